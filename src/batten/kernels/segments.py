"""Straight segments of the plane."""

from numba import njit


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def segments_cross(ax, ay, bx, by, cx, cy, dx, dy):
    """Whether the segments from a to b and from c to d cross at an inner point of both; touching is no crossing."""
    if max(ax, bx) < min(cx, dx) or max(cx, dx) < min(ax, bx):
        return False
    if max(ay, by) < min(cy, dy) or max(cy, dy) < min(ay, by):
        return False
    s1 = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    s2 = (bx - ax) * (dy - ay) - (by - ay) * (dx - ax)
    s3 = (dx - cx) * (ay - cy) - (dy - cy) * (ax - cx)
    s4 = (dx - cx) * (by - cy) - (dy - cy) * (bx - cx)
    return s1 * s2 < 0.0 and s3 * s4 < 0.0
