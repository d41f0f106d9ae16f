"""All checks in a fixed order, and what they refuse."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from batten.errors import InvalidInputError
from batten.fabrication.checks.context import CheckContext
from batten.fabrication.checks.continuity import continuity_checks
from batten.fabrication.checks.deviation import deviation_checks
from batten.fabrication.checks.forces import forces_checks
from batten.fabrication.checks.gripper_clearance import gripper_clearance_check
from batten.fabrication.checks.kerf import kerf_checks
from batten.fabrication.checks.reentry import reentry_check
from batten.fabrication.checks.speed_ratio import speed_ratio_check
from batten.fabrication.checks.stability import stability_checks
from batten.fabrication.checks.straightness import straightness_checks
from batten.fabrication.checks.strain import strain_check
from batten.fabrication.job import CutJob
from batten.fabrication.plan import Block, BlockMotion, CheckResult, RodPlacement
from batten.surfaces.bspline_surface import BSplineSurface

if TYPE_CHECKING:
    from batten.fabrication.robot.cell import RobotCell


def run_checks(
    job: CutJob,
    surface: BSplineSurface,
    blocks: Sequence[Block],
    rods: Sequence[RodPlacement],
    motions: Sequence[BlockMotion] = (),
    cell: RobotCell | None = None,
    blade_axis: Literal["x", "y"] | None = None,
) -> tuple[CheckResult, ...]:
    """Every check over all rods of a plan, refused ones included.

    Parameters:
        job: the limits.
        surface: the wanted surface in the wall frame, mm.
        blocks: every block that a rod names.
        rods: in the plan's order; each check has one value for each of them.
        motions: what the robots do, as far as it is planned; without, the robots' checks are left out.
        cell: needed with `motions`. blade_axis: wall axis along which the blade lies, needed with `motions`.

    Returns:
        strain, deviation, deviation_mean, hausdorff, jump, jump_tangent, reentry, gripper_clearance, straightness,
        passes_straight, stability, snap_shift, snap_turn, jump_between, speed_ratio, gripper_force, gripper_moment, then
        the robots' checks, and kerf where the job gives a law for it.

    Raises:
        InvalidInputError: motions without a cell or a blade axis, a rod in a block that is not there.
    """
    return (
        rod_checks(job, surface, blocks, rods)
        + robot_checks(job, blocks, rods, motions, cell, blade_axis)
        + kerf_checks(job, blocks, rods, motions)
    )


def rod_checks(
    job: CutJob, surface: BSplineSurface, blocks: Sequence[Block], rods: Sequence[RodPlacement]
) -> tuple[CheckResult, ...]:
    """The checks of `run_checks` that need no robot."""
    context = CheckContext.of(job, surface, blocks, rods)
    return (
        strain_check(context),
        *deviation_checks(context),
        *continuity_checks(context),
        reentry_check(context),
        gripper_clearance_check(context),
        *straightness_checks(context),
        *stability_checks(context),
        speed_ratio_check(context),
        *forces_checks(context),
    )


def robot_checks(
    job: CutJob,
    blocks: Sequence[Block],
    rods: Sequence[RodPlacement],
    motions: Sequence[BlockMotion],
    cell: RobotCell | None,
    blade_axis: Literal["x", "y"] | None,
) -> tuple[CheckResult, ...]:
    """The checks of `run_checks` that need the robots' motions; none without motions."""
    if not motions:
        return ()
    if cell is None:
        raise InvalidInputError(f"{len(motions)} motions were given without the robot cell they belong to; pass cell=")
    if blade_axis is None:
        raise InvalidInputError(
            f'{len(motions)} motions were given without the way the blade lies; pass blade_axis="x" or "y"'
        )
    from batten.fabrication.checks.collision import collision_check, travel_check
    from batten.fabrication.checks.reach import reach_checks

    given = (job, cell, blocks, rods, motions, blade_axis)
    return (*reach_checks(motions, cell, len(rods)), collision_check(*given), travel_check(*given))


def refusals(checks: Sequence[CheckResult], rods: Sequence[RodPlacement]) -> dict[int, tuple[str, ...]]:
    """Why leaves cannot be cut: for every leaf with a broken hard check, one sentence a check, in the checks' order.

    Parameters:
        checks: with values for each rod; soft ones are passed over.
        rods: in the same order.

    Returns:
        Leaf number → reasons, leaves ascending; each reason tells the worst value, the limit, the block, and the other
        blocks in which the same leaf breaks it.

    Raises:
        InvalidInputError: a check with another number of values.

    Example:
        >>> from types import SimpleNamespace as Placement
        >>> check = CheckResult("strain", "Strain on the whole rod", "", 0.008, "max", np.array([0.0123, 0.002]))
        >>> refusals([check], [Placement(leaf=4, block=7), Placement(leaf=5, block=7)])
        {4: ('strain on the whole rod 0.0123 > 0.008 in block 7',)}
    """
    reasons: dict[int, list[str]] = {}
    for check in checks:
        if len(check.values) != len(rods):
            raise InvalidInputError(f"check {check.name!r} has {len(check.values)} values for {len(rods)} rods")
        if not check.hard:
            continue
        broken: dict[int, list[int]] = {}
        for i in np.flatnonzero(~check.passed).tolist():
            broken.setdefault(rods[i].leaf, []).append(i)
        for leaf, members in broken.items():
            members.sort(key=lambda i: (float(check.margins[i]), rods[i].block))
            reasons.setdefault(leaf, []).append(_reason(check, members, rods))
    return {leaf: tuple(reasons[leaf]) for leaf in sorted(reasons)}


def _reason(check: CheckResult, broken: Sequence[int], rods: Sequence[RodPlacement]) -> str:
    worst, block = float(check.values[broken[0]]), rods[broken[0]].block
    unit = check.unit if check.unit in ("", "°") else f" {check.unit}"
    value, limit = _apart(worst, check.limit)
    text = (
        f"{check.title[0].lower()}{check.title[1:]} {value}{unit} {'>' if check.sense == 'max' else '<'} {limit}{unit}"
    )
    others = sorted({rods[i].block for i in broken} - {block})
    also = f" (also in {', '.join(map(str, others))})" if others else ""
    return f"{text} in block {block}{also}"


def _apart(value: float, limit: float) -> tuple[str, str]:
    """Both numbers with so few digits, from three on, that they still read as different; rounding noise reads as 0."""
    value = 0.0 if abs(value) < 1e-9 * abs(limit) else value
    for digits in range(3, 17):
        texts = f"{value:.{digits}g}", f"{limit:.{digits}g}"
        if texts[0] != texts[1]:
            break
    return texts
