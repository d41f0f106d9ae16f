"""Splines whose tangents come from the neighbours alone: circles, cubic Lagrange, Ikarus (Levien2009 §4.4–4.5, 4.10)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import chebyshev

from batten.curves.base import Curve, check_order
from batten.curves.bezier import CubicBezier
from batten.curves.piecewise import PiecewiseCurve
from batten.curves.spiral import Spiral
from batten.typing import ArrayLike, FloatArray

_DEGREE = 40


def circle_tangents(points: FloatArray, closed: bool) -> FloatArray:
    """Tangent angle at each point, of the circle through it and its two neighbours, run from the one to the other.

    At the ends of an open spline the tangent of the circle through the last three points. Points (n, 2), n ≥ 3.
    """
    z = points[:, 0] + 1j * points[:, 1]
    before = z - np.roll(z, 1)
    after = np.roll(z, -1) - z
    # The tangent of the circle in the middle of three points: the angle of before·after/(whole chord).
    whole = np.roll(z, -1) - np.roll(z, 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        tangent = np.where(whole == 0.0, 1j * after, before * after / whole)
    if not closed:
        # At an end: mirror the middle tangent in the chord.
        tangent[0] = after[0] ** 2 / tangent[1]
        tangent[-1] = before[-1] ** 2 / tangent[-2]
    return np.angle(tangent)


def lagrange_velocities(points: FloatArray, closed: bool) -> tuple[FloatArray, FloatArray]:
    """Velocity at each point (n, 2) by chord length, of cubics through four successive points (Levien2009 (4.4)).

    Two such cubics pass through the two chords at an inner point, one for each chord as its middle; the mean of their
    derivatives is taken (Levien2009 does not say which). Near an open end there is one cubic only; three points have a
    parabola, two a line. Also the chord lengths.
    """
    n = len(points)
    if closed:
        reach = 3
        index = np.arange(-reach, n + reach) % n
        own = points[index]
    else:
        reach = 0
        own = points
    lengths = np.hypot(*np.diff(own, axis=0).T)
    t = np.concatenate([[0.0], np.cumsum(lengths)])
    m = len(own)
    width = min(4, m)
    velocity = np.zeros((m, 2))
    count = np.zeros(m)
    for chord in range(m - 1):
        first = min(max(chord - 1, 0), m - width)
        nodes = t[first : first + width]
        for end in (chord, chord + 1):
            velocity[end] += _slope(nodes, t[end]) @ own[first : first + width]
            count[end] += 1.0
    velocity /= count[:, None]
    chords = np.hypot(*np.diff(np.vstack([points, points[:1]]) if closed else points, axis=0).T)
    return velocity[reach : reach + n], chords


def _slope(nodes: FloatArray, t: float) -> FloatArray:
    """Weights of the derivative at t of the polynomial through values at the nodes."""
    n = len(nodes)
    out = np.zeros(n)
    for j in range(n):
        for k in range(n):
            if k == j:
                continue
            product = 1.0 / (nodes[j] - nodes[k])
            for i in range(n):
                if i not in (j, k):
                    product *= (t - nodes[i]) / (nodes[j] - nodes[i])
            out[j] += product
    return out


def hermite(p: FloatArray, q: FloatArray, velocity_p: FloatArray, velocity_q: FloatArray, chord: float) -> CubicBezier:
    """The cubic from p to q with these derivatives by a parameter that runs over the chord's length."""
    third = chord / 3.0
    return CubicBezier(np.stack([p, p + third * velocity_p, q - third * velocity_q, q]))


def biarc(p: FloatArray, angle_p: float, q: FloatArray, angle_q: float) -> PiecewiseCurve:
    """Two arcs from p to q with these tangents, joined with a common tangent, at equal arms (Ikarus; Levien2009 §4.5).

    The joint is free; here both control triangles have legs of one length d, the usual choice, which gives one arc where
    one arc fits. Lines are arcs of curvature 0.
    """
    v = q - p
    t0, t1 = (np.array([math.cos(a), math.sin(a)]) for a in (angle_p, angle_q))
    # (v − d(t0 + t1))² = (2d)²:  2d²(1 − t0·t1) + 2d v·(t0 + t1) − v·v = 0
    a, b, c = 2.0 * (1.0 - float(t0 @ t1)), 2.0 * float(v @ (t0 + t1)), -float(v @ v)
    root = math.sqrt(max(b * b - 4.0 * a * c, 0.0))
    d = -2.0 * c / (b + root) if b + root > 0.0 else (-b + root) / (2.0 * a)
    joint = 0.5 * (p + d * t0 + q - d * t1)
    return PiecewiseCurve([_arc(p, angle_p, joint), _arc(q, angle_q + math.pi, joint).reversed()])


def _arc(p: FloatArray, angle: float, q: FloatArray) -> Spiral:
    """The arc from p with this tangent to q."""
    v = q - p
    chord = float(np.hypot(*v))
    half = math.remainder(math.atan2(v[1], v[0]) - angle, 2.0 * math.pi)
    curvature = 2.0 * math.sin(half) / chord
    length = chord if half == 0.0 else chord * half / math.sin(half)
    return Spiral(p, angle, np.array([curvature]), length)


@dataclass(frozen=True, eq=False)
class BlendedArcs:
    """A segment of a circle spline: two arcs over one chord, blended by their angle (Séquin, Lee, Yin; Levien2009 §4.10).

    The point at t lies at the fraction t of the arc over the chord p–q whose angle to the chord is
    τ(t) = start·cos²(πt/2) + end·sin²(πt/2). The curvature at an end is that of the arc there; its derivative is not 0 as
    Levien2009 says, since τ″ is not.

    Parameters:
        p, q: the chord's ends, (2,).
        start, end: angles to the chord of the arc at the start and of the arc at the end, both at p, radians.
    """

    p: FloatArray
    q: FloatArray
    start: float
    end: float

    def point(self, t: ArrayLike) -> FloatArray:
        """Points, shape (…, 2)."""
        t = np.asarray(t, dtype=np.float64)
        blend = np.sin(0.5 * np.pi * t) ** 2
        angle = self.start * (1.0 - blend) + self.end * blend
        size = t * np.sinc(t * angle / np.pi) / np.sinc(angle / np.pi)
        chord = complex(*(np.asarray(self.q) - np.asarray(self.p)))
        z = chord * size * np.exp(1j * (1.0 - t) * angle)
        return np.stack([self.p[0] + z.real, self.p[1] + z.imag], axis=-1)

    @cached_property
    def _series(self) -> tuple[FloatArray, ...]:
        """Chebyshev coefficients of the point and its first three derivatives on [0, 1]."""
        nodes = 0.5 * (1.0 + np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1)))
        own = chebyshev.chebfit(2.0 * nodes - 1.0, self.point(nodes), _DEGREE)
        return tuple(np.asarray(chebyshev.chebder(own, m, scl=2.0) if m else own, dtype=np.float64) for m in range(4))

    def derivative(self, t: ArrayLike, order: int = 1) -> FloatArray:
        """Derivatives of order 1, 2 or 3, shape (…, 2); by a Chebyshev series of degree 40, to about 1e-9 of their size."""
        check_order(order)
        t = np.asarray(t, dtype=np.float64)
        return np.moveaxis(np.asarray(chebyshev.chebval(2.0 * t - 1.0, self._series[order]), dtype=np.float64), 0, -1)

    @cached_property
    def length(self) -> float:
        """The arc length."""
        x, w = np.polynomial.legendre.leggauss(64)
        return float(0.5 * w @ np.hypot(*self.derivative(0.5 * (x + 1.0)).T))

    def breaks(self) -> FloatArray:
        """Smooth: (0, 1)."""
        return np.array([0.0, 1.0])


def local_segments(method: str, points: FloatArray, closed: bool) -> tuple[list[Curve], FloatArray]:
    """The segments of a spline by a local method ("circle", "lagrange", "ikarus") and the tangent angles at the points."""
    n = len(points)
    following = [(i, (i + 1) % n) for i in range(n if closed else n - 1)]
    if n == 2:
        d = points[1] - points[0]
        angle = math.atan2(d[1], d[0])
        return [Spiral(points[0], angle, np.zeros(1), float(np.hypot(*d)))], np.array([angle, angle])
    if method == "circle":
        tangents = circle_tangents(points, closed)
        curves: list[Curve] = []
        for i, j in following:
            d = points[j] - points[i]
            chord = math.atan2(d[1], d[0])
            start = math.remainder(tangents[i] - chord, 2.0 * math.pi)
            end = math.remainder(chord - tangents[j], 2.0 * math.pi)
            curves.append(BlendedArcs(points[i], points[j], start, end))
        return curves, tangents
    velocity, chords = lagrange_velocities(points, closed)
    tangents = np.arctan2(velocity[:, 1], velocity[:, 0])
    if method == "lagrange":
        return [hermite(points[i], points[j], velocity[i], velocity[j], chords[i]) for i, j in following], tangents
    return [biarc(points[i], tangents[i], points[j], tangents[j]) for i, j in following], tangents
