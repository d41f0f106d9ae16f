"""Whether the rod comes so near a straight line that it may snap to the other side."""

from __future__ import annotations

import numpy as np

from batten.fabrication.checks.context import CheckContext, greatest, worst_of_pairs
from batten.fabrication.plan import CheckResult
from batten.typing import FloatArray, IntArray

_SHARES = np.linspace(0.0, 1.0, 9)
_STRIDE = 4
_ZOOMS = 3


def straightness_checks(context: CheckContext) -> tuple[CheckResult, CheckResult]:
    """Bow (mm) of each rod, and the least bow on the way between it and its neighbours in the block (soft).

    A rod held straight bears a force that its shape does not determine, and has two mirror shapes to give way to:
    there it wobbles and leaves a ridge (Fisker2018 §1.2, §5.4.3). The bow is the greatest distance of the whole rod
    from its chord, both against `rod.min_bow_mm`.

    On the way from one leaf to the next the curvature as a function of arc length is taken to change linearly, which is
    the shortest way between the two shapes; if the bow flips sides without an S between, the way passes a line.

    Accuracy: the bow to 1e-6 of itself; the least bow on the way to 1/100 of the change of bow.
    """
    limit = context.job.rod.min_bow_mm
    between = least_bows_between(context.curvature, context.rod_parameters[:, 6], context.pairs)
    return (
        CheckResult(
            "straightness",
            "Bow of the rod over its chord",
            "mm",
            limit,
            "min",
            bow(context.plane_points),
            "Greatest distance of the whole rod from the chord; near a straight line it may buckle to either side.",
        ),
        CheckResult(
            "passes_straight",
            "Least bow on the way between leaves",
            "mm",
            limit,
            "min",
            worst_of_pairs(len(context.rods), context.pairs, between, least=True),
            "The curvature is assumed to change linearly between successive leaves of a block.",
            hard=False,
        ),
    )


def bow(points: FloatArray) -> FloatArray:
    """Greatest distance of equally spaced points (…, m, 2) of curves from their chords; shape (…).

    Degenerate: a closed curve has no chord; its greatest distance from its start is returned.

    Example:
        >>> angle = np.linspace(0.0, np.pi, 129)
        >>> round(float(bow(np.stack([np.cos(angle), np.sin(angle)], axis=-1))), 12)
        1.0
    """
    along = points - points[..., :1, :]
    chord = along[..., -1, :]
    length = np.hypot(chord[..., 0], chord[..., 1])
    closed = length < 1e-12 * np.abs(along).max(axis=(-2, -1))
    across = along[..., 1] * chord[..., :1] - along[..., 0] * chord[..., 1:]
    height = across / np.where((length > 0.0) & ~closed, length, 1.0)[..., None]
    bowed = np.abs(np.maximum(greatest(height), greatest(-height)))
    return np.where(closed, np.hypot(along[..., 0], along[..., 1]).max(axis=-1), bowed)


def least_bows_between(curvature: FloatArray, lengths: FloatArray, pairs: IntArray) -> FloatArray:
    """Least bow while the curvature goes linearly from that of one rod to the next's, for every pair: (k,).

    Of nine shares between the two the one with the least bow is found, then of nine around it, three times in all.

    Parameters:
        curvature: (n, m), of n rods at equal steps from end to end, m − 1 a multiple of 4. lengths: (n,), of the rods.
        pairs: (k, 2), indices of rods.
    """
    if len(pairs) == 0:
        return np.empty(0)
    kappa = curvature[:, ::_STRIDE]
    step = lengths / (kappa.shape[1] - 1.0)
    first, second = (kappa[pairs[:, i]] for i in (0, 1))
    step = step[pairs].mean(axis=1)
    low, high = np.zeros(len(first)), np.ones(len(first))
    least = np.full(len(first), np.inf)
    for _ in range(_ZOOMS):
        shares = low[:, None] + (high - low)[:, None] * _SHARES
        bows = bow(_shapes(first[:, None] + shares[..., None] * (second - first)[:, None], step[:, None]))
        least = np.minimum(least, bows.min(axis=1))
        at = bows.argmin(axis=1)
        rows = np.arange(len(at))
        low, high = shares[rows, np.maximum(at - 1, 0)], shares[rows, np.minimum(at + 1, len(_SHARES) - 1)]
    return least


def _shapes(kappa: FloatArray, step: FloatArray) -> FloatArray:
    """Plane curves (…, m, 2) of given curvature (…, m) at equal steps (…) of arc length, by the trapezium rule twice."""
    h = step[..., None]
    turn = np.cumsum(0.5 * h * (kappa[..., 1:] + kappa[..., :-1]), axis=-1)
    angle = np.concatenate([np.zeros_like(kappa[..., :1]), turn], axis=-1)
    middle = 0.5 * (angle[..., 1:] + angle[..., :-1])
    points = np.zeros((*kappa.shape, 2))
    points[..., 1:, 0] = np.cumsum(h * np.cos(middle), axis=-1)
    points[..., 1:, 1] = np.cumsum(h * np.sin(middle), axis=-1)
    return points
