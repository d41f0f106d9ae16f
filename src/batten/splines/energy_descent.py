"""Descent of the energy of a chain of elements: Newton's method with a band Hessian, or conjugate gradients."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.optimize import minimize

from batten.splines.element_chain import ElementChain, Evaluation
from batten.typing import FloatArray

Method = Literal["newton", "cg"]
METHODS: tuple[Method, ...] = get_args(Method)
Status = Literal["converged", "escaped", "iteration limit", "stuck"]

_NEWTON_STEPS, _GRADIENT_STEPS = 1000, 5000
_DECREMENT = 1e-11  # what another Newton step would gain, over 1 + energy
_GRADIENT = 1e-5  # of conjugate gradients: greatest component over 1 + energy
_STEPS_ALIKE = 10  # steps that together gain less than ten times as much: the descent is over
_CORRECTIONS = 4
_STIFF = 0.1  # shift of corrections, over the diagonal of the Hessian
_ESCAPED = 20.0  # lengths of the start
HOLD = 1e-7  # of what holds the parameter, over 1 + energy
_ZERO = 1e-9  # an energy in units of the start's length, below which none is left
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Descent:
    """Where a descent ended.

    Attributes:
        state: of the chain.
        status: "converged"; "escaped": longer than 20 times the start, and still falling; "iteration limit"; "stuck": no
            step lowers the energy, though it should.
        gradient: greatest component, each unknown in its own size, lengths over that of the start.
        iterations, evaluations: steps, and values of energy or gradient or both.
        minimum: the Hessian has no direction downwards.
    """

    state: FloatArray
    status: Status
    gradient: float
    iterations: int
    evaluations: int
    minimum: bool


class _Shifted:
    """(H + shift) s = b for a positive definite left side; `ok` says whether it is."""

    def __init__(self, here: Evaluation, shift: float) -> None:
        band = here.band.copy()
        band[0] += shift
        self.ok = True
        try:
            self._factor = cholesky_banded(band, lower=True, check_finite=False)
        except LinAlgError:
            self.ok = False
            return
        self._low = None
        if here.low_rank is not None:
            u, c = here.low_rank
            z = cho_solve_banded((self._factor, True), u, check_finite=False)
            m = np.linalg.inv(c) + u.T @ z
            # The Hessian is positive definite if m has the signs of C⁻¹, one of each (Haynsworth's inertia formula).
            self.ok = bool(np.linalg.det(m) < 0.0)
            self._low = (u, z, m)

    def solve(self, b: FloatArray) -> FloatArray:
        s = cho_solve_banded((self._factor, True), b, check_finite=False)
        if self._low is not None:
            u, z, m = self._low
            s = s - z @ np.linalg.solve(m, u.T @ s)
        return np.asarray(s)


def newton(chain: ElementChain, state: FloatArray) -> Descent:
    """Newton's method with the exact Hessian, shifted so far that every step goes down and is believed."""
    here = chain.evaluate(state, 2)
    start, size, shift, evaluations = here.length, here.length, 1e-2 * _typical(here), 1
    limits = _Limits(chain)
    status: Status = "iteration limit"
    steps, passed = 0, [chain.total(chain.rows(state))]
    for steps in range(_NEWTON_STEPS + 1):
        if len(chain.free) == 0 or here.value == 0.0:
            status = "converged"
            break
        if here.length > _ESCAPED * start:
            status = "escaped"
            break
        if len(passed) > _STEPS_ALIKE and abs(passed[-1 - _STEPS_ALIKE] - passed[-1]) <= 10.0 * _DECREMENT * (
            1.0 + here.value
        ):
            status = "converged"
            break
        if steps == _NEWTON_STEPS:
            break
        least = 10.0 * _EPS * float(here.band[0].max())
        accepted = False
        while shift < 1e12 * _typical(here):
            solver = _Shifted(here, shift)
            if not solver.ok:
                shift = max(4.0 * shift, least)
                continue
            step = solver.solve(-here.gradient)
            gain = -float(here.gradient @ step)
            small = shift <= max(1e-9 * _typical(here), 64.0 * least)
            if gain <= _DECREMENT * (1.0 + here.value) and small:
                status = "converged"
                break
            factor = limits.share(chain, state, step, here.length)
            curve = gain - shift * float(step @ step)
            predicted = factor * gain - 0.5 * factor**2 * curve
            moved, there, cost = _with_corrections(
                chain, chain.moved(state, factor * step), here, shift, predicted, limits
            )
            evaluations += cost
            ratio = (here.value - there.value) / predicted
            # Gains below rounding tell nothing of the model: the step is taken if it does no harm.
            noise = 64.0 * _EPS * (here.value + 1e-3)
            if ratio > 1e-3 or (predicted < noise and there.value <= here.value + noise):
                state, here, accepted = moved, chain.evaluate(moved, 2), True
                passed.append(chain.total(chain.rows(state)))
                chain, here = _held_less(chain, state, here)
                if here.length > 2.0 * size:
                    typical, size = _typical(here), here.length
                    chain = chain.resized(state)
                    here = chain.evaluate(state, 2)
                    shift *= _typical(here) / typical
                if ratio > 0.7 or predicted < noise:
                    shift = max(0.1 * shift, 1e-3 * least)
                elif ratio < 0.3:
                    shift *= 3.0
                break
            shift = max(4.0 * shift, least)
        if status == "converged":
            break
        if not accepted:
            status = "stuck"
            break
    gradient = float(np.abs(here.gradient).max(initial=0.0))
    return Descent(state, status, gradient, steps, evaluations, status == "converged" and is_minimum(chain, state))


def _held_less(chain: ElementChain, state: FloatArray, here: Evaluation) -> tuple[ElementChain, Evaluation]:
    """The parameter is held in proportion to the energy, also where that falls by orders of magnitude."""
    if chain.hold <= 10.0 * HOLD * (1.0 + here.value):
        return chain, here
    chain = replace(chain, hold=HOLD * (1.0 + here.value))
    return chain, chain.evaluate(state, 2)


def _with_corrections(
    chain: ElementChain, state: FloatArray, here: Evaluation, shift: float, predicted: float, limits: _Limits
) -> tuple[FloatArray, Evaluation, int]:
    """A trial, and where it disappoints better ones by steps with the same factors; also how many evaluations were spent.

    A vertex that slides along the curve costs next to nothing, but a straight step leaves the curve, which costs much:
    such steps lead back to it (Shamanskii's way), so that the next Newton step need not be short.
    """
    there = chain.evaluate(state, 1)
    spent = 1
    stiff = None
    while spent <= _CORRECTIONS and math.isfinite(there.value) and here.value - there.value < 0.7 * predicted:
        stiff = stiff or _Shifted(here, max(_STIFF * _typical(here), shift))
        if not stiff.ok:
            break
        step = stiff.solve(-there.gradient)
        moved = chain.moved(state, limits.share(chain, state, step, there.length) * step)
        other = chain.evaluate(moved, 1)
        spent += 1
        if not other.value < there.value:
            break
        state, there = moved, other
    return state, there, spent


def conjugate_gradients(chain: ElementChain, state: FloatArray) -> Descent:
    """Conjugate gradients after Polak and Ribière, as in Moreton1995 §3.3."""
    start = chain.evaluate(state, 1)
    x = np.zeros(len(chain.free))
    escaped = False

    def value(step: FloatArray) -> tuple[float, FloatArray]:
        there = chain.evaluate(chain.moved(state, step), 1)
        return (there.value, there.gradient) if math.isfinite(there.value) else (1e300, there.gradient)

    def watch(step: FloatArray) -> None:
        nonlocal escaped, x
        x = np.array(step)
        if chain.evaluate(chain.moved(state, x), 0).length > _ESCAPED * start.length:
            escaped = True
            raise StopIteration

    if len(chain.free) == 0:
        return Descent(state, "converged", 0.0, 0, 1, True)
    tolerance = _GRADIENT * (1.0 + start.value)
    found = minimize(
        value, x, jac=True, method="CG", callback=watch, options={"gtol": tolerance, "maxiter": _GRADIENT_STEPS}
    )
    state = chain.moved(state, found.x if not escaped else x)
    here = chain.evaluate(state, 2)
    gradient = float(np.abs(here.gradient).max())
    status: Status = "converged" if gradient <= tolerance else "stuck"
    if escaped:
        status = "escaped"
    elif found.nit >= _GRADIENT_STEPS:
        status = "iteration limit"
    return Descent(
        state, status, gradient, int(found.nit), int(found.nfev), status != "escaped" and is_minimum(chain, state)
    )


def is_minimum(chain: ElementChain, state: FloatArray) -> bool:
    """Whether the Hessian is positive but for what is below 0.1 of the energy for a movement by the curve's length.

    In its own size an unknown of an element of n moves the curve by 1/n of its length over 1/n of it. Movements of the
    whole change nothing, so that 0 is allowed; the parameter is held by 0.1 of the energy, so that vertices which slide
    do not count. An energy of 0 is the least.
    """
    value = chain.total(chain.rows(state))
    if len(chain.free) == 0 or value < _ZERO:
        return True
    here = replace(chain, hold=0.1 * (1.0 + value)).evaluate(state, 2)
    n = len(chain.index)
    return _Shifted(here, max(0.1 * (1.0 + value) / n**3, 50.0 * _EPS * float(here.band[0].max()))).ok


def _typical(here: Evaluation) -> float:
    diagonal = np.abs(here.band[0])
    return float(np.median(diagonal)) + 1e-12 * float(diagonal.max()) + 1e-300


class _Limits:
    """How far one step may go, so that the shape stays that of the start."""

    def __init__(self, chain: ElementChain) -> None:
        places = (np.flatnonzero(np.isin(chain.free, chain.index[:, [k, k + 6]])) for k in range(6))
        x, y, self._angles, self._curvatures, self._speeds, self._changes = places
        self._positions = np.concatenate([x, y])

    def share(self, chain: ElementChain, state: FloatArray, step: FloatArray, length: float) -> float:
        """The share of a step for which no vertex moves by more than 0.3 lengths of the curve, no tangent turns by more
        than 0.6, no √speed changes by more than half, and no κ (times the element's size) and α by more than 2."""
        change = chain.scale * step
        return 1.0 / max(
            1.0,
            _greatest(change[self._positions]) / (0.3 * length),
            _greatest(step[self._angles]) / 0.6,
            _greatest(change[self._speeds] / state[chain.free[self._speeds]]) / 0.5,
            _greatest(step[self._curvatures]) / 2.0,
            _greatest(step[self._changes]) / 2.0,
        )


def _greatest(values: FloatArray) -> float:
    return float(np.abs(values).max(initial=0.0))
