"""Euler spirals between two tangents against pyclothoids (C++), and Euler spiral splines 1×, 10×, 100×.

pyclothoids makes one object for each curve; the loop over it is part of what its user has. It is no dependency: install it
beside batten to see the comparison.
"""

from __future__ import annotations

import math
import time

import numpy as np

from batten.kernels import spiral
from batten.splines.interpolating_spline import joint_problem
from batten.splines.joint_angles import solve_joints
from batten.splines.segment_family import EulerSpirals

COUNT = 100_000


def random_ends(count: int, seed: int = 0) -> np.ndarray:
    """Angles of the tangents to the chord, uniform in (−π, π)², shape (count, 2)."""
    return np.random.default_rng(seed).uniform(-math.pi, math.pi, (count, 2))


def ours(angles: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """(seconds, κ at the start and κ′ for chord 1, length) of all curves, one thread."""
    rows, status = np.empty((len(angles), 9)), np.empty(len(angles), dtype=np.int64)
    spiral.euler_spiral_batch(angles[:10], rows[:10], status[:10])
    start = time.perf_counter()
    spiral.euler_spiral_batch(angles, rows, status)
    elapsed = time.perf_counter() - start
    assert (status == spiral.CONVERGED).all()
    k0, k1, c = rows[:, 0], rows[:, 1], rows[:, 2]
    return elapsed, np.stack([(k0 - 0.5 * k1) * c, k1 * c * c], axis=1), 1.0 / c


def worst_miss(angles: np.ndarray, numbers: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Greatest of the misses of end point and end angle of each curve, by Gauss's rule on 64 panels."""
    x, w = np.polynomial.legendre.leggauss(16)
    s = ((np.arange(64)[:, None] + 0.5 * (x + 1.0)) / 64).ravel()
    weight = np.tile(0.5 * w / 64, 64)
    out = np.empty(len(angles))
    for first in range(0, len(angles), 2000):
        part = slice(first, first + 2000)
        (start, end), k, length = angles[part].T, numbers[part], lengths[part]
        arc = length[:, None] * s
        theta = start[:, None] + arc * (k[:, :1] + 0.5 * k[:, 1:] * arc)
        place = length * (np.exp(1j * theta) @ weight)
        last = start + length * (k[:, 0] + 0.5 * k[:, 1] * length)
        out[part] = np.maximum(np.abs(place - 1.0) / length, np.abs(np.exp(1j * (last - end)) - 1.0))
    return out


def peer(angles: np.ndarray) -> tuple[float, np.ndarray, np.ndarray] | None:
    """The same by pyclothoids; None if it is not installed."""
    try:
        from pyclothoids import Clothoid
    except ImportError:
        return None
    numbers, lengths = np.full((len(angles), 2), np.nan), np.full(len(angles), np.nan)
    rows = angles.tolist()
    start = time.perf_counter()
    made = []
    for a, b in rows:
        try:
            made.append(Clothoid.G1Hermite(0.0, 0.0, a, 1.0, 0.0, b))
        except (RuntimeError, ValueError):
            made.append(None)
    elapsed = time.perf_counter() - start
    for i, curve in enumerate(made):
        if curve is not None:
            numbers[i], lengths[i] = (curve.KappaStart, curve.dk), curve.length
    return elapsed, numbers, lengths


def spline_time(points: int, repeats: int = 3) -> float:
    """Least seconds of `repeats` for the joints of an Euler spiral spline through points of a wandering line."""
    random = np.random.default_rng(points)
    steps = np.exp(1j * np.cumsum(random.uniform(-0.6, 0.6, points)))
    z = np.cumsum(steps)
    problem = joint_problem(np.stack([z.real, z.imag], axis=1), False)
    best = math.inf
    for _ in range(repeats):
        start = time.perf_counter()
        solution = solve_joints(problem, EulerSpirals())
        best = min(best, time.perf_counter() - start)
        assert solution.status == "converged", solution.status
    return best


def run() -> list[dict[str, object]]:
    """Rows of the table: what, ours_s, peer, peer_s, ratio, note."""
    angles = random_ends(COUNT)
    elapsed, numbers, lengths = ours(angles)
    miss = worst_miss(angles, numbers, lengths)
    other = peer(angles)
    if other is None:
        note, peer_s = f"pyclothoids is not installed; our greatest miss {miss.max():.1e}", None
    else:
        theirs = worst_miss(angles, other[1], other[2])
        failed = ~(theirs < 1e-6)
        note = (
            f"greatest miss {miss.max():.1e}, median {np.median(miss):.1e}; pyclothoids' {np.nanmax(theirs[~failed]):.1e}, "
            f"{np.median(theirs[~failed]):.1e}; it fails on {int(failed.sum()):,}"
        )
        peer_s = other[0]
    rows: list[dict[str, object]] = [
        {
            "what": f"Euler spiral between two tangents, {COUNT:,}, one thread",
            "ours_s": elapsed,
            "peer": "pyclothoids, a Python loop over C++" if other else "–",
            "peer_s": peer_s,
            "ratio": None if peer_s is None else peer_s / elapsed,
            "note": note,
        }
    ]
    spline_time(100, 1)
    base = spline_time(1000)
    for points in (1000, 10_000, 100_000):
        elapsed = base if points == 1000 else spline_time(points)
        rows.append(
            {
                "what": f"Euler spiral spline through {points:,} points, angles and curvatures",
                "ours_s": elapsed,
                "peer": "–",
                "peer_s": None,
                "ratio": None,
                "note": f"{1e6 * elapsed / points:.1f} µs a point",
            }
        )
    return rows
