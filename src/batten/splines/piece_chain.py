"""A chain of elastica along a curve, its joints free but continuous, brought as close to the curve as it goes.

The unknowns are the seven numbers of every piece; what holds at joints and ends are equations. A step solves the linearised
minimax problem, the least greatest distance over stations along the pieces, as a linear program within a trust region; then
Newton's method restores the equations, which need no look at the curve.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_matrix, csr_matrix, diags
from scipy.sparse.linalg import splu

from batten.curves.elastica import states_along
from batten.kernels.elastica_jacobian import jacobian_batch
from batten.splines.chain_program import least_offset
from batten.splines.curve_spans import CurveSpan
from batten.typing import BoolArray, FloatArray

#: Stations on a piece, as fractions: close at the ends, where the distance changes fastest.
_STATIONS = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 25))
_TIPS = np.array([0.0, 1.0])
_EXACT = 1e-13
_JOINING = 20
#: What a jump of curvature by 1 over the mean length weighs against the greatest offset.
_TEAR = 10.0
_ROUNDS = 12
_LARGEST = 0.5
_POWERS, _LEVELLING, _LEVEL = (2, 4, 12), 20, 0.005
_DAMPING, _STIFF = 1e-3, 1e4
_DENSE = 64  # equations
_HOPELESS, _NO_GAIN = 1.4, 0.99
_SMALLEST = 1e-4
#: Feet of perpendiculars are found to this share of a piece's length, in at most so many steps; offsets err by its square.
_FOOT, _FOOT_STEPS = 1e-5, 12


@dataclass(frozen=True, eq=False)
class _Joints:
    """A chain, (n, 7), and what holds at its joints and ends.

    `gaps`, (r,), is by how much the equations miss, `equations`, (r, 7 n), their derivative; all but those of curvatures
    are `hard`.
    """

    parameters: FloatArray
    gaps: FloatArray
    equations: csr_matrix
    hard: BoolArray

    def scaled(self) -> csr_matrix:
        """`equations`, by scaled unknowns."""
        a, scale = self.equations, _scales(self.parameters).ravel()
        return csr_matrix((a.data * scale[a.indices], a.indices, a.indptr), a.shape)

    @property
    def torn(self) -> float:
        return float(np.abs(self.gaps).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class _State:
    """A chain beside its span: offsets (n, 2 m) both ways and their derivatives (n, 2 m, 7), feet (n, m)."""

    joints: _Joints
    offsets: FloatArray
    feet: FloatArray
    response: FloatArray

    @property
    def parameters(self) -> FloatArray:
        return self.joints.parameters

    @property
    def worst(self) -> float:
        return max(float(np.abs(self.offsets).max()), 1e-300)


class PieceChain:
    """What a chain along a span has to satisfy.

    Parameters:
        span: the curve.
        order: 0 for common joints, 1 for common tangents too, 2 for common curvatures too.

    The span's ends are held, with their tangents unless the order is 0; a closed span has a joint there like the others.
    """

    def __init__(self, span: CurveSpan, order: int) -> None:
        self.span, self.order = span, order
        self._own = span.points_at(_TIPS * span.length)
        self._patterns: dict[int, tuple[NDArray[np.int32], NDArray[np.int32], BoolArray]] = {}

    def improved(self, parameters: FloatArray, joints: FloatArray, good: float) -> tuple[FloatArray, FloatArray] | None:
        """The chain closer to the span: parameters (n, 7), arc lengths of its joints (n + 1,); None if it cannot be joined.

        Parameters:
            parameters, joints: pieces that meet, with common tangents unless the order is 0, and where on the span.
            good: greatest distance that is good enough; 0 goes on until nothing is gained.
        """
        feet = joints[:-1, None] + np.diff(joints)[:, None] * _STATIONS
        state = self._seen(self._restored(self._joints(parameters), hard_only=True), feet)
        if state is None:
            return None
        state = self._levelled(state, good)
        if state.joints.torn > 100.0 * _EXACT:
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

    def _seen(self, joints: _Joints | None, feet: FloatArray) -> _State | None:
        """The chain beside its span, feet of perpendiculars looked for from `feet`; None if there is no chain."""
        if joints is None:
            return None
        parameters = joints.parameters
        n, m, length = len(parameters), len(_STATIONS), parameters[:, 6:]
        values, full = np.empty((n, m, 4)), np.empty((n, m, 3, 7))
        jacobian_batch(np.ascontiguousarray(parameters), _STATIONS, values, full)
        for k in range(_FOOT_STEPS):
            on, angle = self.span.frames_at(feet)
            away, cos, sin = values[..., :2] - on, np.cos(angle), np.sin(angle)
            step = np.clip(away[..., 0] * cos + away[..., 1] * sin, -0.1 * length, 0.1 * length)
            new = feet + step if self.span.closed else np.clip(feet + step, 0.0, self.span.length)
            if (np.abs(new - feet) <= _FOOT * length).all() or k == _FOOT_STEPS - 1:
                break
            feet = new
        offsets = away[..., 1] * cos - away[..., 0] * sin
        response = cos[..., None] * full[:, :, 1] - sin[..., None] * full[:, :, 0]
        back, back_response = self._back(parameters, feet)
        offsets, response = np.concatenate([offsets, back], axis=1), np.concatenate([response, back_response], axis=1)
        return _State(joints, offsets, feet, response) if np.isfinite(offsets).all() else None

    def _back(self, parameters: FloatArray, feet: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Offsets of the pieces from points of the span between their ends (n, m), and derivatives (n, m, 7).

        Where a piece cuts a bend short, the feet of its own points leave the bend out.
        """
        length = parameters[:, 6:]
        s = feet[:, :1] + (feet[:, -1:] - feet[:, :1]) * _STATIONS
        points, arcs = self.span.points_at(s), length * _STATIONS
        for _ in range(_FOOT_STEPS):
            on = states_along(parameters, arcs)
            away = points - on[..., :2]
            step = away[..., 0] * np.cos(on[..., 2]) + away[..., 1] * np.sin(on[..., 2])
            new = np.clip(arcs + np.clip(step, -0.1 * length, 0.1 * length), 0.0, length)
            still = (np.abs(new - arcs) <= _FOOT * length).all()
            arcs = new
            if still:
                break
        order = np.argsort(arcs, axis=1)
        points = np.take_along_axis(points, order[..., None], axis=1)
        fractions = np.take_along_axis(arcs, order, axis=1) / length
        on, full = np.empty((*s.shape, 4)), np.empty((*s.shape, 3, 7))
        rows = np.ascontiguousarray(parameters)
        for i in range(len(s)):
            jacobian_batch(rows[i : i + 1], fractions[i], on[i : i + 1], full[i : i + 1])
        normal = np.stack([-np.sin(on[..., 2]), np.cos(on[..., 2])], axis=-1)
        response = normal[..., :1] * full[:, :, 0] + normal[..., 1:] * full[:, :, 1]
        return -((points - on[..., :2]) * normal).sum(axis=-1), response

    def _joints(self, parameters: FloatArray) -> _Joints:
        """What must vanish: differences of states at joints and from the ends' own, in units of the mean length."""
        n, rows = len(parameters), self.order + 2
        tips, full = np.empty((n, 2, 4)), np.empty((n, 2, 3, 7))
        jacobian_batch(np.ascontiguousarray(parameters), _TIPS, tips, full)
        unit = np.ones(4)
        unit[:2], unit[3] = n / parameters[:, 6].sum(), parameters[:, 6].sum() / n
        slopes = np.zeros((n, 2, 4, 7))
        slopes[:, :, :3] = full
        slopes[:, 0, 3, 3] = 1.0
        # κ(s) = κ₀ + (γ(s) − start) × force (Brander2016 (5))
        force, step = parameters[:, 4:6], tips[:, 1, :2] - tips[:, 0, :2]
        travel = full[:, 1, :2] - full[:, 0, :2]
        slopes[:, 1, 3] = travel[:, 0] * force[:, 1:] - travel[:, 1] * force[:, :1]
        slopes[:, 1, 3, 3] += 1.0
        slopes[:, 1, 3, 5] += step[:, 0]
        slopes[:, 1, 3, 4] -= step[:, 1]
        tips, slopes = (tips * unit)[:, :, :rows], (slopes * unit[:, None])[:, :, :rows]
        if self.span.closed:
            gaps = tips[:, 1] - np.roll(tips[:, 0], -1, axis=0)
            gaps[-1, 2:3] -= self.span.angles[-1] - self.span.angles[0]
            blocks = np.concatenate([slopes[:, 1], -np.roll(slopes[:, 0], -1, axis=0)], axis=2)
            end_gaps, end_blocks = np.empty((0, 7)), np.empty((0, 7))
        else:
            held = min(rows, 3)
            own = np.column_stack([self._own, self.span.angles[[0, -1]]]) * unit[:3]
            gaps = tips[:-1, 1] - tips[1:, 0]
            blocks = np.concatenate([slopes[:-1, 1], -slopes[1:, 0]], axis=2)
            outer = [(0, 0), (-1, 1)]
            end_gaps = np.concatenate([tips[i, e, :held] - own[e, :held] for i, e in outer])
            end_blocks = np.concatenate([slopes[i, e, :held] for i, e in outer])
        columns, edges, hard = self._pattern(n)
        data = np.concatenate([blocks.ravel(), end_blocks.ravel()])
        matrix = csr_matrix((data, columns, edges), (len(edges) - 1, 7 * n))
        return _Joints(parameters, np.concatenate([gaps.ravel(), end_gaps.ravel()]), matrix, hard)

    def _pattern(self, n: int) -> tuple[NDArray[np.int32], NDArray[np.int32], BoolArray]:
        """Columns and row edges of the equations of n pieces, and which of them are not about curvatures."""
        if n not in self._patterns:
            rows = self.order + 2
            joints, held = (n, 0) if self.span.closed else (n - 1, min(rows, 3))
            before = np.arange(joints)
            pieces = np.stack([before, (before + 1) % n], axis=1)
            columns = (7 * pieces[:, None, :, None] + np.arange(7)).repeat(rows, axis=1).reshape(joints * rows, 14)
            ends = (7 * np.repeat([0, n - 1], held)[:, None] + np.arange(7)).reshape(-1, 7)
            widths = np.concatenate([np.full(len(columns), 14), np.full(len(ends), 7)])
            hard = np.concatenate([np.tile(np.arange(rows) < 3, joints), np.ones(len(ends), bool)])
            flat = np.concatenate([columns.ravel(), ends.ravel()]).astype(np.int32)
            self._patterns[n] = flat, np.concatenate([[0], np.cumsum(widths)]).astype(np.int32), hard
        return self._patterns[n]

    def _joined(self, state: _State, good: float) -> _State | None:
        """A chain with common tangents brought to common curvatures; None if it cannot be.

        The curvatures' greatest jump is weighed against the greatest offset until Newton's method can close it.
        """
        reach = 0.1
        for _ in range(_JOINING):
            near = state.joints.torn < 0.3
            closed = self._seen(self._restored(state.joints), state.feet) if near else None
            if closed is not None and closed.worst < max(2.0 * state.worst, good):
                return closed
            move, promised = self._program(state, reach, soft=True)
            new = None if move is None else self._moved(state, move, hard_only=True)
            merit, before = (np.inf if new is None else self._merit(new, state)), self._merit(state, state)
            if new is not None and merit < before - 0.05 * (before - promised):
                state, reach = new, min(2.0 * reach, _LARGEST)
            else:
                reach *= 0.25
            if reach < _SMALLEST:
                return None
        return self._seen(self._restored(state.joints), state.feet)

    def _levelled(self, state: _State, good: float) -> _State:
        """Lower sums of powers of the offsets, squares and then higher ones, by Gauss–Newton steps, and close curvatures.

        Each step costs a fraction of a linear program. Jumps of curvature yield at first: they weigh as much as the offsets,
        then ten times more at each step. Where they cannot be closed the chain still has them.
        """
        if state.joints.torn > 100.0 * _EXACT:
            state = self._closed(state)
            if state.joints.torn > 100.0 * _EXACT:
                return state
        for power in _POWERS:
            damping = _DAMPING
            for _ in range(_LEVELLING):
                if state.worst <= good:
                    return state
                before = _sum_of_powers(state, state.worst, power)
                move = self._downhill(state, power, damping)
                new = None if move is None else self._moved(state, move)
                after = np.inf if new is None else _sum_of_powers(new, state.worst, power)
                if new is None or after >= before:
                    damping *= 30.0
                    if damping > 1e3:
                        break
                    continue
                state, damping = new, max(0.1 * damping, 1e-9)
                if after > (1.0 - _LEVEL * power) * before:
                    break
        return state

    def _closed(self, state: _State) -> _State:
        """A chain brought to common curvatures, if that goes, by the way `_levelled` says."""
        damping = _DAMPING
        jumps = ~state.joints.hard
        weight = _sum_of_powers(state, state.worst, 2) / float((state.joints.gaps[jumps] ** 2).sum())
        for _ in range(_LEVELLING):
            done = weight > _STIFF
            before = _sum_of_powers(state, state.worst, 2) + weight * float((state.joints.gaps[jumps] ** 2).sum())
            move = self._downhill(state, 2, damping, np.where(jumps, 1.0 / weight, 0.0) * (not done))
            new = None if move is None else self._moved(state, move, hard_only=not done)
            after = np.inf
            if new is not None:
                after = _sum_of_powers(new, state.worst, 2) + weight * float((new.joints.gaps[jumps] ** 2).sum())
            if new is not None and (after < before or done):
                if done:
                    return new
                state, damping, weight = new, max(0.1 * damping, 1e-9), 10.0 * weight
            else:
                damping *= 30.0
                if damping > 1e3:
                    break
        return state

    def _downhill(
        self, state: _State, power: int, damping: float, yielding: FloatArray | None = None
    ) -> FloatArray | None:
        """The Gauss–Newton step, (n, 7), in scaled unknowns, of the sum of powers of the offsets.

        Equations are met, but for those that are `yielding`, (r,): what is left of them counts, squared, divided by that.
        """
        scale, joints, worst = _scales(state.parameters), state.joints, state.worst
        g, o = state.response * (scale[:, None] / worst), state.offsets / worst
        weight = np.abs(o) ** (power - 2)
        weighted = g * weight[..., None]
        hessian = (power - 1) * np.swapaxes(weighted, 1, 2) @ g
        size = np.trace(hessian, axis1=1, axis2=2).mean() / 7.0
        hessian += damping * size * np.eye(7)
        slope = (weighted * o[..., None]).sum(axis=1)
        try:
            inverse = np.linalg.inv(hessian)
        except np.linalg.LinAlgError:
            return None
        free, n = -(inverse @ slope[..., None])[..., 0], len(scale)
        a = joints.scaled()
        spread = bsr_matrix((inverse, np.arange(n), np.arange(n + 1)), (7 * n, 7 * n)).tocsr() @ a.T
        push = _pushed(a, spread, joints.gaps + a @ free.ravel(), yielding)
        return None if push is None else free - (spread @ push).reshape(n, 7)

    def _merit(self, state: _State, unit: _State) -> float:
        return state.worst / unit.worst + _TEAR * state.joints.torn

    def _restored(self, joints: _Joints | None, *, hard_only: bool = False) -> _Joints | None:
        """Newton's method on the equations alone, or all but those of curvatures, by the smallest steps."""
        if joints is None:
            return None
        rows = joints.hard if hard_only else np.ones(len(joints.gaps), bool)
        size = float(np.abs(joints.gaps[rows]).max(initial=0.0))
        for _ in range(10):
            if size <= _EXACT:
                return joints
            move = self._newton(joints, rows)
            new = None if move is None else self._stepped(joints.parameters, move)
            left = np.inf if new is None else float(np.abs(new.gaps[rows]).max(initial=0.0))
            if new is None or not left < size:
                break
            joints, size = new, left
        return joints if size <= 100.0 * _EXACT else None

    def _newton(self, joints: _Joints, rows: BoolArray) -> FloatArray | None:
        """The least step (n, 7), in scaled unknowns, that meets some of the linearised equations."""
        a = joints.scaled()
        a = a if rows.all() else a[rows]
        push = _pushed(a, a.T, joints.gaps[rows], None)
        return None if push is None else -(a.T @ push).reshape(-1, 7)

    def _stepped(self, parameters: FloatArray, move: FloatArray) -> _Joints | None:
        """The chain after a step in scaled unknowns; None where a piece vanishes or turns over."""
        new = parameters + move * _scales(parameters)
        if not ((new[:, 6] > 0.2 * parameters[:, 6]).all() and np.isfinite(new).all()):
            return None
        return self._joints(new)

    def _moved(self, state: _State, move: FloatArray, *, hard_only: bool = False) -> _State | None:
        """The chain after a step, its equations restored; None where that fails."""
        return self._seen(self._restored(self._stepped(state.parameters, move), hard_only=hard_only), state.feet)

    def _minimax(self, state: _State, good: float) -> _State:
        reach = 0.1
        for left in range(_ROUNDS, 0, -1):
            if state.worst <= good or reach < _SMALLEST or state.worst > _HOPELESS * good > 0.0:
                break
            move, promised = self._program(state, reach)
            if move is None or promised > _NO_GAIN * state.worst:
                break
            new = self._moved(state, move)
            gain = -1.0 if new is None else (state.worst - new.worst) / (state.worst - promised)
            won = 0.0
            if new is not None and gain > 0.05:
                won = state.worst - new.worst
                state = new
                reach = min(2.0 * reach, _LARGEST) if gain > 0.7 else reach
            else:
                reach *= 0.25
            if left <= _ROUNDS - 3 and good > 0.0 and won * left < state.worst - good:
                break
        return state

    def _program(self, state: _State, reach: float, soft: bool = False) -> tuple[FloatArray | None, float]:
        """The step within `reach` of least greatest offset, to first order, and that offset.

        With `soft` the jumps of curvature are no equations, but their greatest, times `_TEAR`, is added to the offset in
        units of the present one; that sum is returned.
        """
        scale, joints, worst = _scales(state.parameters), state.joints, state.worst
        a = joints.scaled()
        hard = joints.hard if soft else np.ones(len(joints.gaps), bool)
        move, value = least_offset(
            state.response * (scale[:, None] / worst), state.offsets / worst, a[hard], joints.gaps[hard],
            a[~hard], joints.gaps[~hard], _TEAR, reach,
        )  # fmt: skip
        return move, value if soft else value * worst


def _pushed(a: csr_matrix, spread: csr_matrix, gaps: FloatArray, yielding: FloatArray | None) -> FloatArray | None:
    """What solves (a spread + diag(yielding)) x = gaps; None if that is singular."""
    system = a @ spread
    if yielding is not None:
        system = system + diags(yielding)
    try:
        push = np.linalg.solve(system.toarray(), gaps) if len(gaps) <= _DENSE else splu(system.tocsc()).solve(gaps)
    except (np.linalg.LinAlgError, RuntimeError):
        return None
    return push if np.isfinite(push).all() else None


def _sum_of_powers(state: _State, unit: float, power: int) -> float:
    return float((np.abs(state.offsets / unit) ** power).sum())


def _scales(parameters: FloatArray) -> FloatArray:
    """What a step of 1 is in each of the seven numbers, (n, 7)."""
    length = parameters[:, 6:]
    return np.asarray(np.array([1.0, 1.0, 1.0, 3.0, 10.0, 10.0, 1.0]) * length ** np.array([1, 1, 0, -1, -2, -2, 1.0]))
