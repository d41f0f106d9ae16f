"""The same surface cut by a straight hot wire: how many pieces that takes, and how far off it is (against Brander2016 §5).

In the plane of a leaf the wire is a straight line, so that the cut is a ruled surface. A *column* is a strip of the surface
between two borders that cross all leaves at the same fraction of their intervals; in each column every leaf has a wire of
its own. The wires of neighbouring columns do not know of each other: at a border they leave a step and a kink.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from batten.errors import InvalidInputError
from batten.kernels.minimax_line import minimax_line_batch
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.foliation import covering_offsets, intersect_planes, parallel_planes
from batten.surfaces.plane import Plane
from batten.typing import ArrayLike, BoolArray, FloatArray

Inside = Callable[[FloatArray], BoolArray]

_STATIONS = (257, 1025, 4097)  # along each leaf, more of them where it is curved
_SAGITTA = 2e-3  # of the tolerance: how far a leaf may stray from the polygon of its stations
_BETWEEN = 2.0**-10  # of a station's distance: how sharply borders are found
_BALANCED = 1e-4  # relative: how sharply the least deviation of a given number of columns is found
_SLIVER = 1e-9  # of the whole width: no column of its own
_DIRECTIONS = 36
_CANDIDATES = 3


@dataclass(frozen=True, eq=False)
class WireColumns:
    """Straight wires for m leaves in c columns.

    Attributes:
        planes: m planes. edges: (m, c + 1), abscissae of the columns' borders in each plane, ascending.
        heights: (m, c, 2), of the wire at both borders of the column; NaN where no point of the leaf counts.
        deviation: (m, c), greatest distance of the leaf from its wire, perpendicular to the wire; NaN as above.
    """

    planes: tuple[Plane, ...]
    edges: FloatArray
    heights: FloatArray
    deviation: FloatArray

    @property
    def count(self) -> int:
        """Number of columns."""
        return int(self.deviation.shape[1])

    @property
    def worst(self) -> float:
        """The greatest deviation of all; 0 if no point of the surface counts."""
        return float(np.nanmax(self.deviation, initial=0.0))

    @property
    def slopes(self) -> FloatArray:
        """Slopes of the wires in their planes, (m, c)."""
        return np.asarray(np.diff(self.heights)[..., 0] / np.diff(self.edges))

    @property
    def steps(self) -> FloatArray:
        """Height by which the next column's wire begins above the end of this one's, (m, c − 1)."""
        return np.asarray(self.heights[:, 1:, 0] - self.heights[:, :-1, 1])

    @property
    def kinks(self) -> FloatArray:
        """Turn of the tangent from each column's wire to the next one's, radians, left positive, (m, c − 1)."""
        return np.asarray(np.diff(np.arctan(self.slopes), axis=1))


@dataclass(frozen=True, eq=False)
class WireDirection:
    """What `best_wire_direction` found.

    Attributes:
        turn_rad: angle of the wires in plan against x, [0, π).
        columns: the wires in that direction.
        pieces: blocks that they need: cells of columns and rows in which a point of the surface counts.
        tried: (k, 2), angle and pieces of every direction that was worked out in full.
    """

    turn_rad: float
    columns: WireColumns
    pieces: int
    tried: FloatArray


def wire_columns(
    surface: BSplineSurface,
    planes: Sequence[Plane],
    low: ArrayLike,
    high: ArrayLike,
    tolerance: float,
    inside: Inside | None = None,
    *,
    longest: float = np.inf,
    count: int | None = None,
) -> WireColumns:
    """The fewest columns in which straight wires keep a tolerance, or the best ones of a given number.

    Each column reaches from the border before as far as every leaf has a line within the tolerance. This takes the fewest:
    a line that serves an interval serves each part of it, so what is feasible stays so when it is made smaller. Hence the
    k-th border of any division that keeps the tolerance lies at or before the k-th one found here. It does for k = 0; and if
    it does for k, then the other division's next column, cut down to what lies behind our k-th border, is feasible, and ours
    is the longest from there. So no other division is at the end earlier.

    Parameters:
        surface: single-valued along the planes' y axes.
        planes: m planes.
        low, high: least and greatest abscissa in each plane, shapes () or (m,).
        tolerance: greatest distance of leaf and wire, > 0, in the surface's unit.
        inside: which points in space, (…, 3), count; all that the surface has, if None.
        longest: greatest width of a column along the widest leaf.
        count: if given, the tolerance is set aside, and so many columns are laid such that the greatest deviation becomes
            least (by the same division for a tolerance that is bisected).

    Returns:
        `WireColumns`; the last of the fewest columns reaches only to the end.

    Raises:
        InvalidInputError: a tolerance or longest width that is not above 0, empty intervals, other shapes, count < 1, too
            few columns for the longest width.

    Accuracy: deviations are those of up to 4097 stations on each leaf, chosen so that the leaf strays from their polygon by
    2e-3 of the tolerance at most; borders lie within 1/1000 of a station's distance below the farthest possible; with
    `count` the greatest deviation is within 1e-4 of the least.

    Degenerate: a leaf without a point that counts is no obstacle. A ruled surface along its rulings takes one column.

    Example:
        >>> twisted = BSplineSurface([0, 0, 9, 9], [0, 0, 9, 9], 1, 1, [[(0, 0, 0), (0, 9, 5)], [(9, 0, 5), (9, 9, 0)]])
        >>> wires = wire_columns(twisted, parallel_planes("x", [1.0, 5.0, 9.0]), 0.0, 9.0, 0.01)
        >>> wires.count, wires.worst < 1e-12
        (1, True)
    """
    if not (tolerance > 0.0 and longest > 0.0 and (count is None or count >= 1)):
        raise InvalidInputError(
            f"tolerance = {tolerance}, longest = {longest}, count = {count}; allowed are numbers above 0, and 1 or more"
        )
    leaves = _Leaves(surface, tuple(planes), low, high, tolerance, inside)
    most = min(1.0, longest / float(leaves.width.max()))
    if count is None:
        borders = leaves.longest_columns(tolerance, most)
        assert borders is not None
    else:
        if count * most < 1.0 - 1e-12:
            raise InvalidInputError(
                f"{count} columns of at most {longest:g} do not reach over {leaves.width.max():g}; "
                f"try count = {int(np.ceil(1.0 / most))}"
            )
        borders = leaves.best_columns(count, most)
    return leaves.wires(borders)


def wires_between(
    surface: BSplineSurface, planes: Sequence[Plane], edges: ArrayLike, inside: Inside | None = None
) -> WireColumns:
    """The best straight wires in columns that are given: what a hot wire makes of the blocks of a blade.

    Parameters:
        surface, planes, inside: as for `wire_columns`.
        edges: (m, c + 1), ascending abscissae of the borders in each plane, as for `rationalise`.

    Raises:
        InvalidInputError: edges of another shape or not ascending.

    Accuracy: as `wire_columns`, with 1025 stations on each piece.

    Example:
        >>> dome = BSplineSurface([0] * 3 + [1] * 3, [0, 0, 1, 1], 2, 1, [[(x, y, z) for y in (0, 1)] for x, z in
        ...                       [(0, 0), (4, 8), (8, 0)]])
        >>> wires_between(dome, parallel_planes("x", [0.5]), [[2.0, 6.0]]).deviation.round(6).tolist()  # 4 − (x − 4)²/4
        [[0.5]]
    """
    borders = np.asarray(edges, dtype=np.float64)
    if borders.ndim != 2 or len(borders) != len(planes) or borders.shape[1] < 2 or not (np.diff(borders) > 0).all():
        raise InvalidInputError(
            f"edges: got shape {borders.shape} for {len(planes)} planes; allowed is (planes, columns + 1), ascending"
        )
    columns = [
        _Leaves(surface, tuple(planes), borders[:, k], borders[:, k + 1], None, inside).wires(np.array([0.0, 1.0]))
        for k in range(borders.shape[1] - 1)
    ]
    heights, deviation = (
        np.concatenate([getattr(c, name) for c in columns], axis=1) for name in ("heights", "deviation")
    )
    return WireColumns(tuple(planes), borders, heights, deviation)


class _Leaves:
    """Leaves sampled at equal fractions of their intervals, NaN where they do not count; cubics between the stations."""

    def __init__(
        self,
        surface: BSplineSurface,
        planes: tuple[Plane, ...],
        low: ArrayLike,
        high: ArrayLike,
        tolerance: float | None,
        inside: Inside | None,
    ) -> None:
        ends = [np.asarray(v, dtype=np.float64) for v in (low, high)]
        if not planes or any(v.shape not in ((), (len(planes),)) for v in ends) or not (ends[1] > ends[0]).all():
            raise InvalidInputError(
                f"low, high: got shapes {ends[0].shape} and {ends[1].shape} for {len(planes)} planes; allowed are numbers, "
                f"one or one a plane, low below high, and at least one plane"
            )
        self.planes = planes
        self.low = np.broadcast_to(ends[0], len(planes))
        self.width = np.broadcast_to(ends[1], len(planes)) - self.low
        for stations in _STATIONS if tolerance is not None else _STATIONS[1:2]:
            self.at = np.linspace(0.0, 1.0, stations)
            x = self.low[:, None] + self.width[:, None] * self.at
            section = intersect_planes(surface, planes, x, order=1)
            y = section.y.copy()
            if inside is not None:
                points = np.stack([p.to_world(np.stack(pair, axis=-1)) for p, pair in zip(planes, zip(x, y))])
                y[~inside(points)] = np.nan
            self.y, self.rate = y, section.slope * self.width[:, None]
            bend = np.abs(np.diff(y, 2, axis=1))
            if tolerance is None or not (np.nanmax(bend, initial=0.0) / 8.0 > _SAGITTA * tolerance):
                break

    def heights(self, fraction: float) -> FloatArray:
        """Heights (m,) at one fraction; NaN unless the stations on both sides count."""
        k = min(int(fraction * (len(self.at) - 1)), len(self.at) - 2)
        h = self.at[k + 1] - self.at[k]
        t = (fraction - self.at[k]) / h
        if t in (0.0, 1.0):
            return np.asarray(self.y[:, k + int(t)])
        (a, b), (u, v) = self.y[:, k : k + 2].T, h * self.rate[:, k : k + 2].T
        return np.asarray(a + t * (u + t * (3.0 * (b - a) - 2.0 * u - v + t * (2.0 * (a - b) + u + v))))

    def lines(self, first: float, last: float) -> FloatArray:
        """Height at the start, slope and deviation (m, 3) of the best line of every leaf between two fractions."""
        between = slice(*np.searchsorted(self.at, [first, last], side="right"))
        at, y = self.at[between], self.y[:, between]
        if at.size and at[-1] >= last:
            at, y = at[:-1], y[:, :-1]
        at = np.concatenate([[first], at, [last]])
        y = np.concatenate([self.heights(first)[:, None], y, self.heights(last)[:, None]], axis=1)
        found = np.empty((len(y), 3))
        minimax_line_batch(np.multiply.outer(self.width, at), y, found)
        return found

    def deviation(self, first: float, last: float) -> float:
        """Greatest deviation of all leaves between two fractions; 0 if nothing counts."""
        return float(np.nanmax(self.lines(first, last)[:, 2], initial=0.0))

    def longest_columns(self, tolerance: float, most: float, count: int | None = None) -> FloatArray | None:
        """Borders (c + 1,) of the longest columns from the start; None if there are more than `count` of them."""
        borders = [0.0]
        while borders[-1] < 1.0:
            if count is not None and len(borders) > count:
                return None
            guess = borders[-1] - borders[-2] if len(borders) > 1 else 1.0
            borders.append(self._farthest(borders[-1], tolerance, most, guess))
        return np.array(borders)

    def _farthest(self, first: float, tolerance: float, most: float, guess: float) -> float:
        """The farthest end of a column from `first`: doubling from a guess, then bisection.

        Two points have a line, so a column from a station to the next one, or to the end of its cell, is feasible.
        """
        spacing = self.at[1]
        end = first + most if first + most < 1.0 - _SLIVER else 1.0
        low, high = first, min(end, first + max(guess, spacing))
        while self.deviation(first, high) <= tolerance:
            if high >= end:
                return end
            low, high = high, min(end, first + 2.0 * (high - first))
        while high - low > _BETWEEN * spacing:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.deviation(first, middle) <= tolerance else (low, middle)
        return low

    def best_columns(self, count: int, most: float) -> FloatArray:
        """Borders (count + 1,) with the least greatest deviation, by bisection of the tolerance; no column is empty."""
        best = np.linspace(0.0, 1.0, count + 1)
        low, high = 0.0, max(self.deviation(*best[k : k + 2]) for k in range(count))
        floor = 1e-12 * float(self.width.max())
        while high - low > max(_BALANCED * high, floor):
            middle = 0.5 * (low + high)
            borders = self.longest_columns(middle, most, count)
            if borders is None:
                low = middle
            else:
                best, high = borders, middle
        while len(best) <= count:  # fewer columns do as well: halve the widest
            widest = int(np.diff(best).argmax())
            best = np.insert(best, widest + 1, 0.5 * (best[widest] + best[widest + 1]))
        return best

    def wires(self, borders: FloatArray) -> WireColumns:
        """The best wires between given borders."""
        found = np.stack([self.lines(*borders[k : k + 2]) for k in range(len(borders) - 1)], axis=1)
        edges = self.low[:, None] + self.width[:, None] * borders
        ends = np.stack([found[..., 0], found[..., 0] + found[..., 1] * np.diff(edges)], axis=-1)
        return WireColumns(self.planes, edges, ends, found[..., 2])


def best_wire_direction(
    surface: BSplineSurface,
    low: ArrayLike,
    high: ArrayLike,
    spacing: float,
    tolerance: float,
    *,
    row_width: float = np.inf,
    longest: float = np.inf,
    inside: Inside | None = None,
) -> WireDirection:
    """The direction in plan in which straight wires need the fewest pieces, so that a comparison with them is fair.

    A leaf of curvature κ and slope s needs about ∫ (|κ| (1 + s²) / (16 tolerance))^½ dx columns, the worst leaf counting at
    each place. This number, plus one, times the rows, is looked at in 36 directions; around the three best of its local
    minima it is minimised by golden section. There, and along x and y, the wires are worked out in full, and the direction
    with the fewest pieces is taken, of equals that with the least number above.

    Parameters:
        surface: single-valued in z over its plan.
        low, high: (2,), corners of the plan rectangle.
        spacing: greatest distance of neighbouring wires' planes.
        tolerance, longest, inside: as for `wire_columns`; points beyond the rectangle never count.
        row_width: greatest width of a block across the wires; infinite for one row.

    Raises:
        InvalidInputError: as `wire_columns` and `covering_offsets`; a row width that is not above 0.

    Accuracy: the golden section ends at 1e-4 rad. It is a search, not a proof: a direction that serves in a range narrower
    than 5° may be missed unless the number above falls towards it from 5° away, as it does towards rulings.

    Example:
        >>> saddle = BSplineSurface([0, 0, 9, 9], [0, 0, 9, 9], 1, 1, [[(0, 0, 0), (0, 9, 5)], [(9, 0, 5), (9, 9, 0)]])
        >>> found = best_wire_direction(saddle, (0, 0), (9, 9), 1.0, 0.01)
        >>> found.pieces, round(float(np.degrees(found.turn_rad)) % 90.0, 6)
        (1, 0.0)
    """
    corners = np.array([low, high], dtype=np.float64)
    if not row_width > 0.0:
        raise InvalidInputError(f"row_width = {row_width}; allowed are numbers above 0")
    family = _Family(surface, corners, tolerance, row_width, inside)
    angles = np.arange(_DIRECTIONS) * np.pi / _DIRECTIONS
    needs = np.array([family.need(a) for a in angles])
    minima = np.flatnonzero((needs <= np.roll(needs, 1)) & (needs <= np.roll(needs, -1)))
    minima = minima[np.argsort(needs[minima], kind="stable")][:_CANDIDATES]
    step = np.pi / _DIRECTIONS
    candidates = [0.0, 0.5 * np.pi, *(_golden(family.need, angles[k] - step, angles[k] + step) for k in minima)]
    found: dict[float, tuple[int, float, WireColumns]] = {}
    for angle in candidates:
        turn = float(angle % np.pi)
        planes, half = family.planes(spacing, turn)
        wires = wire_columns(surface, planes, -half, half, tolerance, family.counts, longest=longest)
        found[turn] = (family.pieces(wires, turn), family.need(turn), wires)
    best = min(found, key=lambda turn: found[turn][:2])
    tried = np.array([(turn, found[turn][0]) for turn in sorted(found)])
    return WireDirection(best, found[best][2], found[best][0], tried)


class _Family:
    """Parallel planes in any direction over one rectangle."""

    def __init__(
        self, surface: BSplineSurface, corners: FloatArray, tolerance: float, row_width: float, inside: Inside | None
    ) -> None:
        self.surface, self.corners, self.tolerance = surface, corners, tolerance
        self.row_width, self.inside = row_width, inside
        self.size = corners[1] - corners[0]
        self.slack = 1e-9 * float(np.abs(corners).max())

    def counts(self, points: FloatArray) -> BoolArray:
        """Whether points (…, 3) lie over the rectangle and inside."""
        plan = points[..., :2]
        over = ((plan >= self.corners[0] - self.slack) & (plan <= self.corners[1] + self.slack)).all(axis=-1)
        return np.asarray(over if self.inside is None else over & self.inside(points))

    def planes(self, spacing: float, turn: float) -> tuple[tuple[Plane, ...], float]:
        """Planes that cover the rectangle, and half the length that they need to."""
        offsets = covering_offsets("x", self.corners, spacing, turn_rad=turn)
        centre = self.corners.mean(axis=0)
        half = 0.5 * float(np.abs([np.cos(turn), np.sin(turn)]) @ self.size)
        return parallel_planes("x", offsets, turn_rad=turn, centre=centre), half

    def rows(self, turn: float) -> int:
        """Rows of blocks across the wires."""
        across = float(np.abs([np.sin(turn), np.cos(turn)]) @ self.size)
        return max(1, int(np.ceil(across / self.row_width - 1e-9)))

    def need(self, turn: float) -> float:
        """(1 + columns by curvature) × rows of a coarse family."""
        planes, half = self.planes(float(self.size.max()) / 24.0, turn)
        x = np.linspace(-half, half, 129)
        section = intersect_planes(self.surface, planes, x)
        density = np.abs(section.curvature) * (1.0 + section.slope**2) / (16.0 * self.tolerance)
        pairs = np.stack([np.broadcast_to(x, section.y.shape), section.y], axis=-1)
        density[~self.counts(np.stack([p.to_world(pair) for p, pair in zip(planes, pairs)]))] = 0.0
        worst = np.sqrt(np.nan_to_num(density).max(axis=0))
        return (1.0 + float(np.trapezoid(worst, x))) * self.rows(turn)

    def pieces(self, wires: WireColumns, turn: float) -> int:
        """Cells of rows and columns that hold a point of the surface that counts."""
        across = np.array([-np.sin(turn), np.cos(turn)])
        offsets = np.array([p.origin[:2] @ across for p in wires.planes])
        rows = self.rows(turn)
        share = (offsets - offsets.min()) / max(float(np.ptp(offsets)), 1e-300)
        used = np.isfinite(wires.deviation)
        return sum(
            int(used[(share >= r / rows - 1e-9) & (share <= (r + 1) / rows + 1e-9)].any(axis=0).sum())
            for r in range(rows)
        )


def _golden(function: Callable[[float], float], low: float, high: float) -> float:
    """Where a function of one minimum between two numbers is least, to 1e-4; the best place that was looked at."""
    ratio = 0.5 * (np.sqrt(5.0) - 1.0)
    seen = {x: function(x) for x in (high - ratio * (high - low), low + ratio * (high - low), 0.5 * (low + high))}
    left, right = high - ratio * (high - low), low + ratio * (high - low)
    while high - low > 1e-4:
        if seen[left] <= seen[right]:
            high, right = right, left
            left = high - ratio * (high - low)
            seen.setdefault(left, function(left))
        else:
            low, left = left, right
            right = low + ratio * (high - low)
            seen.setdefault(right, function(right))
    return float(min(seen, key=lambda x: seen[x]))
