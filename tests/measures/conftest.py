"""Curves and oracles that the tests of the measures share."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad_vec, solve_ivp
from scipy.interpolate import make_interp_spline

from batten.curves.bspline import BSplineCurve


def unit_disc(rng, shape):
    """Points uniform in the unit disc, shape (*shape, 2)."""
    radius, angle = np.sqrt(rng.random(shape)), 2 * np.pi * rng.random(shape)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def moments_by_quadrature(control):
    """∫ (1, x, y, κ)ᵀ(1, x, y, κ) ds of a cubic by scipy's adaptive quadrature, 4 × 4, from power-basis polynomials."""
    p0, p1, p2, p3 = control
    c = [p0, 3 * (p1 - p0), 3 * (p2 - 2 * p1 + p0), p3 - 3 * p2 + 3 * p1 - p0]

    def integrand(t):
        x, y = c[0] + t * (c[1] + t * (c[2] + t * c[3]))
        dx, dy = c[1] + t * (2 * c[2] + t * 3 * c[3])
        ddx, ddy = 2 * c[2] + 6 * t * c[3]
        speed = np.hypot(dx, dy)
        v = np.array([1.0, x, y, (dx * ddy - dy * ddx) / speed**3])
        return np.outer(v, v) * speed

    # Break points where the speed is least, for a start.
    t = np.linspace(0, 1, 400)
    slowest = t[np.argmin(np.linalg.norm(c[1] + t[:, None] * (2 * c[2] + t[:, None] * 3 * c[3]), axis=1))]
    return quad_vec(integrand, 0, 1, points=[slowest], epsabs=1e-11, epsrel=1e-11, limit=2000)[0]


def residual_from_moments(moments):
    """(length, ∫κ², ‖r‖, λ₁, λ₂, α, e_λ) by the normal equations (6)."""
    solution = np.linalg.solve(moments[:3, :3], moments[:3, 3])
    energy = moments[3, 3]
    rest = energy - solution @ moments[:3, 3]
    alpha, lambda_2, minus_lambda_1 = solution
    return moments[0, 0], energy, np.sqrt(rest), -minus_lambda_1, lambda_2, alpha, np.sqrt(rest / energy)


@pytest.fixture(scope="session")
def random_cubics():
    """200 cubics in the unit disc and, for each, what quadrature makes of it: (200, 4, 2) and (200, 7)."""
    control = unit_disc(np.random.default_rng(20), (200, 4))
    return control, np.array([residual_from_moments(moments_by_quadrature(c)) for c in control])


def integrated_elastica(angle, curvature, force, length, start=(0.0, 0.0)):
    """An elastica integrated from θ″ = −λ₁ sin θ + λ₂ cos θ, as a B-spline of degree 7 through 400 points."""
    l1, l2 = force

    def right_hand_side(_, state):
        theta, kappa = state[2:]
        return [np.cos(theta), np.sin(theta), kappa, l2 * np.cos(theta) - l1 * np.sin(theta)]

    s = np.linspace(0, length, 400)
    state = [*start, angle, curvature]
    solution = solve_ivp(right_hand_side, (0, length), state, method="DOP853", t_eval=s, rtol=1e-13, atol=1e-14)
    spline = make_interp_spline(s, solution.y[:2].T, k=7)
    return BSplineCurve(spline.t, spline.c, 7)


class Arc:
    """A circular arc at constant speed, from `start` over `turn` radians: a `Curve` in closed form."""

    def __init__(self, radius, start, turn, centre=(0.0, 0.0)):
        self.radius, self.start, self.turn, self.centre = radius, start, turn, np.asarray(centre)
        self.length = abs(radius * turn)

    def _angle(self, t):
        return self.start + self.turn * np.asarray(t, dtype=float)

    def point(self, t):
        a = self._angle(t)
        return self.centre + self.radius * np.stack([np.cos(a), np.sin(a)], axis=-1)

    def derivative(self, t, order=1):
        a = self._angle(t) + order * np.pi / 2
        return self.radius * self.turn**order * np.stack([np.cos(a), np.sin(a)], axis=-1)

    def breaks(self):
        return np.array([0.0, 1.0])


@pytest.fixture(scope="session")
def elastica_from():
    """The function that integrates an elastica."""
    return integrated_elastica


@pytest.fixture(scope="session")
def arc():
    """The class of circular arcs."""
    return Arc
