"""Free distances between capsules and boxes, exact and in batches: arms, grippers, rod, block and table are made of them.

A capsule is a segment with a radius. Two closed forms suffice. The squared distance of two segments is a convex quadratic
over a square of parameters, so its minimum lies inside, where the gradient vanishes, or on one of the four sides, where a
point meets a segment. The signed distance of a point from a box is convex along a segment; outside the box its derivative is
linear between the six places where the segment crosses the planes of the box's faces, inside it is the greatest of six
linear functions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from batten.errors import InvalidInputError
from batten.typing import ArrayLike, BoolArray, FloatArray, IntArray

_PARALLEL = 1e-12  # sin² of the angle between two segments below which only their ends are looked at
_SLACK = 1e-6  # bounds are compared with so much to spare for rounding
_TOUCHING = 1e-12  # of its coordinates: a segment so near to a box may reach into it


def segment_distance(a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> FloatArray:
    """Least distance between the segments from a to b and from c to d.

    Parameters:
        a, b, c, d: points, shapes that broadcast to (…, 3).

    Returns:
        Shape (…); NaN where a point has NaN.

    Accuracy: 1e-12 of the greatest coordinate difference; for segments parallel within 1e-6 rad, 1e-6 of the shorter one.
    Degenerate: a segment of no length is a point.

    Example:
        >>> float(segment_distance((0, 0, 0), (2, 0, 0), (1, -1, 3), (1, 1, 3)))
        3.0
    """
    p, q, r, s = np.broadcast_arrays(*(np.asarray(v, dtype=np.float64) for v in (a, b, c, d)))
    u, v, w = q - p, s - r, p - r
    uu, uv, vv = (u * u).sum(axis=-1), (u * v).sum(axis=-1), (v * v).sum(axis=-1)
    uw, vw = (u * w).sum(axis=-1), (v * w).sum(axis=-1)
    det = uu * vv - uv * uv
    askew = det > _PARALLEL * uu * vv
    safe = np.where(askew, det, 1.0)
    f, g = (uv * vw - vv * uw) / safe, (uu * vw - uv * uw) / safe
    crossing = askew & (f >= 0.0) & (f <= 1.0) & (g >= 0.0) & (g <= 1.0)
    between = ((w + f[..., None] * u - g[..., None] * v) ** 2).sum(axis=-1)
    least = np.where(crossing, between, np.inf)
    for point, start, run, square in ((p, r, v, vv), (q, r, v, vv), (r, p, u, uu), (s, p, u, uu)):
        away = point - start
        t = np.clip((away * run).sum(axis=-1) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
        least = np.minimum(least, ((away - t[..., None] * run) ** 2).sum(axis=-1))
    return np.asarray(np.sqrt(least))


def box_distance(points: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Signed distance of points (…, 3) from boxes with corners that broadcast to (…, 3): negative within; shape (…)."""
    beyond = np.maximum(low - points, points - high)
    outside = np.sqrt((np.maximum(beyond, 0.0) ** 2).sum(axis=-1))
    return np.asarray(outside + np.minimum(beyond.max(axis=-1), 0.0))


def segment_box_distance(a: ArrayLike, b: ArrayLike, low: ArrayLike, high: ArrayLike) -> FloatArray:
    """Least signed distance of the points of a segment from an axis-parallel box: negative within it.

    Parameters:
        a, b: ends of the segments, shapes that broadcast to (…, 3).
        low, high: corners of the boxes, the same; low ≤ high, infinite values allowed.

    Returns:
        Shape (…); within the box, minus the depth of the deepest point; NaN where a point has NaN.

    Accuracy: 1e-12 of the greatest coordinate difference.
    Degenerate: a segment of no length is a point; a box may be flat.

    Example:
        >>> float(segment_box_distance((-5, 0, 3), (5, 0, 3), (-1, -1, 0), (1, 1, 1)))
        2.0
        >>> float(segment_box_distance((-5, 0, 0.4), (5, 0, 0.4), (-1, -1, 0), (1, 1, 1)))
        -0.4
    """
    start, end, lo, hi = np.broadcast_arrays(*(np.asarray(v, dtype=np.float64) for v in (a, b, low, high)))
    shape = start.shape[:-1]
    start, end, lo, hi = (v.reshape(-1, 3) for v in (start, end, lo, hi))
    run = end - start
    with np.errstate(divide="ignore", invalid="ignore"):
        into, out_of = (lo - start) / run, (hi - start) / run
    cross = np.clip(np.nan_to_num(np.concatenate([into, out_of], axis=1), copy=False), 0.0, 1.0)
    knots = np.zeros((len(cross), 8))
    knots[:, 1:7], knots[:, 7] = np.sort(cross, axis=1), 1.0
    # Half the derivative of the squared distance: increasing, linear from knot to knot, so its zero is found by weights.
    slope = np.zeros_like(knots)
    for i in range(3):
        x = start[:, i, None] + knots * run[:, i, None]
        slope += (np.maximum(x - hi[:, i, None], 0.0) - np.maximum(lo[:, i, None] - x, 0.0)) * run[:, i, None]
    row = np.arange(len(slope))
    right = np.where(slope[:, -1] < 0.0, 7, np.maximum((slope >= 0.0).argmax(axis=1), 1))
    s0, s1 = slope[row, right - 1], slope[row, right]
    rise = s1 - s0
    share = np.clip(np.divide(-s0, rise, out=np.where(s1 < 0.0, 1.0, 0.0), where=rise > 0.0), 0.0, 1.0)
    t = knots[row, right - 1] + share * (knots[row, right] - knots[row, right - 1])
    nearest = start + t[:, None] * run
    gap = np.maximum(np.maximum(lo - nearest, nearest - hi), 0.0)
    least = np.sqrt((gap**2).sum(axis=1))
    near = np.flatnonzero(least <= _TOUCHING * (np.abs(start) + np.abs(run)).sum(axis=1))
    if near.size:
        depth = _depth(start[near], run[near], lo[near], hi[near])
        least[near] = np.where(depth >= 0.0, -depth, least[near])
    return np.asarray(least.reshape(shape))


def _depth(start: FloatArray, run: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """How deep in their boxes the deepest points of n segments lie, (n,), negative outside: a concave polygon's top."""
    height = np.concatenate([start - low, high - start], axis=1)  # (n, 6): distance within each face, linear in t
    rate = np.concatenate([run, -run], axis=1)
    first, second = np.triu_indices(6, 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        corner = (height[:, second] - height[:, first]) / (rate[:, first] - rate[:, second])
    corner = np.clip(np.where(np.isfinite(corner), corner, 0.0), 0.0, 1.0)
    corner = np.concatenate([corner, np.zeros((len(corner), 1)), np.ones((len(corner), 1))], axis=1)
    with np.errstate(invalid="ignore"):
        faces = np.where(np.isfinite(height)[:, None], height[:, None] + corner[..., None] * rate[:, None], np.inf)
    return np.asarray(faces.min(axis=2).max(axis=1))


@dataclass(frozen=True, eq=False)
class Capsules:
    """m capsules, the same ones in k poses: `start`, `end` (k, m, 3), `radius` (m,), `names` m of them."""

    start: FloatArray
    end: FloatArray
    radius: FloatArray
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        m = len(self.names)
        if self.start.shape != self.end.shape or self.start.shape[1:] != (m, 3) or self.radius.shape != (m,):
            raise InvalidInputError(
                f"{m} capsules need ends (k, {m}, 3) and radii ({m},); got {self.start.shape}, {self.end.shape} and "
                f"{self.radius.shape}"
            )

    @classmethod
    def joined(cls, parts: tuple[Capsules, ...]) -> Capsules:
        """All capsules of the parts, which have as many poses each, one after the other."""
        return cls(
            np.concatenate([p.start for p in parts], axis=1),
            np.concatenate([p.end for p in parts], axis=1),
            np.concatenate([p.radius for p in parts]),
            tuple(name for p in parts for name in p.names),
        )


@dataclass(frozen=True, eq=False)
class Box:
    """An axis-parallel box that stands still: corners `low` and `high` (3,), infinite values allowed, and its name."""

    low: FloatArray
    high: FloatArray
    name: str


class Clearance(NamedTuple):
    """For each pose the least free distance and the pair that has it.

    `distance` (k,): negative where they overlap, infinite without pairs, NaN where a capsule of a pair has NaN.
    `first`, `second` (k,): index of a capsule, and of another or, from the number of capsules on, of a box.
    """

    distance: FloatArray
    first: IntArray
    second: IntArray


def least_clearance(
    capsules: Capsules, pairs: IntArray, boxes: tuple[Box, ...] = (), against: BoolArray | None = None
) -> Clearance:
    """The least free distance in each pose, over pairs of capsules and over capsules against boxes.

    Parameters:
        capsules: m of them in k poses.
        pairs: (p, 2), indices of capsules that must stay clear of each other.
        boxes: b of them.
        against: (m, b), which capsule must stay clear of which box; None stands for all.

    Returns:
        A distance and the pair for each pose.

    Raises:
        InvalidInputError: an index or a shape that does not fit.

    Accuracy: that of `segment_distance` and `segment_box_distance`. Two capsules whose axes cross overlap by the sum of
    their radii. Pairs whose bounding balls are further apart than the best found are not looked at closer.
    """
    k, m, _ = capsules.start.shape
    wanted = np.ones((m, len(boxes)), dtype=bool) if against is None else np.asarray(against, dtype=bool)
    pairs = np.asarray(pairs, dtype=np.int64).reshape(-1, 2)
    if wanted.shape != (m, len(boxes)) or (pairs.size and not 0 <= int(pairs.min()) <= int(pairs.max()) < m):
        raise InvalidInputError(
            f"{m} capsules and {len(boxes)} boxes: `against` must have shape {(m, len(boxes))} and pairs name capsules "
            f"below {m}; got {wanted.shape} and pairs up to {int(pairs.max(initial=-1))}"
        )
    middle = 0.5 * (capsules.start + capsules.end)
    half = 0.5 * np.sqrt(((capsules.end - capsules.start) ** 2).sum(axis=-1))
    one, other = np.concatenate([pairs, np.argwhere(wanted) + np.array([0, m])]).T
    p, radii = len(pairs), np.append(capsules.radius, np.zeros(len(boxes)))
    reach = radii[one] + radii[other]
    upper = np.empty((k, len(one)))  # free distance of the middles, which the true one does not exceed
    upper[:, :p] = np.sqrt(sum((middle[:, one[:p], i] - middle[:, other[:p], i]) ** 2 for i in range(3)))
    low, high = (np.array([getattr(box, c) for box in boxes]).reshape(-1, 3) for c in ("low", "high"))
    of_box = other[p:] - m
    upper[:, p:] = box_distance(middle[:, one[p:]], low[of_box], high[of_box])
    upper -= reach
    lower = upper - half[:, one]
    lower[:, :p] -= half[:, other[:p]]
    ceiling = np.where(np.isnan(upper), np.inf, upper).min(axis=1, initial=np.inf)
    free = np.full(upper.shape, np.inf)
    pose, pair = np.nonzero(~(lower > ceiling[:, None] + _SLACK))
    for some, is_pair in ((pair < p, True), (pair >= p, False)):
        at, which = pose[some], pair[some]
        a, b = capsules.start[at, one[which]], capsules.end[at, one[which]]
        if is_pair:
            exact = segment_distance(a, b, capsules.start[at, other[which]], capsules.end[at, other[which]])
        else:
            exact = segment_box_distance(a, b, low[other[which] - m], high[other[which] - m])
        free[at, which] = exact - reach[which]
    if not len(one):
        return Clearance(np.full(k, np.inf), np.full(k, -1), np.full(k, -1))
    worst = np.where(np.isnan(free), -np.inf, free).argmin(axis=1)
    return Clearance(free[np.arange(k), worst], one[worst], other[worst])
