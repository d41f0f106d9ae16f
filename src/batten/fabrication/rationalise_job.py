"""A job of `batten rationalise` as validated values: which faces, into what blocks, how close, with which rod."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from batten.fabrication.job import GripperJob, RodJob


@dataclass(frozen=True)
class FacesJob:
    """Where the faces come from.

    Attributes:
        file: .3dm, STEP or IGES file, absolute.
        layer: full path of the layer to read from; None takes every layer.
        scale_mm_per_unit: mm for one unit of the file; None takes the file's own unit.
        names: names of the faces to take; None takes all.
    """

    file: Path
    layer: str | None = None
    scale_mm_per_unit: float | None = None
    names: tuple[str, ...] | None = None


@dataclass(frozen=True)
class GreatestBlocksJob:
    """The greatest foam block that may be used.

    Attributes:
        greatest_mm: plan size, (along the blade, across it), mm.
        clearance_mm: foam that stays at least between the cut and the block's top and bottom, mm.
    """

    greatest_mm: tuple[float, float] = (900.0, 600.0)
    clearance_mm: float = 30.0


@dataclass(frozen=True)
class PatchLeavesJob:
    """The blade's positions, and how close they must come.

    Attributes:
        spacing_mm: greatest distance between successive leaves, mm.
        tolerance_mm: greatest distance of the cut from the faces, mm.
        direction_deg: of the blade in each patch's plan against the way the face's u runs, degrees, or "auto" for a search.
        turn_deg: of the leaves' planes against the blocks, degrees, or "auto" for the least one without straight rods.
    """

    spacing_mm: float = 20.0
    tolerance_mm: float = 0.5
    direction_deg: float | Literal["auto"] = "auto"
    turn_deg: float | Literal["auto"] = "auto"


@dataclass(frozen=True)
class PatchesJob:
    """How faces become patches.

    Attributes:
        greatest_spread_deg: greatest angle between a patch's normals and its own upright, degrees.
    """

    greatest_spread_deg: float = 70.0


@dataclass(frozen=True)
class RationaliseJob:
    """A whole job.

    Attributes:
        name: heads the report. path: the job file, absolute.
        faces, blocks, leaves, patches: see there.
        rod, gripper: of the machine that is to cut.
        workshop: the sections of the job file that a job of `batten cut` takes as they are, for the jobs that are written.
    """

    name: str
    path: Path
    faces: FacesJob
    blocks: GreatestBlocksJob
    leaves: PatchLeavesJob
    patches: PatchesJob
    rod: RodJob
    gripper: GripperJob
    workshop: Mapping[str, Any] = field(default_factory=dict)
