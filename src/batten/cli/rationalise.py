"""The command `batten rationalise`: faces from CAD become patches, blocks and pieces of elastica."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

# Whatever is needed for the work itself is imported in `rationalise`: `batten --help` answers at once.


def rationalise(
    job: Annotated[Path, typer.Argument(metavar="JOB.toml", help="The job; docs/rationalise.md lists its fields.")],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="OUT", help="Folder to write, whole or not at all.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the numbers as JSON on stdout.")] = False,
    no_pictures: Annotated[bool, typer.Option("--no-pictures", help="Draw nothing.")] = False,
) -> None:
    """Divide faces into patches and blocks that pieces of elastica can make within the tolerance, few of them.

    Also says what a straight hot wire would need, and writes jobs for `batten cut`. A run that was stopped goes on where it
    was, if it is given the same job and the same OUT.

    Exit status: 0 every patch can be made as asked; 1 one cannot (OUT is written and says why); 2 bad input.
    """
    from batten.cli.progress import StageProgress
    from batten.fabrication.rationalisation import rationalise_faces
    from batten.io.face_reading import read_faces
    from batten.io.rationalise_files import (
        REPORT,
        KeptPatches,
        rationalise_lines,
        rationalise_record,
        write_rationalisation,
    )
    from batten.io.rationalise_job import load_rationalise_job

    values = load_rationalise_job(job)
    faces = read_faces(values.faces.file, scale_mm_per_unit=values.faces.scale_mm_per_unit, layer=values.faces.layer)
    patches = KeptPatches(values, out)
    with StageProgress() as progress:
        plan = rationalise_faces(values, faces, progress, kept=patches)
        jobs = write_rationalisation(plan, values, out, pictures=not no_pictures, progress=progress)
    patches.clear()
    if as_json:
        record = rationalise_record(plan, values, jobs)
        typer.echo(json.dumps(record, ensure_ascii=False, indent=2, allow_nan=False))
    else:
        typer.echo("\n".join([*rationalise_lines(plan, values), f"report: {out / REPORT}"]))
    raise typer.Exit(0 if plan.is_good else 1)
