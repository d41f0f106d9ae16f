"""The capsules of an arm, against the arm's own forward kinematics and against its lengths."""

from dataclasses import replace

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.fabrication.robot.arm import arm_preset
from batten.fabrication.robot.cell import cell_preset, pose_from_xyz
from batten.fabrication.robot.links import GRIPPER, LINKS, arm_capsules, gripper_bend, link_points

CELL = cell_preset("two-irb6620")
RNG = np.random.default_rng(8)
ODD = replace(
    CELL.left,
    dimensions_mm=np.array([320.0, -200.0, 70.0, 680.0, 975.0, 887.0, 200.0]),
    joint_offsets_rad=RNG.uniform(-1.0, 1.0, 6),
    flip_axes=(True, False, True, False, True, True),
)
ARMS = pytest.mark.parametrize("arm", [CELL.left, CELL.right, ODD], ids=["left", "right", "odd"])


@ARMS
def test_the_chain_ends_at_the_arms_own_wrist_and_flange(arm):
    q = RNG.uniform(-2.5, 2.5, (60, 6))
    points = link_points(arm, q)
    flange = arm.forward(q) @ np.linalg.inv(arm.tool)
    np.testing.assert_allclose(points[:, 6], flange[:, :3, 3], rtol=0, atol=1e-9)
    # The wrist centre lies c4 behind the flange along its axis: known from the orientation alone, not from the chain.
    np.testing.assert_allclose(points[:, 5], flange[:, :3, 3] - 200.0 * flange[:, :3, 2], rtol=0, atol=1e-9)


@ARMS
def test_links_have_the_arms_lengths_and_turn_about_its_axes(arm):
    a1, a2, b, c1, c2, c3, c4 = arm.dimensions_mm
    q = RNG.uniform(-2.5, 2.5, (30, 6))
    points = link_points(arm, q)
    lengths = np.linalg.norm(np.diff(points, axis=1), axis=-1)
    expected = [c1, np.hypot(a1, b), c2, abs(a2), c3, c4]
    np.testing.assert_allclose(lengths, np.tile(expected, (30, 1)), rtol=0, atol=1e-9)
    upper, across, fore = points[:, 3] - points[:, 2], points[:, 4] - points[:, 3], points[:, 5] - points[:, 4]
    np.testing.assert_allclose((across * fore).sum(axis=-1), 0.0, atol=1e-6)
    # Joint 3 turns forearm and elbow against the upper arm by itself, and nothing before them.
    turned = q.copy()
    turned[:, 2] += 0.4
    after = link_points(arm, turned)
    np.testing.assert_array_equal(after[:, :4], points[:, :4])
    cosine = ((after[:, 5] - after[:, 4]) * fore).sum(axis=-1) / c3**2
    np.testing.assert_allclose(cosine, np.cos(0.4), rtol=0, atol=1e-12)
    assert np.abs((np.cross(upper, fore) * across).sum(axis=-1)).max() < 1e-3  # one plane, but for b


def test_the_whole_arm_goes_with_its_base():
    q = RNG.uniform(-1.0, 1.0, (5, 6))
    arm = arm_preset("irb-6620-150-2.2")
    base = pose_from_xyz((100.0, -2000.0, 30.0), (10.0, 20.0, 30.0))
    moved = link_points(arm.placed(base=base), q)
    np.testing.assert_allclose(moved, link_points(arm, q) @ base[:3, :3].T + base[:3, 3], rtol=0, atol=1e-9)


def test_joints_that_are_not_known_give_nan_alone():
    q = np.zeros((2, 6))
    q[0, 3] = np.nan
    assert np.isnan(link_points(CELL.left, q)).all(axis=(1, 2)).tolist() == [True, False]


@pytest.mark.parametrize(("bend", "neck", "jaw"), [(70.0, 150.0, 200.0), (20.0, 90.0, 10.0), (-110.0, 300.0, 250.0)])
def test_a_bent_gripper_bends_where_it_was_bent(bend, neck, jaw):
    tool = pose_from_xyz((0.0, 0.0, neck), (0.0, bend, 0.0))
    tool[:3, 3] += jaw * tool[:3, 2]
    np.testing.assert_allclose(gripper_bend(tool), [0.0, 0.0, neck], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "tool",
    [
        np.eye(4),
        pose_from_xyz((0.0, 0.0, 250.0)),
        pose_from_xyz((30.0, 0.0, 250.0)),  # beside the axis and along it
        pose_from_xyz((200.0, 0.0, -150.0), (0.0, 90.0, 0.0)),  # the lines meet behind the flange
        pose_from_xyz((-200.0, 0.0, 150.0), (0.0, 90.0, 0.0)),  # they meet ahead of the rod's end
    ],
)
def test_other_grippers_are_straight(tool):
    assert gripper_bend(tool).tolist() == [0.0, 0.0, 0.0]


def test_lines_that_do_not_meet_bend_where_they_are_nearest():
    tool = pose_from_xyz((0.0, 0.0, 150.0), (0.0, 70.0, 0.0))
    tool[:3, 3] += 200.0 * tool[:3, 2] + [0.0, 15.0, 0.0]
    np.testing.assert_allclose(gripper_bend(tool), [0.0, 0.0, 150.0], rtol=0, atol=1e-9)


def test_capsules_join_one_another_from_base_to_rod():
    q = RNG.uniform(-1.0, 1.0, (7, 6))
    found = arm_capsules(CELL.left, q, 25.0, "left")
    assert found.names == tuple(f"left {name}" for name in (*LINKS, *GRIPPER))
    np.testing.assert_array_equal(found.start[:, 1:], found.end[:, :-1])
    end = CELL.left.forward(q)
    np.testing.assert_array_equal(found.end[:, -1], end[:, :3, 3])
    jaw = found.end[:, -1] - found.start[:, -1]
    np.testing.assert_allclose(jaw, 200.0 * end[:, :3, 2], rtol=0, atol=1e-9)  # along the rod
    assert found.radius.tolist() == [*CELL.left.link_radii_mm, 25.0, 25.0]
    neck = found.end[:, -2] - found.start[:, -2]
    wrist = found.end[:, 5] - found.start[:, 5]
    np.testing.assert_allclose(neck / 150.0, wrist / 200.0, rtol=0, atol=1e-12)


def test_radii_are_checked():
    with pytest.raises(InvalidInputError, match="link_radii_mm must be 0 or more"):
        replace(CELL.left, link_radii_mm=np.array([1.0, 2.0, -3.0, 4.0, 5.0, 6.0]))
