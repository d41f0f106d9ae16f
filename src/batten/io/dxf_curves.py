"""The plane curves of a DXF drawing: LINE, ARC, CIRCLE, LWPOLYLINE with bulges, SPLINE."""

from __future__ import annotations

import math
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import ezdxf as _ezdxf
import numpy as np

from batten.curves.base import Curve
from batten.curves.bspline import BSplineCurve
from batten.curves.elastica import Elastica
from batten.curves.piecewise import PiecewiseCurve
from batten.curves.polyline import Polyline
from batten.errors import FormatError, InvalidInputError
from batten.typing import FloatArray

ezdxf: Any = _ezdxf


def read_dxf_curves(path: Path) -> tuple[list[tuple[str, Curve]], tuple[str, ...]]:
    """The curves of the model space by name, "LINE 1F" from type and handle, and notes on what was left alone.

    Lines and polylines without bulges become `Polyline`, arcs exact circles, polylines with bulges a `PiecewiseCurve`,
    splines `BSplineCurve`. Other entities, rational splines, and what does not lie in the plane seen from above are left.

    Raises:
        FormatError: no DXF, or a damaged one.

    Example:
        >>> import tempfile
        >>> document = ezdxf.new()
        >>> _ = document.modelspace().add_lwpolyline([(0, 0, 1), (2, 0, 0)], format="xyb", close=True)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     document.saveas(Path(folder) / "half.dxf")
        ...     curves, notes = read_dxf_curves(Path(folder) / "half.dxf")
        >>> round(curves[0][1].length - math.pi - 2.0, 12)
        0.0
    """
    try:
        document = ezdxf.readfile(str(path))
    except (ezdxf.DXFError, UnicodeDecodeError, ValueError) as error:
        raise FormatError(f"{path}: is no DXF that can be read ({error}); save it again as ASCII DXF") from error
    except OSError as error:
        if path.is_file():
            raise FormatError(f"{path}: is no DXF ({error})") from error
        raise
    found: list[tuple[str, Curve]] = []
    left: Counter[str] = Counter()
    for entity in document.modelspace():
        kind = entity.dxftype()
        if not _seen_from_above(entity):
            left[f"{kind} not in the plane seen from above"] += 1
            continue
        try:
            curve = _curve(entity, kind)
        except InvalidInputError as error:
            raise FormatError(f"{path}: {kind} {entity.dxf.handle}: {error}") from error
        if curve is None:
            left["rational SPLINE" if kind == "SPLINE" else kind] += 1
        else:
            found.append((f"{kind} {entity.dxf.handle}", curve))
    return found, tuple(f"{count} × {what} left out" for what, count in sorted(left.items()))


def _seen_from_above(entity: Any) -> bool:
    if entity.dxf.hasattr("extrusion"):
        x, y, z = entity.dxf.extrusion
        return bool(abs(x) < 1e-9 and abs(y) < 1e-9 and z > 0.0)
    return True


def _curve(entity: Any, kind: str) -> Curve | None:
    if kind == "LINE":
        return Polyline(np.array([tuple(entity.dxf.start)[:2], tuple(entity.dxf.end)[:2]], dtype=np.float64))
    if kind in ("ARC", "CIRCLE"):
        first, last = (entity.dxf.start_angle, entity.dxf.end_angle) if kind == "ARC" else (0.0, 360.0)
        turn = math.radians((last - first) % 360.0 or 360.0)
        x, y = tuple(entity.dxf.center)[:2]
        return _arc(np.array([x, y]), float(entity.dxf.radius), math.radians(first), turn)
    if kind == "LWPOLYLINE":
        return _polyline(np.array(entity.get_points("xyb"), dtype=np.float64).reshape(-1, 3), bool(entity.closed))
    if kind == "SPLINE":
        points = np.array(entity.control_points, dtype=np.float64).reshape(-1, 3)
        if not len(points):  # fit points alone
            points = np.array(entity.fit_points, dtype=np.float64).reshape(-1, 3)
            return BSplineCurve.interpolate(points[:, :2]) if len(points) else None
        weights = np.array(entity.weights, dtype=np.float64)
        if len(weights) and np.ptp(weights) > 1e-12 * abs(weights).max():
            return None
        return BSplineCurve(np.array(entity.knots, dtype=np.float64), points[:, :2], int(entity.dxf.degree))
    return None


def _arc(centre: FloatArray, radius: float, first: float, turn: float) -> Elastica:
    """A circular arc from the direction `first` seen from its centre, by `turn`, positive counter-clockwise."""
    start = centre + radius * np.array([math.cos(first), math.sin(first)])
    sign = math.copysign(1.0, turn)
    return Elastica(start, first + sign * 0.5 * math.pi, sign / radius, np.zeros(2), radius * abs(turn))


def _polyline(rows: FloatArray, closed: bool) -> Curve:
    """Vertices with bulges, the tangents of a quarter of the arcs' turns."""
    if closed and len(rows) and (rows[0, :2] != rows[-1, :2]).any():
        rows = np.concatenate([rows, rows[:1]])
    if len(rows):
        rows = rows[np.concatenate([(np.diff(rows[:, :2], axis=0) != 0.0).any(axis=1), [True]])]
    if len(rows) < 2 or not rows[:-1, 2].any():
        return Polyline(rows[:, :2])
    pieces: list[Curve] = []
    for (x0, y0, bulge), (x1, y1, _) in pairwise(rows.tolist()):
        a, b = np.array([x0, y0]), np.array([x1, y1])
        if bulge == 0.0:
            pieces.append(Polyline(np.stack([a, b])))
            continue
        turn, chord = 4.0 * math.atan(bulge), b - a
        radius = float(np.hypot(*chord)) / (2.0 * abs(math.sin(0.5 * turn)))
        angle = math.atan2(chord[1], chord[0]) - 0.5 * turn
        pieces.append(Elastica(a, angle, math.copysign(1.0 / radius, turn), np.zeros(2), radius * abs(turn)))
    return PiecewiseCurve(pieces)
