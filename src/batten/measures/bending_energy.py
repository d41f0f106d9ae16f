"""The bending energy of a curve."""

from __future__ import annotations

from typing import overload

from batten.curves.base import Curve
from batten.measures.curvature_fit import curvature_fit
from batten.typing import ArrayLike, FloatArray


@overload
def bending_energy(curve: Curve, *, tolerance: float | None = 1e-6) -> float: ...
@overload
def bending_energy(curve: ArrayLike, *, tolerance: float | None = 1e-6) -> FloatArray: ...
def bending_energy(curve: Curve | ArrayLike, *, tolerance: float | None = 1e-6) -> float | FloatArray:
    """∫κ² ds, in 1/length. A rod of stiffness EI stores ½ EI times this.

    Brander2016 §2.1 and Fisker2018 (2.1) put the factor ½ into the energy; here it is left out, as in the definition of
    the λ-residual. Length times this is invariant under similarities: 4π² for a full circle.

    Parameters:
        curve: a `Curve`, or control points of cubic Béziers, shape (…, 4, 2).
        tolerance: greatest relative error, about; in [1e-10, 0.1], or None: see `curvature_fit`.

    Returns:
        A number for a `Curve`, an array of the leading shape for control points.

    Raises:
        InvalidInputError: as `curvature_fit`.

    Degenerate cases: 0 for a straight line; inf at cusps, ends whose handle has length zero and straight lines that double
    back; corners between smooth pieces are not counted; NaN for a single point and for rows with NaN or infinity.

    Example:
        >>> parabola = [(0, 0), (1 / 3, 0), (2 / 3, 1 / 3), (1, 1)]  # y = x²: ∫ 4/(1 + 4x²)^(5/2) dx
        >>> float(bending_energy(parabola).round(6))
        1.311827
    """
    return curvature_fit(curve, tolerance=tolerance).bending_energy
