"""Moving the inner control points of a cubic Bézier along its outer edges until it is close to an elastica.

All of it happens in standard position, where only the lengths (L₁, L₂) of the outer edges change. A shape is the array
(c₁, s₁, c₂, s₂) of the directions of the outer edges. The measures of many pairs of lengths are taken in one call of
`curvature_fit_batch`.
"""

import math

import numpy as np
from numba import njit

from batten.kernels.bezier import ENERGY, LAMBDA_RESIDUAL, LENGTH, MOST_PANELS, curvature_fit_rows
from batten.kernels.bezier_criteria import (
    LEAST_EDGE,
    MOST_QUOTIENT,
    crossing,
    edge_limits,
    end_angles,
    in_zone,
    inflectional,
    inner_angles,
    standard_edges,
    within_angles,
)

#: Status of a row.
KEPT, REACHED, BEST, MINIMUM, UNBOUNDED, STEPS, OUTSIDE, DEGENERATE, NOT_FINITE = range(9)
#: Methods.
ZONE, FEEDBACK, GRADIENT = range(3)
#: Energies of the method "gradient".
BENDING, SCALE_INVARIANT, RESIDUAL = range(3)

_GRID = 11
_ZONE_GRID = 20
_LOWER = 1e-9  # by which e_λ must fall to be better: where edges are far longer than the chord it hardly changes
_SPACING = 0.1
_MARGIN = 1e-12  # by which what is projected to a border lies inside, so that rounding does not put it out
_CLEAR = 0.99  # share of the way to the crossing that one of two edges that cross keeps
_STEPS = 400
_FARTHEST = 1e3  # chords; an outer edge that grows beyond has nothing to stop it
_DIFFERENCE = 1e-4  # of the logarithms of the lengths
_SHORTEST_STEP = 1e-7


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _angles(shape, l1, l2):
    return inner_angles(shape[0], shape[1], l1, shape[2], shape[3], l2)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _bends_both_ways(shape, l1, l2):
    phi1, phi2 = _angles(shape, l1, l2)
    return inflectional(phi1, phi2)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _place(shape, lengths, points):
    """Write the control points of each row of `lengths` (n, 2), in standard position, to `points` (n, 4, 2)."""
    for j in range(lengths.shape[0]):
        points[j, 0] = 0.0
        points[j, 1, 0], points[j, 1, 1] = lengths[j, 0] * shape[0], lengths[j, 0] * shape[1]
        points[j, 2, 0], points[j, 2, 1] = 1.0 + lengths[j, 1] * shape[2], lengths[j, 1] * shape[3]
        points[j, 3, 0], points[j, 3, 1] = 1.0, 0.0


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _uncrossed(shape, l1, l2):
    """The lengths without a crossing of the outer edges: both are made shorter by the same factor, as little as will do."""
    a, b = crossing(shape[0], shape[1], shape[2], shape[3], l1, l2)
    if l1 < a or l2 < b:
        return l1, l2
    factor = _CLEAR * max(a / l1, b / l2)
    return factor * l1, factor * l2


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _fitted_edge(theta1, theta2):
    """L̄₁ of Brander2018 §6 for θ₁ ≥ 0, with the greater of 0.12 and f in place of the printed lesser."""
    f = (
        0.00001475 * math.exp(10.39 * theta1 - 10.48 * theta2)
        + 0.4574 * theta1 * math.exp(1.711 * theta1 - 2.535 * theta2)
        + 2.772 * theta2 * math.exp(-0.08504 * theta1 - 0.9109 * theta2)
        - 0.2957 * theta1 * theta2 * math.exp(-0.6606 * theta1)
    )
    return max(0.12, f)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def last_edges(c1, s1, c2, s2):
    """(L̄₁, L̄₂), where the path without inflections ends: near a local minimum of e_λ.

    The mirror image in the chord and the one in its bisector have the same L̄. With both outer edges on one side of the
    chord the formulas have that by themselves. With one on each side, which no curve without inflections has that meets
    the angle constraints, they have not: there the one of the two images is taken that has |θ₁| + |θ₂| ≥ π.
    """
    theta1, theta2 = math.atan2(s1, c1), math.atan2(s2, c2)
    if theta1 < 0.0:
        theta1, theta2 = -theta1, -theta2
    if theta2 < 0.0 and theta1 - theta2 < math.pi:
        theta1, theta2 = math.pi + theta2, theta1 - math.pi
        return _fitted_edge(math.pi - theta2, math.pi - theta1), _fitted_edge(theta1, theta2)
    return _fitted_edge(theta1, theta2), _fitted_edge(math.pi - theta2, math.pi - theta1)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _towards(lengths, l1, l2, end1, end2, start, step):
    """Write (1 − t)·(l1, l2) + t·(end1, end2) for t = start + j·step, cut off to [0, 1]."""
    for j in range(lengths.shape[0]):
        t = min(1.0, max(0.0, start + j * step))
        lengths[j, 0], lengths[j, 1] = (1.0 - t) * l1 + t * end1, (1.0 - t) * l2 + t * end2


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _feedback(shape, l1, l2, threshold, condition, lengths, points, fits, nodes, lefts, widths):
    """Brander2018 §6, steps 3 and 4: (L₁, L₂, status). What is good enough already is kept.

    Lengths with which the edges cross are passed over: few ends of paths without inflections are such.
    """
    start1, start2 = l1, l2
    l1, l2 = _uncrossed(shape, l1, l2)
    if threshold > 0.0 and l1 == start1 and l2 == start2:
        lengths[0, 0], lengths[0, 1] = l1, l2
        _place(shape, lengths[:1], points[:1])
        curvature_fit_rows(points[:1], condition, fits[:1], nodes, lefts, widths)
        if fits[0, LAMBDA_RESIDUAL] <= threshold:
            return l1, l2, KEPT
    beta1, beta2 = end_angles(shape[0], shape[1], shape[2], shape[3])
    longest = edge_limits(beta1, beta2)[1]
    a, b = crossing(shape[0], shape[1], shape[2], shape[3], l1, l2)
    a1, a2 = min(longest, max(LEAST_EDGE, l1)), min(longest, max(LEAST_EDGE, l2))
    # Rows of `ways`: where a part of the path begins and ends.
    ways = np.empty((2, 4))
    first_way = 1
    if _bends_both_ways(shape, a1, a2):
        first_way, l1, l2 = 0, a1, a2
    best, best1, best2, best_way, best_t = math.inf, l1, l2, first_way, 0.0
    for way in range(first_way, 2):
        if way == 0:
            end1, end2 = LEAST_EDGE, LEAST_EDGE
        else:
            end1, end2 = last_edges(shape[0], shape[1], shape[2], shape[3])
        ways[way, 0], ways[way, 1], ways[way, 2], ways[way, 3] = l1, l2, end1, end2
        _towards(lengths, l1, l2, end1, end2, 0.0, _SPACING)
        _place(shape, lengths, points)
        curvature_fit_rows(points, condition, fits, nodes, lefts, widths)
        turned = False
        for j in range(_GRID):
            if way == 0 and not _bends_both_ways(shape, lengths[j, 0], lengths[j, 1]):
                turned, l1, l2 = True, lengths[j, 0], lengths[j, 1]
                break
            e = fits[j, LAMBDA_RESIDUAL]
            if e < best - _LOWER and (lengths[j, 0] < a or lengths[j, 1] < b):
                best, best1, best2, best_way, best_t = e, lengths[j, 0], lengths[j, 1], way, j * _SPACING
            if best <= threshold:
                return best1, best2, REACHED
        if not turned:
            break
    # Once more, around the best.
    w = ways[best_way]
    _towards(lengths, w[0], w[1], w[2], w[3], best_t - _SPACING, 0.2 * _SPACING)
    _place(shape, lengths, points)
    curvature_fit_rows(points, condition, fits, nodes, lefts, widths)
    for j in range(_GRID):
        e = fits[j, LAMBDA_RESIDUAL]
        if e < best - _LOWER and (lengths[j, 0] < a or lengths[j, 1] < b):
            best, best1, best2 = e, lengths[j, 0], lengths[j, 1]
        if best <= threshold:
            return best1, best2, REACHED
    return best1, best2, BEST


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _zone(shape, l1, l2):
    """Brander2018 §5.2: (L₁, L₂, status)."""
    beta1, beta2 = end_angles(shape[0], shape[1], shape[2], shape[3])
    shortest, longest = edge_limits(beta1, beta2)
    start1, start2 = l1, l2
    l1, l2 = _uncrossed(shape, l1, l2)
    phi1, phi2 = _angles(shape, l1, l2)
    even = not inflectional(phi1, phi2) or max(l1, l2) <= MOST_QUOTIENT * min(l1, l2)
    fine = even and min(l1, l2) >= shortest and max(l1, l2) <= longest and in_zone(phi1, phi2, 0.0)
    if fine and l1 == start1 and l2 == start2:
        return l1, l2, KEPT
    shortest, longest, quotient = shortest * (1.0 + _MARGIN), longest * (1.0 - _MARGIN), MOST_QUOTIENT * (1.0 - _MARGIN)
    l1, l2 = min(longest, max(shortest, l1)), min(longest, max(shortest, l2))
    phi1, phi2 = _angles(shape, l1, l2)
    if inflectional(phi1, phi2):
        l1, l2 = min(l1, quotient * l2), min(l2, quotient * l1)
    # An inflectional curve that loses its inflection on the way goes on without, so twice at most.
    for _ in range(2):
        phi1, phi2 = _angles(shape, l1, l2)
        if in_zone(phi1, phi2, _MARGIN):
            return l1, l2, REACHED
        both_ways = inflectional(phi1, phi2)
        if both_ways:
            end1, end2 = shortest, shortest
        elif (phi1 < phi2) == (phi2 <= math.pi):
            end1, end2 = shortest, longest
        else:
            end1, end2 = longest, shortest
        # The first t at which the curve is in the zone or has lost its inflection: between two of a grid, then halved.
        low, high = 0.0, 1.0
        grid = 0
        for step in range(1, _ZONE_GRID + 61):
            t = step / _ZONE_GRID if grid == 0 else 0.5 * (low + high)
            if grid == 0 and step > _ZONE_GRID:
                return end1, end2, BEST
            phi1, phi2 = _angles(shape, (1.0 - t) * l1 + t * end1, (1.0 - t) * l2 + t * end2)
            if in_zone(phi1, phi2, _MARGIN) or (both_ways and not inflectional(phi1, phi2)):
                high, grid = t, 1
            else:
                low = t
        l1, l2 = (1.0 - high) * l1 + high * end1, (1.0 - high) * l2 + high * end2
    phi1, phi2 = _angles(shape, l1, l2)
    return l1, l2, REACHED if in_zone(phi1, phi2, _MARGIN) else BEST


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _energy(row, energy):
    if energy == BENDING:
        return row[ENERGY]
    if energy == SCALE_INVARIANT:
        return row[LENGTH] * row[ENERGY]
    return row[LAMBDA_RESIDUAL]


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _gradient(shape, l1, l2, energy, threshold, condition, lengths, points, fits, nodes, lefts, widths):
    """Steepest descent in (log L₁, log L₂) with a step that is doubled and halved: (L₁, L₂, status)."""
    x, y = math.log(l1), math.log(l2)
    lengths, points, fits = lengths[:5], points[:5], fits[:5]
    step = 0.1
    h = _DIFFERENCE
    for _ in range(_STEPS):
        for j in range(5):
            lengths[j, 0], lengths[j, 1] = math.exp(x), math.exp(y)
        lengths[1, 0], lengths[2, 0] = math.exp(x + h), math.exp(x - h)
        lengths[3, 1], lengths[4, 1] = math.exp(y + h), math.exp(y - h)
        _place(shape, lengths, points)
        curvature_fit_rows(points, condition, fits, nodes, lefts, widths)
        if fits[0, LAMBDA_RESIDUAL] <= threshold:
            return math.exp(x), math.exp(y), REACHED
        here = _energy(fits[0], energy)
        gx = _energy(fits[1], energy) - _energy(fits[2], energy)
        gy = _energy(fits[3], energy) - _energy(fits[4], energy)
        norm = math.hypot(gx, gy)
        if not (norm > 0.0 and norm < math.inf):
            return math.exp(x), math.exp(y), MINIMUM
        gx, gy = gx / norm, gy / norm
        while True:
            lengths[0, 0], lengths[0, 1] = math.exp(x - step * gx), math.exp(y - step * gy)
            _place(shape, lengths[:1], points[:1])
            curvature_fit_rows(points[:1], condition, fits[:1], nodes, lefts, widths)
            if _energy(fits[0], energy) < here - 0.25 * step * norm / (2.0 * h):
                break
            step *= 0.5
            if step < _SHORTEST_STEP:
                return math.exp(x), math.exp(y), MINIMUM
        x, y = x - step * gx, y - step * gy
        step = min(0.5, 2.0 * step)
        if max(x, y) > math.log(_FARTHEST):
            return math.exp(x), math.exp(y), UNBOUNDED
    return math.exp(x), math.exp(y), STEPS


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def project_batch(control_points, method, energy, limits, threshold, condition, out, status):
    """Project each row of `control_points` (n, 4, 2); write control points to `out` and how it ended to `status`.

    limits: (least angle, greatest difference) of the angle constraints; rows outside are copied, but for GRADIENT.
    threshold: of e_λ, for FEEDBACK and GRADIENT; condition: from `panel_condition`.
    """
    lengths, points, fits = np.empty((_GRID, 2)), np.empty((_GRID, 4, 2)), np.empty((_GRID, 7))
    nodes, lefts, widths = np.empty((MOST_PANELS, 4, 24)), np.empty(MOST_PANELS), np.empty(MOST_PANELS)
    shape = np.empty(4)
    for i in range(control_points.shape[0]):
        p, q = control_points[i], out[i]
        shape[0], shape[1], l1, shape[2], shape[3], l2, flag = standard_edges(p)
        if flag > 0:
            q[:] = math.nan
            status[i] = DEGENERATE if flag == 1 else NOT_FINITE
            continue
        q[:] = p
        beta1, beta2 = end_angles(shape[0], shape[1], shape[2], shape[3])
        inside1, inside2 = within_angles(beta1, beta2, limits[0], limits[1])
        if method != GRADIENT and not (inside1 and inside2):
            status[i] = OUTSIDE
            continue
        if method == ZONE:
            new1, new2, status[i] = _zone(shape, l1, l2)
        elif method == FEEDBACK:
            new1, new2, status[i] = _feedback(
                shape, l1, l2, threshold, condition, lengths, points, fits, nodes, lefts, widths
            )
        else:
            new1, new2, status[i] = _gradient(
                shape, l1, l2, energy, threshold, condition, lengths, points, fits, nodes, lefts, widths
            )
        if new1 != l1:
            q[1, 0], q[1, 1] = p[0, 0] + new1 / l1 * (p[1, 0] - p[0, 0]), p[0, 1] + new1 / l1 * (p[1, 1] - p[0, 1])
        if new2 != l2:
            q[2, 0], q[2, 1] = p[3, 0] + new2 / l2 * (p[2, 0] - p[3, 0]), p[3, 1] + new2 / l2 * (p[2, 1] - p[3, 1])
