"""Files of the study of projections: finished parts, the curves as Parquet, the table, and a figure.

A folder holds `parts/` while the study runs, one file for every 10,000 curves that are done, and afterwards `study.txt`,
`curves.parquet` (a row for each curve: control points, λ-residual as drawn and after the projection under each pair of angle
constraints, null where it does not belong there) and `projection.png`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from batten.errors import InvalidInputError
from batten.io.study_parts import PARTS, keep, kept, written_file
from batten.studies.boundary import check_size
from batten.studies.projection import (
    PAPER,
    PART,
    ROWS,
    Progress,
    ProjectionPart,
    ProjectionStudy,
    joined,
    lines,
    parts_of,
    run_parts,
)

COLUMNS = ("p0_x", "p0_y", "p1_x", "p1_y", "p2_x", "p2_y", "p3_x", "p3_y", "before", "after", "after_relaxed",
           "after_wide", "after_outside")  # fmt: skip
_DPI = 130.0


def run_in(
    directory: str | Path, size: int, seed: int = 0, progress: Progress | None = None, *, workers: int | None = None
) -> ProjectionStudy:
    """`studies.projection.run` with finished parts kept in a folder: a run that was stopped goes on where it was.

    Parameters:
        directory: made where it is missing. Parts of another seed, size or version of batten in it are not used.
        size, seed, progress, workers: as in `run`.

    Raises:
        InvalidInputError: a size or a seed out of range.
        OSError: the folder cannot be written to.
    """
    check_size(size, seed)
    folder = Path(directory) / PARTS
    folder.mkdir(parents=True, exist_ok=True)
    wanted = parts_of(size)
    paths = {i: folder / f"projection-seed-{seed}-part-{i}-of-{count}.npz" for i, count in wanted}
    found = {i: part for i, _ in wanted if (part := kept(paths[i], ProjectionPart)) is not None}
    missing = [(i, count) for i, count in wanted if i not in found]
    for i, part in run_parts(seed, missing, workers):
        keep(paths[i], part)
        found[i] = part
        if progress is not None:
            progress("projections", min(len(found) * PART, size), size)
    return ProjectionStudy(size, seed, joined(found[i] for i, _ in wanted))


def write(study: ProjectionStudy, directory: str | Path) -> list[Path]:
    """The curves, the text and the figure of a study.

    Parameters:
        study: the study. directory: made where it is missing; files of these names in it are replaced.

    Returns:
        The paths written.

    Raises:
        InvalidInputError: pyarrow, which writes Parquet, is not installed.
        OSError: the folder cannot be written to.
    """
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise InvalidInputError(
            'curves.parquet needs pyarrow, which is not installed; install batten with the extra "studies", or leave -o out'
        ) from error
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    results = study.results
    columns = [*results.control_points.reshape(-1, 8).T, results.before, *results.after.T]
    table = pyarrow.table({n: pyarrow.array(c, from_pandas=True) for n, c in zip(COLUMNS, columns)})
    figure = _figure(study)
    paths = [folder / name for name in ("study.txt", "curves.parquet", "projection.png")]
    text = "".join(line + "\n" for line in lines(study))
    written_file(paths[0], lambda file: file.write(text.encode()))
    written_file(paths[1], lambda file: parquet.write_table(table, file))
    written_file(paths[2], lambda file: figure.savefig(file, format="png", dpi=_DPI))
    return paths


def _figure(study: ProjectionStudy) -> Figure:
    """How the λ-residuals are spread after the projection, and before it in the first row; the paper's mean as a line."""
    figure = Figure(figsize=(8.6, 6.2), layout="constrained")
    FigureCanvasAgg(figure)
    for j, axes in enumerate(figure.subplots(2, 2, sharex=True).flat):
        inside = study.inside[:, j]
        bins = np.linspace(0.0, 1.0, 101)
        axes.hist(study.results.before[inside], bins, density=True, color="#d5dce2", label="as drawn")
        axes.hist(study.results.after[inside, j], bins, density=True, color="#1f5fa8", alpha=0.85, label="projected")
        axes.axvline(PAPER[j][0] or 0.0, color="#d24a12", lw=1.2, label="the paper's mean")
        axes.set_title(f"{ROWS[j]}: {inside.mean():.1%} of the curves", size=10)
        axes.set_yticks([])
        axes.spines[["top", "right", "left"]].set_visible(False)
        axes.set_xlabel("λ-residual" if j > 1 else "")
        if j == 0:
            axes.legend(frameon=False, fontsize=9)
    return figure
