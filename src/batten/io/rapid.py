"""RAPID modules for two ABB robots under MultiMove: one module for each arm and block.

Syntax after ABB's technical reference manual "RAPID Instructions, Functions and Data types". Lengths in mm, quaternions
w, x, y, z, angles of MoveAbsJ in degrees. The work object is the block's work frame, the same for both arms; the world
frame of the controller is the cell frame, so both base frames must be set there as each module's head says.

What a pair of modules does: each arm goes to its approach pose by itself with an empty gripper, from a posture pulled back
from it (`batten.fabrication.robot.travel`); there the program stops until the rod is fixed in both grippers. Then both arms
move synchronously, every move with the same \\ID in both modules: into the block, from leaf to leaf, and out on the far
side. Where the plan sets the time of a move, so that the kerf is right along the blade, both arms have it as \\T, which then
stands for the speed. Behind the block the program stops until the rod is taken out, and each arm pulls back by itself.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from batten.errors import InvalidInputError, LimitError
from batten.fabrication.plan import ArmMotion, BlockMotion, CutPlan
from batten.fabrication.robot.arm import RobotArm
from batten.fabrication.robot.cell import RobotCell
from batten.fabrication.robot.travel import pulled_back
from batten.typing import ArrayLike, FloatArray

NAME_LENGTH = 32  # RAPID identifiers
STRING_LENGTH = 80  # RAPID strings
LINE_LENGTH = 200

_ZONES = ("fine", "z0", "z1", "z5", "z10", "z15", "z20", "z30", "z40", "z50")
_SIDES = {"left": ("L", "T_ROB1", "start"), "right": ("R", "T_ROB2", "end")}
_NO_AXES = "[9E9,9E9,9E9,9E9,9E9,9E9]"
_TURN_SPEED_DEG_S = 500  # ABB's own in v5 … v7000: the tool's travel sets the pace, not its turn
_ID_STEP = 10


def rapid_modules(
    motion: BlockMotion,
    cell: RobotCell,
    *,
    leaves: Sequence[int],
    name: str = "batten",
    zone: str = "z5",
    travel_mm_s: float = 100.0,
    turn: tuple[int, int] | None = None,
) -> dict[str, str]:
    """The two modules of one block, as text.

    Parameters:
        motion: every pose reachable by both arms.
        cell: the cell that the motion was planned for.
        leaves: the leaf's number for each of `motion.rods`, for the comments.
        name: of the job; the start of the module names.
        zone: RAPID zone at the leaves: "fine", "z0", "z1", "z5", … "z50". Approach and leave always are "fine".
        travel_mm_s: tool speed on the way to the approach pose, mm/s.
        turn: the block's place in the order of cutting, and how many there are, for the head; None leaves it out.

    Returns:
        {file name: text}, the left arm's module first; ASCII, lines end with "\\n".

    Raises:
        InvalidInputError: an unknown zone, a speed that is not positive, leaves that do not match the rods, a motion
            without rods.
        LimitError: a pose that an arm cannot reach.

    Accuracy: positions are rounded to 0.001 mm, times to 0.001 s; quaternions to six decimals, normalised within 1e-6 as
    rounded.
    """
    if zone not in _ZONES:
        raise InvalidInputError(f"zone {zone!r} is not one of {', '.join(_ZONES)}")
    for what, speed in (("speed_mm_s", motion.speed_mm_s), ("travel_mm_s", travel_mm_s)):
        if not (np.isfinite(speed) and speed > 0.0):
            raise InvalidInputError(f"{what} must be a finite number above 0; got {speed}")
    if len(leaves) != len(motion.rods) or not motion.rods:
        raise InvalidInputError(
            f"block {motion.block}: {len(leaves)} leaf numbers for {len(motion.rods)} rods; one each, and at least one"
        )
    for side in _SIDES:
        _refuse_unreachable(motion, side, leaves)
    return {
        f"{_module_name(name, motion.block, side)}.mod": _module(
            motion, cell, side, leaves, name, zone, travel_mm_s, turn
        )
        for side in _SIDES
    }


def rapid_program(plan: CutPlan, cell: RobotCell, *, zone: str = "z5") -> dict[str, str]:
    """The modules of all blocks that have rods, {file name: text}, in the order of cutting; see `rapid_modules`."""
    files: dict[str, str] = {}
    cut = [motion for motion in plan.motions if motion.rods]
    for place, motion in enumerate(cut, start=1):
        leaves = [plan.rods[i].leaf for i in motion.rods]
        files |= rapid_modules(motion, cell, leaves=leaves, name=plan.name, zone=zone, turn=(place, len(cut)))
    return files


def rapid_string(text: str) -> str:
    """Text as a RAPID string literal: ASCII, quotes and backslashes doubled, cut at 80 characters.

    Example:
        >>> print(rapid_string('a "b"'))
        "a ""b\"""
    """
    return '"' + _ascii(text)[:STRING_LENGTH].replace("\\", "\\\\").replace('"', '""') + '"'


def rounded_quaternions(rotations: ArrayLike) -> FloatArray:
    """Quaternions of rotations on a grid of 1e-6, still of length one within 1e-6.

    Of the sixteen ways to round the four numbers up or down, the one that turns least, among those whose length is off by
    less than 5e-7 (plain rounding can be off by almost 1e-6). Signs follow from row to row, the first has w ≥ 0.

    Parameters:
        rotations: shape (n, 3, 3).

    Returns:
        Shape (n, 4), w, x, y, z; multiples of 1e-6.

    Accuracy: turned by less than 4e-6 rad.
    """
    q = Rotation.from_matrix(np.asarray(rotations, dtype=np.float64).reshape(-1, 3, 3)).as_quat()[:, [3, 0, 1, 2]]
    q[0] *= -1.0 if q[0, 0] < 0.0 else 1.0
    q *= np.cumprod(np.where(np.r_[1.0, (q[1:] * q[:-1]).sum(axis=1)] < 0.0, -1.0, 1.0))[:, None]
    up = np.array([[(k >> bit) & 1 for bit in range(4)] for k in range(16)])
    steps = np.floor(q * 1e6)[:, None, :] + up  # (n, 16, 4), in units of 1e-6
    length = np.linalg.norm(steps, axis=-1) * 1e-6
    turn = np.linalg.norm(steps * 1e-6 / length[..., None] - q[:, None], axis=-1)
    cost = turn + np.where(np.abs(length - 1.0) < 5e-7, 0.0, 1.0)
    best = steps[np.arange(len(q)), cost.argmin(axis=1)]
    return np.asarray(best * 1e-6)


def _refuse_unreachable(motion: BlockMotion, side: str, leaves: Sequence[int]) -> None:
    arm = _arm_motion(motion, side)
    joints = np.concatenate([arm.joints_rad, arm.approach_joints_rad[None], arm.leave_joints_rad[None]])
    bad = ~np.isfinite(joints).all(axis=1)
    if bad.any():
        names = [*(f"leaf {leaf}" for leaf in leaves), "the approach pose", "the leave pose"]
        raise LimitError(
            f"block {motion.block}: the {side} arm cannot reach {', '.join(n for n, b in zip(names, bad) if b)}; leave "
            "out the leaves that are refused, or move the block or the arms"
        )


def _arm_motion(motion: BlockMotion, side: str) -> ArmMotion:
    return motion.left if side == "left" else motion.right


def _ascii(text: str) -> str:
    """Printable ASCII on one line."""
    return re.sub(r"[^ -~]", "?", " ".join(text.split()))


def _module_name(name: str, block: int, side: str) -> str:
    """A RAPID identifier of at most 32 characters that names job, block and arm."""
    ending = f"_B{block:03d}_{_SIDES[side][0]}"
    stem = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
    stem = stem if re.match(r"[A-Za-z]", stem) else f"cut_{stem}".rstrip("_")
    return stem[: NAME_LENGTH - len(ending)].rstrip("_") + ending


def _number(value: float, decimals: int) -> str:
    text = f"{value:.{decimals}f}"
    return text[1:] if float(text) == 0.0 and text.startswith("-") else text


def _list(values: ArrayLike, decimals: int) -> str:
    return "[" + ",".join(_number(float(v), decimals) for v in np.asarray(values)) + "]"


def _frame(pose: FloatArray) -> str:
    """A RAPID pose: [[x,y,z],[q1,q2,q3,q4]]."""
    return f"[{_list(pose[:3, 3], 3)},{_list(rounded_quaternions(pose[None, :3, :3])[0], 6)}]"


def _targets(poses: FloatArray, configuration: ArrayLike) -> list[str]:
    """RAPID robtargets of poses (n, 4, 4)."""
    quaternions = rounded_quaternions(poses[:, :3, :3])
    return [
        f"[{_list(pose[:3, 3], 3)},{_list(q, 6)},{_list(conf, 0)},{_NO_AXES}]"
        for pose, q, conf in zip(poses, quaternions, np.asarray(configuration))
    ]


def _module(
    motion: BlockMotion,
    cell: RobotCell,
    side: str,
    leaves: Sequence[int],
    name: str,
    zone: str,
    travel_mm_s: float,
    turn: tuple[int, int] | None,
) -> str:
    arm, robot = _arm_motion(motion, side), cell.arm(side)
    tool = f"grip_{side}"
    ends = np.stack([arm.approach_joints_rad, arm.leave_joints_rad])
    first, last = robot.configuration(ends)
    poses = np.concatenate([arm.approach[None], arm.poses, arm.leave[None]])
    targets = _targets(poses, np.concatenate([first[None], arm.configuration, last[None]]))
    comments = ["approach, before the block", *(f"leaf {leaf}" for leaf in leaves), "leave, behind the block"]
    zones = ["fine", *([zone] * len(leaves)), "fine"]
    lines = _head(motion, cell, side, leaves, name, turn)
    lines += _declarations(motion, cell, side, tool, travel_mm_s)
    lines += [
        "  PROC main()",
        "    ConfL \\Off;",
        "    ! The gripper is empty up to here: the rod is fixed at the approach pose.",
        _to_joints(pulled_back(robot, arm.approach_joints_rad), tool),
        _to_joints(arm.approach_joints_rad, tool),
        "    WaitSyncTask sync1, all_tasks;",
    ]
    if side == "left":
        lines.append(f"    TPWrite {rapid_string(f'Block {motion.block}: fix the rod in both grippers, then start.')};")
        lines.append("    Stop;")
    lines.append("    SyncMoveOn sync2, all_tasks;")
    for k, (target, comment, speed, corner) in enumerate(zip(targets, comments, _speeds(motion), zones), start=1):
        lines.append(f"    ! block {motion.block}, {comment}")
        lines.append(f"    MoveL {target}\\ID:={_ID_STEP * k}, {speed}, {corner}, {tool} \\WObj:=block_frame;")
    lines.append("    SyncMoveOff sync3;")
    if side == "left":
        lines.append(
            f"    TPWrite {rapid_string(f'Block {motion.block}: take the rod out of both grippers, then start.')};"
        )
        lines.append("    Stop;")
    lines += [
        "    WaitSyncTask sync4, all_tasks;",
        "    ! The gripper is empty from here on.",
        _to_joints(pulled_back(robot, arm.leave_joints_rad), tool),
        "  ENDPROC",
        "ENDMODULE",
    ]
    too_long = [line for line in lines if len(line) > LINE_LENGTH]
    if too_long:
        raise InvalidInputError(f"block {motion.block}: a number too large for a RAPID line in {too_long[0]!r}")
    return "\n".join(lines) + "\n"


def _to_joints(joints_rad: FloatArray, tool: str) -> str:
    """One arm's own move to a posture."""
    return f"    MoveAbsJ [{_list(np.degrees(joints_rad), 5)},{_NO_AXES}] \\NoEOffs, travel_speed, fine, {tool};"


def _speeds(motion: BlockMotion) -> list[str]:
    """The speed of each synchronous move, the one to the approach pose first, with its time where that is planned."""
    planned = [] if motion.planned_s is None else motion.planned_s.tolist()
    times = ["" if np.isnan(s) else f" \\T:={_number(max(s, 0.001), 3)}" for s in planned]
    inner = times or [""] * (len(motion.rods) - 1)
    return [f"cut_speed{time}" for time in ("", "", *inner, "")]


def _head(
    motion: BlockMotion,
    cell: RobotCell,
    side: str,
    leaves: Sequence[int],
    name: str,
    turn: tuple[int, int] | None,
) -> list[str]:
    """The MODULE line and what a person should know."""
    _, task, end = _SIDES[side]
    other = "right" if side == "left" else "left"
    robot: RobotArm = cell.arm(side)
    return [
        f"MODULE {_module_name(name, motion.block, side)}",
        f"  ! {_ascii(name)[:100]}: block {motion.block}, {side} arm at the rod's {end}, task {task}.",
        f"  ! {len(leaves)} leaves, {min(leaves)} to {max(leaves)}. Lengths in mm, quaternions w, x, y, z.",
        f"  ! Load it with {_module_name(name, motion.block, other)} in task {_SIDES[other][1]}, one block at a time.",
        *([] if turn is None else [f"  ! In the order of cutting it is number {turn[0]} of {turn[1]}."]),
        f"  ! {_ascii(robot.name)[:100]}; its base frame in the world frame must be set to",
        f"  ! {_frame(robot.base)}.",
        "  ! Work object: origin at the centre of the block's bottom face, x along the rod from left to right,",
        "  ! y the way of the cut, z up. Tool: origin at the rod's end, z along the rod, out of the gripper.",
    ]


def _declarations(motion: BlockMotion, cell: RobotCell, side: str, tool: str, travel_mm_s: float) -> list[str]:
    load = f"[{_number(cell.tool_mass_kg, 3)},{_list(cell.tool_centre_mm, 3)},[1,0,0,0],0,0,0]"
    return [
        f"  PERS tooldata {tool} := [TRUE,{_frame(cell.arm(side).tool)},{load}];",
        f'  PERS wobjdata block_frame := [FALSE,TRUE,"",{_frame(cell.work_object)},[[0,0,0],[1,0,0,0]]];',
        '  PERS tasks all_tasks{2} := [["T_ROB1"],["T_ROB2"]];',
        "  VAR syncident sync1;",
        "  VAR syncident sync2;",
        "  VAR syncident sync3;",
        "  VAR syncident sync4;",
        f"  CONST speeddata travel_speed := [{_number(travel_mm_s, 3)},{_TURN_SPEED_DEG_S},5000,1000];",
        f"  CONST speeddata cut_speed := [{_number(motion.speed_mm_s, 3)},{_TURN_SPEED_DEG_S},5000,1000];",
        "",
    ]
