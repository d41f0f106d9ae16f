"""Whether the rod stays in its shape: held, held a little wrongly, and on the way from leaf to leaf."""

from __future__ import annotations

import numpy as np

from batten.fabrication.checks.context import CheckContext, worst_of_pairs
from batten.fabrication.plan import CheckResult
from batten.kernels.boundary_track import follow_batch
from batten.solvers.snap_error import snap_errors
from batten.solvers.stability import margins
from batten.solvers.track import end_poses, standard_numbers
from batten.typing import BoolArray, FloatArray

REACH = 3.0
"""Errors of a gripper are tried up to so many times the limit."""
_LEAST_REACH_MM, _LEAST_REACH_DEG = 0.1, 0.1
# Beam theory of a flat rod, all in lengths: it has a second shape while the angles of both ends against the chord stay
# below 1.76 to 2.0 √slack (by their ratio); an end shifted sideways by 2/√3 √slack flips the arch with ends along the chord.
_TWO_SHAPES, _SIDEWAYS = 2.3, 2.0
_SAME_SHAPE = 1e-6
_MOST_STEPS = 300


def stability_checks(context: CheckContext) -> tuple[CheckResult, CheckResult, CheckResult, CheckResult]:
    """Margin of stability, least shift (mm) and turn (°) of a gripper that snap the rod, jumps between leaves (soft).

    An unstable rod cannot be held in its shape, and one that is nearly so leaves it at a small error of a gripper, as the
    papers warn of rods near a straight line (Fisker2018 §1.2, §5.4.3). The margin is `solvers.stability.margins` of the
    whole rod, clamped in both grippers, against `rod.min_stability_margin`; inf where the curve has no conjugate point.
    Shift and turn are `solvers.snap_error.snap_errors`, tried up to three times `gripper.position_error_mm` and
    `gripper.angle_error_deg`; inf where the rod bears all that was tried, 0 for a rod that is unstable or straight. A shift
    that pulls a flat rod straight counts if the rod has a mirror shape to come back to, which is seen farther away.

    Between successive leaves of a block the rod is followed from the earlier to the later one, in the plane's coordinates
    (the planes are parallel): positions and angles of both ends go linearly, each angle the shorter way. The value is the
    share of the way up to which it can be followed, 1 if it arrives at the later leaf's shape, 0 if it arrives at another
    one or is unstable from the start. Each rod gets the lesser of the ways before and after it.

    Accuracy: those of the two solvers: the margin 1e-10, the turn 1e-8, the shift 1 %. A shape counts as the same where
    curvature and force at its start agree within 1e-6 of their size. A share is where the rod snaps to 1e-9 of the way; or
    where it is held so stiffly that no small step can be computed, which is no jump in fact.

    Degenerate: the force in a straight rod follows from nothing, so the way out of one gives 0, and the way into one at
    most a little less than 1.
    """
    job = context.job
    margin = margins(context.rod_parameters)
    shift, turn = _snap_errors(context)
    return (
        CheckResult(
            "stability",
            "Stability margin of the rod",
            "",
            job.rod.min_stability_margin,
            "min",
            margin,
            "Length up to which the same curve, held at both ends, would be stable, over the rod's length; "
            "∞ if it is stable at any length.",
        ),
        CheckResult(
            "snap_shift",
            "Shift of a gripper that snaps the rod",
            "mm",
            job.gripper.position_error_mm,
            "min",
            shift,
            f"Least one found; tried up to {_reach_mm(context):g} mm, ∞ if the rod bears that.",
        ),
        CheckResult(
            "snap_turn",
            "Turn of a gripper that snaps the rod",
            "°",
            job.gripper.angle_error_deg,
            "min",
            turn,
            f"In the rod's plane; tried up to {_reach_deg(context):g}°, ∞ if the rod bears that.",
        ),
        CheckResult(
            "jump_between",
            "Way to the next leaf without a jump",
            "",
            1.0,
            "min",
            worst_of_pairs(len(context.rods), context.pairs, held_shares(context, margin > 1.0), least=True),
            "Share of the way between leaves up to which the rod holds, both ends moved evenly; "
            "0 if it comes to another shape than the next leaf's.",
            hard=False,
        ),
    )


def held_shares(context: CheckContext, stable: BoolArray) -> FloatArray:
    """For every pair of successive leaves the share of the way up to which the rod holds, (k,); see `stability_checks`.

    Parameters:
        context: with its pairs.
        stable: (n,), whether each rod is stable.
    """
    earlier, later = context.pairs.T
    if len(earlier) == 0:
        return np.empty(0)
    parameters = context.rod_parameters
    shapes, poses = standard_numbers(parameters), end_poses(parameters)
    first, last = poses[earlier], poses[later]
    angles = [2, 5]  # of the start and the end
    last[:, angles] += 2.0 * np.pi * np.round((first - last)[:, angles] / (2.0 * np.pi))
    share, arrived = np.empty(len(first)), np.empty((len(first), 4))
    spent = np.empty((len(first), 2), dtype=np.int64)
    follow_batch(shapes[earlier], first, last, parameters[earlier, 6], _MOST_STEPS, share, arrived, spent)
    other = (share >= 1.0) & ~_same(arrived, shapes[later])
    return np.where(other | ~stable[earlier], 0.0, share)


def _same(a: FloatArray, b: FloatArray) -> BoolArray:
    """Whether shapes (k, 4), see `standard_numbers`, are the same; curvatures and forces are scaled by their own size."""
    bend = 1.0 + np.abs(b[:, 1]) + np.sqrt(np.hypot(b[:, 2], b[:, 3]))
    off = np.abs(a - b) / np.stack([np.ones_like(bend), bend, bend**2, bend**2], axis=-1)
    return np.asarray(off.max(axis=1) <= _SAME_SHAPE)


def _snap_errors(context: CheckContext) -> tuple[FloatArray, FloatArray]:
    """Least shift (mm) and least turn (°, without its sign) of a gripper that snap each rod, (n,) each.

    A rod whose slack, length − chord, lies within the reach is pulled straight there. That counts if it has a second shape
    to come back to, which the solver sees at shifts that flip it sideways: those rods are given a longer reach.
    """
    rods, reach, turn_reach = context.rod_parameters, _reach_mm(context), float(np.radians(_reach_deg(context)))
    errors = snap_errors(rods, reach=reach, turn_reach=turn_reach)
    shift, length = errors[:, 0], rods[:, 6]
    poses = end_poses(rods)
    chord = poses[:, 3:5] - poses[:, :2]
    slack = np.maximum(length - np.hypot(*chord.T), 0.0)
    against = poses[:, [2, 5]] - np.arctan2(chord[:, 1], chord[:, 0])[:, None]
    against = np.abs(np.mod(against + np.pi, 2.0 * np.pi) - np.pi).max(axis=1)
    flat = (slack < reach) & (against < _TWO_SHAPES * np.sqrt(slack / length)) & np.isinf(shift)
    if flat.any():
        sideways = _SIDEWAYS * float(np.sqrt(slack * length)[flat].max())
        shift[flat] = snap_errors(rods[flat], reach=max(sideways, reach), turn_reach=turn_reach)[:, 0]
    return shift, np.degrees(np.abs(errors[:, 2]))


def _reach_mm(context: CheckContext) -> float:
    return max(REACH * context.job.gripper.position_error_mm, _LEAST_REACH_MM)


def _reach_deg(context: CheckContext) -> float:
    return max(REACH * context.job.gripper.angle_error_deg, _LEAST_REACH_DEG)
