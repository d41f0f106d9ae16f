"""Elastica between two held ends by thousands of Newton starts: slow, and without a formula in common with batten.

The pendulum equation θ″ = −λ₁ sin θ + λ₂ cos θ and its variational equations are integrated by the classical Runge–Kutta
method; Newton's method from random starts finds the numbers (κ₀, λ₁, λ₂) with which a curve of length 1 from (0, 0) arrives.
"""

import math

import numpy as np
from numba import njit

ANGLE, CURVATURE = 0, 1


@njit(nogil=True)
def shoot(z, angle, steps, state):
    """Integrate over length 1 into `state` (16,): θ, κ, x, y, then their derivatives by κ₀, by λ₁, by λ₂."""
    h = 1.0 / steps
    state[:] = 0.0
    state[0], state[1], state[5] = angle, z[0], 1.0
    slopes, w = np.empty((4, 16)), np.empty(16)
    for _ in range(steps):
        for stage in range(4):
            if stage == 0:
                w[:] = state
            else:
                w[:] = state + (h if stage == 3 else 0.5 * h) * slopes[stage - 1]
            f = slopes[stage]
            s, c = math.sin(w[0]), math.cos(w[0])
            f[0], f[1], f[2], f[3] = w[1], z[2] * c - z[1] * s, c, s
            for j in range(3):
                o = 4 + 4 * j
                f[o] = w[o + 1]
                f[o + 1] = -(z[1] * c + z[2] * s) * w[o] + (-s if j == 1 else (c if j == 2 else 0.0))
                f[o + 2], f[o + 3] = -s * w[o], c * w[o]
        state += h / 6.0 * (slopes[0] + 2.0 * slopes[1] + 2.0 * slopes[2] + slopes[3])


@njit(nogil=True)
def newton(z, angle, goal, end, steps, iterations):
    """Newton's method on z (3,) in place for the end (x, y, θ or κ); returns what it misses."""
    state, system, miss = np.empty(16), np.empty((3, 3)), np.empty(3)
    last = 0 if end == ANGLE else 1
    size = 1e9
    for _ in range(iterations):
        shoot(z, angle, steps, state)
        miss[0], miss[1], miss[2] = state[2] - goal[0], state[3] - goal[1], state[last] - goal[2]
        size = np.abs(miss).max()
        if size < 1e-10 or not size < 1e6:
            return size
        for j in range(3):
            o = 4 + 4 * j
            system[0, j], system[1, j], system[2, j] = state[o + 2], state[o + 3], state[o + last]
        if abs(np.linalg.det(system)) < 1e-14:
            return 1e9
        step = np.linalg.solve(system, miss)
        large = max(abs(step[0]) / 10.0, abs(step[1]) / 100.0, abs(step[2]) / 100.0)
        z -= step * (1.0 if large < 0.3 else 0.3 / large)
        if abs(z[0]) > 200.0 or abs(z[1]) > 5000.0 or abs(z[2]) > 5000.0:
            return 1e9
    return size


@njit(nogil=True)
def _all(starts, angle, goal, end, steps, iterations, misses):
    for i in range(len(starts)):
        misses[i] = newton(starts[i], angle, goal, end, steps, iterations)


def brute_force(angle, goal, *, end=ANGLE, starts=3000, seed=0, steps=120):
    """Numbers (κ₀, λ₁, λ₂), (n, 3), of different curves of length 1 that start at an angle and meet the goal (3,)."""
    rng = np.random.default_rng(seed)
    lam, phi = np.exp(rng.uniform(0.0, np.log(900.0), starts)), rng.uniform(-np.pi, np.pi, starts)
    turn = goal[2] - angle if end == ANGLE else rng.uniform(-6, 6, starts)
    kappa = rng.normal(0.0, 1.0, starts) * np.sqrt(lam) + turn * rng.random(starts)
    z = np.column_stack([kappa, lam * np.cos(phi), lam * np.sin(phi)])
    misses = np.empty(starts)
    _all(z, angle, np.asarray(goal, dtype=float), end, steps, 25, misses)
    coarse, found = [], []
    for row in z[misses < 1e-9]:
        bend = 1 + abs(row[0]) + np.sqrt(np.hypot(row[1], row[2]))
        if all(difference(row, other, bend) > 1e-4 for other in coarse):
            coarse.append(row.copy())
    for row in coarse:  # with the coarse step some stiff curves only seem to arrive
        if newton(row, angle, np.asarray(goal, dtype=float), end, 20 * steps, 25) < 1e-8:
            bend = 1 + abs(row[0]) + np.sqrt(np.hypot(row[1], row[2]))
            if all(difference(row, other, bend) > 1e-4 for other in found):
                found.append(row)
    return np.array(found).reshape(-1, 3)


def difference(z, other, bend):
    """How much two curves differ, relative to their curvature."""
    return abs(z[0] - other[0]) / bend + np.hypot(z[1] - other[1], z[2] - other[2]) / bend**2


def inflections(z, angle, steps=400):
    """How often the curvature changes its sign along the curve, at so many steps."""
    signs = np.empty(steps + 1)
    state, part = np.empty(16), np.array(z, dtype=float)
    signs[0] = np.sign(z[0])
    theta, kappa = angle, z[0]
    for i in range(steps):  # a curve of length 1/steps, scaled to length 1
        shoot(np.array([kappa / steps, part[1] / steps**2, part[2] / steps**2]), theta, 1, state)
        theta, kappa = state[0], state[1] * steps
        signs[i + 1] = np.sign(kappa)
    return int(np.sum(signs[1:-1] * signs[2:] < 0)) + int(signs[0] * signs[1] < 0)
