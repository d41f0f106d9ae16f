"""The figure of the study of the annuli: Fisker2018 Figs. 3.6, 3.7 and 3.15, and where the inner control points lie."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from batten.studies.annulus import TYPES, AnnulusPart
from batten.studies.study import Outcome
from batten.typing import FloatArray

_COLOURS = ("#1f5fa8", "#6aa5d8", "#2b8a57", "#8cc26a", "#d24a12", "#efa13c")
_MOST_DOTS = 20_000
_LIMIT = {"color": "#555555", "linewidth": 0.8, "linestyle": (0, (4, 3))}


def figure(outcome: Outcome[AnnulusPart]) -> Figure:
    """L² distance against the smallest angle and the λ-residual, H¹ distance against the λ-residual, by type.

    Polygons that meet themselves are left out; of more than 20,000 curves every n-th is drawn.
    """
    results = outcome.results
    shown = np.flatnonzero(results.simple)
    shown = shown[:: -(-len(shown) // _MOST_DOTS) or 1]
    drawing = Figure(figsize=(10.5, 8.2), layout="constrained")
    FigureCanvasAgg(drawing)
    axes = drawing.subplots(2, 2)
    dots = [_COLOURS[i] for i in results.type[shown]]
    _scatter(axes[0, 0], results.smallest_angle[shown] / np.pi, results.l2[shown], dots)
    axes[0, 0].axvline(2.0 / 3.0, **_LIMIT)
    axes[0, 0].set(title="Fig. 3.6", xlabel="φ_min / π", ylabel="L² distance to the nearest elastica")
    _scatter(axes[0, 1], results.residual[shown], results.l2[shown], dots)
    axes[0, 1].axvline(0.4, **_LIMIT)
    axes[0, 1].set(title="Fig. 3.7", xlabel="λ-residual", ylabel="L² distance to the nearest elastica")
    _scatter(axes[1, 0], results.residual[shown], results.h1[shown], dots)
    axes[1, 0].axvline(0.4, **_LIMIT)
    axes[1, 0].set(title="Fig. 3.15", xlabel="λ-residual", ylabel="H¹ distance to the nearest elastica")
    for panel in axes[0]:
        panel.axhline(0.01, **_LIMIT)
        panel.set_ylim(0.0, None)
    axes[1, 0].set_ylim(0.0, None)
    _shares(axes[1, 1], results)
    return drawing


def _scatter(axes: Any, x: FloatArray, y: FloatArray, colours: list[str]) -> None:
    axes.scatter(x, y, s=2.0, c=colours, linewidths=0.0, alpha=0.6, rasterized=True)
    axes.spines[["top", "right"]].set_visible(False)


def _shares(axes: Any, results: AnnulusPart) -> None:
    """How the L² distances of each type are spread, which is Table 3.2 at every limit; also the legend of the dots."""
    for i, name in enumerate(TYPES):
        distance = np.sort(results.l2[results.simple & (results.type == i)])
        if distance.size:
            axes.step(distance, np.arange(1, distance.size + 1) / distance.size, color=_COLOURS[i], label=name)
    axes.axvline(0.01, **_LIMIT)
    axes.set(
        title="Table 3.2: share of each type below a distance", xlabel="L² distance", xlim=(0.0, None), ylim=(0.0, 1.0)
    )
    if axes.lines[:-1]:
        axes.legend(frameon=False, fontsize=9)
    axes.spines[["top", "right"]].set_visible(False)
