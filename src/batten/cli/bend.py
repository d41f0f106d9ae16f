"""The command `batten bend`: all shapes of a rod between two grippers, with energies, forces and stability."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Annotated

import typer

from batten.errors import InvalidInputError, NoSolutionError

# Whatever is needed for the work itself is imported in `bend`: `batten --help` answers at once.

_END = "X,Y,ANGLE"
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"

LengthOption = Annotated[
    str | None,
    typer.Option(metavar="L", help="The rod's length between the two ends; without it, that of the rod file."),
]
RodOption = Annotated[
    Path | None,
    typer.Option(metavar="ROD.toml", help="The rod, for N and J; lengths are mm then. A job file will do."),
]


def bend(
    start: Annotated[str, typer.Option(metavar=_END, help="Where the rod starts, and its direction there.")],
    end: Annotated[str, typer.Option(metavar=_END, help="Where it ends, and its direction there.")],
    length: LengthOption = None,
    rod: RodOption = None,
    max_inflections: Annotated[
        int, typer.Option(metavar="N", help="The most inflections that are searched for.", show_default=True)
    ] = 2,
    any_winding: Annotated[
        bool, typer.Option("--any-winding", help="The end's direction may be reached by further full turns, too.")
    ] = False,
    out: Annotated[
        list[Path] | None,
        typer.Option(
            "-o", "--out", metavar="FILE", help="Write a .svg, .dxf, .3dm, .json or .png; may come repeatedly."
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print everything as JSON on stdout.")] = False,
) -> None:
    """All shapes of a rod of given length between two ends with given directions: energies, forces, stability.

    Angles are radians, or degrees as in 30deg; counter-clockwise from the x axis; `pinned` for an end that turns freely. The
    shapes are numbered by energy.

    Exit status: 0 there is a shape; 1 there is none; 2 bad input.
    """
    from batten.io.bend_files import write_bend, writer_of
    from batten.io.bend_json import bend_json
    from batten.io.bend_numbers import BendProblem
    from batten.io.bend_table import bend_lines
    from batten.io.rod_file import load_rod
    from batten.solvers.boundary_value import solve_boundary

    (x0, y0, angle0), (x1, y1, angle1) = end_of(start, "--start"), end_of(end, "--end")
    given = None if length is None else length_of(length)
    if max_inflections < 0:
        raise InvalidInputError(f"--max-inflections {max_inflections}: allowed are whole numbers, 0 or more; try 2")
    bent = None if rod is None else load_rod(rod, given)
    long = given if bent is None else bent.length_mm
    if long is None:
        raise InvalidInputError("--length is missing; give the rod's length, or a --rod whose file has length_mm")
    for path in out or []:
        writer_of(path)
    problem = BendProblem((x0, y0), angle0, (x1, y1), angle1, long, max_inflections, end_angle_modulo=any_winding)
    solutions = solve_boundary(
        problem.start,
        problem.start_angle,
        problem.end,
        problem.end_angle,
        problem.length,
        max_inflections=problem.max_inflections,
        max_turns=problem.max_turns,
        end_angle_modulo=problem.end_angle_modulo,
    )
    if not solutions:
        raise NoSolutionError(
            f"no shape of length {long:g} with at most {max_inflections} inflections; the ends lie {problem.chord:g} apart: "
            "try a greater --length, more --max-inflections, or --any-winding"
        )
    for path in out or []:
        write_bend(problem, solutions, path, bent)
    if as_json:
        typer.echo(bend_json(problem, solutions, bent), nl=False)
    else:
        typer.echo("\n".join([*bend_lines(problem, solutions, bent), *(f"written: {path}" for path in out or [])]))


def end_of(text: str, option: str) -> tuple[float, float, float | None]:
    """x, y and the direction in radians, of "X,Y,ANGLE"; None for "X,Y,pinned".

    Raises:
        InvalidInputError: not three numbers, the last with `deg`, `rad` or nothing after it; the message names the field.

    Example:
        >>> end_of("-1,0.5,180deg", "--start")
        (-1.0, 0.5, 3.141592653589793)
    """
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 3:
        raise InvalidInputError(
            f"{option} {text!r}: has {len(parts)} part{'s' if len(parts) != 1 else ''}; allowed is {_END}, three numbers "
            f"with commas in between; try {option} 0,0,30deg"
        )
    x, y = (_number(part, f"{option} {text!r}: {name}") for part, name in zip(parts, "XY"))
    return x, y, None if parts[2] == "pinned" else _angle(parts[2], f"{option} {text!r}: ANGLE")


def length_of(text: str) -> float:
    """A length above 0.

    Raises:
        InvalidInputError: something else.

    Example:
        >>> length_of("1e3")
        1000.0
    """
    length = _number(text.strip(), "--length")
    if not length > 0.0:
        raise InvalidInputError(f"--length {text}: allowed are numbers above 0; try 1000")
    return length


def _number(text: str, where: str) -> float:
    value = float(text) if re.fullmatch(_NUMBER, text) else math.nan
    if not math.isfinite(value):
        raise InvalidInputError(f"{where} = {text!r}: allowed are finite numbers such as 0, -12.5 or 1e3")
    return value


def _angle(text: str, where: str) -> float:
    found = re.fullmatch(rf"({_NUMBER})\s*(deg|rad)?", text)
    value = float(found[1]) if found else math.nan
    if found is None or not math.isfinite(value):
        raise InvalidInputError(
            f"{where} = {text!r}: allowed are finite numbers such as 30deg, 0.5rad or 0.5 (radians), or pinned"
        )
    return math.radians(value) if found[2] == "deg" else value
