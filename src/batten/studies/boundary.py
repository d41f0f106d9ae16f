"""The boundary value problem of the elastica solved by three methods, on random problems: Fisker2018 Tables 2.1 and B.1.

Each problem asks for a curve of given length between two clamps, and comes from a known elastica. A method may answer with
another elastica of the same problem, which is no fault of its curve; so distances are taken to the elastica that was asked
for, and also to the nearest of all solutions that `solve_boundary` knows.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from scipy.special import ellipk

from batten.curves.arc_length import ArcLength
from batten.curves.base import Curve
from batten.curves.elastica import Elastica, points_batch
from batten.errors import ConvergenceError, InvalidInputError, NoSolutionError
from batten.measures.distance import h1_distance, l2_distance
from batten.solvers.boundary_value import solve_boundary
from batten.solvers.cubic_spline_rod import CubicSplineRod
from batten.solvers.discrete_rod import DiscreteRod
from batten.studies.study import Progress, check_size
from batten.typing import BoolArray, FloatArray, IntArray

METHODS = (
    "1, 250 points",
    "1, 750 points",
    "2, 0 updates",
    "2, 1 update",
    "2, 2 updates",
    "ours, least",
    "ours, all",
)
"""The columns. "ours, least" is the solution of least energy with the asked winding, "ours, all" of all of them the
one that is nearest to the elastica asked for; both have the time that it took to find all."""

PART = 50
"""Problems to a part of the study that is kept whole."""

FOUND = 1e-9
"""Greatest distance, in lengths, between a solution of ours and the elastica asked for that counts as found."""

_POINTS = (249, 749)  # edges of Method 1
_TABLE_B1 = 10  # problems in Table B.1
_TABLE_B1_UPDATES = 6
_FRACTIONS = np.linspace(0.0, 1.0, 65)  # where curves are compared to find the nearest
_EVERY_INFLECTIONS, _EVERY_TURNS = 4, 2  # of the solutions among which the nearest is looked for


def random_elastica(seed: int, number: int) -> Elastica:
    """The elastica of one random problem: length 1, at most one period, at most 1.5 turns.

    Half of them have inflections: modulus k = sin β with β uniform in [0.04, 0.98] π/2, period 4K(k). The others have
    none: k = 1/sin β with β in the same range, period 2K(1/k)/k (K of the modulus). Uniform are also the phase, over the
    period, and the extent, from 0.05 to 1 period; either is run through in either sense and turned by any angle. No
    curve of one period turns by more than one turn, so the limit of 1.5 turns takes nothing away.

    Parameters:
        seed: of the study, ≥ 0. number: of the problem, ≥ 0; each has its own random numbers, whatever the size.

    Returns:
        The elastica; it starts in the origin.

    Raises:
        InvalidInputError: a negative seed or number.

    Example:
        >>> one = random_elastica(1, 7)
        >>> one.length, random_elastica(1, 7) == one, random_elastica(1, 8) == one
        (1.0, True, False)
    """
    if not (seed >= 0 and number >= 0):
        raise InvalidInputError(f"seed and number are whole numbers ≥ 0; got {seed}, {number}")
    rng = np.random.default_rng([seed, number])
    inflected = rng.random() < 0.5
    sine = float(np.sin(rng.uniform(0.04, 0.98) * np.pi / 2.0))
    quarter = float(ellipk(sine * sine))
    k, period = (sine, 4.0 * quarter) if inflected else (1.0 / sine, 2.0 * quarter * sine)
    phase, extent = rng.uniform(0.0, 1.0) * period, rng.uniform(0.05, 1.0) * period
    sense = 1.0 if rng.random() < 0.5 else -1.0
    curve = Elastica.from_modulus(k, phase, sense * extent, scale=1.0 / extent, rotation=rng.uniform(-np.pi, np.pi))
    turned = 2.0 * np.pi * np.round(curve.start_angle / (2.0 * np.pi))
    return Elastica(np.zeros(2), curve.start_angle - turned, curve.start_curvature, curve.force, 1.0)


class Clamps(NamedTuple):
    """What a method is told: start (2,), start angle, end (2,), end angle with its turns, length."""

    start: FloatArray
    start_angle: float
    end: FloatArray
    end_angle: float
    length: float


def clamps_of(elastica: Elastica) -> Clamps:
    """The boundary values of an elastica."""
    end = elastica.point_at(elastica.length)
    return Clamps(elastica.start, elastica.start_angle, end, float(elastica.angle_at(elastica.length)), elastica.length)


@dataclass(frozen=True, eq=False)
class BoundaryPart:
    """Results for some problems; n of them, m = len(METHODS). Lengths are 1, so that all distances are normalised.

    Attributes:
        parameters: of the elastica asked for, (n, 7).
        end_error: distance of the last point from the end, (n, m). length_error: |length − 1|, (n, m).
        runtime: seconds, (n, m): the one thing that is not the same for the same seed.
        l2, h1: distances to the elastica asked for, (n, m).
        l2_nearest, h1_nearest: distances to the nearest of all solutions, (n, m).
        another: whether the nearest of all solutions is not the one asked for, (n, m).
        converged: by the method's own word, (n, m); for ours, whether the search was
            not cut short.
        solutions: of the problem with the asked winding; with any winding, (n, 2).
        missing: whether the elastica asked for is not among ours, to 1e-9, (n,).
    """

    parameters: FloatArray
    end_error: FloatArray
    length_error: FloatArray
    runtime: FloatArray
    l2: FloatArray
    h1: FloatArray
    l2_nearest: FloatArray
    h1_nearest: FloatArray
    another: BoolArray
    converged: BoolArray
    solutions: IntArray
    missing: BoolArray


@dataclass(frozen=True, eq=False)
class EnergyTable:
    """Table B.1 for ten problems of ours, in the paper's unit ½∫κ² ds for length 1.

    Attributes:
        exact: of the elastica asked for, (10,).
        energies: of the Bézier and after 0 … 6 updates, (10, 8).
        another: whether Method 2 went to another elastica, (10,).
    """

    exact: FloatArray
    energies: FloatArray
    another: BoolArray


@dataclass(frozen=True, eq=False)
class BoundaryStudy:
    """The whole study: its size and seed, the results for all problems, the table of energies."""

    size: int
    seed: int
    results: BoundaryPart
    energies: EnergyTable


class _Answer(NamedTuple):
    curve: Curve
    runtime: float
    converged: bool


def run(size: int, seed: int = 0, progress: Progress | None = None) -> BoundaryStudy:
    """Fisker2018 Tables 2.1 and B.1 on `size` random problems.

    Parameters:
        size: number of problems, ≥ 1. seed: ≥ 0; the same seed gives the same numbers, run times excepted.
        progress: called as progress(stage, done, total).

    Returns:
        `BoundaryStudy`; `lines` prints it.

    Raises:
        InvalidInputError: a size or a seed out of range.

    Accuracy: of the methods, that is what is measured; the distances to 1e-10.

    Example:
        >>> study = run(2, seed=3)
        >>> study.results.missing.any(), study.results.l2.shape
        (np.False_, (2, 7))
    """
    check_size(size, seed)
    parts = [run_part(seed, first, count, size, progress) for first, count in parts_of(size)]
    return BoundaryStudy(size, seed, joined(parts), energy_table(seed, progress))


def parts_of(size: int) -> list[tuple[int, int]]:
    """First problem and number of problems of each part of a study of this size."""
    return [(first, min(PART, size - first)) for first in range(0, size, PART)]


def joined(parts: Sequence[BoundaryPart]) -> BoundaryPart:
    """Several parts as one."""
    return BoundaryPart(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(BoundaryPart)))


def run_part(seed: int, first: int, count: int, size: int, progress: Progress | None = None) -> BoundaryPart:
    """The problems `first` … `first` + `count` − 1 of a study of `size`."""
    answers(random_elastica(seed, first))  # compiles what has to be compiled, outside of the run times
    rows = []
    for number in range(first, first + count):
        if progress is not None:
            progress("boundary value problems", number, size)
        rows.append(_problem(random_elastica(seed, number)))
    if progress is not None:
        progress("boundary value problems", first + count, size)
    return joined(rows)


def answers(elastica: Elastica) -> tuple[list[Curve], FloatArray, BoolArray, list[Elastica]]:
    """All methods on the boundary values of one elastica.

    Returns:
        The curves in the order of `METHODS`; run times (m,); whether each converged (m,); all solutions of ours with the
        asked winding. Where ours finds none, the lists end before its two columns.
    """
    clamps = clamps_of(elastica)
    found: list[_Answer] = []
    for edges in _POINTS:
        began = time.perf_counter()
        discrete = DiscreteRod(*clamps, edges=edges).solve()
        found.append(_Answer(discrete.curve, time.perf_counter() - began, discrete.converged))
    for updates in range(3):
        began = time.perf_counter()
        spline = CubicSplineRod(*clamps).solve(updates)
        found.append(_Answer(spline.curve, time.perf_counter() - began, spline.converged))
    began = time.perf_counter()
    ours, whole = _all_solutions(clamps)
    took = time.perf_counter() - began
    if ours:
        nearest = ours[int(np.argmin(_gaps(elastica, ours).max(axis=1)))]
        found += [_Answer(ours[0], took, whole), _Answer(nearest, took, whole)]
    return [a.curve for a in found], np.array([a.runtime for a in found]), np.array([a.converged for a in found]), ours


def _all_solutions(clamps: Clamps, **limits: Any) -> tuple[list[Elastica], bool]:
    """What `solve_boundary` finds, by energy, and whether it says that this is all."""
    try:
        return [s.elastica for s in solve_boundary(*clamps, **limits)], True
    except NoSolutionError:
        return [], True
    except ConvergenceError as error:
        return [s.elastica for s in error.best or []], False


def _problem(elastica: Elastica) -> BoundaryPart:
    """One row of the study."""
    curves, runtime, converged, ours = answers(elastica)
    clamps = clamps_of(elastica)
    every, _ = _all_solutions(clamps, max_inflections=_EVERY_INFLECTIONS, max_turns=_EVERY_TURNS, end_angle_modulo=True)
    others = [e for e, gap in zip(every, _gaps(elastica, every).max(axis=1)) if gap > FOUND]
    pool = [elastica, *others]
    m = len(METHODS)
    numbers = {name: np.full((1, m), np.nan) for name in ("end", "length", "l2", "h1", "l2_nearest", "h1_nearest")}
    another = np.zeros((1, m), dtype=bool)
    for j, curve in enumerate(curves):
        numbers["end"][0, j] = np.hypot(*(curve.point(1.0) - clamps.end))
        numbers["length"][0, j] = abs(curve.length - clamps.length)
        numbers["l2"][0, j] = numbers["l2_nearest"][0, j] = l2_distance(curve, elastica)
        numbers["h1"][0, j] = numbers["h1_nearest"][0, j] = h1_distance(curve, elastica)
        nearest = int(np.argmin((_gaps(curve, pool) ** 2).mean(axis=1)))
        if nearest > 0 and (distance := l2_distance(curve, pool[nearest])) < numbers["l2"][0, j]:
            another[0, j] = True
            numbers["l2_nearest"][0, j] = distance
            numbers["h1_nearest"][0, j] = h1_distance(curve, pool[nearest])
    padded = np.full((1, m), np.nan)
    padded[0, : len(runtime)] = runtime
    good = np.zeros((1, m), dtype=bool)
    good[0, : len(converged)] = converged
    gaps = _gaps(elastica, ours).max(axis=1)
    return BoundaryPart(
        parameters=elastica.parameters[None],
        end_error=numbers["end"],
        length_error=numbers["length"],
        runtime=padded,
        l2=numbers["l2"],
        h1=numbers["h1"],
        l2_nearest=numbers["l2_nearest"],
        h1_nearest=numbers["h1_nearest"],
        another=another,
        converged=good,
        solutions=np.array([[len(ours), len(every)]], dtype=np.int64),
        missing=np.array([not (gaps <= FOUND).any()]),
    )


def _gaps(curve: Curve, elastica: Sequence[Elastica]) -> FloatArray:
    """Distances between points at 65 equal fractions of the length, to each elastica, (k, 65)."""
    if not elastica:
        return np.empty((0, len(_FRACTIONS)))
    t = _FRACTIONS if isinstance(curve, Elastica) else ArcLength.of(curve).parameter_at(_FRACTIONS)
    gap = points_batch(np.stack([e.parameters for e in elastica]), _FRACTIONS) - curve.point(t)
    return np.hypot(gap[..., 0], gap[..., 1])


def energy_table(seed: int, progress: Progress | None = None) -> EnergyTable:
    """Table B.1 for the first ten problems of a seed."""
    exact, energies, another = [], [], []
    for number in range(_TABLE_B1):
        if progress is not None:
            progress("energies of Method 2", number, _TABLE_B1)
        elastica = random_elastica(seed, number)
        result = CubicSplineRod(*clamps_of(elastica)).solve(_TABLE_B1_UPDATES)
        exact.append(0.5 * elastica.bending_energy())
        energies.append([0.5 * e for e in result.energies])
        another.append(bool(l2_distance(result.curve, elastica) > 1e-3))
    if progress is not None:
        progress("energies of Method 2", _TABLE_B1, _TABLE_B1)
    return EnergyTable(np.array(exact), np.array(energies), np.array(another))
