"""Polylines that follow a curve within a tolerance."""

from __future__ import annotations

import numpy as np

from batten.curves.base import Curve
from batten.errors import InvalidInputError
from batten.typing import FloatArray

_TESTS = np.array([0.25, 0.5, 0.75])


def flatten(curve: Curve, tolerance: float) -> FloatArray:
    """Points on the curve, in order, such that the polyline through them is nowhere farther than `tolerance` from it.

    Each interval between two points is tested at three places and divided, by the square root of what it is off, until
    it passes; breaks of the curve are always among the points.

    Parameters:
        curve: any `Curve`.
        tolerance: > 0, in the unit of the coordinates.

    Returns:
        Points, shape (n, 2), n ≥ 2; a gap between the pieces of a `PiecewiseCurve` becomes a segment.

    Raises:
        InvalidInputError: a tolerance that is not positive and finite.

    Accuracy: tested, not proved: a curve with detail narrower than a 32nd of a smooth piece may hide it.

    Example:
        >>> from batten.curves.bezier import CubicBezier
        >>> len(flatten(CubicBezier([(0, 0), (1, 0), (2, 0), (3, 0)]), 1e-3))
        9
    """
    if not (np.isfinite(tolerance) and tolerance > 0.0):
        raise InvalidInputError(f"a curve is flattened to a positive tolerance; got {tolerance}")
    breaks = np.asarray(curve.breaks(), dtype=np.float64)
    # The end of each smooth piece just before its break: at the break itself the next piece begins.
    stops = np.append(np.nextafter(breaks[1:-1], 0.0), breaks[-1])
    t = (breaks[:-1, None] + (stops - breaks[:-1])[:, None] * np.linspace(0.0, 1.0, 9)).ravel()
    points = curve.point(t)
    left, right, a, b = t[:-1], t[1:], points[:-1], points[1:]
    places, found = [t], [points]
    for _ in range(60):
        off = _deviation(curve, left, right, a, b)
        parts = np.where(off <= 0.8 * tolerance, 1, np.clip(np.ceil(np.sqrt(1.3 * off / tolerance)), 2, 64)).astype(int)
        busy = parts > 1
        if not busy.any():
            break
        left, right, a, b, parts = left[busy], right[busy], a[busy], b[busy], parts[busy]
        # The k-th of the parts of each busy interval.
        whole = np.repeat(np.arange(parts.size), parts)
        k = np.arange(whole.size) - np.repeat(np.cumsum(parts) - parts, parts)
        ends = left[whole] + (right - left)[whole] * ((k + 1) / parts[whole])
        last = k + 1 == parts[whole]
        ends[last] = right
        far = np.empty((ends.size, 2))
        far[last] = b
        far[~last] = curve.point(ends[~last])
        places.append(ends[~last])
        found.append(far[~last])
        near = np.roll(far, 1, axis=0)
        near[k == 0] = a
        left, right, a, b = np.where(k == 0, left[whole], np.roll(ends, 1)), ends, near, far
    order = np.argsort(np.concatenate(places), kind="stable")
    return np.ascontiguousarray(np.concatenate(found)[order])


def _deviation(curve: Curve, left: FloatArray, right: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Greatest distance of three points of the curve from the chord from a to b of each interval, shape (n,)."""
    p = curve.point(left[:, None] + (right - left)[:, None] * _TESTS) - a[:, None]
    px, py = p[..., 0], p[..., 1]
    dx, dy = (b - a)[:, 0, None], (b - a)[:, 1, None]
    square = dx * dx + dy * dy
    along = np.clip((px * dx + py * dy) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
    return np.asarray(np.sqrt(((px - along * dx) ** 2 + (py - along * dy) ** 2).max(axis=1)))
