"""What all checks look at: the rods of a plan, sampled once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from batten.curves.elastica import points_batch, states_at
from batten.errors import InvalidInputError
from batten.fabrication.job import CutJob
from batten.fabrication.plan import Block, RodPlacement
from batten.fabrication.rod import Rod
from batten.surfaces.bspline_surface import BSplineSurface
from batten.typing import BoolArray, FloatArray, IntArray

ROD_STATIONS = 129
"""Points along every whole rod."""
PIECE_STATIONS = 65
"""Points along every piece."""
PLAN_SLACK_MM = 1e-6
"""A point so far outside a block's plan rectangle still counts as within."""


@dataclass(frozen=True, eq=False)
class CheckContext:
    """The samples that the checks share; n rods, m = ROD_STATIONS, p = PIECE_STATIONS, all in mm.

    Attributes:
        job: the limits.
        surface: the wanted surface, in the wall frame.
        rods: the placements, in the plan's order.
        rod: what the rod is made of.
        leaf, row, column: (n,) integers, the leaf's number and where the rod's block stands.
        block_index: (n,), index of the rod's block in the sequence of blocks.
        box_low, box_high: (n, 3), corners of the rod's block in the wall frame.
        origin, frame: (n, 3) and (n, 3, 3), the planes; rows of a frame are x_axis, y_axis, normal.
        rod_parameters, piece_parameters: (n, 7), see `Elastica.parameters`.
        before, after: (n,), how much of the rod lies before and after the piece.
        plane_points: (n, m, 2), the whole rod in its plane, at equal steps of arc length from end to end.
        points: (n, m, 3), the same in the wall frame.
        curvature: (n, m), 1/mm.
        piece_points: (n, p, 3), the piece in the wall frame, at equal steps.
        piece_inside: (n, p), which of these lie within the block's plan rectangle.
        inside: (n, 2), from which to which fraction of its length the piece lies within that rectangle; NaN where it
            does not on more than a point. Turned planes leave a block through its side faces.
        pairs: (k, 2), indices of rods of successive leaves in one block, in cutting order.
    """

    job: CutJob
    surface: BSplineSurface
    rods: tuple[RodPlacement, ...]
    rod: Rod
    leaf: IntArray
    row: IntArray
    column: IntArray
    block_index: IntArray
    box_low: FloatArray
    box_high: FloatArray
    origin: FloatArray
    frame: FloatArray
    rod_parameters: FloatArray
    piece_parameters: FloatArray
    before: FloatArray
    after: FloatArray
    plane_points: FloatArray
    points: FloatArray
    curvature: FloatArray
    piece_points: FloatArray
    piece_inside: BoolArray
    inside: FloatArray
    pairs: IntArray

    @classmethod
    def of(
        cls, job: CutJob, surface: BSplineSurface, blocks: Sequence[Block], rods: Sequence[RodPlacement]
    ) -> CheckContext:
        """Sample all rods.

        Parameters:
            job: the limits. surface: the wanted surface, mm. blocks: every block that a rod names.
            rods: any number of them, refused or not: a check looks at all.

        Raises:
            InvalidInputError: a rod in a block that is not there, two blocks of one number, a rod's own bounds.
        """
        numbers = {block.number: i for i, block in enumerate(blocks)}
        if len(numbers) < len(blocks):
            raise InvalidInputError(f"{len(blocks)} blocks have {len(numbers)} numbers; each needs its own")
        missing = sorted({r.block for r in rods} - set(numbers))
        if missing:
            raise InvalidInputError(
                f"rods stand in block {missing[0]}, which is not among the {len(blocks)} blocks given"
            )
        n = len(rods)
        index = np.array([numbers[r.block] for r in rods], dtype=np.int64)
        leaf = np.array([r.leaf for r in rods], dtype=np.int64)
        low, high = (np.array(c, dtype=np.float64).reshape(-1, 3)[index] for c in _corners(blocks))
        origin = np.array([r.plane.origin for r in rods]).reshape(n, 3)
        x_axis, y_axis = (np.array([getattr(r.plane, k) for r in rods]).reshape(n, 3) for k in ("x_axis", "y_axis"))
        frame = np.stack([x_axis, y_axis, np.cross(x_axis, y_axis)], axis=1)
        whole, piece = (
            np.array([e.parameters for e in c]).reshape(n, 7) for c in ([r.rod for r in rods], [r.piece for r in rods])
        )
        before = np.array([r.before_mm for r in rods], dtype=np.float64)
        flat = points_batch(whole, np.linspace(0.0, 1.0, ROD_STATIONS))
        along = flat - whole[:, None, :2]
        curvature = whole[:, None, 3] + along[..., 0] * whole[:, None, 5] - along[..., 1] * whole[:, None, 4]
        cut = to_world(origin, frame, points_batch(piece, np.linspace(0.0, 1.0, PIECE_STATIONS)))
        depth = plan_depth(cut, low, high)
        return cls(
            job=job,
            surface=surface,
            rods=tuple(rods),
            rod=Rod.of(job.rod),
            leaf=leaf,
            row=np.array([b.row for b in blocks], dtype=np.int64)[index],
            column=np.array([b.column for b in blocks], dtype=np.int64)[index],
            block_index=index,
            box_low=low,
            box_high=high,
            origin=origin,
            frame=frame,
            rod_parameters=whole,
            piece_parameters=piece,
            before=before,
            after=whole[:, 6] - before - piece[:, 6],
            plane_points=flat,
            points=to_world(origin, frame, flat),
            curvature=curvature,
            piece_points=cut,
            piece_inside=depth >= -PLAN_SLACK_MM,
            inside=interval_within(depth),
            pairs=_successive(index, leaf),
        )

    def piece_within(self, count: int, *, whole: bool = False) -> FloatArray:
        """`count` points in the plane at equal steps along what lies of each piece in its block, (n, count, 2); or NaN.

        With `whole`, along the whole piece if any of it lies there, and a fiftieth of it beyond both ends.
        """
        first, last = self.inside.T
        if whole:
            first, last = np.where(np.isnan(first), np.nan, -0.02), np.where(np.isnan(last), np.nan, 1.02)
        part = shifted(self.piece_parameters, first * self.piece_parameters[:, 6])
        part[:, 6] *= last - first
        return points_batch(part, np.linspace(0.0, 1.0, count))

    def design_within(self, count: int, *, whole: bool = False) -> FloatArray:
        """`count` points along what lies of each design curve in its block, (n, count, 2); NaN where nothing does.

        With `whole`, along the whole curve if any of it lies there.

        A cubic spline through the design's points is used, so that their own spacing does not count.
        """
        out = np.full((len(self.rods), count, 2), np.nan)
        sizes = np.array([len(r.design) for r in self.rods], dtype=np.int64)
        for size in np.unique(sizes[sizes >= 2]):
            some = np.flatnonzero(sizes == size)
            design = np.stack([self.rods[i].design for i in some])
            world = to_world(self.origin[some], self.frame[some], design)
            span = interval_within(plan_depth(world, self.box_low[some], self.box_high[some]))
            if whole:
                span = np.where(np.isnan(span), np.nan, [0.0, 1.0])
            t = span[:, :1] + (span[:, 1:] - span[:, :1]) * np.linspace(0.0, 1.0, count)
            known = np.isfinite(t).all(axis=1) & np.isfinite(design).all(axis=(1, 2))
            out[some[known]] = _along(design[known], t[known] * (size - 1))
        return out


def to_world(origin: FloatArray, frame: FloatArray, points: FloatArray) -> FloatArray:
    """Points (n, k, 2) of n planes in the wall frame, (n, k, 3)."""
    return origin[:, None] + points[..., :1] * frame[:, None, 0] + points[..., 1:] * frame[:, None, 1]


def shifted(parameters: FloatArray, s: FloatArray) -> FloatArray:
    """The same elastica, (n, 7), started at arc length s, (n,), with their lengths as they were."""
    out = parameters.copy()
    out[:, :4] = states_at(parameters, s)
    return out


def greatest(values: FloatArray) -> FloatArray:
    """The greatest of equally spaced samples along the last axis, refined by the parabola through it and its neighbours.

    NaN samples are passed over; all NaN gives NaN. Accuracy: the peak between samples is missed by about h⁴/400 times the
    fourth derivative, where the samples belong to one smooth function around it.
    """
    n = values.shape[-1]
    known = np.where(np.isnan(values), -np.inf, values)
    at = np.clip(known.argmax(axis=-1), 1, n - 2)
    best = known.max(axis=-1)
    low, middle, high = (np.take_along_axis(values, (at + k)[..., None], axis=-1)[..., 0] for k in (-1, 0, 1))
    bend = low - 2.0 * middle + high
    with np.errstate(invalid="ignore", divide="ignore"):
        peak = middle - (high - low) ** 2 / (8.0 * bend)
        inner = (bend < 0.0) & (middle >= low) & (middle >= high)
    return np.where(np.isneginf(best), np.nan, np.where(inner, peak, best))


def worst_of_pairs(n: int, pairs: IntArray, values: FloatArray, *, least: bool) -> FloatArray:
    """For each of n rods the least (or greatest) of the values, (k,), of the pairs, (k, 2), it is part of; NaN if none."""
    out = np.full(n, np.nan)
    for side in (0, 1):
        (np.fmin if least else np.fmax).at(out, pairs[:, side], values)
    return out


def _corners(blocks: Sequence[Block]) -> tuple[list[FloatArray], list[FloatArray]]:
    return [b.corner_mm for b in blocks], [np.add(b.corner_mm, b.size_mm) for b in blocks]


def plan_depth(points: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """How far points (n, k, 3) lie within the blocks' plan rectangles, negative outside; shape (n, k)."""
    inner = np.minimum(points - low[:, None], high[:, None] - points)
    return np.asarray(inner[..., :2].min(axis=-1))


def interval_within(depth: FloatArray) -> FloatArray:
    """From which to which fraction of their range samples (n, k) are at least −PLAN_SLACK_MM, linear between; (n, 2)."""
    n, k = depth.shape
    above = depth + PLAN_SLACK_MM
    within = above >= 0.0
    rows = np.arange(n)
    first, last = within.argmax(axis=1), k - 1 - within[:, ::-1].argmax(axis=1)
    out = np.full((n, 2), np.nan)
    for side, at, step in ((0, first, -1), (1, last, 1)):
        beyond = np.clip(at + step, 0, k - 1)
        drop = above[rows, at] - above[rows, beyond]
        share = np.divide(above[rows, at], drop, out=np.zeros(n), where=(beyond != at) & (drop > 0.0))
        out[:, side] = (at + step * share) / (k - 1.0)
    out[~(within.any(axis=1) & (out[:, 1] > out[:, 0] + 1e-9))] = np.nan
    return out


def _along(points: FloatArray, index: FloatArray) -> FloatArray:
    """Cubic splines through the rows of `points` (n, k, 2) at fractional indices (n, c): (n, c, 2)."""
    n, k, _ = points.shape
    if n == 0:
        return np.empty((0, index.shape[1], 2))
    rows = np.arange(n)[:, None]
    cell = np.clip(np.floor(index).astype(np.int64), 0, k - 2)
    t = index - cell
    if k < 4:
        return np.asarray(points[rows, cell] + t[..., None] * (points[rows, cell + 1] - points[rows, cell]))
    t = t[..., None]
    slopes = _spline_slopes(points)
    step, low, high = points[rows, cell + 1] - points[rows, cell], slopes[rows, cell], slopes[rows, cell + 1]
    return np.asarray(
        points[rows, cell] + t * (low + t * (3.0 * step - 2.0 * low - high + t * (low + high - 2.0 * step)))
    )


def _spline_slopes(points: FloatArray) -> FloatArray:
    """Slopes of the cubic splines through rows of k ≥ 4 points (n, k, 2), a unit apart, with not-a-knot ends."""
    k = points.shape[1]
    system = 4.0 * np.eye(k) + np.eye(k, k=1) + np.eye(k, k=-1)
    system[0, :3] = system[-1, -3:] = 1.0, 0.0, -1.0  # the third derivative is the same on both sides of the next knot
    right = np.empty_like(points)
    right[:, 1:-1] = 3.0 * (points[:, 2:] - points[:, :-2])
    for end, inner in ((0, slice(0, 3)), (-1, slice(-3, None))):
        first, middle, last = np.moveaxis(points[:, inner], 1, 0)
        right[:, end] = 4.0 * middle - 2.0 * (first + last)
    return np.asarray(np.linalg.inv(system) @ right)


def _successive(block: IntArray, leaf: IntArray) -> IntArray:
    """Pairs of indices, (k, 2), of rods that follow one another in a block, by the leaf's number."""
    order = np.lexsort((leaf, block))
    same = block[order[1:]] == block[order[:-1]]
    return np.stack([order[:-1][same], order[1:][same]], axis=1).astype(np.int64)
