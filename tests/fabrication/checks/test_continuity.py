"""Jumps put in by hand."""

import math

import numpy as np
import pytest

from batten.fabrication.checks.continuity import continuity_checks


def blocks(hand, columns=3, rows=1):
    return [hand.block(1 + r * columns + c, r, c) for r in range(rows) for c in range(columns)]


def test_pieces_of_one_elastica_join_without_a_jump(hand):
    whole = hand.arc(1500.0, 1500.0)
    parts = [whole.extended(-a, a + 500.0 - 1500.0) for a in (0.0, 500.0, 1000.0)]
    rods = [hand.place(p, block=i + 1) for i, p in enumerate(parts)]
    jump, turn = continuity_checks(hand.context(rods, blocks(hand)))
    assert np.abs(jump.values).max() < 1e-9
    assert np.abs(turn.values).max() < 1e-9
    assert jump.hard
    assert turn.hard


def test_jumps_of_place_and_tangent(hand):
    rods = [
        hand.place(hand.line(), block=1),
        hand.place(hand.line(start=(600.0, 200.03)), block=2),
        hand.place(hand.line(start=(1200.0, 200.03), angle=math.radians(0.5)), block=3),
        hand.place(hand.line(start=(600.0, 300.0)), block=2, leaf=2),
    ]
    jump, turn = continuity_checks(hand.context(rods, blocks(hand)))
    assert jump.values == pytest.approx([0.03, 0.03, 0.0, np.nan], abs=1e-9, nan_ok=True)
    assert turn.values == pytest.approx([0.0, 0.5, 0.5, np.nan], abs=1e-9, nan_ok=True)
    assert jump.passed.tolist() == [False, False, True, True]
    assert turn.passed.tolist() == [True, False, False, True]


def test_a_jump_between_planes_is_seen_in_space(hand):
    rods = [
        hand.place(hand.line(), block=1),
        hand.place(hand.line(start=(600.0, 200.0)), block=2, plane=hand.vertical(300.04)),
    ]
    jump, _ = continuity_checks(hand.context(rods, blocks(hand)))
    assert jump.values == pytest.approx([0.04, 0.04])


def test_a_turned_leaf_is_followed_from_row_to_row(hand):
    # One plane, in column 0 in both rows, in column 1 in row 1 alone.
    plane = hand.vertical(450.0, math.pi / 4)
    root = math.sqrt(2.0)
    first, second = (hand.line(600.0 * root, start=(600.0 * root * i, 200.0 + 0.02 * i)) for i in (0, 1))
    rods = [hand.place(p, block=b, plane=plane) for p, b in ((first, 1), (first, 3), (second, 4))]
    jump, _ = continuity_checks(hand.context(rods, blocks(hand, 2, 2)))
    assert jump.values == pytest.approx([0.02, 0.02, 0.02])
