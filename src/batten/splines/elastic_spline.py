"""Splines of elastica through points: what a rod does that is held there (Fisker2018 §5.1), exactly."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from batten.curves.base import Curve
from batten.curves.elastica import Elastica, states_at
from batten.curves.piecewise import PiecewiseCurve
from batten.errors import ConvergenceError, InvalidInputError, NoSolutionError
from batten.solvers.stability import margins
from batten.splines.joint_descent import Rest, RodPieces, descend
from batten.splines.spline_start import (
    DesignJoints,
    checked_points,
    clamped_pieces,
    design_joints,
    hermite_cubics,
    interpolating_cubic,
    shared_length,
)
from batten.typing import ArrayLike, BoolArray, FloatArray

_SNAPS = 20
_BALANCED = 1e-8  # of moments (times length) and forces (times its square) of a spline that counts as found


@dataclass(frozen=True, eq=False)
class ElasticSpline:
    """A rod through n points as n − 1 elastica, and how well it is in balance.

    Attributes:
        pieces: the elastica, in order. points: (n, 2). angles: (n,), tangent angles at the points.
        continuity: 1 or 2, what was asked for.
        energy: ∫κ² ds, 1/length (batten's convention, without the factor ½).
        couples: (n,), what the supports do to the rod, over EI: the jump of moment that each holds; at the ends the clamps'.
        reactions: (n, 2), the same for forces, 1/length²: what a support must push with, ∂(½∫κ² ds)/∂(point).
        position_error, angle_error: greatest miss of a point (in lengths of the spline) and of a tangent angle (radians).
        length_error: of the given length or lengths, relative to the whole; 0 where they are free.
        moment_residual: greatest jump of κ, times the length, where moments must balance.
        force_residual: greatest jump of ½κ² − force·tangent, times the square of the length, where the rod slides; for
            a free length its greatest value, which must be 0.
        stable: the energy is a strict minimum among rods that are held alike.
        iterations: steps of the descent. snaps: how often a piece of the start lost its hold on the way.
        status: "converged", or in words what is amiss.
    """

    pieces: tuple[Elastica, ...]
    points: FloatArray
    angles: FloatArray
    continuity: int
    energy: float
    couples: FloatArray
    reactions: FloatArray
    position_error: float
    angle_error: float
    length_error: float
    moment_residual: float
    force_residual: float
    stable: bool
    iterations: int
    snaps: int
    status: str

    @cached_property
    def curve(self) -> PiecewiseCurve:
        """The spline as one curve; piece i takes t ∈ [i/(n − 1), (i + 1)/(n − 1))."""
        return PiecewiseCurve(self.pieces)

    @property
    def lengths(self) -> FloatArray:
        """Arc lengths of the pieces, (n − 1,)."""
        return np.array([piece.length for piece in self.pieces])

    @property
    def length(self) -> float:
        """Arc length of the whole."""
        return float(self.lengths.sum())


def elastic_spline(
    points: ArrayLike,
    start_angle: float | None = None,
    end_angle: float | None = None,
    length: float | None = None,
    *,
    tangents: ArrayLike | None = None,
    lengths: ArrayLike | None = None,
    design: Curve | ElasticSpline | None = None,
    keep: bool = False,
) -> ElasticSpline:
    """The rod through points with the least bending energy in the basin of a design (Fisker2018 §5.1), of exact elastica.

    With `tangents`: a C¹ spline. Every piece is the clamped elastica of given length between two points and two tangents
    (§5.1.1); a length left free is the one where the energy is least.

    Without: a C² spline (§5.1.2), stationary for ∫κ² ds among curves through the points with these end tangents and this
    total length. How long each piece is, is not given: the rod slides through its supports. So at every inner support
    the tangent and the moment (κ) are continuous, the support pushes only across the rod, and ½κ² − force·tangent is the
    same on all pieces. With `lengths` the rod is pinned to the supports at marked places instead: then moments
    balance, and forces may jump in any direction. Without any length it is as long as its energy likes best.

    Unknown are the joints' angles and the pieces' lengths; each piece is the clamped elastica between them. The energy
    descends by Newton's method with exact derivatives in a trust region, so that the shape stays that of the start where
    that is possible.

    Parameters:
        points: (n, 2), n ≥ 2, any unit.
        start_angle, end_angle: tangent angles, radians, of a C² spline; None leaves the end without moment. The winding is
            that of the design; `angles` says what was reached.
        length: total length of a C² spline, above the sum of the chords; None leaves it free.
        tangents: (n,), tangent angles in radians of a C¹ spline, real numbers; with a design, its windings count.
        lengths: (n − 1,), lengths of the pieces, each above its chord.
        design: a curve with the shape that is wanted, made of n − 1 pieces (see `breaks`) or with its joints at
            t = i/(n − 1): the paper's cubic splines, a `PiecewiseCurve`, an earlier elastic spline. Left out: the
            cubic spline through the points, and for a C¹ spline of given lengths the shapes of least energy.
        keep: stop with an error where a piece of the design would lose its hold, as in Fig. 5.4, instead of letting it fall.
            A C¹ spline of given lengths does not move: there the stable pieces nearest to the design are taken.

    Returns:
        An `ElasticSpline` with `status` "converged".

    Raises:
        InvalidInputError: wrong shapes, values that are not finite, arguments that do not go together.
        NoSolutionError: a length below its chord; a free length that would grow without end.
        ConvergenceError: no shape of some piece was found to start with (give more length), or the descent ended
            outside a minimum: `best` is the spline there, with its residuals.

    Accuracy:
        Moments (times the length) and forces (times its square) balance to 1e-8 × (1 + energy × length) or an error is
        raised; 1e-11 is usual, points and angles are met to 1e-12. Pieces much stiffer than √λ·length = 15 lose digits,
        since an elastica is stored by its start.
    Degenerate cases:
        A design that is symmetric may be a saddle of the energy; it is left downwards, and the spline is not symmetric then.
        All points on a line with a total length above it: the straight rod buckles, which way the design says. A total
        length equal to the chords' sum is refused: that rod is a polyline.

    Example:
        >>> spline = elastic_spline([(0, 0), (1, 0.5), (2, 0)], 0.8, -0.8, 2.4)
        >>> spline.status, spline.stable, bool(spline.moment_residual < 1e-9)
        ('converged', True, True)
        >>> tangent = np.array([np.cos(spline.angles[1]), np.sin(spline.angles[1])])
        >>> bool(abs(spline.reactions[1] @ tangent) < 1e-9)  # the middle support pushes across the rod only
        True
    """
    p = checked_points(points)
    m = len(p) - 1
    given = None if lengths is None else _numbers(lengths, (m,), "lengths")
    chords = np.hypot(*np.diff(p, axis=0).T)
    if tangents is not None:
        if not (start_angle is None and end_angle is None and length is None):
            raise InvalidInputError("with tangents, give lengths of the pieces, no end angles and no total length")
        wanted = _numbers(tangents, (m + 1,), "tangents")
        held = np.ones(m + 1, dtype=bool)
    else:
        if length is not None and given is not None:
            raise InvalidInputError("give the total length or the lengths of the pieces, not both")
        ends = [0.0 if a is None else float(a) for a in (start_angle, end_angle)]
        if not np.isfinite(ends).all():
            raise InvalidInputError(f"end angles are finite numbers of radians or None; got {start_angle}, {end_angle}")
        wanted = np.concatenate([ends[:1], np.zeros(m - 1), ends[1:]])
        held = np.zeros(m + 1, dtype=bool)
        held[0], held[-1] = start_angle is not None, end_angle is not None
    total = None if length is None else float(length)
    _check_lengths(chords, given, total)
    joints = _joints(p, wanted, held, design)
    least = tangents is not None and design is None
    angles = wanted if least else np.where(held, _wound(wanted, joints.angles), joints.angles)
    if given is not None:
        begin, rule = given, "held"
    elif total is not None:
        begin, rule = shared_length(joints.lengths, chords, total), "total"
    else:
        begin, rule = np.maximum(joints.lengths, chords * 1.001), "free"
    size, origin = float(begin.sum()), p[0].copy()
    turns = 2.0 * np.pi * np.round((angles[0] - joints.angles[0]) / (2.0 * np.pi))
    headings = None if least and given is not None else joints.headings + turns
    start = clamped_pieces((p - origin) / size, angles, begin / size, headings)
    rest = descend(start, ~held, rule, 0 if keep else _SNAPS)
    spline = _spline(rest, p, size, wanted, held, given, total, rule, 2 if tangents is None else 1)
    _complain(spline, chords)
    return spline


def _joints(p: FloatArray, wanted: FloatArray, held: BoolArray, design: Curve | ElasticSpline | None) -> DesignJoints:
    curve: Curve
    if isinstance(design, ElasticSpline):
        curve = design.curve
    elif design is not None:
        curve = design
    elif held.all() and len(p) > 2:
        curve = hermite_cubics(p, wanted)
    else:
        curve = interpolating_cubic(p, *(float(wanted[i]) if held[i] else None for i in (0, -1)))
    return design_joints(curve, len(p) - 1)


def _numbers(values: ArrayLike, shape: tuple[int, ...], name: str) -> FloatArray:
    try:
        out = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"{name} are numbers of shape {shape}; got {values!r}") from error
    if out.shape != shape or not np.isfinite(out).all():
        raise InvalidInputError(f"{name} have shape {shape} for these points, all finite; got shape {out.shape}")
    return out


def _check_lengths(chords: FloatArray, lengths: FloatArray | None, total: float | None) -> None:
    if lengths is not None and not (lengths > chords * (1.0 + 1e-9)).all():
        i = int(np.argmin(lengths / chords))
        raise NoSolutionError(
            f"piece {i} is {lengths[i]:.9g} long, and its points are {chords[i]:.9g} apart; every length must exceed that"
        )
    if total is None:
        return
    if not np.isfinite(total):
        raise InvalidInputError(f"the length is a finite number or None; got {total}")
    if not total > chords.sum() * (1.0 + 1e-9):
        raise NoSolutionError(
            f"the rod is {total:.9g} long, and the straight way through its points {chords.sum():.9g}; it must be longer"
        )


def _wound(wanted: FloatArray, angles: FloatArray) -> FloatArray:
    """The angles wanted, each with the multiple of 2π that is nearest to the design's."""
    return np.asarray(wanted + 2.0 * np.pi * np.round((angles - wanted) / (2.0 * np.pi)))


def _spline(
    rest: Rest, p: FloatArray, size: float, wanted: FloatArray, held: BoolArray, lengths: FloatArray | None,
    total: float | None, rule: str, continuity: int,
) -> ElasticSpline:  # fmt: skip
    """Back in the units that came, with everything measured on the pieces as they are returned."""
    parameters = rest.pieces.parameters * size ** np.array([1.0, 1.0, 0.0, -1.0, -2.0, -2.0, 1.0])
    parameters[:, :2] = p[:-1]
    pieces = tuple(Elastica.from_parameters(row) for row in parameters)
    length = float(parameters[:, 6].sum())
    ends = states_at(parameters, parameters[:, 6])
    force = parameters[:, 4:6]
    starts, stops = np.append(parameters[:, 3], 0.0), np.append(0.0, ends[:, 3])
    couples = stops - starts
    slips = RodPieces.of(p, rest.pieces.angles, parameters).slips
    slip = {"held": np.zeros(1), "total": np.diff(slips), "free": slips}[rule]
    angle_jumps = np.append(parameters[1:, 2], rest.pieces.angles[-1]) - ends[:, 2]
    turned = np.where(held, rest.pieces.angles - wanted, 0.0)
    errors = np.abs(np.concatenate([angle_jumps, turned - 2.0 * np.pi * np.round(turned / (2.0 * np.pi))]))
    length_error = 0.0
    if lengths is not None:
        length_error = float(np.abs(parameters[:, 6] - lengths).max()) / length
    elif total is not None:
        length_error = abs(length - total) / length
    return ElasticSpline(
        pieces=pieces,
        points=p,
        angles=rest.pieces.angles,
        continuity=continuity,
        energy=float(sum(piece.bending_energy() for piece in pieces)),
        couples=couples,
        reactions=np.concatenate([force[:1], np.diff(force, axis=0), -force[-1:]]),
        position_error=float(np.hypot(*(ends[:, :2] - p[1:]).T).max()) / length,
        angle_error=float(errors.max()),
        length_error=length_error,
        moment_residual=float(np.abs(couples[~held]).max(initial=0.0)) * length,
        force_residual=float(np.abs(slip).max(initial=0.0)) * length**2,
        stable=bool(rest.curvature > 0.0 and (margins(parameters) > 1.0).all()),
        iterations=rest.iterations,
        snaps=rest.snaps,
        status=rest.status,
    )


def _complain(spline: ElasticSpline, chords: FloatArray) -> None:
    if spline.status == "endless":
        raise NoSolutionError(
            f"the energy falls without end while the rod grows (to {spline.length:.3g} over {chords.sum():.3g}); "
            "no length is best: give one, or turn the tangents less"
        )
    residual = max(spline.moment_residual, spline.force_residual)
    if spline.status == "converged" and residual <= _BALANCED * (1.0 + spline.energy * spline.length):
        return
    hint = {
        "a piece would lose its hold": "the design's shape cannot be kept; with keep=False it falls to another one",
        "converged": "the rod is too stiff for its digits; give more length",
    }.get(spline.status, "give more length, or a design nearer to the rod")
    raise ConvergenceError(
        f"the elastic spline ended out of balance by {residual:.3g} ({spline.status}); {hint}",
        best=spline,
        residual=residual,
        iterations=spline.iterations,
    )
