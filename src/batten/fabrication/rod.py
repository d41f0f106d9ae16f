"""The rod that is bent: what it bears, what bending it costs, and what the grippers feel."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError
from batten.fabrication.job import RodJob
from batten.fabrication.section import CrossSection
from batten.typing import ArrayLike, FloatArray


class RodLoads(NamedTuple):
    """What the grippers hold: the force (N, the same at both ends) and the bending moments (N·mm, signed as κ)."""

    force_n: float
    moment_start_nmm: float
    moment_end_nmm: float


@dataclass(frozen=True)
class Rod:
    """A straight rod of linear elastic material and constant cross section, bent in a plane.

    A rod of bending stiffness EI in the shape of an elastica in force form carries the constant force EI·(λ₁, λ₂) and the
    bending moment EI·κ (Brander2016 §2.1, eq. 5). The strain of its outermost fibre is |κ|·c with c half the section's
    depth; its energy is ½EI∫κ² ds.

    Parameters:
        length_mm: length between the grippers, above 0.
        section: a `RoundSection`, `TubeSection` or `FlatSection` of `batten.fabrication.section`.
        youngs_modulus_mpa: E in MPa = N/mm², above 0.
        max_strain: greatest strain allowed, pure number, 0 < max_strain < 1.

    Raises:
        InvalidInputError: a value outside these bounds.

    Accuracy: as the elastica's own numbers, 1e-12 relative; `greatest_strain` too, since the places where the curvature is
    greatest are known in closed form.

    Example:
        >>> from batten.fabrication.section import RoundSection
        >>> rod = Rod(length_mm=1000.0, section=RoundSection(3.0), youngs_modulus_mpa=200000.0, max_strain=0.008)
        >>> round(rod.bending_stiffness_nmm2), round(rod.min_radius_mm, 9)
        (795216, 187.5)
        >>> round(float(rod.strain(-1 / 300)), 9)
        0.005
        >>> arc = Elastica((0, 0), 0.0, 1 / 400, (0, 0), 1000.0)
        >>> round(rod.energy_j(arc), 6), rod.greatest_strain(arc)
        (2.485049, 0.00375)
    """

    length_mm: float
    section: CrossSection
    youngs_modulus_mpa: float
    max_strain: float

    def __post_init__(self) -> None:
        for name in ("length_mm", "youngs_modulus_mpa", "max_strain"):
            value = getattr(self, name)
            if not (isinstance(value, int | float) and math.isfinite(value) and value > 0.0):
                raise InvalidInputError(f"a rod's {name} = {value!r}; allowed are finite numbers above 0")
        if not self.max_strain < 1.0:
            raise InvalidInputError(
                f"a rod's max_strain = {self.max_strain!r}; allowed are pure numbers above 0 and below 1; "
                f"write 0.8 % as 0.008"
            )
        if not hasattr(self.section, "second_moment_mm4"):
            raise InvalidInputError(
                f"a rod's section = {self.section!r}; allowed are RoundSection, TubeSection and FlatSection of "
                f"batten.fabrication.section; try RoundSection(3.0)"
            )

    @classmethod
    def of(cls, job: RodJob) -> Rod:
        """The rod that a job describes."""
        return cls(job.length_mm, job.section, job.youngs_modulus_mpa, job.max_strain)

    @property
    def second_moment_mm4(self) -> float:
        """Second moment of area of the cross section about the axis of bending, mm⁴."""
        return self.section.second_moment_mm4

    @property
    def half_depth_mm(self) -> float:
        """Distance of the outermost fibre from the axis of bending, mm."""
        return self.section.half_depth_mm

    @property
    def bending_stiffness_nmm2(self) -> float:
        """EI, N·mm²."""
        return self.youngs_modulus_mpa * self.second_moment_mm4

    @property
    def min_radius_mm(self) -> float:
        """The least radius of curvature at which the strain is `max_strain`, mm."""
        return self.half_depth_mm / self.max_strain

    def strain(self, curvature: ArrayLike) -> FloatArray:
        """Strain |κ|·(half the depth) of the outermost fibre, for curvatures in 1/mm of any shape (…)."""
        return np.abs(np.asarray(curvature, dtype=np.float64)) * self.half_depth_mm

    def greatest_strain(self, elastica: Elastica) -> float:
        """The greatest strain anywhere on the rod in the shape of an elastica in mm; 0 for a straight one."""
        return float(self.strain(greatest_curvature(elastica)))

    def energy_j(self, elastica: Elastica) -> float:
        """Elastic energy ½EI∫κ² ds of the rod in the shape of an elastica in mm, J (1 J = 1000 N·mm)."""
        return 0.5e-3 * self.bending_stiffness_nmm2 * elastica.bending_energy()

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


def greatest_curvature(elastica: Elastica) -> float:
    """The greatest |κ| on an elastica, 1/length.

    κ′ = t × (λ₁, λ₂), so |κ| is greatest at an end or where the tangent t points along the force; there
    κ² = κ(0)² + 4|λ| sin²((θ(0) − φ)/2), φ = arg(λ₁, λ₂), from κ²/2 − t · (λ₁, λ₂) = constant.

    Accuracy: 1e-12 relative to the greatest |κ|, plus 1e-12/length.

    Degenerate: a circle (force 0) has the same everywhere; a line has 0.

    Example:
        >>> wave = Elastica((0, 0), 0.0, 1.0, (1.0, 0.0), 3.0)  # starts at its crest, where κ = 1
        >>> greatest_curvature(wave), greatest_curvature(wave.extended(before=-1.0)) < 1.0
        (1.0, True)
    """
    ends = np.abs(elastica.curvature_at([0.0, elastica.length]))
    size = float(np.hypot(*elastica.force))
    if size > 0.0:
        direction = math.atan2(elastica.force[1], elastica.force[0])
        stations = np.concatenate([[0.0], elastica.inflections(), [elastica.length]])
        turns = (elastica.angle_at(stations) - direction) / (
            2.0 * math.pi
        )  # whole where the tangent is along the force
        low, high = np.minimum(turns[:-1], turns[1:]), np.maximum(turns[:-1], turns[1:])  # θ is monotone in between
        if (np.ceil(low) <= high).any():
            crest = 2.0 * math.sqrt(size) * math.sin(0.5 * (elastica.start_angle - direction))
            return max(math.hypot(elastica.start_curvature, crest), float(ends.max()))
    return float(ends.max())
