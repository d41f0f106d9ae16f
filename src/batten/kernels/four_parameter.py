"""Segments with curvature cubic in arc length: what their ends are to a chord of 1, with derivatives.

Levien2009 ch. 7. The unit segment is that of `kernels.spiral`: k₀ … k₃ are curvature and derivatives in the middle, for
length 1. Its chord M₀ = c·exp(iχ) has d ln M₀ = i Σ Mⱼ₊₁/(j+1)! dkⱼ / M₀, so all derivatives are exact.
"""

import math

import numpy as np
from numba import njit

from batten.kernels.spiral import BAD_INPUT, CONVERGED, NO_SOLUTION, moments, panels_for

WIDTH = 42
_TOLERANCE = 1e-16
_SMALLEST_CHORD = 1e-9
# θ, κ, κ′, κ″ at ½ by k₀ … k₃; at −½ the sign of every second one changes.
_AT_END = np.array(
    [
        [0.5, 0.125, 1.0 / 48.0, 1.0 / 384.0],
        [1.0, 0.5, 0.125, 1.0 / 48.0],
        [0.0, 1.0, 0.5, 0.125],
        [0.0, 0.0, 1.0, 0.5],
    ]
)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def segment_ends(k, work, out):
    """One segment of chord 1 along the x-axis; k: k₀ … k₃ for length 1. Returns a status.

    out: c (chord over length), χ (angle of the chord to the tangent in the middle, in (−π, π]); then angle, κ, κ′, κ″ at
    the start and the same at the end, for chord 1; then the derivatives of these eight by k₀ … k₃. work: 10 numbers.
    """
    for j in range(WIDTH):
        out[j] = math.nan
    if not math.isfinite(abs(k[0]) + abs(k[1]) + abs(k[2]) + abs(k[3])):
        return BAD_INPUT
    panels = panels_for(k[0], k[1], k[2], k[3], _TOLERANCE)
    if panels == 0:
        return NO_SOLUTION
    moments(k[0], k[1], k[2], k[3], panels, 4, work)
    x, y = work[0], work[1]
    square = x * x + y * y
    if square < _SMALLEST_CHORD**2:
        return NO_SOLUTION
    c = math.sqrt(square)
    chi = math.atan2(y, x)
    out[0], out[1] = c, chi
    for side in range(2):
        scale = 1.0
        for order in range(4):
            turn = 1.0 if side == 1 else -1.0  # of the sign from one parameter to the next
            first = 1.0 if side == 1 or order % 2 == 1 else -1.0
            value = 0.0
            sign = first
            for p in range(4):
                value += sign * _AT_END[order, p] * k[p]
                sign *= turn
            out[2 + 4 * side + order] = scale * value if order > 0 else value - chi
            sign = first
            factorial = 1.0
            for p in range(4):
                factorial *= p + 1.0
                re, im = work[2 * p + 2] / factorial, work[2 * p + 3] / factorial
                # i·M/M₀: real part is the derivative of ln c, imaginary part that of χ.
                by_log = (re * y - im * x) / square
                by_chi = (re * x + im * y) / square
                own = sign * _AT_END[order, p]
                sign *= turn
                if order == 0:
                    out[10 + 16 * side + p] = own - by_chi
                else:
                    out[10 + 16 * side + 4 * order + p] = scale * (own + order * value * by_log)
            scale *= c
    return CONVERGED


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def segment_ends_batch(middle, out, status):
    """`segment_ends` for rows k₀ … k₃; out is (n, WIDTH)."""
    work = np.empty(10)
    for i in range(middle.shape[0]):
        status[i] = segment_ends(middle[i], work, out[i])
