"""Interpolating splines through points in the plane: all of Levien2009 ch. 4, by one engine."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from batten.curves.base import Curve
from batten.curves.bezier import CubicBezier
from batten.curves.elastica import Elastica
from batten.curves.log_aesthetic import LogAestheticCurve
from batten.curves.piecewise import PiecewiseCurve
from batten.curves.spiral import spiral_from_row
from batten.errors import InvalidInputError, NoSolutionError
from batten.splines.generating_curve import GeneratingCurve
from batten.splines.joint_angles import EndCondition, JointProblem, JointSolution, Status, solve_joints
from batten.splines.local_tangents import local_segments
from batten.splines.segment_family import EulerSpirals, HobbySegments, LogAesthetic, SegmentFamily, SlidingElastica
from batten.typing import ArrayLike, FloatArray, IntArray

Method = Literal["euler", "mec", "log-aesthetic", "kurgla1", "hobby", "circle", "ikarus", "lagrange"]
METHODS: tuple[Method, ...] = get_args(Method)
_LOCAL = ("circle", "ikarus", "lagrange")

End = Literal["natural", "arc"] | float | tuple[Literal["curvature"], float]


@dataclass(frozen=True, eq=False)
class InterpolatingSpline:
    """A spline through points.

    Attributes:
        points: (n, 2), as given.
        closed: whether the last segment leads back to the first point.
        method: by which it was made; "euler" where a fallback was taken, the name of a generating curve.
        asked: the method that was asked for.
        segments: one curve for each pair of neighbouring points.
        angles: (segments, 2), tangent angles at both ends of each segment to its chord, radians.
        status: "converged"; "higher winding": the equations hold, and some segment makes a loop that no designer would
            draw; "no solution": only with `fallback`, for the method that was asked for.
        residual: greatest jump of curvature at a point, times the mean of its chords; NaN for local methods.
        blame: the segment at which the method asked for failed; −1 if it did not.
        message: what happened, in words; empty if nothing did.
    """

    points: FloatArray
    closed: bool
    method: str
    asked: str
    segments: tuple[Curve, ...]
    angles: FloatArray
    status: Status
    residual: float
    blame: int
    message: str

    @cached_property
    def curve(self) -> PiecewiseCurve:
        """The whole spline as one curve."""
        return PiecewiseCurve(self.segments)

    def bending_energy(self) -> float:
        """∫κ² ds, in 1/length."""
        from batten.measures.bending_energy import bending_energy

        return float(sum(bending_energy(segment, tolerance=1e-10) for segment in self.segments))


def interpolating_spline(
    points: ArrayLike,
    method: Method | GeneratingCurve = "euler",
    *,
    closed: bool = False,
    start: End = "natural",
    end: End = "natural",
    corners: Sequence[int] = (),
    exponent: float = 1.78,
    tension: float | None = None,
    fallback: bool = False,
) -> InterpolatingSpline:
    """The spline of one kind through points (Levien2009 ch. 4).

    Joined with equal curvature: "euler": Euler spirals (§4.6); "mec": the least bending energy ∫κ² ds, or with `tension` c
    that of ∫κ² + c ds (§4.2); "log-aesthetic": κ = sign(s)|s|^exponent (§4.8); "kurgla1": elastica with the force across
    the chord (§4.9). "hobby": Metafont's cubics (§4.7), one linear system. From neighbours only: "circle": Séquin's blended
    arcs (§4.10); "lagrange": cubics over chord lengths (§4.4); "ikarus": the same tangents, with biarcs (§4.5). A
    `GeneratingCurve` in place of a name: segments cut from any curve, given by its curvature (§4.8).

    Parameters:
        points: shape (n, 2), n ≥ 2 (3 if closed), neighbours not the same; any unit of length.
        closed: whether the spline returns to the first point, which is not repeated.
        start, end: what holds at the ends of an open spline: "natural" (curvature 0), "arc" (no change of curvature along
            the end's segment), an angle of the tangent in radians, or ("curvature", κ). Local methods take none.
        corners: indices of points where the tangent may break: the spline is natural on both sides.
        exponent: α of "log-aesthetic"; 1.78 is what users preferred (§4.8.1), 1 the Euler spiral.
        tension: c of "mec" in 1/length² (default 0), or τ ≥ 0.75 of "hobby" (default 1).
        fallback: where the method has no solution return the Euler spiral spline, which says so, in place of an error.

    Returns:
        The spline with its segments, status and residual.

    Raises:
        InvalidInputError: shapes, values that are not finite, equal neighbours, an unknown method or end.
        NoSolutionError: the spline does not exist or was not found; the message names the segment to blame.

    Accuracy:
        Jumps of curvature at the points below 1e-12 over the mean chord (1e-8 for exponents below 1, whose curvature is
        steep at an inflection); end points and tangents to 1e-13 of the chord.
    Degenerate cases:
        Points on a line in order give the line. Where the polygon turns straight back (by π) it turns to the left. The MEC
        exists only for points that turn little (§2.5); the Euler spiral always did, if need be with more windings.

    Example:
        >>> import numpy as np
        >>> arch = interpolating_spline([[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]], "euler")
        >>> arch.status, len(arch.segments), arch.curve.point(0.5).round(12).tolist()
        ('converged', 2, [1.0, 1.0])
        >>> a = np.linspace(0.0, 2.0 * np.pi, 8)[:-1]
        >>> ring = interpolating_spline(np.stack([np.cos(a), np.sin(a)], axis=1), closed=True)
        >>> round(ring.curve.length / (2.0 * np.pi), 12)
        1.0
    """
    own = check_points(points, closed)
    if not isinstance(method, GeneratingCurve) and method not in METHODS:
        raise InvalidInputError(f"method = {method!r}; allowed are {', '.join(METHODS)} and a GeneratingCurve")
    wish = _Wish(method, exponent, tension, fallback)
    runs = _runs(len(own), closed, corners)
    last = len(runs) - 1
    made = []
    for k, (index, ring) in enumerate(runs):
        first_end: End = start if k == 0 and not closed else "natural"
        last_end: End = end if k == last and not closed else "natural"
        made.append(_run(own[index], ring, first_end, last_end, wish, index))
    segments = [s for m in made for s in m.segments]
    worst = max(made, key=lambda m: ("converged", "higher winding", "no solution").index(m.status))
    residual = float(np.max([m.residual for m in made]))
    angles = np.concatenate([m.angles for m in made])
    return InterpolatingSpline(
        own,
        closed,
        worst.method,
        worst.asked,
        tuple(segments),
        angles,
        worst.status,
        residual,
        worst.blame,
        worst.message,
    )


def check_points(points: ArrayLike, closed: bool) -> FloatArray:
    """The points as a read-only array (n, 2), or `InvalidInputError` in words."""
    own = np.array(points, dtype=np.float64)
    least = 3 if closed else 2
    if own.ndim != 2 or own.shape[1] != 2 or len(own) < least or not np.isfinite(own).all():
        raise InvalidInputError(
            f"points: got shape {own.shape}; allowed is (n, 2), finite, with n ≥ {least} for "
            f"{'a closed' if closed else 'an open'} spline"
        )
    following = np.roll(own, -1, axis=0) if closed else own[1:]
    same = np.flatnonzero((own[: len(following)] == following).all(axis=1))
    if same.size:
        hint = "; leave out the last point of a closed spline" if closed and same[-1] == len(own) - 1 else ""
        raise InvalidInputError(f"points {same[0]} and {(same[0] + 1) % len(own)} are the same; leave one out{hint}")
    own.setflags(write=False)
    return own


def _runs(n: int, closed: bool, corners: Sequence[int]) -> list[tuple[IntArray, bool]]:
    """Indices of the points of each smooth run, and whether it is closed."""
    cut = sorted({int(c) for c in corners})
    if cut and (cut[0] < 0 or cut[-1] >= n):
        raise InvalidInputError(f"corners: got {list(corners)}; allowed are indices of points, 0 to {n - 1}")
    if closed:
        if not cut:
            return [(np.arange(n), True)]
        ends = [*cut, cut[0] + n]
        return [(np.arange(a, b + 1) % n, False) for a, b in itertools.pairwise(ends)]
    ends = sorted({0, *cut, n - 1})
    return [(np.arange(a, b + 1), False) for a, b in itertools.pairwise(ends)]


@dataclass(frozen=True)
class _Wish:
    """What is asked of every run."""

    method: Method | GeneratingCurve
    exponent: float
    tension: float | None
    fallback: bool

    @property
    def family(self) -> SegmentFamily:
        if isinstance(self.method, GeneratingCurve):
            return self.method
        if self.method == "euler":
            return EulerSpirals()
        if self.method == "log-aesthetic":
            return LogAesthetic(self.exponent)
        if self.method == "kurgla1":
            return SlidingElastica(upright=True)
        if self.method == "hobby":
            return HobbySegments(1.0 if self.tension is None else self.tension)
        return SlidingElastica(tension=0.0 if self.tension is None else self.tension)


def _condition(name: str, given: End, chord_angle: float) -> EndCondition:
    if given == "natural":
        return EndCondition("curvature")
    if given == "arc":
        return EndCondition("arc")
    if isinstance(given, tuple) and len(given) == 2 and given[0] == "curvature" and math.isfinite(given[1]):
        return EndCondition("curvature", float(given[1]))
    if isinstance(given, (int, float)) and math.isfinite(given):
        return EndCondition("angle", math.remainder(float(given) - chord_angle, 2.0 * math.pi))
    raise InvalidInputError(
        f"{name} = {given!r}; allowed are 'natural', 'arc', an angle in radians, or ('curvature', value in 1/length)"
    )


def joint_problem(points: FloatArray, closed: bool, start: End = "natural", end: End = "natural") -> JointProblem:
    """The polygon of points (n, 2) as the engine takes it."""
    d = np.diff(np.vstack([points, points[:1]]) if closed else points, axis=0)
    z = d[:, 0] + 1j * d[:, 1]
    direction = np.angle(z)
    lengths: FloatArray = np.hypot(d[:, 0], d[:, 1])
    if closed:
        turns = np.angle(z * np.conj(np.roll(z, 1)))
        return JointProblem(lengths, np.where(turns == -np.pi, np.pi, turns), True)
    inner = np.angle(z[1:] * np.conj(z[:-1]))
    turns = np.zeros(len(points))
    turns[1:-1] = np.where(inner == -np.pi, np.pi, inner)
    first, last = _condition("start", start, float(direction[0])), _condition("end", end, float(direction[-1]))
    return JointProblem(lengths, turns, False, first, last)


def _run(points: FloatArray, closed: bool, start: End, end: End, wish: _Wish, index: IntArray) -> InterpolatingSpline:
    """One smooth run."""
    method = wish.method if isinstance(wish.method, str) else wish.method.name
    if method in _LOCAL:
        if (start, end) != ("natural", "natural"):
            raise InvalidInputError(
                f"method {method!r} takes its tangents from the neighbours; leave start and end out"
            )
        segments, tangents = local_segments(method, points, closed)
        d = np.diff(np.vstack([points, points[:1]]) if closed else points, axis=0)
        chord = np.arctan2(d[:, 1], d[:, 0])
        both = np.stack([tangents[: len(chord)], np.roll(tangents, -1)[: len(chord)]], axis=1) - chord[:, None]
        angles = (both + np.pi) % (2.0 * np.pi) - np.pi
        return InterpolatingSpline(points, closed, method, method, tuple(segments), angles, "converged", np.nan, -1, "")
    problem = joint_problem(points, closed, start, end)
    family = wish.family
    solution = solve_joints(problem, family)
    used, message, blame = method, "", -1
    if solution.status == "no solution":
        blame = solution.blame
        message = _why(family, solution, index)
        if not wish.fallback or method == "euler":
            raise NoSolutionError(message + "; method 'euler' has a spline through these points")
        family, used = EulerSpirals(), "euler"
        solution = solve_joints(problem, family)
        message += "; this is the Euler spiral spline in its place"
    elif solution.status == "higher winding":
        turn = np.abs(solution.angles).max(axis=1)
        message = (
            f"no {family.name} spline was found whose tangents stay within half a turn of the chords; in this one segment "
            f"{int(turn.argmax())} makes a loop: put a point between, or split at a corner"
        )
    curves = segment_curves(points, problem, family, solution)
    return InterpolatingSpline(
        points, closed, used, method, tuple(curves), solution.angles, solution.status, solution.residual, blame, message
    )


def _why(family: SegmentFamily, solution: JointSolution, index: IntArray) -> str:
    k = solution.blame
    if k < 0:
        return f"no {family.name} spline was found through these points"
    start, end = solution.angles[k]
    a, b = int(index[k]), int(index[(k + 1) % len(index)])
    return (
        f"no {family.name} spline was found through these points: it fails at the segment from point {a} to point {b}, when "
        f"its tangents are at {start:.3f} and {end:.3f} rad to the chord; put a point between, or split at a corner"
    )


def segment_curves(
    points: FloatArray, problem: JointProblem, family: SegmentFamily, solution: JointSolution
) -> list[Curve]:
    """The curves of solved segments, in the points' plane."""
    n = len(points)
    curves: list[Curve] = []
    for i in range(len(problem.chords)):
        p, q = points[i], points[(i + 1) % n]
        chord = float(problem.chords[i])
        direction = math.atan2(q[1] - p[1], q[0] - p[0])
        start, end = (float(a) for a in solution.angles[i])
        if isinstance(family, GeneratingCurve):
            curves.append(family.curve(p, q, solution.ends.memory[0][i]))
        elif isinstance(family, EulerSpirals):
            curves.append(spiral_from_row(p, direction + start, solution.ends.memory[0][i], chord))
        elif isinstance(family, LogAesthetic):
            k0, k1, c = solution.ends.memory[0][i, :3]
            curves.append(LogAestheticCurve(p, direction + start, family.exponent, k0, k1, chord / c))
        elif isinstance(family, SlidingElastica):
            curves.append(_elastica(p, direction + start, chord, solution.ends.memory[1][i]))
        else:
            curves.append(_hobby_cubic(p, q, start, end, family))
    return curves


def _elastica(p: FloatArray, angle: float, chord: float, z: FloatArray) -> Elastica:
    """z: κ₀ and the force in the frame of the first tangent for length 1; its chord is curvature·chord over κ₀ …"""
    unit = Elastica(np.zeros(2), 0.0, float(z[0]), z[1:], 1.0)
    length = chord / float(np.hypot(*unit.point(1.0)))
    c, s = math.cos(angle), math.sin(angle)
    force = np.array([c * z[1] - s * z[2], s * z[1] + c * z[2]]) / length**2
    return Elastica(p, angle, float(z[0]) / length, force, length)


def _hobby_cubic(p: FloatArray, q: FloatArray, start: float, end: float, family: SegmentFamily) -> CubicBezier:
    """Hobby's cubic (Levien2009 (4.11)), with θ₀ = start and θ₁ = −end."""
    tension = family.tension if isinstance(family, HobbySegments) else 1.0
    a, b, c = math.sqrt(2.0), 1.0 / 16.0, 0.5 * (3.0 - math.sqrt(5.0))
    t0, t1 = start, -end
    alpha = a * (math.sin(t0) - b * math.sin(t1)) * (math.sin(t1) - b * math.sin(t0)) * (math.cos(t0) - math.cos(t1))
    rho = (2.0 + alpha) / (1.0 + (1.0 - c) * math.cos(t0) + c * math.cos(t1))
    sigma = (2.0 - alpha) / (1.0 + (1.0 - c) * math.cos(t1) + c * math.cos(t0))
    chord = complex(*(q - p))
    first = chord * rho / (3.0 * tension) * complex(math.cos(t0), math.sin(t0))
    last = chord * sigma / (3.0 * tension) * complex(math.cos(t1), -math.sin(t1))
    arms = np.array([[first.real, first.imag], [-last.real, -last.imag]])
    return CubicBezier(np.stack([p, p + arms[0], q + arms[1], q]))
