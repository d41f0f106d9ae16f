"""A curve as a chain of quintic elements: unknowns, energy, gradient and band Hessian (Moreton1995 §3)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from batten.curves.quintic import QuinticHermite
from batten.kernels import hermite_energy as kernel
from batten.kernels.quadrature import NODES_24, WEIGHTS_24
from batten.typing import BoolArray, FloatArray, IntArray

Energy = Literal["mec", "mvc", "si-mec", "si-mvc"]
ENERGIES: tuple[Energy, ...] = get_args(Energy)

_VERTEX, _ELEMENT = 5, 4  # numbers of each: x, y, θ, κ of the element before, κ of that behind; μ, α at both ends


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The energy of a chain and its derivatives by the free unknowns, each in its own size.

    Attributes:
        value: the energy and what holds the parameter; infinite where the speed of some element is 0.
        length: ∫ds. integral: ∫κ² ds or ∫κ′² ds.
        gradient: (n,).
        band: lower band of the Hessian without its part of rank 2, as LAPACK stores it; empty for order < 2.
        low_rank: (n, 2) U and (2, 2) C: the Hessian is band + U C Uᵀ; None for energies that are sums over elements.
    """

    value: float
    length: float
    integral: float
    gradient: FloatArray
    band: FloatArray
    low_rank: tuple[FloatArray, FloatArray] | None


@dataclass(frozen=True, eq=False)
class ElementChain:
    """What is unknown in a chain of elements, and its energy.

    Attributes:
        energy: which of the four.
        index: (elements, 12), where the kernel's numbers of each element stand in the state.
        free: (n,), places in the state that may change, neighbours near one another, so that the Hessian is a band.
        scale: (n,), size of each: 1/scale is its natural unit.
        pairs: (pairs, 2), places of speeds that are held alike: both ends of each element, both sides of each free vertex.
        hold: weight of what holds the parameter.
        spots: for the assembly of the band: rows of (element, i, j) that are free, and where they go;
            where pairs go; its width.
    """

    energy: Energy
    index: IntArray
    free: IntArray
    scale: FloatArray
    pairs: IntArray
    hold: float
    spots: tuple[IntArray, IntArray, IntArray, int]

    @property
    def kind(self) -> int:
        """Which integral the kernel takes."""
        return kernel.BENDING if self.energy.endswith("mec") else kernel.VARIATION

    @property
    def power(self) -> int:
        """The power of the length in the scale-invariant energy: 1 for ∫κ² ds, 3 for ∫κ′² ds."""
        return 1 if self.kind == kernel.BENDING else 3

    def rows(self, state: FloatArray) -> FloatArray:
        """The 12 numbers of each element."""
        return np.ascontiguousarray(state[self.index])

    def moved(self, state: FloatArray, step: FloatArray) -> FloatArray:
        """The state after a step of the free unknowns in their own sizes."""
        out = state.copy()
        out[self.free] += self.scale * step
        return out

    def resized(self, state: FloatArray) -> ElementChain:
        """The same chain with the sizes that its elements have now."""
        return replace(self, scale=_scale(self.index, sizes_of(self.rows(state)), len(state))[self.free])

    def evaluate(self, state: FloatArray, order: int) -> Evaluation:
        """The energy, from order 1 on its gradient, for order 2 its Hessian."""
        rows = self.rows(state)
        count, n = len(rows), len(self.free)
        values, gradients = np.empty((count, 2)), np.empty((count, 2, 12))
        hessians = np.empty((count if order == 2 else 1, 2, 12, 12))
        status = kernel.element_energies_batch(rows, self.kind, order, values, gradients, hessians)
        if status != kernel.GOOD:
            return Evaluation(math.inf, math.nan, math.nan, np.zeros(n), np.empty((0, n)), None)
        length, integral = (float(v) for v in values.sum(axis=0))
        p = self.power if self.energy.startswith("si-") else 0
        held, first, second, mixed_held = self._parameter(state)
        value = length**p * integral + held
        if order == 0:
            return Evaluation(value, length, integral, np.empty(0), np.empty((0, n)), None)
        by_length, by_integral = (self._collected(gradients[:, f]) for f in range(2))
        of_length = p * length ** (p - 1) * integral  # ∂F/∂L; ∂F/∂E = Lᵖ
        gradient = of_length * by_length + length**p * by_integral + first[self.free] * self.scale
        if order == 1:
            return Evaluation(value, length, integral, gradient, np.empty((0, n)), None)
        band = self._band(of_length * hessians[:, 0] + length**p * hessians[:, 1], second, mixed_held)
        low_rank = None
        if p:
            mixed = p * length ** (p - 1)
            c = np.array([[p * (p - 1) * length ** (p - 2) * integral, mixed], [mixed, 0.0]])
            low_rank = (np.stack([by_length, by_integral], axis=1), c)
        return Evaluation(value, length, integral, gradient, band, low_rank)

    def _parameter(self, state: FloatArray) -> tuple[float, FloatArray, FloatArray, FloatArray]:
        """What holds the parameter: hold × (Σ ln² of neighbouring speeds' ratios + Σ α²), over the number of elements.

        How fast a quintic is run through hardly changes its shape, and neither does a vertex that slides along the curve:
        without this the energy has valleys that are flat to 1e-10, in which a descent does not end. Returned are the value,
        its first and second derivatives by all of the state, and the mixed ones of `pairs`.
        """
        weight = self.hold / len(self.index)
        a, b = self.pairs.T
        alphas = self.index[:, [5, 11]].ravel()
        ratio = 2.0 * np.log(np.abs(state[b] / state[a]))
        value = weight * float((ratio**2).sum() + (state[alphas] ** 2).sum())
        slope, size = 4.0 * weight * ratio, len(state)
        first: FloatArray = np.zeros(size)
        first += np.bincount(b, slope / state[b], size) - np.bincount(a, slope / state[a], size)
        second: FloatArray = np.zeros(size)
        second += np.bincount(b, (8.0 * weight - slope) / state[b] ** 2, size)
        second += np.bincount(a, (8.0 * weight + slope) / state[a] ** 2, size)
        first[alphas] += 2.0 * weight * state[alphas]
        second[alphas] += 2.0 * weight
        return value, first, second, -8.0 * weight / (state[a] * state[b])

    def total(self, rows: FloatArray) -> float:
        """The energy of any elements."""
        values = np.empty((len(rows), 2))
        kernel.element_energies_batch(rows, self.kind, 0, values, np.empty((1, 2, 12)), np.empty((1, 2, 12, 12)))
        length, integral = values.sum(axis=0)
        return float(integral * (length**self.power if self.energy.startswith("si-") else 1.0))

    def _collected(self, parts: FloatArray) -> FloatArray:
        whole = np.bincount(self.index.ravel(), parts.ravel(), minlength=int(self.index.max()) + 1)
        return np.asarray(whole[self.free] * self.scale)

    def _band(self, parts: FloatArray, diagonal: FloatArray, pairs: FloatArray) -> FloatArray:
        source, target, of_pairs, width = self.spots
        n = len(self.free)
        band: FloatArray = np.zeros((width, n))
        band += np.bincount(target, parts.ravel()[source], minlength=width * n).reshape(width, n)
        band[0] += diagonal[self.free]
        band += np.bincount(of_pairs, pairs, minlength=width * n).reshape(width, n)
        for k in range(width):
            band[k, : n - k] *= self.scale[k:] * self.scale[: n - k]
        return np.asarray(band)


def element_chain(energy: Energy, closed: bool, fixed: BoolArray, sizes: FloatArray, hold: float = 0.0) -> ElementChain:
    """The chain over vertices with `fixed` (vertices, 3): position, tangent, curvature; and elements of about these sizes.

    Elements share the curvature at a vertex, and so are G²; only where κ² is integrated and the tangent is held, each has
    its own, since the curvature of a MEC jumps there.
    """
    vertices, count = len(fixed), len(sizes)
    doubled = fixed[:, 1] & energy.endswith("mec")
    first, last = np.arange(count), (np.arange(count) + 1) % vertices
    at, behind, own = _VERTEX * first, _VERTEX * last, _VERTEX * vertices + _ELEMENT * first
    kappa = at + np.where(doubled[first], 4, 3)
    index = np.stack(
        [at, at + 1, at + 2, kappa, own, own + 1, behind, behind + 1, behind + 2, behind + 3, own + 2, own + 3], axis=1
    )
    states = _VERTEX * vertices + _ELEMENT * count
    held = np.ones(states, dtype=bool)
    held[index.ravel()] = False
    vertex = held[: _VERTEX * vertices].reshape(vertices, _VERTEX)
    vertex |= fixed[:, [0, 0, 1, 2, 2]]
    # A ring is laid flat: vertices 0, n − 1, 1, n − 2, …; so neighbours are at most two places apart.
    order = np.arange(vertices)
    if closed:
        order = np.where(order % 2 == 0, order // 2, vertices - 1 - order // 2)
    places = []
    for v in order:
        places.append(_VERTEX * v + np.arange(_VERTEX))
        if v < count:
            places.append(_VERTEX * vertices + _ELEMENT * v + np.arange(2))
        before = (v - 1) % vertices
        if before < count:
            places.append(_VERTEX * vertices + _ELEMENT * before + 2 + np.arange(2))
    line = np.concatenate(places)
    free = line[~held[line]]
    inner = np.flatnonzero(~fixed[last, 0] & (last < count))
    pairs = np.concatenate([index[:, [4, 10]], np.stack([index[inner, 10], index[last[inner], 4]], axis=1)])
    scale = _scale(index, sizes, states)[free]
    return ElementChain(energy, index, free, scale, pairs, hold, _spots(index, pairs, free, states))


def _scale(index: IntArray, sizes: FloatArray, states: int) -> FloatArray:
    """Natural size of all of the state: lengths by those of the elements around, (states,)."""
    one = np.ones_like(sizes)
    end = np.stack([sizes, sizes, one, 1.0 / sizes, np.sqrt(sizes), one], axis=1)
    both = np.concatenate([end, end], axis=1)
    total = np.bincount(index.ravel(), both.ravel(), minlength=states)
    return np.asarray(total / np.maximum(np.bincount(index.ravel(), minlength=states), 1))


def _spots(index: IntArray, pairs: IntArray, free: IntArray, size: int) -> tuple[IntArray, IntArray, IntArray, int]:
    """Which entries (element, i, j) of all elements' Hessians go to the lower band, where to; pairs' places; its width."""
    number = np.full(size, -1)
    number[free] = np.arange(len(free))
    own = number[index]
    i, j = own[:, :, None], own[:, None, :]
    source = np.flatnonzero(((i >= 0) & (j >= 0) & (i >= j)).ravel())
    row = (i - j).ravel()[source]
    column = np.broadcast_to(j, (len(index), 12, 12)).ravel()[source]
    ends = np.sort(number[pairs], axis=1)
    apart = ends[:, 1] - ends[:, 0]
    width = int(max(row.max(), apart.max())) + 1
    return source, row * len(free) + column, apart * len(free) + ends[:, 0], width


def state_of(points: FloatArray, angles: FloatArray, curvatures: FloatArray, sizes: FloatArray) -> FloatArray:
    """The state of elements of constant speed between vertices: (v, 2), (v,), (v, 2) for both sides, (elements,)."""
    vertex = np.column_stack([points, angles, curvatures])
    speed = np.sqrt(sizes)
    element = np.column_stack([speed, np.zeros_like(speed), speed, np.zeros_like(speed)])
    return np.concatenate([vertex.ravel(), element.ravel()])


def halved(rows: FloatArray) -> FloatArray:
    """Every element as two, (2n, 12): the same curve."""
    out = np.empty((2 * len(rows), 12))
    for e, row in enumerate(rows):
        piece = QuinticHermite(hermite_data(row))
        middle, first, second = piece.point(0.5), piece.derivative(0.5), piece.derivative(0.5, 2)
        speed = float(np.hypot(*first))
        angle = row[2] + math.remainder(math.atan2(first[1], first[0]) - row[2], 2.0 * math.pi)
        kappa = (first[0] * second[1] - first[1] * second[0]) / speed**3
        inner = [*middle, angle, kappa, math.sqrt(0.5 * speed), 0.5 * float(first @ second) / speed**2]
        half = np.array([1.0, 1.0, 1.0, 1.0, math.sqrt(0.5), 0.5])
        out[2 * e] = [*(row[:6] * half), *inner]
        out[2 * e + 1] = [*inner, *(row[6:] * half)]
    return out


def hermite_data(row: FloatArray) -> FloatArray:
    """C(0), C′(0), C″(0), C″(1), C′(1), C(1) of an element, (6, 2)."""
    data = np.empty((6, 2))
    for end, places in ((row[:6], (0, 1, 2)), (row[6:], (5, 4, 3))):
        x, y, angle, kappa, mu, alpha = end
        t = np.array([math.cos(angle), math.sin(angle)])
        m = mu * mu
        data[places[0]] = x, y
        data[places[1]] = m * t
        data[places[2]] = m * m * kappa * np.array([-t[1], t[0]]) + alpha * m * t
    return data


def state_of_rows(rows: FloatArray, closed: bool) -> FloatArray:
    """The state of given elements, which meet."""
    vertices = np.zeros((len(rows) + (0 if closed else 1), _VERTEX))
    vertices[: len(rows)] = rows[:, [0, 1, 2, 3, 3]]
    if closed:
        vertices[:, 3] = np.roll(rows[:, 9], 1)
    else:
        vertices[1:, 3] = rows[:, 9]
        vertices[-1] = rows[-1, [6, 7, 8, 9, 9]]
    return np.concatenate([vertices.ravel(), rows[:, [4, 5, 10, 11]].ravel()])


def sizes_of(rows: FloatArray) -> FloatArray:
    """Lengths of the elements, (n,)."""
    values = np.empty((len(rows), 2))
    kernel.element_energies_batch(rows, kernel.BENDING, 0, values, np.empty((1, 2, 12)), np.empty((1, 2, 12, 12)))
    return values[:, 0].copy()


def energies(rows: FloatArray) -> tuple[float, float, float, float]:
    """∫ds, ∫κ² ds, ∫κ′² ds within the elements, and ∫κ ds/2π."""
    both = []
    for kind in (kernel.BENDING, kernel.VARIATION):
        values = np.empty((len(rows), 2))
        kernel.element_energies_batch(rows, kind, 0, values, np.empty((1, 2, 12)), np.empty((1, 2, 12, 12)))
        both.append(values.sum(axis=0))
    turning = 0.0
    for row in rows:
        piece = QuinticHermite(hermite_data(row))
        (x1, y1), (x2, y2) = piece.derivative(NODES_24).T, piece.derivative(NODES_24, 2).T
        turning += float(WEIGHTS_24 @ ((x1 * y2 - y1 * x2) / (x1 * x1 + y1 * y1)))
    return float(both[0][0]), float(both[0][1]), float(both[1][1]), turning / (2.0 * math.pi)
