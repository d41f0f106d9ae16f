"""Segments of log-aesthetic curves, whose curvature is a power of arc length."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from batten.curves.base import check_order
from batten.errors import InvalidInputError
from batten.kernels import log_aesthetic as kernel
from batten.typing import ArrayLike, FloatArray


@dataclass(frozen=True, eq=False)
class LogAestheticCurve:
    """A curve with κ(s) = sign(s − s₀)·a·|s − s₀|^α, or a circle (Levien2009 §4.8.1).

    Parameters:
        start: the first point, shape (2,). start_angle: of the tangent there, radians.
        exponent: α > 0; 1 is the Euler spiral.
        turn: the angle of the tangent at the end less that at the start, radians.
        change: curvature at the end less that at the start, times the length.
        length: above 0.

    Accuracy:
        Points to 1e-14 of the length. The third derivative is infinite at an inflection for α < 1.

    Example:
        >>> curve = LogAestheticCurve([0.0, 0.0], 0.0, 2.0, 1.0, 2.0, 3.0)
        >>> round(float(curve.angle_at(3.0)), 12), round(float(np.diff(curve.curvature_at([0.0, 3.0]))[0] * 3.0), 12)
        (1.0, 2.0)
    """

    start: FloatArray
    start_angle: float
    exponent: float
    turn: float
    change: float
    length: float

    def __post_init__(self) -> None:
        start = np.asarray(self.start, dtype=np.float64)
        numbers = [float(v) for v in (self.start_angle, self.exponent, self.turn, self.change, self.length)]
        if start.shape != (2,) or not np.isfinite([*start, *numbers]).all() or not (numbers[1] > 0.0 < numbers[4]):
            raise InvalidInputError(
                f"a log-aesthetic curve needs a start (2,), finite numbers, exponent and length above 0; got {self.start}, "
                f"angle {self.start_angle}, exponent {self.exponent}, turn {self.turn}, length {self.length}"
            )
        start = start.copy()
        start.setflags(write=False)
        object.__setattr__(self, "start", start)

    @cached_property
    def _window(self) -> float:
        """Where the middle of the segment lies from the inflection, in lengths; infinite for a circle."""
        return float(kernel.log_aesthetic_chord(float(self.turn), float(self.change), float(self.exponent))[4])

    @property
    def inflection(self) -> float | None:
        """Arc length of the inflection, which may lie outside the segment; None for a circle."""
        w = self._window
        return None if math.isinf(w) else (0.5 - w) * self.length

    def _relative(self, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(turn from the start, κ·length, κ′·length²) at arc lengths."""
        u = s / self.length - 0.5
        w = self._window
        if math.isinf(w):
            return self.turn * (u + 0.5), np.full(u.shape, self.turn), np.zeros(u.shape)
        alpha, beta = self.exponent, self.exponent + 1.0
        turn, change = kernel.half_sums(w, alpha)
        if abs(w) > 1.0:  # about the middle, where no digits are lost near a circle
            m = self.turn / abs(turn)
            grown = np.log1p(u / w)
            first = math.expm1(beta * math.log1p(-0.5 / w))
            angle = m * w / beta * (np.expm1(beta * grown) - first)
            return angle, m * np.exp(alpha * grown), m * alpha / w * np.exp((alpha - 1.0) * grown)
        a = self.change / change
        size = np.abs(w + u)
        angle = a / beta * (size**beta - abs(w - 0.5) ** beta)
        with np.errstate(divide="ignore"):
            return angle, a * np.sign(w + u) * size**alpha, a * alpha * size ** (alpha - 1.0)

    def angle_at(self, s: ArrayLike) -> FloatArray:
        """Tangent angle at arc length s, shape of s, radians."""
        return np.asarray(self.start_angle + self._relative(np.asarray(s, dtype=np.float64))[0])

    def curvature_at(self, s: ArrayLike) -> FloatArray:
        """Curvature at arc length s, shape of s."""
        return np.asarray(self._relative(np.asarray(s, dtype=np.float64))[1] / self.length)

    def point(self, t: ArrayLike) -> FloatArray:
        """Points at the fraction t of the length, shape (…, 2)."""
        w = self._window
        fractions = np.asarray(t, dtype=np.float64)
        local = np.empty((fractions.size, 2))
        kernel.log_aesthetic_points(self.turn, self.change, self.exponent, w, fractions.reshape(-1), local)
        c, s = math.cos(self.start_angle), math.sin(self.start_angle)
        x, y = self.length * local[:, 0], self.length * local[:, 1]
        out = np.stack([self.start[0] + c * x - s * y, self.start[1] + s * x + c * y], axis=-1)
        return np.asarray(out.reshape(*fractions.shape, 2))

    def derivative(self, t: ArrayLike, order: int = 1) -> FloatArray:
        """Derivatives of `point` of order 1, 2 or 3 with respect to t, shape (…, 2)."""
        check_order(order)
        turn, kappa, slope = self._relative(np.asarray(t, dtype=np.float64) * self.length)
        angle = self.start_angle + turn
        tangent = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        normal = np.stack([-tangent[..., 1], tangent[..., 0]], axis=-1)
        if order == 1:
            return np.asarray(self.length * tangent)
        if order == 2:
            return np.asarray(self.length * kappa[..., None] * normal)
        return np.asarray(self.length * (slope[..., None] * normal - (kappa**2)[..., None] * tangent))

    def breaks(self) -> FloatArray:
        """0, 1 and the inflection between them, where higher derivatives may jump."""
        s = self.inflection
        inner = [s / self.length] if s is not None and 0.0 < s < self.length else []
        return np.array([0.0, *inner, 1.0])
