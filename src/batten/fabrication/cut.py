"""From a job and a surface to a cut: planes, pieces, rods, checks, robots."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from batten.curves.elastica import Elastica, states_at
from batten.errors import InvalidInputError
from batten.fabrication.checks.run import refusals, robot_checks, rod_checks, run_checks
from batten.fabrication.job import CutJob
from batten.fabrication.placement import bow, rod_placement
from batten.fabrication.plan import Block, BlockMotion, CheckResult, CutPlan, RodPlacement, gripper_frames
from batten.fabrication.robot.cell import RobotCell, cell_from_job
from batten.fabrication.robot.motion import plan_block_motion
from batten.fabrication.wall import BladeAxis, Wall, axis_of
from batten.measures.lambda_class import BEST_BELOW, GOOD_BELOW
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.foliation import intersect_planes
from batten.surfaces.plane import Plane
from batten.surfaces.rationalise import Chains, rationalise
from batten.typing import FloatArray, IntArray

Progress = Callable[[str, int, int], None]

TURNS_DEG = (0.0, 2.0, -2.0, 3.0, -3.0, 4.0, -4.0, 6.0, -6.0, 8.0, -8.0, 10.0, -10.0, 15.0, -15.0)
"""Turns that `turn_deg = "auto"` tries, in this order (Fisker2018 §5.4.3, Solution 1)."""

_DESIGN_POINTS = 41


def plan_cut(job: CutJob, surface: BSplineSurface, progress: Progress | None = None) -> CutPlan:
    """Plan a whole cut (Fisker2018 §5.3–5.4, Brander2016 §5).

    The wall is divided into blocks; parallel planes cut the surface into leaves; each leaf is cut at the block borders and
    each piece approximated by an elastica with end points and tangents held, joints moved together where the tolerance is
    missed; the pieces are extended to the rod's length, checked, and handed to the robots. Leaves that break a hard limit
    are refused with all their pieces: no robot cuts them.

    Parameters:
        job: validated values.
        surface: in the wall frame, mm.
        progress: called as progress(stage, done, of).

    Returns:
        The plan, refused leaves included (`status`, `reasons`).

    Raises:
        InvalidInputError: a surface that is no graph over its plan, a rod shorter than a piece, a block that is too low.
    """
    tell = progress or (lambda stage, done, of: None)
    wall, reason = _choose_wall(job, surface)
    cell = replace(cell_from_job(job.cell), rod_is_round=job.rod.section.is_round)
    blocks = wall.blocks(job.blocks)
    turn_deg = _choose_turn(job, wall) if job.leaves.turn_deg == "auto" else float(job.leaves.turn_deg)
    chains = _fit_leaves(job, wall, wall.planes(job.leaves.spacing_mm, np.radians(turn_deg)), tell)
    rods = _place(job, wall, blocks, chains, turn_deg)
    tell("check the rods", 0, 1)
    checks = rod_checks(job, surface, blocks, rods)
    rods = _refuse(rods, refusals(checks, rods))
    tell("check the rods", 1, 1)
    rods, motions, by_robots = _plan_robots(job, cell, blocks, rods, wall.blade_axis, tell)
    checks += by_robots
    facts = _facts(job, wall, blocks, rods, chains, turn_deg)
    return CutPlan(job.name, wall.blade_axis, reason, blocks, rods, checks, motions, facts)


_FIT_SHARE = 0.9
"""Share of the tolerance from which joints are moved: the distance is measured more finely in the checks."""


def _fit_leaves(job: CutJob, wall: Wall, planes: tuple[Plane, ...], tell: Progress) -> Chains:
    """Chains for all planes, with planes put between neighbours whose rods' ends point in too different directions.

    A plane between in which a rod would be too straight is left out: the turn is taken in one step there.
    """

    def fit(some: tuple[Plane, ...], stage: str) -> Chains:
        return rationalise(
            wall.surface,
            some,
            wall.edges(some),
            _FIT_SHARE * job.leaves.tolerance_mm,
            inside=wall.contains,
            progress=lambda done, of: tell(stage, done, of),
        )

    chains = fit(planes, "fit elastica to the leaves")
    for _ in range(3):
        change = _end_turns(job, chains)
        after = np.flatnonzero(change > np.radians(job.leaves.max_turn_between_deg))
        if not after.size:
            break
        between = tuple(
            replace(chains.planes[i], origin=0.5 * (chains.planes[i].origin + chains.planes[i + 1].origin))
            for i in after
        )
        added = fit(between, "fit leaves between")
        good = np.flatnonzero(_least_bows(job, added) >= job.rod.min_bow_mm)
        if not good.size:
            break
        chains = chains.with_between(after[good], added.rows(good))
    return chains


def _least_bows(job: CutJob, chains: Chains) -> FloatArray:
    """Least bow of the rods of each chain, mm, (leaves,), over places of the piece from one end of the rod to the other."""
    bows = np.full(chains.deviation.shape, np.inf)
    known = np.isfinite(chains.parameters).all(axis=-1) & np.isfinite(chains.deviation)
    parameters = chains.parameters[known]
    spare = job.rod.length_mm - parameters[:, 6]
    bows[known] = np.min([bow(parameters, f * spare, job.rod.length_mm) for f in np.linspace(0.0, 1.0, 5)], axis=0)
    return np.asarray(bows.min(axis=1))


def _end_turns(job: CutJob, chains: Chains) -> FloatArray:
    """Greatest turn of a rod's end between each leaf and the next, radians, (leaves − 1,); 0 where neither is cut."""
    spare = job.rod.length_mm - chains.parameters[..., 6]
    ends = [states_at(chains.parameters, -0.5 * spare + f * job.rod.length_mm)[..., 2] for f in (0.0, 1.0)]
    turns = np.abs(np.diff(np.stack(ends), axis=1)).max(axis=0)
    used = np.isfinite(chains.deviation)
    return np.asarray(np.where(used[1:] | used[:-1], turns, 0.0).max(axis=1, initial=0.0))


def _choose_wall(job: CutJob, surface: BSplineSurface) -> tuple[Wall, str]:
    """The wall with its blade axis, and why it lies that way."""
    wanted = job.blocks.direction
    if wanted != "auto":
        axis = axis_of(surface, wanted)
        return Wall.of(surface, job.blocks.size_mm, axis), f"the job asks for {wanted}, which runs along wall {axis}"
    worst: dict[BladeAxis, tuple[int, float]] = {}
    axes: tuple[BladeAxis, BladeAxis] = ("x", "y")
    for axis in axes:
        wall = Wall.of(surface, job.blocks.size_mm, axis)
        planes = wall.planes(4.0 * job.leaves.spacing_mm, 0.0)
        chains = rationalise(
            surface, planes, wall.edges(planes), job.leaves.tolerance_mm, inside=wall.contains, rounds=0
        )
        missed = int((~(chains.deviation <= job.leaves.tolerance_mm)).sum())
        worst[axis] = (missed, float(np.nanmax(chains.deviation)))
    best = min(axes, key=lambda axis: (*worst[axis], axis))
    other: BladeAxis = "y" if best == "x" else "x"
    return Wall.of(surface, job.blocks.size_mm, best), (
        f"of a quarter of the leaves, {worst[best][0]} pieces miss the tolerance before repair along wall {best} (the worst "
        f"lies {worst[best][1]:.2f} mm off), {worst[other][0]} along wall {other} ({worst[other][1]:.2f} mm)"
    )


def _choose_turn(job: CutJob, wall: Wall) -> float:
    """The first turn in `TURNS_DEG` that leaves no piece too straight; the one with the greatest least bow if none does."""
    best, best_bow = 0.0, -1.0
    for turn in TURNS_DEG:
        planes = wall.planes(job.leaves.spacing_mm, np.radians(turn))
        few = tuple(p for i, p in enumerate(planes) if i < 3 or i >= len(planes) - 3 or i % 3 == 0)
        chains = rationalise(
            wall.surface, few, wall.edges(few), job.leaves.tolerance_mm, inside=wall.contains, rounds=0
        )
        least = float(_least_bows(job, chains).min())
        if least >= job.rod.min_bow_mm:
            return turn
        if least > best_bow:
            best, best_bow = turn, least
    return best


def _place(
    job: CutJob, wall: Wall, blocks: tuple[Block, ...], chains: Chains, turn_deg: float
) -> tuple[RodPlacement, ...]:
    """One placement for every plane that crosses a block, block by block in cutting order."""
    plane_index, block_index = wall.crossings(chains.planes, blocks)
    columns = np.array([b.column for b in blocks])[block_index]
    parameters = chains.parameters[plane_index, columns]
    missing = np.flatnonzero(~np.isfinite(parameters).all(axis=1))
    if missing.size:
        leaf, block = int(plane_index[missing[0]]) + 1, blocks[block_index[missing[0]]].number
        raise InvalidInputError(
            f"leaf {leaf} has no elastica in block {block}, and {missing.size} pieces in all have none: the surface does not"
            " reach over the block there, or its section has no length; cut one whose plan is a rectangle along x and y"
        )
    low = np.array([b.corner_mm for b in blocks])[block_index]
    high = low + np.array([b.size_mm for b in blocks])[block_index]
    planes = tuple(chains.planes[i] for i in plane_index)
    before = rod_placement(parameters, planes, low, high, block_index, job.rod, job.gripper)
    design = _design_points(wall, chains)
    moved = np.abs(chains.moved).max(axis=1)
    rods = []
    for k, (i, j) in enumerate(zip(plane_index, block_index)):
        piece = Elastica.from_parameters(parameters[k])
        repair = []
        if turn_deg:
            repair.append(f"planes turned by {turn_deg:g}°")
        if moved[i, 0] > 0.0:
            repair.append(f"border points moved by up to {moved[i, 0]:.2f} mm and {np.degrees(moved[i, 1]):.2f}°")
        rods.append(
            RodPlacement(
                block=blocks[j].number,
                leaf=int(i) + 1,
                plane=planes[k],
                design=design[i, columns[k]],
                piece=piece,
                rod=piece.extended(before[k], job.rod.length_mm - piece.length - before[k]),
                before_mm=float(before[k]),
                repair=tuple(repair),
            )
        )
    return tuple(rods)


def _design_points(wall: Wall, chains: Chains) -> FloatArray:
    """Points of the wanted leaves in their planes, shape (leaves, columns, points, 2)."""
    low, width = chains.edges[:, :-1, None], np.diff(chains.edges)[..., None]
    x = low + width * np.linspace(0.0, 1.0, _DESIGN_POINTS)
    section = intersect_planes(wall.surface, list(chains.planes), x.reshape(len(x), -1), order=1, extend=0.25)
    return np.stack([x, section.y.reshape(x.shape)], axis=-1)


def _refuse(rods: tuple[RodPlacement, ...], reasons: dict[int, tuple[str, ...]]) -> tuple[RodPlacement, ...]:
    """The same rods with every piece of a leaf in `reasons` refused."""
    return tuple(
        replace(r, status="refused", reasons=tuple(dict.fromkeys((*r.reasons, *reasons[r.leaf]))))
        if r.leaf in reasons
        else r
        for r in rods
    )


def _refused_leaves(rods: tuple[RodPlacement, ...]) -> set[int]:
    return {r.leaf for r in rods if r.status == "refused"}


def _plan_robots(
    job: CutJob,
    cell: RobotCell,
    blocks: tuple[Block, ...],
    rods: tuple[RodPlacement, ...],
    blade_axis: BladeAxis,
    tell: Progress,
) -> tuple[tuple[RodPlacement, ...], tuple[BlockMotion, ...], tuple[CheckResult, ...]]:
    """Motions for the leaves that are left; those that the robots cannot do are refused, and the others planned again.

    The checks hold the values of the final motions, and for leaves that were refused those that refused them.
    """
    checks: tuple[CheckResult, ...] = ()
    while True:
        motions = _move(job, cell, blocks, rods, blade_axis, tell)
        new = robot_checks(motions, cell, len(rods))
        refused = _refused_leaves(rods)
        if checks:
            gone = np.array([rod.status == "refused" for rod in rods])
            new = tuple(replace(c, values=np.where(gone, old.values, c.values)) for c, old in zip(new, checks))
        reasons = {leaf: why for leaf, why in refusals(new, rods).items() if leaf not in refused}
        rods, checks = _refuse(rods, reasons), new or checks
        if not reasons:
            return rods, motions, checks


def _move(
    job: CutJob,
    cell: RobotCell,
    blocks: tuple[Block, ...],
    rods: tuple[RodPlacement, ...],
    blade_axis: BladeAxis,
    tell: Progress,
) -> tuple[BlockMotion, ...]:
    """The robots' motions, one for every block that has a rod to cut."""
    motions = []
    members: dict[int, list[int]] = {}
    for i, rod in enumerate(rods):
        if rod.status == "ok":
            members.setdefault(rod.block, []).append(i)
    for done, block in enumerate(blocks):
        tell("plan the robots", done, len(blocks))
        chosen = members.get(block.number, [])
        if not chosen:
            continue
        to_work = np.linalg.inv(block.work_frame(blade_axis))
        rotation, origin = to_work[:3, :3].T, to_work[:3, 3]
        frames = gripper_frames([rods[i] for i in chosen])
        ends = [
            (frames.positions_mm[:, k] @ rotation + origin, frames.tangents[:, k] @ rotation, frames.normals @ rotation)
            for k in range(2)
        ]
        half = 0.5 * float(block.size_mm[1 if blade_axis == "x" else 0])
        first = min(float(p[0][0, 1]) for p in ends)
        last = max(float(p[0][-1, 1]) for p in ends)
        motions.append(
            plan_block_motion(
                cell,
                ends[0],
                ends[1],
                job.blade.speed_mm_s,
                max(0.0, first + half) + job.blade.approach_mm,
                max(0.0, half - last) + job.blade.approach_mm,
                block=block.number,
                rods=chosen,
            )
        )
    tell("plan the robots", len(blocks), len(blocks))
    return tuple(motions)


def _facts(
    job: CutJob,
    wall: Wall,
    blocks: tuple[Block, ...],
    rods: tuple[RodPlacement, ...],
    chains: Chains,
    turn_deg: float,
) -> dict[str, float | int | str]:
    used: IntArray = np.flatnonzero(np.isfinite(chains.deviation).any(axis=1))
    residual = np.where(np.isfinite(chains.deviation), chains.lambda_residual, np.nan)
    worst = np.nanmax(residual[used], axis=1)
    refused = _refused_leaves(rods)
    return {
        "blocks": len(blocks),
        "rows": len(wall.rows) - 1,
        "columns": len(wall.columns) - 1,
        "leaves": len({r.leaf for r in rods}),
        "rods": len(rods),
        "refused_leaves": len(refused),
        "turn_deg": turn_deg,
        "repaired_leaves": len({r.leaf for r in rods if any("border points" in text for text in r.repair)}),
        "leaves_not_close_to_elastica": int((worst >= BEST_BELOW).sum()),
        "leaves_far_from_elastica": int((worst >= GOOD_BELOW).sum()),
        "worst_lambda_residual": float(np.nanmax(residual)),
        "pieces_outside_tolerance_before_repair": int((chains.first_deviation > job.leaves.tolerance_mm).sum()),
        "worst_deviation_before_repair_mm": float(np.nanmax(chains.first_deviation)),
        "longest_piece_mm": float(np.nanmax(chains.parameters[..., 6])),
        "cut_time_s": float(_cut_seconds(job, rods)),
    }


def _cut_seconds(job: CutJob, rods: tuple[RodPlacement, ...]) -> float:
    """Time that the blade spends in the foam: for every block, the way of the faster end over the speed."""
    cut = [r for r in rods if r.status == "ok"]
    ways = np.linalg.norm(np.diff(gripper_frames(cut).positions_mm, axis=0), axis=2).max(axis=1)
    same_block = np.diff([r.block for r in cut]) == 0
    return float(ways[same_block].sum()) / job.blade.speed_mm_s


def check_again(plan: CutPlan, job: CutJob, surface: BSplineSurface) -> tuple[CheckResult, ...]:
    """All checks of a plan once more, from its stored numbers."""
    return run_checks(job, surface, plan.blocks, plan.rods, plan.motions, cell_from_job(job.cell))
