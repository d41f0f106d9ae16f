"""How fast each move is to be, so that the kerf is right along the blade.

From one leaf to the next the points of the rod go different ways in the same time, and where the blade is slower it melts
a wider kerf. Moving along itself it melts nothing, so what counts is the speed at right angles to the blade.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from batten.curves.elastica import states_along
from batten.errors import InvalidInputError
from batten.fabrication.checks.context import interval_within, plan_depth
from batten.fabrication.job import CutJob
from batten.fabrication.kerf import KerfLaw, kerf_law
from batten.fabrication.plan import Block, BlockMotion, RodPlacement
from batten.typing import ArrayLike, FloatArray

STATIONS = 65
"""Points along the part of the rod within the block whose ways are measured."""

_HALVINGS = 60
_INSET = 1e-9  # so that rounding leads to no speed beyond a table


def local_ways_mm(rods: Sequence[RodPlacement], block: Block) -> FloatArray:
    """How far each point of the rod goes at right angles to it from each rod to the next, mm.

    With d the difference of the places of one point of the rod, at the same arc length s from the left gripper, and t the
    unit mean of its tangents, that is ‖d − (d · t) t‖: for a rod that turns about its end, exactly the chord of the arc.

    Parameters:
        rods: n successive rods in one block, in cutting order.
        block: the block.

    Returns:
        Shape (n − 1, STATIONS), at equal steps of s over what both pieces have in common and the middles of the ways have
        within the block's plan rectangle; NaN if that is nothing.

    Accuracy: the move is taken as straight.
    """
    before = np.array([r.before_mm for r in rods])
    after = before + np.array([r.piece.length for r in rods])
    first, last = np.maximum(before[:-1], before[1:]), np.minimum(after[:-1], after[1:])
    shares = np.broadcast_to(np.linspace(0.0, 1.0, STATIONS), (len(first), STATIONS))
    depth = _depth(*_pairs(rods, first[:, None] + (last - first)[:, None] * shares)[0], block)
    low, high = interval_within(depth).T[..., None]
    places, tangents = _pairs(rods, first[:, None] + (last - first)[:, None] * (low + (high - low) * shares))
    mean = tangents[0] + tangents[1]
    mean /= np.maximum(np.linalg.norm(mean, axis=-1, keepdims=True), 1e-300)
    way = places[1] - places[0]
    across = way - (way * mean).sum(axis=-1, keepdims=True) * mean
    return np.asarray(np.linalg.norm(across, axis=-1))


def seconds_for_kerf(
    ways_mm: ArrayLike, law: KerfLaw, kerf_mm: float, min_speed_mm_s: float, max_speed_mm_s: float
) -> FloatArray:
    """The time of each move for which the greatest difference of the kerf from `kerf_mm` along the blade is least.

    The kerf K(v) falls with speed, so its greatest and least value are those of the slowest and the fastest point, and
    the difference is least where their mean is `kerf_mm`. The fastest point keeps to the speeds allowed and to those
    for which the law is known. For slower points outside its range, the kerf at its end is taken, the least that it can be.

    Parameters:
        ways_mm: shape (…, k), ways of points of the blade at right angles to it; NaN for points that do not count.
        law: the kerf as a function of speed.
        kerf_mm: the wanted kerf, mm.
        min_speed_mm_s, max_speed_mm_s: bounds for the speed of the fastest point.

    Returns:
        Seconds, shape (…); NaN for a move without a point that counts or moves.

    Raises:
        InvalidInputError: bounds of speed that leave nothing of the law's range.

    Accuracy: 1e-9 of the time.

    Example:
        >>> law = KerfLaw(formula="a + b / v", a=0.4, b=12.0)
        >>> seconds_for_kerf([20.0, 20.0], law, 1.0, 1.0, 100.0).round(6).tolist()  # 20 mm at 20 mm/s
        1.0
        >>> seconds_for_kerf([10.0, 20.0], law, 1.0, 1.0, 100.0).round(6).tolist()  # kerfs of 1.2 and 0.8 mm
        0.666667
    """
    least, most = max(min_speed_mm_s, law.range_mm_s[0]), min(max_speed_mm_s, law.range_mm_s[1])
    if not 0.0 < least <= most < np.inf:
        raise InvalidInputError(
            f"speeds of {min_speed_mm_s:g} … {max_speed_mm_s:g} mm/s are allowed, and the kerf is known for "
            f"{law.range_mm_s[0]:g} … {law.range_mm_s[1]:g} mm/s; these must overlap"
        )
    ways = np.asarray(ways_mm, dtype=np.float64)
    slow = np.where(np.isnan(ways), np.inf, ways).min(axis=-1)
    fast = np.where(np.isnan(ways), -np.inf, ways).max(axis=-1)
    moves = fast > 0.0
    slow, fast = np.where(moves, slow, 1.0), np.where(moves, fast, 1.0)
    low, high = fast / most * (1.0 + _INSET), fast / least * (1.0 - _INSET)
    for _ in range(_HALVINGS):
        middle = np.sqrt(low * high)
        speeds = np.clip(np.stack([slow, fast]) / middle, *law.range_mm_s)
        too_wide = law.width_mm(speeds).mean(axis=0) > kerf_mm
        low, high = np.where(too_wide, low, middle), np.where(too_wide, middle, high)
    return np.where(moves, np.sqrt(low * high), np.nan)


def leaf_seconds(job: CutJob, rods: Sequence[RodPlacement], block: Block) -> FloatArray | None:
    """The times of the moves between successive rods of a block, (n − 1,), that the job's kerf asks for.

    NaN for a move beside the block; None if the job gives no law for the kerf.
    """
    law = kerf_law(job.kerf)
    if law is None:
        return None
    bounds = job.kerf.min_speed_mm_s, job.kerf.max_speed_mm_s
    return seconds_for_kerf(local_ways_mm(rods, block), law, job.blade.kerf_mm, *bounds)


def local_speeds_mm_s(motion: BlockMotion, rods: Sequence[RodPlacement], block: Block) -> FloatArray:
    """Speeds of the blade's points at right angles to it on the moves from leaf to leaf of a motion: (n − 1, STATIONS).

    Parameters:
        motion: of one block. rods: all rods of the plan. block: the motion's block.
    """
    return local_ways_mm([rods[i] for i in motion.rods], block) / motion.seconds[1:-1, None]


_Two = tuple[FloatArray, FloatArray]


def _pairs(rods: Sequence[RodPlacement], s: FloatArray) -> tuple[_Two, _Two]:
    """Places and unit tangents in space, each (n − 1, k, 3), of each rod and of the next one at arc lengths (n − 1, k)."""
    places, tangents = [], []
    for some in (rods[:-1], rods[1:]):
        parameters = np.array([r.rod.parameters for r in some]).reshape(-1, 7)
        x, y, angle = np.moveaxis(states_along(parameters, s)[..., :3, None], 2, 0)
        origin, x_axis, y_axis = (
            np.array([getattr(r.plane, name) for r in some]).reshape(-1, 1, 3)
            for name in ("origin", "x_axis", "y_axis")
        )
        places.append(origin + x * x_axis + y * y_axis)
        tangents.append(np.cos(angle) * x_axis + np.sin(angle) * y_axis)
    return (places[0], places[1]), (tangents[0], tangents[1])


def _depth(first: FloatArray, second: FloatArray, block: Block) -> FloatArray:
    """How far the middles of ways lie within the block's plan rectangle."""
    corner = np.broadcast_to(block.corner_mm, (len(first), 3))
    return plan_depth(0.5 * (first + second), corner, corner + block.size_mm)
