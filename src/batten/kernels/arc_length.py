"""The inverse of an arc length that is a polynomial on each panel of a curve."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

_TERMS = 25
#: P_{n+1}(x) = _GAIN[n] x P_n(x) − _LOSS[n] P_{n−1}(x), Legendre's polynomials.
_GAIN = (2.0 * np.arange(_TERMS) + 1.0) / (np.arange(_TERMS) + 1.0)
_LOSS = np.arange(_TERMS) / (np.arange(_TERMS) + 1.0)
_STEPS = 60
_STILL = 2e-15


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def parameters_batch(goals, edges, lengths, coefficients, slopes, out):
    """Parameters of n arc lengths, (n,), where panels (p,) begin and end at `edges` and `lengths`, both (p + 1,).

    `coefficients`, (p, 25), and `slopes`, (p, 24), are arc length within a panel and its derivative, in Legendre polynomials
    of x ∈ [−1, 1] along the panel. Newton's iteration, kept inside a bracket that shrinks at every step.
    """
    last = edges.shape[0] - 2
    for i in range(goals.shape[0]):
        if not math.isfinite(goals[i]):
            out[i] = math.nan
            continue
        low_panel, high_panel = 0, last + 1  # lengths[low] <= goal < lengths[high], but for the ends
        while high_panel - low_panel > 1:
            middle = (low_panel + high_panel) // 2
            if lengths[middle] <= goals[i]:
                low_panel = middle
            else:
                high_panel = middle
        panel = min(low_panel, last)
        goal, size = goals[i] - lengths[panel], lengths[panel + 1] - lengths[panel]
        left, right = edges[panel], edges[panel + 1]
        if not size > 0.0:
            out[i] = left
            continue
        low, high, x = -1.0, 1.0, 2.0 * goal / size - 1.0
        for _ in range(_STEPS):
            before, now = 0.0, 1.0
            error, slope = -goal, 0.0
            for n in range(_TERMS - 1):
                error += coefficients[panel, n] * now
                slope += slopes[panel, n] * now
                before, now = now, _GAIN[n] * x * now - _LOSS[n] * before
            error += coefficients[panel, _TERMS - 1] * now
            # What is right to rounding stays: at zero speed the quotient of two roundings would throw it off.
            if abs(error) <= _STILL * size:
                break
            if error < 0.0:
                low = x
            else:
                high = x
            new = x - error / slope if slope != 0.0 else low
            if not low <= new <= high or slope == 0.0:
                new = 0.5 * (low + high)
            change, x = abs(new - x), new
            if change <= _STILL:
                break
        out[i] = min(max(left + 0.5 * (x + 1.0) * (right - left), left), right)
