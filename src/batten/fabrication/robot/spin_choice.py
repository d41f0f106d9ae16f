"""How far the rod is turned about its own axis in the grip, at every leaf: the one freedom that the leaf leaves open.

A round rod does not care how it is turned, so every tool pose comes with a circle of equally good ones. Over a grid of
that circle and the eight branches of the inverse kinematics, a path through the leaves of one block is sought on *one*
branch (no change of configuration within a block):

1. the greatest least margin: dynamic programming for the path whose worst margin is the best that any path has, each
   margin divided by the limit that it must keep (joint limits, singularity, reach, joint step between leaves and, where it
   is asked for, the free distance);
2. among the paths that keep four fifths of that margin, the one that moves the joints least, Σ|Δq|². Where no path keeps
   the limits, the shortfalls are added up instead of forbidden, so that one bad leaf does not spoil the others.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from batten.fabrication.robot.arm import RobotArm
from batten.typing import BoolArray, FloatArray, IntArray

Clearance: TypeAlias = Callable[[FloatArray, IntArray], FloatArray]
"""Free distances (j,), mm, of the arm at joints (j, 6), each at the pose of that index, (j,)."""

_UNREACHABLE = -1.0e3  # below every margin that a reachable pose can have
_KEPT = 0.8  # share of the best margin that the second step keeps
_SHORTFALL_COST = 100.0  # rad² for one limit missed by its own size: far above any motion of the joints
_DEEPEST = -10.0  # shortfalls beyond this many limits are all the same
_ROOMY = 1.5  # a free distance of so many times its limit is as good as any
_EASY_STEP = 0.5  # joint steps below this share of their limit count as free


@dataclass(frozen=True)
class SpinLimits:
    """What a path must keep; each margin is measured in these units. All positive.

    Attributes:
        joint_margin_rad: least distance of a joint from its limits.
        reach_mm: least distance of the wrist centre from the end of its reach.
        singularity: least distance from a singularity (`RobotArm.singularity`).
        joint_step_rad: greatest turn of a joint between successive leaves.
        joint_speed_fraction: greatest share of a joint's rated speed.
        spins: how many turns of the rod are tried over the full circle.
        window: how many of them the rod may turn between successive leaves.
        clearance_mm: least free distance, where a function for it is given.
    """

    joint_margin_rad: float
    reach_mm: float
    singularity: float
    joint_step_rad: float
    joint_speed_fraction: float
    spins: int = 72
    window: int = 4
    clearance_mm: float = 1.0


@dataclass(frozen=True, eq=False)
class SpinPath:
    """The path that was chosen: `spin_rad` (n,), `joints_rad` (n, 6) without jumps of 2π, `reach_mm` (n,), `branch`.

    Poses that the arm cannot reach on that branch have NaN joints.
    """

    spin_rad: FloatArray
    joints_rad: FloatArray
    reach_mm: FloatArray
    branch: int


def spun(poses: FloatArray, spin_rad: FloatArray) -> FloatArray:
    """Tool poses, (…, 4, 4), turned about their own z axis by `spin_rad`, of a shape that broadcasts with (…)."""
    cos, sin = np.cos(spin_rad)[..., None], np.sin(spin_rad)[..., None]
    x, y = poses[..., 0], poses[..., 1]
    out = np.array(np.broadcast_to(poses, np.broadcast_shapes(poses.shape, (*cos.shape[:-1], 4, 4))))
    out[..., 0] = cos * x + sin * y
    out[..., 1] = cos * y - sin * x
    return out


def choose_spins(
    arm: RobotArm,
    poses: FloatArray,
    seconds: FloatArray,
    may_turn: BoolArray,
    limits: SpinLimits,
    clearance: Clearance | None = None,
) -> SpinPath:
    """The turn of the rod at every pose, and the branch, with the best margins (see the module's first lines).

    Parameters:
        poses: shape (n, 4, 4), tool poses in the cell frame at spin 0, mm, in the order of the motion.
        seconds: shape (n − 1,), how long the move between successive poses takes.
        may_turn: shape (n − 1,), whether the rod may turn in the grip on that move.
        limits: what to keep.
        clearance: free distances to be kept too; without, none is looked at.

    Returns:
        A path, always: where no path keeps the limits, the one that breaks them least; poses out of reach have NaN joints.

    Accuracy: the best over the grid of `limits.spins` turns, not over the continuous circle.
    """
    grid = 2.0 * np.pi * np.arange(limits.spins) / limits.spins
    found = arm.inverse(spun(poses[:, None], grid))
    margins = _margins(arm, found.joints_rad, found.extension_mm, limits)
    if clearance is not None:
        row, spin, branch = np.nonzero(margins > 0.0)
        free = clearance(found.joints_rad[row, spin, branch], row) / limits.clearance_mm
        np.minimum.at(margins, (row, spin, branch), np.where(free >= _ROOMY, np.inf, free))
    margins[margins.max(axis=(1, 2)) <= _UNREACHABLE] = -_UNREACHABLE  # reached in no way: has no say in the choice
    reached = margins.max(axis=1)
    bounds = reached.min(axis=0)  # no path on a branch is better than its worst pose
    best: tuple[float, int, IntArray] | None = None
    for branch in np.lexsort((-_clipped(reached).sum(axis=0), -bounds)):
        if best is not None and best[0] >= bounds[branch]:
            break
        value, index = _best_path(arm, found.joints_rad[:, :, branch], margins[:, :, branch], seconds, may_turn, limits)
        if best is None or value > best[0]:
            best = (value, int(branch), index)
    assert best is not None
    _, chosen, index = best
    rows = np.arange(len(poses))
    joints = _unwrapped(arm, found.joints_rad[rows, index, chosen])
    return SpinPath(grid[index], joints, found.extension_mm[rows, index], chosen)


def _margins(arm: RobotArm, joints: FloatArray, extension: FloatArray, limits: SpinLimits) -> FloatArray:
    """The least margin of every candidate, in units of its limit, (n, spins, 8)."""
    worst = np.minimum(
        arm.best_turn_margin(joints) / limits.joint_margin_rad, arm.singularity(joints) / limits.singularity
    )
    worst = np.minimum(worst, extension[..., None] / limits.reach_mm)
    return np.where(np.isnan(worst), _UNREACHABLE, worst)


def _clipped(margin: FloatArray) -> FloatArray:
    """Margins that count: nothing is gained above the limit, nothing more lost far below it."""
    return np.clip(margin, _DEEPEST, 1.0)


def _best_path(
    arm: RobotArm, joints: FloatArray, margin: FloatArray, seconds: FloatArray, may_turn: BoolArray, limits: SpinLimits
) -> tuple[float, IntArray]:
    """On one branch: the best worst margin, and the smoothest path that keeps most of it, as grid indices (n,)."""
    n, spins = margin.shape
    reach = min(limits.window, (spins - 1) // 2)
    offsets = np.arange(-reach, reach + 1)
    before = (np.arange(spins)[:, None] + offsets) % spins  # (spins, window): where a candidate may come from
    allowed = np.minimum(limits.joint_speed_fraction * arm.joint_speeds_rad_s * seconds[:, None], limits.joint_step_rad)
    used = np.zeros((n - 1, spins, len(offsets)))
    work = np.zeros_like(used)
    for k in range(6):
        delta = joints[1:, :, None, k] - joints[:-1, :, k][:, before]
        if arm.wraps[k]:
            delta -= 2.0 * np.pi * np.rint(delta / (2.0 * np.pi))
        np.nan_to_num(delta, copy=False, nan=0.0)
        np.maximum(used, np.abs(delta) / allowed[:, k, None, None], out=used)
        work += delta**2
    step = np.where(used <= _EASY_STEP, np.inf, 1.0 / np.maximum(used, _EASY_STEP))
    barred = ~may_turn[:, None] & (offsets != 0)  # (n − 1, window)
    step = np.where(barred[:, None], -np.inf, step)

    value = margin[0]
    for i in range(n - 1):
        value = np.minimum(margin[i + 1], np.minimum(step[i], value[before]).max(axis=-1))
    worst = float(value.max())

    if worst > 1.0:
        kept = max(1.0, _KEPT * worst)
        price = np.where(margin >= kept, 0.0, np.inf)
        work = np.where(step >= kept, work, np.inf)
    else:
        price = _SHORTFALL_COST * (1.0 - _clipped(margin))
        work = np.where(step < 0.0, np.inf, work + _SHORTFALL_COST * (1.0 - _clipped(step)))
    cost = price[0]
    came = np.zeros((n, spins), dtype=np.int64)
    for i in range(n - 1):
        total = cost[before] + work[i]
        pick = total.argmin(axis=-1)
        came[i + 1] = before[np.arange(spins), pick]
        cost = price[i + 1] + total[np.arange(spins), pick]
    index = np.empty(n, dtype=np.int64)
    index[-1] = int(cost.argmin())
    for i in range(n - 1, 0, -1):
        index[i - 1] = came[i, index[i]]
    return worst, index


def _unwrapped(arm: RobotArm, joints: FloatArray) -> FloatArray:
    """The same joint angles without jumps of 2π, on the full turns that leave the limits furthest; NaN rows stay."""
    out = joints.copy()
    good = np.isfinite(joints).all(axis=1)
    for k in np.flatnonzero(arm.wraps):
        if not good.any():
            break
        path = np.unwrap(joints[good, k])
        centre = 0.5 * float(arm.joint_limits_rad[k].sum())
        middle = 0.5 * float(path.min() + path.max())
        out[good, k] = path - 2.0 * np.pi * np.round((middle - centre) / (2.0 * np.pi))
    return out
