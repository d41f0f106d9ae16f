"""The arm's kinematics against a product of exponentials written from the dimensions alone, and against plain geometry."""

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.fabrication.robot.arm import RobotArm, arm_preset

IRB = arm_preset("irb-6620-150-2.2")
BASE = np.array([[0.0, -1.0, 0.0, 300.0], [1.0, 0.0, 0.0, -200.0], [0.0, 0.0, 1.0, 500.0], [0.0, 0.0, 0.0, 1.0]])
TOOL = np.array([[0.6, 0.0, 0.8, 40.0], [0.0, 1.0, 0.0, -30.0], [-0.8, 0.0, 0.6, 250.0], [0.0, 0.0, 0.0, 1.0]])


def screw_axes():
    """Points and directions of the six axes of an IRB 6620 at its zero pose, and the wrist centre, from ABB's drawing.

    At zero the lower arm stands upright and the forearm lies level, 200 mm above axis 3. Axes 2, 3 and 5 turn about +y
    (forward and down), axes 4 and 6 about +x (along the forearm).
    """
    wrist = np.array([320.0 + 887.0, 0.0, 680.0 + 975.0 + 200.0])
    points = [[0, 0, 0], [320, 0, 680], [320, 0, 1655], wrist, wrist, wrist]
    directions = [[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]]
    return np.array(points, float), np.array(directions, float), wrist


def turn(direction, angle):
    """Rodrigues' formula."""
    x, y, z = direction
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k


def exponentials(joints):
    """The flange pose in the base frame and its 6 × 6 geometric Jacobian (m, rad), by the product of exponentials."""
    points, directions, wrist = screw_axes()
    pose = np.eye(4)
    axes = []
    for point, direction, angle in zip(points, directions, joints):
        axes.append((pose[:3, :3] @ point + pose[:3, 3], pose[:3, :3] @ direction))
        step = np.eye(4)
        step[:3, :3] = turn(direction, angle)
        step[:3, 3] = point - step[:3, :3] @ point
        pose = pose @ step
    home = np.eye(4)
    home[:3, :3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]  # tool0: z forward, x down
    home[:3, 3] = wrist + np.array([200.0, 0.0, 0.0])
    flange = pose @ home
    columns = [np.r_[np.cross(d, flange[:3, 3] - p) / 1000.0, d] for p, d in axes]
    return flange, np.stack(columns, axis=1), pose[:3, :3] @ wrist + pose[:3, 3]


@pytest.fixture(scope="module")
def joints():
    rng = np.random.default_rng(7)
    low, high = IRB.joint_limits_rad.T
    return low + rng.uniform(size=(200, 6)) * (high - low)


def test_the_preset_adds_up_to_the_reach_that_its_maker_prints():
    a1, a2, _, _, c2, c3, _ = IRB.dimensions_mm
    assert a1 + c2 + np.hypot(a2, c3) == pytest.approx(2204.0, abs=1.0)
    assert np.degrees(IRB.joint_limits_rad).round(9).tolist() == [
        [-170, 170], [-65, 140], [-180, 70], [-300, 300], [-130, 130], [-300, 300],
    ]  # fmt: skip


def test_forward_is_the_product_of_exponentials(joints):
    arm = IRB.placed(base=BASE, tool=TOOL)
    expected = np.stack([BASE @ exponentials(q)[0] @ TOOL for q in joints])
    np.testing.assert_allclose(arm.forward(joints), expected, rtol=0, atol=1e-9)
    assert arm.forward(joints.reshape(4, 50, 6)).shape == (4, 50, 4, 4)


def test_every_branch_of_the_inverse_leads_back_to_the_pose(joints):
    arm = IRB.placed(base=BASE, tool=TOOL)
    poses = np.stack([BASE @ exponentials(q)[0] @ TOOL for q in joints])
    found = arm.inverse(poses)
    exists = np.isfinite(found.joints_rad).all(axis=-1)
    assert exists.any(axis=1).all()
    for row, slot in zip(*np.nonzero(exists)):
        back = BASE @ exponentials(found.joints_rad[row, slot])[0] @ TOOL
        assert np.abs(back[:3, 3] - poses[row, :3, 3]).max() < 1e-6
        assert np.abs(back[:3, :3] - poses[row, :3, :3]).max() < 1e-9
    away = found.joints_rad - joints[:, None]
    away = np.abs(away - 2 * np.pi * np.round(away / (2 * np.pi))).max(axis=-1)
    # near a straight wrist the joints are ill-defined, the pose is not
    clear = np.abs(np.sin(joints[:, 4])) > 0.01
    assert np.nanmin(away, axis=1)[clear].max() < 1e-6


def test_a_pose_out_of_reach_and_a_pose_of_nan_spoil_nothing_else():
    pose = IRB.forward(np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]))
    far = pose.copy()
    far[0, 3] += 5000.0
    found = IRB.inverse(np.stack([pose, far, np.full((4, 4), np.nan), pose]))
    assert np.isfinite(found.joints_rad[[0, 3]]).any(axis=(1, 2)).all()
    assert np.isnan(found.joints_rad[1:3]).all()
    assert found.extension_mm[0] > 0 > found.extension_mm[1]
    assert np.isnan(found.extension_mm[2])
    np.testing.assert_array_equal(found.joints_rad[0], found.joints_rad[3])


def test_extension_is_the_distance_of_the_wrist_from_the_end_of_the_arm(joints):
    flange = np.stack([exponentials(q)[0] for q in joints])
    wrist = np.stack([exponentials(q)[2] for q in joints])
    shoulder = np.stack([np.hypot(wrist[:, 0], wrist[:, 1]), wrist[:, 2] - 680.0], axis=1)
    forearm = np.hypot(200.0, 887.0)
    expected = np.full(len(joints), -np.inf)
    for front in (320.0, -320.0):
        far = np.hypot(shoulder[:, 0] - front, shoulder[:, 1])
        expected = np.maximum(expected, np.minimum(975.0 + forearm - far, far - (975.0 - forearm)))
    np.testing.assert_allclose(IRB.inverse(flange).extension_mm, expected, rtol=0, atol=1e-6)


def test_conditioning_is_the_least_singular_value_of_the_jacobian(joints):
    expected = [np.linalg.svd(exponentials(q)[1], compute_uv=False)[-1] for q in joints[:50]]
    np.testing.assert_allclose(IRB.conditioning(joints[:50]), expected, rtol=0, atol=1e-9)
    assert np.isnan(IRB.conditioning(np.full((1, 6), np.nan))).all()


@pytest.mark.parametrize(
    "joints_deg",
    [
        (10, 20, 10, 40, 0, 30),  # axes 4 and 6 in line
        (0, 30, np.degrees(np.arctan2(200, 887)) - 90, 20, 50, 0),  # stretched
        None,  # wrist centre above the base, found below
    ],
)
def test_singularity_is_zero_where_the_jacobian_loses_rank(joints_deg):
    if joints_deg is None:  # bend the lower arm back until the wrist centre stands on axis 1
        low, high = np.radians([-65.0, 0.0])
        for _ in range(80):
            middle = 0.5 * (low + high)
            q = np.array([0.3, middle, np.radians(-40.0), 0.4, 0.8, 0.1])
            ahead = (turn([0, 0, -1], 0.3) @ exponentials(q)[2])[0]
            low, high = (middle, high) if ahead < 0 else (low, middle)
    else:
        q = np.radians(joints_deg)
    assert np.linalg.svd(exponentials(q)[1], compute_uv=False)[-1] < 1e-9
    assert IRB.singularity(q) < 1e-9


def test_singularity_is_the_sines_of_wrist_and_elbow_and_the_wrists_distance(joints):
    wrist = np.stack([exponentials(q)[2] for q in joints])
    shoulder = np.stack([turn([0, 0, 1], q[0]) @ [320.0, 0.0, 680.0] for q in joints])
    elbow = np.stack([turn([0, 0, 1], q[0]) @ ([320, 0, 680] + turn([0, 1, 0], q[1]) @ [0, 0, 975]) for q in joints])
    a, b = elbow - shoulder, wrist - elbow
    bend = np.linalg.norm(np.cross(a, b), axis=1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
    over = np.hypot(wrist[:, 0], wrist[:, 1]) / (975.0 + np.hypot(200.0, 887.0))
    expected = np.minimum(np.minimum(np.abs(np.sin(joints[:, 4])), bend), over)
    np.testing.assert_allclose(IRB.singularity(joints), expected, rtol=0, atol=1e-9)


def test_configuration_follows_abbs_table(joints):
    # quarter turns of axes 1, 4, 6
    q = np.radians([[10, 0, 0, 100, 5, 190], [-10, 0, 0, -100, 5, -190], [90, 0, 0, 0, 5, 299]])
    assert IRB.configuration(q)[:, :3].tolist() == [[0, 1, 2], [-1, -2, -3], [1, 0, 3]]
    # cfx from the geometry: wrist in front of axis 1, wrist in front of the lower arm, axis 5
    for q, cfx in zip(joints, IRB.configuration(joints)[:, 3]):
        back = turn([0, 0, -1], q[0])
        wrist = back @ exponentials(q)[2]
        lower = turn([0, 1, 0], q[1]) @ [0.0, 0.0, 975.0]
        from_elbow = wrist - [320.0, 0.0, 680.0] - lower
        in_front_of_lower_arm = np.cross(lower, from_elbow)[1] > 0.0
        expected = 4 * (wrist[0] < 0.0) + 2 * (not in_front_of_lower_arm) + (q[4] < 0.0)
        assert cfx == expected
    assert set(IRB.configuration(joints)[:, 3]) >= {0, 1, 2, 3, 4, 5, 6, 7}
    assert IRB.configuration(np.full(6, np.nan)).tolist() == [0, 0, 0, 0]


def test_offsets_and_flips_count_as_documented(joints):
    plain = RobotArm("plain", IRB.dimensions_mm, IRB.joint_limits_rad, IRB.joint_speeds_rad_s)
    offsets = np.array([0.3, -0.1, -0.5 * np.pi, 0.2, 0.1, -0.4])
    flips = (True, False, True, True, False, True)
    odd = RobotArm("odd", IRB.dimensions_mm, IRB.joint_limits_rad, IRB.joint_speeds_rad_s, offsets, flips)
    theta = np.where(flips, -joints, joints) - offsets
    np.testing.assert_allclose(odd.forward(joints), plain.forward(theta), rtol=0, atol=1e-9)
    np.testing.assert_allclose(odd.singularity(joints), plain.singularity(theta), rtol=0, atol=1e-12)
    back = odd.forward(odd.inverse(odd.forward(joints)).joints_rad)
    back[np.isnan(back)] = np.broadcast_to(odd.forward(joints)[:, None], back.shape)[np.isnan(back)]
    assert np.abs(back - odd.forward(joints)[:, None]).max() < 1e-6


def test_joint_margins():
    q = np.zeros(6)
    assert np.degrees(IRB.joint_margin(q)) == pytest.approx(65.0)
    q[5] = np.radians(290.0)
    assert np.degrees(IRB.joint_margin(q)) == pytest.approx(10.0)
    assert np.degrees(IRB.best_turn_margin(q)) == pytest.approx(65.0)  # 290° is −70°
    q[0] = np.radians(175.0)  # axis 1 cannot turn right round: −185° is no way out
    assert np.degrees(IRB.best_turn_margin(q)) == pytest.approx(-5.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"base": np.full((4, 4), np.nan)}, "base must be a finite"),
        ({"tool": 2.0 * np.eye(4)}, "tool must be a finite"),
        ({"base": np.diag([1.0, 1.0, -1.0, 1.0])}, "base must be a finite"),
        ({"dimensions_mm": np.array([320.0, -200.0, 0.0, 680.0, np.inf, 887.0, 200.0])}, "finite numbers"),
        ({"dimensions_mm": np.array([320.0, -200.0, 0.0, 680.0, -975.0, 887.0, 200.0])}, "longer than 0"),
        ({"joint_limits_rad": IRB.joint_limits_rad[:, ::-1]}, "less than its highest"),
        ({"joint_limits_rad": IRB.joint_limits_rad[:5]}, "shape"),
        ({"joint_speeds_rad_s": np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.0])}, "must be positive"),
        ({"flip_axes": (False,) * 5}, "six flags"),
    ],
)
def test_values_that_no_arm_can_have(change, words):
    values = {
        "name": "arm",
        "dimensions_mm": IRB.dimensions_mm,
        "joint_limits_rad": IRB.joint_limits_rad,
        "joint_speeds_rad_s": IRB.joint_speeds_rad_s,
    }
    with pytest.raises(InvalidInputError, match=words):
        RobotArm(**(values | change))


def test_an_unknown_robot_is_named():
    with pytest.raises(InvalidInputError, match=r"'r2d2'.*irb-6620"):
        arm_preset("r2d2")
