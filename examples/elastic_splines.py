"""The pictures of "elastic splines": rods through the same points held in four ways, and the jump that a design prevents.

python examples/elastic_splines.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from batten.curves.bezier import CubicBezier
from batten.splines.elastic_spline import ElasticSpline, elastic_spline

EXAMPLES = Path(__file__).resolve().parent
INK, SOFT, ROD, PUSH, OTHER = "#1c2733", "#8b97a3", "#1f6fb2", "#d24a12", "#2f8f4e"
POINTS = [(0, 0), (1, 0.5), (2, -0.1), (3, 0.3)]
START, END = 0.9, 0.6
ARROW = 0.07  # length of the line for a reaction of 1
#: The height of both inner control points of a design over its chord, before and after the small change.
HEIGHTS = (0.02, -0.02)


def four_ways() -> list[tuple[str, ElasticSpline]]:
    """The same points: tangents at every point; held at marked places, sliding, and as long as the energy likes."""
    return [
        ("C¹, a tangent at every point", elastic_spline(POINTS, tangents=[START, -0.3, -0.3, END])),
        ("C², pinned: lengths 1.3, 1.2, 1.1", elastic_spline(POINTS, START, END, lengths=[1.3, 1.2, 1.1])),
        ("C², sliding: 3.6 in all", elastic_spline(POINTS, START, END, 3.6)),
        ("C², any length", elastic_spline(POINTS, START, END)),
    ]


def draw_rod(axes: Axes, spline: ElasticSpline, colour: str = ROD) -> None:
    """The rod, its points, and what the supports push with, a line that ends in the point."""
    axes.plot(*spline.curve.point(np.linspace(0.0, 1.0, 401)).T, color=colour, lw=2.0, zorder=3)
    for point, push in zip(spline.points, spline.reactions):
        tail = point - ARROW * push
        axes.plot(*np.stack([tail, point]).T, color=PUSH, lw=1.6, zorder=2)
    axes.plot(*spline.points.T, "o", ms=5.0, mfc="white", mec=INK, zorder=4)


def held_ways(path: Path) -> None:
    """Four rods through four points, with the forces of their supports."""
    whole = Figure(figsize=(9.6, 4.9), layout="constrained")
    FigureCanvasAgg(whole)
    for axes, (title, spline) in zip(whole.subplots(2, 2, sharex=True, sharey=True).flat, four_ways()):
        draw_rod(axes, spline)
        axes.set_title(f"{title}\nlength {spline.length:.2f}, ∫κ² ds {spline.energy:.2f}", size=10)
        axes.set_aspect("equal")
        axes.set_xlim(-0.55, 3.5)
        axes.set_ylim(-0.5, 0.95)
        axes.axis("off")
    whole.savefig(path, dpi=100)


def designs() -> list[CubicBezier]:
    """Two designs that differ little: end tangents turn from slightly up to slightly down."""
    return [CubicBezier([(0, 0), (0.33, h), (0.67, h), (1, 0)]) for h in HEIGHTS]


def jump(path: Path) -> None:
    """As Fisker2018 Fig. 5.4: the shapes of least energy for two designs, and the second one followed from the first."""
    ends, length = [(0, 0), (1, 0)], 1.2
    whole = Figure(figsize=(9.6, 3.3), layout="constrained")
    FigureCanvasAgg(whole)
    before: ElasticSpline | None = None
    for axes, design in zip(whole.subplots(1, 2, sharex=True, sharey=True), designs()):
        (dx, dy), (ex, ey) = design.derivative([0.0, 1.0])
        tangents = [float(np.arctan2(dy, dx)), float(np.arctan2(ey, ex))]
        least = elastic_spline(ends, tangents=tangents, lengths=[length])
        axes.plot(*design.point(np.linspace(0.0, 1.0, 101)).T, color=INK, lw=1.2, label="design")
        axes.plot(*least.curve.point(np.linspace(0.0, 1.0, 201)).T, color=PUSH, lw=2.0, label="least energy")
        if before is not None:
            kept = elastic_spline(ends, tangents=tangents, lengths=[length], design=before)
            axes.plot(
                *kept.curve.point(np.linspace(0.0, 1.0, 201)).T, color=OTHER, lw=2.0, label="design = the rod before"
            )
        before = least
        axes.set_title(f"end tangents {np.degrees(tangents[0]):+.1f}°, {np.degrees(tangents[1]):+.1f}°", size=10)
        axes.set_aspect("equal")
        axes.axis("off")
    whole.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=9, frameon=False)
    whole.savefig(path, dpi=100)


if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else EXAMPLES.parent / "docs/pictures")
    held_ways(folder / "elastic-splines.png")
    jump(folder / "elastic-spline-jump.png")
