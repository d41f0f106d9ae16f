"""Good regions of control points of random splines: how long a designer waits for one, on one core.

What would be taken instead, the look-up in a database of 385,000 cubics, has its own benchmark.
"""

from __future__ import annotations

import time

import numpy as np

from batten.curves.cubic_proxy import CubicProxy
from batten.solvers.good_region import good_region

COUNT = 100


def random_proxy(rng: np.random.Generator, continuity: int, pieces: int = 4, noise: float = 0.12) -> CubicProxy:
    """A winding spline with noise on its control points, in units of a piece's length."""
    line = CubicProxy.line((0, 0), (pieces, 0), pieces, continuity)
    turns = np.cumsum(rng.normal(0.0, 0.6, pieces + 1))
    points = line.control_points + noise * rng.standard_normal(line.control_points.shape)
    angle = np.interp(points[:, 0], np.arange(pieces + 1), turns)
    x, y = np.diff(points, axis=0, prepend=points[:1]).T
    steps = np.stack([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)], axis=-1)
    return CubicProxy(np.cumsum(steps, axis=0), continuity)


def times(continuity: int, count: int = COUNT, seed: int = 1) -> np.ndarray:
    """Seconds of the processor for the good region of a random control point, for each of `count` random splines."""
    rng = np.random.default_rng(seed)
    good_region(random_proxy(rng, continuity), 1)  # compiled, or read from the cache, before anything is timed
    out = np.empty(count)
    for k in range(count):
        proxy = random_proxy(rng, continuity)
        index = int(rng.integers(len(proxy.control_points)))
        start = time.process_time()
        good_region(proxy, index)
        out[k] = time.process_time() - start
    return out


def run() -> list[dict[str, object]]:
    """Rows of the table: what, ours_s, peer, peer_s, ratio, note."""
    rows: list[dict[str, object]] = []
    for continuity, promised in ((1, 8.0), (2, 20.0)):
        found = times(continuity)
        rows.append(
            {
                "what": f"good region of a control point, C{'¹²'[continuity - 1]} spline, resolution 1 %",
                "ours_s": float(np.median(found)),
                "peer": "–",
                "peer_s": None,
                "ratio": None,
                "note": f"median of {COUNT}; 90 % below {1e3 * np.quantile(found, 0.9):.0f} ms; aim {promised:.0f} ms",
            }
        )
    return rows


if __name__ == "__main__":
    for row in run():
        print(row)
