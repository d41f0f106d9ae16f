"""Trims from curves in space: a closed chain of edges that lie on a surface, as a polygon in its parameter plane."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial import cKDTree

from batten.errors import InvalidInputError
from batten.surfaces.bspline_surface import BSplineSurface
from batten.typing import FloatArray

EdgeCurve = Callable[[FloatArray], FloatArray]
"""t ∈ [0, 1] of shape (n,) to points in space (n, 3), or in the parameter plane (n, 2)."""

_SAME = 1e-9  # of the surface's size: points closer together are one
_FIRST = 17  # points on an edge to begin with
_HALVINGS = 10
_STEPS = 40
_STARTS = 8  # samples from which the search for a parameter starts, where the nearest leads nowhere


def closed_directions(surface: BSplineSurface) -> tuple[bool, bool]:
    """Whether the surface closes along u, and along v: whether its first and last border are the same points.

    Example:
        >>> flat = BSplineSurface([0, 0, 2, 2], [0, 0, 1, 1], 1, 1, [[(0, 0, 0), (0, 3, 0)], [(4, 0, 0), (4, 3, 0)]])
        >>> closed_directions(flat)
        (False, False)
    """
    (u0, u1), (v0, v1) = surface.domain
    samples, size = surface.samples, _size(surface)
    along_u = np.abs(surface.point(u0, samples.v) - surface.point(u1, samples.v)).max()
    along_v = np.abs(surface.point(samples.u, v0) - surface.point(samples.u, v1)).max()
    return bool(along_u <= _SAME * size), bool(along_v <= _SAME * size)


def loop_polygon(
    surface: BSplineSurface, edges: Sequence[EdgeCurve | None], tolerance: float, *, gap: float | None = None
) -> FloatArray:
    """A closed chain of curves on a surface as a polygon in its parameter plane.

    Points of the edges are brought to the surface and their sides halved until they meet the tolerance. Across the seam of
    a closed surface the parameters run on, and a whole polygon is shifted back into the domain.

    Parameters:
        surface: the surface; closed ones, and ones with a side that is one point, are allowed.
        edges: curves, each beginning where the one before ends, the first where the last does; None for a side of the
            domain that is one point in space, passed the way of a border that turns counter-clockwise in (u, v).
        tolerance: greatest distance between the middle of a side, taken on the surface, and the edge's foot, above 0.
        gap: greatest distance of the edges from the surface, above 0; None for 100 × tolerance.

    Returns:
        Shape (k, 2), without the first corner again at the end.

    Raises:
        InvalidInputError: an edge leaves the surface by more than the gap; the edges are no closed chain, or go once round a
            closed surface; no edge at all; a tolerance that is not above 0.

    Accuracy: the tolerance, as far as ten halvings of a sixteenth of an edge reach it.

    Example:
        >>> flat = BSplineSurface([0, 0, 2, 2], [0, 0, 1, 1], 1, 1, [[(0, 0, 0), (0, 3, 0)], [(4, 0, 0), (4, 3, 0)]])
        >>> def circle(t):
        ...     return np.stack([2 + np.cos(2 * np.pi * t), 1 + np.sin(2 * np.pi * t), 0 * t], axis=-1)
        >>> polygon = loop_polygon(flat, [circle], 1e-3)
        >>> polygon.shape, polygon.min(axis=0).round(9).tolist()
        ((128, 2), [0.5, 0.0])
    """
    gap = 100.0 * tolerance if gap is None else gap
    if not (tolerance > 0.0 and gap > 0.0) or all(edge is None for edge in edges):
        raise InvalidInputError(
            f"tolerance = {tolerance}, gap = {gap}, {len(edges)} edges; allowed are lengths above 0 and one edge or more"
        )
    feet = _Feet(surface, gap)
    chains = [None if edge is None else _chain(surface, feet.along(edge), tolerance, feet) for edge in edges]
    while chains[-1] is None:  # begin with a side that is one point, rather than end with it
        chains = [chains[-1], *chains[:-1]]
    parts = _joined(feet, chains)
    around = np.abs(parts[-1][-1] - parts[0][0]) > 0.5 * feet.width
    if chains[0] is not None and (around & feet.closed).any():
        raise InvalidInputError(
            "a trim goes once round a closed surface and no edge follows the seam; split the surface at its seam first"
        )
    polygon = np.concatenate(parts)
    polygon += feet.period * np.ceil((feet.low - polygon.min(axis=0)) / feet.width - 1e-6) * feet.closed
    polygon -= feet.period * np.ceil((polygon.max(axis=0) - feet.high) / feet.width - 1e-6) * feet.closed
    return _without_doubles(surface, _snapped(surface, polygon, 0.1 * tolerance))


def parameter_loop_polygon(surface: BSplineSurface, curves: Sequence[EdgeCurve], tolerance: float) -> FloatArray:
    """A closed chain of curves in the parameter plane as a polygon there.

    Parameters:
        surface: the surface; parts of the curves beyond its domain are put on the border.
        curves: functions to (u, v), each beginning where the one before ends, the first where the last does.
        tolerance: greatest distance in space between the middle of a side and the middle of its arc, above 0.

    Returns:
        Shape (k, 2), without the first corner again at the end.

    Raises:
        InvalidInputError: the curves are no closed chain, within 100 × tolerance in space; a tolerance that is not above 0.

    Accuracy: the tolerance, as far as ten halvings of a sixteenth of a curve reach it.
    """
    if not tolerance > 0.0 or not curves:
        raise InvalidInputError(
            f"tolerance = {tolerance}, {len(curves)} curves; allowed are numbers above 0, one or more"
        )
    low, high = np.array(surface.domain).T
    chains = [_chain(surface, _clipped(curve, low, high), tolerance, None) for curve in curves]
    ends = np.array([(chain[-1], following[0]) for chain, following in zip(chains, [*chains[1:], chains[0]])])
    _check_closed(surface.point(ends[..., 0], ends[..., 1]), 100.0 * tolerance)
    return _without_doubles(surface, _snapped(surface, np.concatenate(chains), 0.1 * tolerance))


class _Feet:
    """Feet on a surface of points that lie on it or nearly so, also across seams and next to sides that are one point."""

    def __init__(self, surface: BSplineSurface, gap: float) -> None:
        self.surface, self.gap, self.size = surface, gap, _size(surface)
        self.low, self.high = np.array(surface.domain).T
        self.width = self.high - self.low
        self.closed = np.array(closed_directions(surface))
        self.period = np.where(self.closed, self.width, 0.0)
        samples = surface.samples
        stretch = np.linalg.norm(np.cross(samples.du, samples.dv), axis=-1)
        i, j = np.nonzero(stretch > 1e-6 * stretch.max())
        self._at = np.stack([samples.u[i], samples.v[j]], axis=1)
        self._tree = cKDTree(samples.points[i, j])

    def find(self, points: FloatArray) -> FloatArray:
        """Parameters (n, 2) of the feet of points (n, 3); NaN in the parameter that moves nothing at a singular point."""
        count = min(_STARTS, len(self._at))
        near = np.asarray(self._tree.query(points, k=[*range(1, count + 1)])[1], dtype=np.int64)
        at, distance = self._descend(points, self._at[near[:, 0]])
        for k in range(1, count):
            far = np.flatnonzero(distance > 1e-3 * self.gap)
            if not len(far):
                break
            again, shorter = self._descend(points[far], self._at[near[far, k]])
            better = shorter < distance[far]
            at[far[better]], distance[far[better]] = again[better], shorter[better]
        worst = int(np.argmax(distance))
        if not distance[worst] <= self.gap:
            raise InvalidInputError(
                f"an edge of the trim leaves the surface by {distance[worst]:.3g} at {points[worst].round(6).tolist()}; "
                f"allowed is {self.gap:.3g}: rebuild the edges (in Rhino: RebuildEdges) or join the faces again"
            )
        d = self.surface.derivatives(at[:, 0], at[:, 1], 1)
        reach = np.stack([np.linalg.norm(d[1, 0], axis=1), np.linalg.norm(d[0, 1], axis=1)], axis=1) * self.width
        at[reach <= 1e-6 * reach.max(axis=1, keepdims=True)] = np.nan
        return at

    def along(self, edge: EdgeCurve) -> EdgeCurve:
        """The feet of an edge's points as a function of t."""
        return lambda t: self.find(edge(t))

    def into_domain(self, at: FloatArray) -> FloatArray:
        """Parameters (…, 2) shifted by periods into the domain."""
        return np.where(self.closed, self.low + np.mod(at - self.low, self.width), at)

    def _descend(self, points: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Parameters near `at`, (n, 2), and distances there, by Levenberg–Marquardt steps of all points at once."""
        best, damping = at.copy(), np.full(len(at), 1e-6)
        d, miss = self._look(points, best)
        merit = np.linalg.norm(miss, axis=1)
        active = np.arange(len(at))
        for _ in range(_STEPS):
            trial = self._step(d[:, :, active], miss[active], best[active], damping[active])
            new_d, new_miss = self._look(points[active], trial)
            value = np.linalg.norm(new_miss, axis=1)
            better = value < merit[active]
            rows = active[better]
            best[rows], merit[rows], d[:, :, rows], miss[rows] = (
                trial[better],
                value[better],
                new_d[:, :, better],
                new_miss[better],
            )
            damping[active] *= np.where(better, 0.1, 10.0)
            active = active[(damping[active] < 1e3) & (merit[active] > 1e-15 * self.size)]
            if not len(active):
                break
        return best, merit

    def _look(self, points: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
        """First derivatives at parameters, and the way from there to the points."""
        d = self.surface.derivatives(at[:, 0], at[:, 1], 1)
        return d, points - d[0, 0]

    def _step(self, d: FloatArray, miss: FloatArray, at: FloatArray, damping: FloatArray) -> FloatArray:
        """The next parameters: wrapped where the surface closes, held at the border elsewhere."""
        du, dv = d[1, 0] * self.width[0], d[0, 1] * self.width[1]
        right = np.stack([(du * miss).sum(axis=1), (dv * miss).sum(axis=1)], axis=1)
        a, b, c = (du * du).sum(axis=1), (du * dv).sum(axis=1), (dv * dv).sum(axis=1)
        blocked = ((at <= self.low) & (right < 0.0) | (at >= self.high) & (right > 0.0)) & ~self.closed
        right[blocked] = 0.0
        b = np.where(blocked.any(axis=1), 0.0, b)
        scale = damping * (a + c) + 1e-300
        a, c = a + scale, c + scale
        determinant = a * c - b * b
        step = np.stack([c * right[:, 0] - b * right[:, 1], a * right[:, 1] - b * right[:, 0]], axis=1)
        following = at + np.clip(step / determinant[:, None], -0.25, 0.25) * self.width
        return np.where(self.closed, self.into_domain(following), np.clip(following, self.low, self.high))


def _clipped(curve: EdgeCurve, low: FloatArray, high: FloatArray) -> EdgeCurve:
    return lambda t: np.clip(curve(t), low, high)


def _chain(surface: BSplineSurface, find: EdgeCurve, tolerance: float, feet: _Feet | None) -> FloatArray:
    """One edge as a chain of parameters (n, 2), continuous across seams, its sides halved until within the tolerance.

    `find` gives the parameters at t; NaN in one that moves nothing there; `feet` knows the seams, None if there are none.
    """
    t = np.linspace(0.0, 1.0, _FIRST)
    at = find(t)
    for _ in range(_HALVINGS):
        chain = at if feet is None else _continuous(feet, at)
        middle_t, middle = 0.5 * (t[:-1] + t[1:]), 0.5 * (chain[:-1] + chain[1:])
        if feet is not None:
            middle = feet.into_domain(middle)
        foot = find(middle_t)
        there = np.where(np.isnan(foot), middle, foot)
        stray = surface.point(middle[:, 0], middle[:, 1]) - surface.point(there[:, 0], there[:, 1])
        rough = np.flatnonzero(np.linalg.norm(stray, axis=1) > tolerance)
        if not len(rough):
            break
        t = np.insert(t, rough + 1, middle_t[rough])
        at = np.insert(at, rough + 1, foot[rough], axis=0)
    return at if feet is None else _continuous(feet, at)


def _continuous(feet: _Feet, at: FloatArray) -> FloatArray:
    """Parameters without jumps by a period; a parameter that is NaN, at a singular point, is that of the next known one."""
    chain = at.copy()
    for axis in (0, 1):
        known = np.flatnonzero(np.isfinite(chain[:, axis]))
        if not len(known):
            chain[:, axis] = feet.low[axis]
            continue
        missing = np.flatnonzero(~np.isfinite(chain[:, axis]))
        nearest = known[np.abs(missing[:, None] - known).argmin(axis=1)]
        chain[missing, axis] = chain[nearest, axis]
        if feet.closed[axis]:
            chain[:, axis] = np.unwrap(chain[:, axis], period=feet.period[axis])
    return chain


def _joined(feet: _Feet, chains: Sequence[FloatArray | None]) -> list[FloatArray]:
    """The chains shifted by periods so that each goes on where the one before ends."""
    parts: list[FloatArray] = []
    end: FloatArray | None = None
    jump = False
    whole = [chain for chain in chains if chain is not None]
    ends = np.array([(chain[-1], following[0]) for chain, following in zip(whole, [*whole[1:], whole[0]])])
    at = feet.into_domain(ends)
    _check_closed(feet.surface.point(at[..., 0], at[..., 1]), 2.0 * feet.gap)
    for chain in chains:
        if chain is None:
            jump = True
            continue
        if end is not None:
            step = chain[0] - end
            shift = -feet.period * np.round(step / feet.width)
            if jump:
                shift = _round_the_point(feet, end, step)
            chain = chain + shift * feet.closed
        parts.append(chain)
        end, jump = chain[-1], False
    return parts


def _check_closed(places: FloatArray, allowed: float) -> None:
    """Refuse ends and following beginnings, (n, 2, 3), that lie apart."""
    apart = np.linalg.norm(places[:, 1] - places[:, 0], axis=-1)
    if not apart.max() <= allowed:
        i = int(np.argmax(apart))
        raise InvalidInputError(
            f"the edges of a trim are no closed chain: after {places[i, 0].round(6).tolist()} comes "
            f"{places[i, 1].round(6).tolist()}, {apart[i]:.3g} away; allowed is {allowed:.3g}: join the faces again"
        )


def _round_the_point(feet: _Feet, end: FloatArray, step: FloatArray) -> FloatArray:
    """The shift after a side of the domain that is one point: a border that turns counter-clockwise passes it one way."""
    shift = np.zeros(2)
    singular = int(np.argmin(np.minimum(np.abs(end - feet.low), np.abs(end - feet.high)) / feet.width))
    along = 1 - singular
    at_high = abs(end[singular] - feet.high[singular]) < abs(end[singular] - feet.low[singular])
    ahead = 1.0 if at_high == (singular == 0) else -1.0  # up the right side, back along the top
    if feet.closed[along]:
        turns = np.floor(ahead * step[along] / feet.width[along] + 1e-6)
        turns -= float(ahead * step[along] / feet.width[along] - turns < 1e-6)
        shift[along] = -ahead * turns * feet.width[along]
    return shift


def _snapped(surface: BSplineSurface, polygon: FloatArray, tolerance: float) -> FloatArray:
    """Corners within the tolerance of the domain's border put on it, and none outside."""
    low, high = np.array(surface.domain).T
    polygon = np.clip(polygon, low, high)
    for border in (low, high):
        for axis in (0, 1):
            moved = polygon.copy()
            moved[:, axis] = border[axis]
            away = surface.point(moved[:, 0], moved[:, 1]) - surface.point(polygon[:, 0], polygon[:, 1])
            near = np.abs(polygon[:, axis] - border[axis]) < 1e-3 * (high - low)[axis]
            polygon[near & (np.linalg.norm(away, axis=1) <= tolerance), axis] = border[axis]
    return polygon


def _without_doubles(surface: BSplineSurface, polygon: FloatArray) -> FloatArray:
    """The polygon without corners that are the same as the one before."""
    low, high = np.array(surface.domain).T
    keep = (np.abs(polygon - np.roll(polygon, 1, axis=0)) > 1e-12 * (high - low)).any(axis=1)
    return polygon[keep]


def _size(surface: BSplineSurface) -> float:
    return float(np.ptp(surface.control_points.reshape(-1, 3), axis=0).max())
