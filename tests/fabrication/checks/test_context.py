"""The shared samples: frames, what lies within a block, peaks between samples, boxes."""

import math

import numpy as np
import pytest

from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError
from batten.fabrication.checks.context import greatest


def test_samples_agree_with_each_rod_alone(hand):
    bent = Elastica((0.0, 180.0), 0.2, -0.001, (2e-6, 4e-6), 640.0)
    rods = [
        hand.place(bent, 150.0, 210.0, plane=hand.vertical(100.0, 0.3)),
        hand.place(hand.arc(400.0, 610.0), leaf=2),
    ]
    c = hand.context(rods)
    for i, placed in enumerate(rods):
        s = np.linspace(0.0, placed.rod.length, 129)
        assert c.points[i] == pytest.approx(placed.plane.to_world(placed.rod.point_at(s)), abs=1e-9)
        assert c.curvature[i] == pytest.approx(placed.rod.curvature_at(s), abs=1e-12)
        t = np.linspace(0.0, placed.piece.length, 65)
        assert c.piece_points[i] == pytest.approx(placed.plane.to_world(placed.piece.point_at(t)), abs=1e-9)
    assert c.after == pytest.approx([210.0, 200.0])


def test_a_turned_plane_is_in_the_block_on_part_of_the_piece(hand):
    # Through (0, 450) at 45°: it meets y = 600 at x = 150, a quarter of the way to x = 600.
    rod = hand.place(hand.line(600.0 * math.sqrt(2.0)), plane=hand.vertical(450.0, math.pi / 4))
    blocks = [hand.block(1), hand.block(2, row=1), hand.block(3, row=3)]
    rods = [rod, *(hand.place(rod.piece, block=b, plane=rod.plane) for b in (2, 3))]
    c = hand.context(rods, blocks)
    assert c.inside[:2] == pytest.approx(np.array([[0.0, 0.25], [0.25, 1.0]]), abs=1e-7)
    assert np.isnan(c.inside[2]).all()
    assert c.piece_inside.sum(axis=1).tolist() == [17, 49, 0]
    within = c.piece_within(5)[1]
    assert within[:, 0] == pytest.approx(np.linspace(0.25, 1.0, 5) * 600.0 * math.sqrt(2.0), abs=1e-4)
    assert c.design_within(5)[:2] == pytest.approx(c.piece_within(5)[:2], abs=1e-3)
    assert np.isnan(c.design_within(5)[2]).all()


def test_a_plane_on_the_border_is_in_both_rows(hand):
    rods = [hand.place(hand.line(), block=b, plane=hand.vertical(600.0)) for b in (1, 2)]
    c = hand.context(rods, [hand.block(1), hand.block(2, row=1)])
    assert c.inside.tolist() == [[0.0, 1.0], [0.0, 1.0]]
    assert c.piece_inside.all()


def test_design_points_are_taken_as_a_smooth_curve(hand):
    circle = hand.arc(-500.0, 600.0, angle=0.6)
    coarse = [hand.place(circle, design=circle.point_at(np.linspace(0.0, 600.0, k))) for k in (13, 29)]
    points = hand.context(coarse).design_within(129)
    centre = circle.start + 500.0 * np.array([math.sin(0.6), -math.cos(0.6)])
    # The chords between 13 points are 0.6 mm off.
    assert np.abs(np.linalg.norm(points - centre, axis=-1) - 500.0).max() < 0.01
    assert np.isnan(hand.context([hand.place(circle, design=np.empty((0, 2)))]).design_within(9)).all()


def test_successive_rods_of_a_block_follow_the_leaves(hand):
    where = [(1, 5), (2, 5), (1, 3), (1, 4), (2, 9)]
    rods = [hand.place(hand.line(), block=b, leaf=leaf) for b, leaf in where]
    c = hand.context(rods, [hand.block(1), hand.block(2, column=1)])
    assert c.pairs.tolist() == [[2, 3], [3, 0], [1, 4]]


def test_blocks_must_be_there_and_differ(hand):
    with pytest.raises(InvalidInputError, match="block 8"):
        hand.context([hand.place(hand.line(), block=8)])
    with pytest.raises(InvalidInputError, match="2 blocks have 1 numbers"):
        hand.context([], [hand.block(1), hand.block(1)])


def test_the_peak_of_a_parabola_between_samples_is_exact():
    x = np.linspace(0.0, 1.0, 11)
    rows = np.stack([3.0 - 7.0 * (x - 0.437) ** 2, x, -x, np.where(x > 0.35, np.nan, x), np.full(11, np.nan)])
    assert greatest(rows) == pytest.approx([3.0, 1.0, 0.0, 0.3, np.nan], abs=1e-12, nan_ok=True)
