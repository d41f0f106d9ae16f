"""Polygons with holes: made of closed rings, asked for what they hold and for what is nearest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from batten.typing import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class Polygon:
    """A region of the plane with one outer ring, counter-clockwise, and holes, clockwise; rings (k, 2) without repetition.

    Example:
        >>> square = np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)])
        >>> Polygon(square, ()).area, round(Polygon(square, ()).width, 12)
        (2.0, 1.0)
    """

    outer: FloatArray
    holes: tuple[FloatArray, ...] = ()

    @property
    def area(self) -> float:
        """The area inside the outer ring less that of the holes."""
        return signed_area(self.outer) + sum(signed_area(hole) for hole in self.holes)

    @property
    def width(self) -> float:
        """The least distance of two parallel lines that hold the polygon between them."""
        from scipy.spatial import ConvexHull, QhullError  # takes a while to load

        try:
            hull = self.outer[ConvexHull(self.outer).vertices]
        except QhullError:
            return 0.0
        edges = np.roll(hull, -1, axis=0) - hull
        normals = np.stack([-edges[:, 1], edges[:, 0]], axis=-1) / np.linalg.norm(edges, axis=-1)[:, None]
        return float(np.ptp(normals @ hull.T, axis=1).min())

    def shifted(self, by: FloatArray) -> Polygon:
        """The same polygon elsewhere."""
        return Polygon(self.outer + by, tuple(hole + by for hole in self.holes))


def signed_area(ring: FloatArray) -> float:
    """Positive for a counter-clockwise ring."""
    off = ring - ring[0]
    return 0.5 * float(np.sum(off[:-1, 0] * off[1:, 1] - off[:-1, 1] * off[1:, 0]))


def winds_about(ring: FloatArray, points: FloatArray) -> BoolArray:
    """Whether each of `points` (…, 2) lies inside a ring, by the parity of crossings to its right."""
    a, b = ring, np.roll(ring, -1, axis=0)
    x, y = points[..., 0, None], points[..., 1, None]
    spans = (a[:, 1] > y) != (b[:, 1] > y)
    rise = np.where(a[:, 1] == b[:, 1], 1.0, b[:, 1] - a[:, 1])
    right = x < a[:, 0] + (y - a[:, 1]) * (b[:, 0] - a[:, 0]) / rise
    return np.asarray((spans & right).sum(axis=-1) % 2 == 1)


def inside_polygons(polygons: Sequence[Polygon], points: FloatArray) -> BoolArray:
    """Whether each of `points` (…, 2) lies in one of the polygons."""
    found = np.zeros(points.shape[:-1], bool)
    for polygon in polygons:
        here = winds_about(polygon.outer, points)
        for hole in polygon.holes:
            here = here & ~winds_about(hole, points)
        found = found | here
    return found


def polygons_of_rings(rings: Sequence[FloatArray], seeds: FloatArray) -> tuple[list[Polygon], list[int]]:
    """The polygons that hold one of `seeds` (n, 2), and the numbers of their outer rings."""
    kept = [(k, signed_area(ring)) for k, ring in enumerate(rings) if len(ring) >= 3]
    outer = sorted((k for k, area in kept if area > 0.0), key=lambda k: signed_area(rings[k]))
    holes: dict[int, list[FloatArray]] = {k: [] for k in outer}
    for k, area in kept:
        if area < 0.0:
            middle = 0.5 * (rings[k][0] + rings[k][1])
            home = next((o for o in outer if winds_about(rings[o], middle)), None)
            if home is not None:
                holes[home].append(rings[k])
    found = [(Polygon(rings[k], tuple(holes[k])), k) for k in outer]
    found = [(polygon, k) for polygon, k in found if inside_polygons([polygon], seeds).any()]
    return [polygon for polygon, _ in found], [k for _, k in found]


def nearest_on_polygons(
    polygons: Sequence[Polygon], point: FloatArray, *, border: bool = False
) -> tuple[FloatArray, FloatArray, int]:
    """(nearest place, unit vector inwards there, which polygon); `border`: on a ring even if the point is inside."""
    best, least = (point, np.zeros(2), 0), np.inf
    for number, polygon in enumerate(polygons):
        if not border and bool(inside_polygons([polygon], point)):
            return point, np.zeros(2), number
        for ring in (polygon.outer, *polygon.holes):
            d = np.roll(ring, -1, axis=0) - ring
            size = np.maximum(np.einsum("ij,ij->i", d, d), 1e-300)
            t = np.clip(np.einsum("ij,ij->i", point - ring, d) / size, 0.0, 1.0)
            feet = ring + t[:, None] * d
            off = np.linalg.norm(feet - point, axis=-1)
            k = int(np.argmin(off))
            if off[k] < least:
                # At a vertex the mean of both edges' normals.
                edges = d[k] if 0.0 < t[k] < 1.0 else d[k] / np.sqrt(size[k]) + d[k - 1] / np.sqrt(size[k - 1])
                if t[k] == 1.0:
                    after = (k + 1) % len(ring)
                    edges = d[k] / np.sqrt(size[k]) + d[after] / np.sqrt(size[after])
                normal = np.array([-edges[1], edges[0]])
                best, least = (feet[k], normal / max(float(np.linalg.norm(normal)), 1e-300), number), float(off[k])
    return best
