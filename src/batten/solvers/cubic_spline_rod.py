"""A rod between two clamps as a cubic spline of least bending energy: Method 2 of Fisker2018 §2.2.2."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from batten.curves.bezier import CubicBezier
from batten.curves.bspline import BSplineCurve
from batten.errors import InvalidInputError
from batten.measures.bending_energy import bending_energy
from batten.measures.distance import hausdorff_distance, l2_distance
from batten.solvers.clamped_ends import ClampedEnds, clamped_ends, feasible_bezier
from batten.typing import FloatArray

MOST_UPDATES = 7
"""Knot updates after which `CubicSplineRod.solve` stops in any case: 128 pieces."""

_FEASIBLE = 1e-9  # error of the length at which the SQP may stop, of the length; it is taken away afterwards
_STANDSTILL = 1e-12  # change of the energy that the last step would have brought, of the energy
_ITERATIONS = 200  # of the SQP on one knot vector
_FARTHEST = 0.5  # of the length: no unknown changes by more in one step
_FLATTEST = 1e-13  # curvatures of the model below this part of the greatest are raised to it
_NODES_A_PIECE = 8  # at least
_MORE_NODES = (1, 4, 16)  # times as many Gauss nodes are tried
_SEEN = 1e-3  # greatest relative error of the Gauss rule's energy, else it has overlooked something


@dataclass(frozen=True, eq=False)
class CubicSplineRodResult:
    """What `CubicSplineRod.solve` found.

    Attributes:
        curve: the cubic spline, on the uniform knots of the last update.
        start: the cubic Bézier that it began with.
        energy: ∫κ² ds of the curve, batten's convention (the paper has ½ of it), by adaptive quadrature to 1e-9.
        energies: the same for the Bézier, then after update 0, 1, 2 …: a row of Fisker2018 Table B.1, without its ½.
        distances: normalised distance of each solution from the one before (the Bézier for the first), (updates + 1,).
        end_angle: tangent angle at the end, continuous along the curve from the start angle; 2π × a whole number off
            the one asked for if the Bézier turned otherwise.
        end_error: distance of the curve's end from the one asked for. length_error: of its length, measured anew.
        iterations: steps of the SQP, over all updates.
        updates: knot updates made; the curve has 2^updates pieces.
        converged: every SQP ended in a stationary point, the quadrature saw the curve as it is (length to 1e-6), and,
            if the number of updates was left open, the last distance is within the tolerance.
        status: in words.
    """

    curve: BSplineCurve
    start: CubicBezier
    energy: float
    energies: tuple[float, ...]
    distances: tuple[float, ...]
    end_angle: float
    end_error: float
    length_error: float
    iterations: int
    updates: int
    converged: bool
    status: str


@dataclass(frozen=True, eq=False)
class CubicSplineRod:
    """The rod of given length between two clamps as a cubic spline of least bending energy (Fisker2018 §2.2.2).

    With control points cᵢ and cubic B-splines on the uniform knots of n − 3 pieces, c₁ and cₙ are the end points, c₂ and
    cₙ₋₁ lie along the end tangents. Minimised is ½∫ det(γ′, γ″)² |γ′|⁻⁵ dt (2.5) over the inner control points and the
    arms v₁, v₂ ≥ ε, subject to ∫|γ′| dt = L, both by Gauss quadrature. The arms here are a third of the speeds at the
    ends, v = (n − 3)|c₂ − c₁|: so they keep their meaning, and their bound, when knots are inserted.

    The solver is an SQP of its own: exact gradient and exact Hessian of the Lagrangian, its curvatures along the constraint
    replaced by their absolute values, an active set for the two bounds, and a line search whose points are all brought
    back to the right length. With a merit function f + μ|c| instead it crept: moving control points along the curve
    changes the energy by 1e-8 of it and less, and a straight step then breaks the length by more than it gains. scipy's
    SLSQP with the same gradients, on the ends of 200 random elastica with 3 updates each: 219 iterations instead of 23
    on average, and 30 of 200 stopped without success; this one left 1 of 200 at its iteration limit.

    Parameters:
        start, end: end points, shape (2,), any unit.
        start_angle, end_angle: tangent angles, radians; the winding is the one that the Bézier start gets.
        length: of the rod.
        gauss_nodes: nodes on [0, 1]; they are shared out among the pieces, at least eight to each.
        least_arm: ε as a part of the length.

    Raises:
        InvalidInputError: a wrong shape, a value that is not finite, a length that is not positive, fewer than 8 nodes.
        NoSolutionError: the ends are farther apart than the rod is long.

    Accuracy: a local minimum among the splines of these knots, its energy to 1e-10 relative. Against the elastica in whose
        basin it lies the energy is too high by an error that falls like h⁶ with the width h of the pieces, and the L²
        distance falls like h⁵ (measured).
    Degenerate cases: ends as far apart as the rod is long give the straight line.

    Example:
        >>> rod = CubicSplineRod((0, 0), np.pi / 2, (2 / np.pi, 0), -np.pi / 2, 1.0)
        >>> result = rod.solve(updates=3)
        >>> result.converged, round(result.energy / np.pi**2, 4)  # half a circle has π² / length
        (True, 1.0)
    """

    start: FloatArray
    start_angle: float
    end: FloatArray
    end_angle: float
    length: float
    gauss_nodes: int = 100
    least_arm: float = 1e-3
    _ends: ClampedEnds = field(init=False, repr=False)

    def __post_init__(self) -> None:
        ends = clamped_ends(self.start, self.start_angle, self.end, self.end_angle, self.length)
        if not (isinstance(self.gauss_nodes, int | np.integer) and self.gauss_nodes >= _NODES_A_PIECE):
            raise InvalidInputError(f"gauss_nodes is a whole number ≥ {_NODES_A_PIECE}; got {self.gauss_nodes!r}")
        if not 0.0 < self.least_arm < 0.1:
            raise InvalidInputError(f"least_arm, a part of the length, lies between 0 and 0.1; got {self.least_arm}")
        for name, value in zip(ClampedEnds._fields, ends):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "_ends", ends)

    def solve(
        self,
        updates: int | None = None,
        *,
        tolerance: float = 1e-5,
        distance: Literal["L2", "hausdorff"] = "L2",
    ) -> CubicSplineRodResult:
        """Minimise, insert knots in the middle of all pieces, minimise again from there, and so on.

        Parameters:
            updates: how many knot updates, 0 to 7; None goes on until two solutions that follow each other are within
                `tolerance`.
            tolerance: greatest normalised distance (distance / length) then.
            distance: "L2" compares points of equal arc length, "hausdorff" sets of points (dearer).

        Returns:
            `CubicSplineRodResult`, `converged` or not.

        Raises:
            InvalidInputError: an option out of range.
        """
        if updates is not None and not (isinstance(updates, int | np.integer) and 0 <= updates <= MOST_UPDATES):
            raise InvalidInputError(f"updates is None or a whole number from 0 to {MOST_UPDATES}; got {updates!r}")
        if not 0.0 < tolerance < np.inf or distance not in ("L2", "hausdorff"):
            raise InvalidInputError(
                f'the tolerance must be positive and the distance "L2" or "hausdorff"; got {tolerance}, {distance!r}'
            )
        ends = self._ends
        bezier = feasible_bezier(ends)
        control = (bezier.control_points - ends.start) / ends.length
        curve = BSplineCurve(np.repeat([0.0, 1.0], 4), bezier.control_points)
        curves, energies, distances, words = [curve], [_measured(curve)], list[float](), list[str]()
        iterations, close = 0, False
        for update in range((MOST_UPDATES if updates is None else updates) + 1):
            if update:
                control = with_middle_knots(control)
            new, energy, control, steps, word = self._updated(control)
            iterations += steps
            words.append(word)
            distances.append(_distance(new, curve, distance))
            curves.append(new)
            energies.append(energy)
            curve, close = new, distances[-1] <= tolerance
            if updates is None and close:
                break
        return self._result(bezier, curve, energies, distances, words, iterations, close or updates is not None)

    def _updated(self, control: FloatArray) -> tuple[BSplineCurve, float, FloatArray, int, str]:
        """The SQP from control points in the unit plane: curve, its energy, control points, steps and a word.

        A Gauss rule overlooks a near-cusp between its nodes, and then the SQP sharpens it: where the energy measured
        anew is not the rule's, the knot vector is solved again from the same start with more nodes.
        """
        ends, iterations = self._ends, 0
        for more in _MORE_NODES:
            space = SplineSpace.of(ends, len(control) - 3, more * self.gauss_nodes)
            unknowns, steps, word = minimise(space, space.unknowns(control), self.least_arm)
            iterations += steps
            found = space.control_points(unknowns)
            curve = BSplineCurve(space.knots, ends.start + ends.length * found)
            energy = _measured(curve)
            seen = 2.0 * space.values(unknowns)[0]
            if abs(energy * ends.length - seen) <= _SEEN * seen + 1e-12:
                break
        else:
            word = "too few Gauss nodes for a near-cusp"
        return curve, energy, found, iterations, word

    def _result(
        self,
        bezier: CubicBezier,
        curve: BSplineCurve,
        energies: list[float],
        distances: list[float],
        words: list[str],
        iterations: int,
        enough: bool,
    ) -> CubicSplineRodResult:
        length_error = curve.length - self.length
        failed = [f"{word} after update {i}" for i, word in enumerate(words) if word != "converged"]
        if not enough:
            failed.append("the last update still changed the curve by more than the tolerance")
        return CubicSplineRodResult(
            curve=curve,
            start=bezier,
            energy=energies[-1],
            energies=tuple(energies),
            distances=tuple(distances),
            end_angle=_end_angle(curve, self._ends),
            end_error=float(np.hypot(*(curve.point(1.0) - self.end))),
            length_error=length_error,
            iterations=iterations,
            updates=len(words) - 1,
            converged=not failed,
            status="; ".join(failed) or "converged",
        )


def _measured(curve: BSplineCurve) -> float:
    """∫κ² ds by adaptive quadrature, which knows nothing of the solver's."""
    return float(bending_energy(curve, tolerance=1e-9))


def _distance(new: BSplineCurve, old: BSplineCurve, kind: Literal["L2", "hausdorff"]) -> float:
    if kind == "L2":
        return float(l2_distance(new, old))
    return float(hausdorff_distance(new, old, normalised=True))


def _end_angle(curve: BSplineCurve, ends: ClampedEnds) -> float:
    """The tangent angle at the end: followed along the curve, then set to the exact one that is nearest."""
    t = np.linspace(0.0, 1.0, 64 * (len(curve.control_points) - 3) + 1)
    d = curve.derivative(t)
    angles = np.unwrap(np.arctan2(d[:, 1], d[:, 0]))
    turn = angles[-1] - angles[0] - (ends.end_angle - ends.start_angle)
    return ends.end_angle + float(2.0 * np.pi * np.round(turn / (2.0 * np.pi)))


def with_middle_knots(control: FloatArray) -> FloatArray:
    """Control points of the same cubic spline on uniform knots with twice as many pieces."""
    pieces = len(control) - 3
    spline = BSpline(knots_of(pieces), control, 3)
    for i in range(pieces):
        spline = spline.insert_knot((i + 0.5) / pieces)
    return np.asarray(spline.c)


def knots_of(pieces: int) -> FloatArray:
    return np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, pieces + 1), np.ones(3)])


@lru_cache(maxsize=32)
def basis_at(pieces: int, nodes: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derivatives Bᵢ′, Bᵢ″ at the Gauss nodes of all pieces, shape (m, n) each, and the weights (m,).

    Pieces with more than 100 nodes are cut: rules of high order are dear to make, and no better at a near-cusp.
    """
    panels = pieces * -(-nodes // 100)
    x, w = np.polynomial.legendre.leggauss(-(-nodes * pieces // panels))
    t = ((np.arange(panels)[:, None] + 0.5 * (x + 1.0)) / panels).ravel()
    spline = BSpline(knots_of(pieces), np.eye(pieces + 3), 3)
    return spline(t, 1), spline(t, 2), np.tile(0.5 * w / panels, panels)


class Expansion(NamedTuple):
    """A function of the unknowns with gradient (d,) and Hessian (d, d)."""

    value: float
    gradient: FloatArray
    hessian: FloatArray


@dataclass(frozen=True, eq=False)
class SplineSpace:
    """All cubic splines on uniform knots that keep the clamps, in a plane where the start is 0 and the length 1.

    The unknowns are (v₁, v₂, x₃ … xₙ₋₂, y₃ … yₙ₋₂), shape (2n − 6,).
    """

    knots: FloatArray
    base: FloatArray  # (n, 2): control points for unknowns of zero
    shape: FloatArray  # (2, n, d): control points by the unknowns
    weights: FloatArray  # (m,)
    offsets: FloatArray  # (4, m): x′, y′, x″, y″ at the nodes for unknowns of zero
    slopes: FloatArray  # (4, m, d): their derivatives by the unknowns

    @classmethod
    def of(cls, ends: ClampedEnds, pieces: int, gauss_nodes: int) -> SplineSpace:
        """The space with so many pieces; `gauss_nodes` are shared out among them."""
        first, second, weights = basis_at(pieces, max(_NODES_A_PIECE, -(-gauss_nodes // pieces)))
        n, inner = pieces + 3, pieces - 1
        base = np.zeros((n, 2))
        base[-2:] = (ends.end - ends.start) / ends.length
        shape = np.zeros((2, n, 2 + 2 * inner))
        shape[:, 1, 0] = np.cos(ends.start_angle) / pieces, np.sin(ends.start_angle) / pieces
        shape[:, -2, 1] = -np.cos(ends.end_angle) / pieces, -np.sin(ends.end_angle) / pieces
        shape[0, 2:-2, 2 : 2 + inner] = shape[1, 2:-2, 2 + inner :] = np.eye(inner)
        rows = [(d, axis) for d in (first, second) for axis in (0, 1)]
        offsets = np.stack([d @ base[:, axis] for d, axis in rows])
        return cls(knots_of(pieces), base, shape, weights, offsets, np.stack([d @ shape[axis] for d, axis in rows]))

    def control_points(self, unknowns: FloatArray) -> FloatArray:
        """Control points (n, 2) of unknowns (d,)."""
        return self.base + (self.shape @ unknowns).T

    def unknowns(self, control: FloatArray) -> FloatArray:
        """The unknowns of control points (n, 2) that keep the clamps."""
        pieces = len(control) - 3
        arms = [pieces * np.hypot(*(control[1] - control[0])), pieces * np.hypot(*(control[-1] - control[-2]))]
        return np.concatenate([arms, control[2:-2, 0], control[2:-2, 1]])

    def values(self, unknowns: FloatArray) -> tuple[float, float]:
        """Energy (2.5) and length; infinite where the curve stands still at a node."""
        x1, y1, x2, y2 = self.offsets + self.slopes @ unknowns
        square = x1 * x1 + y1 * y1
        if not square.min() > 0.0:
            return np.inf, np.inf
        speed = np.sqrt(square)
        energy = 0.5 * float(self.weights @ ((x1 * y2 - y1 * x2) ** 2 / (square * square * speed)))
        return energy, float(self.weights @ speed)

    def expansions(self, unknowns: FloatArray) -> tuple[Expansion, Expansion]:
        """Energy (2.5) and length with their exact first and second derivatives."""
        x1, y1, x2, y2 = self.offsets + self.slopes @ unknowns
        square = x1 * x1 + y1 * y1
        speed = np.sqrt(square)
        det = x1 * y2 - y1 * x2
        # energy density ½ D² Q with Q = (x′² + y′²)^(−5/2), by (x′, y′, x″, y″)
        q0 = 1.0 / (square * square * speed)
        zero = np.zeros_like(x1)
        d1 = np.stack([y2, -x2, -y1, x1])
        half = np.stack([x1, y1, zero, zero])  # half the gradient of the square
        q1 = -5.0 * q0 / square * half
        first = det * q0 * d1 + 0.5 * det * det * q1
        second = q0 * d1[:, None] * d1 + det * (d1[:, None] * q1 + q1[:, None] * d1)
        second += 17.5 * det * det * q0 / square**2 * half[:, None] * half
        for i, j, sign in ((0, 3, 1.0), (1, 2, -1.0)):
            second[i, j] += sign * det * q0
            second[j, i] += sign * det * q0
        for i in (0, 1):
            second[i, i] -= 2.5 * det * det * q0 / square
        energy = self._expansion(0.5 * float(self.weights @ (det * det * q0)), first, second)
        normal = np.stack([-y1, x1]) / speed
        length = self._expansion(
            float(self.weights @ speed), np.stack([x1, y1]) / speed, normal[:, None] * normal / speed
        )
        return energy, length

    def _expansion(self, value: float, first: FloatArray, second: FloatArray) -> Expansion:
        """From derivatives by (x′, y′, x″, y″) at the nodes, or only the first two, to those by the unknowns."""
        slopes = self.slopes[: len(first)]
        rows = np.einsum("ijm,jmd->imd", second * self.weights, slopes, optimize=True)
        d = slopes.shape[2]
        return Expansion(
            value,
            np.tensordot(first * self.weights, slopes, axes=2),
            slopes.reshape(-1, d).T @ rows.reshape(-1, d),
        )


def minimise(space: SplineSpace, unknowns: FloatArray, least_arm: float) -> tuple[FloatArray, int, str]:
    """The SQP on one knot vector: unknowns, number of steps, "converged" or what went wrong."""
    z = unknowns.copy()
    z[:2] = np.maximum(z[:2], least_arm)
    feasible = _retracted(space, z, space.expansions(z)[1].gradient, least_arm)
    z = z if feasible is None else feasible
    for iteration in range(_ITERATIONS):
        energy, length = space.expansions(z)
        excess = length.value - 1.0
        along = float(energy.gradient @ length.gradient / (length.gradient @ length.gradient))
        stationary = energy.gradient - along * length.gradient
        free = np.ones(len(z), dtype=bool)
        free[:2] = (z[:2] > least_arm) | (stationary[:2] < 0.0)
        g, a = energy.gradient[free], length.gradient[free]
        multiplier = float(g @ a / (a @ a))
        hessian = energy.hessian - multiplier * length.hessian
        step = np.zeros_like(z)
        step[free] = _quadratic_step(hessian[np.ix_(free, free)], g, a, excess)
        step *= min(1.0, _FARTHEST / np.abs(step).max(initial=1e-300))
        descent = float((g - multiplier * a) @ step[free])  # without what the last digits of the length cost
        if abs(excess) <= _FEASIBLE and abs(descent) <= _STANDSTILL * energy.value + 1e-24:
            return z, iteration, "converged"
        new = _searched(space, z, step, least_arm, energy.value, descent, np.where(free, length.gradient, 0.0))
        if new is None:
            return z, iteration, "no descent"
        z = new
    return z, _ITERATIONS, "iteration limit"


def _retracted(space: SplineSpace, z: FloatArray, a: FloatArray, least_arm: float) -> FloatArray | None:
    """The unknowns of length 1 that are reached from z along the direction `a`, by a secant method; None if none is."""
    slope = float(a @ a)
    part, excess = 0.0, space.values(z)[1] - 1.0
    for _ in range(20):
        if abs(excess) <= 1e-14:
            break
        step = -excess / slope
        new = z + (part + step) * a
        new[:2] = np.maximum(new[:2], least_arm)
        after = space.values(new)[1] - 1.0
        if not abs(after) < abs(excess):
            break
        slope = (after - excess) / step if after != excess else slope
        part, excess = part + step, after
    new = z + part * a
    new[:2] = np.maximum(new[:2], least_arm)
    return new if abs(excess) <= _FEASIBLE else None


def _quadratic_step(hessian: FloatArray, g: FloatArray, a: FloatArray, excess: float) -> FloatArray:
    """The step to the minimum of the quadratic model on the linearised constraint a·p = −excess.

    Along the constraint the model's curvatures are replaced by their absolute values, so that the step descends.
    """
    size = float(np.sqrt(a @ a))
    across = -excess / size**2 * a
    if len(a) == 1:
        return across
    along = np.linalg.qr(a[:, None], mode="complete")[0][:, 1:]
    curvature, vectors = np.linalg.eigh(along.T @ hessian @ along)
    curvature = np.abs(curvature)
    curvature = np.maximum(curvature, _FLATTEST * max(float(curvature.max()), 1e-300))
    slope = vectors.T @ (along.T @ (g + hessian @ across))
    return across - along @ (vectors @ (slope / curvature))


def _searched(
    space: SplineSpace,
    z: FloatArray,
    step: FloatArray,
    least_arm: float,
    energy: float,
    descent: float,
    a: FloatArray,
) -> FloatArray | None:
    """A point of length 1 near the step where the energy falls enough, or None."""
    part = 1.0
    for _ in range(40):
        trial = z + part * step
        trial[:2] = np.maximum(trial[:2], least_arm)
        new = _retracted(space, trial, a, least_arm)
        enough = energy * (1.0 + 1e-15) + 1e-4 * part * min(descent, 0.0)
        if new is not None and space.values(new)[0] <= enough:
            return new
        part *= 0.5
    return None
