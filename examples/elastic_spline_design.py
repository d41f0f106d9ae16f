"""The pictures of "draw with Béziers, build with rods": good regions of control points, and a design in blocks.

python examples/elastic_spline_design.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline

from batten.curves.cubic_proxy import Border
from batten.solvers.good_region import GoodRegion
from batten.splines.elastic_spline_design import ElasticSplineDesign

EXAMPLES = Path(__file__).resolve().parent
INK, SOFT, ROD, REGION, ACTIVE = "#1c2733", "#8b97a3", "#2f8f4e", "#f2b8a0", "#d24a12"
DPI = 110
BLOCKS = [Border.vertical(x) for x in (0.0, 400.0, 800.0, 1200.0)]
#: The moves of the design: control point and where it shall go; what is too far is clamped.
MOVES = (
    (0, (0, -60)), (1, (130, 160)), (2, (300, 210)), (4, (520, 20)), (5, (690, -190)), (6, (900, -120)), (7, (1080, 240)),
    (1, (110, 240)), (2, (290, 260)),
)  # fmt: skip


def draw_region(axes: Axes, region: GoodRegion) -> None:
    """Polygons with their holes; intervals as thick lines."""
    for polygon in region.polygons:
        rings = [np.concatenate([ring, ring[:1]]) for ring in (polygon.outer, *polygon.holes)]
        codes = [[Outline.MOVETO] + [Outline.LINETO] * (len(r) - 2) + [Outline.CLOSEPOLY] for r in rings]
        outline = Outline(np.concatenate(rings), np.concatenate(codes))
        axes.add_patch(PathPatch(outline, facecolor=REGION, edgecolor=ACTIVE, lw=1.0, alpha=0.75, zorder=1))
    for interval in region.intervals:
        axes.plot(*interval.T, color=REGION, lw=7.0, solid_capstyle="round", zorder=1)


def draw_design(axes: Axes, design: ElasticSplineDesign, active: int | None = None) -> None:
    """The proxy with its control polygon, the rods in green, the borders dashed."""
    points = design.control_points
    axes.plot(*points.T, color=SOFT, lw=0.8, zorder=2)
    axes.plot(*points.T, "o", ms=5.0, mfc="white", mec=SOFT, zorder=4)
    axes.plot(*design.proxy.point(np.linspace(0.0, 1.0, 601)).T, color=INK, lw=1.2, zorder=3)
    for rod in design.elastica("joined").elastica:
        if rod is not None:
            axes.plot(*rod.point(np.linspace(0.0, 1.0, 201)).T, color=ROD, lw=3.2, alpha=0.7, zorder=2.5)
    joints = design.proxy.joints
    axes.plot(*joints.T, "s", ms=4.5, color=INK, zorder=5)
    for border in design.borders or ():
        if border is not None:
            axes.axvline(border.point[0], color=SOFT, lw=0.9, ls=(0, (5, 4)), zorder=0)
    if active is not None:
        axes.plot(*points[active], "o", ms=8.0, color=ACTIVE, zorder=6)


def finish(figure: Figure, path: Path) -> None:
    """Write the picture."""
    for axes in figure.axes:
        axes.set_aspect("equal")
        axes.set_axis_off()
    figure.tight_layout()
    figure.savefig(path)


def good_regions(path: Path) -> None:
    """One spline of class C¹ and one of class C², and where their active points can be."""
    figure = Figure(figsize=(11.0, 7.4), dpi=DPI)
    FigureCanvasAgg(figure)
    heights = {1: (0, 120, 190, 60, -30, -150, -90, 0), 2: (0, 90, 170, -150, -80, 0)}
    for continuity, active, axes in ((1, 3, (figure.subplots(1, 2))[0]), (2, 3, figure.axes[1])):
        line = ElasticSplineDesign.line((0, 0), (1200, 0), 3, continuity=continuity)
        points = np.column_stack([line.control_points[:, 0], heights[continuity]])
        design = ElasticSplineDesign.from_control_points(points, continuity=continuity)
        region = design.good_region(active)
        draw_region(axes, region)
        draw_design(axes, design, active)
        axes.set(xlim=(-40, 1240), ylim=(-800, 700))
        worst = design.residuals.max()
        axes.set_title(
            f"C{'¹²'[continuity - 1]}: λ-residuals up to {worst:.2f}, rods within "
            f"{100.0 * design.elastica().greatest_distance / design.proxy.length:.2f} % of the length",
            fontsize=9, color=INK,
        )  # fmt: skip
    finish(figure, path)


def a_design(path: Path) -> None:
    """A straight line in three blocks becomes an elastic spline; with the good region before the last move."""
    design = ElasticSplineDesign.line((0, 0), (1200, 0), 3, borders=BLOCKS)
    figure = Figure(figsize=(9.0, 8.6), dpi=DPI)
    FigureCanvasAgg(figure)
    rows = figure.subplots(3, 1, height_ratios=(1, 4, 4))
    draw_design(rows[0], design)
    rows[0].set_title("a line in three blocks", fontsize=9, color=INK, loc="left")
    clamped = 0
    for index, target in MOVES[:-1]:
        clamped += design.move(index, target, outside="clamp").outcome == "clamped"
    index, target = MOVES[-1]
    draw_region(rows[1], design.good_region(index))
    draw_design(rows[1], design, index)
    rows[1].set_title(
        f"after {len(MOVES) - 1} moves, {clamped} of them clamped: the good region of a point beside a border",
        fontsize=9, color=INK, loc="left",
    )  # fmt: skip
    design.move(index, target, outside="clamp")
    design.insert(1)
    draw_design(rows[2], design)
    rods = design.elastica()
    rows[2].set_title(
        f"the point moved, the middle piece divided: λ-residuals {', '.join(f'{e:.2f}' for e in design.residuals)}; "
        f"rods within {rods.greatest_distance:.1f} mm, turns below "
        f"{np.degrees(np.abs(rods.turns).max()):.1f}°",
        fontsize=9, color=INK, loc="left",
    )  # fmt: skip
    for axes in rows:
        axes.set(xlim=(-60, 1260), ylim=(-260, 330))
    rows[0].set_ylim(-90, 90)
    finish(figure, path)


def main(folder: Path) -> None:
    """Draw both pictures into a folder."""
    good_regions(folder / "good-region.png")
    a_design(folder / "good-region-design.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else EXAMPLES.parent / "docs/pictures")
