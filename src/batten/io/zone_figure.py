"""Figure of the study of Π: mean and greatest λ-residual over the inner angles, as Brander2018 Fig. 8."""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from batten.studies.study import Outcome
from batten.studies.zone import PAPER_MAXIMUM, ZonePart, zone_border
from batten.typing import FloatArray

_RANGE = (0.9, 2.0 * np.pi - 0.9)
_MOST_CELLS = 240


def cells(results: ZonePart, count: int) -> tuple[FloatArray, FloatArray]:
    """Mean and greatest e_λ in count × count cells of the (φ₁, φ₂) plane, NaN where there is no curve; rows along φ₂."""
    low, high = _RANGE
    index = np.floor((results.phi - np.float32(low)) * np.float32(count / (high - low))).astype(np.int64)
    flat = np.clip(index[:, 1], 0, count - 1) * count + np.clip(index[:, 0], 0, count - 1)
    number = np.bincount(flat, minlength=count * count)
    total = np.bincount(flat, weights=results.residual, minlength=count * count)
    greatest = np.full(count * count, -1.0, np.float32)
    np.maximum.at(greatest, flat, results.residual)
    mean = np.where(number > 0, total / np.maximum(number, 1), np.nan)
    return mean.reshape(count, count), np.where(number > 0, greatest, np.nan).reshape(count, count)


def figure(outcome: Outcome[ZonePart]) -> Figure:
    """Mean and greatest λ-residual in the (φ₁, φ₂) plane, and their distribution."""
    results = outcome.results
    # About twenty curves to a cell, so that the greatest of them means something.
    count = int(np.clip(np.sqrt(outcome.size / 20.0), 12, _MOST_CELLS))
    drawing = Figure(figsize=(12.4, 4.2), layout="constrained")
    FigureCanvasAgg(drawing)
    *planes, spread = drawing.subplots(1, 3)
    border = zone_border()
    for axes, values, name in zip(planes, cells(results, count), ("mean", "greatest")):
        shown = axes.imshow(values, origin="lower", extent=_RANGE + _RANGE, cmap="viridis", vmin=0.0, vmax=0.4)
        axes.plot(border[:, 0], border[:, 1], color="#d24a12", lw=1.2)
        axes.set_title(f"{name} λ-residual of the curves in Π", size=10)
        axes.set_xlabel("φ₁")
        axes.set_ylabel("φ₂")
        axes.set_xticks((0.5 * np.pi, np.pi, 1.5 * np.pi), ("π/2", "π", "3π/2"))
        axes.set_yticks((0.5 * np.pi, np.pi, 1.5 * np.pi), ("π/2", "π", "3π/2"))
        axes.spines[["top", "right"]].set_visible(False)
    drawing.colorbar(shown, ax=planes, label="λ-residual", shrink=0.85)
    spread.hist(results.residual, np.linspace(0.0, 0.42, 85), color="#1f5fa8", alpha=0.85)
    spread.set_yscale("log")
    spread.axvline(PAPER_MAXIMUM, color="#d24a12", lw=1.2, label=f"the paper's maximum, {PAPER_MAXIMUM}")
    spread.axvline(float(results.residual.max()), color="black", lw=1.0, ls="--", label="ours, sampled")
    spread.set_xlabel("λ-residual")
    spread.set_ylabel("curves")
    spread.spines[["top", "right"]].set_visible(False)
    spread.set_ylim(0.7, 40.0 * spread.get_ylim()[1])
    spread.legend(frameon=False, fontsize=9, loc="upper left")
    return drawing
