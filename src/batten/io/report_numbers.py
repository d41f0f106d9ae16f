"""The numbers behind a report's pictures and tables: curvature, strain, forces and local deviation of every rod."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from batten.curves.elastica import points_batch
from batten.fabrication.job import CutJob
from batten.fabrication.plan import CheckResult, CutPlan
from batten.fabrication.rod import Rod
from batten.measures.distance import distance_to_polyline
from batten.typing import BoolArray, FloatArray, IntArray

SAMPLES = 65
"""Points along every rod and every piece."""


@dataclass(frozen=True, eq=False)
class RodNumbers:
    """One row a rod, in the plan's order; n rods, m = SAMPLES points along each.

    Attributes:
        plan: whose rods they are.
        points: (n, m, 2), the whole rod in the coordinates of its plane, mm.
        pieces: (n, m, 2), the part within the block, mm.
        arc_mm: (n, m), arc length along the rod, counted from where it enters the block.
        curvature: (n, m), 1/mm.
        strain: (n, m), κ·d/2 with d the depth of the rod's section, signed.
        force_n: (n,), the force that either gripper holds, EI·‖force‖, N.
        moment_left_nmm, moment_right_nmm: (n,), bending moments EI·κ at the rod's ends, N·mm, signed.
        refused: (n,), whether the rod is left out.
    """

    plan: CutPlan
    points: FloatArray
    pieces: FloatArray
    arc_mm: FloatArray
    curvature: FloatArray
    strain: FloatArray
    force_n: FloatArray
    moment_left_nmm: FloatArray
    moment_right_nmm: FloatArray
    refused: BoolArray

    @property
    def greatest_deviation_mm(self) -> FloatArray:
        """(n,), the greatest of `deviation_mm`; 0 for a rod that passes beside its block."""
        check = _deviation_check(self.plan)
        if check is not None:
            return np.where(np.isnan(check.values), 0.0, check.values)
        return np.array([distance.max() for distance in self.deviation_mm])

    @cached_property
    def deviation_mm(self) -> tuple[FloatArray, ...]:
        """One array a rod, distance of each design point from the piece in the leaf's plane, mm.

        Where the plan holds the check "deviation", which measures at right angles to the surface, in proportion, so that the
        greatest is that check's value.
        """
        distances = [distance_to_polyline(r.design, piece) for r, piece in zip(self.plan.rods, self.pieces)]
        check = _deviation_check(self.plan)
        if check is not None:
            for distance, greatest in zip(distances, check.values):
                if math.isnan(greatest):  # the rod passes beside its block
                    distance *= 0.0
                elif math.isfinite(greatest) and distance.max() > 0.0:
                    distance *= greatest / distance.max()
        return tuple(distances)


def rod_numbers(plan: CutPlan, job: CutJob) -> RodNumbers:
    """All of them at once.

    Parameters:
        plan: the plan, with at least one rod.
        job: the job, for the rod's section and modulus.
    """
    t = np.linspace(0.0, 1.0, SAMPLES)
    parameters = np.array([r.rod.parameters for r in plan.rods]).reshape(-1, 7)
    points = points_batch(parameters, t)
    pieces = points_batch(np.array([r.piece.parameters for r in plan.rods]).reshape(-1, 7), t)
    force = parameters[:, None, 4:6]
    offset = points - parameters[:, None, 0:2]
    curvature = parameters[:, None, 3] + offset[..., 0] * force[..., 1] - offset[..., 1] * force[..., 0]
    bent = Rod.of(job.rod)
    before = np.array([r.before_mm for r in plan.rods])
    return RodNumbers(
        plan=plan,
        points=points,
        pieces=pieces,
        arc_mm=t * parameters[:, None, 6] - before[:, None],
        curvature=curvature,
        strain=curvature * bent.half_depth_mm,
        force_n=bent.force_n(parameters[:, 4:6]),
        moment_left_nmm=bent.moment_nmm(curvature[:, 0]),
        moment_right_nmm=bent.moment_nmm(curvature[:, -1]),
        refused=np.array([r.status == "refused" for r in plan.rods], dtype=np.bool_),
    )


def _deviation_check(plan: CutPlan) -> CheckResult | None:
    return next((c for c in plan.checks if c.name == "deviation"), None)


def use_of_limit(check: CheckResult) -> FloatArray:
    """How much of its limit each rod uses: 0 nothing, 1 all of it, above 1 it is broken; NaN where it does not apply."""
    margins = check.margins
    known = np.isfinite(margins)
    use = np.full(margins.shape, np.nan)
    if not math.isfinite(check.limit):
        return np.where(np.isnan(check.values), np.nan, 0.0)
    if check.sense == "max" and check.limit > 0.0:
        use[known] = check.values[known] / check.limit
    elif check.sense == "min" and check.limit > 0.0:
        use[known] = check.limit / np.maximum(check.values[known], 1e-3 * check.limit)
        if not (margins > 0.0).any():  # nothing is better than the limit: who keeps it uses nothing of it
            use[margins == 0.0] = 0.0
    elif known.any():  # no scale in the limit itself: take the widest margin as the free end
        use[known] = 1.0 - margins[known] / max(float(np.abs(margins[known]).max()), 1e-300)
    use[np.isposinf(check.values)] = np.inf if check.sense == "max" else 0.0
    use[np.isneginf(check.values)] = 0.0 if check.sense == "max" else np.inf
    use[known & (margins < 0.0)] = np.maximum(use[known & (margins < 0.0)], 1.0 + 1e-9)
    return np.maximum(use, 0.0)


def worst_rod(check: CheckResult) -> int:
    """Index of the rod with the least margin; where there is no limit, of the most extreme value; −1 if there is none."""
    if math.isfinite(check.limit) or np.isnan(check.values).all():
        return check.worst
    return int(np.nanargmax(check.values) if check.sense == "max" else np.nanargmin(check.values))


def critical_rod(plan: CutPlan) -> tuple[int, CheckResult | None]:
    """The rod that uses most of a limit, refused ones first, and the check it does so in; hard checks count first."""
    for hard in (True, False):
        best: tuple[float, int, CheckResult | None] = (-1.0, 0, None)
        for check in plan.checks:
            use = use_of_limit(check)
            if check.hard == hard and np.isfinite(use).any():
                worst = int(np.nanargmax(use))
                best = max(best, (float(use[worst]), worst, check), key=lambda item: item[0])
        if best[2] is not None:
            return best[1], best[2]
    return 0, None


@dataclass(frozen=True, eq=False)
class WallOrder:
    """Where each rod stands in the wall's map, both counted from 0 towards greater wall coordinates.

    Attributes:
        ranks: (n,), rank of the rod's leaf across the blade.
        columns: (n,), column of its block along the blade.
        leaves, width: how many of either there are.
    """

    ranks: IntArray
    columns: IntArray
    leaves: int
    width: int


def wall_order(plan: CutPlan) -> WallOrder:
    """The places of a plan's rods in the wall's map."""
    along, across = (0, 1) if plan.blade_axis == "x" else (1, 0)
    middles = np.array([r.plane.to_world(r.design[len(r.design) // 2])[across] for r in plan.rods])
    _, leaf = np.unique([r.leaf for r in plan.rods], return_inverse=True)
    place = np.bincount(leaf, weights=middles) / np.bincount(leaf)
    rank = np.argsort(np.argsort(place, kind="stable"), kind="stable")
    corner = {b.number: round(float(b.corner_mm[along]), 6) for b in plan.blocks}
    edges = sorted(set(corner.values()))
    columns = np.array([edges.index(corner[r.block]) for r in plan.rods], dtype=np.int64)
    return WallOrder(rank[leaf], columns, len(place), len(edges))


def leaf_ranges(leaves: Sequence[int]) -> str:
    """Numbers in order with runs drawn together: 1, 4–6, 9."""
    runs: list[list[int]] = []
    for leaf in sorted(set(leaves)):
        if runs and leaf == runs[-1][1] + 1:
            runs[-1][1] = leaf
        else:
            runs.append([leaf, leaf])
    return ", ".join(f"{a}" if a == b else f"{a}–{b}" if b > a + 1 else f"{a}, {b}" for a, b in runs)
