"""The residual of the elastica's equation, scaled by the length instead of the energy."""

from __future__ import annotations

from typing import overload

import numpy as np

from batten.curves.base import Curve
from batten.measures.curvature_fit import curvature_fit
from batten.typing import ArrayLike, FloatArray


@overload
def curvature_residual(curve: Curve, *, tolerance: float | None = 1e-6) -> float: ...
@overload
def curvature_residual(curve: ArrayLike, *, tolerance: float | None = 1e-6) -> FloatArray: ...
def curvature_residual(curve: Curve | ArrayLike, *, tolerance: float | None = 1e-6) -> float | FloatArray:
    """e_r = √L ‖r‖₂ with r = κ + λ₁y − λ₂x − α at the best multipliers: Fisker2018 §3.3.1.

    Unlike the λ-residual it goes to 0 with the curvature, and with ℓ bounded it bounds the distance to an elastica
    (Fisker2018, Theorem 1).

    Parameters:
        curve: a `Curve`, or control points of cubic Béziers, shape (…, 4, 2).
        tolerance: as for `lambda_residual`; the error of e_r is about tolerance × (L ∫κ² ds)^½.

    Returns:
        A number ≥ 0 for a `Curve`, an array of the leading shape for control points; invariant under similarities.

    Raises:
        InvalidInputError: as `curvature_fit`.

    Degenerate cases: 0 for a straight line; inf where ∫κ² ds is infinite (cusps); NaN for a point and for rows with NaN.

    Example:
        >>> curvature_residual([(0, 0), (1, 0), (2, 0), (3, 0)]).tolist()
        0.0
    """
    fit = curvature_fit(curve, tolerance=tolerance)
    return np.sqrt(fit.length) * fit.residual_norm
