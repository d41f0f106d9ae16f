"""The pieces of a patch as they lie in its blocks: where the blade goes, and how far that is from the face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from batten.curves.elastica import points_batch, states_along
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.columns import Columns
from batten.surfaces.deviation import surface_deviation
from batten.surfaces.height_surface import height_surface
from batten.surfaces.patches import Patch
from batten.surfaces.plane_family import PlaneFamily
from batten.surfaces.rationalise import Chains
from batten.typing import BoolArray, FloatArray

PERCENTILES = (50.0, 90.0, 95.0, 99.0, 100.0)
"""Of the distances, in per cent."""

_STATIONS = 33  # along each piece, where the distance is measured
_FINE = 257  # along each piece, where its height is read off between
_EXTEND = 0.02  # of a face's domain: so far it goes on beyond its border for the foot of a distance
_BEYOND = 81  # points along each side of the blocks' rectangle at which the surface is guided beyond the patch
_BEYOND_WEIGHT = 0.003  # of heights beyond the patch, against those of the pieces
_PLANNED_SPANS = 128
_SEEN = 241  # points along each side of the box at which it is seen which blocks a patch needs


@dataclass(frozen=True, eq=False)
class PatchDeviation:
    """How far the cut lies from the face, measured on the face itself.

    Attributes:
        points: (n, 3), points of the cut over the patch, in the block frame. signed_mm: (n,), their distance from the face.
        percentiles_mm: of the distances, at `PERCENTILES`. mean_mm: their mean.
    """

    points: FloatArray
    signed_mm: FloatArray
    percentiles_mm: FloatArray
    mean_mm: float

    @property
    def greatest_mm(self) -> float:
        """The greatest distance."""
        return float(self.percentiles_mm[-1])


def _grid(patch: Patch, family: PlaneFamily) -> FloatArray:
    """Points of the patch's plan, (n, 2), in the block frame: a grid over the box, and the outline."""
    sides = [np.linspace(family.low[k], family.high[k], _SEEN) for k in (0, 1)]
    grid = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 2)
    plan = grid @ family.pose[:2, :2].T
    return np.asarray(grid[patch.plan.contains(plan[:, 0], plan[:, 1])])


def occupied(patch: Patch, family: PlaneFamily, borders: FloatArray) -> list[tuple[int, int]]:
    """(row, column) of the blocks in which the patch has a point."""
    points = _grid(patch, family)
    column = np.clip(np.searchsorted(borders, points[:, 0], side="right") - 1, 0, len(borders) - 2)
    row = np.clip(np.searchsorted(family.rows, points[:, 1], side="right") - 1, 0, len(family.rows) - 2)
    cells = np.unique(row * (len(borders) - 1) + column)
    return [(int(cell) // (len(borders) - 1), int(cell) % (len(borders) - 1)) for cell in cells]


def piece_points(family: PlaneFamily, chains: Chains) -> FloatArray:
    """Points of all pieces in the block frame, (m, c, stations, 3)."""
    flat = points_batch(chains.parameters, np.linspace(0.0, 1.0, _STATIONS))
    space = np.stack([plane.to_world(row) for plane, row in zip(chains.planes, flat)])
    return np.asarray(space @ family.pose)


def measured(patch: Patch, family: PlaneFamily, chains: Chains) -> PatchDeviation:
    """Distances of the pieces, and of the strip half-way between neighbouring leaves, from the face itself."""
    leaves = piece_points(family, chains)
    between = _half_way(family, chains)
    points = np.concatenate([leaves.reshape(-1, 3), between.reshape(-1, 3)])
    points = points[np.isfinite(points).all(axis=1)]
    plan = points @ family.pose.T
    over = patch.plan.contains(plan[:, 0], plan[:, 1])
    signed = surface_deviation(patch.face.surface, patch.to_design(plan[over]), extend=_EXTEND).signed
    size = np.abs(signed)
    return PatchDeviation(points[over], signed, np.percentile(size, PERCENTILES), float(size.mean()))


def _half_way(family: PlaneFamily, chains: Chains) -> FloatArray:
    """Points half-way between neighbouring leaves at equal x, in the block frame, (m − 1, c, stations, 3), or NaN."""
    fine = points_batch(chains.parameters, np.linspace(0.0, 1.0, _FINE))
    step = (_FINE - 1) // (_STATIONS - 1)
    found = np.full((max(len(fine) - 1, 0), fine.shape[1], _STATIONS, 3), np.nan)
    for i, j in np.ndindex(found.shape[:2]):
        here, there = fine[i, j], fine[i + 1, j]
        if np.isfinite(here).all() and np.isfinite(there).all():
            x = here[::step, 0]
            other = np.stack([x, np.interp(x, there[:, 0], there[:, 1], left=np.nan, right=np.nan)], axis=-1)
            pair = chains.planes[i].to_world(here[::step]), chains.planes[i + 1].to_world(other)
            found[i, j] = 0.5 * (pair[0] + pair[1])
    return np.asarray(found @ family.pose)


def planned_surface(
    patch: Patch, family: PlaneFamily, columns: Columns, tolerance: float
) -> tuple[BSplineSurface, float]:
    """The planned surface over the blocks' rectangle, as heights, and how far at most it lies from the pieces in height.

    Through the pieces, and beyond them, where nothing is asked for, near the heights with which the patch goes on.
    """
    low = np.array([columns.borders[0], family.rows[0]])
    high = np.array([columns.borders[-1], family.rows[-1]])
    pieces = piece_points(family, columns.chains).reshape(-1, 3)
    slack = 1e-9 * (high - low)
    known = np.isfinite(pieces).all(axis=1)
    pieces = pieces[known & ((pieces[:, :2] >= low - slack) & (pieces[:, :2] <= high + slack)).all(axis=1)]
    grid = np.stack(np.meshgrid(*(np.linspace(low[k], high[k], _BEYOND) for k in (0, 1))), axis=-1).reshape(-1, 2)
    flat = grid @ family.pose[:2, :2].T
    empty = ~patch.plan.contains(flat[:, 0], flat[:, 1])
    height = patch.plan.surface.point(flat[empty, 0], flat[empty, 1], extend=0.5)[:, 2]
    points = np.concatenate([pieces, np.column_stack([grid[empty], height])])
    weights = np.repeat([1.0, _BEYOND_WEIGHT], [len(pieces), len(height)])
    fit = height_surface(points, low, high, tolerance, weights=weights, most=_PLANNED_SPANS)
    miss = fit.surface.point(*np.clip(pieces[:, :2], low, high).T)[:, 2] - pieces[:, 2]
    return fit.surface, float(np.abs(miss).max())


def greatest_jumps(chains: Chains, used: BoolArray) -> tuple[float, float]:
    """Greatest jump of position and of tangent between neighbouring pieces that both cut the face."""
    parameters = chains.parameters
    both = used[:, 1:] & used[:, :-1]
    if not both.any():
        return 0.0, 0.0
    left, right = parameters[:, :-1][both], parameters[:, 1:][both]
    end = states_along(left, left[:, 6:])[:, 0]
    start = states_along(right, np.zeros((len(right), 1)))[:, 0]
    turn = np.abs(np.angle(np.exp(1j * (end[:, 2] - start[:, 2]))))
    return float(np.linalg.norm(end[:, :2] - start[:, :2], axis=1).max()), float(turn.max())
