"""The command `batten study`: the papers' experiments, at any size."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

# Whatever is needed for one study only is imported there: `batten --help` answers at once.

app = typer.Typer(help="The papers' experiments beside ours, at any size.", no_args_is_help=True, rich_markup_mode=None)


@app.callback()
def _studies() -> None:
    """The papers' experiments beside ours, at any size."""


@app.command(short_help="Boundary value problems: Tables 2.1 and B.1 of Fisker2018.")
def boundary(
    size: Annotated[int, typer.Option(metavar="N", min=1, max=1_000_000, help="How many random problems.")] = 500,
    seed: Annotated[int, typer.Option(metavar="S", min=0, help="The same seed gives the same problems.")] = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out", metavar="DIR", help="Folder for tables and a figure; a run that was stopped goes on there."
        ),
    ] = None,
) -> None:
    """Random elastica are found again from their ends and length: by the papers' two methods, and by ours.

    Prints errors, run times and distances to the elastica that was asked for and to the nearest of all solutions, with the
    paper's figures beside them, and how the energy of the cubic spline converges. Exit status: 0; 2 for bad input.
    """
    from batten.cli.progress import StageProgress
    from batten.io.boundary_study_files import run_in, write
    from batten.studies.boundary import run
    from batten.studies.boundary_lines import lines

    with StageProgress() as progress:
        study = run(size, seed, progress) if out is None else run_in(out, size, seed, progress)
    if out is not None:
        write(study, out)
    typer.echo("\n".join(lines(study)))


@app.command(short_help="Feedback projection of random Béziers: Table 4.1 of Fisker2018.")
def projection(
    size: Annotated[int, typer.Option(metavar="N", min=1, max=1_000_000_000, help="How many random curves.")] = 100_000,
    seed: Annotated[int, typer.Option(metavar="S", min=0, help="The same seed gives the same curves.")] = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out", metavar="DIR", help="Folder for Parquet and a figure; a run that was stopped goes on there."
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Threads, by default one for each core.")
    ] = None,
) -> None:
    """Random cubic Béziers are moved close to elastica by the feedback projection, under three pairs of angle constraints.

    Prints how far from elastica they are afterwards, with the paper's figures beside. Exit status: 0; 2 for bad input.
    """
    from batten.cli.progress import StageProgress
    from batten.io.projection_study_files import run_in, write
    from batten.studies.projection import lines, run

    with StageProgress() as progress:
        if out is None:
            study = run(size, seed, progress, workers=workers)
        else:
            study = run_in(out, size, seed, progress, workers=workers)
            write(study, out)
    typer.echo("\n".join(lines(study)))
