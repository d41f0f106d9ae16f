"""Pictures of a rationalised design: the patches in space, and the deviation of each in plan."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from batten.fabrication.patch_plan import PatchPlan
from batten.fabrication.rationalisation import Rationalisation
from batten.typing import BoolArray, FloatArray

SIGNED = LinearSegmentedColormap.from_list("signed", ["#0b335e", "#7fb2da", "#f0f0ec", "#f0a26b", "#a8320a"])
"""Blue: the cut lies below the face in its patch's frame; nearly white: on it; orange: above."""

_WIDE = 2000  # pixels across before they are halved, twice as many as are seen
_SAMPLES = 1000  # of a patch along each side of its box
_LINE = 2.2  # pixels of the large picture: half the width of a block's border
_INK = np.array([0.11, 0.15, 0.2])
_MOST_MAPS = 24
_PIXELS = 220  # of a map along its longer side


def view_in_space(rationalisation: Rationalisation, tolerance_mm: float, *, azimuth: float, elevation: float) -> Figure:
    """All patches as planned, seen from a direction: coloured by their distance from the faces, block borders dark.

    Parameters:
        rationalisation: what to draw.
        tolerance_mm: ends of the colours.
        azimuth, elevation: degrees; where the eye stands.
    """
    a, e = math.radians(azimuth), math.radians(elevation)
    eye = np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])
    right = np.array([-math.sin(a), math.cos(a), 0.0])
    view = np.stack([right, np.cross(eye, right), eye])
    light = view.T @ np.array([-0.35, 0.55, 0.76])
    seen = [_points(plan, view, light, tolerance_mm) for plan in rationalisation.patches]
    flat = np.concatenate([s[0] for s in seen])
    low, high = flat[:, :2].min(axis=0), flat[:, :2].max(axis=0)
    margin = 0.02 * float((high - low).max())
    span = high - low + 2.0 * margin
    scale = _WIDE / float(span[0]) if span[0] >= 0.6 * span[1] else 0.6 * _WIDE / float(span[1])
    picture = _splatted(seen, low - margin, span, scale)
    height, width = picture.shape[:2]
    inches = 8.6
    figure = Figure(figsize=(inches, inches * height / width + 0.75))
    FigureCanvasAgg(figure)
    share = (inches * height / width) / (inches * height / width + 0.75)
    axes = figure.add_axes((0.0, 1.0 - share, 1.0, share))
    axes.imshow(picture, interpolation="lanczos")
    axes.set_axis_off()
    bar_axes = figure.add_axes((0.25, (1.0 - share) * 0.62, 0.5, (1.0 - share) * 0.17))
    _bar(figure, tolerance_mm, bar_axes)
    return figure


def _bar(figure: Figure, tolerance_mm: float, axes: Axes) -> None:
    shown = ScalarMappable(Normalize(-tolerance_mm, tolerance_mm), SIGNED)
    bar = figure.colorbar(shown, cax=axes, orientation="horizontal", extend="both")
    bar.set_label("distance of the cut from the face, mm; ends: the tolerance", size=9)
    bar.ax.tick_params(labelsize=8.5)


def _points(
    plan: PatchPlan, view: FloatArray, light: FloatArray, tolerance_mm: float
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Points of a patch in the picture's frame (n, 3), their colours (n, 3), and which lie next to a block's border."""
    points, inside = _sampled(plan, _SAMPLES)
    points = points[inside]
    normal = plan.planned.normal(points[:, 0], points[:, 1])
    shade = 0.62 + 0.38 * np.abs(normal @ (plan.block_frame[:3, :3].T @ light))
    near = cKDTree(plan.deviation.points[:, :2]).query(points[:, :2])[1]
    value = 0.5 + 0.5 * plan.deviation.signed_mm[near] / tolerance_mm
    colours = np.asarray(SIGNED(np.clip(value, 0.0, 1.0)))[:, :3] * shade[:, None]
    gaps = [
        np.abs(points[:, k, None] - lines).min(axis=1)
        for k, lines in ((0, plan.columns.borders), (1, plan.family.rows))
    ]
    step = float(max(np.ptp(plan.columns.borders), np.ptp(plan.family.rows))) / _SAMPLES
    on_line = np.minimum(*gaps) < _LINE * step
    design = points @ plan.block_frame[:3, :3].T + plan.block_frame[:3, 3]
    return design @ view.T, colours, on_line


def _sampled(plan: PatchPlan, count: int) -> tuple[FloatArray, BoolArray]:
    """A grid of the planned surface, (n, 3) in the block frame, and which of its points lie on the patch."""
    borders, rows = plan.columns.borders, plan.family.rows
    longer = max(float(np.ptp(borders)), float(np.ptp(rows)))
    counts = [max(2, int(count * float(np.ptp(ends)) / longer)) for ends in (borders, rows)]
    x, y = (np.linspace(ends[0], ends[-1], n) for ends, n in zip((borders, rows), counts))
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    flat = grid @ plan.family.pose[:2, :2].T
    inside = plan.patch.plan.contains(flat[:, 0], flat[:, 1])
    points = np.concatenate([grid, np.zeros((len(grid), 1))], axis=1)
    points[inside] = plan.planned.point(grid[inside, 0], grid[inside, 1])
    return points, inside


def _splatted(
    seen: list[tuple[FloatArray, FloatArray, BoolArray]], low: FloatArray, span: FloatArray, scale: float
) -> NDArray[np.float64]:
    """The picture (height, width, 3): in every pixel the point next to the eye, each drawn as two by two pixels."""
    height, width = int(span[1] * scale) + 1, int(span[0] * scale) + 1
    points = np.concatenate([s[0] for s in seen])
    colours = np.concatenate([np.where(s[2][:, None], _INK, s[1]) for s in seen])
    column = ((points[:, 0] - low[0]) * scale).astype(int)
    row = height - 1 - ((points[:, 1] - low[1]) * scale).astype(int)
    order = np.argsort(points[:, 2], kind="stable")  # the nearest is drawn last
    chosen = np.full((height + 2, width + 2), -1, dtype=np.int64)  # which point is seen in a pixel
    depth = np.full(chosen.shape, -np.inf)
    row, column = row[order] + 1, column[order] + 1
    for dr, dc in ((0, 0), (0, 1), (1, 0), (1, 1)):
        layer = np.full_like(chosen, -1)
        layer[row - dr, column + dc] = order
        far = np.where(layer >= 0, points[layer, 2], -np.inf)
        nearer = far > depth + (0.0 if dr == dc == 0 else 4.0 / scale)
        chosen[nearer], depth[nearer] = layer[nearer], far[nearer]
    chosen = chosen[1:-1, 1:-1]
    picture = np.where(chosen[..., None] >= 0, colours[chosen], 1.0)
    even = picture[: height // 2 * 2, : width // 2 * 2]
    return np.asarray(even.reshape(height // 2, 2, width // 2, 2, 3).mean(axis=(1, 3)))


def deviation_maps(rationalisation: Rationalisation, tolerance_mm: float) -> Figure:
    """The greatest distance in every cell of each patch's plan, blades from left to right, blocks with their numbers."""
    plans = rationalisation.patches[:_MOST_MAPS]
    across = min(len(plans), max(1, round(math.sqrt(1.4 * len(plans)))))
    down = -(-len(plans) // across)
    shapes = [_extent(plan) for plan in plans]
    tall = max(size[1] / size[0] for _, size in shapes)
    width = 8.6 / across
    figure = Figure(figsize=(8.6, down * (min(width * tall, 9.0) + 0.45) + 0.8), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(down, across, squeeze=False)
    for axes in grid.flat[len(plans) :]:
        axes.set_axis_off()
    for plan, axes, (low, size) in zip(plans, grid.flat, shapes):
        values = _greatest_in_cells(plan, low, size)
        extent = (low[0], low[0] + size[0], low[1], low[1] + size[1])
        axes.imshow(
            values, origin="lower", extent=extent, cmap=SIGNED, vmin=-tolerance_mm, vmax=tolerance_mm,
            interpolation="nearest",
        )  # fmt: skip
        for block in plan.blocks:
            corner, (w, h) = block.low[:2], (block.high - block.low)[:2]
            axes.add_patch(Rectangle((corner[0], corner[1]), w, h, fill=False, edgecolor="#5d6975", lw=0.6))
            place = (corner[0], corner[1] + h)
            axes.annotate(str(block.number), place, (3, -3), textcoords="offset points", va="top", size=7)
        title = f"patch {plan.number}: greatest {plan.deviation.greatest_mm:.2f} mm"
        axes.set_title(title, size=8.5, loc="left")
        axes.tick_params(labelsize=7)
        axes.spines[["top", "right"]].set_visible(False)
    shown = ScalarMappable(Normalize(-tolerance_mm, tolerance_mm), SIGNED)
    bar = figure.colorbar(shown, ax=grid, orientation="horizontal", extend="both", shrink=0.6, aspect=40, pad=0.03)
    bar.set_label("distance of the cut from the face, mm; ends: the tolerance", size=9)
    bar.ax.tick_params(labelsize=8.5)
    return figure


def _extent(plan: PatchPlan) -> tuple[FloatArray, FloatArray]:
    """Least corner and size of a patch's blocks in plan, a little room around."""
    low = np.array([plan.columns.borders[0], plan.family.rows[0]])
    size = np.array([plan.columns.borders[-1], plan.family.rows[-1]]) - low
    room = 0.01 * size.max()
    return low - room, size + 2.0 * room


def _greatest_in_cells(plan: PatchPlan, low: FloatArray, size: FloatArray) -> FloatArray:
    """In each cell (rows, columns) of a grid the signed distance of greatest size; NaN where the patch has no point."""
    cell = float(size.max()) / _PIXELS
    count = np.maximum(np.ceil(size / cell).astype(int), 1)
    x, y = (low[k] + (np.arange(count[k]) + 0.5) * cell for k in (0, 1))
    middles = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    flat = middles @ plan.family.pose[:2, :2].T
    inside = plan.patch.plan.contains(flat[:, 0], flat[:, 1])
    points, signed = plan.deviation.points[:, :2], plan.deviation.signed_mm
    order = np.argsort(np.abs(signed), kind="stable")
    index = np.clip(((points[order] - low) / cell).astype(int), 0, count - 1)
    values = np.full((count[1], count[0]), np.nan)
    values[index[:, 1], index[:, 0]] = signed[order]  # the greatest comes last
    flat_values = values.reshape(-1)
    empty = np.isnan(flat_values) & inside
    if empty.any():
        near = cKDTree(points).query(middles[empty])[1]
        flat_values[empty] = signed[near]
    return values
