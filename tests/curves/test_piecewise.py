"""Piecewise curves: what is between the pieces, and that the pieces come back."""

import numpy as np
import pytest

from batten.curves.base import Curve
from batten.curves.bezier import CubicBezier
from batten.curves.piecewise import PiecewiseCurve
from batten.curves.polyline import Polyline
from batten.errors import InvalidInputError

PARABOLA = CubicBezier([(0, 0), (1 / 3, 0), (2 / 3, 1 / 3), (1, 1)])  # (t, t²)
CORNER = Polyline([(1, 1), (2, 3), (2, 0)])


def test_pieces_come_back():
    path = PiecewiseCurve([PARABOLA, CORNER])
    assert isinstance(path, Curve)
    t = np.linspace(0, 1, 6)[:-1]
    for i, piece in enumerate(path.pieces):
        np.testing.assert_allclose(path.point((i + t) / 2), piece.point(t), atol=1e-15)
        for order in (1, 2, 3):
            np.testing.assert_allclose(
                path.derivative((i + t) / 2, order), 2**order * piece.derivative(t, order), atol=1e-12
            )
    np.testing.assert_array_equal(path.point(1.0), (2, 0))
    assert path.length == PARABOLA.length + CORNER.length
    np.testing.assert_allclose(path.breaks(), [0.0, 0.5, 0.5 + 0.5 * np.sqrt(5) / (np.sqrt(5) + 3), 1.0])


def test_nan_parameters_give_nan_points():
    assert np.isnan(PiecewiseCurve([PARABOLA]).point([np.nan, 0.5])).tolist() == [[True, True], [False, False]]


def test_joints_of_a_split_curve_are_smooth():
    joints = PiecewiseCurve(PARABOLA.split(0.3)).joints()
    assert joints.position_jumps[0] < 1e-15
    assert abs(joints.tangent_jumps[0]) < 1e-14
    assert abs(joints.curvature_jumps[0]) < 1e-12


def test_joints_measure_each_jump():
    shifted = Polyline([(4, 5), (4, 4)])
    joints = PiecewiseCurve([PARABOLA, shifted, shifted.reversed()]).joints()
    np.testing.assert_allclose(joints.position_jumps, [5.0, 0.0], atol=1e-14)
    np.testing.assert_allclose(joints.tangent_jumps, [-np.pi / 2 - np.arctan(2), np.pi], atol=1e-14)
    np.testing.assert_allclose(joints.curvature_jumps, [-2 / 5**1.5, 0.0], atol=1e-14)


def test_tangents_at_ends_of_zero_speed_are_limits():
    into = CubicBezier([(0, 0), (1, 0), (2, 1), (2, 1)])  # arrives along (1, 1)
    out = CubicBezier([(2, 1), (2, 1), (2, 1), (2, 5)])  # leaves along (0, 1)
    joints = PiecewiseCurve([into, out]).joints()
    assert joints.tangent_jumps[0] == pytest.approx(np.pi / 4, abs=1e-14)
    assert np.isnan(joints.curvature_jumps[0])


def test_one_piece_has_no_joints():
    assert PiecewiseCurve([PARABOLA]).joints().position_jumps.shape == (0,)


@pytest.mark.parametrize(("pieces", "word"), [([], "at least one"), ([PARABOLA, 3.0], "piece 1")])
def test_refuses(pieces, word):
    with pytest.raises(InvalidInputError, match=word):
        PiecewiseCurve(pieces)
