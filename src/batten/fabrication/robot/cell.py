"""Two arms, a table between them, and what they must keep.

The *cell frame* is the workshop's own, in mm: z up from the floor. The block stands on a table at a fixed place, so its
work frame (origin at the centre of the block's bottom face, x along the blade from the left arm to the right arm, y the
way the blade is swept, z up) has a fixed pose in the cell. In ABB's words the cell frame is the controller's world frame
and the work frame is the work object.

The grip. The tool centre point is the rod's end; its z axis points along the rod, out of the gripper and into the rod:
for the left arm along the rod's tangent, for the right arm against it. At spin 0 its x axis is the normal of the rod's
plane. A round rod leaves the spin about z free; a flat strip stays at spin 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from batten.errors import InvalidInputError
from batten.fabrication.job import ArmJob, CellJob
from batten.fabrication.robot.arm import RobotArm, arm_preset, rigid_pose
from batten.fabrication.robot.spin_choice import SpinLimits
from batten.typing import ArrayLike, FloatArray


@dataclass(frozen=True, eq=False)
class RobotCell:
    """Two arms that hold the two ends of a rod, and the place of the block between them.

    Parameters:
        left, right: the arms at the rod's start and end; their `base` is in the cell frame, their `tool` ends where the
            rod begins.
        work_object: (4, 4), the block's work frame in the cell frame, mm.
        min_joint_margin_rad: least distance of every joint from its limits.
        min_reach_mm: least distance of the wrist centre from the end of its reach.
        min_singularity: least distance from a singularity (`RobotArm.singularity`), from 0 (singular) to 1.
        min_conditioning: least singular value of the Jacobian (`RobotArm.conditioning`): reported, not enforced.
        max_joint_speed_fraction: greatest share of a joint's rated speed.
        max_joint_step_rad: greatest turn of a joint between successive leaves.
        tool_mass_kg, tool_centre_mm: the gripper's mass, and its centre of mass in the flange frame, shape (3,).
        rod_is_round: whether the rod may turn about its own axis; a flat strip stays at spin 0, its width across the
            plane of bending.
        min_clearance_mm: least free distance between arms, grippers, rod, block, table and floor.
        table_mm: plan size of the table, along the blade and across it, centred under the block; None: the block's own.

    Raises:
        InvalidInputError: a limit that is negative or not finite, a share outside (0, 1], a pose that is not rigid.

    Example:
        >>> cell_preset("two-irb6620").work_object[:3, 3].tolist()
        [0.0, 0.0, 600.0]
    """

    left: RobotArm
    right: RobotArm
    work_object: FloatArray
    min_joint_margin_rad: float = float(np.radians(5.0))
    min_reach_mm: float = 20.0
    min_singularity: float = 0.05
    min_conditioning: float = 0.02
    max_joint_speed_fraction: float = 0.5
    max_joint_step_rad: float = float(np.radians(20.0))
    tool_mass_kg: float = 10.0
    tool_centre_mm: tuple[float, float, float] = (0.0, 0.0, 100.0)
    rod_is_round: bool = True
    min_clearance_mm: float = 10.0
    table_mm: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "work_object", rigid_pose("work_object", self.work_object))
        for name in ("min_joint_margin_rad", "min_reach_mm", "min_singularity", "min_conditioning", "min_clearance_mm"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                raise InvalidInputError(f"{name} must be a finite number, 0 or more; got {value}")
        for name in ("max_joint_step_rad", "tool_mass_kg"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise InvalidInputError(f"{name} must be a finite number above 0; got {value}")
        if not 0.0 < self.max_joint_speed_fraction <= 1.0:
            raise InvalidInputError(f"max_joint_speed_fraction must lie in (0, 1]; got {self.max_joint_speed_fraction}")
        if len(self.tool_centre_mm) != 3 or not np.isfinite(self.tool_centre_mm).all():
            raise InvalidInputError(f"tool_centre_mm needs three finite numbers; got {self.tool_centre_mm}")

    def arm(self, side: str) -> RobotArm:
        """The "left" or the "right" arm."""
        return self.left if side == "left" else self.right

    def spin_limits(self) -> SpinLimits:
        """The limits as units for the margins of `choose_spins`: a limit of 0 is measured in a small unit of its own."""
        limits = SpinLimits(
            joint_margin_rad=max(self.min_joint_margin_rad, float(np.radians(1.0))),
            reach_mm=max(self.min_reach_mm, 1.0),
            singularity=max(self.min_singularity, 0.01),
            joint_step_rad=self.max_joint_step_rad,
            joint_speed_fraction=self.max_joint_speed_fraction,
            clearance_mm=max(self.min_clearance_mm, 1.0),
        )
        return limits if self.rod_is_round else replace(limits, spins=1, window=0)


def pose_from_xyz(position_mm: ArrayLike, angles_deg: ArrayLike = (0.0, 0.0, 0.0)) -> FloatArray:
    """A 4 × 4 pose from a position and turns about the *fixed* x, then y, then z axis.

    Parameters:
        position_mm: shape (3,), mm.
        angles_deg: shape (3,), degrees, counter-clockwise.

    Raises:
        InvalidInputError: numbers that are not finite or not three.

    Example:
        >>> pose_from_xyz((1, 2, 3), (0, 0, 90))[:3, 0].round(12).tolist()
        [0.0, 1.0, 0.0]
    """
    p = np.asarray(position_mm, dtype=np.float64)
    a = np.radians(np.asarray(angles_deg, dtype=np.float64))
    if p.shape != (3,) or a.shape != (3,) or not (np.isfinite(p).all() and np.isfinite(a).all()):
        raise InvalidInputError(
            f"a pose needs three finite lengths in mm and three finite angles in degrees; got {position_mm!r} and "
            f"{angles_deg!r}"
        )
    (cx, cy, cz), (sx, sy, sz) = np.cos(a), np.sin(a)
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
    about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    about_z = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
    pose = np.eye(4)
    pose[:3, :3] = about_z @ about_y @ about_x
    pose[:3, 3] = p
    return pose


def _bent_gripper(bend_deg: float, neck_mm: float, jaw_mm: float) -> FloatArray:
    """A gripper whose jaw is bent away from the flange's axis: `neck_mm` straight out, a bend, `jaw_mm` to the rod's end.

    The bend is what makes the free spin worth having: with a straight gripper it would turn axis 6 and nothing else.
    """
    pose = pose_from_xyz((0.0, 0.0, neck_mm), (0.0, bend_deg, 0.0))
    pose[:3, 3] += jaw_mm * pose[:3, 2]
    return pose


def _two_irb6620() -> RobotCell:
    """Bases on plinths 500 mm high, 4.6 m apart, facing each other; table top 600 mm above the floor between them.

    Found by a search over base distance, table height and gripper for the greatest least margin over the envelope of rod
    ends x = ±(350 … 520), y = ±450, z = 100 … 1200 mm, tangents tilted by up to 60°, planes turned by up to 20°: joints stay
    35° from their limits and from a straight wrist, on one configuration throughout.
    """
    arm = arm_preset("irb-6620-150-2.2")
    tool = _bent_gripper(70.0, 150.0, 200.0)
    return RobotCell(
        left=arm.placed(base=pose_from_xyz((-2300.0, 0.0, 500.0)), tool=tool),
        right=arm.placed(base=pose_from_xyz((2300.0, 0.0, 500.0), (0.0, 0.0, 180.0)), tool=tool),
        work_object=pose_from_xyz((0.0, 0.0, 600.0)),
    )


def cell_preset(name: str) -> RobotCell:
    """A robot cell by name.

    Parameters:
        name: "two-irb6620": two ABB IRB 6620-150/2.2 that face each other over a table.

    Raises:
        InvalidInputError: no such cell.
    """
    if name != "two-irb6620":
        raise InvalidInputError(f"no cell is called {name!r}; there is two-irb6620. Own values go over it")
    return _two_irb6620()


def cell_from_job(job: CellJob) -> RobotCell:
    """The cell that a job describes: a preset, with the job's own values over it.

    Parameters:
        job: lengths in mm, angles in degrees (see `batten.fabrication.job.CellJob`).

    Raises:
        InvalidInputError: an unknown preset, or a value that no cell can have.

    Example:
        >>> cell = cell_from_job(CellJob(block_mm=(0.0, 100.0, 550.0)))
        >>> cell.work_object[:3, 3].tolist()
        [0.0, 100.0, 550.0]
    """
    preset = cell_preset(job.preset)
    place = preset.work_object
    if job.block_mm is not None or job.block_deg is not None:
        turned = pose_from_xyz(place[:3, 3] if job.block_mm is None else job.block_mm, (0.0, 0.0, job.block_deg or 0.0))
        if job.block_deg is None:
            turned[:3, :3] = place[:3, :3]
        place = turned
    return replace(
        preset,
        left=_arm_from_job(preset.left, job.left, "left arm"),
        right=_arm_from_job(preset.right, job.right, "right arm"),
        work_object=place,
        min_joint_margin_rad=float(np.radians(job.min_joint_margin_deg)),
        min_reach_mm=float(job.min_reach_margin_mm),
        min_singularity=float(job.min_singularity),
        min_clearance_mm=float(job.min_clearance_mm),
        table_mm=job.table_mm,
    )


def _pose_over(preset: FloatArray, position: ArrayLike | None, angles: ArrayLike | None) -> FloatArray:
    """A preset's pose, with the position, the angles or both replaced."""
    pose = pose_from_xyz(preset[:3, 3] if position is None else position, (0.0, 0.0, 0.0) if angles is None else angles)
    if angles is None:
        pose[:3, :3] = preset[:3, :3]
    return pose


def _arm_from_job(preset: RobotArm, job: ArmJob, who: str) -> RobotArm:
    limits = np.array(preset.joint_limits_rad)
    for column, angles in ((0, job.joint_min_deg), (1, job.joint_max_deg)):
        if angles is not None:
            if len(angles) != 6:
                raise InvalidInputError(f"{who}: six joint angles are needed, in degrees; got {angles!r}")
            limits[:, column] = np.radians(angles)
    arm = replace(
        preset,
        joint_limits_rad=limits,
        base=_pose_over(preset.base, job.base_mm, job.base_deg),
        tool=_pose_over(preset.tool, job.tool_mm, job.tool_deg),
        link_radii_mm=preset.link_radii_mm if job.link_radii_mm is None else np.array(job.link_radii_mm),
    )
    if job.kinematics is None:
        return arm
    k = job.kinematics
    if any(sign not in (-1, 1) for sign in k.signs):
        raise InvalidInputError(f"{who}: signs must be 1 or -1; got {k.signs!r}")
    return replace(
        arm,
        name=who,
        dimensions_mm=np.array([k.a1_mm, k.a2_mm, k.b_mm, k.c1_mm, k.c2_mm, k.c3_mm, k.c4_mm]),
        joint_offsets_rad=np.radians(k.offsets_deg),
        flip_axes=tuple(sign < 0 for sign in k.signs),
    )
