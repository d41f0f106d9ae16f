"""One run of a constrained spline: where it starts from, what is tried, and what is given up if nothing is found."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from batten.errors import ConvergenceError
from batten.splines.joint_angles import EndCondition, JointProblem, JointSolution, solve_joints
from batten.splines.knot_equations import KnotEquations, KnotState
from batten.splines.knot_types import Run
from batten.splines.segment_family import EulerSpirals
from batten.typing import FloatArray, IntArray

Status = Literal["converged", "relaxed", "higher winding", "not converged"]

# A long run that fails does so at one place, and to follow all of it would take minutes.
_LONG = 2000
_MOST_RELAXATIONS = 200


@dataclass(frozen=True, eq=False)
class SolvedRun:
    """Segments of a run.

    Attributes:
        middle: (m, 4), k₀ … k₃. chord_of_length: (m,), chord over length.
        angles: (m, 2), of the tangents at the ends to the chord. parameters: (m,), of the segments as they are.
        loops: (m,), 1 where a segment begins to make a loop: of greatest angle over π and of turn over 2π the greater.
        status: see `ConstrainedSpline`. residual: of what was asked for. iterations: Newton steps.
        relaxed: indices of the letters of the run that were taken for c.
        joined: how the Euler spirals of a run that did not converge are joined, in words.
    """

    middle: FloatArray
    chord_of_length: FloatArray
    angles: FloatArray
    parameters: IntArray
    loops: FloatArray
    status: Status
    residual: float
    iterations: int = 0
    relaxed: tuple[int, ...] = ()
    joined: str = ""


def solve_run(run: Run, steps: FloatArray, relax: bool, place: str) -> SolvedRun:
    """The segments of a run between points that are (m, 2) `steps` apart; `place`: where it is, in words.

    What has no loops comes first; then, with `relax`, what has none after some o are taken for c; then what has loops; then
    Euler spirals.

    Raises:
        ConvergenceError: not even the Euler spiral spline was found.
    """
    chords: FloatArray = np.hypot(steps[:, 0], steps[:, 1])
    turns = _turns(run, steps)
    equations = KnotEquations(run, chords, turns)
    straight = equations.newton(np.zeros(equations.unknowns), equations.constant)
    best = _read(equations, equations.middle(straight.x)) if straight is not None else None
    if best is not None and best.status == "converged":
        return replace(best, iterations=equations.iterations)
    fair, joined = _euler(run, chords, turns)
    if fair.status == "no solution":
        raise ConvergenceError(
            f"not even an Euler spiral spline {place} was found; put a point between, or make one a corner",
            iterations=fair.iterations,
        )
    euler = np.zeros((len(chords), 4))
    euler[:, :2] = fair.ends.memory[0][:, :2]
    found = _first(equations, euler)
    best = found if best is None or (found is not None and found.status == "converged") else best
    count = equations.iterations
    if relax and (best is None or best.status != "converged"):
        relaxed, tries = _relaxed(run, equations, euler)
        best, count = relaxed if relaxed is not None else best, count + tries
    if best is None:
        two = np.full(len(euler), 2)
        best = replace(_read(equations, euler), status="not converged", parameters=two, joined=joined)
    return replace(best, iterations=count)


def _first(equations: KnotEquations, euler: FloatArray) -> SolvedRun | None:
    """The first solution without loops, or else the first; None if there is none."""
    best: SolvedRun | None = None
    for state in _tries(equations, euler):
        if state is not None:
            found = _read(equations, equations.middle(state.x))
            if found.status == "converged":
                return found
            best = best or found
    return best


def _relaxed(run: Run, asked: KnotEquations, euler: FloatArray) -> tuple[SolvedRun | None, int]:
    """With c for as few o as will do, and the number of Newton steps: all are taken for c, and then given back.

    They are given back by the size of their jumps, the smaller half first, and halved again where that fails; so the choice
    is the same for similar, mirrored and reversed points.
    """
    plain = replace(run, letters=run.letters.replace("o", "c"))
    smooth = [i for i, letter in enumerate(run.letters) if letter == "o"]
    equations = KnotEquations(plain, asked.chords, asked.turns)
    best = _first(equations, euler)
    count = equations.iterations
    if best is None or best.status != "converged":
        return None, count
    kept: set[int] = set()
    size = asked.gaps(asked.ends(best.middle))[np.array(smooth, dtype=np.int64) + (not run.closed)]
    order = [smooth[i] for i in np.argsort(size, kind="stable")]
    half = (len(order) + 1) // 2
    blocks = [order[half:], order[:half]] if len(order) > 1 else []
    for _ in range(_MOST_RELAXATIONS if len(euler) <= _LONG else 0):
        if not blocks:
            break
        block = blocks.pop()
        trial = kept.union(block)
        letters = "".join("c" if a == "o" and i not in trial else a for i, a in enumerate(run.letters))
        equations = KnotEquations(replace(run, letters=letters), asked.chords, asked.turns)
        state = equations.newton(best.middle[equations.used], equations.constant, most=30)
        count += equations.iterations
        found = _read(equations, equations.middle(state.x)) if state is not None else None
        if found is not None and found.status == "converged":
            best, kept = found, trial
        elif len(block) > 1:
            half = (len(block) + 1) // 2
            blocks += [block[half:], block[:half]]
    rest = tuple(i for i in smooth if i not in kept)
    if not rest:
        return best, count
    return replace(best, status="relaxed", relaxed=rest, residual=asked.residual(asked.ends(best.middle))), count


def _turns(run: Run, steps: FloatArray) -> FloatArray:
    """Turning angle at each knot of a run, in (−π, π]; at its ends that from or to the line, if there is one."""
    z = steps[:, 0] + 1j * steps[:, 1]
    if run.closed:
        turns = np.angle(z * np.conj(np.roll(z, 1)))
    else:
        before, after = np.exp(1j * np.array(run.directions))
        first = z[0] * np.conj(before) if run.boundaries[0] == "line" else 1.0
        last = after * np.conj(z[-1]) if run.boundaries[1] == "line" else 1.0
        turns = np.angle(np.concatenate([[first], z[1:] * np.conj(z[:-1]), [last]]))
    return np.where(turns == -np.pi, np.pi, turns)


def _euler(run: Run, chords: FloatArray, turns: FloatArray) -> tuple[JointSolution, str]:
    """The Euler spiral spline of a run, if possible with arcs at its ends and the lines' tangents; and how it is joined."""
    if run.closed:
        return solve_joints(JointProblem(chords, turns, True), EulerSpirals()), "G2"
    inner = turns.copy()
    inner[[0, -1]] = 0.0

    def condition(place: int, arcs: bool, lines: bool) -> EndCondition:
        if lines and run.boundaries[place] == "line":
            return EndCondition("angle", float(turns[place] if place else -turns[place]))
        return EndCondition("arc" if arcs and run.parameters[place] == 1 else "curvature")

    for arcs, lines in ((True, True), (False, True), (False, False)):
        ends = condition(0, arcs, lines), condition(-1, arcs, lines)
        fair = solve_joints(JointProblem(chords, inner, False, *ends), EulerSpirals())
        if fair.status != "no solution":
            break
    beside = "G1" if lines else "G2, with a corner at the line"
    return fair, beside if "line" in run.boundaries else "G2"


def _tries(equations: KnotEquations, euler: FloatArray) -> Iterator[KnotState | None]:
    """Where a start from straight segments failed, what is tried until there is no loop; `euler`: (m, 4), that spline's."""
    x, whole = euler[equations.used], equations.constant
    zero, nothing = np.zeros_like(x), np.zeros_like(whole)
    near = equations.state(x, whole)
    if near is None:
        return
    gap = near.miss - equations.windings(near.ends)
    wound = whole + near.miss - gap
    yield equations.newton(x, wound)
    if len(euler) > _LONG:
        return
    yield equations.follow(zero, nothing, whole)
    yield equations.follow(x, wound + gap, -gap)
    yield equations.wander(zero, whole, 1.0)
    yield equations.wander(zero, whole, 3.0)
    yield equations.wander(x, whole, 3.0)


def _read(equations: KnotEquations, middle: FloatArray) -> SolvedRun:
    """Status of segments: "higher winding" if a tangent is more than π from its chord or a segment turns by 2π."""
    ends = equations.ends(middle)
    angles = ends[:, [2, 6]]
    s = np.linspace(-0.5, 0.5, 17)
    turn = middle @ np.stack([s, s**2 / 2.0, s**3 / 6.0, s**4 / 24.0])
    loops = np.maximum(np.abs(angles).max(axis=1) / np.pi, np.ptp(turn, axis=1) / (2.0 * np.pi))
    wound = bool(np.abs(equations.windings(ends)).any())
    status: Status = "higher winding" if wound or loops.max() > 1.0 + 1e-9 else "converged"
    return SolvedRun(middle, ends[:, 0], angles, equations.parameters, loops, status, equations.residual(ends))
