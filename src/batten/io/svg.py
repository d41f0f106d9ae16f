"""SVG: curves of the plane as paths of cubic Béziers, in their own unit, y turned down."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

import numpy as np

from batten.curves.bezier import CubicBezier
from batten.errors import InvalidInputError
from batten.io.drawn_curve import DrawnCurve, Unit
from batten.typing import FloatArray


def svg_text(curves: Sequence[DrawnCurve], tolerance: float, unit: Unit = None) -> str:
    """Curves as an SVG document.

    Each is a `<path>` of cubics with the id "curve-1", its class "stable" or "unstable", its title as `<title>`; drawn full
    if it is stable, dashed if not. SVG's y points down: the numbers themselves are turned, there is no transform.

    Parameters:
        curves: one or more.
        tolerance: greatest distance from the elastica, in the curves' unit, above 0 (see `Elastica.to_beziers`).
        unit: "mm" makes the picture as large as the curves; None leaves its size to the program that shows it.

    Returns:
        The document, UTF-8 in its head; the same curves give the same text.

    Raises:
        InvalidInputError: no curves, or a tolerance that is not above 0.

    Accuracy: the paths as written, with their numbers rounded to a 200th of the tolerance, are within the tolerance.

    Example:
        >>> from batten.curves.elastica import Elastica
        >>> line = DrawnCurve(1, Elastica((0, 1), 0.0, 0.0, (0, 0), 3.0), True, {"energy": "0"})
        >>> 'd="M0,-1C1,-1 2,-1 3,-1"' in svg_text([line], 0.1)
        True
    """
    if not curves:
        raise InvalidInputError("no curves: there is nothing to draw; give one or more")
    if not (math.isfinite(tolerance) and tolerance > 0.0):
        raise InvalidInputError(f"tolerance = {tolerance!r}; allowed are finite numbers above 0, in the curves' unit")
    decimals = max(0, math.ceil(-math.log10(tolerance / 100.0)))
    pieces = [curve.elastica.to_beziers(0.95 * tolerance) for curve in curves]
    corners = np.concatenate([piece.control_points for row in pieces for piece in row]) * (1.0, -1.0)
    extent = float(np.ptp(corners, axis=0).max())
    low, high = corners.min(axis=0) - 0.05 * extent, corners.max(axis=0) + 0.05 * extent
    size = high - low
    stroke = 0.004 * extent
    box = " ".join(f"{value:.9g}" for value in (*low, *size))
    shown = "" if unit is None else f' width="{size[0]:.9g}{unit}" height="{size[1]:.9g}{unit}"'
    rows = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" version="1.1" viewBox="{box}"{shown}>',
        f'<g fill="none" stroke-width="{stroke:.6g}" stroke-linecap="round" stroke-linejoin="round">',
    ]
    for curve, beziers in zip(curves, pieces):
        dashes = "" if curve.stable else f' stroke-dasharray="{3.0 * stroke:.6g} {3.5 * stroke:.6g}"'
        colour = "#{:02x}{:02x}{:02x}".format(*curve.colour)
        rows += [
            f'<path id="curve-{curve.number}" class="{curve.layer}" d="{_path(beziers, decimals)}"',
            f'  stroke="{colour}"{dashes}>',
            f"<title>{escape(curve.title)}</title></path>",
        ]
    return "\n".join([*rows, "</g>", "</svg>", ""])


def _path(beziers: Sequence[CubicBezier], decimals: int) -> str:
    """A path's data: one move, then three points for each cubic."""

    def pair(point: FloatArray) -> str:
        return ",".join(_number(value, decimals) for value in (float(point[0]), -float(point[1])))

    parts = [f"M{pair(beziers[0].control_points[0])}"]
    parts += ["C" + " ".join(pair(point) for point in bezier.control_points[1:]) for bezier in beziers]
    return "".join(parts)


def _number(value: float, decimals: int) -> str:
    """The shortest text of a value rounded to so many decimals, without an exponent and without −0."""
    text = f"{value:.{decimals}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text in ("-0", "") else text
