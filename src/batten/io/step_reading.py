"""Faces of STEP and IGES files, by Open CASCADE (the extra `cad`)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from batten.errors import FormatError, InvalidInputError
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.face import Face
from batten.surfaces.face_loops import EdgeCurve, parameter_loop_polygon
from batten.typing import FloatArray

STEP_ENDINGS = (".stp", ".step")
IGES_ENDINGS = (".igs", ".iges")

_POINTS = 33  # on an edge, and on ever smaller parts of it, from which its extent is taken
_SAME = 1e-9  # of the domain's width


def step_faces(path: Path, *, trim_mm: float) -> tuple[Face, ...]:
    """Every face of a STEP or IGES file, in mm.

    Parameters:
        path: the file; its ending says which format.
        trim_mm: greatest distance of the middle of a trim's side from the curve that it stands for, mm.

    Returns:
        The faces in the order of the file, named "face 1", "face 2", …; surfaces are shrunk to their trims.

    Raises:
        InvalidInputError: Open CASCADE is not installed; no such file; no face in it.
        FormatError: not such a file, or a damaged one.

    Accuracy: surfaces as Open CASCADE turns them into NURBS, for planes, cylinders, cones, spheres, tori and NURBS exactly.
    """
    try:
        import OCP  # noqa: F401
    except ImportError as error:
        raise InvalidInputError(
            f'{path}: STEP and IGES files need Open CASCADE; install it by pip install "batten[cad]", or save the file '
            "as .3dm"
        ) from error
    from OCP.TopAbs import TopAbs_FACE

    if not path.is_file():
        raise InvalidInputError(f"{path}: no such file")
    shape = _shape(path)
    faces: list[Face] = []
    for number, face in enumerate(_parts(shape, TopAbs_FACE), 1):
        name = f"face {number}"
        try:
            faces.append(_face(face, name, trim_mm))
        except (InvalidInputError, FormatError) as error:
            raise FormatError(f"{path}: {name}: {error}") from error
    if not faces:
        raise InvalidInputError(f"{path}: no face in the file; save surfaces or solids, not curves or meshes")
    return tuple(faces)


def _shape(path: Path) -> Any:
    """What the file holds, in mm, as one shape."""
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.IGESControl import IGESControl_Reader
    from OCP.Interface import Interface_Static
    from OCP.Message import Message, Message_Gravity
    from OCP.STEPControl import STEPControl_Reader

    kind = "STEP" if path.suffix.lower() in STEP_ENDINGS else "IGES"
    with path.open("rb") as stream:
        head = stream.read(1024)
    # Open CASCADE takes any text for an empty IGES file; lines of a real one bear their section's letter in column 73.
    if (b"ISO-10303-21" not in head) if kind == "STEP" else (head[72:73] not in (b"S", b"C", b"B")):
        raise FormatError(f"{path}: is not a {kind} file; save the design again as {path.suffix}")
    for printer in Message.DefaultMessenger_s().Printers():  # it would write to the screen
        printer.SetTraceLevel(Message_Gravity.Message_Fail)
    reader = STEPControl_Reader() if kind == "STEP" else IGESControl_Reader()
    Interface_Static.SetCVal_s("xstep.cascade.unit", "MM")
    if reader.ReadFile(str(path)) != IFSelect_RetDone:
        raise FormatError(
            f"{path}: Open CASCADE cannot read this {kind} file, it may be cut short; save the design again"
        )
    reader.TransferRoots()
    shape = reader.OneShape()
    if shape is None or shape.IsNull():
        raise InvalidInputError(f"{path}: no shape in the file that Open CASCADE can read; save surfaces or solids")
    return shape


def _parts(shape: Any, kind: Any) -> Iterator[Any]:
    from OCP.TopExp import TopExp_Explorer

    explorer = TopExp_Explorer(shape, kind)
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


def _face(shape: Any, name: str, trim_mm: float) -> Face:
    """One face of Open CASCADE's as one of ours."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert
    from OCP.GeomConvert import GeomConvert
    from OCP.TopAbs import TopAbs_FORWARD, TopAbs_WIRE
    from OCP.TopoDS import TopoDS

    face = TopoDS.Face(BRepBuilderAPI_NurbsConvert(shape, True).Shape())
    face = TopoDS.Face(face.Oriented(TopAbs_FORWARD))
    wires = [curves for curves in (_wire(TopoDS.Wire(w), face) for w in _parts(face, TopAbs_WIRE)) if curves]
    if not wires:
        raise FormatError("has no border; rebuild it in the program that it comes from")
    geometry = GeomConvert.SurfaceToBSplineSurface_s(BRep_Tool.Surface_s(face))
    extents = np.array([_extent(curve) for curves in wires for curve in curves])
    surface = _shrunk(geometry, extents[:, 0].min(axis=0), extents[:, 1].max(axis=0))
    trims = tuple(parameter_loop_polygon(surface, curves, trim_mm) for curves in wires)
    whole = Face(surface, trims, name)
    return Face(surface, (), name) if whole.covers_domain() else whole


def _extent(curve: EdgeCurve) -> FloatArray:
    """Least and greatest coordinates of a curve in the plane, [low, high], by ever closer looks around the extremes."""
    coarse = np.linspace(0.0, 1.0, _POINTS)
    found = np.empty((2, 2))
    for row, sign in ((0, -1.0), (1, 1.0)):
        for axis in (0, 1):
            t = coarse
            for _ in range(4):
                heights = sign * curve(t)[:, axis]
                best = int(np.argmax(heights))
                found[row, axis] = sign * heights[best]
                t = np.linspace(t[max(best - 1, 0)], t[min(best + 1, _POINTS - 1)], _POINTS)
    return found


def _shrunk(geometry: Any, low: FloatArray, high: FloatArray) -> BSplineSurface:
    """Open CASCADE's B-spline surface between two corners of the parameter plane; across a seam if it is periodic."""
    u0, u1, v0, v1 = geometry.Bounds()
    borders = [
        _borders(u0, u1, geometry.IsUPeriodic(), float(low[0]), float(high[0])),
        _borders(v0, v1, geometry.IsVPeriodic(), float(low[1]), float(high[1])),
    ]
    geometry.Segment(*borders[0], *borders[1])
    if geometry.IsUPeriodic():
        geometry.SetUNotPeriodic()
    if geometry.IsVPeriodic():
        geometry.SetVNotPeriodic()
    rows = [[(i, j) for j in range(1, geometry.NbVPoles() + 1)] for i in range(1, geometry.NbUPoles() + 1)]
    points = np.array([[(p.X(), p.Y(), p.Z()) for p in (geometry.Pole(i, j) for i, j in row)] for row in rows])
    weights = np.array([[geometry.Weight(i, j) for i, j in row] for row in rows])
    places_u = np.array([geometry.UKnot(i) for i in range(1, geometry.NbUKnots() + 1)])
    places_v = np.array([geometry.VKnot(i) for i in range(1, geometry.NbVKnots() + 1)])
    times_u = [geometry.UMultiplicity(i) for i in range(1, geometry.NbUKnots() + 1)]
    times_v = [geometry.VMultiplicity(i) for i in range(1, geometry.NbVKnots() + 1)]
    # A periodic one may come back a period away.
    places_u += (u1 - u0) * np.round((borders[0][0] - places_u[0]) / (u1 - u0))
    places_v += (v1 - v0) * np.round((borders[1][0] - places_v[0]) / (v1 - v0))
    knots_u, knots_v = np.repeat(places_u, times_u), np.repeat(places_v, times_v)
    return BSplineSurface(knots_u, knots_v, geometry.UDegree(), geometry.VDegree(), points, weights)


def _borders(begin: float, end: float, periodic: bool, low: float, high: float) -> tuple[float, float]:
    """Where the part from `low` to `high` of a domain begins and ends; a border next to the domain's is put on it."""
    width = end - begin
    if periodic:
        turns = round((low - begin) / width)
        if abs(low - begin - turns * width) <= _SAME * width:
            low = begin + turns * width
        return low, (low + width if high - low >= (1.0 - _SAME) * width else high)
    return (low if low > begin + _SAME * width else begin), (high if high < end - _SAME * width else end)


def _wire(wire: Any, face: Any) -> list[EdgeCurve]:
    """The edges of a closed chain as curves in the face's parameter plane, each in its direction, in order.

    The next edge is the one that begins nearest in that plane: there, unlike in space, both passes of a seam and the sides
    that are one point have places of their own.
    """
    from OCP.BRepAdaptor import BRepAdaptor_Curve2d
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_REVERSED
    from OCP.TopoDS import TopoDS

    curves: list[EdgeCurve] = []
    for part in _parts(wire, TopAbs_EDGE):
        edge = TopoDS.Edge(part)
        curves.append(_curve(BRepAdaptor_Curve2d(edge, face), edge.Orientation() == TopAbs_REVERSED))
    if not curves:
        return []
    ends = np.array([curve(np.array([0.0, 1.0])) for curve in curves])
    size = np.maximum(np.ptp(ends.reshape(-1, 2), axis=0), 1e-300)
    order, left = [0], list(range(1, len(curves)))
    while left:
        away = np.abs((ends[left, 0] - ends[order[-1], 1]) / size).max(axis=1)
        order.append(left.pop(int(np.argmin(away))))
    return [curves[i] for i in order]


def _curve(geometry: Any, backwards: bool) -> EdgeCurve:
    first, last = geometry.FirstParameter(), geometry.LastParameter()
    if backwards:
        first, last = last, first

    def curve(t: FloatArray) -> FloatArray:
        points = (geometry.Value(s) for s in (first + t * (last - first)).tolist())
        return np.array([(p.X(), p.Y()) for p in points])

    return curve
