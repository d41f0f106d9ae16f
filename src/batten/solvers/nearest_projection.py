"""The projection "nearest" of cubic Béziers, and how far any projection moved and turned them."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from batten.errors import InvalidInputError
from batten.kernels import nearest_projection as kernel
from batten.kernels.least_residual import least_tables
from batten.kernels.quadrature import panel_condition
from batten.measures.curvature_fit import cubic_array
from batten.typing import ArrayLike, FloatArray, IntArray

_KEEP = {"tangents": kernel.TANGENTS, "points": kernel.POINTS, "nothing": kernel.NOTHING}
#: Errors of e_λ on the grid and elsewhere.
_CONDITIONS = (panel_condition(1e-2), panel_condition(1e-8))
#: Directions in a full turn of the tables where a search for turns begins.
_DIRECTIONS = 48


class ProjectionChange(NamedTuple):
    """What `projection_change` returns, one entry for each curve.

    Attributes:
        movement: (…), mean distance by which the four control points moved, in the unit of the coordinates.
        turns: (…, 2), by which the end tangents turned, radians in [−π, π], counter-clockwise.
        end_movement: (…, 2), distances by which the end points moved over the length of the drawn control polygon.
        change: (…), root of the sum of the squares of `turns` and of `end_movement`.
    """

    movement: FloatArray
    turns: FloatArray
    end_movement: FloatArray
    change: FloatArray


def projection_change(before: ArrayLike, after: ArrayLike) -> ProjectionChange:
    """How far cubic Béziers were moved and turned by a projection, whatever its method; compare Brander2018 §7.

    Parameters:
        before, after: shape (…, 4, 2), of the same shape.

    Returns:
        `ProjectionChange`.

    Raises:
        InvalidInputError: arrays of other or of different shapes.

    Accuracy: to rounding.

    Degenerate cases: a handle of length zero has the direction of the end tangent, towards the next control point that lies
    elsewhere. NaN for single points and for rows with NaN or infinity.

    Example:
        >>> drawn = [(0, 0), (0, 1), (1, 1), (1, 0)]
        >>> found = projection_change(drawn, [(0, 0), (0, 2), (1, 1), (1, 0)])
        >>> float(found.movement), found.turns.tolist(), float(found.change)
        (0.25, [0.0, 0.0], 0.0)
    """
    old, new = cubic_array(before), cubic_array(after)
    if old.shape != new.shape:
        raise InvalidInputError(f"curves before and after have the same shape; got {old.shape} and {new.shape}")
    moved = np.linalg.norm(new - old, axis=-1)
    polygon = np.linalg.norm(np.diff(old, axis=-2), axis=-1).sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        turns = np.stack(
            [_turn(_tangent(old[..., o, :]), _tangent(new[..., o, :])) for o in ([0, 1, 2, 3], [3, 2, 1, 0])], -1
        )
        ends = moved[..., [0, 3]] / polygon[..., None]
    return ProjectionChange(moved.mean(axis=-1), turns, ends, np.sqrt((turns**2 + ends**2).sum(axis=-1)))


def nearest_rows(rows: FloatArray, threshold: float | None, keep: str, out: FloatArray, status: IntArray) -> None:
    """The projection of `project_bezier` with checked arguments: rows (n, 4, 2) to `out` and `status`."""
    turning = keep != "tangents" and threshold is not None
    kernel.nearest_batch(
        rows,
        -1.0 if threshold is None else float(threshold),
        _KEEP[keep],
        _tables() if turning else (np.empty((0, 0, 3)), np.empty((0, 3))),
        _CONDITIONS,
        out,
        status,
    )


@functools.cache
def _tables() -> tuple[FloatArray, FloatArray]:
    table, loops = np.empty((_DIRECTIONS, _DIRECTIONS, 3)), np.empty((_DIRECTIONS, 3))
    least_tables(table, loops, *_CONDITIONS)
    return table, loops


def _tangent(points: FloatArray) -> FloatArray:
    """Vectors from the first point to the next one that lies elsewhere; NaN where there is none."""
    vectors = points[..., 1:, :] - points[..., :1, :]
    elsewhere = (vectors != 0.0).any(axis=-1)
    first = np.take_along_axis(vectors, elsewhere.argmax(axis=-1)[..., None, None], axis=-2)[..., 0, :]
    return np.where(elsewhere.any(axis=-1)[..., None], first, np.nan)


def _turn(old: FloatArray, new: FloatArray) -> FloatArray:
    cross = old[..., 0] * new[..., 1] - old[..., 1] * new[..., 0]
    return np.asarray(np.arctan2(cross, (old * new).sum(axis=-1)))
