"""The choice of spin against trying every path there is."""

import itertools

import numpy as np
import pytest

from batten.fabrication.robot.arm import RobotArm, arm_preset
from batten.fabrication.robot.cell import pose_from_xyz
from batten.fabrication.robot.spin_choice import SpinLimits, choose_spins, spun

IRB = arm_preset("irb-6620-150-2.2")
DEGREE = np.pi / 180.0


def limits(**change):
    values = {
        "joint_margin_rad": 5 * DEGREE,
        "reach_mm": 20.0,
        "singularity": 0.05,
        "joint_step_rad": 30 * DEGREE,
        "joint_speed_fraction": 0.5,
        "spins": 8,
        "window": 1,
    }
    return SpinLimits(**(values | change))


def random_path(arm, rng, n):
    """Poses along a smooth way through joint space, somewhere within the limits."""
    low, high = arm.joint_limits_rad.T
    start = low + rng.uniform(0.1, 0.9, 6) * (high - low)
    end = np.clip(start + rng.uniform(-0.6, 0.6, 6), low, high)
    return arm.forward(start + np.linspace(0.0, 1.0, n)[:, None] * (end - start))


def margins_by_hand(arm, joints, extension, bounds):
    """The least margin over its limit, taken joint by joint with plain loops."""
    out = np.full(joints.shape[:-1], -1000.0)
    for place in np.ndindex(*out.shape):
        q = joints[place]
        if np.isnan(q).any():
            continue
        worst = extension[place[:-1]] / bounds.reach_mm
        worst = min(worst, float(arm.singularity(q)) / bounds.singularity)
        for angle, (low, high) in zip(q, arm.joint_limits_rad):
            turns = (-2 * np.pi, 0.0, 2 * np.pi) if high - low >= 2 * np.pi else (0.0,)
            worst = min(worst, max(min(angle + t - low, high - angle - t) for t in turns) / bounds.joint_margin_rad)
        out[place] = worst
    return out


def step_by_hand(arm, a, b, seconds, bounds):
    worst = np.inf
    for k in range(6):
        turn = abs(b[k] - a[k])
        if np.ptp(arm.joint_limits_rad[k]) >= 2 * np.pi:
            turn = min(turn, 2 * np.pi - turn)
        used = turn / min(bounds.joint_speed_fraction * arm.joint_speeds_rad_s[k] * seconds, bounds.joint_step_rad)
        worst = min(worst, np.inf if used <= 0.5 else 1.0 / used)
    return worst


def all_paths(arm, poses, seconds, may_turn, bounds):
    """Every path there is: (worst margin, joint motion, branch, indices)."""
    grid = 2 * np.pi * np.arange(bounds.spins) / bounds.spins
    found = arm.inverse(spun(poses[:, None], grid))
    margin = margins_by_hand(arm, found.joints_rad, found.extension_mm, bounds)
    turns = itertools.product(*(range(-bounds.window, bounds.window + 1) if may else (0,) for may in may_turn))
    for steps, branch, first in itertools.product(list(turns), range(8), range(bounds.spins)):
        path = np.cumsum([first, *steps]) % bounds.spins
        worst = min(margin[i, j, branch] for i, j in enumerate(path))
        if worst <= 0.0:
            continue
        q = np.array([found.joints_rad[i, j, branch] for i, j in enumerate(path)])
        worst = min([worst, *(step_by_hand(arm, a, b, t, bounds) for a, b, t in zip(q, q[1:], seconds))])
        turned = np.diff(q, axis=0)
        wraps = np.ptp(arm.joint_limits_rad, axis=1) >= 2 * np.pi
        turned = np.where(wraps, turned - 2 * np.pi * np.round(turned / (2 * np.pi)), turned)
        yield worst, float((turned**2).sum()), branch, tuple(path)


def test_no_path_on_any_branch_is_better():
    rng = np.random.default_rng(3)
    bounds = limits()
    arm = IRB.placed(tool=pose_from_xyz((190.0, 0.0, 220.0), (0.0, 70.0, 0.0)))
    kept, settled = 0, 0
    may_turn = np.array([False, True, True])
    for _ in range(10):
        poses = random_path(arm, rng, 4)
        seconds = rng.uniform(0.3, 1.0, 3)
        paths = list(all_paths(arm, poses, seconds, may_turn, bounds))
        best = max((p[0] for p in paths), default=0.0)
        chosen = choose_spins(arm, poses, seconds, may_turn, bounds)
        index = tuple(int(k) for k in np.round(chosen.spin_rad / (2 * np.pi / 8)))
        if best <= 1.0:
            continue
        kept += 1
        mine = next(p for p in paths if p[2:] == (chosen.branch, index))  # it is one of the paths that are allowed
        enough = max(1.0, 0.8 * best)
        assert mine[0] >= enough - 1e-9
        least = min(p[1] for p in paths if p[2] == chosen.branch and p[0] >= enough)
        assert mine[1] == pytest.approx(least, abs=1e-9)
        settled += mine[0] < best - 1e-9
    assert kept >= 5
    assert settled >= 1  # and the second step does choose among the paths that the first leaves


def test_a_leaf_out_of_reach_spoils_no_other():
    rng = np.random.default_rng(5)
    poses = random_path(IRB, rng, 6)
    free = choose_spins(IRB, poses, np.ones(5), np.ones(5, bool), limits(spins=36))
    assert np.isfinite(free.joints_rad).all()
    broken = poses.copy()
    broken[2, :3, 3] *= 10.0
    chosen = choose_spins(IRB, broken, np.ones(5), np.ones(5, bool), limits(spins=36))
    others = [0, 1, 3, 4, 5]
    assert np.isnan(chosen.joints_rad[2]).all()
    assert chosen.reach_mm[2] < 0.0
    assert np.isfinite(chosen.joints_rad[others]).all()
    assert (IRB.joint_margin(chosen.joints_rad[others]) > 5 * DEGREE).all()
    back = IRB.forward(chosen.joints_rad[others])
    np.testing.assert_allclose(back, spun(broken, chosen.spin_rad)[others], rtol=0, atol=1e-6)


def test_the_rod_turns_only_where_standing_still_would_break_a_limit():
    # axis 6 alone carries the sweep: the flange turns by 160° about the rod, which axis 6 may follow by 60° only
    low, high = IRB.joint_limits_rad.T
    low, high = low.copy(), high.copy()
    low[5], high[5] = -30 * DEGREE, 30 * DEGREE
    arm = RobotArm("narrow", IRB.dimensions_mm, np.stack([low, high], 1), IRB.joint_speeds_rad_s, IRB.joint_offsets_rad)
    n = 21
    q = np.tile(np.radians([10.0, 20.0, 10.0, 30.0, 60.0, 0.0]), (n, 1))
    q[:, 5] = np.radians(np.linspace(-80.0, 80.0, n))
    poses = arm.forward(q)  # tool z is the flange's: spin and axis 6 are the same thing
    bounds = limits(spins=72, window=4)
    still = choose_spins(arm, poses, np.ones(n - 1), np.zeros(n - 1, bool), bounds)
    assert arm.joint_margin(still.joints_rad).min() < 0.0
    turning = choose_spins(arm, poses, np.ones(n - 1), np.ones(n - 1, bool), bounds)
    assert arm.joint_margin(turning.joints_rad).min() >= 5 * DEGREE
    turned = np.diff(np.unwrap(turning.spin_rad))
    assert np.abs(turned).max() <= 4 * 5 * DEGREE + 1e-12
    assert np.ptp(np.unwrap(turning.spin_rad)) > 90 * DEGREE
    wide = choose_spins(IRB, poses, np.ones(n - 1), np.ones(n - 1, bool), bounds)
    assert np.ptp(wide.joints_rad[:, :5], axis=0).max() < 1e-9


def test_joints_come_without_jumps_of_a_full_turn():
    # axis 4 goes from 150° to 250°, axis 6 from −140° to −230°: both cross the cut at 180°
    n = 26
    q = np.tile(np.radians([0.0, 20.0, 10.0, 0.0, 60.0, 0.0]), (n, 1))
    q[:, 3] = np.radians(np.linspace(150.0, 250.0, n))
    q[:, 5] = np.radians(np.linspace(-140.0, -230.0, n))
    chosen = choose_spins(IRB, IRB.forward(q), np.ones(n - 1), np.zeros(n - 1, bool), limits(spins=72))
    assert np.abs(np.diff(chosen.joints_rad, axis=0)).max() < 10 * DEGREE
    assert IRB.joint_margin(chosen.joints_rad).min() > 45 * DEGREE
    poses = spun(IRB.forward(q), chosen.spin_rad)
    np.testing.assert_allclose(IRB.forward(chosen.joints_rad), poses, rtol=0, atol=1e-6)


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi])
def test_spin_turns_about_the_tools_own_z(angle):
    pose = IRB.forward(np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]))
    local = np.eye(4)
    local[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    np.testing.assert_allclose(spun(pose, np.asarray(angle)), pose @ local, rtol=0, atol=1e-12)


def test_a_free_distance_is_kept_like_the_other_limits():
    poses = random_path(IRB, np.random.default_rng(11), 6)
    bounds = limits(spins=24, clearance_mm=10.0)
    moves = np.full(5, 10.0), np.ones(5, dtype=bool)
    first = choose_spins(IRB, poses, *moves, bounds)
    asked = []

    def beside(joints, pose):
        """As if the arm were clear only where joint 6 is on the other side of where it was chosen to be."""
        asked.append(len(pose))
        np.testing.assert_allclose(
            IRB.forward(joints)[:, :3, 3], poses[pose, :3, 3], rtol=0, atol=1e-6
        )  # each posture comes with its own pose
        away = np.cos(joints[:, 5] - first.joints_rad[pose, 5])
        return np.where(away < 0.0, 20.0, 5.0)

    other = choose_spins(IRB, poses, *moves, bounds, beside)
    assert len(asked) == 1
    assert (np.cos(other.joints_rad[:, 5] - first.joints_rad[:, 5]) < 0.0).all()
    free = choose_spins(IRB, poses, *moves, bounds, lambda joints, pose: np.full(len(pose), 15.0))
    np.testing.assert_array_equal(free.spin_rad, first.spin_rad)  # roomy everywhere: nothing changes
