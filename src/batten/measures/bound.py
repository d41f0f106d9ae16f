"""How far a curve can be from an elastica, by its residual: Fisker2018 §3.3, and sharper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import overload

import numpy as np

from batten.curves.base import Curve
from batten.curves.bezier import CubicBezier
from batten.errors import InvalidInputError
from batten.kernels.bezier import MOST_PANELS
from batten.kernels.bound import ALONG, ANGLE, DISTANCE, bound_batch, bound_of_points, split_panels
from batten.kernels.quadrature import NODES_24, WEIGHTS_24, adaptive_panels
from batten.measures.curvature_fit import CurvatureFit, cubic_array, curvature_fit
from batten.typing import ArrayLike, FloatArray

#: Of the fit behind residual and multipliers.
_TOLERANCE = 1e-10
#: Gaps (by the length) and corners (radians) between the pieces of a curve that count as rounding.
_JOINT = 1e-9


@dataclass(frozen=True)
class ElasticaBound:
    """What `elastica_distance_bound` returns: numbers for one curve, arrays of the leading shape for an array of cubics.

    Attributes:
        elastica: γₑ in force form, the seven numbers of `Elastica.parameters`, shape (…, 7).
        distance: max ‖γ(s) − γₑ(s)‖/L over at least 200 arc lengths.
        angle: max |θ(s) − θₑ(s)| over the same, radians.
        by_theorem_1: F(ℓ) e_r, the bound of Fisker2018, Corollary 1, for `distance`, and of Theorem 1 for `angle`.
        by_residual_norm: e_r (½ + sinh(2√ℓ)/(4√ℓ))^½, the same from Gronwall's inequality.
        along_curve: the sharpest, for `distance`.
    """

    elastica: FloatArray
    distance: float | FloatArray
    angle: float | FloatArray
    by_theorem_1: float | FloatArray
    by_residual_norm: float | FloatArray
    along_curve: float | FloatArray


@overload
def theorem_1_factor(eta: float) -> float: ...
@overload
def theorem_1_factor(eta: ArrayLike) -> float | FloatArray: ...
def theorem_1_factor(eta: ArrayLike) -> float | FloatArray:
    """F(η) = √2 ((2/(2−η))² − 1)/η for η ≤ 1, √(2/η) (2^(2η+1) − 1) above: Fisker2018 (3.4).

    It grows with η (and jumps up from 3√2 to 7√2 at 1), so that η ≤ ℓ = L²√(λ₁² + λ₂²) may be replaced by ℓ.

    Parameters:
        eta: η ≥ 0, a number or an array (…).

    Returns:
        F, of the same shape; inf beyond 511 or so.

    Raises:
        InvalidInputError: a negative η.

    Accuracy: 1e-15 × F up to η = 1 (computed as √2 (4 − η)/(2 − η)²), 1e-13 × F above.

    Degenerate cases: √2 at 0, the limit; NaN for NaN.

    Example:
        >>> round(theorem_1_factor(0.0) ** 2, 12), round(theorem_1_factor(1.0) ** 2, 12)
        (2.0, 18.0)
    """
    value = np.asarray(eta, dtype=np.float64)
    if (value < 0.0).any():
        raise InvalidInputError(f"η = s₀²√(λ₁² + λ₂²) is not negative; got {value.min()}")
    below = np.minimum(value, 1.0)
    with np.errstate(over="ignore"):
        above = np.sqrt(2.0 / np.maximum(value, 1.0)) * (np.exp2(2.0 * value + 1.0) - 1.0)
    found = np.where(value > 1.0, above, np.sqrt(2.0) * (4.0 - below) / (2.0 - below) ** 2)
    return float(found) if found.ndim == 0 else found


def elastica_distance_bound(curve: Curve | ArrayLike) -> ElasticaBound:
    """How far a curve is from the elastica of its own curvature fit, and bounds on that from the residual alone.

    γₑ has the start and start tangent of γ, its length L, and the multipliers λ₁, λ₂, α of `multipliers`, that is the force
    (λ₁, λ₂) and the start curvature λ₂x₀ − λ₁y₀ + α. It is not the closest elastica: `fit_elastica` finds that, usually
    several times as close. With d = θ − θₑ, ‖r‖ the residual and Λ = √(λ₁² + λ₂²), d′ = r + λ₂Δx − λ₁Δy, so that
    |d(s)| ≤ |∫₀ˢ r| + Λ∫₀ˢ∫₀ᵗ|d|. Three bounds come from it, each for ‖γ − γₑ‖∞/L:

    - `by_theorem_1`: F(ℓ) √L‖r‖ (Fisker2018 (3.4), Theorem 1, Corollary 1, η replaced by ℓ = L²Λ ≥ η); F grows like 4^ℓ.
    - `by_residual_norm`: |d| ≤ ∫ cosh(√Λ(s − t)) |r| dt (Gronwall) and the Cauchy–Schwarz inequality; grows like e^√ℓ.
    - `along_curve`: the equations of γ − γₑ are made linear about the known curve γ and solved with the signed residual;
      what that leaves out is bounded by Green's function of the linear equation (`kernels.bound`). Where this does not
      close, Gronwall's inequality with |∫₀ˢ r| in place of the norm, or ‖γ(s) − γ(0)‖ + s.

    Parameters:
        curve: a `Curve` with a continuous tangent, or control points of cubic Béziers, shape (…, 4, 2).

    Returns:
        An `ElasticaBound`; all but `elastica` are invariant under similarities (not under reversal: γₑ starts at the start).

    Raises:
        InvalidInputError: an array of another shape; a `Curve` with gaps or corners, of length 0 or not finite; a polyline.

    Accuracy: the bounds hold for the greatest distance over all s, not only where `distance` looks, which is at most 1 %
    less than that. They are upper sums over cells in which the slope of d is taken to be largest at an end, of
    quantities with a quadrature error of about 1e-11; `along_curve` has 1e-12 added for rounding. For random cubics in the
    unit disc with e_λ < 0.22, `along_curve` is 1.1 times the distance (median), `by_residual_norm` 140 times,
    `by_theorem_1` 1e8 times. About 0.2 ms for a cubic.

    Degenerate cases: a straight line is its own elastica, all bounds 0. A cusp, an end whose handle has length zero (for
    a `Curve` too) and a line that doubles back have no fit: bounds inf, the rest NaN. Bounds that exceed the floating
    point range are inf. A single point, NaN or infinity in a row: all NaN.

    Example:
        >>> bound = elastica_distance_bound([(0, 0), (0.1, 0.7), (0.9, 0.7), (1, 0)])
        >>> bool(bound.distance < bound.along_curve < 1.02 * bound.distance < 0.003)
        True
        >>> bool(bound.along_curve < 0.1 * bound.by_residual_norm < 1e-3 * bound.by_theorem_1)
        True
    """
    if not isinstance(curve, np.ndarray | list | tuple | CubicBezier) and isinstance(curve, Curve):
        fit = curvature_fit(curve, tolerance=_TOLERANCE)
        return _result(*_bound_of_curve(curve, fit), fit)
    points = curve.control_points if isinstance(curve, CubicBezier) else cubic_array(curve)
    rows = np.require(points.reshape(-1, 4, 2), requirements=["C", "W"])
    out, elastica = np.empty((len(rows), 3)), np.empty((len(rows), 7))
    bound_batch(rows, out, elastica)
    shape = points.shape[:-2]
    fit = curvature_fit(points, tolerance=_TOLERANCE)
    return _result(out.reshape(*shape, 3), elastica.reshape(*shape, 7), fit)


def _result(out: FloatArray, elastica: FloatArray, fit: CurvatureFit) -> ElasticaBound:
    ell = np.asarray(fit.length**2 * np.hypot(fit.lambda_1, fit.lambda_2))
    residual = np.asarray(np.sqrt(fit.length) * fit.residual_norm)
    root = np.sqrt(ell)
    with np.errstate(over="ignore"):
        # sinh(2√ℓ)/(4√ℓ) → ½ at ℓ = 0.
        growth = np.where(root > 1e-8, np.sinh(2.0 * root) / np.maximum(4.0 * root, 1e-8), 0.5)
        theorem = np.asarray(theorem_1_factor(ell)) * residual
        norm = np.sqrt(0.5 + growth) * residual
    columns = (out[..., DISTANCE], out[..., ANGLE], theorem, norm, out[..., ALONG])
    if out.ndim == 1:
        return ElasticaBound(elastica, *(float(v) for v in columns))
    return ElasticaBound(elastica, *columns)


def _bound_of_curve(curve: Curve, fit: CurvatureFit) -> tuple[FloatArray, FloatArray]:
    """The kernel's columns and the elastica's numbers for any curve."""
    length = float(curve.length)
    if not 0.0 < length < np.inf:
        raise InvalidInputError(f"a bound needs a curve of positive, finite length; got length {length}")
    out, elastica = np.full(3, np.nan), np.full(7, np.nan)
    if not np.isfinite(fit.residual_norm):
        out[ALONG] = np.inf
        return out, elastica
    breaks = np.asarray(curve.breaks(), dtype=np.float64)
    _check_joints(curve, breaks[1:-1], length)

    def integrands(t: FloatArray) -> FloatArray:
        first, second = curve.derivative(t), curve.derivative(t, 2)
        speed = np.hypot(first[..., 0], first[..., 1])
        return np.stack([speed, _curvature(first, second) ** 2 * speed])

    edges, _ = adaptive_panels(integrands, breaks, 1e-10)
    lefts, widths = edges[:-1].copy(), np.diff(edges)
    first = curve.derivative(lefts[:, None] + widths[:, None] * NODES_24)
    lengths = np.hypot(first[..., 0], first[..., 1]) @ WEIGHTS_24 * widths
    start = curve.point(0.0)
    b, c = float(fit.lambda_2), -float(fit.lambda_1)
    a = float(fit.alpha) + b * start[0] + c * start[1]
    direction = curve.derivative(0.0)
    elastica[:] = *start, np.arctan2(direction[1], direction[0]), a, -c, b, length
    fine_lefts, fine_widths = np.empty(MOST_PANELS), np.empty(MOST_PANELS)
    stiffness = float(np.sqrt(np.hypot(b, c)))
    count = split_panels(lefts, widths, lengths, len(lefts), stiffness, fine_lefts, fine_widths)
    if count:
        lefts, widths = fine_lefts[:count].copy(), fine_widths[:count].copy()
    values = _points(curve, np.append(lefts, 1.0), widths)
    bound_of_points(values, widths, len(lefts), a, b, c, out)
    if not count:
        out[ALONG] = 2.0
    if fit.bending_energy == 0.0:
        out[:] = 0.0
    return out, elastica


def _check_joints(curve: Curve, inner: FloatArray, length: float) -> None:
    """Refuse gaps and corners at inner breaks."""
    if inner.size == 0:
        return
    before = np.nextafter(inner, -np.inf)
    gaps = np.linalg.norm(curve.point(inner) - curve.point(before), axis=-1) / length
    one, other = curve.derivative(before), curve.derivative(inner)
    cross, dot = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0], (one * other).sum(axis=-1)
    corners = np.abs(np.arctan2(cross, dot))
    if gaps.max() > _JOINT or corners.max() > _JOINT:
        raise InvalidInputError(
            f"a bound needs a curve without gaps and corners; got a gap of {gaps.max():.3g} × length and a corner of "
            f"{corners.max():.3g} rad; take its pieces one by one"
        )


def _curvature(first: FloatArray, second: FloatArray) -> FloatArray:
    with np.errstate(divide="ignore", invalid="ignore"):
        return (first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]) / np.hypot(
            first[..., 0], first[..., 1]
        ) ** 3


def _points(curve: Curve, edges: FloatArray, widths: FloatArray) -> FloatArray:
    """The rows that the kernel takes, at both ends and the 24 nodes of each panel."""
    t = np.append((edges[:-1, None] + widths[:, None] * np.append(0.0, NODES_24)).ravel(), 1.0)
    first = curve.derivative(t)
    kappa = _curvature(first, curve.derivative(t, 2))
    before = kappa.copy()
    ends = np.nextafter(edges[1:], -np.inf)
    before[25::25] = _curvature(curve.derivative(ends), curve.derivative(ends, 2))
    place = curve.point(t) - curve.point(0.0)
    return np.ascontiguousarray(np.stack([place[:, 0], place[:, 1], first[:, 0], first[:, 1], kappa, before]))
