"""From rods in blocks to the robots' motions: ways in and out, and another posture where something would be hit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from batten.curves.elastica import points_batch
from batten.fabrication.block_order import block_order
from batten.fabrication.job import CutJob
from batten.fabrication.plan import Block, BlockMotion, RodPlacement, gripper_frames
from batten.fabrication.robot.arm import RobotArm
from batten.fabrication.robot.cell import RobotCell
from batten.fabrication.robot.motion import Frames, KeepClear, plan_block_motion
from batten.fabrication.robot.motion_clearance import MotionClearance, motion_clearance
from batten.fabrication.speed_plan import leaf_seconds
from batten.fabrication.wall import BladeAxis
from batten.typing import FloatArray

ROD_SEGMENTS = 24
"""Capsules along a rod."""
STEEPNESS = (1.0, 0.75, 0.5, 0.25, 0.0)
"""Shares of the surface's own slope that a way in or out is tried with."""

_PIECE_STATIONS = 65
_SAME_MM = 1e-6


@dataclass(frozen=True, eq=False)
class RodsInBlock:
    """The rods of one block as the robots see them, in its work frame, mm.

    Attributes:
        frames: (positions, tangents, normals), each (n, 3), of the rods' left and right ends.
        points: (n, ROD_SEGMENTS + 1, 3), along the rods at equal steps from left to right.
        radius_mm: half the rod's greatest thickness, and how far a rod lies at most off the chords between its points.
        size_mm: (3,), the block along the blade, across it, and its height.
        rise: (2,), slope of the surface's continuation before the first leaf and behind the last one: by how much the
            pieces rise, in the mean over their width, on each mm out of the block.
        outside_mm: (2,), how far the first and the last rod must be moved along y for the whole of it to be outside.
    """

    frames: tuple[Frames, Frames]
    points: FloatArray
    radius_mm: float
    size_mm: FloatArray
    rise: FloatArray
    outside_mm: FloatArray


def rods_in_block(job: CutJob, rods: Sequence[RodPlacement], block: Block, blade_axis: BladeAxis) -> RodsInBlock:
    """Look at the rods of one block, n ≥ 1 in cutting order, from its work frame.

    The slope at a border is that of the parabola through the mean heights of the three leaves next to it; of the line
    through two where there are not more; level for one.

    Accuracy: points 1e-12 of the rod's length; the sagitta of the chords from the greatest curvature at the points.
    """
    to_work = np.linalg.inv(block.work_frame(blade_axis))
    rotation, origin = to_work[:3, :3].T, to_work[:3, 3]
    held = gripper_frames(rods)
    ends = [
        (held.positions_mm[:, k] @ rotation + origin, held.tangents[:, k] @ rotation, held.normals @ rotation)
        for k in range(2)
    ]
    whole, piece = (np.array([getattr(r, name).parameters for r in rods]) for name in ("rod", "piece"))
    flat = points_batch(whole, np.linspace(0.0, 1.0, ROD_SEGMENTS + 1))
    points = _lifted(rods, flat) @ rotation + origin
    run = flat - whole[:, None, :2]
    curvature = np.abs(whole[:, None, 3] + run[..., 0] * whole[:, None, 5] - run[..., 1] * whole[:, None, 4]).max()
    sagitta = float(curvature * (whole[:, 6].max() / ROD_SEGMENTS) ** 2 / 8.0)
    size = np.array(block.size_mm if blade_axis == "x" else block.size_mm[[1, 0, 2]])
    half = 0.5 * float(size[1])
    pieces = _lifted(rods, points_batch(piece, np.linspace(0.0, 1.0, _PIECE_STATIONS))) @ rotation + origin
    across, height = pieces[..., 1].mean(axis=1), _mean_over_width(pieces)
    outside = np.maximum([points[0, :, 1].max() + half, half - points[-1, :, 1].min()], 0.0)
    return RodsInBlock(
        (ends[0], ends[1]),
        points,
        0.5 * _thickness_mm(job) + sagitta,
        size,
        np.array([-_slope(across, height), _slope(across[::-1], height[::-1])]),
        outside,
    )


def _thickness_mm(job: CutJob) -> float:
    rod = job.rod
    return float(np.hypot(rod.width_mm or 0.0, rod.thickness_mm or 0.0)) if rod.diameter_mm is None else rod.diameter_mm


def _lifted(rods: Sequence[RodPlacement], flat: FloatArray) -> FloatArray:
    """Points (n, k, 2) in the rods' planes, in the wall frame."""
    origin, x_axis, y_axis = (
        np.array([getattr(r.plane, name) for r in rods])[:, None] for name in ("origin", "x_axis", "y_axis")
    )
    return np.asarray(origin + flat[..., :1] * x_axis + flat[..., 1:] * y_axis)


def _mean_over_width(points: FloatArray) -> FloatArray:
    """Mean height of curves (n, k, 3) over x, (n,)."""
    dx = np.diff(points[..., 0], axis=1)
    middle = 0.5 * (points[:, 1:, 2] + points[:, :-1, 2])
    return np.asarray((middle * dx).sum(axis=1) / dx.sum(axis=1))


def _slope(y: FloatArray, z: FloatArray) -> float:
    """dz/dy at the first of a row of points, from as many as three."""
    if len(y) == 1:
        return 0.0
    first = (z[1] - z[0]) / (y[1] - y[0])
    if len(y) == 2:
        return float(first)
    second = (z[2] - z[1]) / (y[2] - y[1])
    return float(first - (y[1] - y[0]) * (second - first) / (y[2] - y[0]))


def move_blocks(
    job: CutJob,
    cell: RobotCell,
    blocks: Sequence[Block],
    rods: Sequence[RodPlacement],
    blade_axis: BladeAxis,
    progress: Callable[[str, int, int], None],
    known: Sequence[BlockMotion] = (),
) -> tuple[BlockMotion, ...]:
    """The robots' motions, one for every block that has a rod to cut, in the order in which the blocks are cut.

    The rod comes in and goes out in the shape of its first and last leaf, along the continuation of the surface: over
    `blade.approach_mm` beyond the place where the whole of it is outside the block, so that it is bent otherwise, or fixed
    in the grippers, only there. Where a way is out of reach or comes too near to something, it is made less steep
    (`STEEPNESS`); where the arms still come too near, their spins and configurations are chosen anew with regard to it.

    Parameters:
        job: the limits.
        cell: arms, places, limits.
        blocks: the plan's. rods: the plan's; refused ones are left out.
        blade_axis: wall axis along which the blade lies.
        progress: called as progress(stage, done, of).
        known: motions planned before, with the same job and cell; taken over for blocks whose rods are still the same.
    """
    before = {m.block: m for m in known}
    members: dict[int, list[int]] = {}
    for i, rod in enumerate(rods):
        if rod.status == "ok":
            members.setdefault(rod.block, []).append(i)
    motions = []
    for done, block in enumerate(blocks):
        progress("plan the robots", done, len(blocks))
        chosen = members.get(block.number, [])
        if chosen and block.number in before and before[block.number].rods == tuple(chosen):
            motions.append(before[block.number])
        elif chosen:
            motions.append(_move(job, cell, block, [rods[i] for i in chosen], chosen, blade_axis))
    progress("plan the robots", len(blocks), len(blocks))
    order = block_order(job.blocks.order, motions, {b.number: b for b in blocks})
    return tuple(motions[k] for k in order)


def _move(
    job: CutJob,
    cell: RobotCell,
    block: Block,
    rods: Sequence[RodPlacement],
    numbers: Sequence[int],
    blade_axis: BladeAxis,
) -> BlockMotion:
    """The best motion through one block: the first without fault, else the one with the fewest leaves that come too near."""
    seen = rods_in_block(job, rods, block, blade_axis)
    seconds = leaf_seconds(job, rods, block)
    distance = seen.outside_mm + job.blade.approach_mm
    best: tuple[tuple[int, float], BlockMotion] | None = None
    steepness = STEEPNESS if job.blade.lead == "along" else STEEPNESS[-1:]
    for keep_clear in (None, KeepClear(seen.size_mm, job.gripper.radius_mm)):
        share = [0, 0]
        while True:
            motion = plan_block_motion(
                cell,
                *seen.frames,
                job.blade.speed_mm_s,
                *distance.tolist(),
                block=block.number,
                rods=numbers,
                leaf_seconds=seconds,
                approach_rise=steepness[share[0]] * float(seen.rise[0]),
                leave_rise=steepness[share[1]] * float(seen.rise[1]),
                keep_clear=keep_clear,
            )
            free = clearance_of(job, cell, motion, seen).distance_mm
            near = ~(free >= cell.min_clearance_mm)
            bad = [
                bool(near[leaf]) or not _reached(cell, motion, way) for leaf, way in ((0, "approach"), (-1, "leave"))
            ]
            fault = int(near.sum()) + sum(bad)
            value = (-fault, float(np.nanmin(free, initial=np.inf)))
            if best is None or value > best[0]:
                best = value, motion
            flatter = [k + int(b and k + 1 < len(steepness)) for k, b in zip(share, bad)]
            if fault == 0 or flatter == share:
                break
            share = flatter
        if best[0][0] == 0:
            break
    assert best is not None
    return best[1]


def flatter_ways(
    job: CutJob,
    blocks: Sequence[Block],
    rods: Sequence[RodPlacement],
    motions: Sequence[BlockMotion],
    blade_axis: BladeAxis,
) -> int:
    """How many of the ways in and out of the blocks are less steep than the continuation of the surface."""
    by_number = {b.number: b for b in blocks}
    count = 0
    for motion in motions:
        rise = rods_in_block(job, [rods[i] for i in motion.rods], by_number[motion.block], blade_axis).rise
        ways = (
            motion.left.approach[:3, 3] - motion.left.poses[0, :3, 3],
            motion.left.leave[:3, 3] - motion.left.poses[-1, :3, 3],
        )
        count += sum(bool(abs(way[2] - abs(way[1]) * slope) > _SAME_MM) for way, slope in zip(ways, rise))
    return count


def clearance_of(job: CutJob, cell: RobotCell, motion: BlockMotion, seen: RodsInBlock) -> MotionClearance:
    """`motion_clearance` for the rods of one block."""
    return motion_clearance(
        cell,
        motion,
        seen.size_mm,
        seen.points,
        rod_radius_mm=seen.radius_mm,
        gripper_radius_mm=job.gripper.radius_mm,
    )


def _reached(cell: RobotCell, motion: BlockMotion, way: str) -> bool:
    """Whether both arms keep their limits at the end of the way in ("approach") or out ("leave")."""

    def keeps(arm: RobotArm, joints: FloatArray) -> bool:
        return bool(
            arm.joint_margin(joints) >= cell.min_joint_margin_rad and arm.singularity(joints) >= cell.min_singularity
        )

    name = f"{way}_joints_rad"
    return keeps(cell.left, getattr(motion.left, name)) and keeps(cell.right, getattr(motion.right, name))
