"""Rods that stay out, and rods that come back."""

import math

import numpy as np
import pytest

from batten.fabrication.checks.reentry import reentry_check

# A circle of radius 100 that leaves the block's right face, x = 600, level at z = 100, and turns upwards.
RADIUS = 100.0


def quarter(hand):
    return hand.arc(RADIUS, RADIUS * math.pi / 2, (500.0, 200.0), -math.pi / 2)


def test_straight_rods_are_as_far_as_the_part_passed_over(hand):
    level = hand.place(hand.line())
    steep = hand.place(hand.line(1200.0, (0.0, -500.0), math.pi / 3))
    check = reentry_check(hand.context([level, steep], [hand.block(size=(600.0, 600.0, 2000.0))]))
    # The steep one enters the left face below the block's bottom and leaves its right face inside it.
    assert check.values == pytest.approx([5.0, 2.5], rel=1e-9)
    assert check.limit == 0.5
    assert check.passed.all()
    assert check.hard


def test_a_rod_bent_back_into_the_block(hand):
    rods = [hand.place(quarter(hand), 0.0, RADIUS * math.pi * share) for share in (0.9, 1.25, 1.5)]
    check = reentry_check(hand.context(rods))
    assert check.values == pytest.approx([RADIUS * math.sin(0.05), -RADIUS * math.sin(math.pi / 4), -100.0], abs=1e-6)
    assert check.passed.tolist() == [True, False, False]


def test_it_may_pass_over_the_block_but_not_through_it(hand):
    rods = [hand.place(quarter(hand), 0.0, RADIUS * 1.2 * math.pi)]
    for height, free in ((400.0, False), (285.0, False), (270.0, True)):
        # At the end, 0.2π past the top, it is at z = 200 + 100 cos 0.2π = 280.9.
        check = reentry_check(hand.context(rods, [hand.block(size=(600.0, 600.0, height))]))
        assert check.passed.tolist() == [free], height


def test_the_side_before_the_piece_counts_too(hand):
    back = quarter(hand).reversed()
    check = reentry_check(hand.context([hand.place(back, RADIUS * 1.5 * math.pi, 0.0)]))
    assert check.values == pytest.approx([-100.0], abs=1e-6)


def test_the_rest_of_a_piece_beyond_a_side_face_is_no_reentry(hand):
    plane = hand.vertical(450.0, math.pi / 4)
    rod = hand.place(hand.line(600.0 * math.sqrt(2.0)), plane=plane)
    assert reentry_check(hand.context([rod])).values == pytest.approx([5.0 * math.sqrt(0.5)])


def test_a_rod_that_ends_with_its_piece_has_nothing_to_bring_back(hand):
    check = reentry_check(hand.context([hand.place(hand.line(), 4.0, 0.0), hand.place(hand.line(), 0.0, -3.0)]))
    assert np.isnan(check.values).all()
    assert check.passed.all()
