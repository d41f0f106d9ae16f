"""The figure of the study of connected components: members, bottlenecks, the way to the mirror image, counts by level."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from batten.curves.bezier import CubicBezier
from batten.curves.elastica import Elastica
from batten.solvers.elastica_fit import fit_elastica_batch
from batten.studies.component_paths import control_points, residual
from batten.studies.components import LEVEL, LEVELS, ComponentStudy
from batten.typing import FloatArray

_BLUE, _RED, _GREY, _PALE = "#1f5fa8", "#d24a12", "#8795a1", "#d5dce2"
_T = np.linspace(0.0, 1.0, 200)


def figure(study: ComponentStudy) -> Figure:
    """Members of the component with their elastica, bodies and necks, the way over, counts against the level, whiskers."""
    drawing = Figure(figsize=(11.0, 9.6), layout="constrained")
    FigureCanvasAgg(drawing)
    upper, lower = np.asarray(drawing.subfigures(2, 1, height_ratios=(1.0, 1.15)))
    upper.suptitle("far apart, all in one component: curve and control polygon, nearest elastica dashed", size=10)
    for axes, inner in zip(upper.subplots(2, 4).flat, study.gallery):
        _member(axes, inner)
    panels = lower.subplots(2, 2)
    _bodies(panels[0, 0], study)
    _way_over(panels[0, 1], study)
    _counts(panels[1, 0], study)
    _whiskers(panels[1, 1], study)
    return drawing


def _member(axes: Axes, inner: FloatArray) -> None:
    control = control_points(inner)
    axes.plot(*control.T, color=_PALE, lw=1.0, marker="o", ms=3.0)
    axes.plot(*CubicBezier(control).point(_T).T, color=_BLUE, lw=1.8)
    parameters = fit_elastica_batch(control[None]).parameters[0]
    if np.isfinite(parameters).all():
        axes.plot(*Elastica.from_parameters(parameters).point(_T).T, color=_RED, lw=1.0, ls=(0, (4, 3)))
    axes.set_title(f"$e_\\lambda$ = {residual(inner):.3f}", size=9)
    _bare(axes)


def _bare(axes: Axes) -> None:
    axes.set_aspect("equal", adjustable="datalim")
    axes.axis("off")


def _bodies(axes: Axes, study: ComponentStudy) -> None:
    """Each body of the finest grid beside the neck that joins it to a thicker one."""
    grid = study.grids[-1]
    left = 0.0
    for k in range(len(grid.peaks)):
        shown = [(grid.peaks[k], _BLUE, grid.peak_clearances[k])]
        if k:
            shown.append((grid.necks[k], _RED, grid.neck_clearances[k]))
        for inner, colour, clearance in shown:
            points = CubicBezier(control_points(inner)).point(_T)
            low, high = points.min(axis=0), points.max(axis=0)
            points = points + np.array([left - low[0], -0.5 * (low[1] + high[1])])
            axes.plot(*points.T, color=colour, lw=1.8)
            middle = left + 0.5 * (high[0] - low[0])
            axes.annotate(
                f"{clearance:.2f}", (middle, points[:, 1].min()), (0, -3), textcoords="offset points", ha="center",
                va="top", size=8, color=colour,
            )  # fmt: skip
            left += high[0] - low[0] + 0.45
    axes.set_title("bodies (blue) and the necks (red) that join each to a thicker one;\nroom to the outside", size=10)
    axes.margins(0.03, 0.2)
    _bare(axes)


def _way_over(axes: Axes, study: ComponentStudy) -> None:
    way = study.paths[-1]
    share = np.linspace(0.0, 1.0, 41)
    fine = np.concatenate([a + share[:, None] * (b - a) for a, b in pairwise(way)])
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(fine, axis=0), axis=1)))
    length /= length[-1]
    axes.plot(length, residual(fine), color=_BLUE, lw=1.4)
    axes.axhline(LEVEL, color=_RED, lw=1.0)
    for place in np.linspace(0.03, 0.97, 9):
        k = int(np.argmin(np.abs(length - place)))
        points = CubicBezier(control_points(fine[k])).point(_T)
        inset = axes.inset_axes((place - 0.05, 0.3, 0.1, 0.46))
        inset.plot(*points.T, color=_GREY, lw=1.3)
        inset.set_xlim(-0.8, 1.8)
        inset.set_ylim(-1.4, 1.4)
        inset.set_aspect("equal")
        inset.axis("off")
    axes.set_ylim(0.0, 1.25 * LEVEL)
    axes.set_xticks([])
    axes.set_title("from the thickest place to its mirror image", size=10)
    axes.set_ylabel("$e_\\lambda$")
    axes.spines[["top", "right"]].set_visible(False)


def _counts(axes: Axes, study: ComponentStudy) -> None:
    for grid, shade in zip(study.grids, ("#c3cdd6", "#9fb0bf", "#6d8296")):
        name = f"grid of {grid.size[0]}, as it is"
        axes.plot(LEVELS, [grid.on_grid(level) for level in LEVELS], color=shade, lw=1.2, marker="o", ms=3, label=name)
        joined = [grid.components(level)[0] for level in LEVELS]
        axes.plot(LEVELS, joined, color=_BLUE, lw=1.8, marker="o", ms=4)
    axes.plot([], [], color=_BLUE, lw=1.8, marker="o", ms=4, label="the same, joined by falling paths")
    axes.set_yscale("log")
    axes.set_ylim(bottom=0.8)
    axes.set_xlabel("level of $e_\\lambda$")
    axes.set_title("number of components", size=10)
    axes.legend(frameon=False, fontsize=8)
    axes.spines[["top", "right"]].set_visible(False)


def _whiskers(axes: Axes, study: ComponentStudy) -> None:
    axes.semilogx(study.sample.edges, study.sample.least, color=_BLUE, lw=1.6, marker="o", ms=4)
    axes.axhline(LEVEL, color=_RED, lw=1.0)
    axes.set_ylim(0.0, 1.25 * LEVEL)
    axes.set_xlabel("length of an outer edge")
    axes.set_title("least $e_\\lambda$: how far the set reaches towards edges of length zero", size=10)
    axes.spines[["top", "right"]].set_visible(False)
