"""Whether a leaf goes on smoothly from one block to the next."""

from __future__ import annotations

import numpy as np

from batten.curves.elastica import states_at
from batten.fabrication.checks.context import CheckContext, worst_of_pairs
from batten.fabrication.plan import CheckResult
from batten.typing import FloatArray, IntArray


def continuity_checks(context: CheckContext) -> tuple[CheckResult, CheckResult]:
    """Jump of position (mm) and of tangent (°) between pieces of one leaf in neighbouring columns (Fisker2018 §5.3).

    The end of a piece is compared with the start of each piece of the same leaf in the next column, in space; each rod
    gets the worse of its two joints. A rod without neighbours gets NaN.

    Accuracy: 1e-10 of the piece's length; the angle to 1e-12 rad.
    """
    pairs = _joints(context)
    p = context.piece_parameters
    states = np.stack([states_at(p, np.zeros(len(p))), states_at(p, p[:, 6])])
    heading = np.stack([np.cos(states[..., 2]), np.sin(states[..., 2])], axis=-1)
    x_axis, y_axis = context.frame[:, 0], context.frame[:, 1]
    places = context.origin + states[..., :1] * x_axis + states[..., 1:2] * y_axis
    tangents = heading[..., :1] * x_axis + heading[..., 1:] * y_axis
    left, right = pairs.T
    step = np.linalg.norm(places[1, left] - places[0, right], axis=-1)
    a, b = tangents[1, left], tangents[0, right]
    turn = np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1)))
    leaves = context.job.leaves

    def result(name: str, title: str, unit: str, limit: float, jumps: FloatArray) -> CheckResult:
        values = worst_of_pairs(len(p), pairs, jumps, least=False)
        return CheckResult(name, title, unit, limit, "max", values, "Worse of the rod's two ends in the block.")

    return (
        result("jump", "Jump of position at block borders", "mm", leaves.max_jump_mm, step),
        result("jump_tangent", "Jump of tangent at block borders", "°", leaves.max_jump_deg, turn),
    )


def _joints(context: CheckContext) -> IntArray:
    """Pairs (k, 2) of rods of one leaf, in a column and the next one; in turned planes they may lie in different rows."""
    at: dict[tuple[int, int], list[int]] = {}
    for i, key in enumerate(zip(context.leaf.tolist(), context.column.tolist())):
        at.setdefault(key, []).append(i)
    pairs = [(i, j) for (leaf, column), left in at.items() for i in left for j in at.get((leaf, column + 1), ())]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)
