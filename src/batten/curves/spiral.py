"""Curves whose curvature is a cubic of arc length: lines, circles, Euler spirals, four-parameter spirals."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from batten.curves.base import check_order
from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError
from batten.kernels import spiral as kernel
from batten.typing import ArrayLike, FloatArray

_DERIVATIVES = 4


@dataclass(frozen=True, eq=False)
class Spiral:
    """A curve with κ(s) = κ₀ + κ₀′ s + κ₀″ s²/2 + κ₀‴ s³/6 (Levien2009 §4.6 for κ₀″ = κ₀‴ = 0: the Euler spiral).

    Parameters:
        start: the first point, shape (2,), any unit of length.
        start_angle: angle of the tangent there, radians.
        curvatures: κ and its derivatives by arc length at the start, shape (1 … 4,); missing ones are 0. Units 1/length,
            1/length² and so on; positive to the left.
        length: above 0.

    Raises:
        InvalidInputError: a shape, a value that is not finite, a length that is not above 0.

    Accuracy:
        The angle is a polynomial; points are integrals of (cos θ, sin θ), to 1e-15 of the length for each turn.
    Degenerate cases:
        Curvatures 0: a straight line. Only the first: an arc.

    Example:
        >>> quarter = Spiral([0.0, 0.0], 0.0, [1.0], np.pi / 2)
        >>> quarter.point(1.0).round(12).tolist()
        [1.0, 1.0]
        >>> Spiral([0.0, 0.0], 0.0, [0.0, 1.0], 2.0).curvature_at([0.0, 2.0]).tolist()
        [0.0, 2.0]
    """

    start: FloatArray
    start_angle: float
    curvatures: FloatArray
    length: float

    def __post_init__(self) -> None:
        start = np.asarray(self.start, dtype=np.float64)
        given = np.asarray(self.curvatures, dtype=np.float64)
        if start.shape != (2,) or given.ndim != 1 or not 1 <= given.size <= _DERIVATIVES:
            raise InvalidInputError(
                f"a spiral has a start of shape (2,) and 1 to 4 curvatures; got shapes {start.shape} and {given.shape}"
            )
        curvatures = np.zeros(_DERIVATIVES)
        curvatures[: given.size] = given
        angle, length = float(self.start_angle), float(self.length)
        if not np.isfinite([*start, *curvatures, angle, length]).all() or not length > 0.0:
            raise InvalidInputError(
                f"a spiral needs finite numbers and a length above 0; got start {start.tolist()}, angle {angle}, "
                f"curvatures {given.tolist()}, length {length}"
            )
        start, curvatures = start.copy(), curvatures
        start.setflags(write=False)
        curvatures.setflags(write=False)
        object.__setattr__(self, "start", start)
        object.__setattr__(self, "start_angle", angle)
        object.__setattr__(self, "curvatures", curvatures)
        object.__setattr__(self, "length", length)

    @cached_property
    def end(self) -> FloatArray:
        """The last point, (2,)."""
        return self.point(1.0)

    @property
    def end_angle(self) -> float:
        """The angle of the tangent at the end; `start_angle` plus the whole turn, radians."""
        return float(self.angle_at(self.length))

    def angle_at(self, s: ArrayLike) -> FloatArray:
        """Tangent angle at arc length s, shape of s, radians."""
        s = np.asarray(s, dtype=np.float64)
        k = self.curvatures
        return np.asarray(self.start_angle + s * (k[0] + s * (k[1] / 2.0 + s * (k[2] / 6.0 + s * k[3] / 24.0))))

    def curvature_at(self, s: ArrayLike, order: int = 0) -> FloatArray:
        """Curvature at arc length s, or its derivative of `order` 0 … 3, shape of s."""
        if order not in range(_DERIVATIVES):
            raise InvalidInputError(f"derivatives of the curvature of order 0 to 3 are offered; got {order}")
        s = np.asarray(s, dtype=np.float64)
        value = np.zeros_like(s)
        for j in range(_DERIVATIVES - 1, order - 1, -1):
            value = value * s / (j - order + 1) + self.curvatures[j]
        return np.asarray(value)

    def point(self, t: ArrayLike) -> FloatArray:
        """Points at the fraction t of the length, shape (…, 2)."""
        fractions = np.asarray(t, dtype=np.float64)
        flat = fractions.reshape(-1)
        order = np.argsort(flat, kind="stable")
        local = np.empty((flat.size, 2))
        kernel.spiral_points(self.curvatures, self.length, 1e-16, flat[order], local)
        out = np.empty_like(local)
        c, s = math.cos(self.start_angle), math.sin(self.start_angle)
        out[order, 0] = self.start[0] + c * local[:, 0] - s * local[:, 1]
        out[order, 1] = self.start[1] + s * local[:, 0] + c * local[:, 1]
        return out.reshape(*fractions.shape, 2)

    def derivative(self, t: ArrayLike, order: int = 1) -> FloatArray:
        """Derivatives of `point` of order 1, 2 or 3 with respect to t, shape (…, 2)."""
        check_order(order)
        s = np.asarray(t, dtype=np.float64) * self.length
        angle, kappa, size = self.angle_at(s), self.curvature_at(s), self.length
        tangent = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        normal = np.stack([-tangent[..., 1], tangent[..., 0]], axis=-1)
        if order == 1:
            return np.asarray(size * tangent)
        if order == 2:
            return np.asarray(size**2 * kappa[..., None] * normal)
        slope = self.curvature_at(s, 1)
        return np.asarray(size**3 * (slope[..., None] * normal - (kappa**2)[..., None] * tangent))

    def breaks(self) -> FloatArray:
        """A spiral is smooth: (0, 1)."""
        return np.array([0.0, 1.0])

    def bending_energy(self) -> float:
        """∫κ² ds, exact up to rounding."""
        x, w = np.polynomial.legendre.leggauss(4)
        return float(0.5 * self.length * w @ self.curvature_at(0.5 * self.length * (x + 1.0)) ** 2)

    def reversed(self) -> Spiral:
        """The same points from the end to the start: κ and κ″ change sign at every point."""
        values = [float(self.curvature_at(self.length, j)) for j in range(_DERIVATIVES)]
        return Spiral(self.end, self.end_angle + math.pi, -np.array(values) * [1.0, -1.0, 1.0, -1.0], self.length)

    def transformed(self, similarity: Similarity) -> Spiral:
        """The image under a similarity."""
        scale = similarity.scale
        curvatures = self.curvatures / scale ** np.arange(1, _DERIVATIVES + 1)
        angle = self.start_angle + similarity.rotation
        return Spiral(similarity.apply(self.start), angle, curvatures, self.length * scale)


def euler_spiral(start: ArrayLike, start_angle: float, end: ArrayLike, end_angle: float) -> Spiral:
    """The Euler spiral (clothoid) between two points with given tangents (Levien2009 §4.6.1; G¹ Hermite interpolation).

    Definition: κ(s) = κ₀ + κ₀′ s. Of the spirals that fit, the one whose tangents lie within π of the chord, so that it
    turns by less than 2π; there is exactly one.

    Parameters:
        start, end: points (2,), not the same, any unit of length.
        start_angle, end_angle: angles of the tangents, radians; full turns are taken off.

    Returns:
        The spiral.

    Raises:
        InvalidInputError: wrong shapes, values that are not finite, start = end, or both tangents straight back along the
            chord in the sense of a full circle, which has no chord.

    Accuracy:
        End point to 1e-15 × length, angles to 1e-14.
    Degenerate cases:
        Tangents along the chord: a line; symmetric tangents: an arc.

    Example:
        >>> bow = euler_spiral([0.0, 0.0], 0.0, [1.0, 1.0], np.pi / 2)
        >>> bow.curvatures.round(12).tolist(), round(bow.length, 6)
        ([1.0, 0.0, 0.0, 0.0], 1.570796)
    """
    from batten.errors import NoSolutionError

    p, q = (np.asarray(v, dtype=np.float64) for v in (start, end))
    if p.shape != (2,) or q.shape != (2,) or not np.isfinite([*p, *q, start_angle, end_angle]).all():
        raise InvalidInputError(
            f"euler_spiral needs two points (2,) and two angles, all finite; got {p}, {start_angle}, {q}, {end_angle}"
        )
    chord = float(np.hypot(*(q - p)))
    if chord == 0.0:
        raise InvalidInputError(f"start and end are both {p.tolist()}; an Euler spiral needs two different points")
    direction = math.atan2(q[1] - p[1], q[0] - p[0])
    angles = [math.remainder(float(a) - direction, 2.0 * math.pi) for a in (start_angle, end_angle)]
    row = np.empty(9)
    if kernel.euler_spiral(angles[0], angles[1], np.empty(6), row) != kernel.CONVERGED:
        raise NoSolutionError(
            f"tangents at {angles[0]:.6g} and {angles[1]:.6g} rad to the chord are those of a full circle, without a chord"
        )
    return spiral_from_row(p, direction + angles[0], row, chord)


def spiral_from_row(start: FloatArray, start_angle: float, row: FloatArray, chord: float) -> Spiral:
    """The spiral of a row of `kernels.spiral.euler_spiral`, for its chord."""
    k0, k1, c = row[:3]
    length = chord / c
    return Spiral(start, start_angle, np.array([(k0 - 0.5 * k1) / length, k1 / length**2]), length)
