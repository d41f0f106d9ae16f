"""A rod between two clamps: all its shapes by batten, one of them by scipy's `solve_bvp` from a good guess.

Problems: ends and lengths of random elastica of at most one period, length 1, as in Fisker2018 §2.2.3. `solve_bvp` gets the
four equations θ′ = κ, κ′ = −λ₁ sin θ + λ₂ cos θ, x′, y′ with the unknown parameters λ₁, λ₂, their Jacobian, 20 nodes of the
true curve disturbed by 1 % as a guess, and tol = 1e-6; its end is then missed by about that, ours by 1e-15. A rod followed
(`kernels.boundary_track.follow`) gets the same curve at ends a little displaced; so does `solve_bvp` in its row.
`CubicSplineRod` (the paper's Method 2) is refined until its L² distance to the exact curve is below 1e-6.
"""

from __future__ import annotations

import os
import time

import numpy as np
from scipy.integrate import solve_bvp

from batten.curves.elastica import Elastica, states_along
from batten.kernels.boundary_track import follow_batch
from batten.measures.distance import l2_distance
from batten.solvers.boundary_value import solve_boundary_batch
from batten.solvers.cubic_spline_rod import CubicSplineRod
from batten.solvers.track import standard_numbers
from batten.studies.boundary import random_elastica

COUNT, BY_BVP, BY_SPLINE, BATCH = 2000, 60, 12, 100_000


def problems(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Parameters (count, 7) of random elastica that start along x in (0, 0), and their end states (count, 4)."""
    rows = np.array([[0.0, *standard_numbers(random_elastica(0, i).parameters)] for i in range(count)])
    segments = np.column_stack([rows[:, :1] * 0, rows[:, :1] * 0, rows[:, 1:], np.ones(count)])
    return segments, states_along(segments, segments[:, 6:])[:, 0]


def by_bvp(segment: np.ndarray, end: np.ndarray, guess: np.ndarray) -> tuple[float, float, bool]:
    """Seconds, greatest miss of the end, and whether scipy says that it converged, from the states of a guess (n, 4)."""

    def slopes(s: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        sin, cos = np.sin(y[2]), np.cos(y[2])
        return np.array([cos, sin, y[3], p[1] * cos - p[0] * sin])

    def jacobian(s: np.ndarray, y: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        sin, cos = np.sin(y[2]), np.cos(y[2])
        by_y, by_p = np.zeros((4, 4, s.size)), np.zeros((4, 2, s.size))
        by_y[0, 2], by_y[1, 2], by_y[2, 3], by_y[3, 2] = -sin, cos, 1.0, -p[1] * sin - p[0] * cos
        by_p[3, 0], by_p[3, 1] = -sin, cos
        return by_y, by_p

    def ends(a: np.ndarray, b: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.array([a[0], a[1], a[2], b[0] - end[0], b[1] - end[1], b[2] - end[2]])

    s = np.linspace(0.0, 1.0, len(guess))
    begin = time.perf_counter()
    found = solve_bvp(slopes, ends, s, guess.T, p=1.01 * segment[4:6], fun_jac=jacobian, tol=1e-6, max_nodes=5000)
    spent = time.perf_counter() - begin
    exact = Elastica.from_parameters([0.0, 0.0, 0.0, found.y[3, 0], *found.p, 1.0])
    miss = float(np.abs([*exact.point_at(1.0) - end[:2], exact.angle_at(1.0) - end[2]]).max())
    return spent, miss, bool(found.success)


def by_spline(segment: np.ndarray, end: np.ndarray) -> tuple[float, float]:
    """Seconds of `CubicSplineRod` and the L² distance it comes to, with as many knot updates as 1e-6 takes (at most 7)."""
    rod = CubicSplineRod((0, 0), 0.0, end[:2], float(end[2]), 1.0)
    for updates in range(8):
        begin = time.perf_counter()
        result = rod.solve(updates=updates)
        spent = time.perf_counter() - begin
        apart = float(l2_distance(result.curve, Elastica.from_parameters(segment)))
        if apart < 1e-6:
            break
    return spent, apart


def row(what: str, ours_s: float, peer: str, peer_s: float | None, note: str) -> dict[str, object]:
    ratio = None if peer_s is None else peer_s / ours_s
    return {"what": what, "ours_s": ours_s, "peer": peer, "peer_s": peer_s, "ratio": ratio, "note": note}


def run() -> list[dict[str, object]]:
    """Rows of the table: what, ours_s, peer, peer_s, ratio, note."""
    rows: list[dict[str, object]] = []
    segments, ends = problems(COUNT)
    arguments = ((0.0, 0.0), 0.0, ends[:, :2], ends[:, 2], 1.0)
    solve_boundary_batch((0.0, 0.0), 0.0, ends[:4, :2], ends[:4, 2], 1.0)  # compiled, or read from the cache
    begin = time.perf_counter()
    batch = solve_boundary_batch(*arguments, workers=1, stability=False)
    each = (time.perf_counter() - begin) / COUNT
    rng = np.random.default_rng(0)
    spent, misses, failed = [], [], 0
    for i in range(BY_BVP):
        guess = states_along(segments[i : i + 1], np.linspace(0, 1, 20)[None])[0]
        seconds, miss, good = by_bvp(segments[i], ends[i], guess * (1 + 0.01 * rng.normal(size=guess.shape)))
        spent.append(seconds)
        misses.append(miss)
        failed += not good
    rows.append(
        row(
            "all shapes of a clamped rod (up to 2 inflections)",
            each,
            "scipy solve_bvp, one shape, good guess, tol 1e-6",
            float(np.mean(spent)),
            f"{batch.count.mean():.1f} shapes and {batch.evaluations.mean():.0f} evaluations a problem, worst miss of an "
            f"end {np.nanmax(batch.residual):.0e}; the peer's median miss {np.median(misses):.0e}, {failed} of {BY_BVP} "
            "failed",
        )
    )
    rows += followed(segments, ends)
    return rows + scaling()


def followed(segments: np.ndarray, ends: np.ndarray) -> list[dict[str, object]]:
    """A curve followed to ends displaced by about 0.02 against the same by solve_bvp, and against the paper's Method 2."""
    rng = np.random.default_rng(1)
    stable = [i for i in range(COUNT) if np.hypot(*segments[i, 4:6]) < 100]
    segments, ends = segments[stable], ends[stable]
    count = len(segments)
    first = np.zeros((count, 6))
    first[:, 3:] = ends[:, :3]
    last = first.copy()
    last[:, 3:] += 0.01 * rng.normal(size=(count, 3))
    last[:, 3:5] *= np.minimum(1.0, 0.995 / np.hypot(last[:, 3], last[:, 4]))[:, None]
    starts = np.column_stack([np.zeros(count), segments[:, 3:6]])
    shares, out, spent = np.empty(count), np.empty_like(starts), np.zeros((count, 2), dtype=np.int64)
    follow_batch(starts[:2], first[:2], last[:2], np.ones(2), 300, shares, out, spent)
    follow_batch(starts, first, last, np.ones(count), 300, shares, out, spent)
    arrived = np.flatnonzero(shares == 1.0)
    some = [np.ascontiguousarray(a[arrived]) for a in (starts, first, last)]
    begin = time.perf_counter()
    follow_batch(*some, np.ones(len(arrived)), 300, np.empty(len(arrived)), some[0].copy(), spent[arrived])
    each = (time.perf_counter() - begin) / len(arrived)
    peers = []
    for i in arrived[:BY_BVP]:
        goal = np.column_stack([np.zeros((1, 3)), out[i : i + 1, 1:], np.ones((1, 1))])[0]
        guess = states_along(segments[i : i + 1], np.linspace(0, 1, 20)[None])[0]
        peers.append(by_bvp(goal, [*last[i, 3:6], 0.0], guess)[0])
    note = (
        f"{np.median(spent[arrived, 0]):.0f} evaluations with derivatives a pose (median), {spent[arrived, 0].mean():.1f} "
        f"on average; {count - len(arrived)} of {count} came to a fold or were too stiff"
    )
    rows = [
        row(
            "a rod followed to its next pose",
            each,
            "scipy solve_bvp from the shape before",
            float(np.median(peers)),
            note,
        )
    ]
    times, distances = zip(*(by_spline(segments[i], ends[i]) for i in range(BY_SPLINE)))
    good = np.array(distances) < 1e-6
    rows.append(
        row(
            "the same",
            each,
            "our CubicSplineRod (Method 2) to an L² distance of 1e-6",
            float(np.mean(np.array(times)[good])) if good.any() else None,
            f"{good.sum()} of {BY_SPLINE} come so near with up to 7 knot updates; ours to 1e-12",
        )
    )
    return rows


def scaling() -> list[dict[str, object]]:
    """100,000 problems on one core and on all."""
    _, ends = problems(COUNT)
    many = np.resize(ends, (BATCH, 4)) + 1e-4 * np.random.default_rng(2).normal(size=(BATCH, 4))
    many[:, :2] *= np.minimum(1.0, 0.9999 / np.hypot(many[:, 0], many[:, 1]))[:, None]
    seconds = {}
    cores = os.cpu_count() or 1
    for workers in (1, cores):
        begin = time.perf_counter()
        batch = solve_boundary_batch((0.0, 0.0), 0.0, many[:, :2], many[:, 2], 1.0, workers=workers, most=12)
        seconds[workers] = time.perf_counter() - begin
    return [
        row(
            f"{BATCH:,} problems with stability, {cores} threads",
            seconds[cores],
            "the same on one",
            seconds[1],
            f"{1e6 * seconds[1] / BATCH:.0f} µs a problem and core; {int(batch.count.sum()):,} shapes",
        )
    ]


if __name__ == "__main__":
    for line in run():
        print(line)
