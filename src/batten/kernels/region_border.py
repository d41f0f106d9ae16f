"""The border of the set {violation < 0}, followed from node to node of a lattice that is computed only where it is needed.

A crossing is a lattice edge from a good node to a bad one. From a crossing the border goes through the cell ahead to the
next one, the good side on its left; where opposite corners of a cell are good and the other two are not, its middle decides.
So rings are closed and do not cross themselves, and their cost goes with their length. Rings are looked for on the lines of
the lattice between neighbouring nodes of a coarser one, every `stride`-th in both directions: along such a line the number
of crossings that are known has to agree with the signs at its ends.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from batten.kernels.good_region import violation, work_space
from batten.kernels.segments import segments_cross

#: What `trace_rings` returns besides a count of points: all is well; the border leaves the lattice at the side of the least
#: or most first index, least or most second; the arrays for points are too short.
DONE, LEFT, RIGHT, BELOW, ABOVE, NO_ROOM = range(6)
#: Where violation differs by more along one edge it jumps, and a zero by interpolation is not trusted.
JUMP = 0.25


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def components(values, labels):
    """Numbers from 1 for the pieces of {values < 0}, neighbours at corners included, into `labels`; how many there are."""
    ni, nj = values.shape
    labels[:] = 0
    stack = np.empty((ni * nj, 2), np.int64)
    count = 0
    for i in range(ni):
        for j in range(nj):
            if not values[i, j] < 0.0 or labels[i, j] > 0:
                continue
            count += 1
            labels[i, j] = count
            stack[0, 0], stack[0, 1] = i, j
            top = 1
            while top > 0:
                top -= 1
                p, q = stack[top]
                for a in range(max(0, p - 1), min(ni, p + 2)):
                    for b in range(max(0, q - 1), min(nj, q + 2)):
                        if values[a, b] < 0.0 and labels[a, b] == 0:
                            labels[a, b] = count
                            stack[top, 0], stack[top, 1] = a, b
                            top += 1
    return count


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def value_at(i, j, frame, values, problem, work):
    """`violation` at a node, computed when it is first asked for."""
    if math.isnan(values[i, j]):
        x, y = frame[0] + i * frame[2] + j * frame[4], frame[1] + i * frame[3] + j * frame[5]
        values[i, j] = violation(x, y, problem, work)
    return values[i, j]


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def edge_zero(i, j, way, small, frame, values, problem, work):
    """How far along the edge from the good node (i, j) a good place lies that is within `small` of a bad one.

    In parts of the edge. False position with the point moved towards the farther end, so that both ends close in; after
    four steps halves.
    """
    a, b = i + (way == 0) - (way == 2), j + (way == 1) - (way == 3)
    x, y = frame[0] + i * frame[2] + j * frame[4], frame[1] + i * frame[3] + j * frame[5]
    u, v = frame[0] + a * frame[2] + b * frame[4], frame[1] + a * frame[3] + b * frame[5]
    low, high, f, g = 0.0, 1.0, values[i, j], values[a, b]
    for step in range(40):
        width = high - low
        if width <= small:
            break
        if step < 4 and g - f < 2.0:
            t = low - f * width / (g - f)
            t += 0.4 * small if t - low < high - t else -0.4 * small
            t = min(high - 0.3 * small, max(low + 0.3 * small, t))
        else:
            t = 0.5 * (low + high)
        h = violation(x + t * (u - x), y + t * (v - y), problem, work)
        if h < 0.0:
            low, f = t, h
        else:
            high, g = t, h
    return low


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def follow(i, j, way, frame, values, marks, problem, work, ring):
    """Follow the border from the crossing at the good node (i, j) towards its neighbour number `way` until it closes.

    ring (m, 3): the crossings' nodes and ways; marks: a bit at the good node for each crossing passed. Returns (how many,
    state). Ways: 0 … 3 are +i, +j, −i, −j.
    """
    ni, nj = values.shape
    count = 0
    while not marks[i, j] & (1 << way):
        if count == ring.shape[0]:
            return count, NO_ROOM
        marks[i, j] |= 1 << way
        ring[count, 0], ring[count, 1], ring[count, 2] = i, j, way
        count += 1
        ahead = (way + 1) % 4
        di, dj = (ahead == 0) - (ahead == 2), (ahead == 1) - (ahead == 3)
        a, b = i + di, j + dj
        c, d = a + (way == 0) - (way == 2), b + (way == 1) - (way == 3)
        if a < 0 or c < 0:
            return count, LEFT
        if a >= ni or c >= ni:
            return count, RIGHT
        if b < 0 or d < 0:
            return count, BELOW
        if b >= nj or d >= nj:
            return count, ABOVE
        beside, across = value_at(a, b, frame, values, problem, work) < 0.0, False
        across = value_at(c, d, frame, values, problem, work) < 0.0
        if across and not beside:
            x = frame[0] + 0.5 * ((i + c) * frame[2] + (j + d) * frame[4])
            y = frame[1] + 0.5 * ((i + c) * frame[3] + (j + d) * frame[5])
            across = violation(x, y, problem, work) < 0.0
            beside = across
        if not beside:
            way = ahead
        elif not across:
            i, j = a, b
        else:
            i, j, way = c, d, (way + 3) % 4
    return count, DONE


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def farther_than(first, last, far, places, count, kept, stack):
    """Mark the points that chords from `first` to `last` (modulo count) need to stay within `far` (Douglas–Peucker)."""
    stack[0, 0], stack[0, 1] = first, last
    top = 1
    while top > 0:
        top -= 1
        a, b = stack[top]
        x, y = places[a]
        dx, dy = places[b % count, 0] - x, places[b % count, 1] - y
        size = dx * dx + dy * dy
        worst, most = -1, far * far
        for k in range(a + 1, b):
            u, v = places[k, 0] - x, places[k, 1] - y
            t = min(1.0, max(0.0, (u * dx + v * dy) / size)) if size > 0.0 else 0.0
            u, v = u - t * dx, v - t * dy
            if u * u + v * v > most:
                worst, most = k, u * u + v * v
        if worst >= 0:
            kept[worst] = True
            stack[top, 0], stack[top, 1], stack[top + 1, 0], stack[top + 1, 1] = a, worst, worst, b
            top += 2


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def crosses_itself(points, count):
    """Whether two edges of a closed ring that are not neighbours cross."""
    for i in range(count):
        ax, ay = points[i]
        bx, by = points[(i + 1) % count]
        for j in range(i + 2, count - (i == 0)):
            cx, cy = points[j]
            dx, dy = points[(j + 1) % count]
            if segments_cross(ax, ay, bx, by, cx, cy, dx, dy):
                return True
    return False


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def finish(ring, count, small, far, frame, values, problem, work, parts, places, kept, stack, points, rim):
    """The points of a ring of crossings, without those that are not needed to stay within `far`: how many.

    small: how near to a bad place they are along their edges, 0 for zeros by interpolation alone. In parts of an edge.
    """
    for k in range(count):
        i, j, way = ring[k]
        a, b = i + (way == 0) - (way == 2), j + (way == 1) - (way == 3)
        f, g = values[i, j], values[a, b]
        t = f / (f - g) if g < math.inf else 1.0
        if small > 0.0 and g - f > JUMP:
            t = edge_zero(i, j, way, 2.0 * small, frame, values, problem, work)
        parts[k], kept[k] = t, False
        places[k, 0], places[k, 1] = i + t * (a - i), j + t * (b - j)
    half, most = 0, -1.0
    for k in range(count):
        size = (places[k, 0] - places[0, 0]) ** 2 + (places[k, 1] - places[0, 1]) ** 2
        if size > most:
            half, most = k, size
    kept[0], kept[half] = True, True
    farther_than(0, half, far, places, count, kept, stack)
    farther_than(half, count, far, places, count, kept, stack)
    written = 0
    for whole in range(2):
        written = 0
        for k in range(count):
            if not kept[k]:
                continue
            i, j, way = ring[k]
            a, b = i + (way == 0) - (way == 2), j + (way == 1) - (way == 3)
            t = parts[k]
            if small > 0.0 and (whole == 1 or values[a, b] - values[i, j] <= JUMP):
                t = edge_zero(i, j, way, small, frame, values, problem, work)
            p, q = i + t * (a - i), j + t * (b - j)
            points[written, 0] = frame[0] + p * frame[2] + q * frame[4]
            points[written, 1] = frame[1] + p * frame[3] + q * frame[5]
            rim[written] = values[a, b] == math.inf
            written += 1
        if written > 2 and not crosses_itself(points, written):
            break
        kept[:count] = True
    return written


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def trace_rings(frame, values, marks, seeds, stride, small, far, problem, points, numbers, rim):
    """The rings that lie between nodes `seeds` (m, 2) and their neighbours `stride` nodes away; (how many points, state).

    frame (6,): the place of node (0, 0), the steps along both indices. values (ni, nj): NaN where not yet known; marks: of
    the same shape, zeros. small, far: see `finish`. points (n, 2), numbers (n,) of the rings from 0, rim (n,): whether the
    bad node beside is infinitely bad. The seeds are good; from each the first crossing along a line is followed, so that the
    rings are those of its own component. If none of them is an outer one, it is looked for from the first seed along +i.
    """
    work = work_space(problem[0].shape[0], problem[3])
    ni, nj = values.shape
    room = points.shape[0]
    ring, parts, places = np.empty((room, 3), np.int64), np.empty(room), np.empty((room, 2))
    kept, stack = np.empty(room, np.bool_), np.empty((room + 2, 2), np.int64)
    count = number = 0
    enclosed = False
    for m in range(4 * seeds.shape[0] + 1):
        last = m == 4 * seeds.shape[0]
        if last and enclosed:
            break
        i, j = seeds[0] if last else seeds[m // 4]
        way = m % 4
        di, dj = (way == 0) - (way == 2), (way == 1) - (way == 3)
        length = ni - 1 - i if di > 0 else (i if di < 0 else (nj - 1 - j if dj > 0 else j))
        length = length if last else min(length, stride)
        met = 0
        for k in range(length):
            p, q = i + k * di, j + k * dj
            met += (marks[p, q] >> way) & 1
            met += (marks[p + di, q + dj] >> ((way + 2) % 4)) & 1
        after = value_at(i + length * di, j + length * dj, frame, values, problem, work) < 0.0
        if not last and met % 2 == (0 if after else 1):
            continue
        here = value_at(i, j, frame, values, problem, work) < 0.0
        for k in range(length):
            p, q = i + k * di, j + k * dj
            before, here = here, value_at(p + di, q + dj, frame, values, problem, work) < 0.0
            if here == before:
                continue
            turned = way
            if not before:
                p, q, turned = p + di, q + dj, (way + 2) % 4
            if not marks[p, q] & (1 << turned):
                found, state = follow(p, q, turned, frame, values, marks, problem, work, ring[: room - count])
                if state != DONE:
                    return count, state
                added = finish(
                    ring, found, small, far, frame, values, problem, work, parts, places, kept, stack, points[count:],
                    rim[count:],
                )  # fmt: skip
                numbers[count : count + added] = number
                enclosed = enclosed or area_of(points[count:], added) > 0.0
                count += added
                number += 1
            if not last or enclosed:
                break
        if last and not enclosed:
            return 0, RIGHT
    return count, DONE


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def area_of(points, count):
    """Twice the area inside a ring, positive counter-clockwise."""
    total = 0.0
    x, y = points[0]
    for k in range(1, count - 1):
        total += (points[k, 0] - x) * (points[k + 1, 1] - y) - (points[k, 1] - y) * (points[k + 1, 0] - x)
    return total
