"""How far the kerf strays from its nominal width where points of the blade move faster or slower than planned for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from batten.fabrication.job import CutJob
from batten.fabrication.kerf import kerf_law
from batten.fabrication.plan import Block, BlockMotion, CheckResult, RodPlacement
from batten.fabrication.speed_plan import local_speeds_mm_s
from batten.typing import FloatArray


def kerf_checks(
    job: CutJob, blocks: Sequence[Block], rods: Sequence[RodPlacement], motions: Sequence[BlockMotion]
) -> tuple[CheckResult, ...]:
    """Greatest difference of the kerf from `blade.kerf_mm` along the blade, on the moves before and after each rod (soft).

    The kerf follows from the job's law and the speed at right angles to the blade, within the block; half of the
    difference is how far the melted face is off. Infinite where a point moves at a speed for which the kerf is not known.
    Nothing without a law: the kerf then counts as the same everywhere, and `speed_ratio` tells how uneven the moves are.

    Accuracy: that of the law; see `local_ways_mm`.
    Degenerate: NaN for a rod in no motion, and for one whose moves pass beside its block.
    """
    law = kerf_law(job.kerf)
    if law is None or not motions:
        return ()
    by_number = {block.number: block for block in blocks}
    values = np.full(len(rods), np.nan)
    slowest, fastest = np.inf, 0.0
    for motion in motions:
        speeds = local_speeds_mm_s(motion, rods, by_number[motion.block])
        known = np.isfinite(speeds)
        slowest, fastest = min(slowest, speeds[known].min(initial=np.inf)), max(fastest, speeds[known].max(initial=0.0))
        off = np.abs(law.width_mm(speeds) - job.blade.kerf_mm)
        off = np.where(known & np.isnan(off), np.inf, off)
        moves: FloatArray = np.fmax.reduce(off, axis=1, initial=np.nan)
        for side in (slice(None, -1), slice(1, None)):
            index = np.array(motion.rods, dtype=np.int64)[side]
            values[index] = np.fmax(values[index], moves)
    note = "By the job's law from the speed at right angles to the blade, within the block; half of it is the face's error."
    if fastest > 0.0:
        note += f" Points of the blade move at {slowest:.3g} to {fastest:.3g} mm/s."
    return (
        CheckResult(
            "kerf", "Difference of the kerf from nominal", "mm", job.kerf.tolerance_mm, "max", values, note, hard=False
        ),
    )
