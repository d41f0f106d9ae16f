"""The picture of README.md, drawn from a job by batten itself: a wall as it is cut, and one of its blocks with its rods.

python examples/pictures.py [JOB.toml [PICTURE.png]]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import LinearSegmentedColormap, to_rgb
from matplotlib.figure import Figure

from batten.fabrication.cut import plan_cut
from batten.io.job import load_job
from batten.io.job_surface import read_job_surface
from batten.surfaces.deviation import surface_deviation

EXAMPLES = Path(__file__).resolve().parent
INK, SOFT, FOAM, REFUSED = "#1c2733", "#66727f", "#ece7d9", "#d24a12"
DEVIATION = LinearSegmentedColormap.from_list("deviation", ["#eef4f9", "#9cc5e2", "#3d83b8", "#123f6d"])
SUN = np.array([-0.45, -0.35, 0.82])
ALONG = 17  # points on every piece


class View:
    """A parallel projection: the eye looks down at `lift` degrees, turned by `turn` degrees about z."""

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


def shade(colours, normals):
    """Colours in the light that falls on faces."""
    light = 0.72 + 0.36 * np.clip(normals @ (SUN / np.linalg.norm(SUN)), 0.0, 1.0)
    return np.clip(np.asarray(colours) * light[:, None], 0.0, 1.0)


def cut_faces(rods, points, deviation, limit):
    """The strips that the blade cuts between its successive positions in one block: faces (k, 4, 3) and colours (k, 3)."""
    faces, colours = [], []
    for i in range(len(rods) - 1):
        quad = np.stack([points[i, :-1], points[i, 1:], points[i + 1, 1:], points[i + 1, :-1]], axis=1)
        normal = np.cross(quad[:, 2] - quad[:, 0], quad[:, 3] - quad[:, 1])
        normal *= np.where(normal[:, 2:] < 0.0, -1.0, 1.0) / np.linalg.norm(normal, axis=1, keepdims=True)
        if "refused" in (rods[i].status, rods[i + 1].status):
            own = np.tile(to_rgb(REFUSED), (len(quad), 1))
        else:
            own = DEVIATION(deviation[i, :-1] / limit)[:, :3]
        faces.append(quad)
        colours.append(shade(own, normal))
    return np.concatenate(faces), np.concatenate(colours)


def side_faces(points, bottom):
    """The block's four sides below the cut, as faces (4 polygons of many corners) and colours."""
    faces = []
    for edge in (points[0], points[-1, ::-1], points[::-1, 0], points[:, -1]):
        foot = edge[[-1, 0]].copy()
        foot[:, 2] = bottom
        faces.append(np.concatenate([edge, foot]))
    normals = []
    for face in faces:
        run = face[-2] - face[-1]
        out = np.cross(run, [0.0, 0.0, 1.0])
        normals.append(out / max(np.linalg.norm(out), 1e-9))
    return faces, normals


def draw_block(axes, view, rods, points, deviation, limit, bottom):
    """One block as it is cut: sides that face the eye, then the cut itself, from far to near."""
    faces, normals = side_faces(points, bottom)
    for face, normal in zip(faces, normals):
        normal = normal if normal @ (face[0] - points.mean(axis=(0, 1))) > 0 else -normal
        if normal @ view.away < 0.0:
            colour = shade([to_rgb(FOAM)], normal[None])[0]
            axes.add_collection(
                PolyCollection([view.flat(face)], facecolors=[colour], edgecolors="#b9b3a2", linewidths=0.4)
            )
    quads, colours = cut_faces(rods, points, deviation, limit)
    order = np.argsort(-view.depth(quads.mean(axis=1)), kind="stable")
    flat = view.flat(quads)[order]
    axes.add_collection(PolyCollection(flat, facecolors=colours[order], edgecolors=colours[order], linewidths=0.25))


def draw(plan, surface, job, path, featured=None):
    """Both parts of the picture, side by side, into a PNG file."""
    limit = job.leaves.tolerance_mm
    members = {b.number: [r for r in plan.rods if r.block == b.number] for b in plan.blocks}
    points, deviation = {}, {}
    t = np.linspace(0.0, 1.0, ALONG)
    for number, rods in members.items():
        points[number] = np.array([r.plane.to_world(r.piece.point(t)) for r in rods])
        deviation[number] = np.abs(surface_deviation(surface, points[number]).signed)
    view = View(-28.0 if plan.blade_axis == "x" else 62.0, 33.0)
    figure = Figure(figsize=(12.0, 5.1), dpi=120)
    wall, detail = figure.add_axes((0.0, 0.0, 0.6, 1.0)), figure.add_axes((0.6, 0.02, 0.4, 0.93))
    far_to_near = sorted(plan.blocks, key=lambda b: -view.depth(b.corner_mm + 0.5 * b.size_mm))
    base = min(float(b.corner_mm[2]) for b in plan.blocks)
    for block in far_to_near:
        n = block.number
        draw_block(wall, view, members[n], points[n], deviation[n], limit, base)
    number = featured or far_to_near[-1].number
    block, rods = plan.block(number), members[number]
    outline = view.flat(points[number][:, [0, -1]].transpose(1, 0, 2).reshape(-1, 3))
    _ring(wall, view, points[number])
    draw_rods(detail, view, block, rods, points[number], deviation[number], limit, job)
    del outline
    for axes in (wall, detail):
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.autoscale_view()
        axes.margins(0.02)
    _legend(figure, plan, block, rods, limit)
    FigureCanvasAgg(figure)
    figure.savefig(path, dpi=120, pil_kwargs={"optimize": True})


def _ring(axes, view, points):
    border = np.concatenate([points[0], points[:, -1], points[-1, ::-1], points[::-1, 0]])
    axes.plot(*view.flat(border).T, color=INK, lw=1.1)


def draw_rods(axes, view, block, rods, points, deviation, limit, job):
    """One block with every fourth of its rods, from gripper to gripper."""
    draw_block(axes, view, rods, points, deviation, limit, float(block.corner_mm[2]))
    s = np.linspace(0.0, 1.0, 65)
    chosen = [i for i in range(len(rods)) if i % 5 == 0]
    whole = np.array([rods[i].plane.to_world(rods[i].rod.point(s)) for i in chosen])
    axes.add_collection(LineCollection(view.flat(whole), colors=INK, linewidths=0.9, capstyle="round"))
    ends = view.flat(whole[:, [0, -1]].reshape(-1, 3))
    axes.plot(*ends.T, "o", ms=4.5, mfc="white", mec=INK, mew=0.9)


def _legend(figure, plan, block, rods, limit):
    bar = figure.add_axes((0.03, 0.9, 0.14, 0.022))
    bar.imshow(np.linspace(0, 1, 128)[None], cmap=DEVIATION, aspect="auto", extent=(0, limit, 0, 1))
    bar.set_yticks([])
    bar.set_xticks([0.0, limit], labels=["0", f"{limit:g} mm"])
    bar.tick_params(length=0, labelsize=8, labelcolor=INK, pad=2)
    bar.set_title("deviation from the surface", loc="left", fontsize=8.5, color=INK, pad=3)
    for spine in bar.spines.values():
        spine.set_visible(False)


def main(arguments):
    job = load_job(arguments[0] if arguments else EXAMPLES / "freeform-wall" / "wall.toml")
    path = Path(arguments[1]) if len(arguments) > 1 else EXAMPLES.parent / "docs" / "pictures" / "wall.png"
    surface = read_job_surface(job.surface)
    plan = plan_cut(job, surface)
    path.parent.mkdir(parents=True, exist_ok=True)
    draw(plan, surface, job, path)
    print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
