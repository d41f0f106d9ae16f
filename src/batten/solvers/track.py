"""A held rod followed while its ends move: what shape it has, and where it must snap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from batten.curves.elastica import Elastica, states_at
from batten.errors import ConvergenceError, InvalidInputError, NoSolutionError
from batten.kernels import boundary_track as kernel
from batten.kernels.boundary_polish import ANGLES, LENGTH, PROBLEM, polish
from batten.solvers.boundary_value import BoundarySolution, solve_boundary
from batten.solvers.discrete_rod import DiscreteRod, DiscreteRodResult
from batten.solvers.stability import margins
from batten.typing import ArrayLike, FloatArray, IntArray

_EDGES = 120  # of the polyline that falls to the shape after a snap
_MOST_FALL = 400  # steps of that fall
_BEYOND = 1e-5  # of the way: how far past a fold the fall begins
_MOST_STEPS = 300  # from one pose to the next
_FAR_FROM_FOLD = 1.01  # margin at which a rod that cannot be followed is too stiff, not about to snap
_MOST_PARTS = 50  # snaps and leaps on one way
_LEAPS = (0.05, 0.01, 0.002, 0.0004)  # of the way, where the rod is too stiff to be followed
_STIFF_TURN = 0.2  # how far its tangents may then turn at once, beyond what the ends do
_TAUT = 1.0 - 1e-6  # of the length: ends farther apart than that are not followed


@dataclass(frozen=True, eq=False)
class Snap:
    """A rod that lost its hold: where, from which shape, to which.

    Attributes:
        fraction: how far between the last pose and this one, 0 to 1.
        pose: (6,), start x, y, angle, end x, y, angle there.
        before, after: the shape at the fold, and the one that an overdamped rod falls to from it.
        energy_released: the difference of their ∫κ² ds, 1/length; times EI/2 it is work.
    """

    fraction: float
    pose: FloatArray
    before: Elastica
    after: Elastica
    energy_released: float


@dataclass(frozen=True, eq=False)
class TrackedPose:
    """The rod at one pose of its ends.

    Attributes:
        elastica: its shape.
        energy: ∫κ² ds. margin, stable: see `BoundarySolution`.
        snap: what happened on the way from the pose before, None if the rod held; the last snap if there were several.
        steps: steps of the predictor and corrector on the way.
        evaluations: of the end point with its derivatives.
    """

    elastica: Elastica
    energy: float
    margin: float
    stable: bool
    snap: Snap | None
    steps: int
    evaluations: int


class RodTracker:
    """A rod of given length whose ends are moved from pose to pose.

    Between two poses all six numbers go linearly. The rod is followed by Newton steps whose size is controlled (the
    change of curvature and force, the contraction of the second step, the sign of stability). Where it would become
    unstable no step leads on: a fold or a bifurcation, found by halving to 1e-9 of the way. From there it falls, overdamped
    (`DiscreteRod.relax`), to a stable shape at the same pose, and is followed on.

    Parameters:
        length: of the rod, any unit, above 0.
        max_inflections: for the first pose, see `solve_boundary`.
        solution: the shape at the first pose, an elastica between its ends (stable or not). By default the stable
            solution of least energy.

    Example:
        >>> rod = RodTracker(1.0)
        >>> first = rod.move((0, 0, 0, 0.8, 0, 0))
        >>> held = rod.move((0, 0, 0.1, 0.7, 0, -0.1))
        >>> held.snap is None, held.stable, held.evaluations < 40
        (True, True, True)
    """

    def __init__(self, length: float, *, max_inflections: int = 2, solution: Elastica | None = None) -> None:
        if not (np.isfinite(length) and length > 0.0):
            raise InvalidInputError(f"a rod's length is a finite number above 0; got {length!r}")
        self.length = float(length)
        self.max_inflections = max_inflections
        self._pose: FloatArray | None = None
        self._z = np.zeros(4) if solution is None else standard_numbers(solution.parameters)
        self._given = solution is not None

    def move(self, pose: ArrayLike) -> TrackedPose:
        """Move the ends to a pose and say what the rod does.

        Parameters:
            pose: (6,), start x, y, angle, end x, y, angle; the angles are real, a turn of an end is followed.

        Returns:
            The rod's state there.

        Raises:
            InvalidInputError: a pose that is not six finite numbers.
            NoSolutionError: the ends are farther apart than the rod is long, there or on the way; or, at the first pose,
                no stable shape. The tracker stays at the pose before.
            ConvergenceError: the shape after a snap was not found.
        """
        p = np.array(pose, dtype=np.float64)
        if p.shape != (6,) or not np.isfinite(p).all():
            raise InvalidInputError(f"a pose is start x, y, angle, end x, y, angle, six finite numbers; got {pose!r}")
        self._check_reach(p, p)
        if self._pose is None:
            return self._begin(p)
        self._check_reach(self._pose, p)
        z, share = self._z.copy(), 0.0
        spent = np.zeros(2, dtype=np.int64)
        snap: Snap | None = None
        for _ in range(_MOST_PARTS):
            stable = float(margins(self._elastica(z, self._pose, p, share).parameters)) > 1.0
            share = float(kernel.follow(z, self._pose, p, share, self.length, stable, _MOST_STEPS, spent))
            if share >= 1.0:
                break
            here = self._elastica(z, self._pose, p, share)
            if stable and float(margins(here.parameters)) > _FAR_FROM_FOLD:
                leap = self._leap(here, self._pose, p, share)
                if leap is not None:
                    z, share = leap
                    continue
            snap = self._fall(here, self._pose, p, share)
            z = standard_numbers(snap.after.parameters)
            share = min(share + _BEYOND, 1.0)
        else:
            raise ConvergenceError(
                f"the rod snapped or stiffened {_MOST_PARTS} times on one way to {p.tolist()}; move in smaller steps",
                best=snap,
            )
        before, self._pose, self._z = self._pose, p, z
        return self._state(self._elastica(z, before, p, 1.0), snap, spent)

    def _begin(self, pose: FloatArray) -> TrackedPose:
        if self._given:
            reached = end_poses(self._elastica(self._z, pose, pose, 0.0).parameters)
            miss, turn = float(np.hypot(*(reached - pose)[3:5])) / self.length, float(reached[5] - pose[5])
            if max(miss, abs(turn)) > 1e-6:
                raise InvalidInputError(
                    f"the solution given ends {miss:.3g} lengths and {turn:.3g} rad away from the first pose's end; give an "
                    "elastica between the ends of the first pose, with the same winding"
                )
        else:
            chosen = next((s for s in self._all(pose) if s.stable), None)
            if chosen is None:
                raise NoSolutionError(
                    f"no stable shape with at most {self.max_inflections} inflections between the ends of {pose.tolist()}; "
                    "move the ends, or allow more inflections"
                )
            self._z = standard_numbers(chosen.elastica.parameters)
        self._pose = pose
        return self._state(self._elastica(self._z, pose, pose, 0.0), None, np.zeros(2, dtype=np.int64))

    def _all(self, pose: FloatArray) -> list[BoundarySolution]:
        return solve_boundary(pose[:2], pose[2], pose[3:5], pose[5], self.length, max_inflections=self.max_inflections)

    def _state(self, elastica: Elastica, snap: Snap | None, spent: IntArray) -> TrackedPose:
        margin = float(margins(elastica.parameters))
        return TrackedPose(
            elastica, elastica.bending_energy(), margin, margin > 1.0, snap, int(spent[1]), int(spent[0])
        )

    def _elastica(self, z: FloatArray, first: FloatArray, last: FloatArray, share: float) -> Elastica:
        """The curve of `z` with its start where the pose at a share of the way has it."""
        return placed(z, first + share * (last - first), self.length)

    def _fall(self, before: Elastica, first: FloatArray, last: FloatArray, share: float) -> Snap:
        """The snap at a share of the way, from the shape `before`."""
        beyond = first + min(share + _BEYOND, 1.0) * (last - first)
        after = fallen(before, beyond)
        released = before.bending_energy() - after.bending_energy()
        return Snap(share, first + share * (last - first), before, after, released)

    def _leap(
        self, here: Elastica, first: FloatArray, last: FloatArray, share: float
    ) -> tuple[FloatArray, float] | None:
        """A little farther on the way where the rod is so stiff that small steps fail too: the nearest stable shape there.

        Returns the shape's numbers and the share of the way; None if no shape is near: then there is a fold after all.
        """
        fractions = np.linspace(0.0, 1.0, 65) * self.length
        shape = here.angle_at(fractions)
        for ahead in _LEAPS:
            there = min(share + ahead, 1.0)
            pose = first + there * (last - first)
            turned = float(np.abs(pose[[2, 5]] - shape[[0, -1]]).max())
            stable = [s.elastica for s in self._all(pose) if s.stable]
            apart = [float(np.abs(e.angle_at(fractions) - shape).max()) for e in stable]
            if apart and min(apart) <= _STIFF_TURN + turned:
                return standard_numbers(stable[int(np.argmin(apart))].parameters), there
        return None

    def _check_reach(self, first: FloatArray, last: FloatArray) -> None:
        """The chord is largest at one of the ends of a straight way: the difference of its ends is linear."""
        for pose in (first, last):
            chord = float(np.hypot(pose[3] - pose[0], pose[4] - pose[1]))
            if not chord <= _TAUT * self.length:
                raise NoSolutionError(
                    f"the ends are {chord:.9g} apart; a rod of length {self.length:.9g} can be followed while they are at "
                    f"most {_TAUT * self.length:.9g} apart (beyond it is taut)"
                )


def track_boundary(
    path: ArrayLike, length: float, *, solution: Elastica | None = None, max_inflections: int = 2
) -> list[TrackedPose]:
    """Follow a rod along a path of poses of its ends.

    Parameters:
        path: (n, 6), rows start x, y, angle, end x, y, angle; between rows all six go linearly.
        length: of the rod.
        solution: its shape at the first pose; by default the stable one of least energy.
        max_inflections: see `solve_boundary`; for the first pose only.

    Returns:
        n states; a `snap` in one of them tells that the rod fell to another shape on the way to it.

    Raises:
        As `RodTracker.move`.

    Accuracy:
        Ends met to 1e-12 (lengths, radians) for √λ·L up to about 12; a fold is found to 1e-9 of the way between two rows.

    Example:
        >>> up, down = (s.elastica for s in solve_boundary((0, 0), 0.0, (0.8, 0), 0.0, 1.0))
        >>> path = np.linspace((0, 0, 0, 0.8, 0, 0), (0, 0, 0, 0.8, 0, 3), 31)  # turn one end by 3 rad
        >>> for shape in sorted((up, down), key=lambda e: e.start_curvature):
        ...     states = track_boundary(path, 1.0, solution=shape)
        ...     print([(i, round(s.snap.energy_released, 1)) for i, s in enumerate(states) if s.snap is not None])
        []
        [(8, 15.6)]
    """
    rows = np.asarray(path, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != 6 or len(rows) == 0:
        raise InvalidInputError(
            f"a path has rows start x, y, angle, end x, y, angle, shape (n, 6), n ≥ 1; got {rows.shape}"
        )
    tracker = RodTracker(length, max_inflections=max_inflections, solution=solution)
    return [tracker.move(row) for row in rows]


def standard_numbers(parameters: ArrayLike) -> FloatArray:
    """(0, κ₀, λ₁, λ₂) of elastica (…, 7) scaled to length 1 and turned so that they start along x; shape (…, 4)."""
    _, _, angle, kappa, fx, fy, length = np.moveaxis(np.asarray(parameters, dtype=np.float64), -1, 0)
    cos, sin = np.cos(angle), np.sin(angle)
    along, across = (cos * fx + sin * fy) * length**2, (cos * fy - sin * fx) * length**2
    return np.stack([np.zeros_like(angle), kappa * length, along, across], axis=-1)


def end_poses(parameters: ArrayLike) -> FloatArray:
    """Start x, y, angle, end x, y, angle of elastica (…, 7); shape (…, 6)."""
    rows = np.asarray(parameters, dtype=np.float64)
    return np.concatenate([rows[..., :3], states_at(rows, rows[..., 6])[..., :3]], axis=-1)


def placed(z: FloatArray, pose: FloatArray, length: float) -> Elastica:
    """The inverse of `standard_numbers` for one curve, started at a pose (6,)."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    force = np.array([cos * z[2] - sin * z[3], sin * z[2] + cos * z[3]]) / length**2
    return Elastica(pose[:2], float(pose[2]), float(z[1]) / length, force, length)


def fallen(before: Elastica, pose: FloatArray) -> Elastica:
    """The stable shape at a pose (6,) that an overdamped rod falls to from the shape `before`.

    Where the fall does not come to rest in time, or its end is too stiff for the polyline that falls to be a guess, it is
    the stable shape nearest to where the fall has come.

    Raises:
        ConvergenceError: there is no stable shape.
    """
    length = before.length
    middles = before.angle_at((np.arange(_EDGES) + 0.5) * (length / _EDGES)) - before.start_angle + pose[2]
    rod = DiscreteRod(pose[:2], float(pose[2]), pose[3:5], float(pose[5]), length, edges=_EDGES, ends="points")
    try:
        angles = rod.relax(middles, max_steps=_MOST_FALL).angles
        after = _from_polyline(rod.solve(initial=angles), pose, length)
        if after is not None:
            return after
    except ConvergenceError as error:
        angles = np.asarray(error.best, dtype=np.float64)
    fractions = (np.arange(_EDGES) + 0.5) / _EDGES
    every = solve_boundary(pose[:2], pose[2], pose[3:5], pose[5], length, max_inflections=4)
    found = [s.elastica for s in every if s.stable]
    if not found:
        raise ConvergenceError(f"no stable shape was found after a snap at {pose.tolist()}", best=before)
    apart = [float(np.abs(e.angle_at(fractions * length) - angles).mean()) for e in found]
    return found[int(np.argmin(apart))]


def _from_polyline(rest: DiscreteRodResult, pose: FloatArray, length: float) -> Elastica | None:
    """The elastica next to a polyline at rest; None if Newton's method does not lead to one of the same energy."""
    problem = np.zeros(PROBLEM)
    problem[LENGTH] = 1.0
    kernel.pose_problem(pose, pose, 0.0, length, problem)
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    force = rest.force * length**2
    bend = 2.0 * _EDGES * (rest.angles[0] - pose[2])  # at a quarter of an edge
    bend -= 0.25 * (_EDGES * (rest.angles[1] - rest.angles[0]) - bend) / 0.75
    z = np.array([0.0, bend, cos * force[0] + sin * force[1], cos * force[1] - sin * force[0]])
    miss = float(polish(z, problem, ANGLES))
    after = placed(z, pose, length)
    good = miss < 1e-9 and abs(after.bending_energy() - rest.energy) < 0.05 * rest.energy
    return after if good and float(margins(after.parameters)) > 1.0 else None
