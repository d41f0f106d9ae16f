"""Whether the rod, beyond its piece, comes back into the block and melts what should stay."""

from __future__ import annotations

import numpy as np

from batten.curves.elastica import points_batch
from batten.fabrication.checks.context import CheckContext, shifted, to_world
from batten.fabrication.collisions import box_distance
from batten.fabrication.plan import CheckResult
from batten.typing import BoolArray, FloatArray

SKIPPED_MM = 5.0
"""So much of the rod next to the piece's ends is not looked at: there it touches the block's face."""
STATIONS = 65


def reentry_check(context: CheckContext) -> CheckResult:
    """Least signed distance (mm) of the rod's two extensions from the block's box, against half the kerf.

    The extensions are what lies of the rod before and after the piece, which spans the whole column of blocks; where a
    turned plane leaves the block through a side face, the rest of the piece lies in the same plane and cannot come back
    to the block, which is convex in plan. The first 5 mm next to the piece are passed over.

    Accuracy: between samples, 1/64 of an extension apart, the distance can be less by half that spacing.
    Degenerate: NaN if neither extension is longer than these 5 mm.
    """
    p = context.piece_parameters
    least = np.full(len(p), np.nan)
    for free, begin, end in (
        (context.before, -context.before, np.full(len(p), -SKIPPED_MM)),
        (context.after, p[:, 6] + SKIPPED_MM, p[:, 6] + context.after),
    ):
        some = free > SKIPPED_MM
        if some.any():
            least[some] = np.fmin(least[some], _distance(context, some, begin[some], end[some]))
    return CheckResult(
        "reentry",
        "Rod outside the block beyond the cut",
        "mm",
        0.5 * context.job.blade.kerf_mm,
        "min",
        least,
        f"Distance from the block of what lies beyond the cut, its first {SKIPPED_MM:g} mm apart, against half the kerf; "
        "negative within the block.",
    )


def _distance(context: CheckContext, some: BoolArray, begin: FloatArray, end: FloatArray) -> FloatArray:
    """Least distance from the box of the stretch between two arc lengths of the piece's curve, for the rods `some`."""
    part = shifted(context.piece_parameters[some], begin)
    part[:, 6] = end - begin
    flat = points_batch(part, np.linspace(0.0, 1.0, STATIONS))
    points = to_world(context.origin[some], context.frame[some], flat)
    return np.asarray(box_distance(points, context.box_low[some, None], context.box_high[some, None]).min(axis=1))
