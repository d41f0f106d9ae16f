"""The straight line of least greatest distance from points of a plane that are in order along x."""

import math

import numpy as np
from numba import njit


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _hull(x, y, sign, chain):
    """Indices of the lower (sign 1) or upper (sign −1) hull of points by ascending x; NaN heights are passed over."""
    n = 0
    for i in range(len(x)):
        if math.isnan(y[i]):
            continue
        while n >= 2:
            a, b = chain[n - 2], chain[n - 1]
            turn = (x[b] - x[a]) * (y[i] - y[a]) - (y[b] - y[a]) * (x[i] - x[a])
            if sign * turn > 0.0:
                break
            n -= 1
        chain[n] = i
        n += 1
    return n


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _narrowest(x, y, one, n_one, other, n_other):
    """Of the strips with an edge of the hull `one` on one side, the narrowest: (width, edge, opposite vertex), by index."""
    least, edge, opposite = math.inf, 0, 0
    k = n_other - 1  # as the edge's slope moves on, the touching vertex of the other hull moves to the left
    for e in range(n_one - 1):
        a, b = one[e], one[e + 1]
        dx, dy = x[b] - x[a], y[b] - y[a]
        size = math.sqrt(dx * dx + dy * dy)
        gap = abs(dx * (y[other[k]] - y[a]) - dy * (x[other[k]] - x[a]))
        while k > 0:
            further = abs(dx * (y[other[k - 1]] - y[a]) - dy * (x[other[k - 1]] - x[a]))
            if further < gap:
                break
            k -= 1
            gap = further
        if gap < least * size:
            least, edge, opposite = gap / size, e, other[k]
    return least, edge, opposite


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def minimax_line(x, y, lower, upper):
    """The line of least greatest distance: (height at x[0], slope, that distance).

    It is the middle of the narrowest strip that holds the points. The strip has an edge of their convex hull on one side
    and a vertex on the other; both hulls are walked through once.

    `x` ascending, without equal ones; points of `y` NaN do not count, but `x[0]` stays where the height is told. `lower`,
    `upper`: work space of whole numbers, as long as x. One point: a level line; none: NaN.
    """
    below, above = _hull(x, y, 1.0, lower), _hull(x, y, -1.0, upper)
    if below == 0:
        return math.nan, math.nan, math.nan
    if below == 1:
        return y[lower[0]], 0.0, 0.0
    width, edge, opposite = _narrowest(x, y, lower, below, upper, above)
    width_above, edge_above, opposite_above = _narrowest(x, y, upper, above, lower, below)
    if width_above < width:
        width, opposite = width_above, opposite_above
        a, b = upper[edge_above], upper[edge_above + 1]
    else:
        a, b = lower[edge], lower[edge + 1]
    slope = (y[b] - y[a]) / (x[b] - x[a])
    on_edge, on_vertex = y[a] + slope * (x[0] - x[a]), y[opposite] + slope * (x[0] - x[opposite])
    return 0.5 * (on_edge + on_vertex), slope, 0.5 * width


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def minimax_line_batch(x, y, out):
    """`minimax_line` for every row of x, y (m, n) into out (m, 3)."""
    lower, upper = np.empty(x.shape[1], dtype=np.int64), np.empty(x.shape[1], dtype=np.int64)
    for i in range(len(x)):
        out[i, 0], out[i, 1], out[i, 2] = minimax_line(x[i], y[i], lower, upper)
