"""Balls about the rod's ends."""

import dataclasses
import math

import pytest

from batten.fabrication.checks.gripper_clearance import gripper_clearance_check
from batten.fabrication.job import CutJob, GripperJob, SurfaceJob


def test_distance_of_the_balls_from_the_block(hand):
    # The last one ends 30 mm right of the block and 40 mm above it: 50 mm from its edge.
    tilted = hand.line(math.hypot(630.0, 240.0), (0.0, 200.0), math.atan2(240.0, 630.0))
    rods = [
        hand.place(hand.line(), 200.0, 250.0),
        hand.place(hand.line(), 250.0, 70.0),
        hand.place(hand.line(), 59.0, 250.0),
        hand.place(tilted, 300.0, 0.0),
    ]
    check = gripper_clearance_check(hand.context(rods))
    assert check.values == pytest.approx([160.0, 30.0, 19.0, 10.0])
    assert check.passed.tolist() == [True, True, False, False]
    job = dataclasses.replace(CutJob(SurfaceJob()), gripper=GripperJob(radius_mm=10.0, clearance_mm=45.0))
    check = gripper_clearance_check(hand.context(rods, job=job))
    assert check.values == pytest.approx([190.0, 60.0, 49.0, 40.0])
    assert check.passed.tolist() == [True, True, True, False]
