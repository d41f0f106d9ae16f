"""One step of the joined fit: conditions at the joints of a row of elastica, and the step that meets them.

Unknowns of a piece are those of `elastica_fit`, about its middle: (x, y, θ, κℓ, f₁, f₂, ℓ). Multipliers are eliminated piece
by piece, so that a block tridiagonal system is left and the cost is linear in pieces.
"""

import math

import numpy as np
from numba import njit

from batten.kernels.elastica_fit import lagrangian
from batten.kernels.linear import solve_linear


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
def measure(mids, points, weights, fractions, k, ridge, work, grads, models, tips, slopes, jumps):
    """½ squared distance of all pieces, and ½ ridge |force|².

    Fills gradients (c, 7), Gauss–Newton matrices (c, 7, 7), states (c, 2, 4) at both ends with derivatives (c, 2, 4, 7), and
    jumps (c − 1, 4) at the joints, the first k of each.
    """
    theta, s, values, jac, ends, none, dull_c, dull_a = work
    total = 0.0
    last = fractions.shape[1] - 1
    for i in range(mids.shape[0]):
        total += lagrangian(
            mids[i], points[i], theta, weights[i], fractions[i], False, ridge, ends, 0, none, s, values, jac, grads[i],
            models[i], dull_c, dull_a,
        )  # fmt: skip
        end_conditions(mids[i], values, jac, 0, k, tips[i, 0], slopes[i, 0])
        end_conditions(mids[i], values, jac, last, k, tips[i, 1], slopes[i, 1])
    for i in range(mids.shape[0] - 1):
        for j in range(k):
            jumps[i, j] = tips[i, 1, j] - tips[i + 1, 0, j]
    return total


@njit(cache=True, no_cfunc_wrapper=True)
def joint_step(grads, models, slopes, jumps, k, mu, yielding, steps, nu):
    """The step (c, 7) to the minimum of the damped model under the linearised conditions, and multipliers (c − 1, 4).

    With `yielding` > 0 jumps of curvature, the fourth, are no conditions; ½ jump² / yielding is added to the model.

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
            if k == 4:
                diagonal[i, 3, 3] += yielding
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
