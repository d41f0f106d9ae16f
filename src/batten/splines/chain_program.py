"""The step of a chain that makes its greatest offset least, to first order: a linear program."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import bmat, coo_matrix, csr_matrix

from batten.typing import BoolArray, FloatArray

_ROUNDS = 8
_SLACK = 1e-3
#: Offsets that are in the program from the first: peaks along a piece, and all above this share of the greatest.
_NEAR = 0.95


def least_offset(
    response: FloatArray, offsets: FloatArray, equations: csr_matrix, gaps: FloatArray,
    jumps: csr_matrix, torn: FloatArray, weight: float, reach: float,
) -> tuple[FloatArray | None, float]:  # fmt: skip
    """The step x within `reach` that meets equations and makes the greatest offset least, with the greatest jump if any.

    That is max |offsets + response x| + weight × max |torn + jumps x|. Few of the offsets decide: the program begins with
    the peaks along each piece, and takes in what turns out to exceed them by more than 0.001.

    Parameters:
        response: (n, m, 7), derivatives of the offsets (n, m) of n pieces by their own seven unknowns.
        equations: (r, 7 n). gaps: (r,); `gaps` + `equations` x must vanish.
        jumps: (j, 7 n), torn: (j,), j ≥ 0. weight, reach: positive.

    Returns:
        The step (n, 7), None if there is none, and the value.
    """
    n = len(offsets)
    spare = 2 if len(torn) else 1
    cost = np.concatenate([np.zeros(7 * n), [1.0, weight][:spare]])
    bounds = np.concatenate([np.tile([-reach, reach], (7 * n, 1)), np.tile([0.0, np.inf], (spare, 1))])
    fixed = bmat([[equations, csr_matrix((len(gaps), spare))]], format="csr")
    tears, tear_limits = csr_matrix((0, 7 * n + spare)), np.empty(0)
    if len(torn):
        one = coo_matrix(np.ones((len(torn), 1)))
        tears = bmat([[jumps, None, -one], [-jumps, coo_matrix(one.shape), -one]], format="csr")
        tear_limits = np.concatenate([-torn, torn])
    signs = np.array([1.0, -1.0])[:, None, None]
    both = signs * offsets  # (2, n, m)
    used = _peaks(both) | (both >= _NEAR * np.abs(offsets).max())
    for _ in range(_ROUNDS):
        side, piece, station = np.nonzero(used)
        slopes = signs[side, 0] * response[piece, station]
        data = np.concatenate([slopes, np.full((len(side), 1), -1.0)], axis=1)
        columns = np.concatenate([7 * piece[:, None] + np.arange(7), np.full((len(side), 1), 7 * n)], axis=1)
        edges = np.arange(0, 8 * len(side) + 1, 8)
        rows = csr_matrix((data.ravel(), columns.ravel(), edges), (len(side), 7 * n + spare))
        found = linprog(
            cost,
            A_ub=bmat([[rows], [tears]], format="csr"),
            b_ub=np.concatenate([-both[used], tear_limits]),
            A_eq=fixed,
            b_eq=-gaps,
            bounds=bounds,
            method="highs",
        )
        if found.x is None:
            return None, np.inf
        step = found.x[: 7 * n].reshape(n, 7)
        after = signs * (offsets + np.einsum("nmi,ni->nm", response, step))
        greatest = float(np.abs(after).max())
        if greatest <= found.x[7 * n] + _SLACK:
            break
        used |= (_peaks(after) | (after >= greatest - _SLACK)) & (after > found.x[7 * n] + 0.1 * _SLACK)
    return step, greatest + weight * float(found.x[7 * n + 1]) if len(torn) else greatest


def _peaks(values: FloatArray) -> BoolArray:
    """Where values (…, m) are not below their neighbours."""
    out = np.ones(values.shape, bool)
    out[..., 1:] &= values[..., 1:] >= values[..., :-1]
    out[..., :-1] &= values[..., :-1] >= values[..., 1:]
    return out
