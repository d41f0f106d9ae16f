"""One patch of a face planned: its blocks, its pieces of elastica, how far they lie from the face, what is wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from batten.fabrication.patch_pieces import (
    PatchDeviation,
    greatest_jumps,
    measured,
    occupied,
    piece_points,
    planned_surface,
)
from batten.fabrication.patch_search import PatchDecision, PatchSearch, WireComparison
from batten.fabrication.rationalise_job import RationaliseJob
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.columns import Columns
from batten.surfaces.patches import Patch
from batten.surfaces.plane_family import Direction, PlaneFamily
from batten.typing import BoolArray, FloatArray

HEIGHTS_SHARE = 0.02
"""Share of the tolerance for the heights that stand for a face, and for the planned surface that stands for the pieces."""


@dataclass(frozen=True, eq=False)
class PatchBlock:
    """One block of a patch, in the patch's block frame: x along the blocks, y across, z up.

    Attributes:
        number: counts from 1 in the patch, along the blade and then across. row, column: from 0.
        low, high: (3,), its corners, mm.
        pieces: how many leaves have a piece in it that cuts the face.
        greatest_mm, mean_mm: distance of the cut from the face within it.
    """

    number: int
    row: int
    column: int
    low: FloatArray
    high: FloatArray
    pieces: int
    greatest_mm: float
    mean_mm: float


@dataclass(frozen=True, eq=False)
class PatchPlan:
    """A patch planned.

    Attributes:
        number: from 1 over the whole job. patch: what is cut.
        directions: what the search looked at; () if the direction was given.
        family, columns: planes and borders. blocks: those in which the patch has a point.
        deviation: of the cut from the face.
        jump_mm, jump_rad: greatest jump of position and tangent from a piece to the next in its leaf.
        pieces: how many pieces cut the face. straight: of these, how many have a rod too straight, mm of bow.
        least_bow_mm: of these rods. strain: greatest, of the rods with the piece in their middle. longest_mm: piece.
        planned: the planned surface over all blocks as heights in the block frame. planned_error_mm: its greatest distance
            in height from the pieces.
        wires: the same by straight wires.
        problems: what keeps it from being made, in words.
    """

    number: int
    patch: Patch
    directions: tuple[Direction, ...]
    family: PlaneFamily
    columns: Columns
    blocks: tuple[PatchBlock, ...]
    deviation: PatchDeviation
    jump_mm: float
    jump_rad: float
    pieces: int
    straight: int
    least_bow_mm: float
    strain: float
    longest_mm: float
    planned: BSplineSurface
    planned_error_mm: float
    wires: WireComparison
    problems: tuple[str, ...]

    @property
    def block_frame(self) -> FloatArray:
        """(4, 4), pose of the block frame in the design."""
        pose = np.eye(4)
        pose[:3, :3] = self.patch.frame[:3, :3] @ self.family.pose
        pose[:3, 3] = self.patch.frame[:3, 3]
        return pose

    @property
    def used(self) -> BoolArray:
        """Which pieces, (leaves, columns), cut the face."""
        return np.isfinite(self.columns.chains.deviation)


def plan_patch(job: RationaliseJob, patch: Patch, decision: PatchDecision, number: int) -> PatchPlan:
    """The plan of a patch from what was decided about it: leaves fitted, measured and checked.

    Parameters:
        job: validated values. patch: what is cut. decision: from `decide_patch`. number: of the patch.
    """
    maker = PatchSearch(job, patch)
    family = maker.family(float(decision.angle), float(decision.turn))
    columns = maker.between(family, decision.borders, int(decision.least))
    chains, used = columns.chains, np.isfinite(columns.chains.deviation)
    deviation = measured(patch, family, chains)
    planned, planned_error = planned_surface(patch, family, columns, HEIGHTS_SHARE * job.leaves.tolerance_mm)
    jump_mm, jump_rad = greatest_jumps(chains, used)
    bows = maker.bows(chains)[used]
    strain = maker.strain(chains.parameters[used])
    longest = float(chains.parameters[used, 6].max(initial=0.0))
    straight = int((bows < job.rod.min_bow_mm).sum())
    problems = _problems(job, deviation, int(used.sum()), straight, strain, longest, maker.greatest_length)
    w = decision.wires
    return PatchPlan(
        number,
        patch,
        tuple(Direction(*row) for row in decision.directions.tolist()),
        family,
        columns,
        _blocks(job, patch, family, columns, deviation, planned),
        deviation,
        jump_mm,
        jump_rad,
        int(used.sum()),
        straight,
        float(bows.min(initial=np.inf)),
        strain,
        longest,
        planned,
        planned_error,
        WireComparison(int(w[0]), *w[1:].tolist()),
        problems,
    )


def _blocks(
    job: RationaliseJob,
    patch: Patch,
    family: PlaneFamily,
    columns: Columns,
    deviation: PatchDeviation,
    planned: BSplineSurface,
) -> tuple[PatchBlock, ...]:
    borders, points = columns.borders, deviation.points
    used = np.isfinite(columns.chains.deviation)
    offsets = piece_points(family, columns.chains)[..., 1]
    column = np.clip(np.searchsorted(borders, points[:, 0], side="right") - 1, 0, len(borders) - 2)
    row = np.clip(np.searchsorted(family.rows, points[:, 1], side="right") - 1, 0, len(family.rows) - 2)
    blocks = []
    for number, (r, c) in enumerate(occupied(patch, family, borders), start=1):
        size = np.abs(deviation.signed_mm[(row == r) & (column == c)])
        x, y = np.meshgrid(
            np.linspace(borders[c], borders[c + 1], 33), np.linspace(family.rows[r], family.rows[r + 1], 33)
        )
        z = planned.point(x, y)[..., 2]
        slack = 1e-6 * (family.rows[-1] - family.rows[0])
        low_y, high_y = family.rows[r] - slack, family.rows[r + 1] + slack
        crosses = ((offsets[:, c] >= low_y) & (offsets[:, c] <= high_y)).any(axis=1)
        blocks.append(
            PatchBlock(
                number,
                r,
                c,
                np.array([borders[c], family.rows[r], z.min() - job.blocks.clearance_mm]),
                np.array([borders[c + 1], family.rows[r + 1], z.max() + job.blocks.clearance_mm]),
                int((used[:, c] & crosses).sum()),
                float(size.max(initial=0.0)),
                float(size.mean()) if size.size else 0.0,
            )
        )
    return tuple(blocks)


def _problems(
    job: RationaliseJob,
    deviation: PatchDeviation,
    pieces: int,
    straight: int,
    strain: float,
    longest: float,
    greatest_length: float,
) -> tuple[str, ...]:
    """What keeps a patch from being made as the job asks."""
    found = []
    if not deviation.greatest_mm <= job.leaves.tolerance_mm:
        found.append(
            f"the cut lies up to {deviation.greatest_mm:.3g} mm from the face, the tolerance is "
            f"{job.leaves.tolerance_mm:g} mm"
        )
    if straight:
        found.append(
            f"{straight} of {pieces} rods have less than {job.rod.min_bow_mm:g} mm of bow over their chord and may snap: "
            "cut what is flat with a straight wire"
        )
    if strain > job.rod.max_strain:
        found.append(f"the greatest strain is {strain:.2%}, above {job.rod.max_strain:.2%}: take a thinner rod")
    if longest > greatest_length:
        found.append(
            f"the longest piece is {longest:.0f} mm, and the rod leaves {greatest_length:.0f} mm between the grippers"
        )
    return tuple(found)
