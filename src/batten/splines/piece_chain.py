"""A chain of elastica along a curve, its joints free but continuous, brought as close to the curve as it goes.

The unknowns are the seven numbers of every piece; what holds at joints and ends are equations. A step solves the linearised
minimax problem, the least greatest distance over stations along the pieces, as a linear program within a trust region; then
Newton's method restores the equations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import block_diag, bmat, coo_matrix, csr_matrix, diags
from scipy.sparse.linalg import splu

from batten.curves.elastica import states_along
from batten.kernels.elastica_jacobian import jacobian_batch
from batten.splines.curve_spans import CurveSpan
from batten.typing import BoolArray, FloatArray

#: Stations on a piece, as fractions: close at the ends, where the distance changes fastest.
_STATIONS = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 25))
_EXACT = 1e-13
_JOINING = 20
#: What a jump of curvature by 1 over the mean length weighs against the greatest offset.
_TEAR = 10.0
_ROUNDS = 12
_LARGEST = 0.5
_SMALLEST = 1e-4


@dataclass(frozen=True, eq=False)
class _State:
    """A chain looked at: parameters (n, 7), offsets (n, 2 m) both ways and their derivatives (n, 2 m, 7), feet (n, m).

    `gaps`, (r,), is by how much the equations miss, `equations`, (r, 7 n), their derivative; all but those of curvatures
    are `hard`.
    """

    parameters: FloatArray
    offsets: FloatArray
    feet: FloatArray
    response: FloatArray
    gaps: FloatArray
    equations: csr_matrix
    hard: BoolArray

    @property
    def worst(self) -> float:
        return float(np.abs(self.offsets).max())

    @property
    def torn(self) -> float:
        return float(np.abs(self.gaps).max(initial=0.0))


class PieceChain:
    """What a chain along a span has to satisfy.

    Parameters:
        span: the curve.
        order: 0 for common joints, 1 for common tangents too, 2 for common curvatures too.

    The span's ends are held, with their tangents unless the order is 0; a closed span has a joint there like the others.
    """

    def __init__(self, span: CurveSpan, order: int) -> None:
        self.span, self.order = span, order

    def improved(self, parameters: FloatArray, joints: FloatArray, good: float) -> tuple[FloatArray, FloatArray] | None:
        """The chain closer to the span: parameters (n, 7), arc lengths of its joints (n + 1,); None if it cannot be joined.

        Parameters:
            parameters, joints: pieces that meet, with common tangents unless the order is 0, and where on the span.
            good: greatest distance that is good enough; 0 goes on until nothing is gained.
        """
        feet = joints[:-1, None] + np.diff(joints)[:, None] * _STATIONS
        state = self._restored(self._look(parameters, feet), hard_only=True)
        if state is not None and self.order == 2:
            state = self._joined(state, good)
        if state is None:
            return None
        state = self._minimax(state, good)
        ends = np.append(state.feet[:, 0], state.feet[-1, -1])
        if self.span.closed:
            ends[-1] = ends[0] + self.span.length
        else:
            ends[0], ends[-1] = 0.0, self.span.length
        return (state.parameters, ends) if (np.diff(ends) > 0.0).all() else None

    def _look(self, parameters: FloatArray, feet: FloatArray) -> _State:
        n, m = len(parameters), len(_STATIONS)
        length = parameters[:, 6:]
        values, ignored, full = (
            states_along(parameters, length * _STATIONS),
            np.empty((n, m, 4)),
            np.empty((n, m, 3, 7)),
        )
        jacobian_batch(np.ascontiguousarray(parameters), _STATIONS, ignored, full)
        points = values[..., :2]
        for _ in range(4):
            angle = self.span.angles_at(feet)
            away = points - self.span.points_at(feet)
            step = away[..., 0] * np.cos(angle) + away[..., 1] * np.sin(angle)
            feet = feet + np.clip(step, -0.1 * length, 0.1 * length)
            if not self.span.closed:
                feet = np.clip(feet, 0.0, self.span.length)
        angle, away = self.span.angles_at(feet), points - self.span.points_at(feet)
        normal = np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
        offsets = (away * normal).sum(axis=-1)
        response = normal[..., :1] * full[:, :, 0] + normal[..., 1:] * full[:, :, 1]
        back, back_response = self._look_back(parameters, feet)
        gaps, equations, hard = self._equations(parameters, values, full)
        offsets, response = np.concatenate([offsets, back], axis=1), np.concatenate([response, back_response], axis=1)
        return _State(parameters, offsets, feet, response, gaps, equations, hard)

    def _look_back(self, parameters: FloatArray, feet: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Offsets of the pieces from points of the span between their ends (n, m), and derivatives (n, m, 7).

        Where a piece cuts a bend short, the feet of its own points leave the bend out.
        """
        length = parameters[:, 6:]
        s = feet[:, :1] + (feet[:, -1:] - feet[:, :1]) * _STATIONS
        points, arcs = self.span.points_at(s), length * _STATIONS
        for _ in range(5):
            on = states_along(parameters, arcs)
            away = points - on[..., :2]
            step = away[..., 0] * np.cos(on[..., 2]) + away[..., 1] * np.sin(on[..., 2])
            arcs = np.clip(arcs + np.clip(step, -0.1 * length, 0.1 * length), 0.0, length)
        order = np.argsort(arcs, axis=1)
        on = states_along(parameters, np.take_along_axis(arcs, order, axis=1))
        points = np.take_along_axis(points, order[..., None], axis=1)
        values, full = np.empty((1, s.shape[1], 4)), np.empty((1, s.shape[1], 3, 7))
        response = np.empty((*s.shape, 7))
        normal = np.stack([-np.sin(on[..., 2]), np.cos(on[..., 2])], axis=-1)
        for i in range(len(s)):
            fractions = np.ascontiguousarray(arcs[i, order[i]] / length[i, 0])
            jacobian_batch(np.ascontiguousarray(parameters[i : i + 1]), fractions, values, full)
            response[i] = normal[i, :, :1] * full[0, :, 0] + normal[i, :, 1:] * full[0, :, 1]
        return -((points - on[..., :2]) * normal).sum(axis=-1), response

    def _equations(
        self, parameters: FloatArray, values: FloatArray, full: FloatArray
    ) -> tuple[FloatArray, csr_matrix, BoolArray]:
        """What must vanish: differences of states at joints and from the ends' own, in units of the mean length."""
        n, rows = len(parameters), self.order + 2
        unit = np.array([1.0, 1.0, 1.0, 1.0])
        unit[:2], unit[3] = n / parameters[:, 6].sum(), parameters[:, 6].sum() / n
        tips, slopes = values[:, [0, -1]], np.zeros((n, 2, 4, 7))
        slopes[:, :, :3] = full[:, [0, -1]]
        slopes[:, 0, 3, 3] = 1.0
        # κ(s) = κ₀ + (γ(s) − start) × force (Brander2016 (5))
        force, step = parameters[:, 4:6], tips[:, 1, :2] - tips[:, 0, :2]
        travel = slopes[:, 1, :2] - slopes[:, 0, :2]
        slopes[:, 1, 3] = travel[:, 0] * force[:, 1:] - travel[:, 1] * force[:, :1]
        slopes[:, 1, 3, 3] += 1.0
        slopes[:, 1, 3, 5] += step[:, 0]
        slopes[:, 1, 3, 4] -= step[:, 1]
        tips, slopes = tips * unit, slopes * unit[:, None]
        gaps, blocks = [], []
        for i in range(n if self.span.closed else n - 1):
            j = (i + 1) % n
            gap = tips[i, 1, :rows] - tips[j, 0, :rows]
            if j == 0 and rows > 2:
                gap[2] -= self.span.angles[-1] - self.span.angles[0]
            gaps.append(gap)
            blocks += [(len(gaps) - 1, i, slopes[i, 1, :rows]), (len(gaps) - 1, j, -slopes[j, 0, :rows])]
        if not self.span.closed:
            held = min(rows, 3)
            own = self.span.points_at(np.array([0.0, self.span.length]))
            for i, e, angle in ((0, 0, self.span.angles[0]), (n - 1, 1, self.span.angles[-1])):
                gap, slope = np.zeros(rows), np.zeros((rows, 7))
                gap[:held] = (tips[i, e] - np.array([*own[e], angle, 0.0]) * unit)[:held]
                slope[:held] = slopes[i, e, :held]
                gaps.append(gap)
                blocks.append((len(gaps) - 1, i, slope))
        data = np.stack([block for _, _, block in blocks])
        row = np.array([r for r, _, _ in blocks])[:, None, None] * rows + np.arange(rows)[:, None]
        column = np.array([c for _, c, _ in blocks])[:, None, None] * 7 + np.arange(7)
        shape = (len(gaps) * rows, 7 * n)
        row, column = np.broadcast_arrays(row, column)
        matrix = coo_matrix((data.ravel(), (row.ravel(), column.ravel())), shape).tocsr()
        used = np.diff(matrix.indptr) > 0
        used &= np.asarray(abs(matrix).sum(axis=1)).ravel() > 0.0
        hard = np.tile(np.arange(rows) < 3, len(gaps))
        return np.concatenate(gaps)[used], matrix[used], hard[used]

    def _joined(self, state: _State, good: float) -> _State | None:
        """A chain with common tangents brought to common curvatures; None if it cannot be.

        The curvatures' greatest jump is weighed against the greatest offset until Newton's method can close it.
        """
        reach = 0.1
        for _ in range(_JOINING):
            closed = self._restored(state) if state.torn < 0.3 else None
            if closed is not None and closed.worst < max(2.0 * state.worst, good):
                return closed
            move, promised = self._program(state, reach, soft=True)
            new = None if move is None else self._moved(state, move)
            new = None if new is None else self._restored(new, hard_only=True)
            merit, before = (np.inf if new is None else self._merit(new, state)), self._merit(state, state)
            if new is not None and merit < before - 0.05 * (before - promised):
                state, reach = new, min(2.0 * reach, _LARGEST)
            else:
                reach *= 0.25
            if reach < _SMALLEST:
                return None
        return self._restored(state)

    def _merit(self, state: _State, unit: _State) -> float:
        return state.worst / unit.worst + _TEAR * state.torn

    def _restored(self, state: _State, *, hard_only: bool = False) -> _State | None:
        """Newton's method on the equations alone, or all but those of curvatures, by the smallest steps."""
        rows = state.hard if hard_only else np.ones(len(state.gaps), bool)
        size = float(np.abs(state.gaps[rows]).max(initial=0.0))
        for _ in range(10):
            if size <= _EXACT:
                return state
            move = self._newton(state, rows)
            new = None if move is None else self._moved(state, move)
            left = np.inf if new is None else float(np.abs(new.gaps[rows]).max(initial=0.0))
            if new is None or left >= size:
                break
            state, size = new, left
        return state if size <= 100.0 * _EXACT else None

    def _newton(self, state: _State, rows: BoolArray) -> FloatArray | None:
        """The least step (n, 7), in scaled unknowns, that meets some of the linearised equations."""
        a = state.equations[rows] @ diags(_scales(state.parameters).ravel())
        system = (a @ a.T + 1e-15 * diags(np.ones(a.shape[0]))).tocsc()
        try:
            step = -(a.T @ splu(system).solve(state.gaps[rows]))
        except RuntimeError:  # singular
            return None
        return step.reshape(-1, 7) if np.isfinite(step).all() else None

    def _moved(self, state: _State, move: FloatArray) -> _State | None:
        """The chain after a step in scaled unknowns; None where a piece vanishes or turns over."""
        parameters = state.parameters + move * _scales(state.parameters)
        if not ((parameters[:, 6] > 0.2 * state.parameters[:, 6]).all() and np.isfinite(parameters).all()):
            return None
        new = self._look(parameters, state.feet)
        return new if np.isfinite(new.offsets).all() else None

    def _minimax(self, state: _State, good: float) -> _State:
        reach = 0.1
        for _ in range(_ROUNDS):
            if state.worst <= good or reach < _SMALLEST:
                break
            move, promised = self._program(state, reach)
            if move is None or promised > 0.995 * state.worst:
                break
            new = self._moved(state, move)
            new = None if new is None else self._restored(new)
            gain = -1.0 if new is None else (state.worst - new.worst) / (state.worst - promised)
            if new is not None and gain > 0.05:
                state = new
                reach = min(2.0 * reach, _LARGEST) if gain > 0.7 else reach
            else:
                reach *= 0.25
        return state

    def _program(self, state: _State, reach: float, soft: bool = False) -> tuple[FloatArray | None, float]:
        """The step within `reach` of least greatest offset, to first order, and that offset.

        With `soft` the jumps of curvature are no equations, but their greatest, times `_TEAR`, is added to the offset in
        units of the present one; that sum is returned.
        """
        n, m = state.offsets.shape
        scale = _scales(state.parameters)
        g = block_diag(list(state.response * scale[:, None] / state.worst))
        o = state.offsets.ravel() / state.worst
        equations = (state.equations @ diags(scale.ravel())).tocsr()
        bounds, cost = [*([(-reach, reach)] * (7 * n)), (0.0, None)], np.append(np.zeros(7 * n), 1.0)
        ones = coo_matrix(np.ones((n * m, 1)))
        rows, upper = [[g, -ones], [-g, -ones]], np.concatenate([-o, o])
        hard = np.ones(len(state.gaps), bool)
        if soft:
            hard = state.hard
            jumps, k = equations[~hard], int((~hard).sum())
            rows = [[*row, None] for row in rows] + [
                [s * jumps, None, coo_matrix(-np.ones((k, 1)))] for s in (1.0, -1.0)
            ]
            upper = np.concatenate([upper, -state.gaps[~hard], state.gaps[~hard]])
            bounds, cost = [*bounds, (0.0, None)], np.append(cost, _TEAR)
        spare = coo_matrix((int(hard.sum()), len(cost) - 7 * n))
        found = linprog(
            cost,
            A_ub=bmat(rows, format="csr"),
            b_ub=upper,
            A_eq=bmat([[equations[hard], spare]], format="csr"),
            b_eq=-state.gaps[hard],
            bounds=bounds,
            method="highs",
        )
        if found.x is None:
            return None, np.inf
        value = float(found.fun)
        return found.x[: 7 * n].reshape(n, 7), value if soft else value * state.worst


def _scales(parameters: FloatArray) -> FloatArray:
    """What a step of 1 is in each of the seven numbers, (n, 7)."""
    length = parameters[:, 6:]
    return np.asarray(np.array([1.0, 1.0, 1.0, 3.0, 10.0, 10.0, 1.0]) * length ** np.array([1, 1, 0, -1, -2, -2, 1.0]))
