"""Gauss–Legendre rules on [0, 1], and the panels on which they have converged.

A rule with n nodes is exact for polynomials of degree 2n − 1. For a function that is analytic inside the Bernstein
ellipse of an interval, the one whose semi-axes add up to ρ half-widths, its error falls like ρ^(−2n): what limits it is
how close to the interval the nearest singularity in the complex plane lies. `panel_condition` turns a tolerance into a
condition on known singularities, `adaptive_panels` finds panels where nothing is known about them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray


def _rule(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    nodes, weights = np.polynomial.legendre.leggauss(count)
    nodes, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    nodes.setflags(write=False)
    weights.setflags(write=False)
    return nodes, weights


#: Nodes in (0, 1), ascending, and weights that add up to 1.
NODES_16, WEIGHTS_16 = _rule(16)
NODES_24, WEIGHTS_24 = _rule(24)
NODES_32, WEIGHTS_32 = _rule(32)

#: An interval is halved at most this often: a panel narrower than 2^−44 of it holds a cusp, or rounding noise.
DEEPEST = 44


def panel_condition(tolerance: float) -> float:
    """Least (|r − a| + |b − r|)/(b − a) for a singularity r of the integrand, so that 24 nodes on [a, b] meet `tolerance`.

    That quotient is (ρ + 1/ρ)/2 for the Bernstein ellipse of [a, b] through r. The factor 1e5 was measured on random
    cubic Béziers with integrands as singular as κ² ds; the tests of the λ-residual hold it.
    """
    rho = (1e5 / tolerance) ** (1.0 / 48.0)
    return float(0.5 * (rho + 1.0 / rho))


def adaptive_panels(
    function: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    breaks: NDArray[np.float64],
    tolerance: float,
    most: int = 256,
) -> tuple[NDArray[np.float64], bool]:
    """Edges of panels on each of which the 24-node rule has converged for every component of `function`.

    A panel is halved until, for each component, its rule and the sum of the rules of its halves differ by no more than
    `tolerance` × (the integral of |component| over everything), but not more than `DEEPEST` times, and not once more
    than `most` panels are waiting (which happens only where rounding noise is above the tolerance).

    Parameters:
        function: maps t of shape (n, 24) to integrands of shape (m, n, 24); values that are not finite count as 0.
        breaks: ascending, where panels begin and end in any case; shape (≥ 2,).
        tolerance: relative, > 0.
        most: positive integer.

    Returns:
        (edges, converged): ascending edges from the first break to the last; `converged` is False if a panel was left
        as it was for one of the two last reasons.
    """
    breaks = np.asarray(breaks, dtype=np.float64)
    left, right = breaks[:-1], breaks[1:]
    done = []
    converged = True
    rule, scale = _integrate(function, left, right)
    scale = scale.sum(axis=1)
    for depth in range(DEEPEST + 1):
        middle = 0.5 * (left + right)
        halves, sizes = _integrate(function, np.concatenate([left, middle]), np.concatenate([middle, right]))
        n = left.size
        scale = np.maximum(scale, sizes.sum(axis=1))
        bad = (np.abs(halves[:, :n] + halves[:, n:] - rule) > tolerance * scale[:, None]).any(axis=0)
        if bad.any() and (depth == DEEPEST or n > most):
            converged = False
            bad[:] = False
        done.append(left[~bad])
        if not bad.any():
            break
        both = np.concatenate([bad, bad])
        left, right = np.concatenate([left, middle])[both], np.concatenate([middle, right])[both]
        rule = halves[:, both]
    return np.append(np.sort(np.concatenate(done)), breaks[-1]), converged


def _integrate(
    function: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    left: NDArray[np.float64],
    right: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Integrals of the components and of their absolute values over each [left, right], each of shape (m, n)."""
    width = right - left
    values = function(left[:, None] + width[:, None] * NODES_24)
    values = np.where(np.isfinite(values), values, 0.0)
    return (values @ WEIGHTS_24) * width, (np.abs(values) @ WEIGHTS_24) * width
