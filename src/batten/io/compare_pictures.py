"""The pictures of a comparison with a scan: signed distances by plan position, and how often each occurs."""

from __future__ import annotations

import io

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from batten.fabrication.scan_comparison import ScanComparison
from batten.typing import FloatArray, IntArray

_PIXELS = 240  # along the longer side of the plan
SIGNED = LinearSegmentedColormap.from_list("signed", ["#0b335e", "#7fb2da", "#f0f0ec", "#f0a26b", "#a8320a"])
"""Blue: too little foam; nearly white: as designed; orange: too much."""


def distance_map(comparison: ScanComparison) -> Figure:
    """Median signed distance in cells of the plan, the tolerance at both ends of the colours; no point, no colour."""
    distances, design = comparison.distances, comparison.design
    known = np.isfinite(distances.signed_mm)
    low, high = design.points[:, :2].min(axis=0), design.points[:, :2].max(axis=0)
    width, height = high - low
    cell = max(width, height) / min(_PIXELS, max(20.0, 0.5 * np.sqrt(known.sum())))
    count = np.maximum(np.ceil((high - low) / cell).astype(int), 1)
    span = [(low[k], low[k] + cell * count[k]) for k in (0, 1)]
    column, row = np.clip(((distances.feet_mm[known] - low) / cell).astype(int), 0, count - 1).T
    middle = _medians(row * count[0] + column, distances.signed_mm[known], int(count.prod())).reshape(count[::-1])
    size = 8.6 if width >= height else 6.4
    drawing = Figure(figsize=(size, float(np.clip(0.82 * size * height / width, 2.2, 9.0))), layout="constrained")
    FigureCanvasAgg(drawing)
    axes = drawing.subplots()
    shown = axes.imshow(
        middle, origin="lower", extent=(*span[0], *span[1]), cmap=SIGNED, interpolation="nearest",
        vmin=-comparison.tolerance_mm, vmax=comparison.tolerance_mm,
    )  # fmt: skip
    bar = drawing.colorbar(shown, ax=axes, extend="both", shrink=0.85)
    bar.set_label("mm: below 0 too little foam, above 0 too much; ends: the tolerance", size=9)
    for block in comparison.boxes:
        (x, y), (across, up) = block.corner_mm[:2], block.size_mm[:2]
        axes.add_patch(Rectangle((x, y), across, up, fill=False, edgecolor="#66727f", lw=0.5))
        axes.annotate(
            str(block.number), (x, y + up), (3, -3), textcoords="offset points", va="top", size=7, color="#1c2733"
        )
    axes.set_xlabel("x, mm")
    axes.set_ylabel("y, mm")
    axes.spines[["top", "right"]].set_visible(False)
    return drawing


def _medians(cells: IntArray, values: FloatArray, count: int) -> FloatArray:
    """Median of the values in each of `count` cells, NaN in those without one: stray points do not show."""
    order = np.lexsort((values, cells))
    ends = np.searchsorted(cells[order], np.arange(count + 1))
    first, size = ends[:-1], np.diff(ends)
    ordered = np.append(values[order], np.nan)
    low, high = (ordered[np.where(size > 0, first + part, -1)] for part in ((size - 1) // 2, size // 2))
    return np.asarray(0.5 * (low + high))


def distance_histogram(comparison: ScanComparison) -> Figure:
    """How the signed distances are spread, tolerance and middle 90 % as lines; the far tails lie in the end bins."""
    signed = comparison.distances.signed_mm
    signed = signed[np.isfinite(signed)]
    limit = max(1.3 * comparison.tolerance_mm, min(float(np.percentile(np.abs(signed), 99.5)), comparison.reach_mm))
    drawing = Figure(figsize=(8.6, 3.4), layout="constrained")
    FigureCanvasAgg(drawing)
    axes = drawing.subplots()
    weights = np.full(len(signed), 100.0 / len(signed))
    axes.hist(
        np.clip(signed, -limit, limit), np.linspace(-limit, limit, 102).tolist(), weights=weights, color="#2c6fa8"
    )
    for sign in (-1.0, 1.0):
        label = f"tolerance, {comparison.tolerance_mm:g} mm" if sign > 0 else None
        axes.axvline(sign * comparison.tolerance_mm, color="#d24a12", lw=1.2, label=label)
    for share, place in zip(("5 %", "95 %"), np.percentile(signed, (5.0, 95.0))):
        axes.axvline(
            place, color="#1c2733", lw=0.9, ls="--", label=f"{share} lie below {place:.2f} mm".replace("-", "−")
        )
    axes.set_xlabel("signed distance, mm (below 0: too little foam)")
    axes.set_ylabel("% of the points")
    axes.set_xlim(-1.02 * limit, 1.02 * limit)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=9, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    return drawing


def picture_bytes(figure: Figure) -> bytes:
    """A figure as PNG; the same figure gives the same bytes."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=150, metadata={"Software": None})
    return file.getvalue()
