"""Surfaces of design splines judged as in Fisker2018 §5.4: Tables 5.1 and 5.2, and elastic foliations by interpolation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from batten.curves.bezier import CubicBezier
from batten.curves.bspline import BSplineCurve
from batten.curves.elastica import Elastica
from batten.curves.piecewise import PiecewiseCurve
from batten.measures.distance import hausdorff_distance
from batten.solvers.boundary_value import in_threads
from batten.splines.analytic_description import STATUS, analytic_descriptions
from batten.surfaces.elastic_foliation import ElasticFoliation, elastic_foliation
from batten.surfaces.isocurves import isocurve_pieces, isocurve_residuals
from batten.surfaces.loft import loft
from batten.typing import ArrayLike, BoolArray, FloatArray

#: Fisker2018 Table 5.1: the greatest e_λ of the four design curves and of all 49 curves of twelve foliations.
PAPER_5_1 = (
    (0.06, 0.10, 0.04, 0.03, 0.11, 0.05, 0.06, 0.03, 0.09, 0.12, 0.10, 0.16),
    (0.08, 0.10, 0.07, 0.06, 0.14, 0.06, 0.06, 0.04, 0.09, 0.17, 0.10, 0.18),
)
#: Fisker2018 Table 5.2: e_λ, L², Hausdorff (mm); maximum, mean, median, variance; each of the design curves and of all.
PAPER_5_2 = (
    (7.86e-03, 8.72e-03, 1.61e-03, 1.20e-03, 3.28e-04, 2.80e-04, 7.32e-06, 4.89e-06),
    (4.52e-05, 4.52e-05, 9.60e-06, 6.53e-06, 6.36e-07, 3.56e-07, 2.99e-10, 1.36e-10),
    (7.84e-02, 7.84e-02, 2.69e-02, 2.25e-02, 1.39e-02, 1.39e-02, 6.14e-04, 2.96e-04),
)
#: The same rows in words.
MEASURES = ("λ-residual", "L² distance", "Hausdorff distance")

_SAME = 1e-9  # of the way across: an isocurve there is the design curve
_DISTANCE = 1e-7  # greatest error of Hausdorff distances, as a part of the curve's length


@dataclass(frozen=True, eq=False)
class FoliationNumbers:
    """k isocurves of a loft and the elastic splines that describe them.

    Attributes:
        name: of the foliation. positions: (k,), of the planes. design: (k,), which of them are design curves.
        residuals: (k,), greatest e_λ of a curve's pieces.
        l2: (k,), ‖γ − γₑ‖ over the whole curve, (∫‖γ − γₑ‖² ds / L³)^½, points at equal fractions of each piece.
        hausdorff: (k,), two-sided, in the unit of the coordinates, to 1e-7 of the curve's length.
        status: k words of `analytic_description.STATUS`; NaN in `l2` and `hausdorff` where it is "bad input".
    """

    name: str
    positions: FloatArray
    design: BoolArray
    residuals: FloatArray
    l2: FloatArray
    hausdorff: FloatArray
    status: tuple[str, ...]

    def statistics(self) -> FloatArray:
        """Maximum, mean, median and variance of e_λ, L² and Hausdorff, of design curves and of all: shape (3, 4, 2)."""
        out = np.empty((3, 4, 2))
        for i, values in enumerate((self.residuals, self.l2, self.hausdorff)):
            for j, some in enumerate((values[self.design], values)):
                out[i, :, j] = some.max(), some.mean(), np.median(some), some.var()
        return out


def foliation_numbers(
    name: str,
    curves: Sequence[BSplineCurve],
    positions: ArrayLike,
    count: int = 49,
    *,
    continuity: Literal[0, 1, 2] = 1,
    workers: int | None = None,
) -> FoliationNumbers:
    """Loft design curves, and describe `count` isocurves at even distances, and the design curves, by elastica (§5.3, §5.4).

    Parameters:
        name: heads its column. curves: cubic splines of equally many pieces, (along the blade, up).
        positions: of their planes, ascending. count: of isocurves, from 2.
        continuity: of the elastic splines, as `analytic_descriptions`. workers: threads, by default one for each core.

    Raises:
        InvalidInputError: as `loft` and `isocurve_pieces`.

    Accuracy: e_λ within 1e-6, L² to the quadrature of `analytic_descriptions`.
    """
    planes = np.asarray(positions, dtype=np.float64)
    surface = loft(curves, planes)
    even = np.linspace(planes[0], planes[-1], count)
    apart = np.abs(even[:, None] - planes).min(axis=1) > _SAME * (planes[-1] - planes[0])
    at = np.sort(np.concatenate([even[apart], planes]))
    control = isocurve_pieces(surface, at)
    described = analytic_descriptions(control, continuity, workers=workers)
    hausdorff = np.full(len(at), np.nan)

    def measure(part: slice) -> None:
        for i in range(*part.indices(len(at))):
            if STATUS[described.status[i]] != "bad input":
                curve = PiecewiseCurve([CubicBezier(piece) for piece in control[i]])
                rods = PiecewiseCurve([Elastica.from_parameters(row) for row in described.parameters[i]])
                hausdorff[i] = hausdorff_distance(curve, rods, tolerance=_DISTANCE * curve.length)

    in_threads(measure, len(at), workers)
    return FoliationNumbers(
        name, at, np.isin(at, planes), isocurve_residuals(surface, at).greatest, described.distance, hausdorff,
        tuple(STATUS[i] for i in described.status),
    )  # fmt: skip


def table_5_1(foliations: Sequence[FoliationNumbers]) -> list[str]:
    """Table 5.1 for foliations, those of the thesis below; theirs are other designs of the same kinds."""
    names = [f"({i})" for i in range(1, len(foliations) + 1)]
    ours = ([f.residuals[f.design].max() for f in foliations], [f.residuals.max() for f in foliations])
    lines = [f"{'greatest λ-residual':<28}" + "".join(f"{name:>6}" for name in names)]
    for who, values in zip(("design curves", "all curves"), ours):
        lines.append(f"{who:<28}" + "".join(f"{v:6.2f}" for v in values))
    for who, printed in zip(("  thesis, design curves", "  thesis, all curves"), PAPER_5_1):
        lines.append(f"{who:<28}" + "".join(f"{v:6.2f}" for v in printed[: len(foliations)]))
    return lines


def table_5_2(foliation: FoliationNumbers) -> list[str]:
    """Table 5.2 for a foliation in mm, the numbers of the thesis below each row; theirs is another design of its kind."""
    columns = [f"{word}, {who}" for word in ("max", "mean", "median", "variance") for who in ("design", "all")]
    lines = [f"{'':<24}" + "".join(f"{c:>17}" for c in columns)]
    for word, ours, paper in zip(MEASURES, foliation.statistics(), PAPER_5_2):
        unit = " (mm)" if word.startswith("H") else ""
        lines.append(f"{word + unit:<24}" + "".join(f"{v:17.2e}" for v in ours.reshape(-1)))
        lines.append(f"{'  thesis':<24}" + "".join(f"{v:17.2e}" for v in paper))
    return lines


def interpolated_foliations(
    curves: Sequence[BSplineCurve], positions: ArrayLike, count: int = 49
) -> tuple[ElasticFoliation, ElasticFoliation]:
    """The second way to a foliation (§5.4.1) from the same design curves: C¹ and C² elastic splines by interpolation."""
    surface = loft(curves, positions)
    return elastic_foliation(surface, count, continuity=1), elastic_foliation(surface, count, continuity=2)


def interpolation_lines(names: Sequence[str], pairs: Sequence[tuple[ElasticFoliation, ElasticFoliation]]) -> list[str]:
    """How far elastic splines by interpolation are from the lofts, in mm, and whether they follow one another."""
    lines = [
        f"{'':<28}{'C¹: max mm':>11}{'mean':>8}{'step':>7}{'C²: max mm':>12}{'mean':>8}{'step':>7}  missing, unstable"
    ]
    for name, pair in zip(names, pairs):
        words = f"{name:<28}"
        for width, leaves in zip((11, 12), pair):
            words += f"{np.nanmax(leaves.distances):{width}.2f}{np.nanmean(leaves.distances):8.2f}"
            words += f"{np.nanmax(leaves.steps):7.2f}"
        missing = sum(word != "converged" for leaves in pair for word in leaves.status)
        unstable = sum(int((~leaves.stable & np.isfinite(leaves.energies)).sum()) for leaves in pair)
        lines.append(f"{words}  {missing}, {unstable}")
    return lines
