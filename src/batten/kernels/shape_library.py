"""Which of many known elastica look most like a given curve: starts for the fit that need no derivative of the curve.

Shape i of the library is a row of `shapes` (N, P) of complex numbers: points at P_0 uniform fractions of its length, its two
ends, and a handle along the tangent at each end, centred and scaled to norm 1 with the weights, and multiplied by them, so
that the least squares similarity onto points z has the value ⟨shape, z⟩ and leaves |z|² − |⟨shape, z⟩|².
"""

import math

import numpy as np
from numba import njit

HANDLE = 0.15  # length of the handles, in lengths of the curve


@njit(cache=True, no_cfunc_wrapper=True)
def resample(points, fractions, ends, uniform, out):
    """Points of a curve of length 1 at uniform fractions (linear between its samples), its ends, its handles; complex."""
    n = fractions.shape[0]
    j = 0
    for i in range(uniform):
        at = (i + 0.5) / uniform
        while j < n - 2 and fractions[j + 1] < at:
            j += 1
        t = (at - fractions[j]) / (fractions[j + 1] - fractions[j])
        out[i] = complex(
            points[j, 0] + t * (points[j + 1, 0] - points[j, 0]), points[j, 1] + t * (points[j + 1, 1] - points[j, 1])
        )
    for e in range(2):
        tip = complex(ends[e, 0], ends[e, 1])
        way = HANDLE if e == 0 else -HANDLE
        out[uniform + e] = tip
        out[uniform + 2 + e] = tip + way * complex(math.cos(ends[e, 2]), math.sin(ends[e, 2]))


@njit(cache=True, no_cfunc_wrapper=True)
def best_shapes(curve, shapes, classes, turnings, turning, most_off, chosen):
    """Numbers of the best shapes, each the best of its class, best first, into `chosen`; −1 where there is none.

    Shapes whose turning is further than `most_off` from that of the curve do not count.
    """
    top = 0
    for c in classes:
        top = max(top, c + 1)
    score, number = np.zeros(top), np.full(top, -1)
    for i in range(shapes.shape[0]):
        if abs(turnings[i] - turning) > most_off:
            continue
        re, im = 0.0, 0.0
        for k in range(curve.shape[0]):
            a, b = shapes[i, k], curve[k]
            re += a.real * b.real + a.imag * b.imag
            im += a.real * b.imag - a.imag * b.real
        value = re * re + im * im
        if value > score[classes[i]]:
            score[classes[i]], number[classes[i]] = value, i
    for j in range(chosen.shape[0]):
        best = np.argmax(score)
        chosen[j] = number[best] if score[best] > 0.0 else -1
        score[best] = -1.0


@njit(cache=True, no_cfunc_wrapper=True)
def place(curve, weights, shape, norm, centre, middle_angle, mid):
    """Put a shape onto the curve by its best similarity: x, y, θ and length of its middle into `mid` (7,)."""
    total, mean = 0.0, 0.0j
    value = 0.0j
    for k in range(curve.shape[0]):
        total += weights[k]
        mean += weights[k] * curve[k]
        value += shape[k].conjugate() * curve[k]
    b = value / norm
    a = mean / total - b * centre
    mid[0], mid[1], mid[6] = a.real, a.imag, abs(b)
    angle = math.atan2(b.imag, b.real)
    mid[2] = angle + 2.0 * math.pi * math.floor((middle_angle - angle) / (2.0 * math.pi) + 0.5)
