"""A held elastica followed while its ends move: Newton steps as long as they hold, down to the fold where it must snap."""

import math

import numpy as np
from numba import njit

from batten.kernels.boundary_polish import ANGLES, LENGTH, PROBLEM, end_residual, solve3
from batten.kernels.stability import conjugate_length

_LARGEST = 0.35  # change of curvature and force in one step, against their size
_LEAST_STEP = 1e-9  # of the way; shorter ones mean a fold
_MET = 1e-12
_NEWTON = 7


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def pose_problem(first, last, share, length, problem):
    """Put the end point and angle, seen from the start, at a share of the way between two poses (6,) into problem[0:3].

    A pose is start x, y, angle, end x, y, angle; all six go linearly. Lengths become shares of `length`.
    """
    x0 = first[0] + share * (last[0] - first[0])
    y0 = first[1] + share * (last[1] - first[1])
    angle = first[2] + share * (last[2] - first[2])
    x1 = first[3] + share * (last[3] - first[3])
    y1 = first[4] + share * (last[4] - first[4])
    cos, sin = math.cos(angle) / length, math.sin(angle) / length
    problem[0] = cos * (x1 - x0) + sin * (y1 - y0)
    problem[1] = cos * (y1 - y0) - sin * (x1 - x0)
    problem[2] = first[5] + share * (last[5] - first[5]) - angle


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def follow(z, first, last, share, length, watch, most, spent):
    """Follow the curve z (4,) = (0, κ₀, λ₁, λ₂), length 1, start along x, from a share of the way to its end, in place.

    Stops where no step leads on (a fold), or, with `watch`, where the curve ceases to be stable, or after `most` steps.
    Returns how far it came (1 if it arrived); spent[0] counts evaluations with derivatives, spent[1] steps.
    """
    values, jac = np.empty((1, 4)), np.empty((1, 3, 6))
    system, residual, step = np.empty((3, 3)), np.empty(3), np.empty(3)
    problem, trial, begin = np.zeros(PROBLEM), np.empty(4), np.empty(4)
    problem[LENGTH] = 1.0
    pose_problem(first, last, share, length, problem)
    enough = max(_MET, 4.0 * end_residual(z, problem, ANGLES, values, jac, system, residual))
    spent[0] += 1
    h, steps = 1.0 - share, 0
    while share < 1.0:
        h = min(h, 1.0 - share)
        there = share + h if h < 1.0 - share else 1.0
        pose_problem(first, last, there, length, problem)
        trial[:] = z
        bend = 1.0 + abs(z[1]) + math.sqrt(math.hypot(z[2], z[3]))
        good = False
        miss = end_residual(trial, problem, ANGLES, values, jac, system, residual)
        spent[0] += 1
        size, first_size = 0.0, 0.0
        for i in range(_NEWTON):
            if not math.isfinite(miss) or not solve3(system, residual, step):
                break
            size = max(abs(step[0]) / bend, math.hypot(step[1], step[2]) / (bend * bend))
            if i == 0:
                first_size = size
                if size > _LARGEST:
                    break
            elif size > 0.5 * first_size and miss > enough:  # the second step no longer the smaller one
                break
            for j in range(3):
                trial[1 + j] -= step[j]
            if i == 0:
                begin[:] = trial
            before = miss
            miss = end_residual(trial, problem, ANGLES, values, jac, system, residual)
            spent[0] += 1
            if miss < enough and (miss > 0.1 * before or miss < 0.01 * enough):
                good = True
                break
        if not good and miss < enough:
            good = True
        if good:
            off = max(abs(trial[1] - begin[1]) / bend, math.hypot(trial[2] - begin[2], trial[3] - begin[3]) / bend**2)
            good = off <= 0.5 * first_size + 1e-9
        if good and watch:
            good = conjugate_length(0.0, trial[1], trial[2], trial[3], 1.0, 0) > 1.0
        if good:
            z[:] = trial
            share = there
            spent[1] += 1
            steps += 1
            h *= 2.0 if first_size < 0.5 * _LARGEST else 1.0
        else:
            h *= 0.5
            if h < _LEAST_STEP or steps > most:
                return share
    return 1.0


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def follow_batch(starts, firsts, lasts, lengths, most, shares, ends, spent):
    """`follow` for n rods: starts and ends (n, 4), poses (n, 6), lengths (n,); how far each came into `shares` (n,)."""
    one = np.zeros(2, np.int64)
    for i in range(starts.shape[0]):
        ends[i] = starts[i]
        one[:] = 0
        if not math.isfinite(starts[i].sum() + firsts[i].sum() + lasts[i].sum() + lengths[i]):
            shares[i] = math.nan
            continue
        watch = conjugate_length(0.0, starts[i, 1], starts[i, 2], starts[i, 3], 1.0, 0) > 1.0
        shares[i] = follow(ends[i], firsts[i], lasts[i], 0.0, lengths[i], watch, most, one)
        spent[i] = one
