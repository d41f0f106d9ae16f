"""Polylines of the plane."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from batten.curves.base import check_order
from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError
from batten.typing import ArrayLike, FloatArray


@dataclass(frozen=True, eq=False)
class Polyline:
    """Straight segments through points, parametrised by arc length: t is the part of the length that is behind.

    Parameters:
        points: shape (n, 2), n ≥ 2, finite, neighbours different; copied and made read-only. For a closed one repeat the
            first point at the end.

    Raises:
        InvalidInputError: another shape, numbers that are not finite, neighbours that coincide.

    Degenerate cases: it has no curvature that would mean anything (0 along the segments, infinite at the corners), so the
    measures that need one refuse it: interpolate its points with `BSplineCurve.interpolate`.

    Example:
        >>> corner = Polyline([(0, 0), (3, 0), (3, 1)])
        >>> corner.length, corner.point(0.75).tolist(), corner.breaks().tolist()
        (4.0, [3.0, 0.0], [0.0, 0.75, 1.0])
    """

    points: FloatArray
    _breaks: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2:
            raise InvalidInputError(f"a polyline has points of shape (n, 2), n ≥ 2; got shape {points.shape}")
        if not np.isfinite(points).all():
            raise InvalidInputError("the points of a polyline must be finite; got NaN or infinity among them")
        steps = np.hypot(*np.diff(points, axis=0).T)
        if not (steps > 0.0).all():
            raise InvalidInputError(
                f"neighbouring points of a polyline must differ; points {np.flatnonzero(steps == 0.0)[:5].tolist()} "
                "coincide with the next: drop them"
            )
        breaks = np.concatenate([[0.0], np.cumsum(steps)])
        breaks /= breaks[-1]
        points.setflags(write=False)
        breaks.setflags(write=False)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "_breaks", breaks)

    def point(self, t: ArrayLike) -> FloatArray:
        """Points γ(t), shape (…, 2) for t of shape (…). Outside [0, 1] the end segments go on."""
        t = np.asarray(t, dtype=np.float64)
        i = self._segment(t)
        left, right = self._breaks[i], self._breaks[i + 1]
        w = ((t - left) / (right - left))[..., None]
        return (1.0 - w) * self.points[i] + w * self.points[i + 1]

    def derivative(self, t: ArrayLike, order: int = 1) -> FloatArray:
        """Derivatives dⁿγ/dtⁿ, shape (…, 2); of order 1 the segment's direction times the length, of others 0."""
        check_order(order)
        t = np.asarray(t, dtype=np.float64)
        if order > 1:
            return np.zeros((*t.shape, 2))
        i = self._segment(t)
        return (self.points[i + 1] - self.points[i]) / (self._breaks[i + 1] - self._breaks[i])[..., None]

    @property
    def length(self) -> float:
        """The arc length: the sum of the segments' lengths."""
        return float(np.hypot(*np.diff(self.points, axis=0).T).sum())

    def breaks(self) -> FloatArray:
        """The parameters of the points, shape (n,)."""
        return self._breaks

    def reversed(self) -> Polyline:
        """The same points run through from the end to the start."""
        return Polyline(self.points[::-1])

    def transformed(self, similarity: Similarity) -> Polyline:
        """The image under a similarity."""
        return Polyline(similarity.apply(self.points))

    def _segment(self, t: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.intp]]:
        return np.clip(np.searchsorted(self._breaks, t, side="right") - 1, 0, len(self._breaks) - 2)
