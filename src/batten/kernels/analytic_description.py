"""Rows of elastica of least L² distance to the pieces of a spline, joined with common tangents or curvatures.

Unknowns are those of `elastica_fit` for each piece, about its middle: (x, y, θ, κℓ, f₁, f₂, ℓ). A step minimises the
Gauss–Newton model under the linearised conditions at the joints; multipliers are eliminated piece by piece, so that a block
tridiagonal system is left and the cost is linear in pieces.
"""

import math

import numpy as np
from numba import njit

from batten.kernels.elastica import elastica_constants, evaluate
from batten.kernels.elastica_fit import force_form, lagrangian
from batten.kernels.elastica_fit_batch import to_unknowns
from batten.kernels.linear import copy, solve_linear

JOINED, NOT_JOINED, BAD_SPLINE = 0, 1, 2
_ITERATIONS = 100
_CORRECTIONS = 3
_TIGHT = 1e-12  # greatest jump at a joint, in mean lengths of a piece and radians
_STILL = 1e-8  # decrease of the squared distance that a step would bring, of the squared distance
_FAR = 4.0  # times the neighbour's squared distance: then the spline's own guess is tried too
_EXACT = 1e-20  # squared distance of a spline that is one of elastica


@njit(cache=True, no_cfunc_wrapper=True)
def end_conditions(mid, values, jac, row, k, out, rows):
    """(x, y, θ, κ) at sample `row` into out, the first k of them, with derivatives (k, 7) into rows."""
    ell = mid[6]
    for j in range(3):
        out[j] = values[row, j]
        for a in range(7):
            rows[j, a] = jac[row, j, a]
    if k < 4:
        return
    c, s = math.cos(mid[2]), math.sin(mid[2])
    dx, dy = values[row, 0] - mid[0], values[row, 1] - mid[1]
    u, v = (c * dx + s * dy) / ell, (c * dy - s * dx) / ell
    f1, f2 = mid[4], mid[5]
    out[3] = (mid[3] + u * f2 - v * f1) / ell
    for a in range(7):
        rows[3, a] = 0.0
    for a in range(3, 6):
        gx, gy = jac[row, 0, a], jac[row, 1, a]
        rows[3, a] = ((c * gx + s * gy) * f2 - (c * gy - s * gx) * f1) / (ell * ell)
    rows[3, 3] += 1.0 / ell
    rows[3, 4] -= v / ell
    rows[3, 5] += u / ell
    rows[3, 6] = -out[3] / ell


@njit(cache=True, no_cfunc_wrapper=True)
def _cholesky(matrix, n):
    """L of a positive matrix in its lower triangle. False if it is none."""
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            if i == j:
                if not total > 0.0:
                    return False
                matrix[i, i] = math.sqrt(total)
            else:
                matrix[i, j] = total / matrix[j, j]
    return True


@njit(cache=True, no_cfunc_wrapper=True)
def _by_cholesky(lower, rhs, n):
    """Solve L Lᵀ x = rhs in place."""
    for i in range(n):
        total = rhs[i]
        for k in range(i):
            total -= lower[i, k] * rhs[k]
        rhs[i] = total / lower[i, i]
    for i in range(n - 1, -1, -1):
        total = rhs[i]
        for k in range(i + 1, n):
            total -= lower[k, i] * rhs[k]
        rhs[i] = total / lower[i, i]


@njit(cache=True, no_cfunc_wrapper=True)
def measure(mids, points, weights, fractions, k, work, grads, models, tips, slopes, jumps):
    """½ squared distance of all pieces.

    Fills gradients (c, 7), Gauss–Newton matrices (c, 7, 7), states (c, 2, 4) at both ends with derivatives (c, 2, 4, 7), and
    jumps (c − 1, 4) at the joints, the first k of each.
    """
    theta, s, values, jac, ends, none, dull_c, dull_a = work
    total = 0.0
    last = fractions.shape[1] - 1
    for i in range(mids.shape[0]):
        total += lagrangian(
            mids[i], points[i], theta, weights[i], fractions[i], False, 0.0, ends, 0, none, s, values, jac, grads[i],
            models[i], dull_c, dull_a,
        )  # fmt: skip
        end_conditions(mids[i], values, jac, 0, k, tips[i, 0], slopes[i, 0])
        end_conditions(mids[i], values, jac, last, k, tips[i, 1], slopes[i, 1])
    for i in range(mids.shape[0] - 1):
        for j in range(k):
            jumps[i, j] = tips[i, 1, j] - tips[i + 1, 0, j]
    return total


@njit(cache=True, no_cfunc_wrapper=True)
def joint_step(grads, models, slopes, jumps, k, mu, steps, nu):
    """The step (c, 7) to the minimum of the damped model under the linearised conditions, and multipliers (c − 1, 4).

    Returns the decrease that the model without damping promises; NaN if a matrix is singular.
    """
    c = grads.shape[0]
    lower, scale = np.empty((c, 7, 7)), np.empty((c, 7))
    free, response = np.empty((c, 7)), np.empty((c, 2, 4, 7))  # G⁻¹g, and G⁻¹ times the conditions' rows
    for i in range(c):
        for a in range(7):
            scale[i, a] = 1.0 / math.sqrt(models[i, a, a] + 1e-12)
        for a in range(7):
            for b in range(7):
                lower[i, a, b] = models[i, a, b] * scale[i, a] * scale[i, b]
            lower[i, a, a] += mu + 1e-13
        if not _cholesky(lower[i], 7):
            return math.nan
        for a in range(7):
            free[i, a] = grads[i, a] * scale[i, a]
        _by_cholesky(lower[i], free[i], 7)
        for e in range(2):
            for j in range(k):
                for a in range(7):
                    response[i, e, j, a] = slopes[i, e, j, a] * scale[i, a]
                _by_cholesky(lower[i], response[i, e, j], 7)
    if c > 1:
        # (A G⁻¹ Aᵀ) ν = jumps − A G⁻¹ g, block tridiagonal; forward elimination in place
        diagonal, upper, rhs = np.empty((c - 1, 4, 4)), np.empty((c - 1, 4, 4)), np.empty((c - 1, 4))
        work, column = np.empty((4, 4)), np.empty(4)
        for i in range(c - 1):
            for j in range(k):
                rhs[i, j] = jumps[i, j]
                for a in range(7):
                    rhs[i, j] -= slopes[i, 1, j, a] * scale[i, a] * free[i, a]
                    rhs[i, j] += slopes[i + 1, 0, j, a] * scale[i + 1, a] * free[i + 1, a]
                for h in range(k):
                    total, across = 0.0, 0.0
                    for a in range(7):
                        total += slopes[i, 1, j, a] * scale[i, a] * response[i, 1, h, a]
                        behind = slopes[i + 1, 0, j, a] * scale[i + 1, a]
                        total += behind * response[i + 1, 0, h, a]
                        across -= behind * response[i + 1, 1, h, a]
                    diagonal[i, j, h], upper[i, j, h] = total, across
            if i > 0:  # diagonal −= upperᵀ(i−1) · [diagonal⁻¹ upper](i−1): columns of `upper` were solved for
                for j in range(k):
                    for h in range(k):
                        for b in range(k):
                            diagonal[i, j, h] -= work[b, j] * upper[i - 1, b, h]
                    for b in range(k):
                        rhs[i, j] -= work[b, j] * rhs[i - 1, b]
            for j in range(k):
                for h in range(k):
                    work[j, h] = upper[i, j, h]
            for h in range(k + 1):  # the columns of upper and the right side, times diagonal⁻¹
                system = diagonal[i].copy()
                for j in range(k):
                    column[j] = work[j, h] if h < k else rhs[i, j]
                if not solve_linear(system, column, k):
                    return math.nan
                for j in range(k):
                    if h < k:
                        upper[i, j, h] = column[j]
                    else:
                        rhs[i, j] = column[j]
        for i in range(c - 2, -1, -1):
            for j in range(k):
                nu[i, j] = rhs[i, j]
                if i < c - 2:
                    for h in range(k):
                        nu[i, j] -= upper[i, j, h] * nu[i + 1, h]
    decrease = 0.0
    for i in range(c):
        for a in range(7):
            total = free[i, a]
            for j in range(k):
                if i < c - 1:
                    total += nu[i, j] * response[i, 1, j, a]
                if i > 0:
                    total -= nu[i - 1, j] * response[i, 0, j, a]
            steps[i, a] = -scale[i, a] * total
        for a in range(7):
            bend = 0.0
            for b in range(7):
                bend += models[i, a, b] * steps[i, b]
            decrease -= steps[i, a] * (grads[i, a] + 0.5 * bend)
    return decrease


@njit(cache=True, no_cfunc_wrapper=True)
def join_pieces(mids, points, weights, fractions, k):
    """Move `mids` (c, 7) to the least distance under the conditions: (status, ½ squared distance, iterations, jump)."""
    c, n = mids.shape[0], weights.shape[1]
    work = (np.zeros(n), np.empty(n), np.empty((n, 4)), np.empty((n, 3, 7)), np.zeros((2, 3)), np.zeros(6), np.zeros(6),
            np.zeros((6, 7)))  # fmt: skip
    grads, models, tips = np.empty((c, 7)), np.empty((c, 7, 7)), np.zeros((c, 2, 4))
    slopes, jumps = np.zeros((c, 2, 4, 7)), np.zeros((max(c - 1, 1), 4))
    grads2, models2, tips2 = np.empty((c, 7)), np.empty((c, 7, 7)), np.zeros((c, 2, 4))
    slopes2, jumps2 = np.zeros((c, 2, 4, 7)), np.zeros((max(c - 1, 1), 4))
    steps, nu, trial = np.zeros((c, 7)), np.zeros((max(c - 1, 1), 4)), np.empty((c, 7))
    value = measure(mids, points, weights, fractions, k, work, grads, models, tips, slopes, jumps)
    none, dull = np.zeros((c, 7)), np.zeros((max(c - 1, 1), 4))
    mu, penalty = 1e-9, 0.0
    gap = np.abs(jumps).max()
    for iteration in range(_ITERATIONS):
        if not math.isfinite(value):
            return BAD_SPLINE, math.inf, iteration, math.inf
        decrease = joint_step(grads, models, slopes, jumps, k, mu, steps, nu)
        accepted, new = False, math.inf
        if math.isfinite(decrease):
            if gap <= _TIGHT and (decrease <= _STILL * value or value < _EXACT):
                return JOINED, value, iteration, gap
            penalty = max(2.0 * np.abs(nu).max(), 0.5 * penalty) + 1e-12
            good = True
            for i in range(c):
                for a in range(7):
                    trial[i, a] = mids[i, a] + steps[i, a]
                good = good and trial[i, 6] > 0.2 * mids[i, 6] and abs(steps[i, 2]) < 1.0
            if good:
                new = measure(trial, points, weights, fractions, k, work, grads2, models2, tips2, slopes2, jumps2)
                before = value + penalty * np.abs(jumps).sum()
                for correction in range(_CORRECTIONS + 1):
                    gap2 = np.abs(jumps2).max()
                    # at the last digits of the jumps the merit cannot tell any more
                    if new + penalty * np.abs(jumps2).sum() < before or (
                        gap < 1e-9 and gap2 < 1e-9 and new <= value * (1.0 + 1e-6) + _EXACT
                    ):
                        accepted = True
                        break
                    if correction == _CORRECTIONS or not (gap2 < 2.0 and math.isfinite(new)):
                        break
                    # The jumps grew by curvature alone: back onto the conditions, with the least change of the fit.
                    if not math.isfinite(joint_step(none, models2, slopes2, jumps2, k, mu, steps, dull)):
                        break
                    for i in range(c):
                        for a in range(7):
                            trial[i, a] += steps[i, a]
                        good = good and trial[i, 6] > 0.2 * mids[i, 6] and abs(trial[i, 2] - mids[i, 2]) < 2.0
                    if not good:
                        break
                    new = measure(trial, points, weights, fractions, k, work, grads2, models2, tips2, slopes2, jumps2)
        if accepted:
            for i in range(c):
                copy(trial[i], mids[i])
            grads, grads2, models, models2, tips, tips2 = grads2, grads, models2, models, tips2, tips
            slopes, slopes2, jumps, jumps2 = slopes2, slopes, jumps2, jumps
            value, gap = new, np.abs(jumps).max()
            mu = max(0.1 * mu, 1e-12)
            continue
        mu = max(10.0 * mu, 1e-8)
        if mu > 1e6:
            break
    return NOT_JOINED, value, _ITERATIONS, gap


@njit(cache=True, no_cfunc_wrapper=True)
def _onto(mid, first, last):
    """Turn, scale and move a piece so that it runs from one point to another; as it is if its own ends coincide."""
    s, tips = np.array([-0.5 * mid[6], 0.5 * mid[6]]), np.empty((2, 4))
    kappa, fx, fy = force_form(mid)
    evaluate(mid[0], mid[1], mid[2], elastica_constants(mid[2], kappa, fx, fy), s, tips)
    x, y = tips[1, 0] - tips[0, 0], tips[1, 1] - tips[0, 1]
    square = x * x + y * y
    if not square > 1e-12 * mid[6] * mid[6]:
        return
    wx, wy = last[0] - first[0], last[1] - first[1]
    c, sn = (x * wx + y * wy) / square, (x * wy - y * wx) / square  # scale · (cos, sin) of the turn
    dx, dy = mid[0] - tips[0, 0], mid[1] - tips[0, 1]
    mid[0], mid[1] = first[0] + c * dx - sn * dy, first[1] + sn * dx + c * dy
    mid[2] += math.atan2(sn, c)
    mid[6] *= math.hypot(c, sn)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def describe_batch(points, weights, fractions, ends, guesses, k, params, info, status):
    """Splines of c pieces, one after the other, each started from the one before.

    points (m, c, n, 2), weights (m, c, n), fractions (m, c, n), ends (m, c, 2, 2), guesses (m, c, 7) in force form, already
    scaled and turned onto the ends. k: 3 or 4 conditions at a joint. Fills params (m, c, 7) about the middles, in force
    form, info (m, 3) = normalised L² distance, iterations, greatest jump at a joint, and status (m,).
    """
    m, c, n = weights.shape
    p, w, f = np.zeros((c, n + 2, 2)), np.zeros((c, n + 2)), np.zeros((c, n + 2))
    e, mids, other, state = np.empty((c, 2, 2)), np.empty((c, 7)), np.empty((c, 7)), np.empty((1, 4))
    half = np.empty(1)
    known, known_value = False, 0.0
    for b in range(m):
        length = 0.0
        for i in range(c):
            for j in range(7):
                params[b, i, j] = math.nan
            for q in range(n):
                length += weights[b, i, q]
        whole, length = length, length / c  # the unit is the mean length of a piece
        status[b] = BAD_SPLINE
        info[b, 0], info[b, 1], info[b, 2] = math.nan, 0.0, math.nan
        if not length > 0.0:
            continue
        check = length
        x0, y0 = ends[b, 0, 0, 0], ends[b, 0, 0, 1]
        for i in range(c):
            for q in range(n):
                p[i, q + 1, 0], p[i, q + 1, 1] = (points[b, i, q, 0] - x0) / length, (points[b, i, q, 1] - y0) / length
                w[i, q + 1], f[i, q + 1] = weights[b, i, q] / length, fractions[b, i, q]
                check += p[i, q + 1, 0] + p[i, q + 1, 1] + f[i, q + 1]
            f[i, n + 1] = 1.0
            for j in range(2):
                e[i, j, 0], e[i, j, 1] = (ends[b, i, j, 0] - x0) / length, (ends[b, i, j, 1] - y0) / length
        for i in range(c):
            check += 0.0 if guesses[b, i, 6] > 0.0 else math.nan
        if not math.isfinite(check):
            continue
        value = math.inf
        for attempt in range(2):
            if attempt == 0:
                if not known:
                    continue
                for i in range(c):
                    copy(mids[i], other[i])
                    _onto(other[i], e[i, 0], e[i, 1])
            else:
                if status[b] == JOINED and value <= _FAR * known_value + 1e-12:
                    break
                for i in range(c):
                    g = guesses[b, i]
                    half[0] = 0.5 * g[6]
                    evaluate(g[0], g[1], g[2], elastica_constants(g[2], g[3], g[4], g[5]), half, state)
                    other[i, 0], other[i, 1] = (state[0, 0] - x0) / length, (state[0, 1] - y0) / length
                    other[i, 2], other[i, 3] = state[0, 2], state[0, 3] * length
                    to_unknowns(other[i], g[4] * length**2, g[5] * length**2, g[6] / length)
            state_of, found, iterations, gap = join_pieces(other, p, w, f, k)
            info[b, 1] += iterations
            if (state_of == JOINED and status[b] != JOINED) or (state_of == status[b] and found < value) or (
                status[b] == BAD_SPLINE
            ):  # fmt: skip
                status[b], value, info[b, 2] = state_of, found, gap
                if state_of != BAD_SPLINE:
                    info[b, 0] = math.sqrt(2.0 * found * (length / whole) ** 3)
                    for i in range(c):
                        kappa, fx, fy = force_form(other[i])
                        params[b, i, 0], params[b, i, 1] = x0 + length * other[i, 0], y0 + length * other[i, 1]
                        params[b, i, 2], params[b, i, 3] = other[i, 2], kappa / length
                        params[b, i, 4], params[b, i, 5] = fx / length**2, fy / length**2
                        params[b, i, 6] = other[i, 6] * length
                        copy(other[i], mids[i])
        known = status[b] == JOINED
        known_value = value
