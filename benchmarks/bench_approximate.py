"""Curves by pieces of elastica: seconds for random splines, by continuity, and for a fine tolerance.

Nobody else draws curves by elastica; what halving needs is in the notes, so that the time can be set against what it saves.
"""

from __future__ import annotations

import time

import numpy as np

from batten.curves.bspline import BSplineCurve
from batten.splines.approximate import Continuity, approximate

COUNT = 20


def random_spline(seed: int) -> BSplineCurve:
    """A cubic spline through 4 to 9 points of a random walk."""
    steps = np.random.default_rng(seed).normal(size=(4 + seed % 6, 2))
    return BSplineCurve.interpolate(steps.cumsum(axis=0))


def spent(seeds: range, tolerance: float, continuity: Continuity) -> tuple[float, int, int]:
    """Median seconds of a curve, pieces of all, and pieces of all by halving; the tolerance is relative to the length."""
    seconds, pieces, halves = [], 0, 0
    for seed in seeds:
        curve = random_spline(seed)
        start = time.perf_counter()
        found = approximate(curve, tolerance * curve.length, continuity=continuity)
        seconds.append(time.perf_counter() - start)
        assert found.status == "converged", (seed, found.status)
        assert len(found.pieces) <= found.bisect_pieces, seed
        pieces, halves = pieces + len(found.pieces), halves + found.bisect_pieces
    return float(np.median(seconds)), pieces, halves


def run() -> list[dict[str, object]]:
    """Rows of the table: what, ours_s, peer, peer_s, ratio, note."""
    approximate(random_spline(0), 0.1, continuity="C2")  # compiled, or read from the cache
    rows: list[dict[str, object]] = []
    cases: list[tuple[range, float, Continuity]] = [
        (range(COUNT), 1e-3, "C0"), (range(COUNT), 1e-3, "C1"), (range(COUNT), 1e-3, "C2"), (range(3), 1e-6, "C2"),
    ]  # fmt: skip
    for seeds, tolerance, continuity in cases:
        seconds, pieces, halves = spent(seeds, tolerance, continuity)
        rows.append(
            {
                "what": f"curve by elastica, {continuity[0]}{'⁰¹²'[int(continuity[1])]}, within {tolerance:g} of its length",
                "ours_s": seconds,
                "peer": "–",
                "peer_s": None,
                "ratio": None,
                "note": f"median of {len(seeds)}; {pieces} pieces, by halving {halves}",
            }
        )
    return rows


if __name__ == "__main__":
    for row in run():
        print(row)
