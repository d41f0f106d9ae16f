"""The figure of the study of projections: the λ-residual before and after."""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from batten.studies.projection import PAPER, ROWS, ProjectionPart
from batten.studies.study import Outcome


def figure(outcome: Outcome[ProjectionPart]) -> Figure:
    """How the λ-residuals are spread after the projection, and before it in the first row; the paper's mean as a line."""
    results = outcome.results
    drawing = Figure(figsize=(8.6, 6.2), layout="constrained")
    FigureCanvasAgg(drawing)
    for j, axes in enumerate(drawing.subplots(2, 2, sharex=True).flat):
        inside = results.inside[:, j]
        bins = np.linspace(0.0, 1.0, 101)
        shown = {"density": bool(inside.any())}  # a density of no curves is 0/0
        axes.hist(results.before[inside], bins, color="#d5dce2", label="as drawn", **shown)
        axes.hist(results.after[inside, j], bins, color="#1f5fa8", alpha=0.85, label="projected", **shown)
        axes.axvline(PAPER[j][0] or 0.0, color="#d24a12", lw=1.2, label="the paper's mean")
        axes.set_title(f"{ROWS[j]}: {inside.mean():.1%} of the curves", size=10)
        axes.set_yticks([])
        axes.spines[["top", "right", "left"]].set_visible(False)
        axes.set_xlabel("λ-residual" if j > 1 else "")
        if j == 0:
            axes.legend(frameon=False, fontsize=9)
    return drawing
