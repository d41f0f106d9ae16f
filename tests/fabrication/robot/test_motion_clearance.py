"""Free distances of whole motions, where they can be told with a ruler."""

from dataclasses import replace

import numpy as np
import pytest

import batten.fabrication.robot.motion as motion_module
from batten.errors import InvalidInputError
from batten.fabrication.plan import ArmMotion, BlockMotion
from batten.fabrication.robot.cell import cell_preset, pose_from_xyz
from batten.fabrication.robot.motion import KeepClear, plan_block_motion
from batten.fabrication.robot.motion_clearance import arm_clearance, arm_in_work, motion_clearance

CELL = cell_preset("two-irb6620")
SIZE = np.array([600.0, 600.0, 600.0])
REST = np.zeros(6)
UP = np.array([0.0, 0.0, 5000.0])
JAWS = {("left gripper jaw", "block"), ("right gripper jaw", "block")}


def level(height, reach, cell=CELL, n=7, size=SIZE, keep_clear=None, ways=(100.0, 100.0), pushed=None):
    """A straight level rod from x = −reach to reach through a block, its motion and free distances.

    `pushed`: leaf and how far its rod is moved along the blade.
    """
    y = np.linspace(-300.0, 300.0, n)
    points = np.stack(np.broadcast_arrays(np.linspace(-reach, reach, 25), y[:, None], height), axis=-1)
    if pushed is not None:
        points[pushed[0], :, 0] += pushed[1]
    along, across = np.tile([1.0, 0.0, 0.0], (n, 1)), np.tile([0.0, 1.0, 0.0], (n, 1))
    frames = [(points[:, k], along, across) for k in (0, -1)]
    motion = plan_block_motion(cell, *frames, 20.0, *ways, block=1, rods=range(n), keep_clear=keep_clear)
    return motion, motion_clearance(cell, motion, size, points, rod_radius_mm=2.0, gripper_radius_mm=25.0)


def test_the_jaw_goes_beside_the_block():
    _, free = level(300.0, 440.0)
    np.testing.assert_allclose(free.distance_mm, 440.0 - 300.0 - 25.0, rtol=0, atol=1e-6)
    assert set(free.pair) <= JAWS


def test_the_rod_goes_over_the_table():
    _, free = level(50.0, 440.0)
    np.testing.assert_allclose(free.distance_mm, 50.0 - 2.0, rtol=0, atol=1e-6)
    assert set(free.pair) == {("rod", "table")}


def test_a_gripper_planted_in_the_block_is_found_at_its_leaf_and_on_the_moves_next_to_it():
    # The fourth rod lies 200 mm to the right: its left end, and the jaw with it, is 60 mm within the block.
    _, free = level(300.0, 440.0, pushed=(3, 200.0), cell=replace(CELL, max_joint_step_rad=2.0))
    expected = [115.0, 115.0, -85.0, -85.0, -85.0, 115.0, 115.0]
    np.testing.assert_allclose(free.distance_mm, expected, rtol=0, atol=1e-6)
    assert free.pair[3] == ("left gripper jaw", "block")


def test_what_is_hit_between_two_leaves_only_is_found():
    # The rod swings from one side of a tall thin block to the other: at the leaves all is free.
    size = np.array([600.0, 20.0, 600.0])
    y = np.array([-200.0, 200.0])
    points = np.stack(np.broadcast_arrays(np.linspace(-290.0, 290.0, 25), y[:, None], 300.0), axis=-1)
    along, across = np.tile([1.0, 0.0, 0.0], (2, 1)), np.tile([0.0, 1.0, 0.0], (2, 1))
    frames = [(points[:, k], along, across) for k in (0, -1)]
    motion = plan_block_motion(CELL, *frames, 20.0, 10.0, 10.0, block=1, rods=range(2))
    free = motion_clearance(CELL, motion, size, points, rod_radius_mm=2.0, gripper_radius_mm=25.0)
    # The jaw's axis starts 10 mm within the block's side and leaves it: 10 mm deep.
    np.testing.assert_allclose(free.distance_mm, -25.0 - 10.0, rtol=0, atol=1e-6)


def facing(distance, joints=REST):
    """Two arms without tools that face each other, both at the same joints all the time."""
    arm = CELL.left.placed(base=np.eye(4), tool=np.eye(4))
    cell = replace(
        CELL,
        left=arm.placed(base=pose_from_xyz((-0.5 * distance, 0.0, 0.0))),
        right=arm.placed(base=pose_from_xyz((0.5 * distance, 0.0, 0.0), (0.0, 0.0, 180.0))),
        work_object=pose_from_xyz((0.0, 0.0, 600.0)),
    )
    motions = []
    for side in ("left", "right"):
        pose = np.linalg.inv(cell.work_object) @ cell.arm(side).forward(joints)
        one = np.ones(1)
        motions.append(
            ArmMotion(
                pose[None], joints[None], 0.0 * one, one, one, one, one, pose, pose, joints, joints,
                np.zeros((1, 4), dtype=np.int64),
            )
        )  # fmt: skip
    points = np.linspace(motions[0].poses[0, :3, 3], motions[1].poses[0, :3, 3], 3)
    return cell, BlockMotion(1, (0,), *motions, 20.0), points[None]


@pytest.mark.parametrize(("distance", "expected"), [(3300.0, 226.0), (2900.0, -174.0)])
def test_arms_that_touch_are_found(distance, expected):
    # Stretched forward, the flange is 1407 mm ahead of axis 1 and 1855 mm up, the wrist's radius 130 mm.
    cell, motion, points = facing(distance)
    assert expected == distance - 2 * 1407.0 - 2 * 130.0
    free = motion_clearance(
        cell,
        motion,
        np.array([200.0, 200.0, 200.0]),
        points + UP,
        rod_radius_mm=1.0,
        gripper_radius_mm=25.0,
    )
    np.testing.assert_allclose(free.distance_mm, expected, rtol=0, atol=1e-6)
    assert free.pair == (("left wrist", "right wrist"),)


def test_an_arm_in_the_block_and_under_the_floor_is_found():
    cell, motion, points = facing(4000.0)
    far = points + UP
    # The block reaches up to 1755 mm over the floor, 100 mm under the wrists' axes, which end at ±593 mm.
    sizes = np.array([1300.0, 400.0, 1155.0])
    free = motion_clearance(cell, motion, sizes, far, rod_radius_mm=1.0, gripper_radius_mm=25.0)
    np.testing.assert_allclose(free.distance_mm, 100.0 - 130.0, rtol=0, atol=1e-6)
    assert free.pair[0][1] == "block"
    # A rod beside the table, 10 mm over the floor.
    low = points + np.array([0.0, 500.0, -points[0, 0, 2] - 590.0])
    free = motion_clearance(
        cell, motion, np.array([200.0, 200.0, 200.0]), low, rod_radius_mm=1.0, gripper_radius_mm=25.0
    )
    np.testing.assert_allclose(free.distance_mm, 10.0 - 1.0, rtol=0, atol=1e-6)
    assert free.pair == (("rod", "floor"),)


def test_the_rod_may_hit_the_other_arm_but_not_what_holds_it():
    cell, motion, points = facing(4000.0)
    tight = motion_clearance(
        cell, motion, np.array([200.0, 200.0, 200.0]), points, rod_radius_mm=1.0, gripper_radius_mm=25.0
    )
    # It begins in one wrist and ends in the other; the forearms, of radius 150 mm, end 200 mm from its ends.
    np.testing.assert_allclose(tight.distance_mm, 200.0 - 150.0 - 1.0, rtol=0, atol=1e-6)
    across = points.copy()
    across[0, 1] = cell.right.forward(np.zeros(6))[:3, 3] - [0.0, 0.0, 600.0]  # its middle in the right wrist
    hit = motion_clearance(
        cell, motion, np.array([200.0, 200.0, 200.0]), across, rod_radius_mm=1.0, gripper_radius_mm=25.0
    )
    np.testing.assert_allclose(hit.distance_mm, -131.0, rtol=0, atol=1e-6)
    assert hit.pair == (("right wrist", "rod"),)


def test_spins_that_stay_clear_are_found_where_the_first_choice_does_not():
    cell = replace(CELL, table_mm=(1200.0, 800.0))
    _, first = level(60.0, 440.0, cell)
    assert first.distance_mm.min() < 0.0
    assert {name for pair in first.pair for name in pair} >= {"table"}
    motion, free = level(60.0, 440.0, cell, keep_clear=KeepClear(SIZE, 25.0))
    assert free.distance_mm.min() >= cell.min_clearance_mm
    for arm in (motion.left, motion.right):  # and the arms keep their own limits
        assert arm.joint_margin_rad.min() >= cell.min_joint_margin_rad
        assert arm.singularity.min() >= cell.min_singularity


def test_postures_are_measured_as_motions_are():
    motion, free = level(300.0, 440.0, n=1, ways=(0.0, 0.0))
    alone = arm_clearance(CELL, "left", motion.left.joints_rad, SIZE, 25.0)
    assert alone[0] > free.distance_mm[0]  # the jaw beside the block is the leaf's affair
    # With very thick links the least distance is theirs, and the same in both ways of asking.
    cell = replace(CELL, left=replace(CELL.left, link_radii_mm=np.full(6, 400.0)))
    fat = motion_clearance(cell, motion, SIZE, np.zeros((1, 3, 3)) + UP, rod_radius_mm=0.0, gripper_radius_mm=25.0)
    again = arm_clearance(cell, "left", motion.left.joints_rad, SIZE, 25.0)
    np.testing.assert_allclose(again, fat.distance_mm, rtol=0, atol=1e-9)


def test_a_posture_beside_the_other_arm():
    cell, motion, _ = facing(2900.0)
    joints = np.zeros((2, 6))
    joints[1, 1] = -0.9  # the right arm leans back
    left = arm_in_work(cell, "left", np.zeros((2, 6)), 25.0)
    free = arm_clearance(cell, "right", joints, np.array([200.0, 200.0, 200.0]), 25.0, left)
    alone = arm_clearance(cell, "right", joints, np.array([200.0, 200.0, 200.0]), 25.0)
    assert free[0] == pytest.approx(2900.0 - 2 * 1407.0 - 2 * 130.0, abs=1e-6)
    assert free[1] > 100.0
    assert (alone > 100.0).all()
    assert motion.rods == (0,)


def test_the_right_arm_is_planned_beside_the_left_one(monkeypatch):
    seen = []

    def spy(cell, side, joints, size, radius, other=None):
        seen.append((side, other))
        return arm_clearance(cell, side, joints, size, radius, other)

    monkeypatch.setattr(motion_module, "arm_clearance", spy)
    motion, _ = level(300.0, 440.0, n=3, keep_clear=KeepClear(SIZE, 25.0))
    assert [side for side, _ in seen] == ["left", "right"]
    assert seen[0][1] is None
    jaws = arm_in_work(CELL, "left", motion.left.joints_rad, 25.0).end[:, -1]
    found = seen[1][1].end[:, -1]  # one for each posture that was tried, at its own leaf
    for jaw in jaws:
        assert (np.abs(found - jaw).max(axis=1) < 1e-9).any()


def test_a_leaf_out_of_reach_has_no_distance():
    motion, _ = level(300.0, 440.0, n=3)
    joints = motion.left.joints_rad.copy()
    joints[1] = np.nan
    lost = replace(motion, left=replace(motion.left, joints_rad=joints))
    points = np.stack(np.broadcast_arrays(np.linspace(-440.0, 440.0, 9), np.zeros((3, 1)), 300.0), axis=-1)
    free = motion_clearance(CELL, lost, SIZE, points, rod_radius_mm=2.0, gripper_radius_mm=25.0)
    assert np.isfinite(free.distance_mm[[0, 2]]).all()  # of the moves that are left to them
    lost = replace(
        lost, left=replace(lost.left, joints_rad=np.full((3, 6), np.nan), approach_joints_rad=np.full(6, np.nan))
    )
    free = motion_clearance(CELL, lost, SIZE, points, rod_radius_mm=2.0, gripper_radius_mm=25.0)
    assert np.isnan(free.distance_mm[:2]).all()
    assert free.pair[0] == ("", "")


def test_rods_must_belong_to_the_motion():
    motion, _ = level(300.0, 440.0, n=3)
    with pytest.raises(InvalidInputError, match="block 1: 3 leaves need rods"):
        motion_clearance(CELL, motion, SIZE, np.zeros((2, 5, 3)), rod_radius_mm=2.0, gripper_radius_mm=25.0)
