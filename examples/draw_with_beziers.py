"""The picture of a drawing before and after `batten project`, for "draw with Béziers, build with rods".

python examples/draw_with_beziers.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from batten.curves.bezier import CubicBezier
from batten.io.project_files import read_drawing
from batten.measures.lambda_class import lambda_class
from batten.measures.lambda_residual import lambda_residual
from batten.solvers.path_projection import project_path

EXAMPLES = Path(__file__).resolve().parent
SOFT = "#8b97a3"
CLASSES = {"best": "#2f8f4e", "good": "#8cb83c", "borderline": "#e8a33d", "far": "#d24a12"}
TITLES = ("as drawn", "lengths of the handles changed alone", "tangents turned too: every cubic below 0.1")


def drawn_chair(path: Path) -> None:
    """The chair as it is drawn and after two projections, cubics coloured by their class."""
    paths = read_drawing(EXAMPLES / "project/chair.svg").paths
    whole = Figure(figsize=(10.4, 3.3), layout="constrained")
    FigureCanvasAgg(whole)
    for column, axes in enumerate(whole.subplots(1, 3, sharex=True, sharey=True)):
        worst = 0.0
        for one in paths:
            cubics = one.control_points
            if column > 0:
                options = {"threshold": 0.1, "keep": ("tangents", "points")[column - 1]}
                cubics = project_path(cubics, closed=one.closed, fixed=one.fixed, **options).control_points
            e = lambda_residual(cubics)
            worst = max(worst, float(np.nanmax(e)))
            for cubic, colour in zip(cubics, lambda_class(e).tolist()):
                axes.plot(*cubic[:2].T, *cubic[2:].T, color=SOFT, lw=0.7)
                axes.plot(*CubicBezier(cubic).point(np.linspace(0.0, 1.0, 101)).T, color=CLASSES[colour], lw=2.2)
        axes.set_title(f"{TITLES[column]}\ngreatest λ-residual {worst:.2f}", size=10)
        axes.set_aspect("equal")
        axes.axis("off")
    whole.savefig(path, dpi=100)


if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else EXAMPLES.parent / "docs/pictures")
    drawn_chair(folder / "project.png")
