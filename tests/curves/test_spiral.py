"""Spirals as curves: derivatives, reversal, similarities, and the Euler spiral between two tangents."""

import numpy as np
import pytest

from batten.curves.base import Curve
from batten.curves.similarity import Similarity
from batten.curves.spiral import Spiral, euler_spiral
from batten.errors import InvalidInputError, NoSolutionError

CURVE = Spiral(np.array([1.0, 2.0]), 0.3, np.array([1.0, -2.0, 3.0, 1.0]), 1.7)


def test_it_is_a_curve_with_consistent_derivatives():
    assert isinstance(CURVE, Curve)
    t, h = np.linspace(0.05, 0.95, 7), 1e-5
    for order in (1, 2, 3):
        value = CURVE.point if order == 1 else lambda x, o=order: CURVE.derivative(x, o - 1)
        slope = (value(t + h) - value(t - h)) / (2.0 * h)
        np.testing.assert_allclose(CURVE.derivative(t, order), slope, atol=1e-7)
    assert np.hypot(*CURVE.derivative(t).T) == pytest.approx(CURVE.length)


def test_curvature_and_its_derivatives_are_a_polynomial():
    s = np.array([0.0, 0.5, 1.7])
    np.testing.assert_allclose(CURVE.curvature_at(s), 1.0 - 2.0 * s + 1.5 * s**2 + s**3 / 6.0)
    np.testing.assert_allclose(CURVE.curvature_at(s, 1), -2.0 + 3.0 * s + 0.5 * s**2)
    np.testing.assert_allclose(CURVE.curvature_at(s, 2), 3.0 + s)
    np.testing.assert_allclose(CURVE.curvature_at(s, 3), 1.0)
    with pytest.raises(InvalidInputError, match="order 0 to 3"):
        CURVE.curvature_at(s, 4)


def test_reversed_and_transformed_run_over_the_same_points():
    t = np.linspace(0.0, 1.0, 9)
    np.testing.assert_allclose(CURVE.reversed().point(1.0 - t), CURVE.point(t), atol=3e-15)
    move = Similarity(scale=2.0, rotation=0.7, translation=(3.0, -1.0))
    np.testing.assert_allclose(CURVE.transformed(move).point(t), move.apply(CURVE.point(t)), atol=5e-15)


def test_its_energy_is_that_of_quadrature():
    s = (np.arange(200000) + 0.5) * CURVE.length / 200000
    assert CURVE.bending_energy() == pytest.approx(float((CURVE.curvature_at(s) ** 2).mean()) * CURVE.length, rel=1e-9)


def test_points_come_back_in_the_order_asked():
    t = np.array([[0.9, 0.1], [0.5, 0.0]])
    assert CURVE.point(t).shape == (2, 2, 2)
    np.testing.assert_allclose(CURVE.point(t)[0, 1], CURVE.point(0.1), atol=1e-15)
    np.testing.assert_array_equal(CURVE.point(t)[1, 1], CURVE.start)


def test_euler_spirals_meet_their_ends():
    random = np.random.default_rng(0)
    for a, b in random.uniform(-9.0, 9.0, (100, 2)):
        curve = euler_spiral([1.0, -1.0], a, [3.0, 0.5], b)
        np.testing.assert_allclose(curve.end, [3.0, 0.5], atol=1e-14 * max(1.0, curve.length))
        assert np.exp(1j * curve.start_angle) == pytest.approx(np.exp(1j * a), abs=1e-13)
        assert np.exp(1j * curve.end_angle) == pytest.approx(np.exp(1j * b), abs=1e-13)
        assert abs(curve.end_angle - curve.start_angle) < 2.0 * np.pi


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        (([0, 0], 0.0, [0, 0], 1.0), InvalidInputError, "two different points"),
        (([0, 0], np.nan, [1, 0], 1.0), InvalidInputError, "finite"),
        (([0, 0], np.pi, [1, 0], -np.pi), NoSolutionError, "full circle"),
    ],
)
def test_bad_ends_are_refused(arguments, error, words):
    with pytest.raises(error, match=words):
        euler_spiral(*arguments)


@pytest.mark.parametrize(
    ("curvatures", "length", "words"),
    [([], 1.0, "1 to 4"), ([1, 2, 3, 4, 5], 1.0, "1 to 4"), ([1.0], 0.0, "above 0"), ([np.inf], 1.0, "finite")],
)
def test_bad_spirals_are_refused(curvatures, length, words):
    with pytest.raises(InvalidInputError, match=words):
        Spiral(np.zeros(2), 0.0, np.array(curvatures), length)
