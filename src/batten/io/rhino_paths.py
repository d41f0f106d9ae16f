"""The planar cubic curves of a Rhino file as paths of cubics, and the file again with others in their place."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import rhino3dm as _rhino3dm

from batten.errors import FormatError
from batten.io.bezier_paths import BezierPath
from batten.typing import FloatArray

rhino3dm: Any = _rhino3dm  # its own stubs call read-only what can be written, and leave out much

#: Farther from its plane than this share of its extent a curve is called a space curve.
_FLAT = 1e-6


@dataclass(frozen=True, eq=False)
class _Object:
    """An object of the model, its cubics in space (n, 4, 3), which of them are its segment's, and its plane's axes."""

    number: int
    cubics: FloatArray
    segments: list[tuple[int | None, int, int]]
    axes: FloatArray


class RhinoPaths:
    """The curves of a .3dm file that are cubic, not rational and planar, alone or joined to polycurves.

    They are split into Béziers in the coordinates of their plane (world x and y if it is horizontal). Lines, polylines and
    arcs in a polycurve stay as they are. Other curves are left alone: rational ones, other degrees, curves in space,
    polycurves within polycurves; so is everything else. Written again, objects keep identifiers, layers, attributes and
    user texts; a curve that changed has its knots three times each, in its old domain.

    Parameters:
        path: the file.

    Raises:
        FormatError: no .3dm file, or a damaged one; a curve that Rhino calls invalid.

    Example:
        >>> import tempfile
        >>> points = [rhino3dm.Point3d(x, y, 0) for x, y in ((0, 0), (0, 2), (1, 2), (1, 0))]
        >>> model = rhino3dm.File3dm()
        >>> _ = model.Objects.AddCurve(rhino3dm.NurbsCurve.CreateControlPointCurve(points, 3))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     _ = model.Write(str(Path(folder) / "arch.3dm"), 7)
        ...     read = RhinoPaths(Path(folder) / "arch.3dm")
        >>> read.paths[0].control_points.tolist()
        [[[0.0, 0.0], [0.0, 2.0], [1.0, 2.0], [1.0, 0.0]]]
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._model = rhino3dm.File3dm.Read(str(path))
        if self._model is None:
            raise FormatError(f"{path}: is not a Rhino file or is damaged; save it again as .3dm (Rhino 5 or later)")
        self._objects: list[_Object] = []
        found: list[BezierPath] = []
        left: Counter[str] = Counter()
        for number in range(len(self._model.Objects)):
            item = self._model.Objects[number]
            if not isinstance(item.Geometry, rhino3dm.Curve):
                continue
            name = item.Attributes.Name or f"curve {number + 1}"
            if not item.Geometry.IsValid:
                raise FormatError(f"{path}: {name} is not valid; rebuild it in Rhino (Rebuild)")
            taken = _taken(number, item.Geometry)
            if isinstance(taken, str):
                left[taken] += 1
                continue
            entry, fixed = taken
            seen = entry.cubics @ entry.axes.T
            self._objects.append(entry)
            found.append(BezierPath(name, seen, bool(item.Geometry.IsClosed), fixed))
        self.paths = tuple(found)
        self.notes = tuple(f"{count} × {what} left as it is" for what, count in sorted(left.items()))

    def write(self, changed: Sequence[FloatArray], out: Path) -> None:
        """The same file with other curves where they changed, as a file of Rhino 7."""
        model = rhino3dm.File3dm.Read(str(self._path))
        if model is None:
            raise FormatError(f"{self._path}: is no Rhino file any more; nothing was written")
        for entry, path, new in zip(self._objects, self.paths, changed):
            if np.array_equal(path.control_points, new):
                continue
            cubics = entry.cubics + (new - path.control_points) @ entry.axes
            geometry = model.Objects[entry.number].Geometry
            for segment, first, count in entry.segments:
                some = slice(first, first + count)
                if not np.array_equal(path.control_points[some], new[some]):
                    _put(geometry if segment is None else geometry.SegmentCurve(segment), cubics[some])
            if not geometry.IsValid or (isinstance(geometry, rhino3dm.PolyCurve) and geometry.HasGap):
                raise FormatError(f"{out}: {path.name} would not be valid for Rhino; nothing was written")
        written_3dm(model, out)


def written_3dm(model: Any, path: Path) -> None:
    """Write a model as a file of Rhino 7; it appears whole or not at all.

    Raises:
        OSError: the file cannot be written.
    """
    part = path.with_name(f".{path.name}.part")
    try:
        if not model.Write(str(part), 7):
            raise OSError(f"{path}: cannot be written; is the folder there, writable and not full?")
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _taken(number: int, geometry: Any) -> tuple[_Object, np.ndarray[Any, np.dtype[np.bool_]]] | str:
    """A curve as cubics, and which are fixed; or what it is that is left alone."""
    parts: list[tuple[int | None, Any]] = [(None, geometry)]
    if isinstance(geometry, rhino3dm.PolyCurve):
        parts = [(i, geometry.SegmentCurve(i)) for i in range(geometry.SegmentCount)]
    cubics: list[FloatArray] = []
    fixed: list[bool] = []
    segments: list[tuple[int | None, int, int]] = []
    some_free = False
    for segment, part in parts:
        rows: FloatArray | None = _cubics(part)
        free = rows is not None
        if rows is None:
            if segment is None or isinstance(part, rhino3dm.PolyCurve):
                return _kind(part)
            rows = _still(part)
        segments.append((segment, len(cubics), len(rows)))
        cubics += list(rows)
        fixed += [not free] * len(rows)
        some_free |= free
    if not some_free:
        return _kind(geometry)
    whole = np.stack(cubics)
    axes = _plane(whole)
    if axes is None:
        return "curve that is not planar"
    return _Object(number, whole, segments, axes), np.array(fixed)


def _kind(geometry: Any) -> str:
    if isinstance(geometry, rhino3dm.NurbsCurve):
        return "rational curve" if geometry.IsRational else f"curve of degree {geometry.Degree}"
    return type(geometry).__name__


def _cubics(part: Any) -> FloatArray | None:
    """A cubic polynomial NURBS curve as Béziers (n, 4, 3)."""
    if not isinstance(part, rhino3dm.NurbsCurve) or part.Degree != 3 or part.IsRational:
        return None
    copy = part.Duplicate()
    if not copy.MakePiecewiseBezier(True):
        return None
    net = _net(copy)
    return np.stack([net[i : i + 4] for i in range(0, len(net) - 1, 3)]) if len(net) % 3 == 1 else None


def _net(curve: Any) -> FloatArray:
    return np.array([(p.X, p.Y, p.Z) for p in (curve.Points[i] for i in range(len(curve.Points)))])


def _still(part: Any) -> FloatArray:
    """Cubics with the ends and end tangents of a segment that stays: straight ones for a polyline, else one."""
    polyline = part.TryGetPolyline() if isinstance(part, rhino3dm.PolylineCurve) else None
    if polyline is not None:
        corners = np.array([(p.X, p.Y, p.Z) for p in (polyline[i] for i in range(len(polyline)))])
        steps = np.array([0.0, 1.0, 2.0, 3.0])[:, None] / 3.0
        return np.stack([a + steps * (b - a) for a, b in pairwise(corners)])
    points = [np.array([p.X, p.Y, p.Z]) for p in (part.PointAtStart, part.PointAtEnd)]
    tangents = [np.array([p.X, p.Y, p.Z]) for p in (part.TangentAtStart, part.TangentAtEnd)]
    reach = np.linalg.norm(points[1] - points[0]) / 3.0
    return np.stack([points[0], points[0] + reach * tangents[0], points[1] - reach * tangents[1], points[1]])[None]


def _plane(cubics: FloatArray) -> FloatArray | None:
    """Two axes (2, 3) of the curve's plane; None if it has none."""
    points = cubics.reshape(-1, 3) - cubics[0, 0]
    extent = np.ptp(points, axis=0)
    if extent[2] <= _FLAT * extent.max():
        return np.eye(2, 3)
    _, sizes, axes = np.linalg.svd(points, full_matrices=False)
    if sizes[2] > _FLAT * sizes[0]:
        return None
    return axes[:2]


def _put(curve: Any, cubics: FloatArray) -> None:
    """Other control points in a curve of Rhino's, which is split into Béziers for them."""
    curve.MakePiecewiseBezier(True)
    net = [cubics[0, 0].tolist(), *cubics[:, 1:].reshape(-1, 3).tolist()]
    for i, (x, y, z) in enumerate(net):
        curve.Points[i] = rhino3dm.Point4d(x, y, z, 1.0)
