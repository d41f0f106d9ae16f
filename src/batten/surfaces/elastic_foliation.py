"""Leaves that are elastic splines, by interpolation of the isocurves' joints, tangents and lengths (Fisker2018 §5.4.1)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from batten.curves.bezier import CubicBezier
from batten.curves.elastica import Elastica, points_batch
from batten.curves.piecewise import PiecewiseCurve
from batten.errors import ConvergenceError, InvalidInputError, NoSolutionError
from batten.measures.distance import hausdorff_distance
from batten.splines.elastic_spline import ElasticSpline, elastic_spline
from batten.splines.spline_start import design_joints
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.isocurves import isocurve_pieces
from batten.typing import ArrayLike, BoolArray, FloatArray

_STATIONS = 65  # where neighbouring leaves are compared, on each piece
_DISTANCE = 1e-5  # greatest error of distances, as a part of the isocurve's length
_JUMP = 4.0


@dataclass(frozen=True, eq=False)
class ElasticFoliation:
    """k elastic splines of c pieces each, one for each isocurve of a surface.

    Attributes:
        positions: (k,), coordinates of their planes across the blade.
        parameters: (k, c, 7), the pieces as `Elastica.parameters`; NaN for a leaf that has none.
        distances: (k,), greatest distance of the leaf from its isocurve (two-sided Hausdorff, in the plane), in the unit of
            the coordinates; NaN for a leaf that has none.
        energies: (k,), ∫κ² ds. stable: (k,), strict minima of the energy.
        imbalances: (k,), greatest moment (times length) or force (times its square) that does not balance where a rod of
            class C² is free to turn or slide; 0 for C¹, whose joints are clamped.
        misses: (k,), greatest miss of a joint and of a length, in lengths of the leaf, or of an angle that is held, radians.
        steps: (k − 1,), greatest distance between neighbouring leaves, at equal fractions of their pieces, over that
            of their isocurves: near 1 where the leaves follow one another as the isocurves do.
        status: k words, "converged" or what is amiss.
    """

    positions: FloatArray
    parameters: FloatArray
    distances: FloatArray
    energies: FloatArray
    stable: BoolArray
    imbalances: FloatArray
    misses: FloatArray
    steps: FloatArray
    status: tuple[str, ...]

    @property
    def jumps(self) -> FloatArray:
        """Positions behind which the next leaf takes another shape (Fig. 5.4): where `steps` is above 4."""
        return np.asarray(self.positions[:-1][self.steps > _JUMP])

    @property
    def greatest_distance(self) -> float:
        """The greatest of the distances; NaN where a leaf is missing."""
        return float(self.distances.max())

    def leaf(self, index: int) -> PiecewiseCurve:
        """One leaf as a curve in the coordinates (along the blade, up).

        Raises:
            InvalidInputError: no such leaf, or one without a shape.
        """
        if not (isinstance(index, int | np.integer) and 0 <= index < len(self.positions)):
            raise InvalidInputError(f"leaves are 0 … {len(self.positions) - 1}; got {index!r}")
        if self.status[index] != "converged":
            raise InvalidInputError(f"leaf {index} has no elastic spline: {self.status[index]}")
        return PiecewiseCurve([Elastica.from_parameters(row) for row in self.parameters[index]])


def elastic_foliation(
    surface: BSplineSurface,
    at: ArrayLike | int = 49,
    *,
    continuity: Literal[1, 2] = 1,
    follow: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> ElasticFoliation:
    """Every isocurve of a loft replaced by the elastic spline with its joints, tangents and lengths (Fisker2018 §5.4.1).

    The loft interpolates what bounds the rods: between the design splines, joints lie on the cubic interpolation of their
    joints. C¹: each piece is the elastica of the isocurve piece's end points, end tangents and length. C²: the rod
    through the joints with the isocurve's two end tangents and total length, free to turn and to slide at the inner ones. Of
    several shapes the one is taken whose basin the isocurve lies in (`elastic_spline` with the isocurve as design), so that
    every leaf stands for itself; neighbours may end in different basins, see `ElasticFoliation.jumps`.

    Parameters:
        surface: a loft of cubic splines in parallel vertical planes, as `isocurve_pieces` takes it.
        at: coordinates of planes across the blade, (k,), ascending; or how many, evenly from the first to the last.
        continuity: 1 or 2.
        follow: begin each leaf with the shape of the one before instead, for as long as the rod keeps it.
        progress: called with (leaves done, leaves in all).

    Returns:
        `ElasticFoliation`; a leaf without a spline gets NaN and its reason, the others go on.

    Raises:
        InvalidInputError: as `isocurve_pieces`; positions that do not ascend, another continuity.

    Accuracy: leaves are elastica to rounding; they meet joints and tangents to 1e-9 of their length, as `elastic_spline`.
    Distances to 1e-5 of the length. That they are near to the isocurves is not guaranteed (the thesis: 79 and 93 mm on
    3 m): where the isocurves' λ-residuals are small, they are.
    Degenerate cases: a straight isocurve piece has length and chord alike, and no elastica of that length bends: its leaf
    has no spline.

    Example:
        >>> from batten.curves.cubic_proxy import CubicProxy
        >>> from batten.surfaces.design_surface import DesignSurface
        >>> low = CubicProxy([(0, 0), (1, 0.3), (2, 0.5), (4, 0.5), (5, 0.3), (6, 0)])
        >>> arch = CubicProxy([(0, 0), (1, 1), (2, 1.5), (4, 1.5), (5, 1), (6, 0)])
        >>> leaves = elastic_foliation(DesignSurface([low, arch], [0.0, 3.0]).surface, 5)
        >>> bool(leaves.greatest_distance < 0.01), leaves.jumps.tolist(), set(leaves.status)
        (True, [], {'converged'})
    """
    if continuity not in (1, 2):
        raise InvalidInputError(f"continuity is 1 or 2; got {continuity!r}")
    low, high = surface.domain[1]
    positions = (
        np.linspace(low, high, int(at)) if isinstance(at, int | np.integer) else np.asarray(at, dtype=np.float64)
    )
    if positions.ndim != 1 or len(positions) < 2 or not (np.diff(positions) > 0.0).all():
        raise InvalidInputError(f"positions: got {positions.tolist()}; allowed are two or more, ascending")
    control = isocurve_pieces(surface, positions)
    k, c = control.shape[:2]
    parameters = np.full((k, c, 7), np.nan)
    distances, energies, imbalances, misses = (np.full(k, np.nan) for _ in range(4))
    stable, status = np.zeros(k, dtype=bool), list[str]()
    before: ElasticSpline | None = None
    for i, rows in enumerate(control):
        isocurve = PiecewiseCurve([CubicBezier(row) for row in rows])
        try:
            before = spline = _elastic(rows, isocurve, continuity, before if follow else None)
        except (NoSolutionError, ConvergenceError, InvalidInputError) as error:
            status.append(str(error))
        else:
            parameters[i] = [piece.parameters for piece in spline.pieces]
            distances[i] = hausdorff_distance(isocurve, spline.curve, tolerance=_DISTANCE * isocurve.length)
            energies[i], stable[i] = spline.energy, spline.stable
            imbalances[i] = max(spline.moment_residual, spline.force_residual)
            misses[i] = max(spline.position_error, spline.angle_error, spline.length_error)
            status.append(spline.status)
        if progress is not None:
            progress(i + 1, k)
    steps = _steps(parameters, control)
    return ElasticFoliation(
        positions, parameters, distances, energies, stable, imbalances, misses, steps, tuple(status)
    )


def _elastic(
    rows: FloatArray, isocurve: PiecewiseCurve, continuity: int, before: ElasticSpline | None
) -> ElasticSpline:
    """The elastic spline of one isocurve, control points (c, 4, 2), begun with its own shape or the one before."""
    points = np.concatenate([rows[:, 0], rows[-1:, 3]])
    joints = design_joints(isocurve, len(rows))
    handles = np.concatenate([rows[:, 1] - rows[:, 0], rows[-1:, 3] - rows[-1:, 2]])
    own = np.arctan2(handles[:, 1], handles[:, 0])  # exact; which turn of it, the samples say
    own = np.where(np.hypot(*handles.T) > 0.0, own, joints.angles)
    angles = own + 2.0 * np.pi * np.round((joints.angles - own) / (2.0 * np.pi))
    lengths = np.array([piece.length for piece in isocurve.pieces])
    if continuity == 1:
        return elastic_spline(points, tangents=angles, lengths=lengths, design=before or isocurve)
    return elastic_spline(points, float(angles[0]), float(angles[-1]), float(lengths.sum()), design=before or isocurve)


def _steps(parameters: FloatArray, control: FloatArray) -> FloatArray:
    """See `ElasticFoliation.steps`; pieces of an isocurve are compared at equal parameters."""
    t = np.linspace(0.0, 1.0, _STATIONS)
    basis = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3], axis=-1)
    on_isocurves, on_leaves = basis @ control, points_batch(parameters, t)
    moved, wanted = (
        np.linalg.norm(np.diff(points, axis=0), axis=-1).max(axis=(1, 2)) for points in (on_leaves, on_isocurves)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(moved / wanted)
