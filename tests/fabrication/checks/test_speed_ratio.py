"""Translation, rotation about a point, rotation about an upright axis."""

import math

import numpy as np
import pytest

from batten.fabrication.checks.speed_ratio import speed_ratio_check


def test_a_shifted_blade_moves_evenly(hand):
    rods = [hand.place(hand.arc(700.0, 620.0), leaf=i, plane=hand.vertical(20.0 * i)) for i in (1, 2, 3)]
    check = speed_ratio_check(hand.context(rods))
    assert check.values == pytest.approx([1.0, 1.0, 1.0])
    assert not check.hard


def test_a_blade_tilted_about_its_left_end(hand):
    # A point at s moves 20 mm across and 2 s sin(φ/2) up.
    tilt, length = 0.12, 580.0
    rods = [
        hand.place(hand.line(length), leaf=1, plane=hand.vertical(20.0)),
        hand.place(hand.line(length, angle=tilt), leaf=2, plane=hand.vertical(40.0)),
        hand.place(hand.line(length, angle=tilt), leaf=3, plane=hand.vertical(60.0)),
    ]
    ratio = math.hypot(20.0, 2.0 * length * math.sin(0.5 * tilt)) / 20.0
    check = speed_ratio_check(hand.context(rods))
    assert check.values == pytest.approx([ratio, ratio, 1.0])
    assert check.passed.tolist() == [False, False, True]


def test_a_blade_that_turns_about_an_upright_axis(hand):
    # Distances from the axis, 150 mm left of the block: 151 … 651 mm.
    rods = [
        hand.place(hand.line(500.0, (151.0, 200.0)), leaf=i, plane=hand.vertical(300.0, 0.04 * i, (-150.0, 0.0)))
        for i in (0, 1)
    ]
    assert speed_ratio_check(hand.context(rods)).values == pytest.approx([651.0 / 151.0] * 2)


def test_a_point_that_stands_still_makes_it_infinite(hand):
    rods = [hand.place(hand.line(500.0), leaf=i, plane=hand.vertical(300.0, 0.04 * i)) for i in (0, 1)]
    check = speed_ratio_check(hand.context(rods))
    assert np.isinf(check.values).all()
    assert not check.passed.any()


def test_only_what_is_in_the_block_counts(hand):
    # The right half lies beyond the block, where the blade moves faster.
    rods = [
        hand.place(hand.line(1000.0, (100.0, 200.0)), leaf=i, plane=hand.vertical(300.0, 0.01 * i, (0.0, 0.0)))
        for i in (0, 1)
    ]
    assert speed_ratio_check(hand.context(rods)).values == pytest.approx([(100.0 + 500.0) / 100.0] * 2)
    outside = [hand.place(hand.line(500.0), leaf=i, plane=hand.vertical(900.0 + i)) for i in (0, 1)]
    assert np.isnan(speed_ratio_check(hand.context(outside)).values).all()
