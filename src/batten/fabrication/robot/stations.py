"""Where both arms are on their way from target to target, as the controller interpolates it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from batten.errors import InvalidInputError
from batten.fabrication.plan import ArmMotion, BlockMotion
from batten.fabrication.robot.arm import RobotArm
from batten.fabrication.robot.cell import RobotCell
from batten.typing import ArrayLike, FloatArray, IntArray

STEP_MM = 20.0
"""Greatest way of a rod's end between two stations."""
STEP_RAD = float(np.radians(3.0))
"""Greatest turn of a tool between two stations."""


class MotionStations(NamedTuple):
    """k stations on the moves of a block, the targets among them; targets: approach, n leaves, leave.

    `move` (k,): from target `move` to the next one, the last station on the last move. `share` (k,): how much of the move
    is done, 0 to 1. `left_joints_rad`, `right_joints_rad` (k, 6): NaN where an arm cannot follow.
    """

    move: IntArray
    share: FloatArray
    left_joints_rad: FloatArray
    right_joints_rad: FloatArray


def between_poses(start: ArrayLike, end: ArrayLike, share: ArrayLike) -> FloatArray:
    """Poses on a linear move: the position goes straight and evenly, the rotation evenly about one axis.

    So ABB's MoveL interpolates; of two ways round the shorter one is taken.

    Parameters:
        start, end: rigid poses (…, 4, 4) of one shape.
        share: shape (…), from 0 (start) to 1 (end).

    Returns:
        Shape (…, 4, 4).

    Example:
        >>> quarter = np.eye(4)
        >>> quarter[:2, :2] = [[0, -1], [1, 0]]
        >>> between_poses(np.eye(4), quarter, 0.5)[:2, 0].round(6).tolist()
        [0.707107, 0.707107]
    """
    a, b = np.broadcast_arrays(np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64))
    f = np.broadcast_to(np.asarray(share, dtype=np.float64), a.shape[:-2])
    first = Rotation.from_matrix(a[..., :3, :3].reshape(-1, 3, 3))
    turn = (first.inv() * Rotation.from_matrix(b[..., :3, :3].reshape(-1, 3, 3))).as_rotvec()
    out = a.copy()
    turned = first * Rotation.from_rotvec(f.reshape(-1, 1) * turn)
    out[..., :3, :3] = turned.as_matrix().reshape(out[..., :3, :3].shape)
    out[..., :3, 3] += f[..., None] * (b[..., :3, 3] - a[..., :3, 3])
    return out


def motion_stations(
    cell: RobotCell, motion: BlockMotion, *, step_mm: float = STEP_MM, step_rad: float = STEP_RAD
) -> MotionStations:
    """Stations on every move of both arms through a block, close enough for the steps given.

    Between targets both tools move linearly, as MoveL does, each to its own target in the same time; the joints are those
    of the branch that is nearest to the joints between the targets.

    Parameters:
        cell: that the motion was planned for.
        motion: with n ≥ 1 leaves.
        step_mm, step_rad: greatest way and turn of either tool between stations, above 0.

    Raises:
        InvalidInputError: a step that is not above 0.

    Accuracy: poses at the targets are met as well as the motion's joints meet them, others to 1e-6 mm.
    """
    if not (step_mm > 0.0 and step_rad > 0.0):
        raise InvalidInputError(f"steps must be above 0; got {step_mm} mm and {step_rad} rad")
    sides = [(motion.left, cell.left), (motion.right, cell.right)]
    poses = [target_poses(arm) for arm, _ in sides]
    steps = np.ones(len(poses[0]) - 1)
    for p in poses:
        way = np.linalg.norm(np.diff(p[:, :3, 3], axis=0), axis=1)
        cosine = 0.5 * (np.einsum("nij,nij->n", p[1:, :3, :3], p[:-1, :3, :3]) - 1.0)
        steps = np.maximum(steps, np.maximum(way / step_mm, np.arccos(np.clip(cosine, -1.0, 1.0)) / step_rad))
    counts = np.ceil(steps - 1e-9).astype(np.int64)
    move = np.append(np.repeat(np.arange(len(counts)), counts), len(counts) - 1)
    ahead = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    share = np.append(ahead / np.repeat(counts, counts), 1.0)
    joints = [
        _joints_between(robot, arm, cell.work_object @ between_poses(p[move], p[move + 1], share), move, share)
        for (arm, robot), p in zip(sides, poses)
    ]
    return MotionStations(move, share, joints[0], joints[1])


def target_poses(arm: ArmMotion) -> FloatArray:
    """The poses of approach, leaves and leave, (n + 2, 4, 4), in the work frame."""
    return np.concatenate([arm.approach[None], arm.poses, arm.leave[None]])


def _joints_between(
    robot: RobotArm, arm: ArmMotion, poses: FloatArray, move: IntArray, share: FloatArray
) -> FloatArray:
    """Joints for poses in the cell frame, on the branch nearest to the straight way between the targets' joints."""
    known = np.concatenate([arm.approach_joints_rad[None], arm.joints_rad, arm.leave_joints_rad[None]])
    guess = known[move] + share[:, None] * (known[move + 1] - known[move])
    at_target = (share == 0.0) | (share == 1.0)
    out = np.where(share[:, None] == 1.0, known[move + 1], known[move])
    some = np.flatnonzero(~at_target)
    if not some.size:
        return out
    found = robot.inverse(poses[some]).joints_rad
    off = found - guess[some, None]
    off -= 2.0 * np.pi * np.rint(off / (2.0 * np.pi))
    size = np.abs(off).max(axis=-1)
    size = np.where(np.isnan(size), np.inf, size)
    branch = size.argmin(axis=1)
    row = np.arange(len(some))
    out[some] = np.where(np.isinf(size[row, branch])[:, None], np.nan, guess[some] + off[row, branch])
    return out
