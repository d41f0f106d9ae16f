"""Where on a surface: the nearest point, and where a line of given direction meets it, for many points at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from batten.errors import InvalidInputError
from batten.surfaces.bspline_surface import BSplineSurface, perpendicular_frame, unit_vector
from batten.typing import ArrayLike, BoolArray, FloatArray, IntArray

_EVALUATIONS = 60
_LEAST_SHRINK = 2.0**-8


def parameters_along(
    surface: BSplineSurface, points: ArrayLike, direction: ArrayLike, *, extend: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Parameters (u, v) where the lines through `points` along `direction` meet the surface.

    Damped Newton on the two coordinates across the lines, from near the nearest of the surface's `samples`.

    Parameters:
        surface: where several of its points lie on one line, one of them is found, as a rule on the sheet of the
            nearest sample; `surface.is_graph_along(direction)` says that there is only one.
        points: shape (…, 3), in the unit of the surface.
        direction: shape (3,), not zero; the same for all lines.
        extend: how far beyond the domain to look (see `BSplineSurface`).

    Returns:
        u and v, shape (…); NaN for a line that misses the surface and for points that are not finite.

    Raises:
        InvalidInputError: points that are not (…, 3), a direction that is zero, a negative `extend`.

    Accuracy: the surface point lies within 1e-13 × size of the line, size being the greatest coordinate of the control
    points and of the point.

    Example:
        >>> flat = BSplineSurface([0, 0, 2, 2], [0, 0, 1, 1], 1, 1, [[(0, 0, 0), (0, 3, 0)], [(4, 0, 0), (4, 3, 8)]])
        >>> u, v = parameters_along(flat, [[1.0, 1.5, 99.0], [7.0, 1.5, 0.0]], (0, 0, 1))
        >>> u.tolist(), v.tolist()
        ([0.5, nan], [0.5, nan])
    """
    frame = perpendicular_frame(unit_vector(direction))
    wanted, shape = _rows(points)
    wanted = wanted @ frame.T
    size = np.maximum(np.abs(surface.control_points).max(), np.abs(wanted).max(axis=1, initial=0.0))

    def evaluate(rows: IntArray, at: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
        d = surface.derivatives(at[:, 0], at[:, 1], 1, extend=np.inf) @ frame.T
        miss = wanted[rows] - d[0, 0]
        gap = np.hypot(miss[:, 0], miss[:, 1])
        return gap, _solve(d[1, 0], d[0, 1], miss), gap <= 1e-14 * size[rows]

    # On the way the search may leave the region where the end is wanted.
    low, high = _bounds(surface, extend + 0.5)
    at, gap = _newton(_starts(surface, frame, wanted), low, high, evaluate)
    low, high = _bounds(surface, extend + 1e-12)
    with np.errstate(invalid="ignore"):
        at[~((gap <= 1e-13 * size) & (at >= low).all(axis=1) & (at <= high).all(axis=1))] = np.nan
    return at[:, 0].reshape(shape), at[:, 1].reshape(shape)


def closest_parameters(
    surface: BSplineSurface, points: ArrayLike, *, extend: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Parameters (u, v) of the surface points nearest to `points`.

    Minimises |S(u, v) − P|² over the domain by damped Newton from near the nearest of the surface's `samples`; on the border
    only the parameter that can still move does.

    Parameters:
        surface: the surface.
        points: shape (…, 3), in the unit of the surface.
        extend: how far beyond the domain to look (see `BSplineSurface`).

    Returns:
        u and v, shape (…); NaN for points that are not finite.

    Raises:
        InvalidInputError: points that are not (…, 3), a negative `extend`.

    Accuracy: a local minimum, to about 1e-8 of the domain's width or better, and the distance to it to about 1e-12 of the
    surface's size. It is the least one where the point is nearer to the surface than to its centres of curvature and
    the samples are closer together than the surface's waves.

    Example:
        >>> flat = BSplineSurface([0, 0, 2, 2], [0, 0, 1, 1], 1, 1, [[(0, 0, 0), (0, 3, 0)], [(4, 0, 0), (4, 3, 0)]])
        >>> u, v = closest_parameters(flat, [[1.0, 1.5, 7.0], [9.0, 1.5, 0.0]])
        >>> u.round(12).tolist(), v.round(12).tolist()
        ([0.5, 2.0], [0.5, 0.5])
    """
    wanted, shape = _rows(points)
    low, high = _bounds(surface, extend)
    size = np.maximum(np.abs(surface.control_points).max(), np.abs(wanted).max(axis=1, initial=0.0))

    def evaluate(rows: IntArray, at: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
        d = surface.derivatives(at[:, 0], at[:, 1], 2, extend=np.inf)
        miss = d[0, 0] - wanted[rows]
        first = np.stack([_dot(miss, d[1, 0]), _dot(miss, d[0, 1])], axis=1)
        metric = np.stack([_dot(d[1, 0], d[1, 0]), _dot(d[1, 0], d[0, 1]), _dot(d[0, 1], d[0, 1])], axis=1)
        second = metric + np.stack([_dot(miss, d[2, 0]), _dot(miss, d[1, 1]), _dot(miss, d[0, 2])], axis=1)
        # Away from a minimum the Hessian may point uphill; Gauss–Newton never does.
        uphill = (second[:, 0] <= 0.0) | (second[:, 0] * second[:, 2] <= second[:, 1] ** 2)
        second[uphill] = metric[uphill]
        blocked = ((at <= low) & (first > 0.0)) | ((at >= high) & (first < 0.0))
        first[blocked] = 0.0
        second[blocked.any(axis=1), 1] = 0.0
        step = -_solve(second[:, :2], second[:, 1:], first)
        length = np.sqrt(metric[:, 0]) * np.abs(step[:, 0]) + np.sqrt(metric[:, 2]) * np.abs(step[:, 1])
        distance = np.sqrt(_dot(miss, miss))
        return distance, step, length <= 1e-8 * size[rows]

    at, _ = _newton(_starts(surface, np.eye(3), wanted), low, high, evaluate)
    return at[:, 0].reshape(shape), at[:, 1].reshape(shape)


def _newton(
    start: FloatArray,
    low: FloatArray,
    high: FloatArray,
    evaluate: Callable[[IntArray, FloatArray], tuple[FloatArray, FloatArray, BoolArray]],
) -> tuple[FloatArray, FloatArray]:
    """Parameters of least merit from `start`, (N, 2), between `low` and `high`, and that merit, (N,).

    `evaluate(rows, at)` gives merit, Newton step and whether to stop, for those rows. A step that does not lower the
    merit is halved until it does; a row whose steps no longer help has arrived at rounding, or at a minimum. The step
    at which a row stops is taken, for Newton doubles the digits.
    """
    best = np.clip(start, low, high)
    merit = np.full(len(start), np.inf)
    step = np.zeros_like(start)
    shrink = np.ones(len(start))
    active: IntArray = np.flatnonzero(np.isfinite(start).all(axis=1))
    trial = best[active]
    for _ in range(_EVALUATIONS):
        value, new_step, stop = evaluate(active, trial)
        better = value < merit[active]
        rows = active[better]
        best[rows], merit[rows], shrink[rows] = trial[better], value[better], 1.0
        step[rows] = np.where(np.isfinite(new_step[better]), new_step[better], 0.0)
        shrink[active[~better]] *= 0.5
        arrived = active[better & stop]
        best[arrived] = np.clip(best[arrived] + step[arrived], low, high)
        active = active[~(better & stop) & (shrink[active] >= _LEAST_SHRINK)]
        if len(active) == 0:
            break
        trial = np.clip(best[active] + shrink[active, None] * step[active], low, high)
    return best, merit


def _starts(surface: BSplineSurface, frame: FloatArray, wanted: FloatArray) -> FloatArray:
    """Parameters (N, 2) near each row of `wanted`, (N, d), in the coordinates `frame`, (d, 3); NaN for rows not finite.

    Those of the nearest sample, and a Newton step from there by at most one cell of the grid.
    """
    samples = surface.samples
    start = np.full((len(wanted), 2), np.nan)
    known = np.isfinite(wanted).all(axis=1)
    i, j = samples.nearest(frame, wanted[known])
    miss = wanted[known] - samples.points[i, j] @ frame.T
    du, dv = samples.du[i, j] @ frame.T, samples.dv[i, j] @ frame.T
    across = _dot(du, dv)
    normal = np.stack([_dot(du, du), across], axis=1), np.stack([across, _dot(dv, dv)], axis=1)
    cell = np.array([np.diff(samples.u).max(), np.diff(samples.v).max()])
    step = np.clip(_solve(*normal, np.stack([_dot(du, miss), _dot(dv, miss)], axis=1)), -cell, cell)
    start[known] = np.stack([samples.u[i], samples.v[j]], axis=1) + np.where(np.isfinite(step), step, 0.0)
    return start


def _bounds(surface: BSplineSurface, extend: float) -> tuple[FloatArray, FloatArray]:
    """Least and greatest (u, v), the domain's width × `extend` beyond the domain."""
    if not extend >= 0.0:
        raise InvalidInputError(f"extend = {extend}; allowed are numbers from 0, a fraction of the domain's width")
    low, high = np.array(surface.domain).T
    margin = extend * (high - low)
    return low - margin, high + margin


def _solve(first: FloatArray, second: FloatArray, right: FloatArray) -> FloatArray:
    """x with x₀ first + x₁ second = right, for columns of shape (N, 2); NaN where they are parallel."""
    determinant = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    determinant = np.where(determinant == 0.0, np.nan, determinant)
    x = right[:, 0] * second[:, 1] - right[:, 1] * second[:, 0]
    y = first[:, 0] * right[:, 1] - first[:, 1] * right[:, 0]
    return np.stack([x, y], axis=1) / determinant[:, None]


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("...i,...i", a, b))


def _rows(points: ArrayLike) -> tuple[FloatArray, tuple[int, ...]]:
    """Points as (N, 3), and the shape (…) they came in."""
    p = np.asarray(points, dtype=np.float64)
    if p.ndim < 1 or p.shape[-1] != 3:
        raise InvalidInputError(f"points: got shape {p.shape}; allowed is (…, 3)")
    return p.reshape(-1, 3), p.shape[:-1]
