"""Splines of four-parameter segments with a type for each point, as font designers set them (Levien2009 ch. 7, 8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import get_args

import numpy as np

from batten.curves.piecewise import PiecewiseCurve
from batten.curves.spiral import Spiral
from batten.splines.knot_run import SolvedRun, Status, solve_run
from batten.splines.knot_types import KnotPath, Run, read_knots, runs
from batten.typing import ArrayLike, FloatArray, IntArray

_WORSE: tuple[Status, ...] = get_args(Status)


@dataclass(frozen=True, eq=False)
class ConstrainedSpline:
    """A spline through typed points.

    Attributes:
        points: (n, 2), those that it passes through: as given, without handles.
        types: their letters, n of them; closed splines without the z, handles without their h.
        closed: whether the last segment leads back to the first point.
        parameters: (segments,), how many parameters each segment has: 4, 2, 1 (an arc) or 0 (a line); as solved.
        middle: (segments, 4), curvature and its derivatives in the middle of each segment, times its length's powers.
        chords, lengths: (segments,).
        angles: (segments, 2), of the tangents at the ends of each segment to its chord, radians.
        status: the worst of its runs': "converged"; "relaxed": at some points `c` was taken for `o`; "higher winding": the
            equations hold, and some segment makes a loop that no designer would draw; "not converged": Euler spirals in
            place of what was asked for.
        statuses: (segments,), the same for each segment.
        relaxed: indices of the points where `c` was taken for `o`.
        residual: greatest miss of an equation that was asked for: jump of an angle, or of κ, κ′, κ″ times the power of the
            mean chord.
        iterations: Newton steps in all.
        message: what happened, in words; empty if nothing did.
    """

    points: FloatArray
    types: str
    closed: bool
    parameters: IntArray
    middle: FloatArray
    chords: FloatArray
    lengths: FloatArray
    angles: FloatArray
    status: Status
    statuses: tuple[Status, ...]
    relaxed: tuple[int, ...]
    residual: float
    iterations: int
    message: str

    @cached_property
    def segments(self) -> tuple[Spiral, ...]:
        """One curve for each pair of neighbouring points."""
        size = self.lengths[:, None] ** np.arange(1, 5)
        k = self.middle
        start = np.stack(
            [
                k[:, 0] - k[:, 1] / 2.0 + k[:, 2] / 8.0 - k[:, 3] / 48.0,
                k[:, 1] - k[:, 2] / 2.0 + k[:, 3] / 8.0,
                k[:, 2] - k[:, 3] / 2.0,
                k[:, 3],
            ],
            axis=1,
        )
        steps = _steps(self.points, self.closed)
        angle = np.arctan2(steps[:, 1], steps[:, 0]) + self.angles[:, 0]
        return tuple(
            Spiral(p, float(a), c, float(s))
            for p, a, c, s in zip(self.points, angle, start / size, self.lengths, strict=False)
        )

    @cached_property
    def curve(self) -> PiecewiseCurve:
        """The whole spline as one curve."""
        return PiecewiseCurve(self.segments)

    def bending_energy(self) -> float:
        """∫κ² ds, in 1/length; exact up to rounding."""
        return self._energy(0)

    def variation_energy(self) -> float:
        """∫κ′² ds, in 1/length³; exact up to rounding. The MVC has the least (Moreton1995)."""
        return self._energy(1)

    def _energy(self, order: int) -> float:
        x, w = np.polynomial.legendre.leggauss(4)
        k, s = self.middle, 0.5 * x
        powers = (np.ones_like(s), s, s * s / 2.0, s**3 / 6.0)
        value = sum(k[:, j, None] * powers[j - order] for j in range(order, 4))
        return float((0.5 * value**2 @ w / self.lengths ** (1 + 2 * order)).sum())


def constrained_spline(points: ArrayLike, types: str | Sequence[str], *, relax: bool = True) -> ConstrainedSpline:
    """The spline of four-parameter segments through points with libspiro's types (Levien2009 ch. 7, 8: "Spiro").

    Definition: the curvature of every segment is a cubic of arc length. Joined are, at a point of type

    - `o`: θ, κ, κ′, κ″ (G⁴);
    - `c`: θ and κ (G²); κ″ = 0 on a side with four parameters;
    - `[`, from curve to line: θ and κ; κ′ = κ″ = 0 on its right, should a curve of four parameters follow;
    - `]`, from line to curve: the mirror image;
    - `a`: an anchor, followed by a point `h`, its handle, through which the curve does not pass. As in libspiro the anchor
      is `[` and `]` in one point, with a line of no length between: its tangent points to the handle, and κ = 0;
    - `v`, a corner, and `{` `}`, the ends of an open path: nothing; κ′ = κ″ = 0 on a side with four parameters.

    A segment has four parameters beside `o`, right of `]` and `a`, left of `[` and `a`; two between `c` and `c`; one (an
    arc) between `c` and another point; none (a line) else. With `c` alone it is the Euler spiral spline with arcs at its
    ends; with `o` alone, to first order in the angles, the spline of least ∫κ′² ds (MVC, Moreton1995).

    Parameters:
        points: shape (n, 2), neighbours not the same; any unit of length.
        types: one letter for each point. An open path begins with `{`; its last letter stands for `}` whatever it is.
            A closed path ends with `z`, a letter more than there are points (or with a point that is left out).
        relax: where no spline without loops is found, take `c` for as few `o` as will do before one with loops is taken.

    Returns:
        The spline. It always has status and residual. Many sharp turns, or one beside a line, have no spline of these types
        (solutions end in folds): such a run, from a corner, line, anchor or end to the next, is relaxed; has loops; or is
        an Euler spiral spline (G²; beside a line G¹, or with a corner there). Status and message say which.

    Raises:
        InvalidInputError: shapes, values that are not finite, equal neighbours, unknown or misplaced letters.
        ConvergenceError: not even the Euler spiral spline was found.

    Accuracy:
        Residuals are below 1e-12 × the size of their terms; points are met to 1e-14 of the segment's length.
    Degenerate cases:
        Points on a line in order give the line. Between two lines a bracket is a corner. Where the polygon
        turns straight back (by π) it turns to the left.

    Example:
        >>> import numpy as np
        >>> a = np.linspace(0.0, 2.0 * np.pi, 6)[:-1]
        >>> ring = constrained_spline(np.stack([np.cos(a), np.sin(a)], axis=1), "ooooo" + "z")
        >>> ring.status, round(float(ring.lengths.sum() / (2.0 * np.pi)), 12)
        ('converged', 1.0)
        >>> constrained_spline([[0, 0], [1, 1], [2, 1], [3, 0], [4, 0]], "{o[]}").parameters.tolist()
        [4, 4, 0, 4]
    """
    path = read_knots(points, types)
    steps = _steps(path.knots, path.closed)
    chords = np.hypot(steps[:, 0], steps[:, 1])
    m = path.segments
    middle, lengths, angles = np.zeros((m, 4)), chords.copy(), np.zeros((m, 2))
    parameters = path.parameters()
    statuses: list[Status] = ["converged"] * m
    relaxed: list[int] = []
    residual, iterations, messages = 0.0, 0, []
    for run in runs(path):
        place = _place(run, path)
        made = solve_run(run, steps[run.segments], relax, place)
        where = run.segments
        middle[where], angles[where], parameters[where] = made.middle, made.angles, made.parameters
        lengths[where] = chords[where] / made.chord_of_length
        for i in where:
            statuses[i] = made.status
        relaxed += [int(run.knots[i]) for i in made.relaxed]
        residual, iterations = max(residual, made.residual), iterations + made.iterations
        if made.status != "converged":
            messages.append(_words(run, path, made, place))
    for array in (middle, chords, lengths, angles, parameters):
        array.setflags(write=False)
    return ConstrainedSpline(
        path.knots,
        path.letters,
        path.closed,
        parameters,
        middle,
        chords,
        lengths,
        angles,
        max(statuses, key=_WORSE.index),
        tuple(statuses),
        tuple(sorted(relaxed)),
        residual,
        iterations,
        "; ".join(messages),
    )


def _steps(knots: FloatArray, closed: bool) -> FloatArray:
    return np.diff(np.vstack([knots, knots[:1]]) if closed else knots, axis=0)


def _place(run: Run, path: KnotPath) -> str:
    first, last = path.places[run.segments[0]], path.places[(run.segments[-1] + 1) % len(path.places)]
    return "of this ring" if run.closed else f"between points {first} and {last}"


def _words(run: Run, path: KnotPath, made: SolvedRun, place: str) -> str:
    if made.status == "higher winding":
        worst = path.places[run.segments[int(made.loops.argmax())]]
        return (
            f"no spline {place} was found whose segments make no loop; in this one the segment after point {worst} does: "
            f"put a point between, or make one a corner"
        )
    advice = "put a point between, or make one c or a corner"
    if made.status == "relaxed":
        some = [str(path.places[run.knots[i]]) for i in made.relaxed[:6]] + ["…"] * (len(made.relaxed) > 6)
        return f"no spline with the types {place} was found; c was taken for o at points {', '.join(some)}: {advice}"
    return f"no spline with the types {place} was found; in its place are Euler spirals, joined {made.joined}: {advice}"
