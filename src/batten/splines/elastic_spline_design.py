"""The design of an elastic spline through its cubic proxy: what a studio, a plug-in or a script drives."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np

from batten.curves.cubic_proxy import Border, CubicProxy
from batten.errors import InvalidInputError
from batten.measures.lambda_class import lambda_class
from batten.solvers.good_region import GoodRegion, good_region
from batten.splines.design_history import DesignHistory, DesignState
from batten.splines.design_limits import BrokenLimit, DesignLimits, PieceMeasures, broken_limits, piece_measures
from batten.splines.design_rods import DesignRods, RodKind, design_rods
from batten.splines.design_step import DesignStep, is_one_move, touched_pieces, unchanged_pieces, without_end
from batten.splines.limit_repair import repaired
from batten.splines.nearest_place import nearest_place, same_component
from batten.typing import ArrayLike, FloatArray, IntArray

Outside = Literal["refuse", "clamp"]


class ElasticSplineDesign:
    """An elastic spline while it is designed: a cubic spline, each piece of it close to a rod (Fisker2018 §5.2, §5.2.1).

    State: the cubic proxy with the borders of its blocks, the limits, and all steps so far. Control points move within their
    good regions, pieces are inserted and deleted, steps undone and done again. No step breaks a limit that was kept before,
    or breaks one further: it is refused and changes nothing. A design that starts with broken limits can be edited; what is
    broken is listed by `broken` and in every `DesignStep`. No graphics here; coordinates have any unit of length.

    Parameters:
        proxy: the spline to start with; `line`, `from_control_points` make one.
        limits: what every piece has to keep.

    Accuracy: whether a limit is kept is decided by the measures of the pieces themselves, not by the region's polygons.

    Example:
        >>> design = ElasticSplineDesign.line((0, 0), (6, 0), 2)
        >>> step = design.move(2, (2.0, 0.8))
        >>> step.outcome, step.classes
        ('done', ('best', 'best'))
        >>> step = design.move(2, (2.0, 40.0))
        >>> step.outcome, design.control_points[2].tolist()
        ('refused', [2.0, 0.8])
        >>> step = design.move(2, (2.0, 40.0), outside="clamp")
        >>> step.outcome, bool(0.8 < design.control_points[2, 1] < 40.0), design.broken
        ('clamped', True, ())
        >>> design.undo().point, design.undo().point
        ((2.0, 0.8), (2.0, 0.0))
    """

    def __init__(self, proxy: CubicProxy, limits: DesignLimits | None = None) -> None:
        if not isinstance(proxy, CubicProxy):
            raise InvalidInputError(f"a design starts with a CubicProxy; got {type(proxy).__name__}; see line()")
        self._start(DesignHistory([DesignState(proxy, limits or DesignLimits())]))

    def _start(self, history: DesignHistory) -> None:
        self._history = history
        self._regions: dict[int, GoodRegion] = {}
        self._measured()

    @classmethod
    def line(
        cls,
        start: ArrayLike,
        end: ArrayLike,
        pieces: int = 1,
        *,
        continuity: int = 1,
        borders: Sequence[Border | None] | None = None,
        limits: DesignLimits | None = None,
    ) -> ElasticSplineDesign:
        """A straight line to start with; its joints are moved to the borders, one `Border` or None for each, ends included.

        Raises:
            InvalidInputError: as `CubicProxy.line` and `CubicProxy.with_borders`.
        """
        proxy = CubicProxy.line(start, end, pieces, continuity)
        return cls(proxy if borders is None else proxy.with_borders(borders), limits)

    @classmethod
    def from_control_points(
        cls,
        control_points: ArrayLike,
        *,
        continuity: int = 1,
        borders: Sequence[Border | None] | None = None,
        limits: DesignLimits | None = None,
    ) -> ElasticSplineDesign:
        """A design from the control points (m, 2) of a `CubicProxy`, whose joints lie on their borders.

        Raises:
            InvalidInputError: as the constructor of `CubicProxy`.
        """
        points = np.asarray(control_points, dtype=np.float64)
        return cls(CubicProxy(points, continuity, None if borders is None else tuple(borders)), limits)

    @classmethod
    def from_states(cls, states: Sequence[DesignState], current: int = 0) -> ElasticSplineDesign:
        """A design with its history, as `states` and `undo_depth` give it.

        Raises:
            InvalidInputError: as `DesignHistory`.
        """
        design = cls.__new__(cls)
        design._start(DesignHistory(states, current))
        return design

    # --- the present state ---

    @property
    def proxy(self) -> CubicProxy:
        """The cubic spline, itself a `Curve`."""
        return self._history.present.proxy

    @property
    def limits(self) -> DesignLimits:
        """What every piece has to keep."""
        return self._history.present.limits

    @property
    def control_points(self) -> FloatArray:
        """The control points of the proxy, shape (m, 2), read-only."""
        return self.proxy.control_points

    @property
    def borders(self) -> tuple[Border | None, ...] | None:
        """The border of each joint, ends included; None without any."""
        return self.proxy.borders

    @property
    def pieces(self) -> FloatArray:
        """Bézier points of the pieces, shape (n, 4, 2), read-only."""
        return self.proxy.pieces

    @property
    def measures(self) -> PieceMeasures:
        """All that limits are about, of each piece."""
        return self._measures

    @property
    def residuals(self) -> FloatArray:
        """e_λ of each piece, shape (n,)."""
        return self._measures.residuals

    @property
    def angle_errors(self) -> FloatArray:
        """Greatest turn of the end tangents of the first guess against those of each piece, radians, shape (n,)."""
        return self._measures.angle_errors

    @property
    def classes(self) -> tuple[str, ...]:
        """`lambda_class` of each piece."""
        return tuple(str(name) for name in np.atleast_1d(lambda_class(self.residuals)))

    @property
    def broken(self) -> tuple[BrokenLimit, ...]:
        """The limits that are not kept; empty for a design that started without."""
        return self._broken

    @property
    def states(self) -> tuple[DesignState, ...]:
        """The whole history, oldest first; the present state is `states[undo_depth]`."""
        return self._history.states

    @property
    def undo_depth(self) -> int:
        """How many steps can be undone."""
        return self._history.undo_depth

    @property
    def redo_depth(self) -> int:
        """How many undone steps can be done again."""
        return self._history.redo_depth

    def elastica(self, kind: RodKind = "joined") -> DesignRods:
        """The rods that the pieces stand for, and how far they are from the proxy: see `design_rods`."""
        return design_rods(self.pieces, kind)

    def good_region(self, index: int) -> GoodRegion:
        """Where control point `index` can be while all limits are kept: see `solvers.good_region`.

        Kept until something changes that it depends on. Moving the point itself, or points whose pieces are others, does not
        change it, so that it is computed once for a whole drag.

        Raises:
            InvalidInputError: no such control point.
        """
        i = self.proxy._index(index)
        if i not in self._regions:
            limits = self.limits
            self._regions[i] = good_region(
                self.proxy,
                i,
                residual_below=limits.residual_below,
                angle_error_below=limits.angle_error_below,
                curvature_below=limits.curvature_below,
                margin_above=limits.margin_above,
                simple=limits.simple,
            )
        return self._regions[i]

    # --- operations ---

    def move(self, index: int, point: ArrayLike, outside: Outside = "refuse", *, continues: bool = False) -> DesignStep:
        """Move a control point, as far as borders and limits allow.

        Where borders bind the point it goes to the nearest place that they allow; with continuity 1 the point across a joint
        with a border follows (`CubicProxy.freedom`).

        Parameters:
            index: of the control point, 0 … m − 1.
            point: where to, shape (2,).
            outside: what happens where a limit would be broken. "refuse": nothing changes. "clamp": the point goes to the
                nearest place of its good region, in the component of its present place (of any, where it is in none).
            continues: the move goes on with the last one, as in a drag: it makes no step of its own in the history if the
                last step was a move of the same point.

        Raises:
            InvalidInputError: no such control point, a point that is not two finite numbers, another word for `outside`.

        Accuracy: clamped places keep the limits, and are nearest to within 1 % of the region's width.
        """
        if outside not in ("refuse", "clamp"):
            raise InvalidInputError(f"outside is 'refuse' or 'clamp'; got {outside!r}")
        i = self.proxy._index(index)
        moved = self.proxy.with_control_point(i, point)
        x, y = np.asarray(point, dtype=np.float64).tolist()
        touched = touched_pieces(self.proxy, i)
        measures, worse = self._judged(moved, touched)
        outcome, reason = "done", "; ".join(map(str, worse))
        if outside == "clamp" and (worse or not self._reaches(i, moved.control_points[i], touched)):
            found = self._clamped(i, moved.control_points[i], touched)
            if found is None:
                worse = worse or ()
                reason = reason or "there is no place for this point that keeps all limits"
                return self._refused("move", i, (x, y), touched, worse, reason)
            moved, measures = found
            outcome, reason, worse = "clamped", reason or "the way there leaves the good region", ()
        if worse:
            return self._refused("move", i, (x, y), touched, worse, reason)
        if len(self.proxy.freedom(i).directions) == 0:
            return self._refused("move", i, (x, y), touched, (), "borders in different directions hold this point")
        if not np.array_equal(moved.control_points, self.control_points):
            last = self._history.present
            drag = continues and last.action == "move" and last.index == i
            self._go_on(DesignState(moved, self.limits, "move", i), measures, replace=drag)
        return self._step("move", outcome, i, touched, asked=(x, y), reason=reason)

    def insert(self, piece: int, *, fraction: float = 0.5, border: Border | None = None) -> DesignStep:
        """Divide a piece in two at a fraction of its parameter, or where it meets a border: `CubicProxy.with_piece`.

        The spline changes a little where it is no such spline with the new joint. Borders keep their joints.

        Raises:
            InvalidInputError: no such piece, a fraction outside (0, 1), a border that the piece does not cross.
        """
        n = self.proxy.piece_count
        proxy = self.proxy.with_piece(piece, fraction=fraction, border=border)
        before = np.insert(np.arange(n), piece, -1)
        before[piece + 1] = -1
        return self._replaced("insert", int(piece), proxy, before)

    def delete(self, joint: int) -> DesignStep:
        """Take a joint away: an inner one makes one piece of two (`CubicProxy.without_joint`), an end takes its piece off.

        The joint's border goes with it; the others keep theirs.

        Raises:
            InvalidInputError: no such joint, the only piece.
        """
        n = self.proxy.piece_count
        if not (isinstance(joint, int | np.integer) and 0 <= joint <= n) or n == 1:
            raise InvalidInputError(
                f"joints that can be deleted are {f'0 … {n}' if n > 1 else 'none, with one piece left'}; got {joint!r}"
            )
        if joint in (0, n):
            proxy, before = without_end(self.proxy, int(joint)), np.delete(np.arange(n), 0 if joint == 0 else n - 1)
        else:
            proxy, before = self.proxy.without_joint(joint), np.delete(np.arange(n), joint)
            before[joint - 1] = -1
        return self._replaced("delete", int(joint), proxy, before)

    def set_borders(self, borders: Sequence[Border | None] | None) -> DesignStep:
        """Other borders of the blocks, one or None for each joint; the joints are moved there: `CubicProxy.with_borders`.

        Raises:
            InvalidInputError: not one entry for each joint; borders that cannot all be met.
        """
        proxy = self.proxy.with_borders(borders)
        return self._replaced("borders", None, proxy, np.arange(proxy.piece_count))

    def set_limits(self, limits: DesignLimits) -> DesignStep:
        """Other limits. Never refused: what the design does not keep of them is in `broken` and can be put right."""
        if not isinstance(limits, DesignLimits):
            raise InvalidInputError(f"limits are DesignLimits; got {type(limits).__name__}")
        state = DesignState(self.proxy, limits, "limits")
        self._go_on(state, piece_measures(self.proxy, limits))
        return self._step("limits", "done", None, np.arange(self.proxy.piece_count))

    def undo(self) -> DesignStep:
        """Go one step back, to the same numbers bit by bit.

        Raises:
            InvalidInputError: there is no step to undo.
        """
        return self._turn("undo", self._history.back)

    def redo(self) -> DesignStep:
        """Do again what was undone last.

        Raises:
            InvalidInputError: there is nothing to do again; any new step drops what was undone.
        """
        return self._turn("redo", self._history.forth)

    # --- how steps are judged and taken ---

    def _measured(self) -> None:
        self._measures = piece_measures(self.proxy, self.limits)
        self._broken = broken_limits(self._measures, self.limits)

    def _judged(self, proxy: CubicProxy, touched: IntArray) -> tuple[PieceMeasures, tuple[BrokenLimit, ...]]:
        """The measures of a spline in which `touched` pieces differ, and the limits that it breaks anew or further."""
        measures = piece_measures(proxy, self.limits, self._measures, touched)
        before = {(b.limit, b.piece): b.excess for b in self._broken}
        broken = broken_limits(measures, self.limits, touched)
        return measures, tuple(b for b in broken if not b.excess <= before.get((b.limit, b.piece), -math.inf))

    def _clamped(self, index: int, target: FloatArray, touched: IntArray) -> tuple[CubicProxy, PieceMeasures] | None:
        """The nearest spline to the one with the control point at `target` that breaks nothing; None without any."""
        region, here = self.good_region(index), self.control_points[index]
        if not (region.polygons or len(region.intervals)):
            return None
        place = region.clamp(target, start=here if self._keeps(touched) else None)
        tried: dict[bytes, tuple[CubicProxy, PieceMeasures]] = {}

        def good(point: FloatArray) -> bool:
            proxy = self.proxy.with_control_point(index, point)
            measures, worse = self._judged(proxy, touched)
            tried[point.tobytes()] = proxy, measures
            return not worse

        found = nearest_place(place, target, here, region.width, good)
        good(found)
        return tried[found.tobytes()]

    def _reaches(self, index: int, target: FloatArray, touched: IntArray) -> bool:
        """Whether a good place is in the component of the present one; any is, from a place that is not good."""
        return not self._keeps(touched) or same_component(self.good_region(index), self.control_points[index], target)

    def _keeps(self, pieces: IntArray) -> bool:
        """Whether these pieces keep all limits now."""
        return not any(b.piece is None or b.piece in pieces for b in self._broken)

    def _replaced(self, action: str, index: int | None, proxy: CubicProxy, before: IntArray) -> DesignStep:
        """Go on to another spline, whose piece k was `before[k]` (−1: a new one), unless it breaks limits.

        Where it does, the control points of the pieces that change go on until all limits are kept, if they can. In a design
        that breaks a limit already, no piece may break it further than the worst one does.
        """
        old, reason = self.pieces, ""
        measures, worse = self._compared(proxy)
        same = unchanged_pieces(old, proxy.pieces, before)
        if worse:
            reason = "; ".join(map(str, worse))
            better = repaired(proxy, np.flatnonzero(~same), self.limits)
            if better is None:
                gone = np.setdiff1d(np.arange(len(old)), before[same])
                return self._refused(action, index, None, gone, worse, reason)
            far = float(np.linalg.norm(better.control_points - proxy.control_points, axis=-1).max())
            reason = (
                f"control points were moved by up to {far:.3g} to keep all limits, since in the nearest spline {reason}"
            )
            proxy, (measures, _), same = better, self._compared(better), unchanged_pieces(old, better.pieces, before)
        self._go_on(DesignState(proxy, self.limits, action, index), measures)
        return self._step(action, "done", index, np.flatnonzero(~same), reason=reason)

    def _compared(self, proxy: CubicProxy) -> tuple[PieceMeasures, tuple[BrokenLimit, ...]]:
        """The measures of a spline with other pieces, and the limits that it breaks further than any piece does now."""
        measures, worst = piece_measures(proxy, self.limits), dict[str, float]()
        for b in self._broken:
            worst[b.limit] = max(worst.get(b.limit, -math.inf), b.excess * (1.0 + 1e-9))
        broken = broken_limits(measures, self.limits)
        return measures, tuple(b for b in broken if not b.excess <= worst.get(b.limit, -math.inf))

    def _go_on(self, state: DesignState, measures: PieceMeasures, *, replace: bool = False) -> None:
        before = self._history.present
        self._history.add(state, replace=replace)
        self._measures, self._broken = measures, broken_limits(measures, state.limits)
        self._forget(before, state.index if state.action == "move" else None)

    def _turn(self, action: str, turn: Callable[[], DesignState]) -> DesignStep:
        before = self._history.present
        now = turn()
        taken = before if action == "undo" else now
        moved = taken.index if taken.action == "move" else None
        self._forget(before, moved)
        self._measured()
        touched = np.arange(self.proxy.piece_count) if moved is None else touched_pieces(self.proxy, moved)
        return self._step(action, "done", taken.index, touched, named=moved)

    def _forget(self, before: DesignState, moved: int | None) -> None:
        """Drop the regions that a step from `before` may have changed; `moved`: it only moved this control point."""
        now = self._history.present
        kept: dict[int, GoodRegion] = {}
        if moved is not None and before.limits == now.limits and is_one_move(before.proxy, now.proxy, moved):
            touched = set(touched_pieces(now.proxy, moved).tolist())
            for i, region in self._regions.items():
                apart = not now.limits.simple and touched.isdisjoint(touched_pieces(now.proxy, i).tolist())
                if i == moved or apart:
                    kept[i] = region
        self._regions = kept

    def _refused(
        self,
        action: str,
        index: int | None,
        asked: tuple[float, float] | None,
        touched: IntArray,
        worse: tuple[BrokenLimit, ...],
        reason: str,
    ) -> DesignStep:
        return self._step(action, "refused", index, touched, asked=asked, broken=worse, reason=reason)

    def _step(
        self,
        action: str,
        outcome: str,
        index: int | None,
        touched: IntArray,
        *,
        named: int | None = None,
        asked: tuple[float, float] | None = None,
        broken: tuple[BrokenLimit, ...] | None = None,
        reason: str = "",
    ) -> DesignStep:
        """The record of a step, as things are now. named: the control point whose place is told."""
        named = index if action == "move" else named
        x_y = None if named is None else (float(self.control_points[named, 0]), float(self.control_points[named, 1]))
        residuals, angles = self.residuals[touched], self.angle_errors[touched]
        classes = tuple(self.classes[k] for k in touched)
        broken = self._broken if broken is None else broken
        return DesignStep(action, outcome, index, asked, x_y, touched, residuals, angles, classes, broken, reason)
