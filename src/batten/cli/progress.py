"""Progress on stderr: bars on a terminal; elsewhere, when all is done, a plain line for each stage of over a second."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

_SLOW_S = 1.0


class StageProgress:
    """Call it as `progress(stage, done, total)`; a stage begins with its first call and ends with done = total."""

    def __init__(self) -> None:
        self._bars: Progress | None = None
        self._tasks: dict[str, TaskID] = {}
        self._began: dict[str, float] = {}
        self._took: dict[str, float] = {}

    def __enter__(self) -> StageProgress:
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import (
                BarColumn,
                MofNCompleteColumn,
                Progress,
                TextColumn,
                TimeElapsedColumn,
                TimeRemainingColumn,
            )

            self._bars = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TimeElapsedColumn(),
                TimeRemainingColumn(),
                console=Console(stderr=True),
                transient=True,
            )
            self._bars.start()
        return self

    def __call__(self, stage: str, done: int, total: int) -> None:
        now = time.monotonic()
        self._began.setdefault(stage, now)
        if self._bars is not None:
            if stage not in self._tasks:
                self._tasks[stage] = self._bars.add_task(stage, total=total)
            self._bars.update(self._tasks[stage], completed=done, total=total)
        self._took[stage] = now - self._began[stage]

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bars is not None:
            self._bars.stop()
        elif error is None:  # an error is told in one line, and that line alone
            for stage, seconds in self._took.items():
                if seconds >= _SLOW_S:
                    print(f"{stage}: {seconds:.1f} s", file=sys.stderr)
