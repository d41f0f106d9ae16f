"""Faces from files of CAD programs and from meshes: what `batten rationalise` works on."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from batten.errors import InvalidInputError
from batten.io.mesh_reading import MESH_ENDINGS, read_mesh
from batten.io.step_reading import IGES_ENDINGS, STEP_ENDINGS, step_faces
from batten.surfaces.face import Face
from batten.surfaces.mesh_region import mesh_regions

TRIM_MM = 0.01
"""How far trims may stray from the edges of the file, unless something else is asked for."""

MESH_MM = 1.0
"""How far the vertices of a mesh may lie from the surface laid through them, unless something else is asked for."""


def read_faces(
    path: str | Path,
    *,
    scale_mm_per_unit: float | None = None,
    layer: str | None = None,
    trim_mm: float = TRIM_MM,
    mesh_mm: float = MESH_MM,
) -> tuple[Face, ...]:
    """Every face of a file, in mm: B-spline surfaces and their trims.

    .3dm: the faces of polysurfaces and extrusions, surfaces, and meshes. STEP and IGES, by the extra `cad`: the faces of all
    shapes. OBJ, STL, PLY: one face for each connected piece of the mesh. Meshes become smooth height surfaces (see
    `batten.surfaces.mesh_region.mesh_regions`).

    Parameters:
        path: the file; its ending says which format: .3dm, .step, .stp, .iges, .igs, .obj, .stl or .ply, in capitals or not.
        scale_mm_per_unit: mm for one unit of the file, above 0; None to take the file's own unit, or mm for OBJ, STL and
            PLY, which name none. STEP and IGES always name theirs, and take none here.
        layer: name or full path ("Default::wall") of the layer to read from, for .3dm alone; None for all layers.
        trim_mm: greatest distance in mm between the middle of a trim's side and the edge that it stands for.
        mesh_mm: greatest distance in mm of a mesh's vertices from its surface.

    Returns:
        The faces in the order of the file, with the names it gives them, numbered where one name has several. Faces
        without trims are those whose border is that of their surface.

    Raises:
        FormatError: not such a file, or a damaged one; a surface that cannot be understood.
        InvalidInputError: no such file or layer; another ending; no unit and no scale, or a scale where none is taken; no
            face; a mesh that its surface cannot follow; an edge that leaves its face by more than 100 × trim_mm; for STEP
            and IGES, Open CASCADE is not installed.

    Accuracy: NURBS are those of the file times its unit; other surfaces (of revolution, planes, cylinders, …) in their NURBS
    form, exactly. Trims as `trim_mm` says, meshes as `mesh_mm` says.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     file = Path(folder) / "sheet.obj"
        ...     text = "v 0 0 0", "v 2 0 0", "v 2 1 0", "v 0 1 0", "f 1 2 3 4"
        ...     _ = file.write_text("\\n".join(text))
        ...     (face,) = read_faces(file, scale_mm_per_unit=1000.0)
        >>> round(face.area())
        2000000
    """
    path = Path(path)
    ending = path.suffix.lower()
    if not (trim_mm > 0.0 and mesh_mm > 0.0):
        raise InvalidInputError(f"trim_mm = {trim_mm}, mesh_mm = {mesh_mm}; allowed are numbers above 0")
    if scale_mm_per_unit is not None and not (np.isfinite(scale_mm_per_unit) and scale_mm_per_unit > 0.0):
        raise InvalidInputError(f"scale_mm_per_unit = {scale_mm_per_unit}; allowed are finite numbers above 0")
    if ending == ".3dm":
        from batten.io.rhino_faces import rhino_faces  # the Rhino library takes a while to load

        return rhino_faces(path, scale_mm_per_unit, layer, trim_mm=trim_mm, mesh_mm=mesh_mm)
    if layer is not None:
        raise InvalidInputError(f"{path}: layer = {layer!r}; only .3dm files have layers: leave it out")
    if ending in STEP_ENDINGS + IGES_ENDINGS:
        if scale_mm_per_unit is not None:
            raise InvalidInputError(
                f"{path}: scale_mm_per_unit = {scale_mm_per_unit}; STEP and IGES files name their unit: leave it out"
            )
        return step_faces(path, trim_mm=trim_mm)
    if ending in MESH_ENDINGS:
        vertices, triangles = read_mesh(path)
        scale = 1.0 if scale_mm_per_unit is None else scale_mm_per_unit
        try:
            regions = mesh_regions(vertices * scale, triangles, mesh_mm, name=path.stem)
        except InvalidInputError as error:
            raise InvalidInputError(f"{path}: {error}") from error
        return tuple(region.face for region in regions)
    allowed = ", ".join((".3dm", *STEP_ENDINGS, *IGES_ENDINGS, *MESH_ENDINGS))
    raise InvalidInputError(f"{path}: allowed are files that end in {allowed}; save the design as one of them")
