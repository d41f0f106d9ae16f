"""The free distances between arms, grippers, rod, block, table and floor while a block is cut."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from batten.errors import InvalidInputError
from batten.fabrication.collisions import Box, Capsules, least_clearance
from batten.fabrication.plan import BlockMotion
from batten.fabrication.robot.cell import RobotCell
from batten.fabrication.robot.links import GRIPPER, LINKS, arm_capsules, gripper_bend
from batten.fabrication.robot.stations import motion_stations
from batten.typing import ArrayLike, BoolArray, FloatArray, IntArray

ARM_CAPSULES = len(LINKS) + len(GRIPPER)
ROD_NAME = "rod"
_JAW = ARM_CAPSULES - 1
_HELD = (LINKS.index("wrist"), *range(len(LINKS), ARM_CAPSULES))  # what moves with the rod's end


class MotionClearance(NamedTuple):
    """For each of n leaves the least free distance on the move to it, at it and on the move from it.

    `distance_mm` (n,): negative where things overlap, NaN where an arm cannot get there. `pair`: the two names, n of them.
    """

    distance_mm: FloatArray
    pair: tuple[tuple[str, str], ...]


def motion_clearance(
    cell: RobotCell,
    motion: BlockMotion,
    block_size_mm: ArrayLike,
    rods_mm: ArrayLike,
    *,
    rod_radius_mm: float,
    gripper_radius_mm: float,
) -> MotionClearance:
    """The least free distance at each leaf of a block, ways in and out and stations between the leaves included.

    Looked at: both arms' links and grippers against the block, the table, the floor and each other; each jaw against its own
    arm from base to forearm (a straight gripper's to the elbow); the rod against the table, the floor and both arms. Not
    looked at: the rod in the block, which is its work; the half of the rod next to an arm against that arm's wrist and
    gripper, which hold it; neighbouring links.

    The block stands on the table, which reaches down to the floor (z = 0 of the cell) below it.

    Parameters:
        cell: arms, places, table.
        motion: with n leaves.
        block_size_mm: shape (3,), along the blade, across it, height.
        rods_mm: shape (n, m + 1, 3), points along the rods in the block's work frame, from the left end to the right.
        rod_radius_mm: half the rod's greatest thickness, and how far it lies off the chords between its points.
        gripper_radius_mm: of the grippers about their axes.

    Raises:
        InvalidInputError: rods that are not as many as the motion's.

    Accuracy: that of the capsules and boxes, at stations at most 20 mm and 3° apart: between two of them a distance can be
    less by half of what its two bodies move towards each other from one to the other. Between leaves the rod's points go
    straight from one leaf's shape to the next one's; the true elastica, midway in examples/freeform-wall, lies 0.1 mm
    beside that in the median and up to 5 mm where the rod turns fastest.
    """
    rods, size = np.asarray(rods_mm, dtype=np.float64), np.asarray(block_size_mm, dtype=np.float64)
    n = len(motion.rods)
    if rods.ndim != 3 or rods.shape[0] != n or rods.shape[1] < 2 or rods.shape[2] != 3 or size.shape != (3,):
        raise InvalidInputError(
            f"block {motion.block}: {n} leaves need rods (n, 2 or more, 3) and a block size (3,); got {rods.shape} and "
            f"{size.shape}"
        )
    at = motion_stations(cell, motion)
    way_in = motion.left.approach[:3, 3] - motion.left.poses[0, :3, 3]
    way_out = motion.left.leave[:3, 3] - motion.left.poses[-1, :3, 3]
    shapes = np.concatenate([rods[:1] + way_in, rods, rods[-1:] + way_out])
    points = shapes[at.move] + at.share[:, None, None] * (shapes[at.move + 1] - shapes[at.move])
    segments = points.shape[1] - 1
    bodies = Capsules.joined(
        (
            arm_in_work(cell, "left", at.left_joints_rad, gripper_radius_mm),
            arm_in_work(cell, "right", at.right_joints_rad, gripper_radius_mm),
            Capsules(points[:, :-1], points[:, 1:], np.full(segments, rod_radius_mm), (ROD_NAME,) * segments),
        )
    )
    boxes = surroundings(cell, size)
    found = least_clearance(bodies, _pairs(cell, segments), boxes, _against(segments))
    names = (*bodies.names, *(box.name for box in boxes))
    return _by_leaf(found.distance, at.move, [(names[i], names[j]) for i, j in zip(found.first, found.second)], n)


def arm_clearance(
    cell: RobotCell,
    side: str,
    joints_rad: FloatArray,
    block_size_mm: ArrayLike,
    gripper_radius_mm: float,
    other: Capsules | None = None,
) -> FloatArray:
    """The least free distance of one arm in many postures, as far as it depends on how the rod's end is reached.

    The same as in `motion_clearance`, without the rod, and without the jaw against what stands still or the other jaw:
    where a jaw is, the leaf says.

    Parameters:
        cell: arms, places, table.
        side: "left" or "right".
        joints_rad: shape (k, 6).
        block_size_mm: shape (3,), along the blade, across it, height.
        gripper_radius_mm: of the grippers about their axes.
        other: the other arm's capsules in the block's work frame, in as many poses; None leaves it out.

    Returns:
        Shape (k,), mm.
    """
    own = arm_in_work(cell, side, joints_rad, gripper_radius_mm)
    boxes = surroundings(cell, np.asarray(block_size_mm, dtype=np.float64))
    pairs = _jaw_pairs(cell, side)
    against = _against(0)[:ARM_CAPSULES]
    against[_JAW] = False
    if other is not None:
        pairs += [
            (i, ARM_CAPSULES + j)
            for i in range(ARM_CAPSULES)
            for j in range(len(other.names))
            if not (i == _JAW and j == _JAW)
        ]
        against = np.concatenate([against, np.zeros((len(other.names), len(boxes)), dtype=bool)])
        own = Capsules.joined((own, other))
    return least_clearance(own, np.array(pairs), boxes, against).distance


def arm_in_work(cell: RobotCell, side: str, joints_rad: FloatArray, gripper_radius_mm: float) -> Capsules:
    """One arm's capsules, `batten.fabrication.robot.links.arm_capsules`, in the block's work frame."""
    arm = cell.arm(side)
    return arm_capsules(
        arm.placed(base=_rigid_inverse(cell.work_object) @ arm.base), joints_rad, gripper_radius_mm, side
    )


def surroundings(cell: RobotCell, block_size_mm: FloatArray) -> tuple[Box, ...]:
    """Block, table and floor in the block's work frame."""
    half = 0.5 * block_size_mm[:2]
    top = 0.5 * np.asarray(cell.table_mm) if cell.table_mm is not None else half
    down = float(cell.work_object[2, 3])
    return (
        Box(np.append(-half, 0.0), np.append(half, block_size_mm[2]), "block"),
        Box(np.append(-top, min(-down, 0.0)), np.append(top, 0.0), "table"),
        Box(np.full(3, -np.inf), np.array([np.inf, np.inf, -down]), "floor"),
    )


def between_arms(cell: RobotCell, boxes: tuple[Box, ...]) -> tuple[IntArray, tuple[Box, ...], BoolArray]:
    """What `least_clearance` is to look at for both arms, left before right, with no rod between them."""
    return _pairs(cell, 0), boxes, _against(0)


def _rigid_inverse(pose: FloatArray) -> FloatArray:
    out = np.eye(4)
    out[:3, :3] = pose[:3, :3].T
    out[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return out


def _pairs(cell: RobotCell, segments: int) -> IntArray:
    """Which capsules must stay clear of which: left arm, right arm, then the rod's segments from left to right."""
    pairs = [(i, ARM_CAPSULES + j) for i in range(ARM_CAPSULES) for j in range(ARM_CAPSULES)]
    near_left, near_right = range(segments // 2), range((segments + 1) // 2, segments)
    for first, side, near in ((0, "left", near_left), (ARM_CAPSULES, "right", near_right)):
        pairs += [(first + i, first + j) for i, j in _jaw_pairs(cell, side)]
        pairs += [
            (first + k, 2 * ARM_CAPSULES + s)
            for k in range(ARM_CAPSULES)
            for s in range(segments)
            if not (k in _HELD and s in near)
        ]
    return np.array(pairs, dtype=np.int64)


def _jaw_pairs(cell: RobotCell, side: str) -> list[tuple[int, int]]:
    """The jaw against its own arm; a straight gripper's begins at the wrist, too near to the forearm to tell anything."""
    links = LINKS[:-1] if gripper_bend(cell.arm(side).tool).any() else LINKS[:-2]
    return [(_JAW, LINKS.index(link)) for link in links]


def _against(segments: int) -> BoolArray:
    """Which capsules must stay clear of block, table and floor."""
    against = np.ones((2 * ARM_CAPSULES + segments, 3), dtype=bool)
    against[2 * ARM_CAPSULES :, 0] = False
    for first in (0, ARM_CAPSULES):
        against[[first + LINKS.index("base"), first + LINKS.index("shoulder")], 2] = False
    return against


def _by_leaf(distance: FloatArray, move: IntArray, pairs: list[tuple[str, str]], n: int) -> MotionClearance:
    """The least over the two moves next to each leaf; a station at a target begins the next move and counts for both."""
    least = np.full(n, np.nan)
    where = np.full(n, -1)
    starts = np.flatnonzero(np.r_[True, np.diff(move) > 0])
    for leaf in range(n):
        first, last = starts[leaf], starts[leaf + 2] if leaf + 2 < len(starts) else len(move) - 1
        part = distance[first : last + 1]
        if np.isfinite(part).any():
            k = int(np.nanargmin(part))
            least[leaf], where[leaf] = part[k], first + k
    return MotionClearance(least, tuple(pairs[k] if k >= 0 else ("", "") for k in where))
