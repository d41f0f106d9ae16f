"""Minimum curves: least ∫κ² ds or ∫κ′² ds, or their scale-invariant forms, on quintic elements (Moreton1995)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from batten.curves.base import Curve
from batten.curves.piecewise import PiecewiseCurve
from batten.curves.quintic import QuinticHermite
from batten.errors import InvalidInputError
from batten.splines.chain_start import ChainStart, closed_start, spiral_start
from batten.splines.element_chain import (
    ENERGIES,
    ElementChain,
    Energy,
    element_chain,
    energies,
    halved,
    hermite_data,
    sizes_of,
    state_of,
    state_of_rows,
)
from batten.splines.energy_descent import HOLD, METHODS, Descent, Method, Status, conjugate_gradients, newton
from batten.splines.interpolating_spline import check_points
from batten.typing import ArrayLike, BoolArray, FloatArray

_FIRST, _MOST = 2, 32  # elements between points where their number is left open
_SETTLED = 1e-9  # change of the energy by the last doubling, over 1 + energy in units of the curve's length


@dataclass(frozen=True, eq=False)
class MinimumCurve:
    """A curve of least energy on quintic elements, or where the descent to it ended.

    Attributes:
        kind: "mec", "mvc", "si-mec" or "si-mvc".
        closed: whether the last piece leads back to the first.
        pieces: the elements. elements: how many of them between two points (or altogether, without points).
        status: "converged"; "escaped": there is no minimum, the curve grew beyond 20 times its start while its energy fell;
            "iteration limit"; "stuck": no step lowers the energy any more though the gradient is not small.
        message: what happened, in words; empty if nothing did.
        energy: what was to be least: 1/length for "mec", 1/length³ for "mvc", pure numbers for the others.
        length: ∫ds. bending: ∫κ² ds, 1/length. variation: ∫κ′² ds within the elements, 1/length³.
        turning: ∫κ ds/2π, a whole number for a closed curve.
        gradient: greatest component of the gradient, each unknown in its own size and lengths over that of the start.
        minimum: whether the Hessian is positive, but for what leaves the curve as it is.
        iterations, evaluations: of all descents together.
        quadrature_error: change of the energy when every element is integrated in two halves, over 1 + energy, in units of
            the start's length.
        history: (elements, energy) of each descent, in order.
    """

    kind: Energy
    closed: bool
    pieces: tuple[QuinticHermite, ...]
    elements: int
    status: Status
    message: str
    energy: float
    length: float
    bending: float
    variation: float
    turning: float
    gradient: float
    minimum: bool
    iterations: int
    evaluations: int
    quadrature_error: float
    history: tuple[tuple[int, float], ...]

    @cached_property
    def curve(self) -> PiecewiseCurve:
        """The whole as one curve."""
        return PiecewiseCurve(self.pieces)

    @property
    def scale_invariant_bending(self) -> float:
        """L∫κ² ds; 4π² for a circle."""
        return self.length * self.bending

    @property
    def scale_invariant_variation(self) -> float:
        """L³∫κ′² ds; 0 for a circle."""
        return self.length**3 * self.variation


def minimum_curve(
    points: ArrayLike,
    energy: Energy = "mvc",
    *,
    closed: bool = False,
    tangents: ArrayLike | None = None,
    curvatures: ArrayLike | None = None,
    start_angles: ArrayLike | None = None,
    elements: int | None = None,
    method: Method = "newton",
) -> MinimumCurve:
    """The curve through points with the least energy that a descent reaches (Moreton1995 §2, §3).

    Definition: "mec" has the least ∫κ² ds, "mvc" ∫κ′² ds, "si-mec" L∫κ² ds, "si-mvc" L³∫κ′² ds. The curve is a chain of
    quintics, as many between two points as `elements` says; they share position, tangent and curvature, but for the
    curvature of a MEC where the tangent is held. All
    that is not given is unknown; ends that are free are those of least energy (κ = 0 for κ², κ′ = κ″ = 0 for κ′²).

    Parameters:
        points: shape (n, 2), n ≥ 2 (3 if closed), neighbours not the same; any unit of length.
        energy: which energy.
        closed: whether the curve returns to the first point, which is not repeated.
        tangents: (n,), angles of the tangents in radians, NaN where free.
        curvatures: (n,), curvatures in 1/length, NaN where free; not for "mec" and "si-mec", which cannot hold them.
        start_angles: (n,), angles of the tangents at the start of the descent only, NaN: those of the Euler spiral spline.
            They decide which of several minima is found.
        elements: between two points, 1 to 256; None: 2, then twice as many until the energy has settled, 32 at the most.
        method: "newton": exact Hessian, tens of steps; "cg": conjugate gradients as in the paper, hundreds or thousands.

    Returns:
        A `MinimumCurve`. Where there is no minimum its status is "escaped" and its shape that at which this was noticed.

    Raises:
        InvalidInputError: shapes, values that are not finite, equal neighbours, unknown words, curvatures for a MEC.

    Accuracy:
        "newton" ends where a further step would gain less than 1e-11 × (1 + energy), in units of the start's length, or ten
        steps together less than 1e-10. What hardly changes the curve, how fast it is run through, is held by a term of
        1e-7 of the energy, which is not counted. Errors: docs/minimum-curves.md. "cg" ends at gradients of 1e-5 ×
        (1 + energy of the start), which may be early, or after 5000 steps.
    Degenerate cases:
        Points on a line in order: the line, energy 0. Points on a circle: the circle, but for "mec".

    Example:
        >>> horn = minimum_curve([[-1, 0], [1, 0]], "mvc", tangents=[np.pi / 2, -np.pi / 2])
        >>> horn.status, round(float(horn.curve.point(0.5)[1]), 6), bool(horn.energy < 1e-9)
        ('converged', 1.0, True)
    """
    own = check_points(points, closed)
    _check_words(energy, method, elements, 1)
    held_angles = _per_point("tangents", tangents, len(own))
    held_curvatures = _per_point("curvatures", curvatures, len(own))
    hints = _per_point("start_angles", start_angles, len(own))
    if energy.endswith("mec") and np.isfinite(held_curvatures).any():
        raise InvalidInputError(
            f"energy {energy!r} cannot hold a curvature at a point, since its curvature may jump there; take 'mvc' "
            "or 'si-mvc'"
        )
    count = _FIRST if elements is None else int(elements)
    angles = np.where(np.isfinite(held_angles), held_angles, hints)
    shared = np.isnan(held_angles) | energy.endswith("mvc")
    start = spiral_start(own, closed, angles, held_curvatures, count, shared)
    fixed = np.zeros((len(start.angles), 3), dtype=bool)
    fixed[::count, 0] = True
    fixed[::count, 1] = np.isfinite(held_angles)
    fixed[::count, 2] = np.isfinite(held_curvatures)
    most = _MOST if elements is None else count
    return _descended(energy, closed, fixed, start, count, most, method)


def minimum_closed_curve(
    start: Curve, energy: Energy = "si-mvc", *, elements: int = 32, method: Method = "newton"
) -> MinimumCurve:
    """The closed curve of least energy that is reached from a given one, held by nothing (Moreton1995 §5).

    Definition: as `minimum_curve`, without points. The turning number of the start is kept as long as no cusp is crossed.

    Parameters:
        start: a closed curve with a tangent that is continuous, also where it closes.
        energy: scale-invariant ones have minima of every turning number; "mec" escapes, "mvc" unless it ends as a circle.
        elements: of the whole, 3 to 4096, at equal lengths of the start.
        method: as `minimum_curve`.

    Returns:
        A `MinimumCurve`. Its place, direction and, where the energy is scale-invariant, size come from the start.

    Raises:
        InvalidInputError: an open start or one with a corner where it closes, a length of 0, unknown words.

    Accuracy:
        As `minimum_curve`.
    Degenerate cases:
        A start of so few elements that neighbours turn by more than π has another turning number on the elements.

    Example:
        >>> from batten.curves.spiral import Spiral
        >>> ring = minimum_closed_curve(Spiral([0, 0], 0.0, [1.0], 2.0 * np.pi), "si-mec", elements=8)
        >>> ring.status, round(ring.energy / np.pi**2, 6), round(ring.turning, 9)
        ('converged', 4.0, 1.0)
    """
    _check_words(energy, method, elements, 3)
    chain = closed_start(start, int(elements))
    fixed = np.zeros((elements, 3), dtype=bool)
    return _descended(energy, True, fixed, chain, int(elements), int(elements), method)


def _check_words(energy: str, method: str, elements: int | None, least: int) -> None:
    if energy not in ENERGIES:
        raise InvalidInputError(f"energy = {energy!r}; allowed are {', '.join(ENERGIES)}")
    if method not in METHODS:
        raise InvalidInputError(f"method = {method!r}; allowed are {', '.join(METHODS)}")
    most = 256 if least == 1 else 4096
    if elements is not None and (
        isinstance(elements, bool) or elements != int(elements) or not least <= elements <= most
    ):
        raise InvalidInputError(f"elements = {elements!r}; allowed are whole numbers from {least} to {most}")


def _per_point(name: str, given: ArrayLike | None, n: int) -> FloatArray:
    """One number for each point, NaN where nothing is given."""
    if given is None:
        return np.full(n, np.nan)
    out = np.array(given, dtype=np.float64)
    if out.shape != (n,) or np.isinf(out).any():
        raise InvalidInputError(
            f"{name}: one number for each of the {n} points is wanted, NaN where it is free; got shape {out.shape}"
            + (", with infinite numbers" if np.isinf(out).any() else "")
        )
    return out


def _descended(
    energy: Energy, closed: bool, fixed: BoolArray, start: ChainStart, count: int, most: int, method: Method
) -> MinimumCurve:
    """The descent, with twice as many elements until the energy has settled or `most` are reached; whole at unit length."""
    unit = float(start.sizes.sum())
    middle = start.points.mean(axis=0)
    sizes = start.sizes / unit
    state = state_of((start.points - middle) / unit, start.angles, start.curvatures * unit, sizes)
    history: list[tuple[int, float]] = []
    ends: list[Descent] = []
    while True:
        chain = element_chain(energy, closed, fixed, sizes)
        chain = replace(chain, hold=HOLD * (1.0 + chain.evaluate(state, 0).value))
        end = newton(chain, state) if method == "newton" else conjugate_gradients(chain, state)
        ends.append(end)
        value = chain.total(chain.rows(end.state))
        history.append((count, value))
        before = history[-2][1] if len(history) > 1 else math.inf
        settled = abs(before - value) <= _SETTLED * (1.0 + value)
        if end.status != "converged" or settled or 2 * count > most:
            break
        rows = halved(chain.rows(end.state))
        fixed, count = _doubled(fixed, closed), 2 * count
        sizes = sizes_of(rows)
        state = state_of_rows(rows, closed)
    missing = not settled and len(history) > 1
    change = abs(before - value) / (1.0 + value) if missing else 0.0
    return _result(chain, closed, ends, history, middle, unit, count, change)


def _doubled(fixed: BoolArray, closed: bool) -> BoolArray:
    """What is held when a free vertex stands in the middle of every element."""
    out = np.zeros((2 * len(fixed) if closed else 2 * len(fixed) - 1, 3), dtype=bool)
    out[::2] = fixed
    return out


def _result(
    chain: ElementChain,
    closed: bool,
    ends: list[Descent],
    history: list[tuple[int, float]],
    middle: FloatArray,
    unit: float,
    count: int,
    change: float,
) -> MinimumCurve:
    """The answer, in the units of the points."""
    last = ends[-1]
    rows = chain.rows(last.state)
    value = history[-1][1]
    finer = chain.total(halved(rows))
    pieces = []
    for row in rows:
        data = unit * hermite_data(row)
        data[[0, 5]] += middle
        pieces.append(QuinticHermite(data))
    length, bending, variation, turning = energies(rows)
    factor = 1.0 if chain.energy.startswith("si-") else unit**-chain.power
    return MinimumCurve(
        chain.energy,
        closed,
        tuple(pieces),
        count,
        last.status,
        _message(chain.energy, last, change, count),
        factor * value,
        unit * length,
        bending / unit,
        variation / unit**3,
        turning,
        last.gradient,
        last.minimum,
        sum(end.iterations for end in ends),
        sum(end.evaluations for end in ends),
        abs(finer - value) / (1.0 + value),
        tuple((n, factor * v) for n, v in history),
    )


def _message(energy: Energy, last: Descent, change: float, count: int) -> str:
    if last.status == "escaped":
        stable = "" if energy.startswith("si-") else f", or take 'si-{energy}', which does not gain by growing"
        return (
            f"the curve escapes: after {last.iterations} steps it is more than 20 times as long as at the start and its "
            f"energy still falls; hold it with more points or with tangents{stable}"
        )
    if last.status == "iteration limit":
        return (
            f"no minimum within {last.iterations} steps; the greatest component of the gradient is {last.gradient:.2g}"
        )
    if last.status == "stuck":
        return (
            f"no step lowers the energy any more, though the greatest component of the gradient is {last.gradient:.2g}; a "
            "cusp may be in the way: start from other tangents, or take more elements"
        )
    if change > 0.0:
        return f"with {count} elements between points the energy still changed by {change:.2g} of its value"
    return (
        ""
        if last.minimum
        else "the Hessian is not positive where the descent ended: a saddle, or not quite at rest; more elements tell"
    )
