"""rods.csv: for every rod that is cut, what the papers hand to the robots (Fisker2018 §5.3), one line a rod.

Wall frame, mm. Both tangents point from the left end to the right end of the rod, the normal is the way the blade is
swept; all three are unit vectors. Positions and lengths have 6 decimals (1 nm), unit vectors 9: a rod rebuilt from its
line, as the elastica of that length through these ends and tangents, lies within 0.0001 mm of the planned one for rods
that bow 1 mm or more over 1 m (straighter ones lose in proportion, for there a rod's bow hangs on its length).
The last column is the time of the move that ends at this rod, from the one before it in the block or from the approach
pose, with 4 decimals; empty where no motion is planned. Rods of refused leaves are not in the table.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from batten.errors import FormatError
from batten.fabrication.plan import CutPlan, RodPlacement, gripper_frames
from batten.typing import FloatArray

_VECTORS = ("start_mm", "end_mm", "start_tangent", "end_tangent", "plane_normal")
COLUMNS = (
    "block",
    "leaf",
    *(f"{vector.removesuffix('_mm')}_{axis}{'_mm' * vector.endswith('_mm')}" for vector in _VECTORS for axis in "xyz"),
    "length_mm",
    "move_s",
)


@dataclass(frozen=True, eq=False)
class RodRow:
    """One line of rods.csv: numbers of block and leaf, the rod's ends, vectors of shape (3,) in the wall frame, its length,
    and the time of the move that ends there, NaN if none is planned."""

    block: int
    leaf: int
    start_mm: FloatArray
    end_mm: FloatArray
    start_tangent: FloatArray
    end_tangent: FloatArray
    plane_normal: FloatArray
    length_mm: float
    move_s: float


def rod_rows(rods: Sequence[RodPlacement], move_s: Sequence[float]) -> list[RodRow]:
    """The lines of rods, in full precision; `move_s` as in `RodRow`, one for each rod."""
    positions, tangents, normals = gripper_frames(rods)
    return [
        RodRow(
            block=rod.block,
            leaf=rod.leaf,
            start_mm=positions[i, 0],
            end_mm=positions[i, 1],
            start_tangent=tangents[i, 0],
            end_tangent=tangents[i, 1],
            plane_normal=normals[i],
            length_mm=float(rod.rod.length),
            move_s=float(move_s[i]),
        )
        for i, rod in enumerate(rods)
    ]


def write_rods_csv(path: str | Path, plan: CutPlan) -> None:
    """Write the rods of a plan that are cut, in the plan's order, with a line of names at the top.

    Parameters:
        path: the file to write, overwritten if it exists.
        plan: the plan.
    """
    seconds = np.full(len(plan.rods), np.nan)
    for motion in plan.motions:
        seconds[list(motion.rods)] = motion.seconds[:-1]
    cut = [i for i, rod in enumerate(plan.rods) if rod.status == "ok"]
    rows = rod_rows([plan.rods[i] for i in cut], seconds[cut].tolist())
    with Path(path).open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(map(_fields, rows))


def read_rods_csv(path: str | Path) -> list[RodRow]:
    """Read rods.csv back.

    Parameters:
        path: the file.

    Returns:
        One row for every line after the first.

    Raises:
        FormatError: other columns, or a line that is not all numbers; the message names file and line.
    """
    with Path(path).open(encoding="utf-8", newline="") as file:
        lines = list(csv.reader(file))
    if not lines or tuple(lines[0]) != COLUMNS:
        raise FormatError(f"{path}:1: must be the columns {','.join(COLUMNS)}; give a rods.csv that `batten cut` made")
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        try:
            *numbers, length = (float(field) for field in line[:-1])
            start, end, t0, t1, normal = np.array(numbers[2:]).reshape(len(_VECTORS), 3)
            seconds = float(line[-1]) if line[-1] else np.nan
            rows.append(RodRow(int(line[0]), int(line[1]), start, end, t0, t1, normal, length, seconds))
        except (ValueError, IndexError) as error:
            raise FormatError(
                f"{path}:{number}: must be {len(COLUMNS)} numbers, got {','.join(line)!r}; cut the job again"
            ) from error
    return rows


def _fields(row: RodRow) -> list[str]:
    fields = [str(row.block), str(row.leaf)]
    for vector in _VECTORS:
        decimals = 6 if vector.endswith("_mm") else 9
        fields += [_fixed(v, decimals) for v in getattr(row, vector)]
    return [*fields, _fixed(row.length_mm, 6), "" if np.isnan(row.move_s) else _fixed(row.move_s, 4)]


def _fixed(value: float, decimals: int) -> str:
    """A number with fixed decimals and no "-0.000"."""
    text = f"{value:.{decimals}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text
