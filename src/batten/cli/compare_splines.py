"""The command `batten compare-splines`: every kind of spline through the same points, in one picture and one table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

# Whatever is needed for the work itself is imported in `compare_splines`: `batten --help` answers at once.


def compare_splines(
    points: Annotated[Path, typer.Argument(metavar="FILE", help="The points: .json, .svg, .sfd, .glif or .ufo.")],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="OUT", help="The picture to write: .svg or .png.")],
    closed: Annotated[bool, typer.Option("--closed", help="Let every spline return to its first point.")] = False,
    tolerance: Annotated[
        float | None, typer.Option(metavar="T", help="For counting cubics; without, 1e-4 of the points' size.")
    ] = None,
) -> None:
    """Draw every kind of spline through the same points, with curvature combs, and print how fair each of them is.

    Exit status: 0 the picture is written, even where a kind has no spline through the points; 2 bad input.
    """
    from batten.io.spline_files import closed_splines
    from batten.io.spline_pictures import checked_picture, compare_all, comparison_lines, write_comparison
    from batten.io.spline_reading import read_splines

    target = checked_picture(out)
    given, notes = read_splines(points)
    rows = compare_all(closed_splines(given) if closed else given, tolerance)
    write_comparison(rows, target)
    typer.echo("\n".join([*comparison_lines(rows), *notes, f"written: {target}"]))
