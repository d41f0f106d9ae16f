"""A rationalised design as .3dm: faces, blocks and leaves, in the design's own coordinates."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import rhino3dm as _rhino3dm

from batten.curves.elastica import Elastica
from batten.fabrication.patch_plan import PatchPlan
from batten.fabrication.rationalisation import Rationalisation
from batten.io.rhino import rhino_surface
from batten.io.rhino_curves import Drawing, nurbs_curves
from batten.surfaces.plane import Plane
from batten.typing import FloatArray

rhino3dm: Any = _rhino3dm  # its own stubs call read-only what can be written, and leave out much

_STRAY_MM = 0.01
_COLOURS = {"faces": (190, 190, 190), "blocks": (120, 140, 160), "leaves": (0, 90, 200), "planned": (150, 190, 150)}


def write_patches_3dm(rationalisation: Rationalisation, path: str | Path) -> None:
    """All patches in one file, in mm.

    Layers: `faces` (the part of each face that is a patch, untrimmed), `blocks` (boxes), `leaves` (the pieces of elastica
    that cut the face), `planned` (each patch's planned surface over its blocks). Objects bear the user texts `patch`, and
    where they have one `block`, `row`, `column`, `leaf`.

    Parameters:
        rationalisation: what to write. path: the file; it appears whole or not at all.

    Raises:
        FormatError: Rhino's library calls a geometry invalid. OSError: the file cannot be written.

    Accuracy: leaves are C¹ cubic NURBS within 0.01 mm of the elastica, their ends and end tangents are exact.
    """
    draw = Drawing(_COLOURS, "mm")
    for plan in rationalisation.patches:
        texts = {"patch": str(plan.number)}
        draw.add("faces", f"patch {plan.number}", rhino_surface(plan.patch.face.surface), texts)
        draw.add("planned", f"patch {plan.number}", rhino_surface(plan.planned.transformed(plan.block_frame)), texts)
        for block in plan.blocks:
            place = {"block": str(block.number), "row": str(block.row), "column": str(block.column)}
            box = _box(block.low, block.high, plan.block_frame)
            draw.add("blocks", f"patch {plan.number} block {block.number}", box, texts | place)
        _add_leaves(draw, plan)
    draw.write(Path(path))


def _add_leaves(draw: Drawing, plan: PatchPlan) -> None:
    leaves, columns = np.nonzero(plan.used)
    pieces = [Elastica.from_parameters(p) for p in plan.columns.chains.parameters[leaves, columns]]
    frame = plan.patch.frame
    in_design = [
        Plane(plan.patch.to_design(p.origin), frame[:3, :3] @ p.x_axis, frame[:3, :3] @ p.y_axis)
        for p in plan.columns.chains.planes
    ]
    curves = nurbs_curves(pieces, [in_design[i] for i in leaves], _STRAY_MM)
    for leaf, column, curve in zip(leaves, columns, curves):
        texts = {"patch": str(plan.number), "leaf": str(leaf + 1), "column": str(column)}
        draw.add("leaves", f"patch {plan.number} leaf {leaf + 1} column {column}", curve, texts)


def _box(low: FloatArray, high: FloatArray, frame: FloatArray) -> Any:
    """A box of the block frame in the design."""
    corners = (rhino3dm.Point3d(*map(float, c)) for c in (low, high))
    box = rhino3dm.Brep.CreateFromBox(rhino3dm.Box(rhino3dm.BoundingBox(*corners)))
    turn = rhino3dm.Transform(1.0)
    for i in range(4):
        for j in range(4):
            setattr(turn, f"M{i}{j}", float(frame[i, j]))
    box.Transform(turn)
    return box
