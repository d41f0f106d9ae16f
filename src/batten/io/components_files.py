"""Files of the study of connected components: finished parts while it runs, then the text, curves as Parquet, a figure.

A folder holds `parts/`, a file for each grid and one for the random curves, and in the end

- `components.txt`: what the study prints,
- `components.parquet`: a row for each curve that the text or the figure names: `kind` ("member", "body", "neck", "other",
  "way over": knots from the thickest place to its mirror image, in order), cells on each axis of its grid (0: of none),
  control points, λ-residual, distance to the outside of the set (null: not measured),
- `components.png`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from batten.io.components_figure import figure
from batten.io.study_files import parquet_modules, written_study
from batten.io.study_parts import PARTS, keep, kept
from batten.studies.component_paths import control_points, residual
from batten.studies.components import (
    DEFAULT_SIZE,
    ComponentStudy,
    GridPart,
    SamplePart,
    check,
    finished,
    run_grid,
    run_sample,
    sizes_of,
)
from batten.studies.components_lines import lines
from batten.studies.study import Progress
from batten.typing import FloatArray


def run_in(
    directory: str | Path, size: int = DEFAULT_SIZE, seed: int = 0, progress: Progress | None = None
) -> ComponentStudy:
    """`studies.components.run` with finished parts kept in a folder: a run that was stopped goes on where it was.

    Parameters:
        directory: made where it is missing. Grids of another version of batten, and random curves of another size or seed,
            are left alone and not used.
        size, seed, progress: as in `run`.

    Returns:
        The study; it is the same as without a folder, bit for bit.

    Raises:
        InvalidInputError: a size or a seed out of range.
        OSError: the folder cannot be written to.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     paths = write(run_in(folder, 16), folder)
        ...     sorted(p.name for p in Path(folder).iterdir())
        ['components.parquet', 'components.png', 'components.txt', 'parts']
    """
    check(size, seed)
    folder = Path(directory) / PARTS
    folder.mkdir(parents=True, exist_ok=True)
    grids = []
    for cells in sizes_of(size):
        path = folder / f"components-grid-{cells}.npz"
        grid = kept(path, GridPart)
        if grid is None:
            grid = run_grid(cells, progress)
            keep(path, grid)
        grids.append(grid)
    path = folder / f"components-size-{size}-seed-{seed}.npz"
    sample = kept(path, SamplePart)
    if sample is None:
        sample = run_sample(size, seed, progress)
        keep(path, sample)
    return finished(size, seed, tuple(grids), sample)


def write(study: ComponentStudy, directory: str | Path) -> list[Path]:
    """The text, the curves and the figure of a study: components.txt, components.parquet, components.png.

    Parameters:
        study: the study. directory: made where it is missing; files of these names in it are replaced.

    Returns:
        The paths written.

    Raises:
        InvalidInputError: pyarrow, which writes Parquet, is not installed.
        OSError: the folder cannot be written to.
    """
    pyarrow, parquet = parquet_modules()
    columns = _columns(study)
    table = pyarrow.table({name: pyarrow.array(column, from_pandas=True) for name, column in columns.items()})
    return written_study(
        directory, "components", lines(study), lambda file: parquet.write_table(table, file), figure(study)
    )


def _columns(study: ComponentStudy) -> dict[str, Any]:
    kinds: list[str] = []
    cells: list[int] = []
    curves: list[FloatArray] = []
    clearances: list[float] = []

    def add(kind: str, size: int, points: FloatArray, clearance: FloatArray | None = None) -> None:
        kinds.extend([kind] * len(points))
        cells.extend([size] * len(points))
        curves.extend(points)
        clearances.extend(np.full(len(points), np.nan) if clearance is None else clearance)

    add("member", 0, study.gallery)
    for grid in study.grids:
        add("body", int(grid.size[0]), grid.peaks, grid.peak_clearances)
        add("neck", int(grid.size[0]), grid.necks[1:], grid.neck_clearances[1:])
    add("other", 0, study.sample.others[:1])
    add("way over", 0, study.paths[-1])
    inner = np.array(curves)
    numbers = control_points(inner).reshape(-1, 8).T
    names = [f"p{i}_{axis}" for i in range(4) for axis in "xy"]
    return {
        "kind": kinds,
        "cells": np.array(cells),
        **dict(zip(names, numbers)),
        "lambda_residual": residual(inner),
        "clearance": np.array(clearances),
    }
