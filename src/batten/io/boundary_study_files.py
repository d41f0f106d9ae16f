"""Files of the study of boundary value problems: parts that a later run goes on from, tables, and a figure.

A folder holds `parts/` while the study runs, one file for every 50 problems that are done, and afterwards

- `study.txt`: what the study prints,
- `problems.csv`: a line for each problem and method,
- `table-2.1.csv`, `table-b1.csv`: the tables of Fisker2018 with its numbers beside ours,
- `figure-2.13.png`: problems where a method found another elastica than the one asked for.

Every file is written under another name and renamed when it is whole.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from batten.curves.base import Curve
from batten.curves.elastica import Elastica
from batten.io.study_parts import PARTS, keep, kept, written_file
from batten.studies.boundary import (
    METHODS,
    BoundaryPart,
    BoundaryStudy,
    EnergyTable,
    answers,
    energy_table,
    joined,
    parts_of,
    run_part,
)
from batten.studies.boundary_lines import NEAREST, PAPER_ENERGIES, PAPER_TABLE, QUANTITIES, lines, statistics
from batten.studies.study import Progress, check_size
from batten.typing import FloatArray

_SHOWN = 3  # problems in the figure for each method
_DPI = 150.0


def run_in(directory: str | Path, size: int, seed: int = 0, progress: Progress | None = None) -> BoundaryStudy:
    """`studies.boundary.run` with finished parts kept in a folder: a run that was stopped goes on where it was.

    Parameters:
        directory: made where it is missing. Parts of another seed, size or version of batten in it are not used.
        size, seed, progress: as in `run`.

    Returns:
        The study; it is the same as without a folder (run times apart).

    Raises:
        InvalidInputError: a size or a seed out of range.
        OSError: the folder cannot be written to.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     study = run_in(folder, 1, seed=3)
        ...     paths = write(study, folder)
        ...     sorted(p.name for p in Path(folder).iterdir())
        ['figure-2.13.png', 'parts', 'problems.csv', 'study.txt', 'table-2.1.csv', 'table-b1.csv']
    """
    check_size(size, seed)
    folder = Path(directory) / PARTS
    folder.mkdir(parents=True, exist_ok=True)
    results = []
    for first, count in parts_of(size):
        path = folder / f"seed-{seed}-problems-{first}-to-{first + count - 1}.npz"
        part = kept(path, BoundaryPart)
        if part is None:
            part = run_part(seed, first, count, size, progress)
            keep(path, part)
        elif progress is not None:
            progress("boundary value problems", first + count, size)
        results.append(part)
    path = folder / f"seed-{seed}-energies.npz"
    energies = kept(path, EnergyTable)
    if energies is None:
        energies = energy_table(seed, progress)
        keep(path, energies)
    return BoundaryStudy(size, seed, joined(results), energies)


def write(study: BoundaryStudy, directory: str | Path) -> list[Path]:
    """The tables, the text and the figure of a study.

    Parameters:
        study: the study. directory: made where it is missing; files of these names in it are replaced.

    Returns:
        The paths written.

    Raises:
        OSError: the folder cannot be written to.
    """
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    text = "".join(line + "\n" for line in lines(study))
    written_file(folder / "study.txt", lambda file: file.write(text.encode()))
    _table(folder / "problems.csv", _problem_rows(study))
    _table(folder / "table-2.1.csv", _table_rows(study))
    _table(folder / "table-b1.csv", _energy_rows(study))
    figure = _figure(study)
    written_file(folder / "figure-2.13.png", lambda file: figure.savefig(file, format="png", dpi=_DPI))
    return [folder / n for n in ("study.txt", "problems.csv", "table-2.1.csv", "table-b1.csv", "figure-2.13.png")]


# --- tables ---


def _table(path: Path, rows: Iterable[Iterable[object]]) -> None:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    written_file(path, lambda file: file.write(text.getvalue().encode()))


def _problem_rows(study: BoundaryStudy) -> Iterable[Iterable[object]]:
    results = study.results
    names = ("end_error", "length_error", "runtime", "l2", "h1", "l2_nearest", "h1_nearest", "another", "converged")
    asked = ("start_x", "start_y", "start_angle", "start_curvature", "force_x", "force_y", "length")
    yield ("problem", "method", *names, "solutions", "missing", *asked)
    for i in range(study.size):
        for j, method in enumerate(METHODS):
            cells = [getattr(results, name)[i, j].item() for name in names]
            found = (int(results.solutions[i, 0]), bool(results.missing[i]))
            yield (i, method, *cells, *found, *results.parameters[i].tolist())


def _table_rows(study: BoundaryStudy) -> Iterable[Iterable[object]]:
    yield ("statistic", "quantity", "source", *METHODS)
    for word, table in statistics(study.results).items():
        for i, quantity in enumerate((*QUANTITIES, *NEAREST)):
            yield (word, quantity, "here", *table[i].tolist())
            if i < len(QUANTITIES):
                yield (word, quantity, "paper", *PAPER_TABLE[word][i])


def _energy_rows(study: BoundaryStudy) -> Iterable[Iterable[object]]:
    updates = [f"update {i}" for i in range(study.energies.energies.shape[1] - 1)]
    yield ("source", "example", "exact", "bezier", *updates)
    for i, (exact, row) in enumerate(zip(study.energies.exact, study.energies.energies), start=1):
        yield ("here", i, exact.item(), *row.tolist())
    for i, printed in enumerate(PAPER_ENERGIES, start=1):
        yield ("paper", i, "", *printed)


# --- the figure ---


def _figure(study: BoundaryStudy) -> Figure:
    """Some problems for each method whose answer is nearest to another elastica, as in Fisker2018 Fig. 2.13."""
    shown = [(j, np.flatnonzero(study.results.another[:, j])) for j in range(len(METHODS) - 1)]
    rows = [(j, numbers[np.argsort(-study.results.l2[numbers, j])][:_SHOWN]) for j, numbers in shown if numbers.size]
    with matplotlib.rc_context({"font.size": 8.0}):
        figure = Figure(figsize=(7.5, 0.6 + 2.4 * max(len(rows), 1)), layout="constrained")
        FigureCanvasAgg(figure)
        figure.suptitle("red: the elastica asked for; black: the one that the method found", fontsize=9.0)
        if not rows:
            figure.text(0.5, 0.4, "every method found the elastica that was asked for", ha="center")
        for line, (j, numbers) in enumerate(rows):
            for column, number in enumerate(numbers.tolist()):
                axes = figure.add_subplot(len(rows), _SHOWN, _SHOWN * line + column + 1)
                elastica = Elastica.from_parameters(study.results.parameters[number])
                axes.plot(*_points(elastica).T, color="#c0392b", linewidth=1.4)
                axes.plot(*_points(answers(elastica)[0][j]).T, color="black", linewidth=0.9)
                axes.set_title(f"{METHODS[j]}: L² {study.results.l2[number, j]:.2f}", fontsize=8.0)
                axes.set_aspect("equal")
                axes.axis("off")
    return figure


def _points(curve: Curve) -> FloatArray:
    return curve.point(np.linspace(0.0, 1.0, 400))
