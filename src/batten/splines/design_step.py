"""One step of a design: what became of it, and which pieces it changes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from batten.curves.cubic_proxy import CubicProxy
from batten.splines.design_limits import BrokenLimit
from batten.typing import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class DesignStep:
    """What became of one operation.

    Attributes:
        action: "move", "insert", "delete", "borders", "limits", "undo" or "redo".
        outcome: "done"; "clamped", a move that ended elsewhere than asked because of the limits; "refused", nothing changed.
        index: the control point, the piece or the joint that was named; None where none is.
        asked: where the control point should go; None for other actions.
        point: where it is now. Borders may hold it elsewhere than asked although the outcome is "done".
        pieces: the numbers of the pieces that changed, as they are counted now; for a refused step, those that it would have
            changed, and their measures are those of before.
        residuals, angle_errors, classes: e_λ, radians and `lambda_class` of these pieces as they are now.
        broken: refused: the limits that the step would have broken, pieces counted as they would then be. Else: all limits
            of the whole design that are broken now; empty unless they were before, or limits were changed.
        reason: in words, why a step was refused or clamped, or what else was done to keep the limits; empty else.
    """

    action: str
    outcome: str
    index: int | None
    asked: tuple[float, float] | None
    point: tuple[float, float] | None
    pieces: IntArray
    residuals: FloatArray
    angle_errors: FloatArray
    classes: tuple[str, ...]
    broken: tuple[BrokenLimit, ...]
    reason: str


def touched_pieces(proxy: CubicProxy, index: int) -> IntArray:
    """The pieces that moving a control point changes, those included that others change that follow it."""
    moved = np.array(proxy.freedom(index).response.any(axis=(1, 2)))
    moved[index] = True
    return np.flatnonzero(proxy.bezier_matrix[:, :, moved].any(axis=(1, 2))).astype(np.int64)


def is_one_move(before: CubicProxy, now: CubicProxy, index: int) -> bool:
    """Whether one spline is the other with one control point moved, and those that follow it."""
    if before.continuity != now.continuity or before.borders != now.borders:
        return False
    if before.control_points.shape != now.control_points.shape:
        return False
    expected = before.with_control_point(index, now.control_points[index]).control_points
    size = float(np.ptp(now.control_points, axis=0).max())
    return bool(np.abs(expected - now.control_points).max() <= 1e-12 * size)


def without_end(proxy: CubicProxy, joint: int) -> CubicProxy:
    """The spline without its first piece (joint 0) or its last one; the others stay as they are."""
    if joint > 0:
        return without_end(proxy.reversed(), 0).reversed()
    borders = None if proxy.borders is None else proxy.borders[1:]
    if proxy.continuity == 2:
        shorter = CubicProxy.from_beziers(proxy.pieces[1:], 2).control_points
    else:
        shorter = np.concatenate([proxy.joints[1:2], proxy.control_points[3:]])
    return CubicProxy(shorter, proxy.continuity, borders)


def unchanged_pieces(old: FloatArray, now: FloatArray, before: IntArray) -> BoolArray:
    """Whether each piece of `now` is the piece `before[k]` of `old`, to rounding."""
    size = float(np.ptp(old.reshape(-1, 2), axis=0).max())
    return np.asarray((before >= 0) & (np.abs(now - old[before]).max(axis=(1, 2)) <= 1e-12 * size))
