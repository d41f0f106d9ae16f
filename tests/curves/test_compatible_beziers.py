"""Béziers of several masters: equal structure, every master within the tolerance, means without kinks."""

import numpy as np
import pytest

from batten.curves.compatible_beziers import compatible_beziers, interpolated_beziers
from batten.curves.piecewise import PiecewiseCurve
from batten.curves.polyline import Polyline
from batten.curves.spiral import Spiral
from batten.curves.to_beziers import to_beziers
from batten.errors import InvalidInputError
from batten.measures.distance import hausdorff_distance
from batten.splines.interpolating_spline import interpolating_spline

LIGHT = np.array([[0, 0], [1, 0.8], [2, 0.1], [3, 0.9], [4, 0.2]])
BOLD = LIGHT * [1.3, 0.6] + [0, 0.1] + np.array([[0, 0], [0, 0], [0.2, -0.3], [0, 0], [0, 0]])
WIDE = LIGHT * [2.0, 1.0]


@pytest.mark.parametrize("closed", [False, True])
def test_masters_keep_their_shape_and_means_are_smooth(closed):
    masters = [interpolating_spline(p, closed=closed).curve for p in (LIGHT, BOLD, WIDE)]
    for tolerance in (1e-1, 1e-3, 1e-4):
        found = compatible_beziers(masters, tolerance)
        assert len({len(f.pieces) for f in found}) == 1
        for f, master in zip(found, masters):
            assert hausdorff_distance(master, f.curve, tolerance=1e-2 * tolerance) <= 1.01 * tolerance
            assert len(f.pieces) >= len(to_beziers(master, tolerance).pieces)
        for weights in ([0.5, 0.5, 0.0], [0.2, 0.3, 0.5], [1.4, -0.2, -0.2]):
            mean = interpolated_beziers(found, weights)
            ring = [*mean, mean[0]] if closed else mean
            joints = PiecewiseCurve(ring).joints()
            assert joints.position_jumps.max() < 1e-13
            assert np.abs(joints.tangent_jumps).max() < 1e-11


def test_without_shared_ratios_means_have_kinks():
    """What the shared ratios are for: independent cubics at the same parameters turn at the joints of their means."""
    masters = [interpolating_spline(p).curve for p in (LIGHT, BOLD)]
    single = [to_beziers(m, 1e-3) for m in masters]
    assert len(single[0].pieces) == len(single[1].pieces)
    joints = PiecewiseCurve(interpolated_beziers(single, [0.5, 0.5])).joints()
    assert np.abs(joints.tangent_jumps).max() > 1e-4
    found = to_beziers(masters[0], 1e-3, compatible_with=masters[1:])
    np.testing.assert_allclose(found.control_points, compatible_beziers(masters, 1e-3)[0].control_points)


def test_a_corner_of_one_master_divides_all():
    bent = PiecewiseCurve([Polyline([(0, 0), (1, 0)]), Polyline([(1, 0), (2, 1)])])
    flat = PiecewiseCurve(
        [Spiral([0, 0], 0.0, [0.3], 1.0), Spiral(Spiral([0, 0], 0.0, [0.3], 1.0).end, 0.3, [0.3], 1.0)]
    )
    one, other = compatible_beziers([bent, flat], 1e-3)
    assert 0.5 in one.places
    assert 0.5 in other.places


def test_bad_masters_are_refused():
    one = interpolating_spline(LIGHT).curve
    with pytest.raises(InvalidInputError, match="two or more"):
        compatible_beziers([one], 1e-3)
    with pytest.raises(InvalidInputError, match="equally many"):
        compatible_beziers([one, interpolating_spline(LIGHT[:4]).curve], 1e-3)
    found = compatible_beziers([one, one], 1e-3)
    with pytest.raises(InvalidInputError, match="sum 1"):
        interpolated_beziers(found, [0.5, 0.6])
    with pytest.raises(InvalidInputError, match="equal numbers"):
        interpolated_beziers([found[0], to_beziers(Spiral([0, 0], 0.0, [1.0], 1.0), 0.1)], [0.5, 0.5])
