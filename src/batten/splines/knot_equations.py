"""The equations of a run of a constrained spline, and Newton's method for them (Levien2009 ch. 8).

The unknowns are each segment's curvature and derivatives in the middle, for length 1: four, two or one of them. Angle,
curvature, κ′ and κ″ at the ends of the segments, for chord 1, are known with exact derivatives (`kernels.four_parameter`);
in these the equations are linear, each with at most two terms: a band matrix of 5 diagonals on either side. A closed run is
folded, so that segments that follow one another stay near: 7 diagonals.

Newton's method is damped by the size of the following correction, measured in radians (Deuflhard's natural test), and no
tangent turns by more than one radian in a step. Where it fails, (x, share) is followed from a known solution at share 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from batten.kernels import four_parameter as kernel
from batten.splines.knot_types import Run
from batten.typing import BoolArray, FloatArray

# For each kind of knot what holds: for the four equations the order of the derivative of the angle taken on the left and on
# the right; −1 none; + 8: only if that side has four parameters.
_NONE, _IF_FOUR = -1, 8
_SIDES = {
    "o": ((0, 1, 2, 3), (0, 1, 2, 3)),
    "c": ((0, 1, 3 + _IF_FOUR, _NONE), (0, 1, _NONE, 3 + _IF_FOUR)),
    "[": ((0, 1, _NONE, _NONE), (0, 1, 2 + _IF_FOUR, 3 + _IF_FOUR)),
    "]": ((0, 1, 2 + _IF_FOUR, 3 + _IF_FOUR), (0, 1, _NONE, _NONE)),
    "free": ((2 + _IF_FOUR, 3 + _IF_FOUR, _NONE, _NONE),) * 2,
    "line": ((0, 1, _NONE, _NONE),) * 2,
}
_RADIANS = np.array([1.0 / 2.0, 1.0 / 8.0, 1.0 / 48.0, 1.0 / 384.0])  # of k₀ … k₃, at the end of the segment
_TOLERANCE = 1e-12
_LARGEST_TURN = 1.0
_LEAST_FACTOR = 1e-4


@dataclass(frozen=True, eq=False)
class KnotState:
    """A place on the way: unknowns, the segments' ends (kernel's rows), residuals."""

    x: FloatArray
    ends: FloatArray
    miss: FloatArray


class _Factors(Protocol):
    def __call__(self, right: FloatArray) -> FloatArray: ...


class KnotEquations:
    """The equations of one run.

    Attributes:
        chords: (m,). parameters: (m,) of 1, 2, 4.
        turns: turning angle at each knot of the run, (m,) if closed, else (m + 1,) with those to the lines at its ends.
        knots: whether the equation is one of angles, and its knot; (rows,) each.
        iterations: Newton steps so far.
    """

    def __init__(self, run: Run, chords: FloatArray, turns: FloatArray) -> None:
        self.chords, self.parameters, self.turns = chords, run.parameters, turns
        self.iterations = 0
        m = len(chords)
        self.used: BoolArray = np.arange(4)[None, :] < self.parameters[:, None]
        self.unknowns = int(self.used.sum())
        self.radians = np.broadcast_to(_RADIANS, (m, 4))[self.used]
        self._column = np.cumsum(self.used.ravel()).reshape(m, 4) - 1
        self._terms(run)
        self._places(run.closed)

    # --- structure ---

    def _terms(self, run: Run) -> None:
        """Rows, segments, values and factors of all terms."""
        m = len(self.chords)
        four = self.parameters == 4
        if run.closed:
            kinds = list(run.letters)
            left, right = np.arange(-1, m - 1) % m, np.arange(m)
        else:
            kinds = [run.boundaries[0], *run.letters, run.boundaries[1]]
            left, right = np.arange(-1, m), np.append(np.arange(m), -1)
        names = list(_SIDES)
        table = np.array([_SIDES[name] for name in names])  # (kinds, sides, slots)
        index = np.array([names.index(kind) for kind in kinds])
        orders = table[index]
        for side, segment in enumerate((left, right)):
            o = orders[:, side]
            there = (segment >= 0)[:, None]
            whole = four[segment][:, None]
            orders[:, side] = np.where(
                o < _IF_FOUR, np.where(there, o, _NONE), np.where(there & whole, o - _IF_FOUR, _NONE)
            )
        a = np.where(left >= 0, self.chords[left], self.chords[right])
        b = np.where(right >= 0, self.chords[right], self.chords[left])
        weight = 2.0 * a * b / (a + b)
        exists = (orders >= 0).any(axis=1)  # (knots, slots)
        row = np.cumsum(exists.ravel()).reshape(exists.shape) - 1
        self.rows = int(exists.sum())
        self.knot = np.broadcast_to(np.arange(len(kinds))[:, None], exists.shape)[exists]
        parts = []
        for side, segment, chord, sign in ((0, left, a, 1.0), (1, right, b, -1.0)):
            knot, slot = np.nonzero(orders[:, side] >= 0)
            order = orders[knot, side, slot]
            factor = sign * (weight / chord)[knot] ** order
            parts.append((row[knot, slot], segment[knot], 4 * (1 - side) + order, factor))
        self.row, self.segment, self.value, self.factor = (np.concatenate(p) for p in zip(*parts, strict=True))
        is_angle = np.zeros(self.rows, dtype=bool)
        is_angle[self.row[self.value % 4 == 0]] = True
        self.is_angle = is_angle
        self.constant = np.where(is_angle, self.turns[self.knot], 0.0)

    def _places(self, closed: bool) -> None:
        """Where each derivative goes in the band matrix."""
        m = len(self.chords)
        if closed:  # 0, m − 1, 1, m − 2, … for segments; knots 0, 1, m − 1, 2, …
            fold = np.empty(m, dtype=np.int64)
            fold[0::2] = np.arange((m + 1) // 2)
            fold[1::2] = m - 1 - np.arange(m // 2)
            segment_place = np.argsort(fold)
            knots = np.empty(m, dtype=np.int64)
            knots[0] = 0
            knots[1::2] = np.arange(1, m // 2 + 1)
            knots[2::2] = m - np.arange(1, (m + 1) // 2)
            knot_place = np.argsort(knots)
        else:
            segment_place, knot_place = np.arange(m), np.arange(m + 1)
        owner = np.broadcast_to(np.arange(m)[:, None], (m, 4))[self.used]
        order = np.lexsort((np.arange(self.unknowns), segment_place[owner]))
        self._to_unknown = order  # band column → unknown
        column_place = np.empty(self.unknowns, dtype=np.int64)
        column_place[order] = np.arange(self.unknowns)
        self._to_row = np.lexsort((np.arange(self.rows), knot_place[self.knot]))
        row_place = np.empty(self.rows, dtype=np.int64)
        row_place[self._to_row] = np.arange(self.rows)
        term, parameter = np.nonzero(self.used[self.segment])
        rows = row_place[self.row[term]]
        columns = column_place[self._column[self.segment[term], parameter]]
        self._lower, self._upper = int(max(np.max(rows - columns), 0)), int(max(np.max(columns - rows), 0))
        height = 2 * self._lower + self._upper + 1
        self._flat = columns * height + self._lower + self._upper + rows - columns  # into a band stored by columns
        self._entry = (self.segment[term] * kernel.WIDTH + 10 + 4 * self.value[term] + parameter, self.factor[term])
        self._height = height

    # --- values ---

    def middle(self, x: FloatArray) -> FloatArray:
        """(m, 4): k₀ … k₃ of every segment."""
        out = np.zeros(self.used.shape)
        out[self.used] = x
        return out

    def state(self, x: FloatArray, constant: FloatArray, wind: bool = False) -> KnotState | None:
        """Segments and residuals at x, or None where a segment cannot be computed; `wind`: without full turns of angles."""
        ends = self.ends(self.middle(x))
        if np.isnan(ends[:, 0]).any():
            return None
        miss = self.sums(ends) - constant
        return KnotState(x, ends, miss - self._full_turns(miss) if wind else miss)

    def ends(self, middle: FloatArray) -> FloatArray:
        """Rows of the kernel for k₀ … k₃, (m, 4); NaN where a segment cannot be computed."""
        out = np.empty((len(middle), kernel.WIDTH))
        kernel.segment_ends_batch(middle, out, np.empty(len(middle), dtype=np.int64))
        return out

    def sums(self, ends: FloatArray) -> FloatArray:
        """(rows,): the sum of factor × value over the terms of each row."""
        values: FloatArray = self.factor * ends[self.segment, 2 + self.value]
        return np.asarray(np.bincount(self.row, values, minlength=self.rows), dtype=np.float64)

    def windings(self, ends: FloatArray) -> FloatArray:
        """(rows,): by how many full turns, in radians, the angles of the segments differ from those of the polygon."""
        return self._full_turns(self.sums(ends) - self.constant)

    def _full_turns(self, miss: FloatArray) -> FloatArray:
        full = 2.0 * np.pi
        return np.where(self.is_angle, full * np.rint(miss / full), 0.0)

    def residual(self, ends: FloatArray) -> float:
        """Greatest miss of an equation, full turns left out."""
        return float(self.gaps(ends).max())

    def gaps(self, ends: FloatArray) -> FloatArray:
        """Greatest miss at each knot of the run, full turns left out."""
        out = np.zeros(int(self.knot.max()) + 1)
        np.maximum.at(out, self.knot, np.abs(self.sums(ends) - self.constant - self.windings(ends)))
        return out

    def meets(self, state: KnotState) -> bool:
        """Whether all residuals are rounding."""
        size = np.bincount(
            self.row, np.abs(self.factor * state.ends[self.segment, 2 + self.value]), minlength=self.rows
        )
        return bool((np.abs(state.miss) <= _TOLERANCE * (1.0 + size)).all())

    def factors(self, state: KnotState) -> _Factors | None:
        """The band matrix in triangular factors, as a function that solves; None if it is singular."""
        from scipy.linalg.lapack import dgbtrf, dgbtrs

        band = np.zeros(self.unknowns * self._height)
        entry, factor = self._entry
        band += np.bincount(self._flat, factor * state.ends.ravel()[entry], minlength=len(band))
        low, up = self._lower, self._upper
        lu, pivots, info = dgbtrf(band.reshape(-1, self._height).T, low, up, overwrite_ab=1)
        if info != 0:
            return None

        def solve(right: FloatArray) -> FloatArray:
            found, _ = dgbtrs(lu, low, up, right[self._to_row], pivots)
            out = np.empty_like(found)
            out[self._to_unknown] = found
            return np.asarray(out)

        return solve

    def size(self, step: FloatArray) -> float:
        """Euclidean norm of a step in radians."""
        return float(np.linalg.norm((step.T * self.radians).T))

    def turn(self, step: FloatArray) -> float:
        """The most by which a step can turn a tangent against the middle of its segment, radians."""
        sums = np.zeros(self.used.shape)
        sums[self.used] = np.abs(step * self.radians)
        return float(sums.sum(axis=1).max())

    # --- Newton's method ---

    def newton(self, x: FloatArray, constant: FloatArray, most: int = 60) -> KnotState | None:
        """Damped Newton's method for Σ factor × value = constant."""
        state = self.state(x, constant)
        factor = 1.0
        for _ in range(most):
            if state is None:
                return None
            solve = self.factors(state)
            if solve is None:
                return None
            step = -solve(state.miss)
            size = self.size(step)
            if not np.isfinite(size):
                return None
            self.iterations += 1
            if self.meets(state):
                better = self.state(state.x + step, constant)
                return better if better is not None and self.meets(better) else state
            factor = min(1.0, factor, _LARGEST_TURN / max(self.turn(step), 1e-300))
            while True:
                following = self.state(state.x + factor * step, constant)
                if following is not None:
                    rest = solve(following.miss)
                    new = self.size(rest)
                    if new <= (1.0 - 0.25 * factor) * size or self.meets(following):
                        # The length at which the second-order term is as large as the step (Deuflhard's prediction).
                        bend = self.size(-rest - (1.0 - factor) * step)
                        factor = min(1.0, max(factor, factor * factor * size / max(bend, 1e-300)))
                        break
                factor *= 0.5
                if factor < _LEAST_FACTOR:
                    return None
            state = following
        return None

    def wander(self, x: FloatArray, constant: FloatArray, most_turn: float, most: int = 40) -> KnotState | None:
        """Newton's steps, undamped but for tangents that turn by `most_turn` at most; full turns of angles are left out.

        Where no solution without loops is near this often falls on one with loops.
        """
        for _ in range(most):
            state = self.state(x, constant, wind=True)
            solve = self.factors(state) if state is not None else None
            if state is None or solve is None:
                return None
            if self.meets(state):
                return state
            step = -solve(state.miss)
            if not np.isfinite(step).all():
                return None
            self.iterations += 1
            x = state.x + min(1.0, most_turn / max(self.turn(step), 1e-300)) * step
        return None

    # --- following ---

    def follow(self, x: FloatArray, fixed: FloatArray, moving: FloatArray, most: int = 200) -> KnotState | None:
        """From a solution of Σ factor × value = fixed + share × moving at share 0 to one at 1, by pseudo-arc length."""
        state = self.state(x, fixed)
        share, length = 0.0, 0.5
        before = np.append(np.zeros(self.unknowns), 1.0)
        weights = np.append(self.radians, 1.0)
        for _ in range(most):
            if state is None:
                return None
            solve = self.factors(state)
            along = solve(moving) if solve is not None else None
            if along is None or not np.isfinite(along).all():
                return None
            tangent = np.append(along, 1.0) * weights
            tangent /= np.linalg.norm(tangent)
            if tangent @ before < 0.0:
                tangent = -tangent
            before = tangent
            while True:
                found = self._correct(state.x, share, tangent / weights, tangent * weights, length, fixed, moving)
                if found is not None:
                    break
                length *= 0.5
                if length < 1e-4:
                    return None
            following, new = found
            if (share - 1.0) * (new - 1.0) <= 0.0 and new != share:
                part = (1.0 - share) / (new - share)
                there = self.newton(state.x + part * (following.x - state.x), fixed + moving, most=20)
                if there is not None and self.size(there.x - state.x) < 4.0 * length + 0.5:
                    return there
            state, share = following, new
            length = min(1.5 * length, 2.0)
        return None

    def _correct(
        self,
        x: FloatArray,
        share: float,
        step: FloatArray,
        across: FloatArray,
        length: float,
        fixed: FloatArray,
        moving: FloatArray,
    ) -> tuple[KnotState, float] | None:
        """Newton's method on the residuals and the plane across the tangent, from `length` steps along it."""
        start, first = x, share
        x, share = x + length * step[:-1], share + length * step[-1]
        last = np.inf
        for _ in range(8):
            state = self.state(x, fixed + share * moving)
            solve = self.factors(state) if state is not None else None
            if state is None or solve is None:
                return None
            self.iterations += 1
            both = solve(np.stack([state.miss, moving], axis=1))
            if not np.isfinite(both).all():
                return None
            plane = across[:-1] @ (x - start) + across[-1] * (share - first) - length
            one, two = both[:, 0], both[:, 1]
            # x moves by −one + d·two while share moves by d.
            d = -(plane - across[:-1] @ one) / (across[-1] + across[:-1] @ two)
            move = d * two - one
            size = float(np.hypot(self.size(move), d))
            x, share = x + move, share + d
            if size > 0.5 * last or size > length:
                return None
            if size < 1e-7:
                state = self.state(x, fixed + share * moving)
                return None if state is None else (state, share)
            last = size
        return None
