"""The α-shape of points in the plane: the region that a cloud of points fills, as polygons with holes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from batten.errors import InvalidInputError
from batten.solvers.region_polygons import Polygon, inside_polygons, signed_area, winds_about
from batten.typing import ArrayLike, BoolArray, FloatArray, IntArray

#: The default radius is this many times the radius at which nine of ten points belong to the shape.
_OF_LOCAL_SPACING, _SHARE = 2.5, 0.9
#: Triangles and rings of less than this share of the squared extent of the points are rounding.
_FLAT = 1e-13


@dataclass(frozen=True, eq=False)
class AlphaShape:
    """What `alpha_shape` returns.

    Attributes:
        rings: simple polygons of shape (k, 2), the first point not repeated: outer ones counter-clockwise, holes clockwise;
            the largest first, the largest hole last. They may share single points, but no edges, and do not cross.
        radius: the greatest circumradius of a triangle, 1/α of Edelsbrunner 1983.
        area: of the polygons less the holes.
    """

    rings: tuple[FloatArray, ...]
    radius: float
    area: float

    @cached_property
    def polygons(self) -> tuple[Polygon, ...]:
        """The same as polygons with their holes, the largest outer ring first."""
        return polygons_of(self.rings)

    def contains(self, points: ArrayLike) -> BoolArray:
        """Which points, shape (…, 2), lie inside; on the border either."""
        return inside_polygons(self.polygons, np.asarray(points, dtype=np.float64))


def alpha_shape(points: ArrayLike, radius: float | None = None) -> AlphaShape:
    """The α-shape of points in the plane: H. Edelsbrunner et al. 1983, cited by Fisker2018 §5.2.

    The union of the Delaunay triangles whose circumcircle is no larger than `radius` = 1/α. What the shape of the paper has
    besides, single edges and points, bounds no region and is left out.

    Parameters:
        points: shape (n, 2), any order; points may coincide. Rows that are not finite are left out.
        radius: > 0, ∞ gives the convex hull. Holes and gaps in which a disc of this radius has room stay open, narrower
            ones are bridged. None takes it from the points: 2.5 times the radius at which 90 % of them belong to a
            triangle, for a square grid 1.77 times its spacing.

    Returns:
        An `AlphaShape`. The corners of its polygons are given points.

    Raises:
        InvalidInputError: an array of another shape, a radius that is not positive.

    Accuracy: the corners are exact. Among points on one circle, as on a grid, which triangles there are is arbitrary, but
    not their union, as all have the same circumcircle.

    Degenerate cases: no polygon and area 0 where fewer than three points differ or all lie on a line.

    Example:
        >>> import numpy as np
        >>> x, y = np.meshgrid(np.arange(5.0), np.arange(5.0))
        >>> frame = np.stack([x, y], axis=-1)[np.hypot(x - 2, y - 2) > 0.5]  # a grid without its middle
        >>> full, holed = alpha_shape(frame, 1.5), alpha_shape(frame, 0.8)
        >>> full.area, holed.area, [len(ring) for ring in holed.rings]
        (16.0, 14.0, [16, 4])
    """
    from scipy.spatial import Delaunay, QhullError  # takes a while to load

    given = np.asarray(points, dtype=np.float64)
    if given.ndim != 2 or given.shape[1] != 2:
        raise InvalidInputError(f"an alpha shape takes points of shape (n, 2); got shape {given.shape}")
    if radius is not None and not radius > 0.0:
        raise InvalidInputError(
            f"the radius of an alpha shape is positive (∞ for the convex hull) or None; got {radius}"
        )
    places = np.unique(given[np.isfinite(given).all(axis=1)], axis=0)
    nothing = AlphaShape((), float("nan") if radius is None else radius, 0.0)
    if len(places) < 3:
        return nothing
    extent = np.ptp(places, axis=0).max()
    local = (places - places[0]) / extent
    try:
        triangles = Delaunay(local).simplices.astype(np.int64)
    except QhullError:
        return nothing  # all on a line
    triangles, radii = _turned_left(local, triangles)
    if not len(triangles):
        return nothing
    if radius is None:
        first = np.full(len(places), np.inf)
        np.minimum.at(first, triangles.ravel(), np.repeat(radii, 3))
        radius = _OF_LOCAL_SPACING * extent * float(np.quantile(first[np.isfinite(first)], _SHARE))
    kept = triangles[radii <= radius / extent * (1.0 + 1e-9)]
    sized = [(signed_area(local[r]), places[r]) for r in _rings(local, kept)]
    sized = sorted((s for s in sized if abs(s[0]) > _FLAT), key=lambda s: -s[0])
    area = sum(s[0] for s in sized) * float(extent) ** 2
    return AlphaShape(tuple(s[1] for s in sized), float(radius), area)


def polygons_of(rings: Sequence[FloatArray]) -> tuple[Polygon, ...]:
    """Rings as polygons, the largest first: each hole belongs to the smallest outer ring around it."""
    outer = sorted((r for r in rings if signed_area(r) > 0.0), key=signed_area)
    holes: list[list[FloatArray]] = [[] for _ in outer]
    for ring in rings:
        if signed_area(ring) < 0.0:
            middle = 0.5 * (ring[0] + ring[1])
            holes[next(k for k, around in enumerate(outer) if winds_about(around, middle))].append(ring)
    return tuple(Polygon(r, tuple(h)) for r, h in zip(outer, holes))[::-1]


def _turned_left(points: FloatArray, triangles: IntArray) -> tuple[IntArray, FloatArray]:
    """Triangles run through counter-clockwise, flat ones left out, and their circumradii."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    doubled = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    left = np.where(doubled[:, None] > 0.0, triangles, triangles[:, [0, 2, 1]])
    solid = np.abs(doubled) > _FLAT
    sides = np.linalg.norm(b - a, axis=1) * np.linalg.norm(c - b, axis=1) * np.linalg.norm(a - c, axis=1)
    return left[solid], sides[solid] / (2.0 * np.abs(doubled[solid]))


def _rings(points: FloatArray, triangles: IntArray) -> list[IntArray]:
    """The border of a union of triangles, all counter-clockwise: indices of simple polygons, the inside on their left."""
    starts, ends = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    n = np.int64(len(points))
    single = ~np.isin(starts * n + ends, ends * n + starts)
    onward: dict[int, list[int]] = {}
    for a, b in zip(starts[single].tolist(), ends[single].tolist()):
        onward.setdefault(a, []).append(b)
    rings = []
    for first in starts[single].tolist():
        path, place, before = [first], {first: 0}, first
        while onward[path[-1]]:
            at, ways = path[-1], onward[path[-1]]
            after = ways.pop(0 if len(ways) == 1 or before == at else _same_fan(points, before, at, ways))
            before = at
            if after not in place:
                place[after] = len(path)
                path.append(after)
                continue
            loop = path[place[after] :]  # back at a point of the path: a polygon of its own
            rings.append(np.array(loop, dtype=np.int64))
            del path[place[after] + 1 :]
            for passed in loop[1:]:
                del place[passed]
            if after == first:
                break
    return rings


def _same_fan(points: FloatArray, before: int, at: int, ways: list[int]) -> int:
    """Which of several border edges out of a point bounds the fan of triangles to the left of the edge that came in."""
    back = np.arctan2(*(points[before] - points[at])[::-1])
    steps = points[ways] - points[at]
    return int(np.argmin((back - np.arctan2(steps[:, 1], steps[:, 0])) % (2.0 * np.pi)))
