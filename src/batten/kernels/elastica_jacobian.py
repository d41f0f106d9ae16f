"""Derivatives of an elastica with respect to its stored numbers.

Forward differentiation of the closed form of `elastica.py`: base functions with respect to (λ, M), then the state and the
displacement with respect to (ψ₀, q₀, λ) in the frame of the force, then the six stored numbers. The derivative with
respect to the force's direction is (1/λ)·(something that vanishes with λ), so where λ is small against 1/s² or κ² the
variational equations are integrated by Taylor series instead: there the curve is nearly a circle and a few steps do.
"""

import math

import numpy as np
from numba import njit

from batten.kernels.elastica import (
    _RADIUS,
    _TERMS,
    base_series_tangent,
    elastica_constants,
    half_turn,
    turning_rate,
)

_ORDER = 22


@njit(cache=True, no_cfunc_wrapper=True)
def base_tangent_at(v, lam, big_m, delta, c, dc, w, dw, out):
    """(S, C, D, J) at v in row 0 of `out` (3, 4), with derivatives in rows 1 and 2.

    Row 1: by λ at fixed M, that is by Δ = λ − M; row 2: by λ and M together, at fixed Δ. Near k = 1 the former grows like
    exp(2√λ v): apart, a motion that keeps Δ is not spoilt by it.
    """
    swap = big_m > lam
    top = max(lam, big_m)
    p = min(lam, big_m) / top if top > 0.0 else 0.0
    h = v
    halvings = 0
    size = abs(v) * math.sqrt(top)
    while size > _RADIUS and halvings < 100:
        size *= 0.5
        h *= 0.5
        halvings += 1
    h2 = h * h
    x = top * h2
    last = _TERMS - 1
    ps, pj = c[last], w[last]
    # d/d(min) = Σ ĉ′ₙ xⁿ⁻¹ h², d/d(max) = Σ (n ĉₙ − p ĉ′ₙ) xⁿ⁻¹ h² (homogeneous polynomials)
    s_min, j_min = dc[last], dw[last]
    s_max, j_max = last * c[last] - p * dc[last], last * w[last] - p * dw[last]
    for n in range(last - 1, -1, -1):
        ps = ps * x + c[n]
        pj = pj * x + w[n]
        if n > 0:
            s_min = s_min * x + dc[n]
            j_min = j_min * x + dw[n]
            s_max = s_max * x + (n * c[n] - p * dc[n])
            j_max = j_max * x + (n * w[n] - p * dw[n])
    h3 = h * h2
    s, j = h * ps, h3 * pj
    sl = h3 * (s_min if swap else s_max)
    jl = h3 * h2 * (j_min if swap else j_max)
    sm = h3 * (s_min + s_max)
    jm = h3 * h2 * (j_min + j_max)
    s2 = s * s
    cc = math.sqrt(1.0 - lam * s2)
    dd = math.sqrt(1.0 - big_m * s2)
    cl = -(s2 + 2.0 * lam * s * sl) / (2.0 * cc)
    cm = -(s2 + 2.0 * lam * s * sm) / (2.0 * cc)
    dl = -(big_m * s * sl) / dd
    dm = -(s2 + 2.0 * big_m * s * sm) / (2.0 * dd)
    for _ in range(halvings):
        s2 = s * s
        c2 = cc * cc
        d2 = dd * dd
        den = c2 + lam * s2 * d2
        inv = 1.0 / den
        scd = s * cc * dd
        c2d2 = c2 * d2
        ds2 = delta * s2
        sn = 2.0 * scd * inv
        cn = (c2d2 - ds2) * inv
        dn = (c2d2 + ds2) * inv
        # λ alone
        ds = 2.0 * s * sl
        dc2 = 2.0 * cc * cl
        dd2 = 2.0 * dd * dl
        dden = dc2 + s2 * d2 + lam * (ds * d2 + s2 * dd2)
        dprod = dc2 * d2 + c2 * dd2
        ddel = s2 + delta * ds
        sl_new = (2.0 * (sl * cc * dd + s * cl * dd + s * cc * dl) - sn * dden) * inv
        cl = (dprod - ddel - cn * dden) * inv
        dl = (dprod + ddel - dn * dden) * inv
        jl = 2.0 * jl + ds * sn + s2 * sl_new
        # λ and M together
        ds = 2.0 * s * sm
        dc2 = 2.0 * cc * cm
        dd2 = 2.0 * dd * dm
        dden = dc2 + s2 * d2 + lam * (ds * d2 + s2 * dd2)
        dprod = dc2 * d2 + c2 * dd2
        ddel = delta * ds
        sm_new = (2.0 * (sm * cc * dd + s * cm * dd + s * cc * dm) - sn * dden) * inv
        cm = (dprod - ddel - cn * dden) * inv
        dm = (dprod + ddel - dn * dden) * inv
        jm = 2.0 * jm + ds * sn + s2 * sm_new
        j = 2.0 * j + s2 * sn
        s, cc, dd = sn, cn, dn
        sl, sm = sl_new, sm_new
    out[0, 0], out[0, 1], out[0, 2], out[0, 3] = s, cc, dd, j
    out[1, 0], out[1, 1], out[1, 2], out[1, 3] = sl, cl, dl, jl
    out[2, 0], out[2, 1], out[2, 2], out[2, 3] = sm, cm, dm, jm


@njit(cache=True, no_cfunc_wrapper=True)
def point_tangent(s, lam, q, a, c, delta, ser, dser, wer, dwer, base, out):
    """Row 0 of `out` (4, 5): X, Y, a, c, q at s; rows 1–3: derivatives with respect to (ψ₀, q₀, λ); frame of the force."""
    big_m = q * q + lam * a * a
    base_tangent_at(0.5 * s, lam, big_m, delta, ser, dser, wer, dwer, base)
    bs, bc, bd, bj = base[0]
    s2 = bs * bs
    s2l = lam * s2
    den1 = bc * bc + c * c * s2l
    inv1 = 1.0 / den1
    am = (a * bc * bd + bs * c * q) * inv1
    cm = (c * bd - a * q * bs * bc) * inv1
    qm = (q * bc - lam * a * c * bs * bd) * inv1
    den2 = bc * bc + cm * cm * s2l
    inv2 = 1.0 / den2
    g = bs * bd * inv2
    out[0, 0] = s - 4.0 * big_m * bj - 4.0 * am * am * bc * g
    out[0, 1] = 4.0 * am * cm * g
    a1 = (am * bc * bd + bs * cm * qm) * inv2
    c1 = (cm * bd - am * qm * bs * bc) * inv2
    q1 = (qm * bc - lam * am * cm * bs * bd) * inv2
    out[0, 2], out[0, 3], out[0, 4] = a1, c1, q1
    for k in range(3):
        if k == 0:
            ad, cd, qd, ld = 0.5 * c, -0.5 * a, 0.0, 0.0
            md = lam * a * c
            deltad = -md
        elif k == 1:
            ad, cd, qd, ld = 0.0, 0.0, 1.0, 0.0
            md = 2.0 * q
            deltad = -md
        else:
            ad, cd, qd, ld = 0.0, 0.0, 0.0, 1.0
            md = a * a
            deltad = c * c
        sd = base[1, 0] * deltad + base[2, 0] * md
        bcd = base[1, 1] * deltad + base[2, 1] * md
        bdd = base[1, 2] * deltad + base[2, 2] * md
        jd = base[1, 3] * deltad + base[2, 3] * md
        s2ld = ld * s2 + 2.0 * lam * bs * sd
        d1 = 2.0 * bc * bcd + 2.0 * c * cd * s2l + c * c * s2ld
        amd = (ad * bc * bd + a * bcd * bd + a * bc * bdd + sd * c * q + bs * cd * q + bs * c * qd - am * d1) * inv1
        cmd = (
            cd * bd + c * bdd - ad * q * bs * bc - a * qd * bs * bc - a * q * sd * bc - a * q * bs * bcd - cm * d1
        ) * inv1
        qmd = (
            qd * bc + q * bcd - ld * a * c * bs * bd - lam * (ad * c * bs * bd + a * cd * bs * bd)
            - lam * a * c * (sd * bd + bs * bdd) - qm * d1
        ) * inv1  # fmt: skip
        d2 = 2.0 * bc * bcd + 2.0 * cm * cmd * s2l + cm * cm * s2ld
        gd = (sd * bd + bs * bdd - g * d2) * inv2
        out[k + 1, 0] = -4.0 * (md * bj + big_m * jd) - 8.0 * am * amd * bc * g - 4.0 * am * am * (bcd * g + bc * gd)
        out[k + 1, 1] = 4.0 * ((amd * cm + am * cmd) * g + am * cm * gd)
        out[k + 1, 2] = (
            amd * bc * bd + am * bcd * bd + am * bc * bdd + sd * cm * qm + bs * cmd * qm + bs * cm * qmd - a1 * d2
        ) * inv2
        out[k + 1, 3] = (
            cmd * bd + cm * bdd - amd * qm * bs * bc - am * qmd * bs * bc - am * qm * (sd * bc + bs * bcd) - c1 * d2
        ) * inv2
        out[k + 1, 4] = (
            qmd * bc + qm * bcd - ld * am * cm * bs * bd - lam * (amd * cm + am * cmd) * bs * bd
            - lam * am * cm * (sd * bd + bs * bdd) - q1 * d2
        ) * inv2  # fmt: skip


@njit(cache=True, no_cfunc_wrapper=True)
def _taylor_step(state, fx, fy, ser):
    """Taylor coefficients about `state` of (θ, x, y) and of the derivatives by (κ₀, λ₁, λ₂), into `ser` (12, order + 1).

    Rows of `ser` and entries of `state`: 0–2 θ, x, y; 3–5 ∂θ; 6–8 ∂x; 9–11 ∂y. `state` (16,) also holds κ in 12 and
    ∂κ in 13–15.
    """
    sn = np.empty(_ORDER + 1)
    cs = np.empty(_ORDER + 1)
    th, px, py = ser[0], ser[1], ser[2]
    th[0], th[1] = state[0], state[12]
    px[0], py[0] = state[1], state[2]
    for j in range(3):
        ser[3 + j, 0], ser[3 + j, 1] = state[3 + j], state[13 + j]
        ser[6 + j, 0], ser[9 + j, 0] = state[6 + j], state[9 + j]
    sn[0], cs[0] = math.sin(th[0]), math.cos(th[0])
    for n in range(_ORDER):
        if n > 0:
            a, b = 0.0, 0.0
            for i in range(1, n + 1):
                a += i * th[i] * cs[n - i]
                b += i * th[i] * sn[n - i]
            sn[n], cs[n] = a / n, -b / n
        if n + 2 <= _ORDER:
            th[n + 2] = (fy * cs[n] - fx * sn[n]) / ((n + 1.0) * (n + 2.0))
        px[n + 1] = cs[n] / (n + 1.0)
        py[n + 1] = sn[n] / (n + 1.0)
        for j in range(3):
            u = ser[3 + j]
            us, uc = 0.0, 0.0
            for i in range(n + 1):
                us += u[i] * sn[n - i]
                uc += u[i] * cs[n - i]
            if n + 2 <= _ORDER:
                g = -sn[n] if j == 1 else (cs[n] if j == 2 else 0.0)
                u[n + 2] = (g - fx * uc - fy * us) / ((n + 1.0) * (n + 2.0))
            ser[6 + j, n + 1] = -us / (n + 1.0)
            ser[9 + j, n + 1] = uc / (n + 1.0)


@njit(cache=True, no_cfunc_wrapper=True)
def jacobian_taylor(theta, kappa, fx, fy, s, out):
    """Derivatives by Taylor steps: fills `out` (n, 3, 6) at ascending arc lengths s (n,), negative ones too."""
    bound = abs(kappa) + 3.0 * math.sqrt(math.hypot(fx, fy))
    step = 0.8 / bound if bound > 0.0 else math.inf
    n_s = s.shape[0]
    ser = np.zeros((12, _ORDER + 1))
    state = np.zeros(16)
    for sign in (1.0, -1.0):
        here = 0.0
        state[:] = 0.0
        state[0], state[12], state[13] = theta, kappa, 1.0
        _taylor_step(state, fx, fy, ser)
        for i in range(n_s):
            index = i if sign > 0.0 else n_s - 1 - i
            if s[index] * sign < 0.0 or (s[index] == 0.0 and sign < 0.0):
                continue
            while abs(s[index] - here) > step:
                h = sign * step
                for r in range(12):
                    total, slope = ser[r, _ORDER], 0.0
                    for n in range(_ORDER - 1, -1, -1):
                        slope = slope * h + total
                        total = total * h + ser[r, n]
                    state[r] = total
                    if r == 0:
                        state[12] = slope
                    elif 3 <= r < 6:
                        state[10 + r] = slope
                here += h
                _taylor_step(state, fx, fy, ser)
            h = s[index] - here
            value = np.empty(12)
            for r in range(12):
                total = ser[r, _ORDER]
                for n in range(_ORDER - 1, -1, -1):
                    total = total * h + ser[r, n]
                value[r] = total
            row = out[index]
            row[:, :] = 0.0
            row[0, 0], row[1, 1] = 1.0, 1.0
            for j in range(3):
                row[0, 3 + j], row[1, 3 + j], row[2, 3 + j] = value[6 + j], value[9 + j], value[3 + j]
            row[0, 2] = -value[2] + fy * row[0, 4] - fx * row[0, 5]
            row[1, 2] = value[1] + fy * row[1, 4] - fx * row[1, 5]
            row[2, 2] = 1.0 + fy * row[2, 4] - fx * row[2, 5]


@njit(cache=True, no_cfunc_wrapper=True)
def jacobian(start_x, start_y, theta, kappa, fx, fy, constants, s, values, out):
    """Values (n, 4) as `elastica.evaluate`, and derivatives of (x, y, θ) by (x₀, y₀, θ₀, κ₀, λ₁, λ₂), shape (n, 3, 6).

    Arc lengths s (n,) ascend. Points with λs² < 1e-3 lose digits in the last two columns if the others are far away.
    """
    lam, q, a, c, delta, ux, uy = constants
    n_s = s.shape[0]
    big_m = q * q + lam * a * a
    top = max(lam, big_m)
    ser, dser = np.empty(_TERMS), np.empty(_TERMS)
    wer, dwer = np.empty(_TERMS), np.empty(_TERMS)
    base_series_tangent(min(lam, big_m) / top if top > 0.0 else 0.0, ser, dser, wer, dwer)
    rate = turning_rate(lam, q, a, delta)
    base = np.empty((3, 4))
    row = np.empty((4, 5))
    for i in range(n_s):
        point_tangent(s[i], lam, q, a, c, delta, ser, dser, wer, dwer, base, row)
        x, y, a1, c1 = row[0, 0], row[0, 1], row[0, 2], row[0, 3]
        gx, gy = ux * x - uy * y, uy * x + ux * y
        values[i, 0], values[i, 1] = start_x + gx, start_y + gy
        values[i, 2] = theta + 2.0 * half_turn(s[i], a, c, a1, c1, rate)
        values[i, 3] = 2.0 * row[0, 4]
        o = out[i]
        o[0, 0], o[0, 1], o[1, 0], o[1, 1], o[2, 0], o[2, 1] = 1.0, 0.0, 0.0, 1.0, 0.0, 0.0
        o[0, 2] = ux * row[1, 0] - uy * row[1, 1]
        o[1, 2] = uy * row[1, 0] + ux * row[1, 1]
        o[0, 3] = 0.5 * (ux * row[2, 0] - uy * row[2, 1])
        o[1, 3] = 0.5 * (uy * row[2, 0] + ux * row[2, 1])
        norm = 2.0 / (a1 * a1 + c1 * c1)
        o[2, 2] = norm * (c1 * row[1, 2] - a1 * row[1, 3])
        o[2, 3] = 0.5 * norm * (c1 * row[2, 2] - a1 * row[2, 3])
        if lam > 0.0:
            rx, ry = ux * row[3, 0] - uy * row[3, 1], uy * row[3, 0] + ux * row[3, 1]
            rt = norm * (c1 * row[3, 2] - a1 * row[3, 3])
            tx, ty, tt = (-gy - o[0, 2]) / lam, (gx - o[1, 2]) / lam, (1.0 - o[2, 2]) / lam
            o[0, 4], o[0, 5] = ux * rx - uy * tx, uy * rx + ux * tx
            o[1, 4], o[1, 5] = ux * ry - uy * ty, uy * ry + ux * ty
            o[2, 4], o[2, 5] = ux * rt - uy * tt, uy * rt + ux * tt
    if n_s > 0:
        reach = max(abs(s[0]), abs(s[n_s - 1]))
        if lam < 1e-5 * big_m or lam * reach * reach < 1e-3:
            jacobian_taylor(theta, kappa, fx, fy, s, out)


@njit(cache=True, no_cfunc_wrapper=True)
def jacobian_batch(parameters, fractions, values, out):
    """`jacobian` of n curves, (n, 7), at ascending fractions (m,) of their lengths: values (n, m, 4), out (n, m, 3, 7).

    The last column is the derivative by the length while the fraction stays.
    """
    s = np.empty(fractions.shape[0])
    for k in range(parameters.shape[0]):
        x0, y0, theta, kappa, fx, fy, length = parameters[k]
        for i in range(s.shape[0]):
            s[i] = fractions[i] * length
        jacobian(x0, y0, theta, kappa, fx, fy, elastica_constants(theta, kappa, fx, fy), s, values[k], out[k])
        for i in range(s.shape[0]):
            out[k, i, 0, 6] = fractions[i] * math.cos(values[k, i, 2])
            out[k, i, 1, 6] = fractions[i] * math.sin(values[k, i, 2])
            out[k, i, 2, 6] = fractions[i] * values[k, i, 3]
