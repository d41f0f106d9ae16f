"""The directed Hausdorff distance from one polyline to another, by branch and bound.

On a segment of the first polyline the distance to one fixed segment of the second is convex, so it is largest at an
end. Hence the distance from all of a piece [p, q] to the second polyline is at most the least, over segments g, of
max(|p − g|, |q − g|), and a piece is halved only while that is above the greatest distance found so far. Segments of
the second polyline are kept in blocks with bounding boxes, so that a search looks at few of them.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

_BLOCK = 16
_DEEPEST = 60


@njit(cache=True)
def _to_segment(x, y, ax, ay, bx, by):
    """Squared distance from (x, y) to the segment from a to b."""
    dx, dy, px, py = bx - ax, by - ay, x - ax, y - ay
    along = px * dx + py * dy
    square = dx * dx + dy * dy
    if along <= 0.0 or square == 0.0:
        return px * px + py * py
    if along >= square:
        return (x - bx) ** 2 + (y - by) ** 2
    cross = px * dy - py * dx
    return cross * cross / square


@njit(cache=True)
def _nearest(x, y, b, boxes, hint):
    """(squared distance, segment) from (x, y) to the polyline b; `hint` is a segment likely to be near."""
    best = _to_segment(x, y, b[hint, 0], b[hint, 1], b[hint + 1, 0], b[hint + 1, 1])
    where = hint
    for k in range(boxes.shape[0]):
        dx = max(boxes[k, 0] - x, x - boxes[k, 2], 0.0)
        dy = max(boxes[k, 1] - y, y - boxes[k, 3], 0.0)
        if dx * dx + dy * dy < best:
            for i in range(k * _BLOCK, min((k + 1) * _BLOCK, b.shape[0] - 1)):
                d = _to_segment(x, y, b[i, 0], b[i, 1], b[i + 1, 0], b[i + 1, 1])
                if d < best:
                    best, where = d, i
    return best, where


@njit(cache=True)
def directed_distance(a, b, tolerance, at_least):
    """max over points p of the polyline a of the distance from p to the polyline b, within `tolerance` > 0.

    a, b: (n, 2) and (m, 2), n, m ≥ 2, finite. at_least: a lower bound known from elsewhere, or 0; what is returned is
    the larger of the two. The result is never above the true value by more than rounding, nor below it by more than
    the tolerance.
    """
    count = (b.shape[0] - 2) // _BLOCK + 1
    boxes = np.empty((count, 4))
    for k in range(count):
        first = k * _BLOCK
        boxes[k, 0] = boxes[k, 2] = b[first, 0]
        boxes[k, 1] = boxes[k, 3] = b[first, 1]
        for i in range(first + 1, min(first + _BLOCK + 1, b.shape[0])):
            boxes[k, 0], boxes[k, 2] = min(boxes[k, 0], b[i, 0]), max(boxes[k, 2], b[i, 0])
            boxes[k, 1], boxes[k, 3] = min(boxes[k, 1], b[i, 1]), max(boxes[k, 3], b[i, 1])
    # The piece looked at runs from p to the top of the stack; below it wait the ends of the pieces after it.
    ends = np.empty((_DEEPEST, 3))
    near = np.zeros(_DEEPEST, dtype=np.int64)
    px, py = a[0, 0], a[0, 1]
    dp, g = _nearest(px, py, b, boxes, near[0])  # a plain 0 would make numba compile it twice
    found = max(at_least, math.sqrt(dp))
    for i in range(1, a.shape[0]):
        ends[0, 0], ends[0, 1] = a[i, 0], a[i, 1]
        ends[0, 2], near[0] = _nearest(a[i, 0], a[i, 1], b, boxes, g)
        found = max(found, math.sqrt(ends[0, 2]))
        top = 0
        while top >= 0:
            qx, qy, dq, h = ends[top, 0], ends[top, 1], ends[top, 2], near[top]
            bound = min(
                max(dp, _to_segment(qx, qy, b[g, 0], b[g, 1], b[g + 1, 0], b[g + 1, 1])),
                max(dq, _to_segment(px, py, b[h, 0], b[h, 1], b[h + 1, 0], b[h + 1, 1])),
            )
            if math.sqrt(bound) <= found + tolerance or top + 1 == _DEEPEST:
                px, py, dp, g = qx, qy, dq, h
                top -= 1
            else:
                top += 1
                ends[top, 0], ends[top, 1] = 0.5 * (px + qx), 0.5 * (py + qy)
                ends[top, 2], near[top] = _nearest(ends[top, 0], ends[top, 1], b, boxes, g)
                found = max(found, math.sqrt(ends[top, 2]))
    return found
