"""Any curve by few cubics: the distance held, measured by others; corners, lines, gaps, cusps; pens."""

import numpy as np
import pytest
from fontTools.pens.pointPen import PointToSegmentPen
from fontTools.pens.recordingPen import RecordingPen

from batten.curves.bezier import CubicBezier
from batten.curves.bezier_breaks import fewest_places, halved_places
from batten.curves.bspline import BSplineCurve
from batten.curves.elastica import Elastica
from batten.curves.log_aesthetic import LogAestheticCurve
from batten.curves.piecewise import PiecewiseCurve
from batten.curves.polyline import Polyline
from batten.curves.spiral import Spiral
from batten.curves.to_beziers import to_beziers
from batten.errors import ConvergenceError, InvalidInputError
from batten.kernels import to_beziers as kernel
from batten.measures.distance import hausdorff_distance

RING = Elastica((1, 0), np.pi / 2, 1.0, (0, 0), 2 * np.pi)
CURVES = {
    "ring": RING,
    "elastica": Elastica((3, -1), 0.3, 2.0, (5, -3.0), 3.0),
    "spiral": Spiral([0, 0], 0.0, [0.0, 3.0], 3.0),
    "four": Spiral([0, 0], 0.4, [1.0, -2.0, 3.0, 1.0], 2.5),
    "log": LogAestheticCurve([0.0, 0.0], 0.0, 0.6, 1.0, 4.0, 3.0),
    "spline": BSplineCurve.interpolate([(0, 0), (1, 2), (3, 1), (4, 3), (6, 0)]),
    "cubic": CubicBezier([(0, 0), (3, 3), (0, 3), (3, 0.5)]),
}


@pytest.mark.parametrize("name", CURVES)
def test_the_distance_is_a_contract(name):
    """1e-1 … 1e-8 of the length; measured by flattening and branch and bound, which shares nothing with the bound."""
    curve = CURVES[name]
    for power in (1, 2, 3, 4, 5):
        tolerance = 10.0**-power * curve.length
        found = to_beziers(curve, tolerance)
        slack = 1e-3 * tolerance
        measured = hausdorff_distance(curve, found.curve, tolerance=slack)
        assert measured <= found.distance + slack <= 1.001 * tolerance
        assert len(found.pieces) <= found.halving_pieces
        if len(found.pieces) > 1:
            joints = found.curve.joints()
            assert joints.position_jumps.max() <= 1e-15 * curve.length
            assert np.abs(joints.tangent_jumps).max() < 1e-9
    for power in (6, 7, 8):  # flattening takes too long: points of the cubics, and nearest points by Newton's method
        tolerance = 10.0**-power * curve.length
        found = to_beziers(curve, tolerance)
        assert _farthest(curve, found) <= found.distance + 1e-12 * curve.length <= 1.001 * tolerance
        assert len(found.pieces) <= found.halving_pieces


def _farthest(curve, found):
    worst = 0.0
    r = np.linspace(0.0, 1.0, 41)
    for piece, a, b in zip(found.pieces, found.places[:-1], found.places[1:]):
        dense = np.linspace(a, b, 401)
        on, points = curve.point(dense), piece.point(r)
        t = dense[np.argmin(np.hypot(*(points[:, None] - on).transpose(2, 0, 1)), axis=1)]
        for _ in range(4):
            slope = curve.derivative(t)
            t = np.clip(t + ((points - curve.point(t)) * slope).sum(1) / (slope**2).sum(1), 0.0, 1.0)
        worst = max(worst, float(np.hypot(*(points - curve.point(t)).T).max()))
    return worst


def test_the_bound_is_near_what_is_reached():
    found = to_beziers(CURVES["elastica"], 1e-6)
    assert 0.8 * found.distance < _farthest(CURVES["elastica"], found) <= found.distance


def test_errors_are_equal_and_their_order_is_six():
    curve = CURVES["elastica"]
    found = to_beziers(curve, 1e-8 * curve.length)
    assert found.distances.max() < 1.1 * found.distances.min()
    counts = [len(to_beziers(CURVES["spiral"], 10.0**-p).pieces) for p in (5, 11)]
    assert counts[1] / counts[0] == pytest.approx(10.0, rel=0.15)  # six digits by ten times as many


def test_area_and_moment_are_kept():
    """Of the arc by Green's formula, with quadrature of the curves themselves."""
    curve = Spiral([0, 0], 0.0, [1.0, 0.7], 1.0)
    (piece,) = to_beziers(curve, 1e-2).pieces
    x, w = np.polynomial.legendre.leggauss(40)
    t, w = 0.5 * (x + 1.0), 0.5 * w

    def integrals(c):
        p, d = c.point(t), c.derivative(t)
        return np.array([w @ (p[:, 1] * d[:, 0]), w @ (p[:, 0] * p[:, 1] * d[:, 0])])

    chord = curve.point(1.0)
    turn = np.array([[chord[0], chord[1]], [-chord[1], chord[0]]]) / (chord @ chord)

    class Turned:
        def __init__(self, c):
            self.c = c

        def point(self, s):
            return self.c.point(s) @ turn.T

        def derivative(self, s):
            return self.c.derivative(s) @ turn.T

    np.testing.assert_allclose(integrals(Turned(piece)), integrals(Turned(curve)), rtol=1e-11)


def test_real_roots_of_quartics_are_found():
    out = np.empty(8)
    q = np.polynomial.polynomial.polyfromroots([0.2, 0.5, 0.9, 3.0])
    assert sorted(out[: kernel.quartic_places(q, 1.0, out)]) == pytest.approx([0.2, 0.5, 0.9])
    double = np.polynomial.polynomial.polymul([0.25 + 1e-9, -1.0, 1.0], [2.0, 0.0, 1.0])
    assert out[: kernel.quartic_places(double, 1.0, out)] == pytest.approx([0.5], abs=1e-6)


def test_corners_lines_and_gaps_are_kept():
    square = Polyline([(0, 0), (2, 0), (2, 1), (0, 1), (0, 0)])
    found = to_beziers(square, 1.0)
    assert len(found.pieces) == 4
    assert found.closed
    assert not found.smooth.any()
    line, arc = Polyline([(-1, 0), (0, 0)]), Spiral([0, 0], 0.0, [0.0, 1.0], 1.0)
    mixed = to_beziers(PiecewiseCurve([line, arc]), 0.05)
    np.testing.assert_allclose(mixed.control_points[0], [(-1, 0), (-2 / 3, 0), (-1 / 3, 0), (0, 0)], atol=1e-15)
    assert mixed.smooth.tolist() == [False, True]
    apart = to_beziers(PiecewiseCurve([line, Polyline([(5, 5), (6, 5)])]), 0.1)
    assert apart.joined.tolist() == [False, False]
    np.testing.assert_array_equal(apart.control_points[1, 0], [5, 5])


def test_a_smooth_joint_may_lie_inside_a_piece():
    arc = Spiral([0, 0], 0.0, [1.0], 0.5)
    halves = PiecewiseCurve([Spiral([0, 0], 0.0, [1.0], 0.2), Spiral(arc.point(0.4), 0.2, [1.0], 0.3)])
    assert len(to_beziers(halves, 1e-6).pieces) == 1


def test_cusps_are_passed():
    cusp = CubicBezier([(0, 0), (1, 1), (0, 1), (1, 0)])  # zero speed in the middle
    found = to_beziers(cusp, 1e-4)
    assert hausdorff_distance(cusp, found.curve, tolerance=1e-6) <= 1.02e-4
    still = CubicBezier([(0, 0), (0, 0), (1, 1), (2, 0)])  # zero speed at its start
    assert hausdorff_distance(still, to_beziers(still, 1e-5).curve, tolerance=1e-7) <= 1.02e-5


def test_pens_of_font_tools_see_the_same_outline():
    ring = to_beziers(RING, 1e-3)
    pen, other = RecordingPen(), RecordingPen()
    ring.draw(pen)
    ring.draw_points(PointToSegmentPen(other))
    assert [op for op, _ in pen.value] == ["moveTo", *["curveTo"] * len(ring.pieces), "closePath"]
    assert pen.value == other.value
    square = to_beziers(Polyline([(0, 0), (2, 0), (2, 1), (0, 0)]), 1.0)
    pen = RecordingPen()
    square.draw(pen)
    assert pen.value == [
        ("moveTo", ((0.0, 0.0),)),
        ("lineTo", ((2.0, 0.0),)),
        ("lineTo", ((2.0, 1.0),)),
        ("closePath", ()),
    ]


@pytest.mark.parametrize("tolerance", [0.0, -1.0, np.nan, np.inf, 1e-14])
def test_tolerances_out_of_range_are_refused(tolerance):
    with pytest.raises(InvalidInputError, match="1e-13"):
        to_beziers(RING, tolerance)


def test_greedy_and_halving_on_a_known_error():
    def error(a, b):
        return (b - a) ** 6

    for n in (1, 3, 7, 40):
        assert len(fewest_places(error, 0.0, 1.0, (1.0001 / n) ** 6)[1]) == n
    assert len(halved_places(error, 0.0, 1.0, (1.0001 / 5) ** 6)[1]) == 8
    for divide in (fewest_places, halved_places):
        with pytest.raises(ConvergenceError, match="greater distance"):
            divide(lambda a, b: 1.0, 0.0, 1.0, 0.5)
