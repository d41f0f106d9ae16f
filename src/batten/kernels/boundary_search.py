"""The charts of `boundary_value.py` subdivided until every curve that arrives at the end point is nearly known.

A cell of a chart is given up if the end point lies outside the image of its nine points, widened by the second differences
between them; it is solved as a linear system where these are small; else it is halved.
"""

import math

import numpy as np
from numba import njit

from batten.kernels.boundary_value import (
    INFLECTED_HIGH,
    TURNING,
    aim,
    chart_point,
    inflected_end,
    inflected_integrals,
)

TIGHTEST = 40.0
"""Greatest √λ, times the length, of the curves that are looked for: a force forty times the clamped buckling load."""

_DEPTH = 44
_TIP = 1e-11  # a cell whose points miss less is a point
_WIDEN = 1.0
_LINEAR = 0.12
_LOWEST = 1.0 / 340.0  # v in charts 1 and 2: 1 − k² = exp(−678) and exp(−339)
_LEAST = 1e-60  # of v in the others


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _add(out, starts, n):
    """Append what a chart says of a curve, (θ₀, κ₀, λ₁, λ₂), to the first n of `starts` (m, 4), unless it is there."""
    bend = 1.0 + abs(out[2]) + math.sqrt(math.hypot(out[3], out[4]))
    for i in range(n):
        apart = abs(starts[i, 1] - out[2]) / bend + math.hypot(starts[i, 2] - out[3], starts[i, 3] - out[4]) / bend**2
        if apart + abs(starts[i, 0] - out[5]) < 1e-9:
            return n
    starts[n, 0], starts[n, 1], starts[n, 2], starts[n, 3] = out[5], out[2], out[3], out[4]
    return n + 1


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _sharpen(chart, cell, count, u, v, problem, out, side):
    """Newton's method with central differences on the chart itself, a few steps; `out` is left at the last point."""
    for _ in range(5):
        chart_point(chart, cell, count, u, v, problem, out)
        miss = math.hypot(out[0], out[1])
        if not miss > 1e-11:
            return
        h = 1e-5
        hu, hv = min(h, u, 1.0 - u), min(h * v, 0.5 * (1.0 - v))
        hu, hv = max(hu, 1e-9), max(hv, 1e-9 * v)
        chart_point(chart, cell, count, u + hu, v, problem, side[0])
        chart_point(chart, cell, count, u - hu, v, problem, side[1])
        chart_point(chart, cell, count, u, v + hv, problem, side[2])
        chart_point(chart, cell, count, u, v - hv, problem, side[3])
        xu, yu = (side[0, 0] - side[1, 0]) / (2.0 * hu), (side[0, 1] - side[1, 1]) / (2.0 * hu)
        xv, yv = (side[2, 0] - side[3, 0]) / (2.0 * hv), (side[2, 1] - side[3, 1]) / (2.0 * hv)
        det = xu * yv - yu * xv
        if not abs(det) > 1e-14 * math.hypot(xu, yu) * math.hypot(xv, yv):
            return
        du, dv = (out[0] * yv - out[1] * xv) / det, (xu * out[1] - yu * out[0]) / det
        nu, nv = u - du, v - dv
        if not (-0.05 < nu < 1.05 and 0.3 * v < nv < 3.0 * v and nv < 1.05):
            return
        u, v = min(max(nu, 0.0), 1.0), min(max(nv, lowest(chart), _LEAST), 1.0)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def fill_nodes(chart, cell, nu, nv, problem, nodes):
    """The points of a chart's first nu × nv cells into `nodes` (≥ 2nu + 1, ≥ 2nv + 1, INTEGRALS).

    Charts 0 and 1 store their integrals, which serve every number of inflections; the others what has to vanish, and λ².
    """
    low = lowest(chart)
    out = np.empty(6)
    for i in range(2 * nu + 1):
        for j in range(2 * nv + 1):
            u, v = 0.5 * i / nu, max(low + (1.0 - low) * 0.5 * j / nv, _LEAST)
            if chart <= INFLECTED_HIGH:
                inflected_integrals(chart == INFLECTED_HIGH, u, v, problem[2], nodes[i, j])
            else:
                chart_point(chart, cell, 0, u, v, problem, out)
                nodes[i, j, 0], nodes[i, j, 1], nodes[i, j, 2] = out[0], out[1], out[3] * out[3] + out[4] * out[4]


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def lowest(chart):
    """The least v of a chart that is looked at."""
    return _LOWEST if chart in (INFLECTED_HIGH, TURNING) else 0.0


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _from_nodes(chart, cell, count, i, j, nodes, problem, nine, out):
    """The nine points of the first cell (i, j)."""
    for k in range(3):
        for l in range(3):
            node = nodes[2 * i + k, 2 * j + l]
            if chart <= INFLECTED_HIGH:
                inflected_end(node, cell, count, out)
                nine[k, l, 0], nine[k, l, 1] = aim(out[0], out[1], problem)
                nine[k, l, 2] = out[3] * out[3] + out[4] * out[4]
            else:
                nine[k, l] = node[:3]


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _fill_half(chart, cell, count, frame, nine, along_u, half, problem, out):
    """Turn the points of a cell, `nine` (3, 3, 3), into those of its half 0 or 1: only a middle row is new."""
    u0, u1, v0, v1 = frame[0], frame[1], frame[2], frame[3]
    outer = 2 if half == 0 else 0
    for j in range(3):
        if along_u:
            nine[outer, j] = nine[1, j]
            u, v = 0.5 * (u0 + u1), v0 + 0.5 * j * (v1 - v0)
        else:
            nine[j, outer] = nine[j, 1]
            u, v = u0 + 0.5 * j * (u1 - u0), 0.5 * (v0 + v1)
        chart_point(chart, cell, count, u, max(v, _LEAST), problem, out)
        new = nine[1, j] if along_u else nine[j, 1]
        new[0], new[1], new[2] = out[0], out[1], out[3] * out[3] + out[4] * out[4]


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def search_chart(chart, cell, count, nu, nv, problem, nodes, starts, n_starts, budget, frames, nines, spent):
    """Search one chart for curves that nearly arrive, (θ₀, κ₀, λ₁, λ₂), into `starts` (m, 4); returns how many it holds.

    `nodes` from `fill_nodes`. `frames` (m, 5) and `nines` (m, 3, 3, 3) are the stack: borders u₀, u₁, v₀, v₁ and depth of
    cells, and their points. `spent` (2,): evaluations; 1 if cut short.
    """
    out, side = np.empty(6), np.empty((4, 6))
    low = lowest(chart)
    for first in range(nu * nv):
        i, j = first // nv, first % nv
        frame = frames[0]
        frame[0], frame[1], frame[4] = i / nu, (i + 1.0) / nu, 0.0
        frame[2], frame[3] = low + (1.0 - low) * j / nv, low + (1.0 - low) * (j + 1.0) / nv
        _from_nodes(chart, cell, count, i, j, nodes, problem, nines[0], out)
        n_stack = 1
        while n_stack > 0:
            n_stack -= 1
            r = nines[n_stack]
            u0, u1, v0, v1, depth = frames[n_stack]
            if spent[0] > budget or n_starts == starts.shape[0]:
                spent[1] = 1
                return n_starts
            bend_u, bend_v, twist = 0.0, 0.0, 0.0
            for m in range(2):
                for k in range(3):
                    bend_u = max(bend_u, abs(r[0, k, m] + r[2, k, m] - 2.0 * r[1, k, m]))
                    bend_v = max(bend_v, abs(r[k, 0, m] + r[k, 2, m] - 2.0 * r[k, 1, m]))
                twist = max(twist, abs(r[2, 2, m] - r[2, 0, m] - r[0, 2, m] + r[0, 0, m]))
            bend = max(bend_u, bend_v, 0.5 * twist)
            xu, yu = r[2, 1, 0] - r[0, 1, 0], r[2, 1, 1] - r[0, 1, 1]
            xv, yv = r[1, 2, 0] - r[1, 0, 0], r[1, 2, 1] - r[1, 0, 1]
            known = _finite(r)
            if known and (_soft(r) > TIGHTEST**4 or not _may_hold(r, xu, yu, xv, yv, _WIDEN * bend)):
                continue
            det = xu * yv - yu * xv
            long_u, long_v = math.hypot(xu, yu), math.hypot(xv, yv)
            u, v = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
            linear = known and bend * max(long_u, long_v) < _LINEAR * abs(det)
            if not linear and depth < (_DEPTH if known else 8) and not (known and _all_near(r)):
                if known:
                    along_u = max(bend_u, 1e-3 * long_u) >= max(bend_v, 1e-3 * long_v)
                else:
                    along_u = int(depth) % 2 == 0
                nines[n_stack + 1] = r
                for half in range(2):
                    frame = frames[n_stack + half]
                    frame[0], frame[1], frame[2], frame[3], frame[4] = u0, u1, v0, v1, depth + 1.0
                    frame[(1 - half) if along_u else (3 - half)] = u if along_u else v
                    _fill_half(chart, cell, count, frame, nines[n_stack + half], along_u, half, problem, out)
                spent[0] += 6
                n_stack += 2
                continue
            if not known:
                continue
            if linear:
                x, y = r[1, 1, 0], r[1, 1, 1]
                du, dv = -(x * yv - y * xv) / det, -(xu * y - yu * x) / det
                if abs(du) > 0.75 or abs(dv) > 0.75:
                    continue
                u = min(max(u + du * (u1 - u0), 0.0), 1.0)
                v = min(max(v + dv * (v1 - v0), max(low, _LEAST)), 1.0)
            _sharpen(chart, cell, count, u, v, problem, out, side)
            spent[0] += 20
            if math.isfinite(out[2] + out[3] + out[4] + out[5]):
                n_starts = _add(out, starts, n_starts)
    return n_starts


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _all_near(nine):
    """Whether a cell's points all but vanish: at the tip of a chart no smaller cell is more nearly linear."""
    for i in range(3):
        for j in range(3):
            if abs(nine[i, j, 0]) + abs(nine[i, j, 1]) > _TIP:
                return False
    return True


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _soft(nine):
    """The least λ² of a cell's points."""
    least = math.inf
    for i in range(3):
        for j in range(3):
            least = min(least, nine[i, j, 2])
    return least


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _finite(nine):
    for i in range(3):
        for j in range(3):
            if not math.isfinite(nine[i, j, 0] + nine[i, j, 1]):
                return False
    return True


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _may_hold(r, xu, yu, xv, yv, pad):
    """Whether 0 may lie in the image of a cell: it does not if all nine points are on one side, farther than `pad`."""
    for direction in range(4):
        if direction == 0:
            nx, ny = 1.0, 0.0
        elif direction == 1:
            nx, ny = 0.0, 1.0
        elif direction == 2:
            nx, ny = -yu, xu
        else:
            nx, ny = -yv, xv
        size = math.hypot(nx, ny)
        if size == 0.0:
            continue
        low, high = math.inf, -math.inf
        for i in range(3):
            for j in range(3):
                side = (nx * r[i, j, 0] + ny * r[i, j, 1]) / size
                low, high = min(low, side), max(high, side)
        if low > pad or high < -pad:
            return False
    return True
