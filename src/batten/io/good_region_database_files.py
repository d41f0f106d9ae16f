"""The database of good regions as a Parquet file, and a picture of how its grids are refined.

The file has a row for each cubic, the six numbers of `solvers.good_region_database.COLUMNS`, and in its metadata, under
`batten`, the grids and limits that it was built with, as JSON.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from batten.errors import FormatError
from batten.io.study_files import parquet_modules
from batten.io.study_parts import written_file
from batten.measures.lambda_residual import lambda_residual
from batten.solvers.good_region_database import (
    CELLS,
    COLUMNS,
    SPACING,
    GoodRegionDatabase,
    build_good_region_database,
    refined_grid,
    standard_cubics,
)
from batten.typing import ArrayLike, FloatArray

PARQUET, PICTURE = "good-regions.parquet", "good-regions.png"
"""Names of the files in a folder."""

_KEY, _FORMAT = b"batten", 1
_FIELDS = ("spacing", "cells", "residual_below", "angle_error_below")
_DPI = 130.0


def write_good_region_database(database: GoodRegionDatabase, path: str | Path) -> None:
    """Write a database as one Parquet file, whole or not at all.

    Raises:
        InvalidInputError: pyarrow is not installed. OSError: the file cannot be written.
    """
    pyarrow, parquet = parquet_modules()
    about = {"format": _FORMAT, **{name: getattr(database, name) for name in _FIELDS}}
    table = pyarrow.table({name: pyarrow.array(column) for name, column in zip(COLUMNS, database.rows.T)})
    table = table.replace_schema_metadata({_KEY: json.dumps(about).encode()})
    written_file(Path(path), lambda file: parquet.write_table(table, file))


def read_good_region_database(path: str | Path) -> GoodRegionDatabase:
    """Read what `write_good_region_database` wrote, bit by bit the same.

    Raises:
        FormatError: the file is no Parquet, or no database of good regions. InvalidInputError: pyarrow is not installed.
        OSError: the file cannot be read.
    """
    pyarrow, parquet = parquet_modules()
    try:
        table = parquet.read_table(Path(path))
    except pyarrow.ArrowException as error:
        raise FormatError(f"{path}: not a Parquet file: {error}") from error
    try:
        about = json.loads((table.schema.metadata or {})[_KEY])
        rows = np.column_stack([table.column(name).to_numpy() for name in COLUMNS]).astype(np.float64)
        kept = (
            float(about["spacing"]), int(about["cells"]), float(about["residual_below"]), float(about["angle_error_below"])
        )  # fmt: skip
        known = about["format"] == _FORMAT
    except (KeyError, ValueError, TypeError) as error:
        raise FormatError(
            f"{path}: not a database of good regions: it lacks {error}; write one with `batten study database -o DIR`"
        ) from error
    if not known or not np.isfinite(rows).all():
        raise FormatError(f"{path}: format {about['format']!r} with finite rows is {_FORMAT}; write it again")
    return GoodRegionDatabase(rows, *kept)


def good_region_database_at(
    path: str | Path, progress: Callable[[str, int, int], None] | None = None
) -> GoodRegionDatabase:
    """The database of a file; where there is none, it is built with the default grids and written there.

    Raises:
        As `read_good_region_database` and `write_good_region_database`: a file that is something else is left alone.
    """
    if Path(path).is_file():
        return read_good_region_database(path)
    parquet_modules()  # before the work
    database = build_good_region_database(progress=progress)
    write_good_region_database(database, path)
    return database


def write_database_folder(
    directory: str | Path, progress: Callable[[str, int, int], None] | None = None
) -> tuple[GoodRegionDatabase, list[Path]]:
    """Build the database and write it with a picture like Fig. 5.6 of Fisker2018: (database, the paths written).

    Parameters:
        directory: made where it is missing; files of these names in it are replaced.
        progress: called as progress(stage, done, total).

    Raises:
        InvalidInputError: pyarrow is not installed. OSError: the folder cannot be written to.
    """
    parquet_modules()
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    database = build_good_region_database(progress=progress)
    paths = [folder / PARQUET, folder / PICTURE]
    write_good_region_database(database, paths[0])
    figure = grids_figure()
    written_file(paths[1], lambda file: figure.savefig(file, format="png", dpi=_DPI))
    return database, paths


def database_lines(database: GoodRegionDatabase) -> list[str]:
    """What `batten study database` prints."""
    limit = np.degrees(database.angle_error_below)
    reach = database.cells * database.spacing
    return [
        f"{len(database.rows):,} cubic Béziers in standard position with λ-residual < {database.residual_below:g} and angle "
        f"error < {limit:g}° (Fisker2018 §5.2: about 385,000)",
        f"uniform grids of spacing {database.spacing:g} up to {reach:g} from (0, ½), refined by the λ-residual's gradient",
    ]


def grids_figure(place: ArrayLike = (-1.375, 2.125)) -> Figure:
    """Like Fig. 5.6 of Fisker2018: e_λ by the place of c₂ for one c₁, the refined grid, and ‖∇e_λ‖; cusps dashed."""
    c1 = np.asarray(place, dtype=np.float64)
    grid = refined_grid(c1, 2)
    reach = SPACING * CELLS
    figure = Figure(figsize=(13.5, 4.9), layout="constrained")
    FigureCanvasAgg(figure)
    left, middle, right = figure.subplots(1, 3, sharex=True, sharey=True)
    residual = lambda_residual(standard_cubics(c1, grid.fine), tolerance=1e-4)
    dots = left.scatter(*grid.fine.T, c=residual, s=1.5, cmap="viridis", vmin=0.0, vmax=1.0, linewidths=0)
    figure.colorbar(dots, ax=left, shrink=0.8)
    middle.scatter(*grid.fine.T, c="#33414d", s=0.8, linewidths=0)
    steep = np.where(np.isnan(grid.gradients), np.inf, grid.gradients)
    top = float(np.percentile(steep, 90.0))
    dots = right.scatter(*grid.coarse.T, c=steep, s=9.0, cmap="magma", vmin=0.0, vmax=top, linewidths=0)
    figure.colorbar(dots, ax=right, shrink=0.8, extend="max")
    for axes, title in ((left, "λ-residual by c₂"), (middle, "refined grid of c₂"), (right, "‖∇e_λ‖ by c₂")):
        _points_and_cusps(axes, c1)
        axes.set(xlim=(-reach, reach), ylim=(0.5 - reach, 0.5 + reach), aspect="equal")
        axes.set_title(title, size=11)
    return figure


def cusp_places(c1: FloatArray, count: int = 801) -> FloatArray:
    """Places (count, 2) of c₂ at which the cubic with c₁, c₃ = (0, 1), c₄ = (0, 0) has a cusp, for t from 0 to 1.

    γ'(t) = 0 is linear in c₂: (1−t)² (c₂ − c₁) + 2t(1−t) (c₃ − c₂) + t² (c₄ − c₃) = 0. NaN where c₂ drops out, at t = 1/3.
    """
    t = np.linspace(0.0, 1.0, count)[:, None]
    u = 1.0 - t
    c3 = np.array([0.0, 1.0])
    factor = u * u - 2.0 * t * u
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(np.abs(factor) < 1e-12, np.nan, (u * u * c1 - 2.0 * t * u * c3 + t * t * c3) / factor)


def _points_and_cusps(axes: Axes, c1: FloatArray) -> None:
    cusps = cusp_places(c1)
    cusps[np.abs(cusps).max(axis=1) > 50.0] = np.nan
    axes.plot(*cusps.T, "--", color="black", lw=1.1)
    for point, name in ((c1, "c₁"), ((0.0, 1.0), "c₃"), ((0.0, 0.0), "c₄")):
        x, y = float(point[0]), float(point[1])
        axes.plot(x, y, "o", color="#d24a12", ms=5)
        axes.annotate(name, (x, y), xytext=(5, 4), textcoords="offset points", size=11, color="#d24a12")
