"""Figure of the study of random Béziers: λ-residuals over the inner angles, as Fisker2018 Fig. 3.12."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure

from batten.measures.lambda_class import BEST_BELOW, GOOD_BELOW
from batten.studies.random_sample import ANGLES, LENGTHS, SIMPLE, RandomPart
from batten.studies.study import Outcome
from batten.studies.zone import zone_border
from batten.typing import BoolArray

_MOST_POINTS = 40_000
_TICKS = (0.0, 0.5 * np.pi, np.pi, 1.5 * np.pi, 2.0 * np.pi)
_NAMES = ("0", "π/2", "π", "3π/2", "2π")


def figure(outcome: Outcome[RandomPart]) -> Figure:
    """λ-residuals over (φ₁, φ₂) under the angle constraints, without and with edge lengths, and the border of Π.

    Of each panel's curves the first 40,000 are drawn.
    """
    results = outcome.results
    allowed = results.satisfying(SIMPLE | ANGLES)
    held = allowed & results.satisfying(LENGTHS)
    residual = results.residual
    best, good = np.float32(BEST_BELOW), np.float32(GOOD_BELOW)
    panels = (
        ("a  any edge lengths", allowed),
        ("b  edge lengths hold, λ-residual < 0.22", held & (residual < best)),
        ("c  edge lengths hold, 0.22 to 0.4", held & (residual >= best) & (residual < good)),
        ("d  edge lengths hold, 0.4 and above", held & (residual >= good)),
    )
    drawing = Figure(figsize=(8.6, 8.0), layout="constrained")
    FigureCanvasAgg(drawing)
    every = drawing.subplots(2, 2, sharex=True, sharey=True)
    for axes, (title, shown) in zip(every.flat, panels):
        points = _panel(axes, results, shown)
        axes.set_title(f"{title}: {np.count_nonzero(shown):,}", size=9)
    for axes in every[1]:
        axes.set_xlabel("φ₁")
    for axes in every[:, 0]:
        axes.set_ylabel("φ₂")
    drawing.colorbar(points, ax=every, shrink=0.6, label="λ-residual", extend="max")
    return drawing


def _panel(axes: Axes, results: RandomPart, shown: BoolArray) -> PathCollection:
    rows = np.flatnonzero(shown)[:_MOST_POINTS]
    points = axes.scatter(
        results.phi[rows, 0],
        results.phi[rows, 1],
        c=results.residual[rows],
        s=1.2,
        lw=0,
        cmap="viridis",
        vmin=0,
        vmax=0.8,
    )
    border = zone_border()
    axes.plot(border[:, 0], border[:, 1], color="#d24a12", lw=1.2)
    axes.set_aspect("equal")
    axes.set_xlim(0.0, 2.0 * np.pi)
    axes.set_ylim(0.0, 2.0 * np.pi)
    axes.set_xticks(_TICKS, _NAMES)
    axes.set_yticks(_TICKS, _NAMES)
    axes.spines[["top", "right"]].set_visible(False)
    return points
