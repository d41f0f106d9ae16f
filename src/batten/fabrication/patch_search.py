"""How a patch is to be cut: a search for the blade's direction, the columns of blocks and the turn of the planes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from batten.curves.elastica import states_along
from batten.fabrication.patch_pieces import occupied
from batten.fabrication.placement import bow
from batten.fabrication.rationalise_job import RationaliseJob
from batten.surfaces.columns import Columns, fewest_columns
from batten.surfaces.hot_wire import best_wire_direction, wire_columns, wires_between
from batten.surfaces.patches import Patch
from batten.surfaces.plane_family import Direction, PlaneFamily, best_direction, fitted, plane_family
from batten.surfaces.rationalise import Chains
from batten.surfaces.straight_leaves import least_turn
from batten.typing import BoolArray, FloatArray

Progress = Callable[[str, int, int], None]

FIT_SHARE = 0.9
"""Share of the tolerance that a piece may take in its plane: the rest is for heights, and between leaves."""

_TRIED = 3  # directions for which the columns are worked out
_ALIKE = 1.15  # of the least expected number of blocks: directions up to this are tried
_MOST_MORE = 1.6  # times the fewest blocks found: no direction with more than that is looked for
_MOST_TURN_DEG, _STEP_DEG, _UNIT_DEG = 15.0, 0.5, 0.05
_FLAT = 0.5  # share of straight rods from which no small turn can help
_WIRE_SHARE = 4  # wires are laid for one leaf in so many


@dataclass(frozen=True)
class WireComparison:
    """The same patch cut by a straight hot wire, in blocks no greater than the blade's.

    Attributes:
        blocks: so many the wire needs for the same tolerance, in the direction that suits it best. angle: that direction in
            the patch's plan, radians.
        same_count_mm: greatest distance in that direction with no more blocks than the blade has, but at least one a row;
            NaN if blocks of the greatest size are too few.
        same_blocks_mm: greatest distance in the blade's own blocks, along its planes.
        step_mm, kink_rad: greatest jump of position and tangent from wire to wire where it keeps the tolerance.
    """

    blocks: int
    angle: float
    same_count_mm: float
    same_blocks_mm: float
    step_mm: float
    kink_rad: float


@dataclass(frozen=True, eq=False)
class PatchDecision:
    """What takes long to find: from it the plan of a patch is made again at once.

    Attributes:
        angle, turn: (), radians, of blocks and planes. borders: (c + 1,), of the columns. least: (), see `Columns`.
        directions: (k, 4), angle, blocks, straight share and deviation of the directions looked at.
        wires: (6,), the numbers of `WireComparison`.
    """

    angle: FloatArray
    turn: FloatArray
    borders: FloatArray
    least: FloatArray
    directions: FloatArray
    wires: FloatArray


def decide_patch(job: RationaliseJob, patch: Patch, tell: Progress) -> PatchDecision:
    """Search direction, columns and turn of a patch, and what a wire would need.

    Parameters:
        job: validated values. patch: what is cut.
        tell: called as tell(what, done, of).
    """
    maker = PatchSearch(job, patch)
    directions: tuple[Direction, ...] = ()
    if job.leaves.direction_deg == "auto":
        best, directions = best_direction(
            patch.plan,
            job.leaves.spacing_mm,
            job.blocks.greatest_mm,
            maker.tolerance,
            is_straight=lambda chains: maker.bows(chains) < job.rod.min_bow_mm,
            progress=lambda done, of: tell("direction", done, of),
        )
        angles, others = _worth_trying(best, directions)
    else:
        angles, others = (float(np.radians(job.leaves.direction_deg)),), ()
    family, columns = maker.best(angles, others, tell)
    tell("straight wires", 0, 1)
    wires = maker.wires(family, columns)
    tell("straight wires", 1, 1)
    return PatchDecision(
        np.array(family.angle),
        np.array(family.turn),
        columns.borders,
        np.array(float(columns.least)),
        np.array([(d.angle, d.blocks, d.straight, d.deviation) for d in directions]).reshape(-1, 4),
        np.array([wires.blocks, wires.angle, wires.same_count_mm, wires.same_blocks_mm, wires.step_mm, wires.kink_rad]),
    )


class PatchSearch:
    """The steps for one patch, with the job's limits at hand."""

    def __init__(self, job: RationaliseJob, patch: Patch) -> None:
        self.job, self.patch = job, patch
        self.tolerance = FIT_SHARE * job.leaves.tolerance_mm
        self.greatest_length = job.rod.length_mm - 2.0 * (job.gripper.radius_mm + job.gripper.clearance_mm)

    def family(self, angle: float, turn: float = 0.0) -> PlaneFamily:
        """Planes over the patch."""
        return plane_family(
            self.patch.plan, angle, self.job.leaves.spacing_mm, self.job.blocks.greatest_mm[1], turn=turn
        )

    def columns(self, family: PlaneFamily, tell: Progress, at_most: int = 10**6) -> Columns:
        """The fewest columns, and no more than `at_most`."""
        return fewest_columns(
            self.patch.plan,
            family,
            self.tolerance,
            greatest_width=self.job.blocks.greatest_mm[0],
            greatest_length=self.greatest_length,
            at_most=at_most,
            progress=lambda done, of: tell("columns", done, of),
        )

    def between(self, family: PlaneFamily, borders: FloatArray, least: int) -> Columns:
        """Columns with given borders, as `fewest_columns` leaves them."""
        chains = fitted(self.patch.plan, family, borders, self.tolerance)
        deviation = float(np.nanmax(chains.deviation, initial=0.0))
        return Columns(borders, chains, deviation, least, deviation <= self.tolerance)

    def best(self, angles: tuple[float, ...], others: tuple[float, ...], tell: Progress) -> tuple[PlaneFamily, Columns]:
        """Of some directions the one with the fewest blocks in which no rod is too straight, of equals the closest.

        A direction with a few straight rods is taken with its planes turned, if a turn clears it. If none of `angles` can be
        cleared, `others` are tried; if none of those, it is the one with the fewest blocks, straight rods and all.
        """
        found: list[tuple[bool, int, float, PlaneFamily, Columns]] = []
        for group in (angles, others):
            new: list[tuple[bool, int, float, PlaneFamily, Columns]] = []
            for angle in group:
                family = self.family(angle)
                fewest = min((entry[1] for entry in [*found, *new] if not entry[0]), default=10**6)
                columns = self.columns(family, tell, int(_MOST_MORE * fewest / (len(family.rows) - 1)) + 1)
                count = len(occupied(self.patch, family, columns.borders))
                new.append((not columns.kept, count, columns.deviation, family, columns))
            new.sort(key=lambda entry: entry[:3])
            for failed, _, _, family, columns in new:
                asked = self.job.leaves.turn_deg
                turn = self.turn(family, columns) if asked == "auto" else float(np.radians(asked))
                if failed or turn is None:
                    continue
                if turn == 0.0:
                    return family, columns
                turned = self.family(family.angle, turn)
                columns = self.columns(turned, tell)
                if columns.kept:
                    return turned, columns
            found = sorted([*found, *new], key=lambda entry: entry[:3])
        return found[0][3], found[0][4]

    def bows(self, chains: Chains) -> FloatArray:
        """Bow of the rods of all pieces with the piece in their middle, mm, (m, c); NaN where there is no piece."""
        parameters = chains.parameters.reshape(-1, 7)
        bows = np.full(len(parameters), np.nan)
        known = np.isfinite(parameters).all(axis=1)
        length = self.job.rod.length_mm
        bows[known] = bow(parameters[known], 0.5 * (length - parameters[known, 6]), length)
        return bows.reshape(chains.deviation.shape)

    def strain(self, parameters: FloatArray) -> float:
        """Greatest strain anywhere on rods with their pieces (n, 7) in their middle."""
        if not len(parameters):
            return 0.0
        length = self.job.rod.length_mm
        s = -0.5 * (length - parameters[:, 6:]) + np.linspace(0.0, length, 129)
        curvature = np.abs(states_along(parameters, s)[..., 3]).max()
        return float(curvature * self.job.rod.section.half_depth_mm)

    def turn(self, family: PlaneFamily, columns: Columns) -> float | None:
        """The least turn of the planes that leaves no rod too straight, radians; None if none does."""
        wanted = self.job.rod.min_bow_mm
        used = np.isfinite(columns.chains.deviation)
        bows = self.bows(columns.chains)[used]
        share = float((bows < wanted).mean()) if bows.size else 0.0
        if share == 0.0:
            return 0.0
        if share >= _FLAT:
            return None

        def clearance(degrees: float, share: int) -> float:
            turned = self.family(family.angle, float(np.radians(degrees)))
            rows = None if share == 1 else turned.some(share)
            chains = fitted(self.patch.plan, turned, columns.borders, self.tolerance, rows=rows, rounds=0)
            counts = np.isfinite(chains.deviation)
            return float(np.where(counts, self.bows(chains), np.inf).min()) / wanted

        found = least_turn(
            lambda degrees: clearance(degrees, 1),
            step=_STEP_DEG,
            most=_MOST_TURN_DEG,
            unit=_UNIT_DEG,
            quick=lambda degrees: clearance(degrees, 6),
        )
        return float(np.radians(found.turn)) if found.clears else None

    def wires(self, family: PlaneFamily, columns: Columns) -> WireComparison:
        """The same patch by straight wires."""
        plan, job = self.patch.plan, self.job
        corners = np.concatenate(plan.polygons())
        low, high = corners.min(axis=0), corners.max(axis=0)

        def inside(points: FloatArray) -> BoolArray:
            return plan.contains(points[..., 0], points[..., 1])

        best = best_wire_direction(
            plan.surface,
            low,
            high,
            _WIRE_SHARE * job.leaves.spacing_mm,
            self.tolerance,
            row_width=job.blocks.greatest_mm[1],
            longest=job.blocks.greatest_mm[0],
            inside=inside,
        )
        wires = best.columns
        blocks = len(occupied(self.patch, family, columns.borders))
        rows = max(1, -(-best.pieces // wires.count))
        ends = wires.edges[:, 0], wires.edges[:, -1]
        count = max(1, blocks // rows)
        width = float((ends[1] - ends[0]).max())
        same = np.nan
        if count * job.blocks.greatest_mm[0] >= width * (1.0 - 1e-9):
            longest = max(job.blocks.greatest_mm[0], width / count)
            same = wire_columns(
                plan.surface, wires.planes, *ends, self.tolerance, inside, longest=longest, count=count
            ).worst
        some = family.some(_WIRE_SHARE)
        own = wires_between(
            plan.surface, [family.planes[i] for i in some], family.edges(columns.borders)[some], inside
        ).worst
        step, kink = (float(np.nanmax(np.abs(v), initial=0.0)) for v in (wires.steps, wires.kinks))
        return WireComparison(best.pieces, best.turn_rad, float(same), own, step, kink)


def _worth_trying(best: Direction, directions: tuple[Direction, ...]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Angles of a few directions that are expected to need about as few blocks as the best one, which comes first.

    And those of the fewest blocks without any straight rod.
    """
    ranked = sorted(directions, key=lambda d: (d.blocks, d.deviation))
    near = [d.angle for d in ranked if d.blocks <= _ALIKE * best.blocks and d.straight <= best.straight + 0.05]
    first = tuple(dict.fromkeys((best.angle, *near)))[:_TRIED]
    return first, tuple([d.angle for d in ranked if d.straight == 0.0 and d.angle not in first][:_TRIED])
