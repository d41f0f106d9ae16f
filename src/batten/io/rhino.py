"""Rhino's .3dm: surfaces and design curves in, cuts out. Lengths are mm on this side and the file's unit on the other."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import rhino3dm as _rhino3dm

from batten.curves.bspline import BSplineCurve
from batten.errors import FormatError, InvalidInputError
from batten.fabrication.plan import CutPlan, GripperFrames, gripper_frames
from batten.io.rhino_curves import Drawing, nurbs_curves
from batten.surfaces.bspline_surface import BSplineSurface
from batten.typing import FloatArray

rhino3dm: Any = _rhino3dm  # its own stubs call read-only what can be written, and leave out much


@dataclass(frozen=True, eq=False)
class DesignCurves:
    """Planar design curves in parallel vertical planes, ready to be lofted.

    Attributes:
        curves: in the coordinates (along the blade, up) of their planes, mm, from low to high along the blade.
        positions: wall coordinate across the blade of each plane, mm, ascending, shape (n,).
        blade_axis: the wall axis that the planes are parallel to.
    """

    curves: tuple[BSplineCurve, ...]
    positions: FloatArray
    blade_axis: Literal["x", "y"]


def read_surface(path: str | Path, scale_mm_per_unit: float | None = None, layer: str | None = None) -> BSplineSurface:
    """The one surface of a .3dm file, in mm.

    Taken are NURBS and other surfaces, extrusions of an open profile, and polysurfaces of one untrimmed face.

    Parameters:
        path: the file.
        scale_mm_per_unit: mm for one unit of the file, above 0; None to take the file's own unit.
        layer: name or full path ("Default::wall") of the layer to read from; None for all layers.

    Returns:
        The surface, exactly as stored, times the scale.

    Raises:
        FormatError: not a .3dm file, or a damaged one; a surface that Rhino calls invalid or that holds no numbers.
        InvalidInputError: no such file or layer; no unit and no scale; no surface or several; a trimmed, closed or
            pointed one.
    """
    path = Path(path)
    model = open_model(path)
    scale = mm_per_unit(path, model, scale_mm_per_unit)
    found = [(o, where) for o, where in layer_objects(path, model, layer) if isinstance(o.Geometry, _SURFACES)]
    if len(found) != 1:
        raise InvalidInputError(f"{path}: {_not_one_surface(path, model, layer, [where for _, where in found])}")
    item, where = found[0]
    try:
        return _surface(item.Geometry).scaled(scale)
    except FormatError as error:
        raise FormatError(f"{path}: the surface on layer '{where}' {error}") from error
    except InvalidInputError as error:
        raise InvalidInputError(f"{path}: the surface on layer '{where}' {error}") from error


_SURFACES = (rhino3dm.Brep, rhino3dm.Surface)  # an Extrusion is a Surface


def open_model(path: Path) -> Any:
    """The model that a .3dm file holds, as Rhino's library gives it."""
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "no such file"
        raise InvalidInputError(f"{path}: {what}; give the path of a Rhino file (.3dm)")
    model = rhino3dm.File3dm.Read(str(path))
    if model is None:
        with path.open("rb") as stream:
            is_rhino = stream.read(23) == b"3D Geometry File Format"
        what = "is damaged or cut short" if is_rhino else "is not a Rhino file"
        raise FormatError(f"{path}: {what}; save the design again as .3dm (Rhino 5 or later)")
    return model


def mm_per_unit(path: Path, model: Any, given: float | None) -> float:
    """mm for one unit of the file."""
    if given is not None:
        if not (np.isfinite(given) and given > 0.0):
            raise InvalidInputError(
                f"scale_mm_per_unit = {given}; allowed are finite numbers above 0, in mm for one unit"
            )
        return float(given)
    unit = model.Settings.ModelUnitSystem
    if unit.name in ("None", "Unset", "CustomUnits"):
        raise InvalidInputError(
            f"{path}: the file's unit is {unit.name}, so its size is unknown; set scale_mm_per_unit (1.0 for mm, 1000.0 for "
            "m), or set the unit in Rhino"
        )
    return float(rhino3dm.UnitSystem.UnitScale(unit, rhino3dm.UnitSystem.Millimeters))


def layer_objects(path: Path, model: Any, layer: str | None) -> Iterator[tuple[Any, str]]:
    """The file's objects on a layer, with the full path of their layer; parts of block definitions are left out."""
    layers = dict(enumerate(model.Layers))
    names = {index: entry.FullPath for index, entry in layers.items()}
    wanted = None
    if layer is not None:
        wanted = {i for i, e in layers.items() if layer.casefold() in (e.FullPath.casefold(), e.Name.casefold())}
        if not wanted:
            raise InvalidInputError(
                f"{path}: no layer '{layer}'; it has {', '.join(repr(n) for n in names.values()) or 'none'}"
            )
    for item in model.Objects:
        index = item.Attributes.LayerIndex
        if not item.Attributes.IsInstanceDefinitionObject and (wanted is None or index in wanted):
            yield item, names.get(index, "?")


def _not_one_surface(path: Path, model: Any, layer: str | None, found: list[str]) -> str:
    """The reason why there is nothing to take, when there is no surface or there are several."""
    place = "the file" if layer is None else f"layer '{layer}'"
    if found:
        counts = ", ".join(f"{count} on layer '{where}'" for where, count in sorted(Counter(found).items()))
        return f"{len(found)} surfaces ({counts}); exactly one is allowed: name its layer, or keep one in the file"
    kinds = Counter(type(item.Geometry).__name__ for item, _ in layer_objects(path, model, layer))
    other = ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items())) or "nothing"
    hint = "explode the block instances in Rhino" if "InstanceReference" in kinds else "a NURBS surface is needed"
    return f"no surface; {place} holds {other}: {hint}"


def _surface(geometry: Any) -> BSplineSurface:
    """A surface of Rhino's as one of ours, in the file's unit."""
    if isinstance(geometry, rhino3dm.Extrusion):
        if geometry.ProfileCount != 1 or geometry.CapCount or geometry.IsClosed(0) or geometry.IsClosed(1):
            raise InvalidInputError("is an extruded solid or tube; allowed are extrusions of one open profile")
        surface = geometry.ToNurbsSurface()
    elif isinstance(geometry, rhino3dm.Brep):
        if len(geometry.Faces) != 1:
            raise InvalidInputError(
                f"is a polysurface of {len(geometry.Faces)} faces; one face is allowed: keep one of them"
            )
        surface = geometry.Faces[0].ToNurbsSurface()
    else:
        surface = geometry if isinstance(geometry, rhino3dm.NurbsSurface) else geometry.ToNurbsSurface()
    if surface is None:
        raise FormatError("has no NURBS form; rebuild it in Rhino (Rebuild)")
    knots_u, knots_v, points, weights = surface_data(surface)
    if not np.isfinite(points).all():
        raise FormatError(
            f"has {np.count_nonzero(~np.isfinite(points).all(axis=2))} control points that are not numbers (NaN)"
        )
    for part in (surface, geometry):
        valid, log = part.IsValidWithLog
        if not valid:
            raise FormatError(
                f"is not valid ({' '.join(log.split())[:200] or 'Rhino gives no reason'}); rebuild it in Rhino"
            )
    if isinstance(geometry, rhino3dm.Brep) and not geometry.IsSurface:
        raise InvalidInputError(
            "is trimmed; only whole surfaces can be cut: untrim it, or shrink it to its trims, in Rhino"
        )
    for axis, name in ((0, "u"), (1, "v")):
        if surface.IsClosed(axis):
            raise InvalidInputError(
                f"is closed along {name}; a wall is open on all sides: split it in Rhino (Split, Isocurve)"
            )
    if any(surface.IsSingular(side) for side in range(4)):
        raise InvalidInputError(
            "has a side that shrinks to a point; allowed are surfaces with four sides (rebuild or split)"
        )
    try:
        return BSplineSurface(knots_u, knots_v, surface.Degree(0), surface.Degree(1), points, weights)
    except InvalidInputError as error:  # for example weights below 0, which Rhino allows
        raise InvalidInputError(f"cannot be cut: {error}") from error


def surface_data(surface: Any) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Complete knot vectors, control points (n, m, 3) and weights (n, m) of a NurbsSurface."""
    net = surface.Points
    rows = [[net[i, j] for j in range(net.CountV)] for i in range(net.CountU)]
    homogeneous = np.array([[(p.X, p.Y, p.Z, p.W) for p in row] for row in rows])
    weights = homogeneous[..., 3] if surface.IsRational else np.ones(homogeneous.shape[:2])
    knots_u, knots_v = (np.array(k.ToList(), dtype=np.float64) for k in (surface.KnotsU, surface.KnotsV))
    with np.errstate(divide="ignore", invalid="ignore"):
        points = homogeneous[..., :3] / weights[..., None]
    return _complete(knots_u), _complete(knots_v), points, weights


def _complete(knots: FloatArray) -> FloatArray:
    """Rhino's knots with the first and the last, which it leaves out and never uses."""
    return np.concatenate([knots[:1], knots, knots[-1:]])


def read_design_curves(
    path: str | Path, layer: str | None = None, scale_mm_per_unit: float | None = None
) -> DesignCurves:
    """The planar design curves of a .3dm file, in mm, for `batten.surfaces.loft.loft`.

    Taken are all curves on the layer: NURBS, lines, polylines and joined ones. Each must lie in a vertical plane, and all
    planes be parallel to the wall's x axis, or all to its y axis.

    Parameters:
        path: the file.
        layer: name or full path of the layer; None for all layers.
        scale_mm_per_unit: mm for one unit of the file, above 0; None to take the file's own unit.

    Returns:
        The curves, by position, all running towards greater x (or y); where they are drawn is kept exactly.

    Raises:
        FormatError: not a .3dm file, or a damaged one; a curve that Rhino calls invalid or that holds no numbers.
        InvalidInputError: no such file or layer; no unit and no scale; fewer than two curves; curves that are closed,
            rational (arcs, conics), not in such planes, or two in one plane.
    """
    path = Path(path)
    model = open_model(path)
    scale = mm_per_unit(path, model, scale_mm_per_unit)
    found = [(o, where) for o, where in layer_objects(path, model, layer) if isinstance(o.Geometry, rhino3dm.Curve)]
    if len(found) < 2:
        raise InvalidInputError(
            f"{path}: {len(found)} design curve{'s' if len(found) != 1 else ''} "
            f"{'in the file' if layer is None else f'on layer {layer!r}'}; a loft needs two or more"
        )
    spatial = [_space_curve(path, f"curve {i} on layer '{where}'", o.Geometry) for i, (o, where) in enumerate(found, 1)]
    spreads = np.array([np.ptp(points, axis=0) for _, _, points in spatial])
    flat = (spreads <= 1e-6 * spreads.max()).all(axis=0)
    if flat[0] == flat[1]:
        raise InvalidInputError(
            f"{path}: the design curves must all lie in planes of constant y, or all in planes of constant x; they spread "
            f"by up to {spreads[:, 1].max():.6g} in y and {spreads[:, 0].max():.6g} in x: project them onto such planes"
        )
    blade_axis: Literal["x", "y"] = "x" if flat[1] else "y"
    along, across = (0, 1) if blade_axis == "x" else (1, 0)
    rows: list[tuple[float, BSplineCurve]] = []
    for degree, knots, points in spatial:
        curve = BSplineCurve(_complete(knots), scale * points[:, [along, 2]], degree)
        start, end = curve.point([0.0, 1.0])[:, 0]
        rows.append((float(scale * points[:, across].mean()), curve if start < end else curve.reversed()))
    rows.sort(key=lambda row: row[0])
    positions = np.array([position for position, _ in rows])
    close = np.flatnonzero(np.diff(positions) <= 1e-6 * scale * spreads.max())
    if len(close):
        raise InvalidInputError(
            f"{path}: two design curves lie in the plane at {positions[close[0]]:.6g} mm; one is allowed in each plane"
        )
    return DesignCurves(tuple(curve for _, curve in rows), positions, blade_axis)


def _space_curve(path: Path, name: str, geometry: Any) -> tuple[int, FloatArray, FloatArray]:
    """Degree, Rhino's knots, and control points (n, 3) of a curve, in the file's unit."""
    curve = geometry.ToNurbsCurve()
    if curve is None:
        raise FormatError(f"{path}: {name} has no NURBS form; rebuild it in Rhino (Rebuild)")
    net = np.array([(p.X, p.Y, p.Z, p.W) for p in (curve.Points[i] for i in range(len(curve.Points)))])
    if not np.isfinite(net).all():
        raise FormatError(f"{path}: {name} has control points that are not numbers (NaN)")
    if not curve.IsValid:
        raise FormatError(f"{path}: {name} is not valid; rebuild it in Rhino (Rebuild)")
    if curve.IsRational and np.ptp(net[:, 3]) > 0.0:
        raise InvalidInputError(f"{path}: {name} is an arc or a conic; only polynomial splines can be lofted (Rebuild)")
    if curve.IsClosed:
        raise InvalidInputError(f"{path}: {name} is closed; a design curve runs from one side of the wall to the other")
    return curve.Degree, np.array(curve.Knots.ToList(), dtype=np.float64), net[:, :3] / net[:, 3:]


_STRAY_MM = 0.009  # of a curve from its elastica, measured in the middle of each cubic; 0.01 is promised
_AXES_MM = (60.0, 40.0, 20.0)  # along the tangent, across the rod in its plane, along the plane's normal
_COLOURS = {
    "surface": (190, 190, 190),
    "blocks": (120, 140, 160),
    "leaves": (0, 90, 200),
    "rods": (60, 60, 60),
    "frames": (0, 0, 0),
}
_REFUSED_COLOUR = (230, 120, 0)


def write_cut_3dm(plan: CutPlan, path: str | Path, surface: BSplineSurface | None = None) -> None:
    """A cut as a .3dm file in mm: blocks, leaves, rods and gripper frames, each on its layer and with its numbers.

    Layers: `blocks` (boxes), `leaves` (the elastica within the block), `rods` (the whole rod), `frames` (at each gripper
    one polyline of five corners: 60 mm along the tangent, the gripper's place, 40 mm across the rod in its plane, the place,
    20 mm along the plane's normal), `surface` (the wanted one). Every object bears the user texts `block` and `leaf` (the
    block alone for blocks) and a name; rods also `length_mm`, `status`, and where there are any, `repair` and `reasons`;
    frames `gripper`, left or right. Refused rods are orange.

    Parameters:
        plan: the cut.
        path: the file; it appears whole or not at all, and replaces an earlier one.
        surface: the wanted surface in the wall frame, mm; None to leave it out.

    Raises:
        FormatError: Rhino's library calls a geometry invalid; nothing is written then.
        OSError: the file cannot be written.

    Accuracy: leaves and rods are C¹ cubic NURBS within 0.01 mm of the elastica, their parameter is the arc length in mm,
    and their ends and end tangents are exact.
    """
    draw = Drawing(_COLOURS, "mm")
    if surface is not None:
        draw.add("surface", "wanted surface", rhino_surface(surface), {})
    for block in plan.blocks:
        texts = {"block": str(block.number), "row": str(block.row), "column": str(block.column)}
        low, high = (rhino3dm.Point3d(*map(float, c)) for c in (block.corner_mm, block.corner_mm + block.size_mm))
        box = rhino3dm.Brep.CreateFromBox(rhino3dm.Box(rhino3dm.BoundingBox(low, high)))
        draw.add("blocks", f"block {block.number}", box, texts)
    planes = [rod.plane for rod in plan.rods]
    leaves = nurbs_curves([rod.piece for rod in plan.rods], planes, _STRAY_MM)
    rods = nurbs_curves([rod.rod for rod in plan.rods], planes, _STRAY_MM)
    frames = _axes_curves(gripper_frames(plan.rods))
    for rod, leaf_curve, rod_curve, axes in zip(plan.rods, leaves, rods, frames):
        texts = {"block": str(rod.block), "leaf": str(rod.leaf)}
        more = {"length_mm": f"{rod.rod.length:.6f}", "status": rod.status}
        more |= {k: "; ".join(v) for k, v in (("repair", rod.repair), ("reasons", rod.reasons)) if v}
        colour = _REFUSED_COLOUR if rod.status == "refused" else None
        name = f"block {rod.block} leaf {rod.leaf}"
        draw.add("leaves", name, leaf_curve, texts, colour)
        draw.add("rods", name, rod_curve, texts | more, colour)
        for side, curve in zip(("left", "right"), axes):
            draw.add("frames", f"{name} {side}", curve, texts | {"gripper": side})
    draw.write(Path(path))


def rhino_surface(surface: BSplineSurface) -> Any:
    """A surface as a `rhino3dm.NurbsSurface` with the same knots, control points and weights."""
    n, m = surface.control_points.shape[:2]
    result = rhino3dm.NurbsSurface.Create(3, surface.is_rational, surface.degree_u + 1, surface.degree_v + 1, n, m)
    weights = np.ones((n, m)) if surface.weights is None else surface.weights
    for (i, j), w in np.ndenumerate(weights):
        result.Points[i, j] = rhino3dm.Point4d(*map(float, surface.control_points[i, j] * w), float(w))
    for target, knots in ((result.KnotsU, surface.knots_u), (result.KnotsV, surface.knots_v)):
        for i, knot in enumerate(knots[1:-1]):
            target[i] = float(knot)
    return result


def _axes_curves(frames: GripperFrames) -> list[tuple[Any, Any]]:
    """For each rod the axes of its left and its right gripper, each as one polyline: three lines each take twice as long."""
    places, tangents = frames.positions_mm, frames.tangents
    normals = np.broadcast_to(frames.normals[:, None], tangents.shape)
    along, across, normal = (
        places + length * axis for length, axis in zip(_AXES_MM, (tangents, np.cross(normals, tangents), normals))
    )
    corners = np.stack([along, places, across, places, normal], axis=2).tolist()
    return [(_polyline(left), _polyline(right)) for left, right in corners]


def _polyline(corners: list[list[float]]) -> Any:
    return rhino3dm.Polyline([rhino3dm.Point3d(*corner) for corner in corners]).ToPolylineCurve()
