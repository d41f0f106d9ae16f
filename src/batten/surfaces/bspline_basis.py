"""B-spline basis functions at many parameters at once, and the same spline written over finer knots.

Knot vectors are complete: n + p + 1 knots for n coefficients of degree p, so the domain is [t_p, t_n]. Points come last
in every array of this module, so that each step of the recursion is one long vector operation.
"""

from __future__ import annotations

from math import comb, factorial

import numpy as np

from batten.errors import InvalidInputError
from batten.typing import ArrayLike, FloatArray, IntArray


def check_knots(knots: ArrayLike, degree: int, count: int, name: str = "knots") -> FloatArray:
    """A knot vector as a read-only array, if it is one of `count` coefficients of that degree.

    Parameters:
        knots: shape (count + degree + 1,), ascending, end knots up to degree + 1 times, inner knots up to degree times.
        degree: 1 or more.
        count: number of coefficients, at least degree + 1.
        name: how the message calls it.

    Raises:
        InvalidInputError: anything else.
    """
    t = np.array(knots, dtype=np.float64)
    if degree < 1 or count < degree + 1:
        raise InvalidInputError(f"{name}: degree {degree} with {count} control points; allowed is 1 ≤ degree < count")
    if t.shape != (count + degree + 1,):
        raise InvalidInputError(
            f"{name}: got shape {t.shape}; {count} control points of degree {degree} need {count + degree + 1} knots "
            "(Rhino leaves out the first and the last: repeat both)"
        )
    if not np.isfinite(t).all() or (np.diff(t) < 0.0).any():
        raise InvalidInputError(f"{name}: knots must be finite and ascending; got {t.tolist()}")
    if (t[degree + 1 : count] - t[1 : count - degree] <= 0.0).any() or not t[degree] < t[count]:
        raise InvalidInputError(
            f"{name}: an inner knot is repeated more than degree = {degree} times: the surface has a gap"
        )
    t.setflags(write=False)
    return t


def find_spans(knots: FloatArray, degree: int, t: FloatArray) -> IntArray:
    """Index i of the knot interval [t_i, t_{i+1}) that holds each parameter; the end intervals reach out for ever."""
    inner = knots[degree : len(knots) - degree]
    spans = degree - 1 + np.searchsorted(inner, t, side="right")
    last = int(np.searchsorted(knots, inner[-1], side="left")) - 1
    return np.clip(spans, degree, last).astype(np.int64)


def basis_functions(knots: FloatArray, degree: int, t: FloatArray, order: int) -> tuple[IntArray, FloatArray]:
    """The degree + 1 basis functions that do not vanish at each parameter, with derivatives up to `order`.

    Cox–de Boor recursion. Outside the domain the polynomials of the end intervals are continued.

    Parameters:
        knots: shape (n + degree + 1,), as `check_knots` returns it.
        degree: 1 or more.
        t: shape (N,), in the unit of the knots.
        order: 0, 1, 2, …; beyond the degree the derivatives are zero.

    Returns:
        Index of the first of these functions for each parameter, shape (N,), and their values, shape
        (order + 1, degree + 1, N).

    Accuracy: a few units in the last place inside the domain.

    Example:
        >>> first, values = basis_functions(np.array([0.0, 0, 1, 1]), 1, np.array([0.25]), 1)
        >>> first.tolist(), values[:, :, 0].tolist()
        ([0], [[0.75, 0.25], [-1.0, 1.0]])
    """
    spans = find_spans(knots, degree, t)
    values = np.zeros((order + 1, degree + 1, len(t)))
    lower: FloatArray = np.ones((1, len(t)))  # the basis functions of degree d
    for d in range(degree + 1):
        if d > 0:
            lower = _raise_degree(knots, spans, t, lower, d)
        k = degree - d
        if k <= order:
            top = lower
            for e in range(d + 1, degree + 1):
                top = _differentiate(knots, spans, top, e)
            values[k] = top
    return spans - degree, values


def _raise_degree(knots: FloatArray, spans: IntArray, t: FloatArray, lower: FloatArray, degree: int) -> FloatArray:
    """From the basis functions of degree − 1 to those of `degree`."""
    values = np.zeros((degree + 1, len(t)))
    for r in range(degree):
        right = knots[spans + r + 1]
        left = knots[spans + r + 1 - degree]
        share = lower[r] / (right - left)
        values[r] += (right - t) * share
        values[r + 1] = (t - left) * share
    return values


def _differentiate(knots: FloatArray, spans: IntArray, lower: FloatArray, degree: int) -> FloatArray:
    """Derivatives of the basis functions of `degree` from (derivatives of) those of degree − 1."""
    values = np.zeros((degree + 1, lower.shape[1]))
    for r in range(degree):
        share = degree * lower[r] / (knots[spans + r + 1] - knots[spans + r + 1 - degree])
        values[r] -= share
        values[r + 1] = share
    return values


def span_polynomials(knots: FloatArray, degree: int) -> tuple[FloatArray, IntArray, FloatArray]:
    """The basis functions as polynomials on each span that is not empty, about the span's middle.

    Parameters:
        knots: shape (n + degree + 1,), as `check_knots` returns it.
        degree: 1 or more.

    Returns:
        The borders of the S spans, shape (S + 1,); the index of the first function that does not vanish on each, (S,);
        and c of shape (S, degree + 1, degree + 1): function number a there is Σ_k c[:, k, a] (t − middle)^k.

    Example:
        >>> borders, first, c = span_polynomials(np.array([0.0, 0, 2, 2]), 1)
        >>> borders.tolist(), first.tolist(), c.tolist()
        ([0.0, 2.0], [0], [[[0.5, 0.5], [-0.5, 0.5]]])
    """
    borders = np.unique(knots[degree : len(knots) - degree])
    first, values = basis_functions(knots, degree, 0.5 * (borders[:-1] + borders[1:]), degree)
    factorials = np.cumprod(np.maximum(np.arange(degree + 1.0), 1.0))
    return borders, first, np.asarray(np.moveaxis(values, 2, 0) / factorials[:, None])


def powers(t: FloatArray, degree: int, order: int) -> FloatArray:
    """Derivatives of order 0 … `order` of 1, t, …, t^degree at t of shape (N,): shape (N, order + 1, degree + 1).

    Example:
        >>> powers(np.array([3.0]), 2, 1).tolist()
        [[[1.0, 3.0, 9.0], [0.0, 1.0, 6.0]]]
    """
    rows = np.zeros((len(t), order + 1, degree + 1))
    rows[:, 0, 0] = 1.0
    for j in range(1, degree + 1):
        rows[:, 0, j] = rows[:, 0, j - 1] * t
    for k in range(1, order + 1):
        rows[:, k, 1:] = rows[:, k - 1, :-1] * np.arange(1.0, degree + 1)
    return rows


def bezier_rows(borders: FloatArray, degree: int, pieces: int) -> FloatArray:
    """From polynomials about the middles of spans to Bézier control points of equal pieces of each span.

    Parameters:
        borders: of S spans, shape (S + 1,), as `span_polynomials` returns it.
        degree: 1 or more.
        pieces: of each span, 1 or more.

    Returns:
        Shape (S, pieces · (degree + 1), degree + 1): matrices that take coefficients of powers to control points.

    Example:
        >>> bezier_rows(np.array([0.0, 2.0]), 1, 2).tolist()  # of a + b (t − 1): where t = 0, 1 and 1, 2
        [[[1.0, -1.0], [1.0, 0.0], [1.0, 0.0], [1.0, 1.0]]]
    """
    width = np.diff(borders)
    starts = width[:, None] * (np.arange(pieces) / pieces - 0.5)
    orders = range(degree + 1)
    derivatives = powers(starts.ravel(), degree, degree).reshape(len(width), pieces, degree + 1, degree + 1)
    taylor = derivatives * ((width[:, None] / pieces) ** orders / [factorial(i) for i in orders])[:, None, :, None]
    bernstein = np.array([[comb(j, i) / comb(degree, i) for i in orders] for j in orders])
    return (bernstein @ taylor).reshape(len(width), -1, degree + 1)


def greville(knots: FloatArray, degree: int) -> FloatArray:
    """The Greville abscissae: means of `degree` successive knots, one for each coefficient."""
    return np.lib.stride_tricks.sliding_window_view(knots[1:-1], degree).mean(axis=-1)


def rewrite(
    knots: FloatArray, degree: int, coefficients: FloatArray, new_knots: FloatArray, new_degree: int
) -> FloatArray:
    """Coefficients of the same spline over knots and a degree whose splines include it.

    Parameters:
        knots: shape (n + degree + 1,), clamped or not.
        degree: of the spline.
        coefficients: shape (n, …).
        new_knots: clamped; every inner knot of `knots` as often plus new_degree − degree times, or more, and others.
        new_degree: not less than `degree`.

    Returns:
        The coefficients, shape (len(new_knots) − new_degree − 1, …), by interpolation at the Greville abscissae, which
        is exact where the new splines include the old one.

    Accuracy: about 1e-14 of the largest coefficient for degrees up to 5.

    Example:
        >>> line, parabola = np.array([0.0, 0, 1, 1]), np.array([0.0, 0, 0, 1, 1, 1])
        >>> rewrite(line, 1, np.array([0.0, 2.0]), parabola, 2).round(12).tolist()
        [0.0, 1.0, 2.0]
    """
    from scipy.interpolate import BSpline, make_interp_spline  # takes a while to load

    if new_degree == degree and np.array_equal(knots, new_knots):
        return coefficients.copy()
    sites = np.clip(greville(new_knots, new_degree), new_knots[new_degree], new_knots[-new_degree - 1])
    wanted = BSpline(knots, coefficients, degree)(np.clip(sites, knots[degree], knots[-degree - 1]))
    return np.asarray(make_interp_spline(sites, wanted, k=new_degree, t=new_knots).c, dtype=np.float64)
