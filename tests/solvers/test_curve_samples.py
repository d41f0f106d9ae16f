"""Samples of curves: quadrature, arc length, angles and curvature against scipy and closed forms; measured points."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from batten.curves.bezier import CubicBezier
from batten.curves.bspline import BSplineCurve
from batten.curves.elastica import Elastica
from batten.curves.piecewise import PiecewiseCurve
from batten.errors import InvalidInputError
from batten.solvers.curve_samples import from_points, gauss_rule, samples_of
from batten.solvers.smoothing_spline import smoothing_spline

CONTROL = np.array([(0.0, 0.0), (0.3, 0.9), (0.8, -0.5), (1.0, 0.2)])


@pytest.mark.parametrize("n", [2, 5, 16, 32])
def test_the_rule_integrates_polynomials_to_every_node(n):
    t, w, cumulative = gauss_rule(n)
    for degree in range(n):
        np.testing.assert_allclose(cumulative @ t**degree, t ** (degree + 1) / (degree + 1), atol=1e-14)
    assert w @ t ** (2 * n - 1) == pytest.approx(1.0 / (2 * n), abs=1e-15)


def test_a_cubic_against_adaptive_quadrature():
    curve = CubicBezier(CONTROL)
    samples, shape = samples_of(CONTROL, nodes=32)
    assert shape == ()
    t = gauss_rule(32)[0]
    np.testing.assert_allclose(samples.points[0], curve.point(t), atol=1e-15)

    def speed(u):
        return np.hypot(*curve.derivative(u, 1))

    length = quad(speed, 0.0, 1.0, epsabs=1e-13)[0]
    assert samples.lengths[0] == pytest.approx(length, rel=1e-9)
    for i in (0, 7, 31):
        assert samples.fractions[0, i] == pytest.approx(quad(speed, 0.0, t[i], epsabs=1e-13)[0] / length, abs=1e-7)
    first, second = curve.derivative(t, 1), curve.derivative(t, 2)
    np.testing.assert_allclose(np.cos(samples.angles[0]), first[:, 0] / np.hypot(*first.T), atol=1e-14)
    expected = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / np.hypot(*first.T) ** 3
    np.testing.assert_allclose(samples.curvatures[0], expected, rtol=1e-12, atol=1e-12)
    # ∫κ ds is how far the tangent turns.
    turned = samples.ends[0, 1, 2] - samples.ends[0, 0, 2]
    assert samples.weights[0] @ samples.curvatures[0] == pytest.approx(turned, abs=1e-6)


def test_a_curve_and_its_control_points_give_the_same():
    one, other = samples_of(CONTROL)[0], samples_of(CubicBezier(CONTROL))[0]
    for name in one.__dataclass_fields__:
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize(("least", "most", "nodes", "error"), [(1, 3, 32, 1e-10), (3, 10, 32, 2e-5), (3, 10, 64, 2e-8)])
def test_lengths_are_as_good_as_promised(least, most, nodes, error):
    random, counted = np.random.default_rng(8), 0
    for control in random.normal(size=(120, 4, 2)):
        curve = CubicBezier(control)
        speed = np.hypot(*curve.derivative(np.linspace(0.0, 1.0, 400), 1).T)
        if not least <= speed.max() / speed.min() < most:
            continue
        counted += 1
        length = quad(lambda u, c=curve: np.hypot(*c.derivative(u, 1)), 0.0, 1.0, epsabs=1e-13, limit=200)[0]
        assert samples_of(control, nodes=nodes)[0].lengths[0] == pytest.approx(length, rel=error)
    assert counted > 10


def test_leading_shapes():
    samples, shape = samples_of(np.broadcast_to(CONTROL, (2, 3, 4, 2)), nodes=8)
    assert shape == (2, 3)
    assert len(samples) == 6
    assert samples.points.shape == (6, 8, 2)
    assert samples.ends.shape == (6, 2, 3)


def test_angles_go_on_where_the_curve_winds():
    coil = Elastica((0.0, 0.0), 3.0, 4.0, (0.0, 0.0), 5.0)  # a circle, more than three times round
    samples, _ = samples_of(coil, nodes=40)
    np.testing.assert_allclose(samples.angles[0], 3.0 + 20.0 * samples.fractions[0], atol=1e-12)
    np.testing.assert_allclose(samples.ends[0, :, 2], [3.0, 23.0], atol=1e-12)
    np.testing.assert_allclose(samples.curvatures, 4.0, rtol=1e-12)


def test_every_piece_has_its_own_nodes():
    pieces = [CubicBezier([(0, 0), (1, 0), (2, 0), (3, 0)]), CubicBezier([(3, 0), (3, 1), (3, 2), (3, 3)])]
    samples, _ = samples_of(PiecewiseCurve(pieces), nodes=6)
    assert samples.points.shape == (1, 12, 2)
    assert samples.lengths[0] == pytest.approx(6.0, rel=1e-15)
    np.testing.assert_allclose(samples.angles[0], np.repeat([0.0, np.pi / 2], 6), atol=1e-14)
    assert (np.diff(samples.fractions[0]) > 0.0).all()
    knots = [0, 0, 0, 0, 1, 2, 3, 3, 3, 3]
    spline = BSplineCurve(knots, [(0, 0), (1, 1), (2, 0), (3, 1), (4, 0), (5, 2)])
    assert samples_of(spline, nodes=4)[0].points.shape[1] == 4 * (len(spline.breaks()) - 1)


def test_handles_without_length_still_have_a_direction():
    samples, _ = samples_of([[(0, 0), (0, 0), (1, 1), (2, 0)], [(0, 0), (1, 1), (2, 0), (2, 0)]])
    np.testing.assert_allclose(samples.ends[0, :, 2], [np.pi / 4, -np.pi / 4], atol=1e-12)
    np.testing.assert_allclose(samples.ends[1, :, 2], [np.pi / 4, -np.pi / 4], atol=1e-12)


def test_bad_rows_stay_in_their_rows():
    rows = np.stack([CONTROL, np.full((4, 2), np.nan), np.zeros((4, 2)), 2 * CONTROL])
    samples, _ = samples_of(rows)
    assert np.isfinite(samples.lengths).tolist() == [True, False, True, True]
    assert samples.lengths[2] == 0.0
    assert samples.lengths[3] == pytest.approx(2 * samples.lengths[0], rel=1e-14)


def test_exact_points_give_back_their_curve():
    true = Elastica.from_modulus(0.7, -1.0, 3.5, 40.0, 0.5, (1e3, -2e3))
    samples = from_points(true.point(np.linspace(0.0, 1.0, 100)))
    assert samples.lengths[0] == pytest.approx(true.length, rel=1e-8)
    s = samples.fractions[0] * true.length
    np.testing.assert_allclose(samples.points[0], true.point_at(s), atol=1e-7 * true.length)
    np.testing.assert_allclose(samples.angles[0], true.angle_at(s), atol=1e-6)
    # The ends too: no natural boundary bends them straight.
    np.testing.assert_allclose(
        samples.curvatures[0], true.curvature_at(s), atol=1e-4 * np.abs(true.curvature_at(s)).max()
    )


@pytest.mark.parametrize("count", [5, 6, 7, 8, 9, 10, 13])
def test_few_points_are_enough(count):
    arc = Elastica((0.0, 0.0), 0.0, 1.0, (0.0, 0.0), 1.0)
    samples = from_points(arc.point(np.linspace(0.0, 1.0, count)))
    assert samples.lengths[0] == pytest.approx(1.0, rel=1e-3)


def test_more_smoothing_is_smoother_and_the_limit_is_a_parabola():
    random = np.random.default_rng(2)
    t = np.linspace(0.0, 1.0, 50)
    data = np.stack([t, np.sin(5 * t)], axis=-1) + 0.01 * random.normal(size=(50, 2))
    fine = np.linspace(0.0, 1.0, 400)
    rough = [(smoothing_spline(t, data, w)(fine, 3) ** 2).mean() for w in (1e-12, 1e-8, 1e-4, 1.0)]
    assert (np.diff(rough) < 0.0).all()
    parabola = np.polynomial.polynomial.polyfit(t, data, 2)
    flat = smoothing_spline(t, data, 1e9)(fine)
    np.testing.assert_allclose(flat, np.polynomial.polynomial.polyval(fine, parabola).T, atol=1e-6)


def test_cross_validation_finds_the_noise():
    t = np.linspace(0.0, 1.0, 200)
    exact = np.stack([t, np.sin(5 * t)], axis=-1)
    for noise in (1e-4, 1e-2):
        data = exact + noise * np.random.default_rng(3).normal(size=exact.shape)
        error = np.sqrt(((smoothing_spline(t, data)(t) - exact) ** 2).mean())
        assert error < 0.45 * noise  # of 200 points some ten parameters: √(10/200) = 0.22 is what can be had


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((3, 2)), "m ≥ 5"),
        (np.zeros((6, 3)), r"\(6, 3\)"),
        ([(0, 0), (1, 0), (1, 0), (2, 0), (3, 1), (4, 1)], r"\[1\] coincide"),
        ([(0, 0), (1, 0), (np.nan, 0), (2, 0), (3, 1)], "all finite"),
    ],
)
def test_points_that_make_no_curve_are_refused(points, message):
    with pytest.raises(InvalidInputError, match=message):
        from_points(points)
    with pytest.raises(InvalidInputError, match="from_points"):
        samples_of(points)
