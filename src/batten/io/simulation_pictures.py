"""The pictures of a simulated cut: the face coloured by its distance from the design, and how often each distance occurs."""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from batten.fabrication.swept_surface import Simulation, face_distances
from batten.io.compare_pictures import SIGNED
from batten.typing import FloatArray, IntArray

_BEYOND = "#c3007a"
"""Beyond the limit, on either side."""
_BINS = 101


def deviation_colours(signed: FloatArray, limit: float) -> IntArray:
    """Red, green, blue, 0 to 255, of signed distances (n,), shape (n, 3): `SIGNED`, magenta beyond the limit."""
    colours = SIGNED.with_extremes(over=_BEYOND, under=_BEYOND)(Normalize(-limit, limit)(signed))
    return np.rint(255.0 * np.asarray(colours)[:, :3]).astype(np.int64)


def deviation_map(simulation: Simulation) -> Figure:
    """The face in plan, coloured by its signed distance from the design, with a cross where a failing block is worst."""
    boxes = [b.block for b in simulation.blocks]
    low = np.min([b.corner_mm[:2] for b in boxes], axis=0)
    high = np.max([b.corner_mm[:2] + b.size_mm[:2] for b in boxes], axis=0)
    width, height = high - low
    size = 8.6 if width >= height else 6.4
    drawing = Figure(figsize=(size, float(np.clip(0.84 * size * height / width, 2.2, 9.0))), layout="compressed")
    FigureCanvasAgg(drawing)
    axes = drawing.subplots()
    limit = simulation.limit_mm
    colours = SIGNED.with_extremes(over=_BEYOND, under=_BEYOND)
    shown = None
    for block in simulation.blocks:
        mesh = block.mesh
        if len(mesh.triangles):
            shown = axes.tripcolor(
                mesh.points[:, 0], mesh.points[:, 1], mesh.triangles, mesh.signed, shading="gouraud", cmap=colours,
                vmin=-limit, vmax=limit,
            )  # fmt: skip
    if shown is not None:
        bar = drawing.colorbar(shown, ax=axes, extend="both", shrink=0.85)
        bar.set_label("mm: below 0 under the design, above 0 over it; ends: the limit", size=9)
    for block in simulation.blocks:
        (x, y), (across, up) = block.block.corner_mm[:2], block.block.size_mm[:2]
        axes.add_patch(Rectangle((x, y), across, up, fill=False, edgecolor="#66727f", lw=0.5))
        axes.annotate(
            str(block.block.number), (x, y + up), (3, -3), textcoords="offset points", va="top", size=7, color="#1c2733"
        )
        if block.block.number in simulation.failing:
            axes.plot(*block.worst[1][:2], "x", color="#1c2733", ms=6)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_xlabel("x, mm")
    axes.set_ylabel("y, mm")
    axes.spines[["top", "right"]].set_visible(False)
    return drawing


def deviation_histogram(simulation: Simulation) -> Figure:
    """How the signed distances are spread over the face, at the leaves and between them, the limit as lines."""
    limit = simulation.limit_mm
    parts = []
    for at_leaf in (True, False):
        pairs = [face_distances(b, at_leaf) for b in simulation.blocks]
        signed, areas = (np.concatenate(p) for p in zip(*pairs))
        known = np.isfinite(signed) & (areas > 0.0)
        parts.append((signed[known], areas[known]))
    reach = max([1.15 * limit, *(float(np.abs(s).max()) for s, _ in parts if len(s))])
    drawing = Figure(figsize=(8.6, 3.4), layout="constrained")
    FigureCanvasAgg(drawing)
    axes = drawing.subplots()
    bins = np.linspace(-reach, reach, _BINS)
    (leaf, leaf_area), (between, between_area) = parts
    axes.hist(
        between, bins.tolist(), weights=100.0 * between_area / max(between_area.sum(), 1e-300), color="#9dbfda",
        label="between leaves",
    )  # fmt: skip
    axes.hist(
        leaf, bins.tolist(), weights=100.0 * leaf_area / max(leaf_area.sum(), 1e-300), histtype="step", lw=1.3,
        color="#12395c", label="at leaves",
    )  # fmt: skip
    for sign in (-1.0, 1.0):
        label = f"limit, {limit:g} mm" if sign > 0 else None
        axes.axvline(sign * limit, color="#d24a12", lw=1.2, label=label)
    axes.set_xlabel("signed distance, mm (below 0: under the design)")
    axes.set_ylabel("% of the area")
    axes.set_xlim(-1.02 * reach, 1.02 * reach)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=9, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    return drawing
