"""Connected components of a set of pairs of lattice points: how they merge as a level rises, and how thick they are.

A cell is a pair (i, j) of points of one plane lattice. Cells are listed in order of i, then j: `offsets[i]` is the first of
row i, `columns` holds j. `neighbours` (n, 4) has for every lattice point the ones a step away along the two axes, +x, −x,
+y, −y, or −1. A cell has the eight neighbours that differ from it by one step of one of its points.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _root(parent, i):
    """The root of the tree that i belongs to; the way there is made shorter."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _cell(offsets, columns, i, j):
    """Number of the cell (i, j), −1 if it is not listed."""
    low, high = offsets[i], offsets[i + 1]
    end = high
    while low < high:
        middle = (low + high) // 2
        if columns[middle] < j:
            low = middle + 1
        else:
            high = middle
    return low if low < end and columns[low] == j else -1


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _next_cell(offsets, columns, neighbours, i, j, direction):
    """Number of the neighbour of the cell (i, j) in one of eight directions, −1 if there is none."""
    if direction < 4:
        other = neighbours[i, direction]
        return _cell(offsets, columns, other, j) if other >= 0 else -1
    other = neighbours[j, direction - 4]
    return _cell(offsets, columns, i, other) if other >= 0 else -1


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def merge_tree(offsets, rows, columns, neighbours, values, order, parent, births, sizes, merges):
    """Join cells with their neighbours in the given order (of rising values), and write down how components merge.

    A component bears the name of its first cell. Where two meet, the one that began later ends.

    parent (n,): filled with the root of each cell, one for every component that is left; births (n,), sizes (n,): for
    roots the first cell and the number of cells. merges (m, 4): first cell of the one that ends, first cell of the other,
    the cell where they meet, the number of cells of the one that ends. A cell that begins and ends at once is none.
    Returns how many merges there are; those beyond m are not written.
    """
    count = 0
    parent[:] = -1
    for k in range(order.shape[0]):
        c = order[k]
        i, j = rows[c], columns[c]
        parent[c], births[c], sizes[c] = c, c, 1
        for direction in range(8):
            q = _next_cell(offsets, columns, neighbours, i, j, direction)
            if q < 0 or parent[q] < 0:
                continue
            one, other = _root(parent, q), _root(parent, c)
            if one == other:
                continue
            first = values[births[one]] <= values[births[other]]
            old, young = (one, other) if first else (other, one)
            if births[young] != c:
                if count < merges.shape[0]:
                    merges[count, 0], merges[count, 1] = births[young], births[old]
                    merges[count, 2], merges[count, 3] = c, sizes[young]
                count += 1
            # The larger tree takes the smaller one in, under the older name.
            name = births[old]
            top, below = (old, young) if sizes[old] >= sizes[young] else (young, old)
            parent[below] = top
            sizes[top] += sizes[below]
            births[top] = name
    for c in range(parent.shape[0]):
        if parent[c] >= 0:
            parent[c] = _root(parent, c)
    return count


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def _shorten(steps, c, q, direction, change):
    """Take over the way of cell q to the outside, if that makes the one of c shorter."""
    here = there = 0
    for d in range(4):
        step = steps[q, d] + (change if d == direction else 0)
        there += step * step
        here += steps[c, d] * steps[c, d]
    if there >= here:
        return False
    for d in range(4):
        steps[c, d] = steps[q, d]
    steps[c, direction] += change
    return True


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def steps_outside(offsets, rows, columns, neighbours, most, steps):
    """For every cell the steps (n, 4), int16, along the four axes to the nearest cell that is not listed.

    Vectors are handed from neighbour to neighbour, forwards and backwards, until nothing changes or `most` rounds are done
    (Danielsson's distances: rarely, and by a fraction of a step, longer than the true ones).
    """
    n = rows.shape[0]
    for c in range(n):
        for d in range(4):
            steps[c, d] = 8000
    for _ in range(most):
        changed = False
        for turn in range(2):
            for k in range(n):
                c = k if turn == 0 else n - 1 - k
                i, j = rows[c], columns[c]
                for direction in range(8):
                    axis = direction // 2
                    change = 1 if direction % 2 == 0 else -1
                    q = _next_cell(offsets, columns, neighbours, i, j, direction)
                    if q >= 0:
                        changed = _shorten(steps, c, q, axis, change) or changed
                        continue
                    norm = 0
                    for d in range(4):
                        norm += steps[c, d] * np.int64(steps[c, d])
                    if norm > 1:
                        steps[c, :] = 0
                        steps[c, axis] = change
                        changed = True
        if not changed:
            return
