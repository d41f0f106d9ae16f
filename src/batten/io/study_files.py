"""Files of a sampled study: finished parts while it runs, then a table, the curves as Parquet, and a figure.

A folder holds `parts/`, a file for each part that is done, and in the end `NAME.txt`, `NAME.parquet` (a row for each curve,
a row group for each part) and `NAME.png`. Several studies may share a folder: parts and files carry the study's name, and
parts also seed, number, size and the version of batten.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import IO, Any

from matplotlib.figure import Figure

from batten.errors import InvalidInputError
from batten.io.study_parts import PARTS, keep, kept, written_file
from batten.studies.study import Outcome, PartsJoined, Progress, Record, Study, check_size, run_parts

_DPI = 130.0


def run_in(
    study: Study[Record],
    directory: str | Path,
    size: int,
    seed: int = 0,
    progress: Progress | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
) -> Outcome[Record]:
    """`studies.study.run` with finished parts kept in a folder: a run that was stopped or killed goes on where it was.

    Parameters:
        study, size, seed, progress, workers, scheduler: as in `run`.
        directory: made where it is missing. Parts of another study, seed, size of part or version of batten in it are
            left alone and not used; those of a study of another size are, where they are whole parts.

    Returns:
        The outcome; it is the same as without a folder, bit for bit.

    Raises:
        InvalidInputError: as `run`.
        OSError: the folder cannot be written to.

    Example:
        >>> import tempfile
        >>> from batten.studies.projection import STUDY
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     outcome = run_in(STUDY, folder, 100, seed=3)
        ...     paths = write(outcome, folder)
        ...     sorted(p.name for p in Path(folder).iterdir())
        ['parts', 'projection.parquet', 'projection.png', 'projection.txt']
    """
    check_size(size, seed)
    folder = Path(directory) / PARTS
    folder.mkdir(parents=True, exist_ok=True)
    paths = {i: folder / f"{study.name}-seed-{seed}-part-{i}-of-{count}.npz" for i, count in study.parts_of(size)}
    joined = PartsJoined(study, size)
    missing = []
    for number, count in study.parts_of(size):
        part = kept(paths[number], study.record)
        if part is None:
            missing.append((number, count))
        else:
            joined.put(number, part)
    if joined.done and progress is not None:
        progress(study.name, joined.done, size)
    with closing(run_parts(study, seed, missing, workers=workers, scheduler=scheduler)) as parts:
        for number, part in parts:
            keep(paths[number], part)
            joined.put(number, part)
            if progress is not None:
                progress(study.name, joined.done, size)
    return Outcome(study, size, seed, joined.whole())


def write(outcome: Outcome[Record], directory: str | Path) -> list[Path]:
    """The text, the curves and the figure of a study: NAME.txt, NAME.parquet, NAME.png.

    Parameters:
        outcome: the study. directory: made where it is missing; files of these names in it are replaced.

    Returns:
        The paths written.

    Raises:
        InvalidInputError: pyarrow, which writes Parquet, is not installed.
        OSError: the folder cannot be written to.
    """
    pyarrow, parquet = parquet_modules()
    name = outcome.study.name
    figure = import_module(f"batten.io.{name}_figure").figure(outcome)
    return written_study(
        directory,
        name,
        outcome.study.lines(outcome),
        lambda file: _write_parquet(outcome, file, pyarrow, parquet),
        figure,
    )


def written_study(
    directory: str | Path, name: str, lines: Sequence[str], fill_parquet: Callable[[IO[bytes]], object], figure: Figure
) -> list[Path]:
    """NAME.txt, NAME.parquet and NAME.png in a folder that is made where it is missing, each whole or not at all."""
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    text = "".join(line + "\n" for line in lines)
    paths = [folder / f"{name}.{ending}" for ending in ("txt", "parquet", "png")]
    written_file(paths[0], lambda file: file.write(text.encode()))
    written_file(paths[1], fill_parquet)
    written_file(paths[2], lambda file: figure.savefig(file, format="png", dpi=_DPI))
    return paths


def parquet_modules() -> tuple[ModuleType, ModuleType]:
    """pyarrow and pyarrow.parquet, or `InvalidInputError` that names the extra."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise InvalidInputError(
            'Parquet needs pyarrow, which is not installed; install batten with the extra "studies", or leave -o out'
        ) from error
    return pyarrow, parquet


def _write_parquet(outcome: Outcome[Record], file: IO[bytes], pyarrow: ModuleType, parquet: ModuleType) -> None:
    """Part by part, so that the table is never in memory as a whole."""
    tables = _tables(outcome, pyarrow)
    first = next(tables)
    with parquet.ParquetWriter(file, first.schema) as writer:
        writer.write_table(first)
        for table in tables:
            writer.write_table(table)


def _tables(outcome: Outcome[Record], pyarrow: ModuleType) -> Iterator[Any]:
    for part in outcome.parts():
        columns = outcome.study.columns(part)
        yield pyarrow.table({name: pyarrow.array(column, from_pandas=True) for name, column in columns.items()})
