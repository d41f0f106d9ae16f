"""cut.json: everything that a cut consists of, schema versioned, read back to the same numbers, bit by bit.

Numbers are written so that reading them gives the same double. A number that does not exist (NaN: a check that does not
apply, a pose out of reach) is `null`, an infinite one "Infinity" or "-Infinity": plain JSON has neither. The lists of
blocks, rods, checks and motions have one item per line, so that two cuts can be compared with any text tool.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, TypeVar

import numpy as np

from batten.curves.elastica import Elastica
from batten.errors import FormatError
from batten.fabrication.job import CutJob
from batten.fabrication.plan import ArmMotion, Block, BlockMotion, CheckResult, CutPlan, RodPlacement
from batten.io.software import software_name
from batten.surfaces.plane import Plane
from batten.typing import FloatArray

FORMAT = "batten cut"
SCHEMA = 2
FILE_NAME = "cut.json"
INPUT_FOLDER = "input"
"""Where the files that the job refers to are kept beside cut.json."""

_INFINITE = {"Infinity": math.inf, "-Infinity": -math.inf}
_Item = TypeVar("_Item")


@dataclass(frozen=True, eq=False)
class StoredCut:
    """What cut.json holds.

    Attributes:
        plan: the plan, as it was written.
        job: the job; its paths are those of the copies beside cut.json.
        software: name and version of the batten that wrote it.
        files: SHA-256 of every other file of the cut, by path relative to cut.json (with "/").
    """

    plan: CutPlan
    job: CutJob
    software: str
    files: dict[str, str]


def write_cut_json(path: str | Path, plan: CutPlan, job: CutJob, files: Mapping[str, str]) -> None:
    """Write a cut.

    Parameters:
        path: the file to write, overwritten if it exists.
        plan: the plan.
        job: the job that it answers.
        files: SHA-256 of the other files of the cut, by path relative to `path`'s folder.
    """
    head: dict[str, Any] = {
        "format": FORMAT,
        "schema": SCHEMA,
        "software": software_name(),
        "job": _job_out(job),
        "name": plan.name,
        "blade_axis": plan.blade_axis,
        "direction_reason": plan.direction_reason,
        "facts": {key: _scalar_out(value) for key, value in plan.facts.items()},
        "files": dict(files),
    }
    lists: dict[str, Iterable[dict[str, Any]]] = {
        "blocks": (_block_out(b) for b in plan.blocks),
        "checks": (_check_out(c) for c in plan.checks),
        "rods": (_rod_out(r) for r in plan.rods),
        "motions": (_motion_out(m) for m in plan.motions),
    }
    with Path(path).open("w", encoding="utf-8", newline="\n") as file:
        file.write("{\n")
        file.write(",\n".join(f"{json.dumps(key)}: {_compact(value)}" for key, value in head.items()))
        for key, items in lists.items():
            file.write(f",\n{json.dumps(key)}: [\n" + ",\n".join(map(_compact, items)) + "\n]")
        file.write("\n}\n")


def read_cut_json(path: str | Path) -> StoredCut:
    """Read a cut back.

    Parameters:
        path: a cut.json.

    Returns:
        The cut, all numbers the same bit by bit.

    Raises:
        FormatError: no such file, no JSON, not a cut, a schema that this batten does not know, a field missing or of
            the wrong kind; the message names the file and the item.
    """
    path = Path(path)
    data = _load(path)
    if data.get("format") != FORMAT:
        raise FormatError(f'{path}: format = {data.get("format")!r}: must be "{FORMAT}"; give a cut.json of batten')
    if data.get("schema") != SCHEMA:
        raise FormatError(
            f"{path}: schema = {data.get('schema')!r}: this {software_name()} reads schema {SCHEMA}; "
            f"use {data.get('software', 'the batten that wrote it')}, or cut the job again"
        )
    plan = CutPlan(
        name=_item(path, data, "name", str),
        blade_axis=_item(path, data, "blade_axis", _blade_axis),
        direction_reason=_item(path, data, "direction_reason", str),
        blocks=_items(path, data, "blocks", _block_in),
        rods=_items(path, data, "rods", _rod_in),
        checks=_items(path, data, "checks", _check_in),
        motions=_items(path, data, "motions", _motion_in),
        facts={key: _scalar_in(value) for key, value in _item(path, data, "facts", dict).items()},
    )
    return StoredCut(
        plan=plan,
        job=_job_in(path, _item(path, data, "job", dict)),
        software=_item(path, data, "software", str),
        files=_item(path, data, "files", dict),
    )


def files_of_cut(folder: Path) -> frozenset[str] | None:
    """Relative paths of the files in `folder` that batten wrote, from its cut.json; None if it made none of them."""
    try:
        data = _load(folder / FILE_NAME)
    except FormatError:
        return None
    files = data.get("files")
    if data.get("format") != FORMAT or not isinstance(files, dict):
        return None
    return frozenset({FILE_NAME, *files})


def _load(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"), parse_constant=_no_constant)
    except FileNotFoundError as error:
        raise FormatError(f"{path}: no such file; give a folder that `batten cut` made") from error
    except OSError as error:
        raise FormatError(f"{path}: cannot be read ({error.strerror}); give a folder that `batten cut` made") from error
    except ValueError as error:  # no UTF-8, no JSON
        raise FormatError(f"{path}: not a JSON file: {error}; give a folder that `batten cut` made") from error
    if not isinstance(data, dict):
        raise FormatError(f"{path}: holds no JSON object; give a folder that `batten cut` made")
    return data


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is no JSON number")


def _item(path: Path, data: Mapping[str, Any], key: str, read: Callable[[Any], _Item]) -> _Item:
    try:
        return read(data[key])
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise FormatError(f"{path}: {key}: {_reason(error)}; cut the job again") from error


def _items(path: Path, data: Mapping[str, Any], key: str, read: Callable[[Any], _Item]) -> tuple[_Item, ...]:
    entries = _item(path, data, key, list)
    return tuple(_item(path, {f"{key}[{i}]": entry}, f"{key}[{i}]", read) for i, entry in enumerate(entries))


def _reason(error: Exception) -> str:
    return f"{error.args[0]!r} is missing" if isinstance(error, KeyError) else " ".join(str(error).split())


def _compact(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))


# Numbers and arrays of them. numpy reads None as NaN and "Infinity" as ∞ by itself.


def _scalar_out(value: float | int | str) -> float | int | str | None:
    if isinstance(value, str | int):
        return value
    if isinstance(value, np.integer):
        return int(value)
    number = float(value)
    return number if math.isfinite(number) else _nonfinite(number)


def _scalar_in(value: Any) -> Any:
    return math.nan if value is None else _INFINITE.get(value, value) if isinstance(value, str) else value


def _nonfinite(value: float) -> str | None:
    return None if math.isnan(value) else "Infinity" if value > 0.0 else "-Infinity"


def _numbers_out(array: Any) -> Any:
    a = np.asarray(array)
    if a.dtype.kind in "iub" or np.isfinite(a).all():
        return a.tolist()
    boxed = a.astype(object)
    boxed[~np.isfinite(a)] = [_nonfinite(float(v)) for v in a[~np.isfinite(a)]]
    return boxed.tolist()


def _numbers_in(values: Any, *shape: int) -> FloatArray:
    """An array whose shape is `shape`, where −1 stands for any number."""
    a = np.array(values, dtype=np.float64).reshape(shape)
    return a


# Blocks, rods, checks, motions


def _block_out(block: Block) -> dict[str, Any]:
    return {
        "number": block.number,
        "row": block.row,
        "column": block.column,
        "corner_mm": _numbers_out(block.corner_mm),
        "size_mm": _numbers_out(block.size_mm),
    }


def _block_in(data: Mapping[str, Any]) -> Block:
    return Block(
        number=int(data["number"]),
        row=int(data["row"]),
        column=int(data["column"]),
        corner_mm=_numbers_in(data["corner_mm"], 3),
        size_mm=_numbers_in(data["size_mm"], 3),
    )


def _elastica_out(curve: Elastica) -> dict[str, Any]:
    return {
        "start_mm": _numbers_out(curve.start),
        "start_angle_rad": float(curve.start_angle),
        "start_curvature_per_mm": float(curve.start_curvature),
        "force_per_mm2": _numbers_out(curve.force),
        "length_mm": float(curve.length),
    }


def _elastica_in(data: Mapping[str, Any]) -> Elastica:
    return Elastica(
        start=_numbers_in(data["start_mm"], 2),
        start_angle=float(data["start_angle_rad"]),
        start_curvature=float(data["start_curvature_per_mm"]),
        force=_numbers_in(data["force_per_mm2"], 2),
        length=float(data["length_mm"]),
    )


def _plane_in(data: Mapping[str, Any]) -> Plane:
    stored = {"origin": data["origin_mm"], "x_axis": data["x_axis"], "y_axis": data["y_axis"]}
    plane = Plane(**{key: _numbers_in(value, 3) for key, value in stored.items()})
    for (
        key,
        value,
    ) in stored.items():  # normalising once more may move the last bit, so take the stored numbers as they are
        exact = _numbers_in(value, 3)
        exact.setflags(write=False)
        object.__setattr__(plane, key, exact)
    return plane


def _rod_out(rod: RodPlacement) -> dict[str, Any]:
    return {
        "block": rod.block,
        "leaf": rod.leaf,
        "status": rod.status,
        "reasons": list(rod.reasons),
        "repair": list(rod.repair),
        "plane": {
            "origin_mm": _numbers_out(rod.plane.origin),
            "x_axis": _numbers_out(rod.plane.x_axis),
            "y_axis": _numbers_out(rod.plane.y_axis),
        },
        "before_mm": float(rod.before_mm),
        "piece": _elastica_out(rod.piece),
        "rod": _elastica_out(rod.rod),
        "design_mm": _numbers_out(rod.design),
    }


def _rod_in(data: Mapping[str, Any]) -> RodPlacement:
    status = data["status"]
    if status not in ("ok", "refused"):
        raise ValueError(f'status = {status!r}: must be "ok" or "refused"')
    return RodPlacement(
        block=int(data["block"]),
        leaf=int(data["leaf"]),
        plane=_plane_in(data["plane"]),
        design=_numbers_in(data["design_mm"], -1, 2),
        piece=_elastica_in(data["piece"]),
        rod=_elastica_in(data["rod"]),
        before_mm=float(data["before_mm"]),
        repair=tuple(map(str, data["repair"])),
        status=status,
        reasons=tuple(map(str, data["reasons"])),
    )


def _check_out(check: CheckResult) -> dict[str, Any]:
    data = {f.name: getattr(check, f.name) for f in dataclasses.fields(check)}
    return data | {"limit": _scalar_out(float(check.limit)), "values": _numbers_out(check.values)}


def _check_in(data: Mapping[str, Any]) -> CheckResult:
    sense = data["sense"]
    if sense not in ("max", "min"):
        raise ValueError(f'sense = {sense!r}: must be "max" or "min"')
    return CheckResult(
        name=str(data["name"]),
        title=str(data["title"]),
        unit=str(data["unit"]),
        limit=float(_scalar_in(data["limit"])),
        sense=sense,
        values=_numbers_in(data["values"], -1),
        note=str(data["note"]),
        hard=bool(data["hard"]),
    )


_ARM_FIELDS = tuple(field.name for field in dataclasses.fields(ArmMotion))
_ARM_SHAPES: dict[str, tuple[int, ...]] = {  # of those that are not one number a pose
    "poses": (-1, 4, 4),
    "joints_rad": (-1, 6),
    "approach": (4, 4),
    "leave": (4, 4),
    "approach_joints_rad": (6,),
    "leave_joints_rad": (6,),
    "configuration": (-1, 4),
}


def _arm_out(arm: ArmMotion) -> dict[str, Any]:
    return {key: _numbers_out(getattr(arm, key)) for key in _ARM_FIELDS}


def _arm_in(data: Mapping[str, Any]) -> ArmMotion:
    arrays: dict[str, Any] = {key: _numbers_in(data[key], *_ARM_SHAPES.get(key, (-1,))) for key in _ARM_FIELDS}
    return ArmMotion(**(arrays | {"configuration": arrays["configuration"].astype(np.int64)}))


def _motion_out(motion: BlockMotion) -> dict[str, Any]:
    return {
        "block": motion.block,
        "rods": list(motion.rods),
        "speed_mm_s": float(motion.speed_mm_s),
        "planned_s": None if motion.planned_s is None else _numbers_out(motion.planned_s),
        "left": _arm_out(motion.left),
        "right": _arm_out(motion.right),
    }


def _motion_in(data: Mapping[str, Any]) -> BlockMotion:
    return BlockMotion(
        block=int(data["block"]),
        rods=tuple(int(r) for r in data["rods"]),
        left=_arm_in(data["left"]),
        right=_arm_in(data["right"]),
        speed_mm_s=float(data["speed_mm_s"]),
        planned_s=None if data["planned_s"] is None else _numbers_in(data["planned_s"], -1),
    )


def _blade_axis(value: Any) -> Any:
    if value not in ("x", "y"):
        raise ValueError(f'{value!r}: must be "x" or "y"')
    return value


# The job: in the form of a job file, so that one set of bounds holds for both


def input_name(path: Path) -> str:
    """Where a file that the job refers to is kept, relative to cut.json."""
    return str(PurePosixPath(INPUT_FOLDER) / path.name)


def _job_out(job: CutJob) -> dict[str, Any]:
    data: dict[str, Any] = _without_none(dataclasses.asdict(dataclasses.replace(job, path=None)))
    for key in ("file", "curves"):
        if key in data["surface"]:
            data["surface"][key] = input_name(data["surface"][key])
    return data


def _job_in(path: Path, data: dict[str, Any]) -> CutJob:
    from pydantic import ValidationError

    from batten.io.job import job_from_model
    from batten.io.job_fields import JobFile

    try:
        return job_from_model(JobFile.model_validate(data), path)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise FormatError(f"{path}: job.{where}: {' '.join(first['msg'].split())}; cut the job again") from error


def _without_none(data: dict[str, Any]) -> dict[str, Any]:
    return {k: _without_none(v) if isinstance(v, dict) else v for k, v in data.items() if v is not None}
