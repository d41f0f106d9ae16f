"""What the robots can do: reach, joint limits, singularities and joint speeds, from the motions that were planned."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from batten.errors import InvalidInputError
from batten.fabrication.plan import ArmMotion, BlockMotion, CheckResult
from batten.fabrication.robot.arm import RobotArm
from batten.fabrication.robot.cell import RobotCell
from batten.typing import FloatArray


def reach_checks(motions: Sequence[BlockMotion], cell: RobotCell, n_rods: int) -> tuple[CheckResult, ...]:
    """The robots' checks over all rods of a plan; each value is the worse of the two arms.

    - `reach` (mm): how far the wrist centre lies within what the arm can reach; negative beyond it.
    - `joint_limits` (°): distance of the worst joint from its nearer limit. A leaf that cannot be reached counts as −180°.
    - `singularity`: the least of |sin θ₅|, the sine of the elbow's bend, and the wrist centre's relative distance from
      axis 1 (`RobotArm.singularity`); 0 where the leaf cannot be reached.
    - `conditioning` (soft): least singular value of the Jacobian, metres and radians; 0 where it cannot be reached.
    - `joint_speed` (%): the fastest joint's share of its rated speed on the moves to and from the leaf, when the faster
      rod end moves at the cutting speed, or in the time that the kerf asks for.
    - `joint_step` (°): the greatest turn of a joint on these moves; on a move over leaves that are left out, per leaf.

    Parameters:
        motions: at most one for each rod and block.
        cell: whose limits hold.
        n_rods: how many rods the plan has; rods in no motion get NaN.

    Returns:
        Six results, values of shape (n_rods,).

    Raises:
        InvalidInputError: a motion names a rod that is not below `n_rods`.
    """
    values = {
        name: np.full(n_rods, np.nan)
        for name in ("reach", "joint_limits", "singularity", "conditioning", "joint_speed", "joint_step")
    }
    for motion in motions:
        rods = np.asarray(motion.rods, dtype=np.int64)
        if len(rods) and not (rods.min() >= 0 and rods.max() < n_rods):
            raise InvalidInputError(
                f"block {motion.block} names rods {rods.min()} … {rods.max()} of a plan with {n_rods}"
            )
        both = (motion.left, motion.right)
        values["reach"][rods] = _worse(both, lambda arm: arm.reach_mm, -np.inf)
        values["joint_limits"][rods] = np.degrees(_worse(both, lambda arm: arm.joint_margin_rad, -np.pi))
        values["singularity"][rods] = _worse(both, lambda arm: arm.singularity, 0.0)
        values["conditioning"][rods] = _worse(both, lambda arm: arm.conditioning, 0.0)
        seconds = motion.seconds
        steps = [np.abs(np.diff(_with_ends(arm), axis=0)) for arm in both]
        robots: tuple[RobotArm, RobotArm] = (cell.left, cell.right)
        speed = [(s / seconds[:, None] / robot.joint_speeds_rad_s).max(axis=1) for s, robot in zip(steps, robots)]
        values["joint_speed"][rods] = 100.0 * _worst_move(np.fmax(*speed))
        # The ways in and out are longer than a step; so is a move over leaves that are left out.
        inner = np.fmax(*(s[1:-1].max(axis=1) for s in steps)) / np.maximum(np.diff(rods), 1)
        values["joint_step"][rods] = np.degrees(_worst_move(np.r_[np.nan, inner, np.nan]))
    return _results(values, cell)


def _with_ends(arm: ArmMotion) -> FloatArray:
    return np.concatenate([arm.approach_joints_rad[None], arm.joints_rad, arm.leave_joints_rad[None]])


def _worse(arms: Sequence[ArmMotion], value: Callable[[ArmMotion], FloatArray], unreachable: float) -> FloatArray:
    """The lesser value of the two arms; NaN, which means that an arm cannot get there, counts as `unreachable`."""
    return np.minimum(*(np.where(np.isnan(value(arm)), unreachable, value(arm)) for arm in arms))


def _worst_move(moves: FloatArray) -> FloatArray:
    """For each leaf the worse of the move to it and the move from it, for moves (n + 1,); NaN if neither is known."""
    return np.fmax(moves[:-1], moves[1:])


def _results(values: dict[str, FloatArray], cell: RobotCell) -> tuple[CheckResult, ...]:
    both = "The worse of the two arms, with the rod turned in the grip for the best margin."
    moves = "From leaf to leaf in the time planned, both ends arriving together."
    return (
        CheckResult("reach", "Reach of the robots", "mm", cell.min_reach_mm, "min", values["reach"], both),
        CheckResult(
            "joint_limits",
            "Distance of the joints from their limits",
            "°",
            float(np.degrees(cell.min_joint_margin_rad)),
            "min",
            values["joint_limits"],
            both,
        ),
        CheckResult(
            "singularity",
            "Distance from a singularity",
            "",
            cell.min_singularity,
            "min",
            values["singularity"],
            "Least of the sines of wrist and elbow and of the wrist's relative distance from axis 1; 0 is singular.",
        ),
        CheckResult(
            "conditioning",
            "Least singular value of the Jacobian",
            "",
            cell.min_conditioning,
            "min",
            values["conditioning"],
            "At the flange, with lengths in metres and angles in radians.",
            hard=False,
        ),
        CheckResult(
            "joint_speed",
            "Joint speed over rated speed",
            "%",
            100.0 * cell.max_joint_speed_fraction,
            "max",
            values["joint_speed"],
            moves,
        ),
        CheckResult(
            "joint_step",
            "Turn of a joint between leaves",
            "°",
            float(np.degrees(cell.max_joint_step_rad)),
            "max",
            values["joint_step"],
            moves,
        ),
    )
