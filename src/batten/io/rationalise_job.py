"""Job files of `batten rationalise`: TOML in, a validated `RationaliseJob` out, in the words of `batten.io.job`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from batten.errors import InvalidInputError
from batten.fabrication import rationalise_job as plain
from batten.fabrication.job import GripperJob, RodJob
from batten.fabrication.rationalise_job import RationaliseJob
from batten.io.cell_fields import CellSection
from batten.io.job import read_toml, validated
from batten.io.job_fields import BladeSection, GripperSection, KerfSection, RodSection
from batten.io.job_section import Pair, Section

_WORKSHOP = ("rod", "blade", "kerf", "gripper", "cell")


class FacesSection(Section):
    """The wanted faces."""

    file: str = Field(
        min_length=1,
        description="Rhino, STEP or IGES file with the faces, relative to the job file.",
        examples=["teapot.3dm"],
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
    names: Annotated[tuple[str, ...], Field(strict=False, min_length=1, max_length=1000)] | None = Field(
        default=None,
        description="Names of the faces to take; without it, all of them.",
        examples=[["upper"]],
    )


class GreatestBlocksSection(Section):
    """The greatest foam block."""

    greatest_mm: Pair = Field(
        description="Greatest plan size of a block, along the blade and across it.", examples=[[900.0, 600.0]]
    )
    clearance_mm: float = Field(
        default=plain.GreatestBlocksJob.clearance_mm,
        ge=0.0,
        le=5000.0,
        description="Foam that stays at least between the cut and the block's top and bottom.",
        examples=[30.0],
    )


class PatchLeavesSection(Section):
    """The blade's positions, and how close they must come."""

    spacing_mm: float = Field(
        gt=0.0, le=10000.0, description="Greatest distance between successive blade positions.", examples=[20.0]
    )
    tolerance_mm: float = Field(
        gt=0.0, le=1000.0, description="Greatest distance of the cut from the faces.", examples=[0.5]
    )
    direction_deg: Annotated[float, Field(ge=-360.0, le=360.0)] | Literal["auto"] = Field(
        default=plain.PatchLeavesJob.direction_deg,
        description="Direction of the blocks in each patch's plan, counter-clockwise from the way the face's u runs; "
        "`auto` searches the one that needs the fewest blocks.",
        examples=["auto"],
    )
    turn_deg: Annotated[float, Field(ge=-30.0, le=30.0)] | Literal["auto"] = Field(
        default=plain.PatchLeavesJob.turn_deg,
        description="Turns the leaves' planes against the blocks; `auto` searches the least turn without a straight rod.",
        examples=["auto"],
    )


class PatchesSection(Section):
    """How faces become patches."""

    greatest_spread_deg: float = Field(
        default=plain.PatchesJob.greatest_spread_deg,
        gt=5.0,
        le=85.0,
        description="Greatest angle between a patch's normals and its own upright; a face that exceeds it is divided.",
        examples=[70.0],
    )


class RationaliseFile(Section):
    """A whole job file of `batten rationalise`; the last five sections are those of `batten cut`."""

    name: str | None = Field(
        default=None,
        min_length=1,
        max_length=60,
        pattern=r"^[^\x00-\x1f\x7f]+$",
        description="Heads the report; without it, the job file's own name.",
        examples=["teapot"],
    )
    faces: FacesSection = Field(description="The wanted faces.")
    blocks: GreatestBlocksSection = Field(description="The greatest foam block.")
    leaves: PatchLeavesSection = Field(description="The blade's positions.")
    patches: PatchesSection = Field(default_factory=PatchesSection, description="How faces become patches.")
    rod: RodSection = Field(description="The rod.")
    blade: BladeSection = Field(description="The blade.")
    kerf: KerfSection = Field(default_factory=KerfSection, description="The kerf.")
    gripper: GripperSection = Field(default_factory=GripperSection, description="The grippers.")
    cell: CellSection = Field(description="The robot cell.")


def load_rationalise_job(path: str | Path) -> RationaliseJob:
    """Read a job file of `batten rationalise`.

    Parameters:
        path: the TOML file. Paths inside it are relative to its own folder.

    Returns:
        The job, every value inside its bounds, its paths absolute.

    Raises:
        FormatError: no TOML, an unknown field, a missing field. The message is one line: file, line, field, what came,
            what is allowed, what to try.
        InvalidInputError: a value outside its bounds, values that contradict each other, a file that is not there.
    """
    path = Path(path)
    text, data = read_toml(path, "a job file", "examples/rationalise/teapot.toml")
    model = validated(RationaliseFile, data, path, text)
    job = RationaliseJob(
        name=model.name if model.name is not None else path.stem,
        path=path.resolve(),
        faces=plain.FacesJob(**(dict(model.faces) | {"file": path.resolve().parent / model.faces.file})),
        blocks=plain.GreatestBlocksJob(**dict(model.blocks)),
        leaves=plain.PatchLeavesJob(**dict(model.leaves)),
        patches=plain.PatchesJob(**dict(model.patches)),
        rod=RodJob(**dict(model.rod)),
        gripper=GripperJob(**dict(model.gripper)),
        workshop={key: data[key] for key in _WORKSHOP if key in data},
    )
    _hold_together(job, path)
    return job


def _hold_together(job: RationaliseJob, path: Path) -> None:
    """What no single field can tell."""
    if not job.faces.file.is_file():
        raise InvalidInputError(
            f"{path}: faces.file = {job.faces.file}: no such file; the path is relative to the job file"
        )
    room = 2.0 * (job.gripper.radius_mm + job.gripper.clearance_mm)
    if job.rod.length_mm <= room:
        raise InvalidInputError(
            f"{path}: rod.length_mm = {job.rod.length_mm:g}: both grippers, with their clearance, take {room:g} mm of it; "
            f"try {job.blocks.greatest_mm[0] + 2.0 * room:g}"
        )
    if job.leaves.spacing_mm > min(job.blocks.greatest_mm):
        raise InvalidInputError(
            f"{path}: leaves.spacing_mm = {job.leaves.spacing_mm:g}: must be at most the block's "
            f"{min(job.blocks.greatest_mm):g} mm; try {min(job.blocks.greatest_mm) / 30.0:g}"
        )
