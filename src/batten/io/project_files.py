"""A drawing's paths brought close to elastica, file to file, and what is said about it: what `batten project` does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from batten.errors import InvalidInputError
from batten.io.bezier_paths import BezierPath, DrawingFile, JsonPaths
from batten.io.path_drawings import ENDINGS, write_paths
from batten.measures.curvature_fit import curvature_fit
from batten.measures.lambda_class import LAMBDA_CLASSES, lambda_class
from batten.solvers.bezier_projection import Keep, Method
from batten.solvers.path_projection import LEFT, NOT_FINITE, SMOOTH_WITHIN, PathProjection, project_path
from batten.typing import FloatArray

READABLE = (".svg", ".json", ".3dm")
"""The endings of drawings that can be read."""


class ProjectedPath(NamedTuple):
    """One path of a drawing before and after.

    Attributes:
        path: as it was read.
        projection: what `project_path` made of it.
        moved: how far the new cubics lie from the old ones at most, as a share of the path's length, within 1 % of it.
    """

    path: BezierPath
    projection: PathProjection
    moved: float


def read_drawing(path: str | Path) -> DrawingFile:
    """The paths of a .svg, .json or .3dm file: see `SvgPaths`, `JsonPaths`, `RhinoPaths`.

    Raises:
        InvalidInputError: no such file, another ending, or no curves in it.
        FormatError: the file cannot be understood.
    """
    path = Path(path)
    if path.suffix.lower() not in READABLE:
        raise InvalidInputError(f"{path}: has the ending {path.suffix or 'none'}; allowed are {', '.join(READABLE)}")
    if not path.is_file():
        raise InvalidInputError(f"{path}: {'is a folder' if path.is_dir() else 'no such file'}; give a drawing")
    drawing: DrawingFile
    if path.suffix.lower() == ".svg":
        from batten.io.svg_paths import SvgPaths

        drawing = SvgPaths(path)
    elif path.suffix.lower() == ".3dm":
        from batten.io.rhino_paths import RhinoPaths

        drawing = RhinoPaths(path)
    else:
        drawing = JsonPaths(path)
    if not drawing.paths:
        raise InvalidInputError(f"{path}: has no curves to project; {'; '.join(drawing.notes) or 'it is empty'}")
    return drawing


def checked_out(source: str | Path, out: str | Path) -> Path:
    """The file to write, whose ending and folder are looked at before any work.

    Raises:
        InvalidInputError: another ending than .svg, .json, .3dm, .dxf; no such folder; a path that is a folder.
    """
    out = Path(out)
    if out.suffix.lower() not in ENDINGS:
        raise InvalidInputError(f"{out}: has the ending {out.suffix or 'none'}; allowed are {', '.join(ENDINGS)}")
    if out.is_dir() or not out.parent.is_dir():
        what = "is a folder" if out.is_dir() else f"there is no folder {out.parent}"
        raise InvalidInputError(f"{out}: {what}; give the path of a file in a folder that exists")
    return out


def project_paths(
    paths: Sequence[BezierPath],
    method: Method = "nearest",
    *,
    threshold: float | None = None,
    keep: Keep = "tangents",
    smooth_within: float = SMOOTH_WITHIN,
) -> list[ProjectedPath]:
    """`project_path` for every path of a drawing, with the same options.

    Raises:
        InvalidInputError: an option that `project_path` refuses.
    """
    result = []
    for path in paths:
        found = project_path(
            path.control_points,
            method,
            threshold=threshold,
            keep=keep,
            closed=path.closed,
            fixed=path.fixed,
            smooth_within=smooth_within,
        )
        result.append(ProjectedPath(path, found, _moved(path, found)))
    return result


def write_projected(drawing: DrawingFile, source: Path, results: Sequence[ProjectedPath], out: Path) -> None:
    """Write a projected drawing: as the file it came from if OUT has its ending, else its curves alone.

    Parameters:
        drawing: what was read. source: where from.
        results: one for each of its paths.
        out: the file; it may be the source. It appears whole or not at all.

    Raises:
        FormatError: a curve would not be valid in the file; nothing is written then.
        OSError: the file cannot be written.
    """
    changed = [result.projection.control_points for result in results]
    if out.suffix.lower() == source.suffix.lower():
        drawing.write(changed, out)
    else:
        write_paths([replace(path, control_points=new) for path, new in zip(drawing.paths, changed)], out)


def missed(results: Sequence[ProjectedPath]) -> list[str]:
    """The cubics that did not reach the threshold, or were left: "path, cubic 3: e_λ 0.51"."""
    lines = []
    for result in results:
        found = result.projection
        for i in np.flatnonzero(~found.reached):
            why = " (the method refuses it)" if found.status[i] in (LEFT, NOT_FINITE) else ""
            lines.append(f"{result.path.name}, cubic {i + 1}: e_λ {found.residual_after[i]:.3f}{why}")
    return lines


def project_lines(results: Sequence[ProjectedPath], notes: Sequence[str] = ()) -> list[str]:
    """The table: a line for each path, then what was left alone and what was missed.

    "e_λ" is the greatest of the path's cubics, lines counting 0; "class" the worst afterwards; "moved" how far the curve
    moved at most, in percent of the path's length; "turned" the greatest turn of a tangent.

    Example:
        >>> path = BezierPath("arch", np.array([[(0.0, 0.0), (0.0, 9.0), (3.0, 9.0), (3.0, 0.0)]]), False)
        >>> for line in project_lines(project_paths([path], "feedback")): print(line)
        path  cubics  changed    e_λ  after  class  moved %  turned °
        arch       1        1  0.748  0.013  best      10.1       0.0
    """
    head = ["path", "cubics", "changed", "e_λ", "after", "class", "moved %", "turned °"]
    rows = [head, *(_cells(result) for result in results)]
    widths = [max(map(len, column)) for column in zip(*rows)]
    lines = []
    for row in rows:
        cells = (c.ljust(w) if k in (0, 5) else c.rjust(w) for k, (c, w) in enumerate(zip(row, widths)))
        lines.append("  ".join(cells).rstrip())
    return [*lines, *notes, *(f"not reached: {line}" for line in missed(results))]


def _cells(result: ProjectedPath) -> list[str]:
    found = result.projection
    before, after = (np.nan_to_num(v, nan=0.0) for v in (found.residual_before, found.residual_after))
    worst = max(LAMBDA_CLASSES.index(str(lambda_class(float(v)))) for v in after)
    changed = int((result.path.control_points != found.control_points).any(axis=(1, 2)).sum())
    return [
        result.path.name,
        str(len(found.status)),
        str(changed),
        f"{before.max():.3f}",
        f"{after.max():.3f}",
        LAMBDA_CLASSES[worst],
        f"{100.0 * result.moved:.1f}",
        f"{np.degrees(np.abs(found.turned)).max():.1f}",
    ]


def _moved(path: BezierPath, found: PathProjection) -> float:
    """Greatest distance of 33 points of each new cubic from the old one, taken as 64 chords, over the path's length."""
    new, (first, second) = _points(found.control_points, 33)[:, :, None], _chords(_points(path.control_points, 65))
    step, away = second - first, new - first
    square = (step * step).sum(axis=-1)
    share = np.clip((away * step).sum(axis=-1) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
    distance = np.linalg.norm(away - share[..., None] * step, axis=-1).min(axis=2).max()
    length = float(np.nansum(curvature_fit(path.control_points).length))
    return float(distance) / length if length > 0.0 else 0.0


def _points(cubics: FloatArray, count: int) -> FloatArray:
    t = np.linspace(0.0, 1.0, count)[:, None]
    return np.concatenate([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3], axis=1) @ cubics


def _chords(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    return points[:, None, :-1], points[:, None, 1:]
