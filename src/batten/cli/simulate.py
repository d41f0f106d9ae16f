"""The command `batten simulate`: the blade along the robot program, and the face that it leaves against the design."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

# Whatever is needed for the work itself is imported in `simulate`: `batten --help` answers at once.


def simulate(
    out: Annotated[Path, typer.Argument(metavar="OUT", help="A folder that `batten cut` made.")],
    allowance: Annotated[
        float, typer.Option(metavar="MM", help="How much farther than the job's tolerance the face may lie.")
    ] = 0.05,
    as_json: Annotated[bool, typer.Option("--json", help="Print the numbers as JSON on stdout.")] = False,
) -> None:
    """Drive the blade along the robot modules of a cut and compare the face that is left with the design.

    Between the leaves too the rod is the elastica between its grippers. Writes OUT/simulation and puts the main figures into
    OUT/report.html.

    Exit status: 0 the face keeps tolerance and allowance; 1 it does not, or the rod snaps; 2 bad input.
    """
    from batten.io.simulation_files import (
        FOLDER,
        PAGE,
        simulate_folder,
        simulation_lines,
        simulation_record,
        write_simulation,
    )

    stored, simulation = simulate_folder(out, allowance_mm=allowance)
    write_simulation(simulation, stored, out)
    if as_json:
        record = simulation_record(simulation, cut=stored.plan.name)
        typer.echo(json.dumps(record, ensure_ascii=False, indent=2, allow_nan=False))
    else:
        lines = simulation_lines(simulation, cut=stored.plan.name)
        typer.echo("\n".join([*lines, f"report: {out / FOLDER / PAGE}"]))
    raise typer.Exit(0 if simulation.is_good else 1)
