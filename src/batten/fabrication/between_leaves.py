"""How far the blade strays from its surface between two leaves, where the robots move its ends along straight lines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from batten.curves.elastica import points_batch, states_at
from batten.fabrication.plan import Block, RodPlacement, gripper_frames
from batten.fabrication.robot.motion import grip_poses
from batten.fabrication.simulation import BlockPath, held_ends, interpolated_poses, placed_shapes
from batten.kernels.boundary_track import follow_batch
from batten.solvers.track import standard_numbers
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.deviation import surface_deviation
from batten.typing import FloatArray, IntArray

SHARES = np.array([0.0, 0.25, 0.5, 0.75])
"""Shares of the way from leaf to leaf; at the last three the rod is measured."""
POINTS = 17
"""Points of a piece that are measured."""
_MOST_STEPS = 300
_SLACK_MM = 1e-6


def strays_between(
    surface: BSplineSurface, blocks: Sequence[Block], rods: Sequence[RodPlacement], extend: float = 0.0
) -> FloatArray:
    """Greatest distance of each rod from the surface on its way to the next leaf of its block.

    The grippers go along straight lines and turn by the shortest way, as in `fabrication.simulation`, the rod held without
    spin; from each leaf's own shape the rod is followed. Near a straight line a little slack makes much bow, and the
    straight ways of the ends leave the rod another slack than the leaves have: there they must lie close together.

    Parameters:
        surface: what the blade is to sweep, in the wall frame, mm.
        blocks: all blocks that the rods name. rods: in any order.
        extend: how far the surface may be continued.

    Returns:
        Shape (n,), mm, for points over the block; NaN for the last rod of a block and where nothing lies over it. A rod that
        cannot be followed all the way counts as far as it comes.

    Accuracy: the greatest of 17 points along the piece at three shares of the way: some 1 % of itself.
    """
    out = np.full(len(rods), np.nan)
    pairs = _pairs(rods)
    if not len(pairs):
        return out
    a, b = pairs.T
    frames = gripper_frames(rods)
    arms = [
        grip_poses(frames.positions_mm[:, k], frames.tangents[:, k], frames.normals, s)
        for k, s in enumerate(("left", "right"))
    ]
    chain = np.stack([a, b], axis=1).ravel()  # every other move leads from leaf to leaf
    path = BlockPath(
        0,
        arms[0][chain],
        arms[1][chain],
        ("",) * len(chain),
        np.ones(len(chain), dtype=np.bool_),
        np.ones(len(chain) - 1),
    )
    n, k = len(a), len(SHARES)
    held = held_ends(*interpolated_poses(path, np.repeat(2 * np.arange(n), k), np.tile(SHARES, n)))
    poses = held.pose.reshape(n, k, 6)
    length = np.array([r.rod.length for r in rods])
    shape = standard_numbers(np.array([r.rod.parameters for r in rods])[a])
    part = np.array([(r.before_mm, r.before_mm + r.piece.length) for r in rods]) / length[:, None]
    part = np.stack([np.minimum(part[a, 0], part[b, 0]), np.maximum(part[a, 1], part[b, 1])], axis=1)
    fractions = part[:, :1] + (part[:, 1:] - part[:, :1]) * np.linspace(0.0, 1.0, POINTS)
    box = {block.number: (block.corner_mm[:2], block.corner_mm[:2] + block.size_mm[:2]) for block in blocks}
    low, high = (np.array([box[rods[i].block][side] for i in a])[:, None] for side in (0, 1))
    worst = np.full(n, np.nan)
    origin, frame = held.origin.reshape(n, k, 3), held.frame.reshape(n, k, 3, 3)
    for j in range(1, k):
        come, arrived = np.empty(n), np.empty((n, 4))
        before, here = (np.ascontiguousarray(poses[:, i]) for i in (j - 1, j))
        follow_batch(shape, before, here, length[a], _MOST_STEPS, come, arrived, np.empty((n, 2), dtype=np.int64))
        arrived[~(come >= 1.0)] = np.nan
        shape = arrived
        curves = placed_shapes(arrived, here, length[a])
        curves[:, :4] = states_at(curves, fractions[:, 0] * length[a])
        curves[:, 6] = (fractions[:, -1] - fractions[:, 0]) * length[a]
        flat = points_batch(curves, np.linspace(0.0, 1.0, POINTS))
        points = origin[:, j, None] + flat[..., :1] * frame[:, j, None, 0] + flat[..., 1:] * frame[:, j, None, 1]
        with np.errstate(invalid="ignore"):
            over = ((points[..., :2] >= low - _SLACK_MM) & (points[..., :2] <= high + _SLACK_MM)).all(axis=-1)
        off = np.full(over.shape, np.nan)
        off[over] = np.abs(surface_deviation(surface, points[over], extend=extend).signed)
        worst = np.fmax(worst, np.fmax.reduce(off, axis=1))
    out[a] = worst
    return out


def _pairs(rods: Sequence[RodPlacement]) -> IntArray:
    """Indices (k, 2) of rods of successive leaves in one block."""
    block, leaf = (np.array([getattr(r, name) for r in rods], dtype=np.int64) for name in ("block", "leaf"))
    order = np.lexsort((leaf, block))
    same = block[order[1:]] == block[order[:-1]]
    return np.stack([order[:-1][same], order[1:][same]], axis=1).astype(np.int64)
