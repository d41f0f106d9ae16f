"""The pictures of "design a surface": the foliations of examples/foliations, one that is put right, and six blocks.

python examples/design_a_surface.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import LinearSegmentedColormap, to_rgb
from matplotlib.figure import Figure
from PIL import Image

from batten.curves.cubic_proxy import CubicProxy
from batten.io.job import load_job
from batten.io.job_surface import read_job_surface
from batten.io.rhino import read_design_curves
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.design_surface import DesignSurface, Rectification, rectified
from batten.surfaces.elastic_foliation import elastic_foliation
from batten.surfaces.isocurves import isocurve_residuals

EXAMPLES = Path(__file__).resolve().parent
FOLDER = EXAMPLES / "foliations"
INK, SOFT, DESIGN, OFFERED, SHELL = "#1c2733", "#8b97a3", "#d24a12", "#2f8f4e", "#f2efe6"
RESIDUAL = LinearSegmentedColormap.from_list("residual", ["#f2efe6", "#f3cfae", "#d24a12"])
SUN = np.array([-0.55, -0.25, 0.8])
DPI, COLOURS = 88, 96
KINDS = ("from concave to convex", "fixed ends", "one end up, the other down", "the same two boundary curves")


class View:
    """A parallel projection: the eye looks down at `lift` degrees and is turned by `turn` degrees about z."""

    def __init__(self, turn: float, lift: float) -> None:
        a, b = np.radians([turn, lift])
        right, ahead = np.array([np.cos(a), np.sin(a), 0.0]), np.array([-np.sin(a), np.cos(a), 0.0])
        self.axes = np.stack([right, np.sin(b) * ahead + np.cos(b) * np.array([0.0, 0.0, 1.0])])
        self.away = np.cos(b) * ahead - np.sin(b) * np.array([0.0, 0.0, 1.0])

    def flat(self, points: np.ndarray) -> np.ndarray:
        return points @ self.axes.T

    def depth(self, points: np.ndarray) -> np.ndarray:
        return points @ self.away


def draw_surface(
    axes: Axes, surface: BSplineSurface, marked: dict[float, str], view: View, leaves: int, by_residual: bool = False
) -> None:
    """A shaded surface, strip by strip from behind to the front, with some isocurves in grey and some of them marked.

    by_residual: colour each piece of an isocurve by its λ-residual, from 0 to 0.4.
    """
    low, high = surface.domain[1]
    u, v = np.linspace(0.0, 1.0, 97), np.linspace(low, high, 4 * (leaves - 1) + 1)
    points = surface.point(u[:, None], v)
    corners = np.stack([points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]], axis=2)
    normal = np.cross(corners[:, :, 2] - corners[:, :, 0], corners[:, :, 3] - corners[:, :, 1])
    light = np.abs(normal @ SUN) / np.linalg.norm(normal, axis=-1) / np.linalg.norm(SUN)
    base = np.broadcast_to(to_rgb(SHELL), (*light.shape, 3))
    if by_residual:
        values = isocurve_residuals(surface, 0.5 * (v[1:] + v[:-1])).residuals.T / 0.4
        base = np.repeat(RESIDUAL(np.clip(values, 0.0, 1.0))[..., :3], 48, axis=0)
    shade = np.clip((0.62 + 0.42 * light)[..., None] * base, 0.0, 1.0)
    behind = view.away[1] > 0.0  # the far strips are those of great v
    for step, k in enumerate(range(len(v) - 2, -1, -1) if behind else range(len(v) - 1)):
        z, face, near = 1.0 + 0.01 * step, shade[:, k], v[k] if behind else v[k + 1]
        quads = list(view.flat(corners[:, k]))
        axes.add_collection(PolyCollection(quads, facecolors=face, edgecolors=face, linewidths=0.4, zorder=z))
        if k % 4 == 0 and k:
            axes.plot(*view.flat(surface.point(u, near)).T, color=SOFT, lw=0.45, zorder=z + 0.012)
        last = near in v[[0, -1]]
        for at, colour in marked.items():
            far = v[k + 1] if behind else v[k]
            if min(near, far) <= at < max(near, far) or (at == high and step == 0) or (last and at == near):
                edge = view.flat(surface.point(u, at))
                axes.plot(*edge.T, color=colour, lw=1.6, zorder=z + 0.014)
                axes.plot(*edge[48], "o", ms=2.6, color=colour, zorder=z + 0.016)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.autoscale_view()


def save(figure: Figure, path: Path) -> None:
    """Write a picture of few colours, which keeps it small."""
    figure.canvas.draw()  # type: ignore[attr-defined]
    image = Image.fromarray(np.asarray(figure.canvas.buffer_rgba()))  # type: ignore[attr-defined]
    image.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)


def read(name: str) -> tuple[BSplineSurface, np.ndarray]:
    """The surface of a job of the examples, and the positions of its design curves."""
    job = load_job(FOLDER / f"{name}.toml").surface
    return read_job_surface(job), read_design_curves(job.source, layer=job.layer).positions


def foliations(path: Path) -> None:
    """The twelve foliations, a row for each kind."""
    names = sorted(p.stem for p in FOLDER.glob("[0-9]*.toml"))
    figure = Figure(figsize=(11.0, 10.4), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    view = View(-34.0, 30.0)
    for i, (name, axes) in enumerate(zip(names, figure.subplots(4, 3).flat)):
        surface, positions = read(name)
        draw_surface(axes, surface, dict.fromkeys(positions.tolist(), DESIGN), view, 25)
        worst = isocurve_residuals(surface, 49).worst
        title = f"({i + 1}) {name[3:].replace('-', ' ')}: {worst:.2f}"
        axes.set_title(f"{KINDS[i // 3]}\n{title}" if i % 3 == 0 else f"\n{title}", fontsize=9, color=INK, loc="left")
    save(figure, path)


def put_right() -> tuple[DesignSurface, Rectification]:
    """An arch and an S with a loft between them that no rod follows, and what is made of it."""
    arch = CubicProxy([(0, 0), (180, 240), (420, 360), (780, 360), (1020, 240), (1200, 0)])
    wave = CubicProxy([(0, 0), (270, -180), (570, -270), (630, 270), (930, 180), (1200, 0)])
    drawn = DesignSurface([arch, wave], [0.0, 600.0])
    return drawn, rectified(drawn, 0.22)


def rectification(path: Path) -> None:
    """λ-residual across the surface before and after, and both surfaces."""
    drawn, found = put_right()
    figure = Figure(figsize=(11.0, 6.4), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.25, 1.0))
    view = View(-34.0, 26.0)
    worsts = []
    for j, (design, title) in enumerate(((drawn, "as drawn"), (found.design, "put right"))):
        marked = {p: DESIGN if p in drawn.positions else OFFERED for p in design.positions.tolist()}
        axes = figure.add_subplot(grid[0, j])
        draw_surface(axes, design.surface, marked, view, 21, by_residual=True)
        worst = design.residuals(481)
        worsts.append(worst)
        axes.set_title(f"{title}: λ-residual up to {worst.worst:.2f}", fontsize=9, color=INK, loc="left")
    axes = figure.add_subplot(grid[1, :])
    for worst, colour, label in zip(worsts, (DESIGN, OFFERED), ("as drawn", "put right")):
        axes.plot(worst.positions, worst.greatest, color=colour, lw=1.4, label=label)
    axes.axhline(0.22, color=INK, lw=0.8, ls=(0, (4, 3)))
    for p in found.design.positions:
        axes.axvline(p, color=SOFT, lw=0.6, zorder=0)
    axes.set(xlabel="across the blade, mm", ylabel="greatest λ-residual", xlim=(0, 600), ylim=(0, None))
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=9)
    save(figure, path)


def six_blocks(path: Path) -> None:
    """The design in six blocks, and how far its two kinds of elastic leaves are from it."""
    surface, positions = read("six-blocks")
    figure = Figure(figsize=(11.0, 5.0), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2, width_ratios=(1.5, 1.0))
    view = View(-38.0, 32.0)
    heights = surface.point(np.linspace(0, 1, 50)[:, None], np.linspace(0, 1650, 50))[..., 2]
    floor = heights.min() - 60.0
    lines = [[(x, 0, floor), (x, 1650, floor)] for x in (0, 550, 1100)]
    lines += [[(0, y, floor), (1100, y, floor)] for y in (0, 550, 1100, 1650)]
    for line in lines:
        left.plot(*view.flat(np.array(line, dtype=float)).T, color=SOFT, lw=0.8, ls=(0, (5, 4)), zorder=0)
    for corner in ((0, 0), (1100, 0), (0, 1650), (1100, 1650)):
        top = surface.point(corner[0] / 1100, corner[1])
        left.plot(*view.flat(np.array([[*corner, floor], top])).T, color=SOFT, lw=0.8, ls=(0, (5, 4)), zorder=0)
    draw_surface(left, surface, dict.fromkeys(positions.tolist(), DESIGN), view, 55)
    for continuity, colour in ((1, OFFERED), (2, INK)):
        leaves = elastic_foliation(surface, 55, continuity=continuity)  # type: ignore[arg-type]
        label = f"C{'¹²'[continuity - 1]} rods by interpolation"
        right.plot(leaves.positions, leaves.distances, color=colour, lw=1.4, label=label)
    right.set(
        xlabel="across the blade, mm", ylabel="distance of the leaf from the loft, mm", xlim=(0, 1650), yscale="log"
    )
    for p in positions:
        right.axvline(p, color=SOFT, lw=0.6, zorder=0)
    right.spines[["top", "right"]].set_visible(False)
    right.legend(frameon=False, fontsize=9)
    save(figure, path)


def main(folder: Path) -> None:
    """Draw the three pictures into a folder."""
    foliations(folder / "foliations.png")
    rectification(folder / "design-surface.png")
    six_blocks(folder / "six-blocks.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else EXAMPLES.parent / "docs/pictures")
