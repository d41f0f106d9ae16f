"""DXF: curves of the plane as SPLINE entities on the layers "stable" and "unstable"."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from typing import Any

import ezdxf as _ezdxf
import numpy as np
from ezdxf import units as _units

from batten.curves.bezier import CubicBezier
from batten.errors import InvalidInputError
from batten.io.drawn_curve import LAYERS, DrawnCurve, Unit

ezdxf: Any = _ezdxf
units: Any = _units


def dxf_text(curves: Sequence[DrawnCurve], tolerance: float, unit: Unit = None) -> str:
    """Curves as a DXF document of AutoCAD 2010.

    Each is one SPLINE of degree 3, the exact conversion of its Béziers: knots of multiplicity three where two of them meet
    (with one tangent), the parameter of each from i to i + 1. Curves that are not stable lie on a layer with dashed lines.
    Each has its title as extended data of the application BATTEN.

    Parameters:
        curves: one or more.
        tolerance: greatest distance from the elastica, in the curves' unit, above 0 (see `Elastica.to_beziers`).
        unit: "mm", or None for a drawing without a unit.

    Returns:
        The document's text; the same curves give the same text.

    Raises:
        InvalidInputError: no curves, or a tolerance that is not above 0.

    Accuracy: the control points are written with all their digits, so the curves are within the tolerance.

    Example:
        >>> from batten.curves.elastica import Elastica
        >>> arc = DrawnCurve(1, Elastica((0, 0), 0.0, 1.0, (0, 0), 3.0), True, {"energy": "3"})
        >>> document = ezdxf.read(io.StringIO(dxf_text([arc], 1e-6)))
        >>> [(e.dxftype(), e.dxf.layer, e.dxf.degree) for e in document.modelspace()]
        [('SPLINE', 'stable', 3)]
    """
    if not curves:
        raise InvalidInputError("no curves: there is nothing to draw; give one or more")
    if not (math.isfinite(tolerance) and tolerance > 0.0):
        raise InvalidInputError(f"tolerance = {tolerance!r}; allowed are finite numbers above 0, in the curves' unit")
    pieces = [curve.elastica.to_beziers(tolerance) for curve in curves]
    corners = np.concatenate([piece.control_points for row in pieces for piece in row])
    low, high = corners.min(axis=0), corners.max(axis=0)
    extent = float((high - low).max())
    fixed = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True  # no date, no random identifiers
    try:
        document = ezdxf.new("R2010", units=units.MM if unit == "mm" else 0)
        document.appids.add("BATTEN")
        dash = extent / 60.0
        document.linetypes.add("DASHED", [2.0 * dash, dash, -dash], description="Dashed __ __ __ __")
        document.layers.add(LAYERS[0], color=5)
        document.layers.add(LAYERS[1], color=1, linetype="DASHED")
        space = document.modelspace()
        for curve, beziers in zip(curves, pieces):
            spline = space.add_spline(degree=3, dxfattribs={"layer": curve.layer, "true_color": _colour(curve)})
            points, knots = _joined(beziers)
            spline.control_points = points
            spline.knots = knots
            spline.set_xdata("BATTEN", [(1000, curve.title[:255])])
        document.set_modelspace_vport(height=1.1 * extent, center=tuple(float(c) for c in 0.5 * (low + high)))
        text = io.StringIO()
        document.write(text)
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = fixed
    return text.getvalue()


def _joined(beziers: Sequence[CubicBezier]) -> tuple[list[tuple[float, float, float]], list[float]]:
    """Control points (3 n + 1) and knots (3 n + 5) of n Béziers end to end."""
    points = [beziers[0].control_points[0], *(p for bezier in beziers for p in bezier.control_points[1:])]
    knots = [0.0, *(float(i) for i in range(len(beziers) + 1) for _ in range(3)), float(len(beziers))]
    return [(float(x), float(y), 0.0) for x, y in points], knots


def _colour(curve: DrawnCurve) -> int:
    red, green, blue = curve.colour
    return red << 16 | green << 8 | blue
