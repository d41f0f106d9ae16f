"""Any curve by few cubic Béziers, with a verified distance."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from batten.curves.arc_length import ArcLength
from batten.curves.base import Curve
from batten.curves.bezier import CubicBezier
from batten.curves.bezier_breaks import fewest_places, halved_places
from batten.curves.piecewise import PiecewiseCurve
from batten.errors import InvalidInputError
from batten.kernels import to_beziers as kernel
from batten.kernels.quadrature import NODES_24
from batten.typing import BoolArray, FloatArray

#: From values at the nodes to Chebyshev coefficients.
_FIT = np.linalg.inv(np.polynomial.chebyshev.chebvander(2.0 * NODES_24 - 1.0, 23)).T
#: A turn of the tangent that makes a corner, radians.
_CORNER = 1e-6
_LEAST = 1e-13


@dataclass(frozen=True, eq=False)
class BezierPieces:
    """Cubic Béziers that follow a curve.

    Attributes:
        pieces: the cubics, in order.
        places: (n + 1,), parameters of the curve where they begin and end.
        distances: (n,), bounds of the distance between each of them and its part of the curve, both ways.
        smooth: (n,), whether the tangent goes on from the piece before; at 0, from the last one of a closed curve.
        joined: (n,), whether a piece begins where the one before it ends; at 0, whether the curve is closed.
        tolerance: what was asked for.
        halving_pieces: how many there would be if pieces were halved until they are within the tolerance; 0 if unknown.
    """

    pieces: tuple[CubicBezier, ...]
    places: FloatArray
    distances: FloatArray
    smooth: BoolArray
    joined: BoolArray
    tolerance: float
    halving_pieces: int

    @cached_property
    def control_points(self) -> FloatArray:
        """(n, 4, 2)."""
        return np.stack([piece.control_points for piece in self.pieces])

    @cached_property
    def curve(self) -> PiecewiseCurve:
        """All pieces as one curve."""
        return PiecewiseCurve(self.pieces)

    @property
    def distance(self) -> float:
        """The greatest of `distances`."""
        return float(self.distances.max())

    @property
    def closed(self) -> bool:
        """Whether the last piece ends where the first begins."""
        return bool(self.joined[0])

    def draw(self, pen: Any) -> None:
        """Draw into a segment pen of fontTools (moveTo, lineTo, curveTo, closePath, endPath); straight pieces as lines.

        Example:
            >>> from batten.curves.polyline import Polyline
            >>> class Pen:
            ...     def __getattr__(self, name): return lambda *points: print(*[name, *points])
            >>> to_beziers(Polyline([(0, 0), (2, 0), (2, 1), (0, 0)]), 0.1).draw(Pen())
            moveTo (0.0, 0.0)
            lineTo (2.0, 0.0)
            lineTo (2.0, 1.0)
            closePath
        """
        for first, last, closed in self._contours():
            pen.moveTo(_pair(self.control_points[first, 0]))
            for i in range(first, last):
                p = self.control_points[i]
                # closePath draws the line back itself.
                if not _straight(p):
                    pen.curveTo(*(_pair(q) for q in p[1:]))
                elif not (closed and i == last - 1):
                    pen.lineTo(_pair(p[3]))
            if closed:
                pen.closePath()
            else:
                pen.endPath()

    def draw_points(self, pen: Any) -> None:
        """Draw into a point pen of fontTools (beginPath, addPoint, endPath), with `smooth` where the tangent goes on."""
        for first, last, closed in self._contours():
            pen.beginPath()
            kinds = ["line" if _straight(self.control_points[i]) else "curve" for i in range(first, last)]
            start = kinds[-1] if closed else "move"
            smooth = closed and bool(self.smooth[first])
            pen.addPoint(_pair(self.control_points[first, 0]), start, smooth)
            for i, kind in zip(range(first, last), kinds):
                if kind == "curve":
                    pen.addPoint(_pair(self.control_points[i, 1]))
                    pen.addPoint(_pair(self.control_points[i, 2]))
                if not (closed and i == last - 1):
                    on = i + 1 < last and bool(self.smooth[i + 1])
                    pen.addPoint(_pair(self.control_points[i, 3]), kind, on)
            pen.endPath()

    def _contours(self) -> list[tuple[int, int, bool]]:
        """(first piece, one past the last, closed) of each contour."""
        starts = [0, *(int(i) for i in np.flatnonzero(~self.joined[1:]) + 1), len(self.pieces)]
        whole = len(starts) == 2 and self.closed
        return [(a, b, whole) for a, b in itertools.pairwise(starts)]


def to_beziers(curve: Curve, tolerance: float, *, compatible_with: Sequence[Curve] = ()) -> BezierPieces:
    """Cubic Béziers within a distance of a curve, as few as a division into pieces allows (Levien2009 ch. 9).

    Each cubic has the ends and end tangents of its piece; its arms are those with the piece's signed area and first moment,
    which leads to a quartic; of its roots the nearest to the curve is taken, equal arms where there is none. Corners of the
    curve are kept, between them pieces are divided so that their errors are equal.

    Parameters:
        curve: any `Curve`.
        tolerance: the greatest distance, both ways, in the curve's unit; at least 1e-13 × its length.
        compatible_with: other masters of the same design: see `compatible_beziers`, whose first result this is.

    Returns:
        The pieces, with their distances.

    Raises:
        InvalidInputError: a tolerance out of range, a curve of length 0, masters of another structure.
        ConvergenceError: somewhere not even a short piece stays within the tolerance.

    Accuracy:
        `distances` are bounds from 32 projections on each piece and their second differences, up to
        rounding, 1e-12 × length. Joints that are no corners are
        G¹ to rounding. Never more pieces than halving gives.
    Degenerate cases:
        Lines are one piece each, in a curve that goes on smoothly too. At a cusp that is no break of the curve a
        piece smaller than the tolerance may be left. A tangent that turns by less than 1e-6
        at a break is no corner. Gaps of a `PiecewiseCurve` stay gaps.

    Example:
        >>> from batten.curves.elastica import Elastica
        >>> ring = Elastica((1, 0), np.pi / 2, 1.0, (0, 0), 2 * np.pi)
        >>> found = to_beziers(ring, 3e-4)
        >>> len(found.pieces), found.halving_pieces, found.distance < 3e-4, found.closed
        (4, 4, True, True)
    """
    if len(compatible_with):
        from batten.curves.compatible_beziers import compatible_beziers

        return compatible_beziers([curve, *compatible_with], tolerance)[0]
    own = Panels.of(curve)
    within = checked_tolerance(tolerance, own.length)
    places, halved = [], 0
    for start, stop in own.runs:
        few = fewest_places(own.error, start, stop, within)[0]
        half = halved_places(own.error, start, stop, within)[0]
        halved += len(half) - 1
        places.append(few if len(few) <= len(half) else half)
    return own.pieces(np.concatenate([*(p[:-1] for p in places), places[-1][-1:]]), within, halved)


def checked_tolerance(tolerance: float, length: float) -> float:
    """A tolerance that is finite and not below rounding, or `InvalidInputError`."""
    if not (math.isfinite(tolerance) and tolerance >= _LEAST * length):
        raise InvalidInputError(
            f"to_beziers needs a tolerance of at least 1e-13 × length = {_LEAST * length:.3g}; got {tolerance}"
        )
    return float(tolerance)


@dataclass(frozen=True, eq=False)
class Panels:
    """A curve as polynomials on panels, which is quick to measure.

    Attributes:
        curve: it. arc: its arc length.
        edges: (n + 1,), parameters between the panels. coefficients: (n, 4, 24), Chebyshev, of x, y, x', y' less `origin`.
        origin: (2,), the first point.
        runs: (start, stop) of each part between corners, gaps and ends of lines.
        breaks: parameters of the curve's breaks.
    """

    curve: Curve
    arc: ArcLength
    edges: FloatArray
    coefficients: FloatArray
    origin: FloatArray
    runs: tuple[tuple[float, float], ...]
    breaks: FloatArray

    @classmethod
    def of(cls, curve: Curve) -> Panels:
        """Measure a curve."""
        arc = ArcLength.of(curve)
        edges = arc.edges
        t = edges[:-1, None] + np.diff(edges)[:, None] * NODES_24
        origin = np.asarray(curve.point(0.0))
        values = np.concatenate([curve.point(t) - origin, curve.derivative(t)], axis=-1)
        coefficients = np.ascontiguousarray(np.moveaxis(values, -1, 1) @ _FIT)
        signs = (-1.0) ** np.arange(24)
        begin, end = (coefficients * signs).sum(axis=-1)[1:], coefficients.sum(axis=-1)[:-1]
        scale = np.abs(coefficients[:, 2:]).max(axis=(1, 2))
        breaks = np.asarray(curve.breaks(), dtype=np.float64)
        d = coefficients[:, 2:, 0]  # the mean direction, near enough: across it a line does not move
        off = np.abs(coefficients[:, 0, 1:] * d[:, 1:] - coefficients[:, 1, 1:] * d[:, :1]).sum(axis=1)
        line = off <= 1e-13 * arc.length * np.hypot(*d.T)
        gap = np.hypot(*(begin - end)[:, :2].T) > 1e-9 * arc.length
        turn = np.abs(np.angle((begin[:, 2] + 1j * begin[:, 3]) * np.conj(end[:, 2] + 1j * end[:, 3]))) > _CORNER
        still = (np.hypot(*begin[:, 2:].T) <= 1e-9 * scale[1:]) | (np.hypot(*end[:, 2:].T) <= 1e-9 * scale[:-1])
        cut = edges[1:-1][(gap | turn | still | (line[1:] != line[:-1])) & np.isin(edges[1:-1], breaks)]
        ends = [float(edges[0]), *cut.tolist(), float(edges[-1])]
        return cls(curve, arc, edges, coefficients, origin, tuple(itertools.pairwise(ends)), breaks)

    @property
    def length(self) -> float:
        """The arc length."""
        return self.arc.length

    def error(self, start: float, stop: float) -> float:
        """A bound of the distance of the cubic for a piece."""
        return float(kernel.fit_piece(start, stop, self.edges, self.coefficients, np.empty(2)))

    def arms(self, places: FloatArray) -> FloatArray:
        """(n, 2), the arms of the cubics between places."""
        out = np.empty((len(places) - 1, 2))
        for i, row in enumerate(out):
            kernel.fit_piece(places[i], places[i + 1], self.edges, self.coefficients, row)
        return out

    def thirds(self, places: FloatArray) -> FloatArray:
        """(n,), a third of the arc length between places."""
        return np.diff(self.arc.fraction_at(places)) * (self.arc.length / 3.0)

    def cubics(self, places: FloatArray, arms: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Control points (n, 4, 2) with given arms, and bounds (n,) of their distances."""
        control, off = np.empty((len(arms), 4, 2)), np.empty(len(arms))
        for i, row in enumerate(arms):
            off[i] = kernel.cubic_piece(places[i], places[i + 1], row, self.edges, self.coefficients, control[i])
        return control, off

    def pieces(self, places: FloatArray, tolerance: float, halved: int, arms: FloatArray | None = None) -> BezierPieces:
        """The cubics between places, with the curve's own points at their ends."""
        fitted = self.arms(places) if arms is None else arms
        control, off = self.cubics(places, fitted)
        for i in np.flatnonzero(~np.isfinite(off)):  # no cubic follows it, but it is shorter than the tolerance
            off[i] = self.error(places[i], places[i + 1])
        gap = np.hypot(*(np.roll(control[:, 3], 1, axis=0) - control[:, 0]).T)
        joined = gap <= 1e-9 * self.length
        points = np.asarray(self.curve.point(places))
        if joined[0]:
            points[-1] = points[0]
        control += self.origin
        control[:, :2] += (points[:-1] - control[:, 0])[:, None]
        follows = np.append(joined[1:], True)
        control[follows, 2:] += (points[1:] - control[:, 3])[follows, None]
        before, after = np.roll(control[:, 3] - control[:, 2], 1, axis=0), control[:, 1] - control[:, 0]
        turn = np.abs(np.angle((after[:, 0] + 1j * after[:, 1]) * np.conj(before[:, 0] + 1j * before[:, 1])))
        smooth = joined & (turn <= 10.0 * _CORNER)
        cubics = tuple(CubicBezier(row) for row in control)
        return BezierPieces(cubics, places, off, smooth, joined, tolerance, halved)


def _straight(control: FloatArray) -> bool:
    """Whether a cubic is a line: its inner points on the chord."""
    d = control[1:] - control[0]
    across = np.abs(d[:2, 0] * d[2, 1] - d[:2, 1] * d[2, 0])
    return bool((across <= 1e-14 * (d[2] @ d[2])).all())


def _pair(point: FloatArray) -> tuple[float, float]:
    return float(point[0]), float(point[1])
