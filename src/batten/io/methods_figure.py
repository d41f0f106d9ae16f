"""The figure of the study of all projections: how their λ-residuals and movements are spread."""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from batten.studies.methods import NAMES, MethodsPart
from batten.studies.study import Outcome

_COLOURS = ("#d24a12", "#f0a070", "#1f5fa8", "#7fb0e0", "#2f8f4e", "#5b6470", "#8b97a3", "#bcc4cc")


def figure(outcome: Outcome[MethodsPart]) -> Figure:
    """Share of the curves below a λ-residual, and below a movement, for each method."""
    results = outcome.results
    rows = ~np.isnan(results.before)
    whole = Figure(figsize=(10.0, 4.6), layout="constrained")
    FigureCanvasAgg(whole)
    left, right = whole.subplots(1, 2)
    share = np.linspace(0.0, 1.0, 401)
    left.plot(np.quantile(results.before[rows], share), share, color="#1c2733", lw=1.0, ls=":", label="as drawn")
    for j, (name, colour) in enumerate(zip(NAMES, _COLOURS)):
        line = "--" if "0.22" in name else "-"
        left.plot(np.quantile(results.after[rows, j], share), share, color=colour, lw=1.6, ls=line, label=name)
        right.plot(np.quantile(results.movement[rows, j], share), share, color=colour, lw=1.6, ls=line)
    left.set_xlim(0.0, 0.6)
    right.set_xlim(0.0, 1.2)
    left.set_xlabel("λ-residual")
    right.set_xlabel("mean movement of the control points (radius of the disc 1)")
    left.set_ylabel("share of the curves below")
    for axes in (left, right):
        axes.set_ylim(0.0, 1.0)
        axes.spines[["top", "right"]].set_visible(False)
    left.legend(frameon=False, fontsize=9, loc="center right", bbox_to_anchor=(1.0, 0.58))
    return whole
