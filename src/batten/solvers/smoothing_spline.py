"""A smooth curve through noisy points: quintic spline with a penalty on its third derivative."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import cholesky, eigh, solve_triangular

from batten.typing import FloatArray

_MOST_PIECES = 48
_CAUTION = 1.4  # each degree of freedom counts as so many: guards cross-validation against following the noise


def smoothing_spline(parameters: FloatArray, data: FloatArray, smoothing: float | None = None) -> BSpline:
    """The spline f that minimises Σ|f(tᵢ) − yᵢ|² + smoothing·∫|f‴|² dt over quintic splines with knots at the data.

    The penalty leaves value, slope and second derivative at the ends alone: a natural cubic spline has curvature 0 there,
    which an elastica has not.

    Parameters:
        parameters: shape (m,), m ≥ 5, strictly ascending from 0 to 1. data: shape (m, d).
        smoothing: weight of the penalty; None chooses it by generalised cross-validation.

    Returns:
        A `BSpline` on [0, 1] with values of shape (d,). At most 48 pieces; degree 4 for five points.
    """
    m = len(parameters)
    degree = min(5, m - 1)
    pieces = max(1, min(m // 2 - 2, _MOST_PIECES))
    breaks = np.interp(np.linspace(0.0, m - 1.0, pieces + 1), np.arange(m), parameters)
    knots = np.concatenate([np.zeros(degree), breaks, np.ones(degree)])
    basis = BSpline.design_matrix(parameters, knots, degree).toarray()
    x, w = np.polynomial.legendre.leggauss(3)  # exact for the square of a quadratic
    widths = np.diff(breaks)
    nodes = (breaks[:-1, None] + 0.5 * widths[:, None] * (x + 1.0)).reshape(-1)
    third = BSpline(knots, np.eye(basis.shape[1]), degree)(nodes, 3)
    roughness = third.T @ (third * (0.5 * widths[:, None] * w).reshape(-1, 1))
    # With BᵀB = LLᵀ and L⁻¹RL⁻ᵀ = U diag(γ) Uᵀ, the coefficients are L⁻ᵀU diag(1/(1 + weight·γ)) Uᵀ L⁻¹Bᵀy.
    lower = cholesky(basis.T @ basis, lower=True)
    half = solve_triangular(lower, roughness, lower=True)
    gamma, vectors = eigh(solve_triangular(lower, half.T, lower=True))
    gamma = np.maximum(gamma, 0.0)
    gamma[:3] = 0.0  # parabolas, exactly
    seen = vectors.T @ solve_triangular(lower, basis.T @ data, lower=True)
    if smoothing is None:
        weights = np.logspace(-20.0, 2.0, 111)
        kept = 1.0 / (1.0 + weights[:, None] * gamma)
        outside = max(float((data**2).sum() - (seen**2).sum()), 0.0)
        errors = outside + ((1.0 - kept) ** 2) @ (seen**2).sum(axis=1)
        spare = np.maximum(1.0 - _CAUTION * kept.sum(axis=1) / m, 1e-3)
        smoothing = float(weights[np.argmin(errors / spare**2)])
    coefficients = vectors @ (seen / (1.0 + smoothing * gamma)[:, None])
    return BSpline(knots, solve_triangular(lower, coefficients, lower=True, trans="T"), degree)
