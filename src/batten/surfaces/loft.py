"""A surface through planar design splines in parallel planes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from batten.curves.bspline import BSplineCurve
from batten.errors import InvalidInputError
from batten.surfaces.bspline_basis import rewrite
from batten.surfaces.bspline_surface import BSplineSurface
from batten.typing import ArrayLike, FloatArray

_SAME_KNOT = 1e-10  # of the curves' common parameter range [0, 1]


def loft(
    curves: Sequence[BSplineCurve], positions: ArrayLike, *, blade_axis: Literal["x", "y"] = "x"
) -> BSplineSurface:
    """The cubic interpolation of planar splines across their planes, with the not-a-knot condition (Fisker2018 §5.4.2).

    The curves are first written over common knots and a common degree, which changes none of them; then each row of
    control points is interpolated across the planes. Two curves give a ruled surface, three a parabola across.

    Parameters:
        curves: n ≥ 2 splines in the coordinates (along the blade, up) of their planes. Points of equal parameter are
            joined, so the curves should run the same way.
        positions: shape (n,), coordinate of the planes across the blade, strictly ascending.
        blade_axis: wall axis along the curves: "x" puts curve i into the plane y = positions[i], "y" into x = positions[i].

    Returns:
        S(u, v) with u ∈ [0, 1] the curves' parameter and v the coordinate across itself: S(u, positions[i]) is curve i.

    Raises:
        InvalidInputError: fewer than two curves, positions that do not belong to them or do not ascend.

    Accuracy: the surface holds each curve to about 1e-13 of its size.

    Example:
        >>> import numpy as np
        >>> line = BSplineCurve.interpolate([[0, 0], [1, 0], [2, 0], [3, 0]], np.linspace(0, 1, 4))
        >>> arch = BSplineCurve.interpolate([[0, 0], [1, 2], [2, 2], [3, 0]], np.linspace(0, 1, 4))
        >>> (loft([line, arch], [0.0, 10.0]).point(1 / 3, [0.0, 5.0, 10.0]).round(12) + 0.0).tolist()
        [[1.0, 0.0, 0.0], [1.0, 5.0, 1.0], [1.0, 10.0, 2.0]]
    """
    from scipy.interpolate import make_interp_spline  # takes a while to load

    across = np.asarray(positions, dtype=np.float64)
    if len(curves) < 2 or across.shape != (len(curves),):
        raise InvalidInputError(
            f"{len(curves)} curves, positions of shape {across.shape}; a loft needs 2 curves or more, a position for each"
        )
    if not np.isfinite(across).all() or (np.diff(across) <= 0.0).any():
        raise InvalidInputError(
            f"positions: got {across.tolist()}; they must be finite and strictly ascending: sort the curves by plane"
        )
    if blade_axis not in ("x", "y"):
        raise InvalidInputError(f"blade_axis = {blade_axis!r}; allowed are 'x' and 'y'")
    knots, degree, rows = compatible(curves)
    order = [0, 2] if blade_axis == "x" else [1, 2]
    net = np.empty((len(curves), rows.shape[1], 3))
    net[..., order] = rows
    net[..., 1 if blade_axis == "x" else 0] = across[:, None]
    spline = make_interp_spline(across, net, k=min(3, len(curves) - 1))
    return BSplineSurface(knots, spline.t, degree, int(spline.k), np.moveaxis(spline.c, 0, 1))


def compatible(curves: Sequence[BSplineCurve]) -> tuple[FloatArray, int, FloatArray]:
    """The same curves over common knots on [0, 1] and a common degree.

    Parameters:
        curves: one or more.

    Returns:
        The knots, the degree, and the control points of all curves, shape (n, m, 2).

    Accuracy: knots closer together than 1e-10 count as one; apart from that exact, to rounding.
    """
    degree = max(c.degree for c in curves)
    scaled: list[FloatArray] = []
    for c in curves:
        low, high = c.knots[c.degree], c.knots[-c.degree - 1]
        scaled.append((c.knots - low) / (high - low))
    inner = np.sort(np.concatenate([t[(t > _SAME_KNOT) & (t < 1.0 - _SAME_KNOT)] for t in scaled]))
    distinct = inner[np.diff(inner, prepend=-1.0) > _SAME_KNOT]
    times = np.zeros(len(distinct), dtype=np.int64)
    for c, t in zip(curves, scaled):
        here = (np.abs(t[:, None] - distinct) <= _SAME_KNOT).sum(axis=0)
        times = np.maximum(times, np.where(here > 0, here + degree - c.degree, 0))
    ends = np.ones(degree + 1)
    knots = np.concatenate([0.0 * ends, np.repeat(distinct, times), ends])
    rows = [rewrite(t, c.degree, c.control_points, knots, degree) for c, t in zip(curves, scaled)]
    return knots, degree, np.stack(rows)
