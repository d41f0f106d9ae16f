"""Capsules around an arm's links and its gripper, from the arm's lengths and joints.

The axes of the six links follow the closed form of the ortho-parallel basis (Brandstötter, Angerer and Hofbaur 2014; the
lengths in `RobotArm`): in the arm's own plane, turned by θ₁ about the base's z axis, axis 2 lies a1 ahead and c1 up, the
upper arm runs c2 along (sin θ₂, cos θ₂), the elbow a2 along (cos φ, −sin φ) and the forearm c3 along (sin φ, cos φ) with
φ = θ₂ + θ₃; the wrist goes c4 along the flange's axis.

The gripper's axis leaves the flange along the flange's z and reaches the rod's end along the tool's z: where these two
lines meet it bends once, as a gripper does that is bent in one plane.
"""

from __future__ import annotations

import numpy as np

from batten.fabrication.collisions import Capsules
from batten.fabrication.robot.arm import RobotArm
from batten.typing import ArrayLike, FloatArray

LINKS = ("base", "shoulder", "upper arm", "elbow", "forearm", "wrist")
"""Names of the capsules of an arm, in the order of `RobotArm.link_radii_mm`."""
GRIPPER = ("gripper neck", "gripper jaw")


def link_points(arm: RobotArm, joints_rad: ArrayLike) -> FloatArray:
    """The points that join the links: base, axis 1 at the height of axis 2, axis 2, axis 3, axis 4, wrist centre, flange.

    Parameters:
        arm: its lengths and place.
        joints_rad: shape (…, 6).

    Returns:
        Shape (…, 7, 3), in the cell frame, mm; NaN for joints that are NaN.

    Accuracy: 1e-9 mm for an arm of a few metres.

    Example:
        >>> from batten.fabrication.robot.arm import arm_preset
        >>> link_points(arm_preset("irb-6620-150-2.2"), np.zeros(6))[:, 2].round(6).tolist()
        [0.0, 680.0, 680.0, 1655.0, 1855.0, 1855.0, 1855.0]
    """
    q = np.asarray(joints_rad, dtype=np.float64)
    a1, a2, b, c1, c2, c3, _ = arm.dimensions_mm
    sign = np.where(arm.flip_axes, -1.0, 1.0)
    theta = sign * q - arm.joint_offsets_rad
    bend, turn = theta[..., 1], theta[..., 1] + theta[..., 2]
    zero = np.zeros_like(bend)
    ahead = np.cumsum([zero, zero, zero + a1, c2 * np.sin(bend), a2 * np.cos(turn), c3 * np.sin(turn)], axis=0)
    up = np.cumsum([zero, zero + c1, zero, c2 * np.cos(bend), -a2 * np.sin(turn), c3 * np.cos(turn)], axis=0)
    side = np.stack([zero, zero, zero + b, zero + b, zero + b, zero + b])
    cos, sin = np.cos(theta[..., 0]), np.sin(theta[..., 0])
    points = np.empty((*q.shape[:-1], 7, 3))
    points[..., :6, :] = np.moveaxis(np.stack([cos * ahead - sin * side, sin * ahead + cos * side, up], axis=-1), 0, -2)
    points[..., :6, :] = points[..., :6, :] @ arm.base[:3, :3].T + arm.base[:3, 3]
    points[..., 6, :] = (arm.forward(q) @ np.linalg.inv(arm.tool))[..., :3, 3]
    known = np.asarray(np.isfinite(q).all(axis=-1))
    return np.where(known[..., None, None], points, np.nan)


def gripper_bend(tool: ArrayLike) -> FloatArray:
    """Where the gripper's axis bends, in the flange frame, shape (3,), mm.

    The point of the flange's z axis that is nearest to the line of the rod behind its end. Where that lies behind the
    flange, or ahead of the rod's end, or the lines are parallel, the gripper is taken as straight: the flange itself.

    Parameters:
        tool: (4, 4), the rod's end in the flange frame; its z axis points into the rod.

    Example:
        >>> tool = np.eye(4)
        >>> tool[:3, :3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
        >>> tool[:3, 3] = 200.0, 0.0, 150.0
        >>> gripper_bend(tool).tolist()
        [0.0, 0.0, 150.0]
    """
    pose = np.asarray(tool, dtype=np.float64)
    end, into = pose[:3, 3], pose[:3, 2]
    across = 1.0 - into[2] ** 2
    if across < 1e-6:
        return np.zeros(3)
    # least distance between z·e₃ and end − back·into
    along = float(end @ into)
    out, back = (end[2] - along * into[2]) / across, (along - end[2] * into[2]) / across
    return np.array([0.0, 0.0, out]) if out > 0.0 and back > 0.0 else np.zeros(3)


def arm_capsules(arm: RobotArm, joints_rad: ArrayLike, gripper_radius_mm: float, name: str) -> Capsules:
    """The capsules of an arm's six links, and of its gripper's neck and jaw.

    Parameters:
        arm: its lengths, radii, place and tool.
        joints_rad: shape (k, 6).
        gripper_radius_mm: of the gripper about its axis, the ball around the rod's end included.
        name: "left" or "right", the first word of the capsules' names.

    Returns:
        Eight capsules in k poses, in the cell frame, mm. A straight gripper has a neck of no length.
    """
    q = np.asarray(joints_rad, dtype=np.float64).reshape(-1, 6)
    points = link_points(arm, q)
    end = arm.forward(q)
    flange = end @ np.linalg.inv(arm.tool)
    bend = flange[:, :3, :3] @ gripper_bend(arm.tool) + flange[:, :3, 3]
    chain = np.concatenate([points, bend[:, None], end[:, None, :3, 3]], axis=1)
    return Capsules(
        chain[:, :-1],
        chain[:, 1:],
        np.concatenate([arm.link_radii_mm, np.full(2, float(gripper_radius_mm))]),
        tuple(f"{name} {part}" for part in (*LINKS, *GRIPPER)),
    )
