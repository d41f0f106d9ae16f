"""From gripper frames to the synchronous motion of two arms through one block."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from batten.errors import InvalidInputError
from batten.fabrication.plan import ArmMotion, BlockMotion
from batten.fabrication.robot.arm import RobotArm
from batten.fabrication.robot.cell import RobotCell
from batten.fabrication.robot.spin_choice import choose_spins, spun
from batten.typing import ArrayLike, BoolArray, FloatArray

Frames: TypeAlias = tuple[ArrayLike, ArrayLike, ArrayLike]

_APPROACH_SAMPLE_MM = 50.0


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
) -> BlockMotion:
    """The motion of both arms for one block: the rod's spin and both arms' configurations chosen for the best margins.

    Both arms start a move together and end it together; the end that has further to go moves at `speed_mm_s`. The
    approach and leave poses are the first and last leaf's, moved along the work frame's y axis out of the block; the
    straight ways between them and the leaves are checked with the leaves.

    Parameters:
        cell: arms, tools, place of the block, limits.
        left_frames, right_frames: each (positions, tangents, normals) of the rod's start and end in the work frame, three
            arrays of shape (n, 3), mm, in cutting order, n ≥ 1.
        speed_mm_s: of the faster end, positive.
        approach_mm: how far before the first leaf the approach pose lies, towards −y, 0 or more.
        leave_mm: how far behind the last leaf the leave pose lies, towards +y, 0 or more.
        block: number of the block.
        rods: indices into the plan's rods, one per leaf.

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
    before = _stations(approach_mm)[:0:-1]
    after = _stations(leave_mm)[1:]
    path = {side: _with_ways(poses, before, after) for side, poses in leaves.items()}
    moves = [np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1) for poses in path.values()]
    seconds = np.maximum(np.maximum(*moves) / speed_mm_s, 1e-9)
    may_turn = np.zeros(len(seconds), dtype=bool)
    may_turn[len(before) : len(before) + n - 1] = True
    arms = {
        side: _arm_motion(cell, cell.arm(side), path[side], seconds, may_turn, slice(len(before), len(before) + n))
        for side in path
    }
    return BlockMotion(block, tuple(int(r) for r in rods), arms["left"], arms["right"], float(speed_mm_s))


def _stations(distance_mm: float) -> FloatArray:
    """Distances from the leaf at which a straight way of that length is looked at, from 0 to its end."""
    return np.linspace(0.0, distance_mm, 1 + int(np.ceil(distance_mm / _APPROACH_SAMPLE_MM)))


def _with_ways(leaves: FloatArray, before: FloatArray, after: FloatArray) -> FloatArray:
    """Leaf poses with the poses on the way in and out, all in the work frame."""
    way_in = np.repeat(leaves[:1], len(before), axis=0)
    way_in[:, 1, 3] -= before
    way_out = np.repeat(leaves[-1:], len(after), axis=0)
    way_out[:, 1, 3] += after
    return np.concatenate([way_in, leaves, way_out])


def _arm_motion(
    cell: RobotCell, arm: RobotArm, path: FloatArray, seconds: FloatArray, may_turn: BoolArray, leaves: slice
) -> ArmMotion:
    chosen = choose_spins(arm, cell.work_object @ path, seconds, may_turn, cell.spin_limits())
    poses = spun(path, chosen.spin_rad)
    joints = chosen.joints_rad
    return ArmMotion(
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
