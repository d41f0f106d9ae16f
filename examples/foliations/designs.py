"""The design curves of the foliations in this folder, as they were drawn; writes them into designs.3dm.

python examples/foliations/designs.py

Every curve is a C¹ spline of two cubics, one for each block along the blade, given by the heights of its six control points
(Fisker2018 §5.2). Their abscissae are those of `EVEN`, but for the curves that lean. All control points lie in their good
regions: λ-residuals below 0.21, the ends of the rods' first guesses within 6° of the curves'.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from batten.curves.cubic_proxy import Border, CubicProxy
from batten.io.design_curves_file import write_design_curves
from batten.io.rhino import DesignCurves
from batten.splines.elastic_spline_design import ElasticSplineDesign
from batten.surfaces.design_surface import DesignSurface, spline_curve

FOLDER = Path(__file__).resolve().parent

EVEN = (0, 200, 400, 800, 1000, 1200)
LEANING = (0, 160, 380, 820, 1040, 1200)
MORE = (0, 120, 360, 840, 1080, 1200)
SIX = (0, 180, 370, 730, 920, 1100)

_FIRST, _LAST = (EVEN, 0, 150, 220, 180, 100, -60), (EVEN, -60, 100, 180, 220, 150, 0)  # of 10, 11 and 12

#: By the name of the layer and of the job: four curves each, 200 mm apart; mm. The last are six blocks, 275 mm apart.
DESIGNS: dict[str, tuple[tuple[tuple[int, ...] | int, ...], ...]] = {
    # from concave to convex (Fig. 5.20)
    "01-arch-to-valley": (
        (EVEN, 0, 150, 230, 230, 150, 0),
        (EVEN, 0, 170, 190, 40, -60, 0),
        (EVEN, 0, 60, -40, -190, -170, 0),
        (EVEN, 0, -150, -230, -230, -150, 0),
    ),
    "02-left-side-first": (
        (EVEN, -100, 100, 220, 240, 140, -60),
        (EVEN, -20, -80, 0, 170, 190, 20),
        (EVEN, 60, -90, -110, 30, 150, 100),
        (EVEN, 120, -80, -200, -220, -120, 80),
    ),
    "03-wave-turns-over": (
        (EVEN, 0, 200, 110, -110, -200, 0),
        (EVEN, 60, 190, 70, -70, -50, 100),
        (EVEN, 100, 50, -40, 60, 180, 50),
        (EVEN, 0, -200, -110, 110, 200, 0),
    ),
    # ends that stay where they are (Fig. 5.21)
    "04-both-ends-fixed": (
        (EVEN, 0, 80, 120, 120, 80, 0),
        (LEANING, 0, 150, 240, 220, 130, 0),
        (MORE, 0, 210, 330, 300, 180, 0),
        (EVEN, 0, 130, 200, 120, 60, 0),
    ),
    "05-left-end-fixed": (
        (EVEN, 0, 120, 190, 190, 160, 120),
        (EVEN, 0, 160, 220, 120, 40, -20),
        (EVEN, 0, 210, 200, 20, -60, -180),
        (EVEN, 0, 240, 160, -60, -220, -300),
    ),
    "06-fixed-ends-of-a-wave": (
        (EVEN, 0, 170, 120, -60, -120, 0),
        (EVEN, 0, 220, 210, 60, -60, 0),
        (EVEN, 0, 180, 260, 220, 120, 0),
        (EVEN, 0, 60, 180, 300, 210, 0),
    ),
    # one end moves up, the other one down (Fig. 5.22)
    "07-see-saw-of-arches": (
        (EVEN, -150, 60, 170, 250, 220, 150),
        (EVEN, -50, 130, 220, 260, 190, 80),
        (EVEN, 60, 200, 250, 210, 120, -20),
        (EVEN, 150, 220, 250, 170, 60, -150),
    ),
    "08-see-saw-of-waves": (
        (EVEN, -160, -60, 90, 190, 160, 160),
        (EVEN, -60, -100, 10, 170, 200, 80),
        (EVEN, 60, -60, -20, 150, 180, -40),
        (EVEN, 160, 40, -60, 40, 70, -160),
    ),
    "09-twist": (
        (EVEN, -160, 90, 140, -60, 0, 170),
        (EVEN, -60, 150, 160, -20, -40, 60),
        (EVEN, 60, 190, 150, 0, -80, -50),
        (EVEN, 170, 210, 60, -60, -160, -120),
    ),
    # the same two boundary curves (Fig. 5.23)
    "10-same-borders-swell": (
        _FIRST,
        (MORE, -10, 210, 370, 350, 230, -50),
        (MORE, -50, 250, 400, 380, 220, -10),
        _LAST,
    ),
    "11-same-borders-dip": (_FIRST, (EVEN, 0, 130, 30, 30, 140, -50), (EVEN, -50, 140, 60, 20, 110, 0), _LAST),
    "12-same-borders-wave": (
        _FIRST,
        (EVEN, -60, 140, 160, -50, -90, 50),
        (EVEN, 20, -40, 10, 160, 210, -10),
        _LAST,
    ),
    # formwork for a shell of 1.1 × 1.65 m, as in Fig. 5.24
    "six-blocks": (
        (SIX, 0, 110, 180, 190, 130, 20),
        (SIX, 10, 150, 230, 200, 110, 0),
        (SIX, 40, 200, 260, 160, 40, -20),
        (SIX, 80, 220, 240, 100, -10, -20),
        (SIX, 100, 210, 230, 120, 30, 10),
        (SIX, 90, 170, 210, 180, 110, 30),
        (SIX, 60, 130, 180, 200, 170, 60),
    ),
}  # fmt: skip


def design(name: str) -> DesignSurface:
    """The surface of a design, its curves with the borders of the blocks."""
    curves = [np.column_stack([abscissae, heights]).astype(float) for abscissae, *heights in DESIGNS[name]]
    width = curves[0][-1, 0]
    borders = tuple(Border.vertical(x) for x in (0.0, 0.5 * width, width))
    step = 275.0 if name == "six-blocks" else 200.0
    return DesignSurface(tuple(CubicProxy(points, 1, borders) for points in curves), step * np.arange(len(curves)))


def main() -> None:
    """Refuse curves with control points outside their good regions, and write the file."""
    layers = {}
    for name in DESIGNS:
        surface = design(name)
        for spline in surface.splines:
            if broken := ElasticSplineDesign(spline).broken:
                sys.exit(f"{name}: {', '.join(map(str, broken))}")
        layers[name] = DesignCurves(tuple(map(spline_curve, surface.splines)), surface.positions, surface.blade_axis)
    write_design_curves(FOLDER / "designs.3dm", layers)


if __name__ == "__main__":
    main()
