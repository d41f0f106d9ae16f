"""The fields of a job file: names, bounds, meaning and an example for each. docs/job-file.md is made from them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from batten.fabrication import job as plain
from batten.fabrication.section import section_of_sizes

# TOML knows lists only, so a fixed number of values must be allowed to come as one; the values themselves stay strict.
Length = Annotated[float, Field(gt=0.0, le=10000.0)]
Angle = Annotated[float, Field(ge=-720.0, le=720.0)]
Pair = Annotated[tuple[Length, Length], Field(strict=False)]
Vector = Annotated[tuple[float, float, float], Field(strict=False)]
SixAngles = Annotated[tuple[Angle, ...], Field(strict=False, min_length=6, max_length=6)]
SixSigns = Annotated[tuple[Literal[-1, 1], ...], Field(strict=False, min_length=6, max_length=6)]


class Section(BaseModel):
    """What every part of a job file shares: no unknown fields, no NaN, no text where a number belongs."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


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


class LeavesSection(Section):
    """The blade's positions, and how close they must come."""

    spacing_mm: float = Field(
        gt=0.0, le=10000.0, description="Distance between successive blade positions.", examples=[20.0]
    )
    tolerance_mm: float = Field(
        gt=0.0, le=1000.0, description="Greatest distance of a rod from the surface, inside its block.", examples=[0.5]
    )
    turn_deg: Annotated[float, Field(ge=-90.0, le=90.0)] | Literal["auto"] = Field(
        default=plain.LeavesJob.turn_deg,
        description="Turns the leaves' planes in plan, counter-clockwise; `auto` searches the least turn that "
        "leaves no straight leaf.",
        examples=[0.0],
    )
    max_turn_between_deg: float = Field(
        default=plain.LeavesJob.max_turn_between_deg,
        gt=0.5,
        le=90.0,
        description="Greatest turn of a rod's end between successive leaves; where it is more, leaves are put between them.",
        examples=[12.0],
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
        ge=0.0, le=50.0, description="Width of foam that melts away, half of it on either side.", examples=[1.0]
    )
    speed_mm_s: float = Field(gt=0.0, le=1000.0, description="Speed of the blade's fastest point.", examples=[20.0])
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
        description="Distance of the approach and leave positions from the block.",
        examples=[100.0],
    )


class GripperSection(Section):
    """The grippers."""

    radius_mm: float = Field(
        default=plain.GripperJob.radius_mm,
        ge=0.0,
        le=2000.0,
        description="Radius of the ball about the rod's end that holds the whole gripper.",
        examples=[40.0],
    )
    clearance_mm: float = Field(
        default=plain.GripperJob.clearance_mm,
        ge=0.0,
        le=2000.0,
        description="Least free distance between that ball and the block.",
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


class KinematicsSection(Section):
    """The lengths of a six-axis arm with spherical wrist, in the OPW convention."""

    a1_mm: float = Field(ge=-10000.0, le=10000.0, description="From axis 1 to axis 2, across.", examples=[320.0])
    a2_mm: float = Field(ge=-10000.0, le=10000.0, description="From axis 3 to axis 4, across.", examples=[-200.0])
    b_mm: float = Field(ge=-10000.0, le=10000.0, description="Sideways offset of the arm.", examples=[0.0])
    c1_mm: float = Field(ge=0.0, le=10000.0, description="Height of axis 2 over the base.", examples=[680.0])
    c2_mm: float = Field(gt=0.0, le=10000.0, description="From axis 2 to axis 3.", examples=[975.0])
    c3_mm: float = Field(gt=0.0, le=10000.0, description="From axis 3 to the wrist's centre.", examples=[887.0])
    c4_mm: float = Field(ge=0.0, le=10000.0, description="From the wrist's centre to the flange.", examples=[200.0])
    offsets_deg: SixAngles = Field(
        default=(0.0,) * 6, description="Zero offsets of the six joints.", examples=[[0.0, 0.0, -90.0, 0.0, 0.0, 0.0]]
    )
    signs: SixSigns = Field(default=(1,) * 6, description="Sense of the six joints.", examples=[[1, 1, 1, 1, 1, 1]])


class ArmSection(Section):
    """One arm's own values; what is absent comes from the preset."""

    base_mm: Vector | None = Field(
        default=None, description="The robot base's origin in the cell.", examples=[[-1800.0, 0.0, 0.0]]
    )
    base_deg: Vector | None = Field(
        default=None,
        description="Rotation of the base about the cell's fixed x, y and z, in this order.",
        examples=[[0, 0, 90]],
    )
    tool_mm: Vector | None = Field(
        default=None, description="The rod's end in the gripper, seen from the flange.", examples=[[0.0, 0.0, 250.0]]
    )
    tool_deg: Vector | None = Field(
        default=None,
        description="Rotation of the tool, seen from the flange, as `base_deg`.",
        examples=[[0.0, 0.0, 0.0]],
    )
    joint_min_deg: SixAngles | None = Field(
        default=None, description="Least angle of every joint.", examples=[[-170, -65, -180, -300, -130, -300]]
    )
    joint_max_deg: SixAngles | None = Field(
        default=None, description="Greatest angle of every joint.", examples=[[170, 140, 70, 300, 130, 300]]
    )
    kinematics: KinematicsSection | None = Field(
        default=None, description="The arm's lengths, as a section of its own."
    )

    @model_validator(mode="after")
    def _limits_in_order(self) -> ArmSection:
        for joint, (low, high) in enumerate(zip(self.joint_min_deg or (), self.joint_max_deg or ()), start=1):
            if not low < high:
                raise ValueError(
                    f"joint {joint} has limits {low:g} … {high:g}; joint_min_deg must be below joint_max_deg"
                )
        return self


class CellSection(Section):
    """The robot cell: a preset, and own values over it."""

    preset: str = Field(min_length=1, description="Name of a cell that batten knows.", examples=["two-irb6620"])
    block_mm: Vector | None = Field(
        default=None,
        description="Centre of the block's bottom face in the cell; else the preset's.",
        examples=[[0.0, 0.0, 600.0]],
    )
    block_deg: float | None = Field(
        default=None,
        ge=-360.0,
        le=360.0,
        description="Rotation of the block about the cell's z; else the preset's.",
        examples=[0.0],
    )
    min_joint_margin_deg: float = Field(
        default=plain.CellJob.min_joint_margin_deg,
        ge=0.0,
        le=180.0,
        description="Least distance of every joint from its limits.",
        examples=[5.0],
    )
    min_reach_margin_mm: float = Field(
        default=plain.CellJob.min_reach_margin_mm,
        ge=0.0,
        le=5000.0,
        description="Least distance of the wrist from the end of its reach.",
        examples=[20.0],
    )
    min_singularity: float = Field(
        default=plain.CellJob.min_singularity,
        ge=0.0,
        lt=1.0,
        description="Least distance from a singularity, from 0 (singular) to 1.",
        examples=[0.05],
    )
    left: ArmSection = Field(default_factory=ArmSection, description="The arm at the rod's start.")
    right: ArmSection = Field(default_factory=ArmSection, description="The arm at the rod's end.")


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
    gripper: GripperSection = Field(default_factory=GripperSection, description="The grippers.")
    cell: CellSection = Field(description="The robot cell.")
