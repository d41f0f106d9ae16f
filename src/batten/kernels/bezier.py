"""Cubic Béziers from their control points: the affine fit of the curvature behind the λ-residual.

An elastica has κ = λ₂x − λ₁y + α (Brander2016 (5)). For any other curve the least-squares solution of that equation
(Brander2016 (6)) and its residual say how far it is from one. Here the integrals of (6) are taken by Gauss–Legendre
rules and solved in a frame that is stable for every curve, near-lines included:

- the control polygon is moved to 0 and divided, as complex numbers, by the point of it farthest from its start, so that
  a near-line lies along the real axis and only the second coordinate is small;
- the 2 × 2 system is centred and orthogonalised, so that the small coordinate is not lost in the large one;
- a small residual is summed from its own values at the nodes, not taken as a difference of moments.

`NODES`-many values of one panel are one loop over a fixed count. These loops are compiled so that sums may be
reordered (they become vector code, three times as fast); nothing in them relies on the order, and NaN and infinity
keep their meaning. All that needs exact order, the frame and its differences, is in functions without that freedom.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from batten.kernels.quadrature import DEEPEST, NODES_24, WEIGHTS_24

#: Columns of what `curvature_fit_batch` returns.
LENGTH, ENERGY, RESIDUAL_SQUARED, LAMBDA_1, LAMBDA_2, ALPHA, LAMBDA_RESIDUAL = range(7)

MOST_PANELS = 512
_EPS = 2.220446049250313e-16
_SUMS = {"reassoc", "contract", "arcp", "nsz"}


@njit(cache=True, error_model="numpy", fastmath=_SUMS)
def panel_moments(f, left, width, nodes):
    """Write x, y, κ and ds at the 24 nodes of [left, left + width] to the rows of `nodes` (4, 24); return their moments.

    The curve starts at 0 and f is (f0x, f0y, f1x, f1y, f2x, f2y), the edges of its control polygon. γ' × γ'' is
    quadratic: 18 [(1−t)² f0×f1 + t(1−t) f0×f2 + t² f1×f2].
    """
    c1x, c2x, c3x = 3.0 * f[0], 3.0 * (f[2] - f[0]), f[4] - 2.0 * f[2] + f[0]
    c1y, c2y, c3y = 3.0 * f[1], 3.0 * (f[3] - f[1]), f[5] - 2.0 * f[3] + f[1]
    q0 = 18.0 * (f[0] * f[3] - f[1] * f[2])
    q1 = 18.0 * (f[0] * f[5] - f[1] * f[4])
    q2 = 18.0 * (f[2] * f[5] - f[3] * f[4])
    s = sx = sy = sk = sxx = sxy = syy = sxk = syk = skk = 0.0
    for i in range(24):
        t = left + width * NODES_24[i]
        u = 1.0 - t
        dx = (3.0 * c3x * t + 2.0 * c2x) * t + c1x
        dy = (3.0 * c3y * t + 2.0 * c2y) * t + c1y
        speed2 = dx * dx + dy * dy
        speed = math.sqrt(speed2)
        x = ((c3x * t + c2x) * t + c1x) * t
        y = ((c3y * t + c2y) * t + c1y) * t
        k = ((u * q0 + t * q1) * u + t * t * q2) / (speed2 * speed)
        w = speed * (width * WEIGHTS_24[i])
        nodes[0, i], nodes[1, i], nodes[2, i], nodes[3, i] = x, y, k, w
        wx, wy, wk = w * x, w * y, w * k
        s += w
        sx += wx
        sy += wy
        sk += wk
        sxx += wx * x
        sxy += wx * y
        syy += wy * y
        sxk += wx * k
        syk += wy * k
        skk += wk * k
    return s, sx, sy, sk, sxx, sxy, syy, sxk, syk, skk


@njit(cache=True, error_model="numpy", fastmath=_SUMS)
def affine_fit(moments, nodes, panels):
    """Least squares of κ ≈ a + b x + c y: (a, b, c, ∫ds, ∫κ²ds, ∫residual² ds) from the moments and the panels' nodes.

    Stable if y is not nearly proportional to x; a coordinate without variation of its own gets coefficient 0.
    """
    s, sx, sy, sk, sxx, sxy, syy, sxk, syk, skk = moments
    per = 1.0 / s
    mx, my, mk = sx * per, sy * per, sk * per
    cxx, cxy, cyy = sxx - mx * sx, sxy - mx * sy, syy - my * sy
    cxk, cyk = sxk - mx * sk, syk - my * sk
    b = c = 0.0
    if cxx > 0.0:
        slope = cxy / cxx
        rest = cyy - slope * cxy
        if rest > 1e-24 * cyy:
            c = (cyk - slope * cxk) / rest
        b = cxk / cxx - c * slope
    a = mk - b * mx - c * my
    # What the fit leaves, as a difference where that loses four digits at most, else from its own values.
    r2 = skk - mk * sk - b * cxk - c * cyk
    if r2 > 1e-4 * skk:
        return a, b, c, s, skk, r2
    r2 = 0.0
    for j in range(panels):
        for i in range(24):
            r = nodes[j, 2, i] - a - b * nodes[j, 0, i] - c * nodes[j, 1, i]
            r2 += nodes[j, 3, i] * r * r
    return a, b, c, s, skk, r2


@njit(cache=True, error_model="numpy")
def polygon_frame(p):
    """(ux, uy, |u|, edges, flag): the edges of the control polygon divided by u, from p[0] to its farthest point.

    flag: 0 curved, 1 a straight line run through in one direction, 2 a straight line that doubles back, 3 a single
    point, 4 not finite.
    """
    x1, y1 = p[1, 0] - p[0, 0], p[1, 1] - p[0, 1]
    x2, y2 = p[2, 0] - p[0, 0], p[2, 1] - p[0, 1]
    x3, y3 = p[3, 0] - p[0, 0], p[3, 1] - p[0, 1]
    a0, b0 = p[2, 0] - p[1, 0], p[2, 1] - p[1, 1]
    a1, b1 = p[3, 0] - p[2, 0], p[3, 1] - p[2, 1]
    size = 1.0
    n1, n2, n3 = x1 * x1 + y1 * y1, x2 * x2 + y2 * y2, x3 * x3 + y3 * y3
    if not 1e-200 < n1 + n2 + n3 < 1e200:
        size = max(abs(x1), abs(y1), abs(x2), abs(y2), abs(x3), abs(y3))
        total = p[0, 0] + p[0, 1] + x1 + y1 + x2 + y2 + x3 + y3
        if size == 0.0 or total - total != 0.0:
            return 0.0, 0.0, 0.0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 3 if total - total == 0.0 else 4
        x1, y1, x2, y2, x3, y3 = x1 / size, y1 / size, x2 / size, y2 / size, x3 / size, y3 / size
        a0, b0, a1, b1 = a0 / size, b0 / size, a1 / size, b1 / size
        n1, n2, n3 = x1 * x1 + y1 * y1, x2 * x2 + y2 * y2, x3 * x3 + y3 * y3
    ux = x2 if n2 > n1 else x1
    uy = y2 if n2 > n1 else y1
    far = n2 if n2 > n1 else n1
    ux = x3 if n3 > far else ux
    uy = y3 if n3 > far else uy
    far = n3 if n3 > far else far
    per = 1.0 / far
    cx, cy = ux * per, uy * per
    f = (
        x1 * cx + y1 * cy,
        y1 * cx - x1 * cy,
        a0 * cx + b0 * cy,
        b0 * cx - a0 * cy,
        a1 * cx + b1 * cy,
        b1 * cx - a1 * cy,
    )
    length = math.sqrt(far) * size
    flag = 0
    # What a rounding of the coordinates can move a control point by, times the length.
    noise = 4.0 * _EPS * (2.0 * length + abs(p[0, 0]) + abs(p[0, 1]))
    if max(abs(f[1]), abs(f[1] + f[3]), abs(f[1] + f[3] + f[5])) * length <= noise:
        flag = 1 if _one_direction(f[0], f[2], f[4], noise / length) else 2
    return ux * size, uy * size, length, f, flag


@njit(cache=True, error_model="numpy")
def _one_direction(f0, f1, f2, noise):
    """Whether f0 (1−t)² + 2 f1 t(1−t) + f2 t² keeps one sign on [0, 1], up to `noise`."""
    low, high = min(f0, f2), max(f0, f2)
    bend = f0 - 2.0 * f1 + f2
    t = (f0 - f1) / bend if bend != 0.0 else 0.0
    if 0.0 < t < 1.0:
        value = f0 + (f1 - f0) * t
        low, high = min(low, value), max(high, value)
    return low >= -noise or high <= noise


@njit(cache=True, error_model="numpy")
def _roots(f):
    """Zeros r₁, r₂ of the hodograph as a complex polynomial, real and imaginary parts: there |γ'|² = 0 (or at r̄₁, r̄₂).

    These are the singularities of every integrand here. A zero at infinity comes back as one far away.
    """
    ax, ay = f[0] - 2.0 * f[2] + f[4], f[1] - 2.0 * f[3] + f[5]
    bx, by = f[2] - f[0], f[3] - f[1]
    dx = bx * bx - by * by - (ax * f[0] - ay * f[1])
    dy = 2.0 * bx * by - (ax * f[1] + ay * f[0])
    size = math.sqrt(dx * dx + dy * dy)
    sx = math.sqrt(0.5 * (size + abs(dx)))
    sy = 0.5 * dy / sx if sx > 0.0 else 0.0
    if dx < 0.0:
        sx, sy = sy, sx
    if sx * bx + sy * by < 0.0:
        sx, sy = -sx, -sy
    qx, qy = -bx - sx, -by - sy
    q2, a2 = qx * qx + qy * qy, ax * ax + ay * ay
    r1x = r2x = 1e30
    r1y = r2y = 0.0
    if q2 < 1e60 * a2:
        r1x, r1y = (qx * ax + qy * ay) / a2, (qy * ax - qx * ay) / a2
    if f[0] * f[0] + f[1] * f[1] < 1e60 * q2:
        r2x, r2y = (f[0] * qx + f[1] * qy) / q2, (f[1] * qx - f[0] * qy) / q2
    return r1x, r1y, r2x, r2y


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def dyadic_panels(f, condition, lefts, widths):
    """Left ends and widths of dyadic panels that all meet `condition`: (how many, whether a cusp was met)."""
    r1x, r1y, r2x, r2y = _roots(f)
    cusp = False
    count = 0
    # The panel [index, index + 1] × width, where 1/width = 2^level: a walk over the binary tree without a stack.
    index, level, width = 0, 0, 1.0
    along, across = 1.0 / (condition * condition), 1.0 / (condition * condition - 1.0)
    while True:
        left = index * width
        # Both zeros outside the ellipse whose foci are the ends of the panel.
        u1, u2 = r1x - (left + 0.5 * width), r2x - (left + 0.5 * width)
        limit = 0.25 * width * width
        fits = u1 * u1 * along + r1y * r1y * across >= limit and u2 * u2 * along + r2y * r2y * across >= limit
        if not fits and level < DEEPEST:
            index, level, width = 2 * index, level + 1, 0.5 * width
            continue
        cusp = cusp or not fits
        lefts[count], widths[count] = left, width
        count += 1
        index += 1
        while index & 1 == 0:
            index, level, width = index >> 1, level - 1, 2.0 * width
        if level == 0 or count == MOST_PANELS:
            return count, cusp or level > 0


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def fit_on_panels(f, lefts, widths, count, nodes):
    """(a, b, c, ∫ds, ∫κ² ds, ∫r² ds) in the frame, with the values at the nodes of `count` panels left in `nodes`."""
    s = sx = sy = sk = sxx = sxy = syy = sxk = syk = skk = 0.0
    for j in range(count):
        m = panel_moments(f, lefts[j], widths[j], nodes[j])
        s, sx, sy, sk, sxx = s + m[0], sx + m[1], sy + m[2], sk + m[3], sxx + m[4]
        sxy, syy, sxk, syk, skk = sxy + m[5], syy + m[6], sxk + m[7], syk + m[8], skk + m[9]
    return affine_fit((s, sx, sy, sk, sxx, sxy, syy, sxk, syk, skk), nodes, count)


@njit(cache=True, error_model="numpy")
def _write_flat(flag, length, out):
    """The columns of a curve that has no curvature, by the flags of `polygon_frame`."""
    for j in range(7):
        out[j] = 0.0 if flag < 3 else math.nan
    if flag < 4:
        out[0] = length
    if flag == 2:
        out[1], out[2], out[6] = math.inf, math.inf, 1.0


@njit(cache=True, error_model="numpy")
def _write_fit(p, ux, uy, scale, fit, cusp, out):
    """The columns from the fit in the frame, where κ·scale = a + b x + c y with x + iy = (z − p₀)/u."""
    a, b, c, length, energy, r2 = fit
    per = 1.0 / scale
    cx, cy = ux * per * per * per, uy * per * per * per
    gx, gy = b * cx - c * cy, b * cy + c * cx
    ratio = math.sqrt(r2 / energy)
    out[0] = length * scale
    out[1] = energy * per
    out[2] = r2 * per
    out[3] = -gy
    out[4] = gx
    out[5] = a * per - gx * p[0, 0] - gy * p[0, 1]
    out[6] = 1.0 if ratio > 1.0 else ratio
    if cusp:
        out[1], out[2], out[6] = math.inf, math.inf, 1.0


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def curvature_fit_rows(control_points, condition, out, nodes, lefts, widths):
    """`curvature_fit_batch` with room for the nodes and panels, for callers that come again and again with few rows."""
    for i in range(control_points.shape[0]):
        p = control_points[i]
        ux, uy, scale, f, flag = polygon_frame(p)
        if flag >= 3:
            _write_flat(flag, 0.0, out[i])
            continue
        panels, cusp = 1, False
        if condition > 0.0:
            panels, cusp = dyadic_panels(f, condition, lefts, widths)
        if panels == 1:
            fit = affine_fit(panel_moments(f, 0.0, 1.0, nodes[0]), nodes, 1)
        else:
            fit = fit_on_panels(f, lefts, widths, panels, nodes)
        if flag > 0:
            _write_flat(flag, fit[3] * scale, out[i])
        else:
            _write_fit(p, ux, uy, scale, fit, cusp, out[i])


@njit(cache=True, error_model="numpy")
def curvature_fit_batch(control_points, condition, out):
    """Fit each row of `control_points` (n, 4, 2) and write the seven columns named above to `out` (n, 7).

    condition: from `panel_condition`, or 0 for one panel of 24 nodes whatever the curve.
    """
    most = MOST_PANELS if condition > 0.0 else 1
    curvature_fit_rows(control_points, condition, out, np.empty((most, 4, 24)), np.empty(most), np.empty(most))
