"""A surface of heights z = h(x, y) over a rectangle, through points that lie anywhere in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from batten.errors import InvalidInputError
from batten.surfaces.bspline_basis import basis_functions, greville
from batten.surfaces.bspline_surface import BSplineSurface
from batten.typing import ArrayLike, BoolArray, FloatArray

_DEGREE = 3
_STIFFNESS = 0.02  # weight of the bending, as a length in spans: what is shorter than that is smoothed
_LEAST_STIFFNESS = 1e-10  # of the rectangle's side: what holds the surface where there are no points at all


@dataclass(frozen=True, eq=False)
class HeightFit:
    """A surface of heights, and how far it lies from the points that it was made for.

    Attributes:
        surface: bicubic, with u = x and v = y over the rectangle.
        error: greatest distance in height of the points from it, times their weights.
    """

    surface: BSplineSurface
    error: float


def height_surface(
    points: ArrayLike,
    low: ArrayLike,
    high: ArrayLike,
    tolerance: float,
    *,
    weights: ArrayLike = 1.0,
    spans: int = 6,
    most: int = 96,
) -> HeightFit:
    """The bicubic spline h of least Σ (wᵢ zᵢ − wᵢ h(xᵢ, yᵢ))² + μ ∫ h_xx² + 2 h_xy² + h_yy², knots laid where need be.

    Columns and rows of spans in which a point lies farther than the tolerance from the surface are halved until none does.
    μ is so small that it shows only where there are no points: there the surface goes on as a thin plate would.

    Parameters:
        points: shape (n, 3), x and y within the rectangle.
        low, high: (2,), corners of the rectangle.
        tolerance: wanted greatest distance in height, above 0; the same unit.
        weights: wᵢ, (n,) or one for all, from 0 to 1; distances count times these everywhere.
        spans: how many spans to begin with along the rectangle's longer side.
        most: how many at most along either side.

    Returns:
        The surface, and the distance reached, which is above the tolerance if `most` spans are not enough.

    Raises:
        InvalidInputError: fewer than 16 points, values that are not finite, points outside, a tolerance not above 0,
            weights outside 0 … 1.

    Accuracy: `error` is measured at the points themselves; h leaves cubics of x and y as they are but for μ, and misses a
    smooth function by a power of the spacing of the knots.

    Example:
        >>> import numpy as np
        >>> x, y = (v.ravel() for v in np.meshgrid(np.linspace(0, 4, 30), np.linspace(0, 2, 20)))
        >>> fit = height_surface(np.stack([x, y, np.sin(x) * y], axis=1), (0, 0), (4, 2), 1e-3)
        >>> bool(fit.error <= 1e-3), bool(abs(fit.surface.point(1.0, 1.5)[2] - 1.5 * np.sin(1.0)) < 1e-3)
        (True, True)
    """
    p = np.asarray(points, dtype=np.float64)
    box = np.stack([np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)])
    if p.ndim != 2 or p.shape[1] != 3 or len(p) < 16 or not np.isfinite(p).all():
        raise InvalidInputError(f"points: got shape {p.shape}; allowed are 16 or more finite points, (n, 3)")
    size = box[1] - box[0]
    slack = 1e-9 * size
    if (
        box.shape != (2, 2)
        or not (size > 0.0).all()
        or (np.abs(p[:, :2] - box.mean(axis=0)) > 0.5 * size + slack).any()
    ):
        raise InvalidInputError(
            f"low = {box[0].tolist()}, high = {box[1].tolist()}: points reach from {p[:, :2].min(axis=0).tolist()} to "
            f"{p[:, :2].max(axis=0).tolist()}; allowed is a rectangle that holds them all"
        )
    if not tolerance > 0.0:
        raise InvalidInputError(f"tolerance = {tolerance}; allowed are numbers above 0")
    w = np.broadcast_to(np.asarray(weights, dtype=np.float64), len(p))
    if not ((w >= 0.0) & (w <= 1.0)).all():
        raise InvalidInputError(f"weights: reach from {w.min()} to {w.max()}; allowed are numbers from 0 to 1")
    at = np.clip(p[:, :2], box[0], box[1])
    counts = np.maximum(np.ceil(spans * size / size.max()).astype(int), 2)
    borders = [np.linspace(box[0, k], box[1, k], int(counts[k]) + 1) for k in (0, 1)]
    while True:
        surface = _fitted(at, p[:, 2], w, borders)
        miss = np.abs(surface.point(at[:, 0], at[:, 1])[:, 2] - p[:, 2]) * w
        error = float(miss.max())
        halved = [_halved(borders[k], at[:, k], miss > tolerance, most) for k in (0, 1)]
        if error <= tolerance or all(len(h) == len(b) for h, b in zip(halved, borders)):
            return HeightFit(surface, error)
        borders = halved


def _halved(borders: FloatArray, at: FloatArray, poor: BoolArray, most: int) -> FloatArray:
    """Borders with a middle in every span that holds a poor point, as many as may be, those with most such points first."""
    span = np.clip(np.searchsorted(borders, at[poor], side="right") - 1, 0, len(borders) - 2)
    count = np.bincount(span, minlength=len(borders) - 1)
    room = most - (len(borders) - 1)
    chosen = [i for i in np.argsort(-count, kind="stable")[: max(room, 0)] if count[i] > 0]
    return np.sort(np.append(borders, 0.5 * (borders[chosen] + borders[np.array(chosen, dtype=int) + 1])))


def _fitted(at: FloatArray, heights: FloatArray, weights: FloatArray, borders: list[FloatArray]) -> BSplineSurface:
    """The spline of least misfit and bending over these borders of spans."""
    from scipy.sparse import csc_array, kron
    from scipy.sparse.linalg import splu

    knots = [np.concatenate([[b[0]] * _DEGREE, b, [b[-1]] * _DEGREE]) for b in borders]
    shape = tuple(len(t) - _DEGREE - 1 for t in knots)
    first_x, along_x = basis_functions(knots[0], _DEGREE, at[:, 0], 0)
    first_y, along_y = basis_functions(knots[1], _DEGREE, at[:, 1], 0)
    steps = np.arange(_DEGREE + 1)
    column = ((first_x[:, None, None] + steps[:, None]) * shape[1] + first_y[:, None, None] + steps).reshape(-1)
    value = (weights[:, None, None] * along_x[0].T[:, :, None] * along_y[0].T[:, None, :]).reshape(-1)
    row = np.repeat(np.arange(len(at)), (_DEGREE + 1) ** 2)
    system = csc_array((value, (row, column)), shape=(len(at), shape[0] * shape[1]))
    gx, gy = (_gram(t, b) for t, b in zip(knots, borders))
    bending = kron(gx[2], gy[0]) + 2.0 * kron(gx[1], gy[1]) + kron(gx[0], gy[2])
    area = float(np.prod([b[-1] - b[0] for b in borders]))
    finest = max(float(np.diff(b).min()) for b in borders)
    stiffness = (_STIFFNESS * finest) ** 4 + (_LEAST_STIFFNESS * area**0.5) ** 4
    normal: Any = csc_array(system.T @ system * (area / len(at)) + stiffness * bending)
    right = system.T @ (weights * heights) * (area / len(at))
    solve = splu(normal, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}).solve
    height = solve(right)
    height += solve(right - normal @ height)  # where there are no points, digits were lost
    x, y = (greville(t, _DEGREE) for t in knots)
    net = np.stack([*np.meshgrid(x, y, indexing="ij"), height.reshape(shape)], axis=-1)
    return BSplineSurface(knots[0], knots[1], _DEGREE, _DEGREE, net)


def _gram(knots: FloatArray, borders: FloatArray) -> list[Any]:
    """∫ N_i⁽ᵏ⁾ N_j⁽ᵏ⁾ dt for k = 0, 1, 2 as sparse matrices; four Gauss nodes to a span are exact for cubics."""
    from scipy.sparse import csc_array

    nodes, weights = np.polynomial.legendre.leggauss(4)
    width = np.diff(borders)
    t = (0.5 * (borders[:-1] + borders[1:])[:, None] + 0.5 * width[:, None] * nodes).reshape(-1)
    w = (0.5 * width[:, None] * weights).reshape(-1)
    first, values = basis_functions(knots, _DEGREE, t, 2)
    row = np.repeat(np.arange(len(t)), _DEGREE + 1)
    column = (first[:, None] + np.arange(_DEGREE + 1)).reshape(-1)
    shape = (len(t), len(knots) - _DEGREE - 1)
    grams = []
    for order in range(3):
        part = csc_array((values[order].T.reshape(-1), (row, column)), shape=shape)
        grams.append(part.T @ (part * w[:, None]))
    return grams
