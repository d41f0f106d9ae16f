"""The discrete elastica between two clamps: its energy, its constraints, and the solvers for both, O(edges) a step.

Everything here is for a rod of length 1; `solvers.discrete_rod` scales, checks and names. Fisker2018 §2.2.1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_banded

from batten.typing import FloatArray

_NEWTON_STEPS = 60
_STATIONARY = 1e-9  # stationarity that counts as converged, against the size of the forces
_CLOSED = 1e-12  # error of the end that counts as converged, of the length
_GROWN = 10.0  # times its least: then Newton's method has failed
_PENALTIES = (1e2, 1e3, 1e4, 1e5, 1e6)  # on the squared errors of the end
_GRADIENT_STEPS = 400  # for each of them
_FIRST_TIME = 1e-4  # first time step of the fall, for a rod of length 1
_LAST_TIME = 1e4
_NEARLY_AT_REST = 1e-3  # stationarity at which Newton's method is tried in a fall, against the size of the forces


class DiscreteChain(NamedTuple):
    """The discrete problem for a rod of length 1: unknown angles u (m,) between the fixed angles `first` and `last`.

    E(u) = ½ [w (u₁ − first)² + Σ (uᵢ₊₁ − uᵢ)² + w (last − uₘ)²], subject to l Σ (cos uᵢ, sin uᵢ) = goal.
    """

    first: float
    last: float
    weight: float
    edge: float
    goal: FloatArray
    unknowns: int

    def energy(self, u: FloatArray) -> float:
        turns = np.diff(u)
        ends = (u[0] - self.first) ** 2 + (self.last - u[-1]) ** 2
        return 0.5 * float(turns @ turns + self.weight * ends)

    def gradient(self, u: FloatArray) -> FloatArray:
        turns = np.concatenate([[self.weight * (u[0] - self.first)], np.diff(u), [self.weight * (self.last - u[-1])]])
        return -np.diff(turns)

    def stiffness(self) -> FloatArray:
        """The diagonal of the Hessian of E; beside it stand −1."""
        diagonal = np.full(self.unknowns, 2.0)
        diagonal[0] = diagonal[-1] = 1.0 + self.weight
        return diagonal

    def gap(self, u: FloatArray) -> FloatArray:
        """Errors c₁, c₂ of the end, (2,)."""
        return self.edge * np.array([np.cos(u).sum(), np.sin(u).sum()]) - self.goal

    def slopes(self, u: FloatArray) -> FloatArray:
        """Their derivatives by the angles, (2, m)."""
        return self.edge * np.stack([-np.sin(u), np.cos(u)])

    def hessian(self, u: FloatArray, force: FloatArray) -> FloatArray:
        """The diagonal of the Hessian of E + λ·c."""
        return self.stiffness() - self.edge * (force[0] * np.cos(u) + force[1] * np.sin(u))

    def residual(self, u: FloatArray, force: FloatArray) -> tuple[FloatArray, FloatArray]:
        """∇(E + λ·c): by the angles, (m,), and by the multipliers, (2,)."""
        return self.gradient(u) + force @ self.slopes(u), self.gap(u)

    def size(self, along: FloatArray, gap: FloatArray) -> float:
        """The norm of ∇L, the part by the angles as the L² norm of κ′ + λ × t, for which 1 is a natural unit."""
        return float(np.sqrt(along @ along / self.edge**3 + 100.0 * gap @ gap))


def _tridiagonal(diagonal: FloatArray, right: FloatArray) -> FloatArray:
    bands = np.full((3, len(diagonal)), -1.0)
    bands[1] = diagonal
    return solve_banded((1, 1), bands, right, overwrite_ab=True, check_finite=False)


def bordered_solution(
    diagonal: FloatArray, slopes: FloatArray, along: FloatArray, gap: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """x (m,) and y (2,) with D x + Aᵀy = along and A x = gap; D has this diagonal and −1 beside it.

    By the Schur complement of D, and once more for what is left over: D alone may be nearly singular.
    """
    columns = _tridiagonal(diagonal, np.column_stack([along, slopes.T]))
    schur = slopes @ columns[:, 1:]
    y = np.linalg.lstsq(schur, slopes @ columns[:, 0] - gap, rcond=None)[0]
    x = columns[:, 0] - columns[:, 1:] @ y
    left = along - diagonal * x - y @ slopes
    left[1:] += x[:-1]
    left[:-1] += x[1:]
    again = _tridiagonal(diagonal, left)
    dy = np.linalg.lstsq(schur, slopes @ (again + x) - gap, rcond=None)[0]
    return x + again - columns[:, 1:] @ dy, y + dy


def descents(diagonal: FloatArray, slopes: FloatArray, shift: float = 0.0) -> int:
    """The number of independent directions that keep the constraints and along which the energy falls: 0 at a minimum.

    By the inertia of the bordered matrix: negative pivots of D + shift, and of −A D⁻¹ Aᵀ, less the two constraints.

    Parameters:
        diagonal: of the Hessian D of the Lagrangian, shape (m,); beside it stand −1. slopes: A, shape (2, m).
        shift: added to D.

    Returns:
        How many eigenvalues of D + shift, restricted to the directions with A d = 0, are negative.

    Example:
        >>> slopes = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])  # the first and the last are held
        >>> descents(np.array([2.0, 2.0, 2.0, 2.0]), slopes), descents(np.array([2.0, -2.0, 2.0, 2.0]), slopes)
        (0, 1)
    """
    moved = diagonal + shift
    negative, pivot = 0, 1.0
    for k, value in enumerate(moved.tolist()):
        pivot = value - 1.0 / pivot if k else value
        if pivot == 0.0:
            pivot = 1e-300
        negative += pivot < 0.0
    schur = slopes @ _tridiagonal(moved, slopes.T)
    return int(negative + (np.linalg.eigvalsh(schur) > 0.0).sum() - 2)


# --- Newton's method and the gradient method ---


def multipliers(chain: DiscreteChain, u: FloatArray) -> FloatArray:
    """λ (2,) with the least ∇(E + λ·c)."""
    return np.asarray(np.linalg.lstsq(chain.slopes(u).T, -chain.gradient(u), rcond=None)[0], dtype=np.float64)


def has_converged(chain: DiscreteChain, u: FloatArray, force: FloatArray) -> bool:
    along, gap = chain.residual(u, force)
    rounding = 32.0 * np.finfo(float).eps * np.abs(u).max() / chain.edge**2
    forces = 1.0 + float(np.hypot(*force)) / chain.edge
    worst = float(np.abs(along).max()) / chain.edge**2
    return bool(worst <= _STATIONARY * forces + rounding and np.hypot(*gap) <= _CLOSED)


def newton(chain: DiscreteChain, u: FloatArray) -> tuple[FloatArray, FloatArray, int, bool]:
    """Full Newton steps (2.4) until ∇L is 0, or has grown to ten times its least: angles, multipliers, steps, success."""
    force = multipliers(chain, u)
    least = np.inf
    for step in range(_NEWTON_STEPS):
        along, gap = chain.residual(u, force)
        size = chain.size(along, gap)
        if has_converged(chain, u, force):
            return u, force, step, True
        if not size <= _GROWN * least:
            return u, force, step, False
        least = min(least, size)
        du, dforce = bordered_solution(chain.hessian(u, force), chain.slopes(u), -along, -gap)
        u, force = u + du, force + dforce
    return u, force, _NEWTON_STEPS, has_converged(chain, u, force)


def penalised_descent(chain: DiscreteChain, u: FloatArray) -> tuple[FloatArray, int]:
    """Gradient descent of E/l + ρ/2 |c|² for rising ρ, the gradient in the metric T/l + ρ AᵀA: angles and steps."""
    steps = 0
    for penalty in _PENALTIES:
        weight = penalty * chain.edge
        gap = chain.gap(u)
        value = chain.energy(u) + 0.5 * weight * float(gap @ gap)
        for _ in range(_GRADIENT_STEPS):
            slopes = chain.slopes(u)
            gradient = chain.gradient(u) + weight * gap @ slopes
            columns = _tridiagonal(chain.stiffness(), np.column_stack([gradient, slopes.T]))
            inner = np.eye(2) / weight + slopes @ columns[:, 1:]
            direction = columns[:, 1:] @ np.linalg.solve(inner, slopes @ columns[:, 0]) - columns[:, 0]
            slope = float(gradient @ direction)
            steps += 1
            part = 1.0
            while part > 1e-8:
                trial = u + part * direction
                gap_there = chain.gap(trial)
                there = chain.energy(trial) + 0.5 * weight * float(gap_there @ gap_there)
                if there <= value + 0.25 * part * slope:
                    break
                part *= 0.5
            else:
                break
            u, gap, value = trial, gap_there, there
            if -slope <= 1e-10 * value:
                break
    return u, steps


# --- the fall to a stable shape ---


def closed(chain: DiscreteChain, u: FloatArray, metric: FloatArray) -> FloatArray | None:
    """The angles nearest to u (to first order, in a tridiagonal metric of this diagonal) that reach the end, or None."""
    gap = chain.gap(u)
    for _ in range(50):
        miss = float(np.hypot(*gap))
        if miss <= 1e-15:
            break
        slopes = chain.slopes(u)
        columns = _tridiagonal(metric, slopes.T)
        move = columns @ np.linalg.lstsq(slopes @ columns, -gap, rcond=None)[0]
        part = min(1.0, 1.0 / float(np.abs(move).max(initial=1e-300)))
        while part > 1e-3 and not np.hypot(*chain.gap(u + part * move)) < miss:
            part *= 0.5
        if part <= 1e-3:
            break
        u = u + part * move
        gap = chain.gap(u)
    return u if np.hypot(*gap) <= _CLOSED else None


def fall(
    chain: DiscreteChain, u: FloatArray, largest_step: float, max_steps: int
) -> tuple[FloatArray, list[float], bool]:
    """Descent of the energy from closed angles: the last angles, the energy after each step, whether they are at rest."""
    energies = [chain.energy(u)]
    time = _FIRST_TIME
    for step in range(max_steps):
        force = multipliers(chain, u)
        along, gap = chain.residual(u, force)
        forces = 1.0 + float(np.hypot(*force)) / chain.edge
        if step % 4 == 0 and chain.size(along, gap) <= _NEARLY_AT_REST * forces:
            rest = _minimum_near(chain, u, largest_step)
            if rest is not None:
                energies.append(min(chain.energy(rest), energies[-1]))
                return rest, energies, True
            if chain.size(along, gap) <= 1e-3 * _NEARLY_AT_REST * forces and descents(
                chain.hessian(u, force), chain.slopes(u)
            ):
                u = _pushed(chain, u, force, largest_step)
                energies.append(chain.energy(u))
                time = _FIRST_TIME
                continue
        new = None
        while new is None:
            new, good = _moved(chain, u, time, largest_step)
            time = min(1.5 * time, _LAST_TIME) if good else 0.3 * time
            if time < 1e-12:
                return u, energies, False
        u = new
        energies.append(chain.energy(u))
    return u, energies, False


def _moved(chain: DiscreteChain, u: FloatArray, time: float, largest_step: float) -> tuple[FloatArray | None, bool]:
    """One implicit step of overdamped motion, if it is short and the energy falls; whether it was a good step."""
    metric = chain.stiffness() + chain.edge**2 / time
    gradient = chain.gradient(u)
    move, _ = bordered_solution(metric, chain.slopes(u), -gradient, np.zeros(2))
    if np.abs(move).max() > largest_step:
        return None, False
    new = closed(chain, u + move, metric)
    if new is None or chain.energy(new) > chain.energy(u) + 1e-3 * min(float(gradient @ move), 0.0):
        return None, False
    return new, True


def _minimum_near(chain: DiscreteChain, u: FloatArray, largest_step: float) -> FloatArray | None:
    """The minimum that Newton's method finds, if it is one, near and not above."""
    found, force, _, good = newton(chain, u)
    near = good and np.abs(found - u).max() <= largest_step
    if not near or chain.energy(found) > chain.energy(u) * (1.0 + 1e-9):
        return None
    return None if descents(chain.hessian(found, force), chain.slopes(found)) else found


def _pushed(chain: DiscreteChain, u: FloatArray, force: FloatArray, largest_step: float) -> FloatArray:
    """Away from a stationary shape that is no minimum, along the direction of the most negative second variation."""
    diagonal, slopes = chain.hessian(u, force), chain.slopes(u)
    low, high = 0.0, chain.edge**2
    for _ in range(100):
        if not descents(diagonal, slopes, high):
            break
        low, high = high, 2.0 * high
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if descents(diagonal, slopes, middle) else (low, middle)
    direction = np.linspace(1.0, 2.0, chain.unknowns)
    for _ in range(4):
        direction, _ = bordered_solution(diagonal + high, slopes, direction, np.zeros(2))
        direction /= np.abs(direction).max()
    if chain.gradient(u) @ direction > 0.0:
        direction = -direction
    size = largest_step
    while size > 1e-9:
        for side in (1.0, -1.0):
            new = closed(chain, u + side * size * direction, chain.stiffness())
            if new is not None and chain.energy(new) < chain.energy(u):
                return new
        size *= 0.5
    return u
