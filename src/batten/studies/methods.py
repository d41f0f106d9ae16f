"""The study of all projections side by side: how close to elastica, how far moved, how steady (Brander2018 §4–7)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from batten.solvers.bezier_criteria import bezier_criteria
from batten.solvers.bezier_projection import BezierProjection, project_bezier
from batten.solvers.nearest_projection import projection_change
from batten.studies.projection import random_beziers
from batten.studies.study import Columns, Outcome, Study
from batten.typing import FloatArray

DEFAULT_SIZE = 100_000
"""As in Brander2018 §6.1."""

NUDGE, JUMP = 0.001, 0.05
"""How far the eight coordinates are moved together, in a random direction, and a control point of the outcome in a jump."""

_METHODS: dict[str, Callable[[FloatArray], BezierProjection]] = {
    "nearest": lambda curves: project_bezier(curves, "nearest"),
    "nearest, 0.22": lambda curves: project_bezier(curves, "nearest", threshold=0.22),
    "feedback": lambda curves: project_bezier(curves, "feedback"),
    "feedback, 0.22": lambda curves: project_bezier(curves, "feedback", threshold=0.22),
    "zone": lambda curves: project_bezier(curves, "zone"),
    "gradient of e_λ": lambda curves: project_bezier(curves, "gradient", energy="lambda_residual"),
    "gradient of L∫κ²": lambda curves: project_bezier(curves, "gradient", energy="scale_invariant"),
    "gradient of ∫κ²": lambda curves: project_bezier(curves, "gradient", energy="bending"),
}
NAMES = tuple(_METHODS)
"""The methods, with the threshold where there is one."""


@dataclass(frozen=True, eq=False)
class MethodsPart:
    """Curves drawn at random, a row for each, float32; NaN where a curve is outside the angle constraints.

    Attributes:
        before: (n,), e_λ as drawn. after: (n, 8), e_λ after each of `NAMES`.
        movement: (n, 8), mean distance by which the four control points moved, the disc's radius being 1.
        answer: (n, 8), greatest distance by which a control point of the outcome moves when the curve is nudged.
    """

    before: NDArray[np.float32]
    after: NDArray[np.float32]
    movement: NDArray[np.float32]
    answer: NDArray[np.float32]


def run_part(seed: int, part: int, count: int) -> MethodsPart:
    """One part of the study."""
    curves = random_beziers(count, seed, part)
    nudges = np.random.default_rng([seed, part, 1]).normal(size=curves.shape)
    nudges *= NUDGE / np.sqrt((nudges**2).sum(axis=(1, 2), keepdims=True))
    inside = [(c.angles_1 & c.angles_2) for c in (bezier_criteria(curves), bezier_criteria(curves + nudges))]
    rows = np.flatnonzero(inside[0] & inside[1])
    before = np.full(count, np.nan, np.float32)
    after, movement, answer = (np.full((count, len(NAMES)), np.nan, np.float32) for _ in range(3))
    for j, project in enumerate(_METHODS.values()):
        found, other = project(curves[rows]), project(curves[rows] + nudges[rows])
        before[rows], after[rows, j] = found.residual_before, found.residual_after
        movement[rows, j] = projection_change(curves[rows], found.control_points).movement
        answer[rows, j] = np.linalg.norm(other.control_points - found.control_points, axis=-1).max(axis=-1)
    return MethodsPart(before, after, movement, answer)


def statistics(results: MethodsPart) -> FloatArray:
    """For each of `NAMES`: mean, median, 99 %, maximum of e_λ, share below feedback's (by 1e-6), median and mean movement,

    share of jumps: (8, 8). NaN without a curve inside.
    """
    rows = ~np.isnan(results.before)
    out = np.full((len(NAMES), 8), np.nan)
    if not rows.any():
        return out
    feedback = results.after[rows, NAMES.index("feedback")]
    for j in range(len(NAMES)):
        e, moved = results.after[rows, j].astype(np.float64), results.movement[rows, j].astype(np.float64)
        out[j] = [e.mean(), *np.quantile(e, [0.5, 0.99, 1.0]), np.mean(e < feedback - 1e-6), np.median(moved),
                  moved.mean(), np.mean(results.answer[rows, j] > JUMP)]  # fmt: skip
    return out


def lines(outcome: Outcome[MethodsPart]) -> list[str]:
    """What the study prints."""
    inside = int((~np.isnan(outcome.results.before)).sum())
    out = [
        f"{outcome.size:,} Béziers with control points uniform in the unit disc (seed {outcome.seed}): {inside:,} within",
        "angle constraints 1 and 2 (π/3, 0.4π) by every method, ends and end directions kept (Brander2018 §4–7)",
        "",
        f"{'':<18}{'e_λ mean':>9}{'median':>8}{'99 %':>8}{'maximum':>9}{'< feedback':>12}"
        f"{'moved, median':>15}{'mean':>9}{'jumps':>9}",
    ]
    for name, row in zip(NAMES, statistics(outcome.results)):
        mean, median, most, greatest, lower, half, moved, jumps = row
        out.append(
            f"{name:<18}{mean:>9.4f}{median:>8.4f}{most:>8.3f}{greatest:>9.3f}{lower:>12.1%}"
            f"{half:>15.3f}{moved:>9.3g}{jumps:>9.3%}"
        )
    out += [
        "",
        "moved: mean distance of the four control points from where they were drawn, the disc's radius being 1",
        f"jumps: share of curves of which a control point moves by more than {JUMP} when the drawing is moved by {NUDGE}",
        "the number behind a method is its threshold of e_λ; the others go to the least they find",
    ]
    return out


def columns(results: MethodsPart) -> Columns:
    """Columns of methods.parquet."""
    out: dict[str, NDArray[Any]] = {"before": results.before}
    for j, name in enumerate(NAMES):
        word = (
            name.replace(", ", "_")
            .replace(" of ", "_")
            .replace("∫κ²", "energy")
            .replace("e_λ", "lambda")
            .replace(".", "")
        )
        out |= {f"after_{word}": results.after[:, j], f"moved_{word}": results.movement[:, j],
                f"answer_{word}": results.answer[:, j]}  # fmt: skip
    return out


STUDY = Study("methods", 2_000, MethodsPart, run_part, lines, columns)
