"""Whether a bent rod stays where it is: second variation and conjugate points of an elastica with held ends.

The energy ½∫κ² ds under the constraint that the end does not move has, along an elastica, the second variation
I(v) = ∫ v′² − λ cos ψ v² ds for changes v of the tangent angle with ∫ v sin θ ds = ∫ v cos θ ds = 0; λ is the size of the
force, ψ the angle from the force to the tangent. Ends: clamped (position and tangent held, v = 0) or pinned (position held,
free to turn; there the curvature is 0, or the rod would turn). The rod is stable if I > 0 for all v ≠ 0 that the ends allow.

What happens at nearly straight rods. A straight rod in compression has one constraint less than a slightly bowed one, since
turning pieces of a straight rod changes its ends' distance to second order only. So it buckles at z = √λ L = 2π (clamped), π
(pinned), 4.4934 (clamped and pinned), while the margin of a rod of vanishing bow tends to another limit: between 2π and
8.9868 by how it lies (clamped), 4.9638 (pinned), 6.0175 (clamped and pinned). Both are right: the slightly bowed rod is the
buckled one, held by its neighbours in energy only up to about its own bow. Rods are taken as straight where the modulus k is
below 1e-7, that is, where the inclination to the force stays below 2e-7 and the bow below 1e-7 of the buckling length.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np

from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError
from batten.kernels import stability as kernel
from batten.typing import ArrayLike, BoolArray, FloatArray

Ends = Literal["clamped", "pinned", "clamped-pinned", "pinned-clamped"]

_CODES: dict[str, int] = {
    "clamped": kernel.CLAMPED,
    "pinned": kernel.PINNED,
    "clamped-pinned": kernel.CLAMPED_PINNED,
    "pinned-clamped": kernel.PINNED_CLAMPED,
}
_MOST = 1024  # order of the spectral method beyond which it is not raised
_NO_BOW = (
    1e-8  # root mean square of the inclination to the mean tangent, below which the second constraint says nothing
)


@dataclass(frozen=True)
class Stability:
    """What `stability` found about one rod.

    Attributes:
        stable: whether the second variation is positive; margin > 1.
        conjugate_length: arc length of the first conjugate point on the continued curve, in the curve's unit; inf if none.
        margin: conjugate_length / length; scale-free.
        least_eigenvalue: least value of L²·I(v)/∫v² ds; scale-free; positive if stable.
    """

    stable: bool
    conjugate_length: float
    margin: float
    least_eigenvalue: float


def stability(elastica: Elastica, ends: Ends = "clamped") -> Stability:
    """Whether a rod in the shape of an elastica is stable between held ends, and by what margin.

    Definition: the conjugate point is the first arc length s at which a Jacobi field vanishes: a solution of
    v″ + λ cos ψ v = α sin ψ + β cos ψ that satisfies the end conditions at 0 and s and moves no end (Sachkov 2008). Clamped:
    counted from the start. Clamped and pinned: counted from the pinned end. The rod is stable exactly if it is shorter than
    that, because v goes on by 0 beyond a clamped end. Pinned at both ends: counted from either end (the curve is symmetric),
    with v′ = 0 at s. There s is no pinned end unless the curvature vanishes, and the index need not grow with s; but at the
    lengths that are possible (m half waves) the sign of margin − 1 is that of the index: stable for m = 1 and
    k < k₀ = 0.90891 (where the ends meet, and the rod turns round freely), else not.

    Parameters:
        elastica: the rod; forces and curvature in its own unit of length.
        ends: "clamped"; "pinned"; "clamped-pinned", pinned at the end; "pinned-clamped", pinned at the start.

    Returns:
        `Stability`. margin > 1 means stable. The margin of the reversed curve with clamped ends is another number, because
        the curve is continued at its other end; it is above 1 if and only if this one is. With a pinned end it is the same.

    Raises:
        InvalidInputError: unknown `ends`; curvature at a pinned end, |κ|L > 1e-6 max(1, L·greatest |κ| of the curve).

    Accuracy:
        conjugate_length: 1e-13 relative for 1 − k² > 1e-6, 1e-10 up to k = 1, of the curve of the stored numbers. No
        digits are lost by long rods near k = 1. least_eigenvalue: see `least_eigenvalues`. The margin of pinned ends jumps,
        without passing 1, from 1.520 to 1.207 where k passes 0.88611.

    Degenerate cases:
        No inflections on the continued curve (k ≥ 1), circles, force 0, straight rods in tension: inf, always stable.
        Straight rods in compression (k < 1e-7): √λ·conjugate_length = 2π, π, 4.4934, see the head of this module.

    Example:
        >>> rod = Elastica(start=(0, 0), start_angle=0, start_curvature=0, force=(30, 0), length=1)
        >>> found = stability(rod)  # a straight column buckles at 4π² = 39.5
        >>> found.stable, round(found.margin, 6), round(found.least_eigenvalue / (4 * np.pi**2 - 30), 6)
        (True, 1.147147, 1.0)
        >>> stability(rod, "pinned").stable  # π² = 9.9
        False
    """
    code = _code(ends)
    p = elastica.parameters
    conjugate = float(kernel.conjugate_length(p[2], p[3], p[4], p[5], p[6], code))
    if np.isnan(conjugate):
        at_ends = [elastica.start_curvature * elastica.length, float(elastica.curvature_at(elastica.length)) * p[6]]
        raise InvalidInputError(
            f"a rod bears no moment at a pinned end; got κ·length = {at_ends[0]:.3g} at the start and {at_ends[1]:.3g} at "
            f"the end with ends {ends!r}; allowed is 1e-6 × max(1, length × greatest |κ|); cut the curve at its "
            f"inflections() or take ends='clamped'"
        )
    least = float(_least_of_good_rows(p[None], code)[0])
    margin = conjugate / elastica.length
    return Stability(margin > 1.0, conjugate, margin, least)


def margins(parameters: ArrayLike, ends: Ends = "clamped") -> FloatArray:
    """Margins of stability, conjugate length / length, of many elastica; above 1 means stable.

    Definition: as in `stability`.

    Parameters:
        parameters: shape (…, 7), as `Elastica.parameters`.
        ends: as in `stability`, the same for all rows.

    Returns:
        Shape (…); inf where there is no conjugate point, NaN for a row that is not finite, whose length is not positive,
        or that has curvature at a pinned end.

    Raises:
        InvalidInputError: unknown `ends`, a last axis that is not 7.

    Accuracy: as in `stability`.

    Example:
        >>> full_turn = [0.0, 0.0, 0.0, 2 * np.pi, 0.0, 0.0, 1.0]
        >>> margins([full_turn, [np.nan] * 7])
        array([inf, nan])
    """
    p, code = _rows(parameters), _code(ends)
    return (_conjugate_lengths(p, code) / p.reshape(-1, 7)[:, 6]).reshape(p.shape[:-1])


def least_eigenvalues(parameters: ArrayLike, ends: Ends = "clamped", *, moments: bool = False) -> FloatArray:
    """Least value of L²·I(v)/∫v² ds over all v that the ends allow, of many elastica; scale-free.

    Definition: the least eigenvalue μ of −v″ − λ cos ψ v = μ v/L² + α sin ψ + β cos ψ under both constraints. By Galerkin's
    method with Legendre polynomials on the whole rod, so the value is never too small by more than rounding.

    Parameters:
        parameters: shape (…, 7), as `Elastica.parameters`.
        ends: as in `stability`, the same for all rows.
        moments: whether pinned ends may have curvature: a given moment, which does not change with the angle there, adds
            nothing to the second variation.

    Returns:
        Shape (…); NaN for the rows that `margins` gives NaN, but for curvature at a pinned end with `moments`.

    Raises:
        InvalidInputError: unknown `ends`, a last axis that is not 7.

    Accuracy:
        1e-8·(1 + Φ²) for Φ = L·max(√λ, greatest |κ|/2) up to 250; beyond that the order is not raised further.

    Degenerate cases:
        Where a rod counts as straight (k < 1e-7 in compression, or an inclination to its mean tangent below 1e-8 root mean
        square), ∫ v sin = 0 is left out, and the value jumps.

    Example:
        >>> line = [0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 2.0]
        >>> least_eigenvalues([line], "pinned") / np.pi**2
        array([1.])
    """
    p, code = _rows(parameters), _code(ends)
    rows = np.ascontiguousarray(p.reshape(-1, 7))
    out = np.full(rows.shape[0], np.nan)
    good = ~np.isnan(_conjugate_lengths(rows, kernel.CLAMPED if moments else code))
    if good.any():
        out[good] = _least_of_good_rows(rows[good], code)
    return out.reshape(p.shape[:-1])


def _code(ends: str) -> int:
    if ends not in _CODES:
        raise InvalidInputError(f"ends are one of {', '.join(map(repr, _CODES))}; got {ends!r}")
    return _CODES[ends]


def _rows(parameters: ArrayLike) -> FloatArray:
    p = np.asarray(parameters, dtype=np.float64)
    if p.ndim < 1 or p.shape[-1] != 7:
        raise InvalidInputError(f"elastica come as seven numbers, shape (…, 7); got shape {p.shape}")
    return p


def _conjugate_lengths(p: FloatArray, code: int) -> FloatArray:
    rows = np.ascontiguousarray(p.reshape(-1, 7))
    out = np.empty(rows.shape[0])
    kernel.conjugate_length_batch(rows, code, out)
    return out


# --- the spectral method ---


class _Rule(NamedTuple):
    """Orthonormal polynomials on [0, 1] that meet the end conditions, at Gauss nodes: what depends on the order alone."""

    nodes: FloatArray
    weights: FloatArray
    values: FloatArray  # (nodes, functions)
    stiffness: FloatArray  # ∫ φ′ φ′


@lru_cache(maxsize=24)
def _rule(order: int, code: int) -> _Rule:
    x, w = np.polynomial.legendre.leggauss(order + order // 2)
    n = np.arange(order)
    norm = np.sqrt(2.0 * n + 1.0)
    values = np.polynomial.legendre.legvander(x, order - 1) * norm
    low = np.minimum(n[:, None], n)
    stiffness = np.where((n[:, None] + n) % 2 == 0, 2.0 * np.outer(norm, norm) * (low * (low + 1.0)), 0.0)
    held = []
    if code in (kernel.CLAMPED, kernel.CLAMPED_PINNED):
        held.append(norm * (-1.0) ** n)
    if code in (kernel.CLAMPED, kernel.PINNED_CLAMPED):
        held.append(norm)
    if held:
        free = np.linalg.qr(np.array(held).T, mode="complete")[0][:, len(held) :]
        values, stiffness = values @ free, free.T @ stiffness @ free
    return _Rule(0.5 * (x + 1.0), 0.5 * w, values, stiffness)


def _least_of_good_rows(rows: FloatArray, code: int) -> FloatArray:
    """`least_eigenvalues` of rows (n, 7) that are finite and fit their ends: in groups of one order and one shape."""
    force = np.hypot(rows[:, 4], rows[:, 5])
    # M = (κ/2)² + λ sin²(ψ/2): a quarter of the greatest κ²
    chord = np.cos(rows[:, 2]) * rows[:, 4] + np.sin(rows[:, 2]) * rows[:, 5]
    phase = rows[:, 6] * np.sqrt(np.maximum(force, 0.25 * rows[:, 3] ** 2 + 0.5 * (force - chord)))
    order = np.minimum(24 + 8 * np.ceil(0.5 * phase), _MOST).astype(np.int64)
    out = np.empty(rows.shape[0])
    for size in np.unique(order):
        members = np.flatnonzero(order == size)
        step = max(1, int(4_000_000 // size**2))
        for first in range(0, members.size, step):
            some = members[first : first + step]
            out[some] = _least_of_one_order(rows[some], code, int(size))
    return out


def _least_of_one_order(rows: FloatArray, code: int, order: int) -> FloatArray:
    rule = _rule(order, code)
    inclination = np.empty((rows.shape[0], rule.nodes.size, 2))
    kernel.inclination_batch(np.ascontiguousarray(rows), rule.nodes, inclination)
    sine, cosine = inclination[..., 0], inclination[..., 1]
    scale = np.hypot(rows[:, 4], rows[:, 5]) * rows[:, 6] ** 2
    weighted = rule.values * rule.weights[:, None]
    matrix = rule.stiffness - np.swapaxes(weighted * (scale[:, None] * cosine)[..., None], 1, 2) @ rule.values
    # constraints along and across the mean tangent
    mean_sine, mean_cosine = sine @ rule.weights, cosine @ rule.weights
    size = np.maximum(np.hypot(mean_sine, mean_cosine), 1e-300)
    mean_sine, mean_cosine = mean_sine / size, mean_cosine / size
    along = cosine * mean_cosine[:, None] + sine * mean_sine[:, None]
    across = sine * mean_cosine[:, None] - cosine * mean_sine[:, None]
    bow = np.sqrt(across**2 @ rule.weights)
    straight = (bow < _NO_BOW) | _is_straight_column(rows)
    out = np.empty(rows.shape[0])
    for some, directions in (
        (straight, along[..., None]),
        (~straight, np.stack([along, across / np.maximum(bow, 1e-300)[:, None]], axis=-1)),
    ):
        if some.any():
            constraints = weighted.T @ directions[some]
            out[some] = _least_under(matrix[some], constraints)
    return out


def _is_straight_column(rows: FloatArray) -> BoolArray:
    """Where the kernel takes a rod in compression as straight: M < 1e-14 λ."""
    force = np.hypot(rows[:, 4], rows[:, 5])
    cross = np.cos(rows[:, 2]) * rows[:, 5] - np.sin(rows[:, 2]) * rows[:, 4]
    along = np.cos(rows[:, 2]) * rows[:, 4] + np.sin(rows[:, 2]) * rows[:, 5]
    half = np.divide(cross, 2.0 * force, out=np.zeros_like(force), where=force > 0.0)  # sin ψ/2, to within 1e-14
    result: BoolArray = (along > 0.0) & (0.25 * rows[:, 3] ** 2 + force * half**2 < kernel.STRAIGHT * force)
    return result


def _least_under(matrices: FloatArray, constraints: FloatArray) -> FloatArray:
    """Least eigenvalues of symmetric matrices (n, m, m) on the null spaces of constraints (n, m, c)."""
    free = np.linalg.qr(constraints, mode="complete")[0][..., constraints.shape[-1] :]
    reduced = np.swapaxes(free, 1, 2) @ matrices @ free
    return np.linalg.eigvalsh(0.5 * (reduced + np.swapaxes(reduced, 1, 2)))[:, 0]
