"""Any plane curve by pieces of elastica within a tolerance."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from batten.curves.base import Curve
from batten.curves.bspline import BSplineCurve
from batten.curves.elastica import Elastica
from batten.curves.piecewise import PiecewiseCurve
from batten.curves.polyline import Polyline
from batten.errors import InvalidInputError
from batten.solvers.smoothing_spline import smoothing_spline
from batten.splines.curve_spans import CurveSpan, spans_of
from batten.splines.piece_chain import PieceChain
from batten.splines.piece_distance import piece_distances
from batten.splines.piece_split import PieceFitter, SplitPieces, bisected, longest_first, pieces_of
from batten.typing import ArrayLike, BoolArray, FloatArray

Continuity = Literal["C0", "C1", "C2"]
Split = Literal["bisect", "fewest"]

#: What a corner is, radians: of a polyline, and of any other curve.
POLYLINE_CORNER, CURVE_CORNER = np.radians(20.0), np.radians(2.0)
_LEAST = 1e-7  # tolerance over length
#: Distances are measured to this share of the tolerance, polylines' strays included, and kept this far below it.
_MARGIN = 0.02
#: Tolerances, in units of the one asked for, at which a first cutting is tried; freed joints gain what they exceed it by.
_FACTORS = {0: (1.2,), 1: (2.0, 1.4), 2: (2.0, 1.2, 0.7, 0.4, 0.2, 0.1, 0.05, 0.02, 0.01)}
#: More pieces than this in one span are not moved together.
_MOST_FREED = 160
_HALVINGS = 12


@dataclass(frozen=True, eq=False)
class Approximation:
    """Result of `approximate`, n pieces in order.

    Attributes:
        pieces: the elastica.
        joints: (n + 1,), arc lengths on the curve of the points that the pieces' ends stand for.
        corners: (n + 1,), whether the curve has a corner there; both ends of an open curve count as corners.
        distances: (n,), greatest distance, both ways, between a piece and its part of the curve.
        tolerance: what was asked for.
        bisect_pieces: how many pieces bisection takes at the same tolerance and continuity.
        status: "converged", "tolerance missed", or "continuity missed" (common curvatures could not be reached).
    """

    pieces: tuple[Elastica, ...]
    joints: FloatArray
    corners: BoolArray
    distances: FloatArray
    tolerance: float
    bisect_pieces: int
    status: str

    @property
    def distance(self) -> float:
        """The greatest of the distances; the Hausdorff distance of the whole curves is not above it."""
        return float(self.distances.max())

    @cached_property
    def curve(self) -> PiecewiseCurve:
        """The pieces as one curve."""
        return PiecewiseCurve(self.pieces)


def approximate(
    curve: Curve | ArrayLike,
    tolerance: float,
    *,
    continuity: Continuity = "C1",
    split: Split = "fewest",
    corner_angle: float | None = None,
    smoothing: float | None = None,
) -> Approximation:
    """A curve by pieces of elastica whose greatest distance from it is at most the tolerance (Brander2016 §5, Fig. 10).

    The curve is cut at its corners, which stay corners. Between them "bisect" halves parts, by arc length, until the
    elastica of least L² distance that holds their end points (and with "C1" their end tangents) is near enough: the papers'
    way. "fewest" makes each piece as long as the tolerance lets it be, then frees all joints together and makes the greatest
    distance least; it first tries fewer pieces than the held joints need. "C2" needs free joints in both ways: the pieces
    are brought to common curvatures, with more of them where the tolerance is missed.

    Parameters:
        curve: a `Curve`; or measured points, shape (m, 2), m ≥ 5, which stand for the smoothing spline through them.
        tolerance: greatest distance, in the unit of the coordinates, at least 1e-7 × length.
        continuity: "C0" common joints, "C1" tangents too, "C2" curvatures too. Where a closed curve has no corner, its
            start is a joint like the others.
        split: "bisect" or "fewest".
        corner_angle: a turn above it is a corner, radians; left out: 20° for a `Polyline`, else 2°.
        smoothing: for measured points: see `curve_samples.from_points`.

    Returns:
        An `Approximation`. Its status is "converged" if all was met; nothing is claimed that was not measured.

    Raises:
        InvalidInputError: no curve, one without length, a tolerance out of range, another word for an option.

    Accuracy: distances are measured to 2 % of the tolerance, which counts against the pieces; joints meet, in position,
    tangent and curvature, within 1e-11 in units of the pieces' mean length (common ends at corners and held joints within
    2e-12 of a piece's length).
    Degenerate cases: straight parts are lines; bends much tighter than the tolerance (cusps, loops below a 25th of it) count
    as corners.

    Example:
        >>> from batten.curves.bezier import CubicBezier
        >>> found = approximate(CubicBezier([(0, 0), (1, 3), (3, -2), (4, 1)]), 1e-3)
        >>> found.status, found.distance <= 1e-3, len(found.pieces) <= found.bisect_pieces
        ('converged', True, True)
    """
    if continuity not in ("C0", "C1", "C2"):
        raise InvalidInputError(f"continuity is 'C0', 'C1' or 'C2'; got {continuity!r}")
    if split not in ("bisect", "fewest"):
        raise InvalidInputError(f"split is 'bisect' or 'fewest'; got {split!r}")
    target = curve if isinstance(curve, Curve) else smooth_curve(curve, smoothing)
    length = target.length
    if not 0.0 < length < np.inf:
        raise InvalidInputError(f"the curve has length {length}; give one of positive, finite length")
    if not _LEAST * length <= tolerance < np.inf:
        raise InvalidInputError(
            f"tolerance = {tolerance}; allowed are finite numbers from {_LEAST:g} × length = {_LEAST * length:.3g}"
        )
    if corner_angle is None:
        corner_angle = POLYLINE_CORNER if isinstance(target, Polyline) else CURVE_CORNER
    if not 0.0 < corner_angle <= np.pi:
        raise InvalidInputError(f"corner_angle = {corner_angle}; allowed are radians in (0, π]")
    spans = spans_of(target, 0.25 * _MARGIN * tolerance, corner_angle, 0.5 * tolerance)
    order = int(continuity[1])
    parts = [_SpanWork(span, order, tolerance).pieces(split) for span in spans]
    found = [part for part, _, _ in parts]
    joints = [span.first + part.joints for span, part in zip(spans, found)]
    distances = np.concatenate([part.distances for part in found])
    corners = np.zeros(len(distances) + 1, bool)
    corners[np.cumsum([0, *map(len, found)])] = not spans[0].closed
    status = "converged"
    if not (distances <= tolerance).all():
        status = "tolerance missed"
    if not all(met for _, _, met in parts):
        status = "continuity missed"
    return Approximation(
        pieces=tuple(piece for part in found for piece in pieces_of(part.parameters)),
        joints=np.concatenate([joints[0], *(row[1:] for row in joints[1:])]),
        corners=corners,
        distances=distances,
        tolerance=float(tolerance),
        bisect_pieces=sum(count for _, count, _ in parts),
        status=status,
    )


def smooth_curve(points: ArrayLike, smoothing: float | None = None) -> BSplineCurve:
    """Measured points, (m, 2), m ≥ 5, as the quintic spline that `curve_samples.from_points` takes them for.

    Raises:
        InvalidInputError: another shape, numbers that are not finite, neighbours that coincide.

    Example:
        >>> smooth_curve([(0, 0), (1, 1), (2, 4), (3, 9), (4, 16)]).point(1.0).round(6).tolist()
        [4.0, 16.0]
    """
    data = np.asarray(points, dtype=np.float64)
    if data.ndim != 2 or data.shape[1] != 2 or len(data) < 5 or not np.isfinite(data).all():
        raise InvalidInputError(
            f"expected a curve, or measured points of shape (m, 2), m ≥ 5, finite; got {data.shape}"
        )
    step = np.hypot(*np.diff(data, axis=0).T)
    if not (step > 0.0).all():
        raise InvalidInputError(
            f"measured points {np.flatnonzero(step == 0.0)[:5].tolist()} coincide with the next: drop one"
        )
    chord = np.concatenate([[0.0], np.cumsum(step)])
    middle = data.mean(axis=0)
    spline = smoothing_spline(chord / chord[-1], data - middle, smoothing)
    return BSplineCurve(spline.t, spline.c + middle, spline.k)


class _SpanWork:
    """Pieces for one span."""

    def __init__(self, span: CurveSpan, order: int, tolerance: float) -> None:
        self.span, self.order = span, order
        self.limit = (1.0 - _MARGIN) * tolerance
        self.within = 0.25 * _MARGIN * tolerance
        self.chain = PieceChain(span, order)

    def pieces(self, split: Split) -> tuple[SplitPieces, int, bool]:
        """The pieces, how many bisection takes, and whether the continuity is met."""
        if self.span.straight:
            return bisected(self._fitter(1.0)), 1, True
        halves, met = self._bisected()
        if split == "bisect":
            return self._counted(halves), len(halves), met
        found = self._fewest(halves, met)
        met |= found is not halves
        return self._counted(found), len(halves), met

    def _fitter(self, factor: float) -> PieceFitter:
        return PieceFitter(self.span, "points" if self.order == 0 else "tangents", factor * self.limit, self.within)

    def _counted(self, pieces: SplitPieces) -> SplitPieces:
        """The pieces, distances with their error on top."""
        return replace(pieces, distances=pieces.distances + _MARGIN * self.limit / (1.0 - _MARGIN))

    def _bisected(self) -> tuple[SplitPieces, bool]:
        fitter = self._fitter(1.0)
        halves = bisected(fitter)
        if self.order < 2:
            return halves, True
        joints = halves.joints
        for _ in range(_HALVINGS):
            parameters, distances = fitter.fit(joints[:-1], joints[1:])
            held = SplitPieces(joints, parameters, distances)
            free = self._freed(held, self.limit)
            if free is not None and free.distances.max() <= self.limit:
                return free, True
            poor = distances > 0.05 * self.limit if free is None else free.distances > self.limit
            if not poor.any():
                poor = np.ones(len(distances), bool)
            joints = np.sort(np.concatenate([joints, 0.5 * (joints[:-1] + joints[1:])[poor]]))
            if len(joints) > 2 * _MOST_FREED:
                break
        return (free, True) if free is not None else (halves, False)

    def _fewest(self, halves: SplitPieces, met: bool) -> SplitPieces:
        best: SplitPieces | None = None
        tried = 0
        good = halves.distances.max() <= self.limit and met
        for factor in _FACTORS[self.order]:
            most = len(halves) - 1 if good else 4 * _MOST_FREED
            held = longest_first(self._fitter(factor), min(most, _MOST_FREED))
            if held is None or (len(held) == tried and factor > 1.0):
                continue
            tried = len(held)
            free = self._freed(held, 0.97 * self.limit)
            if free is not None and free.distances.max() <= self.limit:
                best = free
                break
        if best is None and self.order < 2:
            best = longest_first(self._fitter(1.0), len(halves))
        if best is None or (len(best) >= len(halves) and good):
            best = halves if best is None or len(best) > len(halves) else best
        if best.distances.max() <= 1e-3 * self.limit or (best is halves and not met):
            return best
        free = self._freed(best, 0.0)
        return free if free is not None and free.distances.max() < best.distances.max() else best

    def _freed(self, pieces: SplitPieces, good: float) -> SplitPieces | None:
        """The pieces with joints moved together, measured; None if they cannot be joined or are too many."""
        if not np.isfinite(pieces.distances).all() or len(pieces) > 2 * _MOST_FREED:
            return None
        found = self.chain.improved(pieces.parameters, pieces.joints, good)
        if found is None:
            return None
        parameters, joints = found
        return SplitPieces(
            joints, parameters, piece_distances(self.span, joints[:-1], joints[1:], parameters, self.within)
        )
