"""The study of the feedback projection: 100,000 random Béziers, Fisker2018 Table 4.1 and Brander2018 §6."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from batten.measures.lambda_residual import lambda_residual
from batten.solvers.bezier_criteria import ANGLE_LIMITS, RELAXED_ANGLE_LIMITS, WIDE_ANGLE_LIMITS, bezier_criteria
from batten.solvers.bezier_projection import project_bezier
from batten.studies.study import Columns, Outcome, Study
from batten.typing import BoolArray, FloatArray

DEFAULT_SIZE = 100_000

LIMITS = (ANGLE_LIMITS, RELAXED_ANGLE_LIMITS, WIDE_ANGLE_LIMITS)
ROWS = ("π/3, 0.4π", "π/4, 0.6π", "π/6, 0.75π", "outside π/3, 0.4π")
"""Angle constraints 1 and 2 of each row; the last are the curves that break the first pair, projected all the same."""

PAPER = ((0.048, 0.042, 0.15, 0.22, 0.26), (0.06, 0.043, None, None, 0.42), (0.1, 0.06, None, None, 0.71),
         (0.4, 0.3, None, None, 1.0))  # fmt: skip
"""Fisker2018 Table 4.1, Brander2018 §6: mean, median, 99 %, 99.99 %, maximum."""


@dataclass(frozen=True, eq=False)
class ProjectionPart:
    """Some curves of the study: control points (n, 4, 2), λ-residual as drawn (n,), after the projection (n, 4) in the order

    of `ROWS`, NaN where a curve does not belong to a row.
    """

    control_points: FloatArray
    before: FloatArray
    after: FloatArray

    @property
    def inside(self) -> BoolArray:
        """(n, 4), which curves belong to which row."""
        return ~np.isnan(self.after)


def random_beziers(count: int, seed: int, part: int) -> FloatArray:
    """Cubics with control points uniform in the unit disc (Brander2018 §6), (count, 4, 2), for one part of a seed."""
    rng = np.random.default_rng([seed, part])
    radius, angle = np.sqrt(rng.random((count, 4))), 2.0 * np.pi * rng.random((count, 4))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def run_part(seed: int, part: int, count: int) -> ProjectionPart:
    """One part of the study."""
    control = random_beziers(count, seed, part)
    after = np.full((count, len(ROWS)), np.nan)
    for j, limits in enumerate(LIMITS):
        criteria = bezier_criteria(control, angle_limits=limits)
        members = criteria.angles_1 & criteria.angles_2
        after[members, j] = project_bezier(control[members], angle_limits=limits).residual_after
    others = np.isnan(after[:, 0])
    after[others, 3] = project_bezier(control[others], angle_limits=None).residual_after
    return ProjectionPart(control, lambda_residual(control), after)


def statistics(results: ProjectionPart) -> FloatArray:
    """Mean, median, 99 %, 99.99 % and maximum of the λ-residual after the projection, for each of `ROWS`: (4, 5)."""
    out = np.full((len(ROWS), 5), np.nan)
    for j in range(len(ROWS)):
        values = results.after[results.inside[:, j], j]
        if values.size:
            out[j] = [values.mean(), *np.quantile(values, [0.5, 0.99, 0.9999, 1.0])]
    return out


def lines(outcome: Outcome[ProjectionPart]) -> list[str]:
    """What the study prints: a row for each pair of constraints, the paper's numbers below it."""
    results = outcome.results
    head = f"{'angle constraints':<20}{'curves':>9}{'mean':>9}{'median':>9}{'99 %':>9}{'99.99 %':>9}{'maximum':>9}"
    out = [
        f"{outcome.size:,} Béziers with control points uniform in the unit disc (seed {outcome.seed}), projected",
        "by feedback; λ-residual after it, within angle constraints 1 and 2 (Brander2018 §6, Fisker2018 Table 4.1)",
        "",
        head,
    ]
    shares = results.inside.mean(axis=0)
    for name, share, row, paper in zip(ROWS, shares, statistics(results), PAPER):
        out.append(f"{name:<20}{share:>9.1%}" + "".join(f"{v:>9.3f}" for v in row))
        out.append(f"{'  paper':<29}" + "".join(f"{'' if v is None else v:>9}" for v in paper))
    before = results.before[results.inside[:, 0]]
    if before.size:
        out += ["", f"as drawn, within π/3, 0.4π: mean {before.mean():.3f}, median {np.median(before):.3f}"]
    return out


def columns(part: ProjectionPart) -> Columns:
    """Control points, λ-residual as drawn and after the projection under each pair of constraints."""
    points = {f"p{i}_{axis}": part.control_points[:, i, j] for i in range(4) for j, axis in enumerate("xy")}
    names = ("after", "after_relaxed", "after_wide", "after_outside")
    return {**points, "before": part.before, **{name: part.after[:, j] for j, name in enumerate(names)}}


STUDY = Study("projection", 10_000, ProjectionPart, run_part, lines, columns)
"""The feedback projection of random curves under each pair of angle constraints."""
