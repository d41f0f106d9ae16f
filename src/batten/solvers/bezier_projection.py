"""Cubic Béziers made close to elastica by other lengths of their outer edges, and by turns where lengths do not do."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from batten.errors import InvalidInputError
from batten.kernels import bezier_projection as kernel
from batten.kernels.quadrature import panel_condition
from batten.measures.curvature_fit import cubic_array
from batten.measures.lambda_class import BEST_BELOW
from batten.measures.lambda_residual import lambda_residual
from batten.solvers.bezier_criteria import ANGLE_LIMITS, checked_angle_limits
from batten.solvers.nearest_projection import nearest_rows
from batten.typing import ArrayLike, FloatArray, IntArray

#: What the numbers in `BezierProjection.status` mean.
STATUS = (
    "kept",
    "reached",
    "best of the path",
    "minimum",
    "unbounded",
    "step limit",
    "outside the angle limits",
    "degenerate",
    "not finite",
    "turned",
    "moved",
)

Method = Literal["zone", "feedback", "gradient", "nearest"]
Keep = Literal["tangents", "points", "nothing"]
Energy = Literal["bending", "scale_invariant", "lambda_residual"]

_METHODS = {"zone": kernel.ZONE, "feedback": kernel.FEEDBACK, "gradient": kernel.GRADIENT}
_NAMES = (*_METHODS, "nearest")
_KEEP = ("tangents", "points", "nothing")
_ENERGIES = {
    "bending": kernel.BENDING,
    "scale_invariant": kernel.SCALE_INVARIANT,
    "lambda_residual": kernel.RESIDUAL,
}
#: e_λ within this on the path; the gradient takes differences of it over 2e-4.
_TOLERANCE = {"zone": 1e-6, "feedback": 1e-6, "gradient": 1e-10}
#: No angle lies outside.
_ANY_ANGLES = (-1.0, 100.0)


class BezierProjection(NamedTuple):
    """What `project_bezier` returns, one entry for each curve.

    Attributes:
        control_points: (…, 4, 2).
        residual_before, residual_after: (…), e_λ of the curves given and returned, within 1e-6.
        status: (…), index into `STATUS`: 0 kept as it was (it met the aim); 1 zone or threshold reached; 2 not reached,
            the best of the path; 3, 4, 5 how a descent ended: in a local minimum, with an edge of more than 1000 chords,
            after 400 steps; 6 outside the angle limits, returned as it was; 7 an end without a direction or a chord of
            length zero (with "nearest": a single point), NaN; 8 NaN or infinity came in, NaN; 9 the threshold was reached
            by turning end tangents; 10 by moving end points, too.
    """

    control_points: FloatArray
    residual_before: FloatArray
    residual_after: FloatArray
    status: IntArray


def project_bezier(
    control_points: ArrayLike,
    method: Method = "feedback",
    *,
    threshold: float | None = None,
    keep: Keep = "tangents",
    angle_limits: tuple[float, float] | None = ANGLE_LIMITS,
    energy: Energy | None = None,
) -> BezierProjection:
    """Change the lengths of a cubic's outer edges until it is close to an elastica: Brander2018 §4–7, Fisker2018 §4.1.

    End points and the directions of the end tangents stay, unless `keep` says otherwise. Edges that cross are first
    shortened, both by one factor.

    - "feedback" (§6): is the curve inflectional with both lengths L₁, L₂ brought into [0.27, Lmax] (see
      `bezier_criteria`)? Then it is taken so, and they go straight to 0.27. If it is not, or once it is not any more,
      they go straight to the fitted L̄₁(θ₁, θ₂) = max(0.12, f) and L̄₂(θ₁, θ₂) = L̄₁(π − θ₂, π − θ₁). e_λ is taken at
      t = 0, 0.1, … 1 of each way and once more in steps of 0.02 about the least, and the least is returned; or the
      first that is ≤ `threshold`.
    - "zone" (§5.2): lengths are brought into the edge-length constraints and go, with (1) or (2), until (φ₁, φ₂) lies in
      the zone Π; then `is_elastica_like` is true and e_λ < 0.412. The smallest t is found by bisection.
    - "gradient" (§4): steepest descent of `energy` in (log L₁, log L₂) to a local minimum. Kept to show why it is not the
      way: with "bending", ∫κ² ds, the edges grow without end; with "scale_invariant", L ∫κ² ds, the outcome need not be
      near an elastica; with "lambda_residual", e_λ, neighbouring curves end in different minima. Edges may cross.
    - "nearest", ours: for every cubic, angle constraints or not. Without a threshold the lengths of least
      e_λ² + w d²/(1 + d²) + v c²/(1/4 + c²), d the distance in (log L₁, log L₂) from the lengths as drawn, c from those
      of 0.36 chords, w = 1e-3 and v = 2e-4: the least of e_λ, and of minima that are nearly as good the nearer one. With a
      threshold the lengths nearest to the drawn ones in that distance with which e_λ is at most the threshold; a curve
      that is good enough stays. Lengths from 0.1 to 6 chords are tried, and those on the way there. If none of them
      reach the threshold, "points" turns the end tangents by τ₁ and τ₂ and takes the least τ₁² + τ₂² that does, any
      lengths; "nothing" also moves the end points, on a circle about the middle of the chord by arcs δ on both sides,
      and takes the least τ₁² + τ₂² + 2 (δ/P)², P the length of the control polygon.

    Parameters:
        control_points: shape (…, 4, 2), any unit.
        method: as above.
        threshold: e_λ in [0, 1) at which to stop; None for the least that is found, and for 0.22 (`BEST_BELOW`) if
            `keep` is not "tangents". Not for "zone".
        keep: "tangents", "points" or "nothing", what stays whatever it takes; the latter two for "nearest" only.
        angle_limits: (least, most) of angle constraints 1 and 2, radians, outside of which curves are left alone; also
            `RELAXED_ANGLE_LIMITS` and `WIDE_ANGLE_LIMITS` of `bezier_criteria`; None takes every curve, with "feedback"
            only. Without meaning for "gradient" and "nearest".
        energy: for "gradient" only; None is "lambda_residual".

    Returns:
        `BezierProjection`. It commutes with similarities, reflections and reversal. "zone", and "feedback" and
        "nearest" with a threshold that is reached, change nothing the second time; without one they search again from
        another start.

    Raises:
        InvalidInputError: an array of another shape, an unknown word, a threshold or limits outside their domain, or an
            option that the method does not have.

    Accuracy: end points bit by bit, directions to rounding of the coordinates. With `ANGLE_LIMITS`, "feedback" gives
    random curves in the unit disc a mean e_λ of 0.042, 0.16 at the 99th percentile and less than 0.29 in 600,000
    trials; "zone" less than 0.4 in 100,000, of which 7 did not reach it. Neither is proven. Without limits the mean of
    the others is 0.38, and edges of 1e6 chords and more are possible: look at `residual_after` and at the lengths. Of
    10,000 curves 1 or 2 were better before "feedback". About 3 µs a curve with "feedback", 30 with "zone", 100 to 200
    with "gradient".

    "nearest" has a lower e_λ than "feedback" for 97 % of the random curves within `ANGLE_LIMITS`, mean 0.022, less than
    0.2 in 200,000, and moves by more than 0.05 for fewer of them when the input moves by 0.001 (0.09 % against 0.13 %).
    That its answers are the nearest ones is not proven: against a dense search 2 to 5 % were not, where slim parts of
    the set lie nearer. All of 100,000 random cubics reached 0.22 with "points" and "nothing", 84 % with "tangents". 50
    µs a curve without, 65 to 100 with a threshold, 250 to 400 on average for wholly random curves with "points" and
    "nothing".

    Degenerate cases: see the status. A straight line with the handles inwards stays one. For "nearest" a handle of
    length zero has the direction of the end tangent and counts as 0.01 chords; with p₀ = p₃ L₁ L₂ stays, only L₁/L₂ is
    sought, and "nothing" does what "points" does. Where two answers of a symmetric curve are equally near, one of them
    is taken.

    Example:
        >>> spike = [(0, 0), (0, 9), (3, 9), (3, 0)]
        >>> found = project_bezier(spike)
        >>> print(f"{found.residual_before:.2f} {found.residual_after:.2f} {STATUS[found.status]}")
        0.75 0.01 best of the path
    """
    points = cubic_array(control_points)
    if keep not in _KEEP:
        raise InvalidInputError(f"keep is one of {', '.join(_KEEP)}; got {keep!r}")
    if keep != "tangents" and method != "nearest":
        raise InvalidInputError(f'keep={keep!r} belongs to "nearest"; {method!r} always keeps "tangents"')
    if method not in _NAMES:
        raise InvalidInputError(f"method is one of {', '.join(_NAMES)}; got {method!r}")
    if energy is not None and (method != "gradient" or energy not in _ENERGIES):
        raise InvalidInputError(f'energy belongs to "gradient" and is one of {", ".join(_ENERGIES)}; got {energy!r}')
    if threshold is not None and not (method != "zone" and 0.0 <= threshold < 1.0):
        raise InvalidInputError(
            f'a threshold lies in [0, 1) and belongs to "feedback" and "gradient"; got {threshold!r}'
        )
    if angle_limits is None and method == "zone":
        raise InvalidInputError('"zone" needs angle limits: outside of them the zone cannot be reached')
    limits = _ANY_ANGLES if angle_limits is None else checked_angle_limits(angle_limits)
    rows = np.require(points.reshape(-1, 4, 2), requirements=["C", "W"])
    out = np.empty_like(rows)
    status = np.empty(len(rows), np.int64)
    if method == "nearest":
        nearest_rows(rows, BEST_BELOW if threshold is None and keep != "tangents" else threshold, keep, out, status)
    else:
        kernel.project_batch(
            rows,
            _METHODS[method],
            _ENERGIES[energy or "lambda_residual"],
            limits,
            float(threshold or 0.0),
            panel_condition(_TOLERANCE[method]),
            out,
            status,
        )
    found = out.reshape(points.shape)
    return BezierProjection(found, lambda_residual(points), lambda_residual(found), status.reshape(points.shape[:-2]))
