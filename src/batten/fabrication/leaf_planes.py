"""Which planes cut the leaves: as the job says, or turned by the least angle without a straight rod (Fisker2018 §5.4.3)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from batten.curves.elastica import states_along
from batten.errors import InvalidInputError
from batten.fabrication.checks.context import ROD_STATIONS, greatest
from batten.fabrication.checks.straightness import bow, least_bows_between
from batten.fabrication.job import CutJob
from batten.fabrication.placement import bow as rod_bow
from batten.fabrication.placement import rod_placement
from batten.fabrication.plan import Block
from batten.fabrication.wall import Wall
from batten.solvers.stability import margins
from batten.surfaces.plane import Plane
from batten.surfaces.rationalise import Chains
from batten.surfaces.straight_leaves import LeastTurn, least_turn
from batten.typing import FloatArray, IntArray

Fit = Callable[[tuple[Plane, ...], bool], Chains]
"""Chains for some planes: thoroughly, as they will be cut, or at first sight, without moving joints or adding leaves."""

MOST_TURN_DEG = 30.0
"""Greatest turn that `turn_deg = "auto"` tries."""
STEP_DEG = 0.5
"""Turns grow by this until one clears."""
UNIT_DEG = 0.05
"""Turns that are found are multiples of this: the least one that clears. A plane of 3 m moves by 1.3 mm at its ends."""
BEYOND_DEG = 4.0
"""So much more than the bows ask for is tried for the sake of margin and strain."""

_GAIN = 0.01  # of the bow that is needed: a turn that does not clear has to bring that much


class Clearance(NamedTuple):
    """How far a family of planes is from straight rods: the worst values of all rods, each placed as the cut will place it.

    `bow_mm`, least bow; `bow_between_mm`, the same on the way from each rod to the next one in its block, as the check
    "passes_straight" has it; `margin`, least margin of stability; `strain`, greatest strain.
    """

    bow_mm: float
    bow_between_mm: float
    margin: float
    strain: float


@dataclass(frozen=True, eq=False)
class LeafPlanes:
    """The planes of a cut.

    Attributes:
        planes: in cutting order.
        turn_deg: their turn; of a fan, that of the plane in the middle.
        border_turn_deg: of a fan, the size of the turn at its first and last plane; None for parallel planes.
        facts: what was found on the way, for the report.
    """

    planes: tuple[Plane, ...]
    turn_deg: float
    border_turn_deg: float | None = None
    facts: dict[str, float] = field(default_factory=dict)

    @property
    def repair(self) -> str:
        """What was done to the planes, in words; empty if nothing."""
        if not self.turn_deg:
            return ""
        if self.border_turn_deg is None:
            return f"planes turned by {self.turn_deg:g}°"
        side = np.copysign(self.border_turn_deg, self.turn_deg)
        return f"planes turned like a fan, by {self.turn_deg:g}° in the middle and {side:g}° at the borders"


def choose_planes(job: CutJob, wall: Wall, blocks: tuple[Block, ...], fit: Fit) -> LeafPlanes:
    """The planes that a job asks for.

    With a number for `leaves.turn_deg` they are turned by it: all alike (`leaves.planes` "parallel", Solution 1), or about
    two centres beside the wall ("fan", Solution 2, `surfaces.straight_leaves.fan_planes`). With "auto" they are turned by
    the least angle of either sense at which no rod comes near a line: every one as it will be placed, and on the way to the
    next, has `rod.min_bow_mm`, and all keep `rod.min_stability_margin` and `rod.max_strain`. If no angle up to 4° beyond the
    bows' own gives all of it, margin and strain are left to the checks, and the least one with these bows is taken; if none
    has them, that of the greatest least bow, as far as a first sight of each tells.

    A fan whose border planes stay has straight leaves where the wall's own borders are straight. With
    `leaves.border_turn_deg` "auto" the borders stay only if the leaves on them are not straight; else they turn by half.

    Parameters:
        job: limits and wishes. wall: with its blade axis. blocks: of it.
        fit: see `Fit`.

    Raises:
        InvalidInputError: a fan that is turned farther than its centres allow, or more at its borders than in its middle.

    Accuracy: a multiple of 0.05°, and the next lesser one does not do; sought in steps of 0.5° up to 30°, see `least_turn`.
    """
    wanted = job.leaves
    fan = wanted.planes == "fan"
    share = _border_share(job, wall, fit) if fan and wanted.border_turn_deg == "auto" else None

    def border(turn_deg: float) -> float | None:
        if not fan:
            return None
        if share is not None:
            return round(share * abs(turn_deg), 12)
        given = float(wanted.border_turn_deg)
        return min(given, abs(turn_deg)) if wanted.turn_deg == "auto" else given

    def planes(turn_deg: float) -> tuple[Plane, ...]:
        beside = border(turn_deg)
        return wall.planes(wanted.spacing_mm, np.radians(turn_deg), None if beside is None else np.radians(beside))

    if wanted.turn_deg != "auto":
        turn = float(wanted.turn_deg)
        if fan and wanted.border_turn_deg != "auto" and not wanted.border_turn_deg <= abs(turn):
            raise InvalidInputError(
                f"leaves.border_turn_deg = {wanted.border_turn_deg:g} with leaves.turn_deg = {turn:g}; allowed is at most "
                f"the size of turn_deg, which is the turn in the middle; try {0.5 * abs(turn):g}"
            )
        return LeafPlanes(planes(turn), turn, border(turn))
    most = min(MOST_TURN_DEG, _steepest_deg(wall, share, border(90.0))) if fan else MOST_TURN_DEG
    found, measured = _search(job, wall, blocks, fit, planes, most)
    turned = measured[found.turn]
    facts = {
        "least_bow_unturned_mm": measured[0.0].bow_mm,
        "least_bow_turned_mm": turned.bow_mm,
        "least_bow_between_turned_mm": turned.bow_between_mm,
        "least_stability_margin_turned": turned.margin,
    }
    facts = {name: value for name, value in facts.items() if np.isfinite(value)}  # a margin may be infinite
    return LeafPlanes(planes(found.turn), found.turn, border(found.turn), facts)


def _search(
    job: CutJob,
    wall: Wall,
    blocks: tuple[Block, ...],
    fit: Fit,
    planes: Callable[[float], tuple[Plane, ...]],
    most_deg: float,
) -> tuple[LeastTurn, dict[float, Clearance]]:
    """The least turn, and what was measured at every turn that was tried thoroughly."""
    measured: dict[float, Clearance] = {}
    glanced: dict[float, Clearance] = {}

    def thorough(turn: float) -> Clearance:
        if turn not in measured:
            measured[turn] = clearance(job, wall, blocks, fit(planes(turn), True))
        return measured[turn]

    def glance(turn: float) -> Clearance:
        if turn not in glanced:
            glanced[turn] = clearance(job, wall, blocks, fit(planes(turn), False))
        return glanced[turn]

    def of_bows(got: Clearance) -> float:
        least = job.rod.min_bow_mm
        return min(got.bow_mm, got.bow_between_mm) / least if least > 0.0 else np.inf

    def of_all(got: Clearance) -> float:
        least = job.rod.min_stability_margin
        return min(of_bows(got), got.margin / least if least > 0.0 else np.inf, job.rod.max_strain / got.strain)

    def search(measure: Callable[[Clearance], float], most: float) -> LeastTurn:
        return least_turn(
            lambda turn: measure(thorough(turn)),
            step=STEP_DEG,
            most=most,
            unit=UNIT_DEG,
            quick=lambda turn: of_bows(glance(turn)),  # strain falls when joints are moved
        )

    found = search(of_bows, most_deg)
    if not found.clears:
        best = max(glanced, key=lambda turn: (of_bows(glanced[turn]), -abs(turn)), default=0.0)
        if of_bows(thorough(best)) > found.clearance + _GAIN:
            found = LeastTurn(best, of_bows(measured[best]), False, found.tried)
    if found.clears and of_all(measured[found.turn]) < 1.0:
        better = search(of_all, min(most_deg, abs(found.turn) + BEYOND_DEG))
        found = better if better.clears else found
    return found, measured


def clearance(job: CutJob, wall: Wall, blocks: tuple[Block, ...], chains: Chains) -> Clearance:
    """`Clearance` of some chains.

    Degenerate: 0, and infinite strain, where a piece has no elastica or the rod is too short for it.
    """
    plane_index, block_index, parameters = crossing_pieces(wall, blocks, chains)
    if not (parameters[:, 6] < job.rod.length_mm).all():
        return Clearance(0.0, 0.0, 0.0, np.inf)
    before = spare_before(job, blocks, chains, plane_index, block_index, parameters)
    stations = np.linspace(0.0, job.rod.length_mm, ROD_STATIONS) - before[:, None]
    states = states_along(parameters, stations)
    rods = np.concatenate([states[:, 0, :4], parameters[:, 4:6], np.full((len(before), 1), job.rod.length_mm)], axis=1)
    successive = np.flatnonzero(block_index[1:] == block_index[:-1])
    pairs = np.stack([successive, successive + 1], axis=1)
    curvature = states[..., 3]
    return Clearance(
        float(bow(states[..., :2]).min()),
        float(least_bows_between(curvature, rods[:, 6], pairs).min(initial=np.inf)),
        float(margins(rods).min()),
        float(greatest(np.abs(curvature)).max()) * job.rod.section.half_depth_mm,
    )


def crossing_pieces(wall: Wall, blocks: tuple[Block, ...], chains: Chains) -> tuple[IntArray, IntArray, FloatArray]:
    """The pieces that are cut, block by block: indices of their planes and blocks, (k,), and parameters, (k, 7)."""
    plane_index, block_index = wall.crossings(chains.planes, blocks)
    columns = np.array([b.column for b in blocks])[block_index]
    return plane_index, block_index, chains.parameters[plane_index, columns]


def spare_before(
    job: CutJob,
    blocks: tuple[Block, ...],
    chains: Chains,
    plane_index: IntArray,
    block_index: IntArray,
    parameters: FloatArray,
) -> FloatArray:
    """How much of the rod lies before each of the `crossing_pieces`, mm, (k,): `rod_placement`."""
    low = np.array([b.corner_mm for b in blocks])[block_index]
    high = low + np.array([b.size_mm for b in blocks])[block_index]
    planes = tuple(chains.planes[i] for i in plane_index)
    return rod_placement(parameters, planes, low, high, block_index, job.rod, job.gripper)


def least_bows(job: CutJob, chains: Chains) -> FloatArray:
    """Least bow of the rods of each chain, mm, (leaves,), over places of the piece from one end of the rod to the other."""
    bows = np.full(chains.deviation.shape, np.inf)
    known = np.isfinite(chains.parameters).all(axis=-1) & np.isfinite(chains.deviation)
    parameters = chains.parameters[known]
    spare = job.rod.length_mm - parameters[:, 6]
    bows[known] = np.min([rod_bow(parameters, f * spare, job.rod.length_mm) for f in np.linspace(0.0, 1.0, 5)], axis=0)
    return np.asarray(bows.min(axis=1))


def _border_share(job: CutJob, wall: Wall, fit: Fit) -> float:
    """The turn at the borders over that in the middle: 0 if the rods on the wall's borders are not straight, else ½."""
    planes = wall.planes(job.leaves.spacing_mm, 0.0)
    on_border = least_bows(job, fit((planes[0], planes[-1]), False))
    return 0.0 if float(on_border.min()) >= job.rod.min_bow_mm else 0.5


def _steepest_deg(wall: Wall, share: float | None, border_deg: float | None) -> float:
    """The greatest turn α that keeps a fan's centres beside the wall, tan α ≤ D/W + 2 tan β, in hundredths of °."""
    size = wall.high - wall.low
    slender = float(size[1 - wall.along] / size[wall.along])
    angle = np.radians(np.linspace(0.0, 89.0, 8901))
    border = share * angle if share is not None else np.minimum(np.radians(border_deg or 0.0), angle)
    return float(np.degrees(angle[np.tan(angle) <= slender + 2.0 * np.tan(border)][-1]))
