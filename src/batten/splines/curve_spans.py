"""A curve between its corners, by arc length: samples for the fits, and a polyline that follows it closely."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from batten.curves.arc_length import ArcLength
from batten.curves.base import Curve
from batten.curves.polyline import Polyline
from batten.solvers.curve_samples import CurveSamples, gauss_rule
from batten.typing import FloatArray

_NODES = 24
#: Where a curve turns by more than this within a trace's fineness it is taken to have a corner (a cusp, a tiny loop).
_SHARP = np.radians(60.0)
_MOST_POINTS = 400_000


@dataclass(frozen=True, eq=False)
class CurveSpan:
    """A part of a curve without corners, by arc length from its own start.

    Attributes:
        curve: the whole curve. arc: its arc length.
        first: where the span begins on the curve. length: its length.
        closed: whether the span is the whole of a closed curve that is smooth where it closes.
        arcs, trace: (n,), (n, 2), points at these arc lengths; the polyline through them follows the span within `fineness`.
        angles: (n,), tangent angles at these, continuous.
        ramps: for a `Polyline`, arc lengths and tangent angles between which the angle is taken as linear.
        straight: whether it is a line segment to rounding.
        tips: the curve's parameters at both ends; arc length alone does not find them where the speed is 0.
    """

    curve: Curve
    arc: ArcLength
    first: float
    length: float
    closed: bool
    arcs: FloatArray
    trace: FloatArray
    angles: FloatArray
    fineness: float
    ramps: tuple[FloatArray, FloatArray] | None
    straight: bool
    tips: tuple[float, float]

    def points_at(self, s: FloatArray) -> FloatArray:
        """Points (…, 2) at arc lengths (…) of the span; on a closed one any real number will do."""
        return self.curve.point(self._parameter(s))

    def angles_at(self, s: FloatArray) -> FloatArray:
        """Tangent angles (…), continuous along the span; on a closed one also from lap to lap."""
        return self._angles(s, None)

    def frames_at(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """`points_at` and `angles_at` together, for less than both apart."""
        u = self._parameter(s)
        return self.curve.point(u), self._angles(s, u)

    def _angles(self, s: FloatArray, u: FloatArray | None) -> FloatArray:
        laps = np.floor(s / self.length) if self.closed else np.zeros(np.shape(s))
        inner = np.clip(s - laps * self.length, 0.0, self.length)
        turns = laps * (self.angles[-1] - self.angles[0])
        if self.ramps is not None:
            return np.interp(inner, *self.ramps) + turns
        rough = np.interp(inner, self.arcs, self.angles)
        velocity = self.curve.derivative(self._parameter(s) if u is None else u)
        exact = np.arctan2(velocity[..., 1], velocity[..., 0])
        angle = exact + 2.0 * np.pi * np.round((rough - exact) / (2.0 * np.pi))
        # Without speed there is no direction; at the ends that of the trace is good, as it has looked there already.
        speed = np.hypot(velocity[..., 0], velocity[..., 1])
        known = (speed > 1e-6 * self.arc.length) & (inner > 0.0) & (inner < self.length)
        return np.where(known, angle, rough) + turns

    def samples(self, a: FloatArray, b: FloatArray) -> CurveSamples:
        """What a fit sees of the parts [a, b] of the span, each (k,)."""
        t, w, _ = gauss_rule(_NODES)
        width = (b - a)[:, None]
        s = a[:, None] + width * np.concatenate([[0.0], t, [1.0]])
        u = self._parameter(s)
        points, angles = self.curve.point(u), self._angles(s, u)
        if self.ramps is not None:
            inner = s[:, 1:-1]
            slope = np.append(np.diff(self.ramps[1]) / np.maximum(np.diff(self.ramps[0]), 1e-300), 0.0)
            laps = np.floor(inner / self.length) if self.closed else 0.0
            at = np.searchsorted(self.ramps[0], inner - laps * self.length, side="right") - 1
            curvature = slope[np.clip(at, 0, len(slope) - 2)]
        else:
            d, dd = self.curve.derivative(u[:, 1:-1]), self.curve.derivative(u[:, 1:-1], 2)
            speed = np.maximum(np.hypot(d[..., 0], d[..., 1]), 1e-9 * self.arc.length)
            curvature = (d[..., 0] * dd[..., 1] - d[..., 1] * dd[..., 0]) / speed**3
        ends = np.concatenate([points[:, [0, -1]], angles[:, [0, -1], None]], axis=2)
        return CurveSamples(*(np.ascontiguousarray(v) for v in (
            points[:, 1:-1], angles[:, 1:-1], curvature, width * w, np.tile(t, (len(a), 1)), b - a, ends,
        )))  # fmt: skip

    def part(self, a: float, b: float) -> FloatArray:
        """The trace from a to b, (n, 2), n ≥ 2; on a closed span it may go over the end."""
        if self.closed and (a < 0.0 or b > self.length):
            shift = np.floor(a / self.length) * self.length
            a, b = a - shift, b - shift
            if b > self.length:
                return np.concatenate([self.part(a, self.length), self.part(0.0, b - self.length)[1:]])
        low, high = np.searchsorted(self.arcs, [a, b], side="right")
        tips = self.points_at(np.array([a, b]))
        inner = self.trace[low:high]
        if len(inner) and self.arcs[high - 1] >= b:
            inner = inner[:-1]
        return np.ascontiguousarray(np.concatenate([tips[:1], inner, tips[1:]]))

    def _parameter(self, s: FloatArray) -> FloatArray:
        s = np.asarray(s, dtype=np.float64)
        if self.closed:
            s = s - np.floor(s / self.length) * self.length * ((s < 0.0) | (s > self.length))
        u = self.arc.parameter_at((self.first + np.clip(s, 0.0, self.length)) / self.arc.length)
        return np.where(s <= 0.0, self.tips[0], np.where(s >= self.length, self.tips[1], u))


def spans_of(curve: Curve, fineness: float, corner_angle: float, blend: float) -> list[CurveSpan]:
    """A curve cut at its corners.

    Parameters:
        curve: of positive length.
        fineness: greatest distance of the trace from the curve.
        corner_angle: a turn above it is a corner, radians.
        blend: how far a smooth curve may pass a vertex of a `Polyline` that is no corner.
    """
    arc = ArcLength.of(curve)
    s, u, points, before, after = _trace(curve, arc, fineness)
    turn = _wrapped(after - before)
    corner = np.abs(turn) > corner_angle
    chords = np.diff(points, axis=0)
    heading = np.arctan2(chords[:, 1], chords[:, 0])
    sharp = np.zeros(len(s), bool)
    sharp[1:-1] = np.abs(_wrapped(np.diff(heading))) > _SHARP
    after[sharp], before[1:][sharp[1:]] = heading[sharp[:-1]], heading[sharp[1:]]
    corner |= sharp
    reach = np.hypot(*np.ptp(points, axis=0))
    closes = bool(np.hypot(*(points[-1] - points[0])) <= 1e-9 * reach)
    cuts = np.flatnonzero(corner[1:-1]) + 1
    closed = closes and not len(cuts) and abs(_wrapped(np.array([after[0] - before[-1]]))[0]) <= corner_angle
    edges = np.concatenate([[0], cuts, [len(s) - 1]])
    return [
        _span(curve, arc, s, u, points, before, after, int(i), int(j), closed, fineness, blend)
        for i, j in pairwise(edges)
    ]


def _span(
    curve: Curve, arc: ArcLength, s: FloatArray, u: FloatArray, points: FloatArray, before: FloatArray, after: FloatArray,
    i: int, j: int, closed: bool, fineness: float, blend: float,
) -> CurveSpan:  # fmt: skip
    arcs, trace = s[i : j + 1] - s[i], points[i : j + 1]
    raw = np.append(after[i:j], before[j])
    if closed:
        raw[-1] = after[0]
    angles = np.unwrap(raw)
    ramps = _ramps(arcs, after[i:j], closed, blend) if isinstance(curve, Polyline) else None
    if ramps is not None:
        angles = np.interp(arcs, *ramps)
    chord = trace[-1] - trace[0]
    width = float(np.hypot(*chord))
    away = trace - trace[0]
    off = float(np.abs(away[:, 0] * chord[1] - away[:, 1] * chord[0]).max()) / width if width > 0.0 else np.inf
    straight = off <= 1e-12 * arcs[-1] and width >= (1.0 - 1e-12) * arcs[-1]
    return CurveSpan(
        curve,
        arc,
        float(s[i]),
        float(arcs[-1]),
        closed,
        arcs,
        trace,
        angles,
        fineness,
        ramps,
        straight,
        (float(u[i]), float(u[j])),
    )


def _ramps(arcs: FloatArray, heading: FloatArray, closed: bool, blend: float) -> tuple[FloatArray, FloatArray]:
    """Angles of a polyline's span: constant along segments, but turning evenly about the vertices.

    A parabola with the segments as tangents leaves a vertex of turn δ at a distance of δ/4 of its half width.
    """
    length = np.diff(arcs)
    angle = np.unwrap(heading)
    turn = np.abs(np.diff(angle))
    half = np.minimum(0.5 * np.minimum(length[:-1], length[1:]), 4.0 * blend / np.maximum(turn, 1e-12))
    knots = np.stack([arcs[1:-1] - half, arcs[1:-1] + half], axis=1).ravel()
    values = np.stack([angle[:-1], angle[1:]], axis=1).ravel()
    first, last = angle[0], angle[-1]
    if closed:
        gap = float(_wrapped(np.array([angle[0] - angle[-1]]))[0])
        half_gap = min(0.5 * length[0], 0.5 * length[-1], 4.0 * blend / max(abs(gap), 1e-12))
        knots = np.concatenate([[half_gap], knots, [arcs[-1] - half_gap]])
        values = np.concatenate([[angle[0]], values, [angle[-1]]])
        first, last = angle[0] - 0.5 * gap, angle[-1] + 0.5 * gap
    return np.concatenate([[0.0], knots, arcs[-1:]]), np.concatenate([[first], values, [last]])


def _trace(
    curve: Curve, arc: ArcLength, fineness: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Arc lengths, parameters, points of a polyline within `fineness` of the curve; tangent angles before and after each.

    Straight pieces of a curve have no points between their ends.
    """
    breaks = arc.fraction_at(np.asarray(curve.breaks(), dtype=np.float64)) * arc.length
    breaks = breaks[np.concatenate([[True], np.diff(breaks) > 1e-14 * arc.length])]
    breaks[-1] = arc.length
    if isinstance(curve, Polyline):
        s = breaks
    else:
        grid = np.linspace(0.0, 1.0, 9)[:-1]
        s = np.append((breaks[:-1, None] + np.diff(breaks)[:, None] * grid).ravel(), arc.length)
        s = _refined(curve, arc, s, fineness)
    u = _parameters(curve, arc, s)
    at_break = np.isin(s, breaks)
    points = curve.point(u)
    after, before = _direction(curve, u, 1), _direction(curve, u, -1)
    inner = ~at_break
    before[inner] = after[inner]
    return s, u, points, before, after


def _refined(curve: Curve, arc: ArcLength, s: FloatArray, fineness: float) -> FloatArray:
    """Arc lengths with more in between wherever the middle lies farther than `fineness` from the chord."""
    left, right = s[:-1], s[1:]
    found = [s]
    for _ in range(40):
        middle = 0.5 * (left + right)
        a, b, m = (curve.point(_parameters(curve, arc, v)) for v in (left, right, middle))
        quarter = curve.point(_parameters(curve, arc, 0.5 * (left + middle)))
        off = np.maximum(_off(m, a, b), 4.0 / 3.0 * _off(quarter, a, b))
        parts = np.clip(np.ceil(np.sqrt(1.1 * off / fineness)), 1, 64).astype(int)
        busy = parts > 1
        if not busy.any() or sum(map(len, found)) > _MOST_POINTS:
            break
        left, right, parts = left[busy], right[busy], parts[busy]
        whole = np.repeat(np.arange(len(parts)), parts)
        k = np.arange(len(whole)) - np.repeat(np.cumsum(parts) - parts, parts)
        step = (right - left)[whole] / parts[whole]
        lows = left[whole] + k * step
        found.append(lows[k > 0])
        last = k + 1 == parts[whole]
        left, right = lows, np.where(last, right[whole], np.roll(lows, -1))
    return np.sort(np.concatenate(found))


def _parameters(curve: Curve, arc: ArcLength, s: FloatArray) -> FloatArray:
    """Parameters at arc lengths; those of breaks exactly, also where the speed is 0 there."""
    breaks = np.asarray(curve.breaks(), dtype=np.float64)
    known = arc.fraction_at(breaks) * arc.length
    known[-1] = arc.length
    at = np.clip(np.searchsorted(known, s), 0, len(known) - 1)
    return np.where(known[at] == s, breaks[at], arc.parameter_at(s / arc.length))


def _off(p: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    chord, away = b - a, p - a
    square = (chord**2).sum(axis=-1)
    along = np.clip((chord * away).sum(axis=-1) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
    return np.asarray(np.linalg.norm(away - along[:, None] * chord, axis=-1))


def _direction(curve: Curve, u: FloatArray, side: int) -> FloatArray:
    """Tangent angles just after (side 1) or before (−1) parameters u; along a tiny chord where there is no speed."""
    at = u if side > 0 else np.nextafter(u, 0.0)
    velocity = curve.derivative(np.clip(at, 0.0, 1.0))
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    slow = np.flatnonzero(speed <= 1e-6 * speed.max())
    if len(slow):
        breaks = np.asarray(curve.breaks(), dtype=np.float64)
        room = np.diff(breaks)
        piece = np.clip(np.searchsorted(breaks, at[slow], side="right") - 1, 0, len(room) - 1)
        near = np.clip(u[slow] + side * 1e-5 * room[piece], 0.0, 1.0)
        stays = near == u[slow]
        near[stays] = u[slow][stays] - side * 1e-5 * room[piece][stays]
        velocity[slow] = curve.derivative(near)
    return np.arctan2(velocity[:, 1], velocity[:, 0])


def _wrapped(angle: FloatArray) -> FloatArray:
    return np.asarray(angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi)))
