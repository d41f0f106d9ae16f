"""The elastica that the pieces of a cubic proxy stand for."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, get_args

import numpy as np

from batten.curves.bezier import CubicBezier
from batten.curves.elastica import Elastica
from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError
from batten.kernels.elastica_fit_batch import guess_batch
from batten.measures.distance import hausdorff_distance
from batten.solvers.curve_samples import samples_of
from batten.solvers.elastica_fit import fit_samples
from batten.typing import ArrayLike, FloatArray

RodKind = Literal["guess", "joined", "fit"]

#: Greatest error of the distances, as a part of the length of the piece.
_DISTANCE_TOLERANCE = 1e-4
_NODES = 64
#: Farthest from its chord, in chords, that a piece without a guess may be to count as straight.
_STRAIGHT = 1e-9


@dataclass(frozen=True, eq=False)
class DesignRods:
    """Result of `design_rods`, one for each of the n pieces.

    Attributes:
        elastica: n curves; None for a piece that has no first guess, or whose fit failed.
        distances: (n,), greatest distance of the rod to its piece (two-sided Hausdorff), in the unit of the coordinates; NaN
            where there is no rod.
        gaps: (n − 1,), distance from the end of each rod to the start of the next; NaN where one is missing.
        turns: (n − 1,), turn of the tangent there, radians in [−π, π], counter-clockwise positive.
    """

    elastica: tuple[Elastica | None, ...]
    distances: FloatArray
    gaps: FloatArray
    turns: FloatArray

    @property
    def greatest_distance(self) -> float:
        """The greatest of the distances; NaN where a rod is missing."""
        return float(np.max(self.distances))


def design_rods(pieces: ArrayLike, kind: RodKind = "joined") -> DesignRods:
    """An elastica for each piece of a cubic spline, for drawing and for judging the proxy.

    Definition: "guess" is the first guess as it is (Brander2016 §3–4, Fisker2018 §2.1.1); "joined" the same scaled, turned
    and shifted onto the ends of the piece, so that the rods meet (Fisker2018 §5.3, Fig. 5.12); "fit" the elastica of least
    L² distance with the piece's end points and end tangents, so that the rods meet without a corner.

    Parameters:
        pieces: Bézier points, shape (n, 4, 2), n ≥ 1.
        kind: "guess", "joined" or "fit".

    Raises:
        InvalidInputError: another shape or kind.

    Accuracy: distances to 1e-4 × the length of the piece. Joined rods meet to 1e-11 × their length, fitted ones to 1e-12.

    Degenerate cases: a straight piece gives a straight rod; a piece of length 0 or with a cusp may have none. A guess whose
    ends coincide cannot be joined to ends that differ, and is missing.

    Example:
        >>> rods = design_rods([[(0, 0), (1, 1), (2, 1), (3, 0)], [(3, 0), (4, -1), (5, -1), (6, 0)]])
        >>> bool(rods.greatest_distance < 0.01), bool(rods.gaps[0] < 1e-10), bool(abs(rods.turns[0]) < 0.02)
        (True, True, True)
    """
    if kind not in get_args(RodKind):
        raise InvalidInputError(f"kind is 'guess', 'joined' or 'fit'; got {kind!r}")
    control = np.asarray(pieces, dtype=np.float64)
    if control.ndim != 3 or control.shape[1:] != (4, 2) or len(control) == 0:
        raise InvalidInputError(f"pieces are Bézier points, shape (n, 4, 2), n ≥ 1; got shape {control.shape}")
    rods = tuple(_fits(control) if kind == "fit" else _guesses(control))
    if kind == "joined":
        rods = tuple(_joined(rod, piece[0], piece[3]) for rod, piece in zip(rods, control))
    distances = np.array([_distance(piece, rod) for piece, rod in zip(control, rods)])
    gaps, turns = np.full(len(rods) - 1, np.nan), np.full(len(rods) - 1, np.nan)
    for i, (a, b) in enumerate(pairwise(rods)):
        if a is not None and b is not None:
            gaps[i] = np.hypot(*(b.start - a.point_at(a.length)))
            turns[i] = math.remainder(b.start_angle - float(a.angle_at(a.length)), 2.0 * math.pi)
    return DesignRods(rods, distances, gaps, turns)


def _guesses(control: FloatArray) -> list[Elastica | None]:
    samples = samples_of(control, nodes=_NODES)[0]
    n = len(samples)
    parameters, info, status = np.empty((n, 7)), np.empty((n, 4)), np.empty(n, dtype=np.int64)
    guess_batch(
        samples.points, samples.angles, samples.curvatures, samples.weights, samples.fractions, samples.lengths,
        samples.ends, parameters, info, status,
    )  # fmt: skip
    return [_elastica(row) or _straight(piece) for row, piece in zip(parameters, control)]


def _fits(control: FloatArray) -> list[Elastica | None]:
    return [_elastica(row) for row in fit_samples(samples_of(control)[0], ends="tangents").parameters]


def _elastica(row: FloatArray) -> Elastica | None:
    return Elastica.from_parameters(row) if np.isfinite(row).all() and row[6] > 0.0 else None


def _straight(piece: FloatArray) -> Elastica | None:
    """The chord of a piece that is straight but for rounding, whose curvature gives no direction."""
    chord = piece[3] - piece[0]
    size = float(np.hypot(*chord))
    off = piece - piece[0]
    if not size > 0.0 or np.abs(off[:, 0] * chord[1] - off[:, 1] * chord[0]).max() > _STRAIGHT * size * size:
        return None
    return Elastica(piece[0], math.atan2(chord[1], chord[0]), 0.0, np.zeros(2), size)


def _joined(rod: Elastica | None, start: FloatArray, end: FloatArray) -> Elastica | None:
    """The similar rod with these ends."""
    if rod is None:
        return None
    chord, wanted = rod.point_at(rod.length) - rod.start, end - start
    size = float(np.hypot(*chord))
    scale = float(np.hypot(*wanted)) / size if size > 1e-9 * rod.length else 0.0
    if not scale > 0.0:
        return None
    rotation = float(np.angle(complex(*wanted) * complex(*chord).conjugate()))
    turned = rod.transformed(Similarity(scale, rotation))
    x, y = (start - turned.start).tolist()
    return turned.transformed(Similarity(translation=(x, y)))


def _distance(piece: FloatArray, rod: Elastica | None) -> float:
    if rod is None:
        return float("nan")
    curve = CubicBezier(piece)
    return float(hausdorff_distance(curve, rod, tolerance=_DISTANCE_TOLERANCE * curve.length))
