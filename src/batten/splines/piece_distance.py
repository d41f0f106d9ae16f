"""How far pieces of elastica are from the parts of a curve that they stand for."""

from __future__ import annotations

import numpy as np

from batten.curves.elastica import states_along
from batten.kernels.polyline_distance import directed_distance
from batten.splines.curve_spans import CurveSpan
from batten.typing import FloatArray

_MOST_POINTS = 200_000


def piece_distance(span: CurveSpan, a: float, b: float, parameters: FloatArray, within: float) -> float:
    """The greatest distance, both ways, between an elastica (7,) and the part [a, b] of a span: at most `within` off.

    The elastica is followed by chords that stray no more than the span's own trace; inf where that needs more than
    200,000 of them, or the parameters are not finite. An upper bound for the distance of the two as parts of whole curves.
    """
    if not np.isfinite(parameters).all():
        return np.inf
    length = float(parameters[6])
    bend = np.abs(states_along(parameters[None], np.linspace(0.0, length, 65)[None])[0, :, 3]).max()
    force = float(np.hypot(parameters[4], parameters[5]))
    bend = bend + force * length / 128.0  # |κ′| ≤ |force|, and no point is farther from a station
    count = np.ceil(length * np.sqrt(bend / (8.0 * span.fineness))) + 2.0
    if not count < _MOST_POINTS:
        return np.inf
    s = np.linspace(0.0, length, int(count))
    points = np.ascontiguousarray(states_along(parameters[None], s[None])[0, :, :2])
    target = span.part(a, b)
    there = directed_distance(points, target, within, 0.0)
    return float(directed_distance(target, points, within, there))


def piece_distances(span: CurveSpan, a: FloatArray, b: FloatArray, parameters: FloatArray, within: float) -> FloatArray:
    """`piece_distance` for k pieces: a, b (k,), parameters (k, 7)."""
    return np.array([piece_distance(span, *row, p, within) for row, p in zip(zip(a.tolist(), b.tolist()), parameters)])
