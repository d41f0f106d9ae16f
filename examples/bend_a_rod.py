"""The pictures of docs/bend-a-rod.md, drawn by batten: every shape between two grippers, and a rod that snaps.

python examples/bend_a_rod.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from batten.fabrication.rod import Rod
from batten.io.bend_files import write_bend
from batten.io.bend_numbers import BendProblem
from batten.io.rod_file import load_rod
from batten.solvers.boundary_value import solve_boundary, solve_boundary_batch
from batten.solvers.track import track_boundary

EXAMPLES = Path(__file__).resolve().parent
INK, SOFT, STABLE, UNSTABLE, SNAP = "#1c2733", "#66727f", "#1f5fa8", "#b9c3cc", "#d24a12"
DPI = 110


def every_shape(path: Path) -> None:
    """`batten bend --start 0,0,30deg --end 800,0,-10deg --rod examples/bend/rod.toml --max-inflections 4 -o bend.png`."""
    rod: Rod = load_rod(EXAMPLES / "bend/rod.toml")
    ends = ((0.0, 0.0), np.radians(30.0), (800.0, 0.0), np.radians(-10.0))
    problem = BendProblem(*ends, rod.length_mm)
    write_bend(problem, solve_boundary(*ends, rod.length_mm, max_inflections=4), path, rod=rod)


def the_snap(path: Path, turns: int = 241) -> None:
    """A flat rod with 20 % of slack, bowed up, while its right end is turned: energies of all shapes, and the way of one."""
    figure = Figure(figsize=(11.0, 4.4), dpi=DPI)
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2, width_ratios=(1.15, 1.0))
    angles = np.linspace(-2.0, 2.0, turns)
    batch = solve_boundary_batch((0.0, 0.0), 0.0, (0.8, 0.0), angles, 1.0, max_inflections=5)
    stable = batch.margin > 1.0
    x = np.degrees(np.broadcast_to(angles[:, None], batch.energy.shape))
    left.plot(x[stable], batch.energy[stable], ".", color=STABLE, ms=3.0, label="stable")
    left.plot(x[~stable & (batch.inflections >= 0)], batch.energy[~stable & (batch.inflections >= 0)], ".", color=UNSTABLE,
              ms=3.0, label="unstable", zorder=1)  # fmt: skip
    up = max((s.elastica for s in solve_boundary((0, 0), 0.0, (0.8, 0), 0.0, 1.0)), key=lambda e: e.start_curvature)
    way = np.linspace((0, 0, 0, 0.8, 0, 0), (0, 0, 0, 0.8, 0, 2.0), 41)
    states = track_boundary(way, 1.0, solution=up)
    snap = next(s.snap for s in states if s.snap is not None)
    at, high, low = np.degrees(snap.pose[5]), snap.before.bending_energy(), snap.after.bending_energy()
    left.annotate("", (at, low), (at, high), arrowprops={"arrowstyle": "-|>", "color": SNAP, "lw": 2.0})
    left.annotate(
        f"fold at {at:.1f}°: the rod snaps,\n∫κ² falls by {snap.energy_released:.1f}",
        (at, low),
        (at + 10, low - 9.0),
        color=SNAP,
    )
    left.set(xlabel="turn of the right end, degrees", ylabel="∫κ² ds · L", ylim=(0, 72), xlim=(-115, 115))
    left.legend(loc="upper left", frameon=False, markerscale=3)
    for state in states[:: max(1, len(states) // 14)]:
        if state.elastica.point_at(0.5)[1] > -0.05:
            right.plot(*state.elastica.point(np.linspace(0, 1, 201)).T, color=STABLE, lw=0.8, alpha=0.5)
    for elastica, colour, name in ((snap.before, STABLE, "at the fold"), (snap.after, SNAP, "after the snap")):
        right.plot(*elastica.point(np.linspace(0, 1, 201)).T, color=colour, lw=2.6, label=name)
    right.plot([0, 0.8], [0, 0], "o", color=INK, ms=7)
    right.set_aspect("equal")
    right.set_axis_off()
    right.legend(loc="upper right", frameon=False)
    for axes in (left,):
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color="#e6eaee", lw=0.6)
    figure.tight_layout()
    figure.savefig(path)


def main(folder: Path) -> None:
    """Draw both pictures into a folder."""
    every_shape(folder / "bend.png")
    the_snap(folder / "snap.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else EXAMPLES.parent / "docs/pictures")
