"""The simulated cut: whole processes, and the following of one block's rod against scipy's solver of boundary values.

The peer solves the same elastica, θ″ = force × tangent with its two forces as parameters, by `scipy.integrate.solve_bvp`,
station after station, each from the solution before; to 1e-6, where batten goes to 1e-12.
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

import numpy as np
from scipy.integrate import solve_bvp

from batten.fabrication.robot.cell import cell_from_job
from batten.fabrication.simulation import RodSweep, held_ends, interpolated_poses, sweep_rods
from batten.io.cut_json import read_cut_json
from batten.io.simulation_paths import read_rod_paths

ROOT = Path(__file__).parent.parent
JOB = ROOT / "examples" / "freeform-wall" / "wall.toml"
BLOCK = 13


def _command(words: list[str]) -> float:
    command = [sys.executable, "-m", "batten.cli.main", *words]
    start = time.perf_counter()
    done = subprocess.run(command, cwd=ROOT, env=os.environ, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        raise RuntimeError(f"{' '.join(command)} ended with {done.returncode}: {done.stderr}")
    return time.perf_counter() - start


def _best(work: Any, times: int = 3) -> float:
    spent = []
    for _ in range(times):
        start = time.perf_counter()
        work()
        spent.append(time.perf_counter() - start)
    return min(spent)


def _by_scipy(sweep: RodSweep, length: float) -> tuple[float, float]:
    """Seconds for all stations of a sweep, and how far its curves lie from batten's at most, mm."""
    held = held_ends(*interpolated_poses(sweep.path, sweep.move, sweep.share))
    s = np.linspace(0.0, 1.0, 41)
    first = sweep.parameters[0]
    guess = np.zeros((4, len(s)))
    guess[2] = first[2] + (held.pose[0, 5] - first[2]) * s
    guess[0] = held.pose[0, 3] / length * s
    force = np.zeros(2)
    off = 0.0

    def slope(s: Any, y: Any, p: Any) -> Any:
        return np.stack([np.cos(y[2]), np.sin(y[2]), y[3], np.cos(y[2]) * p[1] - np.sin(y[2]) * p[0]])

    wanted = sweep.points(s)
    start = time.perf_counter()
    shapes = []
    for pose in held.pose:
        goal = np.array([0.0, 0.0, pose[2], pose[3] / length, 0.0, pose[5]])

        def miss(a: Any, b: Any, p: Any, goal: Any = goal) -> Any:
            return np.array([*(a[:3] - goal[:3]), *(b[:3] - goal[3:])])

        found = solve_bvp(slope, miss, s, guess, p=force, tol=1e-6, max_nodes=5000)
        guess, force = found.sol(s), found.p
        shapes.append(guess[:2].T * length)
    spent = time.perf_counter() - start
    for k, shape in enumerate(shapes):
        lie = sweep.origin[k] + shape[:, :1] * sweep.frame[k, 0] + shape[:, 1:] * sweep.frame[k, 1]
        off = max(off, float(np.abs(lie - wanted[k]).max()))
    return spent, off


def run() -> list[dict[str, Any]]:
    """Rows for cut and simulation of the example, for following, and for ten times the stations."""
    with tempfile.TemporaryDirectory() as folder:
        out = f"{folder}/out"
        cut = [_command(["cut", str(JOB), "-o", out]) for _ in range(2)][1]
        simulated = [_command(["simulate", out]) for _ in range(3)]
        stored = read_cut_json(Path(out) / "cut.json")
        paths = read_rod_paths(Path(out) / "rapid", cell_from_job(stored.job.cell))
    length = stored.job.rod.length_mm
    one = [p for p in paths if p.block == BLOCK]
    (sweep,) = sweep_rods(one, length)
    ours = _best(lambda: sweep_rods(one, length))
    peer, off = _by_scipy(sweep, length)
    everything = _best(lambda: sweep_rods(paths, length))
    stations = sum(len(s.move) for s in sweep_rods(paths, length))
    ten = _best(lambda: sweep_rods(paths, length, step_mm=0.5), 1)
    more = sum(len(s.move) for s in sweep_rods(paths, length, step_mm=0.5))
    alone: dict[str, Any] = {"peer": "–", "peer_s": None, "ratio": None}
    both = cut + statistics.median(simulated)
    return [
        {"what": "cut and simulation of the example wall, warm", "ours_s": both, **alone, "note": "target 20 s"},
        {
            "what": "`batten simulate` of it",
            "ours_s": statistics.median(simulated),
            **alone,
            "note": "median of 3 runs",
        },
        {
            "what": f"one block's rod followed, {len(sweep.move)} stations",
            "ours_s": ours,
            "peer": "scipy solve_bvp",
            "peer_s": peer,
            "ratio": peer / ours,
            "note": f"curves agree to {off:.1e} mm",
        },
        {"what": f"all blocks, {stations} stations", "ours_s": everything, **alone, "note": ""},
        {
            "what": f"the same, {more} stations",
            "ours_s": ten,
            **alone,
            "note": f"{ten / everything:.1f} times as long for {more / stations:.1f} times as many",
        },
    ]


if __name__ == "__main__":
    for row in run():
        print(f"{row['what']}: {row['ours_s']:.3g} s, {row['peer']} {row['peer_s']} ({row['note']})")
