"""What every sampled study is: parts with random numbers of their own, run in threads or on a cluster, and joined."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import closing
from dataclasses import dataclass, fields
from itertools import islice
from typing import Any, Generic, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from batten.errors import InvalidInputError

Progress: TypeAlias = Callable[[str, int, int], None]
"""Called as progress(stage, done, total)."""

Record = TypeVar("Record")
"""A frozen dataclass of arrays with the same first axis, a row for each curve. Large samples may hold float32."""

Columns: TypeAlias = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Study(Generic[Record]):
    """One of the papers' experiments on random curves.

    Attributes:
        name: word of the command and stem of the files.
        part_size: curves of a part; each part draws from default_rng([seed, part]), so that the number of workers does
            not matter.
        record: type of the results.
        run_part: (seed, part, count) to the results of `count` curves; a function of a module, so that it can be sent to
            another machine.
        lines: what is printed, the paper's figures beside ours.
        columns: columns of NAME.parquet for the results of one part; NaN becomes null.
    """

    name: str
    part_size: int
    record: type[Record]
    run_part: Callable[[int, int, int], Record]
    lines: Callable[[Outcome[Record]], list[str]]
    columns: Callable[[Record], Columns]

    def parts_of(self, size: int) -> list[tuple[int, int]]:
        """Number and size of each part of a study of this size; only the last may be smaller."""
        step = self.part_size
        return [(i, min(step, size - i * step)) for i in range(-(-size // step))]


@dataclass(frozen=True, eq=False)
class Outcome(Generic[Record]):
    """A whole study: which, its size and seed, and the results of all parts joined in their order."""

    study: Study[Record]
    size: int
    seed: int
    results: Record

    def parts(self) -> Iterator[Record]:
        """The results part by part, as views."""
        for i, count in self.study.parts_of(self.size):
            yield rows_of(self.results, slice(i * self.study.part_size, i * self.study.part_size + count))


class PartsJoined(Generic[Record]):
    """Arrays for all parts of a study, made when the first part comes and filled as they come: nothing is held twice."""

    def __init__(self, study: Study[Record], size: int) -> None:
        self._study, self._size = study, size
        self._arrays: dict[str, NDArray[Any]] = {}
        self.done = 0

    def put(self, number: int, part: Record) -> None:
        """Copy the results of one part to their place."""
        first = number * self._study.part_size
        count = min(self._study.part_size, self._size - first)
        for f in fields(self._study.record):  # type: ignore[arg-type]  # a dataclass
            rows = np.asarray(getattr(part, f.name))
            if f.name not in self._arrays:
                self._arrays[f.name] = np.empty((self._size, *rows.shape[1:]), rows.dtype)
            whole = self._arrays[f.name]
            if rows.shape != (count, *whole.shape[1:]) or rows.dtype != whole.dtype:
                raise InvalidInputError(
                    f"part {number} of the study {self._study.name!r} has {f.name} of shape {rows.shape}, {rows.dtype}; "
                    f"it should be {(count, *whole.shape[1:])}, {whole.dtype}, as in the other parts"
                )
            whole[first : first + count] = rows
        self.done += count

    def whole(self) -> Record:
        """The results of all parts, once each has been put."""
        return self._study.record(**self._arrays)


def rows_of(record: Record, rows: slice) -> Record:
    """Some rows of results, as views."""
    every = fields(record)  # type: ignore[arg-type]  # a dataclass
    return type(record)(**{f.name: getattr(record, f.name)[rows] for f in every})


def check_size(size: int, seed: int) -> None:
    """Refuse sizes below 1 and seeds below 0: `InvalidInputError`."""
    if not (isinstance(size, int | np.integer) and size >= 1 and isinstance(seed, int | np.integer) and seed >= 0):
        raise InvalidInputError(f"a study has a size ≥ 1 and a seed ≥ 0, whole numbers; got {size!r}, {seed!r}")


def run(
    study: Study[Record],
    size: int,
    seed: int = 0,
    progress: Progress | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
) -> Outcome[Record]:
    """A study of `size` random curves.

    Parameters:
        study: which. size: number of curves, ≥ 1. seed: ≥ 0; the same seed gives the same numbers, bit for bit, whatever
            the number of workers, on one machine or several of one kind; to rounding (1e-13) in the process that compiles
            the kernels, once after an installation, and on machines of another kind.
        progress: called as progress(name, done, size) when a part is done.
        workers: threads, ≥ 1; None takes one for each core.
        scheduler: address of a dask.distributed scheduler, such as "tcp://10.0.0.1:8786", whose workers run the parts
            (extra `dist`); not together with `workers`.

    Returns:
        The `Outcome`; `study.lines` prints it.

    Raises:
        InvalidInputError: size, seed or workers out of range, no scheduler at the address, workers that cannot run
            batten or run another version, or the extra is missing.

    Example:
        >>> from batten.studies.projection import STUDY
        >>> outcome = run(STUDY, 2000, seed=1)
        >>> outcome.results.before.shape
        (2000,)
    """
    check_size(size, seed)
    joined = PartsJoined(study, size)
    with closing(run_parts(study, seed, study.parts_of(size), workers=workers, scheduler=scheduler)) as parts:
        for number, part in parts:
            joined.put(number, part)
            if progress is not None:
                progress(study.name, joined.done, size)
    return Outcome(study, size, seed, joined.whole())


def run_parts(
    study: Study[Record],
    seed: int,
    parts: Sequence[tuple[int, int]],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
) -> Generator[tuple[int, Record], None, None]:
    """Some parts of a study, (number, size), each with its number as it is done, in any order; arguments as in `run`.

    Only a few parts are ahead of the one that is taken, so that a slow taker does not fill the memory. Close the iterator
    to stop early: parts in work are waited for in threads, and given up on a cluster.
    """
    if workers is not None and not (isinstance(workers, int | np.integer) and workers >= 1):
        raise InvalidInputError(f"workers is a whole number ≥ 1, or None for one on each core; got {workers!r}")
    if scheduler is None:
        return _run_in_threads(study, seed, parts, int(workers or os.cpu_count() or 1))
    if workers is not None:
        raise InvalidInputError("give workers or a scheduler: a cluster has as many workers as were started for it")
    from batten.studies.cluster import run_on_cluster

    return run_on_cluster(study, seed, parts, scheduler)


def _run_in_threads(
    study: Study[Record], seed: int, parts: Sequence[tuple[int, int]], workers: int
) -> Generator[tuple[int, Record], None, None]:
    """Kernels let other threads run, so threads are enough."""
    waiting = iter(parts)
    pool = ThreadPoolExecutor(workers, thread_name_prefix=f"batten-{study.name}")
    running: dict[Future[Record], int] = {}
    try:
        for number, count in islice(waiting, 2 * workers):
            running[pool.submit(study.run_part, seed, number, count)] = number
        while running:
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in sorted(done, key=running.__getitem__):
                number = running.pop(future)
                for following, count in islice(waiting, 1):
                    running[pool.submit(study.run_part, seed, following, count)] = following
                yield number, future.result()
    finally:
        pool.shutdown(cancel_futures=True)
