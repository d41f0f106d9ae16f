"""How large an error of a gripper a held rod bears before it snaps to another shape."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError, NoSolutionError
from batten.kernels import snap_error as kernel
from batten.solvers.track import RodTracker, end_poses, standard_numbers
from batten.typing import ArrayLike, FloatArray


class SnapError(NamedTuple):
    """The smallest errors at which a clamped rod snaps; inf where none was found.

    Attributes:
        shift: least displacement of one end against the other, in the unit of length.
        direction: of that displacement of the end, radians, in the elastica's own frame; NaN if `shift` is inf or 0.
        turn: least turn of one end, radians, with its sign.
        turned: which end that is, "start" or "end".
    """

    shift: float
    direction: float
    turn: float
    turned: str


def snap_error(elastica: Elastica, *, reach: float | None = None, turn_reach: float = np.pi) -> SnapError:
    """The smallest errors of position and of angle of a gripper that make a clamped rod snap.

    The margin of `stability` tells how much longer the same elastica could be; a workshop asks instead how precisely the
    ends must be held. Around the rod's pose lies a surface of folds, where its shape merges with an unstable one (another
    solution of `solve_boundary`); the rod is followed towards it: the end shifted in 24 directions, the nearest of them
    refined, and each end turned both ways.

    Near a straight line the margin says little: the force is not determined by the shape, two mirror branches lie on
    either side, and the margin of both is that of a buckled column (1.225 with both ends along the chord), however small
    the bow. The errors do tell: with slack ε = 1 − chord/length a turn of 1.78 √ε radians at one end flips the rod, and a
    shift of ε lengths along the chord pulls it straight, after which it may come back on either side. That shift counts
    wherever the rod snaps at all; for a straight rod both errors are 0.

    Parameters:
        elastica: the rod, clamped at both ends.
        reach: greatest shift that is tried, by default half the length.
        turn_reach: greatest turn that is tried, radians.

    Returns:
        `SnapError`, with inf for what the rod bears as far as was tried. An unstable rod has 0 for both.

    Raises:
        InvalidInputError: a reach that is not positive.

    Accuracy: a turn to 1e-8; a shift is the least along 24 directions and about the best of them, to about 1 %. The way
    to a fold is straight: a fold behind another is not seen. Rods are drawn to at most 98 % of their slack.

    Example:
        >>> from batten.solvers.boundary_value import solve_boundary
        >>> up = solve_boundary((0, 0), 0.0, (990, 0), 0.0, 1000)[0]  # slack 1 %
        >>> error = snap_error(up.elastica)
        >>> print(f"{error.shift:.0f} mm, {abs(np.degrees(error.turn)):.1f}°")
        10 mm, 10.2°
    """
    row = snap_errors(elastica.parameters, reach=reach, turn_reach=turn_reach)
    size, direction, turn, end = (float(v) for v in row)
    known = 0.0 < size < np.inf
    return SnapError(size, direction if known else float("nan"), turn, "end" if end > 0.5 else "start")


def snap_errors(parameters: ArrayLike, *, reach: float | None = None, turn_reach: float = np.pi) -> FloatArray:
    """`snap_error` of many rods: `parameters` (…, 7); (…, 4) with shift, direction, turn, 0 for the start or 1 for the end.

    NaN for rows that are not finite.

    Example:
        >>> bool(np.isnan(snap_errors(np.full((2, 7), np.nan))).all())
        True
    """
    p = np.asarray(parameters, dtype=np.float64)
    if p.shape[-1:] != (7,):
        raise InvalidInputError(f"parameters of elastica have shape (…, 7); got {p.shape}")
    if not ((reach is None or reach > 0.0) and turn_reach > 0.0):
        raise InvalidInputError(f"reach = {reach!r}, turn_reach = {turn_reach!r}; both must be above 0")
    rows = np.ascontiguousarray(p.reshape(-1, 7))
    length, angle = rows[:, 6], rows[:, 2]
    starts, poses = standard_numbers(rows), end_poses(rows)
    chord = (poses[:, 3:5] - poses[:, :2]) / length[:, None]
    cos, sin = np.cos(angle), np.sin(angle)
    goals = np.stack(
        [cos * chord[:, 0] + sin * chord[:, 1], cos * chord[:, 1] - sin * chord[:, 0], poses[:, 5] - angle], axis=-1
    )
    out = np.empty((len(rows), 4))
    far = np.full(len(rows), 0.5) if reach is None else reach / length
    kernel.snap_error_batch(starts, goals, far, float(turn_reach), out)
    out[:, 0] *= length
    out[:, 1] += angle
    return out.reshape(*p.shape[:-1], 4)


def snapped_shape(elastica: Elastica, error: SnapError) -> Elastica:
    """Where a rod falls to when one end is turned by a little more than `error.turn`.

    Raises:
        NoSolutionError: the rod bears every turn that was tried.
        ConvergenceError: the fall does not come to rest.

    Example:
        >>> from batten.solvers.boundary_value import solve_boundary
        >>> up = solve_boundary((0, 0), 0.0, (0.99, 0), 0.0, 1.0)[0].elastica
        >>> down = snapped_shape(up, snap_error(up))
        >>> bool(up.point_at(0.5)[1] * down.point_at(0.5)[1] < 0)
        True
    """
    if not np.isfinite(error.turn):
        raise NoSolutionError("the rod does not snap at any turn of its ends that was tried")
    first = end_poses(elastica.parameters)
    last = first.copy()
    last[2 if error.turned == "start" else 5] += 1.02 * error.turn
    tracker = RodTracker(elastica.length, solution=elastica)
    tracker.move(first)
    state = tracker.move(last)
    return state.elastica if state.snap is None else state.snap.after
