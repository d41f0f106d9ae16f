"""Segments of log-aesthetic curves, κ = sign(s)|s|^α with α > 0, between two tangents (Levien2009 §4.8.1).

A segment of length 1 is the window [w − ½, w + ½] of A·sign(t)|t|^α; its mirror image has the other sign of A. With
β = α + 1, turn k₀ = A(|w + ½|^β − |w − ½|^β)/β and difference of the end curvatures k₁ = A(g(w + ½) − g(w − ½)), where
g(t) = sign(t)|t|^α; k₀/k₁ grows with w. As for the Euler spiral (α = 1) k₀ is given by the two angles, and the mean of the
angles grows with k₁: one bracketed root. w → ±∞ is a circle.
"""

import math

import numpy as np
from numba import njit

from batten.kernels.quadrature import NODES_16, WEIGHTS_16
from batten.kernels.spiral import BAD_INPUT, CONVERGED, FAILED, NO_SOLUTION, euler_spiral

_TWO_PI = 2.0 * math.pi
_SERIES = 3.0  # radians of turn up to which the power series about the inflection is used


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def half_sums(w, alpha):
    """(|w+½|^β − |w−½|^β)/β and g(w+½) − g(w−½), over |w|^α where |w| > 1: no digits are lost at a circle."""
    beta = alpha + 1.0
    if abs(w) <= 1.0:
        p, m = w + 0.5, w - 0.5
        turn = (abs(p) ** beta - abs(m) ** beta) / beta
        return turn, math.copysign(abs(p) ** alpha, p) - math.copysign(abs(m) ** alpha, m)
    h = 0.5 / abs(w)
    plus, minus = math.log1p(h), math.log1p(-h)
    turn = 2.0 * math.exp(0.5 * beta * (plus + minus)) * math.sinh(0.5 * beta * (plus - minus)) * w / beta
    change = 2.0 * math.exp(0.5 * alpha * (plus + minus)) * math.sinh(0.5 * alpha * (plus - minus))
    return turn, change


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _window(ratio, alpha):
    """w with k₀/k₁ = ratio, which grows with w, by Newton's method in a bracket; odd in the ratio."""
    target = abs(ratio)
    if target == 0.0:
        return 0.0
    low, high = 0.0, 1.0
    while True:
        turn, change = half_sums(high, alpha)
        if turn >= target * change or high > 1e17:
            break
        low = high
        high *= 4.0
    w = min(max(alpha * target, low), high)
    if not low < w < high:
        w = 0.5 * (low + high)
    for _ in range(200):
        turn, change = half_sums(w, alpha)
        miss = turn / change - target
        if miss > 0.0:
            high = w
        else:
            low = w
        step = 1e-6 * (w + 1e-3)
        turn2, change2 = half_sums(w + step, alpha)
        slope = (turn2 / change2 - turn / change) / step
        following = w - miss / slope if slope > 0.0 else 0.5 * (low + high)
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - w) <= 2e-16 * w:
            w = following
            break
        w = following
    return math.copysign(w, ratio)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _from_inflection(b, beta, x):
    """∫₀ˣ exp(i b t^β) dt for x ≥ 0 as (real, imaginary): the power series, and Gauss panels beyond it."""
    if x == 0.0:
        return 0.0, 0.0
    first = x
    if abs(b) * x**beta > _SERIES:
        first = (_SERIES / abs(b)) ** (1.0 / beta)
    phase = b * first**beta
    # Σ (i·phase)ⁿ/(n!(βn + 1)): terms below 3³/3! = 4.5 lose no digit to speak of.
    re, im = first, 0.0
    size = 1.0
    for n in range(1, 60):
        size *= phase / n
        term = first * size / (beta * n + 1.0)
        k = n % 4
        if k == 1:
            im += term
        elif k == 2:
            re -= term
        elif k == 3:
            im -= term
        else:
            re += term
        if abs(size) < 1e-18:
            break
    left = first
    while left < x:
        # Turn of at most 3 a panel, and never wider than its distance from the inflection.
        right = min(x, 1.8 * left, (left**beta + 3.0 / abs(b)) ** (1.0 / beta))
        if not right > left:
            break
        width = right - left
        for i in range(16):
            t = left + width * NODES_16[i]
            theta = b * t**beta
            re += width * WEIGHTS_16[i] * math.cos(theta)
            im += width * WEIGHTS_16[i] * math.sin(theta)
        left = right
    return re, im


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def log_aesthetic_chord(k0, k1, alpha):
    """(angle of the chord to the tangent at the start, its length, κ(0), κ(1), w) of the segment of length 1."""
    beta = alpha + 1.0
    if k1 == 0.0:
        half = 0.5 * k0
        return half, math.sin(half) / half if half != 0.0 else 1.0, k0, k0, math.inf
    w = _window(k0 / k1, alpha)
    turn, change = half_sums(w, alpha)
    if abs(w) > 1.0:
        # About the middle: θ(u) = m·(w/β)·((1 + u/w)^β − 1) with m the curvature in the middle.
        m = k0 / abs(turn)
        re, im = 0.0, 0.0
        panels = max(1, int(abs(m) * (1.0 + 0.5 / abs(w)) ** alpha / 3.0) + 2)
        width = 1.0 / panels
        for p in range(panels):
            for i in range(16):
                u = -0.5 + width * (p + NODES_16[i])
                theta = m * w / beta * math.expm1(beta * math.log1p(u / w))
                re += width * WEIGHTS_16[i] * math.cos(theta)
                im += width * WEIGHTS_16[i] * math.sin(theta)
        first = m * w / beta * math.expm1(beta * math.log1p(-0.5 / w))
        start = m * math.exp(alpha * math.log1p(-0.5 / w))
        return math.atan2(im, re) - first, math.hypot(re, im), start, start + k1, w
    a = k1 / change
    b = a / beta
    p, q = w + 0.5, w - 0.5
    re, im = _from_inflection(b, beta, abs(p))
    re2, im2 = _from_inflection(b, beta, abs(q))
    # The curve has odd curvature: θ is even, so that ∫ from −t to 0 equals ∫ from 0 to t.
    sign_p = 1.0 if p >= 0.0 else -1.0
    sign_q = 1.0 if q >= 0.0 else -1.0
    re, im = sign_p * re - sign_q * re2, sign_p * im - sign_q * im2
    first = b * abs(q) ** beta
    start = a * math.copysign(abs(q) ** alpha, q)
    # The chord lies within π of the tangent at the inflection if that is inside, and of the tangent in the middle if not.
    about = b * abs(w) ** beta if abs(w) > 0.5 else 0.0
    c, s = math.cos(about), math.sin(about)
    return about + math.atan2(c * im - s * re, c * re + s * im) - first, math.hypot(re, im), start, start + k1, w


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _miss(k0, k1, alpha, mean):
    """Mean angle of the segment minus the wanted one; the angle of its chord is made continuous in k₁."""
    angle, _, _, _, _ = log_aesthetic_chord(k0, k1, alpha)
    # Mean angle: (θ(0) + θ(1))/2 − chord = k₀/2 − angle, up to full turns; that for a circle is 0.
    value = 0.5 * k0 - angle
    return value - mean


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def log_aesthetic_segment(start, end, alpha, work, out):
    """The segment of chord 1 along the x-axis with tangent angles `start` and `end`.

    out: k₀, k₁ (for length 1), chord over length, curvatures at the ends for chord 1, and their derivatives as
    `spiral.euler_spiral`. Returns a status.
    """
    for j in range(9):
        out[j] = math.nan
    if not (math.isfinite(start) and math.isfinite(end)):
        return BAD_INPUT
    k0 = end - start
    mean = 0.5 * (start + end)
    status = euler_spiral(start, end, work, out)
    if status != CONVERGED or alpha == 1.0:
        return status
    # Bracket about the Euler spiral's k₁, then the method of Illinois.
    guess = out[1]
    if abs(mean) > 0.0:
        low, high = 0.5 * guess, 2.0 * guess
        f_low, f_high = _miss(k0, low, alpha, mean), _miss(k0, high, alpha, mean)
        for _ in range(60):
            if f_low * f_high <= 0.0:
                break
            if (f_high < 0.0) == (mean > 0.0):
                low, f_low = high, f_high
                high *= 1.6
                f_high = _miss(k0, high, alpha, mean)
            else:
                high, f_high = low, f_low
                low *= 0.5
                f_low = _miss(k0, low, alpha, mean)
        else:
            for j in range(9):
                out[j] = math.nan
            return NO_SOLUTION
        k1 = low
        side = 0
        status = FAILED
        for _ in range(100):
            k1 = high - f_high * (high - low) / (f_high - f_low) if f_high != f_low else 0.5 * (low + high)
            f = _miss(k0, k1, alpha, mean)
            if abs(f) <= 1e-15 * (1.0 + abs(mean)) or abs(high - low) <= 4e-16 * abs(k1):
                status = CONVERGED
                break
            if f * f_high > 0.0:
                high, f_high = k1, f
                if side == -1:
                    f_low *= 0.5
                side = -1
            else:
                low, f_low = k1, f
                if side == 1:
                    f_high *= 0.5
                side = 1
        if status == FAILED and abs(f) < 1e-12:
            status = CONVERGED
    else:
        k1 = 0.0
        status = CONVERGED
    _, c, kappa_start, kappa_end, w = log_aesthetic_chord(k0, k1, alpha)
    out[0], out[1], out[2] = k0, k1, c
    out[3], out[4] = kappa_start * c, kappa_end * c
    _slopes(start, end, c, kappa_start, kappa_end, k1, w, alpha, out)
    return status


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _slopes(start, end, c, kappa_start, kappa_end, k1, w, alpha, out):
    """Derivatives of the end curvatures by the angles, into out[5:9].

    The window's two ends are moved along the curve: dχ = (sin(end) db − sin(start) da)/c, dc = cos(end) db − cos(start) da.
    Near a circle this is singular, and to first order every such curve is an Euler spiral, whose derivatives stand in out.
    """
    if not abs(k1) > 1e-3 * (1.0 + abs(kappa_start)):
        return
    p, q = w + 0.5, w - 0.5
    # κ′ = A α |t|^(α−1); with A from the curvature at the farther end.
    if abs(p) >= abs(q):
        rate_end = alpha * kappa_end / p
        rate_start = rate_end * (abs(q) / abs(p)) ** (alpha - 1.0) if q != 0.0 else 0.0
    else:
        rate_start = alpha * kappa_start / q
        rate_end = rate_start * (abs(p) / abs(q)) ** (alpha - 1.0) if p != 0.0 else 0.0
    sa, ca, sb, cb = math.sin(start), math.cos(start), math.sin(end), math.cos(end)
    j00, j01 = kappa_start + sa / c, -sb / c
    j10, j11 = sa / c, kappa_end - sb / c
    det = j00 * j11 - j01 * j10
    n00, n01 = rate_start * c - kappa_start * ca, kappa_start * cb
    n10, n11 = -kappa_end * ca, rate_end * c + kappa_end * cb
    if det == 0.0 or not math.isfinite(rate_start + rate_end):
        return
    out[5] = (n00 * j11 - n01 * j10) / det
    out[6] = (n01 * j00 - n00 * j01) / det
    out[7] = (n10 * j11 - n11 * j10) / det
    out[8] = (n11 * j00 - n10 * j01) / det


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def log_aesthetic_batch(angles, alpha, out, status):
    """`log_aesthetic_segment` for rows (start, end) of angles; out is (n, 9)."""
    work = np.empty(6)
    for i in range(angles.shape[0]):
        status[i] = log_aesthetic_segment(angles[i, 0], angles[i, 1], alpha, work, out[i])


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def log_aesthetic_points(k0, k1, alpha, w, fractions, out):
    """Points at fractions of a segment of length 1 that starts at the origin along the x-axis; out is (n, 2)."""
    beta = alpha + 1.0
    turn, change = 0.0, 1.0
    if math.isfinite(w):
        turn, change = half_sums(w, alpha)
    near = math.isfinite(w) and abs(w) <= 1.0
    for i in range(fractions.shape[0]):
        f = fractions[i]
        re, im = 0.0, 0.0
        first = 0.0
        if near:
            a = k1 / change
            b = a / beta
            p, q = w - 0.5 + f, w - 0.5
            re, im = _from_inflection(b, beta, abs(p))
            re2, im2 = _from_inflection(b, beta, abs(q))
            sign_p = 1.0 if p >= 0.0 else -1.0
            sign_q = 1.0 if q >= 0.0 else -1.0
            re, im = sign_p * re - sign_q * re2, sign_p * im - sign_q * im2
            first = b * abs(q) ** beta
        elif math.isfinite(w):
            m = k0 / abs(turn)
            first = m * w / beta * math.expm1(beta * math.log1p(-0.5 / w))
            panels = max(1, int(abs(m) * (1.0 + 0.5 / abs(w)) ** alpha / 3.0) + 2)
            width = f / panels
            for j in range(panels):
                for k in range(16):
                    u = -0.5 + width * (j + NODES_16[k])
                    theta = m * w / beta * math.expm1(beta * math.log1p(u / w))
                    re += width * WEIGHTS_16[k] * math.cos(theta)
                    im += width * WEIGHTS_16[k] * math.sin(theta)
        else:
            half = 0.5 * k0 * f
            size = f * (math.sin(half) / half if half != 0.0 else 1.0)
            re, im = size * math.cos(half), size * math.sin(half)
        c, s = math.cos(first), math.sin(first)
        out[i, 0] = c * re + s * im
        out[i, 1] = c * im - s * re
