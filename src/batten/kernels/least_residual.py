"""The lengths of the outer edges of a cubic Bézier, directions kept, for which e_λ is least.

A shape is the array (c₁, s₁, c₂, s₂, chord) of the directions of the outer edges in standard position; chord is 1, or 0
where p₀ = p₃. (x, y) are the logarithms of the lengths of the edges; without a chord only x − y matters. For given
directions e² has one to five minima in a bent valley, and where two of them tie the lowest jumps. So there is the least
of

    F = e² + w d²/(1 + d²) + v c²/(σ² + c²) + walls,    d = |(x, y) − (x₀, y₀)|,    c = |(x, y) − (log 0.36, log 0.36)|,

with (x₀, y₀) as drawn and small w and v: among minima that are hardly worse than each other the one nearer to what was
drawn, and fewer ties where inflectional curves have several minima in a short valley. Without w there is neither of the
two.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from batten.kernels.bezier import MOST_PANELS, dyadic_panels, fit_on_panels, polygon_frame
from batten.kernels.bezier_projection import last_edges
from batten.kernels.quadrature import NODES_24, WEIGHTS_24

SHORTEST, LONGEST = math.log(0.1), math.log(6.0)  # walls: beyond them a square is added
_SUMS = {"reassoc", "contract", "arcp", "nsz"}  # sums and quotients whose order does not matter
GRID = 10
_CENTRE, _WIDTH, _CALM = math.log(0.36), 0.5, 2e-4  # a pull to where the valley of the inflectional curves is
_STARTS = 3  # of the grid
#: Columns of the tables of the least e over all lengths.
LEAST, AT_X, AT_Y = range(3)
MOST_FOUND = 3 + _STARTS
_APART = 0.3  # a start of the grid nearer to a minimum that was found is left out


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def workspace():
    """(control points, left ends, widths, values at nodes, a shape, lengths): what every evaluation writes to."""
    lefts, widths, nodes = np.zeros(MOST_PANELS), np.ones(MOST_PANELS), np.empty((MOST_PANELS, 4, 24))
    return np.zeros((4, 2)), lefts, widths, nodes, np.empty(5), np.empty(2)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy", fastmath=_SUMS)
def _inner_gradient(f, fit, lefts, widths, count, nodes):
    """The part of `lambda_residual_gradient._gradient` that belongs to p₁ and p₂: four numbers, in the frame."""
    a, b, c, _, energy, r2 = fit
    e2 = r2 / energy
    c1x, c2x, c3x = 3.0 * f[0], 3.0 * (f[2] - f[0]), f[4] - 2.0 * f[2] + f[0]
    c1y, c2y, c3y = 3.0 * f[1], 3.0 * (f[3] - f[1]), f[5] - 2.0 * f[3] + f[1]
    g1x = g1y = g2x = g2y = 0.0
    for j in range(count):
        left, width = lefts[j], widths[j]
        for i in range(24):
            t = left + width * NODES_24[i]
            u = 1.0 - t
            w = width * WEIGHTS_24[i]
            dx, dy = (3.0 * c3x * t + 2.0 * c2x) * t + c1x, (3.0 * c3y * t + 2.0 * c2y) * t + c1y
            ddx, ddy = 6.0 * c3x * t + 2.0 * c2x, 6.0 * c3y * t + 2.0 * c2y
            v = nodes[j, 3, i] / w
            k = nodes[j, 2, i]
            r = k - a - b * nodes[j, 0, i] - c * nodes[j, 1, i]
            per = 1.0 / v
            by_c = 2.0 * w * (r - e2 * k) * per * per
            by_v = w * (r * (r - 6.0 * k) + 5.0 * e2 * k * k) * per
            p = -2.0 * w * r * v
            px, py = p * b, p * c
            qx, qy = by_c * ddy + by_v * dx, by_v * dy - by_c * ddx
            rx, ry = -by_c * dy, by_c * dx
            b1, d1, h1 = 3.0 * t * u * u, 3.0 * u * (1.0 - 3.0 * t), 18.0 * t - 12.0
            b2, d2, h2 = 3.0 * t * t * u, 3.0 * t * (2.0 - 3.0 * t), 6.0 - 18.0 * t
            g1x += b1 * px + d1 * qx + h1 * rx
            g1y += b1 * py + d1 * qy + h1 * ry
            g2x += b2 * px + d2 * qx + h2 * rx
            g2y += b2 * py + d2 * qy + h2 * ry
    per = 0.5 / math.sqrt(r2 * energy)
    return g1x * per, g1y * per, g2x * per, g2y * per


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def residual(shape, x, y, condition, slopes, work):
    """(e, ∂e/∂x, ∂e/∂y, ∂e/∂θ₁, ∂e/∂θ₂); derivatives 0 unless `slopes`, and where there are none."""
    p, lefts, widths, nodes, _, _ = work
    l1, l2 = math.exp(x), math.exp(y)
    p[1, 0], p[1, 1] = l1 * shape[0], l1 * shape[1]
    p[2, 0], p[2, 1] = shape[4] + l2 * shape[2], l2 * shape[3]
    p[3, 0] = shape[4]
    ux, uy, size, f, flag = polygon_frame(p)
    if flag > 0:
        return 0.0 if flag == 1 else 1.0, 0.0, 0.0, 0.0, 0.0
    count, cusp = dyadic_panels(f, condition, lefts, widths)
    if cusp:
        return 1.0, 0.0, 0.0, 0.0, 0.0
    fit = fit_on_panels(f, lefts, widths, count, nodes)
    e = min(1.0, math.sqrt(fit[5] / fit[4]))
    if not slopes:
        return e, 0.0, 0.0, 0.0, 0.0
    ax, ay, bx, by = _inner_gradient(f, fit, lefts, widths, count, nodes)
    cx, cy = ux / size / size, uy / size / size
    ax, ay = ax * cx - ay * cy, ax * cy + ay * cx
    bx, by = bx * cx - by * cy, bx * cy + by * cx
    return (
        e,
        l1 * (ax * shape[0] + ay * shape[1]),
        l2 * (bx * shape[2] + by * shape[3]),
        l1 * (ay * shape[0] - ax * shape[1]),
        l2 * (by * shape[2] - bx * shape[3]),
    )


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _wall(x):
    """A square beyond the allowed lengths, and its derivative."""
    over = max(0.0, x - LONGEST) + min(0.0, x - SHORTEST)
    return over * over, 2.0 * over


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _pull(x, y, x0, y0, weight):
    """What F adds to e² within the walls, and its derivatives by x and y."""
    if weight == 0.0:
        return 0.0, 0.0, 0.0
    dx, dy, cx, cy = x - x0, y - y0, x - _CENTRE, y - _CENTRE
    far, out = 1.0 + dx * dx + dy * dy, _WIDTH * _WIDTH + cx * cx + cy * cy
    per, calm = 2.0 * weight / (far * far), 2.0 * _CALM * _WIDTH * _WIDTH / (out * out)
    return (
        weight * (1.0 - 1.0 / far) + _CALM * (1.0 - _WIDTH * _WIDTH / out),
        per * dx + calm * cx,
        per * dy + calm * cy,
    )


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def _aim(shape, x, y, x0, y0, weight, condition, work):
    """(F, ∂F/∂x, ∂F/∂y, e)."""
    e, ex, ey, _, _ = residual(shape, x, y, condition, True, work)
    wx, dwx = _wall(x)
    wy, dwy = _wall(y)
    pull, px, py = _pull(x, y, x0, y0, weight)
    return e * e + wx + wy + pull, 2.0 * e * ex + dwx + px, 2.0 * e * ey + dwy + py, e


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def minimum(shape, x, y, x0, y0, weight, close, condition, work):
    """BFGS from (x, y), to steps below `close`: (x, y, F, e)."""
    f, fx, fy, e = _aim(shape, x, y, x0, y0, weight, condition, work)
    hxx, hxy, hyy = 1.0, 0.0, 1.0
    first = True
    for _ in range(60):
        dx, dy = -(hxx * fx + hxy * fy), -(hxy * fx + hyy * fy)
        slope = dx * fx + dy * fy
        if not slope < 0.0:
            break
        length = math.hypot(dx, dy)
        limit = 0.15 if first else 0.3
        if length > limit or first:
            dx, dy, slope = dx * limit / length, dy * limit / length, slope * limit / length
            length = limit
        t = 1.0
        while True:
            nf, nfx, nfy, ne = _aim(shape, x + t * dx, y + t * dy, x0, y0, weight, condition, work)
            if nf <= f + 1e-4 * t * slope:
                break
            t *= max(0.1, min(0.5, -0.5 * slope * t / (nf - f - slope * t)))
            if t * length < 0.1 * close:
                return x, y, f, e
        sx, sy = t * dx, t * dy
        gx, gy = nfx - fx, nfy - fy
        x, y, f, fx, fy, e = x + sx, y + sy, nf, nfx, nfy, ne
        if t * length < close:
            break
        sg = sx * gx + sy * gy
        if sg > 1e-14 * math.hypot(sx, sy) * math.hypot(gx, gy):
            if first:
                hxx = hyy = sg / (gx * gx + gy * gy)
                first = False
            rho = 1.0 / sg
            qx, qy = hxx * gx + hxy * gy, hxy * gx + hyy * gy
            k = rho * (1.0 + rho * (gx * qx + gy * qy))
            hxx += k * sx * sx - 2.0 * rho * sx * qx
            hxy += k * sx * sy - rho * (sx * qy + qx * sy)
            hyy += k * sy * sy - 2.0 * rho * sy * qy
        else:
            first = True
            hxx, hxy, hyy = 1.0, 0.0, 1.0
    return x, y, f, e


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def fill_grid(shape, x0, y0, weight, rough, grid, work):
    """F without walls over the grid, into `grid`, whose rim stays infinite."""
    step = (LONGEST - SHORTEST) / (GRID - 1)
    for i in range(GRID):
        for j in range(GRID):
            x, y = SHORTEST + i * step, SHORTEST + j * step
            e = residual(shape, x, y, rough, False, work)[0]
            grid[i + 1, j + 1] = e * e + _pull(x, y, x0, y0, weight)[0]


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def lowest(shape, x0, y0, weight, close, condition, grid, found, work):
    """The least F of all lengths: (x, y, e), from the minima of a grid that is filled and from where they mostly lie.

    Those are (L̄₁, L̄₂) of Brander2018 §6 and two points of the valley of the inflectional curves, which lie too close to
    each other for a grid.
    """
    l1, l2 = last_edges(shape[0], shape[1], shape[2], shape[3])
    best, bx, by, be = math.inf, 0.0, 0.0, 1.0
    step = (LONGEST - SHORTEST) / (GRID - 1)
    last = -1.0
    for k in range(MOST_FOUND):
        if k == 0:
            x, y = min(LONGEST, max(SHORTEST, math.log(l1))), min(LONGEST, max(SHORTEST, math.log(l2)))
        elif k < 3:
            x = y = math.log(0.28) if k == 1 else math.log(0.45)
        else:
            low, li, lj = math.inf, 0, 0
            for i in range(1, GRID + 1):
                for j in range(1, GRID + 1):
                    v = grid[i, j]
                    if last < v < low:
                        sides = min(grid[i - 1, j], grid[i + 1, j], grid[i, j - 1], grid[i, j + 1])
                        if v <= sides and v <= min(
                            grid[i - 1, j - 1], grid[i - 1, j + 1], grid[i + 1, j - 1], grid[i + 1, j + 1]
                        ):
                            low, li, lj = v, i, j
            if low == math.inf:
                break
            last = low
            x, y = SHORTEST + (li - 1) * step, SHORTEST + (lj - 1) * step
            near = False
            for m in range(k):
                near = near or math.hypot(found[m, 0] - x, found[m, 1] - y) < _APART
            if near:
                found[k, 0], found[k, 1] = x, y
                continue
        x, y, f, e = minimum(shape, x, y, x0, y0, weight, close, condition, work)
        found[k, 0], found[k, 1] = x, y
        if f < best:
            best, bx, by, be = f, x, y, e
    return bx, by, be


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def turn(base, t1, t2, shape):
    """The shape with its outer edges turned by t₁ and t₂, into `shape`."""
    c, s = math.cos(t1), math.sin(t1)
    shape[0], shape[1] = base[0] * c - base[1] * s, base[0] * s + base[1] * c
    c, s = math.cos(t2), math.sin(t2)
    shape[2], shape[3] = base[2] * c - base[3] * s, base[2] * s + base[3] * c
    shape[4] = base[4]


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def least_tables(table, loops, rough, condition):
    """Least e of all lengths and where, (e, x, y), for directions of the outer edges in the middle of cells of a grid.

    table (n, n, 3): θ₁, θ₂, n a multiple of 2; a mirror image and a reversed curve share an entry. loops (m, 3): θ₁ −
    θ₂ of curves with p₀ = p₃.
    """
    work = workspace()
    grid = np.full((GRID + 2, GRID + 2), math.inf)
    found, shape = np.empty((MOST_FOUND, 2)), np.empty(5)
    n, half = len(table), len(table) // 2
    table[:, :, 0] = math.nan
    for i in range(n + 1):
        for j in range(n):
            if i == n:
                if j >= len(loops):
                    break
                theta1, theta2 = math.pi * (j + 0.5) / len(loops), -math.pi * (j + 0.5) / len(loops)
            else:
                if table[i, j, 0] == table[i, j, 0]:
                    continue
                theta1, theta2 = 2.0 * math.pi * (i + 0.5) / n, 2.0 * math.pi * (j + 0.5) / n
            shape[0], shape[1], shape[2], shape[3] = (
                math.cos(theta1),
                math.sin(theta1),
                math.cos(theta2),
                math.sin(theta2),
            )
            shape[4] = 0.0 if i == n else 1.0
            fill_grid(shape, 0.0, 0.0, 0.0, rough, grid, work)
            x, y, e = lowest(shape, 0.0, 0.0, 0.0, 1e-5, condition, grid, found, work)
            if i == n:
                loops[j, 0], loops[j, 1], loops[j, 2] = e, x, y
                continue
            i2, j2 = (half - 1 - j) % n, (half - 1 - i) % n
            table[i, j, 0], table[i, j, 1], table[i, j, 2] = e, x, y
            table[n - 1 - i, n - 1 - j] = table[i, j]
            table[i2, j2, 0], table[i2, j2, 1], table[i2, j2, 2] = e, y, x
            table[n - 1 - i2, n - 1 - j2] = table[i2, j2]
