"""Parallel planes over a patch: how they lie in its plan, in rows of blocks, and which way lets few blocks do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from batten.errors import InvalidInputError
from batten.surfaces.face import Face
from batten.surfaces.foliation import blade_directions, covering_offsets, parallel_planes
from batten.surfaces.plane import Plane
from batten.surfaces.rationalise import Chains, rationalise
from batten.typing import BoolArray, FloatArray, IntArray

ANGLES = 12
"""Directions that the scan looks at, evenly over half a turn."""

ABSENT = -1
"""Status of a piece that its leaf does not need."""

_SHARE = 6  # of the leaves, one in so many is looked at
_GROWTH = 0.25  # a column's width goes with so high a power of its deviation: a fit of four free numbers
_FAR = 10.0  # times the tolerance: from there on it goes with the square root
_FINER = (0.5, 0.25)  # of the scan's step: how far around the best direction two more rounds look
_REACH = 0.5 * (1.0 - 1e-5)  # of the distance between planes
_INWARD = 1.0 - 1e-5  # towards the patch's middle, so that its outline counts as inside
_LOOKED_AT = 513  # points of a plane at which it is seen whether it meets the plan
_LEAST_PART = 0.1
_CLEARED = 0.25  # a smaller share of straight rods than this is left to a small turn of the planes


@dataclass(frozen=True, eq=False)
class PlaneFamily:
    """Parallel vertical planes over a plan, and the box around the plan that is cut into blocks.

    Attributes:
        angle: of the blocks' long side in plan, radians, counter-clockwise from x.
        turn: of the planes against the blocks, radians, counter-clockwise; 0 if the blade runs along the blocks.
        low, high: (2,), the box around the plan along the blocks and across them.
        rows: (r + 1,), borders of the rows of blocks across, ascending; planes of the family where there is no turn.
        planes: towards greater y across; their x is counted along the plane from the origin's foot.
        looked_at: (k,), abscissae in the planes at which it was seen whether they meet the plan. met: (m, k), whether the
            plane or a neighbour does.
    """

    angle: float
    turn: float
    low: FloatArray
    high: FloatArray
    rows: FloatArray
    planes: tuple[Plane, ...]
    looked_at: FloatArray
    met: BoolArray

    @property
    def pose(self) -> FloatArray:
        """(3, 3): takes points with x along the blocks, y across them and z up to the plan's frame."""
        along, across = blade_directions("x", self.angle)
        return np.array([[along[0], across[0], 0.0], [along[1], across[1], 0.0], [0.0, 0.0, 1.0]])

    def edges(self, borders: FloatArray) -> FloatArray:
        """Abscissae of the columns' borders, (c + 1,), in every plane: (m, c + 1)."""
        along = blade_directions("x", self.angle)[0]
        start = np.array([p.origin[:2] @ along for p in self.planes])
        return np.asarray((borders - start[:, None]) / np.cos(self.turn))

    def clipped(self, borders: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Where the pieces of each plane begin and end, (m, c) each, in its x, and which columns (m, c) it needs at all.

        A plane needs a column in which it, or a neighbour, meets the plan. Pieces reach from border to border; where no
        column follows that is needed, they are drawn in to where the plan is met, but to no less than a part of the column:
        a shorter piece would say too little about the rod that is bent through the whole block.
        """
        edges = self.edges(borders)
        m, c = len(edges), len(borders) - 1
        width = np.diff(edges)
        step = float(self.looked_at[1] - self.looked_at[0])
        leaf, at = np.nonzero(self.met)
        x = self.looked_at[at]
        column = np.clip((x[:, None] >= edges[leaf]).sum(axis=1) - 1, 0, c - 1)
        beyond = (x < edges[leaf, 0]) | (x > edges[leaf, -1])
        leaf, column, x = leaf[~beyond], column[~beyond], x[~beyond]
        first, last, count = np.full((m, c), np.inf), np.full((m, c), -np.inf), np.zeros((m, c))
        np.minimum.at(first, (leaf, column), x)
        np.maximum.at(last, (leaf, column), x)
        np.add.at(count, (leaf, column), 1)
        needed = np.asarray(count >= 2)
        needed |= (count == 1) & ~needed.any(axis=1, keepdims=True)
        none = np.zeros((m, 1), dtype=np.bool_)
        opens = needed & ~np.concatenate([none, needed[:, :-1]], axis=1)
        closes = needed & ~np.concatenate([needed[:, 1:], none], axis=1)
        part = _LEAST_PART * width
        start = np.where(opens, np.clip(first - step, edges[:, :-1], edges[:, 1:] - part), edges[:, :-1])
        end = np.where(closes, np.clip(last + step, edges[:, :-1] + part, edges[:, 1:]), edges[:, 1:])
        short = end - start < part
        middle = np.clip(0.5 * (start + end) - 0.5 * part, edges[:, :-1], edges[:, 1:] - part)
        return np.where(short, middle, start), np.where(short, middle + part, end), needed

    def some(self, share: int = _SHARE) -> IntArray:
        """Indices of one plane in `share` of those that meet the plan, evenly; at least eight, or all."""
        known = np.flatnonzero(self.met.any(axis=1))
        count = min(len(known), max(8, -(-len(known) // share)))
        return np.asarray(known[np.unique(np.rint(np.linspace(0, len(known) - 1, count + 2)[1:-1]).astype(int))])


@dataclass(frozen=True, eq=False)
class Direction:
    """What the scan found for one direction.

    Attributes:
        angle: radians. blocks: how many blocks are expected to do, not a whole number.
        straight: share of the pieces whose rod would be straight.
        deviation: greatest distance of a piece from its leaf, at the blocks' greatest width, joints held.
    """

    angle: float
    blocks: float
    straight: float
    deviation: float


def plane_family(plan: Face, angle: float, spacing: float, greatest_depth: float, *, turn: float = 0.0) -> PlaneFamily:
    """Planes along `angle` that cover a plan, in rows of equal depth.

    Parameters:
        plan: heights over x and y (`Patch.plan`).
        angle: of the blocks, radians.
        spacing: greatest distance of neighbouring planes, above 0.
        greatest_depth: of a row, above 0.
        turn: of the planes against the blocks (Fisker2018 §5.4.3, Solution 1), within ±1 rad.

    Raises:
        InvalidInputError: values outside these bounds.

    Example:
        >>> import numpy as np
        >>> from batten.surfaces.bspline_surface import BSplineSurface
        >>> net = [[(x, y, 0.0) for y in (0.0, 5.0)] for x in (0.0, 9.0)]
        >>> family = plane_family(Face(BSplineSurface([0, 0, 9, 9], [0, 0, 5, 5], 1, 1, net)), 0.0, 1.5, 3.0)
        >>> family.rows.tolist(), [float(p.origin[1]) for p in family.planes]
        ([0.0, 2.5, 5.0], [0.0, 1.25, 2.5, 3.75, 5.0])
    """
    if not (spacing > 0.0 and greatest_depth > 0.0 and np.isfinite(angle) and abs(turn) <= 1.0):
        raise InvalidInputError(
            f"spacing = {spacing}, greatest_depth = {greatest_depth}, angle = {angle}, turn = {turn}; allowed are numbers "
            "above 0, a finite angle and a turn within ±1 rad"
        )
    corners = np.concatenate(plan.polygons())
    along, across = blade_directions("x", angle)
    turned = np.stack([corners @ along, corners @ across], axis=1)
    low, high = turned.min(axis=0), turned.max(axis=0)
    depth = float(high[1] - low[1])
    rows = np.linspace(low[1], high[1], max(1, int(np.ceil(depth / greatest_depth - 1e-9))) + 1)
    if turn == 0.0:
        steps = max(1, int(np.ceil((rows[1] - rows[0]) / spacing - 1e-9)))
        offsets = np.linspace(low[1], high[1], steps * (len(rows) - 1) + 1)
    else:
        middle = 0.5 * (low + high)
        offsets = covering_offsets("x", [low, high], spacing, turn_rad=turn)
        offsets = offsets + float(middle @ blade_directions("x", turn)[1])
    planes = parallel_planes("x", offsets, turn_rad=angle + turn)
    x = np.linspace(*_ends(corners @ planes[0].x_axis[:2]), _LOOKED_AT)
    points = np.stack([p.origin[:2] + x[:, None] * p.x_axis[:2] for p in planes])
    return PlaneFamily(angle, turn, low, high, rows, planes, x, counted(plan, points, _step(planes)))


def _ends(values: FloatArray) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def _step(planes: tuple[Plane, ...]) -> FloatArray:
    """From each plane to the next, (2,), in plan; 0 for a single one."""
    return np.asarray((planes[-1].origin - planes[0].origin)[:2] / max(len(planes) - 1, 1))


def counted(plan: Face, points: FloatArray, step: FloatArray) -> BoolArray:
    """Which points (…, 2 or 3) lie on the plan, or next to it, within half a step to the next plane on either side.

    The blade goes straight from leaf to leaf: of a leaf just outside the plan comes what lies just inside, half-way at most.
    """
    at = _INWARD * points[..., :2]
    return _near(plan, at, 0.0 * step) | _near(plan, at, _REACH * step) | _near(plan, at, -_REACH * step)


def _near(plan: Face, at: FloatArray, step: FloatArray) -> BoolArray:
    return plan.contains(at[..., 0] + step[0], at[..., 1] + step[1])


def best_direction(
    plan: Face,
    spacing: float,
    greatest: tuple[float, float],
    tolerance: float,
    *,
    is_straight: Callable[[Chains], BoolArray] | None = None,
    angles: int = ANGLES,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Direction, tuple[Direction, ...]]:
    """The direction of the blade that is expected to need the fewest blocks.

    For every direction of an even scan, and for the sides of the smallest box around the plan, a sixth of the leaves are
    fitted, cut into columns of at most the greatest width; joints are held. A column whose leaves stray d, r = d/tolerance
    of what they may, counts as max(1, r^¼), and from r = 10 on as 10^¼ (r/10)^½: such pieces are far from an elastica.
    Directions with fewer straight rods come first, then those of fewer columns times rows; around the best
    one, two finer rounds look a half and a quarter of a step to either side.

    Parameters:
        plan: heights over x and y.
        spacing: of the leaves.
        greatest: width along the blade and depth across it of a block.
        tolerance: greatest distance wanted.
        is_straight: which pieces, (m, c), have a rod too straight to hold its shape; None for none.
        angles: number of directions in the scan.
        progress: called with (directions done, in all).

    Returns:
        The best direction, and all that were looked at, by angle in [0, π).

    Accuracy: the count is an estimate; `columns` finds what is really needed.
    """
    found: dict[float, Direction] = {}
    step = np.pi / angles
    total = angles + 2 * len(_FINER) + 2

    def look(angle: float) -> None:
        if angle % np.pi not in found:
            found[angle % np.pi] = _direction(plan, angle % np.pi, spacing, greatest, tolerance, is_straight)
        if progress is not None:
            progress(min(len(found), total), total)

    for angle in (*(k * step for k in range(angles)), *_box_angles(plan)):
        look(angle)
    for finer in _FINER:
        best = min(found.values(), key=_rank)
        for side in (-1.0, 1.0):
            look(best.angle + side * finer * step)
    return min(found.values(), key=_rank), tuple(found[a] for a in sorted(found))


def _box_angles(plan: Face) -> tuple[float, float]:
    """Both sides' directions of the least rectangle around the plan: one side lies along its convex hull."""
    from scipy.spatial import ConvexHull

    corners = np.concatenate(plan.polygons())
    hull = corners[ConvexHull(corners).vertices]
    sides = np.roll(hull, -1, axis=0) - hull
    angles = np.arctan2(sides[:, 1], sides[:, 0])
    along, across = (np.stack([np.cos(a), np.sin(a)]) for a in (angles, angles + 0.5 * np.pi))
    areas = np.ptp(hull @ along, axis=0) * np.ptp(hull @ across, axis=0)
    best = float(angles[int(np.argmin(areas))])
    return best, best + 0.5 * np.pi


def _rank(direction: Direction) -> tuple[float, float, float]:
    return float(np.floor(direction.straight / _CLEARED)), round(direction.blocks, 3), direction.deviation


def _direction(
    plan: Face,
    angle: float,
    spacing: float,
    greatest: tuple[float, float],
    tolerance: float,
    is_straight: Callable[[Chains], BoolArray] | None,
) -> Direction:
    family = plane_family(plan, angle, spacing, greatest[1])
    count = max(1, int(np.ceil((family.high[0] - family.low[0]) / greatest[0] - 1e-9)))
    borders = np.linspace(family.low[0], family.high[0], count + 1)
    chains = fitted(plan, family, borders, tolerance, rows=family.some(), rounds=0)
    counts = np.isfinite(chains.deviation)
    worst = np.where(counts, chains.deviation, 0.0).max(axis=0)
    ratio = worst / tolerance
    needs = np.clip(ratio, 1.0, _FAR) ** _GROWTH * np.maximum(ratio / _FAR, 1.0) ** 0.5
    blocks = (len(family.rows) - 1) * float(needs.sum())
    straight = 0.0 if is_straight is None else float((is_straight(chains) & counts).sum() / max(int(counts.sum()), 1))
    return Direction(angle, blocks, straight, float(worst.max()))


def fitted(
    plan: Face,
    family: PlaneFamily,
    borders: FloatArray,
    tolerance: float,
    *,
    rows: IntArray | None = None,
    rounds: int = 4,
) -> Chains:
    """Chains of elastica between the columns' borders, for the part of each leaf that meets the plan.

    Parameters:
        plan: heights over x and y.
        family: its planes. borders: (c + 1,), ascending along the blocks.
        tolerance, rounds: see `rationalise`.
        rows: indices of the planes to take; None for all.

    Returns:
        Chains of c pieces each, which begin and end as `PlaneFamily.clipped` says; where a leaf needs no piece, NaN and the
        status `ABSENT`.
    """
    chosen = np.arange(len(family.planes)) if rows is None else rows
    all_starts, all_ends, all_needed = family.clipped(borders)
    start, end, needed = all_starts[chosen], all_ends[chosen], all_needed[chosen]
    m, c = needed.shape
    chains = Chains(
        tuple(family.planes[i] for i in chosen),
        family.edges(borders)[chosen],
        np.full((m, c + 1, 2), np.nan),
        np.full((m, c + 1, 2), np.nan),
        np.full((m, c, 7), np.nan),
        np.full((m, c), ABSENT),
        *(np.full((m, c), np.nan) for _ in range(3)),
    )
    for (first, last), members in _runs(needed).items():
        leaves = np.array(members)
        edges = np.concatenate([start[leaves, first:last], end[leaves, last - 1 : last]], axis=1)
        part = fit_rows(plan, family, chosen[leaves], edges, tolerance, rounds=rounds)
        for name in ("joints", "moved"):
            getattr(chains, name)[leaves, first : last + 1] = getattr(part, name)
        for name in ("parameters", "status", "deviation", "first_deviation", "lambda_residual"):
            getattr(chains, name)[leaves, first:last] = getattr(part, name)
    return chains


def _runs(needed: BoolArray) -> dict[tuple[int, int], list[int]]:
    """For each run of neighbouring columns, (first, last + 1), the leaves that need just these: a chain of each."""
    found: dict[tuple[int, int], list[int]] = {}
    for leaf, row in enumerate(needed):
        steps = np.flatnonzero(np.diff(np.concatenate([[False], row, [False]]).astype(np.int8)))
        for first, last in steps.reshape(-1, 2).tolist():
            found.setdefault((first, last), []).append(leaf)
    return found


def fit_rows(
    plan: Face,
    family: PlaneFamily,
    rows: IntArray,
    edges: FloatArray,
    tolerance: float,
    *,
    rounds: int,
) -> Chains:
    """Chains of elastica for the planes `rows` of a family (see `rationalise`); what counts is said by `counted`."""
    step = _step(family.planes)
    return rationalise(
        plan.surface,
        tuple(family.planes[i] for i in rows),
        edges,
        tolerance,
        inside=lambda points: counted(plan, points, step),
        extend=0.5,
        rounds=rounds,
    )
