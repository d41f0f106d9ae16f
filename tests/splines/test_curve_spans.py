"""Spans between corners: angles, samples and traces of curves whose arc length is known."""

import numpy as np
import pytest

from batten.curves.bezier import CubicBezier
from batten.curves.elastica import Elastica
from batten.curves.piecewise import PiecewiseCurve
from batten.curves.polyline import Polyline
from batten.splines.curve_spans import spans_of

RING = Elastica((1.0, 0.0), np.pi / 2, 1.0, (0.0, 0.0), 2.0 * np.pi)


def test_a_closed_smooth_curve_is_one_span_that_goes_round():
    (span,) = spans_of(RING, 1e-4, 0.1, 1e-2)
    assert span.closed
    s = np.array([-1.0, 0.5, 7.0])
    assert np.allclose(span.points_at(s), np.stack([np.cos(s), np.sin(s)], axis=1), atol=1e-11)
    assert np.allclose(span.angles_at(s), np.pi / 2 + s, atol=1e-11)
    part = span.part(6.0, 7.0)
    assert np.allclose(part[[0, -1]], [[np.cos(a), np.sin(a)] for a in (6.0, 7.0)], atol=1e-11)
    turn = np.unwrap(np.arctan2(part[:, 1], part[:, 0]))
    assert (np.diff(turn) > -1e-12).all()
    assert np.ptp(turn) == pytest.approx(1.0, abs=1e-11)


@pytest.mark.parametrize("fineness", [1e-2, 1e-4, 1e-6])
def test_the_trace_is_as_fine_as_asked(fineness):
    (span,) = spans_of(RING, fineness, 0.1, 1e-2)
    steps = np.hypot(*np.diff(span.trace, axis=0).T)
    assert (1.0 - np.sqrt(1.0 - 0.25 * steps**2)).max() <= fineness


def test_samples_are_the_curves_own():
    curve = Elastica((1.0, 2.0), 0.3, 1.2, (2.0, -1.0), 3.0)
    (span,) = spans_of(curve, 1e-4, 0.1, 1e-2)
    a, b = np.array([0.0, 1.0]), np.array([0.7, 3.0])
    samples = span.samples(a, b)
    s = a[:, None] + (b - a)[:, None] * samples.fractions
    assert np.allclose(samples.points, curve.point_at(s), atol=1e-11)
    assert np.allclose(samples.angles, curve.angle_at(s), atol=1e-11)
    assert np.allclose(samples.curvatures, curve.curvature_at(s), atol=1e-9)
    assert np.allclose(samples.weights.sum(axis=1), b - a, atol=1e-13)
    assert np.allclose(samples.ends[..., 2], curve.angle_at(np.stack([a, b], axis=1)), atol=1e-11)


def test_corners_cut_and_kinks_do_not():
    corner = Polyline([(0, 0), (1, 0), (2, 0.1), (2, 1)])
    spans = spans_of(corner, 1e-3, np.radians(20.0), 1e-2)
    assert [len(span.arcs) for span in spans] == [3, 2]
    assert [span.straight for span in spans] == [False, True]
    kink = np.arctan2(0.1, 1.0)
    assert spans[0].angles_at(np.array([0.2, 1.0, 1.8])) == pytest.approx([0.0, 0.5 * kink, kink], abs=1e-12)
    assert len(spans_of(corner, 1e-3, 0.01, 1e-2)) == 3


def test_a_cusp_is_a_corner_with_a_tangent_on_either_side():
    cusp = CubicBezier([(0.0, 0.0), (1.0, 1.0), (0.0, 1.0), (1.0, 0.0)])
    first, second = spans_of(cusp, 1e-5, 0.1, 1e-3)
    assert first.length == pytest.approx(second.length, rel=1e-4)
    assert np.cos(first.angles[-1]) == pytest.approx(0.0, abs=0.05)
    assert np.sin(first.angles[-1]) == pytest.approx(1.0, abs=0.01)
    assert np.sin(second.angles[0]) == pytest.approx(-1.0, abs=0.01)


def test_a_tangent_where_the_speed_is_zero():
    stub = PiecewiseCurve([CubicBezier([(0.0, 0.0), (0.0, 0.0), (1.0, 2.0), (3.0, 0.0)])])
    (span,) = spans_of(stub, 1e-4, 0.1, 1e-2)
    assert span.angles[0] == pytest.approx(np.arctan2(2.0, 1.0), abs=1e-3)
