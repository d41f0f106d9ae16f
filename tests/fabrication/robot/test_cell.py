"""The preset's envelope, and cells from a job."""

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from batten.errors import InvalidInputError
from batten.fabrication.job import ArmJob, CellJob, KinematicsJob
from batten.fabrication.robot.cell import RobotCell, cell_from_job, cell_preset, pose_from_xyz
from batten.fabrication.robot.motion import grip_poses
from batten.fabrication.robot.spin_choice import spun

CELL = cell_preset("two-irb6620")


def envelope(side):
    """Rod ends of 1000 mm rods on blocks of 600 × 600 × 1000 mm, tilted by up to 60°, planes turned by up to 20°."""
    sign = -1.0 if side == "left" else 1.0
    grid = itertools.product(
        (350.0, 520.0),
        (-450.0, 0.0, 450.0),
        (100.0, 650.0, 1200.0),
        (-60.0, -30.0, 0.0, 30.0, 60.0),
        (-20.0, 0.0, 20.0),
    )
    x, y, z, tilt, yaw = np.array(list(grid)).T
    turned = Rotation.from_rotvec(np.radians(yaw)[:, None] * [0.0, 0.0, 1.0])
    tilt = np.radians(tilt)
    tangents = turned.apply(np.stack([np.cos(tilt), 0.0 * tilt, np.sin(tilt)], axis=1))
    return np.stack([sign * x, y, z], axis=1), tangents, turned.apply([0.0, 1.0, 0.0])


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_preset_holds_its_envelope_with_margins_to_spare_on_one_branch(side):
    arm = CELL.arm(side)
    poses = CELL.work_object @ grip_poses(*envelope(side), side)
    found = arm.inverse(spun(poses[:, None], np.radians(np.arange(0.0, 360.0, 15.0))))
    joints = np.nan_to_num(np.degrees(arm.best_turn_margin(found.joints_rad)), nan=-180.0)
    good = (joints >= 35.0) & (arm.singularity(found.joints_rad) >= 0.5) & (found.extension_mm[..., None] >= 100.0)
    assert good.any(axis=1).all(axis=0).any()  # some turn at every pose, on one and the same branch


def test_the_arms_face_each_other_across_the_block():
    # at zero each arm points at the other; the left one stands at −x
    left, right = (arm.placed(tool=np.eye(4)).forward(np.zeros(6)) for arm in (CELL.left, CELL.right))
    assert CELL.left.base[0, 3] < left[0, 3] < 0.0 < right[0, 3] < CELL.right.base[0, 3]
    np.testing.assert_allclose(left[:3, 2], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(right[:3, 2], [-1, 0, 0], atol=1e-12)


def test_poses_turn_about_fixed_axes():
    pose = pose_from_xyz((1, 2, 3), (10, 20, 30))
    expected = Rotation.from_euler("xyz", (10, 20, 30), degrees=True).as_matrix()  # lower case: fixed axes
    np.testing.assert_allclose(pose[:3, :3], expected, atol=1e-15)
    assert pose[:3, 3].tolist() == [1, 2, 3]


def test_a_job_without_own_values_is_the_preset():
    cell = cell_from_job(CellJob())
    for side in ("left", "right"):
        for name in ("base", "tool", "joint_limits_rad", "dimensions_mm"):
            np.testing.assert_array_equal(getattr(cell.arm(side), name), getattr(CELL.arm(side), name))
    np.testing.assert_array_equal(cell.work_object, CELL.work_object)
    assert np.degrees(cell.min_joint_margin_rad) == pytest.approx(5.0)


def test_a_job_puts_its_own_values_over_the_preset():
    lengths = KinematicsJob(100.0, -50.0, 1.0, 500.0, 600.0, 700.0, 80.0, (0, 0, -90, 0, 0, 0), (1, 1, -1, 1, 1, 1))
    cell = cell_from_job(
        CellJob(
            block_mm=(10.0, 20.0, 30.0),
            block_deg=90.0,
            min_joint_margin_deg=7.0,
            min_reach_margin_mm=33.0,
            min_singularity=0.2,
            left=ArmJob(base_mm=(1.0, 2.0, 3.0), joint_min_deg=(-100.0,) * 6, kinematics=lengths),
            right=ArmJob(tool_deg=(0.0, 0.0, 90.0), base_deg=(0.0, 0.0, 90.0)),
        )
    )
    assert cell.work_object[:3, 3].tolist() == [10, 20, 30]
    np.testing.assert_allclose(cell.work_object[:3, 0], [0, 1, 0], atol=1e-12)
    assert np.degrees(cell.min_joint_margin_rad) == pytest.approx(7.0)
    assert (cell.min_reach_mm, cell.min_singularity) == (33.0, 0.2)
    assert cell.left.base[:3, 3].tolist() == [1, 2, 3]
    np.testing.assert_array_equal(cell.left.base[:3, :3], CELL.left.base[:3, :3])
    assert np.degrees(cell.left.joint_limits_rad[:, 0]).round(9).tolist() == [-100.0] * 6
    assert np.degrees(cell.left.joint_limits_rad[0, 1]) == pytest.approx(170.0)
    assert cell.left.dimensions_mm.tolist() == [100, -50, 1, 500, 600, 700, 80]
    assert cell.left.flip_axes == (False, False, True, False, False, False)
    np.testing.assert_allclose(cell.right.tool[:3, 0], [0, 1, 0], atol=1e-12)
    np.testing.assert_array_equal(cell.right.tool[:3, 3], CELL.right.tool[:3, 3])
    np.testing.assert_allclose(cell.right.base[:3, 0], [0, 1, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("job", "words"),
    [
        (CellJob(preset="three-irb6620"), "no cell is called"),
        (CellJob(left=ArmJob(base_mm=(np.nan, 0.0, 0.0))), "finite"),
        (CellJob(block_mm=(0.0, np.inf, 0.0)), "finite"),
        (CellJob(min_joint_margin_deg=-1.0), "min_joint_margin_rad"),
        (CellJob(min_reach_margin_mm=float("nan")), "min_reach_mm"),
        (CellJob(right=ArmJob(joint_min_deg=(10.0,) * 5)), "six joint angles"),
        (CellJob(right=ArmJob(joint_min_deg=(160.0,) * 6)), "less than its highest"),
        (CellJob(left=ArmJob(kinematics=KinematicsJob(1, 1, 0, 1, 1, 1, 1, signs=(1, 0, 1, 1, 1, 1)))), "signs"),
    ],
)
def test_a_job_that_no_cell_can_have(job, words):
    with pytest.raises(InvalidInputError, match=words):
        cell_from_job(job)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"max_joint_speed_fraction": 0.0}, r"\(0, 1\]"),
        ({"max_joint_speed_fraction": float("nan")}, r"\(0, 1\]"),
        ({"max_joint_step_rad": -0.1}, "max_joint_step_rad"),
        ({"min_singularity": -0.1}, "min_singularity"),
        ({"tool_mass_kg": 0.0}, "tool_mass_kg"),
        ({"tool_centre_mm": (0.0, 0.0)}, "tool_centre_mm"),
        ({"work_object": np.zeros((4, 4))}, "work_object"),
    ],
)
def test_values_that_no_cell_can_have(change, words):
    values = {"left": CELL.left, "right": CELL.right, "work_object": CELL.work_object}
    with pytest.raises(InvalidInputError, match=words):
        RobotCell(**(values | change))
