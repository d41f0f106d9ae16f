"""All elastica between two held ends (Fisker2018 §2.2, Definition 1), not the one next to a guess."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from batten.curves.elastica import Elastica
from batten.errors import ConvergenceError, InvalidInputError, NoSolutionError
from batten.kernels import boundary_batch as kernel
from batten.kernels.boundary_polish import ANGLES, CURVATURES, END_CURVATURE, START_CURVATURE
from batten.kernels.boundary_search import TIGHTEST
from batten.solvers.stability import Ends, least_eigenvalues, margins
from batten.typing import ArrayLike, FloatArray, IntArray

STATUS = (
    "found",
    "no solution with so few inflections",
    "search cut short",
    "a solution cannot be stored",
    "length below the chord",
    "taut, but the ends do not lie along the chord",
    "both ends pinned in one point",
    "bad input",
)
"""What the status of a row of `BoundaryBatch` means, by its number."""

_BUDGET = 200_000  # evaluations of the curve for one problem; a thousand are usual
_CHUNK = 256  # problems that a thread takes at once
_KINDS: dict[int, Ends] = {
    ANGLES: "clamped",
    START_CURVATURE: "pinned-clamped",
    END_CURVATURE: "clamped-pinned",
    CURVATURES: "pinned",
}


@dataclass(frozen=True)
class BoundarySolution:
    """One of the shapes that a rod can take between its ends.

    Attributes:
        elastica: the curve.
        energy: ∫κ² ds, 1/length (batten's convention, without the factor ½).
        inflections: how often the curvature changes sign strictly between the ends.
        rotation_number: (θ(L) − θ(0)) / 2π.
        stable: whether the rod holds this shape: its energy is a strict minimum among neighbours with the same ends.
        margin: length up to the first conjugate point over the length: above 1 the shape is stable; inf if none comes. NaN
            where an end's curvature is given and not 0; there `stable` comes from the least eigenvalue.
        residual: greatest miss of the end point (in lengths) and of the end angle (radians), as stored.
        ends: which ends are clamped; what `stable` and `margin` are for.
    """

    elastica: Elastica
    energy: float
    inflections: int
    rotation_number: float
    stable: bool
    margin: float
    residual: float
    ends: Ends = "clamped"


@dataclass(frozen=True, eq=False)
class BoundaryBatch:
    """All solutions of n problems, m places for each; what is not used is NaN.

    Attributes:
        parameters: (n, m, 7), as `Elastica.parameters`, sorted by energy.
        energy, margin, residual: (n, m), see `BoundarySolution`; margin is NaN if it was not asked for.
        inflections: (n, m), −1 where there is no solution.
        count: (n,), how many solutions each problem has.
        status: (n,), index into `STATUS`. With "search cut short" (degenerate problems) and "a solution cannot be stored"
            there may be more solutions than are listed.
        evaluations: (n,), how often the search evaluated a curve.
    """

    parameters: FloatArray
    energy: FloatArray
    margin: FloatArray
    residual: FloatArray
    inflections: IntArray
    count: IntArray
    status: IntArray
    evaluations: IntArray


def solve_boundary(
    start: ArrayLike,
    start_angle: float | None,
    end: ArrayLike,
    end_angle: float | None,
    length: float,
    *,
    start_curvature: float = 0.0,
    end_curvature: float = 0.0,
    max_inflections: int = 2,
    max_turns: float = 1.0,
    end_angle_modulo: bool = False,
) -> list[BoundarySolution]:
    """All elastica of a given length between two held ends: the rod's equilibria, sorted by energy.

    They are the stationary curves of ∫κ² ds with given end points, end tangent angles and length (Fisker2018 Definition 1).
    For each number of inflections and each sign of the first curvature two unknowns are left, the direction of the force
    and the modulus, on a bounded domain; it is subdivided until every cell either cannot hold a solution or holds one
    that Newton's method polishes. No guess is needed. That a cell cannot hold one is judged from the image of its nine
    points, widened by their second differences: no proof, but brute force by other code found no solution missing.

    Parameters:
        start, end: points (2,), any unit of length.
        start_angle, end_angle: tangent angles in radians, real numbers: end_angle = start_angle + 2π asks for one whole turn
            more. None: the rod may turn freely there, its curvature (moment) is given instead.
        length: arc length, at least the distance of the points.
        start_curvature, end_curvature: 1/length, where the angle is None; 0 is a pin.
        max_inflections: only curves with at most so many inflections between the ends, 0 or more.
        max_turns: with `end_angle_modulo` or an angle None, only curves with |θ(L) − θ(0)| ≤ 2π max_turns.
        end_angle_modulo: the end angle counts modulo 2π: all windings within `max_turns`.

    Returns:
        The solutions, never an empty list.

    Raises:
        InvalidInputError: a value that is not finite, a wrong shape, a length that is not positive, limits below 0.
        NoSolutionError: length below the chord; a taut rod whose ends do not lie along the chord; no solution within the
            limits.
        ConvergenceError: the search was cut short (a degenerate problem with very many solutions), or all solutions are so
            taut that their seven numbers cannot be stored (`best` holds what was found).

    Accuracy:
        End point and end angle are met to 1e-11 (in lengths and radians) up to √λ·L = 30. The end of a rod that is pulled
        hard, or makes tight loops, hangs on its start like exp(√λ·L): there the last digits of the seven numbers are
        searched for the best, `residual` says what is missed, and above 1e-9 a solution is left out. Looked for are
        curves with √λ·L ≤ 40, forty times the clamped buckling load; with an angle None, ≤ 12 + 6 max_inflections.
        Two solutions that are about to merge (a fold) are told apart down to 1e-7 in curvature and force.

    Degenerate cases:
        length = distance within 1e-12: the straight line, if both ends lie along it, with force 0 (a straight rod's axial
        force is not determined). start = end with equal angles: the figure-eights that start in their double point stand
        for the family that starts anywhere on them. Both ends pinned in one point: every direction is possible;
        NoSolutionError says so.

    Example:
        >>> both = solve_boundary((0, 0), 0.0, (0.8, 0), 0.0, 1.0)
        >>> [(round(s.energy, 3), s.inflections, s.stable) for s in both]
        [(16.646, 2, True), (16.646, 2, True)]
        >>> up, down = solve_boundary((0, 0), None, (0.8, 0), None, 1.0, max_inflections=0)
        >>> print(f"{up.energy:.3f} {abs(up.elastica.start_angle):.3f} rad")
        4.161 0.914 rad
    """
    row, kind = _problem(start, start_angle, end, end_angle, length, start_curvature, end_curvature)
    if not (max_inflections >= 0 and max_turns >= 0.0):
        raise InvalidInputError(
            f"max_inflections = {max_inflections!r}, max_turns = {max_turns!r}; both must be numbers from 0 on"
        )
    rows = row[None]
    if end_angle_modulo and kind == ANGLES:
        turn = row[3] - row[2]
        first = np.ceil(-max_turns - turn / (2 * np.pi) - 1e-12)
        last = np.floor(max_turns - turn / (2 * np.pi) + 1e-12)
        windings = np.arange(first, last + 1)
        if len(windings) == 0:
            raise NoSolutionError(
                f"no winding of the end angle {row[3]:g} is within max_turns = {max_turns:g} of the start angle {row[2]:g}; "
                "take max_turns of at least 0.5"
            )
        rows = np.repeat(rows, len(windings), axis=0)
        rows[:, 3] += 2 * np.pi * windings
    batch = _solve_rows(rows, kind, int(max_inflections), workers=1, stability=True)
    batch.parameters[:, :, :2] += np.asarray(start, dtype=np.float64)
    solutions = [_solution(batch, i, j, kind) for i in range(len(rows)) for j in range(int(batch.count[i]))]
    if kind != ANGLES:
        solutions = [s for s in solutions if abs(s.rotation_number) <= max_turns + 1e-12]
    solutions.sort(key=lambda s: s.energy)
    _complain(batch.status, solutions, row, int(max_inflections))
    return solutions


def solve_boundary_batch(
    start: ArrayLike,
    start_angle: ArrayLike,
    end: ArrayLike,
    end_angle: ArrayLike,
    length: ArrayLike,
    *,
    max_inflections: int = 2,
    most: int | None = None,
    stability: bool = True,
    workers: int | None = None,
) -> BoundaryBatch:
    """`solve_boundary` for n problems with held angles, on all cores.

    Parameters:
        start, end: (n, 2) or (2,). start_angle, end_angle, length: (n,) or one number for all.
        max_inflections: as in `solve_boundary`.
        most: places for solutions of each problem; by default 8 + 8 max_inflections. A problem with more gets the status
            "search cut short".
        stability: whether margins are computed.
        workers: threads, by default one for each core.

    Returns:
        A `BoundaryBatch`; a bad row gets a status and NaN, the others go on.

    Raises:
        InvalidInputError: shapes that do not fit together.

    Example:
        >>> batch = solve_boundary_batch((0, 0), 0.0, (0.8, 0), np.array([0.0, 0.3, np.nan]), 1.0)
        >>> batch.count.tolist(), [STATUS[s] for s in batch.status]
        ([2, 2, 0], ['found', 'found', 'bad input'])
    """
    p, q = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    if p.shape[-1:] != (2,) or q.shape[-1:] != (2,) or p.ndim > 2 or q.ndim > 2:
        raise InvalidInputError(f"start and end have shape (n, 2) or (2,); got {p.shape} and {q.shape}")
    try:
        columns = np.broadcast_arrays(p[..., 0], p[..., 1], q[..., 0] - p[..., 0], q[..., 1] - p[..., 1],
                                      start_angle, end_angle, length)  # fmt: skip
    except ValueError as error:
        raise InvalidInputError(f"start, angles, end and length must have n rows each or one: {error}") from error
    table = np.stack([np.atleast_1d(np.asarray(c, dtype=np.float64)) for c in columns], axis=-1)
    rows = np.zeros((len(table), 7))
    rows[:, :4], rows[:, 6] = table[:, 2:6], table[:, 6]
    found = _solve_rows(rows, ANGLES, int(max_inflections), workers=workers, stability=stability, most=most)
    found.parameters[:, :, :2] += table[:, None, :2]
    return found


def _problem(
    start: ArrayLike, start_angle: float | None, end: ArrayLike, end_angle: float | None, length: float,
    start_curvature: float, end_curvature: float,
) -> tuple[FloatArray, int]:  # fmt: skip
    """The row of a single problem with its start in (0, 0), and its kind."""
    try:
        p, q = np.array(start, dtype=np.float64), np.array(end, dtype=np.float64)
        rest = [0.0 if a is None else float(a) for a in (start_angle, end_angle)]
        rest += [float(start_curvature), float(end_curvature), float(length)]
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"ends, angles and length are numbers; {error}") from error
    if p.shape != (2,) or q.shape != (2,):
        raise InvalidInputError(f"start and end are points, shape (2,); got shapes {p.shape} and {q.shape}")
    if not (np.isfinite(p).all() and np.isfinite(q).all() and np.isfinite(rest).all()):
        raise InvalidInputError(
            f"ends, angles and length must be finite; got start {p}, {start_angle}, end {q}, {end_angle}, length {length}"
        )
    if not rest[4] > 0.0:
        raise InvalidInputError(f"a rod's length is above 0; got {length}")
    kind = (START_CURVATURE if start_angle is None else 0) | (END_CURVATURE if end_angle is None else 0)
    return np.array([*(q - p), *rest]), kind


def _solve_rows(
    rows: FloatArray, kind: int, max_inflections: int, *, workers: int | None, stability: bool, most: int | None = None
) -> BoundaryBatch:
    """All solutions of `rows` (n, 7), see `kernels.boundary_batch.scan_rows`; starts in (0, 0)."""
    if max_inflections < 0:
        raise InvalidInputError(f"max_inflections = {max_inflections}; allowed are whole numbers from 0 on")
    n, m = len(rows), 8 + 8 * max_inflections if most is None else int(most)
    rows = np.ascontiguousarray(rows)
    found = np.empty((n, m, 7))
    count, status, evaluations = (np.zeros(n, dtype=np.int64) for _ in range(3))
    parameters, margin = np.full((n, m, 7), np.nan), np.full((n, m), np.nan)

    jobs = kernel.jobs_of(kind, max_inflections)

    def work(part: slice) -> None:
        out = found[part]
        size = len(out)
        starts, n_starts = np.empty((size, 16 + 24 * (max_inflections + 1), 4)), np.empty(size, dtype=np.int64)
        state = status[part]
        kernel.scan_rows(rows[part], kind, max_inflections, jobs, _BUDGET, starts, n_starts, state, evaluations[part])
        kernel.finish_rows(rows[part], kind, max_inflections, starts, n_starts, out, count[part], state)
        there = np.arange(m) < count[part, None]
        parameters[part, :, :2][there] = 0.0
        parameters[part, :, 2:6] = out[:, :, :4]
        parameters[part, :, 6] = np.where(there, rows[part, None, 6], np.nan)
        if stability:
            values = margins(parameters[part][there], _KINDS[kind])
            margin[part][there] = values

    in_threads(work, n, workers)
    inflections = np.where(np.isfinite(found[:, :, 5]), found[:, :, 5], -1.0).astype(np.int64)
    return BoundaryBatch(parameters, found[:, :, 4], margin, found[:, :, 6], inflections, count, status, evaluations)


def in_threads(work: Callable[[slice], Any], n: int, workers: int | None) -> None:
    """Call `work` on slices that cover range(n), in as many threads as `workers` says (None: one for each core)."""
    threads = max(1, workers if workers is not None else (os.cpu_count() or 1))
    parts = [slice(i, min(i + _CHUNK, n)) for i in range(0, n, _CHUNK)]
    if threads == 1 or len(parts) < 2:
        for part in parts:
            work(part)
        return
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, parts))


def _solution(batch: BoundaryBatch, i: int, j: int, kind: int) -> BoundarySolution:
    parameters, margin = batch.parameters[i, j], float(batch.margin[i, j])
    elastica = Elastica.from_parameters(parameters)
    turned = float(elastica.angle_at(elastica.length)) - elastica.start_angle
    if np.isnan(margin):  # a given moment at an end
        stable = float(least_eigenvalues(parameters, _KINDS[kind], moments=True)) > 0.0
    else:
        stable = margin > 1.0
    return BoundarySolution(
        elastica=elastica,
        energy=float(batch.energy[i, j]),
        inflections=int(batch.inflections[i, j]),
        rotation_number=turned / (2 * np.pi),
        stable=stable,
        margin=margin,
        residual=float(batch.residual[i, j]),
        ends=_KINDS[kind],
    )


def _complain(status: IntArray, solutions: list[BoundarySolution], row: FloatArray, most: int) -> None:
    """Raise what a single problem's statuses call for."""
    words = {STATUS[s] for s in status}
    chord, length = float(np.hypot(row[0], row[1])), float(row[6])
    if "search cut short" in words:
        raise ConvergenceError(
            f"the search was cut short after {_BUDGET:,} evaluations with {len(solutions)} solutions found; the problem is "
            "degenerate (very many solutions): change an end a little, or allow fewer inflections",
            best=solutions,
            iterations=_BUDGET,
        )
    if solutions:
        return
    if "length below the chord" in words:
        raise NoSolutionError(
            f"the ends are {chord:.9g} apart and the rod is only {length:.9g} long; it must be at least as long: bring the "
            "ends together or take a longer rod"
        )
    if "taut, but the ends do not lie along the chord" in words:
        raise NoSolutionError(
            f"a rod as long as the distance of its ends ({chord:.9g}) is straight, but the end angles {row[2]:g} and "
            f"{row[3]:g} do not lie along the chord (angle {np.arctan2(row[1], row[0]):g}); take a longer rod"
        )
    if "both ends pinned in one point" in words:
        raise NoSolutionError(
            "both ends are pinned in one point: every direction of the same closed curves is a solution; clamp an end"
        )
    if "a solution cannot be stored" in words:
        raise ConvergenceError(
            f"a rod of length {length:.9g} between ends {chord:.9g} apart is here so stiffly held that its shape cannot be "
            "computed from its start in double precision; take a longer rod",
            best=solutions,
        )
    raise NoSolutionError(
        f"no elastica with at most {most} inflections and a force up to {TIGHTEST**2:g} EI/length² joins these ends with "
        f"length {length:.9g} (distance {chord:.9g}); "
        + ("the rod is all but taut: take a longer one" if chord > 0.98 * length else "allow more with max_inflections")
    )
