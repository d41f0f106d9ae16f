"""Design curves as a Rhino file, which a job of `batten cut` reads: one layer for each design."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import rhino3dm as _rhino3dm

from batten.curves.bspline import BSplineCurve
from batten.errors import InvalidInputError
from batten.io.rhino import DesignCurves
from batten.io.rhino_curves import Drawing
from batten.typing import FloatArray

rhino3dm: Any = _rhino3dm  # its own stubs call read-only what can be written, and leave out much

_COLOUR = (210, 74, 18)


def write_design_curves(path: str | Path, designs: Mapping[str, DesignCurves]) -> None:
    """Design curves as NURBS in their planes, in mm, one layer for each design; `read_design_curves` reads them back.

    Parameters:
        path: the file; it appears whole or not at all, and replaces an earlier one.
        designs: by the name of the layer, 1 to 60 characters without a colon.

    Raises:
        InvalidInputError: a name that no layer can have.
        FormatError: Rhino's library calls a curve invalid; nothing is written then.
        OSError: the file cannot be written.

    Accuracy: degree, knots and control points bit by bit, but for the knots outside the domain.
    """
    for name in designs:
        if not (len(name.strip()) > 0 and len(name) <= 60 and ":" not in name):
            raise InvalidInputError(f"a layer has a name of 1 to 60 characters without a colon; got {name!r}")
    draw = Drawing(dict.fromkeys(designs, _COLOUR), "mm")
    for name, design in designs.items():
        axes = [0, 2] if design.blade_axis == "x" else [1, 2]
        for curve, position in zip(design.curves, design.positions.tolist()):
            points = np.full((len(curve.control_points), 3), position)
            points[:, axes] = curve.control_points
            draw.add(name, f"{name} at {position:g} mm", _nurbs_curve(curve, points), {})
    draw.write(Path(path))


def _nurbs_curve(curve: BSplineCurve, points: FloatArray) -> Any:
    """A curve with these control points in space, (n, 3); Rhino leaves out the first and the last knot."""
    nurbs = rhino3dm.NurbsCurve(3, False, curve.degree + 1, len(points))
    for i, (x, y, z) in enumerate(points.tolist()):
        nurbs.Points[i] = rhino3dm.Point4d(x, y, z, 1.0)
    for i, knot in enumerate(curve.knots[1:-1].tolist()):
        nurbs.Knots[i] = knot
    return nurbs
