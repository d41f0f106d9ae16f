"""The fields of a job file's `[cell]`: names, bounds, meaning and an example for each."""

from __future__ import annotations

from pydantic import Field, model_validator

from batten.fabrication import job as plain
from batten.io.job_section import Pair, Section, SixAngles, SixLengths, SixSigns, Vector


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

    link_radii_mm: SixLengths | None = Field(
        default=None,
        description="Radii that hold base, shoulder, upper arm, elbow, forearm and wrist, about the axes of the links.",
        examples=[[350.0, 300.0, 180.0, 250.0, 150.0, 130.0]],
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
    min_clearance_mm: float = Field(
        default=plain.CellJob.min_clearance_mm,
        ge=0.0,
        le=1000.0,
        description="Least free distance between arms, grippers, rod, block, table and floor, on the ways too.",
        examples=[10.0],
    )
    table_mm: Pair | None = Field(
        default=plain.CellJob.table_mm,
        description="Plan size of the table, along the blade and across it, centred under the block; else the block's own.",
        examples=[[700.0, 700.0]],
    )
    left: ArmSection = Field(default_factory=ArmSection, description="The arm at the rod's start.")
    right: ArmSection = Field(default_factory=ArmSection, description="The arm at the rod's end.")
