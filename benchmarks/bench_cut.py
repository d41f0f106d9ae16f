"""The main job as a person starts it: whole processes of `batten`, wall-clock, the median of several runs.

No other program does this job, so there is no peer. The cold run has an empty folder of compiled kernels, as a fresh
installation has.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
JOB = ROOT / "examples" / "freeform-wall" / "wall.toml"


def _seconds(arguments: list[str], **environment: str) -> float:
    command = [sys.executable, "-m", "batten.cli.main", *arguments]
    start = time.perf_counter()
    done = subprocess.run(
        command, cwd=ROOT, env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} ended with {done.returncode}: {done.stderr}")
    return time.perf_counter() - start


def _row(what: str, runs: list[float], note: str) -> dict[str, Any]:
    return {"what": what, "ours_s": statistics.median(runs), "peer": "–", "peer_s": None, "ratio": None, "note": note}


def run() -> list[dict[str, Any]]:
    """Rows for the command's help, and for the example's job cold and warm."""
    with tempfile.TemporaryDirectory() as folder:
        out, cache = f"{folder}/out", f"{folder}/cache"
        job = ["cut", str(JOB), "-o", out]
        cold = _seconds(job, NUMBA_CACHE_DIR=cache)
        warm = [_seconds([*job, "--no-pictures"], NUMBA_CACHE_DIR=cache) for _ in range(5)]
        pictures = [_seconds(job, NUMBA_CACHE_DIR=cache) for _ in range(3)]
        again = [_seconds(["check", out], NUMBA_CACHE_DIR=cache) for _ in range(3)]
    answer = [_seconds(["--help"]) for _ in range(5)]
    spread = f"{min(warm):.2f} to {max(warm):.2f} s"
    return [
        _row("`batten --help`", answer, "target 0.5 s"),
        _row(
            "`batten cut` on the example wall, warm, without pictures", warm, f"target 5 s; {len(warm)} runs, {spread}"
        ),
        _row("the same with pictures", pictures, ""),
        _row("the same cold: kernels compiled first", [cold], "target 45 s; one run"),
        _row("`batten check` on its folder", again, ""),
    ]


if __name__ == "__main__":
    for row in run():
        print(f"{row['what']}: {row['ours_s']:.2f} s ({row['note']})")
