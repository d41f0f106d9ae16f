"""Paths of cubic Béziers as files hold them, and a plain JSON format for them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from batten.errors import FormatError
from batten.io.study_parts import written_file
from batten.typing import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class BezierPath:
    """One path of a drawing.

    Attributes:
        name: as the table calls it.
        control_points: (n, 4, 2), as it is seen, y up.
        closed: whether the last cubic is followed by the first.
        fixed: (n,), what must stay as it is because the file has no cubics there (arcs of circles).
    """

    name: str
    control_points: FloatArray
    closed: bool
    fixed: BoolArray = field(default_factory=lambda: np.zeros(0, bool))

    def __post_init__(self) -> None:
        if len(self.fixed) == 0:
            object.__setattr__(self, "fixed", np.zeros(len(self.control_points), bool))


class DrawingFile(Protocol):
    """A file of paths that can be written again with other control points.

    Attributes:
        paths: what was found.
        notes: what was left alone, and why; one line each.
    """

    paths: tuple[BezierPath, ...]
    notes: tuple[str, ...]

    def write(self, changed: Sequence[FloatArray], out: Path) -> None:
        """Write the file with other control points (n, 4, 2), one array for each path; whole or not at all."""


class JsonPaths:
    """A JSON file of paths: an object with the list "paths".

    Each path is an object with either "points", a list of 3 n + 1 pairs [x, y] (ends and handles in turn), or
    "control_points", a list of n lists of four pairs; with "closed" (true or false; false if it is missing) and "name", if
    wanted. y points up; the unit is yours. Everything else in the file is kept.

    Parameters:
        path: the file.

    Raises:
        FormatError: no JSON, or not of this form; the message names the file and the field.

    Example:
        >>> import tempfile
        >>> text = '{"paths": [{"name": "arch", "points": [[0, 0], [0, 1], [1, 1], [1, 0]], "colour": "red"}]}'
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     file = Path(folder) / "arch.json"
        ...     _ = file.write_text(text)
        ...     read = JsonPaths(file)
        ...     read.write([read.paths[0].control_points + 1], file)
        ...     json.loads(file.read_text())["paths"][0]["points"][-1]
        [2.0, 1.0]
    """

    def __init__(self, path: Path) -> None:
        try:
            self._document = json.loads(path.read_text("utf-8"))
        except UnicodeDecodeError as error:
            raise FormatError(f"{path}: is not UTF-8 text ({error.reason}); save it as UTF-8") from error
        except json.JSONDecodeError as error:
            raise FormatError(f"{path}: line {error.lineno}: {error.msg}; JSON is needed") from error
        rows = self._document.get("paths") if isinstance(self._document, dict) else None
        if not isinstance(rows, list):
            raise FormatError(f'{path}: has no list "paths"; needed is {{"paths": [{{"points": [[x, y], …]}}, …]}}')
        self.paths = tuple(_json_path(row, f"{path}: paths[{i}]", i + 1) for i, row in enumerate(rows))
        self.notes: tuple[str, ...] = ()

    def write(self, changed: Sequence[FloatArray], out: Path) -> None:
        """The same document with other numbers, in full precision; rows that did not change are as they were."""
        rows = [dict(row) for row in self._document["paths"]]
        for row, old, new in zip(rows, self.paths, changed):
            if not np.array_equal(old.control_points, new):
                if "points" in row:
                    row["points"] = [new[0, 0].tolist(), *new[:, 1:].reshape(-1, 2).tolist()]
                else:
                    row["control_points"] = new.tolist()
        text = json_text({**self._document, "paths": rows})
        written_file(out, lambda file: file.write(text.encode()))


def json_text(document: dict[str, Any]) -> str:
    """JSON with one line for each path."""
    head = {key: value for key, value in document.items() if key != "paths"}
    lines = [f" {json.dumps(k)}: {json.dumps(v, ensure_ascii=False)}," for k, v in head.items()]
    rows = ",\n".join(f"  {json.dumps(row, ensure_ascii=False)}" for row in document["paths"])
    return "\n".join(["{", *lines, ' "paths": [', rows, " ]", "}", ""])


def _json_path(row: Any, where: str, number: int) -> BezierPath:
    if not isinstance(row, dict):
        raise FormatError(f"{where}: is no object; needed is an object with points or control_points")
    given = [key for key in ("points", "control_points") if key in row]
    if len(given) != 1:
        raise FormatError(f"{where}: needs exactly one of points and control_points; has {len(given)} of them")
    field_name = f"{where}.{given[0]}"
    try:
        values = np.array(row[given[0]], dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise FormatError(f"{field_name}: is no list of pairs of numbers of equal length") from error
    if not np.isfinite(values).all():
        raise FormatError(f"{field_name}: holds numbers that are not finite")
    if given[0] == "points":
        if values.ndim != 2 or values.shape[1] != 2 or len(values) < 4 or len(values) % 3 != 1:
            raise FormatError(
                f"{field_name}: has shape {values.shape}; needed are 3 n + 1 pairs, n ≥ 1: ends and handles in turn"
            )
        values = np.stack([values[i : i + 4] for i in range(0, len(values) - 1, 3)])
    elif values.ndim != 3 or values.shape[1:] != (4, 2) or len(values) == 0:
        raise FormatError(f"{field_name}: has shape {values.shape}; needed is (n, 4, 2), n ≥ 1")
    closed, name = row.get("closed", False), row.get("name", f"path {number}")
    if not isinstance(closed, bool):
        raise FormatError(f"{where}.closed: is {closed!r}; allowed are true and false")
    if closed and not np.array_equal(values[0, 0], values[-1, 3]):
        raise FormatError(f"{where}.closed: is true, but the last point is not the first; add the closing cubic")
    return BezierPath(str(name), values, closed)
