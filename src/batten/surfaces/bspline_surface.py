"""A tensor-product B-spline surface, rational or not: the form in which a design comes out of CAD."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy.spatial import cKDTree

from batten.errors import InvalidInputError
from batten.surfaces.bspline_basis import bezier_rows, check_knots, powers, span_polynomials
from batten.typing import ArrayLike, FloatArray, IntArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

_CHUNK = 2048  # points evaluated at a time, so that their patches stay in the cache
_TREES = 8  # search trees kept with a surface, at most


@dataclass(frozen=True, eq=False)
class BSplineSurface:
    """S(u, v) = Σ w_ij P_ij N_i(u) N_j(v) / Σ w_ij N_i(u) N_j(v) over clamped or unclamped knots.

    Functions of u and v broadcast over their shapes. Parameters outside the domain give NaN, unless `extend` says how
    far the polynomials of the border spans are to be continued, as a fraction of the domain's width: 0.1 lets u run
    from u₀ − 0.1 (u₁ − u₀) to u₁ + 0.1 (u₁ − u₀), and `np.inf` anywhere. The continuation is smooth across the border,
    and strays from what the designer saw the farther it goes.

    Parameters:
        knots_u, knots_v: complete knot vectors, shapes (n + degree_u + 1,) and (m + degree_v + 1,), ascending, inner
            knots repeated at most degree times.
        degree_u, degree_v: 1 or more.
        control_points: shape (n, m, 3), any unit.
        weights: shape (n, m), positive; None, or all equal, for a surface that is not rational (stored as None).

    Raises:
        InvalidInputError: shapes that do not belong together, knots that are not ascending, values that are not finite.

    Example:
        >>> flat = BSplineSurface([0, 0, 2, 2], [0, 0, 1, 1], 1, 1, [[(0, 0, 0), (0, 3, 0)], [(4, 0, 0), (4, 3, 8)]])
        >>> flat.point(1.0, 0.5).tolist()
        [2.0, 1.5, 2.0]
        >>> flat.point([1.0, 2.5], 0.5).tolist()
        [[2.0, 1.5, 2.0], [nan, nan, nan]]
        >>> flat.point(2.5, 0.5, extend=0.25).tolist()
        [5.0, 1.5, 5.0]
    """

    knots_u: FloatArray
    knots_v: FloatArray
    degree_u: int
    degree_v: int
    control_points: FloatArray
    weights: FloatArray | None = None

    def __post_init__(self) -> None:
        points = np.array(self.control_points, dtype=np.float64)
        if points.ndim != 3 or points.shape[2] != 3:
            raise InvalidInputError(f"control_points: got shape {points.shape}; a surface needs (n, m, 3)")
        if not np.isfinite(points).all():
            i, j = np.argwhere(~np.isfinite(points).all(axis=2))[0]
            raise InvalidInputError(f"control_points: point ({i}, {j}) is {points[i, j].tolist()}; all must be finite")
        weights = None if self.weights is None else np.array(self.weights, dtype=np.float64)
        if weights is not None:
            if weights.shape != points.shape[:2] or not (np.isfinite(weights).all() and (weights > 0.0).all()):
                raise InvalidInputError(
                    f"weights: got shape {weights.shape}, least {np.min(weights, initial=np.inf)}; "
                    f"{points.shape[0]} × {points.shape[1]} control points need as many positive weights"
                )
            weights = None if (weights == weights.flat[0]).all() else weights
        for name, value in (
            ("knots_u", check_knots(self.knots_u, self.degree_u, points.shape[0], "knots_u")),
            ("knots_v", check_knots(self.knots_v, self.degree_v, points.shape[1], "knots_v")),
            ("control_points", points),
            ("weights", weights),
        ):
            if value is not None:
                value.setflags(write=False)
            object.__setattr__(self, name, value)

    @property
    def domain(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """((u₀, u₁), (v₀, v₁)), where the surface is defined without extension."""
        u, v = self.knots_u, self.knots_v
        p, q = self.degree_u, self.degree_v
        return (float(u[p]), float(u[-p - 1])), (float(v[q]), float(v[-q - 1]))

    @property
    def is_rational(self) -> bool:
        """Whether the weights differ from one another."""
        return self.weights is not None

    def point(self, u: ArrayLike, v: ArrayLike, *, extend: float = 0.0) -> FloatArray:
        """Points S(u, v), shape (…, 3) for u and v that broadcast to shape (…); NaN outside (see the class)."""
        return np.asarray(self.derivatives(u, v, 0, extend=extend)[0, 0])

    def derivatives(self, u: ArrayLike, v: ArrayLike, order: int = 1, *, extend: float = 0.0) -> FloatArray:
        """Partial derivatives up to `order`, itself 0, 1 or 2.

        Parameters:
            u, v: shapes that broadcast to (…).
            order: 0 for points alone, 1 for first, 2 for second derivatives.
            extend: see the class.

        Returns:
            D of shape (order + 1, order + 1, …, 3) with D[k, l] = ∂^{k+l} S / ∂u^k ∂v^l where k + l ≤ order; the other
            entries are NaN.

        Raises:
            InvalidInputError: another order, or a negative `extend`.

        Example:
            >>> net = [[(0, 0, 0), (0, 3, 0)], [(4, 0, 0), (4, 3, 8)]]
            >>> flat = BSplineSurface([0, 0, 2, 2], [0, 0, 1, 1], 1, 1, net)
            >>> d = flat.derivatives(1.0, 0.5, 2)
            >>> d[1, 0].tolist(), d[0, 1].tolist(), d[1, 1].tolist()
            ([2.0, 0.0, 2.0], [0.0, 3.0, 4.0], [0.0, 0.0, 4.0])
        """
        if order not in (0, 1, 2) or not extend >= 0.0:
            raise InvalidInputError(f"order = {order}, extend = {extend}; allowed are order 0, 1, 2 and extend ≥ 0")
        u, v = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64))
        shape = u.shape
        u, v = np.ravel(u), np.ravel(v)
        inside = np.isfinite(u) & np.isfinite(v)
        for t, (low, high) in ((u, self.domain[0]), (v, self.domain[1])):
            margin = (extend + 1e-12) * (high - low)
            inside &= (t >= low - margin) & (t <= high + margin)
        u, v = np.where(inside, u, self.domain[0][0]), np.where(inside, v, self.domain[1][0])
        result = np.full((order + 1, order + 1, len(u), 3), np.nan)
        for start in range(0, len(u), _CHUNK):
            part = slice(start, start + _CHUNK)
            result[:, :, part] = self._evaluate(u[part], v[part], order)
        result[:, :, ~inside] = np.nan
        for k in range(1, order + 1):
            result[k, order + 1 - k :] = np.nan
        return result.reshape(order + 1, order + 1, *shape, 3)

    def _evaluate(self, u: FloatArray, v: FloatArray, order: int) -> FloatArray:
        """D[k, l] of `derivatives` for finite parameters of shape (N,), and those with k + l > order."""
        borders_u, borders_v, patches = self._patches
        (span_u, local_u), (span_v, local_v) = _in_span(borders_u, u), _in_span(borders_v, v)
        patch = patches[span_u * (len(borders_v) - 1) + span_v]
        along_u = powers(local_u, self.degree_u, order) @ patch.reshape(len(u), self.degree_u + 1, -1)
        along_u = along_u.reshape(len(u), order + 1, self.degree_v + 1, -1)
        sums = np.moveaxis(powers(local_v, self.degree_v, order)[:, None] @ along_u, 0, 2)
        if self.is_rational:
            _divide(sums, order)
        return sums[..., :3]

    @cached_property
    def _patches(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Borders of the spans along u and v, and for each patch between them the surface as a polynomial.

        Shape (patches, degree_u + 1, degree_v + 1, 3 or 4): coefficients of powers of the distances from its middle.
        """
        borders_u, first_u, cu = span_polynomials(self.knots_u, self.degree_u)
        borders_v, first_v, cv = span_polynomials(self.knots_v, self.degree_v)
        net = self._homogeneous[first_u[:, None] + np.arange(self.degree_u + 1)]
        net = net[:, :, first_v[:, None] + np.arange(self.degree_v + 1)]
        patches = np.einsum("tlb,sktbd->stkld", cv, np.einsum("ska,satbd->sktbd", cu, net))
        return borders_u, borders_v, patches.reshape(-1, *patches.shape[2:])

    @cached_property
    def _homogeneous(self) -> FloatArray:
        """The control points (n, m, 3), or (n, m, 4) with w P and w."""
        if self.weights is None:
            return self.control_points
        weights = self.weights[..., None]
        return np.concatenate([self.control_points * weights, weights], axis=2)

    def normal(self, u: ArrayLike, v: ArrayLike, *, extend: float = 0.0) -> FloatArray:
        """Unit normals S_u × S_v / |S_u × S_v|, shape (…, 3); NaN where the derivatives are parallel."""
        d = self.derivatives(u, v, 1, extend=extend)
        normal = np.cross(d[1, 0], d[0, 1])
        length = np.linalg.norm(normal, axis=-1, keepdims=True)
        return normal / np.where(length > 0.0, length, np.nan)

    def isocurve(self, direction: Literal["u", "v"], at: float) -> BSpline:
        """The curve along `direction` at the fixed value `at` of the other parameter, as a spline in space.

        Parameters:
            direction: "u" for u ↦ S(u, at), "v" for v ↦ S(at, v).
            at: within the domain.

        Returns:
            scipy's BSpline with coefficients of shape (n, 3), exact.

        Raises:
            InvalidInputError: a parameter outside the domain; a rational surface (use `point`).
        """
        from scipy.interpolate import BSpline  # takes a while to load

        low, high = self.domain[1 if direction == "u" else 0]
        if self.is_rational or not low <= at <= high:
            raise InvalidInputError(
                f"isocurve at {at} of a {'rational' if self.is_rational else 'polynomial'} surface; allowed are "
                f"polynomial surfaces and {low} ≤ at ≤ {high}; try `point`, which takes both"
            )
        if direction == "u":
            across = BSpline(self.knots_v, np.moveaxis(self.control_points, 1, 0), self.degree_v)
            return BSpline(self.knots_u, across(at), self.degree_u)
        across = BSpline(self.knots_u, self.control_points, self.degree_u)
        return BSpline(self.knots_v, across(at), self.degree_v)

    def transformed(self, matrix: ArrayLike) -> BSplineSurface:
        """The surface under an affine map, a 4 × 4 matrix with last row (0, 0, 0, 1).

        Raises:
            InvalidInputError: another shape, another last row, values that are not finite.
        """
        m = np.asarray(matrix, dtype=np.float64)
        if m.shape != (4, 4) or not np.isfinite(m).all() or not np.array_equal(m[3], (0.0, 0.0, 0.0, 1.0)):
            raise InvalidInputError(f"matrix: got {m.tolist()}; an affine map is 4 × 4, finite, with last row 0 0 0 1")
        points = self.control_points @ m[:3, :3].T + m[:3, 3]
        return BSplineSurface(self.knots_u, self.knots_v, self.degree_u, self.degree_v, points, self.weights)

    def scaled(self, mm_per_unit: float) -> BSplineSurface:
        """The surface in mm, from one whose unit is `mm_per_unit` mm, scaled about the origin."""
        if not (np.isfinite(mm_per_unit) and mm_per_unit > 0.0):
            raise InvalidInputError(f"mm_per_unit = {mm_per_unit}; allowed are finite numbers above 0")
        return self.transformed(np.diag([mm_per_unit, mm_per_unit, mm_per_unit, 1.0]))

    def bounding_box(self) -> tuple[FloatArray, FloatArray]:
        """Least and greatest x, y, z of a box that holds the surface, shapes (3,).

        The hull of the Bézier control points after every span was cut into sixteen, fewer only where there are very many
        spans: at most about 1 % of the distance between surface and control points too large, and never too small.
        """
        borders_u, borders_v, patches = self._patches
        u, v = (
            bezier_rows(borders, degree, int(np.clip(256 // len(borders), 1, 16)))
            for borders, degree in ((borders_u, self.degree_u), (borders_v, self.degree_v))
        )
        patches = patches.reshape(len(u), len(v), *patches.shape[1:])
        points = np.einsum("tbl,stald->stabd", v, np.einsum("sak,stkld->stald", u, patches))
        if self.is_rational:
            points = points[..., :3] / points[..., 3:]
        points = points.reshape(-1, 3)
        return points.min(axis=0), points.max(axis=0)

    @cached_property
    def samples(self) -> SurfaceSamples:
        """A grid of points and derivatives, a few to every span, from which searches start."""
        return SurfaceSamples.of(self)

    def closest_parameters(self, points: ArrayLike, *, extend: float = 0.0) -> tuple[FloatArray, FloatArray]:
        """Parameters of the surface points nearest to `points`: see `batten.surfaces.search.closest_parameters`."""
        from batten.surfaces.search import closest_parameters

        return closest_parameters(self, points, extend=extend)

    def is_graph_over_plan(self) -> bool:
        """Whether z is a single-valued function of x and y on the surface (see `is_graph_along`)."""
        return self.is_graph_along((0.0, 0.0, 1.0))

    def is_graph_along(self, direction: ArrayLike) -> bool:
        """Whether no line along `direction` meets the surface more than once.

        The Jacobian of the projection along `direction` must have one sign on a grid, a few points to a span each way,
        and the projected border must not cross itself: a map of a rectangle with both properties is one to one.

        Parameters:
            direction: shape (3,), not zero.

        Accuracy: a fold smaller than the grid can slip through.
        """
        axis = unit_vector(direction)
        jacobian = np.cross(self.samples.du, self.samples.dv) @ axis
        low, high = float(jacobian.min()), float(jacobian.max())
        if not (low > 1e-9 * high > 0.0 or high < 1e-9 * low < 0.0):
            return False
        frame = perpendicular_frame(axis)
        grid = self.samples.points @ frame.T
        border = np.concatenate([grid[:-1, 0], grid[-1, :-1], grid[:0:-1, -1], grid[0, :0:-1]])
        return not crosses_itself(border)


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Points of a surface on a grid: `u` (a,), `v` (b,), and `points`, `du`, `dv`, each (a, b, 3)."""

    u: FloatArray
    v: FloatArray
    points: FloatArray
    du: FloatArray
    dv: FloatArray

    @staticmethod
    def of(surface: BSplineSurface) -> SurfaceSamples:
        """Eight to thirty-three points to a span each way, fewer only where there are very many spans."""
        u, v = (
            _grid(np.unique(knots[degree : len(knots) - degree]))
            for knots, degree in ((surface.knots_u, surface.degree_u), (surface.knots_v, surface.degree_v))
        )
        d = surface.derivatives(u[:, None], v, 1)
        return SurfaceSamples(u, v, d[0, 0], d[1, 0], d[0, 1])

    def nearest(self, frame: FloatArray, wanted: FloatArray) -> tuple[IntArray, IntArray]:
        """Indices along u and v of the sample next to each row of `wanted`, (N, d), in the coordinates `frame`, (d, 3)."""
        key = frame.tobytes()
        if key not in self._trees:
            if len(self._trees) >= _TREES:
                self._trees.clear()
            self._trees[key] = cKDTree(self.points.reshape(-1, 3) @ frame.T)
        found = np.asarray(self._trees[key].query(wanted)[1], dtype=np.int64)
        return np.divmod(found, len(self.v))

    @cached_property
    def _trees(self) -> dict[bytes, cKDTree]:
        """Search trees by the frame they were built in: most searches go along one direction."""
        return {}


def perpendicular_frame(axis: FloatArray) -> FloatArray:
    """Two unit vectors that complete `axis` to an orthonormal frame, shape (2, 3)."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    first = np.cross(helper, axis)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first)])


def unit_vector(direction: ArrayLike) -> FloatArray:
    """A vector of three numbers, scaled to length 1."""
    d = np.asarray(direction, dtype=np.float64)
    length = float(np.linalg.norm(d))
    if d.shape != (3,) or not (np.isfinite(length) and length > 0.0):
        raise InvalidInputError(f"direction: got {d.tolist()}; allowed is a finite vector (x, y, z) that is not zero")
    return d / length


def _grid(knots: FloatArray) -> FloatArray:
    """Parameters between distinct knots: so many to a span that there are at least 33 in all and at most about 400."""
    spans = len(knots) - 1
    per_span = int(np.clip(400 // spans, 2, max(8, -(-32 // spans))))
    steps = np.arange(per_span) / per_span
    return np.append((knots[:-1, None] + steps * np.diff(knots)[:, None]).ravel(), knots[-1])


def _in_span(borders: FloatArray, t: FloatArray) -> tuple[IntArray, FloatArray]:
    """The span that holds each parameter, and its distance from the span's middle; the end spans reach out for ever."""
    span = np.clip(np.searchsorted(borders, t, side="right") - 1, 0, len(borders) - 2)
    return span, np.asarray(t - 0.5 * (borders[span] + borders[span + 1]))


def _divide(sums: FloatArray, order: int) -> None:
    """From the derivatives of (w S, w), (order + 1, order + 1, N, 4), to those of S, in place (the quotient rule)."""
    w = sums[0, 0, :, 3:].copy()
    point = sums[0, 0, :, :3]
    point /= w
    if order >= 1:
        for k, l in ((1, 0), (0, 1)):
            sums[k, l, :, :3] = (sums[k, l, :, :3] - sums[k, l, :, 3:] * point) / w
    if order >= 2:
        du, dv, wu, wv = sums[1, 0, :, :3], sums[0, 1, :, :3], sums[1, 0, :, 3:], sums[0, 1, :, 3:]
        sums[2, 0, :, :3] = (sums[2, 0, :, :3] - 2.0 * wu * du - sums[2, 0, :, 3:] * point) / w
        sums[0, 2, :, :3] = (sums[0, 2, :, :3] - 2.0 * wv * dv - sums[0, 2, :, 3:] * point) / w
        sums[1, 1, :, :3] = (sums[1, 1, :, :3] - wu * dv - wv * du - sums[1, 1, :, 3:] * point) / w


def crosses_itself(polygon: FloatArray) -> bool:
    """Whether two edges of a closed polygon, (n, 2), that are not neighbours cross."""
    p, q = polygon, np.roll(polygon, -1, axis=0)

    def side(points: FloatArray) -> FloatArray:
        d = q - p
        return d[:, None, 0] * (points[None, :, 1] - p[:, None, 1]) - d[:, None, 1] * (
            points[None, :, 0] - p[:, None, 0]
        )

    apart = side(p) * side(q) < 0.0
    return bool((apart & apart.T).any())
