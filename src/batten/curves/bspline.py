"""Plane B-spline curves of any degree."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from batten.curves.arc_length import ArcLength
from batten.curves.base import check_order
from batten.curves.bezier import CubicBezier
from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError
from batten.typing import ArrayLike, FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


@dataclass(frozen=True, eq=False)
class BSplineCurve:
    """The B-spline curve Σ Nᵢ(u) pᵢ, with u = (1−t) a + t b for t ∈ [0, 1] and [a, b] the domain of its knots.

    Parameters:
        knots: shape (n + degree + 1,), ascending, finite. The domain is [knots[degree], knots[n]]: end knots of full
            multiplicity make the curve begin and end in its control points, others do not.
        control_points: shape (n, 2), n ≥ degree + 1, finite.
        degree: ≥ 1.

    Raises:
        InvalidInputError: shapes that do not fit, knots that descend, an empty domain, an inner knot so often repeated
            that the curve is torn there, numbers that are not finite.

    Accuracy: evaluation by de Boor's algorithm (scipy): a few units in the last place of the control points.
    Degenerate cases: where the derivative vanishes the curve is not regular; curvature is then undefined.

    Example:
        >>> parabola = BSplineCurve(knots=[0, 0, 0, 1, 1, 1], control_points=[(0, 0), (1, 2), (2, 0)], degree=2)
        >>> parabola.point([0.0, 0.5, 1.0]).tolist()
        [[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]]
        >>> len(parabola.to_beziers())
        1
    """

    knots: FloatArray
    control_points: FloatArray
    degree: int = 3

    def __post_init__(self) -> None:
        knots = np.array(self.knots, dtype=np.float64)
        points = np.array(self.control_points, dtype=np.float64)
        p = self.degree
        if not (isinstance(p, int | np.integer) and p >= 1):
            raise InvalidInputError(f"the degree is a whole number ≥ 1; got {p!r}")
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < p + 1 or knots.shape != (len(points) + p + 1,):
            raise InvalidInputError(
                f"a B-spline of degree {p} needs n ≥ {p + 1} control points of shape (n, 2) and n + {p + 1} knots; got "
                f"control points of shape {points.shape} and knots of shape {knots.shape}; some programs leave out the "
                "first and the last knot: repeat them"
            )
        if not (np.isfinite(knots).all() and np.isfinite(points).all()):
            raise InvalidInputError("knots and control points must be finite; got NaN or infinity among them")
        if (np.diff(knots) < 0.0).any():
            raise InvalidInputError(f"knots must not descend; got {knots.tolist()}")
        low, high = knots[p], knots[len(points)]
        if not low < high:
            raise InvalidInputError(f"the domain [{low}, {high}] of the knots is empty")
        inner, counts = np.unique(knots[(knots > low) & (knots < high)], return_counts=True)
        if (counts > p).any():
            raise InvalidInputError(
                f"inner knots {inner[counts > p].tolist()} are repeated more than {p} times, which tears a curve of "
                f"degree {p}; make two curves of it"
            )
        knots.setflags(write=False)
        points.setflags(write=False)
        object.__setattr__(self, "knots", knots)
        object.__setattr__(self, "control_points", points)
        object.__setattr__(self, "degree", int(p))

    @classmethod
    def interpolate(cls, points: ArrayLike, parameters: ArrayLike | None = None) -> BSplineCurve:
        """The cubic spline through points, twice continuously differentiable, with not-a-knot ends.

        Parameters:
            points: shape (n, 2), n ≥ 2, finite. Two points give a line, three a parabola.
            parameters: shape (n,), strictly ascending: where the curve passes each point. Left out: chord lengths.

        Raises:
            InvalidInputError: shapes that do not fit, parameters that do not ascend, or (without parameters)
                neighbouring points that coincide.
        """
        data = np.asarray(points, dtype=np.float64)
        if data.ndim != 2 or data.shape[1] != 2 or len(data) < 2 or not np.isfinite(data).all():
            raise InvalidInputError(
                f"points to interpolate have shape (n, 2), n ≥ 2, all finite; got shape {data.shape}"
            )
        if parameters is None:
            u = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(data, axis=0).T))])
        else:
            u = np.asarray(parameters, dtype=np.float64)
        if u.shape != (len(data),) or not np.isfinite(u).all() or not (np.diff(u) > 0.0).all():
            raise InvalidInputError(
                f"parameters must ascend strictly, one for each of the {len(data)} points; got "
                f"{u.tolist() if parameters is not None else 'chord lengths of neighbouring points that coincide'}"
            )
        from scipy.interpolate import make_interp_spline  # takes a while to load

        degree = min(3, len(data) - 1)
        spline = make_interp_spline((u - u[0]) / (u[-1] - u[0]), data, k=degree)
        return cls(spline.t, spline.c, degree)

    @cached_property
    def _spline(self) -> BSpline:
        from scipy.interpolate import BSpline

        return BSpline(self.knots, self.control_points, self.degree)

    @property
    def domain(self) -> tuple[float, float]:
        """The interval [a, b] of knot values that t ∈ [0, 1] is mapped to."""
        return float(self.knots[self.degree]), float(self.knots[len(self.control_points)])

    def point(self, t: ArrayLike) -> FloatArray:
        """Points γ(t), shape (…, 2) for t of shape (…). Outside [0, 1] the end polynomials go on."""
        return np.asarray(self._spline(self._knot_value(t)))

    def derivative(self, t: ArrayLike, order: int = 1) -> FloatArray:
        """Derivatives dⁿγ/dtⁿ for n = `order` ∈ {1, 2, 3}, shape (…, 2); at a knot, those of the piece on its right."""
        check_order(order)
        a, b = self.domain
        u = self._knot_value(t)
        if order > self.degree:
            return np.zeros((*u.shape, 2))
        return np.asarray(self._spline(u, nu=order)) * (b - a) ** order

    @cached_property
    def length(self) -> float:
        """The arc length, to 1e-12 relative."""
        return ArcLength.of(self).length if np.ptp(self.control_points, axis=0).any() else 0.0

    def breaks(self) -> FloatArray:
        """Parameters of the distinct knots in the domain: between them the curve is a polynomial."""
        a, b = self.domain
        inside = np.unique(self.knots[(self.knots > a) & (self.knots < b)])
        return np.concatenate([[0.0], (inside - a) / (b - a), [1.0]])

    def to_beziers(self) -> tuple[CubicBezier, ...]:
        """The polynomial pieces as cubic Béziers, in order: the same curve, by knot insertion; for degree ≤ 3.

        Each control point is the blossom of the piece at the ends of its interval, a convex combination of the
        spline's control points, so nothing cancels; pieces of degree 1 and 2 are raised to 3.

        Raises:
            InvalidInputError: a degree above 3, which cubics cannot hold.
        """
        p = self.degree
        if p > 3:
            raise InvalidInputError(f"a B-spline of degree {p} is not made of cubics; degrees 1 to 3 are")
        pieces = []
        for j in range(p, len(self.control_points)):
            a, b = self.knots[j], self.knots[j + 1]
            if b > a:
                corners = np.stack([self._blossom(j, [a] * (p - i) + [b] * i) for i in range(p + 1)])
                pieces.append(CubicBezier(_raise_degree(corners)))
        return tuple(pieces)

    def reversed(self) -> BSplineCurve:
        """The same points run through from the end to the start."""
        return BSplineCurve(self.knots[0] + self.knots[-1] - self.knots[::-1], self.control_points[::-1], self.degree)

    def transformed(self, similarity: Similarity) -> BSplineCurve:
        """The image under a similarity."""
        return BSplineCurve(self.knots, similarity.apply(self.control_points), self.degree)

    def _knot_value(self, t: ArrayLike) -> FloatArray:
        t = np.asarray(t, dtype=np.float64)
        a, b = self.domain
        return a * (1.0 - t) + b * t

    def _blossom(self, span: int, arguments: list[float]) -> FloatArray:
        """De Boor's algorithm on the knot span with one argument for each of its steps."""
        p, u = self.degree, self.knots
        d = list(self.control_points[span - p : span + 1])
        for r, x in enumerate(arguments, start=1):
            for i in range(p, r - 1, -1):
                low, high = u[span - p + i], u[span + 1 + i - r]
                alpha = (x - low) / (high - low)
                d[i] = (1.0 - alpha) * d[i - 1] + alpha * d[i]
        return np.asarray(d[p])


def _raise_degree(points: FloatArray) -> FloatArray:
    """Control points of a Bézier curve of degree 1, 2 or 3 as those of the same curve of degree 3."""
    while len(points) < 4:
        n = len(points)
        i = np.arange(1, n)[:, None] / n
        points = np.concatenate([points[:1], i * points[:-1] + (1.0 - i) * points[1:], points[-1:]])
    return points
