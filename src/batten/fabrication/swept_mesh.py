"""The swept face as a mesh of triangles, cut to the plan of a block."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from batten.typing import FloatArray, IntArray

_GRAIN = 1e-9  # corners on the border that are nearer than that are one


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in the wall frame: `points` (n, 3), `signed` (n,) distances from the design, `triangles` (t, 3) indices."""

    points: FloatArray
    signed: FloatArray
    triangles: IntArray


def plan_depth(points: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """How far points (…, 3) lie within a plan rectangle, mm, negative outside, (…)."""
    return np.asarray(np.minimum(points[..., :2] - low, high - points[..., :2]).min(axis=-1))


def mesh_within(
    grid: FloatArray,
    values: FloatArray,
    low: FloatArray,
    high: FloatArray,
    measure: Callable[[FloatArray], FloatArray],
) -> Mesh:
    """Every other row of a grid as a mesh cut to a rectangle of the plan.

    Parameters:
        grid: (a, b, 3), points of successive rods; NaN leaves a hole.
        values: (a, b), their signed distances from the design, NaN where not known.
        low, high: (2,), the rectangle.
        measure: gives signed distances (n,) of points (n, 3) for those that are not known and are needed.
    """
    rows = np.unique(np.append(np.arange(0, len(grid), 2), len(grid) - 1)) if len(grid) else np.zeros(0, dtype=np.int64)
    coarse, known = grid[rows], values[rows]
    a, b = coarse.shape[:2]
    if min(a, b) < 2:
        return Mesh(np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3), dtype=np.int64))
    index = np.arange(a * b).reshape(a, b)
    p, q, r, s = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    triangles = np.stack([np.stack([p, q, r], axis=-1), np.stack([p, r, s], axis=-1)]).reshape(-1, 3)
    points, signed = coarse.reshape(-1, 3), known.ravel().copy()
    within = plan_depth(points, low, high) >= 0.0
    finite = np.asarray(np.isfinite(points).all(axis=1))
    plan = points[triangles][..., :2]
    beside = ((plan < low).all(axis=1) | (plan > high).all(axis=1)).any(axis=1)
    triangles = triangles[~beside & finite[triangles].all(axis=1)]
    missing = np.unique(triangles[np.isnan(signed[triangles])])
    if len(missing):
        signed[missing] = measure(points[missing])
    whole = within[triangles].all(axis=1)
    cut = clipped(np.column_stack([points, signed])[triangles[~whole]], low, high)
    used, kept = np.unique(triangles[whole], return_inverse=True)
    _, first, corners = np.unique(
        np.rint(cut.reshape(-1, 4)[:, :3] / _GRAIN), axis=0, return_index=True, return_inverse=True
    )
    new, corners = cut.reshape(-1, 4)[first], corners.reshape(-1, 3)
    flat = (corners == np.roll(corners, 1, axis=1)).any(axis=1)
    faces = np.concatenate([kept.reshape(-1, 3), corners[~flat] + len(used)])
    needed, faces = np.unique(faces, return_inverse=True)
    return Mesh(
        np.concatenate([points[used], new[:, :3]])[needed],
        np.concatenate([signed[used], new[:, 3]])[needed],
        faces.reshape(-1, 3).astype(np.int64),
    )


def clipped(triangles: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Triangles (n, 3, 4), corners x, y, z and a value, cut to a rectangle of x and y: (k, 3, 4)."""
    for axis in (0, 1):
        for bound, sense in ((low[axis], 1.0), (high[axis], -1.0)):
            depth = sense * (triangles[..., axis] - bound)
            count = (depth >= 0.0).sum(axis=1)
            parts = [triangles[count == 3]]
            for inside in (1, 2):
                some = count == inside
                first = np.argmax((depth[some] >= 0.0) == (inside == 1), axis=1)  # the corner that stands alone
                order = (first[:, None] + np.arange(3)) % 3
                corner = np.take_along_axis(triangles[some], order[..., None], axis=1)
                d = np.take_along_axis(depth[some], order, axis=1)
                ends = [
                    corner[:, 0] + (d[:, 0] / (d[:, 0] - d[:, k]))[:, None] * (corner[:, k] - corner[:, 0])
                    for k in (1, 2)
                ]
                if inside == 1:
                    parts.append(np.stack([corner[:, 0], *ends], axis=1))
                else:
                    parts.append(np.stack([ends[0], corner[:, 1], corner[:, 2]], axis=1))
                    parts.append(np.stack([ends[0], corner[:, 2], ends[1]], axis=1))
            triangles = np.concatenate(parts)
    return triangles
