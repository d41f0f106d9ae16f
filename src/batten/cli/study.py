"""The command `batten study`: the papers' experiments, at any size."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

# Whatever is needed for one study only is imported there: `batten --help` answers at once.

_INTERRUPTED = 130

app = typer.Typer(help="The papers' experiments beside ours, at any size.", no_args_is_help=True, rich_markup_mode=None)

_Size = Annotated[
    int | None,
    typer.Option(
        "--size", metavar="N", min=1, max=1_000_000_000, help="How many random curves, by default as many as the paper."
    ),
]
_Seed = Annotated[int, typer.Option("--seed", metavar="S", min=0, help="The same seed gives the same curves.")]
_Out = Annotated[
    Path | None,
    typer.Option("-o", "--out", metavar="DIR", help="Folder for Parquet and a figure; a stopped run goes on there."),
]
_Workers = Annotated[
    int | None, typer.Option("--workers", metavar="N", min=1, help="Threads, by default one for each core.")
]
_Scheduler = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        metavar="ADDRESS",
        help="Of a dask.distributed scheduler, tcp://HOST:PORT, whose workers compute.",
    ),
]


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
    size: _Size = None, seed: _Seed = 0, out: _Out = None, workers: _Workers = None, scheduler: _Scheduler = None
) -> None:
    """Random cubic Béziers, 100,000, are moved close to elastica by the feedback projection, under three pairs of angle

    constraints. Prints how far from elastica they are afterwards, with the paper's figures beside. Exit status: 0; 2 for bad
    input.
    """
    _run("projection", size, seed, out, workers, scheduler)


@app.command(short_help="Distance to elastica by type: Tables 3.1 and 3.2 of Fisker2018.")
def annulus(
    size: _Size = None, seed: _Seed = 0, out: _Out = None, workers: _Workers = None, scheduler: _Scheduler = None
) -> None:
    """The nearest elastica to random cubic Béziers, 80,000, with inner control points in two annuli around the ends.

    Prints how far it is, by the quadrants in which the outer edges of the control polygon lie, with the paper's figures
    beside. The figure shows the distance against the smallest angle and the λ-residual. Exit status: 0; 2 for bad input.
    """
    _run("annulus", size, seed, out, workers, scheduler)


@app.command(short_help="The λ-residual under the criteria: Tables 3.3 and 3.4 of Fisker2018.")
def random(
    size: _Size = None, seed: _Seed = 0, out: _Out = None, workers: _Workers = None, scheduler: _Scheduler = None
) -> None:
    """The λ-residual of random cubic Béziers, 8,000,000, under the angle, zone and length constraints one after the other.

    Prints shares, means and maxima with the papers' figures beside. Exit status: 0; 2 for bad input.
    """
    _run("random_sample", size, seed, out, workers, scheduler)


@app.command(short_help="The greatest λ-residual in the projection zone.")
def zone(
    size: _Size = None, seed: _Seed = 0, out: _Out = None, workers: _Workers = None, scheduler: _Scheduler = None
) -> None:
    """The λ-residual of cubic Béziers, 10,700,000, that satisfy all criteria.

    Prints quantiles and the maximum, sampled and sharpened, with the papers' beside: they conclude that none is above 0.4.
    Exit status: 0; 2 for bad input.
    """
    _run("zone", size, seed, out, workers, scheduler)


@app.command(short_help="Elastica fitted in the projection zone: Figs. 3.13 and 3.14 of Fisker2018.")
def fits(
    size: _Size = None, seed: _Seed = 0, out: _Out = None, workers: _Workers = None, scheduler: _Scheduler = None
) -> None:
    """The nearest elastica, in two norms, to cubic Béziers, 38,826, that satisfy all criteria.

    Prints how far they are with the paper's figures beside. Exit status: 0; 2 for bad input.
    """
    _run("zone_fits", size, seed, out, workers, scheduler)


@app.command(short_help="The bound on the distance to an elastica: Figs. 3.17 to 3.21 of Fisker2018.")
def bound(
    size: _Size = None, seed: _Seed = 0, out: _Out = None, workers: _Workers = None, scheduler: _Scheduler = None
) -> None:
    """The distance to an elastica that the λ-residual guarantees, against the true one, for random cubic Béziers.

    Prints how much greater it is, by the paper's theorem and by a sharper bound. Exit status: 0; 2 for bad input.
    """
    _run("bound", size, seed, out, workers, scheduler)


@app.command(short_help="Good regions: the papers' database against computed ones.")
def regions(
    size: _Size = None, seed: _Seed = 0, out: _Out = None, workers: _Workers = None, scheduler: _Scheduler = None
) -> None:
    """The good region of a control point of random C¹ splines, 1,000, looked up in the papers' database and computed.

    Prints how much the two differ, and why. The database is built first. Exit status: 0; 2 for bad input.
    """
    _run("regions", size, seed, out, workers, scheduler)


@app.command(short_help="All projections of random Béziers beside one another.")
def methods(
    size: _Size = None, seed: _Seed = 0, out: _Out = None, workers: _Workers = None, scheduler: _Scheduler = None
) -> None:
    """Random cubic Béziers, 100,000, projected by every method: how close to elastica, how far moved, how steady.

    Exit status: 0; 2 for bad input.
    """
    _run("methods", size, seed, out, workers, scheduler)


@app.command(short_help="Interpolating splines of every kind: Table 4.1 of Levien2009 with numbers.")
def splines(
    size: _Size = None, seed: _Seed = 0, out: _Out = None, workers: _Workers = None, scheduler: _Scheduler = None
) -> None:
    """Splines through random sequences of points, 100,000, and through designs such as people draw.

    Prints which exist, their order of continuity, roundness, extensionality, locality, energies and what they do under
    similarities, in a mirror and reversed. The figure shows all with curvature combs. Exit status: 0; 2 for bad input.
    """
    _run("splines", size, seed, out, workers, scheduler)


@app.command(short_help="The papers' database of good regions: Fisker2018, section 5.2.")
def database(
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="Folder for the Parquet file and a picture.")],
) -> None:
    """Builds about 390,000 cubic Béziers close to elastica and writes them, with a picture like Fig. 5.6.

    Exit status: 0; 2 for bad input.
    """
    from batten.cli.progress import StageProgress
    from batten.io.good_region_database_files import database_lines, write_database_folder

    with StageProgress() as progress:
        built, paths = write_database_folder(out, progress)
    typer.echo("\n".join([*database_lines(built), *map(str, paths)]))


@app.command(short_help="Connected components of cubics close to elastica: Fisker2018, 3.4 and 6.2.")
def components(
    size: Annotated[
        int, typer.Option("--size", metavar="N", min=16, max=240, help="Cells of the finest grid on each axis.")
    ] = 160,
    seed: _Seed = 0,
    out: _Out = None,
) -> None:
    """How many connected components has the set of cubics with λ-residual below 0.2 and outer edges below 2?

    Flood fill on three grids, paths that join what a grid cuts, bottlenecks. Exit status: 0; 2 for bad input.
    """
    from batten.cli.progress import StageProgress
    from batten.studies.components import run
    from batten.studies.components_lines import lines

    with StageProgress() as progress:
        if out is None:
            study = run(size, seed, progress)
        else:
            from batten.io.components_files import run_in, write
            from batten.io.study_files import parquet_modules

            parquet_modules()  # what is missing is told now
            try:
                study = run_in(out, size, seed, progress)
            except KeyboardInterrupt:
                typer.echo(f"batten: interrupted; finished parts are kept, the same command goes on in {out}", err=True)
                raise SystemExit(_INTERRUPTED) from None
            write(study, out)
    typer.echo("\n".join(lines(study)))


def _run(
    module: str, size: int | None, seed: int, out: Path | None, workers: int | None, scheduler: str | None
) -> None:
    """One sampled study, `STUDY` of a module of `batten.studies`: computed, written where a folder is given, and printed."""
    from batten.cli.progress import StageProgress
    from batten.studies.study import Outcome, Study, run

    chosen = import_module(f"batten.studies.{module}")
    study: Study[Any] = chosen.STUDY
    outcome: Outcome[Any]
    wanted: int = chosen.DEFAULT_SIZE if size is None else size
    with StageProgress() as progress:
        if out is None:
            outcome = run(study, wanted, seed, progress, workers=workers, scheduler=scheduler)
        else:
            from batten.io.study_files import parquet_modules, run_in, write

            parquet_modules()  # what is missing is told now, not after an hour
            try:
                outcome = run_in(study, out, wanted, seed, progress, workers=workers, scheduler=scheduler)
            except KeyboardInterrupt:
                typer.echo(f"batten: interrupted; finished parts are kept, the same command goes on in {out}", err=True)
                raise SystemExit(_INTERRUPTED) from None
            write(outcome, out)
    typer.echo("\n".join(study.lines(outcome)))
