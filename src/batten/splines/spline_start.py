"""Where an elastic spline begins: a cubic spline through the points, and clamped elastica that look like a design."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from batten.curves.base import Curve
from batten.curves.bezier import CubicBezier
from batten.curves.bspline import BSplineCurve
from batten.curves.elastica import states_along
from batten.curves.piecewise import PiecewiseCurve
from batten.errors import ConvergenceError, InvalidInputError
from batten.solvers.boundary_value import STATUS, solve_boundary_batch
from batten.splines.joint_descent import RodPieces
from batten.typing import ArrayLike, FloatArray

_PLACES = 33  # where shapes are compared, on each piece
_FINE = 16  # samples between two of them, to follow the tangent angle


_LEAST_SPARE = 0.05  # of the greatest: a straight piece of a design does not begin taut


class DesignJoints(NamedTuple):
    """What an elastic spline takes from a design of m pieces.

    Attributes:
        angles: (m + 1,), tangent angles at the joints, continuous along the curve. lengths: (m,).
        headings: (m, 33), tangent angles of each piece at equal steps of arc length, continuous along the curve.
    """

    angles: FloatArray
    lengths: FloatArray
    headings: FloatArray


def checked_points(points: ArrayLike) -> FloatArray:
    """Points to interpolate, (n, 2), n ≥ 2, neighbours apart, or `InvalidInputError`."""
    try:
        p = np.array(points, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"points are numbers of shape (n, 2), n ≥ 2; got {points!r}") from error
    if p.ndim != 2 or p.shape[1] != 2 or len(p) < 2 or not np.isfinite(p).all():
        raise InvalidInputError(f"points to interpolate have shape (n, 2), n ≥ 2, all finite; got shape {p.shape}")
    steps = np.hypot(*np.diff(p, axis=0).T)
    if not (steps > 1e-9 * np.ptp(p, axis=0).max()).all():
        raise InvalidInputError(
            f"neighbouring points must differ; points {np.flatnonzero(~(steps > 0.0))[:5].tolist()} lie on the next ones"
        )
    return p


def interpolating_cubic(
    points: ArrayLike, start_angle: float | None, end_angle: float | None, *, uniform: bool = False
) -> BSplineCurve:
    """The cubic spline through points with given end tangents, twice continuously differentiable (Fisker2018 §5.1.2).

    Parameters:
        points: (n, 2), n ≥ 2. start_angle, end_angle: radians; None leaves the end without curvature.
        uniform: knots at equal steps, as in the paper; else at chord lengths, which makes fewer loops where the points lie
            at unequal distances. The speed at a clamped end is that of the chord beside it, as the paper leaves it open.

    Raises:
        InvalidInputError: points of a wrong shape, not finite, or neighbours that coincide; an angle that is not finite.

    Example:
        >>> wave = interpolating_cubic([(0, 0), (1, 1), (2, 0)], 0.0, 0.0, uniform=True)
        >>> wave.point([0.5, 1.0]).round(12).tolist()
        [[1.0, 1.0], [2.0, 0.0]]
    """
    from scipy.interpolate import make_interp_spline

    p = checked_points(points)
    chords = np.hypot(*np.diff(p, axis=0).T)
    steps = np.full(len(chords), 1.0 / len(chords)) if uniform else chords / chords.sum()
    t = np.concatenate([[0.0], np.cumsum(steps)])
    t[-1] = 1.0
    conditions = []
    for angle, chord, step in ((start_angle, chords[0], steps[0]), (end_angle, chords[-1], steps[-1])):
        if angle is None:
            conditions.append([(2, np.zeros(2))])
        elif np.isfinite(angle):
            conditions.append([(1, chord / step * np.array([np.cos(angle), np.sin(angle)]))])
        else:
            raise InvalidInputError(f"an end angle is a finite number of radians or None; got {angle}")
    spline = make_interp_spline(t, p, k=3, bc_type=tuple(conditions))
    return BSplineCurve(spline.t, spline.c, 3)


def hermite_cubics(points: FloatArray, angles: FloatArray) -> PiecewiseCurve:
    """Cubic Béziers through points (n, 2) with tangent angles (n,), their arms a third of the chord (§5.1.1)."""
    arms = np.hypot(*np.diff(points, axis=0).T)[:, None] / 3.0
    tangents = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    corners = [points[:-1], points[:-1] + arms * tangents[:-1], points[1:] - arms * tangents[1:], points[1:]]
    return PiecewiseCurve([CubicBezier(c) for c in np.stack(corners, axis=1)])


def design_joints(design: Curve, pieces: int) -> DesignJoints:
    """Read angles, lengths and shapes off a design.

    Parameters:
        design: its joints lie at its breaks, if these make so many pieces, else at t = i/pieces.
        pieces: how many.

    Raises:
        InvalidInputError: not a curve, or one that stands still or has no length in a piece.
    """
    if not isinstance(design, Curve):
        raise InvalidInputError(f"a design is a curve, such as a spline or an elastic spline's curve; got {design!r}")
    breaks = np.asarray(design.breaks(), dtype=np.float64)
    edges = breaks if len(breaks) == pieces + 1 else np.linspace(0.0, 1.0, pieces + 1)
    count = (_PLACES - 1) * _FINE
    t = edges[:-1, None] + np.diff(edges)[:, None] * (np.arange(count) + 0.5) / count  # middles: no corner is met
    velocity = design.derivative(t)
    speed = np.hypot(velocity[..., 0], velocity[..., 1]) * np.diff(edges)[:, None] / count
    lengths = speed.sum(axis=1)
    if not (np.isfinite(lengths).all() and (lengths > 0.0).all()):
        raise InvalidInputError(f"the design has no length in one of its {pieces} pieces, or is not finite")
    # The tangent at a joint: between the two beside it, so that a design with a corner there will do.
    angles = np.unwrap(np.arctan2(velocity[..., 1], velocity[..., 0]).ravel()).reshape(pieces, count)
    tips = 1.5 * angles[:, [0, -1]] - 0.5 * angles[:, [1, -2]]
    joints = np.concatenate([tips[:1, 0], 0.5 * (tips[1:, 0] + tips[:-1, 1]), tips[-1:, 1]])
    arc = np.concatenate([np.zeros((pieces, 1)), np.cumsum(speed, axis=1)], axis=1)
    headings = np.empty((pieces, _PLACES))
    for i in range(pieces):
        wanted = np.linspace(0.0, arc[i, -1], _PLACES)
        headings[i] = np.interp(wanted, 0.5 * (arc[i, 1:] + arc[i, :-1]), angles[i])
    return DesignJoints(joints, lengths, headings)


def shared_length(lengths: FloatArray, chords: FloatArray, total: float) -> FloatArray:
    """Lengths with a given sum above that of the chords: what they have beyond their chords, all by one factor."""
    spare = np.maximum(lengths - chords, _LEAST_SPARE * float((lengths - chords).max(initial=1e-9)))
    return np.asarray(chords + spare * (total - chords.sum()) / spare.sum())


def clamped_pieces(
    points: FloatArray, angles: FloatArray, lengths: FloatArray, headings: FloatArray | None
) -> RodPieces:
    """Stable clamped elastica between points: those of least energy, or with tangent angles nearest to `headings`.

    Angles, because a rod much longer than its design comes nearest to that in space with loops pulled tight.

    Raises:
        ConvergenceError: a piece without a stable shape that could be found.
    """
    batch = solve_boundary_batch(points[:-1], angles[:-1], points[1:], angles[1:], lengths, workers=1)
    stable = batch.margin > 1.0
    for i in np.flatnonzero(~stable.any(axis=1)):
        chord = float(np.hypot(*(points[i + 1] - points[i])))
        raise ConvergenceError(
            f"piece {i}, {lengths[i]:.6g} long over a distance of {chord:.6g} between angles {angles[i]:.4g} and "
            f"{angles[i + 1]:.4g}, has no stable shape that could be found ({STATUS[batch.status[i]]}); give more length "
            "or other end angles"
        )
    cost = batch.energy.copy()
    if headings is not None:
        at = np.linspace(0.0, 1.0, headings.shape[1]) * lengths[:, None, None]
        along = np.broadcast_to(at, (*cost.shape, at.shape[-1]))
        cost = ((states_along(batch.parameters, along)[..., 2] - headings[:, None]) ** 2).sum(axis=2)
    cost[~stable] = np.inf
    chosen = batch.parameters[np.arange(len(lengths)), np.argmin(cost, axis=1)]
    pieces, found = RodPieces.of(points, angles, chosen).corrected()
    if not found.all():
        raise ConvergenceError(
            f"pieces {np.flatnonzero(~found).tolist()} are too stiff to be computed from their starts; give more length"
        )
    return pieces
