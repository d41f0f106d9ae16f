"""Whether arms, grippers and rod stay clear of block, table, floor and each other, in the blocks and between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from batten.fabrication.block_motions import clearance_of, rods_in_block
from batten.fabrication.job import CutJob
from batten.fabrication.plan import Block, BlockMotion, CheckResult, RodPlacement
from batten.fabrication.robot.cell import RobotCell
from batten.fabrication.robot.travel import travel_clearance


def collision_check(
    job: CutJob,
    cell: RobotCell,
    blocks: Sequence[Block],
    rods: Sequence[RodPlacement],
    motions: Sequence[BlockMotion],
    blade_axis: Literal["x", "y"],
) -> CheckResult:
    """Least free distance (mm) at each leaf, on the moves to it and from it, the ways in and out included.

    Arms and rod are capsules, block and table boxes (`batten.fabrication.robot.motion_clearance` says which pairs count);
    the note names the pair that comes nearest.

    Accuracy: that of `motion_clearance`. On the moves of examples/freeform-wall, ten times as many stations give values that
    are less by 0.7 mm at most.
    Degenerate: NaN for rods in no motion and where an arm cannot get there (`reach` tells).
    """
    values = np.full(len(rods), np.nan)
    worst, where = np.inf, ""
    by_number = {b.number: b for b in blocks}
    for motion in motions:
        seen = rods_in_block(job, [rods[i] for i in motion.rods], by_number[motion.block], blade_axis)
        found = clearance_of(job, cell, motion, seen)
        values[list(motion.rods)] = found.distance_mm
        if np.isfinite(found.distance_mm).any():
            k = int(np.nanargmin(found.distance_mm))
            if found.distance_mm[k] < worst:
                worst, (one, other) = float(found.distance_mm[k]), found.pair[k]
                where = f" The nearest: {one} and {other}, leaf {rods[motion.rods[k]].leaf} in block {motion.block}."
    return CheckResult(
        "collision",
        "Free distance of arms, grippers and rod",
        "mm",
        cell.min_clearance_mm,
        "min",
        values,
        f"From block, table, floor and each other, on the moves to and from the leaf.{where}",
    )


def travel_check(
    job: CutJob,
    cell: RobotCell,
    blocks: Sequence[Block],
    rods: Sequence[RodPlacement],
    motions: Sequence[BlockMotion],
    blade_axis: Literal["x", "y"],
) -> CheckResult:
    """Least free distance (mm) of the arms on their way from the block before, at the first rod of each block.

    Soft: no leaf that is left out makes the way free; another order of the blocks, or a posture set by hand, may.

    Accuracy: that of `batten.fabrication.robot.travel.travel_clearance`.
    Degenerate: NaN for all other rods, and where an arm cannot reach an approach or leave pose.
    """
    values = np.full(len(rods), np.nan)
    worst, where = np.inf, ""
    sizes = {b.number: np.array(b.size_mm if blade_axis == "x" else b.size_mm[[1, 0, 2]]) for b in blocks}
    for before, motion in zip((None, *motions[:-1]), motions):
        free, (one, other) = travel_clearance(
            cell,
            before,
            motion,
            None if before is None else sizes[before.block],
            sizes[motion.block],
            job.gripper.radius_mm,
        )
        values[motion.rods[0]] = free
        if free < worst:
            worst, where = free, f" The nearest: {one} and {other}, on the way to block {motion.block}."
    return CheckResult(
        "travel",
        "Free distance between the blocks",
        "mm",
        cell.min_clearance_mm,
        "min",
        values,
        f"Of the arms, back from one block and on to the next, with empty grippers.{where}",
        hard=False,
    )
