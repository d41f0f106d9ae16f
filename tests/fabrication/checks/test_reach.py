"""The robots' checks, from motions whose numbers are known."""

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.fabrication.checks.reach import reach_checks
from batten.fabrication.plan import ArmMotion, BlockMotion
from batten.fabrication.robot.cell import cell_preset

CELL = cell_preset("two-irb6620")


def arm_motion(y, joints_deg, **change):
    """An arm whose tool goes along y; `y` and `joints_deg` name approach, leaves and leave."""
    y, joints = np.asarray(y, float), np.radians(np.asarray(joints_deg, float))
    poses = np.tile(np.eye(4), (len(y), 1, 1))
    poses[:, 1, 3] = y
    n = len(y) - 2
    values = {
        "poses": poses[1:-1],
        "joints_rad": joints[1:-1],
        "spin_rad": np.zeros(n),
        "reach_mm": np.full(n, 200.0),
        "joint_margin_rad": np.radians(np.full(n, 50.0)),
        "singularity": np.full(n, 0.8),
        "conditioning": np.full(n, 0.4),
        "approach": poses[0],
        "leave": poses[-1],
        "approach_joints_rad": joints[0],
        "leave_joints_rad": joints[-1],
        "configuration": np.zeros((n, 4), dtype=np.int64),
    }
    return ArmMotion(**(values | change))


@pytest.fixture
def motion():
    rest = np.zeros((5, 6))
    moving = rest.copy()
    moving[:, 0] = [0.0, 5.0, 10.0, 13.0, 18.0]  # degrees; axis 1 may do 100 °/s
    left = arm_motion([-100, 0, 20, 40, 140], moving, reach_mm=np.array([200.0, 15.0, 200.0]))
    right = arm_motion(
        [-100, 0, 40, 60, 160],
        rest,
        joint_margin_rad=np.radians([50.0, 40.0, 3.0]),
        singularity=np.array([0.8, np.nan, 0.04]),
        conditioning=np.array([0.4, 0.3, 0.01]),
    )
    return BlockMotion(7, (4, 1, 2), left, right, 20.0)


def by_name(motions, n_rods=6):
    return {c.name: c for c in reach_checks(motions, CELL, n_rods)}


def test_both_ends_arrive_together_and_the_further_one_moves_at_the_cutting_speed(motion):
    np.testing.assert_allclose(motion.seconds, [5.0, 2.0, 1.0, 5.0])


def test_each_value_is_the_worse_of_both_arms_at_the_rods_place(motion):
    checks = by_name([motion])
    nan = np.nan
    np.testing.assert_allclose(checks["reach"].values, [nan, 15.0, 200.0, nan, 200.0, nan])
    np.testing.assert_allclose(checks["joint_limits"].values, [nan, 40.0, 3.0, nan, 50.0, nan])
    np.testing.assert_allclose(checks["singularity"].values, [nan, 0.0, 0.04, nan, 0.8, nan])
    np.testing.assert_allclose(checks["conditioning"].values, [nan, 0.3, 0.01, nan, 0.4, nan])
    # moves take 5, 2, 1, 5 s and turn axis 1 by 5, 5, 3, 5 degrees: 1, 2.5, 3, 1 % of 100 °/s
    np.testing.assert_allclose(checks["joint_speed"].values, [nan, 3.0, 3.0, nan, 2.5, nan])
    np.testing.assert_allclose(checks["joint_step"].values, [nan, 5.0, 3.0, nan, 5.0, nan])


def test_limits_and_verdicts(motion):
    checks = by_name([motion])
    assert list(checks) == ["reach", "joint_limits", "singularity", "conditioning", "joint_speed", "joint_step"]
    broken = {name: np.flatnonzero(~c.passed).tolist() for name, c in checks.items()}
    assert broken["reach"] == [1]
    assert broken["joint_limits"] == [2]
    assert broken["singularity"] == [1, 2]
    assert broken["conditioning"] == [2]
    assert broken["joint_speed"] == broken["joint_step"] == []
    assert [c.unit for c in checks.values()] == ["mm", "°", "", "", "%", "°"]
    assert [c.hard for c in checks.values()] == [True, True, True, False, True, True]


def test_a_jump_of_a_joint_breaks_step_and_speed():
    joints = np.zeros((5, 6))
    joints[2:, 3] = 90.0
    swing = arm_motion([-100, 0, 20, 40, 140], joints)
    checks = by_name([BlockMotion(1, (0, 1, 2), swing, arm_motion([-100, 0, 20, 40, 140], np.zeros((5, 6))), 20.0)], 3)
    np.testing.assert_allclose(checks["joint_step"].values, [90.0, 90.0, 0.0])
    np.testing.assert_allclose(checks["joint_speed"].values, [60.0, 60.0, 0.0])  # 90 °/s of 150 °/s
    assert checks["joint_step"].passed.tolist() == checks["joint_speed"].passed.tolist() == [False, False, True]


def test_a_leaf_out_of_reach_fails_and_leaves_its_neighbours_alone():
    joints = np.zeros((5, 6))
    joints[2] = np.nan
    broken = arm_motion(
        [-100, 0, 20, 40, 140],
        joints,
        reach_mm=np.array([200.0, -30.0, 200.0]),
        joint_margin_rad=np.array([1.0, np.nan, 1.0]),
        singularity=np.array([0.8, np.nan, 0.8]),
        conditioning=np.array([0.4, np.nan, 0.4]),
    )
    checks = by_name([BlockMotion(1, (0, 1, 2), broken, arm_motion([-100, 0, 20, 40, 140], np.zeros((5, 6))), 20.0)], 3)
    for name in ("reach", "joint_limits", "singularity", "conditioning"):
        assert checks[name].passed.tolist() == [True, False, True]
    assert checks["reach"].values[1] == -30.0
    assert checks["joint_limits"].values[1] == -180.0
    assert checks["joint_speed"].passed.all()


def test_one_leaf_has_no_step():
    single = arm_motion([-100, 0, 100], np.zeros((3, 6)))
    checks = by_name([BlockMotion(1, (0,), single, single, 20.0)], 1)
    assert np.isnan(checks["joint_step"].values).all()
    assert checks["joint_speed"].values.tolist() == [0.0]


def test_rods_that_the_plan_does_not_have(motion):
    with pytest.raises(InvalidInputError, match="block 7 names rods 1 … 4 of a plan with 4"):
        reach_checks([motion], CELL, 4)
