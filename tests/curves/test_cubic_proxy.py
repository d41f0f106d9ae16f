"""Cubic splines on uniform knots: smoothness, what moves with what, borders, pieces put in and taken out."""

import numpy as np
import pytest

from batten.curves.base import Curve
from batten.curves.bspline import BSplineCurve
from batten.curves.cubic_proxy import Border, CubicProxy
from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError
from batten.measures.distance import hausdorff_distance


def winding(continuity, pieces=5, seed=0, noise=0.15):
    line = CubicProxy.line((0, 0), (6, 1), pieces, continuity)
    shift = noise * np.random.default_rng(seed).standard_normal(line.control_points.shape)
    return CubicProxy(line.control_points + shift, continuity)


@pytest.mark.parametrize("continuity", [1, 2])
def test_derivatives_meet_at_the_joints(continuity):
    p = winding(continuity).pieces
    for order in range(continuity + 1):
        before, after = np.diff(p[:-1], order, axis=1)[:, -1], np.diff(p[1:], order, axis=1)[:, 0]
        assert np.abs(before - after).max() < 1e-13
    third = np.diff(p, 3, axis=1)[:, 0]
    assert np.abs(np.diff(third, axis=0)).max() > 0.1


def test_continuity_two_is_the_clamped_b_spline():
    proxy = winding(2)
    other = BSplineCurve(np.clip(np.arange(-3, 9), 0, 5), proxy.control_points)
    assert np.abs(np.array([b.control_points for b in other.to_beziers()]) - proxy.pieces).max() < 1e-14
    assert isinstance(proxy, Curve)
    t = np.linspace(0, 1, 41)
    assert np.abs(proxy.point(t) - other.point(t)).max() < 1e-13
    assert np.abs(proxy.derivative(t) - other.derivative(t)).max() < 1e-11


@pytest.mark.parametrize(("continuity", "most"), [(1, 2), (2, 4)])
def test_affected_pieces_are_those_that_change(continuity, most):
    proxy = winding(continuity, pieces=7)
    counts = []
    for i in range(len(proxy.control_points)):
        moved = proxy.with_control_point(i, proxy.control_points[i] + (0.3, 0.2))
        changed = np.flatnonzero(np.abs(moved.pieces - proxy.pieces).max(axis=(1, 2)) > 1e-15)
        assert changed.tolist() == proxy.affected_pieces(i).tolist()
        counts.append(len(changed))
    assert max(counts) == most


@pytest.mark.parametrize("continuity", [1, 2])
def test_a_spline_comes_back_from_its_beziers(continuity):
    proxy = winding(continuity)
    assert (
        np.abs(CubicProxy.from_beziers(proxy.beziers(), continuity).control_points - proxy.control_points).max() < 1e-12
    )
    assert np.abs(CubicProxy.from_beziers(proxy.pieces, continuity).control_points - proxy.control_points).max() < 1e-12


@pytest.mark.parametrize("continuity", [1, 2])
def test_a_line_stays_a_line(continuity):
    line = CubicProxy.line((0, 0), (6, 1), 4, continuity)
    for proxy in (line.with_piece(1), line.with_piece(0, fraction=0.3), line.without_joint(2)):
        x, y = proxy.control_points.T
        assert np.abs(6 * y - x).max() < 1e-12
        assert (np.diff(x) > 0).all()


@pytest.mark.parametrize(("continuity", "limit"), [(1, 0.004), (2, 0.006)])
def test_a_piece_put_in_stays_near_the_curve(continuity, limit):
    proxy = winding(continuity, noise=0.2)
    for piece in range(5):
        longer = proxy.with_piece(piece)
        assert longer.piece_count == 6
        assert hausdorff_distance(proxy, longer, normalised=True) < limit
    if continuity == 1:
        assert (proxy.with_piece(4).control_points[:7] == proxy.control_points[:7]).all()


def test_joints_never_leave_their_borders():
    rng = np.random.default_rng(3)
    borders = [Border((x, 0), (1, 0.3 * rng.standard_normal())) for x in range(6)]
    for continuity in (1, 2):
        proxy = winding(continuity).with_borders(borders)
        for _ in range(200):
            index = int(rng.integers(len(proxy.control_points)))
            proxy = proxy.with_control_point(index, rng.normal(3, 2, 2))
            assert max(abs(b.distance(j)) for b, j in zip(borders, proxy.joints)) < 1e-13
        for other in (proxy.without_joint(2), proxy.with_piece(3, border=Border((3.5, 0), borders[3].normal))):
            assert max(abs(b.distance(j)) for b, j in zip(other.borders, other.joints)) < 1e-12


def test_the_neighbour_moves_across_the_border_only():
    proxy = winding(1).with_borders([None, None, Border((2.4, 0.4), (3, 1)), None, None, None])
    moved = proxy.with_control_point(4, proxy.control_points[4] + (0.1, 0.7))
    change = moved.control_points - proxy.control_points
    assert np.abs(change[[0, 1, 2, 3, 6, 7, 8, 9, 10, 11]]).max() == 0.0
    assert abs(change[5] @ (1, -3)) < 1e-13
    assert abs((change[4] + change[5]) @ (3, 1)) < 1e-13


def test_continuity_two_moves_along_parallel_borders_only():
    line = CubicProxy.line((0, 0), (5, 0), 5, 2)
    proxy = CubicProxy(line.control_points, 2, [Border.vertical(x) for x in range(6)])
    moved = proxy.with_control_point(3, (9, 2)).control_points[3]
    assert moved.tolist() == [proxy.control_points[3, 0], 2.0]
    tilted = [None, Border.vertical(1), Border((2, 0), (1, 1)), Border.vertical(3), None, None]
    assert len(CubicProxy(line.control_points, 2, tilted).freedom(3).directions) == 0


def test_similarity_and_reversal():
    turn = Similarity(2.0, 0.7, (1.0, -3.0))
    for continuity in (1, 2):
        proxy = winding(continuity).with_borders([Border.vertical(x) for x in range(6)])
        moved = proxy.transformed(turn)
        assert np.abs(turn.apply(proxy.pieces) - moved.pieces).max() < 1e-13
        assert np.abs(proxy.reversed().pieces[::-1, ::-1] - proxy.pieces).max() < 1e-14


@pytest.mark.parametrize(
    "make",
    [
        lambda: CubicProxy(np.zeros((5, 2))),
        lambda: CubicProxy(np.zeros((4, 2)), 3),
        lambda: CubicProxy([(0, 0), (1, 0), (np.nan, 0), (3, 0)]),
        lambda: CubicProxy.line((0, 0), (1, 0), 0),
        lambda: CubicProxy.line((0, 0), (3, 0)).with_piece(1),
        lambda: CubicProxy.line((0, 0), (3, 0)).without_joint(1),
        lambda: CubicProxy.line((0, 0), (3, 0), 2).with_piece(0, border=Border.vertical(2)),
        lambda: CubicProxy.line((0, 0), (3, 0), 2).affected_pieces(6),
        lambda: CubicProxy(np.eye(4)[:, :2], borders=[Border.vertical(9), None]),
        lambda: CubicProxy.line((0, 0), (3, 0)).with_borders([None]),
        lambda: Border((0, 0), (0, 0)),
        lambda: CubicProxy.from_beziers(np.zeros((0, 4, 2))),
    ],
)
def test_bad_input_is_refused_in_words(make):
    with pytest.raises(InvalidInputError, match=r"\w+ \w+ \w+"):
        make()
