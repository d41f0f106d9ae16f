"""The λ-residual of a cubic Bézier and its gradient by the eight coordinates of the control points.

With Q = ∫r² ds, r = κ − a − bx − cy, and W = ∫κ² ds the residual is e = (Q/W)^½. At the best a, b, c the derivatives of Q by
them vanish, so only the curve itself is varied: for a displacement δ of γ, with C = γ' × γ'', V = |γ'|, κ = C/V³,

    δQ = ∫ 2r δC/V² − 2rV (b δx + c δy) + (r² − 6rκ) δV dt,   δV = γ'·δ'/V,   δC = δ' × γ'' + γ' × δ'',

δW is the same with r = κ and b = c = 0, and δe = (δQ − e² δW)/(2eW). The same holds for sums over nodes that stay, so the
gradient is that of the computed value. e is invariant under similarities, so everything is done in the frame of
`kernels.bezier`, in which a near-line lies along the real axis.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from batten.kernels.bezier import MOST_PANELS, dyadic_panels, fit_on_panels, polygon_frame
from batten.kernels.quadrature import NODES_24, WEIGHTS_24


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def _gradient(f, fit, lefts, widths, count, nodes, out):
    """δe in the frame by each control point into `out` (4, 2)."""
    a, b, c, _, energy, r2 = fit
    e2 = r2 / energy
    c1x, c2x, c3x = 3.0 * f[0], 3.0 * (f[2] - f[0]), f[4] - 2.0 * f[2] + f[0]
    c1y, c2y, c3y = 3.0 * f[1], 3.0 * (f[3] - f[1]), f[5] - 2.0 * f[3] + f[1]
    out[:] = 0.0
    for j in range(count):
        for i in range(24):
            t = lefts[j] + widths[j] * NODES_24[i]
            u = 1.0 - t
            w = widths[j] * WEIGHTS_24[i]
            dx, dy = (3.0 * c3x * t + 2.0 * c2x) * t + c1x, (3.0 * c3y * t + 2.0 * c2y) * t + c1y
            ddx, ddy = 6.0 * c3x * t + 2.0 * c2x, 6.0 * c3y * t + 2.0 * c2y
            v2 = dx * dx + dy * dy
            v = math.sqrt(v2)
            k = nodes[j, 2, i]
            r = k - a - b * nodes[j, 0, i] - c * nodes[j, 1, i]
            # What multiplies δ, δ' and δ'' in δQ − e² δW.
            by_c = 2.0 * w * (r - e2 * k) / v2
            by_v = w * (r * (r - 6.0 * k) + 5.0 * e2 * k * k) / v
            p = -2.0 * w * r * v
            px, py = p * b, p * c
            qx, qy = by_c * ddy + by_v * dx, by_v * dy - by_c * ddx
            rx, ry = -by_c * dy, by_c * dx
            b0, d0, h0 = u * u * u, -3.0 * u * u, 6.0 * u
            b1, d1, h1 = 3.0 * t * u * u, 3.0 * u * (1.0 - 3.0 * t), 18.0 * t - 12.0
            b2, d2, h2 = 3.0 * t * t * u, 3.0 * t * (2.0 - 3.0 * t), 6.0 - 18.0 * t
            b3, d3, h3 = t * t * t, 3.0 * t * t, 6.0 * t
            out[0, 0] += b0 * px + d0 * qx + h0 * rx
            out[0, 1] += b0 * py + d0 * qy + h0 * ry
            out[1, 0] += b1 * px + d1 * qx + h1 * rx
            out[1, 1] += b1 * py + d1 * qy + h1 * ry
            out[2, 0] += b2 * px + d2 * qx + h2 * rx
            out[2, 1] += b2 * py + d2 * qy + h2 * ry
            out[3, 0] += b3 * px + d3 * qx + h3 * rx
            out[3, 1] += b3 * py + d3 * qy + h3 * ry
    per = 0.5 / math.sqrt(r2 * energy)
    for i in range(4):
        out[i, 0] *= per
        out[i, 1] *= per


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def lambda_residual_gradient_batch(control_points, condition, values, gradients):
    """e_λ and its gradient for each row of `control_points` (n, 4, 2), into `values` (n,) and `gradients` (n, 4, 2).

    condition: from `panel_condition`, or 0 for one panel of 24 nodes whatever the curve. No gradient (NaN): lines, cusps,
    points, rows that are not finite.
    """
    most = MOST_PANELS if condition > 0.0 else 1
    nodes, lefts, widths = np.empty((most, 4, 24)), np.zeros(most), np.ones(most)
    for n in range(control_points.shape[0]):
        ux, uy, size, f, flag = polygon_frame(control_points[n])
        gradients[n] = math.nan
        if flag > 0:
            values[n] = 0.0 if flag == 1 else (1.0 if flag == 2 else math.nan)
            continue
        count, cusp = 1, False
        if condition > 0.0:
            count, cusp = dyadic_panels(f, condition, lefts, widths)
        fit = fit_on_panels(f, lefts, widths, count, nodes)
        values[n] = 1.0 if cusp else min(1.0, math.sqrt(fit[5] / fit[4]))
        if cusp:
            continue
        g = gradients[n]
        _gradient(f, fit, lefts, widths, count, nodes, g)
        # Back from the frame, where z' = (z − p₀)/u.
        cx, cy = ux / size / size, uy / size / size
        for i in range(4):
            gx, gy = g[i, 0], g[i, 1]
            g[i, 0], g[i, 1] = gx * cx - gy * cy, gx * cy + gy * cx
