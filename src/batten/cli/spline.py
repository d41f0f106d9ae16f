"""The command `batten spline`: fair curves through the points of a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

# Whatever is needed for the work itself is imported in `spline`: `batten --help` answers at once.

Method = Literal["euler", "mec", "log-aesthetic", "kurgla1", "hobby", "circle", "ikarus", "lagrange", "si-mec", "spiro"]


def spline(
    points: Annotated[Path, typer.Argument(metavar="FILE", help="The points: .json, .svg, .sfd, .glif or .ufo.")],
    out: Annotated[
        Path,
        typer.Option("-o", "--out", metavar="OUT", help="The file to write: .svg, .dxf, .3dm, .json, .glif or .sfd."),
    ],
    method: Annotated[
        Method | None, typer.Option(help="The spline; without, spiro for points with types and euler for others.")
    ] = None,
    closed: Annotated[bool, typer.Option("--closed", help="Let every spline return to its first point.")] = False,
    tolerance: Annotated[
        float | None,
        typer.Option(
            metavar="T", help="The greatest distance of the cubics from the spline; without, 1e-4 of the size."
        ),
    ] = None,
    fallback: Annotated[
        bool, typer.Option("--fallback", help="Take Euler spirals where there is no spline of the method.")
    ] = False,
) -> None:
    """Draw fair curves through points, as few cubic Béziers that are nowhere farther from them than T.

    Exit status: 0 every spline is what was asked for; 1 one has a loop, or another is in its place (OUT is written, the
    table says which), or there is none (nothing is written); 2 bad input.
    """
    from batten.io.spline_files import checked_target, closed_splines, draw_splines, spline_lines, write_splines
    from batten.io.spline_reading import read_splines

    target = checked_target(points, out)
    given, notes = read_splines(points)
    drawn = draw_splines(closed_splines(given) if closed else given, method, tolerance=tolerance, fallback=fallback)
    write_splines(drawn, points, target)
    typer.echo("\n".join([*spline_lines(drawn, notes), f"written: {target}"]))
    raise typer.Exit(0 if all(d.spline.status == "converged" for d in drawn) else 1)
