"""Interpolating splines of every kind, beside one another: Table 4.1 of Levien2009 with numbers in place of plus signs.

Random points, uniform in a square, say which splines exist; designs such as people draw say how good they are.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from batten.errors import NoSolutionError
from batten.splines.interpolating_spline import interpolating_spline
from batten.studies.spline_measures import Fairness, SplineMeasures, designs, fairness, makers, measure
from batten.studies.study import Columns, Outcome, Study
from batten.typing import FloatArray

DEFAULT_SIZE = 100_000

TRIED = ("euler", "log-aesthetic", "kurgla1", "mec")
"""Methods whose existence is not given by their construction."""

_EVERY = 50  # of the sequences all methods but the Euler spiral are tried on: they take longer
_NOT_TRIED = -1
_STATUS = {"converged": 0, "higher winding": 1}
_NONE = 2
_DESIGNS = 60


@dataclass(frozen=True, eq=False)
class SplineSample:
    """One row for each random sequence.

    Attributes:
        points: number of points, 3 to 30. closed: whether the spline was closed.
        status: (n, 4), for each of `TRIED`: 0 a spline, 1 one with a loop, 2 none, −1 not tried.
        residual: (n, 4), greatest jump of curvature over the mean chord; NaN where there is no spline.
    """

    points: NDArray[np.int16]
    closed: NDArray[np.bool_]
    status: NDArray[np.int8]
    residual: NDArray[np.float32]


def random_points(random: np.random.Generator) -> FloatArray:
    """3 to 30 points, uniform in the unit square; shape (n, 2)."""
    return random.uniform(0.0, 1.0, (int(random.integers(3, 31)), 2))


def run_part(seed: int, part: int, count: int) -> SplineSample:
    """Splines through `count` random sequences."""
    random = np.random.default_rng([seed, part])
    points = np.empty(count, dtype=np.int16)
    closed = np.empty(count, dtype=np.bool_)
    status = np.full((count, len(TRIED)), _NOT_TRIED, dtype=np.int8)
    residual = np.full((count, len(TRIED)), np.nan, dtype=np.float32)
    for i in range(count):
        own = random_points(random)
        points[i], closed[i] = len(own), bool(random.integers(2))
        for k, method in enumerate(TRIED):
            if k and i % _EVERY:
                continue
            try:
                spline = interpolating_spline(own, method, closed=bool(closed[i]))  # type: ignore[arg-type]
            except NoSolutionError:
                status[i, k] = _NONE
                continue
            status[i, k], residual[i, k] = _STATUS[spline.status], spline.residual
    return SplineSample(points, closed, status, residual)


@lru_cache(maxsize=2)
def measured(seed: int) -> dict[str, SplineMeasures]:
    """Every kind of spline measured on the same designs: those of 60 on which there is a MEC."""
    every = makers()
    own = []
    for points in designs(_DESIGNS, seed):
        try:
            every["mec"](points, False)
        except NoSolutionError:
            continue
        own.append(points)
    reference: dict[str, list[Fairness]] = {
        name: [fairness(every[name](points, False)) for points in own] for name in ("mec", "euler")
    }
    return {name: measure(name, make, own, reference) for name, make in every.items()}


def lines(outcome: Outcome[SplineSample]) -> list[str]:
    """The tables."""
    result = outcome.results
    out = [
        f"{outcome.size:,} sequences of 3 to 30 random points in a square, open and closed, seed {outcome.seed}",
        "",
        f"{'':16}{'tried':>9}{'a spline':>10}{'with a loop':>13}{'none':>8}{'greatest residual':>19}",
    ]
    for k, method in enumerate(TRIED):
        tried = result.status[:, k] != _NOT_TRIED
        shares = [f"{100.0 * np.mean(result.status[tried, k] == v):.1f}%" for v in (0, 1, 2)]
        worst = np.nanmax(result.residual[:, k], initial=0.0)
        out.append(f"{method:16}{tried.sum():9,}{shares[0]:>10}{shares[1]:>13}{shares[2]:>8}{worst:19.1e}")
    out += ["", f"Designs of 10 points that turn by up to 55° ({_DESIGNS} drawn, those with a MEC kept)", ""]
    head = [
        "",
        "Gⁿ",
        "round, 8",
        "order",
        "extens.",
        "local",
        "monotone",
        "∫κ²",
        "∫κ′²",
        "max |κ′|",
        "similar",
        "mirror",
    ]
    widths = [16, 4, 10, 7, 10, 7, 10, 8, 8, 10, 10, 9, 10]
    out.append("".join(f"{h:>{w}}" if i else f"{h:{w}}" for i, (h, w) in enumerate(zip([*head, "reverse"], widths))))
    for name, m in measured(outcome.seed).items():
        arcs = m.variation < 1e-12  # κ′ is 0 but at jumps
        cells = [
            name,
            str(m.continuity),
            "exact" if m.roundness == 0.0 else f"{m.roundness:.1e}",
            "" if m.roundness == 0.0 else f"{m.roundness_order:.2f}",
            f"{m.extensionality:.0e}",
            f"{m.locality:.3f}",
            f"{100.0 * m.monotone:.0f}%",
            f"{m.energy:.3f}",
            "jumps" if arcs else f"{m.variation:.3f}",
            "jumps" if arcs else f"{m.steepest:.3f}",
            *(f"{v:.0e}" for v in m.invariance),
        ]
        out.append("".join(f"{c:>{w}}" if i else f"{c:{w}}" for i, (c, w) in enumerate(zip(cells, widths))))
    out += [
        "",
        "Gⁿ: order of continuity up to 3. round, 8: radius error through 8 points of a circle, order: of its fall with n.",
        "extens.: movement, in chords, when a point of the curve is added. local: angle from point to point, far from",
        "a moved one. ∫κ² over the MEC's, ∫κ′² and max |κ′| over the Euler spiral's, medians. similar, mirror, reverse:",
        "movement, in chords, under a similarity, in a mirror, with the points in reverse order.",
    ]
    return out


def columns(part: SplineSample) -> Columns:
    """Columns of splines.parquet."""
    out: Columns = {"points": part.points, "closed": part.closed}
    for k, method in enumerate(TRIED):
        out[f"status_{method.replace('-', '_')}"] = part.status[:, k]
        out[f"residual_{method.replace('-', '_')}"] = part.residual[:, k]
    return out


STUDY = Study("splines", 2000, SplineSample, run_part, lines, columns)
