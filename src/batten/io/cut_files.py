"""All files of a cut, written whole or not at all.

OUT/report.html   for people: numbers, checks, pictures, a line to sign
OUT/cut.3dm       blocks, leaves, rods and gripper frames for Rhino, mm
OUT/rods.csv      a line for each rod: ends, tangents, plane normal, length
OUT/rapid/*.mod   two modules for each block, one for each arm
OUT/input/*       the files that the job refers to, as they were read
OUT/cut.json      everything, with the sums of the other files; read back by `batten check OUT`
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from batten.errors import InvalidInputError
from batten.fabrication.job import CutJob
from batten.fabrication.plan import CutPlan
from batten.io.cut_json import FILE_NAME, files_of_cut, input_name, write_cut_json
from batten.io.rods_table import write_rods_csv
from batten.io.whole_or_nothing import written_whole

if TYPE_CHECKING:
    from batten.fabrication.robot.cell import RobotCell
    from batten.surfaces.bspline_surface import BSplineSurface

REPORT, RODS, MODEL, RAPID_FOLDER = "report.html", "rods.csv", "cut.3dm", "rapid"

Progress = Callable[[str, int, int], None]
"""Called as progress(what is being done, how much of it is done, how much there is)."""


def write_cut(
    plan: CutPlan,
    job: CutJob,
    surface: BSplineSurface | None,
    cell: RobotCell,
    out: str | Path,
    *,
    pictures: bool = True,
    progress: Progress | None = None,
) -> dict[str, str]:
    """Write all files of a cut into a folder.

    Parameters:
        plan: the plan.
        job: the job that it answers.
        surface: the wanted surface, drawn into cut.3dm; None to leave it out.
        cell: the cell that the motions were planned for.
        out: the folder. An earlier one is replaced if batten made it and it holds nothing else.
        pictures: whether the report gets its large pictures.
        progress: told about each step.

    Returns:
        SHA-256 of every file but cut.json itself, by path relative to `out`.

    Raises:
        InvalidInputError: `out` exists and is not batten's own.
        FormatError: Rhino's library calls a geometry invalid.
        LimitError: a pose of a rod that is to be cut is out of reach.
        OSError: the drive is full or not writable. In all these cases nothing is left behind.
    """
    try:
        with written_whole(out, files_of_cut) as folder:
            _write_all(folder, plan, job, surface, cell, pictures, progress)
            return file_sums(folder)
    except OSError as error:  # name the folder that was asked for, not the hidden one beside it
        reason = error.strerror or "is the drive full, or not writable?"
        raise OSError(error.errno, f"cannot be written ({reason})", str(out)) from error


def _write_all(
    folder: Path,
    plan: CutPlan,
    job: CutJob,
    surface: BSplineSurface | None,
    cell: RobotCell,
    pictures: bool,
    progress: Progress | None,
) -> None:
    from batten.io.rapid import rapid_program
    from batten.io.report import write_report
    from batten.io.rhino import write_cut_3dm

    def tables() -> None:
        _keep_input(job, folder)
        write_rods_csv(folder / RODS, plan)

    def robot_program() -> None:
        (folder / RAPID_FOLDER).mkdir()
        for name, text in rapid_program(plan, cell).items():
            (folder / RAPID_FOLDER / name).write_text(text, encoding="ascii", newline="\n")

    steps: tuple[Callable[[], None], ...] = (
        tables,
        robot_program,
        lambda: write_cut_3dm(plan, folder / MODEL, surface),
        lambda: write_report(folder / REPORT, plan, job, pictures=pictures, files=file_sums(folder)),
        lambda: write_cut_json(folder / FILE_NAME, plan, job, file_sums(folder)),
    )
    for done, step in enumerate(steps):
        if progress is not None:
            progress("write files", done, len(steps))
        step()
    if progress is not None:
        progress("write files", len(steps), len(steps))


def file_sums(folder: Path) -> dict[str, str]:
    """SHA-256 of every file in a folder but its cut.json, by relative path with "/", in order of path."""
    files = {p.relative_to(folder).as_posix(): p for p in folder.rglob("*") if p.is_file()}
    return {name: hashlib.sha256(files[name].read_bytes()).hexdigest() for name in sorted(files) if name != FILE_NAME}


def _keep_input(job: CutJob, folder: Path) -> None:
    """The file that the job refers to, beside what was made from it."""
    if job.surface.file is None and job.surface.curves is None:
        return
    source = job.surface.source
    if not source.is_file():
        raise InvalidInputError(f"{source}: no such file; it is kept with the cut so that the cut can be checked later")
    kept = folder / input_name(source)
    kept.parent.mkdir()
    shutil.copyfile(source, kept)
