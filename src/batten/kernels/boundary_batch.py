"""Many boundary value problems, one row each: brought to the charts' position, searched, and brought back."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from batten.kernels.boundary_polish import (
    ANGLES,
    CURVATURES,
    END_CURVATURE,
    LENGTH,
    PROBLEM,
    START_CURVATURE,
    bending_and_inflections,
    polish,
    settle,
)
from batten.kernels.boundary_search import TIGHTEST, fill_nodes, search_chart
from batten.kernels.boundary_value import (
    CURVATURE_ANGLE,
    CURVATURE_CURVATURE,
    INFLECTED,
    INFLECTED_HIGH,
    INTEGRALS,
    ROUND,
    SOFT_CELL,
    TURNING,
    incomplete,
    prepare,
)
from batten.kernels.elastica import elastica_constants_exact, evaluate

FOUND, NONE, CUT_SHORT, UNSTORABLE, TOO_SHORT, TAUT, CLOSED_PINNED, BAD = 0, 1, 2, 3, 4, 5, 6, 7
LINE, FIGURE_EIGHTS = 8, 9  # between the two halves alone

STRAIGHT = 1e-12
"""A rod no longer than its chord by this share is straight."""
STRAIGHT_ANGLE = 1e-9
"""By how much its ends may then be turned against the chord, or bent (curvature times length)."""
STORED = 1e-9
"""What a solution may miss as it is stored; others are left out."""
CLOSED = 1e-12
"""A chord that is shorter than this share of the length, or an angle so small, is none."""
_FIGURE_EIGHT = 0.9089085575485414  # the modulus with 2E = K


def jobs_of(kind: int, most: int) -> NDArray[np.int64]:
    """What `scan_rows` is to search for a kind of ends and at most so many inflections: (n, 5) integers."""
    if kind in (START_CURVATURE, END_CURVATURE, CURVATURES):
        chart = CURVATURE_CURVATURE if kind == CURVATURES else CURVATURE_ANGLE
        jobs = [(chart, cell, 0, 20, 24) for cell in range(SOFT_CELL)] + [(chart, SOFT_CELL, 0, 4, 4)]
    else:
        waves = [(0, 0), *((count, cell) for count in range(1, most + 1) for cell in range(2))]
        jobs = [(chart, cell, count, 4, 4) for chart in (INFLECTED, INFLECTED_HIGH) for count, cell in waves]
        jobs += [(ROUND, 0, 0, 4, 4), (TURNING, 0, 0, 8, 4)]
    return np.array(jobs, dtype=np.int64)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _off(angle):
    """How far an angle is from a multiple of 2π."""
    return abs(angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5))


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _place(row, kind, problem):
    """Bring a row of `scan_rows` to standard position, in `problem`; returns (turned by, mirrored, reversed)."""
    dx, dy, angle, end_angle, curvature, end_curvature, length = row
    mirrored, back = False, kind == END_CURVATURE
    if back:
        dx, dy, end_angle = -dx, -dy, angle + math.pi
        curvature = -end_curvature
    turned = angle if kind == ANGLES else 0.0
    problem[LENGTH] = 1.0
    cos, sin = math.cos(turned) / length, math.sin(turned) / length
    problem[0], problem[1] = cos * dx + sin * dy, cos * dy - sin * dx
    problem[2], problem[3], problem[4] = 0.0, curvature * length, end_curvature * length
    if kind == ANGLES:
        turn = end_angle - angle
        mirrored = turn < 0.0
        problem[2] = abs(turn) if abs(turn) > 1e-13 else 0.0
        if mirrored:
            problem[1] = -problem[1]
    elif kind != CURVATURES:
        problem[2] = end_angle
    return turned, mirrored, back


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _bring_back(z, row, kind, problem, turned, mirrored, back):
    """The numbers `z` (7,) of `_good` from standard position to the row's own frame and unit, in place.

    Only there the last digits are chosen, since turning and scaling round; z[6] becomes what is missed as stored.
    """
    length = row[6]
    if mirrored:
        z[1], z[3] = -z[1], -z[3]
    if back:
        end = np.empty((1, 4))
        evaluate(0.0, 0.0, z[0], elastica_constants_exact(z[0], z[1], z[2], z[3]), np.ones(1), end)
        z[0], z[1], z[2], z[3] = row[2], -end[0, 3], -z[2], -z[3]
    if kind == ANGLES:
        z[0] = row[2]
    cos, sin = math.cos(turned), math.sin(turned)
    lx, ly = z[2] / length**2, z[3] / length**2
    z[1] /= length
    z[2], z[3] = cos * lx - sin * ly, sin * lx + cos * ly
    z[4] /= length
    if kind in (START_CURVATURE, CURVATURES):
        z[1] = row[4]
    problem[0], problem[1], problem[2], problem[3], problem[4] = row[0], row[1], row[3], row[4], row[5]
    problem[LENGTH] = length
    z[6] = settle(z[:4], problem, kind)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _aligned(row, kind):
    """How far a row's ends lie off the chord: the greatest angle, or curvature times length."""
    along = math.atan2(row[1], row[0])
    off = 0.0
    if kind in (ANGLES, END_CURVATURE):
        off = max(off, _off(row[2] - along))
    if kind in (ANGLES, START_CURVATURE):
        off = max(off, _off(row[3] - along))
    if kind == ANGLES:
        off = max(off, abs(row[3] - row[2]))
    if kind in (START_CURVATURE, CURVATURES):
        off = max(off, abs(row[4]) * row[6])
    if kind in (END_CURVATURE, CURVATURES):
        off = max(off, abs(row[5]) * row[6])
    return off


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def scan_rows(rows, kind, most, jobs, budget, starts, n_starts, status, evaluations):
    """The first half of solving n problems: curves that nearly arrive, and a status for each row.

    `rows` (n, 7): the end point's offset from the start, start angle, end angle, start curvature, end curvature, length; of
    angle and curvature at an end, `kind` says which is given, the other is not looked at. `jobs` (m, 5) lists what to
    search: chart, cell, count, nu, nv. Into `starts` (n, m, 4) curves in standard position, `n_starts` (n,) of them.
    Searched rows get FOUND or CUT_SHORT, closed ones FIGURE_EIGHTS, those that cannot be searched what is wrong.
    """
    problem = np.zeros(PROBLEM)
    problem[5] = min(12.0 + 6.0 * most, TIGHTEST)
    nodes = np.empty((41, 49, INTEGRALS))
    frames, nines = np.empty((64, 5)), np.empty((64, 3, 3, 3))
    spent = np.zeros(2, np.int64)
    for k in range(rows.shape[0]):
        n_starts[k], evaluations[k] = 0, 0
        row = rows[k]
        if not (math.isfinite(row.sum()) and row[6] > 0.0):
            status[k] = BAD
            continue
        chord = math.hypot(row[0], row[1]) / row[6]
        if chord > 1.0 + STRAIGHT:
            status[k] = TOO_SHORT
            continue
        if chord >= 1.0 - STRAIGHT:
            status[k] = LINE if _aligned(row, kind) <= STRAIGHT_ANGLE else TAUT
            continue
        _place(row, kind, problem)
        if chord < CLOSED and (kind == CURVATURES or (kind == ANGLES and problem[2] < CLOSED)):
            status[k] = FIGURE_EIGHTS if kind == ANGLES else CLOSED_PINNED
            continue
        prepare(problem)
        turn = problem[2]
        # without inflections the tangent keeps within `turn`: then the chord is at least cos(turn/2) of the length
        too_bent = kind == ANGLES and (turn == 0.0 or (turn < math.pi and chord < math.cos(0.5 * turn) - 1e-12))
        spent[:] = 0
        n, filled = 0, -1
        for j in range(jobs.shape[0]):
            chart, cell, count, nu, nv = jobs[j]
            if chart <= INFLECTED_HIGH and turn >= 2.0 * math.pi - 1e-9:
                continue
            if chart <= ROUND and count == 0 and too_bent:
                continue
            which = chart if chart <= ROUND else chart + 10 * cell
            if which != filled:
                fill_nodes(chart, cell, nu, nv, problem, nodes)
                filled = which
            n = search_chart(chart, cell, count, nu, nv, problem, nodes, starts[k], n, budget, frames, nines, spent)
        n_starts[k], evaluations[k] = n, spent[0]
        status[k] = CUT_SHORT if spent[1] else FOUND


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def finish_rows(rows, kind, most, starts, n_starts, found, counts, status):
    """The second half of solving n problems: starts polished, sorted out and brought to each row's own frame and unit.

    Into `found` (n, m, 7): θ₀, κ₀, λ₁, λ₂, ∫κ² ds, inflections in the open interval, greatest miss of the ends (in lengths)
    and of what is given there; sorted by energy. `counts` (n,) of them; `status` (n,) is brought to its end.
    """
    problem = np.zeros(PROBLEM)
    z = np.empty(7)
    for k in range(rows.shape[0]):
        counts[k] = 0
        table, row = found[k], rows[k]
        table[:] = math.nan
        if status[k] == LINE:
            table[0, :] = 0.0
            along = math.atan2(row[1], row[0])
            table[0, 0] = row[2] if kind in (ANGLES, END_CURVATURE) else along
            table[0, 6] = max(abs(math.hypot(row[0], row[1]) / row[6] - 1.0), _aligned(row, kind))
            counts[k], status[k] = 1, FOUND
            continue
        if status[k] not in (FOUND, CUT_SHORT, FIGURE_EIGHTS):
            continue
        turned, mirrored, back = _place(row, kind, problem)
        if status[k] == FIGURE_EIGHTS:
            n = _figures_of_eight(most, table)
            status[k] = FOUND
        else:
            n = 0
            for i in range(n_starts[k]):
                z[:4] = starts[k, i]
                if _good(z, problem, START_CURVATURE if back else kind, most) and _is_new(z, table, n):
                    if n == table.shape[0]:
                        status[k] = CUT_SHORT
                        break
                    table[n] = z
                    n += 1
        kept = 0
        for i in range(n):
            _bring_back(table[i], row, kind, problem, turned, mirrored, back)
            if table[i, 6] <= STORED:
                table[kept] = table[i]
                kept += 1
        table[kept:] = math.nan
        _sort(table, kept)
        counts[k] = kept
        if status[k] == FOUND and (kept < n or n == 0):
            status[k] = UNSTORABLE if kept < n else NONE


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _good(z, problem, kind, most):
    """Polish z (7,), in place, and add energy, inflections and miss; whether it is a solution that is looked for."""
    z[6] = polish(z[:4], problem, kind)
    lam = math.hypot(z[2], z[3])
    if kind == CURVATURES:
        z[0] -= 2.0 * math.pi * math.ceil(z[0] / (2.0 * math.pi) - 0.5)
    slack = 1.0 - math.hypot(problem[0], problem[1])  # a straight line misses by that much, and is none
    enough = 1e-3 if lam > 225.0 else max(min(1e-11, 1e-3 * slack), 4e-16)
    if not (z[6] <= enough and lam <= TIGHTEST**2):
        return False
    z[4], count = bending_and_inflections(z[:4])
    z[5] = count
    return count <= most


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _is_new(z, table, n):
    """Whether z (7,) differs from the first n rows of `table`."""
    bend = 1.0 + abs(z[1]) + math.sqrt(math.hypot(z[2], z[3]))
    for i in range(n):
        apart = abs(table[i, 1] - z[1]) / bend + math.hypot(table[i, 2] - z[2], table[i, 3] - z[3]) / (bend * bend)
        if apart + abs(table[i, 0] - z[0]) < 1e-7:
            return False
    return True


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _figures_of_eight(most, table):
    """Both mirror images of the closed figure-eights that start in their double point, once, twice … around.

    With start = end and equal angles the same curve may start anywhere on itself: one row stands for a family.
    """
    k = _FIGURE_EIGHT
    mc = (1.0 - k) * (1.0 + k)
    quarter, _ = incomplete(1.0, 0.0, mc)
    n = 0
    period = 1
    while 2 * period - 1 <= most and n + 2 <= table.shape[0]:
        arc = 4.0 * quarter * period
        for side in (-1.0, 1.0):
            psi = 2.0 * math.asin(k) * side
            table[n, 0], table[n, 1] = 0.0, 0.0
            table[n, 2], table[n, 3] = arc * arc * math.cos(psi), -arc * arc * math.sin(psi)
            table[n, 4], table[n, 5], table[n, 6] = 0.0, 2.0 * period - 1.0, 1e-15
            table[n, 4], _ = bending_and_inflections(table[n, :4])
            n += 1
        period += 1
    return n


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _sort(table, n):
    """The first n rows by energy, ascending, in place."""
    row = np.empty(table.shape[1])
    for i in range(1, n):
        row[:] = table[i]
        j = i - 1
        while j >= 0 and table[j, 4] > row[4]:
            table[j + 1] = table[j]
            j -= 1
        table[j + 1] = row
