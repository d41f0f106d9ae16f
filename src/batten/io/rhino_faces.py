"""Faces of a .3dm file: of polysurfaces, extrusions, surfaces and meshes, with their trims."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import rhino3dm as _rhino3dm

from batten.errors import FormatError, InvalidInputError
from batten.io.rhino import layer_objects, mm_per_unit, open_model, surface_data
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.face import Face
from batten.surfaces.face_loops import EdgeCurve, loop_polygon
from batten.surfaces.mesh_region import mesh_regions
from batten.typing import FloatArray, IntArray

rhino3dm: Any = _rhino3dm  # its own stubs call read-only what can be written, and leave out much


def rhino_faces(
    path: Path, scale_mm_per_unit: float | None, layer: str | None, *, trim_mm: float, mesh_mm: float
) -> tuple[Face, ...]:
    """The faces of a .3dm file, in mm; parameters and errors as `batten.io.face_reading.read_faces`."""
    model = open_model(path)
    scale = mm_per_unit(path, model, scale_mm_per_unit)
    faces: list[Face] = []
    others: Counter[str] = Counter()
    for number, (item, where) in enumerate(layer_objects(path, model, layer), 1):
        label = f"object {number} on layer '{where}'"
        name = item.Attributes.Name or ""
        try:
            found = list(_faces(item.Geometry, scale, name, trim_mm=trim_mm, mesh_mm=mesh_mm))
        except FormatError as error:
            raise FormatError(f"{path}: {label} {error}") from error
        except InvalidInputError as error:
            raise InvalidInputError(f"{path}: {label}: {error}") from error
        if not found:
            others[type(item.Geometry).__name__] += 1
        faces += found
    if not faces:
        place = "the file" if layer is None else f"layer '{layer}'"
        held = ", ".join(f"{count} {kind}" for kind, count in sorted(others.items())) or "nothing"
        hint = "surfaces, polysurfaces, extrusions or meshes are needed"
        if "InstanceReference" in others:
            hint = "explode the block instances in Rhino"
        elif "SubD" in others:
            hint = "turn the SubD into NURBS in Rhino (ToNURBS)"
        raise InvalidInputError(f"{path}: no face; {place} holds {held}: {hint}")
    return tuple(faces)


def _faces(geometry: Any, scale: float, name: str, *, trim_mm: float, mesh_mm: float) -> Iterator[Face]:
    """The faces of one object, in mm; none for curves, points and other things."""
    if isinstance(geometry, rhino3dm.Mesh):
        vertices, triangles = _mesh(geometry)
        for region in mesh_regions(vertices * scale, triangles, mesh_mm, name=name):
            yield region.face
        return
    if isinstance(geometry, rhino3dm.Extrusion):
        geometry = geometry.ToBrep(True)
        if geometry is None:
            raise FormatError("has no form as a polysurface; turn it into one in Rhino (ConvertExtrusion)")
    if isinstance(geometry, rhino3dm.Brep):
        count = len(geometry.Faces)
        for i in range(count):
            yield _brep_face(geometry, i, scale, name if count == 1 or not name else f"{name} {i + 1}", trim_mm)
    elif isinstance(geometry, rhino3dm.Surface):
        yield Face(_surface(geometry).scaled(scale), (), name)


def _brep_face(brep: Any, index: int, scale: float, name: str, trim_mm: float) -> Face:
    face = brep.Faces[index]
    surface = _surface(face).scaled(scale)
    trims: list[FloatArray] = []
    for loop in face.Loops:
        if loop.LoopType in (rhino3dm.BrepLoopType.Outer, rhino3dm.BrepLoopType.Inner):
            edges = [
                _edge(brep.Edges[trim.EdgeIndex], trim.IsReversed, scale) if trim.EdgeIndex >= 0 else None
                for trim in loop.Trims
            ]
            trims.append(loop_polygon(surface, edges, trim_mm))
    whole = Face(surface, (), name)
    if len(trims) == 1 and Face(surface, tuple(trims)).covers_domain():
        return whole
    return Face(surface, tuple(trims), name)


def _edge(edge: Any, is_reversed: bool, scale: float) -> EdgeCurve:
    """An edge as a function of t ∈ [0, 1] in the direction of its trim, in mm."""
    low, high = edge.Domain.T0, edge.Domain.T1
    if is_reversed:
        low, high = high, low

    def curve(t: FloatArray) -> FloatArray:
        points = (edge.PointAt(s) for s in (low + t * (high - low)).tolist())
        return scale * np.array([(p.X, p.Y, p.Z) for p in points])

    return curve


def _surface(geometry: Any) -> BSplineSurface:
    """A surface of Rhino's, or a face without its trims, as one of ours in the file's unit."""
    surface = geometry if isinstance(geometry, rhino3dm.NurbsSurface) else geometry.ToNurbsSurface()
    if surface is None:
        raise FormatError("has no NURBS form; rebuild it in Rhino (Rebuild)")
    knots_u, knots_v, points, weights = surface_data(surface)
    if not np.isfinite(points).all():
        count = np.count_nonzero(~np.isfinite(points).all(axis=2))
        raise FormatError(f"has {count} control points that are not numbers (NaN)")
    valid, log = surface.IsValidWithLog
    if not valid:
        reason = " ".join(log.split())[:200] or "Rhino gives no reason"
        raise FormatError(f"is not valid ({reason}); rebuild it in Rhino (Rebuild)")
    return BSplineSurface(knots_u, knots_v, surface.Degree(0), surface.Degree(1), points, weights)


def _mesh(mesh: Any) -> tuple[FloatArray, IntArray]:
    """Vertices (n, 3) in the file's unit and triangles (m, 3) of a mesh; quads are cut in two."""
    vertices = np.array([(p.X, p.Y, p.Z) for p in (mesh.Vertices[i] for i in range(len(mesh.Vertices)))])
    quads = np.array([mesh.Faces[i] for i in range(len(mesh.Faces))], dtype=np.int64).reshape(-1, 4)
    second = quads[quads[:, 2] != quads[:, 3]][:, [0, 2, 3]]
    return vertices.reshape(-1, 3), np.concatenate([quads[:, :3], second])
