"""Job files: TOML in, a validated `CutJob` out. What is wrong is said in one line: file, line, field, a way out."""

from __future__ import annotations

import difflib
import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from batten.errors import BattenError, FormatError, InvalidInputError
from batten.fabrication.job import (
    ArmJob,
    BladeJob,
    BlocksJob,
    CellJob,
    CutJob,
    GripperJob,
    KerfJob,
    KinematicsJob,
    LeavesJob,
    RodJob,
    SurfaceJob,
)
from batten.fabrication.kerf import fit_blade_to_law
from batten.io.cell_fields import ArmSection, CellSection
from batten.io.job_fields import JobFile, SurfaceSection

_Model = TypeVar("_Model", bound=BaseModel)


def load_job(path: str | Path) -> CutJob:
    """Read a job file.

    Parameters:
        path: the TOML file. Paths inside it are relative to its own folder.

    Returns:
        The job, every value inside its bounds (docs/job-file.md lists them), its paths absolute.

    Raises:
        FormatError: no TOML, an unknown field, a missing field. The message is one line: file, line, field, what came,
            what is allowed, what to try.
        InvalidInputError: a value outside its bounds, values that contradict each other, a file that is not there.
    """
    path = Path(path)
    text, data = read_toml(path, "a job file", "examples/freeform-wall/wall.toml")
    job = job_from_model(validated(JobFile, data, path, text), path)
    _hold_together(job, path, text)
    return job


def read_toml(path: Path, kind: str, example: str) -> tuple[str, dict[str, Any]]:
    """A TOML file's text and what it says; `kind` ("a job file") and `example` are for the messages.

    Raises:
        FormatError: no TOML. InvalidInputError: no such file, or one that cannot be read.
    """
    text = _read_text(path, kind)
    try:
        return text, tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FormatError(
            f"{path}: not a TOML file: {_one_line(str(error))}; write `key = value` lines under [sections], as in "
            f"{example}"
        ) from error


def validated(root: type[_Model], data: Mapping[str, Any], path: Path, text: str) -> _Model:
    """The model of what a TOML file says; errors name the file, the line in its `text`, the field and a way out.

    Raises:
        FormatError: an unknown or a missing field. InvalidInputError: a value outside its bounds.
    """
    try:
        return root.model_validate(data)
    except ValidationError as error:
        raise _explain(error, path, text, data, root) from error


def job_from_model(model: JobFile, path: Path) -> CutJob:
    """The plain values of a validated job file that lies at `path`."""
    return CutJob(
        name=model.name if model.name is not None else path.stem,
        path=path.resolve(),
        surface=_surface(model.surface, path.resolve().parent),
        blocks=BlocksJob(**dict(model.blocks)),
        leaves=LeavesJob(**dict(model.leaves)),
        rod=RodJob(**dict(model.rod)),
        blade=BladeJob(**dict(model.blade)),
        kerf=KerfJob(**dict(model.kerf)),
        gripper=GripperJob(**dict(model.gripper)),
        cell=_cell(model.cell),
    )


def _surface(section: SurfaceSection, folder: Path) -> SurfaceJob:
    return SurfaceJob(
        file=None if section.file is None else folder / section.file,
        curves=None if section.curves is None else folder / section.curves,
        layer=section.layer,
        scale_mm_per_unit=section.scale_mm_per_unit,
    )


def _cell(section: CellSection) -> CellJob:
    return CellJob(**(dict(section) | {"left": _arm(section.left), "right": _arm(section.right)}))


def _arm(section: ArmSection) -> ArmJob:
    lengths = None if section.kinematics is None else KinematicsJob(**dict(section.kinematics))
    return ArmJob(**(dict(section) | {"kinematics": lengths}))


def _read_text(path: Path, kind: str) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise InvalidInputError(f"{path}: no such file; give the path of {kind} (TOML)") from error
    except UnicodeDecodeError as error:
        raise FormatError(f"{path}: not a text file in UTF-8; {kind} is TOML") from error
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be read ({error.strerror}); give the path of {kind} (TOML)") from error


def _hold_together(job: CutJob, path: Path, text: str) -> None:
    """What no single field can tell: files that must exist and values that must fit each other."""
    key = "file" if job.surface.file is not None else "curves"
    source = job.surface.source
    if not source.is_file():
        raise InvalidInputError(
            f"{_where(path, text, ('surface', key))} = {_shown(str(source))}: no such file; "
            "the path is relative to the job file, give that of a .3dm file"
        )
    shortest = min(job.blocks.size_mm)
    if job.rod.length_mm <= shortest:
        raise InvalidInputError(
            f"{_where(path, text, ('rod', 'length_mm'))} = {job.rod.length_mm:g}: a rod must be longer than its leaf, "
            f"and the leaves of these blocks are {shortest:g} mm or more; try {1.5 * shortest:g}, or smaller blocks"
        )
    _hold_kerf_together(job, path, text)
    if job.leaves.spacing_mm > shortest:
        raise InvalidInputError(
            f"{_where(path, text, ('leaves', 'spacing_mm'))} = {job.leaves.spacing_mm:g}: must be at most the block's "
            f"{shortest:g} mm; try {shortest / 30.0:g}"
        )


def _hold_kerf_together(job: CutJob, path: Path, text: str) -> None:
    try:
        fit_blade_to_law(job.kerf, job.blade)
    except InvalidInputError as error:
        raise InvalidInputError(f"{_where(path, text, ('kerf',))}: {error}") from error


def _explain(
    error: ValidationError, path: Path, text: str, data: Mapping[str, Any], root: type[BaseModel]
) -> BattenError:
    """The first thing wrong, in one line, and how many more there are."""
    found = sorted(error.errors(include_url=False), key=lambda e: e["type"] != "extra_forbidden")  # misspelt: say that
    first = found[0]
    location, model = _field_path(first["loc"], root)
    more = {_field_path(e["loc"], root)[0] for e in found} - {location}
    rest = f" (and {len(more)} more field{'s' if len(more) > 1 else ''})" if more else ""
    where = _where(path, text, location)
    if first["type"] == "extra_forbidden":
        known = list(model.model_fields) if model is not None else []
        near = difflib.get_close_matches(location[-1], known, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]}?" if near else f"known here: {', '.join(known)}"
        return FormatError(f"{where}: unknown field; {hint}{rest}")
    if _value(data, location) is None:
        return FormatError(f"{where} is missing; {_allowed(location, root)}{rest}")
    if first["type"] == "value_error":
        return InvalidInputError(f"{where}: {_one_line(str(first['ctx']['error']))}{rest}")
    return InvalidInputError(f"{where} = {_shown(_value(data, location))}: {_allowed(location, root)}{rest}")


def _field_path(loc: Sequence[int | str], root: type[BaseModel]) -> tuple[tuple[str, ...], type[BaseModel] | None]:
    """The part of pydantic's location that names fields (it goes on into list items and union members).

    Also the model in which the last name stands, for an unknown one the model it was looked up in.
    """
    names: list[str] = []
    model = root
    for part in loc:
        names.append(str(part))
        inner = section_of(model, str(part))
        if inner is None:
            return tuple(names), model
        model = inner
    return tuple(names), model


def section_of(model: type[BaseModel], name: str) -> type[BaseModel] | None:
    """The model of a field that is a section of its own, None for a plain value or an unknown name."""
    field = model.model_fields.get(name)
    if field is None:
        return None
    candidates = (field.annotation, *getattr(field.annotation, "__args__", ()))
    return next((c for c in candidates if isinstance(c, type) and issubclass(c, BaseModel)), None)


def _allowed(location: Sequence[str], root: type[BaseModel]) -> str:
    """What the field takes and an example: "a number > 0 and ≤ 1000; try 0.5"."""
    model = root
    for name in location[:-1]:
        inner = section_of(model, name)
        if inner is None:
            break
        model = inner
    if section_of(model, location[-1]) is not None:
        return f"must be one section [{'.'.join(location)}]"
    schema = model.model_json_schema(mode="validation")["properties"][location[-1]]
    return f"must be {describe_type(schema)}; try {_shown(schema['examples'][0])}"


def describe_type(schema: Mapping[str, Any]) -> str:
    """One field's JSON schema in words, for messages and for the reference."""
    if "anyOf" in schema:
        return " or ".join(describe_type(s) for s in schema["anyOf"] if s.get("type") != "null")
    if "const" in schema:
        return _shown(schema["const"])
    if "enum" in schema:
        return " or ".join(_shown(v) for v in schema["enum"])
    kind = schema["type"]
    if kind == "boolean":
        return "true or false"
    if kind == "array":
        items = schema.get("items") or schema["prefixItems"][0]
        least, most = schema["minItems"], schema["maxItems"]
        count = f"{least}" if least == most else f"{least} to {most}"
        return f"{count} values, each {describe_type(items)}"
    if kind == "string":
        return f"text of at most {schema['maxLength']} characters" if "maxLength" in schema else "text"
    words = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
    bounds = " and ".join(f"{sign} {schema[key]:.10g}" for key, sign in words.items() if key in schema)
    return f"a number {bounds}".strip()


def _value(data: Mapping[str, Any], location: Sequence[str]) -> Any:
    """The value in the file, None if it is absent (TOML has no null)."""
    value: Any = data
    for name in location:
        value = value.get(name) if isinstance(value, Mapping) else None
    return value


def _shown(value: Any) -> str:
    """A value as TOML writes it, cut to a readable length."""
    shown = json.dumps(value, ensure_ascii=False, default=str)
    shown = shown.replace("NaN", "nan").replace("Infinity", "inf") if isinstance(value, float | list) else shown
    return shown if len(shown) <= 200 else shown[:197] + "…"


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _where(path: Path, text: str, location: Sequence[str]) -> str:
    """`file:line: section.field`, without the line where it cannot be told, without the field for the whole file."""
    if not location:
        return str(path)
    line = _line_of(text, location)
    return f"{path}:{line}: {'.'.join(location)}" if line else f"{path}: {'.'.join(location)}"


def _line_of(text: str, location: Sequence[str]) -> int | None:
    """The line (from 1) on which a field or section stands; None if it is absent or written in another style."""
    section = ""
    wanted_section, key = ".".join(location[:-1]), location[-1]
    for number, line in enumerate(text.splitlines(), start=1):
        header = re.match(r"\s*\[\s*([\w.\- ]+?)\s*\]\s*(#.*)?$", line)
        if header:
            section = header.group(1).replace(" ", "")
            if section == ".".join(location):
                return number
        elif section == wanted_section and re.match(rf"\s*{re.escape(key)}\s*=", line):
            return number
    return None
