"""JSON of the design of an elastic spline: its states, schema versioned, read back to the same numbers, bit by bit.

Numbers are written so that reading them gives the same double. Each state stands on one line.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from batten.curves.cubic_proxy import Border, CubicProxy
from batten.errors import FormatError, InvalidInputError
from batten.io.software import software_name
from batten.io.study_parts import written_file
from batten.splines.design_history import DesignState
from batten.splines.design_limits import DesignLimits
from batten.splines.elastic_spline_design import ElasticSplineDesign

FORMAT = "batten elastic spline design"
SCHEMA = 1

_Item = TypeVar("_Item")


def elastic_spline_design_json(design: ElasticSplineDesign, *, history: bool = True) -> str:
    """A design as JSON.

    At the top: `format` ("batten elastic spline design"), `schema` (1), `software`, `current` (index of the present state),
    `states`, oldest first. A state has `action` (what led there: "start" for the first, "move", "insert", "delete",
    "borders" or "limits"), `index` (of the control point, piece or joint; null without), `continuity` (1 or 2),
    `control_points` ([[x, y], …]), `borders` (null, or null or {`point`, `normal`} for each joint) and `limits` (the fields
    of `DesignLimits`, angles in radians, null for none).

    Parameters:
        design: any.
        history: whether all states are kept, undone ones included, or the present one alone.

    Example:
        >>> design = ElasticSplineDesign.line((0, 0), (3, 0))
        >>> text = elastic_spline_design_json(design)
        >>> back = read_elastic_spline_design_text(text)
        >>> json.loads(text)["schema"], back.control_points.tolist() == design.control_points.tolist()
        (1, True)
    """
    present = design.states[design.undo_depth]
    states = design.states if history else (dataclasses.replace(present, action="start", index=None),)
    head = {
        "format": FORMAT,
        "schema": SCHEMA,
        "software": software_name(),
        "current": design.undo_depth if history else 0,
    }
    lines = [f"{json.dumps(key)}: {_compact(value)}" for key, value in head.items()]
    rows = ",\n".join(_compact(_state_out(state)) for state in states)
    return "{\n" + ",\n".join([*lines, f'"states": [\n{rows}\n]']) + "\n}\n"


def write_elastic_spline_design(design: ElasticSplineDesign, path: str | Path, *, history: bool = True) -> None:
    """Write a design as a file, whole or not at all; an earlier file of this name is replaced.

    Parameters:
        design, history: as for `elastic_spline_design_json`.
        path: the file.

    Raises:
        InvalidInputError: a folder that is not there, a path that is a folder.
        OSError: the file cannot be written; then what was there before is there still.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = Path(folder) / "bow.json"
        ...     write_elastic_spline_design(ElasticSplineDesign.line((0, 0), (3, 0), 2), path)
        ...     len(read_elastic_spline_design(path).pieces)
        2
    """
    path = Path(path)
    if path.is_dir() or not path.parent.is_dir():
        came = "is a folder" if path.is_dir() else "lies in a folder that is not there"
        raise InvalidInputError(f"{path}: {came}; give the name of a file in a folder that exists")
    text = elastic_spline_design_json(design, history=history)
    written_file(path, lambda file: file.write(text.encode("utf-8")))


def read_elastic_spline_design(path: str | Path) -> ElasticSplineDesign:
    """Read such a file back.

    Parameters:
        path: a file of `write_elastic_spline_design`.

    Returns:
        The design with all states of the file, numbers the same bit by bit. A design that breaks its limits is read, too,
        and says so in `broken`.

    Raises:
        InvalidInputError: no such file.
        FormatError: as `read_elastic_spline_design_text`; the message names the file and the field.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except (FileNotFoundError, IsADirectoryError) as error:
        raise InvalidInputError(f"{path}: no such file; give a design that batten wrote") from error
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise FormatError(f"{path}: no text in UTF-8: {error}; give a design that batten wrote") from error
    return read_elastic_spline_design_text(text, str(path))


def read_elastic_spline_design_text(text: str, source: str = "JSON") -> ElasticSplineDesign:
    """The design that a text of `elastic_spline_design_json` holds.

    Parameters:
        text: the JSON.
        source: what the messages of errors call it.

    Raises:
        FormatError: no JSON, not a design, a schema that this batten does not know, a field missing, unknown or of the wrong
            kind, states that do not make a history; the message names the field.
    """
    try:
        data = json.loads(text, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{source}: not JSON: {' '.join(str(error).split())}; save the design again") from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        came = data.get("format") if isinstance(data, dict) else type(data).__name__
        raise FormatError(f'{source}: format = {came!r}: must be "{FORMAT}"; give a design that batten wrote')
    if data.get("schema") != SCHEMA:
        raise FormatError(
            f"{source}: schema = {data.get('schema')!r}: this {software_name()} reads schema {SCHEMA}; "
            f"use {data.get('software', 'the batten that wrote it')}"
        )
    entries = _item(source, "states", data, "states", _list)
    current = _item(source, "current", data, "current", _whole)
    states = [_state_in(source, f"states[{i}]", entry) for i, entry in enumerate(entries)]
    try:
        return ElasticSplineDesign.from_states(states, current)
    except InvalidInputError as error:
        raise FormatError(f"{source}: states and current: {error}") from error


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is no JSON number")


def _compact(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))


def _state_out(state: DesignState) -> dict[str, Any]:
    borders = state.proxy.borders
    return {
        "action": state.action,
        "index": state.index,
        "continuity": state.proxy.continuity,
        "control_points": state.proxy.control_points.tolist(),
        "borders": None if borders is None else [None if b is None else dataclasses.asdict(b) for b in borders],
        "limits": dataclasses.asdict(state.limits),
    }


def _state_in(source: str, place: str, entry: Any) -> DesignState:
    known = {"action", "index", "continuity", "control_points", "borders", "limits"}
    if not isinstance(entry, dict):
        raise FormatError(f"{source}: {place}: must be an object with {', '.join(sorted(known))}; got {entry!r:.60}")
    _only(source, place, entry, known)

    def read(key: str, convert: Callable[[Any], _Item]) -> _Item:
        return _item(source, f"{place}.{key}", entry, key, convert)

    points = read("control_points", _points)
    borders = read("borders", _borders)
    limits = read("limits", _limits)
    continuity = read("continuity", _whole)
    action, index = read("action", _text), read("index", lambda value: None if value is None else _whole(value))
    try:
        proxy = CubicProxy(points, continuity, borders)
    except InvalidInputError as error:
        raise FormatError(f"{source}: {place}: {error}") from error
    return DesignState(proxy, limits, action, index)


def _item(source: str, place: str, data: Mapping[str, Any], key: str, convert: Callable[[Any], _Item]) -> _Item:
    if key not in data:
        raise FormatError(f"{source}: {place}: is missing; save the design again")
    try:
        return convert(data[key])
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        reason = f"{error.args[0]!r} is missing" if isinstance(error, KeyError) else " ".join(str(error).split())
        raise FormatError(f"{source}: {place}: {reason}") from error


def _only(source: str, place: str, data: Mapping[str, Any], known: set[str]) -> None:
    unknown = sorted(set(data) - known)
    if unknown:
        raise FormatError(f"{source}: {place}: unknown field {unknown[0]!r}; allowed are {', '.join(sorted(known))}")


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise TypeError(f"must be a list; got {value!r:.60}")
    return value


def _whole(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise TypeError(f"must be a whole number; got {value!r:.60}")
    return value


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(f"must be a text; got {value!r:.60}")
    return value


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise TypeError(f"must be a finite number; got {value!r:.60}")
    return float(value)


def _pair(value: Any) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise TypeError(f"must be two numbers; got {value!r:.60}")
    return _number(value[0]), _number(value[1])


def _points(value: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array([_pair(entry) for entry in _list(value)]).reshape(-1, 2)


def _borders(value: Any) -> tuple[Border | None, ...] | None:
    return None if value is None else tuple(_border(entry) for entry in _list(value))


def _border(value: Any) -> Border | None:
    if value is None:
        return None
    if not isinstance(value, dict) or set(value) != {"point", "normal"}:
        raise TypeError(f"a border is null or has point and normal; got {value!r:.60}")
    normal = _pair(value["normal"])
    border = Border(_pair(value["point"]), normal)
    if abs(math.hypot(*normal) - 1.0) < 1e-12:
        object.__setattr__(border, "normal", normal)  # scaled once more it could differ in the last bit
    return border


def _limits(value: Any) -> DesignLimits:
    names = [field.name for field in dataclasses.fields(DesignLimits)]
    if not isinstance(value, dict) or set(value) != set(names):
        raise TypeError(f"must be an object with {', '.join(names)}; got {value!r:.60}")
    numbers: dict[str, Any] = {k: v if k == "simple" or v is None else _number(v) for k, v in value.items()}
    return DesignLimits(**numbers)
