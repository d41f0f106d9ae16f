"""Arc length along any curve, and its inverse: from the fraction of the length to the parameter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from batten.curves.base import Curve
from batten.errors import InvalidInputError
from batten.kernels import arc_length as kernel
from batten.kernels.quadrature import DEEPEST, NODES_24, WEIGHTS_24
from batten.typing import ArrayLike, FloatArray

_X = 2.0 * NODES_24 - 1.0
# From values at the nodes to the Legendre coefficients of the interpolating polynomial on [−1, 1].
_FIT = legendre.legvander(_X, 23).T * (2.0 * WEIGHTS_24) * (np.arange(24)[:, None] + 0.5)


@dataclass(frozen=True, eq=False)
class ArcLength:
    """The arc length s(t) = ∫₀ᵗ |γ'| of a curve as a piecewise polynomial. Make one with `ArcLength.of(curve)`.

    Attributes:
        curve: the curve.
        edges: parameters between the pieces, from 0 to 1, shape (n + 1,); the breaks of the curve are among them.
        lengths: arc length from the start to each edge, shape (n + 1,).
        uniform: whether the speed is constant to rounding, so that fraction and parameter are the same.

    Accuracy: 1e-12 of the length, both ways. Near a point of zero speed the parameter is only as well determined as the
    point it belongs to: the point is right to 1e-12 of the length, the parameter to its square root.
    Degenerate cases: a curve of length 0 is refused.

    Example:
        >>> from batten.curves.bezier import CubicBezier
        >>> arch = ArcLength.of(CubicBezier([(0, 0), (0, 1), (1, 1), (1, 0)]))
        >>> round(arch.length, 12), arch.parameter_at([0.0, 0.5, 1.0]).round(12).tolist()
        (2.0, [0.0, 0.5, 1.0])
    """

    curve: Curve
    edges: FloatArray
    lengths: FloatArray
    uniform: bool
    _coefficients: FloatArray  # (n, 25): arc length within each piece, in Legendre polynomials on [−1, 1]
    _slopes: FloatArray  # (n, 24): its derivative

    @classmethod
    def of(cls, curve: Curve, tolerance: float = 1e-13) -> ArcLength:
        """Measure a curve; pieces are halved until γ' and |γ'| are polynomials of degree 23 on each, to `tolerance`.

        Raises:
            InvalidInputError: a curve of length 0 or one that is not finite.
        """
        edges, values = _resolved_panels(curve, tolerance)
        half = 0.5 * np.diff(edges)
        slopes = (values * half[:, None]) @ _FIT.T
        coefficients = legendre.legint(slopes, lbnd=-1, axis=1)
        pieces = 2.0 * half * (values @ WEIGHTS_24)
        lengths = np.concatenate([[0.0], np.cumsum(pieces)])
        if not (np.isfinite(lengths[-1]) and lengths[-1] > 0.0):
            raise InvalidInputError(
                f"arc length needs a curve with a positive, finite length; got length {lengths[-1]}"
            )
        uniform = bool(np.ptp(values) <= 8.0 * np.finfo(float).eps * lengths[-1])
        return cls(curve, edges, lengths, uniform, np.ascontiguousarray(coefficients), slopes)

    @property
    def length(self) -> float:
        """The whole arc length."""
        return float(self.lengths[-1])

    def fraction_at(self, t: ArrayLike) -> FloatArray:
        """s(t)/L in [0, 1], shape (…) for t of shape (…) in [0, 1]."""
        t = np.clip(np.asarray(t, dtype=np.float64), 0.0, 1.0)
        if self.uniform:
            return t
        piece = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, len(self.edges) - 2)
        x = _local(t, self.edges, piece)
        return (self.lengths[piece] + _series(x, self._coefficients[piece])) / self.lengths[-1]

    def parameter_at(self, fraction: ArrayLike) -> FloatArray:
        """The parameter t where s(t) = fraction × L, shape (…) for fractions of shape (…) in [0, 1]."""
        fraction = np.clip(np.asarray(fraction, dtype=np.float64), 0.0, 1.0)
        if self.uniform:
            return fraction
        out = np.empty(fraction.size)
        goals = fraction.ravel() * self.lengths[-1]
        kernel.parameters_batch(goals, self.edges, self.lengths, self._coefficients, self._slopes, out)
        return out.reshape(fraction.shape)


def _resolved_panels(curve: Curve, tolerance: float) -> tuple[FloatArray, FloatArray]:
    """Edges (n + 1,) of panels where the last Legendre coefficients of γ' and |γ'| are small, and |γ'| at their nodes."""
    breaks = np.asarray(curve.breaks(), dtype=np.float64)
    left, right = breaks[:-1], breaks[1:]
    starts, speeds = [], []
    length = 0.0
    for depth in range(DEEPEST + 1):
        width = right - left
        first = curve.derivative(left[:, None] + width[:, None] * NODES_24)
        v = np.hypot(first[..., 0], first[..., 1])
        length = max(length, float((v @ WEIGHTS_24) @ width))
        tails = np.stack([v, first[..., 0], first[..., 1]]) @ _FIT[-4:].T * width[:, None]
        # NaN and a length of 0 pass: there is nothing to resolve. So many panels come from rounding noise alone.
        bad = (np.abs(tails) > tolerance * length).any(axis=(0, 2)) & (depth < DEEPEST) & (left.size <= 1024)
        starts.append(left[~bad])
        speeds.append(v[~bad])
        if not bad.any():
            break
        middle = 0.5 * (left + right)[bad]
        left, right = np.concatenate([left[bad], middle]), np.concatenate([middle, right[bad]])
    joined = np.concatenate(starts)
    order = np.argsort(joined)
    return np.append(joined[order], breaks[-1]), np.concatenate(speeds)[order]


def _local(t: FloatArray, edges: FloatArray, piece: NDArray[np.intp]) -> FloatArray:
    left, right = edges[piece], edges[piece + 1]
    return (2.0 * t - left - right) / (right - left)


def _series(x: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Legendre series with one row of coefficients for each x."""
    basis = legendre.legvander(x, coefficients.shape[-1] - 1).reshape(coefficients.shape)
    return np.asarray((basis * coefficients).sum(axis=-1))
