"""Paths on which the λ-residual falls: how members of the set of Fisker2018 §3.4 are joined to one place, the trunk.

Points are (x1, y1, x2, y2), the inner control points of a cubic from (0, 0) to (1, 0); its outer edges are at most
`LONGEST`.

The trunk is a box about p₁ = (1/3, 0), p₂ = (2/3, 0) without the straight lines in it. There x(t) is nearly t and y(t) a
small cubic, so that κ is nearly y″, affine in x: e_λ goes to 0 as the points go to the box's middle, from any side. A box
in four dimensions stays connected without a plane, so the trunk is connected, and it is its own mirror image.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from batten.measures.lambda_residual import lambda_residual
from batten.measures.lambda_residual_gradient import lambda_residual_gradient
from batten.typing import BoolArray, FloatArray, IntArray

LONGEST = 2.0
"""Greatest length of an outer edge, Fisker2018 §3.4."""

TRUNK = 1.0 / 60.0
"""Half the width of the trunk's box."""

_END = np.array([1.0, 0.0])
_TOLERANCE = 1e-6
_SHORT, _LONG = 0.5, 0.7  # outer edges below the first get the chart of a short edge, and keep it up to the second
_FAR = 0.1  # the far control point is then at least so far from the short edge
_FAR_STARTS = ((0.66, 0.2), (0.9, 0.3), (1.3, 0.7), (0.3, 0.5), (-0.2, 0.6))  # for the far control point
_STEP = 0.15  # longest step in the coordinates of a chart
_BETWEEN = np.array([0.25, 0.5, 0.75])  # of a step, where e_λ must have fallen too
_SEGMENT = np.linspace(0.0, 1.0, 65)
_LOW = 0.05  # straight ways as low as this are low enough from any start
_ROUND = 40  # steps of descent between two looks at the trunk


def control_points(inner: FloatArray) -> FloatArray:
    """Control points (…, 4, 2) of points (…, 4)."""
    control = np.zeros((*inner.shape[:-1], 4, 2))
    control[..., 1, :], control[..., 2, :], control[..., 3, 0] = inner[..., :2], inner[..., 2:], 1.0
    return control


def residual(inner: FloatArray) -> FloatArray:
    """e_λ of points (…, 4)."""
    return np.asarray(lambda_residual(control_points(inner), tolerance=_TOLERANCE))


def mirrored(inner: FloatArray) -> FloatArray:
    """The image in the x axis."""
    return inner * np.array([1.0, -1.0, 1.0, -1.0])


def reversed_ends(inner: FloatArray) -> FloatArray:
    """The curve run through from its other end, then mirrored in x = ½, so that it goes from (0, 0) to (1, 0) again."""
    return np.stack([1.0 - inner[..., 2], inner[..., 3], 1.0 - inner[..., 0], inner[..., 1]], axis=-1)


def edge_lengths(inner: FloatArray) -> FloatArray:
    """L₁ and L₂, (…, 2)."""
    return np.stack([np.hypot(inner[..., 0], inner[..., 1]), np.hypot(inner[..., 2] - 1.0, inner[..., 3])], axis=-1)


def _value_and_gradient(inner: FloatArray) -> tuple[FloatArray, FloatArray]:
    value, gradient = lambda_residual_gradient(control_points(inner), tolerance=_TOLERANCE)
    return value, gradient[..., 1:3, :].reshape(*inner.shape)


def _within(inner: FloatArray) -> FloatArray:
    """Both outer edges cut to `LONGEST`."""
    out = inner.copy()
    for columns, end in ((slice(0, 2), 0.0), (slice(2, 4), _END)):
        edge = out[..., columns] - end
        length = np.linalg.norm(edge, axis=-1, keepdims=True)
        out[..., columns] = np.where(length > LONGEST, end + edge * (LONGEST / np.maximum(length, 1e-300)), edge + end)
    return out


# --- the chart of a short first edge: (ln L₁, (θ₁ − arg p₂)/L₁, x2, y2) ---
# With a short edge, e_λ is small only where it points at the far control point up to an angle of the order of its length.


def _to_chart(inner: FloatArray) -> FloatArray:
    length = np.hypot(inner[:, 0], inner[:, 1])
    turn = np.arctan2(inner[:, 1], inner[:, 0]) - np.arctan2(inner[:, 3], inner[:, 2])
    turn = (turn + np.pi) % (2.0 * np.pi) - np.pi
    return np.stack([np.log(length), turn / length, inner[:, 2], inner[:, 3]], axis=1)


def _from_chart(chart: FloatArray) -> FloatArray:
    length = np.exp(chart[..., 0])
    angle = np.arctan2(chart[..., 3], chart[..., 2]) + chart[..., 1] * length
    return np.stack([length * np.cos(angle), length * np.sin(angle), chart[..., 2], chart[..., 3]], axis=-1)


def _chart_gradient(chart: FloatArray, gradient: FloatArray) -> FloatArray:
    length = np.exp(chart[:, 0])
    angle = np.arctan2(chart[:, 3], chart[:, 2]) + chart[:, 1] * length
    c, s = np.cos(angle), np.sin(angle)
    along, across = gradient[:, 0] * c + gradient[:, 1] * s, gradient[:, 1] * c - gradient[:, 0] * s
    turned = length * across / (chart[:, 2] ** 2 + chart[:, 3] ** 2)
    return np.stack(
        [
            length * (along + length * chart[:, 1] * across),
            length**2 * across,
            gradient[:, 2] - turned * chart[:, 3],
            gradient[:, 3] + turned * chart[:, 2],
        ],
        axis=1,
    )


def descended(inner: FloatArray, steps: int, knots: list[FloatArray] | None = None, *, pieces: int = 4) -> FloatArray:
    """Points after some steps of descent of e_λ, each of them a path on which e_λ stays below where it began.

    Parameters:
        inner: points (n, 4), none on a straight line or a cusp. steps: ≥ 0. knots: gets so many points (n, 4) of
            each step as `pieces` says, its end last. With a short edge a step is a curve.

    Returns:
        Points (n, 4). A step is taken only if e_λ is lower at its end and at three places on the way.

    Example:
        >>> start = np.array([[0.0, 1.0, 0.9, 0.6]])
        >>> bool(residual(descended(start, 50))[0] < 0.05 < residual(start)[0])
        True
    """
    flipped = np.diff(edge_lengths(inner), axis=-1)[:, 0] < 0.0
    out = np.where(flipped[:, None], reversed_ends(inner), inner)
    short = (edge_lengths(out)[:, 0] < _SHORT) & (np.hypot(out[:, 2], out[:, 3]) > _FAR)
    ways = np.repeat(out[None], pieces * steps if knots is not None else 0, axis=0)
    for rows, chart in ((short, True), (~short, False)):
        if rows.any():
            way: list[FloatArray] = []
            out[rows] = _descended(out[rows], steps, chart, None if knots is None else way, pieces)
            if knots is not None and steps:
                ways[:, rows] = way
    if knots is not None:
        knots.extend(np.where(flipped[:, None], reversed_ends(ways), ways))
    return np.where(flipped[:, None], reversed_ends(out), out)


def _descended(inner: FloatArray, steps: int, chart: bool, knots: list[FloatArray] | None, pieces: int) -> FloatArray:
    """By the quasi-Newton steps of Broyden, Fletcher, Goldfarb and Shanno, in the chart of a short first edge or without."""

    def points_of(place: FloatArray) -> FloatArray:
        return _from_chart(place) if chart else place

    def value_and_gradient(place: FloatArray) -> tuple[FloatArray, FloatArray]:
        value, gradient = _value_and_gradient(points_of(place))
        return value, _chart_gradient(place, gradient) if chart else gradient

    place = _to_chart(inner) if chart else inner.copy()
    values, gradients = value_and_gradient(place)
    inverse = np.tile(np.eye(4), (len(place), 1, 1))
    share = np.ones(len(place))
    for _ in range(steps):
        change = -share[:, None] * np.einsum("nij,nj->ni", inverse, gradients)
        change *= np.minimum(1.0, _STEP / np.maximum(np.abs(change).max(axis=1), 1e-300))[:, None]
        new = place + change
        if chart:
            new[:, 0] = np.minimum(new[:, 0], np.log(_LONG))
            new[:, 2:] = _within(_from_chart(new))[:, 2:]
        else:
            new = _within(new)
        new_values, new_gradients = value_and_gradient(new)
        better = (new_values < values) & np.isfinite(new_gradients).all(axis=1)
        way = points_of(place + _BETWEEN[:, None, None] * (new - place))
        better[better] = (residual(way[:, better]) < values[better]).all(axis=0)
        _update(inverse, new - place, new_gradients - gradients, better, share < 0.02)
        share = np.where(better, 1.0, np.where(share < 0.02, 1.0, 0.3 * share))
        old, place = place, np.where(better[:, None], new, place)
        values, gradients = np.where(better, new_values, values), np.where(better[:, None], new_gradients, gradients)
        if knots is not None:
            shares = np.linspace(0.0, 1.0, pieces + 1)[1:, None, None]
            knots.extend(points_of(old + shares * (place - old)))
    return points_of(place)


def _update(inverse: FloatArray, s: FloatArray, y: FloatArray, better: BoolArray, worn: BoolArray) -> None:
    """The inverse Hessians (n, 4, 4) after steps s with changes y of the gradient; begun again, smaller, where worn."""
    product = np.einsum("ni,ni->n", s, y)
    size = np.einsum("ni,ni->n", y, y)
    rows = np.flatnonzero(better & (product > 1e-12 * size))
    rho = 1.0 / product[rows, None, None]
    left = np.eye(4) - rho * s[rows, :, None] * y[rows, None, :]
    inverse[rows] = left @ inverse[rows] @ left.transpose(0, 2, 1) + rho * s[rows, :, None] * s[rows, None, :]
    rows = np.flatnonzero(~better & worn)
    inverse[rows] = np.eye(4) * np.minimum(1.0, 0.1 * np.trace(inverse[rows], axis1=1, axis2=2))[:, None, None]


def in_trunk(inner: FloatArray) -> FloatArray:
    """The points of the trunk's box nearest to points (n, 4)."""
    middle = np.array([1.0 / 3.0, 0.0, 2.0 / 3.0, 0.0])
    return np.clip(inner, middle - TRUNK, middle + TRUNK)


def trunk_level() -> float:
    """The greatest e_λ found in the trunk, on a grid of it that is also fine towards the lines in the middle.

    Example:
        >>> 0.05 < trunk_level() < 0.1
        True
    """
    across = np.linspace(-TRUNK, TRUNK, 9)
    angle = np.linspace(0.0, np.pi, 48, endpoint=False)
    size = TRUNK * np.array([1e-3, 0.1, 0.3, 0.6, 1.0])
    x1, x2, a, r = np.meshgrid(1.0 / 3.0 + across, 2.0 / 3.0 + across, angle, size, indexing="ij")
    most = r / np.maximum(np.abs(np.cos(a)), np.abs(np.sin(a)))
    return float(residual(np.stack([x1, most * np.cos(a), x2, most * np.sin(a)], axis=-1)).max())


@dataclass(frozen=True, eq=False)
class Joined:
    """How points are joined to the trunk.

    Attributes:
        levels: the greatest e_λ on the way found, (n,): the point and the trunk are in one component of every set
            e_λ < c with c above it (and above `trunk_level`). inf if none was found.
        rounds: of descent that it took, (n,).
        paths: the knots of the way, from the point into the trunk, if they were asked for.
    """

    levels: FloatArray
    rounds: IntArray
    paths: tuple[FloatArray, ...] = ()


def join(inner: FloatArray, *, most_rounds: int = 100, keep_paths: bool = False, pieces: int = 4) -> Joined:
    """Join points to the trunk: down, until the straight way into the trunk is no higher than the start.

    Parameters:
        inner: points (n, 4). most_rounds: of `_ROUND` steps of descent each; then the lowest straight way found is taken.
        keep_paths: keep knots. pieces: of each step of descent, between knots.

    Returns:
        A `Joined`. Straight ways are looked at in 65 places. A level above the start's own e_λ is an upper bound only.

    Example:
        >>> arch, loop = [-0.5, 1.6, 1.5, 1.6], [1.7, 1.05, -0.7, 1.05]
        >>> (join(np.array([arch, loop]), most_rounds=10).levels < 0.2).tolist()
        [True, False]
    """
    start = residual(inner)
    levels, rounds = np.full(len(inner), np.inf), np.zeros(len(inner), np.int64)
    paths: list[list[FloatArray]] = [[row] for row in inner] if keep_paths else []
    ends = list(inner) if keep_paths else []
    left, here = np.arange(len(inner)), inner.copy()
    for round_ in range(most_rounds + 1):
        straight = _straight_level(here[left], in_trunk(here[left]))
        found = np.maximum(straight, start[left])
        for k in np.flatnonzero(found < levels[left]) if keep_paths else ():
            ends[left[k]] = here[left[k]]
        levels[left] = np.minimum(levels[left], found)
        rounds[left] = round_
        left = left[straight > np.maximum(start[left], _LOW)]
        if not left.size or round_ == most_rounds:
            break
        knots: list[FloatArray] | None = [] if keep_paths else None
        here[left] = descended(here[left], _ROUND, knots, pieces=pieces)
        for row, k in enumerate(left) if keep_paths else ():
            paths[k].extend(knot[row] for knot in knots or ())
    ways = tuple(_finished(path, end) for path, end in zip(paths, ends))
    return Joined(levels, rounds, ways)


def _finished(path: list[FloatArray], end: FloatArray) -> FloatArray:
    """A way down as far as `end`, without the steps that were not taken, and straight into the trunk from there."""
    last = next(k for k, knot in enumerate(path) if np.array_equal(knot, end))
    way = np.array([*path[: last + 1], in_trunk(end[None])[0]])
    return way[np.append(True, (np.diff(way, axis=0) != 0.0).any(axis=1))]


def _straight_level(start: FloatArray, end: FloatArray) -> FloatArray:
    """The greatest e_λ on straight ways (n, 4) to (n, 4)."""
    out = np.empty(len(start))
    for first in range(0, len(start), 4096):
        rows = slice(first, first + 4096)
        ways = start[None, rows] + _SEGMENT[:, None, None] * (end[None, rows] - start[None, rows])
        out[rows] = residual(ways).max(axis=0)
    return out


def to_mirror_image(path: FloatArray) -> FloatArray:
    """From the start of a path into the trunk to the mirror image of the start: through S-shapes in the trunk.

    Example:
        >>> path = join(np.array([[-0.5, 1.6, 1.5, 1.6]]), keep_paths=True).paths[0]
        >>> way = to_mirror_image(path)
        >>> bool((way[-1] == mirrored(way[0])).all()), stays_below(way, 0.2)
        (True, True)
    """
    x1, y1, x2, y2 = path[-1]
    one, other = np.copysign(TRUNK, y1), np.copysign(TRUNK, y2)
    over = [[x1, one, x2, other], [x1, one, x2, -other], [x1, -one, x2, -other]]
    return np.vstack([path, over, mirrored(path[::-1])])


def stays_below(path: FloatArray, level: float) -> bool:
    """Whether e_λ stays below a level all along the straight pieces between knots (k, 4), by what its slope allows.

    A piece passes if the higher of its ends, and half its length at twice the steeper of the slopes at its ends, stay
    below; else it is halved, thirty times at most. So no rise can hide between two places that is not announced by its
    slope there.

    Example:
        >>> arch = np.array([0.1, 0.7, 0.9, 0.7])
        >>> stays_below(np.array([arch, 0.5 * arch + [0.2, 0.0, 0.3, 0.0]]), 0.2)
        True
        >>> stays_below(np.array([arch, [0.9, 0.7, 0.1, 0.7]]), 0.2)
        False
    """
    start, end = path[:-1], path[1:]
    for _ in range(30):
        moving = (start != end).any(axis=1)
        start, end = start[moving], end[moving]
        if not len(start):
            return True
        way = end - start
        values, gradients = _value_and_gradient(np.stack([start, end]))
        if not np.isfinite(gradients).all() or values.max() >= level:
            return False
        slope = np.abs((gradients * way).sum(axis=-1)).max(axis=0)
        open_ = values.max(axis=0) + slope >= level
        if not open_.any():
            return True
        middle = 0.5 * (start[open_] + end[open_])
        start, end = np.concatenate([start[open_], middle]), np.concatenate([middle, end[open_]])
    return False


def least_by_edge(lengths: FloatArray) -> FloatArray:
    """The least e_λ found among cubics whose first outer edge has each of these lengths (n,), going from one to the next.

    Example:
        >>> least = least_by_edge(np.array([0.3, 0.1, 0.01]))
        >>> bool((np.diff(least) > 0).all() and least[-1] < 0.1)
        True
    """
    free = np.array([0.0, 0.9, 0.3])
    out = np.empty(len(lengths))
    for k, length in enumerate(lengths):
        u = float(np.log(length))

        def value(rest: FloatArray, u: float = u) -> tuple[float, FloatArray]:
            chart = np.array([[u, *rest]])
            values, gradients = _value_and_gradient(_from_chart(chart))
            return float(values[0]), _chart_gradient(chart, gradients)[0, 1:]

        starts = [free, *(np.array([0.0, *far]) for far in _FAR_STARTS)]
        found = min((minimize(value, start, jac=True, method="BFGS") for start in starts), key=lambda f: float(f.fun))
        free, out[k] = found.x, found.fun
    return out
