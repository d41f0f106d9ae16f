"""The library of elastica that `kernels.shape_library` looks curves up in."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipk

from batten.curves.elastica import states_along
from batten.kernels.shape_library import HANDLE
from batten.typing import FloatArray, IntArray

UNIFORM = 24  # points along each shape
_INFLECTIONAL = (0.2, 0.4, 0.55, 0.68, 0.78, 0.85, 0.9, 0.94, 0.97, 0.985, 0.995, 0.9995, 0.99999)
_WITHOUT = (1.002, 1.01, 1.03, 1.07, 1.15, 1.3, 1.6, 2.5, 6.0)
_SPANS = (0.25, 0.45, 0.65, 0.85, 1.05, 1.3, 1.6, 2.0, 2.5, 3.1, 3.8, 4.5)  # in half periods
_PHASES = 12  # a period


class ShapeLibrary(NamedTuple):
    """N elastica of length 1 whose middle lies at 0 with angle 0; P = 28 points each (see the kernel).

    shapes: (N, P) complex. norms, centres: (N,). weights: (P,). classes: (N,), how many inflections, which way it starts.
    turnings, means: (N,), difference and mean of the angles at the ends. unknowns: (N, 3), κ and force at the middle.
    """

    shapes: NDArray[np.complex128]
    norms: FloatArray
    centres: NDArray[np.complex128]
    weights: FloatArray
    classes: IntArray
    turnings: FloatArray
    means: FloatArray
    unknowns: FloatArray


@cache
def _states() -> tuple[FloatArray, FloatArray]:
    """Parameters (N, 7) about the middle, and states (N, 24 + 2, 4) at the uniform fractions and both ends."""
    rows = []
    for k in (*_INFLECTIONAL, *_WITHOUT):
        half = 2.0 * ellipk(k * k) if k < 1.0 else ellipk(1.0 / k**2) / k
        count = _PHASES if half < 8.0 else 2 * _PHASES  # next to k = 1 the bends are short
        phases = np.arange(count) / count * 2.0 * half
        basic = states_along([0.0, 0.0, 0.0, 2.0 * k, 1.0, 0.0, 1.0], phases)
        for span in _SPANS:
            ell = span * half
            for angle, kappa in basic[:, 2:]:
                force = ell**2 * np.array([np.cos(angle), -np.sin(angle)])
                rows.append([0.0, 0.0, 0.0, kappa * ell, *force, 1.0])
                if k > 1.0:  # the same, turning right
                    rows.append([0.0, 0.0, 0.0, -kappa * ell, force[0], -force[1], 1.0])
    parameters = np.array(rows)
    fractions = np.concatenate([(np.arange(UNIFORM) + 0.5) / UNIFORM, [0.0, 1.0]]) - 0.5
    return parameters, states_along(parameters, np.broadcast_to(fractions, (len(rows), fractions.size)))


@cache
def shape_library(conditions: int) -> ShapeLibrary:
    """The library with the weights for so many end conditions: 0, 4 (end points) or 6 (and tangents)."""
    parameters, states = _states()
    points = states[..., 0] + 1j * states[..., 1]
    tangents = np.exp(1j * states[:, -2:, 2]) * [HANDLE, -HANDLE]
    points = np.concatenate([points, points[:, -2:] + tangents], axis=1)
    weights = np.full(UNIFORM + 4, 1.0 / UNIFORM)
    weights[UNIFORM : UNIFORM + 2] = 0.5 if conditions else 0.0
    weights[UNIFORM + 2 :] = 0.5 if conditions == 6 else 0.0
    centres = points @ weights / weights.sum()
    points = points - centres[:, None]
    norms = np.sqrt(np.abs(points) ** 2 @ weights)
    curvature = np.concatenate([states[:, -2:-1, 3], states[:, :UNIFORM, 3], states[:, -1:, 3]], axis=1)
    inflections = (curvature[:, 1:] * curvature[:, :-1] < 0.0).sum(axis=1)
    classes = 2 * inflections + (curvature[:, 0] < 0.0)
    return ShapeLibrary(
        np.ascontiguousarray(points * weights / norms[:, None]),
        norms,
        centres,
        weights,
        classes.astype(np.int64),
        states[:, -1, 2] - states[:, -2, 2],
        0.5 * (states[:, -1, 2] + states[:, -2, 2]),
        np.ascontiguousarray(parameters[:, 3:6]),
    )


def no_shapes() -> ShapeLibrary:
    """An empty library, for fits from one start alone, which do not look into it."""
    n, none = np.empty(0), np.empty(0, dtype=np.complex128)
    return ShapeLibrary(
        np.empty((0, UNIFORM + 4), dtype=np.complex128), n, none, n, n.astype(np.int64), n, n, np.empty((0, 3))
    )
