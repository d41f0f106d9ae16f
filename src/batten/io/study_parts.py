"""Finished parts of a study, kept as files, so that a run that was stopped goes on; and files that appear whole."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import IO, Any, TypeVar

import numpy as np

import batten

PARTS = "parts"
"""Name of the folder of finished parts."""

_FORMAT = 1
_Record = TypeVar("_Record")


def keep(path: Path, record: Any) -> None:
    """Keep a dataclass of arrays as a file of numpy's."""
    arrays: dict[str, Any] = {f.name: getattr(record, f.name) for f in fields(record)}
    mark = np.array([str(_FORMAT), batten.__version__])
    written_file(path, lambda file: np.savez(file, mark=mark, **arrays))


def kept(path: Path, kind: type[_Record]) -> _Record | None:
    """What `keep` kept; None if there is none, or another version of batten kept it, or the file is no such file."""
    if not path.is_file():
        return None
    try:
        with np.load(path, allow_pickle=False) as data:
            if data["mark"].tolist() != [str(_FORMAT), batten.__version__]:
                return None
            return kind(*(data[f.name] for f in fields(kind)))  # type: ignore[arg-type]  # a dataclass of arrays
    except (ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None


def written_file(path: Path, fill: Callable[[IO[bytes]], object]) -> None:
    """Write a file under another name, and rename it when it is whole and on the drive."""
    new = path.with_name(f".{path.name}.new")
    try:
        with new.open("wb") as file:
            fill(file)
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
    finally:
        new.unlink(missing_ok=True)
