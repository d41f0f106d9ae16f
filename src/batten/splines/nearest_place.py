"""Places in good regions: which component they are in, and from one that is good to the resolution to one that is good."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from batten.solvers.good_region import GoodRegion
from batten.solvers.region_polygons import inside_polygons, nearest_on_polygons
from batten.typing import FloatArray

#: First radius of the search, as a part of the region's width, and how much it grows; the last is 2 %.
_LEAST, _GROWTH, _CIRCLES = 1e-5, 2.5, 9
_DIRECTIONS = 16
_HALVINGS = 14
#: How far a place may be from a component that it counts to, as a part of the region's width.
_STRIP = 0.02


def nearest_place(
    place: FloatArray, target: FloatArray, fallback: FloatArray, width: float, good: Callable[[FloatArray], bool]
) -> FloatArray:
    """A good place close to `place`: of the smallest circle about it that has one, that nearest to `target`.

    Parameters:
        place: (2,). target: (2,), where one would like to be. width: of the region.
        fallback: a place that is good, taken as the far end where no circle up to 2 % of the width has a good place.
        good: says whether a place is good.

    Returns:
        `place` where it is good; else a place on the way from there to the good one found, close to where that way begins to
        be good.

    Example:
        >>> disc = lambda p: p[0] ** 2 + p[1] ** 2 < 1.0
        >>> found = nearest_place(np.array([1.001, 0.0]), np.array([2.0, 0.0]), np.zeros(2), 2.0, disc)
        >>> bool(0.999 < found[0] < 1.0)
        True
    """
    if good(place):
        return place
    for k in range(_CIRCLES):
        radius = width * _LEAST * _GROWTH**k
        turns = 2.0 * math.pi / _DIRECTIONS * np.arange(_DIRECTIONS)
        around = place + radius * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
        for candidate in around[np.argsort(np.hypot(*(around - target).T), kind="stable")]:
            if good(candidate):
                return _between(place, candidate, good)
    return _between(place, fallback, good)


def _between(bad: FloatArray, fine: FloatArray, good: Callable[[FloatArray], bool]) -> FloatArray:
    """The last good place of a bisection between a bad and a good one."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (bad + fine)
        if good(middle):
            fine = middle
        else:
            bad = middle
    return fine


def same_component(region: GoodRegion, one: FloatArray, other: FloatArray) -> bool:
    """Whether two good places, each (2,), are in one component of a region; near its border counts as in it."""
    if region.polygons:
        for polygon in region.polygons:
            if inside_polygons([polygon], one):
                if inside_polygons([polygon], other):
                    return True
                break
        near = [nearest_on_polygons(region.polygons, point) for point in (one, other)]
    else:
        near = [_nearest_interval(region.intervals, point) for point in (one, other)]
    reach = _STRIP * region.width
    close = all(np.hypot(*(place - point)) <= reach for (place, _, _), point in zip(near, (one, other)))
    return close and near[0][2] == near[1][2]


def _nearest_interval(intervals: FloatArray, point: FloatArray) -> tuple[FloatArray, FloatArray, int]:
    """As `nearest_on_polygons`."""
    a, d = intervals[:, 0], intervals[:, 1] - intervals[:, 0]
    size = np.maximum(np.einsum("ij,ij->i", d, d), 1e-300)
    feet = a + np.clip(np.einsum("ij,ij->i", point - a, d) / size, 0.0, 1.0)[:, None] * d
    k = int(np.argmin(np.hypot(*(feet - point).T)))
    return feet[k], np.zeros(2), k
