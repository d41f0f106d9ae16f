"""Families of curve segments given by the two tangent angles to their chord (Levien2009 ch. 4).

Angles are those of the tangent to the chord, counter-clockwise positive, radians: `start` at the chord's start, `end` at its
end; Levien's are θ₀ = start, θ₁ = −end. Curvatures are multiplied by the chord. A family that is cut from a generating curve
is extensional: a point of the curve, added to the points, changes nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from batten.errors import InvalidInputError
from batten.kernels import log_aesthetic as log_aesthetic_kernel
from batten.kernels import sliding_segment as sliding_kernel
from batten.kernels import spiral as spiral_kernel
from batten.typing import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class SegmentEnds:
    """What the joints of a spline must know of n segments.

    Attributes:
        curvatures: (n, 2), curvature × chord at start and end; NaN where there is no segment.
        slopes: (n, 2, 2), their derivatives: [i, e, a] is that at end e by angle a.
        exists: (n,).
        memory: what `ends` needs to go on from these angles to others nearby.
    """

    curvatures: FloatArray
    slopes: FloatArray
    exists: BoolArray
    memory: tuple[FloatArray, ...] = ()


class SegmentFamily(Protocol):
    """A family of segments."""

    @property
    def name(self) -> str:
        """How the family is called in tables."""
        ...

    @property
    def reach(self) -> float:
        """No segment turns by as much as this, radians."""
        ...

    @property
    def winds(self) -> bool:
        """Whether a segment exists for all angles within `reach`, so that a full turn may be added to a segment."""
        ...

    @property
    def exponent(self) -> float:
        """α where curvature vanishes like |s|^α at an inflection; 1 for all smooth curves."""
        ...

    def ends(self, angles: FloatArray, chords: FloatArray, memory: tuple[FloatArray, ...] = ()) -> SegmentEnds:
        """End curvatures of segments with `angles` (n, 2) and `chords` (n,)."""
        ...


@dataclass(frozen=True)
class EulerSpirals:
    """Euler spirals, curvature linear in arc length (Levien2009 §4.6): for all angles that differ by less than 2π."""

    name: str = "Euler spiral"
    reach: float = 2.0 * np.pi
    winds: bool = True
    exponent: float = 1.0

    def ends(self, angles: FloatArray, chords: FloatArray, memory: tuple[FloatArray, ...] = ()) -> SegmentEnds:
        rows = np.empty((len(angles), 9))
        status = np.empty(len(angles), dtype=np.int64)
        spiral_kernel.euler_spiral_batch(np.ascontiguousarray(angles), rows, status)
        return SegmentEnds(rows[:, 3:5], rows[:, 5:9].reshape(-1, 2, 2), status == spiral_kernel.CONVERGED, (rows,))


@dataclass(frozen=True)
class LogAesthetic:
    """Log-aesthetic curves κ = sign(s)|s|^α (Levien2009 §4.8.1), mirror images included; α = 1 is the Euler spiral.

    Attributes:
        exponent: α > 0.
    """

    exponent: float
    reach: float = 2.0 * np.pi
    winds: bool = True

    def __post_init__(self) -> None:
        if not 0.05 <= self.exponent <= 20.0:
            raise InvalidInputError(
                f"exponent = {self.exponent}; allowed are numbers from 0.05 to 20 (1 is the Euler spiral)"
            )

    @property
    def name(self) -> str:
        return f"log-aesthetic {self.exponent:g}"

    def ends(self, angles: FloatArray, chords: FloatArray, memory: tuple[FloatArray, ...] = ()) -> SegmentEnds:
        rows = np.empty((len(angles), 9))
        status = np.empty(len(angles), dtype=np.int64)
        log_aesthetic_kernel.log_aesthetic_batch(np.ascontiguousarray(angles), self.exponent, rows, status)
        exists = status == spiral_kernel.CONVERGED
        return SegmentEnds(rows[:, 3:5], rows[:, 5:9].reshape(-1, 2, 2), exists, (rows,))


@dataclass(frozen=True)
class SlidingElastica:
    """Elastica whose ends slide (Levien2009 §3.9–3.11, §4.2, §4.9).

    Attributes:
        upright: whether the force is perpendicular to the chord (SI-MEC, kurgla 1) and not given by the tension.
        tension: c of the energy ∫κ² + c ds, 1/length²; 0 for the MEC, whose segments are cut from the rectangular elastica.
    """

    upright: bool = False
    tension: float = 0.0
    reach: float = 2.0 * np.pi
    winds: bool = False
    exponent: float = 1.0

    @property
    def name(self) -> str:
        if self.upright:
            return "SI-MEC segments (kurgla 1)"
        return "MEC" if self.tension == 0.0 else f"MEC with tension {self.tension:g}"

    def ends(self, angles: FloatArray, chords: FloatArray, memory: tuple[FloatArray, ...] = ()) -> SegmentEnds:
        n = len(angles)
        tension = self.tension * chords**2
        known, z = (m.copy() for m in memory) if memory else (np.zeros((n, 3)), np.zeros((n, 3)))
        if not memory:  # straight rods
            known[:, 2], z[:, 1] = tension, 0.0 if self.upright else -0.5 * tension
        rows = np.empty((n, 7))
        status = np.empty(n, dtype=np.int64)
        sliding_kernel.sliding_batch(np.ascontiguousarray(angles), tension, self.upright, known, z, rows, status)
        exists = status == spiral_kernel.CONVERGED
        return SegmentEnds(rows[:, 1:3], rows[:, 3:7].reshape(-1, 2, 2), exists, (known, z))


@dataclass(frozen=True)
class HobbySegments:
    """Hobby's cubics, as Metafont draws them, joined by *mock curvature*: linear in the angles (Levien2009 §4.7).

    Attributes:
        tension: τ of (4.11), at least 0.75; 1 as Metafont has it.
    """

    tension: float = 1.0
    reach: float = np.inf
    winds: bool = False
    exponent: float = 1.0

    def __post_init__(self) -> None:
        if not 0.75 <= self.tension < np.inf:
            raise InvalidInputError(f"tension = {self.tension}; allowed are numbers from 0.75 (1 is Metafont's own)")

    @property
    def name(self) -> str:
        return "Hobby" if self.tension == 1.0 else f"Hobby, tension {self.tension:g}"

    def ends(self, angles: FloatArray, chords: FloatArray, memory: tuple[FloatArray, ...] = ()) -> SegmentEnds:
        # The cubic with arms 1/(3τ): κ(0) = (2τ − 6τ²)·start − 2τ·end to first order; at the end by symmetry.
        t = self.tension
        own, other = 2.0 * t - 6.0 * t * t, -2.0 * t
        slopes = np.broadcast_to(np.array([[own, other], [-other, -own]]), (len(angles), 2, 2))
        return SegmentEnds((slopes @ angles[..., None])[..., 0], slopes, np.asarray(np.isfinite(angles).all(axis=1)))
