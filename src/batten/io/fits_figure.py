"""Figure of the study of fits in Π: distances to the nearest elastica over the λ-residual, Fisker2018 Figs. 3.13, 3.14."""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from batten.studies.study import Outcome
from batten.studies.zone_fits import NORMS, PAPER_BOUNDS, FitsPart


def figure(outcome: Outcome[FitsPart]) -> Figure:
    """Both distances over the λ-residual, the paper's bounds as lines, and how they spread beside."""
    results = outcome.results
    drawing = Figure(figsize=(10.4, 4.4), layout="constrained")
    FigureCanvasAgg(drawing)
    panels = drawing.subplots(1, 4, width_ratios=(3, 1, 3, 1))
    for i, (norm, bound) in enumerate(zip(NORMS, PAPER_BOUNDS)):
        plane, spread = panels[2 * i : 2 * i + 2]
        top = 1.08 * max(bound, float(results.distances[:, i].max()))
        name = norm.replace("L2", "L²").replace("H1", "H¹")
        plane.scatter(results.residual, results.distances[:, i], s=1.5, lw=0, color="#1f5fa8", alpha=0.5)
        plane.axhline(bound, color="#d24a12", lw=1.2, label=f"the paper's bound, {bound}")
        plane.set_xlim(0.0, None)
        plane.set_ylim(0.0, top)
        plane.set_xlabel("λ-residual")
        plane.set_ylabel(f"normalised {name} distance to the nearest elastica")
        plane.legend(frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(0.0, 0.93))
        spread.hist(
            results.distances[:, i], np.linspace(0.0, top, 81), orientation="horizontal", color="#1f5fa8", alpha=0.85
        )
        spread.axhline(bound, color="#d24a12", lw=1.2)
        spread.set_ylim(0.0, top)
        spread.set_yticklabels([])
        spread.set_xlabel("curves")
        for axes in (plane, spread):
            axes.spines[["top", "right"]].set_visible(False)
    return drawing
