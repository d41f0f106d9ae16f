"""How far points, and the strip that successive blades cut, lie from the wanted surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from batten.errors import InvalidInputError
from batten.surfaces.bspline_surface import BSplineSurface
from batten.typing import ArrayLike, FloatArray


@dataclass(frozen=True, eq=False)
class Deviation:
    """Distances of points from a surface.

    Attributes:
        signed: shape (…), positive on the side of S_u × S_v; NaN for points that are not finite.
        u: parameter of the nearest surface point, shape (…).
        v: its other parameter, shape (…).
    """

    signed: FloatArray
    u: FloatArray
    v: FloatArray

    @property
    def max(self) -> float:
        """The greatest distance; NaN if there is no finite one."""
        return float(np.nanmax(np.abs(self.signed))) if np.isfinite(self.signed).any() else float("nan")

    @property
    def mean(self) -> float:
        """The mean distance; NaN if there is no finite one."""
        return float(np.nanmean(np.abs(self.signed))) if np.isfinite(self.signed).any() else float("nan")


@dataclass(frozen=True, eq=False)
class StripDeviation:
    """How far a cut strip and the wanted surface lie apart.

    Attributes:
        max: greatest distance of the strip from the surface.
        mean: mean distance of the strip's samples from the surface.
        hausdorff: greatest distance of any sample of one from the other: not less than `max`.
    """

    max: float
    mean: float
    hausdorff: float


def surface_deviation(surface: BSplineSurface, points: ArrayLike, *, extend: float = 0.0) -> Deviation:
    """Signed distances of points from a surface.

    Parameters:
        surface: the wanted surface.
        points: shape (…, 3), in its unit.
        extend: how far to continue it beyond its domain (see `BSplineSurface`); without, points beyond the border are
            measured from the border.

    Returns:
        Distances and feet, arrays of shape (…).

    Raises:
        InvalidInputError: points that are not (…, 3).

    Accuracy: that of `closest_parameters`; the distance itself is right to about 1e-12 of the surface's size.

    Example:
        >>> flat = BSplineSurface([0, 0, 2, 2], [0, 0, 1, 1], 1, 1, [[(0, 0, 0), (0, 3, 0)], [(4, 0, 0), (4, 3, 0)]])
        >>> d = surface_deviation(flat, [[1.0, 1.0, 0.5], [2.0, 1.0, -0.25]])
        >>> d.signed.round(12).tolist(), round(d.max, 12), round(d.mean, 12)
        ([0.5, -0.25], 0.5, 0.375)
    """
    p = np.asarray(points, dtype=np.float64)
    u, v = surface.closest_parameters(p, extend=extend)
    d = surface.derivatives(u, v, 1, extend=extend)
    away = p - d[0, 0]
    side = np.sign((away * np.cross(d[1, 0], d[0, 1])).sum(axis=-1))
    return Deviation(np.where(side < 0.0, -1.0, 1.0) * np.linalg.norm(away, axis=-1), u, v)


def strip_deviation(
    surface: BSplineSurface, strip: ArrayLike, *, refine: int = 2, extend: float = 0.0
) -> StripDeviation:
    """Maximum, mean and Hausdorff distance between the strip that successive blades cut and the wanted surface.

    The strip is bilinear between neighbouring points of the grid. From it to the surface, its points and `refine` − 1 more
    between each two are measured. The other way, the piece of the surface that the strip stands for, between the feet of
    the grid's points, is sampled as densely and measured against the strip's triangles.

    Parameters:
        surface: the wanted surface.
        strip: shape (a, b, 3), a ≥ 2 successive blades of b ≥ 2 points each, left to right, in the surface's unit.
        refine: samples to every interval of the grid, each way, 1 or more.
        extend: how far to continue the surface beyond its domain (see `BSplineSurface`).

    Returns:
        The three distances; NaN if a point of the strip is not finite.

    Raises:
        InvalidInputError: another shape; `refine` below 1.

    Accuracy: between samples a distance d(x) is missed by at most h²/8 · max|d″|, h being the samples' spacing.
    """
    grid = np.asarray(strip, dtype=np.float64)
    if grid.ndim != 3 or grid.shape[2] != 3 or min(grid.shape[:2]) < 2 or refine < 1:
        raise InvalidInputError(
            f"strip of shape {grid.shape}, refine = {refine}; allowed are (a, b, 3), a, b ≥ 2, refine ≥ 1"
        )
    if not np.isfinite(grid).all():
        return StripDeviation(float("nan"), float("nan"), float("nan"))
    fine = _refined(grid, refine)
    forward = surface_deviation(surface, fine, extend=extend)
    feet = _refined(np.stack([forward.u[::refine, ::refine], forward.v[::refine, ::refine]], axis=-1), refine)
    wanted = surface.point(feet[..., 0], feet[..., 1], extend=extend).reshape(-1, 3)
    back = _distance_to_grid(wanted, fine)
    return StripDeviation(forward.max, forward.mean, max(forward.max, float(back.max())))


def _refined(grid: FloatArray, refine: int) -> FloatArray:
    """A grid (a, b, d) with `refine` − 1 more points between each two, bilinear."""
    for axis in (0, 1):
        old = np.arange(grid.shape[axis] - 1)
        share = np.arange(refine) / refine
        low, high = np.take(grid, old, axis=axis), np.take(grid, old + 1, axis=axis)
        mixed = np.stack([low + s * (high - low) for s in share], axis=axis + 1)
        shape = list(grid.shape)
        shape[axis] = len(old) * refine
        grid = np.concatenate([mixed.reshape(shape), np.take(grid, [-1], axis=axis)], axis=axis)
    return grid


def _distance_to_grid(points: FloatArray, grid: FloatArray) -> FloatArray:
    """Distance of points (N, 3) from the triangles around the nearest grid point and its neighbours in (a, b, 3)."""
    a, b = grid.shape[:2]
    middles = 0.25 * (grid[:-1, :-1] + grid[1:, :-1] + grid[:-1, 1:] + grid[1:, 1:])
    cells = np.asarray(cKDTree(middles.reshape(-1, 3)).query(points)[1], dtype=np.int64)
    row, column = np.divmod(cells, b - 1)
    best = np.full(len(points), np.inf)
    for di in (-1, 0, 1):
        for dj in (-1, 0, 1):
            i, j = np.clip(row + di, 0, a - 2), np.clip(column + dj, 0, b - 2)
            p, q, r, s = grid[i, j], grid[i + 1, j], grid[i + 1, j + 1], grid[i, j + 1]
            best = np.minimum(
                best, np.minimum(_distance_to_triangle(points, p, q, r), _distance_to_triangle(points, p, r, s))
            )
    return best


def _distance_to_triangle(points: FloatArray, p: FloatArray, q: FloatArray, r: FloatArray) -> FloatArray:
    """Distances of points from triangles p q r, row by row, all of shape (N, 3)."""
    distance = np.minimum(
        np.minimum(_distance_to_segment(points, p, q), _distance_to_segment(points, q, r)),
        _distance_to_segment(points, r, p),
    )
    e, f, w = q - p, r - p, points - p
    normal = np.cross(e, f)
    area = (normal * normal).sum(axis=1)
    safe = np.where(area > 0.0, area, np.nan)
    s = (np.cross(w, f) * normal).sum(axis=1) / safe
    t = (np.cross(e, w) * normal).sum(axis=1) / safe
    height = np.abs((w * normal).sum(axis=1)) / np.sqrt(safe)
    return np.where((s >= 0.0) & (t >= 0.0) & (s + t <= 1.0), height, distance)


def _distance_to_segment(points: FloatArray, p: FloatArray, q: FloatArray) -> FloatArray:
    e, w = q - p, points - p
    length = (e * e).sum(axis=1)
    share = np.clip((w * e).sum(axis=1) / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
    return np.asarray(np.linalg.norm(w - share[:, None] * e, axis=1))
