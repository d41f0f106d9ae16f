"""Every elastica between two held ends: charts of the two unknowns that are left, and a search that subdivides them.

The rod has length 1, starts in (0, 0) with angle 0, ends in d with angle Δ ≥ 0 (others are mirrored or turned before).
With ψ = θ − arg(force) it is the pendulum ψ″ = −λ sin ψ. Fix how many inflections it has and the sign of its first
curvature: then the axis (ψ₀) and the modulus k say everything, since incomplete elliptic integrals give √λ, and with it
the end point. What is left is a map of the plane of these two numbers onto that of the end point, on a bounded domain;
every preimage of d is a solution.

Charts. With inflections (k < 1): ψ₀/2 = −Δ/4 + e, ψ₁/2 = Δ/4 + e and k = sin α allow the triangle |e| ≤ r = α − Δ/4,
0 ≤ r ≤ R = π/2 − Δ/4; on its sides an end curvature vanishes. e = r sin η takes away the square roots there; r = Rv²/2
that at the tip (chart 0), R − r = (R/2) exp(1 − 1/w) the logarithm at k = 1 (chart 1). Without (k > 1): ψ₀/2 mod π, and
1 − k⁻² = ½ exp(1 − 1/w) (chart 2); around the circle k⁻² (cos ψ₀, sin ψ₀) (chart 3). Charts 4 and 5, for a given curvature
at one end or both, have ψ and √λ at the start.
"""

import math

import numpy as np
from numba import njit

from batten.kernels.elastica import _TERMS, base_series, elastica_constants, half_turn, point_on, turning_rate

INFLECTED, INFLECTED_HIGH, TURNING, ROUND, CURVATURE_ANGLE, CURVATURE_CURVATURE = 0, 1, 2, 3, 4, 5
INTEGRALS = 11

SOFT_CELL = 4
"""The last cell of charts 4 and 5."""

_NEAREST = 28.0  # to k = 1, in charts 4 and 5: exp(−28)
_SOFT = 2.0  # least √λ of the polar cells of charts 4 and 5
_DISC = 0.55  # half the side of chart 3, more than its part of the disc k⁻² ≤ 1
_SPREAD = 0.012  # of the three arguments at which Carlson's series is summed: error below 1e-15


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def incomplete(s, c2, d2):
    """(F, ∫₀ᶠ sn²) of an amplitude with sine s, squared cosine c2, 1 − k²s² = d2: Carlson's R_F and R_D; inf at k = 1."""
    if c2 + d2 < 1e-300:
        return math.copysign(math.inf, s), math.copysign(math.inf, s)
    x, y, z = c2, d2, 1.0
    sum_d, factor = 0.0, 1.0
    mean = 0.0
    for _ in range(600):
        mean = (x + y + z) / 3.0
        if max(abs(x - mean), abs(y - mean), abs(z - mean)) < _SPREAD * mean:
            break
        rx, ry, rz = math.sqrt(x), math.sqrt(y), math.sqrt(z)
        move = rx * ry + ry * rz + rz * rx
        sum_d += factor / (rz * (z + move))
        factor *= 0.25
        x, y, z = 0.25 * (x + move), 0.25 * (y + move), 0.25 * (z + move)
    dx, dy = 1.0 - x / mean, 1.0 - y / mean
    dz = -dx - dy
    e2, e3 = dx * dy - dz * dz, dx * dy * dz
    rf = (1.0 - e2 / 10.0 + e3 / 14.0 + e2 * e2 / 24.0 - 3.0 * e2 * e3 / 44.0) / math.sqrt(mean)
    mean = 0.2 * (x + y + 3.0 * z)
    dx, dy = 1.0 - x / mean, 1.0 - y / mean
    dz = -(dx + dy) / 3.0
    xy, zz = dx * dy, dz * dz
    e2, e3, e4, e5 = xy - 6.0 * zz, (3.0 * xy - 8.0 * zz) * dz, 3.0 * (xy - zz) * zz, xy * zz * dz
    series = 1.0 - 3.0 * e2 / 14.0 + e3 / 6.0 + 9.0 * e2 * e2 / 88.0 - 3.0 * e4 / 22.0 - 9.0 * e2 * e3 / 52.0
    series += 3.0 * e5 / 26.0
    rd = factor * series / (mean * math.sqrt(mean)) + 3.0 * sum_d
    return s * rf, s * s * s * rd / 3.0


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def inflected_integrals(high, u, v, turn, out):
    """What charts 0 and 1 need at (u, v), however many inflections there are, into `out` (INTEGRALS,).

    F and ∫sn² at both ends' amplitudes in (−π/2, π/2) and of the quarter period, their cosines, k, cos and sin of ψ₀.
    """
    big = 0.5 * math.pi - 0.25 * turn
    if high:
        rest = 0.5 * big * math.exp(1.0 - 1.0 / v)
        r = big - rest
    else:
        r = 0.5 * big * v * v
        rest = big - r
    k, mc = math.sin(0.25 * turn + r), math.sin(rest) ** 2  # rest = π/2 − α
    low, top = r * 2.0 * math.sin(0.5 * math.pi * u) ** 2, r * 2.0 * math.sin(0.5 * math.pi * (1.0 - u)) ** 2
    e = -r * math.cos(math.pi * u)
    a, b = -0.25 * turn + e, 0.25 * turn + e
    c2a = max(math.sin(0.5 * turn + top) * math.sin(low), 0.0) / (k * k)
    c2b = max(math.sin(top) * math.sin(0.5 * turn + low), 0.0) / (k * k)
    da, db = math.sin(rest + min(low, 0.5 * turn + top)), math.sin(rest + min(top, 0.5 * turn + low))
    out[0], out[1] = incomplete(math.sin(a) / k, c2a, da * da)
    out[2], out[3] = incomplete(math.sin(b) / k, c2b, db * db)
    out[4], out[5] = incomplete(1.0, 0.0, mc)
    out[6], out[7], out[8] = math.sqrt(c2a), math.sqrt(c2b), k
    out[9], out[10] = math.cos(2.0 * a), math.sin(2.0 * a)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def inflected_end(integrals, cell, count, out):
    """The end point for `count` inflections after a first curvature that is positive if `cell` is 0, negative if 1.

    Into out[0:2]; the start's κ₀, λ₁, λ₂ into out[2:5]; all nan where there is no such curve.
    """
    f0, g0, f1, g1, quarter, quarter_g, c0, c1, k, cos, sin = integrals
    sign0 = 1.0 if cell == 0 else -1.0
    sign1 = 1.0 if (cell + count) % 2 == 0 else -1.0
    arc = sign1 * f1 - sign0 * f0 + 2.0 * quarter * count
    if not arc > 0.0:
        out[:] = math.nan
        return
    moved = sign1 * g1 - sign0 * g0 + 2.0 * quarter_g * count
    x = (arc - 2.0 * k * k * moved) / arc
    y = 2.0 * k * (sign0 * c0 - sign1 * c1) / arc
    out[0], out[1] = cos * x + sin * y, cos * y - sin * x  # the force lies at angle −ψ₀
    out[2] = 2.0 * k * sign0 * c0 * arc
    out[3], out[4] = arc * arc * cos, -arc * arc * sin


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _turning_integrals(h, p2, mc, quarter, quarter_g):
    m = math.floor(h / math.pi + 0.5)
    s, c = math.sin(h - m * math.pi), math.cos(h - m * math.pi)
    d2 = c * c + mc * s * s
    f, g = incomplete(s, c * c, d2)
    return f + 2.0 * quarter * m, g + 2.0 * quarter_g * m, math.sqrt(d2)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _turning(around, u, v, turn, out):
    """Chart 2, or 3 if `around`: curvature positive throughout; `out` as in `inflected_end`."""
    if around:
        x, y = _DISC * (2.0 * u - 1.0), _DISC * (2.0 * v - 1.0)
        p2 = math.hypot(x, y)
        mc = 1.0 - p2
        a = 0.5 * math.atan2(y, x)
    else:
        mc = 0.5 * math.exp(1.0 - 1.0 / v)
        p2 = 1.0 - mc
        a = math.pi * u
    b = a + 0.5 * turn
    quarter, quarter_g = incomplete(1.0, 0.0, mc)
    f0, g0, q0 = _turning_integrals(a, p2, mc, quarter, quarter_g)
    f1, g1, q1 = _turning_integrals(b, p2, mc, quarter, quarter_g)
    arc = f1 - f0
    if not arc > 0.0:
        out[:] = math.nan
        return
    x = (arc - 2.0 * (g1 - g0)) / arc
    y = 2.0 * math.sin(0.5 * turn) * math.sin(a + b) / ((q0 + q1) * arc)
    cos, sin = math.cos(2.0 * a), -math.sin(2.0 * a)
    lam = p2 * arc * arc
    out[0], out[1] = cos * x - sin * y, sin * x + cos * y
    out[2] = 2.0 * q0 * arc
    out[3], out[4] = lam * cos, lam * sin


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _free_force(cell, u, v, q, most):
    """(λ, ψ₀) of charts 4 and 5, for a start curvature ±2q.

    Cells 0 to 3: √λ from 2 to `most`, and ψ₀ inside and outside ±ψ*, where k = 1, by the logarithm of the distance from
    there: around it the map is wild. Cell 4: λ (cos ψ₀, sin ψ₀), for the neighbourhood of λ = 0.
    """
    if cell == SOFT_CELL:
        x, y = 1.05 * _SOFT**2 * (2.0 * u - 1.0), 1.05 * _SOFT**2 * (2.0 * v - 1.0)
        return math.hypot(x, y), math.atan2(y, x)
    root = _SOFT + (most - _SOFT) * v
    border = 2.0 * math.acos(min(q / root, 1.0))
    near = math.exp(-_NEAREST * (1.0 - u))
    psi = border * (1.0 - near) if cell < 2 else border + (math.pi - border) * near
    return root * root, psi if cell % 2 == 0 else -psi


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def prepare(problem):
    """Put into problem[6:8] what `aim` needs: the chord, and √(1 − chord²) or −1 if the rod is far from straight."""
    chord = math.hypot(problem[0], problem[1])
    problem[6] = chord
    problem[7] = math.sqrt(max((1.0 - chord) * (1.0 + chord), 0.0)) if chord > 0.9 else -1.0


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def aim(x, y, problem):
    """Two numbers that vanish where (x, y) is the end point.

    Near a straight line the length in excess goes with the square of the deflection; its root is compared there, so that
    the charts' maps are nearly linear. The opposite point is kept away from zero.
    """
    if problem[7] < 0.0:
        return x - problem[0], y - problem[1]
    cos, sin = problem[0] / problem[6], problem[1] / problem[6]
    short = math.sqrt(max(1.0 - x * x - y * y, 0.0)) - problem[7]
    return y * cos - x * sin, short + max(0.0, -(x * cos + y * sin))


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def chart_point(chart, cell, count, u, v, problem, out):
    """What a chart says at (u, v): out[0:2] is what has to vanish, out[2:6] the start (κ₀, λ₁, λ₂, θ₀) of the curve.

    `problem` (8,): d_x, d_y, Δ, given start curvature, given end curvature, greatest √λ; then what `prepare` puts there.
    """
    if chart <= INFLECTED_HIGH:
        integrals = np.empty(INTEGRALS)
        inflected_integrals(chart == INFLECTED_HIGH, u, v, problem[2], integrals)
        inflected_end(integrals, cell, count, out)
        out[5] = 0.0
    elif chart <= ROUND:
        _turning(chart == ROUND, u, v, problem[2], out)
        out[5] = 0.0
    else:
        kappa = problem[3]
        lam, psi = _free_force(cell, u, v, 0.5 * abs(kappa), problem[5])
        _, q, a, c, delta, _, _ = elastica_constants(psi, kappa, lam, 0.0)
        big_m = q * q + lam * a * a
        top = max(lam, big_m)
        ser, wer = np.empty(_TERMS), np.empty(_TERMS)
        base_series(min(lam, big_m) / top if top > 0.0 else 0.0, ser, wer)
        x, y, a1, c1, q1 = point_on(1.0, lam, q, a, c, delta, ser, wer)
        if chart == CURVATURE_ANGLE:
            psi_end = psi + 2.0 * half_turn(1.0, a, c, a1, c1, turning_rate(lam, q, a, delta))
            phi = problem[2] - psi_end
            cos, sin = math.cos(phi), math.sin(phi)
            out[0], out[1] = cos * x - sin * y, sin * x + cos * y
        else:
            phi = math.atan2(problem[1], problem[0]) - math.atan2(y, x)
            cos, sin = math.cos(phi), math.sin(phi)
            out[0] = math.hypot(x, y) - math.hypot(problem[0], problem[1])
            out[1] = (2.0 * q1 - problem[4]) / (1.0 + abs(problem[4]))
        out[2], out[3], out[4], out[5] = kappa, lam * cos, lam * sin, psi + phi
    if chart != CURVATURE_CURVATURE:
        out[0], out[1] = aim(out[0], out[1], problem)
