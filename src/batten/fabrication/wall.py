"""The wall in plan: which way the blade lies, the blocks, and the planes of the leaves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from batten.errors import InvalidInputError
from batten.fabrication.job import BlocksJob
from batten.fabrication.plan import Block
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.foliation import covering_offsets, parallel_planes
from batten.surfaces.plane import Plane
from batten.surfaces.straight_leaves import fan_planes
from batten.typing import BoolArray, FloatArray, IntArray

BladeAxis = Literal["x", "y"]

_EDGE_SLACK_MM = 1e-6
_LEAST_BLOCK_MM = 1.0  # a narrower strip at the end of the wall is left to its neighbour


@dataclass(frozen=True, eq=False)
class Wall:
    """The plan rectangle of a surface, divided into columns along the blade and rows across it.

    Attributes:
        surface: in the wall frame, mm; single-valued in z over its plan.
        blade_axis: wall axis along which the blade lies.
        low, high: (2,), least and greatest corner in plan.
        columns: (c + 1,), borders along the blade axis, ascending. rows: (r + 1,), borders across it.
    """

    surface: BSplineSurface
    blade_axis: BladeAxis
    low: FloatArray
    high: FloatArray
    columns: FloatArray
    rows: FloatArray

    @classmethod
    def of(cls, surface: BSplineSurface, size_mm: tuple[float, float], blade_axis: BladeAxis) -> Wall:
        """Divide a surface's plan into blocks of at most `size_mm` (along wall x, along wall y).

        The blocks start at the least corner; the last row and column are narrower where the plan is no whole multiple, and
        up to 1 mm wider where a sliver would be left.

        Raises:
            InvalidInputError: a surface that folds back over its plan.
        """
        if not surface.is_graph_over_plan():
            raise InvalidInputError(
                "the surface is not single-valued in z over its plan: the blade would have to cut under an overhang; turn "
                "the design so that its main direction is z, or cut it in parts"
            )
        lowest, highest = surface.bounding_box()
        low, high = lowest[:2], highest[:2]
        borders = []
        for axis in range(2):
            count = max(1, int(np.ceil((high[axis] - low[axis] - _LEAST_BLOCK_MM) / size_mm[axis])))
            borders.append(np.append(low[axis] + size_mm[axis] * np.arange(count), high[axis]))
        along = 0 if blade_axis == "x" else 1
        return cls(surface, blade_axis, low, high, borders[along], borders[1 - along])

    @property
    def along(self) -> int:
        """Index of the blade axis: 0 for x, 1 for y."""
        return 0 if self.blade_axis == "x" else 1

    def contains(self, points: FloatArray) -> BoolArray:
        """Whether points in space (…, 3) lie over the wall's plan rectangle, border included; shape (…)."""
        plan = points[..., :2]
        return np.asarray(((plan >= self.low - _EDGE_SLACK_MM) & (plan <= self.high + _EDGE_SLACK_MM)).all(axis=-1))

    def blocks(self, job: BlocksJob) -> tuple[Block, ...]:
        """The blocks, numbered along the blade and then across; heights from the relief and the clearance, or as given.

        Raises:
            InvalidInputError: a given height that the relief of a block and its clearances exceed.
        """
        (u0, u1), (v0, v1) = self.surface.domain
        u, v = np.meshgrid(np.linspace(u0, u1, 241), np.linspace(v0, v1, 241), indexing="ij")
        points = self.surface.point(u, v).reshape(-1, 3)
        blocks: list[Block] = []
        for row in range(len(self.rows) - 1):
            for column in range(len(self.columns) - 1):
                low, high = np.empty(2), np.empty(2)
                low[self.along], high[self.along] = self.columns[column : column + 2]
                low[1 - self.along], high[1 - self.along] = self.rows[row : row + 2]
                slack = (self.high - self.low) / 200.0
                z = points[((points[:, :2] >= low - slack) & (points[:, :2] <= high + slack)).all(axis=1), 2]
                bottom, height = float(z.min()) - job.clearance_mm, float(np.ptp(z)) + 2.0 * job.clearance_mm
                number = len(blocks) + 1
                if job.height_mm is not None:
                    if height > job.height_mm:
                        raise InvalidInputError(
                            f"block {number} needs a height of {height:.0f} mm (relief {np.ptp(z):.0f} mm and twice "
                            f"{job.clearance_mm:.0f} mm clearance); blocks.height_mm is {job.height_mm:.0f}"
                        )
                    bottom, height = bottom - 0.5 * (job.height_mm - height), job.height_mm
                corner = np.array([low[0], low[1], bottom])
                blocks.append(Block(number, row, column, corner, np.array([*(high - low), height])))
        return tuple(blocks)

    def planes(self, spacing_mm: float, turn_rad: float, border_turn_rad: float | None = None) -> tuple[Plane, ...]:
        """Vertical planes that cover the wall, in cutting order: along +y for a blade along x, along −x for one along y.

        Without turn the rows' borders are planes, and the distance is the largest at most `spacing_mm` that divides each
        row; with it, the planes cover the whole wall evenly. With `border_turn_rad` they are `fan_planes` about two centres
        beside the wall, turned by `turn_rad` in its middle and by this at its first and last border.
        """
        centre = 0.5 * (self.low + self.high)
        if turn_rad == 0.0:
            middle = centre[1 - self.along]
            steps = [
                np.linspace(a, b, max(1, int(np.ceil((b - a) / spacing_mm - 1e-9))) + 1)
                for a, b in zip(self.rows[:-1], self.rows[1:])
            ]
            offsets = np.unique(np.concatenate(steps)) - middle
        elif border_turn_rad is not None:
            fan = fan_planes(
                self.blade_axis,
                [self.low, self.high],
                spacing_mm,
                turn_rad=turn_rad,
                border_turn_rad=border_turn_rad,
            )
            return fan if self.blade_axis == "x" else fan[::-1]
        else:
            offsets = covering_offsets(self.blade_axis, [self.low, self.high], spacing_mm, turn_rad=turn_rad)
        planes = parallel_planes(self.blade_axis, offsets, turn_rad=turn_rad, centre=centre)
        return planes if self.blade_axis == "x" else planes[::-1]

    def edges(self, planes: tuple[Plane, ...]) -> FloatArray:
        """Abscissae of the columns' borders in every plane, shape (planes, columns + 1)."""
        origin = np.array([p.origin[self.along] for p in planes])
        speed = np.array([p.x_axis[self.along] for p in planes])
        return np.asarray((self.columns[None, :] - origin[:, None]) / speed[:, None])

    def crossings(self, planes: tuple[Plane, ...], blocks: tuple[Block, ...]) -> tuple[IntArray, IntArray]:
        """Which planes the blade takes in which block: indices (k,) of planes and (k,) of blocks, block by block.

        All planes that cross the block's plan, and on either side the next one that leaves no corner of it uncut: turned
        planes cross a block's corners obliquely, and the blade would pass the rest of a corner on its way in or out.

        Parameters:
            planes: in cutting order, none crossing another over the wall. blocks: of this wall.
        """
        origins = np.array([p.origin[:2] for p in planes])
        along = np.array([p.x_axis[:2] for p in planes])
        sweep = np.stack([-along[:, 1], along[:, 0]], axis=-1)  # the way of the cut: to the left of the blade
        plane_index: list[int] = []
        block_index: list[int] = []
        for j, block in enumerate(blocks):
            low, high = block.corner_mm[:2], block.corner_mm[:2] + block.size_mm[:2]
            corners = np.array([low, [low[0], high[1]], [high[0], low[1]], high])
            ahead = np.einsum("ikj,ij->ik", corners - origins[:, None], sweep)
            before = np.flatnonzero(ahead.min(axis=1) >= -_EDGE_SLACK_MM)
            behind = np.flatnonzero(ahead.max(axis=1) <= _EDGE_SLACK_MM)
            first = int(before[-1]) if before.size else 0
            last = int(behind[0]) if behind.size else len(planes) - 1
            taken = np.arange(first, last + 1)
            plane_index += taken.tolist()
            block_index += [j] * len(taken)
        return np.array(plane_index, dtype=np.int64), np.array(block_index, dtype=np.int64)


def axis_of(surface: BSplineSurface, parameter: Literal["u", "v"]) -> BladeAxis:
    """The wall axis, x or y, along which a surface's parameter mostly runs."""
    (u0, u1), (v0, v1) = surface.domain
    corners = surface.point(np.array([u0, u1, u0, u1]), np.array([v0, v0, v1, v1]))
    run = corners[1] + corners[3] - corners[0] - corners[2]
    u_axis: BladeAxis = "x" if abs(run[0]) >= abs(run[1]) else "y"
    if parameter == "u":
        return u_axis
    return "y" if u_axis == "x" else "x"
