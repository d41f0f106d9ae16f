"""The boundary values of a rod between two clamps, checked, and a cubic Bézier that fulfils them: Fisker2018 §2.2.2."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from batten.curves.bezier import CubicBezier
from batten.errors import InvalidInputError, NoSolutionError
from batten.typing import ArrayLike, FloatArray


class ClampedEnds(NamedTuple):
    """The checked boundary values of a rod: start and end (2,), angles in radians, length > 0."""

    start: FloatArray
    start_angle: float
    end: FloatArray
    end_angle: float
    length: float

    @property
    def straight(self) -> bool:
        """Whether the length is the distance of the ends, so that only the straight rod is left."""
        return self.length - float(np.hypot(*(self.end - self.start))) <= 1e-15 * self.length


def clamped_ends(start: ArrayLike, start_angle: float, end: ArrayLike, end_angle: float, length: float) -> ClampedEnds:
    """Check the boundary values of a rod.

    Parameters:
        start, end: shape (2,), any unit. start_angle, end_angle: tangent angles, radians. length: of the rod, > 0.

    Returns:
        The values as numbers and arrays.

    Raises:
        InvalidInputError: another shape, a value that is not finite, a length that is not positive.
        NoSolutionError: the ends are farther apart than the rod is long, or as far and not in one line with the tangents.

    Example:
        >>> clamped_ends((0, 0), 0.0, (3, 4), 0.0, 4.0)
        Traceback (most recent call last):
        batten.errors.NoSolutionError: a rod of length 4.0 cannot reach over a distance of 5.0 ...
    """
    try:
        first, last = (np.array(p, dtype=np.float64).reshape(2) for p in (start, end))
        numbers = (float(start_angle), float(end_angle), float(length))
    except (TypeError, ValueError) as error:
        raise InvalidInputError(
            f"a rod needs two end points (x, y), two angles and a length; got {start!r}, {start_angle!r}, {end!r}, "
            f"{end_angle!r}, {length!r}"
        ) from error
    if not (np.isfinite([*first, *last, *numbers]).all() and numbers[2] > 0.0):
        raise InvalidInputError(
            f"a rod needs finite ends and angles and a positive length; got {first.tolist()}, {numbers[0]}, "
            f"{last.tolist()}, {numbers[1]}, length {numbers[2]}"
        )
    ends = ClampedEnds(first, numbers[0], last, numbers[1], numbers[2])
    chord = float(np.hypot(*(last - first)))
    if chord > ends.length * (1.0 + 1e-15):
        raise NoSolutionError(
            f"a rod of length {ends.length} cannot reach over a distance of {chord} between its ends; give a length above "
            "the distance or move the ends together"
        )
    if ends.straight:
        along = np.arctan2(*(last - first)[::-1])
        turned = [abs(float(np.arctan2(np.sin(a - along), np.cos(a - along)))) for a in numbers[:2]]
        if max(turned) > 1e-9:
            raise NoSolutionError(
                f"a rod as long as its ends are apart ({chord}) is straight, but the tangents turn away from that line by "
                f"{turned[0]:.3g} and {turned[1]:.3g} rad; give a greater length"
            )
    return ends


def feasible_bezier(ends: ClampedEnds) -> CubicBezier:
    """The cubic Bézier with the rod's end points, end tangents and length whose two arms are equally long.

    Its control points are P₁, P₁ + v t₁, P₂ − v t₂, P₂ with unit tangents (Fisker2018 §2.2.2). Its length is a convex
    function of v, at v = 0 the distance of the ends: one v > 0 gives the length asked for, if that is greater.

    Parameters:
        ends: checked boundary values; the angles count modulo 2π only.

    Returns:
        The Bézier. It may have loops; which multiple of 2π its tangent turns by comes of itself.

    Accuracy: its length is right to 1e-13.
    Degenerate cases: ends as far apart as the rod is long: the straight line, in thirds.

    Example:
        >>> curve = feasible_bezier(clamped_ends((0, 0), 0.5, (1, 0), -0.5, 1.2))
        >>> round(curve.length, 12)
        1.2
    """
    gap = (ends.end - ends.start) / ends.length
    tangents = [np.array([np.cos(a), np.sin(a)]) for a in (ends.start_angle, ends.end_angle)]

    def curve(v: float) -> FloatArray:
        return np.stack([np.zeros(2), v * tangents[0], gap - v * tangents[1], gap])

    def excess(v: float) -> float:
        return CubicBezier(curve(v)).length - 1.0

    if ends.straight:
        arm = 1.0 / 3.0
    else:
        top = 1.0
        while excess(top) <= 0.0:
            top *= 2.0
        arm = float(brentq(excess, 0.0, top, xtol=1e-16, rtol=1e-14))
    return CubicBezier(ends.start + ends.length * curve(arm))
