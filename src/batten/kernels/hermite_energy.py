"""Length, ∫κ² ds and ∫κ′² ds of quintic Hermite elements, with exact first and second derivatives (Moreton1995 §3).

An element is given by 12 numbers: x, y, θ, κ, μ, α at its start, then at its end. With t = (cos θ, sin θ),
n = (−sin θ, cos θ) and m = μ², so that the speed is never negative, its Hermite data are P = (x, y), P′ = m t,
P″ = m²κ n + α m t. The integrands are G²/|v|^(2p) of v = C′, a = C″, j = C‴: G = v × a, p = 5/2 for κ² ds;
G = (v × j)|v|² − 3(v × a)(v · a), p = 11/2 for κ′² ds.
"""

import math

import numpy as np
from numba import njit

from batten.kernels.quadrature import NODES_24, WEIGHTS_24

GOOD, BAD_ELEMENT = 0, 1
BENDING, VARIATION = 0, 1
VALUES, GRADIENTS, HESSIANS = 0, 1, 2


def _blending(u):
    """Derivatives 1 to 3 at u of what multiplies P₁ − P₀, P₀′, P₀″, P₁″, P₁′: shape (len(u), 3, 5)."""
    polynomials = [
        np.polynomial.Polynomial(c)
        for c in (
            [0.0, 0.0, 0.0, 10.0, -15.0, 6.0],
            [0.0, 1.0, 0.0, -6.0, 8.0, -3.0],
            [0.0, 0.0, 0.5, -1.5, 1.5, -0.5],
            [0.0, 0.0, 0.0, 0.5, -1.0, 0.5],
            [0.0, 0.0, 0.0, -4.0, 7.0, -3.0],
        )
    ]
    return np.array([[p.deriv(k)(u) for p in polynomials] for k in (1, 2, 3)]).transpose(2, 0, 1).copy()


_BLEND = _blending(NODES_24)
_WEIGHTS = WEIGHTS_24.copy()
_WEIGHTS.setflags(write=True)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _hermite_data(row, data):
    """data (2, 5): P₁ − P₀, P₀′, P₀″, P₁″, P₁′."""
    data[0, 0] = row[6] - row[0]
    data[1, 0] = row[7] - row[1]
    for end in range(2):
        k = 6 * end
        c, s = math.cos(row[k + 2]), math.sin(row[k + 2])
        m = row[k + 4] * row[k + 4]
        along, across = row[k + 5] * m, m * m * row[k + 3]
        first, second = (1, 2) if end == 0 else (4, 3)
        data[0, first], data[1, first] = m * c, m * s
        data[0, second], data[1, second] = along * c - across * s, along * s + across * c


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _integrand(w, kind, order, slope, bend):
    """G²/q^p at w = (v, a, j), q = |v|²; its gradient in slope (6,) and Hessian in bend (6, 6), as `order` says."""
    vx, vy, ax, ay, jx, jy = w[0], w[1], w[2], w[3], w[4], w[5]
    q = vx * vx + vy * vy
    cross = vx * ay - vy * ax
    g, p = cross, 2.5
    by_g = np.zeros(6)
    by_g[0], by_g[1], by_g[2], by_g[3] = ay, -ax, -vy, vx
    if kind == VARIATION:
        dot = vx * ax + vy * ay
        third = vx * jy - vy * jx
        g, p = third * q - 3.0 * cross * dot, 5.5
        by_cross = by_g.copy()
        by_dot = np.array([ax, ay, vx, vy, 0.0, 0.0])
        by_third = np.array([jy, -jx, 0.0, 0.0, -vy, vx])
        for i in range(6):
            by_g[i] = q * by_third[i] - 3.0 * (dot * by_cross[i] + cross * by_dot[i])
        by_g[0] += 2.0 * third * vx
        by_g[1] += 2.0 * third * vy
    power = q**-p
    value = g * g * power
    if order == VALUES:
        return value
    for i in range(6):
        slope[i] = 2.0 * g * power * by_g[i]
    by_q = -p * value / q
    slope[0] += 2.0 * by_q * vx
    slope[1] += 2.0 * by_q * vy
    if order == GRADIENTS:
        return value
    for i in range(6):
        for j in range(6):
            bend[i, j] = 2.0 * power * by_g[i] * by_g[j]
    mixed = -4.0 * p * g * power / q  # of ∂G ∂qᵀ, where ∂q = 2v
    for i in range(6):
        for j in range(2):
            term = mixed * by_g[i] * w[j]
            bend[i, j] += term
            bend[j, i] += term
    both = 4.0 * p * (p + 1.0) * value / (q * q)
    for i in range(2):
        bend[i, i] += 2.0 * by_q
        for j in range(2):
            bend[i, j] += both * w[i] * w[j]
    rest = 2.0 * g * power  # times the Hessian of G
    by_second = rest if kind == BENDING else -3.0 * dot * rest
    bend[0, 3] += by_second
    bend[3, 0] += by_second
    bend[1, 2] -= by_second
    bend[2, 1] -= by_second
    if kind == VARIATION:
        for i in range(6):
            for j in range(6):
                bend[i, j] -= 3.0 * rest * (by_cross[i] * by_dot[j] + by_dot[i] * by_cross[j])
            for j in range(2):
                term = 2.0 * rest * by_third[i] * w[j]
                bend[i, j] += term
                bend[j, i] += term
        for i in range(2):
            bend[i, i] += 2.0 * rest * third
            bend[i, i + 2] -= 3.0 * rest * cross
            bend[i + 2, i] -= 3.0 * rest * cross
        bend[0, 5] += rest * q
        bend[5, 0] += rest * q
        bend[1, 4] -= rest * q
        bend[4, 1] -= rest * q
    return value


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _to_parameters(row, by_data, twice, order, gradient, hessian):
    """From derivatives by the Hermite data, (10,) and (10, 10), index 5·coordinate + datum, to those by the 12 numbers."""
    jacobian = np.zeros((10, 12))
    for c in range(2):
        jacobian[5 * c, c], jacobian[5 * c, 6 + c] = -1.0, 1.0
    for end in range(2):
        k = 6 * end
        first, second = (1, 2) if end == 0 else (4, 3)
        t = (math.cos(row[k + 2]), math.sin(row[k + 2]))
        n = (-t[1], t[0])
        kappa, mu, alpha = row[k + 3], row[k + 4], row[k + 5]
        m, dm = mu * mu, 2.0 * mu
        for c in range(2):
            one, two = 5 * c + first, 5 * c + second
            jacobian[one, k + 2] = m * n[c]
            jacobian[one, k + 4] = dm * t[c]
            jacobian[two, k + 2] = alpha * m * n[c] - m * m * kappa * t[c]
            jacobian[two, k + 3] = m * m * n[c]
            jacobian[two, k + 4] = dm * (2.0 * m * kappa * n[c] + alpha * t[c])
            jacobian[two, k + 5] = m * t[c]
    for i in range(12):
        gradient[i] = 0.0
        for a in range(10):
            gradient[i] += jacobian[a, i] * by_data[a]
    if order < HESSIANS:
        return
    half = np.zeros((10, 12))
    for a in range(10):
        for b in range(10):
            if twice[a, b] != 0.0:
                for i in range(12):
                    half[a, i] += twice[a, b] * jacobian[b, i]
    for i in range(12):
        for j in range(12):
            hessian[i, j] = 0.0
    for a in range(10):
        for i in range(12):
            if jacobian[a, i] != 0.0:
                for j in range(12):
                    hessian[i, j] += jacobian[a, i] * half[a, j]
    for end in range(2):
        k = 6 * end
        first, second = (1, 2) if end == 0 else (4, 3)
        t = (math.cos(row[k + 2]), math.sin(row[k + 2]))
        n = (-t[1], t[0])
        kappa, mu, alpha = row[k + 3], row[k + 4], row[k + 5]
        m, dm = mu * mu, 2.0 * mu
        for c in range(2):
            one, two = by_data[5 * c + first], by_data[5 * c + second]
            hessian[k + 2, k + 2] -= one * m * t[c] + two * (m * m * kappa * n[c] + alpha * m * t[c])
            hessian[k + 4, k + 4] += 2.0 * one * t[c]
            hessian[k + 4, k + 4] += two * (
                2.0 * (2.0 * m * kappa * n[c] + alpha * t[c]) + 2.0 * kappa * dm * dm * n[c]
            )
            pairs = (
                (2, 3, -two * m * m * t[c]),
                (2, 4, dm * (one * n[c] + two * (alpha * n[c] - 2.0 * m * kappa * t[c]))),
                (2, 5, two * m * n[c]),
                (3, 4, two * 2.0 * m * dm * n[c]),
                (4, 5, two * dm * t[c]),
            )
            for i, j, value in pairs:
                hessian[k + i, k + j] += value
                hessian[k + j, k + i] += value


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def element_energies_batch(rows, kind, order, values, gradients, hessians):
    """Length and integral of `kind` of each element; rows: (n, 12). Returns a status; NaN values where the speed is 0.

    values: (n, 2). gradients (n, 2, 12) from order 1, hessians (n, 2, 12, 12) for order 2 on; else they stay as they are.
    """
    status = GOOD
    data = np.empty((2, 5))
    w, slope, bend = np.zeros(6), np.zeros(6), np.zeros((6, 6))
    by_data, twice = np.zeros((2, 10)), np.zeros((2, 10, 10))
    by_length, part = np.zeros((2, 2)), np.zeros((3, 5))
    for e in range(rows.shape[0]):
        _hermite_data(rows[e], data)
        by_data[:] = 0.0
        twice[:] = 0.0
        length = integral = 0.0
        for node in range(_WEIGHTS.size):
            weight = _WEIGHTS[node]
            basis = _BLEND[node]
            for r in range(3):
                for c in range(2):
                    total = 0.0
                    for k in range(5):
                        total += basis[r, k] * data[c, k]
                    w[2 * r + c] = total
            speed = math.sqrt(w[0] * w[0] + w[1] * w[1])
            if not speed > 1e-100:
                length = integral = math.nan
                break
            length += weight * speed
            integral += weight * _integrand(w, kind, order, slope, bend)
            if order == VALUES:
                continue
            for c in range(2):
                for k in range(5):
                    by_data[0, 5 * c + k] += weight * w[c] / speed * basis[0, k]
                    total = 0.0
                    for r in range(3):
                        total += slope[2 * r + c] * basis[r, k]
                    by_data[1, 5 * c + k] += weight * total
            if order == GRADIENTS:
                continue
            x, y = w[0] / speed, w[1] / speed
            by_length[0, 0], by_length[0, 1], by_length[1, 1] = y * y / speed, -x * y / speed, x * x / speed
            by_length[1, 0] = by_length[0, 1]
            for c in range(2):
                for d in range(2):
                    for r in range(3):
                        for k in range(5):
                            total = 0.0
                            for s in range(3):
                                total += bend[2 * r + c, 2 * s + d] * basis[s, k]
                            part[r, k] = weight * total
                    for k in range(5):
                        b0, b1, b2 = basis[0, k], basis[1, k], basis[2, k]
                        own = weight * by_length[c, d] * b0
                        for l in range(5):
                            twice[0, 5 * c + k, 5 * d + l] += own * basis[0, l]
                            twice[1, 5 * c + k, 5 * d + l] += b0 * part[0, l] + b1 * part[1, l] + b2 * part[2, l]
        values[e, 0], values[e, 1] = length, integral
        if not math.isfinite(length + integral):
            values[e, 0] = values[e, 1] = math.nan
            status = BAD_ELEMENT
            continue
        if order >= GRADIENTS:
            for f in range(2):
                inner = hessians[e, f] if order >= HESSIANS else hessians[0, f]
                _to_parameters(rows[e], by_data[f], twice[f], order, gradients[e, f], inner)
    return status
