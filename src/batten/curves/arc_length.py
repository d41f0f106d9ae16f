"""Arc length along any curve, and its inverse: from the fraction of the length to the parameter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from batten.curves.base import Curve
from batten.errors import InvalidInputError
from batten.kernels.quadrature import NODES_24, WEIGHTS_24, adaptive_panels
from batten.typing import ArrayLike, FloatArray

_X = 2.0 * NODES_24 - 1.0
# From values at the nodes to the Legendre coefficients of the interpolating polynomial on [−1, 1].
_FIT = legendre.legvander(_X, 23).T * (2.0 * WEIGHTS_24) * (np.arange(24)[:, None] + 0.5)


def speed(curve: Curve, t: ArrayLike) -> FloatArray:
    """|γ'(t)|, shape (…)."""
    d = curve.derivative(t)
    return np.hypot(d[..., 0], d[..., 1])


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
        """Measure a curve; pieces are halved until the integrals of γ' and |γ'| are known to `tolerance` × the length.

        Raises:
            InvalidInputError: a curve of length 0 or one that is not finite.
        """

        def integrands(t: FloatArray) -> FloatArray:
            # The speed, and the direction with it: the sums are all of the size of the speed.
            d = curve.derivative(t)
            v = np.hypot(d[..., 0], d[..., 1])
            return np.stack([v, v + 0.5 * d[..., 0], v + 0.5 * d[..., 1]])

        edges, _ = adaptive_panels(integrands, curve.breaks(), tolerance)
        half = 0.5 * np.diff(edges)
        values = speed(curve, edges[:-1, None] + 2.0 * half[:, None] * NODES_24)
        slopes = (values * half[:, None]) @ _FIT.T
        coefficients = legendre.legint(slopes, lbnd=-1, axis=1)
        pieces = 2.0 * half * (values @ WEIGHTS_24)
        lengths = np.concatenate([[0.0], np.cumsum(pieces)])
        if not (np.isfinite(lengths[-1]) and lengths[-1] > 0.0):
            raise InvalidInputError(
                f"arc length needs a curve with a positive, finite length; got length {lengths[-1]}"
            )
        uniform = bool(np.ptp(values) <= 8.0 * np.finfo(float).eps * lengths[-1])
        return cls(curve, edges, lengths, uniform, np.asarray(coefficients, dtype=np.float64), slopes)

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
        shape = fraction.shape
        goal = fraction.ravel() * self.lengths[-1]
        piece = np.clip(np.searchsorted(self.lengths, goal, side="right") - 1, 0, len(self.edges) - 2)
        goal = goal - self.lengths[piece]
        size = np.diff(self.lengths)[piece]
        low, high = np.full_like(goal, -1.0), np.full_like(goal, 1.0)
        x = 2.0 * goal / np.where(size > 0.0, size, 1.0) - 1.0
        # Newton's iteration, kept inside a bracket that shrinks at every step; each value goes on until it stands still.
        todo = np.flatnonzero(size > 0.0)
        for _ in range(60):
            rows, old = piece[todo], x[todo]
            basis = legendre.legvander(old, 24)
            error = (basis * self._coefficients[rows]).sum(axis=-1) - goal[todo]
            slope = (basis[:, :24] * self._slopes[rows]).sum(axis=-1)
            low[todo] = np.where(error < 0.0, old, low[todo])
            high[todo] = np.where(error > 0.0, old, high[todo])
            with np.errstate(divide="ignore", invalid="ignore"):
                new = old - error / slope
            new = np.where((new >= low[todo]) & (new <= high[todo]), new, 0.5 * (low[todo] + high[todo]))
            x[todo] = new
            todo = todo[(np.abs(new - old) > 1e-15) & (np.abs(error) > 1e-16 * size[todo])]
            if todo.size == 0:
                break
        left, right = self.edges[piece], self.edges[piece + 1]
        return np.clip(left + 0.5 * (x + 1.0) * (right - left), left, right).reshape(shape)


def _local(t: FloatArray, edges: FloatArray, piece: NDArray[np.intp]) -> FloatArray:
    left, right = edges[piece], edges[piece + 1]
    return (2.0 * t - left - right) / (right - left)


def _series(x: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Legendre series with one row of coefficients for each x."""
    return np.asarray((legendre.legvander(x, coefficients.shape[-1] - 1) * coefficients).sum(axis=-1))
