"""One elastica between two tangents whose ends slide: the segments of MEC, tension and SI-MEC splines.

The curve has length 1, starts at the origin along the x-axis, with curvature κ₀ and force f. To its chord it makes the
angles `start` and `end`: χ = −start for the angle χ of the chord, θ(1) = end − start. A third condition makes it unique:
MEC with tension c per chord²:  ½κ₀² − f·t₀ = ½c/chord²  (Levien2009 Result 4 for c = 0, §4.2 else)
SI-MEC (kurgla 1):              f · chord = 0            (Levien2009 §3.11)
Newton's method in (κ₀, f), from the last solution and through angles between if need be.
"""

import math

import numpy as np
from numba import njit

from batten.kernels.elastica import elastica_constants
from batten.kernels.elastica_jacobian import jacobian
from batten.kernels.linear import solve_linear
from batten.kernels.spiral import BAD_INPUT, CONVERGED, FAILED

_STEPS = 40
_FULL_TURN = 2.0 * math.pi


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _equations(z, start, end, tension, upright, values, tangents, miss, matrix):
    """Residuals of the three conditions at z = (κ₀, f₁, f₂) and their derivatives (3, 3) by z; returns the chord."""
    kappa, fx, fy = z[0], z[1], z[2]
    one = np.ones(1)
    jacobian(0.0, 0.0, 0.0, kappa, fx, fy, elastica_constants(0.0, kappa, fx, fy), one, values, tangents)
    x, y, theta = values[0, 0], values[0, 1], values[0, 2]
    square = x * x + y * y
    if not square > 1e-24:
        miss[:] = math.inf
        return 0.0
    chord = math.sqrt(square)
    # The angle from the wanted direction of the chord, −start.
    c, s = math.cos(start), math.sin(start)
    along, across = c * x - s * y, s * x + c * y
    miss[0] = math.atan2(across, along)
    miss[1] = theta - (end - start)
    for j in range(3):
        dx, dy, dt = tangents[0, 0, 3 + j], tangents[0, 1, 3 + j], tangents[0, 2, 3 + j]
        matrix[0, j] = (x * dy - y * dx) / square
        matrix[1, j] = dt
        if upright:
            matrix[2, j] = (fx * dx + fy * dy) / chord
            if j == 1:
                matrix[2, j] += x / chord
            if j == 2:
                matrix[2, j] += y / chord
            matrix[2, j] -= (fx * x + fy * y) * (x * dx + y * dy) / (chord * square)
        else:
            matrix[2, j] = tension * (x * dx + y * dy) / (square * square)
            if j == 0:
                matrix[2, j] += kappa
            if j == 1:
                matrix[2, j] -= 1.0
    if upright:
        miss[2] = (fx * x + fy * y) / chord
    else:
        miss[2] = 0.5 * kappa * kappa - fx - 0.5 * tension / square
    return chord


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _newton(z, start, end, tension, upright, values, tangents, miss, matrix):
    """Newton's method from z, in place; whether it converged."""
    step = np.empty(3)
    system = np.empty((3, 3))
    scale = 1.0 + z[0] * z[0] + abs(z[1]) + abs(z[2])
    least = math.inf
    for _ in range(_STEPS):
        _equations(z, start, end, tension, upright, values, tangents, miss, matrix)
        size = max(abs(miss[0]), abs(miss[1]), abs(miss[2]) / scale)
        if not size < 1e3:
            return False
        if size < 1e-15 or (size < 1e-12 and size >= 0.5 * least):
            return True
        least = min(least, size)
        system[:] = matrix
        step[:] = miss
        if not solve_linear(system, step, 3):
            return False
        length = max(abs(step[0]), abs(step[1]) / (1.0 + abs(z[0])), abs(step[2]) / (1.0 + abs(z[0])))
        if not length < 1e6:
            return False
        factor = min(1.0, 1.5 / length) if length > 0.0 else 1.0
        for j in range(3):
            z[j] -= factor * step[j]
    return False


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _ends(z, chord, values, tangents, matrix, out):
    """The row `out` of `sliding_segment` for a solution."""
    kappa, fx, fy = z[0], z[1], z[2]
    x, y = values[0, 0], values[0, 1]
    last = values[0, 3]
    out[0] = chord
    out[1] = kappa * chord
    out[2] = last * chord
    system = np.empty((3, 3))
    by = np.empty(3)
    for k in range(2):
        system[:] = matrix
        # miss = (χ + start, θ − end + start, …): minus its derivatives by the angle.
        by[0] = -1.0 if k == 0 else 0.0
        by[1] = -1.0 if k == 0 else 1.0
        by[2] = 0.0
        if not solve_linear(system, by, 3):
            by[:] = math.nan
        d_x = 0.0
        d_y = 0.0
        for j in range(3):
            d_x += tangents[0, 0, 3 + j] * by[j]
            d_y += tangents[0, 1, 3 + j] * by[j]
        d_chord = (x * d_x + y * d_y) / chord
        # κ(1) = κ₀ + x f₂ − y f₁
        d_last = by[0] + d_x * fy + x * by[2] - d_y * fx - y * by[1]
        out[3 + k] = by[0] * chord + kappa * d_chord
        out[5 + k] = d_last * chord + last * d_chord


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def sliding_segment(start, end, tension, upright, known, z, out):
    """Solve for one segment; known: angles and tension (3,) of the solution in z (3,), replaced on success.

    Returns a status.

    out: chord over length, the curvatures at the ends for chord 1, their derivatives (at the start by start, end; at the end
    by start, end).
    """
    for j in range(7):
        out[j] = math.nan
    if not (math.isfinite(start) and math.isfinite(end) and math.isfinite(tension)):
        return BAD_INPUT
    values = np.empty((1, 4))
    tangents = np.empty((1, 3, 6))
    miss = np.empty(3)
    matrix = np.empty((3, 3))
    trial = np.empty(3)
    done_start, done_end, done_tension = known[0], known[1], known[2]
    part = 1.0
    for _ in range(60):
        aim_start = done_start + part * (start - done_start)
        aim_end = done_end + part * (end - done_end)
        aim_tension = done_tension + part * (tension - done_tension)
        trial[:] = z
        good = _newton(trial, aim_start, aim_end, aim_tension, upright, values, tangents, miss, matrix)
        # A curve that turns once more, or a jump to another branch, is not what lies next.
        if good:
            reach = 4.0 * (abs(aim_start - done_start) + abs(aim_end - done_end)) + abs(aim_tension - done_tension)
            good = abs(trial[0] - z[0]) <= reach * (2.0 + abs(z[0])) + 1e-6
        if good:
            z[:] = trial
            done_start, done_end, done_tension = aim_start, aim_end, aim_tension
            known[0], known[1], known[2] = done_start, done_end, done_tension
            if part == 1.0:
                chord = _equations(z, start, end, tension, upright, values, tangents, miss, matrix)
                _ends(z, chord, values, tangents, matrix, out)
                return CONVERGED
            part = 1.0
        else:
            part *= 0.5
            if part < 1e-3:
                break
    return FAILED


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def sliding_batch(angles, tension, upright, known, z, out, status):
    """`sliding_segment` for rows (start, end) with tension (n,); known (n, 3), z (n, 3) hold the last solutions."""
    for i in range(angles.shape[0]):
        status[i] = sliding_segment(angles[i, 0], angles[i, 1], tension[i], upright, known[i], z[i], out[i])
