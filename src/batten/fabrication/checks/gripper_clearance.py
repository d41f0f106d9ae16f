"""Whether the grippers stay clear of the block."""

from __future__ import annotations

from batten.fabrication.checks.context import CheckContext
from batten.fabrication.collisions import box_distance
from batten.fabrication.plan import CheckResult


def gripper_clearance_check(context: CheckContext) -> CheckResult:
    """Free distance (mm) between the block and balls of `gripper.radius_mm` about both ends of the rod.

    The block is the box it is sawn from, in its place; the lesser of the two distances counts. Exact for that model.
    """
    gripper = context.job.gripper
    ends = context.points[:, [0, -1]]
    free = box_distance(ends, context.box_low[:, None], context.box_high[:, None]).min(axis=1) - gripper.radius_mm
    return CheckResult(
        "gripper_clearance",
        "Free distance of the grippers from the block",
        "mm",
        gripper.clearance_mm,
        "min",
        free,
        f"A ball of {gripper.radius_mm:g} mm about the rod's end stands for the whole gripper.",
    )
