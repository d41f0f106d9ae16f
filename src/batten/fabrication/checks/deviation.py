"""How far the cut comes from the wanted surface, and from the wanted curve in the leaf's plane."""

from __future__ import annotations

import numpy as np

from batten.fabrication.checks.context import CheckContext, greatest, to_world
from batten.fabrication.kerf import offset_along_normal_mm
from batten.fabrication.plan import CheckResult
from batten.kernels.polyline_distance import directed_distance
from batten.surfaces.deviation import surface_deviation
from batten.typing import FloatArray

SURFACE_STATIONS = 33
"""Points of a piece whose distance from the surface is measured."""
CURVE_STATIONS = 129
"""Points of the polylines between which the Hausdorff distance is taken."""


def deviation_checks(context: CheckContext) -> tuple[CheckResult, CheckResult, CheckResult]:
    """Greatest (hard) and mean distance of each piece from the surface, and its Hausdorff distance from the design curve.

    All for the part of the piece within its block, and against `leaves.tolerance_mm`. With `kerf.offset` what counts is the
    melted face, half the nominal kerf from the piece at right angles to the surface; the wanted curve is then the section
    of the parallel surface that the piece is to follow. The Hausdorff distance is two-sided, so it also sees where the
    piece does not reach; at the ends of the part it can exceed the normal distance.

    Accuracy: of the greatest distance, about 1e-3 of itself where it has fewer than three waves over the piece; of the
    Hausdorff distance, 1e-3 of the tolerance and the sagitta of 1/128 of the piece (0.01 mm at 600 mm, radius 300 mm).
    Degenerate: NaN for a rod with nothing in its block, or without design points.
    """
    tolerance = context.job.leaves.tolerance_mm
    pieces = to_world(context.origin, context.frame, context.piece_within(SURFACE_STATIONS))
    offset = offset_along_normal_mm(context.job, context.surface)
    signed = surface_deviation(context.surface, pieces, extend=_beyond(context, offset)).signed - offset
    worst = np.maximum(greatest(signed), greatest(-signed))
    size = np.abs(signed)
    mean = (size.sum(axis=1) - 0.5 * (size[:, 0] + size[:, -1])) / (SURFACE_STATIONS - 1.0)
    note = "Within the block, at right angles to the surface."
    if offset != 0.0:
        side = "below" if context.job.kerf.side == "lower" else "above"
        note += f" Of the face that is left, {abs(offset):g} mm {side} the blade."
    return (
        CheckResult("deviation", "Greatest deviation from the surface", "mm", tolerance, "max", worst, note),
        CheckResult(
            "deviation_mean", "Mean deviation from the surface", "mm", tolerance, "max", mean, note, hard=False
        ),
        CheckResult(
            "hausdorff",
            "Hausdorff distance from the wanted curve",
            "mm",
            tolerance,
            "max",
            _hausdorff(context, 1e-3 * tolerance),
            "In the leaf's plane, two-sided, of what lies within the block.",
            hard=False,
        ),
    )


def _beyond(context: CheckContext, offset: float) -> float:
    """How far to continue the surface, so that the foot of a point beside its border is found; 0 without offset."""
    low, high = context.surface.bounding_box()
    return float(4.0 * abs(offset) / (high - low)[:2].min())


def _hausdorff(context: CheckContext, within: float) -> FloatArray:
    pieces, designs = context.piece_within(CURVE_STATIONS), context.design_within(CURVE_STATIONS)
    # The near point may lie just beyond the block's border: on a steep leaf, or where a turned plane leaves by a side face.
    whole_pieces = context.piece_within(CURVE_STATIONS, whole=True)
    whole_designs = context.design_within(CURVE_STATIONS, whole=True)
    values = np.full(len(pieces), np.nan)
    known = np.isfinite(pieces).all(axis=(1, 2)) & np.isfinite(designs).all(axis=(1, 2))
    for i in np.flatnonzero(known):
        there = directed_distance(pieces[i], whole_designs[i], within, 0.0)
        values[i] = directed_distance(designs[i], whole_pieces[i], within, there)
    return values
