"""What a cut consists of: blocks, rods in their planes, checks. Plain data that every later step reads.

Frames. The *wall frame* is the design's own, in mm: x and y in plan, z up. Every block also has a *work frame*, in which
the robots see it: origin at the centre of the block's bottom face, x along the blade (from the left arm to the right
arm), y the way the blade is swept, z up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from batten.curves.elastica import Elastica, states_along
from batten.surfaces.plane import Plane
from batten.typing import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Block:
    """One foam block: an axis-parallel box in the wall frame.

    `number` counts from 1; `row` counts across the blade (the way it is swept), `column` along the blade, both from 0.
    `corner_mm` is the corner of least x, y, z; `size_mm` the three edge lengths, both shape (3,).
    """

    number: int
    row: int
    column: int
    corner_mm: FloatArray
    size_mm: FloatArray

    def work_frame(self, blade_axis: Literal["x", "y"]) -> FloatArray:
        """The 4 × 4 pose of the block's work frame in the wall frame (see the module's first lines)."""
        pose = np.eye(4)
        if blade_axis == "y":  # x_work = +y_wall, y_work = −x_wall
            pose[:3, :3] = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        pose[:3, 3] = self.corner_mm + self.size_mm * np.array([0.5, 0.5, 0.0])
        return pose


@dataclass(frozen=True, eq=False)
class GripperFrame:
    """Where one gripper holds the rod, in the wall frame: what the papers hand to the robot (Fisker2018 §5.3).

    `position_mm` is the rod's end; `tangent` the unit tangent there, from the left end to the right end of the rod for
    *both* grippers; `normal` the unit normal of the rod's plane (the way the blade is swept). All shape (3,).
    """

    position_mm: FloatArray
    tangent: FloatArray
    normal: FloatArray


@dataclass(frozen=True, eq=False)
class RodPlacement:
    """One rod in one block: the blade's position for one leaf.

    Attributes:
        block: number of the block.
        leaf: number of the leaf (counts from 1 over the whole wall; a leaf crosses all the blocks of a row).
        plane: the leaf's plane in the wall frame, `x_axis` along the blade.
        design: points of the wanted curve in `plane`, shape (n, 2), mm, from left to right, within the block.
        piece: the elastica within the block, in the coordinates of `plane`, mm.
        rod: the same elastica extended to the rod's length.
        before_mm: how much of the rod lies before the piece.
        repair: what was done to make it fit, in words; empty if nothing.
        status: "ok", or "refused": left out of the robot program.
        reasons: why it was refused.
    """

    block: int
    leaf: int
    plane: Plane
    design: FloatArray
    piece: Elastica
    rod: Elastica
    before_mm: float
    repair: tuple[str, ...] = ()
    status: Literal["ok", "refused"] = "ok"
    reasons: tuple[str, ...] = ()

    def grippers(self) -> tuple[GripperFrame, GripperFrame]:
        """The frames of the left and the right gripper, at the rod's start and end; for many rods: `gripper_frames`."""
        frames = gripper_frames((self,))
        (left, right), (from_left, from_right), normal = frames.positions_mm[0], frames.tangents[0], frames.normals[0]
        return GripperFrame(left, from_left, normal), GripperFrame(right, from_right, normal)


class GripperFrames(NamedTuple):
    """The frames of both grippers of n rods in the wall frame (see `GripperFrame`), left and right along the second axis.

    `positions_mm` and `tangents` (n, 2, 3); `normals` (n, 3), the same for both.
    """

    positions_mm: FloatArray
    tangents: FloatArray
    normals: FloatArray


def gripper_frames(rods: Sequence[RodPlacement]) -> GripperFrames:
    """`RodPlacement.grippers` for many rods at once.

    Parameters:
        rods: n of them, in any blocks.

    Accuracy: that of the elastica, 1e-12 of the rod's length.
    """
    parameters = np.array([r.rod.parameters for r in rods]).reshape(-1, 7)
    origin, x_axis, y_axis = (
        np.array([getattr(r.plane, name) for r in rods]).reshape(-1, 1, 3) for name in ("origin", "x_axis", "y_axis")
    )
    x, y, angle = np.moveaxis(states_along(parameters, parameters[:, 6:] * [0.0, 1.0])[..., :3, None], 2, 0)
    return GripperFrames(
        origin + x * x_axis + y * y_axis,
        np.cos(angle) * x_axis + np.sin(angle) * y_axis,
        -np.cross(x_axis, y_axis)[:, 0],
    )


@dataclass(frozen=True, eq=False)
class CheckResult:
    """One check over all rods of a plan.

    Attributes:
        name: stem of the check's file, for example "strain".
        title: for people, for example "Strain on the whole rod".
        unit: of the values; "" for pure numbers.
        limit: the bound.
        sense: "max" if values must stay at or below the limit, "min" if at or above it.
        values: shape (number of rods,), the worst value for each rod; NaN where the check does not apply.
        note: what was assumed, in one sentence.
        hard: a broken hard check refuses the leaf; a soft one is reported only.
    """

    name: str
    title: str
    unit: str
    limit: float
    sense: Literal["max", "min"]
    values: FloatArray
    note: str = ""
    hard: bool = True

    @property
    def margins(self) -> FloatArray:
        """How far each value is on the good side of the limit, in the check's unit; negative where it is broken."""
        return self.limit - self.values if self.sense == "max" else self.values - self.limit

    @property
    def passed(self) -> BoolArray:
        """Per rod; a check that does not apply passes."""
        return ~(self.margins < 0.0)

    @property
    def worst(self) -> int:
        """Index of the rod with the least margin, −1 if the check applies to none."""
        m = self.margins
        known = np.flatnonzero(~np.isnan(m))  # nanargmin would take NaN for the greatest, infinity
        return int(known[m[known].argmin()]) if known.size else -1


@dataclass(frozen=True, eq=False)
class ArmMotion:
    """What one arm does in one block.

    `poses`: (n, 4, 4), the tool centre point in the block's work frame, one per rod in cutting order (approach and leave
    poses are not among them). `joints_rad`: (n, 6). `spin_rad`: (n,), the chosen rotation about the blade's axis.
    `reach_mm`, `joint_margin_rad`, `singularity` (0 at a singularity, at most 1), `conditioning` (the least singular
    value of the Jacobian): (n,), the margins that were achieved; negative or NaN where the pose cannot be reached.
    `approach`, `leave`: (4, 4) poses outside the block, with `approach_joints_rad`, `leave_joints_rad` (6,).
    `configuration`: ABB's [cf1, cf4, cf6, cfx] for every pose, shape (n, 4), integers.
    """

    poses: FloatArray
    joints_rad: FloatArray
    spin_rad: FloatArray
    reach_mm: FloatArray
    joint_margin_rad: FloatArray
    singularity: FloatArray
    conditioning: FloatArray
    approach: FloatArray
    leave: FloatArray
    approach_joints_rad: FloatArray
    leave_joints_rad: FloatArray
    configuration: IntArray


@dataclass(frozen=True, eq=False)
class BlockMotion:
    """The synchronous motion of both arms for one block.

    Attributes:
        block: number of the block.
        rods: indices into the plan's rods, in cutting order.
        left, right: what each arm does.
        speed_mm_s: of the rod's faster end on each move that `planned_s` leaves open.
        planned_s: (n − 1,), time of each move between leaves, s, NaN where it is left open; None leaves all open.
    """

    block: int
    rods: tuple[int, ...]
    left: ArmMotion
    right: ArmMotion
    speed_mm_s: float
    planned_s: FloatArray | None = None

    @property
    def seconds(self) -> FloatArray:
        """Time of each move, s, (n + 1,): approach to first leaf, …, last leaf to leave; at least 1e-9."""
        ways = [
            np.linalg.norm(
                np.diff(np.concatenate([a.approach[None], a.poses, a.leave[None]])[:, :3, 3], axis=0), axis=1
            )
            for a in (self.left, self.right)
        ]
        seconds = np.maximum(*ways) / self.speed_mm_s
        if self.planned_s is not None:
            seconds[1:-1] = np.where(np.isnan(self.planned_s), seconds[1:-1], self.planned_s)
        return np.maximum(seconds, 1e-9)


@dataclass(frozen=True, eq=False)
class CutPlan:
    """Everything that `batten cut` decides, before any file is written.

    `blade_axis` is the wall axis along which the blade lies; `direction_reason` says why it was chosen.
    `facts` holds named numbers for the report's head (rows, leaves, rods, refused …).
    """

    name: str
    blade_axis: Literal["x", "y"]
    direction_reason: str
    blocks: tuple[Block, ...]
    rods: tuple[RodPlacement, ...]
    checks: tuple[CheckResult, ...]
    motions: tuple[BlockMotion, ...]
    facts: dict[str, float | int | str] = field(default_factory=dict)

    def block(self, number: int) -> Block:
        """The block with that number."""
        return next(b for b in self.blocks if b.number == number)

    @property
    def refused_leaves(self) -> tuple[int, ...]:
        """Numbers of the leaves that are left out of the robot program, in order."""
        return tuple(sorted({r.leaf for r in self.rods if r.status == "refused"}))
