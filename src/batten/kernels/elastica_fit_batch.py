"""Fits of many sampled curves, each from several starts."""

import math

import numpy as np
from numba import njit

from batten.kernels.elastica import elastica_constants, evaluate
from batten.kernels.elastica_fit import FIT_BAD, FIT_ITERATIONS, fit_from, force_form
from batten.kernels.initial_guess import GUESS_BAD, initial_guess, multipliers
from batten.kernels.linear import copy
from batten.kernels.shape_library import best_shapes, place, resample

# How many different starts there are: the canonical guess; the affine curvature of eq. (6) integrated from the middle; the
# most similar shapes of a library, with different numbers of inflections; the affine curvature fitted in H¹ first; the mean
# circle; half the force; a larger force; the opposite curvature in the middle.
LIBRARY_FIRST, LIBRARY_COUNT = 2, 6
IN_H1 = LIBRARY_FIRST + LIBRARY_COUNT
MAX_STARTS = IN_H1 + 5
_FIRST_LAP = 15  # iterations that every start gets
_GO_ON = 2  # how many go on after that
_POOR = 0.5 * 0.04**2  # F of a fit so far away that all starts are tried
FIT_GAVE_UP = 9  # within this module: it has had its iterations


@njit(cache=True, no_cfunc_wrapper=True)
def to_unknowns(mid, fx, fy, length):
    """Complete (x, y, θ, κ) at the middle to the unknowns of `elastica_fit`, in place."""
    c, s = math.cos(mid[2]), math.sin(mid[2])
    mid[3] *= length
    mid[4] = length * length * (c * fx + s * fy)
    mid[5] = length * length * (c * fy - s * fx)
    mid[6] = length


@njit(cache=True, no_cfunc_wrapper=True)
def make_start(which, points, theta, kappa, weights, fractions, guess, mid):
    """Start number `which` (see MAX_STARTS) for a curve of length 1, about the middle; False if there is none."""
    s, state = np.empty(1), np.empty((1, 4))
    if which == 0:
        s[0] = 0.5 * guess[6]
        evaluate(guess[0], guess[1], guess[2], elastica_constants(guess[2], guess[3], guess[4], guess[5]), s, state)
        for k in range(4):
            mid[k] = state[0, k]
        to_unknowns(mid, guess[4], guess[5], guess[6])
        return math.isfinite(guess[0])
    l1, l2, _, _, _, _ = multipliers(points, kappa, weights)
    nearest, mean, mx, my = 0, 0.0, 0.0, 0.0
    for i in range(weights.shape[0]):
        mean += weights[i] * kappa[i]
        mx += weights[i] * points[i, 0]
        my += weights[i] * points[i, 1]
        if abs(fractions[i] - 0.5) < abs(fractions[nearest] - 0.5):
            nearest = i
    factor = 1.0
    if which == IN_H1 + 1:
        factor = 0.0
    elif which == IN_H1 + 2:
        factor = 0.5
    elif which == IN_H1 + 3:
        factor = 1.6
    l1, l2 = factor * l1, factor * l2
    x, y = points[nearest, 0], points[nearest, 1]
    curvature = mean - l1 * (y - my) + l2 * (x - mx)  # affine, with the mean of the given curve
    if which == IN_H1 + 4:
        curvature = -curvature
    s[0] = 0.5 - fractions[nearest]
    evaluate(x, y, theta[nearest], elastica_constants(theta[nearest], curvature, l1, l2), s, state)
    for k in range(4):
        mid[k] = state[0, k]
    to_unknowns(mid, l1, l2, 1.0)
    return math.isfinite(mid[0] + mid[1] + mid[2] + mid[3])


@njit(cache=True, no_cfunc_wrapper=True)
def fit_starts(p, th, k, w, f, e, guess, library, m, h1, ridge, starts, max_iterations, result):
    """The best of several starts for one curve of length 1; (status, F, iterations, √(predicted decrease)).

    Every start gets a few iterations; then the best goes on until it is done, and the next if it is not far behind.
    """
    inner = slice(1, w.shape[0] - 1)
    mid, trial = np.empty(7), np.empty(7)
    found, values, states = np.empty((MAX_STARTS, 7)), np.full(MAX_STARTS, math.inf), np.full(MAX_STARTS, FIT_BAD)
    optimalities = np.full(MAX_STARTS, math.inf)
    curve, chosen = np.empty(library.shapes.shape[1], np.complex128), np.empty(LIBRARY_COUNT, np.int64)
    total = 0
    first = max_iterations if starts == 1 else min(_FIRST_LAP, max_iterations)
    best, begin, end, prepared = 0, 0, starts, False
    for _ in range(2):
        for which in range(begin, end):
            if which == IN_H1 and h1:
                continue
            if LIBRARY_FIRST <= which < IN_H1:
                if not prepared:
                    prepared = True
                    resample(p[inner], f[inner], e, curve.shape[0] - 4, curve)
                    most_off = 4.0 if m == 6 or h1 else math.inf
                    best_shapes(
                        curve, library.shapes, library.classes, library.turnings, e[1, 2] - e[0, 2], most_off, chosen
                    )
                i = chosen[which - LIBRARY_FIRST]
                if i < 0:
                    continue
                angle = 0.5 * (e[0, 2] + e[1, 2]) - library.means[i]
                place(curve, library.weights, library.shapes[i], library.norms[i], library.centres[i], angle, mid)
                copy(library.unknowns[i], mid[3:6])
            elif not make_start(which, p[inner], th[inner], k[inner], w[inner], f[inner], guess, mid):
                continue
            # One start runs in H¹ first, then once more in the metric that was asked for.
            for stage in range(2 if which == IN_H1 else 1):
                states[which], values[which], iterations, optimalities[which] = fit_from(
                    mid, p, th, w, f, e, m, h1 or (which == IN_H1 and stage == 0), ridge, first, trial
                )
                total += iterations
                copy(trial, mid)
            copy(trial, found[which])
            if values[which] < 1e-24:
                break
        best = np.argmin(values)
        for _ in range(_GO_ON):
            # The best one goes on if it is not done, then the next, if it is not far behind.
            onward = -1
            for which in range(MAX_STARTS):
                near = values[which] < 4.0 * values[best] and states[which] == FIT_ITERATIONS
                if near and (onward < 0 or values[which] < values[onward]):
                    onward = which
            if onward < 0 or first == max_iterations:
                break
            copy(found[onward], mid)
            states[onward], values[onward], iterations, optimalities[onward] = fit_from(
                mid, p, th, w, f, e, m, h1, ridge, max_iterations - first, trial
            )
            total += iterations
            copy(trial, found[onward])
            if states[onward] == FIT_ITERATIONS:
                states[onward] = FIT_GAVE_UP
            best = np.argmin(values)
        if starts == 1 or values[best] < 1e-24 or (states[best] != FIT_GAVE_UP and values[best] < _POOR):
            break
        begin, end = starts, MAX_STARTS  # for curves that no start came near, or from which none converged
    for which in range(MAX_STARTS):
        if states[which] == FIT_GAVE_UP:
            states[which] = FIT_ITERATIONS
    copy(found[best], result)
    return states[best], values[best], total, optimalities[best]


@njit(cache=True, no_cfunc_wrapper=True)
def fit_batch(
    points,
    theta,
    kappa,
    weights,
    fractions,
    lengths,
    ends,
    given,
    library,
    m,
    h1,
    ridge,
    starts,
    max_iterations,
    params,
    info,
    status,
):
    """Fit b sampled curves. Fills params (b, 7) about the middle, info (b, 7) and status (b,).

    Info: distance, R₁, R₂, R₃, R₄ of the canonical guess, iterations over all starts, √(predicted decrease). The samples
    (see `CurveSamples`) may have any unit; everything inside is scaled to length 1. m: end conditions, 0, 4 or 6. A finite
    row of `given` (b, 7), force form at the start, takes the place of the canonical guess. library: a `ShapeLibrary` for the
    same m. ridge: weight of |λ|²ℓ⁴.
    """
    n = weights.shape[1]
    p, th, k, w, f = np.zeros((n + 2, 2)), np.zeros(n + 2), np.zeros(n + 2), np.zeros(n + 2), np.zeros(n + 2)
    e, guess, residuals = np.empty((2, 3)), np.empty(7), np.empty(4)
    result = np.empty(7)
    for b in range(lengths.shape[0]):
        length = lengths[b]
        for j in range(7):
            params[b, j], info[b, j] = math.nan, math.nan
        info[b, 5] = 0.0
        status[b] = FIT_BAD
        if not length > 0.0:
            continue
        x0, y0 = points[b, n // 2, 0], points[b, n // 2, 1]
        check = 0.0
        for i in range(n):
            p[i + 1, 0], p[i + 1, 1] = (points[b, i, 0] - x0) / length, (points[b, i, 1] - y0) / length
            th[i + 1], k[i + 1], w[i + 1] = theta[b, i], kappa[b, i] * length, weights[b, i] / length
            f[i + 1] = fractions[b, i]
            check += p[i + 1, 0] + p[i + 1, 1] + th[i + 1] + k[i + 1] + w[i + 1] + f[i + 1]
        f[n + 1] = 1.0
        for j in range(2):
            e[j, 0], e[j, 1], e[j, 2] = (ends[b, j, 0] - x0) / length, (ends[b, j, 1] - y0) / length, ends[b, j, 2]
            check += e[j, 0] + e[j, 1] + e[j, 2]
        if not math.isfinite(check):
            continue
        inner = slice(1, n + 1)
        if math.isfinite(given[b, 0]):
            guess[0], guess[1], guess[2] = (given[b, 0] - x0) / length, (given[b, 1] - y0) / length, given[b, 2]
            guess[3], guess[4], guess[5] = given[b, 3] * length, given[b, 4] * length**2, given[b, 5] * length**2
            guess[6] = given[b, 6] / length
            residuals[:] = math.nan
        elif initial_guess(p[inner], th[inner], k[inner], w[inner], f[inner], 1.0, e, guess, residuals) == GUESS_BAD:
            guess[0] = math.nan
        for j in range(4):
            info[b, 1 + j] = residuals[j]
        status[b], best, info[b, 5], info[b, 6] = fit_starts(
            p, th, k, w, f, e, guess, library, m, h1, ridge, starts, max_iterations, result
        )
        if math.isfinite(best):
            params[b, 0], params[b, 1], params[b, 2] = x0 + length * result[0], y0 + length * result[1], result[2]
            bend, fx, fy = force_form(result)
            params[b, 3], params[b, 4], params[b, 5] = bend / length, fx / length**2, fy / length**2
            params[b, 6] = result[6] * length
            force = (params[b, 4] ** 2 + params[b, 5] ** 2) * params[b, 6] ** 4
            info[b, 0] = math.sqrt(max(2.0 * best - ridge * force, 0.0))


@njit(cache=True, no_cfunc_wrapper=True)
def guess_batch(points, theta, kappa, weights, fractions, lengths, ends, params, info, status):
    """`initial_guess` for every row."""
    for b in range(lengths.shape[0]):
        params[b] = np.nan
        status[b] = initial_guess(
            points[b], theta[b], kappa[b], weights[b], fractions[b], lengths[b], ends[b], params[b], info[b]
        )
