"""How the arms get from one block to the next, each by itself and with an empty gripper.

From the leave pose, the rod taken out, an arm pulls back: the upper arm leans away from the block, the forearm rises. From
there it goes to where it would be if it were to pull back from the next block's approach pose, and from there to that pose;
all three with the joints in even proportion, as MoveAbsJ does. Straight from the leave pose to the next approach pose it
would pass through the block.
"""

from __future__ import annotations

import numpy as np

from batten.fabrication.collisions import Capsules, least_clearance
from batten.fabrication.plan import BlockMotion
from batten.fabrication.robot.arm import RobotArm
from batten.fabrication.robot.cell import RobotCell
from batten.fabrication.robot.motion_clearance import arm_in_work, between_arms, surroundings
from batten.typing import ArrayLike, FloatArray

LEAN_RAD = float(np.radians(40.0))
"""How far the upper arm leans back."""
RISE_RAD = float(np.radians(20.0))
"""How much less the forearm leans back with it."""

_STATIONS = 41


def pulled_back(arm: RobotArm, joints_rad: ArrayLike) -> FloatArray:
    """The posture of an arm that pulls back from where it is: θ₂ less by 40°, θ₃ more by 20°, the wrist as it was.

    Parameters:
        arm: whose limits hold.
        joints_rad: shape (…, 6).

    Returns:
        Shape (…, 6), kept within the joints' limits.

    Example:
        >>> from batten.fabrication.robot.arm import arm_preset
        >>> np.degrees(pulled_back(arm_preset("irb-6620-150-2.2"), np.radians([0.0, 50.0, 10.0, 0.0, 0.0, 0.0]))).round(6)
        array([ 0., 10., 30.,  0.,  0.,  0.])
    """
    out = np.array(joints_rad, dtype=np.float64)
    sign = np.where(arm.flip_axes, -1.0, 1.0)
    out[..., 1] -= sign[1] * LEAN_RAD
    out[..., 2] += sign[2] * RISE_RAD
    return np.clip(out, arm.joint_limits_rad[:, 0], arm.joint_limits_rad[:, 1])


def travel_clearance(
    cell: RobotCell,
    before: BlockMotion | None,
    motion: BlockMotion,
    size_before_mm: ArrayLike | None,
    size_mm: ArrayLike,
    gripper_radius_mm: float,
) -> tuple[float, tuple[str, str]]:
    """The least free distance on the way from one block to the next, and the pair that has it.

    The block that was cut stands there until both arms have pulled back, and the next one from then on; in between, a box
    as large as both. Arms and grippers against block, table, floor and each other.

    Parameters:
        cell: arms, places, table.
        before: what was cut before; None leaves out the ways from it, which nobody knows then.
        motion: what is cut next.
        size_before_mm, size_mm: (3,), both blocks along the blade, across it, and their heights.
        gripper_radius_mm: of the grippers about their axes.

    Returns:
        Distance in mm, NaN where an arm cannot get to an approach or leave pose, and two names.

    Accuracy: at 41 stations on each of the three ways. The arms need not go at the same pace; against each other they are
    looked at as if they did.
    """
    size = np.asarray(size_mm, dtype=np.float64)
    arms = (cell.left, cell.right)
    start = [motion.left.approach_joints_rad, motion.right.approach_joints_rad]
    back = [pulled_back(arm, q) for arm, q in zip(arms, start)]
    ways = [(back, start, size)]
    if before is not None and size_before_mm is not None:
        cut = np.asarray(size_before_mm, dtype=np.float64)
        end = [before.left.leave_joints_rad, before.right.leave_joints_rad]
        away = [pulled_back(arm, q) for arm, q in zip(arms, end)]
        ways = [(end, away, cut), (away, back, np.maximum(size, cut)), *ways]
    best, pair = np.inf, ("", "")
    for first, last, block in ways:
        share = np.linspace(0.0, 1.0, _STATIONS)[:, None]
        bodies = Capsules.joined(
            tuple(
                arm_in_work(cell, side, a + share * (b - a), gripper_radius_mm)
                for side, a, b in zip(("left", "right"), first, last)
            )
        )
        boxes = surroundings(cell, block)
        found = least_clearance(bodies, *between_arms(cell, boxes))
        if not np.isfinite(found.distance).all():
            return float("nan"), ("", "")
        k = int(found.distance.argmin())
        if found.distance[k] < best:
            names = (*bodies.names, *(box.name for box in boxes))
            best, pair = float(found.distance[k]), (names[found.first[k]], names[found.second[k]])
    return best, pair
