"""Where a designer may put a control point of a cubic spline so that its pieces stay close to elastica."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from batten.curves.cubic_proxy import CubicProxy
from batten.errors import InvalidInputError
from batten.kernels import good_region as kernel
from batten.kernels.quadrature import panel_condition
from batten.solvers.region_polygons import Polygon, inside_polygons, nearest_on_polygons
from batten.solvers.region_search import Problem, RegionSearch
from batten.typing import ArrayLike, BoolArray, FloatArray, IntArray

#: What the database of Fisker2018 §5.2 was made with.
RESIDUAL_BELOW, ANGLE_ERROR_BELOW = 0.21, math.radians(6.0)
#: e_λ is within this of its value.
TOLERANCE = 1e-4


class PieceValues(NamedTuple):
    """The criteria of each affected piece, in order, shape (k,).

    Attributes:
        residual: e_λ. angle_error: radians, the greatest difference of the end tangent angles of the first guess of an
            elastica (Brander2016 §3–4) and of the cubic. curvature: the greatest |κ| of the guess. margin: its stability
            margin with clamped ends. A piece that has no guess has 1e9, 1e9 and 0.
    """

    residual: FloatArray
    angle_error: FloatArray
    curvature: FloatArray
    margin: FloatArray


@dataclass(frozen=True, eq=False)
class GoodRegion:
    """Where control point `index` of `proxy` may be: see `good_region`.

    Attributes:
        proxy, index: what it belongs to.
        polygons: each with an outer ring, counter-clockwise, and holes, clockwise; rings are (k, 2), not repeated at the
            end, the good side on the left. The one that holds the present place comes first, then by falling area.
        intervals: (k, 2, 2), the end points of good stretches where the borders leave one direction; else (0, 2, 2).
        bounded: False where the region was cut off by the greatest window that was looked at, or by the one given.
        window: (least x, least y, most x, most y) of what was looked at.
        active_is_good: whether the present place meets all limits.
        values: the criteria at the present place.
        problem: what the kernels know of the spline and the limits.

    Example:
        >>> region = good_region(CubicProxy.line((0, 0), (9, 0), pieces=3), 3)
        >>> isinstance(region, GoodRegion), region.width < region.area
        (True, True)
        >>> bool(region.is_good(region.clamp((4.0, 9.0))))
        True
    """

    proxy: CubicProxy
    index: int
    polygons: tuple[Polygon, ...]
    intervals: FloatArray
    bounded: bool
    window: tuple[float, float, float, float]
    active_is_good: bool
    values: PieceValues
    problem: Problem

    @property
    def area(self) -> float:
        """The area of the polygons less that of their holes."""
        return float(sum(polygon.area for polygon in self.polygons))

    @property
    def width(self) -> float:
        """The least width of the first polygon, or the length of the longest interval; 0 if there is nothing."""
        if self.polygons:
            return self.polygons[0].width
        return float(np.linalg.norm(np.diff(self.intervals, axis=1), axis=-1).max()) if len(self.intervals) else 0.0

    def contains(self, points: ArrayLike) -> BoolArray:
        """Whether points (…, 2) lie in the polygons, or within 1e-9 × their length of the intervals; shape (…).

        Right but for a strip of `resolution` × the width along the border, see `good_region`; `is_good` asks the criterion
        itself.
        """
        p = _points(points)
        if self.polygons or not len(self.intervals):
            return inside_polygons(self.polygons, p)
        a, b = self.intervals[:, 0], self.intervals[:, 1]
        d = b - a
        size = np.einsum("ij,ij->i", d, d)
        t = np.clip(np.einsum("...ij,ij->...i", p[..., None, :] - a, d) / np.maximum(size, 1e-300), 0.0, 1.0)
        off = np.linalg.norm(p[..., None, :] - a - t[..., None] * d, axis=-1)
        reach = 1e-9 * (np.sqrt(size) + np.abs(a).max())
        return np.asarray((off <= reach).any(axis=-1))

    def is_good(self, points: ArrayLike) -> BoolArray:
        """Whether the limits are met with the control point at each of `points` (…, 2), exactly; shape (…).

        Points that the borders do not allow are taken for the nearest ones that they do.
        """
        p = _points(points)
        places = np.ascontiguousarray((p - self.proxy.control_points[self.index]).reshape(-1, 2))
        out = np.empty(len(places))
        kernel.violation_batch(places, self.problem, out)
        return (out < 0.0).reshape(p.shape[:-1])

    def clamp(self, point: ArrayLike, start: ArrayLike | None = None) -> FloatArray:
        """The place nearest to `point` that is in the region, shape (2,).

        Parameters:
            point: shape (2,). Good places come back as they are.
            start: a place whose component is to be kept to (the nearest one, if it is in none); None for any component.

        Returns:
            A place where the limits are met: the border's chords are left inwards, by a few hundredths of the width at
            most, until they are.

        Raises:
            InvalidInputError: the region is empty.
        """
        p = _points(point)
        if p.shape != (2,):
            raise InvalidInputError(f"one point has shape (2,); got shape {p.shape}")
        if self.polygons:
            chosen = self.polygons
            if start is not None:
                _, _, number = nearest_on_polygons(self.polygons, _points(start))
                chosen = (self.polygons[number],)
            if inside_polygons(chosen, p) and self.is_good(p):
                return p
            place, inward, number = nearest_on_polygons(chosen, p, border=True)
            for step in (0.0, *(chosen[number].width * 0.001 * 2.0**k for k in range(7))):
                if self.is_good(place + step * inward):
                    return np.asarray(place + step * inward)
            rings = np.concatenate([chosen[number].outer, *chosen[number].holes])
            rings = rings[self.is_good(rings)]
            return np.asarray(rings[np.argmin(np.linalg.norm(rings - p, axis=-1))])
        if not len(self.intervals):
            raise InvalidInputError("the region is empty: no place of this control point meets the limits; relax them")
        a, d = self.intervals[:, 0], np.diff(self.intervals, axis=1)[:, 0]
        size = np.maximum(np.einsum("ij,ij->i", d, d), 1e-300)

        def on_intervals(q: FloatArray) -> FloatArray:
            return np.asarray(a + np.clip(np.einsum("ij,ij->i", q - a, d) / size, 0.0, 1.0)[:, None] * d)

        feet = on_intervals(p)
        if start is not None:
            origin = _points(start)
            return np.asarray(feet[np.argmin(np.linalg.norm(on_intervals(origin) - origin, axis=-1))])
        return np.asarray(feet[np.argmin(np.linalg.norm(feet - p, axis=-1))])


def good_region(
    proxy: CubicProxy,
    index: int,
    *,
    residual_below: float = RESIDUAL_BELOW,
    angle_error_below: float = ANGLE_ERROR_BELOW,
    curvature_below: float | None = None,
    margin_above: float | None = None,
    simple: bool = False,
    window: Sequence[float] | None = None,
    resolution: float = 0.01,
) -> GoodRegion:
    """The places of one control point at which every piece it affects is close to an elastica: Fisker2018 §5.2, §5.2.1.

    A place is good if each affected piece has e_λ < `residual_below` and its first guess of an elastica (§2.1.1, Brander2016
    §3–4) has end tangents within `angle_error_below` of the cubic's, and meets the further limits. Where the paper looks
    such places up in a database of 385,000 cubics, they are computed here: a scan finds the components, their borders are
    followed on a lattice as fine as the resolution, and the vertices that are needed are sharpened. With borders the
    neighbours follow: see `CubicProxy`.

    Parameters:
        proxy: the spline; it need not be good at present.
        index: the control point, 0 … m − 1.
        residual_below: e_λ, in (0, 1].
        angle_error_below: radians, > 0.
        curvature_below: the greatest |κ| of the rod, 1/unit of the coordinates: of the guessed elastica, the shape that the
            rod takes, not of the cubic.
        margin_above: stability margin of the guessed elastica with clamped ends, see `stability`; 1 is the limit of
            stability. Of each piece for itself.
        simple: whether the whole spline must not cross itself (16 chords on each piece).
        window: (least x, least y, most x, most y) to look at. None: a square about the mean of the other control points that
            the affected pieces depend on, half of its side 1.75 × their greatest distance r from it; what begins there is
            followed up to eight times as far (14 r).
        resolution: greatest distance of the returned border from the true one, over the width (the least one) of the
            component, in [0.002, 0.1].

    Returns:
        A `GoodRegion`. Equivariant under similarities, to the resolution.

    Raises:
        InvalidInputError: a number outside its domain; the other control points all coincide.

    Accuracy: vertices meet the limits, and `resolution`/10 × width further along their lattice lines the limits are broken;
    chords stray by `resolution`/7 × width from the lattice's border, and rings do not cross themselves. The lattice's step
    is 1.1 × `resolution` × width (0.8 × if more than two pieces are affected), so that slits, spikes, bridges and holes
    wider than two steps are followed and thinner ones may be cut short. The angle error jumps where the guess counts its
    runs differently, so there are many thin ones. By brute force on 100 random splines of each continuity: 0.4 % of a
    region's area is wrong (median; 95 % of the regions below 0.8 %, all below 1.3 %), and 99 % of all polygons, down to the
    smallest, have their whole border within 1 % of the region's width. e_λ is within 1e-4.
    Components and holes that hold no node of the scan, of step 0.08 r (0.055 r), or 1/44 (1/64) of the window's longer
    side, are found only if they hold the present place or lie about a minimum of the violation that the scan shows; what is
    narrower than r/1000, or hangs by a thinner thread on a larger component, is left out.

    Degenerate cases: a straight line is good, with e_λ = 0; places where a piece has a cusp or is a single point are not.
    With one direction left by the borders the region is `intervals`; with none, the present place if it is good.

    Example:
        >>> proxy = CubicProxy.line((0, 0), (9, 0), pieces=3)
        >>> region = good_region(proxy, 3)
        >>> region.active_is_good, region.bounded, len(region.polygons)
        (True, True, 1)
        >>> region.contains([(4.0, 0.3), (4.0, 9.0)]).tolist()
        [True, False]
    """
    limits = _limits(residual_below, angle_error_below, curvature_below, margin_above, simple)
    if not 0.002 <= resolution <= 0.1:
        raise InvalidInputError(f"the resolution is a part of the region's width in [0.002, 0.1]; got {resolution}")
    freedom = proxy.freedom(index)
    active = proxy.control_points[index]
    moved = freedom.response if freedom.response.any() else _alone(proxy, index)
    affected = _affected(proxy, moved)
    neighbours = _neighbours(proxy, affected, moved)
    centre = neighbours.mean(axis=0)
    size = float(np.linalg.norm(neighbours - centre, axis=-1).max())
    if not size > 0.0:
        raise InvalidInputError(
            f"the other control points of the pieces that control point {index} affects all lie at {centre.tolist()}; "
            "there is no shape to go by: move one of them away first"
        )
    box = np.array([-np.inf, -np.inf, np.inf, np.inf])
    if window is not None:
        box = _window(window) - np.tile(active, 2)
    base = np.ascontiguousarray(proxy.pieces[affected])
    response = np.ascontiguousarray(np.einsum("ijm,mkl->ijkl", proxy.bezier_matrix[affected], freedom.response))
    fixed = np.ascontiguousarray(_chords(proxy.pieces))
    problem: Problem = (base, response, affected, fixed, box, limits)
    values = np.empty((len(base), 4))
    kernel.values_batch(base, limits, values)
    at_active = np.empty(1)
    kernel.violation_batch(np.zeros((1, 2)), problem, at_active)
    is_good = bool(at_active[0] < 0.0)
    search = RegionSearch(
        problem, centre - active, size, _direction(neighbours), is_good, resolution, window is not None
    )
    polygons: tuple[Polygon, ...] = ()
    intervals = np.zeros((0, 2, 2))
    if len(freedom.directions) == 2:
        polygons = tuple(polygon.shifted(active) for polygon in search.polygons())
    elif len(freedom.directions) == 1:
        intervals = search.intervals(freedom.directions[0]) + active
    elif is_good:
        intervals = np.tile(active, (1, 2, 1))
    left, low, right, high = (np.array(search.seen) + np.tile(active, 2)).tolist()
    return GoodRegion(
        proxy, int(index), polygons, intervals, search.bounded, (left, low, right, high), is_good,
        PieceValues(*values.T), problem,
    )  # fmt: skip


def _chords(pieces: FloatArray) -> FloatArray:
    """Points of the cubics (n, 4, 2) at equal steps of the parameter, shape (n, CHORDS + 1, 2)."""
    t = np.linspace(0.0, 1.0, kernel.CHORDS + 1)
    u = 1.0 - t
    return np.stack([u**3, 3.0 * t * u**2, 3.0 * t**2 * u, t**3], axis=-1) @ pieces


def _points(points: ArrayLike) -> FloatArray:
    p = np.asarray(points, dtype=np.float64)
    if p.ndim == 0 or p.shape[-1] != 2:
        raise InvalidInputError(f"points of the plane have shape (…, 2); got shape {p.shape}")
    return p


def _limits(residual: float, angle: float, curvature: float | None, margin: float | None, simple: bool) -> FloatArray:
    """The limits in the order of the kernel's columns."""
    if not 0.0 < residual <= 1.0:
        raise InvalidInputError(f"the λ-residual is limited by a number in (0, 1]; got {residual}")
    if not 0.0 < angle < np.inf:
        raise InvalidInputError(f"the angle error is limited by a positive number of radians; got {angle}")
    for name, value in (("curvature_below", curvature), ("margin_above", margin)):
        if value is not None and not 0.0 < value < np.inf:
            raise InvalidInputError(f"{name} is a positive number or None; got {value}")
    most = np.inf if curvature is None else curvature
    return np.array([residual, angle, most, margin or 0.0, float(simple), panel_condition(TOLERANCE)])


def _window(window: Sequence[float]) -> FloatArray:
    box = np.asarray(window, dtype=np.float64)
    if box.shape != (4,) or not np.isfinite(box).all() or not (box[0] < box[2] and box[1] < box[3]):
        raise InvalidInputError(
            f"a window is (least x, least y, most x, most y), finite, with a positive area; got {box.tolist()}"
        )
    return box


def _alone(proxy: CubicProxy, index: int) -> FloatArray:
    """The response of a control point that moves without others."""
    response = np.zeros((len(proxy.control_points), 2, 2))
    response[index] = np.eye(2)
    return response


def _affected(proxy: CubicProxy, response: FloatArray) -> IntArray:
    """Pieces that move with the active point or with those that follow it."""
    moving = response.any(axis=(1, 2))
    return np.flatnonzero(proxy.bezier_matrix[:, :, moving].any(axis=(1, 2))).astype(np.int64)


def _neighbours(proxy: CubicProxy, affected: IntArray, response: FloatArray) -> FloatArray:
    """The control points that the affected pieces depend on and that stay where they are."""
    seen = proxy.bezier_matrix[affected].any(axis=(0, 1))
    staying = seen & ~response.any(axis=(1, 2))
    return proxy.control_points[staying if staying.any() else seen]


def _direction(points: FloatArray) -> FloatArray:
    """A unit vector that turns with the points: from the first to the last, or to the farthest of the first."""
    chord = points[-1] - points[0]
    if not chord.any():
        off = points - points[0]
        chord = off[np.argmax(np.linalg.norm(off, axis=-1))]
    return np.asarray(chord / np.linalg.norm(chord))
