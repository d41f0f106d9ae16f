"""From a cubic or numerical elastic spline to elastica pieces: the analytic description of Fisker2018 §5.3."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np

from batten.curves.base import Curve
from batten.curves.elastica import Elastica, states_along, states_at
from batten.curves.piecewise import PiecewiseCurve
from batten.errors import ConvergenceError, InvalidInputError
from batten.kernels.analytic_description import describe_batch
from batten.kernels.elastica_fit_batch import guess_batch
from batten.solvers.boundary_value import in_threads
from batten.solvers.curve_samples import CurveSamples, samples_of
from batten.solvers.elastica_fit import fit_samples
from batten.typing import ArrayLike, BoolArray, FloatArray, IntArray

Continuity = Literal[0, 1, 2]

STATUS = ("converged", "pieces not joined", "bad input")
"""What the status of a spline of `AnalyticDescriptions` means, by its number."""

#: Jumps of position, in lengths of the spline, and angle: above the first a spline is begun again, above the second it is
#: called not joined.
_JOINED, _APART = 1e-11, 1e-9


@dataclass(frozen=True, eq=False)
class AnalyticDescriptions:
    """Elastica for m splines of c pieces each.

    Attributes:
        parameters: (m, c, 7), as `Elastica.parameters`; NaN where the status is "bad input".
        distance: (m,), (∫‖γ − γₑ‖² ds / L³)^½ over the whole spline, points compared at equal fractions of each piece.
        position_jump, angle_jump, curvature_jump: (m,), greatest at a joint, of the pieces as they are returned; lengths
            and curvatures relative to the length of the spline.
        lambda_residual: (m, c), of the given pieces (R₁ of their first guesses).
        iterations: (m,). status: (m,), index into `STATUS`.
    """

    parameters: FloatArray
    distance: FloatArray
    position_jump: FloatArray
    angle_jump: FloatArray
    curvature_jump: FloatArray
    lambda_residual: FloatArray
    iterations: IntArray
    status: IntArray


@dataclass(frozen=True, eq=False)
class AnalyticDescription:
    """Elastica for one spline; attributes as in `AnalyticDescriptions`, status in words."""

    pieces: tuple[Elastica, ...]
    continuity: int
    distance: float
    position_jump: float
    angle_jump: float
    curvature_jump: float
    lambda_residual: FloatArray
    iterations: int
    status: str

    @cached_property
    def curve(self) -> PiecewiseCurve:
        """The pieces as one curve."""
        return PiecewiseCurve(self.pieces)


def analytic_description(
    spline: Curve, pieces: int | None = None, continuity: Continuity = 1, *, nodes: int = 24
) -> AnalyticDescription:
    """The elastica pieces of a spline that is nearly an elastic one (Fisker2018 §5.3).

    C⁰: the first guess of each piece (§2.1.1), scaled and turned onto its end points. C¹ and C²: from there the sum of
    ∫‖γ − γₑ‖² ds over the pieces is minimised subject to a common point and tangent, and curvature, at each joint. Joints
    and ends are free to move with the fit.

    Parameters:
        spline: a smooth curve, such as `NumericalElasticSpline.curve` or a cubic spline.
        pieces: how many elastica, at joints t = i/pieces, which must be breaks of the spline or between them; None takes one
            for each smooth piece (see `breaks`).
        continuity: 0, 1 or 2.
        nodes: Gauss nodes on each piece.

    Returns:
        An `AnalyticDescription` with status "converged".

    Raises:
        InvalidInputError: not a curve, another continuity, a spline without length.
        ConvergenceError: the pieces could not be joined; `best` holds the last ones.

    Accuracy: jumps of position and angle below 1e-11, with great forces 1e-9; the squared distance is within 1e-8,
        relatively, of a local minimum's. For exact elastic splines the pieces come back with a distance of 1e-9 and less.
    Degenerate cases: a sharp piece comes ever nearer while its force grows without end, and hangs on its last digits then.
        Splines that are not joined at once are begun again from pieces that hold the joints' tangents; forces then weigh
        beside the squared distance, by 1e-5 to 1e-10 times their square, mean length 1, as little as will do, and
        curvatures are closed little by little. That moves the other pieces a little, too. What is not joined even so has
        a status. Lines and circles are members. A piece whose ends coincide is not scaled for C⁰, and has a jump there.

    Example:
        >>> from batten.curves.bspline import BSplineCurve
        >>> wave = BSplineCurve.interpolate([(0, 0), (1, 0.3), (2, 0.1), (3, 0.3)])
        >>> found = analytic_description(wave, 3)
        >>> found.status, bool(found.distance < 5e-3), bool(found.angle_jump < 1e-11)
        ('converged', True, True)
    """
    if not isinstance(spline, Curve):
        raise InvalidInputError(f"a spline to describe is a curve; got {type(spline).__name__}")
    breaks = np.asarray(spline.breaks(), dtype=np.float64)
    count = len(breaks) - 1 if pieces is None else pieces
    if not (isinstance(count, int | np.integer) and count >= 1):
        raise InvalidInputError(f"pieces is a whole number from 1 on, or None; got {pieces!r}")
    edges = breaks if pieces is None else np.linspace(0.0, 1.0, count + 1)
    parts = [samples_of(_Part(spline, float(a), float(b), breaks), nodes=nodes)[0] for a, b in pairwise(edges)]
    width = max(part.points.shape[1] for part in parts)
    samples = CurveSamples(*(
        np.concatenate([_padded(getattr(part, name), width, name) for part in parts])
        for name in CurveSamples.__dataclass_fields__
    ))  # fmt: skip
    found = _described(samples, 1, int(count), continuity, 1)
    status = int(found.status[0])
    if status == 2:
        raise InvalidInputError(
            "the spline has no length in one of its pieces, or is not finite; no elastica follows it"
        )
    result = AnalyticDescription(
        tuple(Elastica.from_parameters(row) for row in found.parameters[0]), continuity, float(found.distance[0]),
        float(found.position_jump[0]), float(found.angle_jump[0]), float(found.curvature_jump[0]),
        found.lambda_residual[0], int(found.iterations[0]), STATUS[status],
    )  # fmt: skip
    if status == 1:
        raise ConvergenceError(
            f"the pieces could not be joined to C{continuity} (an angle of {result.angle_jump:.3g} rad is left); take more "
            "pieces, or a spline nearer to an elastic one",
            best=result,
            residual=max(result.position_jump, result.angle_jump),
            iterations=result.iterations,
        )
    return result


def analytic_descriptions(
    control_points: ArrayLike, continuity: Continuity = 1, *, nodes: int = 16, workers: int | None = None
) -> AnalyticDescriptions:
    """`analytic_description` for the leaves of a foliation, each started from the one before (Fisker2018 §5.3).

    A leaf begins with the shapes of its neighbour, scaled and turned onto its own joints, and if that ends much farther
    from it than the neighbour's did, with its own first guesses too. Every 256th leaf begins with its own in any case, so
    that the answer does not depend on the number of threads.

    Parameters:
        control_points: (m, c, 4, 2): m splines of c cubic Béziers each, in the order of the foliation.
        continuity: 0, 1 or 2. nodes: Gauss nodes on each piece. workers: threads, by default one for each core.

    Returns:
        `AnalyticDescriptions`; a bad spline gets a status and NaN, the others go on.

    Raises:
        InvalidInputError: another shape or continuity.

    Example:
        >>> wave = np.array([[(0, 0), (1, 0.5), (2, 0.5), (3, 0)], [(3, 0), (4, -0.5), (5, -0.5), (6, 0)]])
        >>> found = analytic_descriptions([wave, wave + 0.01, np.full((2, 4, 2), np.nan)], 2)
        >>> found.status.tolist(), bool(found.curvature_jump[:2].max() < 1e-9)
        ([0, 0, 2], True)
    """
    control = np.asarray(control_points, dtype=np.float64)
    if control.ndim != 4 or control.shape[2:] != (4, 2) or 0 in control.shape:
        raise InvalidInputError(
            f"splines of c cubic Béziers come as control points (m, c, 4, 2); got shape {control.shape}"
        )
    m, c = control.shape[:2]
    return _described(samples_of(control.reshape(m * c, 4, 2), nodes=nodes)[0], m, c, continuity, workers)


class _Part:
    """The piece of a curve between two parameters."""

    def __init__(self, curve: Curve, first: float, last: float, breaks: FloatArray) -> None:
        self.curve, self.first, self.width = curve, first, last - first
        inside = breaks[(breaks > first + 1e-9) & (breaks < last - 1e-9)]
        self.edges = np.concatenate([[0.0], (inside - first) / self.width, [1.0]])
        self.length = np.nan  # not asked for here

    def point(self, t: ArrayLike) -> FloatArray:
        return self.curve.point(self.first + self.width * np.asarray(t, dtype=np.float64))

    def derivative(self, t: ArrayLike, order: int = 1) -> FloatArray:
        # a hair inside: at a joint the derivative is that of the piece behind
        inner = np.clip(np.asarray(t, dtype=np.float64), 1e-12, 1.0 - 1e-12)
        return self.curve.derivative(self.first + self.width * inner, order) * self.width**order

    def breaks(self) -> FloatArray:
        return self.edges


def _padded(values: FloatArray, width: int, name: str) -> FloatArray:
    """Samples (1, n, …) filled up to `width` with the last one, which gets no more weight by that."""
    if name in ("lengths", "ends") or values.shape[1] == width:
        return values
    last = np.zeros_like(values[:, -1:]) if name == "weights" else values[:, -1:]
    return np.concatenate([values, np.repeat(last, width - values.shape[1], axis=1)], axis=1)


def _described(samples: CurveSamples, m: int, c: int, continuity: int, workers: int | None) -> AnalyticDescriptions:
    if continuity not in (0, 1, 2):
        raise InvalidInputError(f"continuity is 0, 1 or 2; got {continuity!r}")
    guesses, residual = _guesses(samples, m, c)
    points, weights = samples.points.reshape(m, c, -1, 2), samples.weights.reshape(m, c, -1)
    fractions, ends = (
        samples.fractions.reshape(m, c, -1),
        np.ascontiguousarray(samples.ends[:, :, :2]).reshape(m, c, 2, 2),
    )
    parameters, info, status = guesses.copy(), np.zeros((m, 3)), np.zeros(m, dtype=np.int64)
    if continuity == 0:
        status[~np.isfinite(guesses).all(axis=(1, 2))] = 2
        parameters[status == 2] = np.nan
        info[:, 0] = _distances(parameters, points, weights, fractions)
    else:

        def work(part: slice) -> None:
            describe_batch(points[part], weights[part], fractions[part], ends[part], guesses[part], 2 + continuity, False,
                           parameters[part], info[part], status[part])  # fmt: skip

        in_threads(work, m, workers)
        parameters[..., :4] = states_at(parameters, -0.5 * parameters[..., 6])
        apart = (status == 1) | ((status == 0) & (_jumps(parameters)[:, :2].max(axis=1) > _JOINED))
        for row in np.flatnonzero(apart).tolist():
            one = slice(row, row + 1)
            begin, again = _held(samples, row, c, guesses[one]), np.empty((1, c, 7))
            more, joined = np.zeros((1, 3)), np.zeros(1, dtype=np.int64)
            describe_batch(
                points[one], weights[one], fractions[one], ends[one], begin, 2 + continuity, True, again, more, joined
            )
            more[:, 1] += info[one, 1]
            if joined[0] == 0:
                again[..., :4] = states_at(again, -0.5 * again[..., 6])
                parameters[one], info[one], status[one] = again, more, joined
    jumps = _jumps(parameters)
    if continuity > 0:
        status[(status == 0) & (jumps[:, :2].max(axis=1) > _APART)] = 1
    return AnalyticDescriptions(
        parameters, info[:, 0], jumps[:, 0], jumps[:, 1], jumps[:, 2], residual, info[:, 1].astype(np.int64), status,
    )  # fmt: skip


def _jumps(parameters: FloatArray) -> FloatArray:
    """Greatest jumps of position, angle and curvature at a joint of each spline, (m, 3), relative to its length."""
    tips, size = states_at(parameters, parameters[..., 6]), parameters[..., 6].sum(axis=1)
    jumps = tips[:, :-1] - parameters[:, 1:, :4]
    if not jumps.shape[1]:
        return np.zeros((len(parameters), 3))
    worst = np.abs(jumps).max(axis=1)
    return np.stack(
        [np.hypot(jumps[..., 0], jumps[..., 1]).max(axis=1) / size, worst[:, 2], worst[:, 3] * size], axis=1
    )


def _guesses(samples: CurveSamples, m: int, c: int) -> tuple[FloatArray, FloatArray]:
    """First guesses scaled and turned onto their end points, (m, c, 7), their angles continuous; and R₁, (m, c)."""
    b = len(samples)
    parameters, info, status = np.empty((b, 7)), np.empty((b, 4)), np.empty(b, dtype=np.int64)
    guess_batch(
        samples.points, samples.angles, samples.curvatures, samples.weights, samples.fractions, samples.lengths,
        samples.ends, parameters, info, status,
    )  # fmt: skip
    bad = status == 3
    if bad.any():  # a guess may fail where a circle's arc between the ends still does
        parameters[bad] = _arcs(samples, bad)
    own = states_at(parameters, parameters[:, 6])[:, :2] - parameters[:, :2]
    wanted = samples.ends[:, 1, :2] - samples.ends[:, 0, :2]
    z, w = own @ np.array([1.0, 1.0j]), wanted @ np.array([1.0, 1.0j])
    with np.errstate(all="ignore"):
        factor = np.where(np.abs(z) > 1e-6 * parameters[:, 6], w / z, 1.0)
    scale, turn = np.abs(factor), np.angle(factor)
    scale = np.where(scale > 0.0, scale, 1.0)
    force = (parameters[:, 4] + 1j * parameters[:, 5]) * np.exp(1j * turn) / scale**2
    parameters[:, :2] = samples.ends[:, 0, :2]
    parameters[:, 2] += turn
    parameters[:, 3] /= scale
    parameters[:, 4], parameters[:, 5] = force.real, force.imag
    parameters[:, 6] *= scale
    return _unwound(parameters.reshape(m, c, 7)), info[:, 0].reshape(m, c)


def _held(samples: CurveSamples, row: int, c: int, guesses: FloatArray) -> FloatArray:
    """The pieces of one spline of least distance that hold its joints and tangents, (1, c, 7): joined from the first.

    A force of 100 over a length squared weighs as much as a distance of 0.01 lengths.
    """
    part = CurveSamples(*(getattr(samples, name)[row * c : row * c + c] for name in CurveSamples.__dataclass_fields__))
    found = fit_samples(part, ends="tangents", starts=4, force_weight=1e-8).parameters[None]
    return _unwound(np.where(np.isfinite(found).all(axis=2, keepdims=True), found, guesses))


def _unwound(rows: FloatArray) -> FloatArray:
    """Pieces (m, c, 7) with their angles continuous."""
    last = states_at(rows, rows[..., 6])[..., 2]
    turns = np.round((last[:, :-1] - rows[:, 1:, 2]) / (2.0 * np.pi))
    rows[:, 1:, 2] += 2.0 * np.pi * np.cumsum(turns, axis=1)
    return rows


def _arcs(samples: CurveSamples, which: BoolArray) -> FloatArray:
    """Circles of the mean curvature, for pieces without a guess."""
    out = np.zeros((int(which.sum()), 7))
    ends, lengths = samples.ends[which], samples.lengths[which]
    out[:, :3] = ends[:, 0]
    with np.errstate(all="ignore"):
        out[:, 3] = (ends[:, 1, 2] - ends[:, 0, 2]) / lengths
    out[:, 6] = lengths
    return out


def _distances(parameters: FloatArray, points: FloatArray, weights: FloatArray, fractions: FloatArray) -> FloatArray:
    """(∫‖γ − γₑ‖² ds / L³)^½ of rows of pieces."""
    on = states_along(parameters, fractions * parameters[..., 6:])[..., :2]
    total = (weights * ((on - points) ** 2).sum(axis=-1)).sum(axis=(1, 2))
    return np.asarray(np.sqrt(total / weights.sum(axis=(1, 2)) ** 3))
