"""Splines of least scale-invariant bending energy L∫κ² ds (Levien2009 (4.3); Moreton1995 §2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from batten.curves.spiral import Spiral
from batten.errors import NoSolutionError
from batten.splines.interpolating_spline import End, InterpolatingSpline, check_points, joint_problem, segment_curves
from batten.splines.joint_angles import JointSolution, solve_joints
from batten.splines.segment_family import EulerSpirals, SlidingElastica
from batten.typing import ArrayLike

_ROUNDS = 80


@dataclass(frozen=True, eq=False)
class ScaleInvariantSpline:
    """A spline for which L∫κ² ds is stationary.

    Attributes:
        spline: its segments are elastica.
        length: of the whole spline.
        energy: ∫κ² ds, 1/length.
        tension: c = ∫κ² ds/L, 1/length²: the same spline is stationary for ∫κ² + c ds.
    """

    spline: InterpolatingSpline
    length: float
    energy: float
    tension: float

    @property
    def scale_invariant_energy(self) -> float:
        """L∫κ² ds, a pure number; 4π² for a circle."""
        return self.length * self.energy


def scale_invariant_spline(
    points: ArrayLike, *, closed: bool = False, start: End = "natural", end: End = "natural"
) -> ScaleInvariantSpline:
    """The SI-MEC through points: L∫κ² ds is stationary among curves through them in order.

    Definition: Levien2009 (4.3), Moreton1995 §2. Where L∫κ² ds is stationary so is ∫κ² + c ds with c = ∫κ² ds/L; so every
    segment is an elastica, and tangent and curvature are continuous. That is another curve than kurgla 1, whose segments
    are SI-MEC one by one ("kurgla1" of `interpolating_spline`). Free and given lengths: `elastic_spline`.

    Parameters:
        points: shape (n, 2), n ≥ 2 (3 if closed), neighbours not the same; any unit of length.
        closed: whether the spline returns to its first point, which is not repeated.
        start, end: as `interpolating_spline`.

    Returns:
        The spline that is reached from the Euler spiral spline; it is a minimum for points that turn little.

    Raises:
        InvalidInputError: as `interpolating_spline`.
        NoSolutionError: none was reached.

    Accuracy:
        c to 1e-12 of its value; jumps of curvature below 1e-12 over the mean chord.
    Degenerate cases:
        Points on a line in order: the line, with c = 0. Points on a circle: the circle.

    Example:
        >>> a = np.linspace(0.0, 2.0 * np.pi, 6)[:-1]
        >>> ring = scale_invariant_spline(np.stack([np.cos(a), np.sin(a)], axis=1), closed=True)
        >>> round(ring.scale_invariant_energy / np.pi**2, 10), round(ring.length / np.pi, 10)
        (4.0, 2.0)
    """
    own = check_points(points, closed)
    problem = joint_problem(own, closed, start, end)
    first = solve_joints(problem, EulerSpirals())

    def solve(tension: float, near: JointSolution) -> JointSolution | None:
        memory = () if near is first else near.ends.memory
        u = near.angles[:, 0].copy() if closed else np.append(near.angles[:, 0], near.angles[-1, 1])
        solution = solve_joints(problem, SlidingElastica(tension=tension), u, memory)
        return None if solution.status == "no solution" else solution

    def measured(solution: JointSolution, tension: float) -> ScaleInvariantSpline:
        curves = tuple(segment_curves(own, problem, SlidingElastica(tension=tension), solution))
        spline = InterpolatingSpline(
            own, closed, "mec", "mec", curves, solution.angles, solution.status, solution.residual, -1, ""
        )
        return ScaleInvariantSpline(spline, float(sum(c.length for c in curves)), spline.bending_energy(), tension)

    curves = segment_curves(own, problem, EulerSpirals(), first)
    guess = float(sum(c.bending_energy() for c in curves if isinstance(c, Spiral)) / sum(c.length for c in curves))
    near, tension = first, guess
    known: list[tuple[float, float]] = []
    for _ in range(_ROUNDS):
        found = solve(tension, near)
        if found is None:  # less tension than any spline bears, or too far from the last one
            tension = 0.5 * (tension + known[-1][0]) if known else 1.5 * tension
            continue
        near, rod = found, measured(found, tension)
        value = rod.energy / rod.length - tension
        known.append((tension, value))
        if abs(value) <= 1e-12 * (abs(tension) + guess):
            return rod
        step = value
        if len(known) > 1 and known[-1][1] != known[-2][1]:
            (a, f), (b, g) = known[-2:]
            step = -g * (b - a) / (g - f)
        most = 0.5 * (guess + abs(tension))
        tension += float(np.clip(step, -most, most))
    raise NoSolutionError(
        "no spline of stationary L∫κ² ds was reached from the Euler spiral spline of these points; put points between where "
        "they turn much, or take method 'kurgla1' of interpolating_spline"
    )
