"""One picture of all shapes of a bent rod: stable ones full, unstable ones dashed, the grippers, and a legend in numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from batten.errors import InvalidInputError
from batten.fabrication.rod import Rod
from batten.io.bend_numbers import BendNumbers, BendProblem, BendSolution, bend_numbers
from batten.io.bend_table import margin_text, text_of, turns_text
from batten.io.drawn_curve import PALETTE
from batten.typing import FloatArray

INK, SOFT, FAINT, RED = "#1c2733", "#66727f", "#dfe3e7", "#ba2c34"
WIDTH_IN, DPI = 8.0, 150.0
"""1200 pixels."""
_JAW_CORNERS = 8
_SAMPLES = 401
_ROW_IN = 0.235
_STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8.5,
    "text.color": INK,
}
_DASHES: tuple[float, tuple[float, float]] = (0.0, (4.5, 2.2))
_Cell: TypeAlias = tuple[str, str]  # text and colour


def write_bend_png(
    problem: BendProblem, solutions: Sequence[BendSolution], path: str | Path, rod: Rod | None = None
) -> None:
    """Draw all shapes into one picture of 1200 pixels' width.

    Shapes are numbered 1, 2, 3 … by energy, in the picture and in the legend, which says for each whether it is stable, its
    L∫κ² ds, margin, inflections and turns, with a rod also force, energy, greatest strain (red where it is above the rod's)
    and least radius. x and y have one scale. The same input gives the same bytes.

    Parameters:
        problem: where the grippers are.
        solutions: one or more.
        path: the file to write, replaced if it exists.
        rod: the rod; None without one.

    Raises:
        InvalidInputError: no solutions.
        OSError: the file cannot be written.

    Accuracy: curves are polylines of 401 points.
    """
    if not solutions:
        raise InvalidInputError("no solutions: there is nothing to draw; give one or more")
    rows = bend_numbers(solutions, rod)
    curves = [row.solution.elastica.point(np.linspace(0.0, 1.0, _SAMPLES)) for row in rows]
    with matplotlib.rc_context(_STYLE):
        figure = _figure(problem, rows, curves, rod)
        FigureCanvasAgg(figure)
        figure.savefig(path, format="png", dpi=DPI, metadata={"Software": None})


def _figure(problem: BendProblem, rows: Sequence[BendNumbers], curves: Sequence[FloatArray], rod: Rod | None) -> Figure:
    """The picture above, the legend below."""
    every = np.concatenate(curves)
    extent = float(np.ptp(every, axis=0).max())
    jaws = [shape for end in _ends(problem, extent) for shape in end]
    every = np.concatenate([every, *jaws])
    low, high = every.min(axis=0), every.max(axis=0)
    margin = 0.04 * float((high - low).max())
    size = high - low + 2.0 * margin
    plot_width = WIDTH_IN - 0.4
    plot_height = float(np.clip(plot_width * size[1] / size[0], 1.2, 6.6))
    legend_height = _ROW_IN * (len(rows) + 1) + 0.1
    top, bottom = 0.48, 0.16
    height = top + plot_height + 0.15 + legend_height + bottom
    figure = Figure(figsize=(WIDTH_IN, height), facecolor="white")
    axes = figure.add_axes(
        (0.2 / WIDTH_IN, (bottom + legend_height + 0.15) / height, plot_width / WIDTH_IN, plot_height / height)
    )
    axes.set_axis_off()
    middle, half = 0.5 * (low + high), 0.5 * max(size[0] / plot_width, size[1] / plot_height)
    axes.set_xlim(middle[0] - half * plot_width, middle[0] + half * plot_width)  # one scale for x and y
    axes.set_ylim(middle[1] - half * plot_height, middle[1] + half * plot_height)
    for row, points in reversed(list(zip(rows, curves))):
        full = row.solution.stable
        line = axes.plot(*points.T, color=_colour(row), lw=2.3 if full else 1.5, zorder=3.0 if full else 2.5)[0]
        line.set_linestyle("-" if full else _DASHES)
        line.set_dash_capstyle("butt")
        line.set_solid_capstyle("butt")
    for outline in jaws:
        if (
            len(outline) == _JAW_CORNERS
        ):  # the rod goes on into them: 0, 5 lie beside its end, 6, 7 at the slot's bottom
            inside = np.stack([outline[[0, 5]].mean(axis=0), outline[[6, 7]].mean(axis=0)])
            axes.plot(*inside.T, color=SOFT, lw=2.3, zorder=2.0, solid_capstyle="butt")
        axes.add_patch(Polygon(outline, closed=True, facecolor=INK, edgecolor="white", lw=0.6, zorder=4.0))
    for row, place in zip(rows, _label_places(curves, extent)):
        _badge(axes, place, row)
    stable = sum(row.solution.stable for row in rows)
    title = f"{len(rows)} shape{'s' if len(rows) > 1 else ''} of length {text_of(problem.length)}"
    title += "" if rod is None else " mm"
    figure.text(0.2 / WIDTH_IN, 1.0 - 0.27 / height, title, size=10.5, weight="bold", va="center")
    about = f"{stable} stable (full), {len(rows) - stable} unstable (dashed)"
    about += "" if rod is None else f"   ·   {rod.section.description}, strain up to {100.0 * rod.max_strain:g} %"
    figure.text(1.0 - 0.2 / WIDTH_IN, 1.0 - 0.27 / height, about, color=SOFT, va="center", ha="right")
    _legend(figure, rows, bottom, legend_height, height)
    return figure


def _colour(row: BendNumbers) -> str:
    return "#{:02x}{:02x}{:02x}".format(*PALETTE[(row.number - 1) % len(PALETTE)])


def _ends(problem: BendProblem, extent: float) -> list[list[FloatArray]]:
    """Each gripper as outlines: two jaws beside the rod, outside the bent part, and a back; a pin as a disc."""
    long, gap, thick = 0.055 * extent, 0.007 * extent, 0.016 * extent
    found = []
    for place, angle, sign in ((problem.start, problem.start_angle, -1.0), (problem.end, problem.end_angle, 1.0)):
        if angle is None:
            around = np.linspace(0.0, 2.0 * math.pi, 49)
            found.append([np.array(place) + 0.014 * extent * np.stack([np.cos(around), np.sin(around)], axis=-1)])
            continue
        along = sign * np.array([math.cos(angle), math.sin(angle)])
        across = np.array([-along[1], along[0]])
        profile = [(0.0, gap), (0.0, gap + thick), (long, gap + thick), (long, -gap - thick), (0.0, -gap - thick)]
        profile += [(0.0, -gap), (0.62 * long, -gap), (0.62 * long, gap)]
        found.append([np.array(place) + np.array([a * along + b * across for a, b in profile])])
    return found


def _label_places(curves: Sequence[FloatArray], extent: float) -> list[FloatArray]:
    """For each curve the place on it that is farthest from the other curves, from its ends and from earlier labels."""
    places: list[FloatArray] = []
    candidates = np.arange(_SAMPLES // 10, _SAMPLES - _SAMPLES // 10, 6)
    for i, points in enumerate(curves):
        others = [c[::4] for j, c in enumerate(curves) if j != i]
        at = points[candidates]
        room = np.full(len(at), extent)
        for other in others:
            room = np.minimum(room, np.linalg.norm(at[:, None] - other, axis=2).min(axis=1))
        for taken in places:
            room = np.minimum(room, 0.5 * np.linalg.norm(at - taken, axis=1))
        room = np.minimum(room, 0.12 * extent)  # more room than this is no better: then the nearest to the middle
        middle = np.abs(candidates / (_SAMPLES - 1) - 0.5)
        places.append(at[int(np.argmax(room - 0.02 * extent * middle))])
    return places


def _badge(axes: Any, place: FloatArray, row: BendNumbers) -> None:
    """A number in a disc: full for a stable shape, white for an unstable one."""
    full = row.solution.stable
    axes.annotate(
        str(row.number),
        (float(place[0]), float(place[1])),
        color="white" if full else _colour(row),
        size=8.5,
        weight="bold",
        ha="center",
        va="center_baseline",
        zorder=6.0,
        bbox={"boxstyle": "circle,pad=0.26", "fc": _colour(row) if full else "white", "ec": _colour(row), "lw": 1.2},
    )


def _legend(figure: Figure, rows: Sequence[BendNumbers], bottom: float, legend_height: float, height: float) -> None:
    """A table in the picture's whole width: a sample of the line, and the numbers."""
    axes = figure.add_axes((0.2 / WIDTH_IN, bottom / height, 1.0 - 0.4 / WIDTH_IN, legend_height / height))
    axes.set_axis_off()
    axes.set_xlim(0.0, WIDTH_IN - 0.4)
    axes.set_ylim(legend_height, 0.0)
    columns = _columns(rows)
    left, right = 1.35, WIDTH_IN - 0.4
    step = (right - left) / len(columns)
    for k, (head, cells) in enumerate(columns):
        x = left + (k + 1) * step
        axes.text(x, 0.5 * _ROW_IN, head, color=SOFT, ha="right", va="center_baseline", size=8)
        for i, (text, colour) in enumerate(cells):
            axes.text(x, (i + 1.5) * _ROW_IN, text, color=colour, ha="right", va="center_baseline")
    for i, row in enumerate(rows):
        y = (i + 1.5) * _ROW_IN
        axes.plot([0.0, right], [y - 0.5 * _ROW_IN] * 2, color=FAINT, lw=0.6)
        axes.text(0.18, y, str(row.number), color=_colour(row), weight="bold", ha="right", va="center_baseline")
        full = row.solution.stable
        word, shade = ("stable", INK) if full else ("unstable", SOFT)
        axes.text(0.92, y, word, color=shade, va="center_baseline")
        line = axes.plot([0.29, 0.81], [y, y], color=_colour(row), lw=2.3 if full else 1.5)[0]
        line.set_linestyle("-" if full else _DASHES)


def _columns(rows: Sequence[BendNumbers]) -> list[tuple[str, list[_Cell]]]:
    """Heads of the legend's columns, and their cells with colours."""
    columns = [
        ("L·∫κ²", [(f"{row.scaled_energy:.3f}", INK) for row in rows]),
        ("margin", [(margin_text(row.solution.margin), INK) for row in rows]),
        ("inflections", [(str(row.solution.inflections), INK) for row in rows]),
        ("turns", [(turns_text(row.solution.rotation_number, 3), INK) for row in rows]),
    ]
    bent = [row.rod for row in rows if row.rod is not None]
    if bent:
        columns += [
            ("force N", [(text_of(b.force_size_n, 4), INK) for b in bent]),
            ("energy J", [(text_of(b.energy_j, 4), INK) for b in bent]),
            ("strain %", [(f"{100.0 * b.strain:.3f}", RED if b.too_strained else INK) for b in bent]),
            ("radius mm", [(text_of(b.least_radius_mm, 4), INK) for b in bent]),
        ]
    return columns
