"""The good region of a control point of a C¹ spline: computed by batten, and looked up in the papers' database.

The peer is what the thesis did, as one would write it with scipy: KD-trees over the 391,000 rows in place of its linear
search, matches brought back to the spline, α-shapes by a Delaunay triangulation. Building the database and its trees is not
counted. The two regions are not the same: `batten study regions` says how much they differ.
"""

from __future__ import annotations

import time

import numpy as np
from bench_good_region import random_proxy

from batten.curves.cubic_proxy import CubicProxy
from batten.solvers.good_region import good_region
from batten.solvers.good_region_database import GoodRegionDatabase, build_good_region_database, database_region
from batten.studies.regions import random_splines

COUNT = 100
THESIS_RADIUS = 0.26


def inputs(count: int = COUNT, seed: int = 1) -> list[tuple[CubicProxy, int]]:
    """Random C¹ splines of three pieces close to elastica, with a control point each."""
    rng = np.random.default_rng(seed)
    control = random_splines(count, rng)
    return [(CubicProxy(points), int(index)) for points, index in zip(control, rng.integers(0, 8, count))]


def noisy_inputs(count: int = COUNT, seed: int = 1) -> list[tuple[CubicProxy, int]]:
    """The C¹ splines of bench_good_region, which are not all close to elastica, with a control point each."""
    rng = np.random.default_rng(seed)
    random_proxy(rng, 1)
    proxies = ((random_proxy(rng, 1), rng) for _ in range(count))
    return [(proxy, int(r.integers(len(proxy.control_points)))) for proxy, r in proxies]


def database_seconds(
    database: GoodRegionDatabase, cases: list[tuple[CubicProxy, int]], search_radius: float | None = None
) -> np.ndarray:
    """Seconds of the processor for the database's region of each case, the second of two runs."""
    return _seconds(lambda proxy, index: database_region(database, proxy, index, search_radius=search_radius), cases)


def _seconds(function, cases: list[tuple[CubicProxy, int]]) -> np.ndarray:
    out = np.empty(len(cases))
    for i, (proxy, index) in enumerate(cases):
        function(proxy, index)
        start = time.process_time()
        function(proxy, index)
        out[i] = time.process_time() - start
    return out


def linear_seconds(database: GoodRegionDatabase, cases: list[tuple[CubicProxy, int]]) -> np.ndarray:
    """Seconds for the thesis's linear search alone: the distances of all rows to a place, twice for the mirror image."""
    places = database.points["c2"]

    def search(proxy: CubicProxy, index: int) -> None:
        for sign in (1.0, -1.0):
            off = places - np.array([0.4 * sign, 1.8])
            np.flatnonzero((off * off).sum(axis=1) < THESIS_RADIUS**2)

    return _seconds(search, cases)


def run() -> list[dict[str, object]]:
    """Rows of the table: what, ours_s, peer, peer_s, ratio, note."""
    start = time.process_time()
    database = build_good_region_database()
    built = time.process_time() - start
    cases = inputs()
    ours = np.median(_seconds(good_region, cases))
    near, wide = (np.median(database_seconds(database, cases, radius)) for radius in (None, THESIS_RADIUS))
    linear = np.median(linear_seconds(database, cases))
    noisy = noisy_inputs()
    ours_noisy, near_noisy = np.median(_seconds(good_region, noisy)), np.median(database_seconds(database, noisy))
    empty = np.mean([not database_region(database, proxy, index).polygons for proxy, index in noisy])
    rows = f"{len(database.rows):,} rows"
    return [
        {
            "what": f"good region of a control point, C¹ spline, median of {COUNT}",
            "ours_s": ours,
            "peer": f"the papers' database, {rows}, KD-tree and α-shape",
            "peer_s": near,
            "ratio": near / ours,
            "note": f"ours right to 1 % of the width; the database took {built:.0f} s to build, not counted",
        },
        {
            "what": f"good region of a control point, C¹ spline, median of {COUNT}",
            "ours_s": ours,
            "peer": f"the papers' database, {rows}, search radius {THESIS_RADIUS} as in the thesis's program",
            "peer_s": wide,
            "ratio": wide / ours,
            "note": f"the thesis searches linearly, {1e3 * linear:.1f} ms more for each piece here",
        },
        {
            "what": f"the same on the C¹ splines of bench_good_region, median of {COUNT}",
            "ours_s": ours_noisy,
            "peer": f"the papers' database, {rows}, KD-tree and α-shape",
            "peer_s": near_noisy,
            "ratio": near_noisy / ours_noisy,
            "note": f"the database's region is empty in {empty:.0%} of the cases",
        },
    ]


if __name__ == "__main__":
    for row in run():
        print(row)
