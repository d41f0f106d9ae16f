"""Where an elastica with held ends stops being a minimum of the bending energy: its first conjugate point.

A segment is moved along the curve and scaled until λ = 1 and sin(ψ/2) = k sn t, cos(ψ/2) = dn t, κ = 2k cn t. The second
variation ∫ v′² − cos ψ v² with ∫ v sin ψ = ∫ v cos ψ = 0 has the Jacobi equation v″ + cos ψ v = α sin ψ + β cos ψ, whose
solutions are spanned by cn t (shift along the curve), 1 (rotation), t cn t (scaling) and w = sn t dn t − E(t) cn t (what is
left of ∂ψ/∂k; no division by 1 − k²). Seen from the middle τ of the segment [τ − p, τ + p], the determinant of "v vanishes
at both ends, the end does not move" is, up to a positive factor,

    D(p, τ) = sn p H(p) sn²τ dn²τ − f(p) g(p) cn²τ,

because at τ = 0 (a vertex of the curve) and at τ = K (an inflection) solutions are even or odd and the determinant splits.
With s, c, d = sn, cn, dn of p, E = E(p), J = ∫₀ᵖ sn², X = 2E − 2k²sc/d − p:

    f = sd − (2E − p)c,     g = ½{pc[E(1 + c²) − p + J − scd] − (sd − Ec)(s²p − J)},
    H = d³ det ⎡1           ps/d                Es/d                    ⎤    value at distance p from the inflection
               ⎢X           s/d − pc/d²         2k′²s/d − Ec/d² − cX    ⎥    displacement along the force
               ⎣k′²s/d      ½(J + sc/d − pc²/d²)    ½k′²(Es²/d² + J)    ⎦    displacement across it, over 2k.

Columns of H are 1, t cn, w − c·1 about the inflection, those with v′ = 0 there: so H(p) = 0 is also the conjugate point of a
rod that is pinned at an inflection and clamped at the distance p, and with the derivatives (0, s/d + pc/d², Ec/d²) in the
first row, N(p) = 0 that of a rod pinned at both ends. Nothing in these formulas is singular at k = 0 or cancels at k = 1.

The first zero of D lies between p = 2K and the zero p₁ of f in (K, 3K): Sachkov, Conjugate points in Euler's elastic
problem (2008), where the same bounds were proven with another form of D.
"""

import math

import numpy as np
from numba import njit

from batten.kernels.elastica import _TERMS, base_at, base_series, elastica_constants_exact, point_on

CLAMPED, PINNED, CLAMPED_PINNED, PINNED_CLAMPED = 0, 1, 2, 3

#: k² below which a rod in compression counts as straight: its inclination to the force stays below 2e-7.
STRAIGHT = 1e-14
#: |κ|·L that passes for none at a pinned end, times max(1, greatest |κ| of the curve × L).
PINNED_CURVATURE = 1e-6
#: z = √λ L at which a straight rod buckles: pinned, clamped, clamped and pinned (tan z = z).
Z_PINNED, Z_CLAMPED, Z_MIXED = math.pi, 2.0 * math.pi, 4.493409457909064
#: Where the determinant of pinned ends first touches zero between 2K and 3K, as k grows, over K.
TOUCH = 2.41377635669838

_F, _D, _H, _N = 0, 1, 2, 3  # the functions of `determinant`


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def determinant(which, p, k2, q2, sn0, cn0, dn0, ser, wer):
    """f, D, H or N (`which` = 0 … 3) at p, for k² and q2 = 1 − k²; D for the segment of length 2p that starts at sn₀."""
    s, c, d, j = base_at(p, 1.0, k2, q2, ser, wer)
    e = p - k2 * j
    f = s * d - (2.0 * e - p) * c
    if which == 0:
        return f
    r = 1.0 / d
    sd, cd2 = s * r, c * r * r
    x = 2.0 * e - 2.0 * k2 * sd * c - p
    along2 = sd - p * cd2
    along3 = 2.0 * q2 * sd - e * cd2 - c * x
    across1 = q2 * sd
    across2 = 0.5 * (j + sd * c - p * c * cd2)
    across3 = 0.5 * q2 * (e * sd * sd + j)
    minor2 = x * across3 - along3 * across1
    minor3 = x * across2 - along2 * across1
    if which == 3:
        return e * cd2 * minor3 - (sd + p * cd2) * minor2
    h = d * d * d * (along2 * across3 - along3 * across2 - p * sd * minor2 + e * sd * minor3)
    if which == 2:
        return h
    g = 0.5 * (p * c * (e * (1.0 + c * c) - p + j - s * c * d) - (s * d - e * c) * (s * s * p - j))
    scale = 1.0 / (c * c + dn0 * dn0 * s * s)
    sn = scale * (sn0 * c * d + s * cn0 * dn0)
    cn = scale * (cn0 * c - sn0 * dn0 * s * d)
    dn = scale * (dn0 * d - k2 * sn0 * cn0 * s * c)
    return s * h * sn * sn * dn * dn - f * g * cn * cn


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def first_zero(which, low, high, k2, q2, sn0, cn0, dn0, ser, wer):
    """Zero of `determinant` in [low, high], positive at low and negative at high (both may be 0): Chandrupatla's method.

    The signs at the ends are known from theory and not looked at: at both ends the determinant may vanish by symmetry.
    """
    a, fa = high, min(determinant(which, high, k2, q2, sn0, cn0, dn0, ser, wer), -1e-300)
    b, fb = low, max(determinant(which, low, k2, q2, sn0, cn0, dn0, ser, wer), 1e-300)
    c, fc = a, fa
    part = 0.5
    for _ in range(120):
        t = a + part * (b - a)
        ft = determinant(which, t, k2, q2, sn0, cn0, dn0, ser, wer)
        if (ft > 0.0) == (fa > 0.0):
            c, fc = a, fa
        else:
            c, fc, b, fb = b, fb, a, fa
        a, fa = t, ft
        best = a if abs(fa) < abs(fb) else b
        slack = 2e-15 * abs(best) / max(abs(b - a), 1e-300)
        if slack > 0.5 or ft == 0.0:
            return best
        xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
        if phi * phi < xi and (1.0 - phi) * (1.0 - phi) < 1.0 - xi:
            part = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
        else:
            part = 0.5
        part = min(1.0 - slack, max(slack, part))
    return 0.5 * (a + b)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def quarter_period(q2):
    """K by the arithmetic-geometric mean, from 1 − k² > 0."""
    x, y = 1.0, math.sqrt(q2)
    while abs(x - y) > 4e-16 * x:
        x, y = 0.5 * (x + y), math.sqrt(x * y)
    return 0.5 * math.pi / x


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def pinned_ends_are_straight(kappa, length, ends_code, lam, q, a, c, delta, ser, wer):
    """Whether the curvature vanishes at the pinned ends, within `PINNED_CURVATURE`."""
    top = 2.0 * math.sqrt(q * q + lam * a * a) * length
    allowed = PINNED_CURVATURE * max(1.0, top)
    if (ends_code == 1 or ends_code == 3) and not abs(kappa) * length <= allowed:
        return False
    if ends_code == 1 or ends_code == 2:
        _, _, _, _, q1 = point_on(length, lam, q, a, c, delta, ser, wer)
        return 2.0 * abs(q1) * length <= allowed
    return True


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def conjugate_length(theta, kappa, fx, fy, length, ends_code):
    """Arc length of the first conjugate point of the elastica, continued beyond its length; inf if there is none.

    From the start for clamped ends (code 0), from the pinned end for one pinned end (2: the end, 3: the start) and for two
    (1). NaN for numbers that are not finite, a length that is not positive, curvature at a pinned end.
    """
    if not (math.isfinite(theta + kappa + fx + fy + length) and length > 0.0 and 0 <= ends_code <= 3):
        return math.nan
    lam, q, a, c, delta, _, _ = elastica_constants_exact(theta, kappa, fx, fy)
    big_m = q * q + lam * a * a
    if ends_code == 0 and (delta <= 0.0 or lam == 0.0):
        return math.inf
    ser, wer = np.empty(_TERMS), np.empty(_TERMS)
    top = max(lam, big_m)
    base_series(min(lam, big_m) / top if top > 0.0 else 0.0, ser, wer)
    if ends_code != 0 and not pinned_ends_are_straight(kappa, length, ends_code, lam, q, a, c, delta, ser, wer):
        return math.nan
    if delta <= 0.0 or lam == 0.0:
        return math.inf
    root = math.sqrt(lam)
    k2, q2 = big_m / lam, delta / lam
    if k2 < STRAIGHT:
        return (Z_CLAMPED if ends_code == 0 else (Z_PINNED if ends_code == 1 else Z_MIXED)) / root
    quarter = quarter_period(q2)
    if ends_code >= 2:
        return first_zero(2, 1.5 * quarter, 3.88 * quarter, k2, q2, 0.0, 1.0, 1.0, ser, wer) / root
    if ends_code == 1:
        low, high = 2.0 * quarter, TOUCH * quarter
        if determinant(3, low, k2, q2, 0.0, 1.0, 1.0, ser, wer) <= 0.0:
            low, high = quarter, low
        elif determinant(3, high, k2, q2, 0.0, 1.0, 1.0, ser, wer) > 0.0:
            low, high = high, 3.2 * quarter
        return first_zero(3, low, high, k2, q2, 0.0, 1.0, 1.0, ser, wer) / root
    full = 2.0 * quarter
    vertex = first_zero(0, quarter, 3.0 * quarter, k2, q2, 0.0, 1.0, 1.0, ser, wer)
    amplitude = 1.0 / math.sqrt(big_m)
    sn0, cn0 = root * a * amplitude, q * amplitude
    return 2.0 * first_zero(1, min(full, vertex), max(full, vertex), k2, q2, sn0, cn0, c, ser, wer) / root


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def conjugate_length_batch(parameters, ends_code, out):
    """`conjugate_length` of n elastica (x, y, θ, κ, λ₁, λ₂, length), shape (n, 7), into out (n,)."""
    for i in range(parameters.shape[0]):
        _, _, theta, kappa, fx, fy, length = parameters[i]
        out[i] = conjugate_length(theta, kappa, fx, fy, length, ends_code)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def inclination_batch(parameters, fractions, out):
    """(sin ψ, cos ψ), ψ the angle from the force to the tangent, at `fractions` (m,) of n elastica: out (n, m, 2)."""
    ser, wer = np.empty(_TERMS), np.empty(_TERMS)
    for i in range(parameters.shape[0]):
        _, _, theta, kappa, fx, fy, length = parameters[i]
        lam, q, a, c, delta, _, _ = elastica_constants_exact(theta, kappa, fx, fy)
        big_m = q * q + lam * a * a
        top = max(lam, big_m)
        base_series(min(lam, big_m) / top if top > 0.0 else 0.0, ser, wer)
        for j in range(fractions.shape[0]):
            _, _, a1, c1, _ = point_on(fractions[j] * length, lam, q, a, c, delta, ser, wer)
            out[i, j, 0] = 2.0 * a1 * c1
            out[i, j, 1] = (c1 - a1) * (c1 + a1)
