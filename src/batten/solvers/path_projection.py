"""Paths of many cubics brought close to elastica, their smooth joints kept smooth and their corners corners."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from batten.errors import InvalidInputError
from batten.measures.curvature_fit import cubic_array
from batten.measures.lambda_class import BEST_BELOW
from batten.measures.lambda_residual import lambda_residual
from batten.solvers.bezier_projection import Keep, Method, project_bezier
from batten.solvers.path_turning import TurningProblem, least_change
from batten.typing import ArrayLike, BoolArray, FloatArray, IntArray

#: What the numbers in `PathProjection.status` mean.
PATH_STATUS = ("kept", "lengths", "turned", "moved", "straight", "point", "fixed", "left", "not finite")
KEPT, LENGTHS, TURNED, MOVED, STRAIGHT, POINT, FIXED, LEFT, NOT_FINITE = range(9)

#: A joint is smooth if its directions differ by less than this, radians.
SMOOTH_WITHIN = math.radians(0.1)
#: A cubic within this share of its length of its chord is a straight line.
STRAIGHT_WITHIN = 1e-5
#: One that is shorter than this share of its shorter neighbour is a point.
_POINT_WITHIN = 1e-4
#: Ends closer than this share of the path's extent are one point.
_JOINED_WITHIN = 1e-9
#: A shorter handle, in lengths of the control polygon, is opened to this length along the curve's tangent.
_LEAST_HANDLE = 0.02
#: How often the neighbours of a cubic that misses the threshold are taken in.
_WIDENINGS = 4


class PathProjection(NamedTuple):
    """What `project_path` returns, one entry for each cubic of the path.

    Attributes:
        control_points: (n, 4, 2).
        residual_before, residual_after: (n,), e_λ within 1e-6; 0 for straight ones, NaN for points.
        status: (n,), index into `PATH_STATUS`: 0 kept as it was; 1 other lengths of its handles, 2 end tangents turned too,
            3 end points moved too; as they were: 4 straight lines, 5 points, 6 fixed ones, 7 those that the method refuses
            (see `project_bezier`), 8 those with NaN or infinity.
        reached: (n,), whether e_λ ≤ threshold; without a threshold, whether the cubic was not left.
        turned: (n, 2), by how much the tangents at its start and its end turned, radians, counter-clockwise.
        moved: (n, 2), how far its start and its end moved.
        smooth: (n,), whether the joint at its end is smooth; False at the end of an open path.
    """

    control_points: FloatArray
    residual_before: FloatArray
    residual_after: FloatArray
    status: IntArray
    reached: BoolArray
    turned: FloatArray
    moved: FloatArray
    smooth: BoolArray


def project_path(
    control_points: ArrayLike,
    method: Method = "nearest",
    *,
    threshold: float | None = None,
    keep: Keep = "tangents",
    closed: bool | None = None,
    fixed: ArrayLike | None = None,
    smooth_within: float = SMOOTH_WITHIN,
) -> PathProjection:
    """Bring every cubic of a path close to an elastica without making corners: Brander2018 §7, Fig. 15.

    With keep="tangents" each cubic goes its own way by `project_bezier`: end points and directions stay, so every joint is
    as smooth as it was. With keep="points" a cubic that lengths alone do not bring to the threshold may turn its end
    tangents: at a smooth joint both sides turn by one angle, at corners and ends each by its own. With keep="nothing" its
    end points may move too, each for all cubics that meet there. The change is the least of Σ turns² + 0.01 Σ log² of the
    factors of the handles' lengths + Σ (movement / a third of the mean polygon length of the cubics there)², about the
    movement of the control points in thirds of a cubic, with e_λ ≤ threshold for these cubics and their neighbours; of the
    neighbours the far ends stay, and are let go only if that is not enough.

    Smooth means G¹: a continuous unit tangent. The ratio of the handles' lengths at a joint may change; an open path is C¹
    over knots whose steps follow these ratios, a closed one up to the joint that closes it.

    Parameters:
        control_points: shape (n, 4, 2), n ≥ 1; each cubic starts where the one before ends.
        method: of `project_bezier`; with keep="points" or "nothing" only "nearest".
        threshold: greatest e_λ wanted, in (0, 1); None is the least that is found for keep="tangents", 0.22 otherwise.
        keep: as above.
        closed: whether the last cubic is followed by the first; None if its end is the path's start.
        fixed: (n,) of booleans, cubics that must stay as they are, such as arcs of circles; None for none.
        smooth_within: greatest angle, radians, between the directions on both sides of a smooth joint. It stays what it is.

    Returns:
        `PathProjection`. A path that meets the threshold comes back bit by bit.

    Raises:
        InvalidInputError: an array of another shape, a gap between two cubics, an option that `project_bezier` refuses.

    Accuracy: angles at smooth joints to 1e-9, end points that stay bit by bit. The least change is a local one from two or
    three starts, and 0.1 % below the threshold is aimed at; nothing is proven. Without "reached" the best that was found is
    returned.

    Degenerate cases: straight lines (within 1e-5 of their length) and points (less than 1e-4 of their shorter neighbour)
    stay as they are, with their ends and the tangents of smooth neighbours; the directions across a point are compared
    with each other. A handle of length zero is opened along the curve's tangent. A path of one cubic is a path.

    Example:
        >>> wave = [[(0, 0), (0, 9), (3, 9), (3, 0)], [(3, 0), (3, -2), (6, -2), (6, 0)]]
        >>> found = project_path(wave, threshold=0.2)
        >>> [PATH_STATUS[s] for s in found.status], bool((found.residual_after <= 0.2).all())
        (['lengths', 'kept'], True)
    """
    points = _path_array(control_points)
    if keep != "tangents" and (keep not in ("points", "nothing") or method != "nearest"):
        raise InvalidInputError(
            f'keep is tangents, or points or nothing with method="nearest"; got keep={keep!r} with method={method!r}'
        )
    if threshold is None and keep != "tangents":
        threshold = BEST_BELOW
    if threshold is not None and not 0.0 < threshold < 1.0:
        raise InvalidInputError(f"the threshold of a path lies in (0, 1); got {threshold!r}; try {BEST_BELOW}")
    frozen = np.zeros(len(points), bool) if fixed is None else np.asarray(fixed, dtype=bool)
    if frozen.shape != (len(points),):
        raise InvalidInputError(f"fixed has one entry for each of the {len(points)} cubics; got shape {frozen.shape}")
    path = _sorted(points, frozen, closed, smooth_within)
    before = np.where(path.status == STRAIGHT, 0.0, lambda_residual(points))
    wanted = path.status == KEPT
    if threshold is not None:
        wanted &= ~(before <= threshold)
    found = points.copy()
    status = path.status.copy()
    options = {} if threshold is None else {"threshold": 0.9999 * threshold}
    single = project_bezier(path.opened[wanted], method, **options)  # type: ignore[arg-type]  # no threshold for "zone"
    good = np.isfinite(single.control_points).all(axis=(1, 2))
    changed = (single.control_points != points[wanted]).any(axis=(1, 2)) & good
    places = np.flatnonzero(wanted)
    found[places[changed]] = single.control_points[changed]
    status[places[changed]] = LENGTHS
    status[places[~changed & ~(single.residual_before <= 1.0)]] = LEFT
    status[places[~good]] = LEFT
    after = np.where(status == STRAIGHT, 0.0, lambda_residual(found))
    if keep != "tangents" and threshold is not None:
        found = _change_together(path, found, after, threshold, keep)
        after = np.where(status == STRAIGHT, 0.0, lambda_residual(found))
    turned, moved = _turns(path.opened, found, path.status), np.linalg.norm((found - points)[:, [0, 3]], axis=-1)
    status[(path.status == KEPT) & (np.abs(turned) > 1e-12).any(axis=1)] = TURNED
    status[(path.status == KEPT) & (moved > 0.0).any(axis=1)] = MOVED
    if threshold is None:
        reached = np.isfinite(after) & (status != LEFT) | (status == POINT) | (status == FIXED)
    else:
        reached = (after <= threshold) | (status == POINT) | (status == FIXED)
    return PathProjection(found, before, after, status, reached, turned, moved, path.smooth)


@dataclass(frozen=True)
class _Path:
    """A path whose cubics are sorted: `status` is KEPT for those that may change; `following` skips points, −1 at an end."""

    drawn: FloatArray
    opened: FloatArray
    status: IntArray
    following: IntArray
    smooth: BoolArray
    lengths: FloatArray


def _path_array(control_points: ArrayLike) -> FloatArray:
    points = cubic_array(control_points)
    if points.ndim != 3 or len(points) == 0:
        raise InvalidInputError(f"a path has control points of shape (n, 4, 2), n ≥ 1; got {points.shape}")
    finite = np.isfinite(points).all(axis=(1, 2))
    if finite.any():
        extent = float(np.ptp(points[finite].reshape(-1, 2), axis=0).max())
        gaps = np.linalg.norm(points[1:, 0] - points[:-1, 3], axis=1)
        wide = np.flatnonzero(gaps > _JOINED_WITHIN * extent)
        if len(wide):
            i = int(wide[0])
            raise InvalidInputError(
                f"a path is connected, but cubic {i + 2} starts {gaps[i]:g} from the end of cubic {i + 1}; give its parts "
                "one by one"
            )
    return points


def _sorted(points: FloatArray, frozen: BoolArray, closed: bool | None, smooth_within: float) -> _Path:
    n = len(points)
    finite = np.isfinite(points).all(axis=(1, 2))
    with np.errstate(invalid="ignore"):
        lengths = np.linalg.norm(np.diff(points, axis=1), axis=-1).sum(axis=1)
        if closed is None:
            extent = np.ptp(points.reshape(-1, 2), axis=0).max()
            closed = bool(np.linalg.norm(points[-1, 3] - points[0, 0]) <= _JOINED_WITHIN * extent)
        before, after = np.roll(lengths, 1), np.roll(lengths, -1)
        if not closed:
            before[0] = after[-1] = math.inf
        tiny = lengths <= _POINT_WITHIN * np.minimum(before, after) if n > 1 else lengths == 0.0
        tiny &= np.isfinite(lengths) & (np.isfinite(before) | np.isfinite(after)) | (lengths == 0.0)
    status = np.where(frozen, FIXED, np.where(_is_straight(points, lengths), STRAIGHT, KEPT))
    status[tiny | (lengths == 0.0)] = POINT
    status[~finite] = NOT_FINITE
    real = np.flatnonzero((status != POINT) & (status != NOT_FINITE))
    following = np.full(n, -1)
    following[real[:-1]] = real[1:]
    if closed and len(real):
        following[real[-1]] = real[0]
    for i in np.flatnonzero(~finite):  # nothing goes on across a gap
        following[real[(real < i)][-1:]] = -1
        if closed and len(real) and not (real < i).any():
            following[real[-1]] = -1
    opened = _opened(points, lengths, status)
    directions = _handle_directions(opened)
    smooth = np.zeros(n, bool)
    has = following >= 0
    bend = np.angle(-directions[has, 1].conj() * directions[following[has], 0])
    smooth[has] = np.abs(bend) <= smooth_within
    return _Path(points, opened, status, following, smooth, lengths)


def _is_straight(points: FloatArray, lengths: FloatArray) -> BoolArray:
    """Within 1e-5 of its length of the chord, and running forwards all the way."""
    z = points @ np.array([1.0, 1.0j])
    chord = z[:, 3] - z[:, 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        along = (z - z[:, :1]) * (chord.conj() / np.abs(chord))[:, None]
        flat = (np.abs(along.imag) <= STRAIGHT_WITHIN * lengths[:, None]).all(axis=1)
        return flat & (np.diff(along.real, axis=1) >= -STRAIGHT_WITHIN * lengths[:, None]).all(axis=1)


def _opened(points: FloatArray, lengths: FloatArray, status: IntArray) -> FloatArray:
    """The cubics with handles that are shorter than 2 % of the polygon brought to that, along the curve's tangent."""
    result = points.copy()
    for i in np.flatnonzero((status == KEPT) | (status == FIXED) | (status == STRAIGHT)):
        least = _LEAST_HANDLE * lengths[i]
        for order in ((0, 1, 2, 3), (3, 2, 1, 0)):
            row = points[i, order]
            if np.linalg.norm(row[1] - row[0]) < least:
                away = row[1:] - row[0]
                sizes = np.linalg.norm(away, axis=1)
                k = int(np.argmax(sizes > 1e-9 * lengths[i]))
                result[i, order[1]] = row[0] + away[k] * (least / sizes[k])
    return result


def _handle_directions(points: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.complex128]]:
    handles = (points[:, [1, 2]] - points[:, [0, 3]]) @ np.array([1.0, 1.0j])
    with np.errstate(invalid="ignore", divide="ignore"):
        return handles / np.abs(handles)


def _turns(before: FloatArray, after: FloatArray, status: IntArray) -> FloatArray:
    turned = np.angle(_handle_directions(after) * _handle_directions(before).conj())
    return np.where((status == KEPT)[:, None], np.nan_to_num(turned), 0.0)


def _change_together(path: _Path, found: FloatArray, after: FloatArray, threshold: float, keep: Keep) -> FloatArray:
    """Cubics above the threshold, and around them as many neighbours as needed, by `least_change`."""
    free = path.status == KEPT
    core = free & ~(after <= threshold)
    links = _links(path, keep)
    best: dict[bytes, tuple[FloatArray, bool]] = {}
    result = found
    for _ in range(_WIDENINGS + 1):
        if not core.any():
            break
        window = core.copy()
        for i, j in links:
            if core[i] or core[j]:
                window[i] = window[j] = True
        result = found.copy()
        wider = core.copy()
        for members in _components(window, links):
            key = members.tobytes() + core[members].tobytes()
            if key not in best:
                problem, starts = _problem(path, members, core, found, threshold, keep)
                if keep == "nothing":  # what turning alone would give is one of the starts: never more change than that
                    held = replace(problem, points=np.full_like(problem.points, -1), scales=np.empty(0))
                    starts = [*starts[:2], least_change(held, starts)[0]]
                best[key] = least_change(problem, starts)
            points, met = best[key]
            result[members] = points
            if not met:
                wider[members] = True
        if (wider == core).all():
            break
        core = wider
    return result


def _links(path: _Path, keep: Keep) -> list[tuple[int, int]]:
    """Pairs of cubics with a common unknown at the end of the first."""
    free = path.status == KEPT
    return [
        (i, j)
        for i, j in enumerate(path.following.tolist())
        if j >= 0 and free[i] and free[j] and (path.smooth[i] or (keep == "nothing" and _touch(path, i, j)))
    ]


def _touch(path: _Path, i: int, j: int) -> bool:
    """Whether nothing, not even a point, lies between a cubic and the one that follows."""
    return j == (i + 1) % len(path.status)


def _components(window: BoolArray, links: list[tuple[int, int]]) -> list[IntArray]:
    label = np.arange(len(window))
    for _ in range(len(window)):
        last = label.copy()
        for i, j in links:
            if window[i] and window[j]:
                label[i] = label[j] = min(label[i], label[j])
        if (label == last).all():
            break
    return [np.flatnonzero(window & (label == k)) for k in np.unique(label[window])]


def _problem(
    path: _Path, members: IntArray, core: BoolArray, found: FloatArray, threshold: float, keep: Keep
) -> tuple[TurningProblem, list[FloatArray]]:
    """The unknowns at the ends of the core cubics among `members`, and control points to start from."""
    place = {int(m): k for k, m in enumerate(members)}
    turns, points = np.full((len(members), 2), -1), np.full((len(members), 2), -1)
    scales: list[float] = []
    count = 0
    preceding = {int(j): i for i, j in enumerate(path.following.tolist()) if j >= 0}
    for k, i in enumerate(members.tolist()):
        for side in (0, 1):
            other = int(path.following[i]) if side else preceding.get(i, -1)
            first, second = (i, other) if side else (other, i)
            joined = other >= 0
            smooth = joined and bool(path.smooth[first])
            beside = place.get(other, -1) if joined else -1
            still = joined and path.status[other] != KEPT
            if core[i] or (beside >= 0 and core[other] and (smooth or keep == "nothing")):
                may_turn = core[i] if not smooth else not still and (core[i] or core[other])
                if may_turn and turns[k, side] < 0:
                    turns[k, side] = count
                    if smooth and beside >= 0:
                        turns[beside, 1 - side] = count
                    count += 1
                stuck = still or (joined and (beside < 0 or not _touch(path, first, second)))
                if keep == "nothing" and not stuck and points[k, side] < 0:
                    points[k, side] = len(scales)
                    both = [i] if not joined else [i, other]
                    if joined:
                        points[beside, 1 - side] = len(scales)
                    scales.append(float(path.lengths[both].mean()) / 3.0)
    drawn, start = path.opened[members], found[members]
    start = np.where(_has_handles(start)[:, None, None], start, drawn)
    problem = TurningProblem(drawn, turns, points, np.array(scales), 0.999 * threshold)
    alone = project_bezier(drawn, "nearest", threshold=0.999 * threshold, keep=keep).control_points
    alone = np.where((_has_handles(alone) & core[members])[:, None, None], alone, start)
    return problem, [start, alone, _rounded(drawn, turns)]


def _has_handles(points: FloatArray) -> BoolArray:
    return np.asarray(np.isfinite(_handle_directions(points)).all(axis=1))


def _rounded(drawn: FloatArray, turns: IntArray) -> FloatArray:
    """Handles that turn set symmetric to their chord, nearest to where they are, with the lengths of an arc of a circle."""
    z = drawn @ np.array([1.0, 1.0j])
    chord = z[:, 3] - z[:, 0]
    length = np.where(chord == 0.0, 1.0, np.abs(chord))
    direction = np.where(chord == 0.0, 1.0, chord / length)
    angles = np.angle(_handle_directions(drawn) * np.stack([direction, -direction], axis=1).conj())
    half = np.clip(0.5 * (angles[:, 0] - angles[:, 1]), -0.5 * np.pi, 0.5 * np.pi)
    half = np.where(np.abs(half) < 0.3, np.where(half < 0.0, -0.3, 0.3), half)
    new = np.where(turns >= 0, np.stack([half, -half], axis=1), angles)
    handles = (0.4 * length / np.cos(0.25 * half) ** 2)[:, None] * np.exp(1j * new)
    handles = handles * np.stack([direction, -direction], axis=1)
    result = drawn.copy()
    result[:, [1, 2]] = drawn[:, [0, 3]] + np.stack([handles.real, handles.imag], axis=-1)
    return result
