"""The face that a rod leaves in its blocks, compared with the design, point by point in both directions."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from batten.errors import InvalidInputError
from batten.fabrication.plan import Block
from batten.fabrication.simulation import BlockPath, RodSweep, sweep_rods
from batten.fabrication.swept_mesh import Mesh, mesh_within, plan_depth
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.deviation import surface_deviation
from batten.typing import BoolArray, FloatArray, IntArray

PERCENTILES = (50.0, 95.0, 99.0)
COLUMN_MM = 5.0
"""Greatest distance between points along the rod; every other one is measured."""
DESIGN_MM = 10.0
"""About how far the points of the design lie apart that are measured against the swept face."""

_COARSE = 129  # points by which it is found what part of the rods lies in a block
_SLACK_MM = 1e-6
_EXTEND = 0.25  # of the domain: where corners of the mesh beyond the design's border are measured
_ROUNDS = 8  # of Gauss and Newton's method for a foot on the face

HalfKerf = Callable[[FloatArray], FloatArray]
"""Half the kerf, mm, of the speed at which a point of the blade goes at right angles to the blade, mm/s; any shape."""


@dataclass(frozen=True, eq=False)
class Distances:
    """How far points lie from a surface, without sign, mm; NaN where there are none.

    `mean` and `percentiles` (at `PERCENTILES`) count every point by the area that it stands for.
    """

    points: int
    max: float
    mean: float
    percentiles: tuple[float, ...]

    @staticmethod
    def of(values: FloatArray, weights: FloatArray) -> Distances:
        """Distances (n,), signed or not, with areas (n,) of which one at least is above 0; NaN does not count."""
        known = ~np.isnan(values)
        size, area = np.abs(values[known]), weights[known]
        if not area.sum() > 0.0:
            return Distances(0, float("nan"), float("nan"), (float("nan"),) * len(PERCENTILES))
        shares = np.percentile(size, PERCENTILES, weights=area, method="inverted_cdf")
        return Distances(len(size), float(size.max()), float(np.average(size, weights=area)), tuple(map(float, shares)))


@dataclass(frozen=True, eq=False)
class SweptBlock:
    """The face in one block, in the wall frame, mm.

    Attributes:
        block: the block.
        sweep: the rod that swept it.
        points: (n, 3), points of the face within the block's plan.
        signed: (n,), their distances from the design, positive above it.
        areas: (n,), mm² of the face that each stands for; 0 for those on the block's border.
        station: (n,), the station of the sweep.
        design_points: (k, 3), points of the design within the block's plan.
        design_distances: (k,), how far the face is from each.
        mesh: the face, cut to the block's plan; with fewer points.
        unknown: how many points have no distance, because the kerf is not known for the speed there.
    """

    block: Block
    sweep: RodSweep
    points: FloatArray
    signed: FloatArray
    areas: FloatArray
    station: IntArray
    design_points: FloatArray
    design_distances: FloatArray
    mesh: Mesh
    unknown: int

    @property
    def is_at_leaf(self) -> BoolArray:
        """Which points lie on a leaf, (n,)."""
        return np.asarray(self.sweep.at_leaf[self.station])

    @cached_property
    def face(self) -> Distances:
        """All points of the face against the design."""
        return Distances.of(*face_distances(self))

    @cached_property
    def at_leaves(self) -> Distances:
        """Of these, those on a leaf."""
        return Distances.of(*face_distances(self, True))

    @cached_property
    def between_leaves(self) -> Distances:
        """The others."""
        return Distances.of(*face_distances(self, False))

    @cached_property
    def design(self) -> Distances:
        """The points of the design against the face."""
        return Distances.of(self.design_distances, np.ones_like(self.design_distances))

    @property
    def worst_mm(self) -> float:
        """The greatest distance in either direction, mm."""
        return float(np.fmax(self.worst[0], self.design_distances.max(initial=0.0)))

    @cached_property
    def worst(self) -> tuple[float, FloatArray, str]:
        """The greatest distance of a point of the face, mm; the point (3,); between or at which leaves, in words."""
        if not len(self.signed) or np.isnan(self.signed).all():
            return float("nan"), np.full(3, np.nan), "nowhere"
        i = int(np.nanargmax(np.abs(self.signed)))
        k, path = int(self.station[i]), self.sweep.path
        move, share = int(self.sweep.move[k]), float(self.sweep.share[k])
        at_target = share in (0.0, 1.0)
        where = f"at {path.labels[move + int(share)]}" if at_target else path.way(move)
        return float(abs(self.signed[i])), self.points[i], where


@dataclass(frozen=True, eq=False)
class Simulation:
    """A simulated cut.

    Attributes:
        blocks: those that have a robot program.
        without_program: numbers of the blocks that have none.
        tolerance_mm: of the job.
        allowance_mm: how much farther the face may lie from the design.
        half_kerf: whether the face lies half a kerf from the blade; otherwise it is the blade's own surface.
    """

    blocks: tuple[SweptBlock, ...]
    without_program: tuple[int, ...]
    tolerance_mm: float
    allowance_mm: float
    half_kerf: bool = False

    @property
    def limit_mm(self) -> float:
        """Tolerance and allowance together."""
        return self.tolerance_mm + self.allowance_mm

    @cached_property
    def face(self) -> Distances:
        """All points of the face against the design."""
        return self._of_face(None)

    @cached_property
    def at_leaves(self) -> Distances:
        """Of these, those on a leaf."""
        return self._of_face(True)

    @cached_property
    def between_leaves(self) -> Distances:
        """The others."""
        return self._of_face(False)

    @cached_property
    def design(self) -> Distances:
        """All points of the design against the face."""
        values = np.concatenate([b.design_distances for b in self.blocks]) if self.blocks else np.zeros(0)
        return Distances.of(values, np.ones_like(values))

    @property
    def failing(self) -> tuple[int, ...]:
        """Numbers of the blocks where a point lies farther than `limit_mm`, is not known, or that have no program."""
        worse = {b.block.number for b in self.blocks if b.unknown or not b.worst_mm <= self.limit_mm}
        return tuple(sorted(worse | set(self.without_program)))

    @property
    def is_good(self) -> bool:
        """Whether there are blocks and none fails."""
        return bool(self.blocks) and not self.failing

    def _of_face(self, at_leaf: bool | None) -> Distances:
        parts = [face_distances(b, at_leaf) for b in self.blocks]
        return (
            Distances.of(*(np.concatenate(p) for p in zip(*parts))) if parts else Distances.of(np.zeros(0), np.zeros(0))
        )


def face_distances(block: SweptBlock, at_leaf: bool | None = None) -> tuple[FloatArray, FloatArray]:
    """Signed distances and areas of a block's points: all, those on a leaf, or those between leaves."""
    chosen = slice(None) if at_leaf is None else block.is_at_leaf == at_leaf
    return block.signed[chosen], block.areas[chosen]


def simulate_cut(
    paths: Sequence[BlockPath],
    blocks: Sequence[Block],
    blade_axis: Literal["x", "y"],
    surface: BSplineSurface,
    length_mm: float,
    *,
    tolerance_mm: float,
    allowance_mm: float = 0.05,
    half_kerf_mm: HalfKerf | None = None,
    kept: Literal["lower", "upper"] = "lower",
) -> Simulation:
    """Sweep the rod along the robots' paths and compare the face that is left with the design, in both directions.

    The face within a block's plan is compared with the whole design as `batten cut` compares the leaves: by distance from
    its nearest point. Points of the design are compared with the strip that the rod sweeps, beyond the block's border too.

    Parameters:
        paths: one for each block that is cut, in the blocks' work frames.
        blocks: all blocks.
        blade_axis: the wall axis along which the blade lies.
        surface: the design in the wall frame, mm; single-valued in z over its plan.
        length_mm: length of the rod between its ends.
        tolerance_mm, allowance_mm: see `Simulation`; finite, 0 or more.
        half_kerf_mm: how far the face lies from the blade; without it the face is the blade's surface. NaN for a speed at
            which it is not known; such points do not count, and fail.
        kept: the part of the foam that is left, below the blade or above it.

    Returns:
        Distances, and the mesh of the face.

    Raises:
        InvalidInputError: a path of a block that is not there, values outside their bounds.
        LimitError: see `sweep_rods`.

    Accuracy: the points of the face lie on the elastica (1e-9 mm); they are at most 10 mm apart along the rod and
        `simulation.STEP_MM` along the motion. For the design's points see `distance_to_sweep`.
    """
    if not (0.0 <= tolerance_mm < np.inf and 0.0 <= allowance_mm < np.inf):
        raise InvalidInputError(f"tolerance_mm = {tolerance_mm}, allowance_mm = {allowance_mm}; allowed are 0 and more")
    known = {b.number: b for b in blocks}
    foreign = [p.block for p in paths if p.block not in known]
    if foreign:
        raise InvalidInputError(
            f"the program cuts block {foreign[0]}; the plan has blocks {min(known)} to {max(known)}"
        )
    frames = [known[p.block].work_frame(blade_axis) for p in paths]

    def misfit(i: int, points: FloatArray) -> float:
        return surface_deviation(surface, points @ frames[i][:3, :3].T + frames[i][:3, 3]).mean

    sweeps = sweep_rods(paths, length_mm, misfit=misfit)
    design = _design_points(surface)
    sign = -1.0 if kept == "lower" else 1.0

    def one(i: int) -> SweptBlock:
        return _swept_block(sweeps[i], known[sweeps[i].path.block], frames[i], surface, design, half_kerf_mm, sign)

    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        swept = tuple(pool.map(one, range(len(sweeps))))
    absent = tuple(sorted(set(known) - {p.block for p in paths}))
    return Simulation(swept, absent, tolerance_mm, allowance_mm, half_kerf_mm is not None)


def _design_points(surface: BSplineSurface) -> FloatArray:
    """Points of the design about `DESIGN_MM` apart, (n, 3)."""
    low, high = surface.bounding_box()
    count = max(2, int(np.ceil((high - low)[:2].max() / DESIGN_MM)) + 1)
    u, v = (np.linspace(*ends, count) for ends in surface.domain)
    return surface.point(u[:, None], v).reshape(-1, 3)


def _swept_block(
    sweep: RodSweep,
    block: Block,
    frame: FloatArray,
    surface: BSplineSurface,
    design: FloatArray,
    half_kerf_mm: HalfKerf | None,
    sign: float,
) -> SweptBlock:
    low, high = block.corner_mm[:2], block.corner_mm[:2] + block.size_mm[:2]
    grid, first = _face(sweep, block, frame, half_kerf_mm, sign)
    inside = plan_depth(grid, low, high) >= -_SLACK_MM
    unknown = int(np.isnan(grid[:, ::2]).any(axis=2).sum())
    station, column = np.nonzero(inside[:, ::2])
    edge_station, edge = _border_points(grid, low, high)
    points = np.concatenate([grid[:, ::2][station, column], edge])
    areas = _areas(grid[:, ::2])[station, column]
    signed = _upwards(surface, points)
    mine = design[plan_depth(design, low, high) >= -_SLACK_MM]
    back = distance_to_sweep(mine, grid[np.isfinite(grid).all(axis=(1, 2))])
    values = np.full(grid[:, ::2].shape[:2], np.nan)
    values[station, column] = signed[: len(station)]
    return SweptBlock(
        block,
        sweep,
        points,
        signed,
        np.append(areas, np.zeros(len(edge))),
        np.append(station, edge_station) + first,
        mine,
        back,
        mesh_within(grid[:, ::2], values, low, high, lambda p: _upwards(surface, p, _EXTEND)),
        unknown,
    )


def _upwards(surface: BSplineSurface, points: FloatArray, extend: float = 0.0) -> FloatArray:
    """Distances of points (n, 3) from the design, positive above it."""
    (u0, u1), (v0, v1) = surface.domain
    sign = 1.0 if surface.normal(0.5 * (u0 + u1), 0.5 * (v0 + v1))[2] > 0.0 else -1.0
    return sign * surface_deviation(surface, points, extend=extend).signed


def _face(
    sweep: RodSweep, block: Block, frame: FloatArray, half_kerf_mm: HalfKerf | None, sign: float
) -> tuple[FloatArray, int]:
    """Points of the face over the block and a little beyond, (a, b, 3), b odd; and the first one's station."""
    low, high = block.corner_mm[:2], block.corner_mm[:2] + block.size_mm[:2]
    rotation, origin = frame[:3, :3].T, frame[:3, 3]
    length = float(sweep.parameters[0, 6])
    fractions = np.linspace(0.0, 1.0, _COARSE)
    over = plan_depth(sweep.points(fractions) @ rotation + origin, low, high) >= 0.0
    rows, columns = np.flatnonzero(over.any(axis=1)), np.flatnonzero(over.any(axis=0))
    if not len(rows):
        return np.zeros((0, 1, 3)), 0
    begin, end = max(rows[0] - 2, 0), min(rows[-1] + 3, len(over))
    left, right = fractions[max(columns[0] - 2, 0)], fractions[min(columns[-1] + 2, _COARSE - 1)]
    part = np.linspace(left, right, 2 * int(np.ceil((right - left) * length / (2.0 * COLUMN_MM))) + 1)
    points = sweep.points(part)[begin:end] @ rotation + origin
    if half_kerf_mm is None:
        return points, int(begin)
    along = np.gradient(points, axis=1)
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    moved = np.diff(points, axis=0)
    moved -= (moved * along[1:]).sum(axis=2, keepdims=True) * along[1:]
    pace = np.linalg.norm(moved, axis=2) / np.diff(sweep.seconds[begin:end])[:, None]
    pace = 0.5 * (np.concatenate([pace[:1], pace]) + np.concatenate([pace, pace[-1:]]))
    across = np.concatenate([moved[:1], moved]) + np.concatenate([moved, moved[-1:]])
    normal = np.cross(along, across)
    normal *= sign * np.sign(normal[..., 2:]) / np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-300)
    return points + half_kerf_mm(pace)[..., None] * normal, int(begin)


def _areas(grid: FloatArray) -> FloatArray:
    """The area that each point of a grid (a, b, 3) stands for, (a, b)."""
    if min(grid.shape[:2]) < 2:
        return np.zeros(grid.shape[:2])
    areas = np.linalg.norm(np.cross(np.gradient(grid, axis=0), np.gradient(grid, axis=1)), axis=2)
    return np.asarray(np.nan_to_num(areas, nan=0.0))


def _border_points(grid: FloatArray, low: FloatArray, high: FloatArray) -> tuple[IntArray, FloatArray]:
    """Where the grid's rows cross the rectangle's border: row (k,) and point (k, 3), by cubics through four points."""
    depth = plan_depth(grid, low, high)
    row, column = np.nonzero((depth[:, 1:] >= 0.0) != (depth[:, :-1] >= 0.0))
    if grid.shape[1] < 4 or not len(row):
        return np.zeros(0, dtype=np.int64), np.zeros((0, 3))
    a, b = depth[row, column], depth[row, column + 1]
    points, _ = _along_rods(grid, row, column + a / (a - b))
    return row, points


def _along_rods(grid: FloatArray, row: IntArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points of the grid's rows at fractional columns t (n,), and their derivatives by t; cubics through four points."""
    start = np.clip(np.floor(t).astype(np.int64) - 1, 0, grid.shape[1] - 4)
    x = (t - start)[:, None]
    nodes = np.arange(4.0)
    others = [nodes[nodes != k] for k in range(4)]
    scale = [np.prod(k - o) for k, o in enumerate(others)]
    weights = np.stack([np.prod(x - o, axis=1) / c for o, c in zip(others, scale)], axis=1)
    slopes = np.stack(
        [sum(np.prod(x - np.delete(o, i), axis=1) for i in range(3)) / c for o, c in zip(others, scale)], axis=1
    )
    corners = grid[row[:, None], start[:, None] + np.arange(4)]
    return np.einsum("nk,nkd->nd", weights, corners), np.einsum("nk,nkd->nd", slopes, corners)


def distance_to_sweep(points: FloatArray, grid: FloatArray) -> FloatArray:
    """How far points (n, 3) lie from the face through a grid (a, b, 3) of points of successive rods, (n,).

    Along the rods the face is a cubic through four points of the grid, between two rods it is straight. The foot is sought
    from the nearest point of the grid (Gauss and Newton), so that a distance is never too small.

    Accuracy: 1e-9 where the foot is found; the face itself, between rods 5 mm apart, to the height of an arc over 5 mm.
    Degenerate: ∞ without two rods of four points.
    """
    a, b = grid.shape[:2]
    if a < 2 or b < 4 or not len(points):
        return np.full(len(points), np.inf)
    best, nearest = cKDTree(grid.reshape(-1, 3)).query(points)
    s, t = (np.asarray(k, dtype=np.float64) for k in np.divmod(nearest, b))
    for _ in range(_ROUNDS):
        row = np.clip(np.floor(s).astype(np.int64), 0, a - 2)
        (p, p_t), (q, q_t) = _along_rods(grid, row, t), _along_rods(grid, row + 1, t)
        share = (s - row)[:, None]
        miss = points - (p + share * (q - p))
        best = np.minimum(best, np.linalg.norm(miss, axis=1))
        across, along = q - p, p_t + share * (q_t - p_t)
        aa, ab, bb = ((u * v).sum(axis=1) for u, v in ((across, across), (across, along), (along, along)))
        ma, mb = (across * miss).sum(axis=1), (along * miss).sum(axis=1)
        area = np.maximum(aa * bb - ab**2, 1e-12 * aa * bb + 1e-300)
        s = np.clip(s + np.clip((ma * bb - mb * ab) / area, -1.0, 1.0), 0.0, a - 1.0)
        t = np.clip(t + np.clip((mb * aa - ma * ab) / area, -1.0, 1.0), 0.0, b - 1.0)
    return np.asarray(best)
