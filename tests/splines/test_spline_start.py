"""Starts of elastic splines: cubic interpolants, what is read off a design, and the nearest stable shapes."""

import numpy as np
import pytest

from batten.curves.elastica import Elastica
from batten.curves.piecewise import PiecewiseCurve
from batten.errors import ConvergenceError, InvalidInputError
from batten.splines.spline_start import (
    checked_points,
    clamped_pieces,
    design_joints,
    hermite_cubics,
    interpolating_cubic,
    shared_length,
)

POINTS = np.array([(0.0, 0.0), (1.0, 0.6), (2.1, -0.1), (2.9, 0.3)])


@pytest.mark.parametrize("uniform", [True, False])
def test_the_cubic_interpolates_with_its_tangents(uniform):
    spline = interpolating_cubic(POINTS, 0.9, None, uniform=uniform)
    np.testing.assert_allclose(spline.point(spline.breaks()), POINTS, atol=1e-13)
    x, y = spline.derivative(0.0)
    assert np.arctan2(y, x) == pytest.approx(0.9, abs=1e-12)
    np.testing.assert_allclose(spline.derivative(1.0, 2), 0.0, atol=1e-10)
    inner = spline.breaks()[1:-1]
    np.testing.assert_allclose(spline.derivative(inner - 1e-9, 2), spline.derivative(inner + 1e-9, 2), atol=1e-5)
    if uniform:
        np.testing.assert_allclose(np.diff(spline.breaks()), 1.0 / 3.0, atol=1e-14)


def test_joints_of_a_curve_that_is_known():
    """Three quarters of a circle, past π."""
    arcs = PiecewiseCurve(
        [Elastica((2.0, 0.0), 0.5 * np.pi, 0.5, (0.0, 0.0), np.pi).extended(-a, a) for a in (0.0, np.pi)]
    )
    whole = Elastica((2.0, 0.0), 0.5 * np.pi, 0.5, (0.0, 0.0), 3.0 * np.pi)
    joints = design_joints(whole, 3)
    np.testing.assert_allclose(joints.angles, 0.5 * np.pi * np.arange(1, 5), atol=1e-9)
    np.testing.assert_allclose(joints.lengths, np.pi, rtol=1e-9)
    np.testing.assert_allclose(joints.headings[1], np.linspace(np.pi, 1.5 * np.pi, 33), atol=2e-3)
    assert design_joints(arcs, 2).angles == pytest.approx([0.5 * np.pi, np.pi, 1.5 * np.pi], abs=1e-9)


def test_shared_length_keeps_proportions_and_sum():
    lengths = shared_length(np.array([1.2, 1.1, 2.0]), np.array([1.0, 1.0, 2.0]), 4.9)
    assert lengths.sum() == pytest.approx(4.9, rel=1e-14)
    assert (lengths[0] - 1.0) / (lengths[1] - 1.0) == pytest.approx(2.0)
    assert lengths[2] > 2.0


def test_pieces_are_the_nearest_to_the_headings():
    ends, lengths = np.array([(0.0, 0.0), (0.8, 0.0)]), np.array([1.0])
    for sign in (1.0, -1.0):
        headings = sign * np.linspace(1.0, -1.0, 33)[None]
        pieces = clamped_pieces(ends, np.zeros(2), lengths, headings)
        middle = Elastica.from_parameters(pieces.parameters[0]).point(0.5)
        assert sign * middle[1] > 0.1


def test_hermite_cubics_have_points_and_tangents():
    angles = np.array([0.3, -0.2, 0.1, 2.0])
    curve = hermite_cubics(POINTS, angles)
    np.testing.assert_allclose(curve.joints().tangent_jumps, 0.0, atol=1e-14)
    np.testing.assert_allclose(curve.point(np.arange(4) / 3), POINTS, atol=1e-14)


def test_errors():
    with pytest.raises(InvalidInputError, match="numbers"):
        checked_points("abc")
    with pytest.raises(InvalidInputError, match="no length"):
        design_joints(hermite_cubics(np.zeros((3, 2)), np.zeros(3)), 2)
    with pytest.raises(InvalidInputError, match="finite"):
        interpolating_cubic(POINTS, np.inf, 0.0)
    with pytest.raises(ConvergenceError, match="piece 0"):
        clamped_pieces(POINTS[:2], np.array([2.0, 2.0]), np.array([np.hypot(1.0, 0.6)]), None)
