"""The shapes of a bent rod as a file, in the format that its name asks for; whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeAlias

from batten.errors import InvalidInputError
from batten.fabrication.rod import Rod
from batten.io.bend_numbers import BendProblem, BendSolution, bend_numbers, drawn_curves

Writer: TypeAlias = Callable[[BendProblem, Sequence[BendSolution], Path, Rod | None], None]

TOLERANCE = 1e-6
"""Greatest distance of the curves in .svg, .dxf and .3dm from the elastica, as a share of the length."""


def write_bend(
    problem: BendProblem, solutions: Sequence[BendSolution], path: str | Path, rod: Rod | None = None
) -> None:
    """Write all shapes of a bent rod.

    The ending of the name says how: `.svg` (paths of cubics), `.dxf` (splines), `.3dm` (Rhino's NURBS curves with user
    text), `.json` (all numbers, bit by bit), `.png` (a picture with a legend). With a rod the unit is mm; without, the files
    have none.

    Parameters:
        problem: what was asked.
        solutions: one or more.
        path: the file; it appears whole or not at all, and replaces an earlier one.
        rod: the rod, for forces, energies and strains.

    Raises:
        InvalidInputError: another ending, no solutions, a folder that is not there, a path that is a folder.
        OSError: the file cannot be written; nothing is left behind.

    Accuracy: the curves are within 1e-6 × length of the elastica in .svg, .dxf and .3dm.

    Example:
        >>> import math, tempfile
        >>> from batten.curves.elastica import Elastica
        >>> from batten.solvers.boundary_value import BoundarySolution
        >>> half = Elastica((0, 0), math.pi / 2, -math.pi, (0, 0), 1.0)
        >>> solution = BoundarySolution(half, math.pi**2, 0, -0.5, True, 2.0, 0.0)
        >>> problem = BendProblem((0.0, 0.0), math.pi / 2, (2 / math.pi, 0.0), -math.pi / 2, 1.0)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     for name in ("half.svg", "half.json"):
        ...         write_bend(problem, [solution], Path(folder) / name)
        ...     sorted(p.name for p in Path(folder).iterdir())
        ['half.json', 'half.svg']
    """
    path = Path(path)
    write = writer_of(path)
    if not solutions:
        raise InvalidInputError(f"{path}: no solutions, so there is nothing to write; give one or more")
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=f".part{path.suffix}", dir=path.parent)
    os.close(handle)
    part = Path(name)
    try:
        write(problem, solutions, part, rod)
        _finish(part)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def writer_of(path: Path) -> Writer:
    """The function that writes what the path's ending asks for.

    Raises:
        InvalidInputError: another ending, a folder that is not there, a path that is a folder.
    """
    write = _WRITERS.get(path.suffix.lower())
    if write is None:
        came = f"the ending {path.suffix}" if path.suffix else "no ending"
        raise InvalidInputError(
            f"{path}: has {came}; allowed are {', '.join(_WRITERS)}; try {path.with_suffix('.svg')}"
        )
    if path.is_dir():
        raise InvalidInputError(f"{path}: is a folder; give the path of a file")
    if not path.parent.is_dir():
        raise InvalidInputError(f"{path}: there is no folder {path.parent}; make it, or give another path")
    return write


def _finish(part: Path) -> None:
    """On the drive, and readable by everyone whom the user allows: temporary files are private."""
    mask = os.umask(0o077)
    os.umask(mask)
    part.chmod(0o666 & ~mask)
    with part.open("rb+") as file:
        os.fsync(file.fileno())


def _write_text(part: Path, text: str) -> None:
    with part.open("w", encoding="utf-8", newline="\n") as file:
        file.write(text)


# Each imports its library only when it is asked for: ezdxf, rhino3dm and matplotlib take a while.


def _write_svg(problem: BendProblem, solutions: Sequence[BendSolution], part: Path, rod: Rod | None) -> None:
    from batten.io.svg import svg_text

    curves = drawn_curves(bend_numbers(solutions, rod))
    _write_text(part, svg_text(curves, TOLERANCE * problem.length, "mm" if rod is not None else None))


def _write_dxf(problem: BendProblem, solutions: Sequence[BendSolution], part: Path, rod: Rod | None) -> None:
    from batten.io.dxf import dxf_text

    curves = drawn_curves(bend_numbers(solutions, rod))
    _write_text(part, dxf_text(curves, TOLERANCE * problem.length, "mm" if rod is not None else None))


def _write_3dm(problem: BendProblem, solutions: Sequence[BendSolution], part: Path, rod: Rod | None) -> None:
    from batten.io.rhino_curves import write_curves_3dm

    curves = drawn_curves(bend_numbers(solutions, rod))
    write_curves_3dm(curves, part, TOLERANCE * problem.length, "mm" if rod is not None else None)


def _write_json(problem: BendProblem, solutions: Sequence[BendSolution], part: Path, rod: Rod | None) -> None:
    from batten.io.bend_json import bend_json

    _write_text(part, bend_json(problem, solutions, rod))


def _write_png(problem: BendProblem, solutions: Sequence[BendSolution], part: Path, rod: Rod | None) -> None:
    from batten.io.bend_picture import write_bend_png

    write_bend_png(problem, solutions, part, rod)


_WRITERS: dict[str, Writer] = {
    ".svg": _write_svg,
    ".dxf": _write_dxf,
    ".3dm": _write_3dm,
    ".json": _write_json,
    ".png": _write_png,
}
