"""The command `batten project`: the curves of a drawing brought close to what a bent rod takes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

import typer

from batten.errors import InvalidInputError

# Whatever is needed for the work itself is imported in `project`: `batten --help` answers at once.


def project(
    drawing: Annotated[Path, typer.Argument(metavar="FILE", help="The drawing: .svg, .json or .3dm.")],
    out: Annotated[
        Path,
        typer.Option("-o", "--out", metavar="OUT", help="The file to write; may be FILE. Also .dxf, curves alone."),
    ],
    threshold: Annotated[
        float | None,
        typer.Option(
            metavar="E",
            help="λ-residual wanted, in (0, 1); change no more than it needs. Without it: the least with --keep tangents, "
            "else 0.22.",
        ),
    ] = None,
    keep: Annotated[
        Literal["tangents", "points", "nothing"],
        typer.Option(help="What stays: tangents and points of the ends, their points, or nothing."),
    ] = "tangents",
    method: Annotated[
        Literal["nearest", "feedback", "zone", "gradient"],
        typer.Option(help="How handles are changed; --keep points and nothing need nearest."),
    ] = "nearest",
    smooth: Annotated[
        float,
        typer.Option(metavar="DEG", help="A joint whose directions differ by less than this is smooth and stays so."),
    ] = 0.1,
) -> None:
    """Bring the cubics of a drawing close to elastica, the curves of a bent rod; smooth joints stay smooth.

    SVG: the <path> elements, as they are seen through all transforms; all else stays byte by byte. 3DM: cubic planar NURBS
    and polycurves; layers, attributes and all else stay. JSON: {"paths": [{"name": …, "closed": false, "points": [[x, y],
    …]}]} with 3 n + 1 points, ends and handles in turn, or "control_points" of shape (n, 4, 2). If OUT has another ending
    than FILE, it gets the curves alone.

    Exit status: 0 all curves reached the threshold; 1 some did not (OUT is written, they are named); 2 bad input.
    """
    from batten.io.project_files import checked_out, missed, project_lines, project_paths, read_drawing, write_projected

    if threshold is not None and not 0.0 < threshold < 1.0:
        raise InvalidInputError(f"--threshold {threshold:g}: allowed are numbers between 0 and 1; try 0.22")
    if keep != "tangents" and method != "nearest":
        raise InvalidInputError(f"--keep {keep} needs --method nearest; --method {method} always keeps the tangents")
    if not 0.0 <= smooth <= 180.0:
        raise InvalidInputError(f"--smooth {smooth:g}: allowed are degrees from 0 to 180; try 0.1")
    target = checked_out(drawing, out)
    found = read_drawing(drawing)
    results = project_paths(found.paths, method, threshold=threshold, keep=keep, smooth_within=math.radians(smooth))
    write_projected(found, drawing, results, target)
    typer.echo("\n".join([*project_lines(results, found.notes), f"written: {target}"]))
    raise typer.Exit(1 if missed(results) else 0)
