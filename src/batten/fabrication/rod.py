"""The round solid rod that is bent: what it bears, and what the grippers feel."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError
from batten.fabrication.job import RodJob
from batten.typing import ArrayLike, FloatArray


class RodLoads(NamedTuple):
    """What the grippers hold: the force (N, the same at both ends) and the bending moments (N·mm, signed as κ)."""

    force_n: float
    moment_start_nmm: float
    moment_end_nmm: float


@dataclass(frozen=True)
class Rod:
    """A straight round solid rod of linear elastic material, bent in a plane.

    A rod of bending stiffness EI in the shape of an elastica in force form carries the constant force EI·(λ₁, λ₂) and the
    bending moment EI·κ (Brander2016 §2.1, eq. 5). The strain of its outermost fibre is |κ|·d/2.

    Parameters:
        length_mm: length between the grippers, above 0.
        diameter_mm: above 0.
        youngs_modulus_mpa: E in MPa = N/mm², above 0.
        max_strain: greatest strain allowed, pure number, 0 < max_strain < 1.

    Raises:
        InvalidInputError: a value outside these bounds.

    Example:
        >>> rod = Rod(length_mm=1000.0, diameter_mm=3.0, youngs_modulus_mpa=200000.0, max_strain=0.008)
        >>> round(rod.bending_stiffness_nmm2), round(rod.min_radius_mm, 9)
        (795216, 187.5)
        >>> round(float(rod.strain(-1 / 300)), 9)
        0.005
    """

    length_mm: float
    diameter_mm: float
    youngs_modulus_mpa: float
    max_strain: float

    def __post_init__(self) -> None:
        for name in ("length_mm", "diameter_mm", "youngs_modulus_mpa", "max_strain"):
            value = getattr(self, name)
            if not (isinstance(value, int | float) and math.isfinite(value) and value > 0.0):
                raise InvalidInputError(f"a rod's {name} = {value!r}; allowed are finite numbers above 0")
        if not self.max_strain < 1.0:
            raise InvalidInputError(
                f"a rod's max_strain = {self.max_strain!r}; allowed are pure numbers above 0 and below 1; "
                f"write 0.8 % as 0.008"
            )

    @classmethod
    def of(cls, job: RodJob) -> Rod:
        """The rod that a job describes."""
        return cls(job.length_mm, job.diameter_mm, job.youngs_modulus_mpa, job.max_strain)

    @property
    def second_moment_mm4(self) -> float:
        """Second moment of area of the cross section, I = πd⁴/64, mm⁴."""
        return math.pi * self.diameter_mm**4 / 64.0

    @property
    def bending_stiffness_nmm2(self) -> float:
        """EI, N·mm²."""
        return self.youngs_modulus_mpa * self.second_moment_mm4

    @property
    def min_radius_mm(self) -> float:
        """The least radius of curvature at which the strain is `max_strain`, mm."""
        return 0.5 * self.diameter_mm / self.max_strain

    def strain(self, curvature: ArrayLike) -> FloatArray:
        """Strain |κ|·d/2 of the outermost fibre, for curvatures in 1/mm of any shape (…)."""
        return np.abs(np.asarray(curvature, dtype=np.float64)) * (0.5 * self.diameter_mm)

    def force_n(self, force: ArrayLike) -> FloatArray:
        """Size of the rod's inner force, EI·|(λ₁, λ₂)|, N; `force` is an elastica's, (…, 2) in 1/mm²; shape (…)."""
        f = np.asarray(force, dtype=np.float64)
        if f.shape[-1:] != (2,):
            raise InvalidInputError(f"force: got shape {f.shape}; allowed is (…, 2), an elastica's (λ₁, λ₂)")
        return self.bending_stiffness_nmm2 * np.hypot(f[..., 0], f[..., 1])

    def moment_nmm(self, curvature: ArrayLike) -> FloatArray:
        """Bending moment EI·κ, N·mm, signed as κ, for curvatures in 1/mm of any shape (…)."""
        return self.bending_stiffness_nmm2 * np.asarray(curvature, dtype=np.float64)

    def loads(self, elastica: Elastica) -> RodLoads:
        """What the grippers at both ends of an elastica in mm hold.

        Degenerate: along a straight rod the force is not determined by the shape; the one stored in the elastica counts.
        """
        moments = self.moment_nmm(elastica.curvature_at([0.0, elastica.length]))
        return RodLoads(float(self.force_n(elastica.force)), float(moments[0]), float(moments[1]))
