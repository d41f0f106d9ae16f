"""Stations on the moves, against scipy's own interpolation of rotations."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from batten.errors import InvalidInputError
from batten.fabrication.robot.cell import cell_preset, pose_from_xyz
from batten.fabrication.robot.motion import plan_block_motion
from batten.fabrication.robot.stations import between_poses, motion_stations, target_poses

CELL = cell_preset("two-irb6620")


@pytest.fixture(scope="module")
def motion():
    """Five leaves whose ends go different ways and turn."""
    u = np.linspace(0.0, 1.0, 5)
    frames = []
    for side in (-1.0, 1.0):
        slope = 0.5 * side * np.sin(3.0 * u)
        tangents = np.stack([np.cos(slope), 0.0 * u, np.sin(slope)], axis=1)
        positions = np.stack([side * (440.0 + 40.0 * u), -300.0 + 600.0 * u**2, 400.0 + side * 150.0 * u], axis=1)
        frames.append((positions, tangents, np.tile([0.0, 1.0, 0.0], (5, 1))))
    return plan_block_motion(CELL, *frames, 20.0, 130.0, 90.0, block=2, rods=range(5), approach_rise=0.5)


def test_poses_between_two_as_scipy_has_them():
    start, end = pose_from_xyz((1, 2, 3), (10, -40, 100)), pose_from_xyz((5, -2, 3), (80, 20, -60))
    share = np.linspace(0.0, 1.0, 9)
    found = between_poses(start[None].repeat(9, axis=0), end, share)
    slerp = Slerp([0.0, 1.0], Rotation.from_matrix([start[:3, :3], end[:3, :3]]))
    np.testing.assert_allclose(found[:, :3, :3], slerp(share).as_matrix(), rtol=0, atol=1e-12)
    expected = start[:3, 3] + share[:, None] * (end - start)[:3, 3]
    np.testing.assert_allclose(found[:, :3, 3], expected, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found[:, 3], np.tile([0.0, 0.0, 0.0, 1.0], (9, 1)))


def test_stations_are_close_and_the_targets_are_among_them(motion):
    at = motion_stations(CELL, motion, step_mm=12.0, step_rad=0.05)
    assert at.move[0] == 0
    assert at.move[-1] == 5
    starts = np.flatnonzero(at.share == 0.0)
    assert at.move[starts].tolist() == [0, 1, 2, 3, 4, 5]
    assert (at.share[1:][np.diff(at.move) == 0] > at.share[:-1][np.diff(at.move) == 0]).all()
    for arm, robot, joints in (
        (motion.left, CELL.left, at.left_joints_rad),
        (motion.right, CELL.right, at.right_joints_rad),
    ):
        known = np.concatenate([arm.approach_joints_rad[None], arm.joints_rad, arm.leave_joints_rad[None]])
        np.testing.assert_array_equal(joints[[*starts, -1]], known)
        poses = robot.forward(joints)
        way = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
        turn = (Rotation.from_matrix(poses[:-1, :3, :3]).inv() * Rotation.from_matrix(poses[1:, :3, :3])).magnitude()
        assert way.max() <= 12.0 + 1e-6
        assert turn.max() <= 0.05 + 1e-6
        assert np.abs(np.diff(joints, axis=0)).max() < 0.2  # no change of branch, no full turns


def test_between_the_targets_the_tools_are_on_the_straight_way(motion):
    at = motion_stations(CELL, motion)
    for arm, robot, joints in (
        (motion.left, CELL.left, at.left_joints_rad),
        (motion.right, CELL.right, at.right_joints_rad),
    ):
        targets = target_poses(arm)
        found = np.linalg.inv(CELL.work_object) @ robot.forward(joints)
        for k, (move, share) in enumerate(zip(at.move, at.share)):
            slerp = Slerp([0.0, 1.0], Rotation.from_matrix(targets[move : move + 2, :3, :3]))
            np.testing.assert_allclose(found[k, :3, :3], slerp(share).as_matrix(), rtol=0, atol=1e-8)
            line = targets[move] + share * (targets[move + 1] - targets[move])
            np.testing.assert_allclose(found[k, :3, 3], line[:3, 3], rtol=0, atol=1e-6)


def test_a_leaf_out_of_reach_leaves_its_own_moves_open(motion):
    joints = motion.left.joints_rad.copy()
    joints[2] = np.nan
    at = motion_stations(CELL, replace(motion, left=replace(motion.left, joints_rad=joints)))
    lost = np.isnan(at.left_joints_rad).any(axis=1)
    inside = ((at.move == 2) & (at.share > 0.0)) | (at.move == 3)
    np.testing.assert_array_equal(lost, inside)
    assert np.isfinite(at.right_joints_rad).all()


def test_steps_must_be_positive(motion):
    with pytest.raises(InvalidInputError, match=r"steps must be above 0; got 0\.0 mm"):
        motion_stations(CELL, motion, step_mm=0.0)
