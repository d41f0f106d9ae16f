"""The λ-residual: how far a curve's curvature is from that of any elastica."""

from __future__ import annotations

from typing import overload

import numpy as np

from batten.curves.base import Curve
from batten.measures.curvature_fit import curvature_fit, lambda_residual_of_cubics
from batten.typing import ArrayLike, FloatArray


@overload
def lambda_residual(curve: Curve, *, tolerance: float | None = 1e-6) -> float: ...
@overload
def lambda_residual(curve: ArrayLike, *, tolerance: float | None = 1e-6) -> FloatArray: ...
def lambda_residual(curve: Curve | ArrayLike, *, tolerance: float | None = 1e-6) -> float | FloatArray:
    """e_λ = min (∫(κ + λ₁y − λ₂x − α)² ds)^½ / (∫κ² ds)^½ over λ₁, λ₂, α: Brander2018 §2, Fisker2018 (2.3).

    It is R₁ of Brander2016 §4. Below 0.4 a cubic Bézier is, but for few exceptions, within 1 % of its length of an
    elastica in L² (Brander2018 §3: best below 0.22, good below 0.4, borderline below 0.5).

    Parameters:
        curve: a `Curve`, or control points of cubic Béziers, shape (…, 4, 2).
        tolerance: greatest absolute error, in [1e-10, 0.1]; or None for one Gauss rule of 24 nodes: see `curvature_fit`.

    Returns:
        A number in [0, 1] for a `Curve`, an array of the leading shape for control points. Invariant under similarities
        and reversal. 0 for an elastica.

    Raises:
        InvalidInputError: an array of another shape, a tolerance outside its range, a polyline.

    Accuracy: within `tolerance`. A cubic takes about 0.1 µs with None and 0.4 µs with the default.

    Degenerate cases: 0 for a straight line, by definition; 1 at a cusp, at an end whose handle has length zero, and for a
    straight line that doubles back, where ∫κ² ds is infinite; NaN for a single point and for rows with NaN or infinity.

    Example:
        >>> from batten.curves.bezier import CubicBezier
        >>> round(lambda_residual(CubicBezier([(0, 0), (0.1, 0.7), (0.9, 0.7), (1, 0)])), 4)
        0.0121
        >>> lambda_residual([[(0, 0), (1, 0), (2, 0), (3, 0)]]).tolist()
        [0.0]
    """
    if isinstance(curve, np.ndarray | list | tuple):
        return lambda_residual_of_cubics(curve, tolerance)
    return curvature_fit(curve, tolerance=tolerance).lambda_residual
