"""The parts of a study on a dask.distributed cluster (extra `dist`)."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from types import ModuleType
from typing import Any

import batten
from batten.errors import InvalidInputError
from batten.studies.study import Record, Study

_TASK_S = 0.05
"""Least time that a task should take, seconds: a scheduler needs about a millisecond for each."""

_AHEAD = 3
"""Tasks handed out for each thread of the cluster."""

_CONNECT_S = 10.0
_WORKERS_S = 60.0
_MOST_IN_TASK = 64


def run_on_cluster(
    study: Study[Record], seed: int, parts: Sequence[tuple[int, int]], address: str
) -> Generator[tuple[int, Record], None, None]:
    """As `studies.study.run_parts`, on the workers of a scheduler.

    Parts go out in bundles that take 50 ms or more, a few for each thread of the cluster at a time. The scheduler gives
    the tasks of lost workers to others, and workers that join take part. The first task that fails ends the run.

    Parameters:
        study, seed, parts: as in `run_parts`. address: of the scheduler, such as "tcp://10.0.0.1:8786".

    Raises:
        InvalidInputError: the extra is missing, no scheduler answers, or workers cannot run this version of batten.
    """
    if not parts:
        return
    distributed = _distributed()
    with _quiet():
        try:
            client = distributed.Client(address, timeout=_CONNECT_S, set_as_default=False, name="batten study")
        except (OSError, ValueError, TypeError) as error:
            raise InvalidInputError(
                f"no scheduler answers at {address!r} ({error}); give the address that `dask scheduler` prints, "
                '"tcp://HOST:PORT"'
            ) from error
        try:
            yield from _bundles(client, distributed, study, seed, parts)
        finally:
            client.close()  # gives up what is still in work


@contextmanager
def _quiet() -> Iterator[None]:
    """Lost workers are made good and a lost scheduler is an error: nobody needs the client's tracebacks about them."""
    loggers = [logging.getLogger(f"distributed.{name}") for name in ("client", "comm", "utils")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels):
            logger.setLevel(level)


def _bundles(
    client: Any, distributed: ModuleType, study: Study[Record], seed: int, parts: Sequence[tuple[int, int]]
) -> Generator[tuple[int, Record], None, None]:
    waiting = iter(parts)
    bundle = 1  # parts
    finished = distributed.as_completed(with_results=True, raise_errors=False, loop=client.loop)

    def hand_out() -> None:
        """As many bundles as the cluster can use; while it has no workers, as for one."""
        most = _AHEAD * max(1, sum(client.nthreads().values()))
        while finished.count() < most:
            taken = list(islice(waiting, bundle))
            if not taken:
                return
            finished.add(client.submit(_run_bundle, study.run_part, seed, taken, pure=False))

    try:
        client.wait_for_workers(1, timeout=_WORKERS_S)
    except TimeoutError as error:
        raise InvalidInputError(
            f"the scheduler has had no worker for {_WORKERS_S:.0f} s; start some with `dask worker ADDRESS`"
        ) from error
    hand_out()
    for future, result in finished:
        if future.status != "finished":
            raise _failure(distributed, future, result)
        version, seconds, records = result
        future.release()
        if version != batten.__version__:
            raise InvalidInputError(
                f"a worker of the cluster runs batten {version}, this is {batten.__version__}; results are the same only "
                "with the same version: install it there"
            )
        if seconds < _TASK_S:
            bundle = min(_MOST_IN_TASK, max(bundle, int(_TASK_S * len(records) / max(seconds, 1e-6)) + 1))
        hand_out()
        yield from records


def _run_bundle(
    run_part: Callable[[int, int, int], Record], seed: int, parts: list[tuple[int, int]]
) -> tuple[str, float, list[tuple[int, Record]]]:
    """What a worker does: some parts. The version of batten, how long it took, and the parts with their numbers."""
    began = time.perf_counter()
    records = [(number, run_part(seed, number, count)) for number, count in parts]
    return batten.__version__, time.perf_counter() - began, records


def _failure(distributed: ModuleType, future: Any, result: Any) -> BaseException:
    """What to raise for a task that failed."""
    if future.status == "cancelled":
        return InvalidInputError(
            "the scheduler ended or gave up the study's tasks; start both again: what a folder (-o) holds is kept"
        )
    error: BaseException = result[1] if isinstance(result, tuple) else result
    if isinstance(error, ImportError):
        return InvalidInputError(
            f"a worker of the cluster cannot load batten ({error}); install batten {batten.__version__} there"
        )
    if isinstance(error, distributed.KilledWorker):
        return InvalidInputError(
            f"several workers of the cluster died with the same task ({error}); have they enough memory?"
        )
    return error


def _distributed() -> ModuleType:
    try:
        import distributed
    except ImportError as error:
        raise InvalidInputError(
            'a scheduler needs the package distributed, which is not installed; install batten with the extra "dist", or '
            "leave --scheduler out"
        ) from error
    return distributed
