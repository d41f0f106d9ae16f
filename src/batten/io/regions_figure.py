"""The figure of the study `regions`: some cases with both regions, and how much all cases differ."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from batten.curves.cubic_proxy import CubicProxy
from batten.solvers.good_region import good_region
from batten.solvers.good_region_database import database_region
from batten.solvers.region_polygons import Polygon
from batten.studies.regions import RegionsOutcome, study_database
from batten.typing import FloatArray

_OURS, _DATABASE = "#1f5fa8", "#d24a12"
_SHOWN = (0.1, 0.3, 0.5, 0.75, 0.95)


def figure(outcome: RegionsOutcome) -> Figure:
    """Five cases, from those that agree well to those that do not, and the histogram of the symmetric difference."""
    results = outcome.results
    share = results.difference / results.union
    order = np.argsort(share, kind="stable")
    picture = Figure(figsize=(12.6, 8.2), layout="constrained")
    FigureCanvasAgg(picture)
    axes = list(picture.subplots(2, 3).flat)
    for place, quantile in zip(axes, _SHOWN):
        case = int(order[min(int(quantile * len(order)), len(order) - 1)])
        _draw_case(place, results.control_points[case], int(results.index[case]))
        place.set_title(f"{share[case]:.0%} of the union: {quantile:.0%} of the cases differ less", size=10)
    axes[0].legend(loc="best", frameon=False, fontsize=9)
    end = (results.index == 0) | (results.index == results.control_points.shape[1] - 1)
    bins = np.linspace(0.0, 1.0, 41)
    axes[5].hist(
        [share[~end], share[end]], bins, stacked=True, color=["#8c9aa6", "#d5dce2"], label=["inner points", "ends"]
    )
    axes[5].axvline(float(np.median(share)), color="black", lw=1.2, label=f"median {np.median(share):.2f}")
    axes[5].set_xlabel("symmetric difference over union")
    axes[5].set_ylabel("cases")
    axes[5].legend(frameon=False, fontsize=9)
    axes[5].spines[["top", "right"]].set_visible(False)
    return picture


def _draw_case(axes: Axes, control: FloatArray, index: int) -> None:
    """The spline, its control polygon, and both regions of the active point."""
    proxy = CubicProxy(control)
    ours, theirs = good_region(proxy, index).polygons, database_region(study_database(), proxy, index).polygons
    _fill(axes, ours, _OURS, 0.35, "computed")
    _fill(axes, theirs, _DATABASE, 0.0, "database")
    curve = proxy.point(np.linspace(0.0, 1.0, 301))
    axes.plot(*control.T, ".-", color="#8c9aa6", lw=0.7, ms=4)
    axes.plot(*curve.T, color="black", lw=1.6)
    axes.plot(*control[index], "o", color="black", ms=6)
    shown = np.concatenate([control, *(p.outer for p in (*ours, *theirs))])
    near = np.clip(shown, control.min(axis=0) - 1.2 * np.ptp(control), control.max(axis=0) + 1.2 * np.ptp(control))
    low, high = near.min(axis=0), near.max(axis=0)
    margin = 0.04 * float((high - low).max())
    axes.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin), aspect="equal")
    axes.set_xticks([])
    axes.set_yticks([])


def _fill(axes: Axes, polygons: Sequence[Polygon], colour: str, strength: float, label: str) -> None:
    rings = [ring for polygon in polygons for ring in (polygon.outer, *polygon.holes)]
    if rings:
        path = Path.make_compound_path(*(Path(np.vstack([ring, ring[:1]]), closed=True) for ring in rings))
        if strength > 0.0:
            axes.add_patch(PathPatch(path, facecolor=colour, alpha=strength, lw=0.0))
        axes.add_patch(PathPatch(path, fill=False, edgecolor=colour, lw=1.3, label=label))
