"""Elastic splines as cubic splines of least bending energy: the way of Fisker2018 §5.1, the reference for the exact one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from batten.curves.bspline import BSplineCurve
from batten.curves.piecewise import PiecewiseCurve
from batten.errors import InvalidInputError, NoSolutionError
from batten.measures.bending_energy import bending_energy
from batten.measures.lambda_residual import lambda_residual
from batten.solvers.cubic_spline_rod import (
    CubicSplineRod,
    SplineSpace,
    basis_at,
    knots_of,
    minimise,
    with_middle_knots,
)
from batten.splines.spline_start import checked_points, hermite_cubics, interpolating_cubic
from batten.typing import ArrayLike, FloatArray

MOST_UPDATES = 5
"""Knot updates after which `numerical_elastic_spline` stops in any case: 32 cubics between two points."""

_NODES = 12  # Gauss nodes on each cubic
_LEAST_ARM = 1e-4  # of the length


@dataclass(frozen=True, eq=False)
class NumericalElasticSpline:
    """A cubic spline that is nearly an elastic spline.

    Attributes:
        curve: a `BSplineCurve` (C²), or a `PiecewiseCurve` of one for each piece (C¹).
        design: the spline that it began with.
        energy: ∫κ² ds, 1/length, by adaptive quadrature. energies: of the design, then after update 0, 1, 2 ….
        lambda_residuals: (n − 1,), how far each piece is from an elastica (Fisker2018 (2.3)).
        length_error: of the total length, relative; for a C¹ spline the worst of the pieces', relative to the piece.
        position_error: greatest distance from a point that should be met.
        iterations: steps of the SQP. updates: knot updates; 2^updates cubics between two points.
        converged: every SQP ended in a stationary point, and the λ-residuals are within the tolerance, if it was to be met.
        status: in words.
    """

    curve: BSplineCurve | PiecewiseCurve
    design: BSplineCurve | PiecewiseCurve
    energy: float
    energies: tuple[float, ...]
    lambda_residuals: FloatArray
    length_error: float
    position_error: float
    iterations: int
    updates: int
    converged: bool
    status: str


def numerical_elastic_spline(
    points: ArrayLike,
    start_angle: float | None = None,
    end_angle: float | None = None,
    length: float | None = None,
    *,
    tangents: ArrayLike | None = None,
    lengths: ArrayLike | None = None,
    updates: int | None = None,
    tolerance: float = 0.02,
) -> NumericalElasticSpline:
    """Minimise the bending energy of an interpolating cubic spline, insert knots, minimise again (Fisker2018 §5.1).

    C² (§5.1.2): the control points of a cubic spline on uniform knots, with γ(i/(n − 1)) = Pᵢ (5.1), two end tangents and
    one total length. The linear conditions are taken out by an orthonormal basis of their null space; what is left, two
    arms and the other control points, is minimised by the SQP of `CubicSplineRod`. C¹ (§5.1.1), with `tangents`: each piece
    is a `CubicSplineRod` of its own.

    Parameters:
        points: (n, 2). start_angle, end_angle: radians. length: total; None takes the first spline's, as the paper does.
        tangents: (n,), radians, for a C¹ spline. lengths: (n − 1,) of its pieces; None takes those of the first Béziers.
        updates: how many knot updates, 0 to 5; None goes on until all λ-residuals are below the tolerance.
        tolerance: of the λ-residuals.

    Returns:
        A `NumericalElasticSpline`, `converged` or not.

    Raises:
        InvalidInputError: wrong shapes or values. NoSolutionError: a length below the chords'.

    Accuracy:
        A local minimum among the splines of these knots. Its energy lies above that of the elastic spline in whose basin
        it is, by an error that falls like h⁴ with the width of the cubics or faster, until the parameter, that must be
        i/(n − 1) in the points, no longer matters.
    Degenerate cases: from a symmetric start the work may end in a symmetric saddle of the energy. The first spline has
        only its two arms to take a given length with, and would make loops of them; with a length other than its own the
        work begins after the first knot update.

    Example:
        >>> spline = numerical_elastic_spline([(0, 0), (1, 0.5), (2, 0)], 0.8, -0.6, updates=3)
        >>> spline.converged, len(spline.energies), bool(spline.lambda_residuals.max() < 0.01)
        (True, 5, True)
    """
    p = checked_points(points)
    if updates is not None and not (isinstance(updates, int | np.integer) and 0 <= updates <= MOST_UPDATES):
        raise InvalidInputError(f"updates is None or a whole number from 0 to {MOST_UPDATES}; got {updates!r}")
    if not 0.0 < tolerance < 1.0:
        raise InvalidInputError(f"the tolerance of the λ-residuals lies between 0 and 1; got {tolerance}")
    if tangents is not None:
        angles = np.asarray(tangents, dtype=np.float64)
        if angles.shape != (len(p),) or not np.isfinite(angles).all():
            raise InvalidInputError(f"tangents have shape ({len(p)},) for these points; got shape {angles.shape}")
        return _pieces(p, angles, lengths, updates, tolerance)
    if start_angle is None or end_angle is None or lengths is not None:
        raise InvalidInputError(
            "a C² spline needs both end angles and takes one total length; a C¹ spline needs tangents"
        )
    design = interpolating_cubic(p, start_angle, end_angle, uniform=True)
    total = design.length if length is None else float(length)
    chords = float(np.hypot(*np.diff(p, axis=0).T).sum())
    if not (np.isfinite(total) and total > chords):
        raise NoSolutionError(f"the length {total:.9g} must exceed the straight way through the points, {chords:.9g}")
    return _whole(p, (float(start_angle), float(end_angle)), total, design, updates, tolerance)


def _whole(
    p: FloatArray,
    angles: tuple[float, float],
    length: float,
    design: BSplineCurve,
    updates: int | None,
    tolerance: float,
) -> NumericalElasticSpline:
    """The C² spline."""
    energies, words, iterations = [_measured(design)], list[str](), 0
    control = (design.control_points - p[0]) / length
    curve, residuals = design, _residuals(design, len(p) - 1)
    update = 0
    for update in range((MOST_UPDATES if updates is None else updates) + 1):
        if update:
            control = with_middle_knots(control)
        if update == 0 and abs(design.length - length) > 1e-9 * length and updates != 0:
            continue
        space = _space((p - p[0]) / length, angles, len(control) - 3)
        unknowns = np.linalg.lstsq(
            space.shape.reshape(-1, space.shape.shape[2]), (control - space.base).T.reshape(-1), rcond=None
        )[0]
        found, steps, word = minimise(space, _lengthened(space, unknowns), _LEAST_ARM)
        control, iterations = space.control_points(found), iterations + steps
        words.append(word)
        curve = BSplineCurve(space.knots, p[0] + length * control, 3)
        energies.append(_measured(curve))
        residuals = _residuals(curve, len(p) - 1)
        if updates is None and word == "converged" and residuals.max() <= tolerance:
            break
    at = curve.point(np.linspace(0.0, 1.0, len(p)))
    # A first spline that could not take the length does not count, once a later one has.
    failed = [] if words[-1] == "converged" else [words[-1]]
    if updates is None and residuals.max() > tolerance:
        failed.append(f"a λ-residual of {residuals.max():.3g} is left")
    return NumericalElasticSpline(
        curve, design, energies[-1], tuple(energies), residuals, abs(curve.length - length) / length,
        float(np.hypot(*(at - p).T).max()), iterations, update, not failed, "; ".join(failed) or "converged",
    )  # fmt: skip


def _lengthened(space: SplineSpace, unknowns: FloatArray) -> FloatArray:
    """Unknowns of a curve of length 1, by least steps that change the length by at most a fiftieth; as near as they come."""
    z = unknowns.copy()
    for _ in range(100):
        length = space.expansions(z)[1]
        excess = length.value - 1.0
        size = float(length.gradient @ length.gradient)
        if abs(excess) < 1e-10 or not size > 1e-12:
            break
        new = z - np.clip(excess, -0.02, 0.02) / size * length.gradient
        new[:2] = np.maximum(new[:2], _LEAST_ARM)
        if not abs(space.values(new)[1] - 1.0) < abs(excess):
            break
        z = new
    return z


def _space(p: FloatArray, angles: tuple[float, float], pieces: int) -> SplineSpace:
    """All cubic splines of so many cubics through p (a rod of length 1 from 0), by two arms and a basis of the rest."""
    first, second, weights = basis_at(pieces, _NODES)
    knots, n = knots_of(pieces), pieces + 3
    at = BSpline(knots, np.eye(n), 3)(np.linspace(0.0, 1.0, len(p))[1:-1])  # (inner points, n)
    inverse = np.linalg.pinv(at[:, 2:-2]) if len(p) > 2 else np.zeros((n - 4, 0))
    rest = np.linalg.qr(at[:, 2:-2].T, mode="complete")[0][:, len(p) - 2 :] if n > 4 else np.zeros((0, 0))
    base, shape = np.zeros((n, 2)), np.zeros((2, n, 2 + 2 * rest.shape[1]))
    base[-2:] = p[-1]
    base[2:-2] = inverse @ (p[1:-1] - at @ base)
    for axis, part in enumerate((np.cos, np.sin)):
        shape[axis, 1, 0], shape[axis, -2, 1] = part(angles[0]) / pieces, -part(angles[1]) / pieces
        shape[axis, 2:-2, :2] = -inverse @ (at @ shape[axis, :, :2])
        begin = 2 + axis * rest.shape[1]
        shape[axis, 2:-2, begin : begin + rest.shape[1]] = rest
    rows = [(d, axis) for d in (first, second) for axis in (0, 1)]
    offsets = np.stack([d @ base[:, axis] for d, axis in rows])
    return SplineSpace(knots, base, shape, weights, offsets, np.stack([d @ shape[axis] for d, axis in rows]))


def _pieces(
    p: FloatArray, angles: FloatArray, lengths: ArrayLike | None, updates: int | None, tolerance: float
) -> NumericalElasticSpline:
    """The C¹ spline."""
    design = hermite_cubics(p, angles)
    m = len(p) - 1
    wanted = np.array([b.length for b in design.pieces]) if lengths is None else np.asarray(lengths, dtype=np.float64)
    if wanted.shape != (m,):
        raise InvalidInputError(f"lengths have shape ({m},) for these points; got shape {wanted.shape}")
    rods = [CubicSplineRod(p[i], angles[i], p[i + 1], angles[i + 1], float(wanted[i])) for i in range(m)]
    most = MOST_UPDATES if updates is None else updates
    energies = [_measured(design)]
    for update in range(0 if updates is None else updates, most + 1):
        results = [rod.solve(updates=update) for rod in rods]
        curve = PiecewiseCurve([r.curve for r in results])
        energies = [energies[0], *np.sum([r.energies[1:] for r in results], axis=0).tolist()]
        residuals = np.array([lambda_residual(r.curve) for r in results])
        if residuals.max() <= tolerance:
            break
    failed = [f"piece {i}: {r.status}" for i, r in enumerate(results) if not r.converged]
    if updates is None and residuals.max() > tolerance:
        failed.append(f"a λ-residual of {residuals.max():.3g} is left")
    return NumericalElasticSpline(
        curve, design, energies[-1], tuple(energies), residuals,
        max(abs(r.length_error) / w for r, w in zip(results, wanted)), max(r.end_error for r in results),
        sum(r.iterations for r in results), update, not failed, "; ".join(failed) or "converged",
    )  # fmt: skip


def _residuals(curve: BSplineCurve, pieces: int) -> FloatArray:
    """λ-residual of each piece between two points."""
    cubics = curve.to_beziers()
    size = len(cubics) // pieces
    return np.array([lambda_residual(PiecewiseCurve(cubics[i * size : (i + 1) * size])) for i in range(pieces)])


def _measured(curve: BSplineCurve | PiecewiseCurve) -> float:
    return float(bending_energy(curve, tolerance=1e-10))
