"""A job of `batten cut` as validated values: what to cut, from which blocks, with which rod, blade and robots.

Plain data, units in the names (mm, N, N·mm, MPa, s, degrees where a person types them). `batten.io.job.load_job` reads
one from TOML and holds every value inside the bounds documented there; the defaults are stated here and nowhere else.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from batten.fabrication.section import CrossSection, section_of_sizes


@dataclass(frozen=True)
class SurfaceJob:
    """Where the wanted surface comes from: a surface in `file`, or design curves in `curves` that are lofted.

    Attributes:
        file: .3dm file with the surface, absolute; None if `curves` is given. Exactly one of the two is set.
        curves: .3dm file with planar design curves, absolute; None if `file` is given.
        layer: full path of the layer to read from ("Default::design"); None takes every layer.
        scale_mm_per_unit: mm for one unit of the file; None takes the file's own unit, which must then be set.
    """

    file: Path | None = None
    curves: Path | None = None
    layer: str | None = None
    scale_mm_per_unit: float | None = None

    @property
    def source(self) -> Path:
        """The file that is read, whichever of the two it is."""
        path = self.file if self.file is not None else self.curves
        if path is None:
            raise ValueError("a SurfaceJob needs `file` or `curves`; got neither")
        return path


@dataclass(frozen=True)
class BlocksJob:
    """The foam blocks.

    Attributes:
        size_mm: plan size of a block, (along wall x, along wall y), mm.
        direction: which way the blade lies, by the surface's parameters: "u", "v", or "auto" for the better one.
        clearance_mm: foam that stays at least between the cut and the block's top and bottom faces, mm.
        height_mm: height of every block, mm; None lets it follow from the relief and the clearance.
        order: in which the blocks are cut (`batten.fabrication.block_order`).
    """

    size_mm: tuple[float, float] = (600.0, 600.0)
    direction: Literal["u", "v", "auto"] = "auto"
    clearance_mm: float = 30.0
    height_mm: float | None = None
    order: Literal["numbered", "serpentine", "nearest", "shortest"] = "numbered"


@dataclass(frozen=True)
class LeavesJob:
    """The blade's positions and how close they must come.

    Attributes:
        spacing_mm: distance between successive leaves, across the blade, mm.
        tolerance_mm: greatest distance of a rod from the given surface within the block, mm.
        planes: "parallel", all turned by the same angle (Fisker2018 §5.4.3, Solution 1), or "fan", turned about two centres
            beside the wall, most in its middle (Solution 2).
        turn_deg: rotation of the leaves' planes about z in plan, degrees, counter-clockwise; of a fan, that of the plane in
            the middle; "auto" searches the least one, of either sense, that leaves no straight leaf.
        border_turn_deg: size of a fan's turn at the wall's first and last border, degrees, at most that of `turn_deg`;
            "auto" takes 0, or half of `turn_deg` where the leaves on these borders are straight.
        max_turn_between_deg: greatest turn of a rod's end between successive leaves, degrees; where it is more, leaves are
            put between them.
        hold_between: whether the blade must keep the tolerance between the leaves too: moves of border points then change
            gradually from leaf to leaf, and leaves are put between those between which it strays farther.
        max_jump_mm: greatest jump of position between the rods of one leaf at a block border, mm.
        max_jump_deg: greatest jump of tangent there, degrees.
    """

    spacing_mm: float = 20.0
    tolerance_mm: float = 0.5
    planes: Literal["parallel", "fan"] = "parallel"
    turn_deg: float | Literal["auto"] = 0.0
    border_turn_deg: float | Literal["auto"] = "auto"
    max_turn_between_deg: float = 12.0
    hold_between: bool = False
    max_jump_mm: float = 0.01
    max_jump_deg: float = 0.01


@dataclass(frozen=True)
class RodJob:
    """The rod that is bent: a spring-steel rod, round, tube or flat strip; the hot blade itself.

    The section is given by `diameter_mm` (round), `diameter_mm` and `wall_mm` (tube), or `width_mm` and `thickness_mm`
    (flat strip); with none of the four it is a round rod of 3 mm.

    Attributes:
        length_mm: length between the two grippers, mm.
        diameter_mm: of a round rod or, outside, of a tube, mm; None for a flat strip.
        youngs_modulus_mpa: MPa = N/mm².
        max_strain: greatest strain κ·d/2 anywhere on the rod, d its depth in the plane of bending, pure number.
        min_bow_mm: least height of the rod's arc over its chord, mm: a straighter rod may buckle to either side.
        min_stability_margin: least length up to which the rod's own curve, held at both ends, would be stable, over the
            rod's length; at 1 it just ceases to stay in its shape.
        wall_mm: thickness of a tube's wall, mm; None for other sections.
        width_mm: of a flat strip, across the plane of bending, mm; None for other sections.
        thickness_mm: of a flat strip, in the plane of bending, mm; None for other sections.
    """

    length_mm: float = 1000.0
    diameter_mm: float | None = None
    youngs_modulus_mpa: float = 200000.0
    max_strain: float = 0.008
    min_bow_mm: float = 1.0
    min_stability_margin: float = 1.05
    wall_mm: float | None = None
    width_mm: float | None = None
    thickness_mm: float | None = None

    def __post_init__(self) -> None:
        if all(size is None for size in (self.diameter_mm, self.wall_mm, self.width_mm, self.thickness_mm)):
            object.__setattr__(self, "diameter_mm", 3.0)

    @property
    def section(self) -> CrossSection:
        """The rod's cross section; InvalidInputError if the sizes do not make one."""
        return section_of_sizes(self.diameter_mm, self.wall_mm, self.width_mm, self.thickness_mm)


@dataclass(frozen=True)
class BladeJob:
    """How the hot blade melts its way.

    Attributes:
        kerf_mm: width of foam that melts away, mm; half of it lies on either side of the blade. Where `KerfJob` gives a
            law, the width that the speeds are planned for.
        speed_mm_s: speed of the blade's fastest point, mm/s; where `KerfJob` gives a law, on the ways in and out alone.
        max_speed_ratio: greatest ratio of the fastest to the slowest point of the blade between successive leaves.
        approach_mm: distance of the rod from the block's face at the approach and leave positions, mm.
        lead: how the rod, in the shape of its first or last leaf, goes between there and the leaf: "along" the
            continuation of the surface, less steeply where that is not free or not reached, or "level".
    """

    kerf_mm: float = 1.0
    speed_mm_s: float = 20.0
    max_speed_ratio: float = 3.0
    approach_mm: float = 100.0
    lead: Literal["along", "level"] = "along"


@dataclass(frozen=True)
class KerfJob:
    """Which face of the cut is to be the design, and how the kerf follows from the blade's speed.

    The law is a table (`speeds_mm_s`, `widths_mm`) or a formula with its constants; without either the kerf is
    `blade.kerf_mm` at every speed (`batten.fabrication.kerf`).

    Attributes:
        offset: whether the blade runs half the kerf beside the design, so that the face that is left is the design; else
            the blade itself follows the design.
        side: the part of the block that is kept, the lower or the upper one.
        tolerance_mm: greatest difference of the kerf from `blade.kerf_mm` anywhere on the blade, mm.
        min_speed_mm_s: least speed that may be planned for the blade's fastest point, mm/s.
        max_speed_mm_s: greatest such speed, mm/s.
        speeds_mm_s: of the table, ascending, mm/s.
        widths_mm: the kerf at these speeds, mm.
        formula: "a + b / v" or "a * v^-b", mm, v the speed in mm/s.
        a, b: its constants.
    """

    offset: bool = True
    side: Literal["lower", "upper"] = "lower"
    tolerance_mm: float = 0.2
    min_speed_mm_s: float = 1.0
    max_speed_mm_s: float = 100.0
    speeds_mm_s: tuple[float, ...] | None = None
    widths_mm: tuple[float, ...] | None = None
    formula: Literal["a + b / v", "a * v^-b"] | None = None
    a: float | None = None
    b: float | None = None


@dataclass(frozen=True)
class GripperJob:
    """The two grippers, and what they bear.

    Attributes:
        radius_mm: radius of the gripper about its axis, which runs from the flange to the rod's end, mm.
        clearance_mm: least free distance between the gripper's ball around the rod's end and the block, mm.
        max_force_n: greatest force at a gripper, N; None sets no limit.
        max_moment_nmm: greatest bending moment at a gripper, N·mm; None sets no limit.
        position_error_mm: how far a gripper may stand off its place, mm: no such shift may make the rod snap.
        angle_error_deg: how far a gripper may be turned in the rod's plane, degrees: no such turn may make the rod snap.
    """

    radius_mm: float = 40.0
    clearance_mm: float = 20.0
    max_force_n: float | None = None
    max_moment_nmm: float | None = None
    position_error_mm: float = 0.1
    angle_error_deg: float = 0.2


@dataclass(frozen=True)
class KinematicsJob:
    """The seven lengths of a six-axis arm with parallel base and spherical wrist (the OPW convention).

    Attributes:
        a1_mm, a2_mm, b_mm, c1_mm, c2_mm, c3_mm, c4_mm: the seven lengths, mm.
        offsets_deg: the joints' zero offsets, degrees, (6,).
        signs: +1 or −1 for each joint's sense, (6,).
    """

    a1_mm: float
    a2_mm: float
    b_mm: float
    c1_mm: float
    c2_mm: float
    c3_mm: float
    c4_mm: float
    offsets_deg: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    signs: tuple[int, ...] = (1, 1, 1, 1, 1, 1)


@dataclass(frozen=True)
class ArmJob:
    """One robot's own values; None everywhere means the preset's.

    Attributes:
        base_mm: origin of the robot's base in the cell, mm, (3,).
        base_deg: rotation of the base about the cell's x, then y, then z axis (all fixed), degrees, (3,).
        tool_mm: tool centre point (the rod's end in the gripper) in the flange frame, mm, (3,).
        tool_deg: rotation of the tool in the flange frame, same convention, degrees, (3,).
        joint_min_deg: least angle of each joint, degrees, (6,).
        joint_max_deg: greatest angle of each joint, degrees, (6,).
        kinematics: the arm's lengths.
        link_radii_mm: radii of the capsules around base, shoulder, upper arm, elbow, forearm and wrist, mm, (6,).
    """

    base_mm: tuple[float, float, float] | None = None
    base_deg: tuple[float, float, float] | None = None
    tool_mm: tuple[float, float, float] | None = None
    tool_deg: tuple[float, float, float] | None = None
    joint_min_deg: tuple[float, ...] | None = None
    joint_max_deg: tuple[float, ...] | None = None
    kinematics: KinematicsJob | None = None
    link_radii_mm: tuple[float, ...] | None = None


@dataclass(frozen=True)
class CellJob:
    """The robot cell: a preset, and own values over it.

    Attributes:
        preset: name of a cell that batten knows.
        block_mm: origin of the block's work frame (centre of its bottom face) in the cell, mm; None: the preset's.
        block_deg: rotation of the work frame about the cell's z axis, degrees; None: the preset's.
        min_joint_margin_deg: least distance of every joint from its limits, degrees.
        min_reach_margin_mm: least distance of the wrist from the end of its reach, mm.
        min_singularity: least measure of distance from a singularity, pure number from 0 (singular) to 1.
        min_clearance_mm: least free distance between arms, grippers, rod, block, table and floor, mm.
        table_mm: plan size of the table, along the blade and across it, centred under the block, mm; None: the block's own.
        left: own values of the left arm (the one at the rod's start).
        right: own values of the right arm.
    """

    preset: str = "two-irb6620"
    block_mm: tuple[float, float, float] | None = None
    block_deg: float | None = None
    min_joint_margin_deg: float = 5.0
    min_reach_margin_mm: float = 20.0
    min_singularity: float = 0.05
    min_clearance_mm: float = 10.0
    table_mm: tuple[float, float] | None = None
    left: ArmJob = field(default_factory=ArmJob)
    right: ArmJob = field(default_factory=ArmJob)


@dataclass(frozen=True)
class CutJob:
    """A whole job; `name` heads the report and names the RAPID modules, `path` is the job file it came from."""

    surface: SurfaceJob
    name: str = "cut"
    path: Path | None = None
    blocks: BlocksJob = field(default_factory=BlocksJob)
    leaves: LeavesJob = field(default_factory=LeavesJob)
    rod: RodJob = field(default_factory=RodJob)
    blade: BladeJob = field(default_factory=BladeJob)
    kerf: KerfJob = field(default_factory=KerfJob)
    gripper: GripperJob = field(default_factory=GripperJob)
    cell: CellJob = field(default_factory=CellJob)
