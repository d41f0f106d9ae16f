"""The rod followed along a robot program: between two targets as well as at them it is the elastica of its length.

Both arms make every move together: the tool centre points go along straight lines, evenly, and the tools turn about one
axis by the shortest way (ABB's MoveL under MultiMove). At many stations the two tool poses hold the rod's ends; from
station to station its shape is followed (`kernels.boundary_track`), so that it is the shape that a real rod has there, and
a snap on the way is found.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from batten.curves.elastica import Elastica, points_batch
from batten.errors import BattenError, InvalidInputError, LimitError
from batten.kernels.boundary_track import follow_batch
from batten.solvers.boundary_value import solve_boundary
from batten.solvers.stability import margins
from batten.solvers.track import RodTracker, standard_numbers
from batten.typing import ArrayLike, BoolArray, FloatArray, IntArray

STEP_MM = 5.0
"""Stations lie at most so far apart, by the way of the farther end."""
LEAST_STATIONS = 4
"""Stations of every move, however short."""

_MOST_STEPS = 300
_VERTICAL = 1e-3  # rad; ends that point less far from the chord than that do not turn the rod's plane about it

Misfit = Callable[[int, FloatArray], float]
"""Called as misfit(index of the path, points of a rod (k, 3) in the work frame): less is better."""


@dataclass(frozen=True, eq=False)
class BlockPath:
    """What both arms do in one block, n ≥ 2 targets, in the block's work frame.

    Attributes:
        block: number of the block.
        left, right: (n, 4, 4), tool poses: origin in the rod's end, z along the rod, out of the gripper into it.
        labels: n words for people, for example "leaf 12".
        is_leaf: (n,), whether the target is a leaf (and not on the way in or out).
        seconds: (n − 1,), how long each move takes, above 0.

    Raises:
        InvalidInputError: other shapes, numbers that are not finite, times that are not above 0.
    """

    block: int
    left: FloatArray
    right: FloatArray
    labels: tuple[str, ...]
    is_leaf: BoolArray
    seconds: FloatArray

    def __post_init__(self) -> None:
        n = len(self.labels)
        shapes = self.left.shape, self.right.shape, self.is_leaf.shape, self.seconds.shape
        if n < 2 or shapes != ((n, 4, 4), (n, 4, 4), (n,), (n - 1,)):
            raise InvalidInputError(
                f"block {self.block}: {n} labels with poses, flags and times of shapes {shapes}; give n ≥ 2 targets with "
                "(n, 4, 4), (n, 4, 4), (n,) and (n − 1,)"
            )
        if not (np.isfinite(self.left).all() and np.isfinite(self.right).all() and (self.seconds > 0.0).all()):
            raise InvalidInputError(f"block {self.block}: poses must be finite and times above 0")

    def way(self, move: int) -> str:
        """Words for a move, for example "between leaf 11 and leaf 12"."""
        return f"between {self.labels[move]} and {self.labels[move + 1]}"


@dataclass(frozen=True, eq=False)
class RodSweep:
    """The rod at m stations of a path.

    Attributes:
        path: the path.
        move, share: (m,), the move that a station belongs to and how much of it is done; targets are stations.
        seconds: (m,), since the first target.
        at_leaf: (m,), whether the station is the target of a leaf.
        origin, frame: (m, 3), (m, 3, 3): the rod's planes in the work frame; rows of a frame: x along the chord, y, normal.
        parameters: (m, 7), the rod in its plane (see `Elastica.parameters`).
        margin: (m,), its stability margin.
        out_of_plane_rad: (m,), greatest angle between an end's tangent and the plane.
        out_of_plane_mm: (m,), how far a rod that is nearly straight would leave the plane for these angles.
        twist_rad: (m,), by how much the right gripper has turned against the left about the rod, since the first target.
        choices: how many stable shapes the rod could have had at the first target.
    """

    path: BlockPath
    move: IntArray
    share: FloatArray
    seconds: FloatArray
    at_leaf: BoolArray
    origin: FloatArray
    frame: FloatArray
    parameters: FloatArray
    margin: FloatArray
    out_of_plane_rad: FloatArray
    out_of_plane_mm: FloatArray
    twist_rad: FloatArray
    choices: int

    def points(self, fractions: ArrayLike) -> FloatArray:
        """Points in the work frame at fractions (k,) of the rod's length, (m, k, 3)."""
        return _in_space(self.origin, self.frame, points_batch(self.parameters, fractions))


class HeldEnds(NamedTuple):
    """Two held ends in the plane that suits them best (see `held_ends`)."""

    origin: FloatArray
    frame: FloatArray
    pose: FloatArray
    out_of_plane_rad: FloatArray
    out_of_plane_mm: FloatArray
    twist_rad: FloatArray


def sweep_rods(
    paths: Sequence[BlockPath], length_mm: float, *, misfit: Misfit | None = None, step_mm: float = STEP_MM
) -> tuple[RodSweep, ...]:
    """Follow one rod along each path.

    At the first target the rod has a stable shape; where there are several, the one of least misfit once it is shifted to
    the first leaf (a person fixes it the right way round), without `misfit` that of least energy.

    Parameters:
        paths: one for each block.
        length_mm: length of the rod between its ends, above 0.
        misfit: see above.
        step_mm: greatest way of an end from station to station, above 0; at least `LEAST_STATIONS` to a move.

    Returns:
        The rod at all stations, for each path.

    Raises:
        InvalidInputError: a length or a step that is not above 0.
        LimitError: the rod has no stable shape at the first target, is pulled taut, or snaps on the way; the message names
            the block and the leaves.

    Accuracy: the ends are met to 1e-12 of the length. Planes: the rod is taken as planar; what is left out is told by
    `out_of_plane_rad` and `out_of_plane_mm`. Corners at the targets (RAPID's zones) are not rounded.

    Example:
        >>> left, right = np.tile(np.eye(4), (2, 2, 1, 1))
        >>> left[:, :3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]  # z along the rod
        >>> right[:, :3, :3] = [[0, 0, -1], [1, 0, 0], [0, -1, 0]]
        >>> left[:, 0, 3], right[:, 0, 3], left[1, 1, 3], right[1, 1, 3] = -400.0, 400.0, 20.0, 20.0
        >>> path = BlockPath(1, left, right, ("leaf 1", "leaf 2"), np.array([True, True]), np.array([1.0]))
        >>> sweep, = sweep_rods([path], 1000.0)
        >>> sweep.points([0.0, 1.0])[2].round(9).tolist(), sweep.choices
        ([[-400.0, 10.0, 0.0], [400.0, 10.0, 0.0]], 2)
    """
    if not (np.isfinite(length_mm) and length_mm > 0.0 and step_mm > 0.0):
        raise InvalidInputError(f"length_mm = {length_mm}, step_mm = {step_mm}; allowed are finite numbers above 0")
    if not paths:
        return ()
    stations = [_stations(path, step_mm) for path in paths]
    held = [held_ends(*interpolated_poses(path, *at)) for path, at in zip(paths, stations)]
    counts = np.array([len(h.pose) for h in held])
    shapes = np.zeros((len(paths), counts.max(), 4))
    choices = []
    for i, (path, ends) in enumerate(zip(paths, held)):
        shapes[i, 0], count = _first_shape(i, path, ends, length_mm, misfit)
        choices.append(count)
    poses = np.zeros((len(paths), counts.max(), 6))
    for i, ends in enumerate(held):
        poses[i, : counts[i]] = ends.pose
    _follow(paths, stations, counts, poses, shapes, length_mm)
    sweeps = []
    for i, (path, (move, share), ends) in enumerate(zip(paths, stations, held)):
        parameters = placed_shapes(shapes[i, : counts[i]], ends.pose, length_mm)
        start = np.concatenate([[0.0], np.cumsum(path.seconds)])
        target = np.rint(move + share).astype(np.int64)
        sweeps.append(
            RodSweep(
                path=path,
                move=move,
                share=share,
                seconds=start[move] + share * path.seconds[move],
                at_leaf=path.is_leaf[target] & (np.abs(move + share - target) < 1e-12),
                origin=ends.origin,
                frame=ends.frame,
                parameters=parameters,
                margin=np.asarray(margins(parameters)),
                out_of_plane_rad=ends.out_of_plane_rad,
                out_of_plane_mm=ends.out_of_plane_mm,
                twist_rad=ends.twist_rad,
                choices=choices[i],
            )
        )
    return tuple(sweeps)


def held_ends(left: FloatArray, right: FloatArray) -> HeldEnds:
    """The planes in which rods lie best, and their ends there.

    A plane holds the chord; about it, it is turned so that the squares of the tangents' parts across it are least, and 1e-3
    rad count as much as the vertical plane through the chord.

    Parameters:
        left, right: (m, 4, 4), tool poses that follow one another closely.

    Returns:
        origin (m, 3), frame (m, 3, 3), pose (m, 6): start x, y, angle, end x, y, angle in the plane, without jumps of 2π,
        and the three numbers of `RodSweep`.
    """
    start, end = left[:, :3, 3], right[:, :3, 3]
    tangents = np.stack([left[:, :3, 2], -right[:, :3, 2]])
    chord = np.linalg.norm(end - start, axis=1)
    along = (end - start) / np.maximum(chord, 1e-300)[:, None]
    steep = np.abs(along[:, 2]) > 1.0 - 1e-9
    up = np.where(steep[:, None], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    up = up - (up * along).sum(axis=1, keepdims=True) * along
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    side = np.cross(along, up)
    a, b = (tangents * up).sum(axis=2), (tangents * side).sum(axis=2)
    squares = (a**2).sum(axis=0) + _VERTICAL**2 - (b**2).sum(axis=0)
    tilt = 0.5 * np.arctan2(2.0 * (a * b).sum(axis=0), squares)[:, None]
    y_axis = np.cos(tilt) * up + np.sin(tilt) * side
    normal = np.cross(along, y_axis)
    across = np.arcsin(np.clip((tangents * normal).sum(axis=2), -1.0, 1.0))
    angles = np.arctan2((tangents * y_axis).sum(axis=2), (tangents * along).sum(axis=2))
    zero = np.zeros_like(chord)
    start_angle, end_angle = np.unwrap(angles, axis=1)
    pose = np.stack([zero, zero, start_angle, chord, zero, end_angle], axis=1)
    t = np.linspace(0.0, 1.0, 33)[:, None]  # the cubic of small deflections
    lift = t * (1.0 - t) ** 2 * np.tan(across[0]) - t**2 * (1.0 - t) * np.tan(across[1])
    turns = []
    for x_axis, tangent in zip((left[:, :3, 0], right[:, :3, 0]), tangents):
        level = normal - (normal * tangent).sum(axis=1, keepdims=True) * tangent
        turns.append(np.arctan2((x_axis * np.cross(tangent, level)).sum(axis=1), (x_axis * level).sum(axis=1)))
    twist = np.unwrap(turns[1] - turns[0])
    return HeldEnds(
        start,
        np.stack([along, y_axis, normal], axis=1),
        pose,
        np.abs(across).max(axis=0),
        chord * np.abs(lift).max(axis=0),
        twist - twist[0],
    )


def placed_shapes(shapes: FloatArray, poses: FloatArray, length: float) -> FloatArray:
    """The inverse of `solvers.track.standard_numbers`: elastica (m, 7) from shapes (m, 4), started at poses (m, 6)."""
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    along, across = shapes[:, 2] / length**2, shapes[:, 3] / length**2
    columns = [shapes[:, 1] / length, cos * along - sin * across, sin * along + cos * across]
    return np.column_stack([poses[:, :3], *columns, np.full(len(poses), length)])


def _in_space(origin: FloatArray, frame: FloatArray, points: FloatArray) -> FloatArray:
    return origin[:, None] + points[..., :1] * frame[:, None, 0] + points[..., 1:] * frame[:, None, 1]


def _stations(path: BlockPath, step_mm: float) -> tuple[IntArray, FloatArray]:
    """Move and share of every station, both (m,); the targets are among them, each once."""
    ways = [np.linalg.norm(np.diff(p[:, :3, 3], axis=0), axis=1) for p in (path.left, path.right)]
    parts = np.maximum(LEAST_STATIONS, np.ceil(np.maximum(*ways) / step_mm)).astype(np.int64)
    move = np.repeat(np.arange(len(parts)), parts)
    share = np.concatenate([np.arange(n) / n for n in parts])
    return np.append(move, len(parts) - 1), np.append(share, 1.0)


def interpolated_poses(path: BlockPath, move: IntArray, share: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Tool poses of both arms on their way, as MoveL takes them: positions evenly, orientations about one axis.

    Parameters:
        path: the targets.
        move, share: (m,), between which targets and how much of the move is done.

    Returns:
        Poses of the left and of the right arm, both (m, 4, 4).
    """
    both = []
    for targets in (path.left, path.right):
        poses = targets[move].copy()
        poses[:, :3, 3] += share[:, None] * (targets[move + 1, :3, 3] - targets[move, :3, 3])
        turns = Rotation.from_matrix(targets[:, :3, :3])
        by = (turns[:-1].inv() * turns[1:]).as_rotvec()
        poses[:, :3, :3] = (turns[move] * Rotation.from_rotvec(share[:, None] * by[move])).as_matrix()
        both.append(poses)
    return both[0], both[1]


def _first_shape(
    index: int, path: BlockPath, ends: HeldEnds, length_mm: float, misfit: Misfit | None
) -> tuple[FloatArray, int]:
    """The rod's shape (4,) at the first target, and among how many stable ones it was chosen."""
    pose = ends.pose[0]
    try:
        found = solve_boundary(pose[:2], pose[2], pose[3:5], pose[5], length_mm)
    except BattenError as error:
        raise LimitError(f"block {path.block}: the rod cannot be fixed at {path.labels[0]}: {error}") from error
    shapes = [s.elastica for s in found if s.stable]
    if not shapes:
        raise LimitError(
            f"block {path.block}: a rod of {length_mm:g} mm has no stable shape at {path.labels[0]}; the program was made "
            "for another rod, or its targets are damaged"
        )
    best = 0
    if misfit is not None and len(shapes) > 1:
        first = int(np.argmax(path.is_leaf)) if path.is_leaf.any() else 0
        shift = 0.5 * sum(p[first, :3, 3] - p[0, :3, 3] for p in (path.left, path.right))
        flat = points_batch(np.array([e.parameters for e in shapes]), np.linspace(0.2, 0.8, 13))
        lie = _in_space(np.repeat(ends.origin[:1], len(shapes), 0), np.repeat(ends.frame[:1], len(shapes), 0), flat)
        best = int(np.argmin([misfit(index, points + shift) for points in lie]))
    return standard_numbers(shapes[best].parameters), len(shapes)


def _follow(
    paths: Sequence[BlockPath],
    stations: list[tuple[IntArray, FloatArray]],
    counts: IntArray,
    poses: FloatArray,
    shapes: FloatArray,
    length_mm: float,
) -> None:
    """All rods from station to station: into shapes (paths, stations, 4), of which the first station's are given."""
    for k in range(1, int(counts.max())):
        rows = np.flatnonzero(counts > k)
        n = len(rows)
        share, arrived, spent = np.empty(n), np.empty((n, 4)), np.empty((n, 2), dtype=np.int64)
        before, here = np.ascontiguousarray(poses[rows, k - 1]), np.ascontiguousarray(poses[rows, k])
        start = np.ascontiguousarray(shapes[rows, k - 1])
        follow_batch(start, before, here, np.full(n, length_mm), _MOST_STEPS, share, arrived, spent)
        for i in np.flatnonzero(~(share >= 1.0)):
            move = int(stations[rows[i]][0][k - 1])
            arrived[i] = _led(paths[rows[i]], move, start[i], before[i], here[i], length_mm)
        shapes[rows, k] = arrived


def _led(
    path: BlockPath, move: int, shape: FloatArray, before: FloatArray, here: FloatArray, length_mm: float
) -> FloatArray:
    """The shape after a step that small steps do not make: the rod is very stiff there, or it snaps."""
    curve = Elastica.from_parameters(placed_shapes(shape[None], before[None], length_mm)[0])
    tracker = RodTracker(length_mm, solution=curve)
    try:
        tracker.move(before)
        state = tracker.move(here)
    except BattenError as error:
        raise LimitError(f"block {path.block}, {path.way(move)}: the rod cannot be held: {error}") from error
    if state.snap is not None:
        raise LimitError(
            f"block {path.block}, {path.way(move)}: the rod snaps to another shape on the way; put a leaf between them, or "
            "turn the planes (leaves.turn_deg)"
        )
    return standard_numbers(state.elastica.parameters)
