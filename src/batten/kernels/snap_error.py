"""The smallest error of a gripper that makes a held rod snap: folds around its pose, found by following it."""

import math

import numpy as np
from numba import njit

from batten.kernels.boundary_track import follow
from batten.kernels.stability import conjugate_length

DIRECTIONS = 24
_ZOOMS = 14
_GOLDEN = 0.6180339887498949
_NEAR_FOLD = 1.2  # margin below which a rod that cannot be followed is at a fold, not too stiff: it falls to 1 steeply
_DRAWN = 0.98  # share of the length in excess of the chord that is taken away at most
_STEPS = 60  # of one way; a rod that needs more is too stiff
_STRAIGHT = 1e-9  # curvature times length, throughout, below which a rod is straight


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _way(z, first, last):
    """Which share of the way between two poses the rod holds; inf if all of it. Length 1."""
    here, spent = z.copy(), np.zeros(2, np.int64)
    share = follow(here, first, last, 0.0, 1.0, True, _STEPS, spent)
    if share >= 1.0 or spent[1] > _STEPS or conjugate_length(0.0, here[1], here[2], here[3], 1.0, 0) > _NEAR_FOLD:
        return math.inf
    return share


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _shift(z, pose, angle, reach):
    """How far the end can be shifted in a direction before the rod snaps; inf if it holds as far as `reach`."""
    cos, sin = math.cos(angle), math.sin(angle)
    chord = math.hypot(pose[3], pose[4])
    longest = chord + _DRAWN * (1.0 - chord)  # |d + far u|
    along = pose[3] * cos + pose[4] * sin
    inner = along * along + (longest - chord) * (longest + chord)
    if inner <= 0.0:
        return math.inf
    far = min(reach, math.sqrt(inner) - along)
    if not far > 0.0:
        return math.inf
    last = pose.copy()
    last[3] += far * cos
    last[4] += far * sin
    return far * _way(z, pose, last)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _slant(angle, slack):
    """A direction against the chord, from an angle that counts slack and deflection alike, slack = deflection²/2."""
    return math.atan2(math.sqrt(2.0 * slack) * math.sin(angle), slack * math.cos(angle))


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def snap_error(z, dx, dy, turn, reach, turn_reach, out):
    """Into out (4,): least shift of an end (lengths), its direction, least turn of an end (radians, signed), which (0, 1).

    `z` (4,) is a stable curve of length 1 with its start in (0, 0) along x, its end in (dx, dy) at angle `turn`. Shifts up
    to `reach` and turns up to `turn_reach` are tried; inf where the rod holds all of them. If it snaps at any shift, one
    that pulls it taut counts too, because a straight rod may come back on either side. A straight rod gives 0.
    """
    out[0], out[1], out[2], out[3] = math.inf, 0.0, math.inf, 0.0
    if abs(z[1]) < _STRAIGHT and dx > 1.0 - _STRAIGHT:
        out[0], out[2] = 0.0, 0.0
        return
    pose = np.zeros(6)
    pose[3], pose[4], pose[5] = dx, dy, turn
    ahead, slack = math.atan2(dy, dx), 1.0 - math.hypot(dx, dy)
    for i in range(DIRECTIONS):
        angle = 2.0 * math.pi * i / DIRECTIONS
        size = _shift(z, pose, ahead + _slant(angle, slack), min(reach, 1.5 * out[0]))
        if size < out[0]:
            out[0], out[1] = size, angle
    if out[0] < math.inf:
        low, high = out[1] - 2.0 * math.pi / DIRECTIONS, out[1] + 2.0 * math.pi / DIRECTIONS
        a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
        fa = _shift(z, pose, ahead + _slant(a, slack), 3.0 * out[0])
        fb = _shift(z, pose, ahead + _slant(b, slack), 3.0 * out[0])
        for _ in range(_ZOOMS):
            if min(fa, fb) < out[0]:
                out[0], out[1] = min(fa, fb), a if fa < fb else b
            if fa < fb:
                high, b, fb = b, a, fa
                a = high - _GOLDEN * (high - low)
                fa = _shift(z, pose, ahead + _slant(a, slack), 3.0 * out[0])
            else:
                low, a, fa = a, b, fb
                b = low + _GOLDEN * (high - low)
                fb = _shift(z, pose, ahead + _slant(b, slack), 3.0 * out[0])
        out[1] = ahead + _slant(out[1], slack)
        if slack < out[0]:
            out[0], out[1] = slack, ahead
    for end in range(2):
        for sign in (-1.0, 1.0):
            last = pose.copy()
            last[2 if end == 0 else 5] += sign * min(turn_reach, 1.5 * abs(out[2]))
            size = min(turn_reach, 1.5 * abs(out[2])) * _way(z, pose, last)
            if size < abs(out[2]):
                out[2], out[3] = sign * size, float(end)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def snap_error_batch(starts, ends, reach, turn_reach, out):
    """`snap_error` of n curves: starts (n, 4), ends (n, 3) with dx, dy, turn; out (n, 4).

    Unstable curves give 0, bad ones NaN.
    """
    for i in range(starts.shape[0]):
        z = starts[i]
        out[i] = math.nan
        if not math.isfinite(z.sum() + ends[i].sum()):
            continue
        if not conjugate_length(0.0, z[1], z[2], z[3], 1.0, 0) > 1.0:
            out[i] = 0.0
            continue
        snap_error(z, ends[i, 0], ends[i, 1], ends[i, 2], reach[i], turn_reach, out[i])
