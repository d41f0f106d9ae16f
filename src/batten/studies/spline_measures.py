"""How good an interpolating spline is, in figures: Levien2009 ch. 2 and Table 4.1, measured."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from batten.curves.base import Curve
from batten.errors import NoSolutionError
from batten.measures.distance import distance_to_polyline
from batten.splines.interpolating_spline import METHODS, InterpolatingSpline, interpolating_spline
from batten.splines.scale_invariant_spline import scale_invariant_spline
from batten.typing import FloatArray

Maker = Callable[[FloatArray, bool], InterpolatingSpline]
"""A spline through points, (points, closed)."""

_X, _W = np.polynomial.legendre.leggauss(24)
_T, _WEIGHTS = 0.5 * (_X + 1.0), 0.5 * _W
_EXACT = 1e-9  # of a chord: below it a jump or an error counts as 0; circle splines are differentiated by a series


def makers() -> dict[str, Maker]:
    """Every kind of spline that the study compares, by its name."""

    def by(method: str) -> Maker:
        return lambda points, closed: interpolating_spline(points, method, closed=closed)  # type: ignore[arg-type]

    return {
        **{m: by(m) for m in METHODS},
        "si-mec": lambda points, closed: scale_invariant_spline(points, closed=closed).spline,
    }


@dataclass(frozen=True)
class SplineMeasures:
    """What is measured of one kind of spline; NaN where it has no meaning or there was no spline.

    Attributes:
        continuity: greatest n ≤ 3 for which the spline is Gⁿ at the points of the designs.
        roundness: greatest distance from the circle, in radii, of the spline through 8 points on it.
        roundness_order: p of an error like n^(−p), from 8 and 16 points; infinite for a circle.
        extensionality: how far the spline moves when one of its points is added to the points, in chords.
        locality: ratio of the tangent angles from one point to the next, far from a moved point on a straight row.
        found: share of the designs that have such a spline.
        monotone: share of segments whose curvature is monotone.
        energy: ∫κ² ds, the median over designs of the quotient with the MEC's.
        variation: ∫κ′² ds, the same with the Euler spiral's.
        steepest: max |κ′|, the same.
        invariance: greatest movement, in chords, under a similarity, in a mirror and in reverse order: (3,).
        milliseconds: median time for a design of 10 points.
    """

    continuity: int
    roundness: float
    roundness_order: float
    extensionality: float
    locality: float
    found: float
    monotone: float
    energy: float
    variation: float
    steepest: float
    invariance: tuple[float, float, float]
    milliseconds: float


def designs(count: int, seed: int = 0, points: int = 10) -> list[FloatArray]:
    """Points such as a designer sets them: chords of 0.6 to 1.4, turning by at most 55° at each; shape (points, 2) each."""
    random = np.random.default_rng([seed, points])
    out = []
    for _ in range(count):
        turns = random.uniform(-1.0, 1.0, points - 1) * math.radians(55.0)
        chords = random.uniform(0.6, 1.4, points - 1)
        steps = chords * np.exp(1j * np.cumsum(turns))
        z = np.concatenate([[0.0], np.cumsum(steps)])
        out.append(np.stack([z.real, z.imag], axis=1))
    return out


def curvature_and_slope(curve: Curve, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(speed, κ, dκ/ds) at parameters t."""
    (x1, y1), (x2, y2), (x3, y3) = (curve.derivative(t, n).T for n in (1, 2, 3))
    speed = np.hypot(x1, y1)
    cross = x1 * y2 - y1 * x2
    slope = (x1 * y3 - y1 * x3) / speed**3 - 3.0 * cross * (x1 * x2 + y1 * y2) / speed**5
    return speed, cross / speed**3, slope / speed


def circle_points(n: int) -> FloatArray:
    """n points on the unit circle at equal distances."""
    angle = 2.0 * np.pi * np.arange(n) / n
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def roundness(make: Maker, n: int) -> float:
    """Greatest distance from the unit circle of the closed spline through n points on it."""
    spline = make(circle_points(n), True)
    t = np.linspace(0.0, 1.0, 101)
    return max(float(np.abs(np.hypot(*s.point(t).T) - 1.0).max()) for s in spline.segments)


def locality(make: Maker) -> float:
    """Ratio of the tangent angles at neighbouring points, four points from one that was moved; 0 where nothing is left."""
    points = np.stack([np.arange(25.0), np.zeros(25)], axis=1)
    points[12, 1] = 1e-4
    angle = np.abs(make(points, False).angles[:, 0])
    return float(angle[17] / angle[16]) if angle[16] > 1e-12 else 0.0


def extensionality(make: Maker, points: FloatArray) -> float:
    """How far the spline moves, over the mean chord, when the middle point of its middle segment is added to the points."""
    spline = make(points, False)
    k = len(spline.segments) // 2
    again = make(np.insert(points, k + 1, spline.segments[k].point(0.5), axis=0), False)
    t = np.linspace(0.0, 1.0, 17)
    chord = float(np.hypot(*np.diff(points, axis=0).T).mean())
    # Segments before and behind, then the one that was divided: its halves against the nearest of many points.
    moved = [
        np.abs(own.point(t) - again.segments[i if i < k else i + 1].point(t)).max()
        for i, own in enumerate(spline.segments)
        if i != k
    ]
    dense = spline.segments[k].point(np.linspace(0.0, 1.0, 4001))
    for half in again.segments[k : k + 2]:
        moved.append(distance_to_polyline(half.point(t), dense).max())
    return float(max(moved)) / chord


def continuity(splines: list[InterpolatingSpline]) -> int:
    """Greatest n ≤ 3 so that position, tangent, κ and κ′ up to the n-th are continuous: κ to 1e-7, κ′ to 1e-5."""
    order = 3
    for spline in splines:
        for before, after in zip(spline.segments[:-1], spline.segments[1:]):
            _, k0, s0 = curvature_and_slope(before, np.array([1.0]))
            _, k1, s1 = curvature_and_slope(after, np.array([0.0]))
            if abs(k1[0] - k0[0]) > 1e-7:
                order = min(order, 1)
            elif abs(s1[0] - s0[0]) > 1e-5:
                order = min(order, 2)
    return order


@dataclass(frozen=True)
class Fairness:
    """∫κ² ds, ∫κ′² ds, max |κ′| and the share of segments with monotone curvature of one spline."""

    energy: float
    variation: float
    steepest: float
    monotone: float


def fairness(spline: InterpolatingSpline) -> Fairness:
    """Integrals by Gauss's rule between the breaks of each segment; monotony by signs of κ′ at 24 places."""
    energy = variation = steepest = 0.0
    monotone = 0
    for segment in spline.segments:
        edges = segment.breaks()
        slopes = []
        for a, b in itertools.pairwise(edges):
            speed, kappa, slope = curvature_and_slope(segment, a + (b - a) * _T)
            weight = (b - a) * _WEIGHTS * speed
            energy += float(weight @ kappa**2)
            variation += float(weight @ slope**2)
            slopes.append(slope)
        values = np.concatenate(slopes)
        bend = float(np.abs(curvature_and_slope(segment, _T)[1]).max())
        values[np.abs(values) * segment.length < 1e-9 * (1.0 + bend)] = 0.0
        steepest = max(steepest, float(np.abs(values).max()))
        monotone += bool((values >= 0.0).all() or (values <= 0.0).all())
    return Fairness(energy, variation, steepest, monotone / len(spline.segments))


def invariance(make: Maker, points: FloatArray) -> tuple[float, float, float]:
    """Movement of the segments' middles, over the mean chord: under a similarity, in a mirror, in reverse order."""

    def middles(p: FloatArray) -> FloatArray:
        return np.array([s.point(0.5) for s in make(p, False).segments])

    own = middles(points)
    chord = float(np.hypot(*np.diff(points, axis=0).T).mean())
    turn = np.array([[0.6, 0.8], [-0.8, 0.6]])
    moved = (middles(3.0 * points @ turn + [5.0, -2.0]) - [5.0, -2.0]) @ turn.T / 3.0
    mirrored = middles(points * [1.0, -1.0]) * [1.0, -1.0]
    # In reverse order the middle of a parameter is another point: distance to the segment itself.
    reverse = make(points[::-1].copy(), False)
    spline = make(points, False)
    n = len(own)
    t = np.linspace(0.0, 1.0, 2001)
    back = max(
        float(distance_to_polyline(reverse.segments[n - 1 - i].point([0.5]), spline.segments[i].point(t))[0])
        for i in range(n)
    )
    return float(np.abs(moved - own).max()) / chord, float(np.abs(mirrored - own).max()) / chord, back / chord


def measure(name: str, make: Maker, points: list[FloatArray], reference: dict[str, list[Fairness]]) -> SplineMeasures:
    """All measures of one kind of spline over designs; `reference` holds the fairness of "mec" and "euler" on the same."""
    made: list[InterpolatingSpline | None] = []
    times = []
    for p in points:
        begin = perf_counter()
        try:
            made.append(make(p, False))
            times.append(perf_counter() - begin)
        except NoSolutionError:
            made.append(None)
    good = [(i, s) for i, s in enumerate(made) if s is not None]
    fair = [(i, fairness(s)) for i, s in good]
    coarse, fine = roundness(make, 8), roundness(make, 16)
    one = points[good[0][0]]

    def quotient(kind: str, other: str) -> float:
        values = [getattr(f, kind) / getattr(reference[other][i], kind) for i, f in fair]
        return float(np.median(values))

    return SplineMeasures(
        continuity([s for _, s in good]),
        coarse if coarse > _EXACT else 0.0,
        math.log2(coarse / fine) if coarse > _EXACT else math.inf,
        extensionality(make, one),
        locality(make),
        len(good) / len(points),
        float(np.mean([f.monotone for _, f in fair])),
        quotient("energy", "mec"),
        quotient("variation", "euler"),
        quotient("steepest", "euler"),
        invariance(make, one),
        1e3 * float(np.median(times)),
    )
