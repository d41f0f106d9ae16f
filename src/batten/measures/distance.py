"""How far one curve is from another: L² and H¹ over arc length, and Hausdorff."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from batten.curves.arc_length import ArcLength
from batten.curves.base import Curve
from batten.curves.bezier import CubicBezier
from batten.curves.flatten import flatten
from batten.errors import InvalidInputError
from batten.kernels.polyline_distance import directed_distance
from batten.kernels.quadrature import NODES_24, WEIGHTS_24
from batten.measures.curvature_fit import cubic_array
from batten.typing import ArrayLike, FloatArray


def l2_distance(curve: Curve | ArrayLike, other: Curve | ArrayLike, *, normalised: bool = True) -> float | FloatArray:
    """(∫ |γ(s) − γₑ(s)|² ds / L³)^½, both curves at the same fraction of their own arc length: Fisker2018 (3.2).

    It is R₄ of Brander2016 §4. L and ds are those of the first curve.

    Parameters:
        curve, other: each a `Curve` or control points of cubic Béziers, shape (…, 4, 2); leading shapes broadcast.
        normalised: with False the value is multiplied by L^(3/2), which leaves (∫ |γ − γₑ|² ds)^½.

    Returns:
        A number, or an array of the broadcast leading shape.

    Raises:
        InvalidInputError: an array of another shape, leading shapes that do not broadcast, a `Curve` of length 0.

    Accuracy: 1e-12 relative to the larger of value and 1 for curves whose direction can be resolved.
    Degenerate cases: rows with NaN, infinity or length 0 give NaN. The direction matters: a curve and its reverse differ.

    Example:
        >>> line, shifted = [(0, 0), (1, 0), (2, 0), (3, 0)], [(0, 3), (1, 3), (2, 3), (3, 3)]
        >>> float(round(l2_distance(line, shifted), 12)), float(round(l2_distance(line, shifted, normalised=False) ** 2, 9))
        (1.0, 27.0)
    """

    def distance(first: ArcLength, second: ArcLength) -> float:
        fraction, weight = _common_nodes(first, second)
        gap = first.curve.point(first.parameter_at(fraction)) - second.curve.point(second.parameter_at(fraction))
        return float(np.sqrt((weight * (gap**2).sum(axis=-1)).sum())) / first.length

    return _over_pairs(curve, other, distance, normalised)


def h1_distance(curve: Curve | ArrayLike, other: Curve | ArrayLike, *, normalised: bool = True) -> float | FloatArray:
    """(∫ |γ − γₑ|² ds / L³ + ∫ (θ − θₑ)² ds / L)^½ with the tangent angles θ, θₑ: Fisker2018 (3.3).

    Angles are continuous along each curve (at a corner they jump by less than half a turn); of the multiples of 2π by
    which θ − θₑ may be shifted as a whole, the one with the least distance is taken.

    Parameters:
        curve, other: each a `Curve` or control points of cubic Béziers, shape (…, 4, 2); leading shapes broadcast.
        normalised: with False the value is multiplied by L^(3/2), to go with `l2_distance`.

    Returns:
        A number, or an array of the broadcast leading shape.

    Raises:
        InvalidInputError: an array of another shape, leading shapes that do not broadcast, a `Curve` of length 0.

    Accuracy: 1e-10 for curves without near-cusps. At an exact cusp the sense of the half turn is arbitrary.
    Degenerate cases: rows with NaN, infinity or length 0 give NaN.

    Example:
        >>> line, turned = [(0, 0), (1, 0), (2, 0), (3, 0)], [(0, 0), (0, 1), (0, 2), (0, 3)]
        >>> float(round(h1_distance(line, turned) ** 2 - 2 / 3, 12)) == round((np.pi / 2) ** 2, 12)
        True
    """

    def distance(first: ArcLength, second: ArcLength) -> float:
        fraction, weight = _common_nodes(first, second)
        t, u = first.parameter_at(fraction), second.parameter_at(fraction)
        gap = first.curve.point(t) - second.curve.point(u)
        turn = _angles(first.curve, t) - _angles(second.curve, u)
        turn -= 2.0 * np.pi * np.round((weight * turn).sum() / (2.0 * np.pi))
        squares = (gap**2).sum(axis=-1) / first.length**2 + turn**2
        return float(np.sqrt((weight * squares).sum()))

    return _over_pairs(curve, other, distance, normalised)


def hausdorff_distance(
    curve: Curve | ArrayLike,
    other: Curve | ArrayLike,
    *,
    tolerance: float | None = None,
    normalised: bool = False,
) -> float | FloatArray:
    """The greatest distance from a point of either curve to the other curve, as sets of points: two-sided Hausdorff.

    Both curves are followed by polylines within a quarter of the tolerance; between those the distance is found by
    branch and bound to another quarter.

    Parameters:
        curve, other: each a `Curve` or control points of cubic Béziers, shape (…, 4, 2); leading shapes broadcast.
        tolerance: greatest absolute error, in the unit of the coordinates; at least 1e-10 × the length of the first
            curve. None takes 1e-6 × that length.
        normalised: divide by the length of the first curve.

    Returns:
        A number, or an array of the broadcast leading shape.

    Raises:
        InvalidInputError: an array of another shape, leading shapes that do not broadcast, a `Curve` of length 0, a
            tolerance out of range.

    Accuracy: within `tolerance` (before division by the length).
    Degenerate cases: rows with NaN, infinity or length 0 give NaN. Gaps between the pieces of a `PiecewiseCurve` count as
    bridged by straight lines.

    Example:
        >>> line, bump = [(0, 0), (1, 0), (2, 0), (3, 0)], [(0, 0), (1, 0.4), (2, 0.4), (3, 0)]
        >>> round(float(hausdorff_distance(line, bump)), 5)
        0.3
    """

    def distance(first: Curve, second: Curve) -> float:
        length, second_length = first.length, second.length
        if not (0.0 < length < np.inf and 0.0 < second_length < np.inf):
            raise InvalidInputError(f"distances need curves of positive length; got {length} and {second_length}")
        within = 1e-6 * length if tolerance is None else float(tolerance)
        if not 1e-10 * length <= within < np.inf:
            raise InvalidInputError(f"the tolerance must be at least 1e-10 × the length {length}; got {tolerance}")
        a, b = flatten(first, 0.25 * within), flatten(second, 0.25 * within)
        there = directed_distance(a, b, 0.25 * within, 0.0)
        return float(directed_distance(b, a, 0.25 * within, there)) / (length if normalised else 1.0)

    return _over_curves(curve, other, distance)


def _common_nodes(first: ArcLength, second: ArcLength) -> tuple[FloatArray, FloatArray]:
    """Fractions of the arc length and weights, summing to 1, on panels where both curves are smooth and resolved."""
    edges = np.union1d(first.lengths / first.length, second.lengths / second.length)
    keep = np.concatenate([[True], np.diff(edges) > 1e-15])
    edges = edges[keep]
    edges[-1] = 1.0
    width = np.diff(edges)[:, None]
    return (edges[:-1, None] + width * NODES_24).ravel(), (width * WEIGHTS_24).ravel()


def _angles(curve: Curve, t: FloatArray) -> FloatArray:
    """The tangent angle at ascending parameters, continuous."""
    d = curve.derivative(t)
    return np.unwrap(np.arctan2(d[..., 1], d[..., 0]))


def _over_pairs(
    curve: Curve | ArrayLike,
    other: Curve | ArrayLike,
    distance: Callable[[ArcLength, ArcLength], float],
    normalised: bool,
) -> float | FloatArray:
    """`_over_curves` with the arc lengths of both, measured once for a curve that is met again and again."""
    measured: dict[int, ArcLength] = {}

    def arc_length(one: Curve) -> ArcLength:
        if id(one) not in (id(curve), id(other)):
            return ArcLength.of(one)
        if id(one) not in measured:
            measured[id(one)] = ArcLength.of(one)
        return measured[id(one)]

    def scaled(first: Curve, second: Curve) -> float:
        a, b = arc_length(first), arc_length(second)
        return distance(a, b) * (1.0 if normalised else a.length**1.5)

    return _over_curves(curve, other, scaled)


def _over_curves(
    curve: Curve | ArrayLike, other: Curve | ArrayLike, distance: Callable[[Curve, Curve], float]
) -> float | FloatArray:
    """Apply `distance` to two curves, or to each pair of rows of two broadcast arrays; a bad row gives NaN."""
    first, second = _curve_or_array(curve), _curve_or_array(other)
    shapes = [v.shape[:-2] for v in (first, second) if isinstance(v, np.ndarray)]
    if not (isinstance(first, np.ndarray) or isinstance(second, np.ndarray)):
        return distance(first, second)
    try:
        shape = np.broadcast_shapes(*shapes)
    except ValueError as error:
        raise InvalidInputError(f"leading shapes {shapes} do not broadcast") from error
    out = np.full(shape, np.nan)
    rows = [v if not isinstance(v, np.ndarray) else np.broadcast_to(v, (*shape, 4, 2)) for v in (first, second)]
    for index in np.ndindex(shape):
        pair = [v[index] if isinstance(v, np.ndarray) else v for v in rows]
        if all(_usable(v) for v in pair if isinstance(v, np.ndarray)):
            a, b = (CubicBezier(v) if isinstance(v, np.ndarray) else v for v in pair)
            out[index] = distance(a, b)
    return out[()]


def _curve_or_array(curve: Curve | ArrayLike) -> Curve | FloatArray:
    if not isinstance(curve, np.ndarray | list | tuple) and isinstance(curve, Curve):
        return curve
    return cubic_array(curve)


def _usable(points: FloatArray) -> bool:
    return bool(np.isfinite(points).all() and (points != points[0]).any())


def distance_to_polyline(points: FloatArray, polyline: FloatArray) -> FloatArray:
    """Least distance of each point, (k, 2), from a polyline, (m, 2); shape (k,)."""
    start, edge = polyline[:-1], np.diff(polyline, axis=0)
    offset = points[:, None, :] - start
    along = np.einsum("kmi,mi->km", offset, edge) / np.maximum(np.einsum("mi,mi->m", edge, edge), 1e-300)
    foot = offset - np.clip(along, 0.0, 1.0)[..., None] * edge
    distance: FloatArray = np.sqrt(np.einsum("kmi,kmi->km", foot, foot).min(axis=1))
    return distance
