"""From block to block with empty grippers."""

from dataclasses import replace

import numpy as np
import pytest

from batten.fabrication.robot.cell import cell_preset
from batten.fabrication.robot.links import link_points
from batten.fabrication.robot.motion import plan_block_motion
from batten.fabrication.robot.motion_clearance import arm_in_work
from batten.fabrication.robot.travel import pulled_back, travel_clearance

CELL = cell_preset("two-irb6620")
SIZE = np.array([600.0, 600.0, 500.0])


def cut(block, height, reach=440.0, cell=CELL):
    """A level rod through a block at one height."""
    n = 5
    frames = []
    for side in (-1.0, 1.0):
        positions = np.stack([np.full(n, side * reach), np.linspace(-300, 300, n), np.full(n, height)], axis=1)
        frames.append((positions, np.tile([1.0, 0.0, 0.0], (n, 1)), np.tile([0.0, 1.0, 0.0], (n, 1))))
    return plan_block_motion(cell, *frames, 20.0, 100.0, 100.0, block=block, rods=range(n))


def test_pulling_back_takes_the_wrist_away_and_keeps_its_own_joints():
    motion = cut(1, 300.0)
    for side, arm in (("left", motion.left), ("right", motion.right)):
        robot = CELL.arm(side)
        back = pulled_back(robot, arm.joints_rad)
        np.testing.assert_array_equal(back[:, [0, 3, 4, 5]], arm.joints_rad[:, [0, 3, 4, 5]])
        wrists = [link_points(robot, q)[:, 5] - robot.base[:3, 3] for q in (arm.joints_rad, back)]
        reach = [np.linalg.norm(w[:, :2], axis=1) for w in wrists]
        assert (reach[1] < reach[0] - 200.0).all()
        assert (wrists[1][:, 2] > wrists[0][:, 2]).all()


def test_postures_stay_within_the_limits():
    low, high = CELL.left.joint_limits_rad.T
    for q in (low, high, 0.5 * (low + high)):
        back = pulled_back(CELL.left, q)
        assert (back >= low).all()
        assert (back <= high).all()


def test_other_senses_of_the_joints_pull_back_too():
    arm = CELL.left
    flipped = replace(arm, flip_axes=(False, True, True, False, False, False))
    q = np.radians([10.0, 40.0, 5.0, 30.0, -60.0, 20.0])
    mirrored = q * [1.0, -1.0, -1.0, 1.0, 1.0, 1.0]
    # θ = −q − offset: the offset of axis 3 keeps its sign, so the same posture needs the same θ.
    wide = replace(flipped, joint_limits_rad=np.tile([-4.0, 4.0], (6, 1)))
    same = replace(arm, joint_limits_rad=np.tile([-4.0, 4.0], (6, 1)))
    np.testing.assert_allclose(link_points(wide, mirrored), link_points(same, q), rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        link_points(wide, pulled_back(wide, mirrored)), link_points(same, pulled_back(same, q)), rtol=0, atol=1e-9
    )


def test_the_way_between_blocks_is_as_clear_as_its_nearest_station():
    first, second = cut(1, 120.0), cut(2, 420.0)
    free, pair = travel_clearance(CELL, first, second, SIZE, SIZE, 25.0)
    assert free >= CELL.min_clearance_mm
    assert pair[0].startswith(("left", "right"))
    alone, _ = travel_clearance(CELL, None, second, None, SIZE, 25.0)
    assert alone >= free  # one way of the three
    # A wider table comes nearer to the approach pose by what it is wider: the jaw's axis is 440 mm from the middle.
    start = arm_in_work(CELL, "left", first.left.approach_joints_rad, 25.0)
    assert start.end[0, -1] == pytest.approx([-440.0, -400.0, 120.0], abs=1e-6)


def test_a_block_in_the_way_is_found():
    first, second = cut(1, 120.0), cut(2, 420.0)
    # The next block is wider than the place where the grippers go to: they stand in it before they begin.
    wide = np.array([1200.0, 900.0, 900.0])
    free, pair = travel_clearance(CELL, first, second, SIZE, wide, 25.0)
    assert free < -50.0
    assert pair[1] == "block"
    # What was cut before stands there until the arms have pulled back, the next one does not yet.
    before, _ = travel_clearance(CELL, first, second, wide, SIZE, 25.0)
    assert before < -50.0
    assert travel_clearance(CELL, None, second, None, SIZE, 25.0)[0] > 0.0


def test_out_of_reach_is_not_known():
    first = cut(1, 120.0)
    lost = replace(first, left=replace(first.left, approach_joints_rad=np.full(6, np.nan)))
    free, pair = travel_clearance(CELL, None, lost, None, SIZE, 25.0)
    assert np.isnan(free)
    assert pair == ("", "")
