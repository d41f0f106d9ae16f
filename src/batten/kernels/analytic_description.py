"""Rows of elastica of least L² distance to the pieces of a spline, joined with common tangents or curvatures.

Unknowns are those of `elastica_fit` for each piece, about its middle: (x, y, θ, κℓ, f₁, f₂, ℓ). A step (`joint_step`)
minimises the Gauss–Newton model under the linearised conditions at the joints.

Two things keep rows with sharp pieces from being joined that way: a taut piece comes ever nearer while its force grows
without end, and curvatures that jump far apart ask for steps far beyond where they are linear. Rows that fail are begun
again with a small weight on forces, and their curvatures are closed little by little.
"""

import math

import numpy as np
from numba import njit

from batten.kernels.elastica import elastica_constants, elastica_constants_exact, evaluate
from batten.kernels.elastica_fit import force_form
from batten.kernels.elastica_fit_batch import to_unknowns
from batten.kernels.joint_step import joint_step, measure
from batten.kernels.linear import copy

JOINED, NOT_JOINED, BAD_SPLINE = 0, 1, 2
_ITERATIONS = 100
_CORRECTIONS = 3
_TIGHT = 1e-12  # greatest jump at a joint, in mean lengths of a piece and radians
_LOOSER = 2e-14  # what is added for every piece: coordinates grow, and with them their rounding
_STILL = 1e-8  # decrease of the squared distance that a step would bring, of the squared distance
_FAR = 4.0  # times the neighbour's squared distance: then the spline's own guess is tried too
_EXACT = 1e-20  # squared distance of a spline that is one of elastica
# For rows that fail otherwise: ½ ridge |force|² is added, mean length 1, and made less as long as the row stays joined. At
# the first a force of 100 counts as much as a distance of 0.3, at the last of 0.001.
_FIRST_RIDGE, _RIDGES = 1e-5, 6
_STORED = 5e-12  # as _TIGHT, for pieces by the numbers that are stored, where stiff ones lose digits
_SLOWLY_STILL = 1e-6  # as _STILL, for these
# Jumps of curvature count ten times more in every round; a round ends with a step that lowers less than 1 % of all.
_FIRST_YIELDING, _YIELDS, _YIELDING_STEPS, _LITTLE = 1e5, 12, 25, 0.01


@njit(cache=True, no_cfunc_wrapper=True)
def _merit(value, jumps, k, penalty, yielding):
    """What a step has to lower, and the greatest jump that is a condition."""
    hard = 3 if yielding > 0.0 else k
    gap = 0.0
    for i in range(jumps.shape[0]):
        for j in range(hard):
            value += penalty * abs(jumps[i, j])
            gap = max(gap, abs(jumps[i, j]))
        if hard < k:
            value += 0.5 * jumps[i, 3] ** 2 / yielding
    return value, gap


@njit(cache=True, no_cfunc_wrapper=True)
def join_pieces(mids, points, weights, fractions, k, ridge, yielding, most):
    """Move `mids` (c, 7) to the least distance under the conditions: (status, ½ squared distance, iterations, jump).

    ridge: see `measure`. yielding: see `joint_step`. most: iterations.
    """
    c, n = mids.shape[0], weights.shape[1]
    work = (np.zeros(n), np.empty(n), np.empty((n, 4)), np.empty((n, 3, 7)), np.zeros((2, 3)), np.zeros(6), np.zeros(6),
            np.zeros((6, 7)))  # fmt: skip
    grads, models, tips = np.empty((c, 7)), np.empty((c, 7, 7)), np.zeros((c, 2, 4))
    slopes, jumps = np.zeros((c, 2, 4, 7)), np.zeros((max(c - 1, 1), 4))
    grads2, models2, tips2 = np.empty((c, 7)), np.empty((c, 7, 7)), np.zeros((c, 2, 4))
    slopes2, jumps2 = np.zeros((c, 2, 4, 7)), np.zeros((max(c - 1, 1), 4))
    steps, nu, trial = np.zeros((c, 7)), np.zeros((max(c - 1, 1), 4)), np.empty((c, 7))
    value = measure(mids, points, weights, fractions, k, ridge, work, grads, models, tips, slopes, jumps)
    none, dull = np.zeros((c, 7)), np.zeros((max(c - 1, 1), 4))
    mu, penalty = 1e-9, 0.0
    still = _SLOWLY_STILL if ridge > 0.0 else _STILL
    _, gap = _merit(value, jumps, k, 0.0, yielding)
    hard = 3 if yielding > 0.0 else k
    for iteration in range(most):
        if not math.isfinite(value):
            return BAD_SPLINE, math.inf, iteration, math.inf
        decrease = joint_step(grads, models, slopes, jumps, k, mu, yielding, steps, nu)
        accepted, new, before, after = False, math.inf, math.inf, math.inf
        if math.isfinite(decrease):
            if not yielding > 0.0 and gap <= _TIGHT + _LOOSER * c and (decrease <= still * value or value < _EXACT):
                return JOINED, value, iteration, gap
            penalty = max(2.0 * np.abs(nu[:, :hard]).max(), 0.5 * penalty) + 1e-12
            good = True
            for i in range(c):
                for a in range(7):
                    trial[i, a] = mids[i, a] + steps[i, a]
                good = good and trial[i, 6] > 0.2 * mids[i, 6] and abs(steps[i, 2]) < 1.0
            if good:
                new = measure(
                    trial, points, weights, fractions, k, ridge, work, grads2, models2, tips2, slopes2, jumps2
                )
                before, _ = _merit(value, jumps, k, penalty, yielding)
                for correction in range(_CORRECTIONS + 1):
                    after, gap2 = _merit(new, jumps2, k, penalty, yielding)
                    # at the last digits of the jumps the merit cannot tell any more
                    if after < before or (gap < 1e-9 and gap2 < 1e-9 and new <= value * (1.0 + 1e-6) + _EXACT):
                        accepted = True
                        break
                    if correction == _CORRECTIONS or not (gap2 < 2.0 and math.isfinite(new)):
                        break
                    # The jumps grew by curvature alone: back onto the conditions, with the least change of the fit.
                    if not math.isfinite(joint_step(none, models2, slopes2, jumps2, hard, mu, 0.0, steps, dull)):
                        break
                    for i in range(c):
                        for a in range(7):
                            trial[i, a] += steps[i, a]
                        good = good and trial[i, 6] > 0.2 * mids[i, 6] and abs(trial[i, 2] - mids[i, 2]) < 2.0
                    if not good:
                        break
                    new = measure(
                        trial, points, weights, fractions, k, ridge, work, grads2, models2, tips2, slopes2, jumps2
                    )
        if accepted:
            for i in range(c):
                copy(trial[i], mids[i])
            grads, grads2, models, models2, tips, tips2 = grads2, grads, models2, models, tips2, tips
            slopes, slopes2, jumps, jumps2 = slopes2, slopes, jumps2, jumps
            value = new
            _, gap = _merit(value, jumps, k, 0.0, yielding)
            mu = max(0.1 * mu, 1e-12)
            if yielding > 0.0 and after > (1.0 - _LITTLE) * before:
                break
            continue
        mu = max(10.0 * mu, 1e-8)
        if mu > 1e6:
            break
    return NOT_JOINED, value, most, gap


@njit(cache=True, no_cfunc_wrapper=True)
def stored_jump(mids):
    """Greatest jump of position and angle at a joint when every piece is begun at its start, as it is stored."""
    tips, s = np.empty((1, 4)), np.empty(1)
    worst, x, y, theta = 0.0, 0.0, 0.0, 0.0
    for i in range(mids.shape[0]):
        mid = mids[i]
        kappa, fx, fy = force_form(mid)
        s[0] = -0.5 * mid[6]
        evaluate(mid[0], mid[1], mid[2], elastica_constants_exact(mid[2], kappa, fx, fy), s, tips)
        if i > 0:
            worst = max(worst, abs(tips[0, 0] - x), abs(tips[0, 1] - y), abs(tips[0, 2] - theta))
        s[0] = mid[6]
        start = elastica_constants_exact(tips[0, 2], tips[0, 3], fx, fy)
        evaluate(tips[0, 0], tips[0, 1], tips[0, 2], start, s, tips)
        x, y, theta = tips[0, 0], tips[0, 1], tips[0, 2]
    return worst


@njit(cache=True, no_cfunc_wrapper=True)
def join_slowly(mids, points, weights, fractions, k):
    """`join_pieces` for rows that it leaves apart: forces weigh a little, and curvatures are closed by and by.

    The weight is made less as long as the pieces are joined, also by the numbers that are stored. The distance that is
    returned is that of the row, without the weight of the forces.
    """
    ridge = _FIRST_RIDGE
    best, best_gap, total = mids.copy(), math.inf, 0
    for level in range(_RIDGES):
        if level == 0:
            status, _, more, gap = join_pieces(mids, points, weights, fractions, 3, ridge, 0.0, _ITERATIONS)
            total += more
            if status == BAD_SPLINE:
                return status, math.inf, total, math.inf
            yielding = _FIRST_YIELDING
            for _ in range(_YIELDS if k == 4 else 0):
                _, _, more, _ = join_pieces(mids, points, weights, fractions, 4, ridge, yielding, _YIELDING_STEPS)
                total += more
                yielding *= 0.1
        status, _, more, gap = join_pieces(mids, points, weights, fractions, k, ridge, 0.0, _ITERATIONS)
        total += more
        if status != JOINED or (level > 0 and not stored_jump(mids) <= _STORED + _LOOSER * mids.shape[0]):
            break
        best_gap = gap
        for i in range(mids.shape[0]):
            copy(mids[i], best[i])
        ridge *= 0.1
    if math.isfinite(best_gap):
        for i in range(mids.shape[0]):
            copy(best[i], mids[i])
    # one look without the weight, not a step
    _, value, _, last_gap = join_pieces(mids, points, weights, fractions, k, 0.0, 0.0, 0)
    return (JOINED, value, total, best_gap) if math.isfinite(best_gap) else (NOT_JOINED, value, total, last_gap)


@njit(cache=True, no_cfunc_wrapper=True)
def _onto(mid, first, last):
    """Turn, scale and move a piece so that it runs from one point to another; as it is if its own ends coincide."""
    s, tips = np.array([-0.5 * mid[6], 0.5 * mid[6]]), np.empty((2, 4))
    kappa, fx, fy = force_form(mid)
    evaluate(mid[0], mid[1], mid[2], elastica_constants(mid[2], kappa, fx, fy), s, tips)
    x, y = tips[1, 0] - tips[0, 0], tips[1, 1] - tips[0, 1]
    square = x * x + y * y
    if not square > 1e-12 * mid[6] * mid[6]:
        return
    wx, wy = last[0] - first[0], last[1] - first[1]
    c, sn = (x * wx + y * wy) / square, (x * wy - y * wx) / square  # scale · (cos, sin) of the turn
    dx, dy = mid[0] - tips[0, 0], mid[1] - tips[0, 1]
    mid[0], mid[1] = first[0] + c * dx - sn * dy, first[1] + sn * dx + c * dy
    mid[2] += math.atan2(sn, c)
    mid[6] *= math.hypot(c, sn)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def describe_batch(points, weights, fractions, ends, guesses, k, slowly, params, info, status):
    """Splines of c pieces, one after the other, each started from the one before.

    points (m, c, n, 2), weights (m, c, n), fractions (m, c, n), ends (m, c, 2, 2), guesses (m, c, 7) in force form, already
    scaled and turned onto the ends. k: 3 or 4 conditions at a joint. slowly: by
    `join_slowly`, from the guesses alone. Fills params (m, c, 7) about the middles, in force form, info (m, 3) =
    normalised L² distance, iterations, greatest jump at a joint, and status (m,).
    """
    m, c, n = weights.shape
    p, w, f = np.zeros((c, n + 2, 2)), np.zeros((c, n + 2)), np.zeros((c, n + 2))
    e, mids, other, state = np.empty((c, 2, 2)), np.empty((c, 7)), np.empty((c, 7)), np.empty((1, 4))
    half = np.empty(1)
    known, known_value = False, 0.0
    for b in range(m):
        length = 0.0
        for i in range(c):
            for j in range(7):
                params[b, i, j] = math.nan
            for q in range(n):
                length += weights[b, i, q]
        whole, length = length, length / c  # the unit is the mean length of a piece
        status[b] = BAD_SPLINE
        info[b, 0], info[b, 1], info[b, 2] = math.nan, 0.0, math.nan
        if not length > 0.0:
            continue
        check = length
        x0, y0 = ends[b, 0, 0, 0], ends[b, 0, 0, 1]
        for i in range(c):
            for q in range(n):
                p[i, q + 1, 0], p[i, q + 1, 1] = (points[b, i, q, 0] - x0) / length, (points[b, i, q, 1] - y0) / length
                w[i, q + 1], f[i, q + 1] = weights[b, i, q] / length, fractions[b, i, q]
                check += p[i, q + 1, 0] + p[i, q + 1, 1] + f[i, q + 1]
            f[i, n + 1] = 1.0
            for j in range(2):
                e[i, j, 0], e[i, j, 1] = (ends[b, i, j, 0] - x0) / length, (ends[b, i, j, 1] - y0) / length
        for i in range(c):
            check += 0.0 if guesses[b, i, 6] > 0.0 else math.nan
        if not math.isfinite(check):
            continue
        value = math.inf
        for attempt in range(2):
            if attempt == 0:
                if slowly:
                    continue
                if not known:
                    continue
                for i in range(c):
                    copy(mids[i], other[i])
                    _onto(other[i], e[i, 0], e[i, 1])
            else:
                if status[b] == JOINED and value <= _FAR * known_value + 1e-12:
                    break
                for i in range(c):
                    g = guesses[b, i]
                    half[0] = 0.5 * g[6]
                    evaluate(g[0], g[1], g[2], elastica_constants(g[2], g[3], g[4], g[5]), half, state)
                    other[i, 0], other[i, 1] = (state[0, 0] - x0) / length, (state[0, 1] - y0) / length
                    other[i, 2], other[i, 3] = state[0, 2], state[0, 3] * length
                    to_unknowns(other[i], g[4] * length**2, g[5] * length**2, g[6] / length)
            if not slowly:
                state_of, found, iterations, gap = join_pieces(other, p, w, f, k, 0.0, 0.0, _ITERATIONS)
            else:
                state_of, found, iterations, gap = join_slowly(other, p, w, f, k)
            info[b, 1] += iterations
            if (state_of == JOINED and status[b] != JOINED) or (state_of == status[b] and found < value) or (
                status[b] == BAD_SPLINE
            ):  # fmt: skip
                status[b], value, info[b, 2] = state_of, found, gap
                if state_of != BAD_SPLINE:
                    info[b, 0] = math.sqrt(2.0 * found * (length / whole) ** 3)
                    for i in range(c):
                        kappa, fx, fy = force_form(other[i])
                        params[b, i, 0], params[b, i, 1] = x0 + length * other[i, 0], y0 + length * other[i, 1]
                        params[b, i, 2], params[b, i, 3] = other[i, 2], kappa / length
                        params[b, i, 4], params[b, i, 5] = fx / length**2, fy / length**2
                        params[b, i, 6] = other[i, 6] * length
                        copy(other[i], mids[i])
        known = status[b] == JOINED
        known_value = value
