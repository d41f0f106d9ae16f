"""The surface that a job asks for: read from its file, or lofted through its design curves."""

from __future__ import annotations

from batten.errors import InvalidInputError
from batten.fabrication.job import SurfaceJob
from batten.surfaces.bspline_surface import BSplineSurface


def read_job_surface(job: SurfaceJob) -> BSplineSurface:
    """Read the surface.

    Parameters:
        job: which file, layer and scale.

    Returns:
        The surface in the wall frame, mm.

    Raises:
        FormatError: not a Rhino file, or geometry in it that is damaged.
        InvalidInputError: no such file or layer, no surface or curves in it, no unit, a trimmed face.
    """
    from batten.io.rhino import read_design_curves, read_surface  # the Rhino library takes a while to load

    if job.file is not None:
        return read_surface(job.file, scale_mm_per_unit=job.scale_mm_per_unit, layer=job.layer)
    if job.curves is None:
        raise InvalidInputError("the job names no surface; give surface.file or surface.curves")
    from batten.surfaces.loft import loft

    design = read_design_curves(job.curves, layer=job.layer, scale_mm_per_unit=job.scale_mm_per_unit)
    return loft(design.curves, design.positions, blade_axis=design.blade_axis)
