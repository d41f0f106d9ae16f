"""The command `batten approximate`: the curves of a drawing by pieces of elastica within a tolerance."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

# Whatever is needed for the work itself is imported in `approximate`: `batten --help` answers at once.


def approximate(
    drawing: Annotated[Path, typer.Argument(metavar="FILE", help="The drawing: .svg, .dxf, .3dm or .json.")],
    tolerance: Annotated[
        float, typer.Option(metavar="T", help="The greatest distance from the curve, in the drawing's unit.")
    ],
    out: Annotated[
        Path,
        typer.Option(
            "-o", "--out", metavar="OUT", help="The file to write: .svg, .dxf, .3dm, or .json with all numbers."
        ),
    ],
    continuity: Annotated[
        Literal["C0", "C1", "C2"], typer.Option(help="What pieces share: end points, tangents too, curvatures too.")
    ] = "C1",
    split: Annotated[
        Literal["bisect", "fewest"], typer.Option(help="Halve until near enough, or take as few pieces as possible.")
    ] = "fewest",
) -> None:
    """Draw every curve by pieces of elastica, the curves of a bent rod, no farther from it than T; corners stay corners.

    The cubics in OUT follow the elastica within a thousandth of T; a .json holds the elastica themselves.

    Exit status: 0 all curves are within the tolerance; 1 some are not (OUT is written, the table names them); 2 bad input.
    """
    from batten.io.approximate_files import (
        approximate_curves,
        approximation_lines,
        checked_tolerance,
        read_curves,
        write_approximations,
    )
    from batten.io.project_files import checked_out

    target = checked_out(drawing, out)
    within = checked_tolerance(tolerance)
    curves, notes = read_curves(drawing)
    found = approximate_curves(curves, within, continuity, split)
    write_approximations(found, target)
    typer.echo("\n".join([*approximation_lines(found, notes), f"written: {target}"]))
    raise typer.Exit(0 if all(row.result.status == "converged" for row in found) else 1)
