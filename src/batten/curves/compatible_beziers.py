"""Béziers for several masters of one design, alike in number and order, which can be interpolated."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from batten.curves.base import Curve
from batten.curves.bezier import CubicBezier
from batten.curves.bezier_breaks import fewest_places
from batten.curves.piecewise import PiecewiseCurve
from batten.curves.to_beziers import BezierPieces, Panels, checked_tolerance
from batten.errors import ConvergenceError, InvalidInputError
from batten.typing import ArrayLike, BoolArray, FloatArray

_ROUNDS = 60
_ORDER = 4.0  # of the error with shared ratios in the length of a piece, as observed
_STEPS = 8
#: What it costs, in tolerances, to make an arm e times as long as a third of its piece: it holds arms that move nothing.
_STIFF = 0.1
_T = np.linspace(0.0, 1.0, 9)[1:-1]
_FIRST, _SECOND = 3.0 * _T * (1.0 - _T) ** 2, 3.0 * _T**2 * (1.0 - _T)


def compatible_beziers(masters: Sequence[Curve], tolerance: float) -> tuple[BezierPieces, ...]:
    """Cubic Béziers for every master, as many and at the same parameters, whose means are smooth where the masters are.

    A weighted mean of control points has a kink at a joint unless the arms on both sides have the same ratio in all masters
    (Levien2009 ch. 10). So the ratios are shared: they and the arms minimise the squared distance from the cubics of
    `to_beziers` over all masters together, and pieces are added until every master is within the tolerance.

    Parameters:
        masters: two or more curves of one structure: `PiecewiseCurve`s of equally many pieces, which correspond one to
            one, or curves with equally many breaks. A corner of one master divides all of them.
        tolerance: the greatest distance of each master, as `to_beziers`.

    Returns:
        The pieces of every master, in order; `halving_pieces` is 0.

    Raises:
        InvalidInputError: fewer than two masters, masters of different structure, what `to_beziers` refuses.
        ConvergenceError: no number of pieces was found.

    Accuracy:
        Distances as `to_beziers`. Ratios of arms agree to 1e-12, so a mean turns at a smooth joint by rounding only.

    Example:
        >>> from batten.curves.spiral import Spiral
        >>> light, bold = (Spiral([0, 0], 0.0, [k, 1.0], 3.0) for k in (0.5, -1.0))
        >>> one, other = compatible_beziers([light, bold], 1e-4)
        >>> len(one.pieces) == len(other.pieces)
        True
        >>> middle = PiecewiseCurve(interpolated_beziers([one, other], [0.5, 0.5]))
        >>> bool(np.abs(middle.joints().tangent_jumps).max() < 1e-12)
        True
    """
    own = [Panels.of(master) for master in masters]
    if len(own) < 2:
        raise InvalidInputError(f"compatible_beziers needs two or more masters; got {len(own)}")
    within = checked_tolerance(tolerance, max(p.length for p in own))
    shared = [_Shared.of(p) for p in own]
    if len({len(s.knots) for s in shared}) != 1:
        raise InvalidInputError(
            f"the masters have {[len(s.knots) - 1 for s in shared]} pieces; compatible masters have equally many, in one "
            f"order"
        )
    cuts = sorted({u for s in shared for u in s.corners()})

    def error(start: float, stop: float) -> float:
        return max(s.panels.error(*s.parameters(np.array([start, stop])).tolist()) for s in shared)

    parts = [fewest_places(error, a, b, within)[0] for a, b in itertools.pairwise(cuts)]
    for _ in range(_ROUNDS):
        u = np.concatenate([*(p[:-1] for p in parts), parts[-1][-1:]])
        found = _with_shared_ratios(own, [s.parameters(u) for s in shared], within)
        off = np.max([f.distances for f in found], axis=0)
        if off.max() <= within:
            return found
        first = np.cumsum([0, *(len(p) - 1 for p in parts)])
        parts = [_divided(p, off[a:b] / within) for p, a, b in zip(parts, first[:-1], first[1:])]
    raise ConvergenceError(
        f"no compatible cubics within {within:g} were found, with up to {len(off)} pieces; allow a greater distance",
        best=found,
        residual=float(off.max()),
        iterations=_ROUNDS,
    )


def interpolated_beziers(masters: Sequence[BezierPieces], weights: ArrayLike) -> tuple[CubicBezier, ...]:
    """The weighted mean of compatible masters, control point by control point, as variable fonts interpolate.

    Parameters:
        masters: as `compatible_beziers` returns them. weights: one for each, sum 1; below 0 and above 1 extrapolate.

    Raises:
        InvalidInputError: masters with different numbers of pieces, weights whose sum is not 1.

    Example:
        >>> from batten.curves.spiral import Spiral
        >>> arcs = compatible_beziers([Spiral([0, 0], 0.0, [k], 1.0) for k in (1.0, 2.0)], 1e-3)
        >>> interpolated_beziers(arcs, [1.0, 0.0])[0].control_points.tolist() == arcs[0].control_points[0].tolist()
        True
    """
    w = np.asarray(weights, dtype=np.float64)
    sizes = [len(m.pieces) for m in masters]
    if not sizes or len(set(sizes)) != 1:
        raise InvalidInputError(f"masters have {sizes} pieces; needed are equal numbers, from compatible_beziers")
    if w.shape != (len(sizes),) or not abs(float(w.sum()) - 1.0) <= 1e-12:
        raise InvalidInputError(f"weights: got {w.tolist()}; needed are {len(sizes)} numbers with the sum 1")
    mean = np.tensordot(w, np.stack([m.control_points for m in masters]), axes=1)
    return tuple(CubicBezier(row) for row in mean)


@dataclass(frozen=True, eq=False)
class _Shared:
    """A master under a parameter u in which all masters correspond: 0, 1, 2 … at its knots.

    The arc length is a smooth function of u, so that neighbouring pieces that are equally long in u are nearly so in all
    masters, on both sides of a knot too: else shared ratios of arms would be bad for some of them.
    """

    panels: Panels
    knots: FloatArray
    fraction: PchipInterpolator

    @classmethod
    def of(cls, panels: Panels) -> _Shared:
        curve = panels.curve
        count = len(curve.pieces) if isinstance(curve, PiecewiseCurve) else len(panels.breaks) - 1
        knots = np.linspace(0.0, 1.0, count + 1) if isinstance(curve, PiecewiseCurve) else panels.breaks
        at = panels.arc.fraction_at(knots)
        u = np.arange(count + 1.0)
        if np.hypot(*(curve.point(1.0) - curve.point(0.0))) <= 1e-9 * panels.length:  # as smooth at its seam
            u = np.concatenate([u[:-1] - count, u, u[1:] + count])
            at = np.concatenate([at[:-1] - 1.0, at, at[1:] + 1.0])
        return cls(panels, knots, PchipInterpolator(u, at))

    def parameters(self, u: FloatArray) -> FloatArray:
        """Parameters of the curve; exact at knots."""
        t = self.panels.arc.parameter_at(self.fraction(u))
        whole = np.round(u).astype(np.int64)
        return np.where(u == whole, self.knots[np.clip(whole, 0, len(self.knots) - 1)], t)

    def corners(self) -> list[float]:
        """Where its runs begin and end."""
        t = np.array([*(a for a, _ in self.panels.runs), self.panels.runs[-1][1]])
        u = np.interp(t, self.knots, np.arange(len(self.knots)))
        return [float(v) for v in np.where(np.abs(u - np.round(u)) < 1e-9, np.round(u), np.round(u, 9))]


def _divided(places: FloatArray, excess: FloatArray) -> FloatArray:
    """Other ends for a run, (n + 1,): as many pieces as errors in tolerances promise to need, with equal errors."""
    if excess.max() <= 1.0:
        return places
    density = np.clip(excess, 1e-3, 1e4) ** (1.0 / _ORDER)
    total = np.concatenate([[0.0], np.cumsum(density)])
    count = max(len(excess) + 1, min(2 * len(excess), math.ceil(1.02 * total[-1])))
    moved = np.interp(np.linspace(0.0, total[-1], count + 1), total, places)
    moved[[0, -1]] = places[[0, -1]]
    return moved


def _with_shared_ratios(
    panels: Sequence[Panels], places: Sequence[FloatArray], tolerance: float
) -> tuple[BezierPieces, ...]:
    free = [p.pieces(t, tolerance, 0) for p, t in zip(panels, places)]
    tied = np.logical_and.reduce([f.smooth for f in free])
    if not tied.any():
        return tuple(free)
    target = np.stack([_arm_lengths(f.control_points) for f in free])
    thirds = np.stack([p.thirds(t) for p, t in zip(panels, places)])
    arms = _tied_arms(target, thirds, np.stack([_normals(f.control_points) for f in free]), tied, _STIFF * tolerance)
    return tuple(p.pieces(t, tolerance, 0, row) for p, t, row in zip(panels, places, arms))


def _arm_lengths(control: FloatArray) -> FloatArray:
    """(n, 2)."""
    ends = np.stack([control[:, 1] - control[:, 0], control[:, 3] - control[:, 2]], axis=1)
    return np.asarray(np.hypot(ends[..., 0], ends[..., 1]))


def _normals(control: FloatArray) -> FloatArray:
    """(n, 2, samples): how far points of a cubic move to its side for a unit of each arm."""
    d = 3.0 * np.diff(control, axis=1)
    u = 1.0 - _T
    slope = np.einsum("kt,nkd->ntd", np.stack([u * u, 2.0 * u * _T, _T * _T]), d)
    normal = np.stack([-slope[..., 1], slope[..., 0]], axis=-1) / np.hypot(slope[..., 0], slope[..., 1])[..., None]
    first, last = d[:, 0], d[:, 2]
    ends = np.stack([first, last], axis=1) / np.hypot(*np.stack([first, last], axis=1).transpose(2, 0, 1))[..., None]
    side = np.einsum("ntd,nkd->nkt", normal, ends)
    return np.asarray(side * np.stack([_FIRST, -_SECOND]))


def _tied_arms(target: FloatArray, thirds: FloatArray, side: FloatArray, tied: BoolArray, stiff: float) -> FloatArray:
    """Arms (m, n, 2) near the target whose ratio at each tied joint is that of all masters: Gauss-Newton in logarithms.

    Unknown are, for every master, the logarithms of the arms at the start of each piece and of those at ends that are not
    tied, and for all masters those of the ratios. `thirds`, (m, n), are where it starts.
    """
    m, n, _ = target.shape
    after = np.roll(tied, -1)  # is the end of each piece tied to the start of the next?
    rows = np.arange(2 * m * n).reshape(m, n, 2)  # place of each logarithm among all
    start = rows[..., 0].reshape(-1)
    loose = rows[:, ~after, 1].reshape(-1)
    joints = np.flatnonzero(after)
    columns = len(start) + len(loose) + len(joints)
    build = np.zeros((2 * m * n, columns))  # all logarithms from the unknown ones
    build[start, np.arange(len(start))] = 1.0
    build[loose, len(start) + np.arange(len(loose))] = 1.0
    for k, i in enumerate(joints):
        for j in range(m):
            build[rows[j, i, 1]] = build[rows[j, (i + 1) % n, 0]]
            build[rows[j, i, 1], len(start) + len(loose) + k] = 1.0
    rest = np.repeat(np.log(thirds)[..., None], 2, axis=-1)
    ratio = (rest[:, joints, 1] - rest[:, (joints + 1) % n, 0]).mean(axis=0)
    x = np.concatenate([rest.reshape(-1)[start], rest.reshape(-1)[loose], ratio])
    # Of the rows for each piece only the square root of their product matters: (m, n, 2, 2).
    root = np.linalg.qr(np.swapaxes(side, 2, 3), mode="r")
    for _ in range(_STEPS):
        logs = build @ x
        now = np.exp(logs.reshape(m, n, 2))
        off = np.einsum("mntk,mnk->mnt", root, now - target).reshape(-1)
        slope = np.zeros((m * n, 2, 2 * m * n))
        flat = (root * now[:, :, None, :]).reshape(m * n, 2, 2)
        for k in range(2):
            slope[np.arange(m * n), :, rows[..., k].reshape(-1)] = flat[..., k]
        matrix = np.vstack([slope.reshape(-1, 2 * m * n) @ build, stiff * build])
        step = np.linalg.lstsq(matrix, np.concatenate([off, stiff * (logs - rest.reshape(-1))]), rcond=None)[0]
        x = x - step / max(1.0, float(np.abs(step).max()))
        if np.abs(step).max() < 1e-9:
            break
    return np.exp((build @ x).reshape(m, n, 2))
