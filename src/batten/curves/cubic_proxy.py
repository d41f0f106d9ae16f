"""Cubic splines on uniform knots, as designers draw them: what stands for an elastic spline while it is designed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from batten.curves.bezier import CubicBezier
from batten.curves.piecewise import PiecewiseCurve
from batten.curves.similarity import Similarity
from batten.curves.spline_refit import nearest_spline, split_places
from batten.errors import InvalidInputError
from batten.typing import ArrayLike, FloatArray, IntArray

#: How far a joint given may lie from its border, as a part of the spline's size.
BORDER_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Border:
    """The straight line {p : normal · (p − point) = 0} on which a joint has to stay: Fisker2018 §5.2.1.

    Parameters:
        point: two finite numbers. normal: two finite numbers, not both 0; scaled to length 1.

    Raises:
        InvalidInputError: other shapes, numbers that are not finite, a normal of length 0.

    Example:
        >>> Border.vertical(2.0).distance((5.0, 7.0))
        3.0
    """

    point: tuple[float, float]
    normal: tuple[float, float]

    def __post_init__(self) -> None:
        point, normal = np.asarray(self.point, dtype=np.float64), np.asarray(self.normal, dtype=np.float64)
        if point.shape != (2,) or normal.shape != (2,) or not np.isfinite([*point, *normal]).all() or not normal.any():
            raise InvalidInputError(
                f"a border needs a point and a normal of two finite numbers, the normal not 0; got point {self.point} "
                f"and normal {self.normal}"
            )
        normal = normal / np.abs(normal).max()
        normal = normal / np.hypot(*normal)
        object.__setattr__(self, "point", (float(point[0]), float(point[1])))
        object.__setattr__(self, "normal", (float(normal[0]), float(normal[1])))

    @classmethod
    def vertical(cls, x: float) -> Border:
        """The line at the abscissa x."""
        return cls((x, 0.0), (1.0, 0.0))

    def distance(self, point: ArrayLike) -> float:
        """The signed distance of a point, shape (2,), positive on the side of the normal."""
        x, y = np.asarray(point, dtype=np.float64).tolist()
        return (x - self.point[0]) * self.normal[0] + (y - self.point[1]) * self.normal[1]

    def transformed(self, similarity: Similarity) -> Border:
        """The image under a similarity."""
        x, y = similarity.apply(self.point).tolist()
        u, v = similarity.apply_to_vectors(self.normal).tolist()
        return Border((x, y), (u, v))


class Freedom(NamedTuple):
    """How the control points follow a displacement d ∈ R² of the active one.

    Attributes:
        directions: (r, 2), r ∈ {0, 1, 2}, orthonormal: where the active point can go.
        response: (m, 2, 2): control point j moves by response[j] · d. Displacements across `directions` have no effect.
    """

    directions: FloatArray
    response: FloatArray


@cache
def bezier_map(pieces: int, continuity: int) -> FloatArray:
    """The matrix (n, 4, m) that takes the control points of a spline of n pieces to the Bézier points of its pieces.

    continuity 1: m = 2(n + 1) points, all Bézier points without the inner joints, which are the midpoints of their
    neighbours. continuity 2: m = n + 3 points of the B-spline with knots 0, 0, 0, 0, 1, 2 … n, n, n, n.
    """
    n, m = pieces, 2 * (pieces + 1) if continuity == 1 else pieces + 3
    out, unit = np.zeros((n, 4, m)), np.eye(m)
    if continuity == 1:
        joints = np.concatenate([unit[:1], 0.5 * (unit[2:-2:2] + unit[3:-1:2]), unit[-1:]])
        out[:, 0], out[:, 1], out[:, 2], out[:, 3] = joints[:-1], unit[1:-1:2], unit[2::2], joints[1:]
    else:
        knots = np.clip(np.arange(-3, n + 4), 0, n).astype(np.float64)
        for i in range(n):
            for k in range(4):
                out[i, k] = _blossom(unit[i : i + 4], knots[i + 1 : i + 7], [float(i)] * (3 - k) + [i + 1.0] * k)
    out.setflags(write=False)
    return out


def _blossom(points: FloatArray, knots: FloatArray, arguments: Sequence[float]) -> FloatArray:
    """The blossom of a cubic B-spline piece, from its 4 control points and the 6 knots about it."""
    rows = points
    for level, u in enumerate(arguments):
        low, high = knots[level:3], knots[3 : 6 - level]
        part = ((u - low) / (high - low))[:, None]
        rows = (1.0 - part) * rows[:-1] + part * rows[1:]
    return np.asarray(rows[0])


@dataclass(frozen=True, eq=False)
class CubicProxy:
    """A plane cubic spline on uniform knots, the proxy of an elastic spline: Fisker2018 §5.2 and §5.2.1.

    With n pieces and continuity 1 there are 2(n + 1) control points: all Bézier points but the inner joints, which are the
    midpoints of their neighbours. With continuity 2 there are n + 3, those of the B-spline whose end knots have full
    multiplicity. Either way the first and the last control point are the ends of the curve, and the second and the last
    but one lie on its end tangents. It is a `Curve`; piece i takes t ∈ [i/n, (i + 1)/n).

    With `borders` every joint that has one stays on it. Continuity 1: the control point across the joint moves
    orthogonally to the border, just as far as needed (§5.2.1); an end with a border moves along it. Continuity 2: a
    control point moves up to three joints, and what it does to them across their borders no other point could undo
    without moving further joints. So the active point moves along the border only, and not at all if it moves joints on
    borders that are not parallel; points that move no joint with a border are free.

    Parameters:
        control_points: shape (m, 2), finite; copied and made read-only.
        continuity: 1 or 2.
        borders: None, or one `Border` or None for each of the n + 1 joints, ends included.

    Raises:
        InvalidInputError: another shape or continuity, numbers that are not finite, a joint that is farther from its border
            than `BORDER_TOLERANCE` × the size of the spline.

    Accuracy: a joint stays on its border to rounding of the coordinates, however often points are moved.
    Degenerate cases: control points may coincide; where a handle has length zero the curve has no tangent there.

    Example:
        >>> proxy = CubicProxy.line((0, 0), (6, 0), pieces=2)
        >>> proxy.control_points.tolist()
        [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [4.0, 0.0], [5.0, 0.0], [6.0, 0.0]]
        >>> bordered = CubicProxy(proxy.control_points, borders=[None, Border.vertical(3), None])
        >>> bordered.with_control_point(2, (1.5, 1)).control_points[2:4].tolist()
        [[1.5, 1.0], [4.5, 0.0]]
        >>> CubicProxy.line((0, 0), (6, 0), pieces=3, continuity=2).affected_pieces(2).tolist()
        [0, 1, 2]
    """

    control_points: FloatArray
    continuity: int = 1
    borders: tuple[Border | None, ...] | None = None

    def __post_init__(self) -> None:
        points = np.array(self.control_points, dtype=np.float64)
        if self.continuity not in (1, 2):
            raise InvalidInputError(f"a cubic spline has continuity 1 or 2 here; got {self.continuity!r}")
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 4 or (self.continuity == 1 and len(points) % 2):
            allowed = "2(n + 1)" if self.continuity == 1 else "n + 3"
            raise InvalidInputError(
                f"a spline of n ≥ 1 pieces and continuity {self.continuity} has {allowed} control points, shape (m, 2); "
                f"got shape {points.shape}; see CubicProxy.line and CubicProxy.from_beziers"
            )
        if not np.isfinite(points).all():
            raise InvalidInputError(f"control points must be finite; got {points.tolist()}")
        points.setflags(write=False)
        object.__setattr__(self, "control_points", points)
        if self.borders is not None:
            object.__setattr__(self, "borders", tuple(self.borders))
            self._check_borders()

    def _check_borders(self) -> None:
        borders = self.borders or ()
        if len(borders) != self.piece_count + 1 or not all(b is None or isinstance(b, Border) for b in borders):
            raise InvalidInputError(
                f"a spline of {self.piece_count} pieces has {self.piece_count + 1} joints, ends included, and takes a "
                f"Border or None for each; got {len(borders)} entries"
            )
        size = float(np.hypot(*np.ptp(self.control_points, axis=0)))
        for i, (border, joint) in enumerate(zip(borders, self.joints)):
            if border is not None and abs(border.distance(joint)) > BORDER_TOLERANCE * size:
                raise InvalidInputError(
                    f"joint {i} at {joint.tolist()} is {abs(border.distance(joint)):.3g} from its border; "
                    "use with_borders, which moves the joints there"
                )

    @classmethod
    def line(cls, start: ArrayLike, end: ArrayLike, pieces: int = 1, continuity: int = 1) -> CubicProxy:
        """A straight line, run through at constant speed.

        Raises:
            InvalidInputError: ends of another shape than (2,), less than one piece, a continuity other than 1 and 2.
        """
        a, b = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
        if a.shape != (2,) or b.shape != (2,) or not (isinstance(pieces, int | np.integer) and pieces >= 1):
            raise InvalidInputError(
                f"a line needs two points and a number of pieces ≥ 1; got {a.tolist()}, {b.tolist()} and {pieces!r}"
            )
        if continuity == 2:  # the means of three knots
            knots = np.clip(np.arange(-3, pieces + 4), 0, pieces)
            part = (knots[1:-3] + knots[2:-2] + knots[3:-1]) / 3.0
        else:
            part = np.delete(np.arange(3 * pieces + 1) / 3.0, np.arange(3, 3 * pieces, 3))
        part = (part / pieces)[:, None]
        return cls((1.0 - part) * a + part * b, continuity)

    @classmethod
    def from_beziers(cls, pieces: Sequence[CubicBezier] | ArrayLike, continuity: int = 1) -> CubicProxy:
        """The spline nearest to a row of cubic Béziers: least ∫|difference|² dt, with the ends of the first and the last.

        Parameters:
            pieces: n ≥ 1 `CubicBezier`s, or control points (n, 4, 2). A row that is such a spline already comes back, to
                rounding; gaps and corners are smoothed away.
            continuity: 1 or 2.

        Raises:
            InvalidInputError: another shape, numbers that are not finite, a continuity other than 1 and 2.
        """
        curves = [p for p in pieces if isinstance(p, CubicBezier)] if isinstance(pieces, list | tuple) else []
        control = np.array([p.control_points for p in curves]) if curves else np.asarray(pieces, dtype=np.float64)
        if control.ndim != 3 or control.shape[1:] != (4, 2) or len(control) < 1 or continuity not in (1, 2):
            raise InvalidInputError(
                f"expected n ≥ 1 cubic Béziers, shape (n, 4, 2), and continuity 1 or 2; got shape {control.shape} and "
                f"continuity {continuity!r}"
            )
        if not np.isfinite(control).all():
            raise InvalidInputError("control points must be finite; got NaN or infinity among them")
        places = np.arange(len(control) + 1.0)
        return cls(nearest_spline(control, places, bezier_map(len(control), continuity), slide=False), continuity)

    @property
    def piece_count(self) -> int:
        """The number n of polynomial pieces."""
        return len(self.control_points) // 2 - 1 if self.continuity == 1 else len(self.control_points) - 3

    @property
    def bezier_matrix(self) -> FloatArray:
        """The constant matrix (n, 4, m) from control points to Bézier points: see `bezier_map`."""
        return bezier_map(self.piece_count, self.continuity)

    @cached_property
    def pieces(self) -> FloatArray:
        """The Bézier points of the pieces, shape (n, 4, 2), read-only."""
        out = self.bezier_matrix @ self.control_points
        out.setflags(write=False)
        return out

    @property
    def joints(self) -> FloatArray:
        """Where the pieces meet, ends included, shape (n + 1, 2)."""
        return np.concatenate([self.pieces[:, 0], self.pieces[-1:, 3]])

    def beziers(self) -> tuple[CubicBezier, ...]:
        """The pieces as curves, in order."""
        return self._curve.pieces  # type: ignore[return-value]

    def affected_pieces(self, index: int) -> IntArray:
        """The numbers of the pieces that moving control point `index` changes, ascending: up to 2, or 4 for continuity 2.

        Raises:
            InvalidInputError: no such control point.
        """
        return np.flatnonzero(self.bezier_matrix[:, :, self._index(index)].any(axis=1)).astype(np.int64)

    def freedom(self, index: int) -> Freedom:
        """Where control point `index` can go, and how the others follow (Fisker2018 §5.2.1).

        Raises:
            InvalidInputError: no such control point.
        """
        i, m = self._index(index), len(self.control_points)
        directions, response = np.eye(2), np.zeros((m, 2, 2))
        if self.borders is not None:
            reach = np.concatenate([self.bezier_matrix[:, 0, i], self.bezier_matrix[-1:, 3, i]])
            moved = [k for k in np.flatnonzero(reach).tolist() if self.borders[k] is not None]
            normals = np.array([self.borders[k].normal for k in moved]).reshape(-1, 2)  # type: ignore[union-attr]
            if moved and self.continuity == 1 and 0 < i < m - 1:
                across = i + 1 if i % 2 == 0 else i - 1
                response[across] = -np.outer(normals[0], normals[0])
            elif moved:
                turned = normals[0, 0] * normals[:, 1] - normals[0, 1] * normals[:, 0]
                along = np.array([[-normals[0, 1], normals[0, 0]]])
                directions = along if (np.abs(turned) < 1e-12).all() else np.zeros((0, 2))
        response[i] = directions.T @ directions
        return Freedom(directions, response)

    def with_control_point(self, index: int, point: ArrayLike) -> CubicProxy:
        """The spline with control point `index` at `point`, or as near to it as the borders allow: see `freedom`.

        Raises:
            InvalidInputError: no such control point, or a point that is not two finite numbers.
        """
        target = np.asarray(point, dtype=np.float64)
        if target.shape != (2,) or not np.isfinite(target).all():
            raise InvalidInputError(f"a control point is two finite numbers; got {target.tolist()}")
        i = self._index(index)
        freedom = self.freedom(i)
        moved = self.control_points + freedom.response @ (target - self.control_points[i])
        if len(freedom.directions) == 2:
            moved[i] = target
        return CubicProxy(self._on_borders(moved, i), self.continuity, self.borders)

    def _on_borders(self, points: FloatArray, active: int) -> FloatArray:
        """The rounding of this move taken away, so that joints do not drift from their borders (continuity 1)."""
        if self.borders is None or self.continuity == 2:
            return points
        last = len(points) - 1
        joint = 0 if active == 0 else (active // 2 if active < last else self.piece_count)
        border = self.borders[joint]
        if border is not None and active in (0, last):
            points[active] -= border.distance(points[active]) * np.array(border.normal)
        elif border is not None and 0 < joint < self.piece_count:
            across = active + 1 if active % 2 == 0 else active - 1
            middle = 0.5 * (points[active] + points[across])
            points[across] -= 2.0 * border.distance(middle) * np.array(border.normal)
        return points

    def with_borders(self, borders: Sequence[Border | None] | None) -> CubicProxy:
        """The nearest spline whose joints lie on the borders given (as for the constructor); None takes all borders off.

        An end moves to its border along the normal; what lies between is the nearest in ∫|difference|² dt.

        Raises:
            InvalidInputError: not one entry for each joint; borders that cannot all be met.
        """
        if borders is None:
            return CubicProxy(self.control_points, self.continuity)
        if len(borders) != self.piece_count + 1:
            raise InvalidInputError(f"this spline has {self.piece_count + 1} joints; got {len(borders)} borders")
        places = np.arange(self.piece_count + 1.0)
        points = nearest_spline(self.pieces, places, self.bezier_matrix, slide=False, lines=_lines(borders))
        return CubicProxy(points, self.continuity, tuple(borders))

    def with_piece(self, piece: int, *, fraction: float = 0.5, border: Border | None = None) -> CubicProxy:
        """The spline with one piece more: `piece` is divided at `fraction`, or where it meets `border`.

        On uniform knots a divided piece is in general not a spline of this kind. The result is the nearest one: it starts
        from the same curve with the new joint, run through with a speed that has no jump, and takes the least squares of
        the differences, where points may slide along the curve. A straight line stays one. Continuity 1: pieces that are
        not next to the divided one stay as they are. Continuity 2: what is far changes little.

        Raises:
            InvalidInputError: no such piece, a fraction outside (0, 1), a border that the piece does not cross.
        """
        n = self.piece_count
        if not (isinstance(piece, int | np.integer) and 0 <= piece < n):
            raise InvalidInputError(f"this spline has the pieces 0 … {n - 1}; got {piece!r}")
        if border is not None:
            fraction = _crossing(self.pieces[piece], border)
        if not 0.0 < fraction < 1.0:
            raise InvalidInputError(f"a piece is divided at a fraction in (0, 1); got {fraction}")
        places = np.insert(np.arange(n + 1.0), piece + 1, piece + fraction)
        borders = None if self.borders is None and border is None else list(self.borders or [None] * (n + 1))
        if borders is not None:
            borders.insert(piece + 1, border)
        return self._refitted(places, borders, piece - 1, piece + 3)

    def without_joint(self, joint: int) -> CubicProxy:
        """The spline with one piece less: the pieces on both sides of an inner joint become one, as near as may be.

        See `with_piece` for what is nearest and what stays. The joint's border goes with it.

        Raises:
            InvalidInputError: not an inner joint, 1 … n − 1.
        """
        n = self.piece_count
        if not (isinstance(joint, int | np.integer) and 1 <= joint < n):
            raise InvalidInputError(f"inner joints are those from 1 to {n - 1} (of {n} pieces); got {joint!r}")
        borders = None if self.borders is None else [b for k, b in enumerate(self.borders) if k != joint]
        return self._refitted(np.delete(np.arange(n + 1.0), joint), borders, joint - 2, joint + 1)

    def _refitted(self, places: FloatArray, borders: list[Border | None] | None, low: int, high: int) -> CubicProxy:
        """The nearest spline with joints at the parameters `places`; for continuity 1 only pieces low … high − 1 change."""
        matrix = bezier_map(len(places) - 1, self.continuity)
        held = None
        if self.continuity == 1:
            outside = [i for i in range(len(places) - 1) if not low <= i < high]
            held = np.flatnonzero(matrix[outside].any(axis=(0, 1))) if outside else None
        lines = None if borders is None else _lines(borders)
        points = nearest_spline(self.pieces, places, matrix, slide=True, held=held, lines=lines)
        return CubicProxy(points, self.continuity, None if borders is None else tuple(borders))

    def reversed(self) -> CubicProxy:
        """The same points run through from the end to the start."""
        return CubicProxy(self.control_points[::-1], self.continuity, self.borders and self.borders[::-1])

    def transformed(self, similarity: Similarity) -> CubicProxy:
        """The image under a similarity, borders included."""
        borders = None if self.borders is None else tuple(b and b.transformed(similarity) for b in self.borders)
        return CubicProxy(similarity.apply(self.control_points), self.continuity, borders)

    @cached_property
    def _curve(self) -> PiecewiseCurve:
        return PiecewiseCurve([CubicBezier(piece) for piece in self.pieces])

    def point(self, t: ArrayLike) -> FloatArray:
        """Points γ(t), shape (…, 2) for t of shape (…)."""
        return self._curve.point(t)

    def derivative(self, t: ArrayLike, order: int = 1) -> FloatArray:
        """Derivatives dⁿγ/dtⁿ for n = `order` ∈ {1, 2, 3}, shape (…, 2); at a joint, those of the later piece."""
        return self._curve.derivative(t, order)

    @property
    def length(self) -> float:
        """The arc length, to 1e-13 relative."""
        return self._curve.length

    def breaks(self) -> FloatArray:
        """The parameters 0, 1/n … 1 of the joints."""
        return self._curve.breaks()

    def _index(self, index: int) -> int:
        m = len(self.control_points)
        if not (isinstance(index, int | np.integer) and 0 <= index < m):
            raise InvalidInputError(f"this spline has the control points 0 … {m - 1}; got {index!r}")
        return int(index)


def _lines(borders: Sequence[Border | None]) -> list[tuple[int, float, float, float]]:
    """(joint, nx, ny, c) with nx·x + ny·y = c, for the joints that have a border."""
    return [
        (k, *b.normal, b.normal[0] * b.point[0] + b.normal[1] * b.point[1])
        for k, b in enumerate(borders)
        if b is not None
    ]


def _crossing(piece: FloatArray, border: Border) -> float:
    """Where in (0, 1) a cubic meets a line; the place nearest to the middle if there are several."""
    found = split_places(np.array([border.distance(p) for p in piece]))
    if not found:
        raise InvalidInputError(f"the piece does not cross the border through {border.point}; choose another piece")
    return min(found, key=lambda t: math.fabs(t - 0.5))
