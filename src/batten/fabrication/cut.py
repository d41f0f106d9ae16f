"""From a job and a surface to a cut: planes, pieces, rods, checks, robots."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from batten.curves.elastica import Elastica, states_at
from batten.errors import InvalidInputError
from batten.fabrication.between_leaves import strays_between
from batten.fabrication.block_motions import flatter_ways, move_blocks
from batten.fabrication.block_order import travel_mm, way_length_mm
from batten.fabrication.checks.kerf import kerf_checks
from batten.fabrication.checks.run import refusals, robot_checks, rod_checks, run_checks
from batten.fabrication.job import CutJob
from batten.fabrication.kerf import BladeSurface, blade_surface, fit_blade_to_law
from batten.fabrication.leaf_planes import LeafPlanes, choose_planes, crossing_pieces, least_bows, spare_before
from batten.fabrication.plan import Block, BlockMotion, CheckResult, CutPlan, RodPlacement
from batten.fabrication.robot.cell import RobotCell, cell_from_job
from batten.fabrication.wall import BladeAxis, Wall, axis_of
from batten.measures.lambda_class import BEST_BELOW, GOOD_BELOW
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.foliation import intersect_planes
from batten.surfaces.plane import Plane
from batten.surfaces.rationalise import Chains, eased, rationalise
from batten.surfaces.straight_leaves import plane_between
from batten.typing import FloatArray, IntArray

Progress = Callable[[str, int, int], None]

_DESIGN_POINTS = 41


def plan_cut(job: CutJob, surface: BSplineSurface, progress: Progress | None = None) -> CutPlan:
    """Plan a whole cut (Fisker2018 §5.3–5.4, Brander2016 §5).

    The wall is divided into blocks; planes cut the surface, or with `kerf.offset` the one half the kerf beside it, into
    leaves; each leaf is cut at the block borders and each piece approximated by an elastica with end points and tangents
    held, joints moved together where the tolerance is missed; the pieces are extended to the rod's length, checked, and
    handed to the robots. Leaves that break a hard limit are refused with all their pieces: no robot cuts them.

    Parameters:
        job: validated values.
        surface: in the wall frame, mm.
        progress: called as progress(stage, done, of).

    Returns:
        The plan, refused leaves included (`status`, `reasons`).

    Raises:
        InvalidInputError: a surface that is no graph over its plan, a rod shorter than a piece, a block that is too low, a
            kerf that its law does not give, a surface too strongly curved for its offset.
    """
    tell = progress or (lambda stage, done, of: None)
    fit_blade_to_law(job.kerf, job.blade)
    wall, reason = _choose_wall(job, surface)
    wanted = blade_surface(job, surface)
    cell = replace(cell_from_job(job.cell), rod_is_round=job.rod.section.is_round)
    blocks = wall.blocks(job.blocks)
    family = _choose_planes(job, wall, wanted, blocks, tell)
    chains = _fit_leaves(job, wall, wanted, family.planes, tell)
    chains, rods = _rods_of_leaves(job, wall, wanted, blocks, chains, family, tell)
    tell("check the rods", 0, 1)
    checks = rod_checks(job, surface, blocks, rods)
    rods = _refuse(rods, refusals(checks, rods))
    tell("check the rods", 1, 1)
    rods, motions, by_robots = _plan_robots(job, cell, blocks, rods, wall.blade_axis, tell)
    checks += by_robots + kerf_checks(job, blocks, rods, motions)
    facts = _facts(job, wall, blocks, rods, motions, chains, family)
    return CutPlan(job.name, wall.blade_axis, reason, blocks, rods, checks, motions, facts)


_FIT_SHARE = 0.9
"""Share of the tolerance from which joints are moved: the distance is measured more finely in the checks."""
_MOST_CLOSER = 3
"""How often leaves are put between those between which the blade strays."""


def _choose_planes(
    job: CutJob, wall: Wall, wanted: BladeSurface, blocks: tuple[Block, ...], tell: Progress
) -> LeafPlanes:
    """The planes of the leaves, with a search for their turn if the job leaves it open."""
    tries = 0

    def fit(planes: tuple[Plane, ...], thorough: bool) -> Chains:
        nonlocal tries
        tries += 1
        tell("choose the planes", tries, tries + 1)
        if thorough:
            return _fit_leaves(job, wall, wanted, planes, lambda stage, done, of: None)
        edges = wall.edges(planes)
        return rationalise(
            wanted.surface,
            planes,
            edges,
            job.leaves.tolerance_mm,
            inside=wall.contains,
            extend=wanted.extend,
            rounds=0,
        )

    family = choose_planes(job, wall, blocks, fit)
    if tries:
        tell("choose the planes", tries, tries)
    return family


def _fit_leaves(job: CutJob, wall: Wall, wanted: BladeSurface, planes: tuple[Plane, ...], tell: Progress) -> Chains:
    """Chains for all planes, with planes put between neighbours whose rods' ends point in too different directions.

    A plane between in which a rod would be too straight is left out: the turn is taken in one step there.
    """

    def fit(some: tuple[Plane, ...], stage: str) -> Chains:
        return rationalise(
            wanted.surface,
            some,
            wall.edges(some),
            _FIT_SHARE * job.leaves.tolerance_mm,
            inside=wall.contains,
            extend=wanted.extend,
            progress=lambda done, of: tell(stage, done, of),
        )

    chains = fit(planes, "fit elastica to the leaves")
    for _ in range(3):
        change = _end_turns(job, chains)
        after = np.flatnonzero(change > np.radians(job.leaves.max_turn_between_deg))
        if not after.size:
            break
        between = tuple(plane_between(chains.planes[i], chains.planes[i + 1]) for i in after)
        added = fit(between, "fit leaves between")
        good = np.flatnonzero(least_bows(job, added) >= job.rod.min_bow_mm)
        if not good.size:
            break
        chains = chains.with_between(after[good], added.rows(good))
    return chains


def _rods_of_leaves(
    job: CutJob,
    wall: Wall,
    wanted: BladeSurface,
    blocks: tuple[Block, ...],
    chains: Chains,
    family: LeafPlanes,
    tell: Progress,
) -> tuple[Chains, tuple[RodPlacement, ...]]:
    """Chains and rods; with `leaves.hold_between`, moves of joints eased and leaves put where the blade strays between.

    As in `_fit_leaves` a plane in which a rod would be too straight is left out: what the blade does there `batten simulate`
    tells.
    """
    if not job.leaves.hold_between:
        return chains, _place(job, wall, wanted, blocks, chains, family)
    limit = _FIT_SHARE * job.leaves.tolerance_mm
    for done in range(_MOST_CLOSER + 1):
        tell("look between the leaves", done, _MOST_CLOSER + 1)
        chains = eased(wanted.surface, chains, limit, inside=wall.contains, extend=wanted.extend)
        rods = _place(job, wall, wanted, blocks, chains, family)
        stray = np.zeros(len(chains.planes))
        off = strays_between(wanted.surface, blocks, rods, wanted.extend)
        np.fmax.at(stray, np.array([r.leaf for r in rods]) - 1, off)
        after = np.flatnonzero(stray[:-1] > job.leaves.tolerance_mm)
        if not after.size or done == _MOST_CLOSER:
            break
        between = tuple(plane_between(chains.planes[i], chains.planes[i + 1]) for i in after)
        added = rationalise(
            wanted.surface, between, wall.edges(between), limit, inside=wall.contains, extend=wanted.extend
        )
        good = np.flatnonzero(least_bows(job, added) >= job.rod.min_bow_mm)
        if not good.size:
            break
        chains = chains.with_between(after[good], added.rows(good))
    tell("look between the leaves", _MOST_CLOSER + 1, _MOST_CLOSER + 1)
    return chains, rods


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


def _place(
    job: CutJob, wall: Wall, wanted: BladeSurface, blocks: tuple[Block, ...], chains: Chains, family: LeafPlanes
) -> tuple[RodPlacement, ...]:
    """One placement for every plane that crosses a block, block by block in cutting order."""
    plane_index, block_index, parameters = crossing_pieces(wall, blocks, chains)
    missing = np.flatnonzero(~np.isfinite(parameters).all(axis=1))
    if missing.size:
        leaf, block = int(plane_index[missing[0]]) + 1, blocks[block_index[missing[0]]].number
        raise InvalidInputError(
            f"leaf {leaf} has no elastica in block {block}, and {missing.size} pieces in all have none: the surface does not"
            " reach over the block there, or its section has no length; cut one whose plan is a rectangle along x and y"
        )
    before = spare_before(job, blocks, chains, plane_index, block_index, parameters)
    design = _design_points(wanted, chains)
    moved = np.abs(chains.moved).max(axis=1)
    rods = []
    for k, (i, j) in enumerate(zip(plane_index, block_index)):
        piece = Elastica.from_parameters(parameters[k])
        repair = [family.repair] if family.repair else []
        if moved[i, 0] > 0.0:
            repair.append(f"border points moved by up to {moved[i, 0]:.2f} mm and {np.degrees(moved[i, 1]):.2f}°")
        rods.append(
            RodPlacement(
                block=blocks[j].number,
                leaf=int(i) + 1,
                plane=chains.planes[i],
                design=design[i, blocks[j].column],
                piece=piece,
                rod=piece.extended(before[k], job.rod.length_mm - piece.length - before[k]),
                before_mm=float(before[k]),
                repair=tuple(repair),
            )
        )
    return tuple(rods)


def _design_points(wanted: BladeSurface, chains: Chains) -> FloatArray:
    """Points of the wanted leaves in their planes, shape (leaves, columns, points, 2)."""
    low, width = chains.edges[:, :-1, None], np.diff(chains.edges)[..., None]
    x = low + width * np.linspace(0.0, 1.0, _DESIGN_POINTS)
    section = intersect_planes(
        wanted.surface, list(chains.planes), x.reshape(len(x), -1), order=1, extend=wanted.extend
    )
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
    motions: tuple[BlockMotion, ...] = ()
    while True:
        motions = move_blocks(job, cell, blocks, rods, blade_axis, tell, known=motions)
        new = robot_checks(job, blocks, rods, motions, cell, blade_axis)
        refused = _refused_leaves(rods)
        if checks:
            gone = np.array([rod.status == "refused" for rod in rods])
            new = tuple(replace(c, values=np.where(gone, old.values, c.values)) for c, old in zip(new, checks))
        reasons = {leaf: why for leaf, why in refusals(new, rods).items() if leaf not in refused}
        rods, checks = _refuse(rods, reasons), new or checks
        if not reasons:
            return rods, motions, checks


def _facts(
    job: CutJob,
    wall: Wall,
    blocks: tuple[Block, ...],
    rods: tuple[RodPlacement, ...],
    motions: tuple[BlockMotion, ...],
    chains: Chains,
    family: LeafPlanes,
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
        "turn_deg": family.turn_deg,
        **({} if family.border_turn_deg is None else {"border_turn_deg": family.border_turn_deg}),
        **family.facts,
        "repaired_leaves": len({r.leaf for r in rods if any("border points" in text for text in r.repair)}),
        "leaves_not_close_to_elastica": int((worst >= BEST_BELOW).sum()),
        "leaves_far_from_elastica": int((worst >= GOOD_BELOW).sum()),
        "worst_lambda_residual": float(np.nanmax(residual)),
        "pieces_outside_tolerance_before_repair": int((chains.first_deviation > job.leaves.tolerance_mm).sum()),
        "worst_deviation_before_repair_mm": float(np.nanmax(chains.first_deviation)),
        "longest_piece_mm": float(np.nanmax(chains.parameters[..., 6])),
        "cut_time_s": float(sum(m.seconds[1:-1].sum() for m in motions)),
        "ways_less_steep_than_the_surface": flatter_ways(job, blocks, rods, motions, wall.blade_axis),
        "travel_between_blocks_mm": way_length_mm(range(len(motions)), travel_mm(motions)),
        **({} if job.blocks.order == "numbered" else {"block_order": " ".join(str(m.block) for m in motions)}),
    }


def check_again(plan: CutPlan, job: CutJob, surface: BSplineSurface) -> tuple[CheckResult, ...]:
    """All checks of a plan once more, from its stored numbers."""
    return run_checks(job, surface, plan.blocks, plan.rods, plan.motions, cell_from_job(job.cell), plan.blade_axis)
