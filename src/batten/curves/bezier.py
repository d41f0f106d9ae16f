"""Cubic Bézier curves of the plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from batten.curves.base import check_order
from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError
from batten.kernels.bezier import LENGTH, curvature_fit_batch
from batten.kernels.quadrature import panel_condition
from batten.typing import ArrayLike, FloatArray

#: Panels for the arc length: |γ'| is milder than what the factor of `panel_condition` was measured on.
_LENGTH_CONDITION = panel_condition(1e-9)


@dataclass(frozen=True, eq=False)
class CubicBezier:
    """The cubic γ(t) = (1−t)³ p₀ + 3t(1−t)² p₁ + 3t²(1−t) p₂ + t³ p₃ on t ∈ [0, 1].

    Parameters:
        control_points: shape (4, 2), finite; copied and made read-only.

    Raises:
        InvalidInputError: another shape, or a number that is not finite.

    Degenerate cases: coinciding control points are allowed. Where the speed |γ'| is zero (at an end whose handle has
    length zero, at a cusp) the curvature is NaN. Four equal points are a curve of length 0.

    Example:
        >>> arch = CubicBezier([(0, 0), (0, 1), (1, 1), (1, 0)])
        >>> arch.point(0.5).tolist(), round(arch.length, 12)
        ([0.5, 0.75], 2.0)
    """

    control_points: FloatArray

    def __post_init__(self) -> None:
        points = np.array(self.control_points, dtype=np.float64)
        if points.shape != (4, 2):
            raise InvalidInputError(
                f"a cubic Bézier of the plane has control points of shape (4, 2); got shape {points.shape}; "
                "for several curves at once pass the array of shape (…, 4, 2) to the measures themselves"
            )
        if not np.isfinite(points).all():
            raise InvalidInputError(f"control points must be finite; got {points.tolist()}")
        points.setflags(write=False)
        object.__setattr__(self, "control_points", points)

    def point(self, t: ArrayLike) -> FloatArray:
        """Points γ(t), shape (…, 2) for t of shape (…). Outside [0, 1] the cubic goes on.

        At 0 and 1 the first and last control points come back exactly.
        """
        t = np.asarray(t, dtype=np.float64)
        u = 1.0 - t
        uu, tt = u * u, t * t
        return np.stack([uu * u, 3.0 * t * uu, 3.0 * tt * u, tt * t], axis=-1) @ self.control_points

    def derivative(self, t: ArrayLike, order: int = 1) -> FloatArray:
        """Derivatives dⁿγ/dtⁿ for n = `order` ∈ {1, 2, 3}, shape (…, 2) for t of shape (…)."""
        check_order(order)
        t = np.asarray(t, dtype=np.float64)
        u = 1.0 - t
        d = np.diff(self.control_points, n=order, axis=0)
        if order == 1:
            return np.stack([3.0 * u * u, 6.0 * t * u, 3.0 * t * t], axis=-1) @ d
        if order == 2:
            return np.stack([6.0 * u, 6.0 * t], axis=-1) @ d
        return np.asarray(6.0 + 0.0 * t)[..., None] * d[0]

    def curvature(self, t: ArrayLike) -> FloatArray:
        """Signed curvature κ(t) = γ' × γ'' / |γ'|³, positive to the left, shape (…); NaN where γ' = 0.

        The cross product is taken from those of the edges of the control polygon, which loses less than γ' × γ''.
        """
        t = np.asarray(t, dtype=np.float64)
        d = np.diff(self.control_points, axis=0)
        e = d[[0, 0, 1], 0] * d[[1, 2, 2], 1] - d[[0, 0, 1], 1] * d[[1, 2, 2], 0]
        u = 1.0 - t
        speed = np.linalg.norm(self.derivative(t), axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            kappa = 18.0 * (u**2 * e[0] + t * u * e[1] + t**2 * e[2]) / speed**3
        return np.where(np.isfinite(kappa), kappa, np.nan)

    @property
    def length(self) -> float:
        """The arc length ∫₀¹ |γ'| dt.

        Accuracy: 1e-13 relative, near-cusps and cusps included: the panels of the Gauss rule shrink towards the zeros
        of γ' in the complex plane, which are known in closed form. Computed anew at each access (a few microseconds).
        """
        out = np.empty((1, 7))
        curvature_fit_batch(self.control_points[None].copy(), _LENGTH_CONDITION, out)
        return float(out[0, LENGTH])

    def breaks(self) -> FloatArray:
        """(0, 1): a polynomial is smooth."""
        return np.array([0.0, 1.0])

    def split(self, t: float) -> tuple[CubicBezier, CubicBezier]:
        """The two curves before and after the parameter t ∈ (0, 1), by de Casteljau's algorithm.

        Raises:
            InvalidInputError: t outside (0, 1).
        """
        if not 0.0 < t < 1.0:
            raise InvalidInputError(f"a curve is split at a parameter inside (0, 1); got {t}")
        rows = [self.control_points]
        while len(rows[-1]) > 1:
            rows.append((1.0 - t) * rows[-1][:-1] + t * rows[-1][1:])
        return CubicBezier(np.stack([row[0] for row in rows])), CubicBezier(np.stack([row[-1] for row in rows[::-1]]))

    def reversed(self) -> CubicBezier:
        """The same points run through from the end to the start."""
        return CubicBezier(self.control_points[::-1])

    def transformed(self, similarity: Similarity) -> CubicBezier:
        """The image under a similarity."""
        return CubicBezier(similarity.apply(self.control_points))
