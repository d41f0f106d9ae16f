"""Where the descent of a chain of elements begins: Euler spirals between points, or a given closed curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from batten.curves.arc_length import ArcLength
from batten.curves.base import Curve
from batten.curves.spiral import Spiral, euler_spiral
from batten.errors import InvalidInputError, NoSolutionError
from batten.splines.interpolating_spline import End, interpolating_spline
from batten.typing import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class ChainStart:
    """Vertices of a chain: points (v, 2), angles (v,), curvatures (v, 2) before and behind; sizes (elements,)."""

    points: FloatArray
    angles: FloatArray
    curvatures: FloatArray
    sizes: FloatArray


def spiral_start(
    points: FloatArray, closed: bool, angles: FloatArray, curvatures: FloatArray, count: int, shared: BoolArray
) -> ChainStart:
    """`count` elements on the Euler spirals between neighbouring points, with these tangents and curvatures; NaN: free.

    Where no tangent is given it is that of the Euler spiral spline. `shared` (n,): one curvature
    at a point, the mean of both sides.
    """
    spirals = _spirals(points, closed, angles)
    share = np.arange(count) / count
    at = np.concatenate([s.point(share) for s in spirals])
    theta = np.concatenate([s.angle_at(share * s.length) for s in spirals])
    behind = np.concatenate([s.curvature_at(share * s.length) for s in spirals])
    sizes = np.repeat([s.length / count for s in spirals], count)
    last = np.array([s.curvature_at(s.length) for s in spirals])
    if not closed:
        at, theta = np.vstack([at, points[-1:]]), np.append(theta, spirals[-1].end_angle)
        behind = np.append(behind, last[-1])
    before = behind.copy()
    if closed:
        before[::count] = np.roll(last, 1)
    else:
        before[count::count] = last
    at[::count] = points
    theta[::count] = np.where(np.isfinite(angles), angles, theta[::count])
    kappa = np.stack([before, behind], axis=1)
    own = kappa[::count]
    one = np.where(np.isfinite(curvatures), curvatures, own.mean(axis=1))[:, None]
    kappa[::count] = np.where(shared[:, None], one, own)
    return ChainStart(at, theta, kappa, sizes)


def _spirals(points: FloatArray, closed: bool, angles: FloatArray) -> list[Spiral]:
    given = np.isfinite(angles)
    n, theta = len(points), angles.copy()
    if not given.all():
        ends: list[End] = ["natural" if closed or not given[k] else float(angles[k]) for k in (0, -1)]
        spline = interpolating_spline(points, "euler", closed=closed, start=ends[0], end=ends[1])
        own = [s for s in spline.segments if isinstance(s, Spiral)]
        if not given[slice(None) if closed else slice(1, -1)].any():
            return own
        of_spline = np.array([s.start_angle for s in own] + ([] if closed else [own[-1].end_angle]))
        theta = np.where(given, angles, of_spline)
    out = []
    for i in range(n if closed else n - 1):
        k = (i + 1) % n
        try:
            out.append(euler_spiral(points[i], theta[i], points[k], theta[k]))
        except NoSolutionError:  # both tangents straight back: half a radian off there is a spiral to start with
            out.append(euler_spiral(points[i], theta[i] - 0.5, points[k], theta[k] - 0.5))
    return out


def closed_start(start: Curve, elements: int) -> ChainStart:
    """Elements of equal lengths on a closed smooth curve; anything else is an `InvalidInputError`."""
    ruler = ArcLength.of(start)
    ends = np.array([0.0, 1.0])
    first = start.derivative(ends)
    gap = float(np.hypot(*np.diff(start.point(ends), axis=0)[0]))
    turn = float(np.angle(complex(*first[1]) * np.conj(complex(*first[0]))))
    if not (gap <= 1e-6 * ruler.length and abs(turn) <= 1e-3):
        raise InvalidInputError(
            f"start: a closed smooth curve is wanted; this one leaves a gap of {gap:.3g} on a length of {ruler.length:.3g} "
            f"and turns by {turn:.3g} rad where it closes"
        )
    t = ruler.parameter_at(np.arange(elements) / elements)
    velocity, second = start.derivative(t), start.derivative(t, 2)
    speed = np.hypot(*velocity.T)
    if not (speed > 0.0).all():
        raise InvalidInputError(
            f"start: the speed is 0 at parameter {t[np.argmin(speed)]:.6g}; a curve without cusps is wanted"
        )
    kappa = (velocity[:, 0] * second[:, 1] - velocity[:, 1] * second[:, 0]) / speed**3
    return ChainStart(
        start.point(t),
        np.arctan2(velocity[:, 1], velocity[:, 0]),
        np.stack([kappa, kappa], axis=1),
        np.full(elements, ruler.length / elements),
    )
