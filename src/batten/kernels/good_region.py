"""Where a control point of a cubic spline may be: the criterion there, and the border of the places that meet it.

Every Bézier point of the affected pieces is affine in the displacement d of the active control point, B(d) = base +
response · d. `violation` is below 0 where all limits are met. The first guess of an elastica (Brander2016 §3–4) has, at an
end whose height is u, sin θ_u = ½λu² + αu + β, and the mean β of eq. (9) follows from moments that the λ-residual needs
anyway: ∫ sin θ_u ds is a difference of end points. So the angle error costs next to nothing; only where the two ways of
counting monotone runs (see `initial_guess`) are on different sides of the limit is the guess itself computed.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from batten.kernels.bezier import MOST_PANELS, affine_fit, dyadic_panels, panel_moments, polygon_frame
from batten.kernels.elastica import _TERMS, base_series, elastica_constants, evaluate, point_on
from batten.kernels.elliptic import incomplete_f
from batten.kernels.initial_guess import GUESS_BAD, _amplitude, _count_segments, initial_guess
from batten.kernels.quadrature import NODES_24, WEIGHTS_24
from batten.kernels.segments import segments_cross
from batten.kernels.stability import conjugate_length

#: Columns of the limits: e_λ, angle error, |κ| of the guess, stability margin (0: none), no crossing (1), panel condition.
RESIDUAL, ANGLE, CURVATURE, MARGIN, SIMPLE, CONDITION = range(6)
#: Chords on each piece for the test of self-crossing.
CHORDS = 16
#: Panels that the guess may take; curves with more are near a cusp and far from every limit.
GUESS_PANELS = 16
#: e_λ below which `initial_guess` takes the ends' tangents for their amplitudes, or more.
NEARLY_EXACT = 1e-3
FAR = 1e9


def _cumulative():
    """The matrix that integrates the interpolating polynomial from 0 to each of the 24 nodes."""
    x = 2.0 * NODES_24 - 1.0
    values = np.polynomial.legendre.legvander(x, 24)
    integral = np.empty((24, 24))
    integral[:, 0] = x + 1.0
    integral[:, 1:] = (values[:, 2:25] - values[:, :23]) / (2.0 * np.arange(1, 24) + 1.0)
    return np.ascontiguousarray(0.5 * integral @ np.linalg.inv(values[:, :24]))


CUMULATIVE_24 = _cumulative()
#: The same from ds at the nodes, weights included.
ARC_24 = np.ascontiguousarray(CUMULATIVE_24 / WEIGHTS_24)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _turn(angle):
    """The angle in [−π, π) modulo 2π."""
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _guess(f, lefts, widths, count, nodes, params):
    """`initial_guess` in the frame for a curve on `count` panels; (status, start angle, end angle of the curve)."""
    n = 24 * count
    points, theta, kappa = np.empty((n, 2)), np.empty(n), np.empty(n)
    weights, fractions, speeds = np.empty(n), np.empty(n), np.empty(24)
    length = 0.0
    before = math.atan2(f[1], f[0])
    ends = np.empty((2, 3))
    ends[0, 0], ends[0, 1], ends[0, 2] = 0.0, 0.0, before
    for j in range(count):
        for i in range(24):
            t = lefts[j] + widths[j] * NODES_24[i]
            u = 1.0 - t
            dx = 3.0 * (u * u * f[0] + 2.0 * t * u * f[2] + t * t * f[4])
            dy = 3.0 * (u * u * f[1] + 2.0 * t * u * f[3] + t * t * f[5])
            angle = math.atan2(dy, dx)
            before += _turn(angle - before)
            k = 24 * j + i
            points[k, 0], points[k, 1] = nodes[j, 0, i], nodes[j, 1, i]
            theta[k], kappa[k], weights[k] = before, nodes[j, 2, i], nodes[j, 3, i]
            speeds[i] = math.hypot(dx, dy) * widths[j]
        for i in range(24):
            arc = length
            for k in range(24):
                arc += CUMULATIVE_24[i, k] * speeds[k]
            fractions[24 * j + i] = arc
        for i in range(24):
            length += nodes[j, 3, i]
    for k in range(n):
        fractions[k] /= length
    ends[1, 0], ends[1, 1] = f[0] + f[2] + f[4], f[1] + f[3] + f[5]
    ends[1, 2] = before + _turn(math.atan2(f[5], f[4]) - before)
    info = np.empty(4)
    status = initial_guess(points, theta, kappa, weights, fractions, length, ends, params, info)
    return status, ends[0, 2], ends[1, 2]


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _full_guess(f, scale, lefts, widths, count, nodes, dear):
    """(angle error, greatest |κ|, stability margin) of the guess itself; the last two, at 64 steps, only if `dear`."""
    params = np.empty(7)
    status, first, last = _guess(f, lefts, widths, count, nodes, params)
    if status == GUESS_BAD or not params[6] > 0.0:
        return FAR, FAR, 0.0
    steps = 64 if dear else 1
    s, states = np.empty(steps + 1), np.empty((steps + 1, 4))
    for i in range(steps + 1):
        s[i] = params[6] * i / steps
    evaluate(0.0, 0.0, params[2], elastica_constants(params[2], params[3], params[4], params[5]), s, states)
    error = max(abs(_turn(states[0, 2] - first)), abs(_turn(states[steps, 2] - last)))
    if not dear:
        return error, 0.0, math.inf
    top = 0.0
    for i in range(steps + 1):
        top = max(top, abs(states[i, 3]))
    margin = conjugate_length(params[2], params[3], params[4], params[5], params[6], 0) / params[6]
    return error, top / scale, margin


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _way(falling, count, first, final, falls0, falls1, sine0, sine1, actual0, actual1):
    """(possible, angle error) of the guess that starts `falling` and has `count` monotone runs.

    first, final: how far the ends are below the top, as a part of the interval; falls0, falls1: what the tangents do there;
    sine0 … actual1: sin θ_u of the guess and of the curve at the ends.
    """
    number = count if falling else count + 1
    start = first if falling else 2.0 - first
    end = number - 1.0 + final if number % 2 == 1 else number - final
    error = 0.0
    for i in range(2):
        guessed, actual = math.asin(sine0 if i == 0 else sine1), math.asin(actual0 if i == 0 else actual1)
        same = falling == falls0 if i == 0 else (number % 2 == 1) == falls1
        off = abs(guessed - actual) if same else abs(math.pi - guessed - actual)
        error = max(error, min(off, 2.0 * math.pi - off))
    return end - start > 1e-9, error


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _first_is_nearer(one, other, guess, count, nodes, arcs):
    """Whether the guess with the runs `one` = (falling, how many) is nearer to the curve than that with `other`: R₄.

    guess: (λ, u-axis, sign of running, √λ(u_max − u) at both ends, modulus, inflectional), see `initial_guess`. A third of
    the nodes is looked at first; that is enough unless both are within a fifth of each other.
    """
    lam, ux, uy, sign, drop0, drop1, modulus, bends, length = guess
    ser, wer = np.empty(_TERMS), np.empty(_TERMS)
    square = modulus * modulus
    base_series(min(1.0, square) / max(1.0, square), ser, wer)
    delta = 1.0 - square
    complement = delta if bends else 1.0 - 1.0 / square
    scale = 1.0 / math.sqrt(lam)
    ex, ey = -sign * uy * scale, sign * ux * scale
    ratio0, ratio1 = math.asin(_top_ratio(drop0, modulus)), math.asin(_top_ratio(drop1, modulus))
    if bends:
        ratio0 = math.acos(min(1.0, max(-1.0, 1.0 - 0.5 * drop0 / modulus)))
        ratio1 = math.acos(min(1.0, max(-1.0, 1.0 - 0.5 * drop1 / modulus)))
    per = 1.0 if bends else 1.0 / modulus
    passed = 0.0
    for j in range(count):
        total = 0.0
        for i in range(24):
            arc = 0.0
            for k in range(24):
                arc += ARC_24[i, k] * nodes[j, 3, k]
            arcs[24 * j + i] = (passed + arc) / length
            total += nodes[j, 3, i]
        passed += total
    far0 = far1 = 0.0
    for whole in range(2):
        far0 = far1 = math.inf
        for which in range(2):
            falling, runs = one if which == 0 else other
            s0 = per * incomplete_f(_amplitude(1, falling, ratio0, bends), complement)
            s1 = per * incomplete_f(_amplitude(runs, falling, ratio1, bends), complement)
            _, _, a, c, q = point_on(s0, 1.0, modulus, 0.0, 1.0, delta, ser, wer)
            s = sx = sy = squares = 0.0
            for k in range(0 if whole == 1 else 1, 24 * count, 1 if whole == 1 else 3):
                j, i = k // 24, k % 24
                w = nodes[j, 3, i] if whole == 1 else nodes[j, 3, i - 1] + nodes[j, 3, i] + nodes[j, 3, i + 1]
                part = arcs[k] if sign > 0.0 else 1.0 - arcs[k]
                x, y, _, _, _ = point_on(part * (s1 - s0), 1.0, q, a, c, delta, ser, wer)
                dx, dy = nodes[j, 0, i] - x * ex + y * ey, nodes[j, 1, i] - x * ey - y * ex
                s, sx, sy, squares = s + w, sx + w * dx, sy + w * dy, squares + w * (dx * dx + dy * dy)
            far = squares - (sx * sx + sy * sy) / s
            if math.isfinite(far) and s1 - s0 >= 1e-9:
                far0, far1 = (far, far1) if which == 0 else (far0, far)
        if abs(far0 - far1) > 0.36 * max(far0, far1):
            break
    return far0 <= far1


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _top_ratio(drop, modulus):
    """sin of the amplitude without inflections where √λ(u_max − u) = drop."""
    return math.sqrt(min(1.0, max(0.0, drop * (modulus - 0.25 * drop))))


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _quick_guess(f, fit, moments, count, nodes, scale, most, settled, heights):
    """(sure, angle error, greatest |κ|) of the guess from the moments; not sure where the guess itself has to be made.

    Where the two ways of counting are both possible and fall on different sides of `most`, the limit of the angle error,
    the nearer of both guesses is taken if `settled`, else it is left open. Where both are on one side the greater numbers
    are returned.
    """
    a, b, c, length, _, _ = fit
    _, sx, sy, _, sxx, sxy, syy, _, _, _ = moments
    lam = math.hypot(b, c)
    ex, ey = f[0] + f[2] + f[4], f[1] + f[3] + f[5]
    mean_kappa = a + (b * sx + c * sy) / length
    n0, n1 = math.hypot(f[0], f[1]), math.hypot(f[4], f[5])
    if lam * length * length <= 1e-8 * max(abs(mean_kappa) * length, 1e-3) or n0 == 0.0 or n1 == 0.0:
        return False, FAR, FAR
    ux, uy = b / lam, c / lam
    square = ux * ux * sxx + 2.0 * ux * uy * sxy + uy * uy * syy
    beta = (ux * ey - uy * ex - 0.5 * lam * square - a * (ux * sx + uy * sy)) / length
    wide = math.sqrt(max(a * a - 2.0 * lam * (beta - 1.0), 1e-300))
    narrow = a * a - 2.0 * lam * (beta + 1.0)
    # Without inflections and with negative curvature the curve is run backwards: u, α and the order of the ends turn.
    sign = -1.0 if narrow >= 0.0 and mean_kappa < 0.0 else 1.0
    high = (-sign * a + wide) / lam
    low = (-sign * a - wide) / lam if narrow < 0.0 else (-sign * a + math.sqrt(narrow)) / lam
    last = 24 * count + 1
    for j in range(count):
        for i in range(24):
            k = 1 + 24 * j + i
            heights[k if sign > 0.0 else last - k] = sign * (ux * nodes[j, 0, i] + uy * nodes[j, 1, i])
    far = sign * (ux * ex + uy * ey)
    heights[0], heights[last] = (0.0, far) if sign > 0.0 else (far, 0.0)
    # ends and tangents in the order of running
    slope0, slope1 = (ux * f[0] + uy * f[1]) / n0, (ux * f[4] + uy * f[5]) / n1
    actual0, actual1 = (ux * f[1] - uy * f[0]) / n0, (ux * f[5] - uy * f[4]) / n1
    if sign < 0.0:
        slope0, slope1, actual0, actual1 = slope1, slope0, actual1, actual0
    actual0, actual1 = min(1.0, max(-1.0, actual0)), min(1.0, max(-1.0, actual1))
    falls0, falls1 = slope0 <= 0.0, slope1 <= 0.0
    u0, u1 = min(max(heights[0], low), high), min(max(heights[last], low), high)
    sine0 = min(1.0, max(-1.0, (0.5 * lam * u0 + sign * a) * u0 + beta))
    sine1 = min(1.0, max(-1.0, (0.5 * lam * u1 + sign * a) * u1 + beta))
    first, final = (high - u0) / (high - low), (high - u1) / (high - low)
    runs, direction = _count_segments(heights[: last + 1], 0.5 * (high - low))
    written = direction < 0 if direction != 0 else heights[last] <= heights[0]
    runs = max(runs, 1)
    by_tangent = runs + 1 if direction != 0 and falls0 != written else runs
    if (by_tangent % 2 == 1) != (falls0 == falls1):
        by_tangent += 1
    possible, error = _way(written, runs, first, final, falls0, falls1, sine0, sine1, actual0, actual1)
    top = max(abs(lam * u0 + sign * a), abs(lam * u1 + sign * a))
    most_runs = runs if possible else 1
    starts = written
    if falls0 != written or by_tangent != runs:
        also, other = _way(falls0, by_tangent, first, final, falls0, falls1, sine0, sine1, actual0, actual1)
        if also and possible and (error < most) != (other < most):
            if not settled:
                return False, FAR, FAR
            root = math.sqrt(lam)
            guess = (
                lam, ux, uy, sign, root * (high - u0), root * (high - u1), 0.5 * wide / root, narrow < 0.0, length
            )  # fmt: skip
            if not _first_is_nearer((written, runs), (falls0, by_tangent), guess, count, nodes, heights):
                error, most_runs, starts = other, by_tangent, falls0
        elif also:
            error = max(error, other) if possible else other
            if by_tangent > most_runs:
                most_runs, starts = by_tangent, falls0
        possible = possible or also
    if not possible:
        return True, FAR, FAR
    if most_runs > 1:
        top = max(top, abs(lam * (low if starts else high) + sign * a))
    if most_runs > 2:
        top = max(top, abs(lam * (high if starts else low) + sign * a))
    return True, error, top / scale


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def piece_values(p, limits, whole, lefts, widths, nodes, heights):
    """(e_λ, angle error, greatest |κ|, stability margin) of one cubic; what lies beyond a broken limit is not computed.

    whole: all four whatever the limits. Straight lines: 0, 0, 0, inf.
    """
    _, _, scale, f, flag = polygon_frame(p)
    if flag > 0:
        if flag == 1:
            return 0.0, 0.0, 0.0, math.inf
        return (1.0 if flag == 2 else math.nan), FAR, FAR, 0.0
    count, cusp = dyadic_panels(f, limits[CONDITION], lefts, widths)
    if cusp:
        return 1.0, FAR, FAR, 0.0
    s = sx = sy = sk = sxx = sxy = syy = sxk = syk = skk = 0.0
    for j in range(count):
        m = panel_moments(f, lefts[j], widths[j], nodes[j])
        s, sx, sy, sk, sxx = s + m[0], sx + m[1], sy + m[2], sk + m[3], sxx + m[4]
        sxy, syy, sxk, syk, skk = sxy + m[5], syy + m[6], sxk + m[7], syk + m[8], skk + m[9]
    moments = (s, sx, sy, sk, sxx, sxy, syy, sxk, syk, skk)
    fit = affine_fit(moments, nodes, count)
    residual = min(1.0, math.sqrt(fit[5] / fit[4]))
    if residual >= limits[RESIDUAL] and not whole:
        return residual, FAR, FAR, 0.0
    if count > GUESS_PANELS:
        return residual, FAR, FAR, 0.0
    dear = whole or limits[MARGIN] > 0.0 or limits[CURVATURE] < math.inf
    settled = not dear and residual > NEARLY_EXACT
    sure, error, top = _quick_guess(f, fit, moments, count, nodes, scale, limits[ANGLE], settled, heights)
    margin = math.inf
    if whole or not sure or limits[MARGIN] > 0.0:
        if sure and not whole and (error >= limits[ANGLE] or top > limits[CURVATURE]):
            return residual, error, top, 0.0
        error, top, margin = _full_guess(f, scale, lefts, widths, count, nodes, dear)
    return residual, error, top, margin


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def crosses(points, first, affected, fixed):
    """Whether chords of the pieces `points` (k, 4, 2), numbers `affected` (k,), cross one another or those of the others.

    `fixed` (n, CHORDS + 1, 2): chords of all pieces, of which the affected ones are not looked at. first: work space of the
    same shape.
    """
    k, n = points.shape[0], fixed.shape[0]
    for i in range(n):
        first[i] = fixed[i]
    for i in range(k):
        for j in range(CHORDS + 1):
            t = j / CHORDS
            u = 1.0 - t
            for c in range(2):
                p = points[i]
                first[affected[i], j, c] = (
                    u * u * u * p[0, c] + 3.0 * t * u * (u * p[1, c] + t * p[2, c]) + t * t * t * p[3, c]
                )
    for i in range(k):
        for j in range(CHORDS):
            here = affected[i] * CHORDS + j
            ax, ay = first[affected[i], j]
            bx, by = first[affected[i], j + 1]
            for other in range(n):
                for l in range(CHORDS):
                    if abs(other * CHORDS + l - here) <= 1:
                        continue
                    cx, cy = first[other, l]
                    dx, dy = first[other, l + 1]
                    if segments_cross(ax, ay, bx, by, cx, cy, dx, dy):
                        return True
    return False


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def violation(x, y, problem, work):
    """Greatest excess over a limit, relative to it, at the displacement (x, y): below 0 where all are met.

    problem: (base (k, 4, 2), response (k, 4, 2, 2), affected (k,), fixed (n, CHORDS + 1, 2), box (4,), limits (6,)); box:
    least x and y, most x and y of the displacements allowed, beyond which it is inf. Where a cheap limit is broken the
    dear ones are not looked at: see `piece_values`. work: see `work_space`.
    """
    base, response, affected, fixed, box, limits = problem
    if not (box[0] <= x <= box[2] and box[1] <= y <= box[3]):
        return math.inf
    points, first, lefts, widths, nodes, heights = work
    worst = -1.0
    for i in range(base.shape[0]):
        for j in range(4):
            r = response[i, j]
            points[i, j, 0] = base[i, j, 0] + r[0, 0] * x + r[0, 1] * y
            points[i, j, 1] = base[i, j, 1] + r[1, 0] * x + r[1, 1] * y
        e, angle, top, margin = piece_values(points[i], limits, False, lefts, widths, nodes, heights)
        if math.isnan(e):
            return FAR
        worst = max(worst, e / limits[RESIDUAL] - 1.0)
        if e < limits[RESIDUAL]:
            worst = max(worst, min(angle / limits[ANGLE], FAR) - 1.0)
            if limits[CURVATURE] < math.inf:
                worst = max(worst, min(top / limits[CURVATURE], FAR) - 1.0)
            if limits[MARGIN] > 0.0 and worst < 0.0:
                worst = max(worst, 1.0 - margin / limits[MARGIN])
        if worst > 1.0:
            return worst
    if worst < 0.0 and limits[SIMPLE] > 0.0 and crosses(points, first, affected, fixed):
        return 1.0
    return worst


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def work_space(pieces, fixed):
    """Arrays that `violation` writes to."""
    return (
        np.empty((pieces, 4, 2)),
        np.empty_like(fixed),
        np.empty(MOST_PANELS),
        np.empty(MOST_PANELS),
        np.empty((MOST_PANELS, 4, 24)),
        np.empty(24 * GUESS_PANELS + 2),
    )


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def values_batch(pieces, limits, out):
    """`piece_values` of each row of `pieces` (n, 4, 2), all four, into `out` (n, 4)."""
    lefts, widths = np.empty(MOST_PANELS), np.empty(MOST_PANELS)
    nodes, heights = np.empty((MOST_PANELS, 4, 24)), np.empty(24 * GUESS_PANELS + 2)
    for i in range(pieces.shape[0]):
        out[i] = piece_values(pieces[i], limits, True, lefts, widths, nodes, heights)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def violation_batch(places, problem, out):
    """`violation` at each row of `places` (n, 2) into `out` (n,)."""
    work = work_space(problem[0].shape[0], problem[3])
    for i in range(places.shape[0]):
        out[i] = violation(places[i, 0], places[i, 1], problem, work)
