"""A surface through design splines, looked through for isocurves that no rod follows, and put right by further splines."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from batten.curves.bspline import BSplineCurve
from batten.curves.cubic_proxy import CubicProxy
from batten.errors import InvalidInputError, NoSolutionError
from batten.measures.lambda_class import BEST_BELOW
from batten.measures.lambda_residual import lambda_residual
from batten.solvers.bezier_projection import project_bezier
from batten.splines.design_limits import DesignLimits
from batten.splines.limit_repair import repaired
from batten.surfaces.bspline_basis import basis_functions
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.isocurves import IsocurveResiduals, isocurve_residuals
from batten.surfaces.loft import loft
from batten.typing import FloatArray

_SAME_PLANE = 1e-9  # of the way from the first plane to the last
_BESIDE = 1.0 / 24.0  # of the way from the first plane to the last
_ANY_ANGLE = 6.3  # radians: no limit on the angle error
_FARTHEST = 0.5  # of the mean chord of the pieces: a control point that goes farther is not what was drawn
_LOWER = 0.6  # what the aim is multiplied by when a spline that was offered before is offered again


@dataclass(frozen=True, eq=False)
class DesignSurface:
    """The cubic interpolation, not-a-knot, of planar cubic splines with equally many pieces (Fisker2018 §5.4.2).

    Every isocurve between them is such a spline, too: its control points are those of the design splines in the weights of
    the interpolation, which sum to 1, so that its joints stay on borders that all of them share.

    Parameters:
        splines: n ≥ 2, in the coordinates (along the blade, up), all of the same number of pieces and the same continuity.
        positions: (n,), coordinates of their planes across the blade, strictly ascending.
        blade_axis: wall axis along the splines.

    Raises:
        InvalidInputError: something that is not a `CubicProxy`, splines that differ in pieces or continuity; as `loft`.

    Accuracy: the surface holds each spline to 1e-13 of its size.

    Example:
        >>> flat = CubicProxy([(0, 0), (1, 1), (2, 1.5), (4, 1.5), (5, 1), (6, 0)])
        >>> tall = CubicProxy([(0, 0), (1, 2), (2, 3), (4, 3), (5, 2), (6, 0)])
        >>> design = DesignSurface([flat, tall], [0.0, 4.0])
        >>> design.surface.point(0.5, 4.0).tolist()
        [3.0, 4.0, 3.0]
        >>> design.spline_at(2.0).control_points[1].tolist()
        [1.0, 1.5]
    """

    splines: tuple[CubicProxy, ...]
    positions: FloatArray
    blade_axis: Literal["x", "y"] = "x"

    def __post_init__(self) -> None:
        splines = tuple(self.splines)
        if not all(isinstance(spline, CubicProxy) for spline in splines):
            raise InvalidInputError(
                "design splines are CubicProxy objects; CubicProxy.from_beziers makes them of cubics"
            )
        kinds = sorted({(spline.piece_count, spline.continuity) for spline in splines})
        if len(kinds) > 1:
            raise InvalidInputError(
                "design splines have all the same number of pieces and the same continuity; got "
                + ", ".join(f"{pieces} pieces of class C{continuity}" for pieces, continuity in kinds)
            )
        positions = np.array(self.positions, dtype=np.float64)
        positions.setflags(write=False)
        object.__setattr__(self, "splines", splines)
        object.__setattr__(self, "positions", positions)
        _ = self.surface  # what is wrong with the planes is told now

    @cached_property
    def surface(self) -> BSplineSurface:
        """S(u, v), u ∈ [0, 1] along the splines, v the coordinate across the blade: see `loft`."""
        return loft([spline_curve(s) for s in self.splines], self.positions, blade_axis=self.blade_axis)

    def spline_at(self, position: float) -> CubicProxy:
        """The isocurve in the plane at a position, with the borders that all design splines share.

        Raises:
            InvalidInputError: a position outside the planes of the design.
        """
        surface = self.surface
        low, high = surface.domain[1]
        if not low <= position <= high:
            raise InvalidInputError(f"isocurves lie at {low} … {high} across the blade; got {position}")
        first, values = basis_functions(surface.knots_v, surface.degree_v, np.array([float(position)]), 0)
        across = surface.control_points[:, first[0] + np.arange(surface.degree_v + 1)]
        along = 0 if self.blade_axis == "x" else 1
        control = np.einsum("q,nqd->nd", values[0, :, 0], across)[:, [along, 2]]
        spline = self.splines[0]
        borders = None
        if all(s.borders is not None for s in self.splines):
            rows = zip(*(s.borders for s in self.splines if s.borders is not None))
            borders = tuple(row[0] if all(b == row[0] for b in row) else None for row in rows)
        return CubicProxy(control, spline.continuity, borders)

    def with_spline(self, position: float, spline: CubicProxy) -> DesignSurface:
        """The design with one more spline; one that is in the same plane already is replaced.

        Raises:
            InvalidInputError: as the constructor.
        """
        apart = np.abs(self.positions - position) > _SAME_PLANE * np.ptp(self.positions)
        kept = [(p, s) for p, s, other in zip(self.positions.tolist(), self.splines, apart) if other]
        rows = sorted([*kept, (float(position), spline)], key=lambda row: row[0])
        return DesignSurface(tuple(s for _, s in rows), np.array([p for p, _ in rows]), self.blade_axis)

    def residuals(self, count: int = 49) -> IsocurveResiduals:
        """`isocurve_residuals` of `count` ≥ 2 isocurves at even distances and of the design splines."""
        if not (isinstance(count, int | np.integer) and count >= 2):
            raise InvalidInputError(f"isocurves are a whole number from 2 on; got {count!r}")
        low, high = self.surface.domain[1]
        even = np.linspace(low, high, count)
        far = np.abs(even[:, None] - self.positions).min(axis=1) > _SAME_PLANE * (high - low)
        return isocurve_residuals(self.surface, np.sort(np.concatenate([even[far], self.positions])))

    def offered(self, position: float, threshold: float = BEST_BELOW) -> CubicProxy:
        """The isocurve at a position as a new design spline: itself if its pieces are below the threshold, else projected.

        Raises:
            InvalidInputError: as `spline_at`; a threshold outside (0, 1].
            NoSolutionError: no spline near to it was found.
        """
        return elastica_like(self.spline_at(position), threshold)


@dataclass(frozen=True)
class RectificationRound:
    """One isocurve that was offered as a design spline, and taken.

    Attributes:
        position: of its plane. replaced: whether a design spline was there, or next to it, and gave way.
        residual_before, residual_after: greatest e_λ of its pieces as it was, and as it was offered.
        moved: how far a control point went, at most.
        above_before, above_after: how many isocurves were not below the threshold, before and with it.
        worst_after: the greatest e_λ of all isocurves with it.
    """

    position: float
    replaced: bool
    residual_before: float
    residual_after: float
    moved: float
    above_before: int
    above_after: int
    worst_after: float


@dataclass(frozen=True, eq=False)
class Rectification:
    """What `rectified` returns.

    Attributes:
        design: the surface with all splines that were added.
        history: one entry for each round.
        residuals: of the isocurves in the end.
        status: "below the threshold", "round limit", or "no spline to offer": the worst isocurve could not be projected.
    """

    design: DesignSurface
    history: tuple[RectificationRound, ...]
    residuals: IsocurveResiduals
    status: Literal["below the threshold", "round limit", "no spline to offer"]


def rectified(
    design: DesignSurface, threshold: float = BEST_BELOW, *, count: int = 481, rounds: int = 24
) -> Rectification:
    """Make the worst isocurve a design spline, projected, until all isocurves are below a threshold (Fisker2018 §5.4.2).

    The thesis offers the violating isocurve to the designer; here the offer is taken each time. Where a design spline is
    nearer to the worst isocurve than a twenty-fourth of the way across, that spline is projected again, to a lower value
    each time, instead of a second one beside it, which would make the surface wavy.

    Parameters:
        design: the surface as drawn.
        threshold: what e_λ of every piece has to be below, in (0, 1].
        count: how many isocurves are looked at, from 2; peaks can be narrow, and each takes a microsecond.
        rounds: how many splines are added or replaced at most.

    Returns:
        `Rectification`, whatever was reached; the history says what was done.

    Raises:
        InvalidInputError: a threshold, count or number of rounds out of range.

    Accuracy: holds for the isocurves that were looked at. Design splines stay as drawn unless they break the threshold
    themselves, or their neighbours do.

    Example:
        >>> one = CubicProxy([(0, 0), (0.6, 0.8), (1.4, 1.2), (2.6, 1.2), (3.4, 0.8), (4, 0)])
        >>> two = CubicProxy([(0, 0), (0.9, -0.6), (1.9, -0.9), (2.1, 0.9), (3.1, 0.6), (4, 0)])
        >>> found = rectified(DesignSurface([one, two], [0.0, 2.0]), 0.15)
        >>> found.status, bool(found.residuals.worst < 0.15)
        ('below the threshold', True)
    """
    if not (isinstance(rounds, int | np.integer) and rounds >= 0):
        raise InvalidInputError(f"rounds is a whole number from 0 on; got {rounds!r}")
    _ = DesignLimits(residual_below=threshold)
    found, history, times = design.residuals(count), list[RectificationRound](), dict[float, int]()
    gap = _BESIDE * float(np.ptp(design.positions))
    while found.above(threshold).any():
        if len(history) == rounds:
            return Rectification(design, tuple(history), found, "round limit")
        position = found.worst_position
        nearest = float(design.positions[np.argmin(np.abs(design.positions - position))])
        replaced = abs(nearest - position) < gap
        position = nearest if replaced else position
        aim = threshold * _LOWER ** times.get(position, 0)
        if replaced and position not in times and position != found.worst_position:
            aim *= _LOWER  # it may be below the threshold itself
        times[position] = times.get(position, 0) + 1
        before = design.spline_at(position)
        try:
            offered = elastica_like(before, aim)
        except NoSolutionError:
            return Rectification(design, tuple(history), found, "no spline to offer")
        above = int(found.above(threshold).sum())
        design = design.with_spline(position, offered)
        found = design.residuals(count)
        history.append(
            RectificationRound(
                position, replaced, _worst(before), _worst(offered),
                _moved(before, offered),
                above, int(found.above(threshold).sum()), found.worst,
            )
        )  # fmt: skip
    return Rectification(design, tuple(history), found, "below the threshold")


def elastica_like(spline: CubicProxy, threshold: float = BEST_BELOW) -> CubicProxy:
    """A spline near to a given one whose pieces are all below a threshold; itself if it is one.

    The spline is moved by `limit_repair.repaired`, ends and borders held, first with the angle error of §5.2 below 6°, then
    with any. Where that finds none, its pieces are projected one by one (`project_bezier`, "nearest") and the spline
    nearest to them is moved.

    Parameters:
        spline: of class C¹ or C². threshold: of e_λ, in (0, 1].

    Raises:
        InvalidInputError: a threshold out of range.
        NoSolutionError: no such spline was found.

    Accuracy: near, not nearest: see `limit_repair.repaired`.

    Example:
        >>> lean = CubicProxy([(0, 0), (0.2, 1.6), (0.4, 1.8), (3.6, 1.8), (3.8, 1.6), (4, 0)])
        >>> better = elastica_like(lean, 0.1)
        >>> [round(float(lambda_residual(spline.pieces).max()), 1) for spline in (lean, better)]
        [0.3, 0.1]
        >>> better.joints.round(2).tolist()
        [[0.0, 0.0], [2.0, 1.94], [4.0, 0.0]]
    """
    limits, any_angle = (DesignLimits(threshold), DesignLimits(threshold, _ANY_ANGLE))
    if _worst(spline) < threshold:
        return spline
    pieces = np.arange(spline.piece_count)
    for allowed in (limits, any_angle):
        better = repaired(spline, pieces, allowed)
        if better is not None:
            return better
    rows = project_bezier(spline.pieces, "nearest", threshold=0.9 * threshold, keep="points").control_points
    if np.isfinite(rows).all():
        near = CubicProxy.from_beziers(rows, spline.continuity)
        near = near if spline.borders is None else near.with_borders(spline.borders)
        better = near if _worst(near) < threshold else repaired(near, pieces, any_angle)
        chord = float(np.linalg.norm(np.diff(spline.joints, axis=0), axis=1).mean())
        if better is not None and _moved(spline, better) <= _FARTHEST * chord:
            return better
    raise NoSolutionError(
        f"no spline with λ-residuals below {threshold:.3g} was found near to one with {_worst(spline):.3g}; draw it anew, "
        "or change its neighbours"
    )


def spline_curve(spline: CubicProxy) -> BSplineCurve:
    """The same spline as a B-spline curve: knots doubled for C¹, single for C²; control points as they are."""
    n = spline.piece_count
    inner = np.repeat(np.arange(1.0, n), 3 - spline.continuity)
    knots = np.concatenate([np.zeros(4), inner, np.full(4, float(n))])
    return BSplineCurve(knots, spline.control_points, 3)


def _moved(one: CubicProxy, other: CubicProxy) -> float:
    """How far a control point is from its place in the other spline, at most."""
    return float(np.linalg.norm(other.control_points - one.control_points, axis=1).max())


def _worst(spline: CubicProxy) -> float:
    """The greatest e_λ of its pieces; infinite where one has no length."""
    return float(np.nan_to_num(lambda_residual(spline.pieces), nan=np.inf).max())
