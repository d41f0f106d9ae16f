"""From a spline whose pieces break limits to one nearby whose pieces keep them."""

from __future__ import annotations

import numpy as np

from batten.curves.cubic_proxy import CubicProxy
from batten.measures.lambda_residual_gradient import lambda_residual_gradient
from batten.splines.design_limits import DesignLimits, broken_limits, piece_measures
from batten.typing import FloatArray, IntArray

#: Parts of the limit that e_λ is brought below, one after the other, until all limits are kept.
_AIMS = (0.95, 0.75, 0.5)
#: Weight of the excess of e_λ over the aim, squared, against the squared displacements over the mean chord.
_WEIGHT = 100.0
_ITERATIONS = 40
#: Farthest that a control point may go, in mean chords: what is farther is not what was drawn.
_FARTHEST = 0.25


def repaired(proxy: CubicProxy, pieces: IntArray, limits: DesignLimits) -> CubicProxy | None:
    """A spline near to `proxy` that keeps all limits; None where none is found.

    Definition: least Σ |displacement|²/(mean chord)² + w Σ max(0, e_λ − aim)² over the control points that no other pieces
    depend on, the ends and the joints' borders held; by L-BFGS with the gradient of e_λ. The aim is lowered until the other
    limits are kept, too. No control point goes farther than a quarter of the mean chord.

    Parameters:
        proxy: the spline. pieces: the numbers of those that may change.
        limits: what all pieces have to keep.

    Accuracy: a heuristic: a spline that it returns keeps the limits, but need not be the nearest, and none may be found
    where there are some.

    Example:
        >>> wavy = CubicProxy.line((0, 0), (6, 0), 3).with_control_point(2, (1.5, 0.4)).with_piece(1)
        >>> bool(piece_measures(wavy, DesignLimits()).residuals.max() > 0.21)
        True
        >>> better = repaired(wavy, np.arange(4), DesignLimits())
        >>> broken_limits(piece_measures(better, DesignLimits()), DesignLimits())
        ()
        >>> bool(np.abs(better.control_points - wavy.control_points).max() < 0.05)
        True
    """
    from scipy.optimize import minimize  # takes a while to load

    basis = _free_directions(proxy, pieces)
    if basis.shape[1] == 0:
        return None
    start, shape = proxy.control_points, proxy.control_points.shape
    size = float(np.linalg.norm(np.diff(proxy.joints, axis=0), axis=-1).mean())
    matrix = proxy.bezier_matrix[pieces]
    if not size > 0.0:
        return None

    def cost(y: FloatArray, aim: float) -> tuple[float, FloatArray]:
        control = start + size * (basis @ y).reshape(shape)
        values, gradients = lambda_residual_gradient(matrix @ control, tolerance=1e-3)
        over = np.where(np.isfinite(gradients).all(axis=(1, 2)), np.maximum(values - aim, 0.0), 0.0)
        pull = 2.0 * _WEIGHT * size * np.einsum("i,ijk,ijm->mk", over, np.nan_to_num(gradients), matrix)
        return float(y @ y + _WEIGHT * over @ over), 2.0 * y + basis.T @ pull.reshape(-1)

    y = np.zeros(basis.shape[1])
    for aim in _AIMS:
        options = {"maxiter": _ITERATIONS}
        y = minimize(cost, y, (aim * limits.residual_below,), "L-BFGS-B", jac=True, options=options).x
        moves = (basis @ y).reshape(shape)
        if np.linalg.norm(moves, axis=-1).max() > _FARTHEST:
            return None
        better = CubicProxy(start + size * moves, proxy.continuity, proxy.borders)
        if not broken_limits(piece_measures(better, limits), limits):
            return better
    return None


def _free_directions(proxy: CubicProxy, pieces: IntArray) -> FloatArray:
    """Orthonormal displacements (2m, f) of all control points that change `pieces` alone and keep ends and borders."""
    n, m = proxy.piece_count, len(proxy.control_points)
    others = np.setdiff1d(np.arange(n), pieces)
    free = np.array(~proxy.bezier_matrix[others].any(axis=(0, 1)))
    free[[0, -1]] = False
    columns = np.flatnonzero(np.repeat(free, 2))
    weights = np.concatenate([proxy.bezier_matrix[:, 0], proxy.bezier_matrix[-1:, 3]])
    held = [np.kron(weights[k], border.normal)[columns] for k, border in enumerate(proxy.borders or ()) if border]
    directions = np.eye(len(columns))
    if held and len(columns):
        _, singular, right = np.linalg.svd(np.array(held))
        directions = right[int((singular > 1e-10).sum()) :].T
    basis = np.zeros((2 * m, directions.shape[1]))
    basis[columns] = directions
    return basis
