"""What `batten cut` goes on with: for each patch a surface in its block frame and a job, or one for each column."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from batten.fabrication.patch_plan import PatchPlan
from batten.fabrication.rationalise_job import RationaliseJob
from batten.io.rhino import rhino_surface
from batten.io.rhino_curves import Drawing
from batten.surfaces.face import Face

_EQUAL = 1e-6  # of their mean: columns whose widths differ less are cut in one job
_LEAST_SHARE = 0.05  # of the tolerance: what a cut is given at least

JOB, SURFACE = "job.toml", "surface.3dm"


@dataclass(frozen=True)
class CutFolder:
    """A job of `batten cut` that was written.

    Attributes:
        name: of its folder. patch: number of the patch. columns: (first, last + 1), of the patch. blocks: rows × columns.
        tolerance_mm: what the plan leaves of the tolerance.
    """

    name: str
    patch: int
    columns: tuple[int, int]
    blocks: int
    tolerance_mm: float


def write_cut_jobs(job: RationaliseJob, plan: PatchPlan, folder: Path) -> tuple[CutFolder, ...]:
    """Write the jobs of one patch, each into a folder of its own in `folder`.

    The surface is the planned one: the pieces of elastica, and between and beyond them heights as smooth as can be. Its
    distance from the design and the job's tolerance for the cut make up the tolerance together. Columns of one width make
    one job; otherwise each column is one, for `batten cut` knows blocks of one size. Blocks that the face does not reach
    into are cut as well, for the blocks of a cut fill a rectangle.

    Parameters:
        job: what was rationalised. plan: the patch. folder: exists.

    Returns:
        What was written, in order.

    Raises:
        FormatError, OSError: the surface cannot be written.
    """
    borders, rows = plan.columns.borders, plan.family.rows
    widths = np.diff(borders)
    count = len(widths)
    whole = bool(np.ptp(widths) <= _EQUAL * widths.mean())
    runs = [(0, count)] if whole else [(k, k + 1) for k in range(count)]
    left = job.leaves.tolerance_mm - plan.deviation.greatest_mm
    tolerance = max(left, _LEAST_SHARE * job.leaves.tolerance_mm)
    written = []
    for first, last in runs:
        used = [b.row for b in plan.blocks if first <= b.column < last]
        if not used:
            continue
        low, high = min(used), max(used) + 1
        name = f"patch-{plan.number:02d}" + ("" if whole else f"-column-{first + 1}")
        target = folder / name
        target.mkdir()
        part = Face(plan.planned).part(borders[first], borders[last], rows[low], rows[high]).surface
        draw = Drawing({"surface": (90, 110, 130)}, "mm")
        draw.add("surface", name, rhino_surface(part), {"patch": str(plan.number)})
        draw.write(target / SURFACE)
        size = [float(widths[first:last].mean()), float(rows[1] - rows[0])]
        sections: dict[str, Any] = {
            "surface": {"file": SURFACE, "scale_mm_per_unit": 1.0},
            "blocks": {"size_mm": size, "direction": "u", "clearance_mm": job.blocks.clearance_mm},
            "leaves": {
                "spacing_mm": job.leaves.spacing_mm,
                "tolerance_mm": tolerance,
                "turn_deg": float(np.degrees(plan.family.turn)),
            },
        } | dict(job.workshop)
        head = (
            f"# Patch {plan.number} of {job.name}, made by batten rationalise: the planned surface, which lies at most\n"
            f"# {plan.deviation.greatest_mm:.4g} mm from the design; tolerance_mm is what that leaves of "
            f"{job.leaves.tolerance_mm:g} mm.\n\n"
        )
        text = head + _toml({"name": f"{job.name} {name}"[:60]} | sections)
        (target / JOB).write_text(text, encoding="utf-8", newline="\n")
        written.append(CutFolder(name, plan.number, (first, last), (high - low) * (last - first), tolerance))
    return tuple(written)


def _toml(values: Mapping[str, Any], prefix: str = "") -> str:
    """Plain values and tables as TOML text: a section's own values first, then the sections within it."""
    own = [f"{key} = {_value(value)}\n" for key, value in values.items() if not isinstance(value, Mapping)]
    text = "".join(own)
    for key, value in values.items():
        if isinstance(value, Mapping):
            name = f"{prefix}{key}"
            text += f"\n[{name}]\n" + _toml(value, f"{name}.")
    return text


def _value(value: Any) -> str:
    """One value as TOML writes it; texts and lists are written alike in TOML and JSON."""
    return json.dumps(value, ensure_ascii=False)
