"""First guess of an elastica for a sampled curve: Brander2016 §3–4."""

import math

import numpy as np
from numba import njit

from batten.kernels.elastica import elastica_constants, evaluate
from batten.kernels.elliptic import incomplete_f
from batten.kernels.linear import copy

# Status of a guess.
GUESS_OK, GUESS_LINE, GUESS_CIRCLE, GUESS_BAD = 0, 1, 2, 3
EXACT = 1e-7  # R₁ below which a curve counts as an elastica


@njit(cache=True, no_cfunc_wrapper=True)
def multipliers(points, kappa, weights):
    """(λ₁, λ₂, α, R₁, mean x, mean y) of eq. (6), solved about the centroid; α belongs to the original coordinates."""
    total, mx, my, mk = 0.0, 0.0, 0.0, 0.0
    n = weights.shape[0]
    for i in range(n):
        total += weights[i]
        mx += weights[i] * points[i, 0]
        my += weights[i] * points[i, 1]
        mk += weights[i] * kappa[i]
    mx /= total
    my /= total
    mk /= total
    xx, xy, yy, xk, yk, kk = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        x, y, k = points[i, 0] - mx, points[i, 1] - my, kappa[i] - mk
        w = weights[i]
        xx += w * x * x
        xy += w * x * y
        yy += w * y * y
        xk += w * x * k
        yk += w * y * k
        kk += w * kappa[i] * kappa[i]
    trace = xx + yy
    det = xx * yy - xy * xy
    if det > 1e-13 * trace * trace:  # κ − κ̄ ≈ −λ₁ y + λ₂ x
        l2 = (xk * yy - yk * xy) / det
        l1 = -(yk * xx - xk * xy) / det
    elif trace > 0.0:  # collinear: least norm along the line
        hx, hy = (xx, xy) if xx >= yy else (xy, yy)
        norm = math.hypot(hx, hy)
        hx, hy = hx / norm, hy / norm
        g = (hx * xk + hy * yk) / trace
        l2, l1 = g * hx, -g * hy
    else:
        l1, l2 = 0.0, 0.0
    residual = 0.0
    for i in range(n):
        r = kappa[i] - mk + l1 * (points[i, 1] - my) - l2 * (points[i, 0] - mx)
        residual += weights[i] * r * r
    r1 = math.sqrt(residual / kk) if kk > 0.0 else 0.0
    return l1, l2, mk + l1 * my - l2 * mx, r1, mx, my


@njit(cache=True, no_cfunc_wrapper=True)
def _translate(points, weights, fractions, length, params):
    """Set the start so that the mean distance vanishes (eq. 14); returns R₄."""
    n = weights.shape[0]
    values = np.empty((n, 4))
    s = np.empty(n)
    for i in range(n):
        s[i] = fractions[i] * params[6]
    evaluate(0.0, 0.0, params[2], elastica_constants(params[2], params[3], params[4], params[5]), s, values)
    dx, dy = 0.0, 0.0
    for i in range(n):
        dx += weights[i] * (points[i, 0] - values[i, 0])
        dy += weights[i] * (points[i, 1] - values[i, 1])
    dx /= length
    dy /= length
    params[0], params[1] = dx, dy
    total = 0.0
    for i in range(n):
        total += weights[i] * ((points[i, 0] - values[i, 0] - dx) ** 2 + (points[i, 1] - values[i, 1] - dy) ** 2)
    return math.sqrt(total / length**3)


@njit(cache=True, no_cfunc_wrapper=True)
def _count_segments(u, height):
    """Monotone runs of u of at least `height`: (how many, direction of the first: −1 falling, +1 rising, 0 none)."""
    low, high, count, first, direction = u[0], u[0], 0, 0, 0
    for value in u:
        if direction >= 0 and value > high:
            high = value
        if direction <= 0 and value < low:
            low = value
        if direction == 0:
            if high - value >= height:
                direction, count, first, low = -1, 1, -1, value
            elif value - low >= height:
                direction, count, first, high = 1, 1, 1, value
        elif direction < 0:
            if value - low >= height:
                direction, count, high = 1, count + 1, value
        elif high - value >= height:
            direction, count, low = -1, count + 1, value
    return count, first


@njit(cache=True, no_cfunc_wrapper=True)
def _amplitude(segment, start_falling, ratio, inflectional):
    """Amplitude of a point on monotone segment number `segment` (from 1); `ratio` is arccos or arcsin of its u."""
    half = math.pi if inflectional else 0.5 * math.pi
    number = segment if start_falling else segment + 1  # count from a falling segment
    if number % 2 == 1:
        return (number - 1) * half + ratio
    return number * half - ratio


@njit(cache=True, no_cfunc_wrapper=True)
def initial_guess(points, theta, kappa, weights, fractions, length, ends, params, info):
    """Guess for one curve; status.

    Samples: points (n, 2), tangent angle, curvature, ds weights and fraction of arc length (n,); `ends` (2, 3) holds
    (x, y, θ) of both ends. Fills params (7,) in force form and info (4,) = R₁, R₂, R₃, R₄.
    """
    n = weights.shape[0]
    info[:] = np.nan
    if not length > 0.0:
        return GUESS_BAD
    l1, l2, alpha, r1, mx, my = multipliers(points, kappa, weights)
    info[0], info[1], info[2], info[3] = r1, 0.0, 0.0, np.nan
    if not math.isfinite(r1 + length):
        return GUESS_BAD
    lam = math.hypot(l1, l2)
    mean_kappa = alpha - l1 * my + l2 * mx
    turning = abs(mean_kappa) * length
    if lam * length * length <= 1e-9 * max(turning, 1e-3):  # a circle or a line
        mean_angle = 0.0
        for i in range(n):
            mean_angle += weights[i] * (theta[i] - mean_kappa * length * fractions[i])
        params[2], params[3], params[4], params[5], params[6] = mean_angle / length, mean_kappa, 0.0, 0.0, length
        info[3] = _translate(points, weights, fractions, length, params)
        return GUESS_LINE if turning < 1e-9 else GUESS_CIRCLE

    # Without inflections and with negative curvature the curve is run backwards (note 3).
    sign = 1.0
    for _ in range(2):
        ax, ay = sign * l2 / lam, -sign * l1 / lam  # u-axis; all of λ₁, λ₂, α change sign when run backwards
        beta = 0.0
        for i in range(n):
            u = ax * points[i, 0] + ay * points[i, 1]
            sin_u = (l1 * math.cos(theta[i]) + l2 * math.sin(theta[i])) / lam  # both factors turn: no change
            beta += weights[i] * (sin_u - 0.5 * lam * u * u - sign * alpha * u)
        beta /= length
        a = sign * alpha
        delta_minus = math.sqrt(max(a * a - 2.0 * lam * (beta - 1.0), 1e-300))
        modulus = 0.5 * delta_minus / math.sqrt(lam)
        inflectional = a * a - 2.0 * lam * (beta + 1.0) < 0.0
        if inflectional or sign * mean_kappa >= 0.0:
            break
        sign = -sign
    scale = 1.0 / math.sqrt(lam)
    u_max = (-a + delta_minus) / lam
    if inflectional:
        u_min = (-a - delta_minus) / lam
    else:
        u_min = (-a + math.sqrt(a * a - 2.0 * lam * (beta + 1.0))) / lam
    u = np.empty(n + 2)
    residual, outside = 0.0, 0.0
    for i in range(n):
        j = i if sign > 0.0 else n - 1 - i
        u[i + 1] = ax * points[j, 0] + ay * points[j, 1]
        sin_u = (l1 * math.cos(theta[j]) + l2 * math.sin(theta[j])) / lam
        residual += weights[j] * (sin_u - 0.5 * lam * u[i + 1] ** 2 - a * u[i + 1] - beta) ** 2
        if not (u_min - 1e-9 * length <= u[i + 1] <= u_max + 1e-9 * length):
            outside += weights[j]
    info[1] = math.sqrt(residual / length)
    info[2] = outside / length
    first, last = (0, 1) if sign > 0.0 else (1, 0)
    u[0] = ax * ends[first, 0] + ay * ends[first, 1]
    u[n + 1] = ax * ends[last, 0] + ay * ends[last, 1]
    # du/ds at both ends along the direction of running
    slope0 = sign * (ax * math.cos(ends[first, 2]) + ay * math.sin(ends[first, 2]))
    slope1 = sign * (ax * math.cos(ends[last, 2]) + ay * math.sin(ends[last, 2]))
    count, direction = _count_segments(u, 0.5 * (u_max - u_min))
    falling_written = direction < 0 if direction != 0 else u[n + 1] <= u[0]
    count_written = max(count, 1)
    # The count by the tangents at the ends: its parity follows from the two directions.
    falling_tangent = slope0 <= 0.0
    count_tangent = count_written
    if direction != 0 and falling_tangent != falling_written:
        count_tangent += 1
    if (count_tangent % 2 == 1) != (falling_tangent == (slope1 <= 0.0)):
        count_tangent += 1
    complement = 1.0 - modulus * modulus if inflectional else 1.0 - 1.0 / (modulus * modulus)
    best = np.inf
    trial = np.empty(7)
    state = np.empty((1, 4))
    arc_at_start = np.empty(1)
    for way in range(2):
        falling = falling_written if way == 0 else falling_tangent
        segments = count_written if way == 0 else count_tangent
        if way == 1 and falling == falling_written and segments == count_written:
            break
        s0, s1 = 0.0, 0.0
        for end in range(2):
            value, slope = (u[0], slope0) if end == 0 else (u[n + 1], slope1)
            drop = min(max(u_max - value, 0.0), u_max - u_min)  # clipped to the interval
            if inflectional:
                cosine = min(1.0, max(-1.0, 1.0 - drop / (2.0 * modulus * scale)))
                ratio = math.acos(cosine)
                if info[1] < 1e-5 and abs(cosine) > 0.9:  # u is stationary here; the tangent is not
                    sine = abs(slope) / (2.0 * modulus * math.sqrt(max(1.0 - modulus**2 * (1.0 - cosine**2), 1e-12)))
                    ratio = math.atan2(min(sine, 1.0), cosine)
            else:
                square = min(1.0, max(0.0, drop / scale * (modulus - 0.25 * drop / scale)))
                ratio = math.asin(math.sqrt(square))
                if info[1] < 1e-5 and (square < 0.2 or square > 0.8):
                    sine = min(
                        1.0,
                        max(
                            -1.0,
                            (
                                l1 * math.cos(ends[first if end == 0 else last, 2])
                                + l2 * math.sin(ends[first if end == 0 else last, 2])
                            )
                            / lam,
                        ),
                    )
                    # θ_u turns at twice the amplitude: sin θ_u = 2dn² − 1 = cos 2am, |cos θ_u| = sin 2am
                    ratio = 0.5 * math.atan2(abs(slope), sine)
            amplitude = _amplitude(1 if end == 0 else segments, falling, ratio, inflectional)
            arc = incomplete_f(amplitude, complement)
            if not inflectional:
                arc /= modulus
            if end == 0:
                s0 = arc
            else:
                s1 = arc
        if not (math.isfinite(s0) and math.isfinite(s1)) or s1 - s0 < 1e-9:
            continue
        arc_at_start[0] = s0 if sign > 0.0 else s1
        evaluate(0.0, 0.0, 0.0, elastica_constants(0.0, 2.0 * modulus, 1.0, 0.0), arc_at_start, state)
        rotation = math.atan2(sign * l2, sign * l1)
        trial[2] = state[0, 2] + rotation
        trial[3] = state[0, 3] / scale
        trial[4], trial[5] = l1, l2
        trial[6] = (s1 - s0) * scale
        if sign < 0.0:
            trial[2] += math.pi
            trial[3] = -trial[3]
        r4 = _translate(points, weights, fractions, length, trial)
        if r4 < best:
            best = r4
            # Turns are immaterial to the curve; keep the angle next to the given one.
            trial[2] += 2.0 * math.pi * math.floor((ends[0, 2] - trial[2]) / (2.0 * math.pi) + 0.5)
            copy(trial, params)
    if r1 < EXACT:
        # An elastica to rounding: angle, curvature and length are its own, where eq. (13) amplifies the modulus' error by
        # the number of periods, without bound as k → 1.
        trial[2], trial[3] = ends[0, 2], alpha - l1 * ends[0, 1] + l2 * ends[0, 0]
        trial[4], trial[5], trial[6] = l1, l2, length
        r4 = _translate(points, weights, fractions, length, trial)
        if r4 < best:
            best = r4
            copy(trial, params)
    info[3] = best
    return GUESS_OK if math.isfinite(best) else GUESS_BAD
