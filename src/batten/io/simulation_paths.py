"""From the robot modules of a cut to the paths of its rods, one for each block."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from batten.errors import FormatError
from batten.fabrication.robot.cell import RobotCell
from batten.fabrication.simulation import BlockPath
from batten.io.rapid_reading import RapidModule, RapidMove, read_rapid_module
from batten.typing import FloatArray

_SIDES = {"L": "left", "R": "right"}
_LEAF = "leaf "
_LEAST_SECONDS = 1e-9


def read_rod_paths(folder: str | Path, cell: RobotCell) -> tuple[BlockPath, ...]:
    """What the modules in a folder make both arms do, block by block.

    A controller brings the tool frame that a module declares to a target in the work object that it declares. Where the
    rod's end then is in the block depends on the tool and the block's place as they are: those of the cell.

    Parameters:
        folder: with the modules NAME_L.mod and NAME_R.mod of each block, and no other module.
        cell: tools and place of the block.

    Returns:
        Paths in the blocks' work frames, in order of block.

    Raises:
        FormatError: a folder without modules, a module without the other arm's, two for one block, or modules whose moves
            do not match; see also `read_rapid_module`. The message names the file, and the line where there is one.

    Accuracy: that of the numbers in the modules, 0.001 mm and 4e-6 rad as batten writes them.
    """
    modules = {p.stem: p for p in sorted(Path(folder).glob("*.mod"))}
    if not modules:
        raise FormatError(f"{folder}: holds no RAPID module; cut the job again")
    names = sorted({stem[:-1] for stem in modules})
    paths: dict[int, BlockPath] = {}
    for name in names:
        for side in _SIDES:
            if name + side not in modules:
                raise FormatError(f"{folder}: {name + side}.mod is missing; every block needs a module for each arm")
        left, right = (read_rapid_module(modules[name + side]) for side in _SIDES)
        path = _path(left, right, cell)
        if path.block in paths:
            raise FormatError(f"{left.path}: block {path.block} has two programs; leave one in {folder}")
        paths[path.block] = path
    return tuple(paths[block] for block in sorted(paths))


def _path(left: RapidModule, right: RapidModule, cell: RobotCell) -> BlockPath:
    if left.block == 0 or left.block != right.block:
        raise FormatError(
            f"{left.path} and {right.path.name}: their comments must name one block; got {left.block} and {right.block}"
        )
    if [m.identity for m in left.moves] != [m.identity for m in right.moves]:
        ours, others = ({m.identity: m for m in module.moves} for module in (left, right))
        odd = sorted(set(ours) ^ set(others))
        where = f"\\ID:={odd[0]} is in one of them only" if odd else "the same \\ID in another order"
        raise FormatError(f"{left.path} and {right.path.name}: {where}; both arms must make every move together")
    if len(left.moves) < 2:
        raise FormatError(f"{left.path}: one synchronous move alone is no cut; cut the job again")
    labels = tuple(m.label or f"move \\ID:={m.identity}" for m in left.moves)
    return BlockPath(
        block=left.block,
        left=np.stack([_rod_end(m, cell, "left") for m in left.moves]),
        right=np.stack([_rod_end(m, cell, "right") for m in right.moves]),
        labels=labels,
        is_leaf=np.array([label.startswith(_LEAF) for label in labels], dtype=np.bool_),
        seconds=np.maximum(_seconds(left.moves), _seconds(right.moves)),
    )


def _rod_end(move: RapidMove, cell: RobotCell, side: str) -> FloatArray:
    """The rod's end in the block's work frame, (4, 4), when the controller has made a move."""
    flange = move.work_object @ move.pose @ np.linalg.inv(move.tool)
    return np.asarray(np.linalg.inv(cell.work_object) @ flange @ cell.arm(side).tool)


def _seconds(moves: tuple[RapidMove, ...]) -> FloatArray:
    """How long one arm takes at least for each move but the first, (n − 1,), s."""
    poses = np.stack([m.pose for m in moves])
    ways = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    turns = Rotation.from_matrix(poses[:, :3, :3])
    angles = (turns[:-1].inv() * turns[1:]).magnitude()
    pace, turn_pace, given = np.array([[m.speed_mm_s, m.turn_speed_rad_s, m.seconds] for m in moves[1:]]).T
    needed = np.maximum(ways / pace, angles / turn_pace)
    return np.asarray(np.maximum(np.where(given > 0.0, given, needed), _LEAST_SECONDS))
