"""The elastica to more than thirty digits, by Taylor series of its differential equation in integer arithmetic.

Nothing here knows an elliptic function. In force form the elastica is the initial value problem

    x' = cos θ,  y' = sin θ,  θ' = κ,  κ = κ₀ + x λ₂ − y λ₁       (x, y measured from the start point)

whose right-hand side is polynomial in (x, y, c, s) with c = cos θ, s = sin θ, c' = −κ s, s' = κ c. So the Taylor
coefficients follow from one another by products of series, and a step may be as long as the series converges quickly.
The derivatives with respect to θ₀, κ₀, λ₁, λ₂ solve the variational equations θ_p' = κ_p, x_p' = −s θ_p, y_p' = c
θ_p, integrated alongside.

All numbers are integers scaled by 2^208 (62 digits), on a curve scaled to unit length. Every step goes on until its
terms are below 2^-180; an error grows along the curve at most as the derivatives do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from operator import mul

import mpmath

BITS = 208
TAIL_BITS = 180
STEP = 0.25  # step length × the largest frequency; the series' radius of convergence is above one in this unit
PARAMETERS = ("start_angle", "start_curvature", "force_x", "force_y")


@dataclass(frozen=True)
class ReferencePoint:
    """The elastica at one arc length: mpf values, position relative to the start point.

    `derivatives[p]` holds (x, y, θ, κ) differentiated by θ₀, κ₀, λ₁, λ₂ in this order.
    """

    s: mpmath.mpf
    x: mpmath.mpf
    y: mpmath.mpf
    angle: mpmath.mpf
    curvature: mpmath.mpf
    derivatives: tuple[tuple[mpmath.mpf, ...], ...]


def _fixed(value: mpmath.mpf) -> int:
    return int(mpmath.nint(mpmath.ldexp(value, BITS)))


def _product(a: int, b: int) -> int:
    return (a * b) >> BITS


def _convolve(a: list[int], b: list[int], n: int) -> int:
    return sum(map(mul, a[: n + 1], b[n::-1])) >> BITS


@dataclass
class _State:
    x: int
    y: int
    turned: int
    cos: int
    sin: int
    variations: list[list[int]]  # (θ_p, x_p, y_p) for every parameter


_CURVATURE_SOURCE = ((0, 0, 0), (1, 0, 0), (0, -1, 0), (0, 0, 1))  # ∂κ/∂p at fixed position: 1·a + y·b + x·c


def _step(state: _State, h: int, k0: int, f1: int, f2: int, vary: bool) -> None:
    """Advance `state` by h with as many Taylor terms as it takes."""
    one = 1 << BITS
    x, y, turn, cos, sin = [state.x], [state.y], [state.turned], [state.cos], [state.sin]
    kappa: list[int] = []
    series = [[[v] for v in variation] for variation in state.variations] if vary else []
    size = [max(1, *(abs(v) >> BITS for v in variation)) for variation in state.variations] if vary else []
    small = 0
    for n in range(400):
        kappa.append(_product(f2, x[n]) - _product(f1, y[n]) + (k0 if n == 0 else 0))
        m = n + 1
        x.append(_product(h, cos[n]) // m)
        y.append(_product(h, sin[n]) // m)
        turn.append(_product(h, kappa[n]) // m)
        cos.append(_product(-h, _convolve(kappa, sin, n)) // m)
        sin.append(_product(h, _convolve(kappa, cos, n)) // m)
        largest = max(abs(cos[m]), abs(sin[m]), abs(turn[m]))
        for p, (angle_p, x_p, y_p) in enumerate(series):
            const, by_y, by_x = _CURVATURE_SOURCE[p]
            kappa_p = _product(f2, x_p[n]) - _product(f1, y_p[n]) + by_y * y[n] + by_x * x[n]
            if n == 0:
                kappa_p += const * one
            x_p.append(_product(-h, _convolve(sin, angle_p, n)) // m)
            y_p.append(_product(h, _convolve(cos, angle_p, n)) // m)
            angle_p.append(_product(h, kappa_p) // m)
            largest = max(largest, *(abs(v[m]) // size[p] for v in (angle_p, x_p, y_p)))
        small = small + 1 if largest >> (BITS - TAIL_BITS) == 0 else 0
        if small == 3:
            break
    else:
        raise ArithmeticError("the Taylor series of the reference did not converge: shorten STEP")
    state.x, state.y, state.turned, state.cos, state.sin = sum(x), sum(y), sum(turn), sum(cos), sum(sin)
    if vary:
        state.variations = [[sum(v) for v in variation] for variation in series]


def reference_points(
    start_angle: float,
    start_curvature: float,
    force: tuple[float, float],
    arc_lengths: list[float],
    *,
    derivatives: bool = True,
) -> list[ReferencePoint]:
    """The elastica in force form at the given arc lengths (all of one sign, growing away from zero).

    The arguments are taken as exact numbers: floats or mpf.
    """
    with mpmath.workdps(80):
        angle0, curvature0, force_x, force_y = (mpmath.mpf(v) for v in (start_angle, start_curvature, *force))
        unit = max(abs(mpmath.mpf(s)) for s in arc_lengths) or mpmath.mpf(1)
        k0, f1, f2 = _fixed(curvature0 * unit), _fixed(force_x * unit**2), _fixed(force_y * unit**2)
        cos0, sin0 = _fixed(mpmath.cos(angle0)), _fixed(mpmath.sin(angle0))
        one = 1 << BITS
        start = [[one, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]
        state = _State(0, 0, 0, cos0, sin0, start if derivatives else [])
        root_force = math.sqrt(math.hypot(f1 / one, f2 / one))
        at = 0
        points = []
        for s in arc_lengths:
            target = _fixed(mpmath.mpf(s) / unit)
            while at != target:
                kappa = k0 + _product(f2, state.x) - _product(f1, state.y)
                longest = int(STEP / max(abs(kappa / one), root_force, 0.25) * 2**60) << (BITS - 60)
                h = max(-longest, min(longest, target - at))
                _step(state, h, k0, f1, f2, derivatives)
                at += h
            points.append(_unscaled(state, s, unit, angle0, k0, f1, f2))
        return points


def _unscaled(
    state: _State, s: float, unit: mpmath.mpf, angle0: mpmath.mpf, k0: int, f1: int, f2: int
) -> ReferencePoint:
    def real(value: int) -> mpmath.mpf:
        return mpmath.ldexp(mpmath.mpf(value), -BITS)

    kappa = k0 + _product(f2, state.x) - _product(f1, state.y)
    rows = []
    for p, (angle_p, x_p, y_p) in enumerate(state.variations):
        const, by_y, by_x = _CURVATURE_SOURCE[p]
        kappa_p = _product(f2, x_p) - _product(f1, y_p) + by_y * state.y + by_x * state.x + const * (1 << BITS)
        by_unit = unit ** (0, 1, 2, 2)[p]  # d(scaled parameter) / d(parameter)
        rows.append(
            (
                real(x_p) * unit * by_unit,
                real(y_p) * unit * by_unit,
                real(angle_p) * by_unit,
                real(kappa_p) * by_unit / unit,
            )
        )
    return ReferencePoint(
        mpmath.mpf(s),
        real(state.x) * unit,
        real(state.y) * unit,
        angle0 + real(state.turned),
        real(kappa) / unit,
        tuple(rows),
    )


def closed_form_point(
    start_angle: float, start_curvature: float, force: tuple[float, float], s: float
) -> tuple[mpmath.mpf, mpmath.mpf, mpmath.mpf]:
    """Position relative to the start, and curvature, through mpmath's elliptic functions: a check of the first way.

    With λ = |F|, φ = arg F, u = √λ s the basic elastica of modulus k is ζ(u) = (2E(u) − u, 2k(1 − cn u)), Brander2016
    §2.2, with E(u) = ∫₀ᵘ dn². For k > 1 the substitution w = k u, q = 1/k gives x = (1 − 2/q²) u + (2/q) E_q(w),
    Fisker2018 (A.2). Not for force = 0 nor k = 1.
    """
    angle0, curvature0 = mpmath.mpf(start_angle), mpmath.mpf(start_curvature)
    force_x, force_y = mpmath.mpf(force[0]), mpmath.mpf(force[1])
    size = mpmath.hypot(force_x, force_y)
    phi = mpmath.atan2(force_y, force_x)
    root = mpmath.sqrt(size)
    half = (angle0 - phi) / 2
    half -= mpmath.pi * mpmath.nint(half / mpmath.pi)
    k_sn, k_cn = mpmath.sin(half), curvature0 / (2 * root)
    k = mpmath.hypot(k_sn, k_cn)
    if k < 1:
        q, amplitude = k, mpmath.atan2(k_sn, k_cn)
        turn = 1
    else:
        q, turn = 1 / k, k * mpmath.sign(k_cn)
        amplitude = half * mpmath.sign(k_cn)
    m = q * q
    u0 = mpmath.ellipf(amplitude, m)
    u1 = u0 + abs(turn) * root * mpmath.mpf(s)
    am1 = _amplitude(u1, m)
    epsilon = mpmath.ellipe(am1, m) - mpmath.ellipe(amplitude, m)
    if k < 1:
        x = 2 * epsilon - (u1 - u0)
        y = 2 * k * (mpmath.cos(amplitude) - mpmath.cos(am1))
        curvature = 2 * k * root * mpmath.cos(am1)
    else:
        x = (1 - 2 / m) * (u1 - u0) * q + 2 / q * epsilon
        dn0, dn1 = (mpmath.sqrt(1 - m * mpmath.sin(a) ** 2) for a in (amplitude, am1))
        y = mpmath.sign(turn) * 2 * k * (dn0 - dn1)
        curvature = mpmath.sign(turn) * 2 * k * root * dn1
    cos, sin = mpmath.cos(phi), mpmath.sin(phi)
    return (x * cos - y * sin) / root, (x * sin + y * cos) / root, curvature


def _amplitude(u: mpmath.mpf, m: mpmath.mpf) -> mpmath.mpf:
    quarter = mpmath.ellipk(m)
    turns = mpmath.nint(u / (2 * quarter))
    rest = u - 2 * quarter * turns
    sn, cn = mpmath.ellipfun("sn", rest, m=m), mpmath.ellipfun("cn", rest, m=m)
    return mpmath.atan2(sn, cn) + mpmath.pi * turns
