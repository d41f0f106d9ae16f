"""A drawing's curves by pieces of elastica, file to file, and what is said about it: what `batten approximate` does."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

import batten
from batten.curves.base import Curve
from batten.curves.bezier import CubicBezier
from batten.curves.piecewise import PiecewiseCurve
from batten.curves.polyline import Polyline
from batten.errors import InvalidInputError
from batten.io.bezier_paths import BezierPath
from batten.io.path_drawings import write_paths
from batten.io.project_files import read_drawing
from batten.io.study_parts import written_file
from batten.splines.approximate import Approximation, Continuity, Split, approximate
from batten.typing import FloatArray

READABLE = (".svg", ".dxf", ".3dm", ".json")
"""The endings of drawings that can be read."""

_FORMAT = 1
#: How far a drawing's cubics stray from the elastica, as a share of the tolerance.
_STRAY = 1e-3


class NamedApproximation(NamedTuple):
    """One curve of a drawing: its name, itself, and what `approximate` made of it."""

    name: str
    curve: Curve
    result: Approximation


def read_curves(path: str | Path) -> tuple[list[tuple[str, Curve]], tuple[str, ...]]:
    """The curves of a .svg, .dxf, .3dm or .json file by name, and notes on what was left alone.

    See `SvgPaths`, `read_dxf_curves`, `RhinoPaths`, `JsonPaths`. Paths of straight cubics become polylines.

    Raises:
        InvalidInputError: no such file, another ending, or no curves in it.
        FormatError: the file cannot be understood.
    """
    path = Path(path)
    if path.suffix.lower() not in READABLE:
        raise InvalidInputError(f"{path}: has the ending {path.suffix or 'none'}; allowed are {', '.join(READABLE)}")
    if path.suffix.lower() == ".dxf":
        from batten.io.dxf_curves import read_dxf_curves

        if not path.is_file():
            raise InvalidInputError(f"{path}: {'is a folder' if path.is_dir() else 'no such file'}; give a drawing")
        curves, notes = read_dxf_curves(path)
    else:
        drawing = read_drawing(path)
        read = [(p.name, path_curve(p.control_points)) for p in drawing.paths]
        curves, notes = [(name, curve) for name, curve in read if curve is not None], drawing.notes
    if not curves:
        raise InvalidInputError(f"{path}: has no curves to approximate; {'; '.join(notes) or 'it is empty'}")
    return curves, notes


def path_curve(control_points: FloatArray) -> Curve | None:
    """A path of cubics (n, 4, 2) as a curve; a `Polyline` if all are straight; None if all are points.

    Example:
        >>> straight = np.array([[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0)]])
        >>> path_curve(straight).points.tolist()
        [[0.0, 0.0], [3.0, 0.0]]
    """
    rows = control_points[(control_points != control_points[:, :1]).any(axis=(1, 2))]
    if not len(rows):
        return None
    chord, away = rows[:, 3] - rows[:, 0], rows[:, 1:3] - rows[:, :1]
    square = (chord**2).sum(axis=1)[:, None]
    across = np.abs(away[..., 0] * chord[:, None, 1] - away[..., 1] * chord[:, None, 0])
    along = (away * chord[:, None]).sum(axis=-1)
    inside = (along >= -1e-9 * square) & (along <= (1.0 + 1e-9) * square)
    if ((across <= 1e-12 * square) & inside & (square > 0.0)).all():
        return Polyline(np.concatenate([rows[:1, 0], rows[:, 3]]))
    return PiecewiseCurve([CubicBezier(row) for row in rows])


def approximate_curves(
    curves: Sequence[tuple[str, Curve]], tolerance: float, continuity: Continuity = "C1", split: Split = "fewest"
) -> list[NamedApproximation]:
    """`approximate` for every curve, with the same options.

    Raises:
        InvalidInputError: an option or a tolerance that `approximate` refuses; the message names the curve.
    """
    found = []
    for name, curve in curves:
        try:
            found.append(
                NamedApproximation(name, curve, approximate(curve, tolerance, continuity=continuity, split=split))
            )
        except InvalidInputError as error:
            raise InvalidInputError(f"{name}: {error}") from error
    return found


def write_approximations(found: Sequence[NamedApproximation], out: Path) -> None:
    """Write approximations: .json with every number of the elastica, or .svg, .dxf, .3dm with cubics that follow them.

    The cubics stray from the elastica by a thousandth of the tolerance at most. The file appears whole or not at all.

    Raises:
        InvalidInputError: another ending.
        OSError: the file cannot be written.
    """
    if out.suffix.lower() == ".json":
        text = approximation_json(found)
        written_file(out, lambda file: file.write(text.encode()))
        return
    paths = []
    for name, _, result in found:
        cubics = np.stack([
            cubic.control_points
            for piece in result.pieces
            for cubic in piece.to_beziers(max(_STRAY * result.tolerance, 1e-12 * piece.length))
        ])  # fmt: skip
        closed = bool(np.hypot(*(cubics[-1, 3] - cubics[0, 0])) <= 1e-9 * result.curve.length)
        if closed:
            cubics[-1, 3] = cubics[0, 0]
        paths.append(BezierPath(name, cubics, closed))
    write_paths(paths, out)


def approximation_json(found: Sequence[NamedApproximation]) -> str:
    """Approximations as JSON; every double comes back bit by bit, and the seven numbers are `Elastica.parameters`."""
    rows = []
    for name, _, result in found:
        head = {
            "name": name,
            "status": result.status,
            "tolerance": result.tolerance,
            "distance": result.distance,
            "bisect_pieces": result.bisect_pieces,
            "joints": result.joints.tolist(),
            "corners": result.corners.tolist(),
        }
        pieces = ",\n".join(
            "   " + json.dumps({"parameters": piece.parameters.tolist(), "distance": float(distance)})
            for piece, distance in zip(result.pieces, result.distances)
        )
        rows.append(f'  {json.dumps(head, ensure_ascii=False)[:-1]}, "pieces": [\n{pieces}\n  ]}}')
    software = json.dumps(f"batten {batten.__version__}")
    names = json.dumps(["start_x", "start_y", "start_angle", "start_curvature", "force_x", "force_y", "length"])
    body = ",\n".join(rows)
    return (
        f'{{\n "format": {_FORMAT},\n "software": {software},\n "parameters": {names},\n "curves": [\n{body}\n ]\n}}\n'
    )


def approximation_lines(found: Sequence[NamedApproximation], notes: Sequence[str] = ()) -> list[str]:
    """One line for each curve: pieces, those of bisection, what is saved, the greatest distance, whether it is met."""
    head = ["curve", "pieces", "bisection", "saved %", "distance", "status"]
    rows = [head]
    for name, _, result in found:
        count = len(result.pieces)
        saved = 100.0 * (1.0 - count / result.bisect_pieces)
        rows.append([
            name, str(count), str(result.bisect_pieces), f"{saved:.0f}", f"{result.distance:.3g}", result.status,
        ])  # fmt: skip
    widths = [max(map(len, column)) for column in zip(*rows)]
    lines = [
        "  ".join(c.ljust(w) if k in (0, 5) else c.rjust(w) for k, (c, w) in enumerate(zip(row, widths))).rstrip()
        for row in rows
    ]
    return [*lines, *notes]


def checked_tolerance(tolerance: float) -> float:
    """A tolerance that is finite and above 0.

    Raises:
        InvalidInputError: another one.
    """
    if not (math.isfinite(tolerance) and tolerance > 0.0):
        raise InvalidInputError(f"--tolerance {tolerance:g}: allowed are finite numbers above 0; try 0.1")
    return tolerance
