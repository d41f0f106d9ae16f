"""Which cubic Béziers are close to an elastica, told from the angles and edges of their control polygons alone."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from batten.errors import InvalidInputError
from batten.kernels import bezier_criteria as kernel
from batten.measures.curvature_fit import cubic_array
from batten.typing import ArrayLike, BoolArray, FloatArray

#: Least β and greatest |β₁ − β₂| of the angle constraints, radians, as in Brander2018 §5.1.
ANGLE_LIMITS = (math.pi / 3.0, 0.4 * math.pi)
#: The same relaxed, Brander2018 §6.2: still useful if e_λ is looked at afterwards.
RELAXED_ANGLE_LIMITS = (math.pi / 4.0, 0.6 * math.pi)
#: Relaxed further: e_λ up to 0.72 after a projection.
WIDE_ANGLE_LIMITS = (math.pi / 6.0, 0.75 * math.pi)


class BezierCriteria(NamedTuple):
    """What `bezier_criteria` returns: one entry for each control polygon, leading shape (…).

    Lengths are in chords, the distance from p₀ to p₃; angles in radians.

    Attributes:
        beta: (…, 2), β₁ and β₂ in [0, 2π), between the outer edges and the chord, on the upper side of the chord.
        phi: (…, 2), φ₁ and φ₂ in [0, 2π) at p₁ and p₂; φ₁ + φ₂ = β₁ + β₂ modulo 2π. NaN where p₁ = p₂.
        edges: (…, 2), L₁ and L₂, lengths of the outer edges.
        edge_limits: (…, 2), Lmin and Lmax of edge-length constraint 1.
        inflectional: φ₁ and φ₂ lie on either side of π, or on it.
        angles_1: angle constraint 1, both β in (least, 2π − least).
        angles_2: angle constraint 2, |β₁ − β₂| < most.
        lengths_1: edge-length constraint 1, Lmin ≤ L₁, L₂ ≤ Lmax.
        lengths_2: edge-length constraint 2, L₁ and L₂ of an inflectional curve differ by a factor of 1.3 at most.
        simple: the outer edges neither cross nor touch: the control polygon does not meet itself.
        in_zone: (φ₁, φ₂) lies in the projection zone Π.
    """

    beta: FloatArray
    phi: FloatArray
    edges: FloatArray
    edge_limits: FloatArray
    inflectional: BoolArray
    angles_1: BoolArray
    angles_2: BoolArray
    lengths_1: BoolArray
    lengths_2: BoolArray
    simple: BoolArray
    in_zone: BoolArray


def bezier_criteria(control_points: ArrayLike, *, angle_limits: tuple[float, float] = ANGLE_LIMITS) -> BezierCriteria:
    """The constraints of Brander2018 §5.1 (Fisker2018 §3.2.3, (3.1)) on the control polygons of cubic Béziers.

    In standard position, p₀ = (0, 0) and p₃ = (1, 0), let θ₁ = arg(p₁ − p₀) and θ₂ = arg(p₂ − p₃) in (−π, π]: both are
    vectors from an end to its inner control point. Then β₁ = π − θ₁, β₂ = θ₂ modulo 2π, φ₁ = arg((p₂ − p₁)/(p₀ − p₁)),
    φ₂ = arg((p₃ − p₂)/(p₁ − p₂)), and with Δ = sign(θ₂)(θ₁ − θ₂)/π

        Lmin = max(0.4 (1 + 6Δ), 0.27),    Lmax = max(1.2 (1 + 5Δ), 0.58).

    The border of Π is the periodic cubic spline through (1.05, 1.05), (1.9, 1.3), (π, 1.35), (4.3, 1.3), (5.2, 2π − 5.2)
    and their reflections in φ₁ = φ₂ and φ₁ = 2π − φ₂. The paper does not name its parameter; here it is centripetal, and
    with one proportional to the distance or to the number of the point the border lies elsewhere by 0.03 at most.

    Parameters:
        control_points: shape (…, 4, 2), any unit.
        angle_limits: (least, most) of the angle constraints, radians; also `RELAXED_ANGLE_LIMITS`, `WIDE_ANGLE_LIMITS`.

    Returns:
        `BezierCriteria`. The truth values are the same for similar curves, mirror images and reversed curves.

    Raises:
        InvalidInputError: an array of another shape, limits that are not positive finite numbers.

    Accuracy: angles and lengths to a few roundings of the differences of control points.

    Degenerate cases: where p₀ = p₃, p₁ = p₀ or p₂ = p₃, and in rows with NaN or infinity, the numbers are NaN and all
    truth values False. With one outer edge on each side of the chord Δ depends on the direction of the curve; wherever
    angle constraint 1 holds, with π/6 for π/3 too, the limits are 0.27 and 0.58 in both, and here they are so always.

    Example:
        >>> arch = bezier_criteria([(0, 0), (0, 2), (3, 2), (3, 0)])
        >>> arch.beta.round(4).tolist(), arch.edges.round(4).tolist(), arch.edge_limits.round(4).tolist()
        ([1.5708, 1.5708], [0.6667, 0.6667], [0.4, 1.2])
    """
    points = cubic_array(control_points)
    least, most = checked_angle_limits(angle_limits)
    rows = np.require(points.reshape(-1, 4, 2), requirements=["C", "W"])
    out = np.empty((len(rows), kernel.COLUMNS))
    kernel.criteria_batch(rows, least, most, out)
    out = out.reshape(*points.shape[:-2], kernel.COLUMNS)
    beta, phi, edges, edge_limits = (out[..., i : i + 2] for i in range(0, kernel.INFLECTIONAL, 2))
    true = [out[..., i] == 1.0 for i in range(kernel.INFLECTIONAL, kernel.COLUMNS)]
    return BezierCriteria(beta, phi, edges, edge_limits, *true)


def is_elastica_like(control_points: ArrayLike) -> BoolArray:
    """Whether all criteria hold at once, which bounds e_λ by 0.412: Brander2018 §5.1, Fisker2018 §3.2.3.

    Both angle constraints, both edge-length constraints, a control polygon that does not meet itself, and (φ₁, φ₂) in Π:
    see `bezier_criteria`. Sufficient, not necessary: only a third of the curves within both angle constraints that have
    e_λ < 0.22 satisfy them all.

    Parameters:
        control_points: shape (…, 4, 2).

    Returns:
        Truth values of the leading shape.

    Raises:
        InvalidInputError: an array of another shape.

    Accuracy: the greatest e_λ found by local search is 0.4117, in a corner where an edge is 0.27 long; a random curve with
    more than 0.393, the paper's maximum, is one in a million. No proof.

    Degenerate cases: False, as in `bezier_criteria`; True for a straight line with handles of equal length, from 0.27 to
    0.5 chords.

    Example:
        >>> arch = [(0, 0), (0, 2), (3, 2), (3, 0)]
        >>> spike = [(0, 0), (0, 9), (3, 9), (3, 0)]
        >>> is_elastica_like([arch, spike]).tolist()
        [True, False]
    """
    found = bezier_criteria(control_points)
    within = found.angles_1 & found.angles_2 & found.lengths_1 & found.lengths_2
    return np.asarray(within & found.simple & found.in_zone)


def checked_angle_limits(angle_limits: tuple[float, float]) -> tuple[float, float]:
    """Both limits as floats, or `InvalidInputError`."""
    try:
        least, most = (float(v) for v in angle_limits)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"angle limits are (least, most) in radians; got {angle_limits!r}") from error
    if not (0.0 < least < math.inf and 0.0 < most < math.inf):
        raise InvalidInputError(
            f"angle limits are positive and finite, in radians; got {angle_limits!r}, try ANGLE_LIMITS = (π/3, 0.4π)"
        )
    return least, most
