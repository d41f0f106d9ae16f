"""The cubic spline nearest to another one that has its joints elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from batten.errors import InvalidInputError
from batten.typing import BoolArray, FloatArray, IntArray

#: Samples on each piece, and how often the points may slide along the curve.
_SAMPLES, _SLIDES = 12, 30


def nearest_spline(
    target: FloatArray,
    places: FloatArray,
    matrix: FloatArray,
    *,
    slide: bool,
    held: IntArray | None = None,
    lines: Sequence[tuple[int, float, float, float]] | None = None,
) -> FloatArray:
    """Control points of the spline nearest to the cubics `target` in least squares, its end points being theirs.

    Parameters:
        target: (k, 4, 2), Bézier points of what is to be met; its parameter runs from 0 to k.
        places: (n + 1,), ascending from 0 to k: the parameter of the target at each knot of the spline. Between them the
            parameters correspond by a monotone cubic with continuous slope (Fritsch & Butland), which is the identity
            where the knots are those of the target.
        matrix: (n, 4, m), from control points to Bézier points.
        slide: whether the parameter of the target at each sample is improved afterwards (Hoschek's correction).
        held: control points that take the values at which a spline with the target's own knots there has them.
        lines: (joint, nx, ny, c): joints that have to meet nx·x + ny·y = c exactly.

    Raises:
        InvalidInputError: lines that cannot be met.
    """
    from scipy.interpolate import PchipInterpolator  # takes a while to load

    n, m = len(places) - 1, matrix.shape[2]
    t, w = np.polynomial.legendre.leggauss(_SAMPLES)
    t, w = 0.5 * (t + 1.0), np.tile(np.sqrt(0.5 * w), n)
    rows = (_bernstein(t) @ matrix).reshape(-1, m)
    knots = np.arange(n + 1.0)
    inside = (knots[:-1, None] + t).reshape(-1)
    along = np.interp(inside, knots, places)
    if n > 1 and np.ptp(np.diff(places)) > 0.0:
        along = np.asarray(PchipInterpolator(knots, places)(inside))
    ends = np.array([target[0, 0], target[-1, 3]])
    constraint = _constraint(matrix, ends, lines or ())
    free = np.ones(m, bool)
    start = _solve(rows * w[:, None], _value(target, along) * w[:, None], constraint, free, np.zeros((m, 2)))
    if held is not None and len(held):
        start[held] = _held_values(target, places, matrix, held)
        free[held] = False
        start = _solve(rows * w[:, None], _value(target, along) * w[:, None], constraint, free, start)
    best, least = start, _misfit(rows, start, target, along, w)
    size = float(np.abs(target - target[:1, :1]).max())
    for _ in range(_SLIDES if slide else 0):
        if least <= (1e-13 * size) ** 2:
            break
        speed = _slope(target, along)
        step = np.einsum("ij,ij->i", rows @ best - _value(target, along), speed)
        moved = along + step / np.maximum(np.einsum("ij,ij->i", speed, speed), 1e-300)
        moved = np.maximum.accumulate(np.clip(moved, 0.0, float(len(target))))
        found = _solve(rows * w[:, None], _value(target, moved) * w[:, None], constraint, free, start)
        misfit = _misfit(rows, found, target, moved, w)
        if not misfit < least:
            break
        small = misfit > 0.999 * least
        best, least, along = found, misfit, moved
        if small:
            break
    return best


def split_places(heights: FloatArray) -> list[float]:
    """Where in (0, 1) the cubic polynomial with these four Bernstein coefficients is 0, ascending."""
    b = heights / max(float(np.abs(heights).max()), 1e-300)
    power = [b[3] - 3.0 * b[2] + 3.0 * b[1] - b[0], 3.0 * (b[2] - 2.0 * b[1] + b[0]), 3.0 * (b[1] - b[0]), b[0]]
    roots = np.roots(power)
    real = roots.real[np.abs(roots.imag) < 1e-7]
    return sorted(float(r) for r in real if 1e-9 < r < 1.0 - 1e-9)


def _bernstein(t: FloatArray) -> FloatArray:
    u = 1.0 - t
    return np.stack([u**3, 3.0 * t * u**2, 3.0 * t**2 * u, t**3], axis=-1)


def _local(target: FloatArray, along: FloatArray) -> tuple[FloatArray, FloatArray]:
    piece = np.clip(np.floor(along), 0, len(target) - 1).astype(int)
    return along - piece, target[piece]


def _value(target: FloatArray, along: FloatArray) -> FloatArray:
    t, points = _local(target, along)
    return np.einsum("ij,ijk->ik", _bernstein(t), points)


def _slope(target: FloatArray, along: FloatArray) -> FloatArray:
    t, points = _local(target, along)
    u = 1.0 - t
    return np.einsum("ij,ijk->ik", 3.0 * np.stack([u * u, 2.0 * t * u, t * t], axis=-1), np.diff(points, axis=1))


def _misfit(rows: FloatArray, points: FloatArray, target: FloatArray, along: FloatArray, w: FloatArray) -> float:
    return float(np.sum(((rows @ points - _value(target, along)) * w[:, None]) ** 2))


def _held_values(target: FloatArray, places: FloatArray, matrix: FloatArray, held: IntArray) -> FloatArray:
    """Bézier points of the target at the places of control points that are inner Bézier points of unchanged pieces."""
    values = np.empty((len(held), 2))
    for row, j in enumerate(held.tolist()):
        for i, k in np.argwhere(matrix[:, :, j] == 1.0).tolist():
            if places[i + 1] - places[i] == 1.0:
                values[row] = target[round(places[i]), k]
    return values


def _constraint(
    matrix: FloatArray, ends: FloatArray, lines: Sequence[tuple[int, float, float, float]]
) -> tuple[FloatArray, FloatArray]:
    """Rows (r, m, 2) and right sides (r,): both ends, moved to their borders if they have one, and the joints' lines."""
    weights = np.concatenate([matrix[:, 0], matrix[-1:, 3]])
    last = len(weights) - 1
    rows, sides = [], []
    fixed = ends.copy()
    for joint, nx, ny, c in lines:
        if joint in (0, last):
            e = fixed[min(joint, 1)]
            e -= (nx * e[0] + ny * e[1] - c) * np.array([nx, ny])
        else:
            rows.append(weights[joint][:, None] * np.array([nx, ny]))
            sides.append(c)
    for joint, end in ((0, fixed[0]), (last, fixed[1])):
        for axis in range(2):
            rows.append(weights[joint][:, None] * np.eye(2)[axis])
            sides.append(end[axis])
    return np.array(rows), np.array(sides)


def _solve(
    rows: FloatArray, values: FloatArray, constraint: tuple[FloatArray, FloatArray], free: BoolArray, start: FloatArray
) -> FloatArray:
    """Least squares of rows · x = values for the free points, about `start` for the others, with the constraint met."""
    conditions, sides = constraint
    middle = values.sum(axis=0) / rows.sum()  # every row of weights adds up to the weight: shifts commute
    known = np.where(free[:, None], 0.0, start - middle)
    count = int(free.sum())
    a = conditions[:, free].reshape(len(sides), -1)
    b = sides - np.einsum("rmk,k->r", conditions, middle) - np.einsum("rmk,mk->r", conditions, known)
    shifted = values - rows.sum(axis=1)[:, None] * middle - rows @ known
    # A particular solution and the directions that keep the constraint, from one decomposition.
    left, singular, right = np.linalg.svd(a)
    rank = int((singular > 1e-10 * max(float(singular[0]), 1e-300)).sum()) if len(singular) else 0
    particular = right[:rank].T @ ((left[:, :rank].T @ b) / singular[:rank])
    scale = float(np.abs(values / np.maximum(rows.sum(axis=1), 1e-300)[:, None] - middle).max())
    if np.abs(a @ particular - b).max() > 1e-8 * scale:
        raise InvalidInputError("no spline of this kind has its joints on all of these borders; take some of them off")
    null = right[rank:].T
    system = np.einsum("im,mkf->ikf", rows[:, free], null.reshape(count, 2, -1)).reshape(2 * len(rows), -1)
    offset = rows[:, free] @ particular.reshape(count, 2)
    best, *_ = np.linalg.lstsq(system, (shifted - offset).reshape(-1), rcond=None)
    out = known.copy()
    out[free] = (particular + null @ best).reshape(count, 2)
    out += middle
    out[~free] = start[~free]
    return out
