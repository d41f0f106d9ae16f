"""Random samples of cubics: curves per second and core, and what a second core gives."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from batten.measures.lambda_residual import lambda_residual
from batten.studies import study as frame
from batten.studies.projection import STUDY as PROJECTION
from batten.studies.random_sample import STUDY as RANDOM
from batten.studies.study import Study

SIZES = {"random": 2_000_000, "projection": 400_000}


def seconds(study: Study[Any], size: int, workers: int) -> float:
    """The least of two runs."""
    times = []
    for _ in range(2):
        begin = time.perf_counter()
        frame.run(study, size, 0, workers=workers)
        times.append(time.perf_counter() - begin)
    return min(times)


def run() -> list[dict[str, Any]]:
    rows = []
    studies: tuple[Study[Any], ...] = (RANDOM, PROJECTION)
    for study in studies:
        size = SIZES[study.name]
        frame.run(study, 2 * study.part_size, 1)  # compiled
        one, two = (seconds(study, size, workers) for workers in (1, 2))
        rows.append(
            {
                "what": f"batten study {study.name}, {size:,} cubics, two threads",
                "ours_s": two,
                "peer": "the same on one thread",
                "peer_s": one,
                "ratio": one / two,
                "note": f"{size / one:,.0f} curves per second and core",
            }
        )
    curves = np.random.default_rng(0).uniform(-1.0, 1.0, (1_000_000, 4, 2))
    begin = time.perf_counter()
    lambda_residual(curves)
    rows.append(
        {
            "what": "λ-residual alone, 1,000,000 cubics, one core",
            "ours_s": time.perf_counter() - begin,
            "peer": "–",
            "peer_s": None,
            "ratio": None,
            "note": "what such a sample costs at least",
        }
    )
    return rows
