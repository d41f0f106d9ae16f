"""What the pieces of a design have to keep, and which of it they do not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from batten.curves.cubic_proxy import CubicProxy
from batten.errors import InvalidInputError
from batten.kernels import good_region as kernel
from batten.kernels.quadrature import panel_condition
from batten.typing import FloatArray, IntArray

RESIDUAL_BELOW = 0.21
"""Fisker2018 §5.2: the λ-residual that a piece has to stay below."""
ANGLE_ERROR_BELOW = math.radians(6.0)
"""Fisker2018 §5.2: how far the end tangents of the first guess may be turned against those of the piece."""
_NO_LIMITS = np.array([1.0, 2.0 * math.pi, math.inf, 0.0, 0.0, panel_condition(1e-6)])


@dataclass(frozen=True)
class DesignLimits:
    """Limits for every piece of a design, so that a rod takes its shape: Fisker2018 §5.2, and three more on demand.

    Parameters:
        residual_below: e_λ of every piece stays below it; in (0, 1].
        angle_error_below: so does the greatest turn of the first guess's end tangents against those of the piece, radians.
        curvature_below: so does the greatest |κ| of the first guess, 1/length; None for any.
        margin_above: the stability margin of the first guess with clamped ends stays above it; None for any. 1 is the limit
            of stability.
        simple: whether the spline may not cross itself.

    Raises:
        InvalidInputError: a number that is not positive and finite, a residual above 1.

    Example:
        >>> limits = DesignLimits(curvature_below=2.0)
        >>> limits.residual_below, limits.margin_above
        (0.21, None)
    """

    residual_below: float = RESIDUAL_BELOW
    angle_error_below: float = ANGLE_ERROR_BELOW
    curvature_below: float | None = None
    margin_above: float | None = None
    simple: bool = False

    def __post_init__(self) -> None:
        for name in ("residual_below", "angle_error_below", "curvature_below", "margin_above"):
            value = getattr(self, name)
            if value is None and name in ("curvature_below", "margin_above"):
                continue
            most = 1.0 if name == "residual_below" else math.inf
            if not isinstance(value, int | float | np.floating) or not (0.0 < value < math.inf and value <= most):
                allowed = "a number in (0, 1]" if most == 1.0 else "positive and finite"
                raise InvalidInputError(f"{name} is {allowed}; got {value!r}; the defaults are 0.21 and 6° in radians")
            object.__setattr__(self, name, float(value))
        if not isinstance(self.simple, bool):
            raise InvalidInputError(f"simple is True or False; got {self.simple!r}")


@dataclass(frozen=True, eq=False)
class PieceMeasures:
    """What limits are about, of the n pieces of a spline; each (n,).

    Attributes:
        residuals: e_λ. angle_errors: radians. curvatures: greatest |κ| of the first guess, 1/length. margins: stability
            margins of the first guess, clamped ends; inf without a conjugate point. A piece without a first guess has an
            angle error and a curvature of 1e9 and a margin of 0.
        crossing: whether the spline crosses itself; None where that was not asked.
    """

    residuals: FloatArray
    angle_errors: FloatArray
    curvatures: FloatArray
    margins: FloatArray
    crossing: bool | None


@dataclass(frozen=True)
class BrokenLimit:
    """A limit that a piece does not keep.

    Attributes:
        limit: the name of the field of `DesignLimits`.
        piece: the number of the piece; None for `simple`, which is about the whole spline.
        value: what the piece has. allowed: the limit.
    """

    limit: str
    piece: int | None
    value: float
    allowed: float

    @property
    def excess(self) -> float:
        """By how much the value is on the wrong side, ≥ 0 for a limit that is broken."""
        return self.allowed - self.value if self.limit == "margin_above" else self.value - self.allowed

    def __str__(self) -> str:
        if self.limit == "simple":
            return "the spline crosses itself"
        if self.limit == "angle_error_below":
            text = (
                f"an angle error of {math.degrees(self.value):.3g}°, allowed is below {math.degrees(self.allowed):.3g}°"
            )
        elif self.limit == "margin_above":
            text = f"a stability margin of {self.value:.3g}, allowed is above {self.allowed:.3g}"
        else:
            name = "λ-residual" if self.limit == "residual_below" else "greatest curvature"
            text = f"a {name} of {self.value:.3g}, allowed is below {self.allowed:.3g}"
        return f"piece {self.piece} has {text}"


def piece_measures(
    proxy: CubicProxy,
    limits: DesignLimits,
    known: PieceMeasures | None = None,
    pieces: Sequence[int] | IntArray | None = None,
) -> PieceMeasures:
    """The measures of every piece; of `pieces` alone where `known` has those of the others.

    Accuracy: e_λ within 1e-6. The rest as in `solvers.good_region`, whose kernel computes them; the greatest |κ| is that of
    65 places, so up to 1e-3 relative too small on a rod that turns much.
    """
    which = np.arange(proxy.piece_count) if known is None or pieces is None else np.asarray(pieces, dtype=np.int64)
    rows = np.ascontiguousarray(proxy.pieces[which])
    found = np.empty((len(rows), 4))
    kernel.values_batch(rows, _NO_LIMITS, found)
    if known is not None and pieces is not None:
        full = np.stack([known.residuals, known.angle_errors, known.curvatures, known.margins], axis=-1)
        full[which] = found
        found = full
    found.setflags(write=False)
    residuals, angle_errors, curvatures, margins = found.T
    crossing = _crosses_itself(proxy) if limits.simple else None
    return PieceMeasures(residuals, angle_errors, curvatures, margins, crossing)


def broken_limits(
    measures: PieceMeasures, limits: DesignLimits, pieces: Sequence[int] | IntArray | None = None
) -> tuple[BrokenLimit, ...]:
    """All limits that the pieces (None for all) do not keep, piece by piece; a measure that is NaN keeps none."""
    found = []
    columns = (
        ("residual_below", measures.residuals),
        ("angle_error_below", measures.angle_errors),
        ("curvature_below", measures.curvatures),
        ("margin_above", measures.margins),
    )
    for piece in range(len(measures.residuals)) if pieces is None else pieces:
        for name, values in columns:
            allowed, value = getattr(limits, name), float(values[piece])
            if allowed is not None and not (value > allowed if name == "margin_above" else value < allowed):
                found.append(BrokenLimit(name, int(piece), value, allowed))
    if limits.simple and measures.crossing:
        found.append(BrokenLimit("simple", None, 1.0, 0.0))
    return tuple(found)


def _crosses_itself(proxy: CubicProxy) -> bool:
    """Whether chords of the pieces, 16 each, cross one another."""
    chords = np.empty((proxy.piece_count, kernel.CHORDS + 1, 2))
    numbers = np.arange(proxy.piece_count, dtype=np.int64)
    return bool(kernel.crosses(np.ascontiguousarray(proxy.pieces), np.empty_like(chords), numbers, chords))
