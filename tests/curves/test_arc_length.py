"""Arc length and its inverse against closed forms and scipy's quadrature."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from batten.curves.arc_length import ArcLength
from batten.curves.bezier import CubicBezier
from batten.curves.bspline import BSplineCurve
from batten.curves.polyline import Polyline
from batten.errors import InvalidInputError

COORDINATE = st.floats(-2.0, 2.0, allow_subnormal=False)
CONTROL = st.lists(st.tuples(COORDINATE, COORDINATE), min_size=4, max_size=4, unique=True)
PARABOLA = CubicBezier([(0, 0), (1 / 3, 0), (2 / 3, 1 / 3), (1, 1)])  # (t, t²)


def _parabola_length(t):
    return t * np.sqrt(1 + 4 * t**2) / 2 + np.arcsinh(2 * t) / 4


def test_parabola_in_closed_form():
    arc = ArcLength.of(PARABOLA)
    t = np.linspace(0, 1, 41).reshape(1, 41)
    fraction = _parabola_length(t) / _parabola_length(1.0)
    np.testing.assert_allclose(arc.fraction_at(t), fraction, atol=1e-14)
    np.testing.assert_allclose(arc.parameter_at(fraction), t, atol=1e-14)
    assert arc.length == pytest.approx(_parabola_length(1.0), rel=1e-14)
    assert not arc.uniform


def test_a_polyline_is_uniform():
    arc = ArcLength.of(Polyline([(0, 0), (3, 4), (3, 5), (-1, 5)]))
    assert arc.uniform
    assert arc.parameter_at(0.55) == 0.55
    assert arc.length == pytest.approx(10.0, rel=1e-14)


def test_spline_against_quadrature():
    points = [(0, 0), (1, 0.2), (1.5, 1.5), (0.2, 1.1), (0, 2.5)]
    spline = BSplineCurve.interpolate(points)
    arc = ArcLength.of(spline)
    for t in (0.2, 0.5, 0.77, 1.0):
        cuts = [b for b in spline.breaks() if b < t] + [t]
        exact = sum(
            quad(lambda v: float(np.linalg.norm(spline.derivative(v))), a, b, epsabs=1e-13, epsrel=1e-13)[0]
            for a, b in pairwise(cuts)
        )
        assert arc.fraction_at(t) * arc.length == pytest.approx(exact, rel=1e-12)


@settings(max_examples=60, deadline=None)
@given(CONTROL, st.lists(st.floats(0.0, 1.0), min_size=1, max_size=8))
def test_inverse_returns_the_fraction(control, fractions):
    arc = ArcLength.of(CubicBezier(control))
    np.testing.assert_allclose(arc.fraction_at(arc.parameter_at(fractions)), fractions, atol=1e-12)
    assert arc.length == pytest.approx(CubicBezier(control).length, rel=1e-11)


def test_inverse_at_a_cusp():
    # (τ², τ³) with τ = t − 1/2: s(τ) = ±((4 + 9τ²)^1.5 − 8)/27.
    cusp = CubicBezier([(0.25, -0.125), (0.25 - 1 / 3, 0.125), (0.25 - 1 / 3, -0.125), (0.25, 0.125)])
    arc = ArcLength.of(cusp)
    tau = np.array([-0.4, -1e-2, 1e-3, 0.3])
    half = ((4 + 9 / 4) ** 1.5 - 8) / 27
    fraction = 0.5 + 0.5 * np.sign(tau) * ((4 + 9 * tau**2) ** 1.5 - 8) / 27 / half
    np.testing.assert_allclose(arc.parameter_at(fraction), 0.5 + tau, atol=1e-10)
    assert arc.length == pytest.approx(2 * half, rel=1e-12)


def test_refuses_a_point():
    with pytest.raises(InvalidInputError, match="positive"):
        ArcLength.of(CubicBezier([(1, 1)] * 4))


@pytest.mark.parametrize("points", [[(0, 0), (0, 0), (1, 2), (3, 0)], [(0, 0), (0, 0), (0, 0), (3, 1)]])
def test_ends_of_zero_speed(points):
    for curve in (CubicBezier(points), CubicBezier(points[::-1])):
        arc = ArcLength.of(curve)
        fraction = np.array([0.0, 1e-12, 0.3, 1.0 - 1e-12, 1.0])
        assert np.abs(arc.fraction_at(arc.parameter_at(fraction)) - fraction).max() < 1e-12
        t = arc.parameter_at([0.0, 1.0])
        assert np.abs(curve.point(t) - curve.point(np.array([0.0, 1.0]))).max() < 1e-12
