"""The search for the set of good places of a control point: a scan, and a border followed around each component found.

All lattices share one origin, the present place, and the scan's axes, so that the scan's nodes are nodes of every finer one.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np

from batten.kernels import good_region as kernel
from batten.kernels import region_border as border_kernel
from batten.solvers.region_polygons import Polygon, inside_polygons, nearest_on_polygons, polygons_of_rings
from batten.typing import BoolArray, FloatArray, IntArray

#: What the kernels know of the spline and the limits: see `violation`.
Problem: TypeAlias = tuple[FloatArray, FloatArray, IntArray, FloatArray, FloatArray, FloatArray]

#: Cells along each side of the scan, for up to two affected pieces and for more, which are allowed more time.
_SCAN = (44, 64)
#: Half the scan's side over the natural size, and that of the greatest window.
_HALF, _GREATEST = 1.75, 14.0
#: The step of a component's lattice over the resolution × the width, for the same; how near vertices are to the limit and
#: how far chords stray, in that unit.
_STEP = (1.1, 0.8)
_SHARP, _STRAY = 0.1, 0.15
#: How often the stretch of a line that is looked at is doubled.
_DOUBLINGS = 3
#: Steps along the width that a rough border needs to tell it; by what a lattice is made finer until it does.
_ROUGH, _FINER = 3.0, 4
#: By how much finer than the scan a lattice is laid to look for a component; only the present place's is looked for further.
_FINEST = 64
#: How often the lattice of one component is laid anew, and enlarged because the border leaves it.
_LAYINGS, _ENLARGEMENTS = 12, 24
#: A lattice is not enlarged beyond this, nor a border followed for longer.
_MOST_NODES, _MOST_POINTS = 3_000_000, 65536
#: How often it is enlarged for a component of which the scan shows less than `_WELL_KNOWN` nodes, once its size seems known:
#: where it is then found to hang by a thread on a large one, it is left out.
_FEW_ENLARGEMENTS, _WELL_KNOWN = 5, 9


class Traced(NamedTuple):
    """Rings on a lattice, which of their points lie on the greatest window's rim, and the step."""

    rings: list[FloatArray]
    rims: list[BoolArray]
    step: float


class RegionSearch:
    """The steps of `good_region`, in displacements of the active point.

    `values` holds violation at the nodes first + (0 … n − 1) of the lattice of step `cell` about the present place. An
    `origin` is that place, 0, or one of a component that the scan does not show.
    """

    def __init__(
        self, problem: Problem, centre: FloatArray, size: float, direction: FloatArray, is_good: bool, resolution: float,
        windowed: bool,
    ) -> None:  # fmt: skip
        self.problem, self.centre, self.size, self.is_good = problem, centre, size, is_good
        self.axes = np.eye(2) if windowed else np.array([direction, [-direction[1], direction[0]]])
        self.resolution, self.windowed = resolution, windowed
        many = len(problem[0]) > 2
        self.step, self.scan = _STEP[many], _SCAN[many]
        self.bounded = True
        self.seen = (0.0, 0.0, 0.0, 0.0)

    def polygons(self) -> list[Polygon]:
        """All components that are found, that of the present place first."""
        self._scan()
        found: list[Polygon] = []
        here = np.zeros((1, 2))
        labels = np.empty(self.values.shape, np.int64)
        count = border_kernel.components(self.values, labels)
        groups = [np.argwhere(labels == k) for k in range(1, count + 1)]
        for group in sorted(groups, key=lambda nodes: -len(nodes)):
            nodes = group + self.first
            places = nodes @ (self.cell * self.axes)
            fresh = self._fresh(found, places)
            if len(fresh):
                found += self._component(np.zeros(2), nodes, fresh)
        for place in self._minima():
            if len(self._fresh(found, place[None])):
                found += self._component(place, np.zeros((1, 2), np.int64), place[None])
        first = [p for p in found if self.is_good and inside_polygons([p], here).any()]
        rest = [p for p in found if not any(p is q for q in first)]
        return first + sorted(rest, key=lambda p: -p.area)

    def _fresh(self, found: list[Polygon], places: FloatArray) -> FloatArray:
        """Those of `places` that lie in none of the polygons found, nor so near to one that its chords may pass them by."""
        if not found:
            return places
        rest = places[~inside_polygons(found, places)]
        kept = []
        for place in rest:
            near, _, number = nearest_on_polygons(found, place)
            if np.linalg.norm(near - place) > self.resolution * _width(found[number].outer):
                kept.append(place)
        return np.array(kept).reshape(-1, 2)

    def _scan(self) -> None:
        """Violation at the nodes of the first lattice."""
        if self.windowed:
            box = self.problem[4]
            low, high = box[:2], box[2:]
        else:
            middle = self.axes @ self.centre
            low, high = middle - _HALF * self.size, middle + _HALF * self.size
        self.cell = float((high - low).max()) / self.scan
        self.first = np.floor(low / self.cell).astype(np.int64)
        shape = np.ceil(high / self.cell).astype(np.int64) - self.first + 1
        nodes = self.first + np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
        places = (nodes @ (self.cell * self.axes)).reshape(-1, 2)
        values = np.empty(len(places))
        kernel.violation_batch(places, self.problem, values)
        self.values = values.reshape(tuple(shape))
        if self.windowed:
            self.seen = tuple(self.problem[4].tolist())
        else:
            self.seen = (*places.min(axis=0).tolist(), *places.max(axis=0).tolist())

    def _place(self, i: int, j: int) -> FloatArray:
        """Where the scan's node number (i, j) lies."""
        return np.asarray((self.first + np.array([i, j])) @ (self.cell * self.axes))

    def _minima(self) -> list[FloatArray]:
        """Good places that a compass search finds from the least nodes that are not good but not far from it."""
        values = self.values
        m, n = values.shape
        inner = values[1:-1, 1:-1]
        least = (inner >= 0.0) & (inner < 1.0)
        for a, b in ((0, 1), (1, 0), (1, 2), (2, 1), (0, 0), (0, 2), (2, 0), (2, 2)):
            least &= inner <= values[a : m - 2 + a, b : n - 2 + b]
        found = []
        compass = np.concatenate([self.axes, -self.axes])
        trial = np.empty(4)
        for i, j in np.argwhere(least).tolist():
            place, value, step = self._place(i + 1, j + 1), values[i + 1, j + 1], 0.5 * self.cell
            while step > 0.03 * self.cell and value >= 0.0:
                places = place + step * compass
                kernel.violation_batch(places, self.problem, trial)
                best = int(np.argmin(trial))
                if trial[best] < value:
                    place, value = places[best], trial[best]
                else:
                    step *= 0.5
            if value < 0.0:
                found.append(place)
        return found

    def _component(self, origin: FloatArray, nodes: IntArray, seeds: FloatArray) -> list[Polygon]:
        """The polygons that hold one of `seeds`, on a lattice about `origin` as fine as their width asks for.

        nodes (m, 2): of the scan's lattice, moved to `origin`, from where the border is looked for.
        """
        finer = 1 if len(nodes) >= _WELL_KNOWN else _FINER
        needed = len(nodes) >= _WELL_KNOWN or (self.is_good and not seeds[0].any())
        low, high = nodes.min(axis=0) * self.cell, nodes.max(axis=0) * self.cell
        polygons: list[Polygon] = []
        sharp, coarser = False, 0
        for laying in range(_LAYINGS):
            most = _ENLARGEMENTS if needed or laying == 0 else _FEW_ENLARGEMENTS
            traced = self._traced(origin, nodes, finer, low, high, sharp, most)
            if not traced.rings and needed and coarser:  # too large at this step: the finest that is not
                traced = self._traced(origin, nodes, coarser, low, high, True, most)
                return polygons_of_rings(traced.rings, seeds)[0] or polygons
            before = polygons
            polygons, own = polygons_of_rings(traced.rings, seeds)
            if not own:
                return before if needed else []
            coarser = finer
            flat = np.concatenate([traced.rings[k] for k in own])
            width = max(_width(polygon.outer) for polygon in polygons)
            wanted = self.step * self.resolution * width
            if (sharp and traced.step <= 1.25 * wanted) or finer > 2**40:
                self.bounded = self.bounded and not any(traced.rims[k].any() for k in own)
                break
            if width < _ROUGH * traced.step:
                finer *= _FINER
                if finer > _FINEST and not needed:
                    return []
            else:
                finer, sharp = max(1, math.ceil(self.cell / wanted)), True
            local = (flat - origin) @ self.axes.T
            low, high = local.min(axis=0) - traced.step, local.max(axis=0) + traced.step
        return polygons

    def _traced(
        self, origin: FloatArray, nodes: IntArray, finer: int, low: FloatArray, high: FloatArray, sharp: bool,
        most: int,
    ) -> Traced:  # fmt: skip
        """All rings about `nodes`, on a lattice `finer` times as fine as the scan's, which reaches from low to high.

        It is enlarged up to `most` times while a border leaves it.
        """
        step = self.cell / finer
        nodes = nodes * finer
        first, last = np.floor(low / step).astype(np.int64) - 3, np.ceil(high / step).astype(np.int64) + 3
        nodes = nodes[((nodes > first) & (nodes < last)).all(axis=1)]
        if np.prod(last - first + 1) > _MOST_NODES:
            return Traced([], [], step)
        values = self._blank(first, last, step, origin)
        if not origin.any():
            self._fill(values, first, finer)
        frame = np.empty(6)
        frame[2:4], frame[4:] = step * self.axes
        small, far = (_SHARP / self.step, _STRAY / self.step) if sharp else (0.0, 0.0)
        room = 4096
        for _ in range(most):
            frame[:2] = origin + first @ (step * self.axes)
            points, numbers, rim = np.empty((room, 2)), np.empty(room, np.int64), np.empty(room, np.bool_)
            marks = np.zeros(values.shape, np.uint8)
            seeds = np.ascontiguousarray(nodes - first)
            count, state = border_kernel.trace_rings(
                frame, values, marks, seeds, finer, small, far, self.problem, points, numbers, rim
            )
            if state == border_kernel.DONE:
                cuts = np.flatnonzero(np.diff(numbers[:count])) + 1
                return Traced(np.split(points[:count], cuts), np.split(rim[:count], cuts), step)
            if state == border_kernel.NO_ROOM:
                room *= 4
                if room > _MOST_POINTS:
                    break
                continue
            axis, upwards = divmod(state - border_kernel.LEFT, 2)
            more = 16 + values.shape[axis] // 2
            wider_first, wider_last = first.copy(), last.copy()
            (wider_last if upwards else wider_first)[axis] += more if upwards else -more
            if np.prod(wider_last - wider_first + 1) > _MOST_NODES:
                break
            wider = self._blank(wider_first, wider_last, step, origin)
            start = first - wider_first
            wider[start[0] : start[0] + values.shape[0], start[1] : start[1] + values.shape[1]] = values
            values, first, last = wider, wider_first, wider_last
        return Traced([], [], step)

    def _blank(self, first: IntArray, last: IntArray, step: float, origin: FloatArray) -> FloatArray:
        """Unknown values at the nodes from `first` to `last`, infinite ones outside the greatest window."""
        values = np.full(tuple(last - first + 1), np.nan)
        if not self.windowed:
            middle, reach = self.axes @ (self.centre - origin), _GREATEST * self.size
            below = np.ceil((middle - reach) / step).astype(np.int64) - first
            above = np.floor((middle + reach) / step).astype(np.int64) - first + 1
            for axis in range(2):
                side = np.moveaxis(values, axis, 0)
                side[: max(0, below[axis])] = np.inf
                side[max(0, above[axis]) :] = np.inf
        return values

    def _fill(self, values: FloatArray, first: IntArray, finer: int) -> None:
        """Copy what the scan knows to the nodes that coincide."""
        low = np.maximum(self.first, -(-first // finer))
        high = np.minimum(self.first + self.values.shape, (first + values.shape - 1) // finer + 1)
        if (low < high).all():
            a, b = low - self.first, high - self.first
            c, d = low * finer - first, (high - 1) * finer - first + 1
            values[c[0] : d[0] : finer, c[1] : d[1] : finer] = self.values[a[0] : b[0], a[1] : b[1]]

    def intervals(self, direction: FloatArray) -> FloatArray:
        """Good stretches (k, 2, 2) of the line through the present place."""
        half, nodes = _HALF * self.size, 401
        middle = float(self.centre @ direction)
        values = np.empty(nodes)
        for doubling in range(_DOUBLINGS + 1):
            t = middle + half * np.linspace(-1.0, 1.0, nodes)
            t = np.unique(np.append(t, 0.0))
            values = np.empty(len(t))
            kernel.violation_batch(t[:, None] * direction, self.problem, values)
            good = values < 0.0
            if doubling == _DOUBLINGS or not (good[0] or good[-1]):
                break
            half *= 2.0
        self.bounded = not bool(good[0] or good[-1])
        self.seen = (*np.minimum(t[0] * direction, t[-1] * direction).tolist(),
                     *np.maximum(t[0] * direction, t[-1] * direction).tolist())  # fmt: skip
        changes = np.flatnonzero(good[1:] != good[:-1])
        inside, outside = np.where(good[changes], changes, changes + 1), np.where(good[changes], changes + 1, changes)
        near, far = t[inside], t[outside]
        trial = np.empty(len(changes))
        for _ in range(40 if len(changes) else 0):
            between = 0.5 * (near + far)
            kernel.violation_batch(between[:, None] * direction, self.problem, trial)
            near, far = np.where(trial < 0.0, between, near), np.where(trial < 0.0, far, between)
        ends = np.sort(np.concatenate([near, t[:1][good[:1]], t[-1:][good[-1:]]]))
        return ends.reshape(-1, 2)[..., None] * direction


def _width(ring: FloatArray) -> float:
    """The least extent of a ring's points over 60 directions; within 0.2 % of the least over all, if they are not thin."""
    turns = np.arange(60) * (math.pi / 60)
    return float(np.ptp(ring @ np.array([np.cos(turns), np.sin(turns)]), axis=0).min())
