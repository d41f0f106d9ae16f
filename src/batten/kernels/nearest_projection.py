"""The cubic Bézier nearest to a drawn one that is close to an elastica: other lengths of its outer edges, turns, other ends.

Without a threshold it is that of least F, see `least_residual`. With a threshold E the nearest point with e ≤ E is
looked for in a plane: of (x, y); or, where no lengths reach E, of the turns (a, b) of both end tangents, with the least
e of all lengths, m(a, b), in place of e. The radius r(φ) at which the ray from the origin in direction φ meets e = E is
made least by the secant method, with r'(φ)/r = −e_⊥/e_r.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from batten.kernels.bezier import LAMBDA_RESIDUAL, curvature_fit_batch, polygon_frame
from batten.kernels.least_residual import (
    AT_X,
    AT_Y,
    GRID,
    LEAST,
    LONGEST,
    MOST_FOUND,
    SHORTEST,
    fill_grid,
    lowest,
    minimum,
    residual,
    turn,
    workspace,
)

#: Status of a row; the first nine are those of `bezier_projection`.
KEPT, REACHED, BEST, MINIMUM, _, _, _, DEGENERATE, NOT_FINITE, TURNED, MOVED = range(11)
#: What is kept.
TANGENTS, POINTS, NOTHING = range(3)

_PULL = 1e-3  # w
_FLOOR = 0.01  # handles that are shorter, in chords, count as of this length
_UNDER = 5e-8  # by which e lies below the threshold, so that rounding of the coordinates does not put it above
_CLOSE = 8e-9  # how well e = E − _UNDER is met
_STRIDE = 0.08  # on the way to a point that meets the threshold
_RINGS = 2.0  # up to which radius
_TURNS = 40
_BEGINNINGS = 3  # of the search for turns, in different directions


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def _at(plane, u, v, base, state, scale, condition, work):
    """(e, e_u, e_v) in one of the planes. The start of the descent over lengths, `state`, follows.

    plane 0: of the lengths, (u, v) = (x, y). plane 1: of the turns, a = (t₁ + t₂)/√2 = u/scale, b = (t₁ − t₂)/√2 = v;
    t₁ and t₂ turn the outer edges against the chord. base: the shape at (0, 0).
    """
    if plane == 0:
        e, ex, ey, _, _ = residual(base, u, v, condition, True, work)
        return e, ex, ey
    a, b = u / scale, v
    shape = work[4]
    turn(base, math.sqrt(0.5) * (a + b), math.sqrt(0.5) * (a - b), shape)
    x, y, _, _ = minimum(shape, state[0], state[1], 0.0, 0.0, 0.0, 1e-5, condition, work)
    state[0], state[1] = x, y
    e, _, _, e1, e2 = residual(shape, x, y, condition, True, work)
    return e, math.sqrt(0.5) * (e1 + e2) / scale, math.sqrt(0.5) * (e1 - e2)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def _entry(plane, u0, v0, angle, low, high, wanted, base, state, scale, condition, work):
    """Where on the ray from (u₀, v₀) e = `wanted`, between radii outside and inside: (r, (∂r/∂φ)/r, whether it is met)."""
    cu, cv = math.cos(angle), math.sin(angle)
    r = high
    keep0, keep1 = state[0], state[1]
    for _ in range(60):
        e, eu, ev = _at(plane, u0 + r * cu, v0 + r * cv, base, state, scale, condition, work)
        along, across = eu * cu + ev * cv, ev * cu - eu * cv
        miss = e - wanted
        if abs(miss) < _CLOSE and along < 0.0:
            return r, -across / along, True
        if miss > 0.0:
            low = r
            state[0], state[1] = keep0, keep1
        else:
            high = r
            keep0, keep1 = state[0], state[1]
        if high - low < 1e-14 * high:
            break
        r -= miss / along if along < 0.0 else 0.0
        if not low < r < high:
            r = 0.5 * (low + high)
    return high, 0.0, False


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def _bracket(plane, u0, v0, angle, most, wanted, base, state, scale, condition, work):
    """The first radius on a ray, up to `most`, at which e ≤ `wanted`, and the one before: (low, high, whether there is one).

    For the turns the walk goes inwards from `most`, where the descent over lengths begins in `state`, to the last such
    radius.
    """
    cu, cv = math.cos(angle), math.sin(angle)
    steps = max(1, math.ceil(most / _STRIDE))
    if plane == 0:
        for i in range(1, steps + 1):
            r = most * i / steps
            if residual(base, u0 + r * cu, v0 + r * cv, condition, False, work)[0] <= wanted:
                return most * (i - 1) / steps, r, True
        return 0.0, most, False
    e = _at(plane, u0 + most * cu, v0 + most * cv, base, state, scale, condition, work)[0]
    if e > wanted:
        return 0.0, most, False
    high, keep0, keep1 = most, state[0], state[1]
    for i in range(steps - 1, -1, -1):
        r = most * i / steps
        e = _at(plane, u0 + r * cu, v0 + r * cv, base, state, scale, condition, work)[0]
        if e > wanted:
            state[0], state[1] = keep0, keep1
            return r, high, True
        high, keep0, keep1 = r, state[0], state[1]
    return 0.0, high, True


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def _nearest(plane, u0, v0, u, v, wanted, base, state, scale, condition, work):
    """The point nearest to (u₀, v₀) with e = `wanted`, from one with e ≤ `wanted`: (u, v, r); r infinite if it is not."""
    angle, r = math.atan2(v - v0, u - u0), math.hypot(u - u0, v - v0)
    low, high, met = _bracket(plane, u0, v0, angle, r, wanted, base, state, scale, condition, work)
    if not met:
        return u, v, math.inf
    r, slope, met = _entry(plane, u0, v0, angle, low, high, wanted, base, state, scale, condition, work)
    if not met:  # an edge of the set across which e jumps: the inner side of it
        return u0 + r * math.cos(angle), v0 + r * math.sin(angle), r
    # Secant steps for r'(φ) = 0 that make r shorter; the first to where the border would be nearest if it were straight.
    step = -math.atan(slope)
    for _ in range(_TURNS):
        step = min(0.5, max(-0.5, step))
        keep0, keep1 = state[0], state[1]
        while abs(step) > 1e-8:
            new, new_slope = math.inf, 0.0
            cu, cv = math.cos(angle + step), math.sin(angle + step)
            if _at(plane, u0 + r * cu, v0 + r * cv, base, state, scale, condition, work)[0] <= wanted:
                low, high, met = _bracket(plane, u0, v0, angle + step, r, wanted, base, state, scale, condition, work)
                if met:
                    new, new_slope, met = _entry(
                        plane, u0, v0, angle + step, low, high, wanted, base, state, scale, condition, work
                    )
                if met and new < r:
                    break
            state[0], state[1] = keep0, keep1
            new = math.inf
            step *= 0.3
        if abs(step) <= 1e-8:
            break
        turned, fell = step, slope - new_slope
        step = new_slope * turned / fell if fell != 0.0 and new_slope * turned / fell * new_slope < 0.0 else -new_slope
        angle, r, slope = angle + turned, new, new_slope
    return u0 + r * math.cos(angle), v0 + r * math.sin(angle), r


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def _first_ring(shape, x0, y0, wanted, condition, work):
    """The point of least e on the first circle around (x₀, y₀) that meets e ≤ `wanted`: (x, y, whether one does)."""
    r = 0.0
    while r < _RINGS:
        r += 0.1 + 0.1 * r
        count = math.ceil(2.0 * math.pi * r / (0.1 + 0.1 * r))
        least, bx, by = math.inf, x0, y0
        for i in range(count):
            angle = 2.0 * math.pi * (i + 0.5) / count
            x, y = x0 + r * math.cos(angle), y0 + r * math.sin(angle)
            if min(x, y) < min(SHORTEST, x0, y0) or max(x, y) > max(LONGEST, x0, y0):
                continue
            e = residual(shape, x, y, condition, False, work)[0]
            if e < least:
                least, bx, by = e, x, y
        if least <= wanted:
            return bx, by, True
    return x0, y0, False


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def _by_lengths(shape, x0, y0, threshold, rough, condition, grid, found, work):
    """The nearest lengths with e ≤ threshold: (x, y, whether reached), or those of least e.

    From the first circle around (x₀, y₀) that meets it; else from the two points of the grid nearest to (x₀, y₀) that
    do and lie in different directions; else from the lowest minimum.
    """
    wanted = threshold - _UNDER
    state = work[5]
    x, y, met = _first_ring(shape, x0, y0, wanted, rough, work)
    if met:
        x, y, r = _nearest(0, x0, y0, x, y, wanted, shape, state, 1.0, condition, work)
        if r < math.inf:
            return x, y, True
    fill_grid(shape, x0, y0, 0.0, rough, grid, work)
    step = (LONGEST - SHORTEST) / (GRID - 1)
    best, bx, by = math.inf, 0.0, 0.0
    first1, first2 = 0.0, 0.0
    for k in range(2):
        near, nx, ny = math.inf, 0.0, 0.0
        for i in range(GRID):
            for j in range(GRID):
                if grid[i + 1, j + 1] <= wanted * wanted:
                    dx, dy = SHORTEST + i * step - x0, SHORTEST + j * step - y0
                    d = math.hypot(dx, dy)
                    if d < near and (k == 0 or dx * first1 + dy * first2 < 0.7 * d):
                        near, nx, ny = d, dx, dy
        if near < math.inf:
            first1, first2 = nx / near, ny / near
            x, y, r = _nearest(0, x0, y0, x0 + nx, y0 + ny, wanted, shape, state, 1.0, condition, work)
            if r < best:
                best, bx, by = r, x, y
    if best < math.inf:
        return bx, by, True
    x, y, e = lowest(shape, x0, y0, 0.0, 1e-7, condition, grid, found, work)
    if e <= wanted:
        bx, by, r = _nearest(0, x0, y0, x, y, wanted, shape, state, 1.0, condition, work)
        if r < math.inf:
            return bx, by, True
    return x, y, False


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def _wrapped(angle):
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def _beginnings(shape, scale, wanted, table, loops, out):
    """Nearest nodes of a table with m ≤ wanted that lie in different directions: how many; rows (u, v, x, y) to `out`."""
    theta1, theta2 = math.atan2(shape[1], shape[0]), math.atan2(shape[3], shape[2])
    count = 0
    n = len(table) if shape[4] > 0.0 else len(loops)
    for m in range(len(out)):
        near = math.inf
        for i in range(n):
            if shape[4] == 0.0:
                b = _wrapped(2.0 * math.pi * (i + 0.5) / n - (theta1 - theta2)) * math.sqrt(0.5)
                if loops[i, LEAST] <= wanted and abs(b) < near and (m == 0 or b * out[0, 1] < 0.0):
                    near = abs(b)
                    out[m, 0], out[m, 1], out[m, 2], out[m, 3] = 0.0, b, loops[i, AT_X], loops[i, AT_Y]
                continue
            t1 = _wrapped(2.0 * math.pi * (i + 0.5) / n - theta1)
            for j in range(n):
                if table[i, j, LEAST] > wanted:
                    continue
                t2 = _wrapped(2.0 * math.pi * (j + 0.5) / n - theta2)
                # One of them by another full turn, where turns in common cost less.
                for k in range(-1, 2):
                    s2 = t2 + 2.0 * math.pi * k
                    a, b = scale * math.sqrt(0.5) * (t1 + s2), math.sqrt(0.5) * (t1 - s2)
                    d = math.hypot(a, b)
                    if d >= near or (k != 0 and scale == 1.0):
                        continue
                    apart = True
                    for q in range(m):
                        apart = apart and a * out[q, 0] + b * out[q, 1] < 0.5 * d * math.hypot(out[q, 0], out[q, 1])
                    if apart:
                        near = d
                        out[m, 0], out[m, 1], out[m, 2], out[m, 3] = a, b, table[i, j, AT_X], table[i, j, AT_Y]
        if near == math.inf or (shape[4] == 0.0 and m == 2):
            break
        count += 1
    return count


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def _least_turns(shape, scale, wanted, table, loops, starts, condition, work):
    """The nearest (u, v) with m ≤ wanted of those found from several beginnings: (u, v, r, x, y)."""
    state = work[5]
    best, bu, bv, bx, by = math.inf, 0.0, 0.0, 0.0, 0.0
    for i in range(_beginnings(shape, scale, wanted, table, loops, starts)):
        state[0], state[1] = starts[i, 2], starts[i, 3]
        u, v, r = _nearest(1, 0.0, 0.0, starts[i, 0], starts[i, 1], wanted, shape, state, scale, condition, work)
        if r < best:
            best, bu, bv, bx, by = r, u, v, state[0], state[1]
    return bu, bv, best, bx, by


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def _by_turns(shape, keep, quotient, threshold, table, loops, starts, condition, work):
    """The least turns with m ≤ threshold: (t₁, t₂, ρ, x, y, whether reached); ρ turns the chord, t are relative to it.

    With the ends free the change is least if ρ = −2(t₁ + t₂)/(4 + q²), q = chord / length of the control polygon; what is
    left is b² + a² q²/(4 + q²), so that a is scaled by the root of q²/(4 + q²).
    """
    wanted = threshold - _UNDER
    scale = 1.0
    u, v, r, x, y = _least_turns(shape, scale, wanted, table, loops, starts, condition, work)
    if keep == NOTHING and shape[4] > 0.0 and r < math.inf:
        scale = max(1e-3, quotient / math.sqrt(4.0 + quotient * quotient))
        # From the answer with fixed ends, so that this is never the worse one, and from nodes.
        state = work[5]
        state[0], state[1] = x, y
        u *= scale
        near_u, near_v, r = _nearest(1, 0.0, 0.0, u, v, wanted + 2.0 * _CLOSE, shape, state, scale, condition, work)
        if r < math.inf:
            u, v, x, y = near_u, near_v, state[0], state[1]
        else:
            r = math.hypot(u, v)
        near_u, near_v, other, near_x, near_y = _least_turns(
            shape, scale, wanted, table, loops, starts[:1], condition, work
        )
        if other < r:
            u, v, r, x, y = near_u, near_v, other, near_x, near_y
    a, b = u / scale, v
    rho = -2.0 * math.sqrt(2.0) * a / (4.0 + quotient * quotient) if scale < 1.0 else 0.0
    return math.sqrt(0.5) * (a + b), math.sqrt(0.5) * (a - b), rho, x, y, r < math.inf


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def _edge(ax, ay, bx, by, cx, cy):
    """(direction, length) of an outer edge; one of length 0 has the direction of the end tangent, towards the next point."""
    length = math.hypot(ax, ay)
    dx, dy = ax, ay
    if length == 0.0:
        dx, dy = bx, by
    if dx == 0.0 and dy == 0.0:
        dx, dy = cx, cy
    size = math.hypot(dx, dy)
    return dx / size, dy / size, length


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def _standard(p, shape):
    """Write the shape; return (unit, direction of the x-axis, x₀, y₀, chord/polygon, flag), flag as in `standard_edges`."""
    size, total = 0.0, 0.0
    for i in range(4):
        for j in range(2):
            size = max(size, abs(p[i, j] - p[0, j]))
            total += abs(p[i, j])
    if total - total != 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2
    if size == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1
    ax, ay = (p[1, 0] - p[0, 0]) / size, (p[1, 1] - p[0, 1]) / size
    dx, dy = (p[3, 0] - p[0, 0]) / size, (p[3, 1] - p[0, 1]) / size
    bx, by = (p[2, 0] - p[3, 0]) / size, (p[2, 1] - p[3, 1]) / size
    ox, oy = (p[2, 0] - p[0, 0]) / size, (p[2, 1] - p[0, 1]) / size
    mx, my = (p[1, 0] - p[3, 0]) / size, (p[1, 1] - p[3, 1]) / size
    chord = math.hypot(dx, dy)
    ax, ay, l1 = _edge(ax, ay, ox, oy, dx, dy)
    bx, by, l2 = _edge(bx, by, mx, my, -dx, -dy)
    polygon = l1 + l2 + math.hypot(ox - l1 * ax, oy - l1 * ay)
    if chord > 0.0:
        unit, dx, dy = chord, dx / chord, dy / chord
        shape[4] = 1.0
        l1, l2 = max(l1 / unit, _FLOOR), max(l2 / unit, _FLOOR)
    else:
        most = max(l1, l2)
        l1, l2 = max(l1, _FLOOR * most), max(l2, _FLOOR * most)
        if most == 0.0:
            l1 = l2 = 1.0
        unit, dx, dy = math.sqrt(l1 * l2), 1.0, 0.0
        shape[4] = 0.0
        l1, l2 = l1 / unit, l2 / unit
    shape[0], shape[1] = ax * dx + ay * dy, ay * dx - ax * dy
    shape[2], shape[3] = bx * dx + by * dy, by * dx - bx * dy
    return unit * size, dx, dy, math.log(l1), math.log(l2), chord / polygon, 0


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def _place(p, shape, unit, dx, dy, x, y, t1, t2, rho, work, q):
    """Control points from lengths and turns into q; an end that stays does so bit by bit."""
    if shape[4] == 0.0:
        x, y = 0.5 * (x - y), 0.5 * (y - x)
    q[0], q[3] = p[0], p[3]
    if rho != 0.0:
        c, s = math.cos(rho), math.sin(rho)
        for i in range(2):
            mid = p[0, i] + 0.5 * (p[3, i] - p[0, i])
            half = 0.5 * unit * ((c * dx - s * dy) if i == 0 else (s * dx + c * dy))
            q[0, i], q[3, i] = mid - half, mid + half
    turned = work[4]
    turn(shape, t1 + rho, t2 + rho, turned)
    l1, l2 = unit * math.exp(x), unit * math.exp(y)
    q[1, 0] = q[0, 0] + l1 * (turned[0] * dx - turned[1] * dy)
    q[1, 1] = q[0, 1] + l1 * (turned[0] * dy + turned[1] * dx)
    q[2, 0] = q[3, 0] + l2 * (turned[2] * dx - turned[3] * dy)
    q[2, 1] = q[3, 1] + l2 * (turned[2] * dy + turned[3] * dx)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def nearest_batch(control_points, threshold, keep, tables, conditions, out, status):
    """Project each row of `control_points` (n, 4, 2); write control points to `out` and how it ended to `status`.

    threshold: negative for none. tables: from `least_table` and `loop_table`. conditions: of the grid and of the rest,
    from `panel_condition`.
    """
    work = workspace()
    grid = np.full((GRID + 2, GRID + 2), math.inf)
    found, shape = np.empty((MOST_FOUND, 2)), np.empty(5)
    fit, starts = np.empty((1, 7)), np.empty((_BEGINNINGS, 4))
    for n in range(control_points.shape[0]):
        p, q = control_points[n], out[n]
        unit, dx, dy, x0, y0, quotient, flag = _standard(p, shape)
        if flag > 0:
            q[:] = math.nan
            status[n] = DEGENERATE if flag == 1 else NOT_FINITE
            continue
        q[:] = p
        if threshold >= 0.0 or polygon_frame(p)[4] == 1:
            curvature_fit_batch(control_points[n : n + 1], conditions[1], fit)
            if fit[0, LAMBDA_RESIDUAL] <= max(threshold, 0.0):
                status[n] = KEPT
                continue
        t1 = t2 = rho = 0.0
        if threshold < 0.0:
            fill_grid(shape, x0, y0, _PULL, conditions[0], grid, work)
            x, y, _ = lowest(shape, x0, y0, _PULL, 1e-7, conditions[1], grid, found, work)
            status[n] = MINIMUM
        else:
            x, y, met = _by_lengths(shape, x0, y0, threshold, *conditions, grid, found, work)
            status[n] = REACHED if met else BEST
            if not met and keep != TANGENTS:
                t1, t2, rho, new_x, new_y, met = _by_turns(
                    shape, keep, quotient, threshold, tables[0], tables[1], starts, conditions[1], work
                )
                if met:
                    x, y = new_x, new_y
                    status[n] = TURNED if rho == 0.0 else MOVED
                else:
                    t1 = t2 = rho = 0.0
        _place(p, shape, unit, dx, dy, x, y, t1, t2, rho, work, q)
