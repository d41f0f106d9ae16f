"""The isocurves of a surface of design splines as exact cubic pieces, and how far each piece is from an elastica."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from batten.errors import InvalidInputError
from batten.measures.lambda_residual import lambda_residual
from batten.surfaces.bspline_basis import basis_functions, bezier_rows, span_polynomials
from batten.surfaces.bspline_surface import BSplineSurface
from batten.typing import ArrayLike, BoolArray, FloatArray

_FLAT = 1e-9  # of the surface's size: how far an isocurve may leave its plane


@dataclass(frozen=True, eq=False)
class IsocurveResiduals:
    """λ-residuals of k isocurves of c pieces each.

    Attributes:
        positions: (k,), coordinates of their planes across the blade.
        residuals: (k, c), e_λ of every piece; NaN where a piece has no length.
    """

    positions: FloatArray
    residuals: FloatArray

    @property
    def greatest(self) -> FloatArray:
        """The greatest e_λ of each isocurve, (k,); infinite where a piece has no length."""
        return np.asarray(np.where(np.isnan(self.residuals), np.inf, self.residuals).max(axis=1))

    @property
    def worst(self) -> float:
        """The greatest e_λ of all pieces; infinite where one has no length."""
        return float(self.greatest.max())

    @property
    def worst_position(self) -> float:
        """Where it is met first."""
        return float(self.positions[int(np.argmax(self.greatest))])

    def above(self, threshold: float) -> BoolArray:
        """Which isocurves have a piece that is not below the threshold, (k,)."""
        return np.asarray(~(self.greatest < threshold))


def isocurve_residuals(surface: BSplineSurface, at: ArrayLike | int = 49) -> IsocurveResiduals:
    """The λ-residual of every piece of a dense set of isocurves: is the design production-ready (Fisker2018 §5.4.2)?

    Parameters:
        surface: a loft of cubic splines in parallel vertical planes, as `isocurve_pieces` takes it.
        at: coordinates of planes across the blade, shape (k,); or how many, evenly from the first to the last. The thesis
            takes 49.

    Returns:
        `IsocurveResiduals`; by the papers' words, curves below 0.22 are very close to elastica, below 0.4 close.

    Raises:
        InvalidInputError: as `isocurve_pieces`; a number of isocurves below 2.

    Accuracy: e_λ within 1e-6, of the cubic pieces themselves. What lies between the isocurves is not looked at.

    Example:
        >>> from batten.curves.cubic_proxy import CubicProxy
        >>> from batten.surfaces.design_surface import DesignSurface
        >>> arch = CubicProxy([(0, 0), (1, 1), (2, 1.5), (4, 1.5), (5, 1), (6, 0)])
        >>> low = CubicProxy([(0, 0), (1, 0.3), (2, 0.5), (4, 0.5), (5, 0.3), (6, 0)])
        >>> found = isocurve_residuals(DesignSurface([low, arch], [0.0, 3.0]).surface, 7)
        >>> found.residuals.shape, bool(found.worst < 0.22), found.above(0.22).any()
        ((7, 2), True, np.False_)
    """
    low, high = surface.domain[1]
    if isinstance(at, int | np.integer):
        if at < 2:
            raise InvalidInputError(f"isocurves are 2 or more, or coordinates of planes; got {at}")
        at = np.linspace(low, high, int(at))
    positions = np.atleast_1d(np.asarray(at, dtype=np.float64))
    return IsocurveResiduals(positions, np.asarray(lambda_residual(isocurve_pieces(surface, positions))))


def isocurve_pieces(surface: BSplineSurface, at: ArrayLike) -> FloatArray:
    """The cubic Béziers of which the isocurves u ↦ S(u, v) are made, in the coordinates (along the blade, up).

    Parameters:
        surface: polynomial, of degree 3 or less along u, each isocurve in a plane of constant x or of constant y: a loft.
        at: the values of v, shape (k,), within the domain.

    Returns:
        Control points, (k, c, 4, 2), with c the number of polynomial pieces along u. Exact, to rounding: by the basis
        functions across and a change of basis along.

    Raises:
        InvalidInputError: a rational surface, a degree above 3 along u, v outside the domain or not of shape (k,), isocurves
            that are not in such planes.
    """
    v = np.asarray(at, dtype=np.float64)
    low, high = surface.domain[1]
    if v.ndim != 1 or not v.size or not ((v >= low) & (v <= high)).all():
        raise InvalidInputError(
            f"isocurves are taken at v of shape (k,), {low} ≤ v ≤ {high}; got {np.array(at).tolist()}"
        )
    if surface.is_rational or surface.degree_u > 3:
        raise InvalidInputError(
            f"isocurves are cubic splines on polynomial surfaces of degree 3 along u at most; got degree {surface.degree_u}"
            f"{', rational' if surface.is_rational else ''}; loft design splines, or rebuild the surface"
        )
    first, values = basis_functions(surface.knots_v, surface.degree_v, v, 0)
    across = surface.control_points[:, first[:, None] + np.arange(surface.degree_v + 1)]  # (n, k, q + 1, 3)
    control = np.einsum("qk,nkqd->knd", values[0], across)
    size = float(np.ptp(surface.control_points.reshape(-1, 3), axis=0).max())
    flat = [bool((np.ptp(control[..., axis], axis=1) <= _FLAT * size).all()) for axis in (0, 1)]
    if flat[0] == flat[1]:
        raise InvalidInputError(
            "the isocurves along u do not lie in planes of constant y, or of constant x; loft splines drawn in such planes"
        )
    plane = control[..., [0, 2] if flat[1] else [1, 2]]
    borders, begin, rows = span_polynomials(surface.knots_u, surface.degree_u)
    to_bezier = bezier_rows(borders, surface.degree_u, 1) @ rows  # (c, p + 1, p + 1), control points from coefficients
    pieces = np.einsum("cab,kcbd->kcad", to_bezier, plane[:, begin[:, None] + np.arange(surface.degree_u + 1)])
    while pieces.shape[2] < 4:  # raise the degree
        n = pieces.shape[2]
        share = (np.arange(1, n) / n)[:, None]
        inner = share * pieces[:, :, :-1] + (1.0 - share) * pieces[:, :, 1:]
        pieces = np.concatenate([pieces[:, :, :1], inner, pieces[:, :, -1:]], axis=2)
    return np.asarray(pieces)
