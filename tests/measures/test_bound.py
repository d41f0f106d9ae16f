"""Bounds on the distance to an elastica: never below the true distance, Fisker2018's factor derived again, and sharpness."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from batten.curves.bezier import CubicBezier
from batten.curves.bspline import BSplineCurve
from batten.curves.elastica import Elastica
from batten.curves.piecewise import PiecewiseCurve
from batten.curves.polyline import Polyline
from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError
from batten.kernels.elastica import states_grid
from batten.kernels.quadrature import NODES_24, WEIGHTS_24
from batten.measures.bound import elastica_distance_bound, theorem_1_factor
from batten.measures.curvature_fit import basic_length, curvature_fit
from batten.measures.curvature_residual import curvature_residual
from batten.measures.lambda_residual import lambda_residual

ARCH = np.array([(0, 0), (0.1, 0.7), (0.9, 0.6), (1, 0)])


def unit_disc(seed, count):
    rng = np.random.default_rng(seed)
    radius, angle = np.sqrt(rng.random((count, 4))), 2 * np.pi * rng.random((count, 4))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def hermite(seed, count):
    """Cubics between (0, 0) and (1, 0) with moderate angles and handles: mostly close to elastica."""
    rng = np.random.default_rng(seed)
    angle, handle = rng.uniform(-1.5, 1.5, (2, count)), rng.uniform(0.25, 0.5, (2, count))
    control = np.zeros((count, 4, 2))
    control[:, 3, 0] = 1.0
    control[:, 1] = (handle[0] * [np.cos(angle[0]), np.sin(angle[0])]).T
    control[:, 2] = [1, 0] - (handle[1] * [np.cos(angle[1]), np.sin(angle[1])]).T
    return control


def near_cusps(seed, count):
    """Cubics whose speed is nearly 0 somewhere inside."""
    rng = np.random.default_rng(seed)
    control = np.tile([(0.0, 0.0), (1.0, 1.0), (0.0, 1.0), (1.0, 0.0)], (count, 1, 1))
    return control + 10.0 ** rng.uniform(-4, -1, (count, 1, 1)) * rng.standard_normal((count, 4, 2))


def flat(seed, count):
    control = unit_disc(seed, count)
    control[..., 1] *= 10.0 ** np.random.default_rng(seed).uniform(-6, 0, (count, 1))
    return control


def dense_distance(control, elastica, count=400):
    """max ‖γ − γₑ‖/L and max |θ − θₑ| at `count` parameters, those near the slowest point closer together."""
    edges = np.sin(np.linspace(0, 0.5 * np.pi, count + 1)) ** 2
    width = np.diff(edges)

    def speed(t):
        u = 1 - t
        basis = 3 * np.stack([-u * u, u * u - 2 * u * t, 2 * u * t - t * t, t * t], axis=-1)
        return basis @ control

    inner = (edges[:-1, None] + width[:, None] * NODES_24).ravel()
    velocity = np.linalg.norm(speed(inner), axis=-1).reshape(len(control), count, 24)
    s = np.concatenate([np.zeros((len(control), 1)), np.cumsum(velocity @ WEIGHTS_24 * width, axis=1)], axis=1)
    t, u = edges, 1 - edges
    points = np.stack([u**3, 3 * u * u * t, 3 * u * t * t, t**3], axis=-1) @ control
    tangent = speed(t)
    states = np.empty((*s.shape, 4))
    states_grid(np.ascontiguousarray(elastica), np.ascontiguousarray(s), states)
    far = np.linalg.norm(points - states[..., :2], axis=-1).max(axis=1) / s[:, -1]
    angle = np.unwrap(np.arctan2(tangent[..., 1], tangent[..., 0]), axis=1)
    turn = angle - states[..., 2]
    turn -= 2 * np.pi * np.round(turn[:, :1] / (2 * np.pi))
    return far, np.abs(turn).max(axis=1)


# The factor


def test_factor_is_the_sum_of_the_proof():
    """Σ (1/(1 − εη))^i √ε over i ≤ ⌈1/ε⌉ with the proof's ε: equal to F up to η = 1, not above it beyond."""
    for eta in np.linspace(0.0, 1.0, 21):
        total = sum((1 / (1 - eta / 2)) ** i for i in (1, 2)) * np.sqrt(0.5)
        assert theorem_1_factor(eta) == pytest.approx(total, rel=1e-14)
    for eta in np.linspace(1.01, 30.0, 200):
        total = sum(2.0**i for i in range(1, int(np.ceil(2 * eta)) + 1)) * np.sqrt(1 / (2 * eta))
        assert total <= theorem_1_factor(eta) * (1 + 1e-12)
        assert theorem_1_factor(eta) < 2.0001 * total


def test_factor_as_printed():
    for eta in (0.01, 0.5, 1.0):
        assert theorem_1_factor(eta) == pytest.approx(np.sqrt(2) / eta * ((2 / (2 - eta)) ** 2 - 1), rel=1e-12)
    for eta in (1.5, 7.0):
        assert theorem_1_factor(eta) == pytest.approx(np.sqrt(2 / eta) * (2 ** (2 * eta + 1) - 1), rel=1e-13)


def test_factor_follows_from_gronwall_and_grows():
    """|d(s)| ≤ ∫ cosh(√Λ(s − t))|r|, and Cauchy–Schwarz, prove Theorem 1 a second time: F is above that factor."""
    eta = np.geomspace(1e-6, 500, 5000)
    factor = theorem_1_factor(eta)
    assert (np.diff(factor) > 0).all()
    root = np.sqrt(eta)
    assert (factor > np.sqrt(0.5 + np.sinh(2 * root) / (4 * root))).all()
    assert theorem_1_factor(0.0) == pytest.approx(np.sqrt(2), rel=1e-15)
    assert theorem_1_factor([[0.0, np.nan]]).shape == (1, 2)
    assert theorem_1_factor(1e4) == np.inf
    with pytest.raises(InvalidInputError):
        theorem_1_factor([1.0, -1e-9])


def test_misprint_sign_in_the_proof_of_lemma_1():
    """g(θ) = λ₂ cos θ − λ₁ sin θ has |g′| = |λ₁ cos c + λ₂ sin c|, not |λ₁ cos c − λ₂ sin c|; both are ≤ √(λ₁² + λ₂²)."""
    l1, l2, c, h = 0.7, -1.9, 0.8, 1e-6
    slope = (l2 * np.cos(c + h) - l1 * np.sin(c + h) - l2 * np.cos(c - h) + l1 * np.sin(c - h)) / (2 * h)
    assert abs(slope) == pytest.approx(abs(l1 * np.cos(c) + l2 * np.sin(c)), abs=1e-8)
    assert abs(abs(slope) - abs(l1 * np.cos(c) - l2 * np.sin(c))) > 0.5


# The bounds


@pytest.mark.parametrize(
    "control",
    [unit_disc(7, 2000), hermite(8, 1000), near_cusps(9, 200), flat(10, 400)],
    ids=["disc", "hermite", "cusps", "flat"],
)
def test_never_below_the_true_distance(control):
    bound = elastica_distance_bound(control)
    far, turn = dense_distance(control, bound.elastica)
    assert np.isfinite(far).all()
    assert (far <= bound.along_curve).all()
    assert (bound.distance <= bound.along_curve).all()
    assert (far <= bound.by_residual_norm + 1e-12).all()
    assert (bound.by_residual_norm <= bound.by_theorem_1).all()
    tame = lambda_residual(control) < 0.9  # at a near-cusp half a turn falls between two parameters
    assert (turn <= bound.by_residual_norm + 1e-12)[tame].all()
    # `distance` is a maximum over points: below the supremum, by 1 % at most.
    assert (far <= 1.01 * bound.distance + 1e-12).all()


@pytest.mark.slow
def test_never_below_the_true_distance_of_100000_curves():
    for seed in range(50):
        control = unit_disc(100 + seed, 2000)
        bound = elastica_distance_bound(control)
        assert (dense_distance(control, bound.elastica)[0] <= bound.along_curve).all()


def test_is_sharp_for_curves_close_to_elastica():
    control = unit_disc(11, 6000)
    residual = lambda_residual(control)
    control = control[residual < 0.22]
    bound = elastica_distance_bound(control)
    assert len(control) > 200
    assert np.median(bound.along_curve / bound.distance) < 1.12
    assert np.median(bound.by_residual_norm / bound.distance) > 100
    assert np.median(bound.by_theorem_1 / bound.along_curve) > 1e7
    # Beyond the linear equation there are only squares: with the bow the excess falls to that of the cells.
    rows = [[(0, 0), (0.33, h), (0.6, 0.7 * h), (1, 0)] for h in (0.4, 0.2, 0.1, 0.05)]
    bound = elastica_distance_bound(rows)
    excess = bound.along_curve / bound.distance - 1
    assert (np.diff(excess) < 0).all()
    assert excess[3] < 0.005


def test_the_elastica_has_the_start_the_tangent_and_the_multipliers():
    """And is, integrated from its differential equation, as far from the curve as `distance` says."""
    for control in (ARCH, ARCH * 3 + np.array([5, -2]), np.array([(0, 0), (1, 1.2), (0.1, -0.9), (1.1, 0.4)])):
        bound = elastica_distance_bound(control)
        fit = curvature_fit(control, tolerance=1e-10)
        x, y, angle, kappa, l1, l2, length = bound.elastica
        edge = control[1] - control[0]
        np.testing.assert_allclose([x, y, angle], [*control[0], np.arctan2(edge[1], edge[0])], atol=1e-14)
        start_kappa = fit.lambda_2 * x - fit.lambda_1 * y + fit.alpha
        scale = np.array([length, length**2, length**2])
        np.testing.assert_allclose(
            scale * [kappa, l1, l2], scale * [start_kappa, fit.lambda_1, fit.lambda_2], atol=1e-8
        )
        assert length == pytest.approx(fit.length, rel=1e-12)
        curve = CubicBezier(control)

        def both(t, state, curve=curve, force=(l1, l2)):
            speed = float(np.hypot(*curve.derivative(t)))
            _, _, theta, k = state
            turning = force[1] * np.cos(theta) - force[0] * np.sin(theta)
            return [speed * np.cos(theta), speed * np.sin(theta), speed * k, speed * turning]

        t = np.linspace(0, 1, 1001)
        state = [x, y, angle, kappa]
        points = solve_ivp(both, (0, 1), state, method="DOP853", t_eval=t, rtol=1e-11, atol=1e-12).y[:2].T
        far = np.linalg.norm(points - curve.point(t), axis=1).max() / length
        assert bound.distance == pytest.approx(far, rel=5e-3)
        assert far <= bound.along_curve


def test_printed_bound_is_f_times_e_r():
    bound = elastica_distance_bound(ARCH)
    expected = theorem_1_factor(basic_length(ARCH, tolerance=1e-10)) * curvature_residual(ARCH, tolerance=1e-10)
    assert bound.by_theorem_1 == pytest.approx(expected, rel=1e-12)


def test_an_elastica_is_its_own():
    curve = Elastica((1, 2), 0.3, 1.2, (2, -3), 3.0)
    bound = elastica_distance_bound(curve)
    np.testing.assert_allclose(bound.elastica, curve.parameters, atol=1e-11)
    assert bound.distance < 1e-12
    assert bound.along_curve < 1e-11


class Wrapped:
    """A cubic that does not say it is one."""

    def __init__(self, control):
        self.curve = CubicBezier(control)
        self.length = self.curve.length

    def point(self, t):
        return self.curve.point(t)

    def derivative(self, t, order=1):
        return self.curve.derivative(t, order)

    def breaks(self):
        return self.curve.breaks()


def test_any_curve_goes_the_same_way():
    for control in (ARCH, unit_disc(12, 1)[0]):
        one, other = elastica_distance_bound(Wrapped(control)), elastica_distance_bound(CubicBezier(control))
        row = elastica_distance_bound(control)
        assert isinstance(other.along_curve, float)
        assert one.distance == pytest.approx(other.distance, rel=1e-2)
        assert one.along_curve == pytest.approx(other.along_curve, rel=5e-2)
        assert one.by_residual_norm == pytest.approx(other.by_residual_norm, rel=1e-7)
        assert other.along_curve == row.along_curve


def test_curvature_may_jump_and_tangents_may_not():
    spline = BSplineCurve([0, 0, 0, 0.4, 1, 1, 1], [(0, 0), (1, 1.0), (2, 1.2), (3.5, 0.3)], 2)
    bound = elastica_distance_bound(spline)
    t = np.linspace(0, 1, 2001)
    s = np.concatenate(
        [[0], np.cumsum(np.linalg.norm(np.diff(spline.point(np.linspace(0, 1, 200001)), axis=0), axis=1))]
    )
    gap = spline.point(t) - Elastica.from_parameters(bound.elastica).point_at(s[::100])
    assert np.linalg.norm(gap, axis=1).max() / spline.length <= bound.along_curve
    corner = PiecewiseCurve([CubicBezier(ARCH), CubicBezier(ARCH + np.array([1, 0]))])
    with pytest.raises(InvalidInputError, match="corner"):
        elastica_distance_bound(corner)
    with pytest.raises(InvalidInputError):
        elastica_distance_bound(Polyline([(0, 0), (1, 1), (2, 0)]))


def test_is_invariant_under_similarities():
    control = hermite(13, 50)
    one = elastica_distance_bound(control)
    other = elastica_distance_bound(Similarity(40.0, 2.2, (7.0, -3.0)).apply(control))
    for name in ("distance", "angle", "along_curve", "by_residual_norm", "by_theorem_1"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-6, atol=1e-11)


def test_degenerate_curves():
    rows = np.array(
        [
            ARCH,
            [(0, 0), (-1, -1), (-2, -2), (-3, -3)],
            [(0, 0), (3, 0), (-2, 0), (1, 0)],
            [(0, 0), (1, 1), (0, 1), (1, 0)],
            [(0, 0), (0, 0), (1, 1), (2, 0)],
            [(2, 1)] * 4,
            [(0, 0), (np.nan, 1), (2, 1), (3, 0)],
            ARCH,
        ]
    )
    bound = elastica_distance_bound(rows)
    inf, nan = np.inf, np.nan
    for values in (bound.along_curve, bound.by_residual_norm, bound.by_theorem_1):
        np.testing.assert_equal(values[1:7], [0, inf, inf, inf, nan, nan])
        assert values[0] == values[7] > 0
    np.testing.assert_equal(bound.distance[1:7], [0, nan, nan, nan, nan, nan])
    np.testing.assert_allclose(bound.elastica[1], [0, 0, -0.75 * np.pi, 0, 0, 0, 3 * np.sqrt(2)], atol=1e-14)
    assert np.isnan(bound.elastica[2:7]).all()
    line = elastica_distance_bound(Polyline([(0, 0), (1, 1)]))
    assert (line.distance, line.along_curve, line.by_theorem_1) == (0, 0, 0)
    assert elastica_distance_bound(np.empty((2, 0, 4, 2))).elastica.shape == (2, 0, 7)
    with pytest.raises(InvalidInputError):
        elastica_distance_bound(np.zeros((3, 2)))
