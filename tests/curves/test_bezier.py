"""Cubic Béziers against power-basis polynomials in exact arithmetic, closed forms and mpmath."""

from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from batten.curves.base import Curve
from batten.curves.bezier import CubicBezier
from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError

COORDINATE = st.floats(-2.0, 2.0, allow_subnormal=False)
CONTROL = st.lists(st.tuples(COORDINATE, COORDINATE), min_size=4, max_size=4)
ARCH = [(0, 0), (0, 1), (1, 1), (1, 0)]


def _powers(control):
    """Exact coefficients of 1, t, t², t³ for each coordinate."""
    a, b, c, d = ([Fraction(float(v)) for v in row] for row in control)
    return [[a[k], 3 * (b[k] - a[k]), 3 * (c[k] - 2 * b[k] + a[k]), d[k] - 3 * c[k] + 3 * b[k] - a[k]] for k in (0, 1)]


def _from_powers(x, y):
    """Control points (4, 2) of the cubic with these coefficients of 1, t, t², t³."""
    rows = [[c[0], c[0] + c[1] / 3, c[0] + 2 * c[1] / 3 + c[2] / 3, c[0] + c[1] + c[2] + c[3]] for c in (x, y)]
    return np.transpose(rows)


@given(CONTROL, st.floats(0.0, 1.0))
def test_point_and_derivatives_are_those_of_the_polynomial(control, t):
    curve = CubicBezier(control)
    exact_t = Fraction(t)
    for order in range(4):
        expected = []
        for c in _powers(control):
            terms = [c[n] * exact_t ** (n - order) for n in range(order, 4)]
            factors = [np.prod(range(n - order + 1, n + 1), dtype=int) if order else 1 for n in range(order, 4)]
            expected.append(float(sum(int(f) * v for f, v in zip(factors, terms))))
        value = curve.point(t) if order == 0 else curve.derivative(t, order)
        np.testing.assert_allclose(value, expected, rtol=0, atol=2e-14 * 6**order)


def test_broadcasts_over_parameters_and_ends_exactly():
    curve = CubicBezier([(0.1, 0.2), (0.3, 0.9), (0.7, -0.3), (1.1, 0.6)])
    t = np.linspace(0, 1, 6).reshape(2, 3)
    assert curve.point(t).shape == curve.derivative(t, 3).shape == (2, 3, 2)
    assert curve.curvature(t).shape == (2, 3)
    np.testing.assert_array_equal(curve.point([0.0, 1.0]), curve.control_points[[0, 3]])
    assert isinstance(curve, Curve)


def test_curvature_of_a_parabola():
    parabola = CubicBezier([(0, 0), (1 / 3, 0), (2 / 3, 1 / 3), (1, 1)])  # (t, t²)
    t = np.linspace(0, 1, 11)
    np.testing.assert_allclose(parabola.curvature(t), 2 / (1 + 4 * t**2) ** 1.5, rtol=1e-14)
    np.testing.assert_allclose(parabola.reversed().curvature(1 - t), -2 / (1 + 4 * t**2) ** 1.5, rtol=1e-13)


def test_curvature_is_nan_where_the_speed_is_zero():
    assert np.isnan(CubicBezier([(0, 0), (0, 0), (1, 1), (2, 0)]).curvature(0.0))


def test_length_in_closed_form():
    assert CubicBezier(ARCH).length == pytest.approx(2.0, rel=1e-14)
    parabola = CubicBezier([(0, 0), (1 / 3, 0), (2 / 3, 1 / 3), (1, 1)])
    assert parabola.length == pytest.approx(np.sqrt(5) / 2 + np.arcsinh(2) / 4, rel=1e-14)
    assert CubicBezier([(0, 0), (1, 2), (2, 4), (3, 6)]).length == pytest.approx(np.sqrt(45), rel=1e-14)
    assert CubicBezier([(1, 2)] * 4).length == 0.0


def test_length_of_a_cusp():
    # (τ², τ³) with τ = t − 1/2: |γ'| = |τ| (4 + 9τ²)^½.
    control = _from_powers([0.25, -1.0, 1.0, 0.0], [-0.125, 0.75, -1.5, 1.0])
    exact = 2 * ((4 + 9 / 4) ** 1.5 - 8) / 27
    assert CubicBezier(control).length == pytest.approx(exact, rel=1e-13)


def test_length_of_a_line_that_doubles_back():
    # x = 3t(1−t): out to 3/4 and back.
    assert CubicBezier([(0, 0), (1, 0), (1, 0), (0, 0)]).length == pytest.approx(1.5, rel=1e-13)


@pytest.mark.parametrize("offset", [1e-2, 1e-4, 1e-7, 1e-11])
def test_length_near_a_cusp(offset):
    # (τ², τ³ + offset τ): the speed at τ = 0 is `offset`.
    control = _from_powers([0.25, -1.0, 1.0, 0.0], [-0.125 - offset / 2, 0.75 + offset, -1.5, 1.0])
    with mpmath.workdps(30):
        d = [[mpmath.mpf(float(v)) for v in row] for row in control]

        def speed(t):
            u = 1 - t
            e = [[3 * (d[i + 1][k] - d[i][k]) for i in range(3)] for k in (0, 1)]
            return mpmath.hypot(*(u**2 * a + 2 * t * u * b + t**2 * c for a, b, c in e))

        steps = [mpmath.mpf(1) / 2 + s * mpmath.mpf(10) ** -e for s in (-1, 1) for e in range(1, 14)]
        exact = float(mpmath.quad(speed, sorted([mpmath.mpf(0), *steps, mpmath.mpf(1) / 2, mpmath.mpf(1)])))
    assert CubicBezier(control).length == pytest.approx(exact, rel=1e-13)


@given(CONTROL, st.floats(0.01, 0.99), st.floats(0.0, 1.0))
def test_split_runs_over_the_same_points(control, at, t):
    curve = CubicBezier(control)
    before, after = curve.split(at)
    np.testing.assert_allclose(before.point(t), curve.point(at * t), atol=1e-14)
    np.testing.assert_allclose(after.point(t), curve.point(at + (1 - at) * t), atol=1e-14)
    assert before.length + after.length == pytest.approx(curve.length, rel=1e-12, abs=1e-14)


@given(CONTROL, st.floats(0.0, 1.0))
def test_reversed_and_transformed(control, t):
    curve = CubicBezier(control)
    similarity = Similarity(2.5, 0.7, (3.0, -1.0))
    np.testing.assert_allclose(curve.reversed().point(t), curve.point(1 - t), atol=1e-14)
    np.testing.assert_allclose(curve.transformed(similarity).point(t), similarity.apply(curve.point(t)), atol=1e-13)


def test_is_immutable_and_copies():
    points = np.array(ARCH, dtype=float)
    curve = CubicBezier(points)
    points[0] = 7.0
    assert curve.control_points[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        curve.control_points[0] = 1.0
    with pytest.raises(AttributeError):
        curve.control_points = points


@pytest.mark.parametrize(
    ("points", "word"),
    [
        ([(0, 0), (1, 1), (2, 2)], "shape"),
        (np.zeros((2, 4, 2)), "shape"),
        ([(0, 0), (1, np.nan), (2, 2), (3, 3)], "finite"),
        ([(0, 0), (1, np.inf), (2, 2), (3, 3)], "finite"),
    ],
)
def test_refuses(points, word):
    with pytest.raises(InvalidInputError, match=word):
        CubicBezier(points)


@pytest.mark.parametrize("at", [0.0, 1.0, -1.0, np.nan])
def test_refuses_to_split_outside(at):
    with pytest.raises(InvalidInputError, match="inside"):
        CubicBezier(ARCH).split(at)


def test_refuses_other_orders():
    with pytest.raises(InvalidInputError, match="order"):
        CubicBezier(ARCH).derivative(0.5, 4)
