"""The fields of a job file: names, bounds, meaning and an example for each. docs/job-file.md is made from them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from batten.fabrication import job as plain
from batten.fabrication.kerf import kerf_law
from batten.fabrication.section import section_of_sizes
from batten.io.cell_fields import CellSection
from batten.io.job_section import Pair, Section

Speeds = Annotated[
    tuple[Annotated[float, Field(gt=0.0, le=1000.0)], ...], Field(strict=False, min_length=2, max_length=100)
]
Widths = Annotated[
    tuple[Annotated[float, Field(ge=0.0, le=50.0)], ...], Field(strict=False, min_length=2, max_length=100)
]


class SurfaceSection(Section):
    """The wanted surface: exactly one of `file` and `curves`."""

    file: str | None = Field(
        default=None,
        min_length=1,
        description="Rhino file with the surface, relative to the job file.",
        examples=["wall.3dm"],
    )
    curves: str | None = Field(
        default=None,
        min_length=1,
        description="Instead of `file`: Rhino file with planar design curves to be lofted, relative to the job file.",
        examples=["design.3dm"],
    )
    layer: str | None = Field(
        default=None,
        min_length=1,
        description="Full path of the layer to read from, `Parent::Child`; without it, every layer is read.",
        examples=["design"],
    )
    scale_mm_per_unit: float | None = Field(
        default=None,
        gt=0.0,
        le=1.0e6,
        description="Millimetres for one unit of the file; without it, the file's own unit, which must then be set.",
        examples=[1.0],
    )

    @model_validator(mode="after")
    def _one_source(self) -> SurfaceSection:
        if (self.file is None) == (self.curves is None):
            came = "both" if self.file is not None else "neither"
            raise ValueError(f'needs exactly one of `file` and `curves`, got {came}; try file = "wall.3dm"')
        return self


class BlocksSection(Section):
    """The foam blocks."""

    size_mm: Pair = Field(description="Plan size of a block along the wall's x and y.", examples=[[600.0, 600.0]])
    direction: Literal["u", "v", "auto"] = Field(
        default=plain.BlocksJob.direction,
        description="Which way the blade lies, by the surface's parameters; `auto` takes the better one and says why.",
        examples=["auto"],
    )
    clearance_mm: float = Field(
        default=plain.BlocksJob.clearance_mm,
        ge=0.0,
        le=5000.0,
        description="Foam that stays at least between the cut and the block's top and bottom.",
        examples=[30.0],
    )
    height_mm: float | None = Field(
        default=plain.BlocksJob.height_mm,
        gt=0.0,
        le=10000.0,
        description="Height of every block; without it, it follows from the relief and the clearance.",
        examples=[500.0],
    )
    order: Literal["numbered", "serpentine", "nearest", "shortest"] = Field(
        default=plain.BlocksJob.order,
        description="In which order the blocks are cut: as they are `numbered`, row by row there and back (`serpentine`), "
        "each time the one whose first leaf is `nearest`, or on the `shortest` way of the grippers that is found.",
        examples=["shortest"],
    )


class LeavesSection(Section):
    """The blade's positions, and how close they must come."""

    spacing_mm: float = Field(
        gt=0.0, le=10000.0, description="Distance between successive blade positions.", examples=[20.0]
    )
    tolerance_mm: float = Field(
        gt=0.0, le=1000.0, description="Greatest distance of a rod from the surface, inside its block.", examples=[0.5]
    )
    planes: Literal["parallel", "fan"] = Field(
        default=plain.LeavesJob.planes,
        description="`parallel`: all turned by `turn_deg`; `fan`: turned about two centres beside the wall, by `turn_deg` "
        "in its middle and less towards its borders.",
        examples=["parallel"],
    )
    turn_deg: Annotated[float, Field(ge=-90.0, le=90.0)] | Literal["auto"] = Field(
        default=plain.LeavesJob.turn_deg,
        description="Turns the leaves' planes in plan, counter-clockwise; `auto` searches the least turn that "
        "leaves no straight leaf.",
        examples=[0.0],
    )
    border_turn_deg: Annotated[float, Field(ge=0.0, le=90.0)] | Literal["auto"] = Field(
        default=plain.LeavesJob.border_turn_deg,
        description="Of a fan, the size of the turn at the wall's first and last border, at most that of `turn_deg`; `auto` "
        "takes 0, or half of `turn_deg` where the leaves there are straight.",
        examples=["auto"],
    )
    max_turn_between_deg: float = Field(
        default=plain.LeavesJob.max_turn_between_deg,
        gt=0.5,
        le=90.0,
        description="Greatest turn of a rod's end between successive leaves; where it is more, leaves are put between them.",
        examples=[12.0],
    )
    hold_between: bool = Field(
        default=plain.LeavesJob.hold_between,
        description="Whether the blade must keep the tolerance between the leaves too, where the robots move the rod's ends "
        "along straight lines: moves of border points then change gradually from leaf to leaf, and leaves are put between "
        "those between which it strays farther.",
        examples=[True],
    )
    max_jump_mm: float = Field(
        default=plain.LeavesJob.max_jump_mm,
        gt=0.0,
        le=100.0,
        description="Greatest jump of position between the rods of a leaf at a block border.",
        examples=[0.01],
    )
    max_jump_deg: float = Field(
        default=plain.LeavesJob.max_jump_deg,
        gt=0.0,
        le=90.0,
        description="Greatest jump of the tangent there.",
        examples=[0.01],
    )


class RodSection(Section):
    """The rod that is bent: round (`diameter_mm`), a tube (with `wall_mm`), or flat (`width_mm` and `thickness_mm`)."""

    length_mm: float = Field(gt=0.0, le=20000.0, description="Length between the two grippers.", examples=[1000.0])
    diameter_mm: float | None = Field(
        default=plain.RodJob.diameter_mm,
        gt=0.0,
        le=100.0,
        description="Diameter of a round rod, outer diameter of a tube; not for a flat strip.",
        examples=[3.0],
    )
    wall_mm: float | None = Field(
        default=plain.RodJob.wall_mm,
        gt=0.0,
        lt=50.0,
        description="Thickness of a tube's wall, below half the diameter; without it, the rod is solid.",
        examples=[0.5],
    )
    width_mm: float | None = Field(
        default=plain.RodJob.width_mm,
        gt=0.0,
        le=2000.0,
        description="Instead of `diameter_mm`: width of a flat strip, across the plane in which it bends.",
        examples=[20.0],
    )
    thickness_mm: float | None = Field(
        default=plain.RodJob.thickness_mm,
        gt=0.0,
        le=100.0,
        description="With `width_mm`: thickness of the flat strip, in the plane in which it bends; at most its width.",
        examples=[0.5],
    )
    youngs_modulus_mpa: float = Field(
        ge=1.0,
        le=2.0e6,
        description="Young's modulus, MPa = N/mm²; spring steel has about 200000.",
        examples=[200000.0],
    )
    max_strain: float = Field(
        gt=0.0,
        le=0.1,
        description="Greatest strain κ·d/2 anywhere on the rod, d its diameter or thickness (0.008 is 0.8 %).",
        examples=[0.008],
    )
    min_bow_mm: float = Field(
        default=plain.RodJob.min_bow_mm,
        ge=0.0,
        le=1000.0,
        description="Least height of the rod's arc over its chord; a straighter rod may snap to either side.",
        examples=[1.0],
    )
    min_stability_margin: float = Field(
        default=plain.RodJob.min_stability_margin,
        ge=1.0,
        le=100.0,
        description="Least length up to which the rod's curve, held at both ends, would be stable, over the rod's length; "
        "below 1 a rod does not stay in its shape.",
        examples=[1.05],
    )

    @model_validator(mode="after")
    def _one_section(self) -> RodSection:
        section_of_sizes(self.diameter_mm, self.wall_mm, self.width_mm, self.thickness_mm)  # its error is a ValueError
        return self


class BladeSection(Section):
    """How the hot blade melts its way."""

    kerf_mm: float = Field(
        ge=0.0,
        le=50.0,
        description="Width of foam that melts away, half of it on either side; where `[kerf]` says how it follows from the "
        "speed, the width that the speeds are planned for.",
        examples=[1.0],
    )
    speed_mm_s: float = Field(
        gt=0.0,
        le=1000.0,
        description="Speed of the blade's fastest point; where `[kerf]` says how the kerf follows from it, on the ways in "
        "and out alone, and the kerf there must be near `kerf_mm`.",
        examples=[20.0],
    )
    max_speed_ratio: float = Field(
        default=plain.BladeJob.max_speed_ratio,
        ge=1.0,
        le=1000.0,
        description="Greatest ratio of the fastest to the slowest point of the blade between successive leaves.",
        examples=[3.0],
    )
    approach_mm: float = Field(
        default=plain.BladeJob.approach_mm,
        gt=0.0,
        le=5000.0,
        description="Distance of the rod from the block's face at the approach and leave positions.",
        examples=[100.0],
    )
    lead: Literal["along", "level"] = Field(
        default=plain.BladeJob.lead,
        description="How the rod goes between there and the first or last leaf, in that leaf's shape: `along` the "
        "continuation of the surface, less steeply where that is not free, or `level`.",
        examples=["along"],
    )


class KerfSection(Section):
    """Which face of the cut is the design, and how the kerf follows from speed: by a table, by a formula, or not at all."""

    offset: bool = Field(
        default=plain.KerfJob.offset,
        description="Whether the blade runs half the kerf beside the design, so that the face that is left is the design; "
        "else the blade itself follows the design.",
        examples=[True],
    )
    side: Literal["lower", "upper"] = Field(
        default=plain.KerfJob.side, description="The part of the block that is kept.", examples=["lower"]
    )
    tolerance_mm: float = Field(
        default=plain.KerfJob.tolerance_mm,
        gt=0.0,
        le=50.0,
        description="Greatest difference of the kerf from `blade.kerf_mm` anywhere on the blade.",
        examples=[0.2],
    )
    min_speed_mm_s: float = Field(
        default=plain.KerfJob.min_speed_mm_s,
        gt=0.0,
        le=1000.0,
        description="Least speed that may be planned for the blade's fastest point.",
        examples=[1.0],
    )
    max_speed_mm_s: float = Field(
        default=plain.KerfJob.max_speed_mm_s,
        gt=0.0,
        le=1000.0,
        description="Greatest such speed, above the least.",
        examples=[100.0],
    )
    speeds_mm_s: Speeds | None = Field(
        default=plain.KerfJob.speeds_mm_s,
        description="Of a table of measured kerfs, ascending. Outside these speeds the kerf counts as unknown.",
        examples=[[5.0, 10.0, 20.0, 40.0]],
    )
    widths_mm: Widths | None = Field(
        default=plain.KerfJob.widths_mm,
        description="The kerf at each of `speeds_mm_s`, descending; between them monotone cubics.",
        examples=[[2.8, 1.6, 1.0, 0.7]],
    )
    formula: Literal["a + b / v", "a * v^-b"] | None = Field(
        default=plain.KerfJob.formula,
        description="Instead of a table: the kerf in mm, v the speed in mm/s.",
        examples=["a + b / v"],
    )
    a: float | None = Field(
        default=plain.KerfJob.a,
        ge=0.0,
        le=1000.0,
        description="First constant of `formula`: mm; for `a * v^-b` the kerf at 1 mm/s.",
        examples=[0.4],
    )
    b: float | None = Field(
        default=plain.KerfJob.b,
        gt=0.0,
        le=1.0e5,
        description="Second constant of `formula`: mm²/s, or the exponent.",
        examples=[12.0],
    )

    @model_validator(mode="after")
    def _one_law(self) -> KerfSection:
        kerf_law(plain.KerfJob(**dict(self)))  # its error is a ValueError
        return self


class GripperSection(Section):
    """The grippers."""

    radius_mm: float = Field(
        default=plain.GripperJob.radius_mm,
        ge=0.0,
        le=2000.0,
        description="Radius of the gripper about its axis, from the flange to the rod's end.",
        examples=[40.0],
    )
    clearance_mm: float = Field(
        default=plain.GripperJob.clearance_mm,
        ge=0.0,
        le=2000.0,
        description="Least free distance between the gripper's ball about the rod's end and the block.",
        examples=[20.0],
    )
    max_force_n: float | None = Field(
        default=plain.GripperJob.max_force_n,
        gt=0.0,
        le=1.0e6,
        description="Greatest force at a gripper; without it, forces are reported and not limited.",
        examples=[200.0],
    )
    max_moment_nmm: float | None = Field(
        default=plain.GripperJob.max_moment_nmm,
        gt=0.0,
        le=1.0e9,
        description="Greatest bending moment at a gripper; without it, moments are reported and not limited.",
        examples=[50000.0],
    )
    position_error_mm: float = Field(
        default=plain.GripperJob.position_error_mm,
        ge=0.0,
        le=100.0,
        description="How far a gripper may stand off its place; no such shift may make the rod snap.",
        examples=[0.1],
    )
    angle_error_deg: float = Field(
        default=plain.GripperJob.angle_error_deg,
        ge=0.0,
        le=45.0,
        description="How far a gripper may be turned in the rod's plane; no such turn may make the rod snap.",
        examples=[0.2],
    )


class JobFile(Section):
    """A whole job file."""

    name: str | None = Field(
        default=None,
        min_length=1,
        max_length=60,
        pattern=r"^[^\x00-\x1f\x7f]+$",
        description="Heads the report; without it, the job file's own name.",
        examples=["north wall"],
    )
    surface: SurfaceSection = Field(description="The wanted surface.")
    blocks: BlocksSection = Field(description="The foam blocks.")
    leaves: LeavesSection = Field(description="The blade's positions.")
    rod: RodSection = Field(description="The rod.")
    blade: BladeSection = Field(description="The blade.")
    kerf: KerfSection = Field(default_factory=KerfSection, description="The kerf.")
    gripper: GripperSection = Field(default_factory=GripperSection, description="The grippers.")
    cell: CellSection = Field(description="The robot cell.")
