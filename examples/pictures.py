"""The picture of README.md, drawn from a job by batten itself: a wall as it is cut, and one of its blocks with its rods.

python examples/pictures.py [JOB.toml [PICTURE.png [BLOCK]]]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import LinearSegmentedColormap, to_rgb
from matplotlib.figure import Figure
from PIL import Image

from batten.fabrication.cut import plan_cut
from batten.fabrication.kerf import blade_surface
from batten.io.job import load_job
from batten.io.job_surface import read_job_surface
from batten.surfaces.deviation import surface_deviation

EXAMPLES = Path(__file__).resolve().parent
INK, SOFT, FOAM, REFUSED = "#1c2733", "#66727f", "#e9e2cf", "#d24a12"
DEVIATION = LinearSegmentedColormap.from_list("deviation", ["#f3f7fa", "#9cc8e4", "#3d87bd", "#123f6d"])
SUN = np.array([-0.62, -0.05, 0.78])
GRID = 33  # points of a block's cut, each way
DPI = 104


class View:
    """A parallel projection: the eye looks down at `lift` degrees and is turned by `turn` degrees about z."""

    def __init__(self, turn, lift):
        a, b = np.radians([turn, lift])
        right = np.array([np.cos(a), np.sin(a), 0.0])
        ahead = np.array([-np.sin(a), np.cos(a), 0.0])
        self.axes = np.stack([right, np.sin(b) * ahead + np.cos(b) * np.array([0.0, 0.0, 1.0])])
        self.away = np.cos(b) * ahead - np.sin(b) * np.array([0.0, 0.0, 1.0])

    def flat(self, points):
        return points @ self.axes.T

    def depth(self, points):
        return points @ self.away


class Cut:
    """What the blade leaves of one block: the strips between its successive positions, on a grid over the block's plan."""

    def __init__(self, plan, block, surface, limit):
        self.block = block
        self.rods = [r for r in plan.rods if r.block == block.number]
        u, v = np.meshgrid(*(np.linspace(0.0, 1.0, GRID),) * 2, indexing="ij")
        plan_points = block.corner_mm[:2] + np.stack([u, v], axis=-1) * block.size_mm[:2]
        heights, offsets = [], []
        for rod in self.rods:
            piece = rod.piece.point(np.linspace(0.0, 1.0, 129))
            x, _ = np.moveaxis(rod.plane.to_plane(np.dstack([plan_points, np.zeros_like(u)])), -1, 0)
            heights.append(np.interp(x, *piece.T) + rod.plane.origin[2])
            offsets.append((plan_points - rod.plane.origin[:2]) @ rod.plane.normal[:2])
        offset = np.array(offsets)  # (rods, GRID, GRID), monotone in the first index
        sign = np.sign(offset[-1, 0, 0] - offset[0, 0, 0])
        before = np.clip((sign * offset < 0.0).sum(axis=0) - 1, 0, len(self.rods) - 2)[None]
        a, b = (np.take_along_axis(offset, before + i, axis=0)[0] for i in (0, 1))
        share = np.clip(a / (a - b), 0.0, 1.0)
        low, high = (np.take_along_axis(np.array(heights), before + i, axis=0)[0] for i in (0, 1))
        self.points = np.dstack([plan_points, (1.0 - share) * low + share * high])
        self.colours = DEVIATION(np.abs(surface_deviation(surface, self.points).signed) / limit)[..., :3]
        refused = np.array([r.status == "refused" for r in self.rods])
        self.colours[(refused[before[0]] | refused[before[0] + 1])] = to_rgb(REFUSED)

    def top(self, view):
        """Faces (k, 4, 3) of the cut from far to near, and their colours."""
        p, c = self.points, self.colours
        quads = np.stack([p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]], axis=2).reshape(-1, 4, 3)
        colours = (0.25 * (c[:-1, :-1] + c[1:, :-1] + c[1:, 1:] + c[:-1, 1:])).reshape(-1, 3)
        normals = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        order = np.argsort(-view.depth(quads.mean(axis=1)), kind="stable")
        return quads[order], lit(colours[order], normals[order])

    def sides(self, view, bottom):
        """The sides of the block below the cut that face the eye, and their colours."""
        p = self.points
        faces, colours = [], []
        edges = ((p[:, 0], (0, -1)), (p[-1], (1, 0)), (p[::-1, -1], (0, 1)), (p[0, ::-1], (-1, 0)))
        for edge, normal in edges:
            out = np.array([*normal, 0.0])
            if out @ view.away < 0.0:
                foot = edge[[-1, 0]].copy()
                foot[:, 2] = bottom
                faces.append(np.concatenate([edge, foot]))
                colours.append(np.array(to_rgb(FOAM)) * (0.97 if out[0] else 0.85))
        return faces, colours

    def border(self):
        p = self.points
        return np.concatenate([p[:, 0], p[-1], p[::-1, -1], p[0, ::-1]])


def lit(colours, normals):
    """Colours (k, 3) of faces with these normals, in the light."""
    light = 0.62 + 0.42 * np.clip(normals @ (SUN / np.linalg.norm(SUN)), 0.0, 1.0)
    return np.clip(colours * light[:, None], 0.0, 1.0)


def draw_cut(axes, view, cut, bottom):
    """One block as it is cut; blocks are drawn from far to near."""
    quads, colours = cut.top(view)
    axes.add_collection(PolyCollection(view.flat(quads), facecolors=colours, edgecolors=colours, linewidths=0.3))
    axes.add_collection(PolyCollection([view.flat(cut.border())], facecolors="none", edgecolors=SOFT, linewidths=0.4))
    faces, colours = cut.sides(view, bottom)
    axes.add_collection(
        PolyCollection([view.flat(f) for f in faces], facecolors=colours, edgecolors=SOFT, linewidths=0.4)
    )


def draw_rods(axes, view, cut):
    """One block with some of its rods from gripper to gripper: behind it, on the cut, and in front of it."""
    low, high = cut.block.corner_mm, cut.block.corner_mm + cut.block.size_mm
    chosen = cut.rods[2:-2:5] or cut.rods[::5]
    behind, upon, before, ends = [], [], [], []
    for rod in chosen:
        points = rod.plane.to_world(rod.rod.point(np.linspace(0.0, 1.0, 401)))
        middle = 0.5 * (points[1:] + points[:-1])
        beyond = np.where(middle < low, -1.0, np.where(middle > high, 1.0, 0.0)) * [1, 1, 0]
        for segment, side in zip(np.stack([points[:-1], points[1:]], axis=1), beyond @ view.away):
            (upon if side == 0.0 else behind if side > 0.0 else before).append(segment)
        ends += [points[0], points[-1]]
    style = {"facecolors": "none", "capstyle": "round", "closed": False}
    axes.add_collection(
        PolyCollection(view.flat(np.reshape(behind, (-1, 2, 3))), edgecolors=INK, linewidths=1.1, **style)
    )
    quads, colours = cut.top(view)
    lines = np.reshape(upon, (-1, 2, 3))
    # Rods and faces of the cut together, from far to near: a hill hides the rods behind it.
    place = np.concatenate([view.depth(quads.mean(axis=1)), view.depth(lines.mean(axis=1)) - 12.0])
    paths = [*view.flat(quads), *view.flat(lines)]
    clear = np.zeros((len(lines), 4))
    face = np.concatenate([np.c_[colours, np.ones(len(colours))], clear])
    edge = np.concatenate([np.c_[colours, np.ones(len(colours))], np.tile([*to_rgb(INK), 1.0], (len(lines), 1))])
    width = np.concatenate([np.full(len(quads), 0.3), np.full(len(lines), 1.1)])
    order = np.argsort(-place, kind="stable")
    axes.add_collection(
        PolyCollection(
            [paths[i] for i in order],
            facecolors=face[order],
            edgecolors=edge[order],
            linewidths=width[order],
            closed=False,
        )
    )
    faces, colours = cut.sides(view, float(low[2]))
    axes.add_collection(
        PolyCollection([view.flat(f) for f in faces], facecolors=colours, edgecolors=SOFT, linewidths=0.5)
    )
    axes.add_collection(
        PolyCollection(view.flat(np.reshape(before, (-1, 2, 3))), edgecolors=INK, linewidths=1.1, **style)
    )
    axes.plot(*view.flat(np.array(ends)).T, "o", ms=5.0, mfc="white", mec=INK, mew=1.0)


def draw(plan, surface, job, path, featured):
    """Both parts of the picture, side by side, into a PNG file."""
    limit = job.leaves.tolerance_mm
    view = View(-30.0 if plan.blade_axis == "x" else 60.0, 36.0)
    cuts = {b.number: Cut(plan, b, surface, limit) for b in plan.blocks}
    figure = Figure(figsize=(12.0, 5.0), dpi=DPI)
    wall, detail = figure.add_axes((0.0, 0.0, 0.58, 1.0)), figure.add_axes((0.6, 0.03, 0.39, 0.88))
    base = min(float(b.corner_mm[2]) for b in plan.blocks)
    far_to_near = sorted(plan.blocks, key=lambda b: -view.depth(np.array([*(b.corner_mm + 0.5 * b.size_mm)[:2], 0.0])))
    for block in far_to_near:
        draw_cut(wall, view, cuts[block.number], base)
    wall.plot(*view.flat(cuts[featured].border()).T, color=INK, lw=1.3)
    draw_rods(detail, view, cuts[featured])
    for axes in (wall, detail):
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.autoscale_view()
    _words(figure, plan, cuts[featured], limit)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3].astype(np.int64)
    pixels = np.minimum((pixels + 3) // 6 * 6, 255).astype(np.uint8)  # fewer colours make a smaller file
    Image.fromarray(pixels).save(path, optimize=True)


def _words(figure, plan, cut, limit):
    bar = figure.add_axes((0.03, 0.9, 0.13, 0.022))
    bar.imshow(np.linspace(0, 1, 128)[None], cmap=DEVIATION, aspect="auto", extent=(0, limit, 0, 1))
    bar.set_yticks([])
    bar.set_xticks([0.0, limit], labels=["0", f"{limit:g} mm"])
    bar.tick_params(length=0, labelsize=8.5, labelcolor=INK, pad=2)
    bar.set_title("deviation from the design", loc="left", fontsize=9, color=INK, pad=3)
    for spine in bar.spines.values():
        spine.set_visible(False)
    length = cut.rods[0].rod.length
    text = f"block {cut.block.number} with every fifth of its rods, each {length / 1000:g} m from gripper to gripper"
    figure.text(0.6, 0.95, text, color=INK, fontsize=9, va="center")


def main(arguments):
    job = load_job(arguments[0] if arguments else EXAMPLES / "freeform-wall" / "wall.toml")
    path = Path(arguments[1]) if len(arguments) > 1 else EXAMPLES.parent / "docs" / "pictures" / "wall.png"
    featured = int(arguments[2]) if len(arguments) > 2 else 16
    surface = read_job_surface(job.surface)
    path.parent.mkdir(parents=True, exist_ok=True)
    # The blade runs half the kerf beside the design: its distance from where it should run is the face's from the design.
    draw(plan_cut(job, surface), blade_surface(job, surface).surface, job, path, featured)
    print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
