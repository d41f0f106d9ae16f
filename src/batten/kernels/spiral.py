"""Curves whose curvature is a cubic of the arc length: their moments, and the Euler spiral between two tangents.

The unit segment has s ∈ [−½, ½] and θ(s) = k₀ s + k₁ s²/2 + k₂ s³/6 + k₃ s⁴/24, so that k₀ … k₃ are curvature and its
derivatives in the middle, for length 1. Its moments are Mⱼ = ∫ sʲ exp(iθ(s)) ds; M₀ is the chord as a complex number.

exp(iθ) is entire. On a panel the 16-node Gauss rule errs by at most (64/15)·M·ρ^(−32)/(1 − ρ^(−2)) half widths, where M
bounds |exp(iθ)| = exp(−Im θ) on the Bernstein ellipse with semi-axes' sum ρ, in half widths. `panels_for` divides until
this bound, for the best of some ρ, meets the tolerance.
"""

import math

import numpy as np
from numba import njit

from batten.kernels.quadrature import NODES_16, WEIGHTS_16

CONVERGED = 0
NO_SOLUTION = 1
FAILED = 2
BAD_INPUT = 3

_TWO_PI = 2.0 * math.pi
_RHO = np.array([2.0, 3.0, 4.5, 6.5, 9.5])


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def panels_for(k0, k1, k2, k3, tolerance):
    """A number of equal panels of [−½, ½] for which the bound on the error of M₀ is below `tolerance`; 0: over 4096."""
    wanted = math.log(tolerance)
    n = 1
    while n <= 4096:
        h = 0.5 / n
        for rho in _RHO:
            big, small = 0.5 * (rho + 1.0 / rho), 0.5 * (rho - 1.0 / rho)
            # |θ'| on the ellipse about the panel's middle: its points are at most ½ + (big − 1)·h from 0.
            r = 0.5 + (big - 1.0) * h
            slope = abs(k0) + r * (abs(k1) + r * (0.5 * abs(k2) + r * abs(k3) / 6.0))
            # n panels of half width h: n·h = ½.
            rest = math.log(64.0 / 30.0 / (1.0 - rho**-2)) - 32.0 * math.log(rho)
            if slope * small * h + rest <= wanted:
                return n
        n = n + 1 if n < 8 else n + n // 4
    return 0


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def moments(k0, k1, k2, k3, panels, most, out):
    """out[2j], out[2j + 1] = real and imaginary part of Mⱼ for j = 0 … most, by `panels` 16-node rules."""
    for j in range(2 * most + 2):
        out[j] = 0.0
    width = 1.0 / panels
    for p in range(panels):
        left = -0.5 + p * width
        for i in range(16):
            s = left + width * NODES_16[i]
            theta = s * (k0 + s * (0.5 * k1 + s * (k2 / 6.0 + s * k3 / 24.0)))
            w = width * WEIGHTS_16[i]
            c = w * math.cos(theta)
            d = w * math.sin(theta)
            for j in range(most + 1):
                out[2 * j] += c
                out[2 * j + 1] += d
                c *= s
                d *= s


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _chord(k0, k1, work):
    """(χ, ∂χ/∂k₀, ∂χ/∂k₁, c, ∂ ln c/∂k₀, ∂ ln c/∂k₁) of an Euler spiral of length 1: angle and length of its chord."""
    panels = max(panels_for(k0, k1, 0.0, 0.0, 1e-16), 1)
    moments(k0, k1, 0.0, 0.0, panels, 2, work)
    x, y = work[0], work[1]
    square = x * x + y * y
    if square < 1e-30:
        return math.nan, 0.0, 0.0, 0.0, 0.0, 0.0
    # d(ln M₀) = dM₀/M₀ with dM₀ = i M₁ dk₀ + ½ i M₂ dk₁.
    re0 = (-work[3] * x + work[2] * y) / square
    im0 = (work[2] * x + work[3] * y) / square
    re1 = 0.5 * (-work[5] * x + work[4] * y) / square
    im1 = 0.5 * (work[4] * x + work[5] * y) / square
    return math.atan2(y, x), im0, im1, math.sqrt(square), re0, re1


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _ends(k0, k1, c, by0, slope, log0, log1, out):
    """The row `out` of `euler_spiral`; slope = ⅛ − ∂χ/∂k₁, by0 = ∂χ/∂k₀, log0 and log1 the derivatives of ln c."""
    # k₁/8 − χ(k₀, k₁) = (start + end)/2 and k₀ = end − start.
    along_mean = 1.0 / slope
    along_turn = by0 / slope
    d_start = 0.5 * along_mean - along_turn
    d_end = 0.5 * along_mean + along_turn
    kappa_start = k0 - 0.5 * k1
    kappa_end = k0 + 0.5 * k1
    out[0] = k0
    out[1] = k1
    out[2] = c
    out[3] = kappa_start * c
    out[4] = kappa_end * c
    out[5] = c * (-1.0 - 0.5 * d_start + kappa_start * (-log0 + log1 * d_start))
    out[6] = c * (1.0 - 0.5 * d_end + kappa_start * (log0 + log1 * d_end))
    out[7] = c * (-1.0 + 0.5 * d_start + kappa_end * (-log0 + log1 * d_start))
    out[8] = c * (1.0 + 0.5 * d_end + kappa_end * (log0 + log1 * d_end))


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def euler_spiral(start, end, work, out):
    """The Euler spiral of chord 1 along the x-axis with tangent angles `start` and `end`, |end − start| < 2π.

    k₀ = end − start is known. The mean m of the angles is k₁/8 − χ(k₀, k₁), where χ is the angle of the chord to the
    tangent in the middle; this grows with k₁, from −∞ to ∞, so there is one k₁. Newton's method, kept in a bracket.

    out: k₀, k₁ (for length 1), c (chord over length), the curvatures at the ends for chord 1, and their derivatives: of the
    one at the start by start and end, of the one at the end by start and end. Returns a status.
    """
    for j in range(9):
        out[j] = math.nan
    if not (math.isfinite(start) and math.isfinite(end)):
        return BAD_INPUT
    k0 = end - start
    mean = 0.5 * (start + end)
    if not abs(k0) < _TWO_PI:
        return NO_SOLUTION
    # χ lies in (−π/2, 1.06) for k₁ > 0, and is odd in k₁.
    low = 8.0 * (abs(mean) - 1.58)
    if low < 0.0:
        low = 0.0
    high = 8.0 * (abs(mean) + 1.1)
    sign = 1.0 if mean >= 0.0 else -1.0
    target = abs(mean)
    k1 = min(max(12.0 * target * (1.0 - (k0 / _TWO_PI) ** 2), low), high)
    if target == 0.0:
        k1 = 0.0
    status = FAILED
    last = math.inf
    for _ in range(80):
        chi, by0, by1, c, log0, log1 = _chord(k0, k1, work)
        miss = 0.125 * k1 - chi - target
        slope = 0.125 - by1
        if miss > 0.0:
            high = k1
        else:
            low = k1
        step = -miss / slope if slope > 0.0 else math.nan
        if abs(miss) <= 4e-16 * (1.0 + target) or (abs(step) < 1e-13 * (1.0 + k1) and abs(step) >= 0.5 * last):
            status = CONVERGED
            break
        last = abs(step)
        following = k1 + step
        if not (low < following < high):
            following = 0.5 * (low + high)
            if following == k1:
                status = CONVERGED
                break
        k1 = following
    if status == FAILED and abs(miss) < 1e-13 * (1.0 + target):
        status = CONVERGED
    _ends(k0, sign * k1, c, sign * by0, slope, log0, sign * log1, out)
    return status


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def euler_spiral_batch(angles, out, status):
    """`euler_spiral` for rows (start, end) of angles; out is (n, 9)."""
    work = np.empty(6)
    for i in range(angles.shape[0]):
        status[i] = euler_spiral(angles[i, 0], angles[i, 1], work, out[i])


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def spiral_points(curvatures, length, tolerance, fractions, out):
    """Points along a curve that starts at (0, 0) along the x-axis; curvatures: κ and its derivatives at the start.

    fractions ascending; out: (n, 2). Between neighbours as many panels as the tolerance asks for.
    """
    k0 = curvatures[0] * length
    k1 = curvatures[1] * length**2
    k2 = curvatures[2] * length**3
    k3 = curvatures[3] * length**4
    x = 0.0
    y = 0.0
    before = 0.0
    work = np.empty(2)
    for i in range(fractions.shape[0]):
        t = fractions[i]
        h = t - before
        if h != 0.0:
            m = 0.5 * (t + before)
            # Taylor's series about the middle of the interval, for length 1.
            a0 = h * (k0 + m * (k1 + m * (0.5 * k2 + m * k3 / 6.0)))
            a1 = h * h * (k1 + m * (k2 + 0.5 * m * k3))
            a2 = h * h * h * (k2 + m * k3)
            a3 = h * h * h * h * k3
            theta = m * (k0 + m * (0.5 * k1 + m * (k2 / 6.0 + m * k3 / 24.0)))
            moments(a0, a1, a2, a3, max(panels_for(a0, a1, a2, a3, tolerance), 1), 0, work)
            c = math.cos(theta)
            s = math.sin(theta)
            x += h * (c * work[0] - s * work[1])
            y += h * (s * work[0] + c * work[1])
            before = t
        out[i, 0] = length * x
        out[i, 1] = length * y
