"""How unevenly the blade moves between successive leaves: where it is slow, more foam melts."""

from __future__ import annotations

import numpy as np

from batten.fabrication.checks.context import CheckContext, worst_of_pairs
from batten.fabrication.plan import CheckResult

STATION_STRIDE = 2


def speed_ratio_check(context: CheckContext) -> CheckResult:
    """Fastest over slowest point of the blade in the block, from one leaf to the next (Fisker2018 §1.2).

    The way of a point of the blade is that between points at equal fractions of the two pieces, where both lie within
    the block; each rod gets the greater of the ratios before and after it. It is reported, not enforced: the kerf
    grows where the blade is slow, but the cut stays a cut. A point that stands still makes the ratio infinite.

    Accuracy: the fractions are 1/32 apart; between them the ratio can be a little greater. A move is taken as straight.
    """
    first, second = context.pairs.T
    points = context.piece_points[:, ::STATION_STRIDE]
    inside = context.piece_inside[:, ::STATION_STRIDE]
    way = np.linalg.norm(points[second] - points[first], axis=-1)
    both = inside[first] & inside[second]
    fastest, slowest = np.where(both, way, -np.inf).max(axis=1), np.where(both, way, np.inf).min(axis=1)
    ratio = np.full(len(first), np.nan)
    known = both.sum(axis=1) >= 2
    still = known & (slowest <= 1e-12 * np.maximum(fastest, 1.0))
    ratio[still] = np.inf
    moving = known & ~still
    ratio[moving] = fastest[moving] / slowest[moving]
    return CheckResult(
        "speed_ratio",
        "Fastest over slowest point of the blade",
        "",
        context.job.blade.max_speed_ratio,
        "max",
        worst_of_pairs(len(context.rods), context.pairs, ratio, least=False),
        "Within the block, from leaf to leaf, between equal fractions of the two pieces.",
        hard=False,
    )
