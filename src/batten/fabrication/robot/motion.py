"""From gripper frames to the synchronous motion of two arms through one block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from batten.errors import InvalidInputError
from batten.fabrication.collisions import Capsules
from batten.fabrication.plan import ArmMotion, BlockMotion
from batten.fabrication.robot.arm import RobotArm
from batten.fabrication.robot.cell import RobotCell
from batten.fabrication.robot.motion_clearance import arm_clearance, arm_in_work
from batten.fabrication.robot.spin_choice import Clearance, choose_spins, spun
from batten.typing import ArrayLike, BoolArray, FloatArray, IntArray

Frames: TypeAlias = tuple[ArrayLike, ArrayLike, ArrayLike]

_APPROACH_SAMPLE_MM = 50.0


@dataclass(frozen=True, eq=False)
class KeepClear:
    """What arms must stay clear of, beside each other and the table: the block, (3,) along the blade, across it, height."""

    block_size_mm: FloatArray
    gripper_radius_mm: float


def grip_poses(positions_mm: ArrayLike, tangents: ArrayLike, normals: ArrayLike, side: str) -> FloatArray:
    """Tool poses at spin 0 for one end of the rod (convention: `batten.fabrication.robot.cell`).

    Parameters:
        positions_mm: shape (…, 3), the rod's end.
        tangents: shape (…, 3), unit tangents from the rod's left end to its right end, whichever end is held.
        normals: shape (…, 3), unit normals of the rod's plane; made orthogonal to the tangents.
        side: "left" holds the rod's start (z axis along the tangent), "right" its end (z axis against it).

    Returns:
        Shape (…, 4, 4), in the frame of the input.

    Raises:
        InvalidInputError: numbers that are not finite, shapes that do not agree, a tangent that is zero or along the normal.

    Example:
        >>> grip_poses((1, 2, 3), (1, 0, 0), (0, 1, 0), "right")[:3, 2].tolist()
        [-1.0, 0.0, 0.0]
    """
    p, t, n = (np.asarray(v, dtype=np.float64) for v in (positions_mm, tangents, normals))
    if side not in ("left", "right"):
        raise InvalidInputError(f'side must be "left" or "right"; got {side!r}')
    if not p.shape == t.shape == n.shape or p.shape[-1:] != (3,):
        raise InvalidInputError(
            f"positions, tangents and normals must have one shape (…, 3); got {p.shape}, {t.shape}, {n.shape}"
        )
    with np.errstate(invalid="ignore", divide="ignore"):
        z = t / np.linalg.norm(t, axis=-1, keepdims=True)
        x = n - (n * z).sum(axis=-1, keepdims=True) * z
        x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    if not (np.isfinite(p).all() and np.isfinite(z).all() and np.isfinite(x).all()):
        raise InvalidInputError(
            "gripper frames must be finite, with tangents that are neither zero nor along the normal"
        )
    z = z if side == "left" else 0.0 - z  # no negative zeros
    poses = np.zeros((*p.shape[:-1], 4, 4))
    poses[..., :3, 0], poses[..., :3, 1], poses[..., :3, 2], poses[..., :3, 3] = x, np.cross(z, x), z, p
    poses[..., 3, 3] = 1.0
    return poses


def plan_block_motion(
    cell: RobotCell,
    left_frames: Frames,
    right_frames: Frames,
    speed_mm_s: float,
    approach_mm: float,
    leave_mm: float,
    *,
    block: int,
    rods: Sequence[int],
    leaf_seconds: FloatArray | None = None,
    approach_rise: float = 0.0,
    leave_rise: float = 0.0,
    keep_clear: KeepClear | None = None,
) -> BlockMotion:
    """The motion of both arms for one block: the rod's spin and both arms' configurations chosen for the best margins.

    Both arms start a move together and end it together; the end that has further to go moves at `speed_mm_s`. The
    approach and leave poses are the first and last leaf's, moved along the work frame's y axis out of the block and up or
    down as they are to rise; the straight ways between them and the leaves are checked with the leaves.

    Parameters:
        cell: arms, tools, place of the block, limits.
        left_frames, right_frames: each (positions, tangents, normals) of the rod's start and end in the work frame, three
            arrays of shape (n, 3), mm, in cutting order, n ≥ 1.
        speed_mm_s: of the faster end, positive.
        approach_mm: how far before the first leaf the approach pose lies, towards −y, 0 or more.
        leave_mm: how far behind the last leaf the leave pose lies, towards +y, 0 or more.
        block: number of the block.
        rods: indices into the plan's rods, one per leaf.
        leaf_seconds: shape (n − 1,), times wanted for the moves between leaves, lengthened where a joint would be too fast;
            the speed rules where NaN, or all of None.
        approach_rise, leave_rise: by how much the approach and the leave pose lie higher, for each mm of `approach_mm` and
            `leave_mm`.
        keep_clear: what the arms' spins and configurations must stay clear of, first the left arm's, then the right arm's
            with regard to it; None leaves it out.

    Returns:
        The motion. Leaves that an arm cannot reach have NaN joints and margins, and the other leaves are planned as if
        these were not there; what breaks a limit shows in the margins (`batten.fabrication.checks.reach`).

    Raises:
        InvalidInputError: no leaves, shapes that do not agree, numbers that are not finite, a speed that is not positive.

    Accuracy: the joints reproduce the poses to 1e-6 mm. The spin is the best of a grid of 72.
    """
    if not (np.isfinite(speed_mm_s) and speed_mm_s > 0.0):
        raise InvalidInputError(f"speed_mm_s must be a finite number above 0; got {speed_mm_s}")
    for name, value in (("approach_mm", approach_mm), ("leave_mm", leave_mm)):
        if not (np.isfinite(value) and value >= 0.0):
            raise InvalidInputError(f"{name} must be a finite number, 0 or more; got {value}")
    leaves = {side: grip_poses(*frames, side) for side, frames in (("left", left_frames), ("right", right_frames))}
    n = len(rods)
    for side, poses in leaves.items():
        if poses.shape != (n, 4, 4) or n == 0:
            raise InvalidInputError(
                f"block {block}: {n} rods need (n, 3) frames with n = {n} ≥ 1; the {side} arm's have shape "
                f"{poses.shape[:-2]}"
            )
    if not (np.isfinite(approach_rise) and np.isfinite(leave_rise)):
        raise InvalidInputError(f"ways must rise by finite numbers; got {approach_rise} and {leave_rise}")
    before = np.outer(_stations(approach_mm)[:0:-1], [0.0, -1.0, approach_rise])
    after = np.outer(_stations(leave_mm)[1:], [0.0, 1.0, leave_rise])
    path = {side: _with_ways(poses, before, after) for side, poses in leaves.items()}
    moves = [np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1) for poses in path.values()]
    seconds = np.maximum(np.maximum(*moves) / speed_mm_s, 1e-9)
    between = slice(len(before), len(before) + n - 1)
    if leaf_seconds is not None:
        seconds[between] = np.where(np.isnan(leaf_seconds), seconds[between], leaf_seconds)
    may_turn = np.zeros(len(seconds), dtype=bool)
    may_turn[between] = True
    here = slice(len(before), len(before) + n)
    arms: dict[str, ArmMotion] = {}
    other: Capsules | None = None
    for side in ("left", "right"):
        clearance = None if keep_clear is None else _clearance(cell, side, keep_clear, other)
        arms[side], joints = _arm_motion(cell, cell.arm(side), path[side], seconds, may_turn, here, clearance)
        if keep_clear is not None:
            other = arm_in_work(cell, side, joints, keep_clear.gripper_radius_mm)
    planned = None if leaf_seconds is None else _possible_seconds(cell, arms, leaf_seconds)
    return BlockMotion(block, tuple(int(r) for r in rods), arms["left"], arms["right"], float(speed_mm_s), planned)


def _possible_seconds(cell: RobotCell, arms: dict[str, ArmMotion], wanted: FloatArray) -> FloatArray:
    """The wanted times, or the least that the joints' speeds allow; NaN stays, a leaf out of reach asks for nothing."""
    least = np.zeros(len(wanted))
    for side, arm in arms.items():
        allowed = cell.max_joint_speed_fraction * cell.arm(side).joint_speeds_rad_s
        least = np.fmax(least, (np.abs(np.diff(arm.joints_rad, axis=0)) / allowed).max(axis=1))
    return np.where(np.isnan(wanted), np.nan, np.maximum(wanted, least * (1.0 + 1e-9)))


def _stations(distance_mm: float) -> FloatArray:
    """Distances from the leaf at which a straight way of that length is looked at, from 0 to its end."""
    return np.linspace(0.0, distance_mm, 1 + int(np.ceil(distance_mm / _APPROACH_SAMPLE_MM)))


def _with_ways(leaves: FloatArray, before: FloatArray, after: FloatArray) -> FloatArray:
    """Leaf poses with the poses on the way in and out, (…, 3) from the first and the last leaf, all in the work frame."""
    way_in = np.repeat(leaves[:1], len(before), axis=0)
    way_in[:, :3, 3] += before
    way_out = np.repeat(leaves[-1:], len(after), axis=0)
    way_out[:, :3, 3] += after
    return np.concatenate([way_in, leaves, way_out])


def _clearance(cell: RobotCell, side: str, keep_clear: KeepClear, other: Capsules | None) -> Clearance:
    """Free distances of one arm's postures, given the other arm's capsules at the poses of the path."""

    def free(joints_rad: FloatArray, pose: IntArray) -> FloatArray:
        beside = None
        if other is not None:
            beside = Capsules(other.start[pose], other.end[pose], other.radius, other.names)
        return arm_clearance(cell, side, joints_rad, keep_clear.block_size_mm, keep_clear.gripper_radius_mm, beside)

    return free


def _arm_motion(
    cell: RobotCell,
    arm: RobotArm,
    path: FloatArray,
    seconds: FloatArray,
    may_turn: BoolArray,
    leaves: slice,
    clearance: Clearance | None,
) -> tuple[ArmMotion, FloatArray]:
    """What the arm does, and its joints at all poses of the path."""
    chosen = choose_spins(arm, cell.work_object @ path, seconds, may_turn, cell.spin_limits(), clearance)
    poses = spun(path, chosen.spin_rad)
    joints = chosen.joints_rad
    motion = ArmMotion(
        poses=poses[leaves],
        joints_rad=joints[leaves],
        spin_rad=chosen.spin_rad[leaves],
        reach_mm=chosen.reach_mm[leaves],
        joint_margin_rad=arm.joint_margin(joints)[leaves],
        singularity=arm.singularity(joints)[leaves],
        conditioning=arm.conditioning(joints[leaves]),
        approach=poses[0],
        leave=poses[-1],
        approach_joints_rad=joints[0],
        leave_joints_rad=joints[-1],
        configuration=arm.configuration(joints)[leaves],
    )
    return motion, joints
