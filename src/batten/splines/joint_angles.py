"""The tangent angles of a two-parameter spline: curvature equal on both sides of every point (Levien2009 §4.2).

The unknowns are u_i, the angle of the tangent at point i to the chord that leaves it (at the last point of an open spline,
to the chord that comes in). With the turning angle δ_i of the polygon, segment i has the angles (u_i, u_{i+1} + δ_{i+1}): no
angle is ever reduced by a full turn. The equations are tridiagonal, cyclic for closed splines. Newton's method with exact
derivatives, damped. Where it fails, a segment at the end of its reach goes around the other way, by a full turn less: a
solution of higher winding, which is marked. Families that do not exist for all angles have the turning angles (and end
conditions) raised from 0 instead, where u = 0 is the solution, and the curve of solutions is followed, also around folds.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from batten.splines.segment_family import SegmentEnds, SegmentFamily
from batten.typing import FloatArray, IntArray

Status = Literal["converged", "higher winding", "no solution"]


@dataclass(frozen=True)
class EndCondition:
    """What holds at an end of an open spline.

    Attributes:
        kind: "curvature" (value in 1/length; 0 is the natural end), "angle" (value: of the tangent to the end's chord,
            radians) or "arc" (no variation of curvature: the last segment has equal curvatures at its two ends).
        value: see kind.
    """

    kind: Literal["curvature", "angle", "arc"]
    value: float = 0.0


@dataclass(frozen=True, eq=False)
class JointProblem:
    """A polygon whose spline is wanted.

    Attributes:
        chords: (n,), lengths of the segments' chords.
        turns: (n + 1,), turning angle at each point in (−π, π]; 0 at the ends of an open spline. If closed, (n,).
        closed: whether the last segment leads back to the first point.
        start, end: end conditions, for open splines.
        windings: (n,), full turns that each segment makes beside the turn that the angles say; None for none.
    """

    chords: FloatArray
    turns: FloatArray
    closed: bool
    start: EndCondition = EndCondition("curvature")
    end: EndCondition = EndCondition("curvature")
    windings: IntArray | None = None

    @property
    def unknowns(self) -> int:
        """How many angles are sought."""
        return len(self.chords) if self.closed else len(self.chords) + 1

    def angles(self, u: FloatArray, share: float = 1.0) -> FloatArray:
        """(n, 2) angles of the segments, the turning angles multiplied by `share`."""
        following = np.roll(u, -1) if self.closed else u[1:]
        turns = np.roll(self.turns, -1) if self.closed else self.turns[1:]
        full = 0.0 if self.windings is None else 2.0 * np.pi * self.windings
        return np.stack([u[: len(self.chords)], following + share * turns + full], axis=1)


@dataclass(frozen=True, eq=False)
class JointSolution:
    """Angles that were found.

    Attributes:
        angles: (n, 2), of the segments. ends: their end curvatures.
        status: "converged"; "higher winding" if a tangent turns by more than π from its chord, or a segment by a full turn
            more than its neighbours ask for; "no solution".
        residual: greatest jump of curvature × mean chord at a point, and miss of an end condition.
        iterations: Newton steps in all.
        blame: segment at which it failed, −1 if none.
    """

    angles: FloatArray
    ends: SegmentEnds
    status: Status
    residual: float
    iterations: int
    blame: int


@dataclass
class _State:
    u: FloatArray
    ends: SegmentEnds
    miss: FloatArray
    share: float


_TOLERANCE = 1e-12
_LARGEST_STEP = 1.0  # radians
_CLOSE_TO_REACH = 1e-6


def solve_joints(
    problem: JointProblem,
    family: SegmentFamily,
    first: FloatArray | None = None,
    memory: tuple[FloatArray, ...] = (),
) -> JointSolution:
    """Find the angles.

    Parameters:
        problem: the polygon and the end conditions.
        family: of the segments.
        first: angles u to start from; by default those of Hobby's linear system.
        memory: that of the ends of a solution nearby, of this or a similar family.
    """
    engine = _Engine(problem, family)
    u = first if first is not None else _linear_start(problem)
    state = engine.newton(u, 1.0, memory)
    if state is None and not memory:
        state = engine.wind() if family.winds else engine.follow()
    if state is None:
        angles = engine.problem.angles(engine.last)
        ends = family.ends(angles, problem.chords, ())
        return JointSolution(angles, ends, "no solution", np.inf, engine.count, engine.blame)
    angles = engine.problem.angles(state.u)
    windings = engine.problem.windings
    high = bool((np.abs(angles) > np.pi + 1e-9).any()) or (windings is not None and bool(windings.any()))
    residual = float(np.abs(state.miss).max(initial=0.0))
    return JointSolution(angles, state.ends, "higher winding" if high else "converged", residual, engine.count, -1)


def _linear_start(problem: JointProblem) -> FloatArray:
    """Solution of Hobby's linear system, held within ±2.5."""
    from batten.splines.segment_family import HobbySegments

    state = _Engine(problem, HobbySegments()).newton(np.zeros(problem.unknowns), 1.0, ())
    u = np.zeros(problem.unknowns) if state is None else state.u
    return np.asarray(np.clip(u, -2.5, 2.5))


class _Engine:
    def __init__(self, problem: JointProblem, family: SegmentFamily) -> None:
        self.problem, self.family = problem, family
        self.count = 0
        self.blame = -1
        self.last = np.zeros(problem.unknowns)
        c = problem.chords
        before = np.roll(c, 1) if problem.closed else c[:-1]
        after = c if problem.closed else c[1:]
        self.before, self.after = before, after
        self.weight = 2.0 * before * after / (before + after)

    # --- equations ---

    def state(self, u: FloatArray, share: float, memory: tuple[FloatArray, ...]) -> _State | None:
        """Residuals at u, or None where a segment does not exist."""
        angles = self.problem.angles(u, share)
        room = np.abs(angles[:, 1] - angles[:, 0]) < self.family.reach - _CLOSE_TO_REACH
        if not room.all():
            self.blame = int(np.argmin(room))
            return None
        ends = self.family.ends(angles, self.problem.chords, memory)
        if not ends.exists.all():
            self.blame = int(np.argmin(ends.exists))
            return None
        return _State(u, ends, self._miss(u, share, ends), share)

    def _miss(self, u: FloatArray, share: float, ends: SegmentEnds) -> FloatArray:
        k = ends.curvatures
        if self.problem.closed:
            return self.weight * (np.roll(k[:, 1], 1) / self.before - k[:, 0] / self.after)
        inner = self.weight * (k[:-1, 1] / self.before - k[1:, 0] / self.after)
        c = self.problem.chords
        first = self._end(self.problem.start, k[0], 0, u[0], c[0], share)
        last = self._end(self.problem.end, k[-1], 1, u[-1], c[-1], share)
        return np.concatenate([[first], inner, [last]])

    def _end(
        self, condition: EndCondition, k: FloatArray, side: int, angle: float, chord: float, share: float
    ) -> float:
        if condition.kind == "angle":
            return float(angle - share * condition.value)
        if condition.kind == "arc":
            return float(k[0] - k[1])
        return float(k[side] - share * condition.value * chord)

    def bands(self, ends: SegmentEnds) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Lower, main and upper diagonal, (m,) each: row i is lower·u_{i−1} + main·u_i + upper·u_{i+1}."""
        d = ends.slopes
        if self.problem.closed:
            before = np.roll(d, 1, axis=0)
            lower = self.weight * before[:, 1, 0] / self.before
            main = self.weight * (before[:, 1, 1] / self.before - d[:, 0, 0] / self.after)
            return lower, main, -self.weight * d[:, 0, 1] / self.after
        m = self.problem.unknowns
        lower, main, upper = np.zeros(m), np.zeros(m), np.zeros(m)
        lower[1:-1] = self.weight * d[:-1, 1, 0] / self.before
        main[1:-1] = self.weight * (d[:-1, 1, 1] / self.before - d[1:, 0, 0] / self.after)
        upper[1:-1] = -self.weight * d[1:, 0, 1] / self.after
        main[0], upper[0] = self._end_slopes(self.problem.start, d[0], 0)
        lower[-1], main[-1] = self._end_slopes(self.problem.end, d[-1], 1)
        return lower, main, upper

    @staticmethod
    def _end_slopes(condition: EndCondition, d: FloatArray, side: int) -> tuple[float, float]:
        if condition.kind == "angle":
            return (1.0, 0.0) if side == 0 else (0.0, 1.0)
        row = d[0] - d[1] if condition.kind == "arc" else d[side]
        return float(row[0]), float(row[1])

    def _wanted_change(self, state: _State) -> FloatArray:
        """What a Newton step should change the residuals by. A curvature that vanishes like |s|^α is a root of order α."""
        change = -state.miss
        if not self.problem.closed and self.family.exponent != 1.0:
            for place, condition in ((0, self.problem.start), (-1, self.problem.end)):
                if condition.kind == "curvature" and condition.value == 0.0:
                    change[place] *= self.family.exponent
        return change

    def solve(self, ends: SegmentEnds, right: FloatArray) -> FloatArray | None:
        """The linear system of `bands` for right-hand sides (m,) or (m, k); None if it is singular."""
        lower, main, upper = self.bands(ends)
        try:
            if self.problem.closed:
                return _solve_cyclic(lower, main, upper, right)
            return _solve_tridiagonal(lower, main, upper, right)
        except np.linalg.LinAlgError:
            return None

    # --- Newton's method ---

    def newton(self, u: FloatArray, share: float, memory: tuple[FloatArray, ...], most: int = 60) -> _State | None:
        """Damped Newton's method from u at a share of the turning angles."""
        state = self.state(u, share, memory)
        if state is None:
            if memory:
                return None
            u = np.zeros_like(u)
            state = self.state(u, share, ())
            if state is None:
                return None
        size = float(np.linalg.norm(state.miss))
        for _ in range(most):
            self.last = state.u
            if np.abs(state.miss).max(initial=0.0) < _TOLERANCE:
                return self._polished(state)
            step = self.solve(state.ends, self._wanted_change(state))
            if step is None or not np.isfinite(step).all():
                return None
            self.count += 1
            factor = min(1.0, _LARGEST_STEP / max(float(np.abs(step).max()), 1e-300))
            for _ in range(12):
                following = self.state(state.u + factor * step, share, state.ends.memory)
                if following is not None:
                    new = float(np.linalg.norm(following.miss))
                    if new < (1.0 - 1e-4 * factor) * size or new < _TOLERANCE:
                        break
                factor *= 0.5
            else:
                return state if np.abs(state.miss).max() < 1e3 * _TOLERANCE else None
            state, size = following, new
        return None

    def _polished(self, state: _State) -> _State:
        """One more step, if it makes the residual smaller."""
        step = self.solve(state.ends, self._wanted_change(state))
        if step is None or not np.isfinite(step).all():
            return state
        better = self.state(state.u + step, state.share, state.ends.memory)
        if better is None or np.abs(better.miss).max() > np.abs(state.miss).max():
            return state
        return better

    # --- higher windings ---

    def wind(self, most: int = 80) -> _State | None:
        """Newton's method again and again; each time the segment that turns most goes around the other way."""
        n = len(self.problem.chords)
        random = np.random.default_rng(n)
        windings = np.zeros(n, dtype=np.int64)
        u = self.last.copy()
        for attempt in range(most):
            turn = np.diff(self.problem.angles(u), axis=1)[:, 0]
            worst = int(np.argmax(np.abs(turn)))
            windings = windings.copy()
            windings[worst] -= int(np.sign(turn[worst]))
            self.problem = replace(self.problem, windings=windings)
            for _ in range(5):  # back into the reach
                turn = np.diff(self.problem.angles(u), axis=1)[:, 0]
                far = np.abs(turn) >= self.family.reach - 1e-3
                windings = windings - np.where(far, np.sign(turn), 0.0).astype(np.int64)
                self.problem = replace(self.problem, windings=windings)
            state = self.newton(u, 1.0, ())
            if state is not None:
                return state
            u = self.last.copy()
            if attempt % 8 == 7:  # going in circles
                u = u + random.normal(0.0, 0.4, len(u))
        return None

    # --- following from a straight polygon ---

    def follow(self, most: int = 400) -> _State | None:
        """Raise the turning angles from 0 to their values along the curve of solutions (u, share), by pseudo-arc length."""
        state = self.state(np.zeros(self.problem.unknowns), 0.0, ())
        if state is None:
            return None
        n = self.problem.unknowns
        direction = np.zeros(n + 1)
        direction[-1] = 1.0
        length = 0.25
        for _ in range(most):
            tangent = self._tangent(state, direction)
            if tangent is None:
                return None
            while True:
                following = self._correct(state, tangent, length)
                if following is not None:
                    break
                length *= 0.5
                if length < 1e-5:
                    self.last = state.u
                    return None
            if (state.share - 1.0) * (following.share - 1.0) <= 0.0 and following.share != state.share:
                part = (1.0 - state.share) / (following.share - state.share)
                there = self.newton(state.u + part * (following.u - state.u), 1.0, state.ends.memory)
                if there is not None and np.abs(there.u - state.u).max() < 4.0 * length + 0.5:
                    return there
            direction = tangent
            state = following
            length = min(1.5 * length, 0.6)
        self.last = state.u
        return None

    def _by_share(self, state: _State) -> FloatArray:
        """Derivative of the residuals by the share: the turning angles are the second angles of the segments before."""
        d, turns = state.ends.slopes, self.problem.turns
        if self.problem.closed:
            by_end = np.roll(turns, -1)
            return self.weight * (np.roll(d[:, 1, 1] * by_end, 1) / self.before - d[:, 0, 1] * by_end / self.after)
        by_end = turns[1:]
        inner = self.weight * (d[:-1, 1, 1] * by_end[:-1] / self.before - d[1:, 0, 1] * by_end[1:] / self.after)
        out = np.concatenate([[0.0], inner, [0.0]])
        c = self.problem.chords
        for place, condition, side in ((0, self.problem.start, 0), (-1, self.problem.end, 1)):
            row = d[place]
            if condition.kind == "angle":
                out[place] = -condition.value
            elif condition.kind == "arc":
                out[place] = (row[0, 1] - row[1, 1]) * by_end[place]
            else:
                out[place] = row[side, 1] * by_end[place] - condition.value * c[place]
        return out

    def _tangent(self, state: _State, before: FloatArray) -> FloatArray | None:
        """Unit tangent of the curve of solutions at a state, on the side of `before`."""
        along = self.solve(state.ends, -self._by_share(state))
        if along is None or not np.isfinite(along).all():
            return None
        tangent = np.append(along, 1.0)
        tangent /= np.linalg.norm(tangent)
        return tangent if tangent @ before >= 0.0 else -tangent

    def _correct(self, state: _State, tangent: FloatArray, length: float) -> _State | None:
        """Newton's method on the residuals and the plane across the tangent, from a step of `length` along it."""
        u, share = state.u + length * tangent[:-1], state.share + length * tangent[-1]
        memory = state.ends.memory
        last = np.inf
        for _ in range(10):
            here = self.state(u, share, memory)
            if here is None:
                return None
            memory = here.ends.memory
            plane = tangent[:-1] @ (u - state.u) + tangent[-1] * (share - state.share) - length
            size = max(float(np.abs(here.miss).max()), abs(plane))
            if size < 1e-10:
                return here
            if size > 2.0 * last:
                return None
            last = size
            both = self.solve(here.ends, np.stack([here.miss, self._by_share(here)], axis=1))
            if both is None or not np.isfinite(both).all():
                return None
            self.count += 1
            first, second = both[:, 0], both[:, 1]
            d_share = -(plane - tangent[:-1] @ first) / (tangent[-1] - tangent[:-1] @ second)
            u = u - first - d_share * second
            share = share + d_share
        return None


def _solve_tridiagonal(lower: FloatArray, main: FloatArray, upper: FloatArray, right: FloatArray) -> FloatArray:
    from scipy.linalg import solve_banded

    bands = np.zeros((3, len(main)))
    bands[0, 1:] = upper[:-1]
    bands[1] = main
    bands[2, :-1] = lower[1:]
    return np.asarray(solve_banded((1, 1), bands, right, check_finite=False))


def _solve_cyclic(lower: FloatArray, main: FloatArray, upper: FloatArray, right: FloatArray) -> FloatArray:
    """Sherman, Morrison and Woodbury: the two corners as an update of rank 2; directly for fewer than 5 unknowns."""
    n = len(main)
    if n < 5:
        full = np.zeros((n, n))
        for i in range(n):
            full[i, (i - 1) % n] += lower[i]
            full[i, i] += main[i]
            full[i, (i + 1) % n] += upper[i]
        return np.asarray(np.linalg.solve(full, right))
    columns = np.zeros((n, 2))
    columns[0, 0], columns[-1, 1] = 1.0, 1.0
    some = right[:, None] if right.ndim == 1 else right
    solved = _solve_tridiagonal(lower, main, upper, np.concatenate([some, columns], axis=1))
    base, by = solved[:, :-2], solved[:, -2:]
    # The corners take lower[0]·u[n−1] into row 0 and upper[n−1]·u[0] into row n−1.
    pick = np.stack([lower[0] * by[-1], upper[-1] * by[0]])
    rest = np.linalg.solve(np.eye(2) + pick, np.stack([lower[0] * base[-1], upper[-1] * base[0]]))
    out = base - by @ rest
    return np.asarray(out[:, 0] if right.ndim == 1 else out)
