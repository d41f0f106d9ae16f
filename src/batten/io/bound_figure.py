"""Figure of the study of bounds: distances over residuals, coloured by ℓ, as Fisker2018 Figs. 3.17, 3.18, 3.20, 3.21."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from batten.studies.bound import BOUNDS, MOST_ELL, BoundPart, ratios
from batten.studies.study import Outcome

_MOST_POINTS = 40_000
_COLOURS = ("#b8bec4", "#d24a12", "#1f5fa8")
_CEILING = 1e10
_MOST_POWER = 30.0


def figure(outcome: Outcome[BoundPart]) -> Figure:
    """First row over e_λ, second over e_r; below, the bounds over the distance, and their ratios.

    The first 40,000 curves are drawn; e_r is cut off at 20.
    """
    results = outcome.results
    few, line = results.ell <= MOST_ELL, results.below_line
    turning, ell = results.turning, results.ell
    highest = 1.04 * float(results.l2.max())
    panels = (
        ("L² distance (Fig. 3.17)", results.l2, np.ones_like(few), ell, "ℓ", 80.0, highest),
        ("L² distance, ℓ ≤ 25 (Fig. 3.18)", results.l2, few, ell, "ℓ", MOST_ELL, highest),
        ("‖γ − γₑ‖∞/L, ℓ ≤ 25 (Fig. 3.20)", results.distance, few, ell, "ℓ", MOST_ELL, 1.0),
        ("the same, ‖κ‖∞L < 16(L − 1) (Fig. 3.21)", results.distance, line, turning, "‖κ‖∞L", 40.0, 1.0),
    )
    drawing = Figure(figsize=(15.0, 10.5), layout="constrained")
    FigureCanvasAgg(drawing)
    upper, lower = np.asarray(drawing.subfigures(2, 1, height_ratios=(2.2, 1.0)))
    every = upper.subplots(2, 4)
    for j, (title, heights, rows, colours, word, most, top) in enumerate(panels):
        shown = np.flatnonzero(rows)[:_MOST_POINTS]
        abscissas = ((results.residual, "e_λ", 1.0), (results.curvature_residual, "e_r = √L‖r‖", 20.0))
        for axes, (x, name, right) in zip(every[:, j], abscissas):
            points = axes.scatter(
                x[shown], heights[shown], c=colours[shown], s=2.0, lw=0, cmap="viridis", vmin=0.0, vmax=most
            )
            axes.set_xlim(0.0, right)
            axes.set_ylim(0.0, top)
            axes.set_xlabel(name)
            axes.spines[["top", "right"]].set_visible(False)
        every[0, j].set_title(title, size=10)
        upper.colorbar(points, ax=list(every[:, j]), label=word, extend="max", location="bottom", aspect=40, pad=0.02)
    left, right = lower.subplots(1, 2)
    _bounds(left, results)
    _ratios(right, results)
    return drawing


def _bounds(axes: Axes, results: BoundPart) -> None:
    """The bounds over what they bound."""
    distance = results.distance[:_MOST_POINTS]
    for j, (name, colour) in enumerate(zip(BOUNDS, _COLOURS)):
        bound = np.fmin(results.bounds[:_MOST_POINTS, j], _CEILING)
        axes.scatter(distance, bound, s=1.5, lw=0, color=colour, label=name)
    axes.plot([1e-3, 2.0], [1e-3, 2.0], color="black", lw=1.0, label="the distance itself")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(1e-3, 2.0)
    axes.set_ylim(1e-3, _CEILING)
    axes.set_xlabel("‖γ − γₑ‖∞/L")
    axes.set_ylabel("bound on it")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=9, markerscale=5, loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _ratios(axes: Axes, results: BoundPart) -> None:
    """How they are spread over the distance."""
    powers = np.log10(np.fmin(ratios(results), 10.0**_MOST_POWER))
    for j, colour in enumerate(_COLOURS):
        axes.hist(powers[:, j], np.linspace(0.0, _MOST_POWER, 121).tolist(), color=colour, alpha=0.85)
    axes.set_yscale("log")
    axes.set_xlabel(f"bound over distance, as a power of ten ({_MOST_POWER:g}: that or more)")
    axes.set_ylabel("curves")
    axes.spines[["top", "right"]].set_visible(False)
