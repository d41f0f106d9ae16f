"""Curves by pieces of elastica: the tolerance as a contract, joints, corners, and fewest against bisection."""

import math
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.font_manager import FontProperties
from matplotlib.path import Path as FontPath
from matplotlib.textpath import TextPath

from batten.curves.bezier import CubicBezier
from batten.curves.bspline import BSplineCurve
from batten.curves.elastica import Elastica
from batten.curves.piecewise import PiecewiseCurve
from batten.curves.polyline import Polyline
from batten.errors import InvalidInputError
from batten.measures.distance import hausdorff_distance
from batten.splines.approximate import approximate, smooth_curve

ARCH = CubicBezier([(0.0, 0.0), (1.0, 3.0), (3.0, -2.0), (4.0, 1.0)])


def random_spline(seed, count=6):
    return BSplineCurve.interpolate(np.random.default_rng(seed).normal(size=(count, 2)).cumsum(axis=0))


def outlines(text, family="DejaVu Sans"):
    """Outlines of letters from matplotlib's own fonts, one curve for each contour, 100 units high."""
    path = TextPath((0.0, 0.0), text, size=100, prop=FontProperties(family=family))
    found, rows, here, start = [], [], None, None
    for numbers, code in path.iter_segments(simplify=False):
        points = numbers.reshape(-1, 2)
        if code == FontPath.MOVETO:
            here, start, rows = points[0], points[0], []
            continue
        if code == FontPath.CURVE3:
            control, end = points
            cubic = [here, (here + 2.0 * control) / 3.0, (2.0 * control + end) / 3.0, end]
        elif code == FontPath.CURVE4:
            cubic = [here, *points]
        else:
            end = start if code == FontPath.CLOSEPOLY else points[0]
            cubic = [here + (end - here) * k / 3.0 for k in range(4)]
        if (cubic[0] != cubic[3]).any():
            rows.append(CubicBezier(np.array(cubic)))
        here = cubic[3]
        if code == FontPath.CLOSEPOLY and rows:
            found.append(PiecewiseCurve(rows))
            rows = []
    return found


def check(curve, found, continuity):
    """What a result says is so, by the public measures, which share no code with the solver's own distances."""
    assert found.status == "converged"
    assert found.distance <= found.tolerance
    within = 1e-2 * found.tolerance
    assert hausdorff_distance(curve, found.curve, tolerance=within) <= found.distance + within
    joints = found.curve.joints()
    mean = found.curve.length / len(found.pieces)
    smooth = ~found.corners[1:-1]
    assert (joints.position_jumps <= 1e-11 * mean).all()
    if continuity != "C0":
        assert (np.abs(joints.tangent_jumps[smooth]) <= 1e-10).all()
    if continuity == "C2":
        assert (np.abs(joints.curvature_jumps[smooth]) * mean <= 1e-10).all()
    assert (np.diff(found.joints) > 0.0).all()
    assert len(found.pieces) <= found.bisect_pieces


@pytest.mark.parametrize("relative", [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize("split", ["bisect", "fewest"])
def test_the_tolerance_is_a_contract(relative, split):
    found = approximate(ARCH, relative * ARCH.length, split=split)
    check(ARCH, found, "C1")
    assert np.allclose(found.pieces[0].start, (0.0, 0.0), atol=1e-12)
    assert math.isclose(found.pieces[0].start_angle, math.atan2(3.0, 1.0), abs_tol=1e-10)


@pytest.mark.parametrize("continuity", ["C0", "C1", "C2"])
@pytest.mark.parametrize("seed", [3, 4])
def test_continuity_at_joints(continuity, seed):
    curve = random_spline(seed)
    check(curve, approximate(curve, 1e-3 * curve.length, continuity=continuity), continuity)


def test_bisection_halves_by_arc_length():
    found = approximate(ARCH, 1e-4 * ARCH.length, split="bisect")
    parts = np.diff(found.joints) / ARCH.length
    assert np.allclose(np.log2(parts), np.round(np.log2(parts)), atol=1e-9)
    assert len(found.pieces) == found.bisect_pieces > 2


def test_an_elastica_is_one_piece():
    curve = Elastica((1.0, 2.0), 0.3, 1.2, (2.0, -1.0), 3.0)
    found = approximate(curve, 1e-6 * curve.length)
    assert len(found.pieces) == 1
    assert found.distance <= 0.05 * found.tolerance  # measured 0: what is left is the error of measuring


def test_corners_stay_corners_and_lines_are_lines():
    square = Polyline([(0, 0), (2, 0), (2, 2), (0, 2), (0, 0)])
    found = approximate(square, 1e-3)
    assert [piece.length for piece in found.pieces] == pytest.approx([2.0] * 4, abs=1e-13)
    assert all(piece.start_curvature == 0.0 for piece in found.pieces)
    assert found.corners.all()
    check(square, found, "C1")


def test_a_fine_polyline_is_taken_as_smooth():
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    ring = Polyline(np.stack([np.cos(turn), np.sin(turn)], axis=1))
    found = approximate(ring, 1e-2, continuity="C1")
    check(ring, found, "C1")
    assert not found.corners.any()
    assert len(found.pieces) <= 2
    joints = found.curve
    gap = joints.point(1.0) - joints.point(0.0)
    assert np.hypot(*gap) < 1e-10


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3])
def test_a_vertex_below_the_corner_angle_is_rounded(tolerance):
    bent = Polyline([(0.0, 0.0), (1.0, 0.0), (2.0, 0.2)])  # a turn of 11°
    found = approximate(bent, tolerance)
    check(bent, found, "C1")
    assert not found.corners[1:-1].any()
    assert approximate(bent, tolerance, corner_angle=0.1).corners.sum() == 3


def test_a_cusp_and_handles_of_length_zero():
    cusp = CubicBezier([(0.0, 0.0), (1.0, 1.0), (0.0, 1.0), (1.0, 0.0)])
    found = approximate(cusp, 1e-3)
    check(cusp, found, "C1")
    assert found.corners.sum() == 3
    stub = CubicBezier([(0.0, 0.0), (0.0, 0.0), (1.0, 1.0), (2.0, 0.0)])
    check(stub, approximate(stub, 1e-4), "C1")


def test_noisy_samples_stand_for_their_smoothing_spline():
    true = Elastica((0.0, 0.0), 0.2, 1.0, (1.0, 2.0), 3.0)
    points = true.point(np.linspace(0.0, 1.0, 200)) + np.random.default_rng(0).normal(scale=1e-3, size=(200, 2))
    found = approximate(points, 5e-3)
    check(smooth_curve(points), found, "C1")
    assert hausdorff_distance(true, found.curve, tolerance=1e-5) < 7e-3  # the tolerance and twice the noise


@settings(max_examples=8, deadline=None)
@given(st.lists(st.tuples(st.floats(-2, 2), st.floats(-2, 2)), min_size=4, max_size=4, unique=True))
def test_any_cubic_meets_the_tolerance(points):
    curve = CubicBezier(points)
    if np.ptp(curve.control_points, axis=0).max() < 1e-3:
        return
    found = approximate(curve, 2e-2 * curve.length)
    check(curve, found, "C1")


@pytest.mark.parametrize("letter", ["o", "S"])
def test_outlines_of_letters(letter):
    for curve in outlines(letter):
        found = approximate(curve, 0.3)
        check(curve, found, "C1")
        assert (found.corners.sum() == 0) == (letter == "o")


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"tolerance": 0.0}, "tolerance"),
        ({"tolerance": math.nan}, "tolerance"),
        ({"tolerance": 1e-12}, "tolerance"),
        ({"continuity": "C3"}, "continuity"),
        ({"split": "most"}, "split"),
        ({"corner_angle": -1.0}, "corner_angle"),
    ],
)
def test_bad_input_is_refused(options, word):
    with pytest.raises(InvalidInputError, match=word):
        approximate(ARCH, **{"tolerance": 1e-2, **options})
    with pytest.raises(InvalidInputError, match="measured points"):
        approximate([(0, 0), (1, 1)], 1e-2)


@pytest.mark.slow
@pytest.mark.parametrize("continuity", ["C0", "C1", "C2"])
def test_fewest_against_bisection_on_200_curves(continuity, capsys):
    """100 random splines, 100 outlines of letters; what is measured is printed, never more pieces is asserted."""
    curves = [random_spline(seed, 4 + seed % 6) for seed in range(100)]
    letters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
    curves += [curve for family in ("DejaVu Sans", "DejaVu Serif") for curve in outlines(letters, family)][:100]
    assert len(curves) == 200
    saved, times = [], []
    for curve in curves:
        begun = time.perf_counter()
        found = approximate(curve, 1e-3 * curve.length, continuity=continuity)
        times.append(time.perf_counter() - begun)
        check(curve, found, continuity)
        saved.append(1.0 - len(found.pieces) / found.bisect_pieces)
    with capsys.disabled():
        print(
            f"\n{continuity}: saved median {100 * np.median(saved):.0f} %, mean {100 * np.mean(saved):.0f} %; "
            f"time median {np.median(times):.2f} s, greatest {max(times):.2f} s"
        )
