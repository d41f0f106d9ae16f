"""Constrained splines (four-parameter segments) of 100 to 100,000 points: seconds, and the order at which they grow.

The points wander (turning angles up to 0.6, chords from 0.67 to 1.5) or go once around; all are of type `o`, or all of
type `c`. Below, how random paths of 3 to 30 points end.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from batten.splines.constrained_spline import constrained_spline

SIZES = (100, 1_000, 10_000, 100_000)


def wandering(n: int, turns: float, spread: float, seed: int = 0) -> np.ndarray:
    """Points (n, 2) with random turning angles up to `turns` and chords of exp(±spread)."""
    random = np.random.default_rng(seed)
    direction, size = np.cumsum(random.uniform(-turns, turns, n)), np.exp(random.uniform(-spread, spread, n))
    return np.cumsum(np.stack([size * np.cos(direction), size * np.sin(direction)], axis=1), axis=0)


def circuit(n: int) -> np.ndarray:
    """Points (n, 2) once around, at uneven distances from the middle and from each other."""
    random = np.random.default_rng(1)
    angle = 2.0 * np.pi * (np.arange(n) + random.uniform(-0.3, 0.3, n)) / n
    radius = 1.0 + random.uniform(-0.5, 0.5, n) / n
    return radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def spline_time(points: np.ndarray, types: str, repeats: int = 3) -> tuple[float, int, float]:
    """Least seconds of `repeats`, Newton steps and residual; what is not solved as asked is no result."""
    best = np.inf
    for _ in range(repeats):
        start = time.perf_counter()
        found = constrained_spline(points, types)
        best = min(best, time.perf_counter() - start)
    assert found.status == "converged", found.message
    return best, found.iterations, found.residual


def shares(count: int, turns: float | None, letters: str) -> dict[str, int]:
    """How `count` random paths of 3 to 30 points end, without relaxing; `turns` None: points uniform in a square."""
    random = np.random.default_rng(11)
    found: dict[str, int] = {"converged": 0, "higher winding": 0, "not converged": 0}
    for i in range(count):
        n = int(random.integers(3, 31))
        points = random.uniform(0.0, 1.0, (n, 2)) if turns is None else wandering(n, turns, 1.0, i)
        types = "".join(random.choice(list(letters), n))
        types = types + "z" if random.integers(2) else "{" + types[1:-1] + "}"
        found[constrained_spline(points, types, relax=False).status] += 1
    return found


def run() -> list[dict[str, Any]]:
    """A row for each size, and one for each kind of random path; nobody is compared with."""
    constrained_spline([[0, 0], [1, 1], [2, 0]], "{o}")  # compiled, or read from the cache
    rows: list[dict[str, Any]] = []
    for name, points_of, types_of in (
        ("o, open", lambda n: wandering(n, 0.6, 0.4), lambda n: "{" + "o" * (n - 2) + "}"),
        ("o, closed", circuit, lambda n: "o" * n + "z"),
        ("c, open", lambda n: wandering(n, 0.6, 0.4), lambda n: "{" + "c" * (n - 2) + "}"),
    ):
        before = 0.0
        for n in SIZES:
            took, steps, residual = spline_time(points_of(n), types_of(n), 3 if n < SIZES[-1] else 1)
            order = f", order {np.log10(took / before):.2f}" if before else ""
            note = f"{1e6 * took / n:.1f} µs each, {steps} steps, residual {residual:.0e}{order}"
            rows.append(_row(f"constrained spline of {n:,} points, {name}", took, note))
            before = took
    for turns, letters in ((1.2, "o"), (1.2, "ooccv[]"), (None, "o"), (None, "ooccv[]")):
        what = "uniform in a square" if turns is None else f"turns up to {turns}"
        start = time.perf_counter()
        found = shares(100, turns, letters)
        took = (time.perf_counter() - start) / 100
        note = ", ".join(f"{count} % {status}" for status, count in found.items())
        rows.append(_row(f"random path, {what}, types of {letters}", took, note))
    return rows


def _row(what: str, ours: float, note: str) -> dict[str, Any]:
    return {"what": what, "ours_s": ours, "peer": "nobody", "peer_s": None, "ratio": None, "note": note}
