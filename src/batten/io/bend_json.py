"""JSON of a bent rod: the problem and all its solutions, schema versioned, read back to the same numbers, bit by bit.

Numbers are written so that reading them gives the same double; an infinite one is the text "Infinity" or "-Infinity", one
that does not exist `null`: plain JSON has neither. Each solution stands on one line.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, get_args

from batten.curves.elastica import Elastica
from batten.errors import FormatError, InvalidInputError
from batten.fabrication.rod import Rod
from batten.fabrication.section import FlatSection, RoundSection, TubeSection, section_of_sizes
from batten.io.bend_numbers import BendNumbers, BendProblem, BendSolution, BentRod, bend_numbers
from batten.io.software import software_name
from batten.solvers.boundary_value import BoundarySolution
from batten.solvers.stability import Ends

FORMAT = "batten bend"
SCHEMA = 1

_INFINITE = {"Infinity": math.inf, "-Infinity": -math.inf}
_Item = TypeVar("_Item")


@dataclass(frozen=True)
class StoredBend:
    """What the file holds: the problem, its solutions by energy, the rod if there is one, and which batten wrote it."""

    problem: BendProblem
    solutions: tuple[BoundarySolution, ...]
    rod: Rod | None
    software: str


def bend_json(problem: BendProblem, solutions: Sequence[BendSolution], rod: Rod | None = None) -> str:
    """The problem and its solutions, by energy, as JSON.

    At the top: `format` ("batten bend"), `schema` (1), `software`, `unit` ("mm" with a rod, else null), `problem`, `rod`
    (null without), `solutions`. A solution has `number`, `parameters` (the seven numbers of `Elastica.parameters`), `energy`
    (∫κ² ds), `scaled_energy` (L∫κ² ds), `inflections`, `rotation_number`, `stable`, `margin`, `residual`, `force` (λ₁, λ₂),
    `curvature_start`, `curvature_end`, and with a rod `rod`: `force_n` ((x, y), which the gripper at the start exerts; that
    at the end exerts the opposite), `force_size_n`, `moment_start_nmm`, `moment_end_nmm` (EI·κ), `energy_j`, `strain`,
    `max_strain`, `least_radius_mm`, `too_strained`.

    Parameters:
        problem: what was asked.
        solutions: any number of them.
        rod: the rod; None without one.

    Example:
        >>> problem = BendProblem((0.0, 0.0), 0.0, (1.0, 0.0), 0.0, 1.0)
        >>> line = BoundarySolution(Elastica((0, 0), 0.0, 0.0, (0, 0), 1.0), 0.0, 0, 0.0, True, math.inf, 0.0)
        >>> json.loads(bend_json(problem, [line]))["solutions"][0]["margin"]
        'Infinity'
    """
    head: dict[str, Any] = {
        "format": FORMAT,
        "schema": SCHEMA,
        "software": software_name(),
        "unit": None if rod is None else "mm",
        "problem": dataclasses.asdict(problem),
        "rod": None if rod is None else _rod_out(rod),
    }
    rows = ",\n".join(_compact(_solution_out(row)) for row in bend_numbers(solutions, rod))
    lines = [f"{json.dumps(key)}: {_compact(_plain(value))}" for key, value in head.items()]
    return "{\n" + ",\n".join([*lines, f'"solutions": [\n{rows}\n]' if rows else '"solutions": []']) + "\n}\n"


def read_bend_json(path: str | Path) -> StoredBend:
    """Read such a file back.

    Parameters:
        path: a .json that `batten bend` wrote.

    Returns:
        The problem, its solutions and the rod, all numbers the same bit by bit. What follows from them (forces, moments,
        strains) is not read, but comes from them again.

    Raises:
        InvalidInputError: no such file.
        FormatError: no JSON, not of `batten bend`, a schema that this batten does not know, a field missing or of the wrong
            kind; the message names the file and the field.
    """
    path = Path(path)
    try:
        data = json.loads(path.read_text(encoding="utf-8"), parse_constant=_no_constant)
    except FileNotFoundError as error:
        raise InvalidInputError(f"{path}: no such file; give a .json that `batten bend` wrote") from error
    except ValueError as error:
        raise FormatError(f"{path}: not a JSON file: {' '.join(str(error).split())}; bend the rod again") from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        came = data.get("format") if isinstance(data, dict) else type(data).__name__
        raise FormatError(f'{path}: format = {came!r}: must be "{FORMAT}"; give a .json that `batten bend` wrote')
    if data.get("schema") != SCHEMA:
        raise FormatError(
            f"{path}: schema = {data.get('schema')!r}: this {software_name()} reads schema {SCHEMA}; "
            f"use {data.get('software', 'the batten that wrote it')}, or bend the rod again"
        )
    entries = _item(path, data, "solutions", list)
    solutions = (_item(path, {f"solutions[{i}]": e}, f"solutions[{i}]", _solution_in) for i, e in enumerate(entries))
    return StoredBend(
        problem=_item(path, data, "problem", _problem_in),
        solutions=tuple(solutions),
        rod=_item(path, data, "rod", _rod_in),
        software=_item(path, data, "software", str),
    )


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is no JSON number")


def _item(path: Path, data: Mapping[str, Any], key: str, read: Callable[[Any], _Item]) -> _Item:
    try:
        return read(data[key])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        reason = f"{error.args[0]!r} is missing" if isinstance(error, KeyError) else " ".join(str(error).split())
        raise FormatError(f"{path}: {key}: {reason}; bend the rod again") from error


def _compact(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))


def _plain(value: Any) -> Any:
    """The same with every number that JSON does not know replaced; numpy's numbers become Python's."""
    if isinstance(value, dict):
        return {key: _plain(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if value is None or isinstance(value, str | bool | int):
        return value
    number = float(value)
    return (
        number if math.isfinite(number) else None if math.isnan(number) else "Infinity" if number > 0 else "-Infinity"
    )


def _number(value: Any) -> float:
    if isinstance(value, str):
        return _INFINITE[value]
    return math.nan if value is None else float(value)


def _solution_out(row: BendNumbers) -> dict[str, Any]:
    solution = row.solution
    bent = {} if row.rod is None else {"rod": _bent_out(row.rod)}
    return _plain(  # type: ignore[no-any-return]  # a dictionary stays one
        {
            "number": row.number,
            "parameters": solution.elastica.parameters.tolist(),
            "energy": float(solution.energy),
            "scaled_energy": row.scaled_energy,
            "inflections": int(solution.inflections),
            "rotation_number": float(solution.rotation_number),
            "stable": bool(solution.stable),
            "margin": float(solution.margin),
            "residual": float(solution.residual),
            "ends": str(solution.ends),
            "force": row.force,
            "curvature_start": row.curvature_start,
            "curvature_end": row.curvature_end,
        }
        | bent
    )


def _bent_out(bent: BentRod) -> dict[str, Any]:
    return dataclasses.asdict(bent) | {"too_strained": bent.too_strained}


def _solution_in(data: Mapping[str, Any]) -> BoundarySolution:
    return BoundarySolution(
        elastica=Elastica.from_parameters([float(v) for v in data["parameters"]]),
        energy=_number(data["energy"]),
        inflections=int(data["inflections"]),
        rotation_number=_number(data["rotation_number"]),
        stable=bool(data["stable"]),
        margin=_number(data["margin"]),
        residual=_number(data["residual"]),
        ends=_ends_in(data["ends"]),
    )


def _ends_in(text: str) -> Ends:
    for ends in get_args(Ends):
        if text == ends:
            return ends  # type: ignore[no-any-return]
    raise ValueError(f"ends = {text!r}; allowed are {', '.join(get_args(Ends))}")


def _problem_in(data: Mapping[str, Any]) -> BendProblem:
    return BendProblem(**data)


def _rod_out(rod: Rod) -> dict[str, Any]:
    section = rod.section
    known = isinstance(section, RoundSection | TubeSection | FlatSection)
    return {
        "length_mm": rod.length_mm,
        "section": dataclasses.asdict(section) if known else {},  # type: ignore[call-overload]  # all three are dataclasses
        "description": section.description,
        "youngs_modulus_mpa": rod.youngs_modulus_mpa,
        "max_strain": rod.max_strain,
        "bending_stiffness_nmm2": rod.bending_stiffness_nmm2,
    }


def _rod_in(data: Mapping[str, Any] | None) -> Rod | None:
    if data is None:
        return None
    section = section_of_sizes(**{key: float(value) for key, value in data["section"].items()})
    return Rod(float(data["length_mm"]), section, float(data["youngs_modulus_mpa"]), float(data["max_strain"]))
