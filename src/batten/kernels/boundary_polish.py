"""A solution of a boundary value problem made exact: Newton's method on the curve's own numbers, down to their last digits.

For these numbers lines, circles and k = 1 are nothing special.
"""

import math

import numpy as np
from numba import njit

from batten.kernels.boundary_value import incomplete
from batten.kernels.elastica import elastica_constants_exact, evaluate
from batten.kernels.elastica_jacobian import jacobian

# What is given: angles at both ends, curvature at the start, at the end, at both.
ANGLES, START_CURVATURE, END_CURVATURE, CURVATURES = 0, 1, 2, 3

PROBLEM, LENGTH = 9, 8

MET = 2e-12
"""What a solution misses without a search among its last digits: lengths, radians."""

_STEPS = 40
_GOOD = 8e-12  # what is good enough after a first search
_DIGITS, _MORE_DIGITS = 24, 240  # how many last digits are tried
_NODES = np.array([0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363])
_WEIGHTS = np.array([0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763])


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def end_residual(z, problem, kind, values, jac, system, residual):
    """What the curve z = (θ₀, κ₀, λ₁, λ₂) misses, into `residual` (3,), and its derivatives by the three free numbers.

    The free numbers are (κ₀, λ₁, λ₂), or (θ₀, λ₁, λ₂) where the start's curvature is given. `problem` (PROBLEM,) holds end
    point and angle, start and end curvature in its first five places, the length in LENGTH. Returns the greatest miss, in
    lengths, radians, curvature times length.
    """
    length = problem[LENGTH]
    end = np.full(1, length)
    constants = elastica_constants_exact(z[0], z[1], z[2], z[3])
    jacobian(0.0, 0.0, z[0], z[1], z[2], z[3], constants, end, values, jac)
    residual[0] = (values[0, 0] - problem[0]) / length
    residual[1] = (values[0, 1] - problem[1]) / length
    first = 2 if kind in (START_CURVATURE, CURVATURES) else 3
    for i in range(3):
        unit = length if i < 2 else 1.0
        system[i, 0], system[i, 1], system[i, 2] = jac[0, i, first] / unit, jac[0, i, 4] / unit, jac[0, i, 5] / unit
    if kind in (ANGLES, START_CURVATURE):
        residual[2] = values[0, 2] - problem[2]
    else:  # κ₁ = κ₀ + γ₁ × force
        residual[2] = (values[0, 3] - problem[4]) * length
        for j in range(3):
            system[2, j] = (system[0, j] * z[3] - system[1, j] * z[2]) * length**2
        system[2, 0] += length if first == 3 else 0.0
        system[2, 1] -= values[0, 1] * length
        system[2, 2] += values[0, 0] * length
    return max(abs(residual[0]), abs(residual[1]), abs(residual[2]))


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def solve3(m, b, x):
    """x of m x = b, 3 × 3 with pivots, columns scaled; False where m is singular to working precision. m is destroyed."""
    scale = np.empty(3)
    for j in range(3):
        scale[j] = max(abs(m[0, j]), abs(m[1, j]), abs(m[2, j]))
        if not (scale[j] > 0.0 and math.isfinite(scale[j])):
            return False
        for i in range(3):
            m[i, j] /= scale[j]
    for j in range(3):
        x[j] = b[j]
    for col in range(3):
        pivot = col
        for i in range(col + 1, 3):
            if abs(m[i, col]) > abs(m[pivot, col]):
                pivot = i
        if abs(m[pivot, col]) < 1e-15:
            return False
        if pivot != col:
            for j in range(3):
                m[col, j], m[pivot, j] = m[pivot, j], m[col, j]
            x[col], x[pivot] = x[pivot], x[col]
        for i in range(col + 1, 3):
            f = m[i, col] / m[col, col]
            for j in range(col, 3):
                m[i, j] -= f * m[col, j]
            x[i] -= f * x[col]
    for i in range(2, -1, -1):
        for j in range(i + 1, 3):
            x[i] -= m[i, j] * x[j]
        x[i] /= m[i, i]
    for j in range(3):
        x[j] /= scale[j]
    return True


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def polish(z, problem, kind):
    """Newton's method on z (4,) in place, steps halved that make it worse; returns what is still missed, or nan."""
    values, jac = np.empty((1, 4)), np.empty((1, 3, 6))
    system, residual, step = np.empty((3, 3)), np.empty(3), np.empty(3)
    trial = np.empty(4)
    first = 0 if kind in (START_CURVATURE, CURVATURES) else 1
    here = end_residual(z, problem, kind, values, jac, system, residual)
    for _ in range(_STEPS):
        if not math.isfinite(here):
            return math.nan
        if not solve3(system, residual, step):
            return here if here < 1e-13 else math.nan
        share, better = 1.0, False
        bend = 1.0 + abs(z[1]) + math.sqrt(math.hypot(z[2], z[3]))
        largest = max(abs(step[0]) / (bend if first else 1.0), math.hypot(step[1], step[2]) / (bend * bend))
        if largest > 0.5:
            share = 0.5 / largest
        for _ in range(12):
            for i in range(4):
                trial[i] = z[i]
            trial[first] -= share * step[0]
            trial[2] -= share * step[1]
            trial[3] -= share * step[2]
            there = end_residual(trial, problem, kind, values, jac, system, residual)
            if there < here:
                better = True
                break
            if here < 1e-12:
                break
            share *= 0.5
        if not better:
            return here
        z[:] = trial
        done = there > 0.3 * here and there < 1e-13
        here = there
        if done or here == 0.0:
            return here
    return here


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def settle(z, problem, kind):
    """Choose among the doubles next to z (4,), in place, those that miss least; returns what they miss.

    A rod pulled taut multiplies the rounding of its start by up to exp(√λ). One direction is so bad; sums of a few last
    digits of three numbers of different size come close to what is missed along it.
    """
    values, jac = np.empty((1, 4)), np.empty((1, 3, 6))
    system, residual = np.empty((3, 3)), np.empty(3)
    first = 0 if kind in (START_CURVATURE, CURVATURES) else 1
    which = (first, 2, 3)
    trial, best, digit = np.empty(4), np.empty(3), np.empty(3)
    here = end_residual(z, problem, kind, values, jac, system, residual)
    for attempt in range(4):
        if here < (MET if attempt == 0 else _GOOD):
            return here
        reach = _DIGITS if attempt == 0 else _MORE_DIGITS
        end_residual(z, problem, kind, values, jac, system, residual)
        for j in range(3):
            digit[j] = math.ldexp(1.0, max(math.frexp(z[which[j]])[1], -900) - 53)
            for i in range(3):
                system[i, j] *= digit[j]
        square = system[0, 2] ** 2 + system[1, 2] ** 2 + system[2, 2] ** 2
        if not square > 0.0:
            return here
        least = math.inf
        for m in range(-reach, reach + 1):
            for n in range(-reach, reach + 1):
                x = residual[0] + m * system[0, 0] + n * system[0, 1]
                y = residual[1] + m * system[1, 0] + n * system[1, 1]
                t = residual[2] + m * system[2, 0] + n * system[2, 1]
                p = -math.floor((x * system[0, 2] + y * system[1, 2] + t * system[2, 2]) / square + 0.5)
                size = max(abs(x + p * system[0, 2]), abs(y + p * system[1, 2]), abs(t + p * system[2, 2]))
                if size < least:
                    least = size
                    best[0], best[1], best[2] = m, n, p
        trial[:] = z
        for j in range(3):
            trial[which[j]] += best[j] * digit[j]
        there = end_residual(trial, problem, kind, values, jac, system, residual)
        if not there < here:
            return here
        z[:] = trial
        here = there
    return here


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def bending_and_inflections(z):
    """(∫κ² ds, inflections in the open interval) of the curve z = (θ₀, κ₀, λ₁, λ₂) of length 1."""
    constants = elastica_constants_exact(z[0], z[1], z[2], z[3])
    lam, q, a, c, delta, ux, uy = constants
    big_m = q * q + lam * a * a
    end = np.empty((1, 4))
    evaluate(0.0, 0.0, z[0], constants, np.ones(1), end)
    along = ux * end[0, 0] + uy * end[0, 1]
    energy = 4.0 * big_m - 2.0 * lam * (1.0 - along)
    if energy < 1e-3 * 4.0 * big_m:
        panels = int(min(math.ceil(math.sqrt(max(lam, big_m)) / 1.5) + 1.0, 1000.0))
        s = np.empty(8 * panels)
        for i in range(panels):
            for j in range(4):
                s[8 * i + 2 * j] = (i + 0.5 - 0.5 * _NODES[j]) / panels
                s[8 * i + 2 * j + 1] = (i + 0.5 + 0.5 * _NODES[j]) / panels
        state = np.empty((s.shape[0], 4))
        evaluate(0.0, 0.0, z[0], constants, s, state)
        energy = 0.0
        for i in range(s.shape[0]):
            energy += _WEIGHTS[(i % 8) // 2] * state[i, 3] * state[i, 3]
        energy *= 0.5 / panels
    count = 0
    if delta > 0.0 and big_m > 0.0:
        mc = delta / lam
        quarter, _ = incomplete(1.0, 0.0, mc)
        k = math.sqrt(big_m / lam)
        sine = min(max(a / k, -1.0), 1.0)
        cosine = q / math.sqrt(big_m)
        phase, _ = incomplete(sine, cosine * cosine, c * c)
        if q < 0.0:
            phase = 2.0 * quarter - phase
        arc = math.sqrt(lam)
        slack = 1e-9 * quarter
        # inflections at phases (2m + 1)K strictly inside (phase, phase + arc)
        low = math.floor((phase + slack) / (2.0 * quarter) + 0.5)
        high = math.ceil((phase + arc - slack) / (2.0 * quarter) - 0.5)
        count = int(max(high - low, 0.0))
    return energy, count
