"""The folder that `batten rationalise` writes, whole or not at all, and the patches that are finished on the way.

OUT/report.html          for people: verdict, pictures, patches, seams, wires, jobs
OUT/rationalise.json     the numbers: frames, blocks, deviations, seams, wires
OUT/rationalise.3dm      faces, blocks, leaves and planned surfaces in the design's coordinates
OUT/view.png             the patches in space, coloured by deviation
OUT/deviation.png        the deviation of each patch in plan
OUT/jobs/NAME/job.toml   what `batten cut` goes on with, and surface.3dm beside it
.OUT.patches/            while it runs: what was decided about each patch, so that a run that was stopped goes on
"""

from __future__ import annotations

import hashlib
import json
import math
import shutil
from collections.abc import Callable
from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np

import batten
from batten.fabrication.patch_pieces import PERCENTILES
from batten.fabrication.patch_plan import PatchPlan
from batten.fabrication.patch_search import PatchDecision
from batten.fabrication.rationalisation import Rationalisation, Seam
from batten.fabrication.rationalise_job import RationaliseJob
from batten.io.rationalise_jobs import JOB, SURFACE, CutFolder, write_cut_jobs
from batten.io.software import software_name
from batten.io.study_parts import keep, kept
from batten.io.whole_or_nothing import written_whole

FORMAT, SCHEMA = "batten rationalise", 1
REPORT, NUMBERS, MODEL, VIEW, MAPS, JOBS = (
    "report.html",
    "rationalise.json",
    "rationalise.3dm",
    "view.png",
    "deviation.png",
    "jobs",
)
_AZIMUTH, _ELEVATION = -55.0, 28.0  # where the picture's eye stands, degrees


class KeptPatches:
    """Decisions about patches, kept beside OUT until OUT is there; of another job or version they are thrown away.

    Parameters:
        job: the job; its values and the bytes of its file of faces tell whether what was kept belongs to it.
        out: the folder that is to be written.
    """

    def __init__(self, job: RationaliseJob, out: Path) -> None:
        out = out.resolve()
        self.folder = out.parent / f".{out.name}.patches"
        values = repr((batten.__version__, SCHEMA, astuple(job))).encode() + job.faces.file.read_bytes()
        self.mark = hashlib.sha256(values).hexdigest()

    def __call__(self, number: int, decide: Callable[[], PatchDecision]) -> PatchDecision:
        """What was decided about a patch; if nothing was, decide and keep it."""
        path = self.folder / f"{self.mark[:16]}-{number:04d}.npz"
        found = kept(path, PatchDecision)
        if found is None:
            found = decide()
            self.folder.mkdir(parents=True, exist_ok=True)
            keep(path, found)
        return found

    def clear(self) -> None:
        """Throw away what was kept: the whole folder is written."""
        shutil.rmtree(self.folder, ignore_errors=True)


def write_rationalisation(
    rationalisation: Rationalisation,
    job: RationaliseJob,
    out: str | Path,
    *,
    pictures: bool = True,
    progress: Callable[[str, int, int], None] | None = None,
) -> tuple[CutFolder, ...]:
    """Write the report, the numbers, the model, the pictures and the jobs into a folder, whole or not at all.

    Parameters:
        rationalisation: what was planned. job: from what.
        out: the folder. An earlier one is replaced if it holds a rationalisation and nothing else.
        pictures: whether to draw.
        progress: called as progress(stage, done, of).

    Returns:
        The jobs that were written.

    Raises:
        InvalidInputError: `out` exists and is no such folder. OSError: the drive is full or not writable. In all these
            cases nothing is left behind.
    """
    from batten.io.rationalise_report import rationalise_html
    from batten.io.rhino_patches import write_patches_3dm

    tell = progress or (lambda stage, done, of: None)
    with written_whole(out, _files_of_rationalisation) as folder:
        tell("write the files", 0, 3)
        drawn = _drawn(rationalisation, job, folder) if pictures else {}
        tell("write the files", 1, 3)
        write_patches_3dm(rationalisation, folder / MODEL)
        (folder / JOBS).mkdir()
        jobs = tuple(j for plan in rationalisation.patches for j in write_cut_jobs(job, plan, folder / JOBS))
        tell("write the files", 2, 3)
        files = [REPORT, NUMBERS, MODEL, *drawn, *(f"{JOBS}/{j.name}/{f}" for j in jobs for f in (JOB, SURFACE))]
        record = rationalise_record(rationalisation, job, jobs) | {"files": files}
        text = json.dumps(record, ensure_ascii=False, indent=1, allow_nan=False) + "\n"
        (folder / NUMBERS).write_text(text, encoding="utf-8", newline="\n")
        page = rationalise_html(rationalisation, job, jobs, drawn)
        (folder / REPORT).write_text(page, encoding="utf-8", newline="\n")
    tell("write the files", 3, 3)
    return jobs


def _drawn(rationalisation: Rationalisation, job: RationaliseJob, folder: Path) -> dict[str, bytes]:
    """The pictures' bytes by their names, and the same in the folder."""
    from batten.io.compare_pictures import picture_bytes
    from batten.io.rationalise_pictures import deviation_maps, view_in_space

    tolerance = job.leaves.tolerance_mm
    figures = {
        VIEW: view_in_space(rationalisation, tolerance, azimuth=_AZIMUTH, elevation=_ELEVATION),
        MAPS: deviation_maps(rationalisation, tolerance),
    }
    drawn = {name: picture_bytes(figure) for name, figure in figures.items()}
    for name, data in drawn.items():
        (folder / name).write_bytes(data)
    return drawn


def rationalise_record(
    rationalisation: Rationalisation, job: RationaliseJob, jobs: tuple[CutFolder, ...] = ()
) -> dict[str, Any]:
    """All numbers as plain JSON values: None for what does not exist.

    Parameters:
        rationalisation: what was planned. job: from what. jobs: that were written.
    """
    return {
        "format": FORMAT,
        "schema": SCHEMA,
        "software": software_name(),
        "name": rationalisation.name,
        "good": rationalisation.is_good,
        "tolerance_mm": job.leaves.tolerance_mm,
        "greatest_block_mm": list(job.blocks.greatest_mm),
        "blocks": rationalisation.blocks,
        "wire_blocks": rationalisation.wire_blocks,
        "greatest_mm": _number(rationalisation.greatest_mm),
        "patches": [_patch_record(plan) for plan in rationalisation.patches],
        "seams": [_seam_record(seam) for seam in rationalisation.seams],
        "jobs": [
            {"folder": f"{JOBS}/{j.name}", "patch": j.patch, "columns": list(j.columns), "tolerance_mm": j.tolerance_mm}
            for j in jobs
        ],
    }


def _patch_record(plan: PatchPlan) -> dict[str, Any]:
    deviation, wires = plan.deviation, plan.wires
    return {
        "patch": plan.number,
        "face": plan.patch.face.name,
        "parameters": [list(ends) for ends in plan.patch.face.surface.domain],
        "spread_deg": math.degrees(plan.patch.spread),
        "block_frame": plan.block_frame.tolist(),
        "direction_deg": math.degrees(plan.family.angle),
        "turn_deg": math.degrees(plan.family.turn),
        "directions": [
            {"deg": math.degrees(d.angle), "expected": d.blocks, "straight": d.straight, "deviation_mm": d.deviation}
            for d in plan.directions
        ],
        "columns_mm": plan.columns.borders.tolist(),
        "rows_mm": plan.family.rows.tolist(),
        "fewest_columns_possible": plan.columns.least,
        "leaves": len(plan.family.planes),
        "pieces": plan.pieces,
        "heights_error_mm": plan.patch.error,
        "mean_mm": deviation.mean_mm,
        "percentiles_mm": {f"{p:g}": float(v) for p, v in zip(PERCENTILES, deviation.percentiles_mm)},
        "jump_mm": plan.jump_mm,
        "jump_deg": math.degrees(plan.jump_rad),
        "straight_rods": plan.straight,
        "least_bow_mm": _number(plan.least_bow_mm),
        "strain": plan.strain,
        "longest_piece_mm": plan.longest_mm,
        "planned_error_mm": plan.planned_error_mm,
        "problems": list(plan.problems),
        "wires": {
            "blocks": wires.blocks,
            "direction_deg": math.degrees(wires.angle),
            "no_more_blocks_mm": _number(wires.same_count_mm),
            "same_blocks_mm": _number(wires.same_blocks_mm),
            "step_mm": wires.step_mm,
            "kink_deg": math.degrees(wires.kink_rad),
        },
        "blocks": [
            {
                "block": b.number,
                "row": b.row,
                "column": b.column,
                "low_mm": np.asarray(b.low).tolist(),
                "high_mm": np.asarray(b.high).tolist(),
                "pieces": b.pieces,
                "greatest_mm": b.greatest_mm,
                "mean_mm": b.mean_mm,
            }
            for b in plan.blocks
        ],
    }


def _seam_record(seam: Seam) -> dict[str, Any]:
    return {
        "patches": [seam.first, seam.second],
        "length_mm": seam.length_mm,
        "gap_mm": seam.gap_mm,
        "turn_deg": math.degrees(seam.turn_rad),
        "crease_deg": math.degrees(seam.crease_rad),
    }


def rationalise_lines(rationalisation: Rationalisation, job: RationaliseJob) -> list[str]:
    """The result for the terminal: a verdict, a line for each patch, what is wrong."""
    lines = [f"{rationalisation.name}: {verdict(rationalisation, job)}"]
    lines.append("  patch  blocks  pieces   mean   95 %   greatest (mm)   wire: blocks   in our blocks (mm)")
    for plan in rationalisation.patches:
        p, w = plan.deviation, plan.wires
        lines.append(
            f"  {plan.number:>5} {len(plan.blocks):>7} {plan.pieces:>7} {p.mean_mm:>6.3f} {p.percentiles_mm[2]:>6.3f} "
            f"{p.greatest_mm:>10.3f} {w.blocks:>18} {w.same_blocks_mm:>20.2f}"
        )
    for plan in rationalisation.patches:
        lines += [f"  patch {plan.number}: {problem}" for problem in plan.problems]
    return lines


def verdict(rationalisation: Rationalisation, job: RationaliseJob) -> str:
    """What came of it, in one sentence."""
    patches, bad = len(rationalisation.patches), sum(1 for p in rationalisation.patches if p.problems)
    what = f"{_count(rationalisation.blocks, 'block')} in {_count(patches, 'patch', 'patches')}"
    wire = f"a straight wire needs {rationalisation.wire_blocks}"
    if bad:
        return f"{bad} of {_count(patches, 'patch', 'patches')} cannot be made as asked; {what}, {wire}"
    return f"{what} keep {job.leaves.tolerance_mm:g} mm; {wire}"


def _count(number: int, one: str, many: str | None = None) -> str:
    return f"{number} {one if number == 1 else many or one + 's'}"


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _files_of_rationalisation(folder: Path) -> frozenset[str] | None:
    try:
        data = json.loads((folder / NUMBERS).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if not (isinstance(data, dict) and data.get("format") == FORMAT and isinstance(data.get("files"), list)):
        return None
    return frozenset(str(name) for name in data["files"])
