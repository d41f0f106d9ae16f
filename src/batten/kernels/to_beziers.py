"""Cubic Béziers for pieces of a curve that is a polynomial on each panel: by area and moment, distances bounded."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from batten.kernels.quadrature import NODES_24, WEIGHTS_24

_TERMS = 24
_SAMPLES = 32
_BISECTIONS = 52
_NEWTON = 12
#: Greatest step of a foot, in steps of the cubic: nearer to the centre of curvature the feet leap.
_LEAP = 2.0
#: Arms longer than this part of the arc length are not tried: a cubic with them makes a loop or runs far ahead.
_LONGEST = 1.2
#: Share of a panel from which the direction at a point of zero speed is taken.
_ASIDE = 1e-4


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _at(t, k, low, high, edges, coefficients):
    """(x, y, x', y', panel) at t, from panel k on; panels low … high only."""
    while t > edges[k + 1] and k < high:
        k += 1
    while t < edges[k] and k > low:
        k -= 1
    left, right = edges[k], edges[k + 1]
    z = (2.0 * t - left - right) / (right - left)
    x0 = x1 = y0 = y1 = u0 = u1 = v0 = v1 = 0.0
    for n in range(_TERMS - 1, 0, -1):
        x0, x1 = 2.0 * z * x0 - x1 + coefficients[k, 0, n], x0
        y0, y1 = 2.0 * z * y0 - y1 + coefficients[k, 1, n], y0
        u0, u1 = 2.0 * z * u0 - u1 + coefficients[k, 2, n], u0
        v0, v1 = 2.0 * z * v0 - v1 + coefficients[k, 3, n], v0
    x = z * x0 - x1 + coefficients[k, 0, 0]
    y = z * y0 - y1 + coefficients[k, 1, 0]
    u = z * u0 - u1 + coefficients[k, 2, 0]
    v = z * v0 - v1 + coefficients[k, 3, 0]
    return x, y, u, v, k


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _panel(t, edges, after):
    """The panel in which t lies; of two that meet there the one after or before it."""
    low, high = 0, edges.shape[0] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if edges[middle] < t or (after and edges[middle] == t):
            low = middle
        else:
            high = middle
    return low


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _end(t, k, sense, edges, coefficients):
    """(x, y, unit tangent) at an end of a piece; `sense` 1 at its start, −1 at its end. Zero speed: the limit."""
    x, y, u, v, _ = _at(t, k, k, k, edges, coefficients)
    speed = math.hypot(u, v)
    scale = 0.0
    for n in range(1, _TERMS):
        scale = max(scale, abs(coefficients[k, 2, n]), abs(coefficients[k, 3, n]))
    scale = max(scale, abs(coefficients[k, 2, 0]), abs(coefficients[k, 3, 0]))
    if speed <= 1e-9 * scale:
        step = sense * _ASIDE * (edges[k + 1] - edges[k])
        xa, ya, _, _, _ = _at(t + step, k, k, k, edges, coefficients)
        xb, yb, _, _, _ = _at(t + 0.5 * step, k, k, k, edges, coefficients)
        u, v = sense * (8.0 * (xb - x) - (xa - x)), sense * (8.0 * (yb - y) - (ya - y))
        speed = math.hypot(u, v)
    if speed == 0.0:
        return x, y, math.nan, math.nan
    return x, y, u / speed, v / speed


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _integrals(a, b, low, high, px, py, cx, cy, edges, coefficients):
    """(arc length, ∫ y dx, ∫ x y dx) from a to b, the last two in the frame of a chord c at p."""
    length = area = moment = 0.0
    square = cx * cx + cy * cy
    for k in range(low, high + 1):
        left, right = max(a, edges[k]), min(b, edges[k + 1])
        for i in range(_TERMS):
            x, y, u, v, _ = _at(left + (right - left) * NODES_24[i], k, k, k, edges, coefficients)
            w = WEIGHTS_24[i] * (right - left)
            xi = ((x - px) * cx + (y - py) * cy) / square
            eta = ((y - py) * cx - (x - px) * cy) / square
            slope = (u * cx + v * cy) / square
            length += w * math.hypot(u, v)
            area += w * eta * slope
            moment += w * xi * eta * slope
    return length, area, moment


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _value(q, degree, a):
    value = q[degree]
    for n in range(degree - 1, -1, -1):
        value = value * a + q[n]
    return value


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def quartic_places(q, most, out):
    """Real roots in (0, most) of q[0] + … + q[4] a⁴, and places between where its size is least; how many, `out` (8,)."""
    rows = np.zeros((5, 5))
    rows[4] = q
    for d in range(3, 0, -1):
        for n in range(d + 1):
            rows[d, n] = (n + 1) * rows[d + 1, n + 1]
    stops, found = np.empty(8), np.empty(8)
    count = 0
    for degree in range(1, 5):
        stops[0], stops[count + 1] = 0.0, most
        for i in range(count):
            stops[i + 1] = found[i]
        kept = 0
        for i in range(count + 1):
            left, right = stops[i], stops[i + 1]
            f, g = _value(rows[degree], degree, left), _value(rows[degree], degree, right)
            if (f < 0.0) == (g < 0.0) or f == 0.0:
                continue
            for _ in range(_BISECTIONS):
                middle = 0.5 * (left + right)
                if (_value(rows[degree], degree, middle) < 0.0) == (f < 0.0):
                    left = middle
                else:
                    right = middle
            if degree == 4:
                out[kept] = 0.5 * (left + right)
            else:
                found[kept] = 0.5 * (left + right)
            kept += 1
        if degree == 4:
            for i in range(count):  # a minimum of |q| without a root: two roots that have just met
                bend = 0.0
                for n in range(2, 5):
                    bend += n * (n - 1) * q[n] * found[i] ** (n - 2)
                if bend * _value(q, 4, found[i]) > 0.0 and kept < 8:
                    out[kept] = found[i]
                    kept += 1
        count = kept
    return count


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _arms(c0, s0, c1, s1, area, moment, most, arms):
    """Pairs of arms (8, 2) with the area and moment of a piece over a chord of length 1; how many."""
    p, q, g = 0.3 * s0, -0.3 * s1, 0.15 * (s1 * c0 - s0 * c1)
    m10, m01 = 17.0 / 140.0 * s0, -5.0 / 28.0 * s1
    m20, m02 = 3.0 / 56.0 * s0 * c0, 3.0 / 56.0 * s1 * c1
    m11 = (-33.0 * s0 * c1 + 9.0 * s1 * c0) / 280.0
    m21 = 9.0 / 280.0 * c0 * (s1 * c0 - s0 * c1)
    m12 = 9.0 / 280.0 * c1 * (s0 * c1 - s1 * c0)
    # (m10 a + m20 a² − M) D² + (m01 + m11 a + m21 a²) N D + (m02 + m12 a) N², N = A − p a, D = q + g a, b = N/D
    dd = (q * q, 2.0 * q * g, g * g)
    nd = (area * q, area * g - p * q, -p * g)
    nn = (area * area, -2.0 * area * p, p * p)
    first, second, third = (-moment, m10, m20), (m01, m11, m21), (m02, m12, 0.0)
    quartic, places = np.zeros(5), np.empty(8)
    for i in range(3):
        for j in range(3):
            quartic[i + j] += first[i] * dd[j] + second[i] * nd[j] + third[i] * nn[j]
    count = 0
    for i in range(quartic_places(quartic, most, places)):
        a = places[i]
        d = q + g * a
        b = (area - p * a) / d if d != 0.0 else -1.0
        if 0.0 < b < most:
            arms[count, 0], arms[count, 1] = a, b
            count += 1
    return count


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _stray(a, b, low, high, control, edges, coefficients):
    """A bound of the distance between a piece and a cubic with its ends and end tangents, both ways; inf if they part.

    Points of the cubic have their feet on the piece; those advance from end to end without a leap, so every point of the
    piece is a foot. Between the samples the offset is bounded by its second differences.
    """
    worst = bend = 0.0
    before = now = 0.0
    k, t, last = low, a, a
    _, _, dx, dy, _ = _at(a, low, low, high, edges, coefficients)
    speed, px, py = math.hypot(dx, dy), control[0, 0], control[0, 1]
    for i in range(1, _SAMPLES):
        r = i / _SAMPLES
        s = 1.0 - r
        w0, w1, w2, w3 = s * s * s, 3.0 * s * s * r, 3.0 * s * r * r, r * r * r
        x = w0 * control[0, 0] + w1 * control[1, 0] + w2 * control[2, 0] + w3 * control[3, 0]
        y = w0 * control[0, 1] + w1 * control[1, 1] + w2 * control[2, 1] + w3 * control[3, 1]
        u, v = 0.0, 0.0
        for j in range(3):
            w = 3.0 * (s * s if j == 0 else (2.0 * r * s if j == 1 else r * r))
            u += w * (control[j + 1, 0] - control[j, 0])
            v += w * (control[j + 1, 1] - control[j, 1])
        gx = gy = dx = dy = 0.0
        for n in range(_NEWTON):
            gx, gy, dx, dy, k = _at(t, k, low, high, edges, coefficients)
            square = dx * dx + dy * dy
            if square == 0.0:
                return math.inf
            step = ((x - gx) * dx + (y - gy) * dy) / square
            t = min(max(t + step, a), b)
            if abs(step) <= 1e-9 * (b - a) and n:
                break
        gx, gy, dx, dy, k = _at(t, k, low, high, edges, coefficients)
        new = math.hypot(dx, dy)
        if (
            t < last
            or not u * dx + v * dy > 0.0
            or not 0.5 * (speed + new) * (t - last) <= _LEAP * math.hypot(x - px, y - py)
        ):
            return math.inf
        last, speed, px, py = t, new, x, y
        offset = math.copysign(math.hypot(x - gx, y - gy), dx * (y - gy) - dy * (x - gx))
        worst = max(worst, abs(offset))
        bend = max(bend, abs(offset - 2.0 * now + before)) if i > 1 else abs(offset)
        before, now = now, offset
        t = min(t + (u * dx + v * dy) / (dx * dx + dy * dy) / _SAMPLES, b)
    if not speed * (b - last) <= 2.0 * _LEAP * math.hypot(control[3, 0] - px, control[3, 1] - py):
        return math.inf
    bend = max(bend, abs(before - 2.0 * now))
    return worst + bend * 1.25 / 8.0


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def cubic_piece(a, b, arms, edges, coefficients, out):
    """A bound of the distance of a cubic with given `arms`, (2,), from the piece a … b; control points to `out`, (4, 2).

    edges: (n + 1,), parameters between the panels. coefficients: (n, 4, 24), of x, y, x', y' in Chebyshev polynomials.
    """
    low, high = _panel(a, edges, True), _panel(b, edges, False)
    x0, y0, u0, v0 = _end(a, low, 1.0, edges, coefficients)
    x3, y3, u3, v3 = _end(b, high, -1.0, edges, coefficients)
    out[0, 0], out[0, 1] = x0, y0
    out[1, 0], out[1, 1] = x0 + arms[0] * u0, y0 + arms[0] * v0
    out[2, 0], out[2, 1] = x3 - arms[1] * u3, y3 - arms[1] * v3
    out[3, 0], out[3, 1] = x3, y3
    return _stray(a, b, low, high, out, edges, coefficients)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def fit_piece(a, b, edges, coefficients, arms):
    """The arms, (2,), of a good cubic for the piece from a to b, and a bound of its distance.

    Tried are the pairs with the piece's area and moment; where none of them is near, equal arms with its area, and thirds of
    its length. A piece that no cubic follows (at a cusp) has thirds and its own length as the bound.
    """
    low, high = _panel(a, edges, True), _panel(b, edges, False)
    x0, y0, u0, v0 = _end(a, low, 1.0, edges, coefficients)
    x3, y3, u3, v3 = _end(b, high, -1.0, edges, coefficients)
    cx, cy = x3 - x0, y3 - y0
    chord = math.hypot(cx, cy)
    if chord == 0.0:
        cx = 1.0
    length, area, moment = _integrals(a, b, low, high, x0, y0, cx, cy, edges, coefficients)
    arms[0] = arms[1] = length / 3.0
    if math.isnan(u0 + u3) or chord < 1e-6 * length:
        return length
    c0, s0 = (u0 * cx + v0 * cy) / chord, (v0 * cx - u0 * cy) / chord
    c1, s1 = (u3 * cx + v3 * cy) / chord, (v3 * cx - u3 * cy) / chord
    most = _LONGEST * length / chord
    pairs = np.empty((8, 2))
    count = _arms(c0, s0, c1, s1, area, moment, most, pairs)
    control = np.empty((4, 2))
    own = np.empty(2)
    best = math.inf
    for round_ in range(2):
        if round_ == 1:
            if best < 0.02 * length:
                break
            # Equal arms d with the area: (p + q) d + g d² = A; the smaller positive root.
            count = 0
            p, g = 0.3 * (s0 - s1), 0.15 * (s1 * c0 - s0 * c1)
            inside = p * p + 4.0 * g * area
            if inside >= 0.0 and p != 0.0:
                d = 2.0 * area / (p + math.copysign(math.sqrt(inside), p))
                if 0.0 < d < most:
                    pairs[0, 0] = pairs[0, 1] = d
                    count = 1
            pairs[count, 0] = pairs[count, 1] = length / chord / 3.0
            count += 1
        for i in range(count):
            own[0], own[1] = chord * pairs[i, 0], chord * pairs[i, 1]
            off = cubic_piece(a, b, own, edges, coefficients, control)
            if off < best:
                best = off
                arms[0], arms[1] = own[0], own[1]
    return best if best < math.inf else length
