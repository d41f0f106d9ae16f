"""Many boundary value problems, one row each: brought to the charts' position, searched, and brought back."""

import math

import numpy as np
from numba import njit

from batten.kernels.boundary_polish import (
    ANGLES,
    CURVATURES,
    END_CURVATURE,
    LENGTH,
    PROBLEM,
    START_CURVATURE,
    bending_and_inflections,
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

STRAIGHT = 1e-12
"""A rod no longer than its chord by this share is straight."""
STRAIGHT_ANGLE = 1e-9
"""By how much its ends may then be turned against the chord, or bent (curvature times length)."""
STORED = 1e-9
"""What a solution may miss as it is stored; others are left out."""
CLOSED = 1e-12
"""A chord that is shorter than this share of the length, or an angle so small, is none."""
_FIGURE_EIGHT = 0.9089085575485414  # the modulus with 2E = K


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def search(problem, kind, most, budget, found, nodes, frames, nines, spent):
    """All solutions of one problem in standard position into `found` (m, 7); how many. See `_keep` for the columns.

    `problem` as in `chart_point`; for kind ANGLES the angle at the start is 0 and problem[2] ≥ 0 that at the end.
    """
    n = 0
    spent[:] = 0
    prepare(problem)
    if kind != ANGLES:
        chart = CURVATURE_ANGLE if kind == START_CURVATURE else CURVATURE_CURVATURE
        for cell in range(SOFT_CELL + 1):
            nu, nv = (4, 4) if cell == SOFT_CELL else (20, 24)
            fill_nodes(chart, cell, nu, nv, problem, nodes)
            n = search_chart(chart, cell, 0, nu, nv, problem, kind, most, nodes, found, n, budget, frames, nines, spent)
        return n
    turn = problem[2]
    if turn < 2.0 * math.pi:
        for chart in (INFLECTED, INFLECTED_HIGH):
            fill_nodes(chart, 0, 4, 4, problem, nodes)
            for count in range(0, most + 1):
                for cell in range(2):
                    if count > 0 or (cell == 0 and turn > 0.0):
                        n = search_chart(
                            chart, cell, count, 4, 4, problem, kind, most, nodes, found, n, budget, frames, nines, spent
                        )
    if turn > 0.0:
        fill_nodes(ROUND, 0, 4, 4, problem, nodes)
        n = search_chart(ROUND, 0, 0, 4, 4, problem, kind, most, nodes, found, n, budget, frames, nines, spent)
        fill_nodes(TURNING, 0, 8, 4, problem, nodes)
        n = search_chart(TURNING, 0, 0, 8, 4, problem, kind, most, nodes, found, n, budget, frames, nines, spent)
    return n


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _off(angle):
    """How far an angle is from a multiple of 2π."""
    return abs(angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5))


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _place(row, kind, problem):
    """Bring a row of `solve_rows` to standard position, in `problem`; returns (turned by, mirrored, reversed)."""
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
    """The numbers `z` (7,) of `_keep` from standard position to the row's own frame and unit, in place.

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
def solve_rows(rows, kind, most, budget, found, counts, status, evaluations):
    """All solutions of n problems.

    `rows` (n, 7): the end point's offset from the start, start angle, end angle, start curvature, end curvature, length; of
    angle and curvature at an end, `kind` says which is given, the other is not looked at. Into `found` (n, m, 7): the
    numbers (θ₀, κ₀, λ₁, λ₂) in the problem's own frame and unit, ∫κ² ds, inflections in the open interval, greatest miss of
    the ends (in lengths) and of what is given there; sorted by energy. `counts`, `status`, `evaluations` (n,).
    """
    problem = np.zeros(PROBLEM)
    problem[5] = min(12.0 + 6.0 * most, TIGHTEST)
    nodes = np.empty((41, 49, INTEGRALS))
    frames, nines = np.empty((64, 5)), np.empty((64, 3, 3, 3))
    spent = np.zeros(2, np.int64)
    for k in range(rows.shape[0]):
        counts[k], evaluations[k] = 0, 0
        table, row = found[k], rows[k]
        table[:] = math.nan
        length = row[6]
        if not (math.isfinite(row.sum()) and length > 0.0):
            status[k] = BAD
            continue
        chord = math.hypot(row[0], row[1]) / length
        if chord > 1.0 + STRAIGHT:
            status[k] = TOO_SHORT
            continue
        turned, mirrored, back = _place(row, kind, problem)
        if chord >= 1.0 - STRAIGHT:
            status[k] = TAUT
            along = math.atan2(row[1], row[0])
            n_off = 0.0
            if kind in (ANGLES, END_CURVATURE):
                n_off = max(n_off, _off(row[2] - along))
            if kind in (ANGLES, START_CURVATURE):
                n_off = max(n_off, _off(row[3] - along))
            if kind == ANGLES:
                n_off = max(n_off, abs(row[3] - row[2]))
            if kind in (START_CURVATURE, CURVATURES):
                n_off = max(n_off, abs(row[4]) * length)
            if kind in (END_CURVATURE, CURVATURES):
                n_off = max(n_off, abs(row[5]) * length)
            if n_off <= STRAIGHT_ANGLE:
                table[0, :] = 0.0
                table[0, 0] = row[2] if kind in (ANGLES, END_CURVATURE) else along
                table[0, 6] = max(abs(chord - 1.0), n_off)
                counts[k], status[k] = 1, FOUND
            continue
        if kind == ANGLES and chord < CLOSED and problem[2] < CLOSED:
            n = _figures_of_eight(most, table)
            spent[:] = 0
        elif kind == CURVATURES and chord < CLOSED:
            status[k] = CLOSED_PINNED
            continue
        else:
            n = search(problem, START_CURVATURE if back else kind, most, budget, table, nodes, frames, nines, spent)
        kept = 0
        for i in range(n):
            _bring_back(table[i], row, kind, problem, turned, mirrored, back)
            if table[i, 6] <= STORED:
                table[kept] = table[i]
                kept += 1
        table[kept:] = math.nan
        _sort(table, kept)
        counts[k], evaluations[k] = kept, spent[0]
        status[k] = CUT_SHORT if spent[1] else (UNSTORABLE if kept < n else (FOUND if n > 0 else NONE))


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
