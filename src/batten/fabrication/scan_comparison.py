"""How far the scan of a cut part lies from the design: distances, percentiles, block by block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from batten.errors import InvalidInputError
from batten.fabrication.plan import Block
from batten.fabrication.scan import Registration, ScanDesign, on_border, placed
from batten.typing import ArrayLike, FloatArray, IntArray

PERCENTILES = (50.0, 90.0, 95.0, 99.0, 100.0)
CELLS = 60
"""Cells of the design's plan along its longer side, by which it is told what the scan covers."""

_CHUNK = 50_000


@dataclass(frozen=True, eq=False)
class ScanDistances:
    """Every point of a scan against the design.

    Attributes:
        signed_mm: shape (n,): distance to the nearest point of the design, positive above it (too much foam); NaN for
            points that do not count.
        feet_mm: shape (n, 2): plan position of that nearest point; NaN likewise.
        far: how many points lie farther than `reach_mm` from the design: other things, or a gross fault.
        beyond: how many have their nearest point on the design's border, as a block's sides have.
        not_finite: how many are no points at all.
    """

    signed_mm: FloatArray
    feet_mm: FloatArray
    far: int
    beyond: int
    not_finite: int


@dataclass(frozen=True, eq=False)
class BlockDistances:
    """The points over one block, or over all (`block` 0): NaN where there are none.

    `percentiles_mm` of the distances without sign at `PERCENTILES`; `mean_mm` with sign; `within`: share of the points
    within the tolerance; `covered`: share of the block's cells of the plan that hold a point.
    """

    block: int
    points: int
    mean_mm: float
    lowest_mm: float
    highest_mm: float
    percentiles_mm: FloatArray
    within: float
    covered: float


@dataclass(frozen=True, eq=False)
class ScanComparison:
    """A scan compared with its design: `whole` over all of it, then block by block, those without a point left out.

    `boxes` are the cut's blocks, whether scanned or not.
    """

    design: ScanDesign
    registration: Registration
    distances: ScanDistances
    tolerance_mm: float
    reach_mm: float
    share: float
    whole: BlockDistances
    blocks: tuple[BlockDistances, ...]
    boxes: tuple[Block, ...]

    @property
    def failing(self) -> tuple[int, ...]:
        """Numbers of the blocks where less than `share` of the points lie within the tolerance."""
        return tuple(b.block for b in self.blocks if b.within < self.share)

    @property
    def is_good(self) -> bool:
        """Whether something was measured and no block fails."""
        return self.whole.points > 0 and not self.failing


def scan_distances(design: ScanDesign, points: FloatArray, reach_mm: float) -> ScanDistances:
    """Signed distances of a scan's points from the design (Fisker2018 Fig. 1.2: nearest neighbour).

    Parameters:
        design: what was to be cut.
        points: shape (n, 3), in the wall frame, mm.
        reach_mm: points farther away do not count, above 0.

    Returns:
        One distance for each point.

    Raises:
        InvalidInputError: points of another shape, a reach that is not above 0.

    Accuracy: that of `surfaces.deviation.surface_deviation`, 1e-12 of the surface's size.
    """
    if points.ndim != 2 or points.shape[1] != 3 or not reach_mm > 0.0:
        raise InvalidInputError(
            f"points of shape {points.shape}, reach_mm = {reach_mm}; allowed are (n, 3) and above 0"
        )
    signed, feet = np.full(len(points), np.nan), np.full((len(points), 2), np.nan)
    finite = np.isfinite(points).all(axis=1)
    rows = np.flatnonzero(finite)
    sample, _ = design.tree.query(points[rows], workers=-1, distance_upper_bound=reach_mm + design.spacing)
    near = rows[np.isfinite(sample)]  # a surface point lies within one spacing of a sample: the others are too far
    far, beyond = len(rows) - len(near), 0
    for start in range(0, len(near), _CHUNK):
        part = near[start : start + _CHUNK]
        u, v = design.surface.closest_parameters(points[part])
        d = design.surface.derivatives(u, v, 1)
        away = points[part] - d[0, 0]
        normal = np.cross(d[1, 0], d[0, 1])
        side = (away * normal).sum(axis=1) * np.where(normal[:, 2] < 0.0, -1.0, 1.0)
        size = np.linalg.norm(away, axis=1)
        outside = on_border(design.surface, u, v) | ~design.holds(d[0, 0])
        counts = ~outside & (size <= reach_mm)
        beyond += int((outside & (size <= reach_mm)).sum())
        far += int((size > reach_mm).sum())
        signed[part[counts]] = np.where(side < 0.0, -size, size)[counts]
        feet[part[counts]] = d[0, 0][counts, :2]
    return ScanDistances(signed, feet, far, beyond, int((~finite).sum()))


def compare_scan(
    design: ScanDesign,
    blocks: Sequence[Block],
    points: ArrayLike,
    registration: Registration,
    *,
    tolerance_mm: float,
    reach_mm: float = 20.0,
    share: float = 0.95,
) -> ScanComparison:
    """Distances of a registered scan from its design, over all and block by block.

    Parameters:
        design: what was to be cut.
        blocks: the blocks of the cut.
        points: the scan, shape (n, 3), mm, in the scan's own frame.
        registration: where it lies.
        tolerance_mm: how far a point may lie from the design, above 0.
        reach_mm: points farther away do not count; they are numbered. Above 0.
        share: a block fails if less than this share of its points is within the tolerance, in (0, 1]. Scans are noisy:
            1 asks for every single point.

    Returns:
        The comparison. Points count as they were scanned: where the scan is denser there are more.

    Raises:
        InvalidInputError: a value outside its bounds.
    """
    if not (tolerance_mm > 0.0 and 0.0 < share <= 1.0):
        raise InvalidInputError(f"tolerance_mm = {tolerance_mm}, share = {share}; allowed are above 0, and in (0, 1]")
    distances = scan_distances(design, placed(registration.pose, np.asarray(points, dtype=np.float64)), reach_mm)
    rows = np.flatnonzero(np.isfinite(distances.signed_mm))
    signed, feet = distances.signed_mm[rows], distances.feet_mm[rows]
    owner, wanted_owner = _owners(blocks, feet), _owners(blocks, design.points)
    low, high = design.points[:, :2].min(axis=0), design.points[:, :2].max(axis=0)
    edge = float((high - low).max()) / CELLS
    cells, wanted = (np.floor((p[:, :2] - low) / edge).astype(np.int64) @ [1, 1 << 20] for p in (feet, design.points))

    def summary(number: int) -> BlockDistances:
        own, asked = (slice(None), slice(None)) if number == 0 else (owner == number, wanted_owner == number)
        d = signed[own]
        asked_cells = np.unique(wanted[asked])
        covered = float(np.isin(asked_cells, cells[own]).mean()) if len(asked_cells) else float("nan")
        if not len(d):
            nothing = float("nan")
            return BlockDistances(number, 0, nothing, nothing, nothing, np.full(5, nothing), nothing, covered)
        size = np.abs(d)
        within = float((size <= tolerance_mm).mean())
        mean, lowest, highest = float(d.mean()), float(d.min()), float(d.max())
        return BlockDistances(number, len(d), mean, lowest, highest, np.percentile(size, PERCENTILES), within, covered)

    parts = tuple(summary(b.number) for b in blocks if (owner == b.number).any())
    return ScanComparison(
        design, registration, distances, tolerance_mm, reach_mm, share, summary(0), parts, tuple(blocks)
    )


def _owners(blocks: Sequence[Block], plan: FloatArray) -> IntArray:
    """Number of the block over which each place (n, 2 or 3) lies, 0 for none; a border belongs to the earlier block."""
    owner = np.zeros(len(plan), dtype=np.int64)
    for block in reversed(blocks):
        low, high = block.corner_mm[:2] - 1e-6, block.corner_mm[:2] + block.size_mm[:2] + 1e-6
        owner[((plan[:, :2] >= low) & (plan[:, :2] <= high)).all(axis=1)] = block.number
    return owner
