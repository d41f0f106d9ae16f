"""Curves made of other curves, one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from batten.curves.base import Curve, check_order
from batten.errors import InvalidInputError
from batten.typing import ArrayLike, FloatArray


@dataclass(frozen=True, eq=False)
class Joints:
    """How well neighbouring pieces meet: one row for each joint, in order.

    Attributes:
        position_jumps: shape (n − 1,), distance from the end of a piece to the start of the next.
        tangent_jumps: shape (n − 1,), the turn from the tangent at the end of a piece to that at the start of the next,
            radians in (−π, π], counter-clockwise positive.
        curvature_jumps: shape (n − 1,), curvature at the start of the next piece minus that at the end of the piece; NaN
            where one of them has zero speed.
    """

    position_jumps: FloatArray
    tangent_jumps: FloatArray
    curvature_jumps: FloatArray


@dataclass(frozen=True, eq=False)
class PiecewiseCurve:
    """Curves put one after the other; the i-th of n pieces takes t ∈ [i/n, (i + 1)/n).

    The pieces need not meet: `joints()` reports what is between them, and nothing is drawn across a gap.

    Parameters:
        pieces: at least one curve; kept as a tuple.

    Raises:
        InvalidInputError: no pieces, or something that is not a `Curve`.

    Example:
        >>> from batten.curves.polyline import Polyline
        >>> path = PiecewiseCurve([Polyline([(0, 0), (1, 0)]), Polyline([(1, 0), (1, 2)])])
        >>> path.length, path.point([0.25, 0.75]).tolist(), path.joints().tangent_jumps.round(4).tolist()
        (3.0, [[0.5, 0.0], [1.0, 1.0]], [1.5708])
    """

    pieces: tuple[Curve, ...]

    def __init__(self, pieces: Sequence[Curve]) -> None:
        kept = tuple(pieces)
        if not kept:
            raise InvalidInputError("a piecewise curve needs at least one piece; got none")
        for i, piece in enumerate(kept):
            if not isinstance(piece, Curve):
                raise InvalidInputError(f"piece {i} is not a curve but a {type(piece).__name__}")
        object.__setattr__(self, "pieces", kept)

    def point(self, t: ArrayLike) -> FloatArray:
        """Points γ(t), shape (…, 2) for t of shape (…); at a joint, that of the later piece."""
        return self._evaluate(t, 0)

    def derivative(self, t: ArrayLike, order: int = 1) -> FloatArray:
        """Derivatives dⁿγ/dtⁿ for n = `order` ∈ {1, 2, 3}, shape (…, 2); at a joint, those of the later piece."""
        check_order(order)
        return self._evaluate(t, order)

    @cached_property
    def length(self) -> float:
        """The sum of the lengths of the pieces; gaps do not count."""
        return float(sum(piece.length for piece in self.pieces))

    def breaks(self) -> FloatArray:
        """The joints and the breaks of every piece."""
        n = len(self.pieces)
        inner = [(i + np.asarray(piece.breaks())[:-1]) / n for i, piece in enumerate(self.pieces)]
        return np.concatenate([*inner, [1.0]])

    def joints(self) -> Joints:
        """The jumps of position, tangent and curvature from each piece to the next.

        Where the speed at an end is zero the tangent is the limit along the piece.
        """
        before, after = self.pieces[:-1], self.pieces[1:]
        gap = [np.hypot(*(b.point(0.0) - a.point(1.0))) for a, b in zip(before, after)]
        turn = [np.angle(_tangent(b, 0.0) * np.conj(_tangent(a, 1.0))) for a, b in zip(before, after)]
        bend = [_curvature(b, 0.0) - _curvature(a, 1.0) for a, b in zip(before, after)]
        turn = [np.pi if v <= -np.pi else v for v in turn]
        return Joints(*(np.array(v, dtype=np.float64) for v in (gap, turn, bend)))

    def _evaluate(self, t: ArrayLike, order: int) -> FloatArray:
        t = np.asarray(t, dtype=np.float64)
        n = len(self.pieces)
        flat = t.reshape(-1)
        index = np.clip(np.floor(flat * n), 0, n - 1)
        out = np.full((flat.size, 2), np.nan)
        for i in np.unique(index[np.isfinite(index)]).astype(int):
            here = index == i
            local = flat[here] * n - i
            piece = self.pieces[i]
            out[here] = piece.point(local) if order == 0 else piece.derivative(local, order) * float(n) ** order
        return out.reshape(*t.shape, 2)


def _tangent(curve: Curve, t: float) -> complex:
    """The direction of travel at an end, as a complex number of some size: the first derivative that is not 0.

    Just before t = 1 the k-th derivative d contributes d·(−h)^(k−1) to γ', hence the sign.
    """
    for order in (1, 2, 3):
        x, y = curve.derivative(t, order).tolist()
        if x != 0.0 or y != 0.0:
            return complex(x, y) * ((-1.0) ** (order - 1) if t > 0.0 else 1.0)
    return complex(np.nan, np.nan)


def _curvature(curve: Curve, t: float) -> float:
    (x1, y1), (x2, y2) = curve.derivative(t).tolist(), curve.derivative(t, 2).tolist()
    speed = float(np.hypot(x1, y1))
    return (x1 * y2 - y1 * x2) / speed**3 if speed > 0.0 else float("nan")
