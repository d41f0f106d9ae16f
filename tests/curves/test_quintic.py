"""Quintics in Hermite form: what is given comes back, and the two other forms agree."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from batten.curves.base import Curve
from batten.curves.quintic import QuinticHermite
from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError

DATA = np.array([[0.3, -0.2], [1.0, 0.5], [0.4, -2.0], [1.5, 0.3], [0.8, -0.9], [1.4, 0.6]])
T = np.linspace(0.0, 1.0, 11)


def test_ends_and_their_derivatives_are_those_given():
    curve = QuinticHermite(DATA)
    assert isinstance(curve, Curve)
    np.testing.assert_array_equal(curve.point([0.0, 1.0]), DATA[[0, 5]])
    np.testing.assert_allclose(curve.derivative([0.0, 1.0]), DATA[[1, 4]], atol=1e-13)
    np.testing.assert_allclose(curve.derivative([0.0, 1.0], 2), DATA[[2, 3]], atol=1e-12)


def test_bezier_points_length_reversal_and_similarity():
    curve = QuinticHermite(DATA)
    bernstein = np.stack([math.comb(5, k) * T**k * (1 - T) ** (5 - k) for k in range(6)], axis=-1)
    np.testing.assert_allclose(bernstein @ curve.control_points, curve.point(T), atol=1e-14)
    assert curve.length == pytest.approx(
        quad(lambda t: np.hypot(*curve.derivative(t)), 0, 1, epsabs=1e-13)[0], rel=1e-11
    )
    np.testing.assert_allclose(curve.reversed().point(T), curve.point(1.0 - T), atol=1e-13)
    move = Similarity(2.0, 0.7, (3.0, -1.0))
    np.testing.assert_allclose(curve.transformed(move).point(T), move.apply(curve.point(T)), atol=1e-13)
    third = (curve.derivative(0.5 + 1e-4, 2) - curve.derivative(0.5 - 1e-4, 2)) / 2e-4
    np.testing.assert_allclose(curve.derivative(0.5, 3), third, rtol=1e-6)


@pytest.mark.parametrize("data", [np.zeros((5, 2)), np.full((6, 2), np.nan)])
def test_bad_data(data):
    with pytest.raises(InvalidInputError, match=r"\(6, 2\)"):
        QuinticHermite(data)
