"""Curves given by a curvature function of arc length: tabulated once, then evaluated anywhere."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import legendre

from batten.curves.base import check_order
from batten.errors import InvalidInputError
from batten.kernels.quadrature import NODES_24, WEIGHTS_24, adaptive_panels
from batten.typing import ArrayLike, FloatArray

CurvatureFunction = Callable[[FloatArray], FloatArray]
"""Curvature at arc lengths, an array of any shape."""

_X = 2.0 * NODES_24 - 1.0
_FIT = legendre.legvander(_X, 23).T * (2.0 * WEIGHTS_24) * (np.arange(24)[:, None] + 0.5)


@dataclass(frozen=True, eq=False)
class IntrinsicTable:
    """Angle and place along a curve with given curvature, from its arc length 0. Make one with `IntrinsicTable.of`.

    Attributes:
        curvature: κ(s). edges: arc lengths between panels, ascending. On each panel κ, θ and z are Legendre series.
        zeros: arc lengths where the curvature vanishes, ascending.

    Accuracy:
        1e-13 of the length where κ is smooth on the panels that `of` found; they are finest where it is not.
    """

    curvature: CurvatureFunction
    edges: FloatArray
    zeros: FloatArray
    _angle: FloatArray  # (panels, 25)
    _place: FloatArray  # (panels, 2, 25)

    @classmethod
    def of(cls, curvature: CurvatureFunction, low: float, high: float) -> IntrinsicTable:
        """Tabulate κ on [low, high].

        Raises:
            InvalidInputError: low ≥ high, or a curvature that is not finite there or gives arrays of another shape.
        """
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise InvalidInputError(
                f"a curvature is tabulated from low to high, finite and ascending; got {low}, {high}"
            )
        probe = np.linspace(low, high, 101)
        with np.errstate(all="ignore"):
            values = np.asarray(curvature(probe), dtype=np.float64)
        if values.shape != probe.shape or not np.isfinite(values).all():
            got = "NaN or ∞" if values.shape == probe.shape else f"shape {values.shape}"
            raise InvalidInputError(
                f"the curvature function gives {got} for arc lengths of shape {probe.shape} in [{low:g}, {high:g}]; it "
                "must be finite there, an array of the shape that it gets"
            )
        # Zeros of κ are breaks, since a power of |s| has one there. No panel turns by more than 1.
        signs = np.flatnonzero(values[:-1] * values[1:] < 0.0)
        zeros = [_zero(curvature, probe[i], probe[i + 1]) for i in signs]
        inner = [float(s) for s in probe[values == 0.0] if low < s < high]
        vanishing = np.unique([*zeros, *inner])
        breaks = np.unique([low, high, *vanishing])
        edges, _ = adaptive_panels(lambda t: np.asarray(curvature(t), dtype=np.float64)[None], breaks, 1e-14)
        turn = np.abs(np.diff(edges)) * np.abs(values).max()
        parts = zip(edges[:-1], edges[1:], turn)
        edges = np.append(np.concatenate([np.linspace(a, b, max(1, math.ceil(t)) + 1)[:-1] for a, b, t in parts]), high)
        half = 0.5 * np.diff(edges)
        middle = 0.5 * (edges[:-1] + edges[1:])
        kappa = np.asarray(curvature(middle[:, None] + half[:, None] * _X), dtype=np.float64) * half[:, None]
        angle = legendre.legint(kappa @ _FIT.T, lbnd=-1, axis=1)
        angle[:, 0] += np.concatenate([[0.0], np.cumsum(2.0 * (kappa @ WEIGHTS_24))[:-1]])
        theta = legendre.legval(_X, angle.T)  # (panels, 24)
        steps = np.stack([np.cos(theta), np.sin(theta)], axis=1) * half[:, None, None]
        place = legendre.legint(steps @ _FIT.T, lbnd=-1, axis=2)
        place[:, :, 0] += np.concatenate([np.zeros((1, 2)), np.cumsum(2.0 * (steps @ WEIGHTS_24), axis=0)[:-1]])
        return cls(
            curvature, edges, vanishing, np.asarray(angle, dtype=np.float64), np.asarray(place, dtype=np.float64)
        )

    def state(self, s: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(θ, z, κ) at arc lengths within the table: angle from that at `edges[0]`, place as complex numbers, curvature."""
        s = np.asarray(s, dtype=np.float64)
        flat = s.reshape(-1)
        panel = np.clip(np.searchsorted(self.edges, flat, side="right") - 1, 0, len(self.edges) - 2)
        a, b = self.edges[panel], self.edges[panel + 1]
        x = (2.0 * flat - a - b) / (b - a)
        basis = legendre.legvander(x, 24)
        angle = (self._angle[panel] * basis).sum(axis=1)
        place = np.einsum("nij,nj->ni", self._place[panel], basis)
        kappa = np.asarray(self.curvature(flat), dtype=np.float64)
        return angle.reshape(s.shape), (place[:, 0] + 1j * place[:, 1]).reshape(s.shape), kappa.reshape(s.shape)


def _zero(curvature: CurvatureFunction, a: float, b: float) -> float:
    from scipy.optimize import brentq

    return float(brentq(lambda s: float(curvature(np.array([s]))[0]), a, b, xtol=1e-15))


@dataclass(frozen=True, eq=False)
class IntrinsicCurve:
    """A window of a tabulated curve, moved, turned, scaled, mirrored or run backwards.

    Parameters:
        table: of the generating curve. first, last: arc lengths on it where the segment starts and ends; last < first runs
            backwards. mirrored: whether the curvature changes sign.
        start: first point, (2,). end: last point, (2,): scale and direction follow from the two.

    Example:
        >>> table = IntrinsicTable.of(lambda s: s, 0.0, 3.0)
        >>> curve = IntrinsicCurve(table, 0.0, 1.0, False, np.zeros(2), np.array([2.0, 0.0]))
        >>> curve.point([0.0, 1.0]).round(12)[:, 0].tolist()
        [0.0, 2.0]
    """

    table: IntrinsicTable
    first: float
    last: float
    mirrored: bool
    start: FloatArray
    end: FloatArray

    @cached_property
    def _origin(self) -> complex:
        """Place of the first point on the generating curve, mirrored if the segment is."""
        z = complex(self.table.state(self.first)[1])
        return z.conjugate() if self.mirrored else z

    @cached_property
    def _factor(self) -> complex:
        """Scale and rotation from the generating curve to the plane."""
        z = complex(self.table.state(self.last)[1])
        chord = (z.conjugate() if self.mirrored else z) - self._origin
        return complex(*(np.asarray(self.end) - np.asarray(self.start))) / chord

    @property
    def length(self) -> float:
        """The arc length."""
        return abs(self.last - self.first) * abs(self._factor)

    def point(self, t: ArrayLike) -> FloatArray:
        """Points at the fraction t of the length, shape (…, 2)."""
        s = self.first + (self.last - self.first) * np.asarray(t, dtype=np.float64)
        _, z, _ = self.table.state(s)
        own = np.conj(z) if self.mirrored else z
        out = (own - self._origin) * self._factor
        return np.stack([self.start[0] + out.real, self.start[1] + out.imag], axis=-1)

    def derivative(self, t: ArrayLike, order: int = 1) -> FloatArray:
        """Derivatives of order 1, 2 or 3 by t, shape (…, 2); κ′ for the third by central differences of κ."""
        check_order(order)
        way = self.last - self.first
        s = self.first + way * np.asarray(t, dtype=np.float64)
        theta, _, kappa = self.table.state(s)
        sign = -1.0 if self.mirrored else 1.0
        tangent = np.exp(1j * sign * theta) * self._factor * way
        if order == 1:
            out = tangent
        elif order == 2:
            out = 1j * sign * kappa * way * tangent
        else:
            h = 1e-5 * abs(way)
            low, high = np.maximum(s - h, self.table.edges[0]), np.minimum(s + h, self.table.edges[-1])
            slope = (self.table.curvature(high) - self.table.curvature(low)) / (high - low)
            out = (1j * sign * slope - kappa**2) * way**2 * tangent
        return np.stack([out.real, out.imag], axis=-1)

    def breaks(self) -> FloatArray:
        """0, 1 and the zeros of the curvature between them, where a power of arc length is not smooth."""
        places = (self.table.zeros - self.first) / (self.last - self.first)
        return np.array([0.0, *np.sort(places[(places > 0.0) & (places < 1.0)]), 1.0])
