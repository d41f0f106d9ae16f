"""How far a curve is from the elastica of its own curvature fit, and a bound on that from the residual along the curve.

γₑ has the start and the start tangent of γ and satisfies κₑ = a + bx + cy with the fitted a, b, c. With r = κ − a − bx − cy,
R(s) = ∫₀ˢ r, d = θ − θₑ and δ = γ − γₑ

    d = R + q,   q′ = b δx + c δy,   δ′ = e^{iθ} (1 − e^{−id}) = i e^{iθ} d + N,   |N| ≤ d²/2.

Without N this is w′ = g d, q′ = w with g = c cos θ − b sin θ, a linear equation along the *known* curve; its solution d̃
and δ̃ = ∫ i e^{iθ} d̃ are computed. Its Green's function is G(s, t) = d₂(s) d₁(t) − d₁(s) d₂(t) with the solutions d₁, d₂
for R = 0. With Λ = √(b² + c²), |b N_x + c N_y| ≤ Λ d²/2, so what N adds to d and δ is at most A and E, where

    A(s) = ½Λ ∫₀ˢ |G(s, t)| (|d̃| + A)² dt,   E(s) = ∫₀ˢ A + ½ (|d̃| + A)² dt.

Where that does not close, Gronwall's inequality with the signed R is left: |δ| ≤ E, E′ = |R| + A, A′ = ΛE; and |δ| is at
most |γ − γ(0)| + s.

Points lie on panels: both ends and 24 Gauss nodes, 25 cells to a panel. Functions are integrated by the polynomial
through the nodes, bounds by upper sums over cells. On a cell of width h, |f| ≤ ½ (|f₀| + |f₁| + h max|f′|), and what
satisfies f″ = gf (G in both arguments) is at most its greater end value over cos(√Λ h/2).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from batten.kernels.bezier import MOST_PANELS, dyadic_panels, fit_on_panels, polygon_frame
from batten.kernels.elastica import elastica_constants_exact, evaluate
from batten.kernels.quadrature import NODES_24


def _cumulative():
    """∫₀ˣ of the polynomial through values at the 24 nodes, for x each node and 1: (25, 24)."""
    x = np.append(2.0 * NODES_24 - 1.0, 1.0)
    values = np.polynomial.legendre.legvander(x[:24], 23)
    integrals = np.stack(
        [np.polynomial.legendre.legval(x, np.polynomial.legendre.legint(e, lbnd=-1)) for e in np.eye(24)]
    )
    found = 0.5 * np.linalg.solve(values.T, integrals).T
    found.setflags(write=False)
    return found


CUMULATIVE = _cumulative()
#: Rows of the points, and columns of what `bound_batch` returns.
X, Y, DX, DY, KAPPA, KAPPA_BEFORE = range(6)
DISTANCE, ANGLE, ALONG = range(3)
#: For the rounding of the elastica's points (1e-12 × length is what `Elastica` promises), added to the bound.
_ROUNDING = 1e-12
#: Bernstein ellipse of ρ = 3: the polynomials through 24 nodes are right to 3^(−24) times the singular part.
CONDITION = 5.0 / 3.0
#: Panels are at most this long in units of Λ^(−½), and at least this many are taken.
_LONGEST, _LEAST = 3.0, 8
#: With more points than this the Green's function is not tabulated.
_MOST_POINTS = 4000


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def split_panels(lefts, widths, lengths, count, stiffness, new_lefts, new_widths):
    """Cut panels of given arc `lengths` so that they are short enough: how many there are then, 0 if too many."""
    total = 0.0
    for j in range(count):
        total += lengths[j]
    found = 0
    for j in range(count):
        parts = max(1, math.ceil(max(stiffness * lengths[j] / _LONGEST, _LEAST * lengths[j] / total)))
        if found + parts > new_lefts.shape[0]:
            return 0
        for k in range(parts):
            new_widths[found] = widths[j] / parts
            new_lefts[found] = lefts[j] + k * widths[j] / parts
            found += 1
    return found


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def _points(f, lefts, widths, count, points):
    """x, y, x′, y′ (by t) and κ, twice, of the cubic of edges f at its 25 count + 1 points, into the rows of `points`."""
    c1x, c2x, c3x = 3.0 * f[0], 3.0 * (f[2] - f[0]), f[4] - 2.0 * f[2] + f[0]
    c1y, c2y, c3y = 3.0 * f[1], 3.0 * (f[3] - f[1]), f[5] - 2.0 * f[3] + f[1]
    q0 = 18.0 * (f[0] * f[3] - f[1] * f[2])
    q1 = 18.0 * (f[0] * f[5] - f[1] * f[4])
    q2 = 18.0 * (f[2] * f[5] - f[3] * f[4])
    for k in range(25 * count + 1):
        j, i = k // 25, k % 25
        t = 1.0
        if j < count:
            t = lefts[j] + (widths[j] * NODES_24[i - 1] if i > 0 else 0.0)
        u = 1.0 - t
        dx = (3.0 * c3x * t + 2.0 * c2x) * t + c1x
        dy = (3.0 * c3y * t + 2.0 * c2y) * t + c1y
        speed2 = dx * dx + dy * dy
        points[X, k] = ((c3x * t + c2x) * t + c1x) * t
        points[Y, k] = ((c3y * t + c2y) * t + c1y) * t
        points[DX, k], points[DY, k] = dx, dy
        points[KAPPA, k] = points[KAPPA_BEFORE, k] = ((u * q0 + t * q1) * u + t * t * q2) / (speed2 * math.sqrt(speed2))


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def _integrate(values, j, start, out):
    """start + ∫ of the values at the nodes of panel j (with their dt), into out at its points after the first."""
    for i in range(25):
        total = start
        for k in range(24):
            total += CUMULATIVE[i, k] * values[k]
        out[25 * j + 1 + i] = total


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def _linear(g, source, d0, w0, steps, count, d, w):
    """d = source + d₀ + ∫w, w = w₀ + ∫ g d along all panels, by Picard's iteration on each; `steps` (count, 24) hold ds."""
    values = np.empty(24)
    d[0], w[0] = source[0] + d0, w0
    q = d0
    for j in range(count):
        first = 25 * j
        for i in range(25):
            w[first + 1 + i] = w[first]
        last = math.inf
        for _ in range(60):
            for i in range(24):
                values[i] = w[first + 1 + i] * steps[j, i]
            _integrate(values, j, q, d)
            for i in range(24):
                d[first + 1 + i] += source[first + 1 + i]
                values[i] = g[first + 1 + i] * d[first + 1 + i] * steps[j, i]
            old = w[first + 25]
            middle = w[first + 12]
            _integrate(values, j, w[first], w)
            change = abs(w[first + 25] - old) + abs(w[first + 12] - middle)
            if change == 0.0 or (change >= last and change < 1e-13 * (abs(w[first + 25]) + abs(w[first + 12]))):
                break
            last = change
        q = d[first + 25]
        d[first + 25] += source[first + 25]


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def _second_order(s, d, slopes, slopes_before, d1, d2, stiffness, extra):
    """Upper bounds A of what N adds to d on each cell, into `extra`: whether there are finite ones."""
    cells = s.shape[0] - 1
    load = np.empty(cells)
    half = 0.5 * stiffness * stiffness
    for i in range(cells):
        h = s[i + 1] - s[i]
        m = 0.5 * (abs(d[i]) + abs(d[i + 1]) + h * max(abs(slopes[i]), abs(slopes_before[i + 1])))
        near = 1.0 / math.cos(0.5 * stiffness * h)
        total = 0.0
        for j in range(i):
            a = abs(d2[i] * d1[j] - d1[i] * d2[j])
            a = max(a, abs(d2[i + 1] * d1[j] - d1[i + 1] * d2[j]))
            a = max(a, abs(d2[i] * d1[j + 1] - d1[i] * d2[j + 1]))
            a = max(a, abs(d2[i + 1] * d1[j + 1] - d1[i + 1] * d2[j + 1]))
            total += a * load[j]
        total *= near
        # A = total + p (m + A)², the part of this cell itself: |G| ≤ sinh(√Λ h)/√Λ there. Its smaller root.
        p = half * h * (math.sinh(stiffness * h) / stiffness if stiffness > 0.0 else h)
        e = 1.0 - 2.0 * p * m
        root = e * e - 4.0 * p * (total + p * m * m)
        if not (e > 0.0 and root >= 0.0):
            return False
        extra[i] = 2.0 * (total + p * m * m) / (e + math.sqrt(root))
        load[i] = half * h * near * (m + extra[i]) ** 2
    return True


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def bound_of_points(points, widths, count, a, b, c, out):
    """The three columns named above, by the arc length, from points on `count` panels and κ ≈ a + b x + c y.

    `points` (6, ≥ 25 count + 1) begin in 0; where κ jumps (at ends of panels only), the sixth row holds the value before.
    `out`: the greatest distance and the greatest difference of angles at the points, and the bound along the curve.
    """
    n = 25 * count + 1
    s, theta, fitted = np.zeros(n), np.empty(n), np.zeros(n)
    steps, values = np.empty((count, 24)), np.empty(24)
    theta[0] = math.atan2(points[DY, 0], points[DX, 0])
    for k in range(1, n):
        cross = points[DX, k - 1] * points[DY, k] - points[DY, k - 1] * points[DX, k]
        dot = points[DX, k - 1] * points[DX, k] + points[DY, k - 1] * points[DY, k]
        theta[k] = theta[k - 1] + math.atan2(cross, dot)
    for j in range(count):
        for i in range(24):
            k = 25 * j + 1 + i
            steps[j, i] = widths[j] * math.hypot(points[DX, k], points[DY, k])
            values[i] = (a + b * points[X, k] + c * points[Y, k]) * steps[j, i]
        _integrate(values, j, fitted[25 * j], fitted)
        _integrate(steps[j], j, s[25 * j], s)
    length = s[n - 1]
    r, before, turned, g = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for k in range(n):
        r[k] = points[KAPPA, k] - a - b * points[X, k] - c * points[Y, k]
        before[k] = r[k] + points[KAPPA_BEFORE, k] - points[KAPPA, k]
        turned[k] = theta[k] - theta[0] - fitted[k]
        g[k] = c * math.cos(theta[k]) - b * math.sin(theta[k])
    # The elastica itself, in closed form.
    curve = np.empty((n, 4))
    evaluate(0.0, 0.0, theta[0], elastica_constants_exact(theta[0], a, -c, b), s, curve)
    far = angle = 0.0
    for k in range(n):
        far = max(far, math.hypot(points[X, k] - curve[k, 0], points[Y, k] - curve[k, 1]))
        angle = max(angle, abs(theta[k] - curve[k, 2]))
    out[DISTANCE], out[ANGLE] = far / length, angle
    # The linear equation, its two homogeneous solutions, and what is beyond it.
    stiffness = math.sqrt(math.hypot(b, c))
    d, w, nothing = np.empty(n), np.empty(n), np.zeros(n)
    d1, w1, d2, w2 = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    slopes, slopes_before, extra = np.empty(n), np.empty(n), np.empty(n)
    _linear(g, turned, 0.0, 0.0, steps, count, d, w)
    for k in range(n):
        slopes[k], slopes_before[k] = r[k] + w[k], before[k] + w[k]
    closes = False
    if n <= _MOST_POINTS:
        _linear(g, nothing, 1.0, 0.0, steps, count, d1, w1)
        _linear(g, nothing, 0.0, 1.0, steps, count, d2, w2)
        size = 0.0
        for k in range(n):
            size = max(size, abs(d1[k]), stiffness * abs(d2[k]), abs(w1[k]) / max(stiffness, 1e-300), abs(w2[k]))
        # G is a difference of products of these: beyond this their rounding would be seen.
        closes = size < 1e5 and _second_order(s, d, slopes, slopes_before, d1, d2, stiffness, extra)
    moved_x, moved_y = np.zeros(n), np.zeros(n)
    for j in range(count):
        for i in range(24):
            values[i] = -math.sin(theta[25 * j + 1 + i]) * d[25 * j + 1 + i] * steps[j, i]
        _integrate(values, j, moved_x[25 * j], moved_x)
        for i in range(24):
            values[i] = math.cos(theta[25 * j + 1 + i]) * d[25 * j + 1 + i] * steps[j, i]
        _integrate(values, j, moved_y[25 * j], moved_y)
    along = beyond = reach = push = 0.0
    for k in range(n - 1):
        h = s[k + 1] - s[k]
        m = 0.5 * (abs(turned[k]) + abs(turned[k + 1]) + h * max(abs(r[k]), abs(before[k + 1])))
        x = stiffness * h
        grown = math.sinh(x) / stiffness if stiffness > 0.0 else h
        reach, push = (
            math.cosh(x) * reach + grown * (push + m),
            stiffness * math.sinh(x) * reach + math.cosh(x) * (push + m) - m,
        )
        best = min(reach, math.hypot(points[X, k + 1], points[Y, k + 1]) + s[k + 1])
        if closes:
            m = 0.5 * (abs(d[k]) + abs(d[k + 1]) + h * max(abs(slopes[k]), abs(slopes_before[k + 1])))
            beyond += h * (extra[k] + 0.5 * (m + extra[k]) ** 2)
            ends = math.hypot(moved_x[k], moved_y[k]) + math.hypot(moved_x[k + 1], moved_y[k + 1])
            best = min(best, 0.5 * (ends + h * m) + beyond)
        along = max(along, best)
    out[ALONG] = along / length + _ROUNDING


@njit(cache=True, no_cfunc_wrapper=True, nogil=True, error_model="numpy")
def bound_batch(control_points, out, elastica):
    """`bound_of_points` for rows of control points (n, 4, 2), into `out` (n, 3) and the elastica's numbers (n, 7).

    Lines are their own elastica. NaN: points, rows that are not finite; cusps have NaN for the elastica and bounds of inf.
    """
    nodes, lefts, widths = np.empty((MOST_PANELS, 4, 24)), np.empty(MOST_PANELS), np.empty(MOST_PANELS)
    lengths, fine_lefts, fine_widths = np.empty(MOST_PANELS), np.empty(MOST_PANELS), np.empty(MOST_PANELS)
    points = np.empty((6, 25 * MOST_PANELS + 1))
    for n in range(control_points.shape[0]):
        p = control_points[n]
        ux, uy, size, f, flag = polygon_frame(p)
        out[n], elastica[n] = math.nan, math.nan
        if flag >= 3:
            continue
        count, cusp = dyadic_panels(f, CONDITION, lefts, widths)
        if cusp or flag == 2:
            out[n, ALONG] = math.inf
            continue
        a, b, c, length, _, _ = fit_on_panels(f, lefts, widths, count, nodes)
        if flag == 1:
            a = b = c = 0.0
        for j in range(count):
            lengths[j] = 0.0
            for i in range(24):
                lengths[j] += nodes[j, 3, i]
        fine = split_panels(lefts, widths, lengths, count, math.sqrt(math.hypot(b, c)), fine_lefts, fine_widths)
        # The elastica: κ·size = a + b x + c y with x + iy = (z − p₀)/u.
        turn = math.atan2(uy, ux)
        cx, cy = ux / size / size / size, uy / size / size / size
        elastica[n, 0], elastica[n, 1] = p[0, 0], p[0, 1]
        elastica[n, 3] = a / size
        elastica[n, 4], elastica[n, 5] = -(b * cy + c * cx), b * cx - c * cy
        elastica[n, 6] = length * size
        if flag == 1:
            out[n] = 0.0
            forward = f[0] + f[2] + f[4] > 0.0
            elastica[n, 2] = turn if forward else turn + math.pi
            continue
        if fine == 0:
            _points(f, lefts, widths, count, points)
            bound_of_points(points, widths, count, a, b, c, out[n])
            out[n, ALONG] = 2.0  # both curves have left their common start by one length at most
        else:
            _points(f, fine_lefts, fine_widths, fine, points)
            bound_of_points(points, fine_widths, fine, a, b, c, out[n])
        elastica[n, 2] = turn + math.atan2(points[DY, 0], points[DX, 0])
