"""The affine fit of a curve's curvature: multipliers, residual, energy and length in one pass.

An elastica satisfies κ = λ₂x − λ₁y + α (Brander2016 (5), Fisker2018 (2.2)). For any curve, the numbers λ₁, λ₂, α that
satisfy it best in the sense of ∫(κ + λ₁y − λ₂x − α)² ds are the start of every approximation by an elastica, and what
is left, r = κ + λ₁y − λ₂x − α, measures how far the curve is from one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, overload

import numpy as np

from batten.curves.base import Curve
from batten.curves.bezier import CubicBezier
from batten.curves.polyline import Polyline
from batten.errors import InvalidInputError
from batten.kernels.bezier import LAMBDA_RESIDUAL, RESIDUAL_SQUARED, curvature_fit_batch
from batten.kernels.quadrature import NODES_24, WEIGHTS_24, adaptive_panels, panel_condition
from batten.typing import ArrayLike, FloatArray

_EPS = float(np.finfo(np.float64).eps)
#: Rows whose results stay in the cache.
_CHUNK = 4096


@dataclass(frozen=True)
class CurvatureFit:
    """What `curvature_fit` returns: numbers for one curve, arrays of the leading shape for an array of cubics.

    Attributes:
        length: L, the arc length.
        bending_energy: ∫κ² ds, without the factor ½ of Brander2016 and Moreton1995.
        residual_norm: ‖r‖₂ = (∫r² ds)^½.
        lambda_1, lambda_2, alpha: the multipliers, for the coordinates as given.
        lambda_residual: e_λ = ‖r‖₂ / (∫κ² ds)^½ in [0, 1].
    """

    length: float | FloatArray
    bending_energy: float | FloatArray
    residual_norm: float | FloatArray
    lambda_1: float | FloatArray
    lambda_2: float | FloatArray
    alpha: float | FloatArray
    lambda_residual: float | FloatArray


class Multipliers(NamedTuple):
    """λ₁, λ₂, α of κ ≈ λ₂x − λ₁y + α: numbers for one curve, arrays of the leading shape for an array of cubics."""

    lambda_1: float | FloatArray
    lambda_2: float | FloatArray
    alpha: float | FloatArray


def curvature_fit(curve: Curve | ArrayLike, *, tolerance: float | None = 1e-6) -> CurvatureFit:
    """Fit κ ≈ λ₂x − λ₁y + α in the least-squares sense over arc length: Brander2016 (6), solved stably.

    Parameters:
        curve: a `Curve`, or control points of cubic Béziers, shape (…, 4, 2).
        tolerance: how far e_λ may be off, absolutely, in [1e-10, 0.1]. None takes one Gauss rule of 24 nodes on each
            smooth piece, whatever the curve: about four times as fast, as published for interactive use, and off by 0.03
            at the 95th percentile and by up to 0.9 for random cubics, because curvature peaks fall between the nodes.

    Returns:
        A `CurvatureFit`. All of it scales as it must; e_λ, L·∫κ², √L‖r‖ and L²√(λ₁²+λ₂²) are invariant under
        similarities and reversal.

    Raises:
        InvalidInputError: an array of another shape, a tolerance outside its range, a polyline (it has no curvature).

    Accuracy: e_λ within `tolerance`, energy and residual norm within about tolerance × energy, length far better. Small
    residuals are not differences of large numbers: an exact elastica gives 1e-14 or less. Of a near-line with sagitta ε
    × length the curvature itself is known only to 1e-16/ε, relatively, and so are the answers.

    Degenerate cases:
        - A straight line, to within the rounding of its coordinates: all zero but the length.
        - A cusp, an end whose handle has length zero, or a straight line that doubles back: ∫κ² ds diverges; energy
          and residual norm are inf (or, where rounding turns a cusp into a near-cusp, very large) and e_λ = 1, its limit.
          With tolerance None none of this is noticed on curved ones.
        - A single point: length 0, all else NaN. NaN or infinity in a row: that row is NaN, the others stand.
        - Corners between smooth pieces are not counted. A circle gives λ₁ = λ₂ = 0 to rounding.

    Example:
        >>> import numpy as np
        >>> arch = np.array([(0, 0), (0, 1), (1, 1), (1, 0)])
        >>> fit = curvature_fit([arch, 2 * arch])
        >>> fit.length.round(12).tolist(), np.ptp(fit.lambda_residual).round(12).tolist()
        ([2.0, 4.0], 0.0)
    """
    condition = _condition(tolerance)
    if isinstance(curve, CubicBezier):
        return CurvatureFit(*(float(v) for v in _fit_cubics(curve.control_points, condition, slice(0, 7))))
    if not isinstance(curve, np.ndarray | list | tuple) and isinstance(curve, Curve):
        return _fit_curve(curve, tolerance)
    columns = _fit_cubics(cubic_array(curve), condition, slice(0, 7))
    return CurvatureFit(*(columns[..., i] for i in range(7)))


def lambda_residual_of_cubics(control_points: ArrayLike, tolerance: float | None) -> FloatArray:
    """The last field of `curvature_fit` alone, for control points of shape (…, 4, 2): fast for millions of rows."""
    points = cubic_array(control_points)
    return _fit_cubics(points, _condition(tolerance), slice(LAMBDA_RESIDUAL, None))[..., 0]


@overload
def basic_length(curve: Curve, *, tolerance: float | None = 1e-6) -> float: ...
@overload
def basic_length(curve: ArrayLike, *, tolerance: float | None = 1e-6) -> FloatArray: ...
def basic_length(curve: Curve | ArrayLike, *, tolerance: float | None = 1e-6) -> float | FloatArray:
    """The scale-invariant ℓ = L²√(λ₁² + λ₂²) of Fisker2018 §3.3.1.

    For an elastica √ℓ is the length of the piece of the basic elastica ζ_k that it is an image of. ℓ bounds the factor
    between residual and distance in Fisker2018 (3.4) and (3.7).

    Parameters, raises and degenerate cases as for `curvature_fit`; 0 for lines and circles, NaN for a point.

    Example:
        >>> float(basic_length([(0, 0), (1, 1), (2, 2), (3, 3)]))
        0.0
    """
    fit = curvature_fit(curve, tolerance=tolerance)
    return fit.length**2 * np.hypot(fit.lambda_1, fit.lambda_2)


def multipliers(curve: Curve | ArrayLike, *, tolerance: float | None = 1e-6) -> Multipliers:
    """(λ₁, λ₂, α) with the least ∫(κ + λ₁y − λ₂x − α)² ds: Brander2016 (6), for the coordinates as given.

    Parameters, raises and degenerate cases as for `curvature_fit`. Under p ↦ S·R(φ)·p + v, (λ₁, λ₂) turns by φ and is
    divided by S²; under reversal all three change sign. At a cusp they are those of the smooth pieces.

    Example:
        >>> half_circle = [(1, 0), (1, 4 / 3), (-1, 4 / 3), (-1, 0)]
        >>> fit = multipliers(half_circle)
        >>> bool(abs(fit.lambda_2) < 1e-12 and 0.9 < fit.alpha < 1.3)
        True
    """
    fit = curvature_fit(curve, tolerance=tolerance)
    return Multipliers(fit.lambda_1, fit.lambda_2, fit.alpha)


def cubic_array(control_points: ArrayLike) -> FloatArray:
    """Control points of cubic Béziers as an array of shape (…, 4, 2), or `InvalidInputError`."""
    try:
        points = np.asarray(control_points, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(
            f"expected a curve or control points of cubic Béziers, shape (…, 4, 2); got {type(control_points).__name__}"
        ) from error
    if points.ndim < 2 or points.shape[-2:] != (4, 2):
        raise InvalidInputError(
            f"expected a curve or control points of cubic Béziers, shape (…, 4, 2); got shape {points.shape}; "
            "interpolate measured points with BSplineCurve.interpolate"
        )
    return points


def _condition(tolerance: float | None) -> float:
    """What the kernel takes for a tolerance of e_λ."""
    if tolerance is None:
        return 0.0
    if not 1e-10 <= tolerance <= 0.1:
        raise InvalidInputError(f"the tolerance of e_λ lies in [1e-10, 0.1] or is None; got {tolerance}")
    return panel_condition(tolerance)


def _fit_cubics(points: FloatArray, condition: float, columns: slice) -> FloatArray:
    """Those columns of the kernel's result for cubics, ‖r‖² turned into ‖r‖: leading shape + (number of columns,)."""
    # One type of array for the kernel: writable and contiguous, else it would be compiled twice.
    rows = np.require(points.reshape(-1, 4, 2), requirements=["C", "W"])
    buffer = np.empty((min(len(rows), _CHUNK), 7))
    out = np.empty((len(rows), len(range(7)[columns])))
    for start in range(0, len(rows), _CHUNK):
        chunk = rows[start : start + _CHUNK]
        found = buffer[: len(chunk)]
        curvature_fit_batch(chunk, condition, found)
        np.sqrt(found[:, RESIDUAL_SQUARED], out=found[:, RESIDUAL_SQUARED])
        out[start : start + _CHUNK] = found[:, columns]
    return out.reshape(*points.shape[:-2], out.shape[1])


def _fit_curve(curve: Curve, tolerance: float | None) -> CurvatureFit:
    if isinstance(curve, Polyline) and len(curve.points) > 2:
        raise InvalidInputError(
            "a polyline has no curvature to measure: 0 along its segments, infinite at its corners; interpolate its "
            "points with BSplineCurve.interpolate"
        )

    def integrands(t: FloatArray) -> FloatArray:
        first, second = curve.derivative(t), curve.derivative(t, 2)
        speed, kappa = _speed_and_curvature(first, second)
        return np.stack([speed, kappa**2 * speed])

    breaks = np.asarray(curve.breaks(), dtype=np.float64)
    edges, converged = breaks, True
    if tolerance is not None:
        edges, converged = adaptive_panels(integrands, breaks, 0.1 * tolerance)
    widths = np.diff(edges)
    t = (edges[:-1, None] + widths[:, None] * NODES_24).ravel()
    first, second = curve.derivative(t), curve.derivative(t, 2)
    speed, kappa = _speed_and_curvature(first, second)
    weights = speed * (widths[:, None] * WEIGHTS_24).ravel()
    start = curve.point(0.0)
    z = (curve.point(np.append(t, 1.0)) - start) @ np.array([1.0, 1.0j])
    u = z[np.argmax(np.abs(z))]
    length = float(weights.sum())
    if u == 0.0 or not np.isfinite(length):
        return CurvatureFit(0.0 if u == 0.0 else np.nan, *([np.nan] * 6))
    z = z / u
    noise = 8.0 * _EPS * (2.0 + np.abs(start).sum() / abs(u))
    if np.abs(z.imag).max() <= noise:
        forward = (first @ np.array([1.0, 1.0j]) / u).real
        doubles = forward.min() < -noise * np.abs(forward).max() and forward.max() > noise * np.abs(forward).max()
        infinite = np.inf if doubles else 0.0
        return CurvatureFit(length, infinite, infinite, 0.0, 0.0, 0.0, 1.0 if doubles else 0.0)
    # Rounding hides ever finer panels at a cusp; noise all over the curve never makes panels as narrow as this.
    cusp = not converged and widths.min() < 2.0**-20 * np.diff(breaks).max()
    return _least_squares(z[:-1], u, start, np.where(speed > 0.0, kappa, 0.0), weights, cusp)


def _speed_and_curvature(first: FloatArray, second: FloatArray) -> tuple[FloatArray, FloatArray]:
    speed = np.hypot(first[..., 0], first[..., 1])
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        kappa = (first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]) / speed**3
    return speed, kappa


def _least_squares(
    z: np.ndarray[tuple[int, ...], np.dtype[np.complex128]],
    u: complex,
    start: FloatArray,
    kappa: FloatArray,
    weights: FloatArray,
    cusp: bool,
) -> CurvatureFit:
    """The fit from nodes z = (x + iy − start)/u, by an orthogonal triangularisation of the weighted columns."""
    root = np.sqrt(weights)
    columns = root[:, None] * np.stack([np.ones_like(kappa), z.real, z.imag, kappa], axis=-1)
    r: FloatArray = np.asarray(np.linalg.qr(columns, mode="r"))
    energy = float((weights * kappa**2).sum())
    determined = abs(r[2, 2]) > 1e-12 * np.hypot(*r[1:3, 2])
    c = r[2, 3] / r[2, 2] if determined else 0.0
    b = (r[1, 3] - c * r[1, 2]) / r[1, 1]
    a = (r[0, 3] - b * r[0, 1] - c * r[0, 2]) / r[0, 0]
    residual = abs(float(r[3, 3])) if determined else float(np.hypot(r[2, 3], r[3, 3]))
    # κ = a + b Re z + c Im z; its gradient in the plane is (b + ic) u/|u|².
    gradient = complex(b, c) * u / abs(u) ** 2
    alpha = a - gradient.real * start[0] - gradient.imag * start[1]
    infinite = np.inf if cusp else 0.0
    return CurvatureFit(
        float(weights.sum()),
        energy + infinite,
        residual + infinite,
        float(-gradient.imag),
        float(gradient.real),
        float(alpha),
        1.0 if cusp else min(1.0, float(residual / np.sqrt(energy))),
    )
