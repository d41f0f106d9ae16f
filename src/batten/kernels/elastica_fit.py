"""Least-distance fit of an elastica to a sampled curve, with end conditions held exactly.

The unknowns describe the elastica at the *middle* of the segment, so that neither end is far away, and keep its shape apart
from where it lies: (x, y, θ, κℓ, f₁, f₂, ℓ) with f = ℓ² R₋θ(λ₁, λ₂). Then x, y, θ and ℓ are a similarity about the middle,
and the shape has three numbers without dimension. The curve is normalised to length 1 by the caller.

Every iterate meets the end conditions. A step minimises a quadratic model in their null space: the Gauss–Newton model while
it pays, then the exact Hessian of the Lagrangian (by differences of exact gradients) with its eigenvalues taken positive,
damped as Levenberg and Marquardt do.
"""

import math

import numpy as np
from numba import njit

from batten.kernels.elastica import elastica_constants, evaluate
from batten.kernels.elastica_jacobian import jacobian
from batten.kernels.linear import copy, eigen_symmetric, solve_linear

# Status of a fit.
FIT_CONVERGED, FIT_ITERATIONS, FIT_INFEASIBLE, FIT_BAD = 0, 1, 2, 3


@njit(cache=True, no_cfunc_wrapper=True)
def force_form(mid):
    """(κ, λ₁, λ₂) of the unknowns."""
    c, s, inv = math.cos(mid[2]), math.sin(mid[2]), 1.0 / (mid[6] * mid[6])
    return mid[3] / mid[6], inv * (c * mid[4] - s * mid[5]), inv * (s * mid[4] + c * mid[5])


@njit(cache=True, no_cfunc_wrapper=True)
def sample_middle(mid, fractions, s, values, jac):
    """Values (n, 4) at `fractions` of the length, and derivatives (n, 3, 7) by the unknowns."""
    n = fractions.shape[0]
    ell = mid[6]
    for i in range(n):
        s[i] = (fractions[i] - 0.5) * ell
    kappa, fx, fy = force_form(mid)
    jacobian(mid[0], mid[1], mid[2], kappa, fx, fy, elastica_constants(mid[2], kappa, fx, fy), s[:n], values, jac)
    c, sn, inv = math.cos(mid[2]), math.sin(mid[2]), 1.0 / (ell * ell)
    for i in range(n):
        dx, dy = values[i, 0] - mid[0], values[i, 1] - mid[1]
        for r in range(3):
            jac[i, r, 3] /= ell
            by_x, by_y = jac[i, r, 4], jac[i, r, 5]
            jac[i, r, 4] = inv * (c * by_x + sn * by_y)
            jac[i, r, 5] = inv * (c * by_y - sn * by_x)
        jac[i, 0, 2], jac[i, 1, 2], jac[i, 2, 2] = -dy, dx, 1.0
        jac[i, 0, 6], jac[i, 1, 6], jac[i, 2, 6] = dx / ell, dy / ell, 0.0


@njit(cache=True, no_cfunc_wrapper=True)
def lagrangian(mid, points, theta, weights, fractions, h1, ridge, ends, m, nu, work_s, values, jac, grad, gauss, c, a):
    """F = ½ Σ w |γ − x|² (+ ½ Σ w (θ_γ − θ)² for H¹) + ½ ridge |λ|², its gradient (7,), Gauss–Newton matrix (7, 7).

    The first and last entries of `fractions` are 0 and 1, with weight 0: there the end conditions are read off, residuals
    into c (6,), derivatives into a (6, 7), m of them (0 none, 4 points, 6 points and tangents). ν·∂c is added to `grad`.
    """
    sample_middle(mid, fractions, work_s, values, jac)
    rows = 3 if h1 else 2
    n = weights.shape[0]
    total = 0.0
    for k in range(7):
        grad[k] = 0.0
        for b in range(7):
            gauss[k, b] = 0.0
    for i in range(1, n - 1):
        w = weights[i]
        for r in range(rows):
            d = values[i, r] - (points[i, r] if r < 2 else theta[i])
            total += 0.5 * w * d * d
            for k in range(7):
                ja = w * jac[i, r, k]
                grad[k] += ja * d
                for b in range(k + 1):
                    gauss[k, b] += ja * jac[i, r, b]
    for k in range(4, 6):
        total += 0.5 * ridge * mid[k] * mid[k]
        grad[k] += ridge * mid[k]
        gauss[k, k] += ridge
    for k in range(7):
        for b in range(k):
            gauss[b, k] = gauss[k, b]
    for j in range(m):
        e, r = (j // 2, j % 2) if m == 4 else (j // 3, j % 3)
        i = e * (n - 1)
        c[j] = values[i, r] - ends[e, r]
        for k in range(7):
            a[j, k] = jac[i, r, k]
            grad[k] += nu[j] * a[j, k]
    return total


@njit(cache=True, no_cfunc_wrapper=True)
def _objective(mid, points, theta, weights, fractions, h1, ridge, s, values):
    n = weights.shape[0]
    for i in range(n):
        s[i] = (fractions[i] - 0.5) * mid[6]
    kappa, fx, fy = force_form(mid)
    evaluate(mid[0], mid[1], mid[2], elastica_constants(mid[2], kappa, fx, fy), s, values)
    total = ridge * (mid[4] ** 2 + mid[5] ** 2)
    for i in range(1, n - 1):
        dx, dy = values[i, 0] - points[i, 0], values[i, 1] - points[i, 1]
        d = dx * dx + dy * dy
        if h1:
            d += (values[i, 2] - theta[i]) ** 2
        total += weights[i] * d
    return 0.5 * total


@njit(cache=True, no_cfunc_wrapper=True)
def restore(out, tips, ends, m, s, values, jac, c, a):
    """Move `out` (7,) by scaled least-norm Newton steps onto the end conditions. True if they hold to 1e-12.

    A step that makes the largest error larger is halved.
    """
    if m == 0:
        return True
    system = np.empty((6, 6))
    base, delta = np.empty(7), np.zeros(7)
    previous, share = math.inf, 1.0
    for step in range(40):
        size = math.inf
        if out[6] > 1e-6:
            sample_middle(out, tips, s, values, jac)
            size = 0.0
            for j in range(m):
                e, r = (j // 2, j % 2) if m == 4 else (j // 3, j % 3)
                c[j] = values[e, r] - ends[e, r]
                size = max(size, abs(c[j]))
                for k in range(7):
                    a[j, k] = jac[e, r, k]
        if size < 1e-14 or (size < 2e-13 and size >= 0.5 * previous):
            return True
        if not size < previous:  # too far: back by half
            share *= 0.5
            if share < 1e-3 or step == 0:
                return size < 1e-12
            for k in range(7):
                out[k] = base[k] + share * delta[k]
            continue
        if step > 12 and size < 1e-8 and size > 0.5 * previous:
            return size < 1e-12
        previous = size
        for i in range(m):
            for j in range(m):
                total = 1e-15 if i == j else 0.0
                for k in range(7):
                    scale = 1.0 if k < 3 or k == 6 else (10.0 if k == 3 else 100.0)
                    total += a[i, k] * a[j, k] * scale
                system[i, j] = total
        if not solve_linear(system, c, m):
            return False
        share = 1.0 if size < 0.5 else 0.5 / size
        for k in range(7):
            scale = 1.0 if k < 3 or k == 6 else (10.0 if k == 3 else 100.0)
            total = 0.0
            for i in range(m):
                total += a[i, k] * c[i]
            base[k], delta[k] = out[k], -scale * total
            out[k] += share * delta[k]
    return False


@njit(cache=True, no_cfunc_wrapper=True)
def _null_space(grad, gauss, a, m, nu, scale, project):
    """Scales of the unknowns, the projector (7, 7) onto the constraints' null space in scaled unknowns, and multipliers ν.

    ν are the least-squares multipliers. False if the constraints are dependent.
    """
    for k in range(7):
        scale[k] = 1.0 / math.sqrt(gauss[k, k] + 1e-10)
        for j in range(7):
            project[k, j] = 1.0 if j == k else 0.0
    normal, system, rhs = np.empty((6, 6)), np.empty((6, 6)), np.empty(6)
    for i in range(m):
        for j in range(m):
            normal[i, j] = 0.0
            for k in range(7):
                normal[i, j] += a[i, k] * a[j, k] * scale[k] * scale[k]
    for col in range(8 if m > 0 else 0):  # columns of the projector, then the multipliers
        for i in range(m):
            rhs[i] = 0.0
            if col < 7:
                rhs[i] = a[i, col] * scale[col]
            else:
                for k in range(7):
                    rhs[i] -= a[i, k] * scale[k] * scale[k] * grad[k]
            for j in range(m):
                system[i, j] = normal[i, j]
        if not solve_linear(system, rhs, m):
            return False
        for j in range(m):
            if col == 7:
                nu[j] = rhs[j]
            else:
                for k in range(7):
                    project[k, col] -= a[j, k] * scale[k] * rhs[j]
    return True


@njit(cache=True, no_cfunc_wrapper=True)
def _reduce(model, grad, scale, project, basis, eigen, slope):
    """Scaled model in the null space of the constraints: eigenvectors, eigenvalues, and gradient along them."""
    scaled, half = np.empty((7, 7)), np.empty((7, 7))
    for i in range(7):
        for j in range(7):
            total = 0.0
            for k in range(7):
                total += scale[i] * model[i, k] * scale[k] * project[k, j]
            half[i, j] = total
    for i in range(7):
        for j in range(7):
            total = 0.0
            for k in range(7):
                total += project[k, i] * half[k, j]
            scaled[i, j] = total
    eigen_symmetric(scaled, basis, eigen, 7)
    for j in range(7):
        slope[j] = 0.0
        for i in range(7):
            for k in range(7):
                slope[j] += basis[i, j] * project[i, k] * scale[k] * grad[k]


@njit(cache=True, no_cfunc_wrapper=True)
def fit_from(mid, points, theta, weights, fractions, ends, m, h1, ridge, max_iterations, out):
    """Fit from one start; (status, F with the ridge, iterations, √(predicted decrease)); result in `out` (7,).

    Rows of the samples as for `lagrangian`. m: number of end conditions.
    """
    n = weights.shape[0]
    s, values, jac = np.empty(n), np.empty((n, 4)), np.empty((n, 3, 7))
    tips = np.array([0.0, 1.0])
    grad, other, gauss, gauss_other, model = (
        np.empty(7),
        np.empty(7),
        np.empty((7, 7)),
        np.empty((7, 7)),
        np.empty((7, 7)),
    )
    c, a, a_other, nu, zero = np.zeros(6), np.zeros((6, 7)), np.zeros((6, 7)), np.zeros(6), np.zeros(6)
    grad_nu = np.empty(7)
    project, basis, eigen, slope, scale = np.empty((7, 7)), np.empty((7, 7)), np.empty(7), np.empty(7), np.empty(7)
    trial = np.empty(7)
    copy(mid, out)
    if not restore(out, tips, ends, m, s, values, jac, c, a):
        return FIT_INFEASIBLE, math.inf, 0, math.inf
    mu, newton, slow, optimality = 1e-3, False, 0, math.inf
    for iteration in range(max_iterations):
        value = lagrangian(
            out, points, theta, weights, fractions, h1, ridge, ends, m, zero, s, values, jac, grad, gauss, c, a
        )
        if not math.isfinite(value):
            return FIT_BAD, math.inf, iteration, math.inf
        if not _null_space(grad, gauss, a, m, nu, scale, project):
            return FIT_ITERATIONS, value, iteration, optimality
        if newton:
            copy(grad, grad_nu)
            for j in range(m):
                for k in range(7):
                    grad_nu[k] += nu[j] * a[j, k]
            for k in range(7):  # Hessian of the Lagrangian, column by column
                h = 1e-6 * max(1.0, abs(out[k])) if k < 6 else 1e-6 * out[6]
                copy(out, trial)
                trial[k] += h
                lagrangian(
                    trial, points, theta, weights, fractions, h1, ridge, ends, m, nu, s, values, jac, other, gauss_other,
                    c, a_other,
                )  # fmt: skip
                for i in range(7):
                    model[i, k] = (other[i] - grad_nu[i]) / h
            for i in range(7):
                for j in range(i):
                    model[i, j] = 0.5 * (model[i, j] + model[j, i])
                    model[j, i] = model[i, j]
            _reduce(model, grad, scale, project, basis, eigen, slope)
        else:
            _reduce(gauss, grad, scale, project, basis, eigen, slope)
        accepted, finished = False, False
        new = math.inf
        for _ in range(25):
            decrease, optimality = 0.0, 0.0
            for k in range(7):
                trial[k] = 0.0
            for j in range(7):
                curve = abs(eigen[j])
                amount = -slope[j] / (curve + mu + 1e-14)
                decrease -= amount * (slope[j] + 0.5 * curve * amount)
                optimality += 0.5 * slope[j] ** 2 / (curve + 1e-9)
                for k in range(7):
                    trial[k] += amount * basis[k, j] * scale[k]
            if optimality <= 1e-14 * value or value < 1e-30:
                finished = True
                break
            for k in range(7):
                trial[k] += out[k]
            new = math.inf
            if 1e-6 < trial[6] < 50.0 and abs(trial[3]) < 1e5 and restore(trial, tips, ends, m, s, values, jac, c, a):
                new = _objective(trial, points, theta, weights, fractions, h1, ridge, s, values)
            if new < value:
                if value - new > 0.75 * decrease:
                    mu = max(mu * 0.1, 1e-15)
                elif value - new < 0.25 * decrease:
                    mu *= 4.0
                accepted = True
                break
            mu = max(6.0 * mu, 1e-8)
            if decrease < 1e-16 * value:
                break
        optimality = math.sqrt(optimality)
        if (finished or not accepted) and newton:
            good = finished or optimality * optimality <= 1e-10 * value
            return FIT_CONVERGED if good else FIT_ITERATIONS, value, iteration + 1, optimality
        if finished or not accepted:
            newton, mu = True, 1e-6
            continue
        copy(trial, out)
        slow = slow + 1 if value - new < 0.3 * value else 0
        if not newton and slow >= 2:
            newton, mu = True, min(mu, 1e-2)
    return (
        FIT_ITERATIONS,
        _objective(out, points, theta, weights, fractions, h1, ridge, s, values),
        max_iterations,
        optimality,
    )
