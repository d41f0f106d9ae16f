"""Angles and edges of a cubic Bézier's control polygon in standard position, and what they say about its shape.

Standard position (Brander2018 §3): the similarity that takes p₀ to 0 and p₃ to 1 in the complex plane. The outer edges
are the vectors from an end to its inner control point, e₁ = p₁ − p₀ and e₂ = p₂ − p₃, given here as a unit vector and a
length each. β₁ = π − arg e₁ and β₂ = arg e₂ lie in [0, 2π); they are the angles at the ends on the upper side of the chord.
"""

import math

import numpy as np
from numba import njit

#: Columns of what `criteria_batch` returns; the last seven hold 0 or 1.
BETA_1, BETA_2, PHI_1, PHI_2, LENGTH_1, LENGTH_2, LEAST, MOST = range(8)
INFLECTIONAL, ANGLES_1, ANGLES_2, LENGTHS_1, LENGTHS_2, SIMPLE, ZONE = range(8, 15)
COLUMNS = 15

TURN = 2.0 * math.pi
#: Edge-length constraint 2: most of the quotient of the outer edges of an inflectional curve.
MOST_QUOTIENT = 1.3
#: Least outer edge of an inflectional curve, of both projections.
LEAST_EDGE = 0.27

# (φ₁, φ₂) on the border of the projection zone, from one of its axes of symmetry to the other: Brander2018 §5.1.
_QUARTER = ((1.05, 1.05), (1.9, 1.3), (math.pi, 1.35), (4.3, 1.3), (5.2, TURN - 5.2))


def _zone_border():
    """Cubic pieces of a quarter of the zone's border: (4, 2, 4), powers of τ ∈ [0, 1], rows 2π − φ₁ − φ₂ and φ₁ − φ₂.

    The periodic C² spline through all sixteen points, whose parameter grows with the root of the distance between
    neighbours (centripetal). It is found on the whole circle; a quarter says everything, by symmetry.
    """
    quarter = np.array([(TURN - a - b, a - b) for a, b in _QUARTER])
    half = np.vstack([quarter[:-1], quarter[:0:-1] * [-1.0, 1.0]])
    points = np.vstack([half, -half])
    n = len(points)
    steps = np.sqrt(np.linalg.norm(np.roll(points, -1, 0) - points, axis=1))
    before = np.roll(steps, 1)
    # Slopes m at the points that make the second derivative continuous.
    system = np.zeros((n, n))
    rows = np.arange(n)
    system[rows, rows - 1] = steps
    system[rows, rows] = 2.0 * (steps + before)
    system[rows, (rows + 1) % n] = before
    chords = (np.roll(points, -1, 0) - points) / steps[:, None]
    slopes = np.linalg.solve(system, 3.0 * (steps[:, None] * np.roll(chords, 1, 0) + before[:, None] * chords))
    left, right = points[:4], points[1:5]
    rise, fall = slopes[:4] * steps[:4, None], slopes[1:5] * steps[:4, None]
    d = right - left
    pieces = np.stack([left, rise, 3.0 * d - 2.0 * rise - fall, rise + fall - 2.0 * d], axis=-1)
    pieces.setflags(write=False)
    return pieces


ZONE_BORDER = _zone_border()


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def standard_edges(p):
    """(c₁, s₁, L₁, c₂, s₂, L₂, flag): directions and lengths of both outer edges in standard position.

    flag: 0 fine, 1 an end without a direction or a chord of length zero (or too small for doubles), 2 not finite.
    """
    dx, dy = p[3, 0] - p[0, 0], p[3, 1] - p[0, 1]
    ax, ay = p[1, 0] - p[0, 0], p[1, 1] - p[0, 1]
    bx, by = p[2, 0] - p[3, 0], p[2, 1] - p[3, 1]
    total = dx + dy + ax + ay + bx + by
    if total - total != 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2
    chord, a, b = math.hypot(dx, dy), math.hypot(ax, ay), math.hypot(bx, by)
    if chord == 0.0 or a == 0.0 or b == 0.0 or max(a / chord, b / chord) == math.inf:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1
    dx, dy, ax, ay, bx, by = dx / chord, dy / chord, ax / a, ay / a, bx / b, by / b
    return ax * dx + ay * dy, ay * dx - ax * dy, a / chord, bx * dx + by * dy, by * dx - bx * dy, b / chord, 0


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def turned(angle):
    """The angle modulo 2π, in [0, 2π)."""
    angle = angle % TURN
    return 0.0 if angle >= TURN else angle


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def end_angles(c1, s1, c2, s2):
    """(β₁, β₂) from the directions of the outer edges."""
    return turned(math.pi - math.atan2(s1, c1)), turned(math.atan2(s2, c2))


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def inner_angles(c1, s1, l1, c2, s2, l2):
    """(φ₁, φ₂) in [0, 2π): from the first edge back to the middle one at p₁, from the middle one back to the last at p₂.

    NaN where p₁ = p₂.
    """
    mx, my = 1.0 + l2 * c2 - l1 * c1, l2 * s2 - l1 * s1
    if mx == 0.0 and my == 0.0:
        return math.nan, math.nan
    # (p₂ − p₁)/(p₀ − p₁) and (p₃ − p₂)/(p₁ − p₂), up to positive factors.
    phi1 = math.atan2(s1 * mx - c1 * my, -c1 * mx - s1 * my)
    phi2 = math.atan2(s2 * mx - c2 * my, c2 * mx + s2 * my)
    return turned(phi1), turned(phi2)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def inflectional(phi1, phi2):
    """Whether π lies between the inner angles: the control polygon turns to both sides, or not at all."""
    return phi2 <= math.pi <= phi1 or phi1 <= math.pi <= phi2


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def crossing(c1, s1, c2, s2, l1, l2):
    """Distances (a, b) from p₀ and p₃ at which the rays along the outer edges meet; inf where they do not.

    The control polygon meets itself if L₁ ≥ a and L₂ ≥ b. The lengths matter only where both edges lie along the chord
    and point at each other: if they overlap, a and b divide the chord as the lengths do.
    """
    if s1 == 0.0 and s2 == 0.0:
        if c1 > 0.0 and c2 > 0.0:
            return 1.0, 0.0
        if c1 < 0.0 and c2 < 0.0:
            return 0.0, 1.0
        if c1 > 0.0 and l1 + l2 >= 1.0:
            return l1 / (l1 + l2), l2 / (l1 + l2)
        return math.inf, math.inf
    cross = c1 * s2 - s1 * c2
    a = s2 / cross if cross != 0.0 else math.inf
    b = s1 / cross if cross != 0.0 else math.inf
    if a < 0.0 or b < 0.0:
        return math.inf, math.inf
    return a, b


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def edge_limits(beta1, beta2):
    """(Lmin, Lmax) of edge-length constraint 1.

    With both outer edges on one side of the chord πΔ is the excess of π over the sum of the angles β on that side, which
    is sign(θ₂)(θ₁ − θ₂). With one on each side that expression depends on the direction of the curve, but is so far
    below 0 wherever angle constraint 1 holds, relaxed to π/6 or not, that the limits do not.
    """
    above = max(beta1, beta2) <= math.pi
    below = min(beta1, beta2) >= math.pi
    delta = -1.0
    if above:
        delta = 1.0 - (beta1 + beta2) / math.pi
    elif below:
        delta = (beta1 + beta2) / math.pi - 3.0
    return max(0.4 * (1.0 + 6.0 * delta), LEAST_EDGE), max(1.2 * (1.0 + 5.0 * delta), 0.58)


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def in_zone(phi1, phi2, margin):
    """Whether (φ₁, φ₂) lies in the projection zone, farther from its border than `margin`. False for NaN."""
    across, along = abs(TURN - phi1 - phi2), abs(phi1 - phi2)
    if not across <= ZONE_BORDER[0, 0, 0]:
        return False
    piece = 3
    while piece > 0 and across > ZONE_BORDER[piece, 0, 0]:
        piece -= 1
    low, high = 0.0, 1.0
    for _ in range(60):  # the first row falls from the corner on the one axis to 0 on the other
        t = 0.5 * (low + high)
        f = ZONE_BORDER[piece, 0]
        if ((f[3] * t + f[2]) * t + f[1]) * t + f[0] > across:
            low = t
        else:
            high = t
    g = ZONE_BORDER[piece, 1]
    return along <= ((g[3] * high + g[2]) * high + g[1]) * high + g[0] - margin


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def within_angles(beta1, beta2, least, most_difference):
    """(constraint 1, constraint 2): β₁, β₂ ∈ (least, 2π − least) and |β₁ − β₂| < most_difference."""
    low, high = min(beta1, beta2), max(beta1, beta2)
    return low > least and high < TURN - least, high - low < most_difference


@njit(cache=True, no_cfunc_wrapper=True, nogil=True)
def criteria_batch(control_points, least, most_difference, out):
    """Write the columns named above for each row of `control_points` (n, 4, 2) to `out` (n, 15).

    least, most_difference: limits of the angle constraints. Rows without a standard position have NaN for the numbers
    and 0 for the rest.
    """
    for i in range(control_points.shape[0]):
        row = out[i]
        row[:INFLECTIONAL] = math.nan
        row[INFLECTIONAL:] = 0.0
        c1, s1, l1, c2, s2, l2, flag = standard_edges(control_points[i])
        if flag > 0:
            continue
        beta1, beta2 = end_angles(c1, s1, c2, s2)
        phi1, phi2 = inner_angles(c1, s1, l1, c2, s2, l2)
        shortest, longest = edge_limits(beta1, beta2)
        row[BETA_1], row[BETA_2], row[PHI_1], row[PHI_2] = beta1, beta2, phi1, phi2
        row[LENGTH_1], row[LENGTH_2], row[LEAST], row[MOST] = l1, l2, shortest, longest
        bends_both_ways = inflectional(phi1, phi2)
        angles1, angles2 = within_angles(beta1, beta2, least, most_difference)
        a, b = crossing(c1, s1, c2, s2, l1, l2)
        low, high = min(l1, l2), max(l1, l2)
        row[INFLECTIONAL], row[ANGLES_1], row[ANGLES_2] = bends_both_ways, angles1, angles2
        row[LENGTHS_1] = low >= shortest and high <= longest
        row[LENGTHS_2] = not bends_both_ways or high <= MOST_QUOTIENT * low
        row[SIMPLE] = l1 < a or l2 < b
        row[ZONE] = in_zone(phi1, phi2, 0.0)
