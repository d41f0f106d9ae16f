"""Cross sections of a rod: round, tube, flat strip; what bending in a plane needs to know of each."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Protocol

from batten.errors import InvalidInputError


class CrossSection(Protocol):
    """What a rod needs to know of its cross section; every section of this module is one.

    The section is symmetric about the axis that it bends about, so that both outermost fibres lie equally far from it.
    """

    @property
    def area_mm2(self) -> float:
        """Area of the material, mm²."""

    @property
    def second_moment_mm4(self) -> float:
        """Second moment of area I = ∫z² dA about the axis of bending, mm⁴."""

    @property
    def half_depth_mm(self) -> float:
        """Distance of the outermost fibre from the axis of bending, mm; the strain there is |κ| times this."""

    @property
    def description(self) -> str:
        """The section in a few words, as tables and files show it."""

    @property
    def is_round(self) -> bool:
        """Whether the rod may be turned about its own axis without any change."""


@dataclass(frozen=True)
class RoundSection:
    """A solid round section: I = πd⁴/64.

    Parameters:
        diameter_mm: d, finite, above 0.

    Raises:
        InvalidInputError: a diameter outside these bounds.

    Example:
        >>> RoundSection(3.0).description, round(RoundSection(3.0).second_moment_mm4, 6)
        ('round, Ø 3 mm', 3.976078)
    """

    diameter_mm: float

    def __post_init__(self) -> None:
        _check_positive(self, "a round section's")

    @property
    def area_mm2(self) -> float:
        """πd²/4, mm²."""
        return math.pi * self.diameter_mm**2 / 4.0

    @property
    def second_moment_mm4(self) -> float:
        """πd⁴/64, mm⁴."""
        return math.pi * self.diameter_mm**4 / 64.0

    @property
    def half_depth_mm(self) -> float:
        """d/2, mm."""
        return 0.5 * self.diameter_mm

    @property
    def description(self) -> str:
        """ "round, Ø 3 mm"."""
        return f"round, Ø {self.diameter_mm:g} mm"

    @property
    def is_round(self) -> bool:
        """True."""
        return True


@dataclass(frozen=True)
class TubeSection:
    """A round tube of outer diameter d, inner diameter d − 2·wall: I = π(d⁴ − (d − 2·wall)⁴)/64.

    The rod is taken to keep its round section: that the wall of a thin tube buckles or flattens is not looked at.

    Parameters:
        diameter_mm: outer diameter d, finite, above 0.
        wall_mm: thickness of the wall, above 0 and below d/2.

    Raises:
        InvalidInputError: a value outside these bounds.

    Accuracy: 1e-14 relative for any wall, since d⁴ − (d − 2·wall)⁴ is taken as a product without a difference.

    Example:
        >>> TubeSection(10.0, 1.0).description, round(TubeSection(10.0, 1.0).second_moment_mm4, 6)
        ('tube, Ø 10 × 1 mm', 289.811922)
    """

    diameter_mm: float
    wall_mm: float

    def __post_init__(self) -> None:
        _check_positive(self, "a tube's")
        if not 2.0 * self.wall_mm < self.diameter_mm:
            raise InvalidInputError(
                f"a tube's wall_mm = {self.wall_mm:g} with diameter_mm = {self.diameter_mm:g}; allowed are walls above 0 "
                f"and below half the diameter, {0.5 * self.diameter_mm:g}; a solid rod has no wall_mm"
            )

    @property
    def area_mm2(self) -> float:
        """π·wall·(d − wall), mm²."""
        return math.pi * self.wall_mm * (self.diameter_mm - self.wall_mm)

    @property
    def second_moment_mm4(self) -> float:
        """π(d⁴ − (d − 2·wall)⁴)/64 = π/8 · wall (d − wall)(d² + (d − 2·wall)²)/2, mm⁴."""
        inner = self.diameter_mm - 2.0 * self.wall_mm
        return self.area_mm2 * (self.diameter_mm**2 + inner**2) / 16.0

    @property
    def half_depth_mm(self) -> float:
        """d/2, mm."""
        return 0.5 * self.diameter_mm

    @property
    def description(self) -> str:
        """ "tube, Ø 10 × 1 mm"."""
        return f"tube, Ø {self.diameter_mm:g} × {self.wall_mm:g} mm"

    @property
    def is_round(self) -> bool:
        """True."""
        return True


@dataclass(frozen=True)
class FlatSection:
    """A flat strip bent about its weak axis: the thickness lies in the plane of bending, I = width·thickness³/12.

    The width is free to bend across (a narrow strip); a plate is stiffer by up to 1/(1 − ν²), which is not looked at.

    Parameters:
        width_mm: across the plane of bending, finite, above 0.
        thickness_mm: in the plane of bending, above 0 and at most the width.

    Raises:
        InvalidInputError: a value outside these bounds.

    Example:
        >>> FlatSection(20.0, 0.5).description, round(FlatSection(20.0, 0.5).second_moment_mm4, 6)
        ('flat, 20 × 0.5 mm', 0.208333)
    """

    width_mm: float
    thickness_mm: float

    def __post_init__(self) -> None:
        _check_positive(self, "a flat strip's")
        if self.thickness_mm > self.width_mm:
            raise InvalidInputError(
                f"a flat strip's thickness_mm = {self.thickness_mm:g} with width_mm = {self.width_mm:g}; allowed is at most "
                f"the width: a strip bends about its weak axis; try width_mm = {self.thickness_mm:g} and "
                f"thickness_mm = {self.width_mm:g}"
            )

    @property
    def area_mm2(self) -> float:
        """width·thickness, mm²."""
        return self.width_mm * self.thickness_mm

    @property
    def second_moment_mm4(self) -> float:
        """width·thickness³/12, mm⁴."""
        return self.width_mm * self.thickness_mm**3 / 12.0

    @property
    def half_depth_mm(self) -> float:
        """thickness/2, mm."""
        return 0.5 * self.thickness_mm

    @property
    def description(self) -> str:
        """ "flat, 20 × 0.5 mm"."""
        return f"flat, {self.width_mm:g} × {self.thickness_mm:g} mm"

    @property
    def is_round(self) -> bool:
        """False: the strip's width must stay across the plane of bending."""
        return False


def section_of_sizes(
    diameter_mm: float | None = None,
    wall_mm: float | None = None,
    width_mm: float | None = None,
    thickness_mm: float | None = None,
) -> CrossSection:
    """The section that these sizes describe, each None if it is not given.

    Allowed are three combinations: `diameter_mm` alone is a round rod, with `wall_mm` a tube; `width_mm` with `thickness_mm`
    is a flat strip.

    Raises:
        InvalidInputError: another combination, or sizes outside the section's own bounds.

    Example:
        >>> section_of_sizes(diameter_mm=3.0)
        RoundSection(diameter_mm=3.0)
        >>> section_of_sizes(width_mm=20.0, thickness_mm=0.5)
        FlatSection(width_mm=20.0, thickness_mm=0.5)
    """
    if width_mm is None and thickness_mm is None:
        if diameter_mm is not None:
            return RoundSection(diameter_mm) if wall_mm is None else TubeSection(diameter_mm, wall_mm)
    elif width_mm is not None and thickness_mm is not None and diameter_mm is None and wall_mm is None:
        return FlatSection(width_mm, thickness_mm)
    given = {"diameter_mm": diameter_mm, "wall_mm": wall_mm, "width_mm": width_mm, "thickness_mm": thickness_mm}
    came = " and ".join(name for name, value in given.items() if value is not None) or "none of them"
    raise InvalidInputError(
        f"a rod's section needs diameter_mm (round), diameter_mm and wall_mm (tube), or width_mm and thickness_mm (flat "
        f"strip); got {came}; try diameter_mm = 3.0"
    )


def _check_positive(section: RoundSection | TubeSection | FlatSection, whose: str) -> None:
    for field in fields(section):
        value = getattr(section, field.name)
        if isinstance(value, bool) or not (isinstance(value, int | float) and math.isfinite(value) and value > 0.0):
            raise InvalidInputError(f"{whose} {field.name} = {value!r}; allowed are finite numbers above 0; try 3.0")
