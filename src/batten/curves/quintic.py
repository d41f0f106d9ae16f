"""Quintic curves of the plane in Hermite form."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import polynomial

from batten.curves.arc_length import ArcLength
from batten.curves.base import check_order
from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError
from batten.typing import ArrayLike, FloatArray

# Bernstein control points from C(0), C′(0), C″(0), C″(1), C′(1), C(1).
_CONTROL = np.array(
    [
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1.0, 0.2, 0.0, 0.0, 0.0, 0.0],
        [1.0, 0.4, 0.05, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.05, -0.4, 1.0],
        [0.0, 0.0, 0.0, 0.0, -0.2, 1.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
    ]
)
# Coefficients of t⁰ … t⁵, without C(0), from C(1) − C(0) and the four derivatives in the same order.
_POWERS = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.5, 0.0, 0.0],
        [10.0, -6.0, -1.5, 0.5, -4.0],
        [-15.0, 8.0, 1.5, -1.0, 7.0],
        [6.0, -3.0, -0.5, 0.5, -3.0],
    ]
)


@dataclass(frozen=True, eq=False)
class QuinticHermite:
    """The quintic on t ∈ [0, 1] with given ends and first and second derivatives there (Moreton1995 §3.1).

    Parameters:
        data: shape (6, 2), finite: C(0), C′(0), C″(0), C″(1), C′(1), C(1); copied and made read-only.

    Raises:
        InvalidInputError: another shape, or a number that is not finite.

    Accuracy: the ends come back exactly.
    Degenerate cases: any data will do; where C′ is 0 the curve has no tangent.

    Example:
        >>> line = QuinticHermite([(0, 0), (1, 0), (0, 0), (0, 0), (1, 0), (1, 0)])
        >>> line.point(0.25).tolist(), line.length
        ([0.25, 0.0], 1.0)
    """

    data: FloatArray

    def __post_init__(self) -> None:
        data = np.array(self.data, dtype=np.float64)
        if data.shape != (6, 2) or not np.isfinite(data).all():
            raise InvalidInputError(
                "a quintic in Hermite form has finite data of shape (6, 2): C(0), C′(0), C″(0), C″(1), C′(1), C(1); got "
                f"shape {data.shape}" + ("" if data.shape != (6, 2) else f" with {data.tolist()}")
            )
        data.setflags(write=False)
        object.__setattr__(self, "data", data)

    @cached_property
    def _coefficients(self) -> FloatArray:
        own = self.data
        return np.asarray(_POWERS @ np.vstack([own[5] - own[0], own[1:5]]))

    @property
    def control_points(self) -> FloatArray:
        """The six Bézier control points, (6, 2)."""
        return np.asarray(_CONTROL @ self.data)

    def point(self, t: ArrayLike) -> FloatArray:
        """Points C(t), shape (…, 2) for t of shape (…). Outside [0, 1] the quintic goes on."""
        t = np.asarray(t, dtype=np.float64)
        near = np.moveaxis(polynomial.polyval(t, self._coefficients), 0, -1) + self.data[0]
        return np.where((t == 1.0)[..., None], self.data[5], near)

    def derivative(self, t: ArrayLike, order: int = 1) -> FloatArray:
        """Derivatives dⁿC/dtⁿ for n = `order` ∈ {1, 2, 3}, shape (…, 2) for t of shape (…)."""
        check_order(order)
        t = np.asarray(t, dtype=np.float64)
        return np.moveaxis(polynomial.polyval(t, polynomial.polyder(self._coefficients, order)), 0, -1)

    @cached_property
    def length(self) -> float:
        """The arc length, to 1e-13 of itself."""
        return ArcLength.of(self).length

    def breaks(self) -> FloatArray:
        """(0, 1): a polynomial is smooth."""
        return np.array([0.0, 1.0])

    def reversed(self) -> QuinticHermite:
        """The same points from the end to the start."""
        return QuinticHermite(self.data[::-1] * np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0])[:, None])

    def transformed(self, similarity: Similarity) -> QuinticHermite:
        """The image under a similarity."""
        ends = similarity.apply(self.data[[0, 5]])
        arrows = similarity.apply_to_vectors(self.data[1:5])
        return QuinticHermite(np.vstack([ends[:1], arrows, ends[1:]]))
