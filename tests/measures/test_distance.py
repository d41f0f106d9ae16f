"""Distances between curves: closed forms, scipy's quadrature with root finding, and dense samples."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.spatial import cKDTree

from batten.curves.bezier import CubicBezier
from batten.curves.bspline import BSplineCurve
from batten.curves.piecewise import PiecewiseCurve
from batten.curves.polyline import Polyline
from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError
from batten.measures.distance import h1_distance, hausdorff_distance, l2_distance

ARCH = CubicBezier([(0, 0), (0, 1), (1, 1), (1, 0)])
COORDINATE = st.floats(-2.0, 2.0, allow_subnormal=False)
CONTROL = st.lists(st.tuples(COORDINATE, COORDINATE), min_size=4, max_size=4, unique=True)


def test_concentric_arcs(arc):
    inner, outer = arc(1.0, 0.2, 7.5), arc(1.25, 0.2, 7.5)
    assert l2_distance(inner, outer) == pytest.approx(0.25 / 7.5, rel=1e-13)
    # Normalised by the first curve: not symmetric.
    assert l2_distance(outer, inner) == pytest.approx(0.25 / (1.25 * 7.5), rel=1e-13)
    assert l2_distance(inner, outer, normalised=False) == pytest.approx(0.25 * np.sqrt(7.5), rel=1e-13)
    assert h1_distance(inner, outer) == pytest.approx(0.25 / 7.5, rel=1e-13)
    assert hausdorff_distance(inner, outer) == pytest.approx(0.25, abs=7.5e-6)


@pytest.mark.parametrize("turn", [0.5, -3.0, 12.0, -40.0])
def test_tangent_angles_are_compared_continuously(arc, turn):
    """Two arcs that differ by a rotation δ about their centre have θ − θₑ = δ throughout, over many turns."""
    for delta in (0.3, -2.9):
        first, second = arc(1.0, 0.0, turn), arc(1.0, delta, turn)
        chord = 2 * np.sin(delta / 2)
        expected = np.hypot(chord / first.length, delta)
        assert h1_distance(first, second) == pytest.approx(expected, rel=1e-12)
        # A whole turn between the curves does not count.
        assert h1_distance(first, arc(1.0, delta + 2 * np.pi, turn)) == pytest.approx(expected, rel=1e-12)


def test_angles_of_unlike_arcs(arc):
    """A straight line against an arc of 4π: θ − θₑ = 4π s/L + const, of which the best multiple of 2π is taken."""
    line = CubicBezier([(0, 0), (1, 0), (2, 0), (3, 0)])
    circle = arc(3 / (4 * np.pi), -np.pi / 2, 4 * np.pi)
    angle_part = h1_distance(line, circle) ** 2 - l2_distance(line, circle) ** 2
    # (4π (s/L) − 2π n)² on average, least for n = 1.
    assert angle_part == pytest.approx((4 * np.pi) ** 2 / 12, rel=1e-12)


def _by_quadrature(first, second):
    """(3.2) and the angle part of (3.3), from nested adaptive quadrature and bisection."""

    def length(curve, t):
        return quad(lambda v: float(np.linalg.norm(curve.derivative(v))), 0, t, epsabs=1e-12, epsrel=1e-12)[0]

    total, other = length(first, 1.0), length(second, 1.0)
    x, w = np.polynomial.legendre.leggauss(60)
    t = (x + 1) / 2
    s = np.array([length(first, v) for v in t]) / total
    u = np.array([brentq(lambda v, goal=f: length(second, v) - goal * other, 0, 1, xtol=1e-13) for f in s])
    ds = np.linalg.norm(first.derivative(t), axis=-1) * w / 2
    gap = first.point(t) - second.point(u)
    angles = [np.unwrap(np.arctan2(*curve.derivative(v).T[::-1])) for curve, v in ((first, t), (second, u))]
    turn = angles[0] - angles[1]
    best = min((ds * (turn - 2 * np.pi * n) ** 2).sum() / total for n in range(-3, 4))
    l2 = np.sqrt((ds * (gap**2).sum(axis=-1)).sum() / total**3)
    return l2, np.hypot(l2, np.sqrt(best))


@pytest.mark.parametrize("seed", range(3))
def test_against_nested_quadrature(seed):
    rng = np.random.default_rng(seed)
    base = np.array([(0, 0), (0.3, 0.8), (0.9, 0.7), (1, 0)])
    first, second = (CubicBezier(base + 0.1 * rng.normal(size=(4, 2))) for _ in range(2))
    l2, h1 = _by_quadrature(first, second)
    assert l2_distance(first, second) == pytest.approx(l2, rel=1e-10)
    assert h1_distance(first, second) == pytest.approx(h1, rel=1e-9)


@settings(max_examples=15, deadline=None)
@given(CONTROL, CONTROL, st.floats(0.1, 10.0), st.floats(-3.0, 3.0))
def test_normalised_distances_are_invariant(first, second, scale, rotation):
    moved = Similarity(scale, rotation, (1.0, -2.0))
    a, b = np.array(first), np.array(second)
    for measure, keywords in ((l2_distance, {}), (hausdorff_distance, {"normalised": True})):
        value = measure(a, b, **keywords)
        assert measure(moved.apply(a), moved.apply(b), **keywords) == pytest.approx(value, abs=3e-6)
        assert measure(a[::-1], b[::-1], **keywords) == pytest.approx(value, abs=3e-6)


def test_a_curve_is_at_distance_zero_from_itself_however_parametrised(elastica_from):
    spline = elastica_from(0.3, 2.0, (3.0, -1.0), 3.0)
    pieces = PiecewiseCurve(ARCH.split(0.2))
    for first, second in (
        (spline, spline),
        (ARCH, pieces),
        (pieces, BSplineCurve([0, 0, 0, 0, 1, 1, 1, 1], ARCH.control_points)),
    ):
        assert l2_distance(first, second) < 1e-13
        assert h1_distance(first, second) < 1e-12
        assert hausdorff_distance(first, second) < 3e-6


def test_corners_and_kinks():
    """Polylines: the distance is piecewise linear in s, so (3.2) has a closed form."""
    corner, straight = Polyline([(0, 0), (1, 0), (1, 1)]), Polyline([(0, 0), (2, 0)])
    # Up to the corner 0, then |γ − γₑ| = √2 (s − 1): ∫ 2u² du over [0, 1] = 2/3.
    assert l2_distance(corner, straight) == pytest.approx(np.sqrt(2 / 3 / 8), rel=1e-13)
    # The angle differs by π/2 on half of the length.
    assert h1_distance(corner, straight) == pytest.approx(np.sqrt(2 / 3 / 8 + np.pi**2 / 8), rel=1e-13)
    assert hausdorff_distance(corner, straight) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("tolerance", [1e-1, 1e-3, 1e-5, 1e-7, 1e-8])
def test_hausdorff_meets_its_tolerance(arc, tolerance):
    half, diameter = arc(1.0, 0.0, np.pi), Polyline([(1, 0), (-1, 0)])
    assert hausdorff_distance(half, diameter, tolerance=tolerance) == pytest.approx(1.0, abs=tolerance)
    # y = x² − 1 on [−1, 1] and the chord: 1; the point (0, 0) of the chord is √3/2 from the parabola.
    parabola = CubicBezier([(-1, 0), (-1 / 3, -4 / 3), (1 / 3, -4 / 3), (1, 0)])
    assert hausdorff_distance(parabola, diameter, tolerance=tolerance) == pytest.approx(1.0, abs=tolerance)
    # Lens of two arcs of angle 2 on the chord from (−sin 1, 0): the sagitta of both, twice.
    low, high = arc(1.0, np.pi / 2 - 1, 2.0, (0, -np.cos(1))), arc(1.0, np.pi / 2 + 1, 2 * np.pi - 2, (0, -np.cos(1)))
    far = hausdorff_distance(low, high, tolerance=tolerance)
    # The lowest point of the large arc, (0, −1 − cos 1), is nearest to the ends of the small one.
    assert far == pytest.approx(np.hypot(np.sin(1), 1 + np.cos(1)), abs=tolerance)


def test_hausdorff_against_dense_samples():
    rng = np.random.default_rng(11)
    t = np.linspace(0, 1, 4001)
    for _ in range(10):
        first, second = CubicBezier(rng.normal(size=(4, 2))), CubicBezier(rng.normal(size=(4, 2)))
        a, b = first.point(t), second.point(t)
        sampled = max(cKDTree(b).query(a)[0].max(), cKDTree(a).query(b)[0].max())
        slack = max(np.linalg.norm(np.diff(p, axis=0), axis=1).max() for p in (a, b))
        assert hausdorff_distance(first, second) == pytest.approx(sampled, abs=slack)
        assert hausdorff_distance(second, first) == pytest.approx(hausdorff_distance(first, second), abs=2e-5)


def test_batches_broadcast_and_bad_rows_stay_alone():
    rng = np.random.default_rng(4)
    rows = rng.normal(size=(3, 1, 4, 2))
    others = rng.normal(size=(2, 4, 2))
    rows[1, 0, 2, 0] = np.nan
    for measure in (l2_distance, h1_distance, hausdorff_distance):
        values = measure(rows, others)
        assert values.shape == (3, 2)
        assert np.isnan(values).tolist() == [[False] * 2, [True] * 2, [False] * 2]
        assert values[2, 1] == measure(CubicBezier(rows[2, 0]), CubicBezier(others[1]))
        assert measure(ARCH, others).shape == (2,)
        assert measure(ARCH, others)[1] == measure(ARCH, CubicBezier(others[1]))
    assert np.isnan(l2_distance(np.ones((4, 2)), others[0]))


@pytest.mark.parametrize(
    ("first", "second", "word"),
    [
        (ARCH, np.zeros((5, 2)), "shape"),
        (np.zeros((2, 4, 2)), np.zeros((3, 4, 2)), "broadcast"),
        (ARCH, CubicBezier([(1, 1)] * 4), "positive"),
        (CubicBezier([(1, 1)] * 4), ARCH, "positive"),
        (ARCH, 3.0, "shape"),
    ],
)
def test_refuses(first, second, word):
    for measure in (l2_distance, h1_distance, hausdorff_distance):
        with pytest.raises(InvalidInputError, match=word):
            measure(first, second)


@pytest.mark.parametrize("tolerance", [0.0, -1.0, np.nan, 1e-12])
def test_hausdorff_refuses_tolerances(tolerance):
    with pytest.raises(InvalidInputError, match="tolerance"):
        hausdorff_distance(ARCH, ARCH, tolerance=tolerance)
