"""Log-aesthetic segments as curves."""

import numpy as np
import pytest

from batten.curves.base import Curve
from batten.curves.log_aesthetic import LogAestheticCurve
from batten.errors import InvalidInputError


@pytest.mark.parametrize("exponent", [0.5, 1.0, 1.78, 3.0])
@pytest.mark.parametrize(
    ("turn", "change"), [(1.0, 2.0), (2.0, 0.1), (-1.0, -0.2), (-1.0, 4.0), (0.0, 2.0), (2.0, 0.0)]
)
def test_it_is_a_curve_with_consistent_derivatives(exponent, turn, change):
    curve = LogAestheticCurve(np.array([1.0, 2.0]), 0.3, exponent, turn, change, 1.7)
    assert isinstance(curve, Curve)
    h = 1e-6
    t = np.linspace(0.05, 0.95, 12)
    inner = curve.breaks()[1:-1]
    t = t[np.abs(t[:, None] - inner).min(axis=1, initial=1.0) > 0.02]  # κ′ of a power below 1 is infinite there
    for order in (1, 2, 3):
        value = curve.point if order == 1 else lambda x, o=order: curve.derivative(x, o - 1)
        slope = (value(t + h) - value(t - h)) / (2.0 * h)
        np.testing.assert_allclose(curve.derivative(t, order), slope, atol=1e-5)
    ends = np.array([0.0, 1.7])
    assert np.diff(curve.angle_at(ends))[0] == pytest.approx(turn, abs=1e-13)
    assert np.diff(curve.curvature_at(ends))[0] * 1.7 == pytest.approx(change, abs=1e-12)


def test_its_curvature_is_a_power_of_arc_length():
    """log κ against log of the distance from the inflection is a line with slope α: what the name says."""
    curve = LogAestheticCurve(np.zeros(2), 0.0, 1.78, 1.2, 0.9, 2.0)
    s = np.linspace(0.0, 2.0, 9)
    slope = np.diff(np.log(np.abs(curve.curvature_at(s)))) / np.diff(np.log(np.abs(s - curve.inflection)))
    np.testing.assert_allclose(slope, 1.78, rtol=1e-10)


def test_bad_numbers_are_refused():
    with pytest.raises(InvalidInputError, match="exponent"):
        LogAestheticCurve(np.zeros(2), 0.0, -1.0, 1.0, 1.0, 1.0)
