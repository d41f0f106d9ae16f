"""The picture of "any curve by pieces of elastica", and the drawings in examples/approximate that it begins with.

python examples/approximate_curves.py [FOLDER]
python examples/approximate_curves.py --drawings       writes examples/approximate again
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.path import Path as FontPath
from matplotlib.textpath import TextPath

from batten.curves.bspline import BSplineCurve
from batten.io.approximate_files import approximate_curves, read_curves
from batten.io.bezier_paths import BezierPath
from batten.io.path_drawings import write_paths

EXAMPLES = Path(__file__).resolve().parent
DRAWINGS = EXAMPLES / "approximate"
SOFT, INK = "#c3ccd4", "#1c2733"
COLOURS = ("#1f6fb2", "#e0762a")
TOLERANCE = 0.05  # of a letter 100 units high

#: A section through a roof, and a handrail's loop, in metres.
SECTION = [(0, 0), (2, 1.6), (5, 2.2), (8, 1.0), (11, 1.5), (14, 3.1), (17, 2.4), (19, 0)]
HANDRAIL = [(0, 0), (3, -0.4), (5, 1), (4.2, 2.8), (2.5, 2.2), (1.2, 3.2), (-0.8, 2), (0, 0)]


def contours(text: str) -> list[BezierPath]:
    """The outline of a letter of DejaVu Serif, 100 units high, one closed path for each contour."""
    path = TextPath((0.0, 0.0), text, size=100, prop=FontProperties(family="DejaVu Serif"))
    found, rows, here, start = [], [], np.zeros(2), np.zeros(2)
    for numbers, code in path.iter_segments(simplify=False):
        points = numbers.reshape(-1, 2)
        if code == FontPath.MOVETO:
            here, start, rows = points[0], points[0], []
            continue
        if code == FontPath.CURVE3:
            control, end = points
            cubic = np.array([here, (here + 2.0 * control) / 3.0, (2.0 * control + end) / 3.0, end])
        else:
            end = start if code == FontPath.CLOSEPOLY else points[0]
            cubic = here + (end - here) * np.arange(4.0)[:, None] / 3.0
        if (cubic[0] != cubic[3]).any():
            rows.append(cubic)
        here = cubic[3]
        if code == FontPath.CLOSEPOLY:
            found.append(BezierPath(f"contour {len(found) + 1}", np.array(rows), True))
    return found


def drawings(folder: Path) -> None:
    """The drawings that the page reads."""
    write_paths(contours("S"), folder / "letter.svg")
    section = BSplineCurve.interpolate(SECTION).to_beziers()
    write_paths([BezierPath("section", np.array([b.control_points for b in section]), False)], folder / "section.dxf")
    loop = BSplineCurve.interpolate(HANDRAIL).to_beziers()
    write_paths([BezierPath("handrail", np.array([b.control_points for b in loop]), False)], folder / "handrail.3dm")


def every_way(path: Path) -> None:
    """One letter by pieces of elastica: halved and as few as will do, with common points, tangents, curvatures."""
    curves, _ = read_curves(DRAWINGS / "letter.svg")
    whole = Figure(figsize=(9.6, 7.0), layout="constrained")
    FigureCanvasAgg(whole)
    for split, line in zip(("bisect", "fewest"), whole.subplots(2, 3, sharex=True, sharey=True)):
        for continuity, axes in zip(("C0", "C1", "C2"), line):
            found = approximate_curves(curves, TOLERANCE, continuity, split)
            pieces = [piece for one in found for piece in one.result.pieces]
            for k, piece in enumerate(pieces):
                x, y = piece.point(np.linspace(0.0, 1.0, 61)).T
                axes.plot(x, y, color=COLOURS[k % 2], lw=1.8)
                axes.plot(x[[0, -1]], y[[0, -1]], ".", color=INK, ms=4.5)
            axes.set_title(f"{split}, {continuity[0]}{'⁰¹²'[int(continuity[1])]}: {len(pieces)} pieces", size=11)
            axes.set_aspect("equal")
            axes.axis("off")
    whole.savefig(path, dpi=100)


if __name__ == "__main__":
    if sys.argv[1:] == ["--drawings"]:
        drawings(DRAWINGS)
    else:
        every_way(Path(sys.argv[1] if len(sys.argv) > 1 else EXAMPLES.parent / "docs/pictures") / "approximate.png")
