"""Where to divide a curve so that few pieces do: the longest pieces within a tolerance, and pieces of equal error."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from batten.errors import ConvergenceError
from batten.typing import FloatArray

PieceError = Callable[[float, float], float]
"""The error of the piece between two parameters."""

_ORDER = 6.0  # of the error of a cubic by area and moment, in the length of its piece
_TRIES = 80
_PRECISION = 1e-3
_ROUNDS = 14
_EQUAL = 1.02


def fewest_places(error: PieceError, start: float, stop: float, tolerance: float) -> tuple[FloatArray, FloatArray]:
    """Parameters of the ends of as few pieces as stay within a tolerance, (n + 1,), and their errors, (n,).

    The longest pieces, one after the other, give their number: where a part of a piece never has more error than the whole,
    no division has fewer. Then the ends are moved until the errors are equal.

    Raises:
        ConvergenceError: somewhere not even a short piece stays within the tolerance.

    Example:
        >>> places, errors = fewest_places(lambda a, b: (b - a) ** 6, 0.0, 1.0, 1e-3)
        >>> places.round(6).tolist(), bool(errors.max() <= 1e-3)
        ([0.0, 0.25, 0.5, 0.75, 1.0], True)
    """
    places, errors, guess = [start], [], stop - start
    while places[-1] < stop:
        end, reached = _longest(error, places[-1], guess, stop, tolerance)
        guess = end - places[-1]
        places.append(end)
        errors.append(reached)
    own, off = np.array(places), np.array(errors)
    n = len(errors)
    if n > 1:
        if float(((off / tolerance) ** (1.0 / _ORDER)).sum()) < n - 0.95:  # the last piece is hardly needed
            fewer = _balanced(error, own, off, n - 1)
            if fewer[1].max() <= tolerance:
                return fewer
        even = _balanced(error, own, off, n)
        if even[1].max() <= tolerance:
            return even
    return own, off


def halved_places(error: PieceError, start: float, stop: float, tolerance: float) -> tuple[FloatArray, FloatArray]:
    """Ends of the pieces, (n + 1,), and their errors, where every piece is halved until it stays within the tolerance.

    Raises:
        ConvergenceError: as `fewest_places`.
    """
    places, errors, stack = [start], [], [(start, stop)]
    least = 1e-15 * (stop - start)
    while stack:
        a, b = stack.pop()
        off = error(a, b)
        if off <= tolerance:
            places.append(b)
            errors.append(off)
        elif b - a <= least:
            raise _none(a, tolerance)
        else:
            middle = 0.5 * (a + b)
            stack += [(middle, b), (a, middle)]
    return np.array(places), np.array(errors)


def _longest(error: PieceError, start: float, guess: float, stop: float, tolerance: float) -> tuple[float, float]:
    """The end of the longest piece from `start` within the tolerance, to a thousandth of it, and its error."""
    good, bad, kept = start, np.inf, np.nan
    width = min(guess, stop - start)
    for _ in range(_TRIES):
        end = stop if start + width >= stop - 1e-9 * (stop - start) else start + width
        off = error(start, end)
        if off <= tolerance:
            good, kept = end, off
            if end == stop:
                break
        else:
            bad = end
        if bad - good <= _PRECISION * (good - start):
            break
        ratio = (tolerance / max(off, 1e-3 * tolerance)) ** (1.0 / _ORDER)
        hoped = start + (end - start) * ratio
        if bad == np.inf:
            width = (end - start) * min(max(ratio, 1.05), 2.0)
        elif good == start:
            width = (end - start) * min(max(0.98 * ratio, 0.25), 0.9)
        else:
            width = min(max(hoped, good + 0.1 * (bad - good)), bad - 0.1 * (bad - good)) - start
    if good == start:
        raise _none(start, tolerance)
    return good, kept


def _balanced(error: PieceError, places: FloatArray, errors: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """The ends of `count` pieces with errors as equal as was reached, from the errors of some pieces."""
    best = (places, errors)
    for k in range(_ROUNDS):
        density = (
            np.maximum(errors, 1e-6 * errors.max()) ** (1.0 / _ORDER) if errors.max() > 0.0 else np.ones(len(errors))
        )
        total = np.concatenate([[0.0], np.cumsum(density)])
        moved = np.interp(np.linspace(0.0, total[-1], count + 1), total, places)
        moved[[0, -1]] = places[[0, -1]]
        places, errors = moved, _errors(error, moved)
        if k == 0 or errors.max() < best[1].max():
            best = (places, errors)
        if errors.max() <= _EQUAL * errors.min():
            break
    return best


def _errors(error: PieceError, places: FloatArray) -> FloatArray:
    return np.array([error(a, b) for a, b in zip(places[:-1].tolist(), places[1:].tolist())])


def _none(place: float, tolerance: float) -> ConvergenceError:
    return ConvergenceError(
        f"no cubic stays within {tolerance:g} of the curve near its parameter {place:.6g}; allow a greater distance"
    )
