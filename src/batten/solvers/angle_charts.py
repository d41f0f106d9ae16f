"""The families of elastica among which `angle_constrained` searches, one unknown each, and all roots of a function of it.

With ψ = θ − arg(force) and the number of inflections and the sign of the first curvature fixed, one unknown is left: where
on the rectangular elastica the curve begins (MEC), or the modulus (SI-MEC). The ends' distance from the turning points ±ψₘ
of the pendulum, or k's from its bounds, is w/(1 + exp ∓2x): in x nothing happens at scales other than 1, nor at the bounds.
The curves' lengths and displacements are Carlson's integrals R_F and R_D.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.special import elliprd, elliprf

from batten.typing import FloatArray

SCAN = np.linspace(-40.0, 40.0, 801)
"""The grid of x: distances from the bounds down to exp(−80) of what there is."""
FLAT = 2e-3
"""Curves shorter than this, in units of λ^(−1/2), lie within so many radians of their chord and are left to the cubic."""
_TOUCH = 1e-12  # of a function of order 1 that touches zero, or meets it at its bound
_Function = Callable[[FloatArray], FloatArray]
_Phase = tuple[FloatArray, FloatArray]


def reduced(angle: float) -> float:
    """An angle brought to (−π, π]."""
    return float(angle - 2 * np.pi * np.ceil(angle / (2 * np.pi) - 0.5))


def charts_of(turn: float, most: int) -> Iterator[tuple[int, int]]:
    """(number of inflections, 0 if the first curvature is positive, else 1) of every curve with inflections on its line."""
    if turn > 0.0:
        yield 0, 0
    for count in range(1, int(most) + 1):
        yield count, 0
        yield count, 1


class Start(NamedTuple):
    """A curve with turn ≥ 0 in free scale: κ₀, λ, length, chord, and the chord's angle to the force."""

    kappa: float
    lam: float
    length: float
    chord: float
    along: float


def _half_wave(below: FloatArray, above: FloatArray, rest: FloatArray, k: FloatArray) -> FloatArray:
    """F, ∫cos ψ ds and cn from the wave's crest to ψ = below − above, where below + above = 2 arcsin k = π − 2 rest."""
    sine = np.sin(0.5 * (below - above)) / k
    c2 = np.maximum(np.sin(below) * np.sin(above), 0.0) / k**2
    d2 = np.sin(rest + np.minimum(below, above)) ** 2
    arc = sine * elliprf(c2, d2, 1.0)
    return np.stack([arc, arc - 2.0 / 3.0 * k**2 * sine**3 * elliprd(c2, d2, 1.0), np.sqrt(c2)])


def _wave(ends: list[_Phase], rest: FloatArray, k: FloatArray, count: int, sign: int) -> FloatArray:
    """(length, X, Y, κ₀) for λ = 1 between the phases `ends` (below, above), with `count` inflections between."""
    quarter = _half_wave(np.pi - 2.0 * rest, np.zeros_like(rest), rest, k)
    (f0, x0, c0), (f1, x1, c1) = (_half_wave(*end, rest, k) for end in ends)
    last = sign * (-1) ** count
    arc, x = (last * b - sign * a + 2 * count * q for a, b, q in ((f0, f1, quarter[0]), (x0, x1, quarter[1])))
    return np.stack([arc, x, 2.0 * k * (sign * c0 - last * c1), 2.0 * k * sign * c0])


class Rectangular:
    """MEC: where on the rectangular elastica a curve of given turn begins."""

    def __init__(self, turn: float, count: int, cell: int) -> None:
        self.turn, self.count, self.sign = turn, count, 1 - 2 * cell

    def grid(self) -> FloatArray:
        return SCAN if self.turn < np.pi - 1e-12 else np.zeros(1)

    def _at(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        room = max(0.5 * np.pi - 0.5 * self.turn, 0.0)
        below, above = room / (1.0 + np.exp(-2.0 * x)), room / (1.0 + np.exp(2.0 * x))
        rest, k = np.full_like(x, 0.25 * np.pi), np.full_like(x, np.sqrt(0.5))
        half = 0.5 * self.turn
        ends = [(below, above + half), (below + half, above)]
        return below - above - half, _wave(ends, rest, k, self.count, self.sign)

    def lean(self, x: FloatArray) -> FloatArray:
        """(α₀ + α₁)/2; X = ½∫κ² ds is positive."""
        psi, (_, dx, dy, _) = self._at(x)
        lean: FloatArray = psi + 0.5 * self.turn - np.arctan2(dy, dx)
        return lean

    def start(self, x: float) -> Start | None:
        _, (length, dx, dy, kappa) = self._at(np.array([x]))
        if length[0] < FLAT:
            return None
        return Start(kappa[0], 1.0, length[0], np.hypot(dx[0], dy[0]), np.arctan2(dy[0], dx[0]))


class Upright:
    """SI-MEC with inflections on its line: ψ₀ is known, since the force is perpendicular to the chord; x says k."""

    def __init__(self, psi0: float, turn: float, up: int, count: int, cell: int) -> None:
        self.psi, self.up, self.count, self.sign = (psi0, psi0 + turn), up, count, 1 - 2 * cell

    def _at(self, x: FloatArray) -> FloatArray:
        least = 0.5 * max(abs(self.psi[0]), abs(self.psi[1]))
        more, rest = ((0.5 * np.pi - least) / (1.0 + np.exp(2.0 * side * x)) for side in (-1.0, 1.0))
        ends = [(least + 0.5 * p + more, least - 0.5 * p + more) for p in self.psi]
        return _wave(ends, rest, np.sin(least + more), self.count, self.sign)

    def along(self, x: FloatArray) -> FloatArray:
        """The displacement along the force over the length, which has to vanish."""
        length, dx, _, _ = self._at(x)
        share: FloatArray = np.divide(dx, length, out=np.full_like(dx, np.nan), where=length > 1e-12)
        return share

    def start(self, x: float) -> Start | None:
        length, _, dy, kappa = self._at(np.array([x]))[:, 0]
        if length < FLAT or -self.up * dy < 1e-9 * length:
            return None
        return Start(kappa, 1.0, length, abs(dy), -0.5 * np.pi * self.up)


class Turning:
    """SI-MEC without inflections: κ²/4 = 1 + w cos ψ with w = tanh x, in units that leave the circle w = 0 regular."""

    def __init__(self, psi0: float, turn: float) -> None:
        self.psi, self.turn = psi0, turn

    def _at(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        turned = np.where(x < 0.0, np.pi, 0.0)  # the force the other way
        mc = np.exp(-2.0 * np.abs(x))
        quarter, quarter_sn = elliprf(0.0, mc, 1.0), elliprd(0.0, mc, 1.0) / 3.0
        arc, sn = np.zeros_like(x), np.zeros_like(x)
        speed, cosine = [], []
        for sign, psi in ((-1.0, self.psi + turned), (1.0, self.psi + self.turn + turned)):
            half_turns = np.floor(0.5 * psi / np.pi + 0.5)
            s, c2 = np.sin(0.5 * psi - np.pi * half_turns), np.cos(0.5 * psi) ** 2
            d2 = c2 + mc * s * s
            arc += sign * (s * elliprf(c2, d2, 1.0) + 2.0 * quarter * half_turns)
            sn += sign * (s**3 * elliprd(c2, d2, 1.0) / 3.0 + 2.0 * quarter_sn * half_turns)
            speed.append(np.sqrt(d2))
            cosine.append(np.cos(psi))
        dy = (cosine[0] - cosine[1]) / (speed[0] + speed[1])
        return self.psi + turned, np.stack([arc, arc - 2.0 * sn, dy, 2.0 * speed[0]])

    def along(self, x: FloatArray) -> FloatArray:
        """As `Upright.along`, for the force at −π/2 to the chord."""
        _, (length, dx, _, _) = self._at(x)
        share: FloatArray = np.where(x < 0.0, -dx, dx) / length
        return share

    def start(self, x: float) -> Start | None:
        _, (length, _, dy, kappa) = self._at(np.array([x]))
        chord = float(np.copysign(1.0, x) * dy[0]) if x != 0.0 else float(dy[0])
        if chord < 1e-9 * length[0]:
            return None
        along = np.where(x < 0.0, -0.5 * np.pi, 0.5 * np.pi)
        return Start(kappa[0], -np.expm1(-2.0 * abs(x)), length[0], chord, float(along))


def near_the_chord(turn: float, lean: float, *, rail: bool) -> list[Start]:
    """The cubic between tangents that are nearly those of the chord, as a start; `rail` for the SI-MEC."""
    first, last = lean - 0.5 * turn, lean + 0.5 * turn
    if max(abs(first), abs(last)) > 5.0 * FLAT:
        return []
    kappa, slope = -4.0 * first - 2.0 * last, 6.0 * (first + last)  # slope = −force × tangent
    ahead = 0.0 if rail else 0.5 * kappa**2
    return [Start(kappa, float(np.hypot(slope, ahead)), 1.0, 1.0, -float(np.arctan2(slope, ahead)))]


def rectangular_reach(turn: float, most: int) -> float:
    """The greatest lean of the MECs of this turn with at most so many inflections; nan if there is none.

    With one inflection it is greatest, and then the first curvature may be taken as negative.
    """
    if turn >= np.pi - 1e-12:
        return 0.0
    charts = [Rectangular(turn, n, n) for n in range(0, min(int(most), 1) + 1) if n > 0 or turn > 0.0]
    return max([highest(chart.lean, SCAN)[1] for chart in charts], default=float("nan"))


# --- roots of a function of one number ---


def roots(function: _Function, grid: FloatArray, level: float = 0.0) -> list[float]:
    """All x at which a function takes the value `level`, within the grid, where it touches it and at the bounds too."""
    y = function(grid) - level
    zero = np.abs(y) < _TOUCH
    runs = np.flatnonzero(zero & ~np.concatenate([[False], zero[:-1]]))  # of points on the level, the first
    found = [float(grid[i]) for i in runs]
    sides = np.sign(y) * np.where(zero, 0.0, 1.0)
    crossed = np.flatnonzero(sides[:-1] * sides[1:] < 0.0)
    brackets = [(float(grid[i]), float(grid[i + 1])) for i in crossed]
    steps = np.abs(np.diff(y))
    near = np.abs(y[1:-1]) <= np.minimum(np.minimum(np.abs(y[:-2]), np.abs(y[2:])), np.maximum(steps[:-1], steps[1:]))
    alike = (sides[1:-1] != 0.0) & (sides[1:-1] == sides[:-2]) & (sides[1:-1] == sides[2:])
    for i in np.flatnonzero(near & alike) + 1:  # it may touch the level between two points, or cross it twice

        def beyond(x: FloatArray, side: float = float(sides[i])) -> FloatArray:
            return side * (level - function(x))

        x, best = highest(beyond, grid[i - 1 : i + 2])
        if best >= _TOUCH:
            brackets += [(float(grid[i - 1]), x), (x, float(grid[i + 1]))]
        elif best > -_TOUCH:
            found.append(x)
    if brackets:
        low, high = np.array(brackets).T
        falling = function(low) > level
        for _ in range(52):
            middle = 0.5 * (low + high)
            before = (function(middle) > level) == falling
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        found += [float(x) for x in 0.5 * (low + high)]
    return found


def highest(function: _Function, grid: FloatArray) -> tuple[float, float]:
    """Where in the grid a function is greatest, and its value there; it has one summit near its greatest grid point."""
    for _ in range(8):
        y = function(grid)
        i = int(np.nanargmax(y))
        x, best = float(grid[i]), float(y[i])
        grid = np.linspace(grid[max(i - 1, 0)], grid[min(i + 1, len(grid) - 1)], 25)
    return x, best
