"""Cubics in a row changed together, common tangents turned and points moved, until each is close to an elastica."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array, eye_array
from scipy.sparse.linalg import spsolve

from batten.measures.lambda_residual import lambda_residual
from batten.measures.lambda_residual_gradient import lambda_residual_gradient
from batten.typing import FloatArray, IntArray

#: What a change of a handle's length by a factor e costs beside a turn by one radian, squared both.
LENGTH_WEIGHT = 0.01
#: Rounds of the augmented Lagrangian, and its first weight.
_ROUNDS, _WEIGHT = 9, 30.0
#: Evaluations of one round.
_EVALUATIONS = 60
#: Greatest step of an unknown: radians, logarithms, shares of a length.
_LONGEST = 0.5
#: Above so many cubics at work at a time the system is kept sparse.
_DENSE = 200


@dataclass(frozen=True)
class TurningProblem:
    """Cubics whose handles may get other lengths, with the turns and movements that several of them have in common.

    Attributes:
        drawn: (m, 4, 2), handles longer than zero: what changes are measured from.
        turns: (m, 2), the number of the turn of each end's handle, −1 for one that keeps its direction.
        points: (m, 2), the number of the point of each end, −1 for one that stays.
        scales: one length for each such point, by which its movement is divided.
        aim: e_λ that each cubic shall have at most.
    """

    drawn: FloatArray
    turns: IntArray
    points: IntArray
    scales: FloatArray
    aim: float

    @property
    def turn_count(self) -> int:
        """How many turns are unknown."""
        return int(self.turns.max(initial=-1)) + 1

    def unknowns(self, control_points: FloatArray) -> FloatArray:
        """The unknowns of control points: turns, logarithms of the lengths' factors, movements; means where two differ."""
        handles, drawn = _handles(control_points), _handles(self.drawn)
        turned = np.angle(handles * drawn.conj())
        factors = np.log(np.abs(handles) / np.abs(drawn))
        moved = (control_points - self.drawn)[:, [0, 3]]
        turns = _means(turned, self.turns, self.turn_count)
        shifts = [_means(moved[..., k], self.points, len(self.scales)) / self.scales for k in range(2)]
        return np.concatenate([turns, factors.ravel(), np.stack(shifts, axis=-1).ravel()])

    def control_points(self, unknowns: FloatArray) -> FloatArray:
        """Control points (m, 4, 2) from the unknowns."""
        turns, factors, shifts = self._parts(unknowns)
        handles = _handles(self.drawn) * np.exp(factors + 1j * turns)
        result = np.empty_like(self.drawn)
        result[:, [0, 3]] = self.drawn[:, [0, 3]] + shifts
        result[:, [1, 2]] = result[:, [0, 3]] + np.stack([handles.real, handles.imag], axis=-1)
        return result

    def cost(self, unknowns: FloatArray) -> float:
        """Sum of turns² + 0.01 log² of the lengths' factors + (movements over scales)²."""
        return float((self._weights() * unknowns) @ (self._weights() * unknowns))

    def _parts(self, unknowns: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        n, m = self.turn_count, len(self.drawn)
        turns = np.append(unknowns[:n], 0.0)[self.turns]
        factors = unknowns[n : n + 2 * m].reshape(m, 2)
        shifts = np.concatenate([unknowns[n + 2 * m :].reshape(-1, 2) * self.scales[:, None], np.zeros((1, 2))])
        return turns, factors, shifts[self.points]

    def _weights(self) -> FloatArray:
        lengths = np.full(2 * len(self.drawn), np.sqrt(LENGTH_WEIGHT))
        return np.concatenate([np.ones(self.turn_count), lengths, np.ones(2 * len(self.scales))])

    def residuals(self, unknowns: FloatArray) -> tuple[FloatArray, csr_array]:
        """e_λ, 1 where there is none, and its Jacobian; rows of zeros where it has no derivative."""
        points = self.control_points(unknowns)
        values, gradients = lambda_residual_gradient(points)
        gradients = np.where(np.isfinite(gradients), gradients, 0.0)
        n, m = self.turn_count, len(self.drawn)
        rows, columns, entries = [], [], []
        for side, (end, inner) in enumerate(((0, 1), (3, 2))):
            handle, by = points[:, inner] - points[:, end], gradients[:, inner]
            some = np.flatnonzero(self.turns[:, side] >= 0)
            rows += [some, np.arange(m)]
            columns += [self.turns[some, side], n + 2 * np.arange(m) + side]
            entries += [(by[:, 1] * handle[:, 0] - by[:, 0] * handle[:, 1])[some], (by * handle).sum(axis=1)]
            some = np.flatnonzero(self.points[:, side] >= 0)
            which = self.points[some, side]
            for k in range(2):
                rows.append(some)
                columns.append(n + 2 * m + 2 * which + k)
                entries.append((gradients[some, end, k] + by[some, k]) * self.scales[which])
        shape = (m, n + 2 * m + 2 * len(self.scales))
        jacobian = csr_array((np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns))), shape=shape)
        return np.where(np.isfinite(values), values, 1.0), jacobian


def least_change(problem: TurningProblem, starts: list[FloatArray]) -> tuple[FloatArray, bool]:
    """The least change after which e_λ ≤ aim for every cubic, by the augmented Lagrangian from each start.

    Each round is a non-linear least-squares problem, the weighted change beside max(0, e_λ − aim + shift).

    Parameters:
        problem: what may change.
        starts: control points to start from, (m, 4, 2) each.

    Returns:
        (control points, whether the aim is met). Of the answers that meet it that of least cost; if none does, that whose
        worst e_λ is least.
    """
    best, best_key = problem.drawn, (True, np.inf)
    for start in starts:
        unknowns = _descended(problem, problem.unknowns(start))
        points = problem.control_points(unknowns)
        worst = float(np.nan_to_num(lambda_residual(points), nan=1.0).max())
        met = worst <= problem.aim * (1.0 + 5e-4)
        key = (not met, problem.cost(unknowns) if met else worst)
        if key < best_key:
            best, best_key = points, key
    return best, not best_key[0]


def _descended(problem: TurningProblem, unknowns: FloatArray) -> FloatArray:
    """The rounds of the augmented Lagrangian ½|weights · x|² + ½ weight Σ max(0, e_λ − aim + shift)²."""
    shifts, weight, last = np.zeros(len(problem.drawn)), _WEIGHT, np.inf
    for _ in range(_ROUNDS):
        unknowns, values = _least_squares(problem, unknowns, shifts, weight)
        over = values - problem.aim
        excess = float(over.max())
        if excess <= (4e-4 * problem.aim if (shifts > 0.0).any() else 0.0):
            break
        shifts = np.maximum(0.0, shifts + over)
        if excess > 0.25 * last:
            weight, shifts = 6.0 * weight, shifts / 6.0
        last = excess
    return unknowns


def _least_squares(
    problem: TurningProblem, unknowns: FloatArray, shifts: FloatArray, weight: float
) -> tuple[FloatArray, FloatArray]:
    """Levenberg–Marquardt in the metric of the weights: (unknowns, e_λ there)."""
    metric = problem._weights() ** 2

    def height(x: FloatArray, values: FloatArray) -> float:
        excess = np.maximum(0.0, values - problem.aim + shifts)
        return float(0.5 * (metric * x) @ x + 0.5 * weight * excess @ excess)

    values, jacobian = problem.residuals(unknowns)
    here, damping, growth = height(unknowns, values), 1.0, 2.0
    for _ in range(_EVALUATIONS):
        excess = np.maximum(0.0, values - problem.aim + shifts)
        active = np.flatnonzero(excess > 0.0)
        rows = jacobian[active]
        slope = metric * unknowns + weight * (rows.T @ excess[active])
        step = np.clip(-_solved(metric + damping, rows, weight, slope), -_LONGEST, _LONGEST)
        tried, tried_jacobian = problem.residuals(unknowns + step)
        there = height(unknowns + step, tried)
        bent = rows @ step
        expected = -float(slope @ step + 0.5 * (metric * step) @ step + 0.5 * weight * bent @ bent)
        if there < here:
            gain, here = here - there, there
            unknowns, values, jacobian = unknowns + step, tried, tried_jacobian
            damping *= max(0.1, 1.0 - (2.0 * min(gain / expected, 1.0) - 1.0) ** 3) if expected > 0.0 else 1.0
            growth = 2.0
            if gain <= 1e-6 * here:
                break
        elif float(step @ step) <= 1e-14:
            break
        else:
            damping, growth = damping * growth, 2.0 * growth
    return unknowns, values


def _solved(diagonal: FloatArray, rows: csr_array, weight: float, right: FloatArray) -> FloatArray:
    """x of (diag + weight · rowsᵀ rows) x = right, by a system of the size of the rows."""
    scaled = right / diagonal
    if rows.shape[0] == 0:
        return scaled
    small = (rows * (1.0 / diagonal)[None, :]) @ rows.T
    sides = rows @ scaled
    if rows.shape[0] <= _DENSE:
        found = np.linalg.solve(small.toarray() + np.eye(rows.shape[0]) / weight, sides)
    else:
        found = spsolve(csc_array(small + eye_array(rows.shape[0]) / weight), sides)
    return scaled - (rows.T @ found) / diagonal


def _handles(control_points: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.complex128]]:
    """Both handles, from the ends inwards, as complex numbers (m, 2)."""
    return (control_points[:, [1, 2]] - control_points[:, [0, 3]]) @ np.array([1.0, 1.0j])


def _means(values: FloatArray, numbers: IntArray, count: int) -> FloatArray:
    """For each number the mean of the values that bear it."""
    some = numbers >= 0
    sums = np.bincount(numbers[some], values[some], minlength=count)
    return sums / np.maximum(np.bincount(numbers[some], minlength=count), 1)
