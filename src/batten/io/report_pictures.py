"""The report's pictures, drawn with matplotlib: the wall, one block in three views, curvature and strain, forces."""

from __future__ import annotations

import base64
import io
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import LinearSegmentedColormap, to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from batten.fabrication.job import CutJob
from batten.fabrication.plan import Block, CutPlan
from batten.io.report_maps import BROKEN, RAMP, png_address
from batten.io.report_numbers import RodNumbers
from batten.typing import FloatArray, IntArray

INK, SOFT, FAINT, FOAM = "#1c2733", "#66727f", "#c9d0d6", "#f4f1e8"
RED = "#{:02x}{:02x}{:02x}".format(*BROKEN)
BLUE = "#{:02x}{:02x}{:02x}".format(*RAMP[2])
DEEP = "#{:02x}{:02x}{:02x}".format(*RAMP[3])
WIDTH_IN = 10.4
"""Width of a picture, inches: at 1040 CSS pixels its letters are nearly as large as those of the text."""
DPI = 190.0

# Thin lines need more colour than areas: the ramp without its palest end.
_LINES = LinearSegmentedColormap.from_list("lines", [tuple(c / 255.0 for c in colour) for colour in RAMP[1:]])
_STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8.5,
    "text.color": INK,
    "axes.edgecolor": SOFT,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.6,
    "axes.titlesize": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "svg.hashsalt": "batten",
}


def draw_pictures(plan: CutPlan, job: CutJob, numbers: RodNumbers, featured: int) -> dict[str, str]:
    """All pictures as addresses of embedded images, ready for `<img src>`; the same plan gives the same bytes.

    Parameters:
        plan: the plan.
        job: the job, for the limits that are drawn in.
        numbers: the plan's numbers, from `rod_numbers`.
        featured: index of the rod that the three views and the strain plot single out.

    Returns:
        "wall", "block", "strain", "forces".
    """
    with matplotlib.rc_context(_STYLE):
        return {
            "wall": draw_wall(plan, job, numbers),
            "block": draw_block(plan, job, numbers, featured),
            "strain": draw_strain(plan, job, numbers, featured),
            "forces": draw_forces(plan, job, numbers),
        }


def _svg(figure: Figure) -> str:
    FigureCanvasAgg(figure)
    file = io.BytesIO()
    bare: dict[str, None] = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    figure.savefig(file, format="svg", dpi=DPI, metadata=bare)
    return "data:image/svg+xml;base64," + base64.b64encode(file.getvalue()).decode("ascii")


def _png(figure: Figure) -> str:
    """For what has too many lines for SVG; a few bits less of colour make it much smaller."""
    figure.set_dpi(DPI)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    coarse = np.minimum((np.arange(256) + 4) // 8 * 8, 255).astype(np.uint8)
    return png_address(coarse[np.asarray(canvas.buffer_rgba())[..., :3]])


# The wall, seen from above and in front: each leaf hides what lies behind it.


def _view(plan: CutPlan) -> tuple[FloatArray, FloatArray]:
    """The picture's right and up in the wall frame (2, 3), and the direction away from the eye in plan (2,)."""
    turn, lift = np.radians(-24.0 if plan.blade_axis == "x" else 66.0), np.radians(46.0)
    right = np.array([np.cos(turn), np.sin(turn), 0.0])
    away = np.array([-np.sin(turn), np.cos(turn), 0.0])
    up = np.sin(lift) * away + np.array([0.0, 0.0, np.cos(lift)])
    return np.stack([right, up]), away[:2]


def draw_wall(plan: CutPlan, job: CutJob, numbers: RodNumbers) -> str:
    """All leaves, coloured by their deviation from the surface; an address of an embedded picture."""
    axes3, away = _view(plan)
    curves = [r.plane.to_world(piece) for r, piece in zip(plan.rods, numbers.pieces)]
    flat = np.concatenate(curves) @ axes3.T
    low, high = flat.min(axis=0), flat.max(axis=0)
    margin = 0.03 * float((high - low).max())
    size = high - low + 2.0 * margin
    figure = Figure(figsize=(WIDTH_IN, max(4.5, WIDTH_IN * float(size[1] / size[0]))))
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set_axis_off()
    ax.set_aspect("equal")
    ax.set_xlim(low[0] - margin, high[0] + margin)
    ax.set_ylim(low[1] - margin, high[1] + margin)
    nearest_last = np.argsort([-float(c.mean(axis=0)[:2] @ away) for c in curves], kind="stable")
    check = next((c for c in plan.checks if c.name == "deviation"), None)
    if check is not None and not np.isnan(check.values).all():  # rods that pass beside their block cut nothing there
        nearest_last = nearest_last[~np.isnan(check.values[nearest_last])]
    ax.add_collection(_leaves(plan, job, numbers, curves, axes3, nearest_last))
    _block_numbers(ax, plan, curves, axes3, nearest_last)
    _axes_cross(ax, axes3, size)
    beyond = bool((numbers.greatest_deviation_mm > job.leaves.tolerance_mm).any())
    _wall_legend(figure, job.leaves.tolerance_mm, bool(numbers.refused.any()), beyond)
    return _png(figure)


def _leaves(
    plan: CutPlan, job: CutJob, numbers: RodNumbers, curves: list[FloatArray], axes3: FloatArray, order: IntArray
) -> PolyCollection:
    """From the farthest leaf to the nearest: a white curtain that hides what is behind, then the leaf on its hem.

    Thin lines from leaf to leaf show where the cut meets the block's sides.
    """
    base = min(float(b.corner_mm[2]) for b in plan.blocks)
    clear, white, side = to_rgba("none"), to_rgba("white"), to_rgba(INK, 0.55)
    paths: list[FloatArray] = []
    fills: list[Any] = []
    edges: list[Any] = []
    widths: list[float] = []
    behind: dict[int, FloatArray] = {}  # the last leaf of each block
    for index in order:
        curve, block = curves[index], plan.rods[index].block
        flat = curve @ axes3.T
        hem = np.stack([curve[[-1, 0], 0], curve[[-1, 0], 1], [base, base]], axis=1) @ axes3.T
        sides = [np.stack([behind[block][end], flat[end]]) for end in (0, -1)] if block in behind else []
        behind[block] = flat
        if numbers.refused[index]:
            stretches, colours, width = [flat], [to_rgba(RED)], 1.4
        else:
            stretches, colours = _coloured(flat, numbers.deviation_mm[index], job.leaves.tolerance_mm)
            width = 0.9
        paths += [np.concatenate([flat, hem]), *sides, *stretches]
        fills += [white] + [clear] * (len(sides) + len(stretches))
        edges += [clear, *[side] * len(sides), *colours]
        widths += [0.0, *[0.6] * len(sides), *[width] * len(stretches)]
    return PolyCollection(paths, closed=False, facecolors=fills, edgecolors=edges, linewidths=widths, capstyle="round")


def _coloured(flat: FloatArray, deviation: FloatArray, limit: float) -> tuple[list[FloatArray], list[Any]]:
    """A leaf's piece in stretches and the colour of each, from the deviation there."""
    count = len(flat)
    at = np.interp(np.arange(count), np.linspace(0, count - 1, len(deviation)), deviation)
    starts = range(0, count - 1, 8)
    value = np.array([at[i : i + 9].max() for i in starts])
    colours = _LINES(value / limit)
    colours[value > limit] = to_rgba(RED)
    return [flat[i : i + 9] for i in starts], list(colours)


def _block_numbers(ax: Any, plan: CutPlan, curves: list[FloatArray], axes3: FloatArray, order: IntArray) -> None:
    """Each block's number as near to the middle of its cut as the cut can be seen; none where all of it is hidden."""
    flats = [c @ axes3.T for c in curves]
    across = np.linspace(min(f[:, 0].min() for f in flats), max(f[:, 0].max() for f in flats), 600)
    horizon = np.full(across.shape, -np.inf)  # upper edge of all nearer leaves
    seen: dict[int, list[tuple[FloatArray, FloatArray]]] = {}
    for index in order[::-1]:
        flat, middle = flats[index], len(flats[index]) // 2
        if flat[middle, 1] >= np.interp(flat[middle, 0], across, horizon):
            seen.setdefault(plan.rods[index].block, []).append((curves[index][middle], flat[middle]))
        rising = flat if flat[0, 0] < flat[-1, 0] else flat[::-1]
        edge = np.interp(across, rising[:, 0], rising[:, 1], left=-np.inf, right=-np.inf)
        horizon = np.maximum(horizon, edge)
    for block in plan.blocks:
        if block.number not in seen:
            continue
        centre = (block.corner_mm + 0.5 * block.size_mm)[:2]
        _, place = min(seen[block.number], key=lambda pair: float(np.hypot(*(pair[0][:2] - centre))))
        ax.text(
            *place, str(block.number), ha="center", va="center", fontsize=8,
            bbox={"boxstyle": "circle,pad=0.25", "facecolor": "white", "edgecolor": FAINT, "lw": 0.6, "alpha": 0.9},
        )  # fmt: skip


def _axes_cross(ax: Any, axes3: FloatArray, size: FloatArray) -> None:
    """The wall's axes in the lower left corner, all of one stated length."""
    decade = 10.0 ** np.floor(np.log10(0.13 * float(size[0])))
    length = decade * max(n for n in (1.0, 2.0, 5.0) if n * decade <= 0.13 * size[0])
    arms = length * axes3.T
    origin = np.array([ax.get_xlim()[0], ax.get_ylim()[0]]) + 0.05 * size[0] + np.maximum(-arms.min(axis=0), 0.0)
    style = {"arrowstyle": "-|>", "lw": 0.8, "color": SOFT, "shrinkA": 0, "shrinkB": 0}
    for name, arm in zip("xyz", arms):
        ax.annotate("", origin + arm, origin, arrowprops=style)
        ax.text(*(origin + 1.15 * arm), name, color=SOFT, ha="center", va="center")
    ends = origin + 1.15 * np.concatenate([arms, [[0.0, 0.0]]])
    ax.text(*(ends.min(axis=0) - [0.0, 0.012 * size[0]]), f"arrows: {length:g} mm", color=SOFT, va="top")


def _wall_legend(figure: Figure, limit: float, refused: bool, beyond: bool) -> None:
    bar = figure.add_axes((0.755, 0.925, 0.215, 0.018))
    bar.imshow(np.linspace(0.0, 1.0, 128)[None, :], cmap=_LINES, aspect="auto", extent=(0.0, limit, 0.0, 1.0))
    bar.set_yticks([])
    bar.set_xticks([0.0, 0.5 * limit, limit], labels=["0", f"{0.5 * limit:g}", f"{limit:g}"])
    bar.tick_params(length=2, pad=2)
    bar.set_title("deviation from the surface, mm", loc="left", pad=4)
    for spine in bar.spines.values():
        spine.set_visible(False)
    red = " or ".join(text for text, shown in (("refused", refused), ("beyond the tolerance", beyond)) if shown)
    if red:
        figure.text(0.755, 0.865, "━", color=RED, va="center", weight="bold")
        figure.text(0.778, 0.865, red, va="center")


# One block in its work frame: plan above, front below it, side to the right of the front; one scale for all three.


def draw_block(plan: CutPlan, job: CutJob, numbers: RodNumbers, featured: int) -> str:
    """The block of the featured rod, with its rods and grippers, from three sides; an address of a picture."""
    block = plan.block(plan.rods[featured].block)
    frame = block.work_frame(plan.blade_axis)
    inside = [i for i, r in enumerate(plan.rods) if r.block == block.number]
    rods = {i: _to_work(frame, plan.rods[i].plane.to_world(numbers.points[i])) for i in inside}
    pieces = {i: _to_work(frame, plan.rods[i].plane.to_world(numbers.pieces[i])) for i in inside}
    edges = block.size_mm if plan.blade_axis == "x" else block.size_mm[[1, 0, 2]]
    corner = np.array([-0.5 * edges[0], -0.5 * edges[1], 0.0])
    reach = job.gripper.radius_mm + 10.0
    ends = np.concatenate(list(rods.values()))
    low = np.minimum(ends.min(axis=0) - reach, corner - 10.0)
    high = np.maximum(ends.max(axis=0) + reach, corner + edges + 10.0)
    size, gap = high - low, 0.05 * float(high[0] - low[0])
    wide, tall = float(size[0] + gap + size[1]), float(size[1] + size[2] + 2.0 * gap)
    figure = Figure(figsize=(WIDTH_IN, WIDTH_IN * tall / wide))
    views = (  # which axes, the view's lower left corner in the picture, mm, its name
        ((0, 1), (0.0, float(size[2]) + gap), "plan, from above"),
        ((0, 2), (0.0, 0.0), "front, along the sweep"),
        ((1, 2), (float(size[0]) + gap, 0.0), "side, along the blade"),
    )
    for (i, j), at, name in views:
        place = (at[0] / wide, at[1] / tall, float(size[i]) / wide, float(size[j]) / tall)
        ax = figure.add_axes(place)
        ax.set_xlim(low[i], high[i])
        ax.set_ylim(low[j], high[j])
        ax.set_axis_off()
        box = Rectangle((corner[i], corner[j]), edges[i], edges[j], facecolor=FOAM, edgecolor=SOFT, lw=0.8, zorder=0)
        ax.add_patch(box)
        _rods_in_view(ax, rods, pieces, featured, numbers, (i, j), job.gripper.radius_mm)
        figure.text(place[0] + 0.004, place[1] + place[3] + 0.15 * gap / tall, name, color=SOFT, va="bottom")
    _block_legend(figure, plan, block, featured, (float(size[0]) + gap) / wide, job)
    return _svg(figure)


def _to_work(frame: FloatArray, points: FloatArray) -> FloatArray:
    """Wall points (…, 3) in the work frame."""
    moved: FloatArray = (points - frame[:3, 3]) @ frame[:3, :3]
    return moved


def _rods_in_view(
    ax: Any, rods: dict[int, FloatArray], pieces: dict[int, FloatArray], featured: int, numbers: RodNumbers,
    view: tuple[int, int], radius: float,
) -> None:  # fmt: skip
    others = [i for i in rods if i != featured]
    colours = [RED if numbers.refused[i] else "#8fb4d3" for i in others]
    ax.add_collection(LineCollection([rods[i][::2, view] for i in others], colors=FAINT, linewidths=0.5, zorder=1))
    ax.add_collection(LineCollection([pieces[i][::2, view] for i in others], colors=colours, linewidths=0.6, zorder=2))
    if view == (1, 2):  # the cut's edges on the block's two ends
        for end in (0, -1):
            ax.plot(*np.array([pieces[i][end] for i in pieces])[:, view].T, color=BLUE, lw=0.9, zorder=3)
    colour = RED if numbers.refused[featured] else DEEP
    ax.plot(*rods[featured][:, view].T, color=colour, lw=1.1, zorder=5)
    ax.plot(*pieces[featured][:, view].T, color=colour, lw=2.2, zorder=6, solid_capstyle="butt")
    for end in (0, -1):
        centre: Any = rods[featured][end, view]
        ax.add_patch(Circle(centre, radius, facecolor="white", edgecolor=INK, lw=0.8, alpha=0.85, zorder=4))
        ax.plot(*centre, "o", ms=2.4, color=INK, zorder=7)


def _block_legend(figure: Figure, plan: CutPlan, block: Block, featured: int, left: float, job: CutJob) -> None:
    rod = plan.rods[featured]
    size = " × ".join(f"{v:.0f}" for v in block.size_mm)
    lines = (
        (INK, "bold", f"Block {block.number}, {size} mm"),
        (RED if rod.status == "refused" else DEEP, "normal", f"leaf {rod.leaf}, thick where it cuts"),
        (INK, "normal", f"circles: room for the grippers, radius {job.gripper.radius_mm:g} mm"),
        (SOFT, "normal", f"pale: the block's other rods, each {rod.rod.length:.0f} mm long"),
        (SOFT, "normal", "one scale in all three views"),
    )
    height = figure.get_size_inches()[1]
    for row, (colour, weight, text) in enumerate(lines):
        figure.text(left, 1.0 - (0.5 + 0.24 * row) / height, text, color=colour, weight=weight, va="top", fontsize=9)


# Along the rods


def draw_strain(plan: CutPlan, job: CutJob, numbers: RodNumbers, featured: int) -> str:
    """Strain (left scale) and curvature (right scale) along every rod; an address of an embedded picture."""
    figure = Figure(figsize=(WIDTH_IN, 3.5))
    ax = figure.add_axes((0.062, 0.14, 0.885, 0.76))
    percent, limit = 100.0 * numbers.strain, 100.0 * job.rod.max_strain
    top = 1.15 * max(limit, float(np.abs(percent).max()))
    ax.set_ylim(-top, top)
    ax.set_xlim(float(numbers.arc_mm.min()), float(numbers.arc_mm.max()))
    ax.axvspan(0.0, float(np.mean([r.piece.length for r in plan.rods])), color=FOAM, lw=0, zorder=0)
    ax.axhline(0.0, color=FAINT, lw=0.6, zorder=0)
    order = np.argsort(numbers.refused, kind="stable")  # the refused ones on top
    ax.add_collection(
        LineCollection(
            [np.stack([numbers.arc_mm[i, ::2], percent[i, ::2]], axis=1) for i in order],
            colors=[RED + "99" if numbers.refused[i] else BLUE + "1c" for i in order],
            linewidths=0.6,
            rasterized=True,
        )
    )
    for bound, where in ((limit, "bottom"), (-limit, "top")):
        ax.axhline(bound, color=RED, lw=0.9, ls=(0, (6, 3)))
        ax.text(ax.get_xlim()[1], 1.015 * bound, f"limit {abs(bound):g} % ", color=RED, ha="right", va=where)
    rod, colour = plan.rods[featured], RED if numbers.refused[featured] else DEEP
    ax.plot(numbers.arc_mm[featured], percent[featured], color=colour, lw=1.6)
    ax.set_xlabel("arc length from where the rod enters the block, mm (shaded: inside the block)")
    ax.set_title("strain κ·d/2, %", loc="left")
    ax.set_title(f"━ leaf {rod.leaf} in block {rod.block}", color=colour)
    ax.set_title("curvature, 1/m", loc="right")
    per_metre = 0.01 / (1e-3 * job.rod.section.half_depth_mm)  # from strain in % to curvature in 1/m
    scale: tuple[Any, Any] = (lambda e: e * per_metre, lambda k: k / per_metre)
    right = ax.secondary_yaxis("right", functions=scale)
    right.spines["right"].set_visible(True)
    return _svg(figure)


def draw_forces(plan: CutPlan, job: CutJob, numbers: RodNumbers) -> str:
    """Force and greater moment at the grippers for every leaf; an address of an embedded picture."""
    figure = Figure(figsize=(WIDTH_IN, 2.5))
    leaf = np.array([r.leaf for r in plan.rods])
    moments = 1e-3 * np.maximum(np.abs(numbers.moment_left_nmm), np.abs(numbers.moment_right_nmm))
    most = None if job.gripper.max_moment_nmm is None else 1e-3 * job.gripper.max_moment_nmm
    colours = [RED if refused else BLUE for refused in numbers.refused]
    for place, values, name, limit in (
        (0.062, numbers.force_n, "force at either gripper, N", job.gripper.max_force_n),
        (0.562, moments, "greater moment of the two grippers, N·m", most),
    ):
        ax = figure.add_axes((place, 0.19, 0.4, 0.66))
        ax.scatter(leaf, values, s=5, c=colours, alpha=0.55, lw=0, rasterized=True)
        ax.set_ylim(0.0, 1.08 * max(float(values.max()), limit or 1e-9))
        ax.set_xlim(float(leaf.min()) - 1.0, float(leaf.max()) + 1.0)
        if limit is not None:
            ax.axhline(limit, color=RED, lw=0.9, ls=(0, (6, 3)))
        ax.set_xlabel("leaf")
        ax.set_title(name, loc="left")
    return _svg(figure)
