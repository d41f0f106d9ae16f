"""The motion of both arms through one block."""

from dataclasses import replace

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.fabrication.checks.reach import reach_checks
from batten.fabrication.robot.cell import cell_preset
from batten.fabrication.robot.motion import grip_poses, plan_block_motion

CELL = cell_preset("two-irb6620")


def sweep(n=31, yaw=0.0, seed=0):
    """Frames of a bent rod that sweeps a block of 600 mm: (left, right), each (positions, tangents, normals)."""
    rng = np.random.default_rng(seed)
    u = np.linspace(0.0, 1.0, n)
    normal = np.tile([-np.sin(yaw), np.cos(yaw), 0.0], (n, 1))
    along = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    frames = []
    for side in (-1.0, 1.0):
        slope = rng.uniform(-0.9, 0.9) + rng.uniform(-0.3, 0.3) * u
        tangents = np.cos(slope)[:, None] * along + np.sin(slope)[:, None] * [0.0, 0.0, 1.0]
        x = side * (440.0 + 50.0 * np.sin(3.0 * u + seed))
        z = rng.uniform(250.0, 900.0) + 150.0 * np.sin(2.0 * u + seed)
        positions = x[:, None] * along + np.stack([0.0 * u, -300.0 + 600.0 * u, z], axis=1)
        frames.append((positions, tangents, normal))
    return tuple(frames)


def plan(frames=None, cell=CELL, **change):
    frames = sweep() if frames is None else frames
    n = len(frames[0][0])
    values = {"speed_mm_s": 20.0, "approach_mm": 150.0, "leave_mm": 120.0, "block": 3, "rods": range(40, 40 + n)}
    return plan_block_motion(cell, *frames, **(values | change))


def test_the_tool_points_along_the_rod_and_the_spin_is_free():
    frames = sweep(yaw=0.2)
    motion = plan(frames)
    assert (motion.block, motion.rods, motion.speed_mm_s) == (3, tuple(range(40, 71)), 20.0)
    for arm, (positions, tangents, normals), sign in ((motion.left, frames[0], 1.0), (motion.right, frames[1], -1.0)):
        np.testing.assert_allclose(arm.poses[:, :3, 3], positions, rtol=0, atol=1e-12)
        np.testing.assert_allclose(arm.poses[:, :3, 2], sign * tangents, rtol=0, atol=1e-12)
        rotations = arm.poses[:, :3, :3]
        np.testing.assert_allclose(rotations @ rotations.swapaxes(1, 2), np.tile(np.eye(3), (31, 1, 1)), atol=1e-12)
        cos = (rotations[:, :, 0] * normals).sum(axis=1)
        np.testing.assert_allclose(cos, np.cos(arm.spin_rad), rtol=0, atol=1e-12)


def test_planned_times_are_kept_and_lengthened_where_a_joint_would_be_too_fast():
    free = plan()
    wanted = np.full(30, 2.0)
    wanted[::7], wanted[3], wanted[11] = np.nan, 1e-3, 0.02
    motion = plan(leaf_seconds=wanted)
    seconds = motion.seconds[1:-1]
    assert seconds[::7] == pytest.approx(free.seconds[1:-1][::7], rel=1e-12), "left open"
    assert np.isnan(motion.planned_s[::7]).all()
    robots = (CELL.left, CELL.right)
    least = np.max(
        [
            (np.abs(np.diff(arm.joints_rad, axis=0)) / (CELL.max_joint_speed_fraction * r.joint_speeds_rad_s)).max(
                axis=1
            )
            for arm, r in zip((motion.left, motion.right), robots)
        ],
        axis=0,
    )
    given = np.isfinite(wanted)
    assert seconds[given] == pytest.approx(np.maximum(wanted, least)[given], rel=1e-8)
    assert seconds[3] > 1e-3, "too fast for any arm"
    assert (seconds[given] == 2.0).sum() >= 20
    (speed,) = (c for c in reach_checks([motion], CELL, 71) if c.name == "joint_speed")
    assert speed.passed.all()


def test_a_flat_strip_is_never_turned_in_the_grip():
    frames = sweep(yaw=0.2)
    motion = plan(frames, cell=replace(CELL, rod_is_round=False))
    for arm, (_, _, normals) in ((motion.left, frames[0]), (motion.right, frames[1])):
        assert (arm.spin_rad == 0.0).all()
        np.testing.assert_allclose(arm.poses[:, :3, 0], normals, rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_joints_bring_the_tool_where_the_rod_ends(seed):
    motion = plan(sweep(yaw=0.1 * seed, seed=seed))
    for arm, robot in ((motion.left, CELL.left), (motion.right, CELL.right)):
        at = robot.forward(np.concatenate([arm.approach_joints_rad[None], arm.joints_rad, arm.leave_joints_rad[None]]))
        wanted = CELL.work_object @ np.concatenate([arm.approach[None], arm.poses, arm.leave[None]])
        np.testing.assert_allclose(at[:, :3, 3], wanted[:, :3, 3], rtol=0, atol=1e-6)
        np.testing.assert_allclose(at[:, :3, :3], wanted[:, :3, :3], rtol=0, atol=1e-9)
        np.testing.assert_allclose(arm.joint_margin_rad, robot.joint_margin(arm.joints_rad), rtol=0, atol=0)
        assert np.degrees(arm.joint_margin_rad).min() > 30.0
        assert arm.singularity.min() > 0.4
        assert arm.conditioning.min() > 0.1
        assert arm.reach_mm.min() > 100.0
        assert np.degrees(np.abs(np.diff(arm.joints_rad, axis=0))).max() < 10.0
        assert len(np.unique(arm.configuration[:, 3])) == 1
        np.testing.assert_array_equal(arm.configuration, robot.configuration(arm.joints_rad))


def test_approach_and_leave_lie_along_the_sweep_with_the_first_and_last_grip():
    motion = plan()
    for arm in (motion.left, motion.right):
        np.testing.assert_allclose(arm.approach[:3, 3], arm.poses[0, :3, 3] - [0, 150, 0], rtol=0, atol=1e-12)
        np.testing.assert_allclose(arm.leave[:3, 3], arm.poses[-1, :3, 3] + [0, 120, 0], rtol=0, atol=1e-12)
        np.testing.assert_array_equal(arm.approach[:3, :3], arm.poses[0, :3, :3])
        np.testing.assert_array_equal(arm.leave[:3, :3], arm.poses[-1, :3, :3])


def test_no_approach_is_the_first_leaf_itself():
    motion = plan(approach_mm=0.0, leave_mm=0.0)
    np.testing.assert_array_equal(motion.left.approach, motion.left.poses[0])
    np.testing.assert_array_equal(motion.right.leave_joints_rad, motion.right.joints_rad[-1])


def test_a_leaf_out_of_reach_is_told_and_the_others_stay():
    left, right = sweep()
    far = left[0].copy()
    far[10, 0] -= 6000.0
    motion = plan(((far, *left[1:]), right))
    assert np.flatnonzero(np.isnan(motion.left.joints_rad).any(axis=1)).tolist() == [10]
    assert motion.left.reach_mm[10] < 0.0
    assert np.isnan(motion.left.joint_margin_rad[10])
    others = np.arange(31) != 10
    assert np.degrees(motion.left.joint_margin_rad[others]).min() > 30.0
    assert np.isfinite(motion.right.joints_rad).all()
    np.testing.assert_array_equal(motion.right.joints_rad, plan().right.joints_rad)


def test_one_leaf_is_a_motion_too():
    motion = plan(sweep(n=1))
    assert motion.left.joints_rad.shape == (1, 6)
    assert np.isfinite(motion.right.joints_rad).all()


def test_the_whole_cell_may_be_turned():
    turn = np.eye(4)
    turn[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    turn[:3, 3] = [100.0, -2000.0, 30.0]
    cell = replace(
        CELL,
        left=CELL.left.placed(base=turn @ CELL.left.base),
        right=CELL.right.placed(base=turn @ CELL.right.base),
        work_object=turn @ CELL.work_object,
    )
    np.testing.assert_allclose(plan(cell=cell).left.joints_rad, plan().left.joints_rad, rtol=0, atol=1e-9)


def test_grip_poses_make_normals_orthogonal():
    pose = grip_poses((0, 0, 0), (2, 0, 0), (0.5, 1, 0), "left")
    np.testing.assert_allclose(pose[:3, :3].T, [[0, 1, 0], [0, 0, 1], [1, 0, 0]], atol=1e-15)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"speed_mm_s": 0.0}, "speed_mm_s"),
        ({"speed_mm_s": float("nan")}, "speed_mm_s"),
        ({"approach_mm": -1.0}, "approach_mm"),
        ({"leave_mm": float("inf")}, "leave_mm"),
        ({"rods": range(30)}, "30 rods need"),
        ({"frames": (([], [], []), ([], [], [])), "rods": ()}, "shape"),
        ({"frames": tuple((p * np.nan, t, n) for p, t, n in sweep())}, "finite"),
        ({"frames": tuple((p, 0.0 * t, n) for p, t, n in sweep())}, "neither zero"),
        ({"frames": tuple((p, n, n) for p, t, n in sweep())}, "along the normal"),
        ({"frames": tuple((p, t, n[0]) for p, t, n in sweep())}, "one shape"),
    ],
)
def test_input_that_is_no_motion(change, words):
    with pytest.raises(InvalidInputError, match=words):
        plan(**change)


def test_an_arm_is_left_or_right():
    with pytest.raises(InvalidInputError, match="side"):
        grip_poses((0, 0, 0), (1, 0, 0), (0, 1, 0), "middle")
