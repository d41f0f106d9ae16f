"""B-spline curves against the Cox–de Boor recursion in exact rational arithmetic."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest

from batten.curves.base import Curve
from batten.curves.bezier import CubicBezier
from batten.curves.bspline import BSplineCurve
from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError

T = np.linspace(0.0, 1.0, 23)


def _basis(i, p, knots, u, last):
    if p == 0:
        inside = knots[i] <= u < knots[i + 1] if u < last else knots[i] < u == knots[i + 1]
        return Fraction(int(inside))
    total = Fraction(0)
    if knots[i + p] > knots[i]:
        total += (u - knots[i]) / (knots[i + p] - knots[i]) * _basis(i, p - 1, knots, u, last)
    if knots[i + p + 1] > knots[i + 1]:
        total += (knots[i + p + 1] - u) / (knots[i + p + 1] - knots[i + 1]) * _basis(i + 1, p - 1, knots, u, last)
    return total


def _exact(curve, t):
    knots = [Fraction(float(v)) for v in curve.knots]
    a, b = (Fraction(v) for v in curve.domain)
    u = a + (b - a) * Fraction(float(t))
    n = len(curve.control_points)
    weights = [_basis(i, curve.degree, knots, u, b) for i in range(n)]
    return [float(sum(w * Fraction(float(v)) for w, v in zip(weights, curve.control_points[:, k]))) for k in (0, 1)]


def _curves():
    rng = np.random.default_rng(3)
    for degree in (1, 2, 3, 5):
        inner = np.array([0.5, 1.25, 1.25, 3.0]) if degree > 1 else np.array([0.5, 1.25, 3.0])
        clamped = np.concatenate([np.zeros(degree + 1), inner, np.full(degree + 1, 4.0)])
        yield BSplineCurve(clamped, rng.normal(size=(len(clamped) - degree - 1, 2)), degree)
        floating = np.sort(rng.uniform(-2, 5, size=degree + 8))
        yield BSplineCurve(floating, rng.normal(size=(7, 2)), degree)


CURVES = list(_curves())
IDS = [f"degree-{c.degree}-{'clamped' if c.knots[0] == 0.0 else 'floating'}" for c in CURVES]


@pytest.mark.parametrize("curve", CURVES, ids=IDS)
def test_point_is_the_recursion(curve):
    assert isinstance(curve, Curve)
    for t in np.concatenate([T, curve.breaks()]):
        np.testing.assert_allclose(curve.point(t), _exact(curve, t), atol=1e-13)


@pytest.mark.parametrize("curve", CURVES, ids=IDS)
def test_derivatives_are_those_of_the_polynomial_on_each_span(curve):
    edges = curve.breaks()
    for left, right in pairwise(edges):
        x = 0.5 - 0.5 * np.cos(np.linspace(0.05, np.pi - 0.05, 8))
        samples = np.array([_exact(curve, left + (right - left) * v) for v in x])
        fits = [np.polynomial.Polynomial.fit(x, samples[:, k], curve.degree) for k in (0, 1)]
        for order in (1, 2, 3):
            expected = np.stack([f.deriv(order)(x[1:-1]) for f in fits], axis=-1) / (right - left) ** order
            found = curve.derivative(left + (right - left) * x[1:-1], order)
            np.testing.assert_allclose(found, expected, atol=1e-9 * max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("curve", [c for c in CURVES if c.degree <= 3])
def test_beziers_are_the_same_curve(curve):
    pieces, edges = curve.to_beziers(), curve.breaks()
    assert len(pieces) == len(edges) - 1
    for piece, left, right in zip(pieces, edges[:-1], edges[1:]):
        x = np.linspace(0, 1, 7)
        expected = [_exact(curve, left + (right - left) * v) for v in x]
        np.testing.assert_allclose(piece.point(x), expected, atol=1e-13)
    assert sum(p.length for p in pieces) == pytest.approx(curve.length, rel=1e-12)


def test_a_bezier_goes_through_unchanged():
    points = np.array([(0.1, 0.2), (0.4, 1.0), (0.9, -0.2), (1.3, 0.4)])
    curve = BSplineCurve([2, 2, 2, 2, 5, 5, 5, 5], points)
    (piece,) = curve.to_beziers()
    np.testing.assert_array_equal(piece.control_points, points)
    for order in (1, 2, 3):
        np.testing.assert_allclose(curve.derivative(T, order), CubicBezier(points).derivative(T, order), atol=1e-12)


def test_interpolation_passes_through_and_is_not_a_knot():
    rng = np.random.default_rng(8)
    points = np.cumsum(rng.uniform(0.2, 1.0, size=(9, 2)) * [1, -1], axis=0)
    curve = BSplineCurve.interpolate(points)
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = chord / chord[-1]
    np.testing.assert_allclose(curve.point(at), points, atol=1e-13)
    step = 1e-9
    for order in (1, 2):
        jump = curve.derivative(at[1:-1] + step, order) - curve.derivative(at[1:-1] - step, order)
        assert np.abs(jump).max() < 1e-4
    for knot in at[[1, -2]]:
        np.testing.assert_allclose(curve.derivative(knot + step, 3), curve.derivative(knot - step, 3), rtol=1e-6)
    assert np.abs(curve.derivative(at[3] + step, 3) - curve.derivative(at[3] - step, 3)).max() > 1.0


def test_interpolation_reproduces_a_cubic():
    cubic = CubicBezier([(0, 0), (1, 2), (2, -1), (3, 1)])
    at = np.array([0.0, 0.1, 0.35, 0.6, 0.8, 1.0])
    curve = BSplineCurve.interpolate(cubic.point(at), parameters=5.0 + 3.0 * at)
    np.testing.assert_allclose(curve.point(T), cubic.point(T), atol=1e-14)


@pytest.mark.parametrize("count", [2, 3])
def test_interpolation_of_few_points(count):
    points = np.array([(0, 0), (1, 1), (3, 0)], dtype=float)[:count]
    curve = BSplineCurve.interpolate(points)
    assert curve.degree == count - 1
    np.testing.assert_allclose(curve.point([0.0, 1.0]), points[[0, -1]], atol=1e-15)


def test_length_of_an_interpolated_circle():
    angle = np.linspace(0, 2 * np.pi, 201)
    curve = BSplineCurve.interpolate(np.stack([np.cos(angle), np.sin(angle)], axis=-1))
    assert curve.length == pytest.approx(2 * np.pi, rel=1e-7)
    assert BSplineCurve([0, 0, 1, 1], [(1, 1), (1, 1)], 1).length == 0.0


@pytest.mark.parametrize("curve", CURVES, ids=IDS)
def test_reversed_and_transformed(curve):
    similarity = Similarity(0.3, -2.0, (4.0, 1.0))
    np.testing.assert_allclose(curve.reversed().point(T[1:-1]), curve.point(1 - T[1:-1]), atol=1e-12)
    np.testing.assert_allclose(curve.transformed(similarity).point(T), similarity.apply(curve.point(T)), atol=1e-13)


def test_is_immutable():
    curve = BSplineCurve([0, 0, 1, 1], [(0, 0), (1, 1)], 1)
    with pytest.raises(ValueError, match="read-only"):
        curve.control_points[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        curve.knots[0] = 1.0


@pytest.mark.parametrize(
    ("knots", "points", "degree", "word"),
    [
        ([0, 0, 1, 1], [(0, 0), (1, 1)], 0, "degree"),
        ([0, 0, 1, 1], [(0, 0), (1, 1)], 1.5, "degree"),
        ([0, 0, 1, 1, 1], [(0, 0), (1, 1)], 1, "knots"),
        ([0, 0, 1, 1], [(0, 0, 0), (1, 1, 1)], 1, "shape"),
        ([0, 0, 1, 1], [(0, 0)], 1, "needs"),
        ([0, 1, 0, 1], [(0, 0), (1, 1)], 1, "descend"),
        ([0, 0, 0, 0], [(0, 0), (1, 1)], 1, "empty"),
        ([0, 0, np.nan, 1], [(0, 0), (1, 1)], 1, "finite"),
        ([0, 0, 1, 1], [(0, 0), (1, np.inf)], 1, "finite"),
        ([0, 0, 1, 1, 2, 2], [(0, 0), (1, 1), (2, 2), (3, 3)], 1, "tears"),
    ],
)
def test_refuses(knots, points, degree, word):
    with pytest.raises(InvalidInputError, match=word):
        BSplineCurve(knots, points, degree)


@pytest.mark.parametrize(
    ("points", "parameters", "word"),
    [
        ([(0, 0)], None, "n ≥ 2"),
        ([(0, 0), (1, np.nan)], None, "finite"),
        ([(0, 0), (1, 1), (1, 1), (2, 0)], None, "coincide"),
        ([(0, 0), (1, 1), (2, 1), (2, 0)], [0, 1, 1, 2], "ascend"),
        ([(0, 0), (1, 1), (2, 1), (2, 0)], [0, 1, 2], "one for each"),
    ],
)
def test_interpolation_refuses(points, parameters, word):
    with pytest.raises(InvalidInputError, match=word):
        BSplineCurve.interpolate(points, parameters)


def test_only_cubics_and_lower_become_beziers():
    with pytest.raises(InvalidInputError, match="degree 5"):
        next(c for c in CURVES if c.degree == 5).to_beziers()
