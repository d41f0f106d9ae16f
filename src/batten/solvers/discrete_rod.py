"""A rod between two clamps as a polyline of equal edges: Method 1 of Fisker2018 §2.2.1, and its fall to a stable shape."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from batten.curves.arc_length import ArcLength
from batten.curves.polyline import Polyline
from batten.errors import ConvergenceError, InvalidInputError, NoSolutionError
from batten.solvers.clamped_ends import ClampedEnds, clamped_ends, feasible_bezier
from batten.solvers.discrete_chain import (
    DiscreteChain,
    closed,
    descents,
    fall,
    has_converged,
    multipliers,
    newton,
    penalised_descent,
)
from batten.typing import ArrayLike, FloatArray

_RELAX_STEPS = 3000


@dataclass(frozen=True, eq=False)
class DiscreteRodResult:
    """What `DiscreteRod.solve` found.

    Attributes:
        curve: the polyline through the ends of the edges, from the start.
        angles: of the edges, radians, shape (edges,), continuous.
        energy: discrete ∫κ² ds, batten's convention: (1/l) Σ θᵢ² over the turns θᵢ at the corners (for ends="points"
            also 2/l times the square of each turn between a clamp and its edge). The paper's E is l/2 of it.
        force: (λ₁, λ₂) as `Elastica.force`: the paper's multipliers divided by l.
        end_angle: the tangent angle that was reached; off the one asked for by 2π × a whole number if the start wound
            otherwise.
        end_error: distance of the last point from the end asked for. length_error: 0 but for rounding.
        iterations: Newton steps and steps of the gradient method together.
        converged: stationary to 1e-9 and closed to 1e-12 × length.
        stable: whether the second variation under the constraints is positive.
        fallback: whether the gradient method was needed.
        status: in words.
    """

    curve: Polyline
    angles: FloatArray
    energy: float
    force: FloatArray
    end_angle: float
    end_error: float
    length_error: float
    iterations: int
    converged: bool
    stable: bool
    fallback: bool
    status: str


@dataclass(frozen=True, eq=False)
class Relaxation:
    """Where a rod came to rest.

    Attributes:
        curve, angles, energy, end_error: as in `DiscreteRodResult`.
        energies: the energy after each step, shape (steps + 1,); it never rises. The first is that of the angles given,
            once their end is brought to the clamp.
        largest_turn: how far an edge lies from where it began, radians, the greatest over all edges.
    """

    curve: Polyline
    angles: FloatArray
    energy: float
    energies: FloatArray
    end_error: float
    largest_turn: float


@dataclass(frozen=True, eq=False)
class DiscreteRod:
    """The rod of given length between two clamps as a polyline of equal edges (Fisker2018 §2.2.1).

    Unknown are the angles ψᵢ of the edges; ½Σ(ψᵢ₊₁ − ψᵢ)² is to be stationary under the condition that the last point
    is the end. Newton's method (2.4) on the angles and two multipliers; each step is a tridiagonal system for three right
    sides and a 2 × 2 one, O(edges). When the norm of ∇L grows to ten times its least so far, a gradient method takes over:
    descent of E + ρ/2 |c|² for a rising penalty ρ, with the gradient taken in the metric of the bending energy (a
    tridiagonal system), since the steps of the plain gradient shrink like edges⁻². Newton's method then ends the work;
    the paper stops after the gradient method (`polish=False`).

    Parameters:
        start, end: end points, shape (2,), any unit.
        start_angle, end_angle: tangent angles, radians, real numbers: turns count.
        length: of the rod.
        edges: how many, at least 6; the paper's n + 1.
        ends: "edges" is the paper's: the first and the last edge have the end angles. So the rod is straight on half an
            edge at both ends, and the error falls like 1/edges only. "points" clamps the end points: the turn to the
            first edge counts over half an edge, and the error falls like 1/edges².

    Raises:
        InvalidInputError: a wrong shape, a value that is not finite, a length that is not positive, too few edges.
        NoSolutionError: the ends are farther apart than the rod is long, or the fixed edges alone make them so.

    Accuracy: see `ends`. The discrete equations are solved to 1e-9 × force (stationarity) and 1e-12 × length (end).
    Degenerate cases: ends as far apart as the rod is long: the straight line.

    Example:
        >>> rod = DiscreteRod((0, 0), 0.5, (0.9, 0), -0.5, 1.0, edges=100, ends="points")
        >>> result = rod.solve()
        >>> result.converged, result.stable, bool(result.end_error < 1e-12)
        (True, True, True)
        >>> relaxed = rod.relax(result.angles)
        >>> bool(abs(relaxed.energy / result.energy - 1) < 1e-9)
        True
    """

    start: FloatArray
    start_angle: float
    end: FloatArray
    end_angle: float
    length: float
    edges: int = 250
    ends: Literal["edges", "points"] = "edges"
    _ends: ClampedEnds = field(init=False, repr=False)

    def __post_init__(self) -> None:
        ends = clamped_ends(self.start, self.start_angle, self.end, self.end_angle, self.length)
        if not (isinstance(self.edges, int | np.integer) and self.edges >= 6):
            raise InvalidInputError(f"edges is a whole number ≥ 6; got {self.edges!r}")
        if self.ends not in ("edges", "points"):
            raise InvalidInputError(f'ends is "edges" or "points"; got {self.ends!r}')
        for name, value in zip(ClampedEnds._fields, ends):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "_ends", ends)
        chain = self._chain(ends.end_angle)
        reach = float(np.hypot(*chain.goal))
        if not ends.straight and reach > chain.unknowns * chain.edge:
            raise NoSolutionError(
                f"with {self.edges} edges, two of them fixed, the rod of length {ends.length} misses its end by "
                f"{(reach - chain.unknowns * chain.edge) * ends.length:.3g}; give more edges or more length"
            )

    # --- the paper's method ---

    def solve(self, initial: ArrayLike | None = None, *, polish: bool = True) -> DiscreteRodResult:
        """A stationary shape near a start.

        Parameters:
            initial: edge angles to start from, radians, shape (edges,), continuous; their winding is that of the result.
                None takes them from the Bézier of `feasible_bezier`, at equal arc length, with the winding it has.
            polish: after the gradient method go back to Newton's. False stops there, as the paper does: then the end is
                missed by about λ/ρ.

        Returns:
            `DiscreteRodResult`, `converged` or not. A stationary shape need not be stable: `stable` says so.

        Raises:
            InvalidInputError: `initial` of a wrong shape or not finite.
        """
        if self._ends.straight:
            return self._result(np.full(self.edges, self.start_angle), np.zeros(2), 0, False, self.start_angle)
        angles = self._bezier_angles() if initial is None else self._checked_angles(initial)
        end_angle = self._reached_end_angle(angles)
        chain = self._chain(end_angle)
        u = self._inner(angles)
        u, force, steps, good = newton(chain, u)
        fallback = not good
        if fallback:
            u, more = penalised_descent(chain, self._inner(angles))
            steps += more
            force = multipliers(chain, u)
            if polish:
                polished, new_force, more, good = newton(chain, u)
                steps += more
                if good:
                    u, force = polished, new_force
        return self._result(self._whole(u, end_angle), force, steps, fallback, end_angle)

    def _result(
        self, angles: FloatArray, force: FloatArray, steps: int, fallback: bool, end_angle: float
    ) -> DiscreteRodResult:
        chain = self._chain(end_angle)
        u = self._inner(angles)
        curve = self._polyline(angles)
        converged = self._ends.straight or has_converged(chain, u, force)
        status = "converged" if converged else "stopped short of a stationary shape"
        return DiscreteRodResult(
            curve=curve,
            angles=angles,
            energy=2.0 * chain.energy(u) / chain.edge / self.length,
            force=force / chain.edge / self.length**2,
            end_angle=end_angle,
            end_error=float(np.hypot(*(curve.points[-1] - self.end))),
            length_error=curve.length - self.length,
            iterations=steps,
            converged=converged,
            stable=self._ends.straight or (converged and descents(chain.hessian(u, force), chain.slopes(u)) == 0),
            fallback=fallback,
            status=status + " after the gradient method" * fallback,
        )

    # --- the fall to a stable shape ---

    def relax(self, angles: ArrayLike, *, largest_step: float = 0.1, max_steps: int = _RELAX_STEPS) -> Relaxation:
        """The stable shape to which a rod, held in the clamps, falls from given edge angles by a descent of its energy.

        The motion is overdamped, θₜ = θₛₛ + constraint forces, by implicit steps: (T + 1/τ) d = −∇E − Aᵀλ with A d = 0,
        back onto the constraints in the same metric, and half the time step τ where the energy would rise or an edge
        would turn by more than `largest_step`; after a good step τ grows by a half. Near its end Newton's method takes
        over, if it leads to a minimum within `largest_step` and not above. At a stationary shape that is no minimum the
        rod is pushed along the direction in which the energy falls fastest.

        Parameters:
            angles: of the edges, radians, shape (edges,), continuous. With ends="edges" the first and the last are set to
                the clamps' angles; the end angle is taken with the multiple of 2π nearest to the last one.
            largest_step: greatest turn of an edge in one step, radians: smaller follows the motion more closely.
            max_steps: limit of steps.

        Returns:
            `Relaxation`. The end of the motion is exact to 1e-9; the way there follows the motion only roughly.

        Raises:
            InvalidInputError: angles of a wrong shape or not finite, a `largest_step` that is not positive.
            ConvergenceError: no rest after `max_steps`, or the angles are so far from holding the constraints that they
                cannot be brought to them; `best` holds the last angles.
        """
        whole = self._checked_angles(angles)
        if not 0.0 < largest_step < np.inf:
            raise InvalidInputError(f"largest_step must be a positive angle; got {largest_step}")
        if self._ends.straight:
            whole = np.full(self.edges, self.start_angle)
            return Relaxation(self._polyline(whole), whole, 0.0, np.zeros(1), 0.0, 0.0)
        end_angle = self._reached_end_angle(whole)
        chain = self._chain(end_angle)
        begin = self._inner(whole)
        u = closed(chain, begin, chain.stiffness())
        if u is None:
            raise ConvergenceError(
                "these angles cannot be brought to the end of the rod; give ones nearer to it", best=whole
            )
        u, energies, rest = fall(chain, u, largest_step, max_steps)
        end = self._whole(u, end_angle)
        if not rest:
            raise ConvergenceError(
                f"the rod has not come to rest after {len(energies) - 1} steps; allow more of them",
                best=end,
                iterations=len(energies) - 1,
            )
        curve = self._polyline(end)
        scale = 2.0 / chain.edge / self.length
        return Relaxation(
            curve=curve,
            angles=end,
            energy=scale * energies[-1],
            energies=scale * np.array(energies),
            end_error=float(np.hypot(*(curve.points[-1] - self.end))),
            largest_turn=float(np.abs(u - begin).max()),
        )

    # --- angles ---

    def _chain(self, end_angle: float) -> DiscreteChain:
        edge = 1.0 / self.edges
        goal = (self._ends.end - self._ends.start) / self.length
        if self.ends == "points":
            return DiscreteChain(self.start_angle, end_angle, 2.0, edge, goal, self.edges)
        fixed = np.array([self.start_angle, end_angle])
        goal = goal - edge * np.array([np.cos(fixed).sum(), np.sin(fixed).sum()])
        return DiscreteChain(self.start_angle, end_angle, 1.0, edge, goal, self.edges - 2)

    def _inner(self, angles: FloatArray) -> FloatArray:
        return angles[1:-1] if self.ends == "edges" else angles

    def _whole(self, u: FloatArray, end_angle: float) -> FloatArray:
        return np.concatenate([[self.start_angle], u, [end_angle]]) if self.ends == "edges" else u

    def _polyline(self, angles: FloatArray) -> Polyline:
        steps = np.stack([np.cos(angles), np.sin(angles)], axis=1) * (self.length / self.edges)
        return Polyline(np.concatenate([self._ends.start[None], self._ends.start + np.cumsum(steps, axis=0)]))

    def _bezier_angles(self) -> FloatArray:
        """Edge angles at equal arc length of the Bézier start, continuous from the start angle."""
        curve = feasible_bezier(self._ends)
        measured = ArcLength.of(curve)
        d = curve.derivative(measured.parameter_at((np.arange(self.edges) + 0.5) / self.edges))
        angles = np.unwrap(np.arctan2(d[:, 1], d[:, 0]))
        return angles + 2.0 * np.pi * np.round((self.start_angle - angles[0]) / (2.0 * np.pi))

    def _checked_angles(self, angles: ArrayLike) -> FloatArray:
        """Given edge angles, shifted as a whole by the multiple of 2π that brings them to the start angle."""
        given = np.array(angles, dtype=np.float64)
        if given.shape != (self.edges,) or not np.isfinite(given).all():
            raise InvalidInputError(
                f"the angles of {self.edges} edges have shape ({self.edges},) and are finite; got shape {given.shape}"
            )
        return given + 2.0 * np.pi * np.round((self.start_angle - given[0]) / (2.0 * np.pi))

    def _reached_end_angle(self, angles: FloatArray) -> float:
        return self.end_angle + float(2.0 * np.pi * np.round((angles[-1] - self.end_angle) / (2.0 * np.pi)))
