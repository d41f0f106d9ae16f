"""The study of Béziers with inner control points in two annuli: Fisker2018 §3.2, Tables 3.1, 3.2, Figs. 3.6, 3.7, 3.15.

The curves are in standard position, p₀ = (0, 0), p₃ = (1, 0); p₁ and p₂ are uniform by area in the annuli of radii 0.25 and
1.5 about p₀ and p₃, p₂ in the upper half of its own: mirror images in the x-axis are the rest. The types tell in which
quadrants the outer edges p₁ − p₀ and p₂ − p₃ lie, inwards being to the right at p₀ and to the left at p₃:

    A1 both inwards, on different sides of the chord      A2 both inwards, on one side
    B1 both outwards, on one side                         B2 one inwards, one outwards, on one side
    C1 one inwards, one outwards, on different sides      C2 both outwards, on different sides

The thesis draws them (Fig. 3.8) and does not say how its points are spread. Both can be read off its counts: 8645 = 91·95,
9310 = 98·95, 19,885 = 98·105 + 101·95 and 10,605 = 101·105 are the types that never meet themselves, B1, C2, C1 and A1. So
its sample is every pair of 400 points p₁ (91 out and up, 98 out and down, 101 in and down, 110 in and up) and 200 points p₂
(95 out, 105 in). That leaves A2 11,550 and B2 20,005, of which 52.3 % and 92.7 % do not meet themselves. Points uniform by
area give 49.5 % and 92.1 %, with standard errors of 3.3 % and 1.2 % for samples made like this; points uniform in the radius
would give 65.8 % and 95.0 %. Here every curve has two points of its own, so that all figures have less sampling error.

The shares of good curves are the paper's within three standard errors of its sample, those of B1 only just. Where a figure
differs by more, the paper's distances are greater, most of all in B1 (39 % beyond 0.02, here 9 %) and in all maxima: it
sends several optimisers off from one initial guess, and stays at local minima. From that guess alone
`fit_elastica_batch(starts=1)` has 4, 33, 24 and 39 % of B1 in the four classes, as the paper has (3, 33, 24, 39 %), and
misses the nearest elastica found here for 23 % of all curves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from batten.measures.lambda_residual import lambda_residual
from batten.solvers.bezier_criteria import bezier_criteria, is_elastica_like
from batten.solvers.curve_samples import CurveSamples, samples_of
from batten.solvers.elastica_fit import Metric, fit_samples
from batten.studies.study import Columns, Outcome, Study
from batten.typing import BoolArray, FloatArray, IntArray

DEFAULT_SIZE = 80_000

RADII = (0.25, 1.5)
"""Of both annuli, in chords."""

TYPES = ("A1", "A2", "B1", "B2", "C1", "C2")

CLASSES = (0.003, 0.01, 0.02)
"""Limits of the classes of L² distance in the tables."""

B1_LARGEST, B1_BETWEEN, B2_FIRST, B2_BETWEEN = "B1: max(α₁, α₂) < π/4", "B1: Θ < π/3", "B2: α₁ < π/3", "B2: Θ < π/4"

PAPER_SIZE = 80_000
PAPER = {
    "A1": ((201, 1988, 3184, 5232), 0.023, 0.098),
    "A2": ((600, 2485, 2453, 505), 0.011, 0.034),
    "B1": ((295, 2887, 2094, 3369), 0.021, 0.08),
    "B2": ((984, 5859, 6379, 5326), 0.016, 0.11),
    "C1": ((15, 952, 4314, 14604), 0.032, 0.11),
    "C2": ((2, 221, 2417, 6670), 0.03, 0.092),
    "all": ((2097, 14392, 20841, 35706), 0.023, 0.11),
    B1_LARGEST: ((295, 1231, 230, 7), 0.0062, 0.037),
    B1_BETWEEN: ((285, 1247, 186, 5), 0.006, 0.023),
    B2_FIRST: ((979, 5634, 5520, 2387), 0.012, 0.059),
    B2_BETWEEN: ((978, 4347, 5019, 4198), 0.016, 0.11),
}
"""Fisker2018 Tables 3.2 and 3.1: curves in each class, mean, maximum."""

PAPER_ERRORS = {
    "A1": (0.014, 0.0045, 0.017, 0.019, 0.032, 0.020, 0.00084),
    "A2": (0.0088, 0.019, 0.027, 0.032, 0.016, 0.041, 0.00059),
    "B1": (0.013, 0.0091, 0.029, 0.023, 0.017, 0.035, 0.00054),
    "B2": (0.012, 0.0070, 0.023, 0.014, 0.028, 0.028, 0.00069),
    "C1": (0.013, 0.00081, 0.0094, 0.019, 0.024, 0.010, 0.00063),
    "C2": (0.013, 0.00034, 0.0059, 0.029, 0.031, 0.0060, 0.00039),
    "all": (0.0099, 0.0027, 0.013, 0.011, 0.019, 0.015, 0.00045),
    B1_LARGEST: (0.0045, 0.027, 0.023, 0.022, 0.0, 0.022, 0.00030),
    B1_BETWEEN: (0.0043, 0.021, 0.021, 0.021, 0.0, 0.021, 0.00026),
    B2_FIRST: (0.013, 0.0084, 0.023, 0.018, 0.016, 0.029, 0.00044),
    B2_BETWEEN: (0.0093, 0.0093, 0.024, 0.016, 0.030, 0.031, 0.00078),
}
"""Standard errors of the paper's share, classes, share of good curves and mean, its sample being all pairs of 400 and 200

points: by the jackknife over 40 groups of either set, on one such sample with distances as here."""

DIFFERS = 3.0
"""Standard errors, ours and the paper's together, beyond which a figure of the paper is marked."""

NOTE = (
    "* more than three standard errors from ours. The paper's distances are greater where they end in local minima: from",
    "  its one initial guess alone ours would be alike.",
)


@dataclass(frozen=True, eq=False)
class AnnulusPart:
    """Some curves of the study, n of them.

    Attributes:
        inner: p₁ and p₂, (n, 2, 2).
        type: index into `TYPES`, (n,).
        simple: whether the control polygon does not meet itself, (n,).
        smallest_angle: φ_min = min(φ₁, φ₂, 2π − φ₁, 2π − φ₂) of §3.2.1, radians, (n,).
        residual: e_λ, (n,).
        l2, h1: least normalised distance to an elastica, in the L² norm (3.2) and in the H¹ norm (3.3), (n,).
        elastica_like: whether all criteria of §3.2.3 hold, (n,).
    """

    inner: FloatArray
    type: IntArray
    simple: BoolArray
    smallest_angle: FloatArray
    residual: FloatArray
    l2: FloatArray
    h1: FloatArray
    elastica_like: BoolArray


def random_inner_points(count: int, seed: int, part: int) -> FloatArray:
    """p₁ and p₂ of one part, (count, 2, 2), uniform by area in the annulus of p₀ and the upper half of that of p₃."""
    u = np.random.default_rng([seed, part]).random((count, 2, 2))
    radius = np.sqrt(RADII[0] ** 2 + u[..., 0] * (RADII[1] ** 2 - RADII[0] ** 2))
    angle = u[..., 1] * np.array([2.0 * np.pi, np.pi])
    points: FloatArray = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    points[:, 1, 0] += 1.0
    return points


def standard_position(inner: FloatArray) -> FloatArray:
    """Control points (…, 4, 2) with ends (0, 0) and (1, 0)."""
    control = np.zeros((*inner.shape[:-2], 4, 2))
    control[..., 1:3, :] = inner
    control[..., 3, 0] = 1.0
    return control


def types_of(inner: FloatArray) -> IntArray:
    """Index into `TYPES` for inner control points (…, 2, 2) in standard position, whichever side p₂ is on."""
    inwards = np.stack([inner[..., 0, 0] > 0.0, inner[..., 1, 0] < 1.0], axis=-1).sum(axis=-1)
    one_side = (inner[..., 0, 1] > 0.0) == (inner[..., 1, 1] > 0.0)
    apart = np.where(inwards == 2, 0, np.where(inwards == 1, 4, 5))  # A1, C1, C2
    return np.where(one_side, np.where(inwards == 2, 1, np.where(inwards == 1, 3, 2)), apart)


def edge_angles(inner: FloatArray) -> FloatArray:
    """Angles in [0, π/2] between the outer edges and the vertical, (…, 2), for p₁ and p₂."""
    edges = np.abs(inner - np.array([[0.0, 0.0], [1.0, 0.0]]))
    return np.arctan2(edges[..., 0], edges[..., 1])


def run_part(seed: int, part: int, count: int) -> AnnulusPart:
    """One part of the study."""
    inner = random_inner_points(count, seed, part)
    control = standard_position(inner)
    criteria = bezier_criteria(control)
    l2, h1 = least_distances(samples_of(control)[0])
    return AnnulusPart(
        inner=inner,
        type=types_of(inner),
        simple=criteria.simple,
        smallest_angle=np.minimum(criteria.phi, 2.0 * np.pi - criteria.phi).min(axis=-1),
        residual=lambda_residual(control),
        l2=l2,
        h1=h1,
        elastica_like=is_elastica_like(control),
    )


def least_distances(samples: CurveSamples) -> tuple[FloatArray, FloatArray]:
    """Normalised L² and H¹ distance to the nearest elastica in each norm, (n,).

    Four starts in each norm, all thirteen where no elastica comes within 4 % of the length; then each norm starts once more
    from what the other found.
    """
    metrics: tuple[Metric, Metric] = ("L2", "H1")
    fits = [fit_samples(samples, metric=metric) for metric in metrics]
    again = [fit_samples(samples, metric=m, starts=1, given=f.parameters) for m, f in zip(metrics, reversed(fits))]
    l2, h1 = (np.fmin(one.distance, other.distance) for one, other in zip(fits, again))
    return l2, h1


def columns(part: AnnulusPart) -> Columns:
    """Inner control points, the type as text, and all numbers of `AnnulusPart`."""
    points = {f"p{i + 1}_{axis}": part.inner[:, i, j] for i in range(2) for j, axis in enumerate("xy")}
    names = ("simple", "smallest_angle", "residual", "l2", "h1", "elastica_like")
    return {**points, "type": np.array(TYPES)[part.type], **{name: getattr(part, name) for name in names}}


class Row(NamedTuple):
    """One row of Table 3.1 or 3.2: number of curves; share of all curves, shares of the four classes, share of good curves,

    mean, (7,), and their standard errors; maximum.
    """

    curves: int
    figures: FloatArray
    errors: FloatArray
    maximum: float


def rows_of_tables(results: AnnulusPart) -> dict[str, Row]:
    """The rows of Tables 3.2 and 3.1 by name, polygons that meet themselves left out; "all" is the last row of Table 3.2.

    Θ is the angle between the end tangents, α₁ + α₂ in type B1, |α₁ − α₂| in B2. In B2 α₁ belongs to the edge that points
    inwards: the thesis only draws it (Fig. 3.9), but α₁ < π/3 then keeps 73 % of the curves with 12 to 16 % of them beyond
    0.02 as in the paper, while the other edge would keep 65 % with 27 % beyond.
    """
    alpha = edge_angles(results.inner)
    inwards_first = results.inner[:, 0, 0] > 0.0
    inner_edge = np.where(inwards_first, alpha[:, 0], alpha[:, 1])
    members = {name: results.type == i for i, name in enumerate(TYPES)}
    b1, b2 = members["B1"], members["B2"]
    members |= {
        "all": np.ones(len(alpha), dtype=bool),
        B1_LARGEST: b1 & (alpha.max(axis=1) < np.pi / 4.0),
        B1_BETWEEN: b1 & (alpha.sum(axis=1) < np.pi / 3.0),
        B2_FIRST: b2 & (inner_edge < np.pi / 3.0),
        B2_BETWEEN: b2 & (np.abs(alpha[:, 0] - alpha[:, 1]) < np.pi / 4.0),
    }
    return {name: _row(results.l2[rows & results.simple], len(alpha)) for name, rows in members.items()}


def _row(distance: FloatArray, size: int) -> Row:
    n = len(distance)
    if n == 0:
        return Row(0, np.array([0.0, *[np.nan] * 6]), np.full(7, np.nan), np.nan)
    classes = np.histogram(distance, [0.0, *CLASSES, np.inf])[0] / n
    shares = np.array([n / size, *classes, classes[:2].sum()])
    of = np.array([size, *[n] * 5])
    likely = (shares * of + 2.0) / (of + 4.0)  # so that a share of nothing is not thought to be exact
    errors = np.sqrt(likely * (1.0 - likely) / (of + 4.0))
    return Row(
        n, np.append(shares, distance.mean()), np.append(errors, distance.std() / np.sqrt(n)), float(distance.max())
    )


def paper_row(name: str) -> Row:
    """The same row as printed in the thesis, with the standard errors of its sample."""
    counts, mean, maximum = PAPER[name]
    n = sum(counts)
    classes = np.array(counts) / n
    figures = np.array([n / PAPER_SIZE, *classes, classes[:2].sum(), mean])
    return Row(n, figures, np.array(PAPER_ERRORS[name]), maximum)


def lines(outcome: Outcome[AnnulusPart]) -> list[str]:
    """What the study prints: Tables 3.2 and 3.1 with the paper's numbers below ours, and what the figures show."""
    results, rows = outcome.results, rows_of_tables(outcome.results)
    words = ("share", "< 0.003", "– 0.01", "– 0.02", "> 0.02", "good", "mean")
    head = f"{'':<22}{'curves':>8}" + "".join(f"{word:>8} " for word in words) + f"{'max':>7}"
    out = [
        f"{outcome.size:,} Béziers with inner control points in two annuli (seed {outcome.seed}): normalised L² distance to",
        "the nearest elastica, polygons that meet themselves left out (Fisker2018 §3.2); good is below 0.01",
    ]
    for title, names in (("Table 3.2", (*TYPES, "all")), ("Table 3.1", (B1_LARGEST, B1_BETWEEN, B2_FIRST, B2_BETWEEN))):
        out += ["", title, head]
        for name in names:
            ours, paper = rows[name], paper_row(name)
            differs = np.abs(ours.figures - paper.figures) > DIFFERS * np.hypot(ours.errors, paper.errors)
            out += [_line(name, ours), _line("  paper", paper, differs)]
    simple = results.simple
    straight, small = simple & (results.smallest_angle > 2.0 * np.pi / 3.0), simple & (results.residual < 0.4)
    like = results.elastica_like
    out += [
        "",
        "Fig. 3.6: " + _within("φ_min > 2π/3", results, straight),
        "Fig. 3.7: " + _within("e_λ < 0.4", results, small),
        "Fig. 3.15: " + _within("e_λ < 0.4", results, small, h1=True),
        "§3.2.3:   " + _within("all criteria hold", results, like),
        "",
        *NOTE,
    ]
    return out


def _line(name: str, row: Row, marks: BoolArray | None = None) -> str:
    marked = ["*" if mark else " " for mark in (np.zeros(7, dtype=bool) if marks is None else marks)]
    texts = [f"{v:.1%}" for v in row.figures[:6]] + [f"{row.figures[6]:.4f}"]
    cells = "".join(f"{'–' if 'nan' in text else text:>8}{mark}" for text, mark in zip(texts, marked))
    return f"{name:<22}{row.curves:>8,}{cells}{f'{row.maximum:.3f}' if row.curves else '–':>7}"


def _within(words: str, results: AnnulusPart, rows: BoolArray, h1: bool = False) -> str:
    """How far from elastica the curves of a condition are."""
    if not rows.any():
        return f"{words}: no curves"
    if h1:
        median, most, last = np.quantile(results.h1[rows], [0.5, 0.99, 1.0])
        return f"{words}: H¹ distance median {median:.3f}, 99 % {most:.3f}, maximum {last:.3f}"
    good, most = (results.l2[rows] < 0.01).mean(), results.l2[rows].max()
    return f"{words}: {rows.mean():.1%} of the curves, {good:.2%} of them good, maximum {most:.4f}"


STUDY = Study("annulus", 500, AnnulusPart, run_part, lines, columns)
"""The sample of the annuli; `studies.study.run` runs it."""
