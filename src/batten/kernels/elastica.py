"""The elastica in closed form, without special cases.

The curve solves θ″ = −λ₁ sin θ + λ₂ cos θ (Brander2016 eq. 1). With λ = |(λ₁, λ₂)|, ψ = θ − arg(λ₁, λ₂), and
a = sin(ψ/2), c = cos(ψ/2), q = κ/2, it is the top  a′ = cq, c′ = −aq, q′ = −λac  with the invariants a² + c² = 1 and
M = q² + λa² = λk².

Everything is expressed in the base functions with two parameters
    S(v; λ, M),  C = √(1 − λS²),  D = √(1 − MS²),  J = ∫₀ᵛ S²,   S′ = CD,  S(0) = 0,
that is S = sn(√λ v, k)/√λ, C = cn, D = dn. They are symmetric under λ ↔ M, C ↔ D (Jacobi's real transformation k → 1/k)
and analytic at λ = 0 (circle), M = 0 and λ = M (k = 1): there is no case to distinguish. They are computed by a power
series at v/2ʲ and j duplications in a form in which every sum has terms of one sign or carries the difference λ − M
explicitly. The state at v follows by the addition theorem, the displacement by the addition theorem about the midpoint,
where it factors; no difference of large numbers is left. λ − M is computed with twice the digits where it is small.
"""

import math

import numpy as np
from numba import njit

from batten.kernels.double_double import dd_add, dd_mul, dd_sin_cos, dd_sqrt, two_product

_TERMS = 14
_RADIUS = 0.35  # of the series; the nearest singularity lies at K′ ≥ π/2
_SPLIT_SUM = np.array([2.0 * n + 3.0 for n in range(_TERMS)])


@njit(cache=True, no_cfunc_wrapper=True)
def elastica_constants(theta, kappa, fx, fy):
    """Constants of a curve: (λ, q₀, a₀, c₀, Δ = λ − M, cos φ, sin φ), in plain double precision."""
    lam = math.hypot(fx, fy)
    q = 0.5 * kappa
    if lam == 0.0:
        return 0.0, q, math.sin(0.5 * theta), math.cos(0.5 * theta), -q * q, 1.0, 0.0
    ux, uy = fx / lam, fy / lam
    st, ct = math.sin(theta), math.cos(theta)
    cos_psi = ux * ct + uy * st
    sin_psi = ux * st - uy * ct
    root = math.sqrt(lam)
    if cos_psi >= 0.0:
        c = math.sqrt(0.5 * (1.0 + cos_psi))
        a = 0.5 * sin_psi / c
    else:
        a = math.copysign(math.sqrt(0.5 * (1.0 - cos_psi)), sin_psi)
        c = 0.5 * sin_psi / a
    delta = (root * c - abs(q)) * (root * c + abs(q))
    return lam, q, a, c, delta, ux, uy


@njit(cache=True, no_cfunc_wrapper=True)
def elastica_constants_exact(theta, kappa, fx, fy):
    """`elastica_constants` with Δ to about 30 digits before rounding, and c₀ relatively exact, where that matters."""
    lam, q, a, c, delta, ux, uy = elastica_constants(theta, kappa, fx, fy)
    scale = max(lam, q * q + lam * a * a)
    if (abs(delta) < 0.05 * scale or c * c < 0.01) and 1e-140 < lam < 1e140:
        sh, sl, ch, cl = dd_sin_cos(theta)
        h, e = two_product(fx, fx)
        g, f = two_product(fy, fy)
        nh, nl = dd_add(h, e, g, f)
        nh, nl = dd_sqrt(nh, nl)  # λ
        xh, xl = dd_mul(fx, 0.0, ch, cl)
        yh, yl = dd_mul(fy, 0.0, sh, sl)
        dh, dl = dd_add(xh, xl, yh, yl)  # λ cos ψ
        xh, xl = dd_mul(fx, 0.0, sh, sl)
        yh, yl = dd_mul(fy, 0.0, ch, cl)
        eh, el = dd_add(xh, xl, -yh, -yl)  # λ sin ψ
        if dh < 0.0:
            # 2λc² = λ + λ cos ψ = (λ sin ψ)² / (λ − λ cos ψ), without cancellation.
            c = 0.5 * (eh / lam) / a
            zh, zl = dd_mul(eh, el, eh, el)
            wh, wl = dd_add(nh, nl, -dh, -dl)
            h = zh / wh
            g, f = dd_mul(h, 0.0, wh, wl)
            g, f = dd_add(zh, zl, -g, -f)
            dh, dl = dd_add(h, 0.0, (g + f) / wh, 0.0)
        else:
            dh, dl = dd_add(nh, nl, dh, dl)
        h, e = two_product(q, q)
        dh, dl = dd_add(0.5 * dh, 0.5 * dl, -h, -e)
        delta = dh + dl
    return lam, q, a, c, delta, ux, uy


@njit(cache=True, no_cfunc_wrapper=True)
def base_series(p, c, w):
    """Coefficients in x = t² of sn(t | p)/t into `c` and of 3·∫sn²/t³-type sums into `w`: ∫₀ᵗ sn² = t³ Σ wₙ xⁿ."""
    c[0] = 1.0
    for n in range(_TERMS):
        total = 0.0
        for i in range(n + 1):
            total += c[i] * c[n - i]
        w[n] = total
        if n + 1 < _TERMS:
            cube = 0.0
            for i in range(n):
                cube += w[i] * c[n - 1 - i]
            c[n + 1] = (2.0 * p * cube - (1.0 + p) * c[n]) / ((2.0 * n + 3.0) * (2.0 * n + 2.0))
    for n in range(_TERMS):
        w[n] /= _SPLIT_SUM[n]


@njit(cache=True, no_cfunc_wrapper=True)
def base_series_tangent(p, c, dc, w, dw):
    """`base_series` together with the derivatives of its coefficients with respect to p."""
    c[0], dc[0] = 1.0, 0.0
    for n in range(_TERMS):
        total, slope = 0.0, 0.0
        for i in range(n + 1):
            total += c[i] * c[n - i]
            slope += 2.0 * c[i] * dc[n - i]
        w[n], dw[n] = total, slope
        if n + 1 < _TERMS:
            cube, dcube = 0.0, 0.0
            for i in range(n):
                cube += w[i] * c[n - 1 - i]
                dcube += dw[i] * c[n - 1 - i] + w[i] * dc[n - 1 - i]
            f = 1.0 / ((2.0 * n + 3.0) * (2.0 * n + 2.0))
            c[n + 1] = f * (2.0 * p * cube - (1.0 + p) * c[n])
            dc[n + 1] = f * (2.0 * (cube + p * dcube) - c[n] - (1.0 + p) * dc[n])
    for n in range(_TERMS):
        w[n] /= _SPLIT_SUM[n]
        dw[n] /= _SPLIT_SUM[n]


@njit(cache=True, no_cfunc_wrapper=True)
def base_at(v, lam, big_m, delta, c, w):
    """(S, C, D, J) at v, given the series of p = min(λ, M)/max(λ, M)."""
    top = max(lam, big_m)
    h = v
    halvings = 0
    size = abs(v) * math.sqrt(top)
    while size > _RADIUS and halvings < 100:
        size *= 0.5
        h *= 0.5
        halvings += 1
    x = top * h * h
    ps, pj = c[_TERMS - 1], w[_TERMS - 1]
    for n in range(_TERMS - 2, -1, -1):
        ps = ps * x + c[n]
        pj = pj * x + w[n]
    s = h * ps
    s2 = s * s
    cc = math.sqrt(1.0 - lam * s2)
    dd = math.sqrt(1.0 - big_m * s2)
    j = h * h * h * pj
    for _ in range(halvings):
        s2 = s * s
        c2 = cc * cc
        d2 = dd * dd
        inv = 1.0 / (c2 + lam * s2 * d2)
        c2d2 = c2 * d2
        ds2 = delta * s2
        sn = 2.0 * s * cc * dd * inv
        j = 2.0 * j + s2 * sn
        s = sn
        cc = (c2d2 - ds2) * inv
        dd = (c2d2 + ds2) * inv
    return s, cc, dd, j


@njit(cache=True, no_cfunc_wrapper=True)
def point_on(s, lam, q, a, c, delta, ser, wer):
    """In the frame of the force: displacement (X, Y) over arc length s, and the end state (a, c, q)."""
    big_m = q * q + lam * a * a
    v = 0.5 * s
    bs, bc, bd, bj = base_at(v, lam, big_m, delta, ser, wer)
    s2l = lam * bs * bs
    inv = 1.0 / (bc * bc + c * c * s2l)
    am = (a * bc * bd + bs * c * q) * inv
    cm = (c * bd - a * q * bs * bc) * inv
    qm = (q * bc - lam * a * c * bs * bd) * inv
    inv = 1.0 / (bc * bc + cm * cm * s2l)
    g = bs * bd * inv
    x = s - 4.0 * big_m * bj - 4.0 * am * am * bc * g
    y = 4.0 * am * cm * g
    a1 = (am * bc * bd + bs * cm * qm) * inv
    c1 = (cm * bd - am * qm * bs * bc) * inv
    q1 = (qm * bc - lam * am * cm * bs * bd) * inv
    return x, y, a1, c1, q1


@njit(cache=True, no_cfunc_wrapper=True)
def turning_rate(lam, q, a, delta):
    """Mean rate of ψ/2 along the curve, signed: √M·π/(2K(√p)) without inflections; 0 with inflections or at k = 1."""
    if delta >= 0.0:
        return 0.0
    big_m = q * q + lam * a * a
    x, y = 1.0, math.sqrt(-delta / big_m)
    if y == 0.0:
        return 0.0
    while abs(x - y) > 4e-16 * x:
        x, y = 0.5 * (x + y), math.sqrt(x * y)
    return math.copysign(math.sqrt(big_m) * x, q)  # K = π / (2 agm)


@njit(cache=True, no_cfunc_wrapper=True)
def half_turn(s, a, c, a1, c1, rate):
    """(ψ(s) − ψ(0))/2, continuous along the curve."""
    principal = math.atan2(a1 * c - c1 * a, c1 * c + a1 * a)
    if rate == 0.0:
        return principal
    return principal + 2.0 * math.pi * math.floor((rate * s - principal) / (2.0 * math.pi) + 0.5)


@njit(cache=True, no_cfunc_wrapper=True)
def evaluate(start_x, start_y, theta, constants, s, out):
    """Rows (x, y, θ, κ) at every arc length s (n,) into out (n, 4); `constants` from `elastica_constants` or `…_exact`."""
    lam, q, a, c, delta, ux, uy = constants
    big_m = q * q + lam * a * a
    ser = np.empty(_TERMS)
    wer = np.empty(_TERMS)
    top = max(lam, big_m)
    base_series(min(lam, big_m) / top if top > 0.0 else 0.0, ser, wer)
    rate = turning_rate(lam, q, a, delta)
    for i in range(s.shape[0]):
        x, y, a1, c1, q1 = point_on(s[i], lam, q, a, c, delta, ser, wer)
        out[i, 0] = start_x + ux * x - uy * y
        out[i, 1] = start_y + uy * x + ux * y
        out[i, 2] = theta + 2.0 * half_turn(s[i], a, c, a1, c1, rate)
        out[i, 3] = 2.0 * q1


@njit(cache=True, no_cfunc_wrapper=True)
def points_batch(parameters, fractions, out):
    """Points (n, m, 2) at `fractions` (m,) of the length of n curves (x, y, θ, κ, λ₁, λ₂, length), shape (n, 7)."""
    ser = np.empty(_TERMS)
    wer = np.empty(_TERMS)
    for k in range(parameters.shape[0]):
        x0, y0, theta, kappa, fx, fy, length = parameters[k]
        if not math.isfinite(x0 + y0 + theta + kappa + fx + fy + length):
            out[k] = math.nan
            continue
        lam, q, a, c, delta, ux, uy = elastica_constants_exact(theta, kappa, fx, fy)
        big_m = q * q + lam * a * a
        top = max(lam, big_m)
        base_series(min(lam, big_m) / top if top > 0.0 else 0.0, ser, wer)
        for i in range(fractions.shape[0]):
            x, y, _, _, _ = point_on(fractions[i] * length, lam, q, a, c, delta, ser, wer)
            out[k, i, 0] = x0 + ux * x - uy * y
            out[k, i, 1] = y0 + uy * x + ux * y


@njit(cache=True, no_cfunc_wrapper=True)
def states_grid(parameters, s, out):
    """(x, y, θ, κ) of n curves at m arc lengths each: parameters (n, 7), s (n, m), out (n, m, 4)."""
    for k in range(parameters.shape[0]):
        x0, y0, theta, kappa, fx, fy, _ = parameters[k]
        if not math.isfinite(x0 + y0 + theta + kappa + fx + fy):
            out[k] = math.nan
            continue
        evaluate(x0, y0, theta, elastica_constants_exact(theta, kappa, fx, fy), s[k], out[k])
