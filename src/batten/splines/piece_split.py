"""Where to cut a curve into pieces that elastica follow within a tolerance: by halves, and as few as possible."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from batten.curves.elastica import Elastica, states_at
from batten.solvers.elastica_fit import Ends, fit_samples
from batten.splines.curve_spans import CurveSpan
from batten.splines.piece_distance import piece_distances
from batten.typing import FloatArray

Held = Literal["points", "tangents"]

#: A fit that is farther away, as a share of the piece's length, is tried again from other starts.
_FAR = 0.01
#: The longest feasible piece is found to this share of its length.
_CLOSE = 0.01
_GROWTH, _CREEP = 1.6, 1.25
#: Distances grow about as the fourth power of the length: lengths as the fourth root of the distance.
_POWER = 0.25
#: No piece is cut that is shorter than this share of the tolerance: its ends alone hold it that close.
_SHORTEST = 0.05
#: How near its end, as a share of its length, a fitted piece has to come by its stored numbers.
_HOLDS = 2e-12


@dataclass(frozen=True, eq=False)
class SplitPieces:
    """Pieces of a span, in order.

    Attributes:
        joints: (n + 1,), arc lengths where they meet, ends included. parameters: (n, 7). distances: (n,).
    """

    joints: FloatArray
    parameters: FloatArray
    distances: FloatArray

    def __len__(self) -> int:
        return len(self.parameters)


class PieceFitter:
    """Elastica for parts of a span, whose ends (and end tangents) are those of the span.

    Parameters:
        span: the curve. held: "points" or "tangents". tolerance: what `fit_one` calls good. within: the error of distances.
    """

    def __init__(self, span: CurveSpan, held: Held, tolerance: float, within: float) -> None:
        self.span, self.held, self.tolerance, self.within = span, held, tolerance, within
        self.fits = 0

    def fit(self, a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The elastica of least L² distance for parts [a, b], (k,): parameters (k, 7) and greatest distances (k,)."""
        if self.span.straight:
            return _lines(self.span, a, b), np.zeros(len(a))
        samples = self.span.samples(a, b)
        ends: Ends = self.held
        # A force of 50/ℓ² weighs as much as a distance of twice the tolerance (as in `surfaces.rationalise`).
        weight = (0.04 * self.tolerance / float((b - a).mean())) ** 2
        fits = fit_samples(samples, ends=ends, starts=1, force_weight=weight)
        parameters = fits.parameters.copy()
        self.fits += len(a)
        distances = self._distances(a, b, parameters)
        poor = (distances > self.tolerance) & ~(fits.distance < _FAR)
        for i in np.flatnonzero(poor):
            one = self.span.samples(a[i : i + 1], b[i : i + 1])
            again = fit_samples(one, ends=ends, starts=4, force_weight=weight).parameters[0]
            self.fits += 1
            distance = float(self._distances(a[i : i + 1], b[i : i + 1], again[None])[0])
            if distance < distances[i]:
                parameters[i], distances[i] = again, distance
        return parameters, distances

    def _distances(self, a: FloatArray, b: FloatArray, parameters: FloatArray) -> FloatArray:
        """Greatest distances; inf where the seven numbers do not hold the far end, because it hangs on their last digits."""
        ends = states_at(parameters, parameters[:, 6])[:, :2]
        with np.errstate(invalid="ignore"):
            holds = np.hypot(*(ends - self.span.points_at(b)).T) <= _HOLDS * (b - a)
        distances = np.full(len(a), np.inf)
        if holds.any():
            distances[holds] = piece_distances(self.span, a[holds], b[holds], parameters[holds], self.within)
        return distances

    def fit_one(self, a: float, b: float) -> tuple[FloatArray, float]:
        """`fit` for one part."""
        parameters, distances = self.fit(np.array([a]), np.array([b]))
        return parameters[0], float(distances[0])


def bisected(fitter: PieceFitter, first: float = 0.0) -> SplitPieces:
    """Halves, and halves of halves, until every piece is within the tolerance (Brander2016 §5, Fig. 10).

    A piece too short to be cut stays as it is, with its distance.

    Parameters:
        fitter: what fits. first: arc length of the first joint, for a closed span.
    """
    waiting_a, waiting_b = np.array([first]), np.array([first + fitter.span.length])
    rows: list[tuple[float, float, FloatArray, float]] = []
    while len(waiting_a):
        parameters, distances = fitter.fit(waiting_a, waiting_b)
        done = (distances <= fitter.tolerance) | (waiting_b - waiting_a <= _SHORTEST * fitter.tolerance)
        rows += [
            (float(waiting_a[i]), float(waiting_b[i]), parameters[i], float(distances[i])) for i in np.flatnonzero(done)
        ]
        a, b = waiting_a[~done], waiting_b[~done]
        middle = 0.5 * (a + b)
        waiting_a, waiting_b = np.concatenate([a, middle]), np.concatenate([middle, b])
    rows.sort(key=lambda row: row[0])
    joints = np.array([*(row[0] for row in rows), rows[-1][1]])
    return SplitPieces(joints, np.stack([row[2] for row in rows]), np.array([row[3] for row in rows]))


def longest_first(fitter: PieceFitter, most: int, first: float = 0.0) -> SplitPieces | None:
    """Each piece as long as the tolerance lets it be, one after the other; None if more than `most` are needed.

    Where a part of a feasible part is always feasible, no cutting has fewer pieces.

    Parameters:
        fitter, first: as for `bisected`. most: where to give up.
    """
    start, stop = first, first + fitter.span.length
    joints, distances = [start], list[float]()
    parameters: list[FloatArray] = []
    guess = stop - start
    while start < stop:
        if len(parameters) == most:
            return None
        found, good, distance = _longest(fitter, start, stop, guess)
        guess = found - start
        joints.append(found)
        parameters.append(good)
        distances.append(distance)
        start = found
    return SplitPieces(np.array(joints), np.stack(parameters), np.array(distances))


def _longest(fitter: PieceFitter, start: float, stop: float, guess: float) -> tuple[float, FloatArray, float]:
    """The end of the longest good piece from `start`, with the piece and its distance.

    Distances grow like powers of the length; the power between the longest good and the shortest bad length known says
    where to look next. Where that does not halve what is between them, the middle does.
    """
    shortest = _SHORTEST * fitter.tolerance
    good: tuple[float, FloatArray, float] | None = None
    bad, bad_distance, halve = np.inf, np.inf, False
    length = guess
    while True:
        end = stop if start + length >= stop - shortest else start + length
        parameters, distance = fitter.fit_one(start, end)
        between = bad - (start if good is None else good[0])
        if distance <= fitter.tolerance or end - start <= shortest:
            good = end, parameters, distance
            if end == stop:
                return good
        else:
            bad, bad_distance = end, distance
        if good is None:
            length *= float(np.clip((fitter.tolerance / distance) ** _POWER, 1.0 / _GROWTH**2, 1.0 / _CREEP))
            continue
        size = good[0] - start
        if not np.isfinite(bad):
            length = size * float(np.clip((fitter.tolerance / max(good[2], 1e-300)) ** _POWER, _CREEP, _GROWTH))
            continue
        if bad - good[0] <= max(_CLOSE * size, shortest):
            return good
        halve = not halve and bad - good[0] > 0.5 * between
        length = 0.5 * (good[0] + bad) - start
        if not halve and np.isfinite(bad_distance) and good[2] > 0.0:
            share = np.log(fitter.tolerance / good[2]) / np.log(bad_distance / good[2])
            aim = size * ((bad - start) / size) ** share
            # A little to the side that leaves less between them if all goes as expected.
            aim += 0.4 * _CLOSE * size * (1.0 if bad - start - aim > aim - size else -1.0)
            length = float(np.clip(aim, size + 0.02 * (bad - good[0]), bad - start - 0.02 * (bad - good[0])))


def _lines(span: CurveSpan, a: FloatArray, b: FloatArray) -> FloatArray:
    p, q = span.points_at(a), span.points_at(b)
    step = q - p
    out = np.zeros((len(a), 7))
    out[:, :2], out[:, 2], out[:, 6] = p, span.angles_at(0.5 * (a + b)), np.hypot(step[:, 0], step[:, 1])
    return out


def pieces_of(parameters: FloatArray) -> tuple[Elastica, ...]:
    """Rows of parameters as curves."""
    return tuple(Elastica.from_parameters(row) for row in parameters)
