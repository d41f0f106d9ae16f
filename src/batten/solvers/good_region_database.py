"""The papers' way to good regions: a database of cubic Béziers close to elastica, searched for each active point."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from batten.curves.cubic_proxy import CubicProxy
from batten.errors import InvalidInputError
from batten.kernels.elastica import states_grid
from batten.kernels.elastica_fit_batch import guess_batch
from batten.measures.curvature_fit import cubic_array
from batten.measures.lambda_residual import lambda_residual
from batten.measures.lambda_residual_gradient import lambda_residual_gradient
from batten.solvers.alpha_shape import AlphaShape, alpha_shape
from batten.solvers.curve_samples import samples_of
from batten.solvers.good_region import ANGLE_ERROR_BELOW, RESIDUAL_BELOW
from batten.solvers.region_polygons import Polygon, inside_polygons
from batten.typing import ArrayLike, BoolArray, FloatArray

#: The grids, which the thesis does not print: spacing and extent in units of |c₃ − c₄|, and into how many squares a side a
#: cell is divided in each quarter of ‖∇e_λ‖, the lowest first. They give 385,000 rows.
SPACING, CELLS, SUBDIVISIONS = 0.25, 17, (1, 2, 3, 4)
#: Default radius of the search, and of the α-shape, in spacings: of those that were tried, 0.4 … 1.04 and 0.7 … 1.4, the
#: two with which the regions agree best with computed ones. A smaller search leaves gaps, a larger one blurs.
SEARCH_RADIUS, SHAPE_RADIUS = 0.5, 1.2
COLUMNS = ("c0_x", "c0_y", "c2_x", "c2_y", "residual", "angle_error")
"""What stands in a row of the database."""

_RESIDUAL_TOLERANCE = 1e-4
_CHUNK = 16_384


def angle_error(control_points: ArrayLike, *, nodes: int = 32) -> FloatArray:
    """The greatest difference between the end tangents of cubic Béziers and those of their first guesses: Fisker2018 §5.2.

    Parameters:
        control_points: shape (…, 4, 2). nodes: Gauss nodes of the first guess, see `initial_elastica`.

    Returns:
        Angles in [0, π], radians, shape (…); 0 for straight lines.

    Raises:
        InvalidInputError: an array of another shape.

    Accuracy: where e_λ < 0.21, 32 nodes and 64 lie on different sides of 6° for one curve in 10,000.
    Degenerate cases: NaN where there is no first guess.

    Example:
        >>> round(float(angle_error([(0, 0), (0.1, 0.7), (0.9, 0.7), (1, 0)])), 4)
        0.0004
    """
    control = cubic_array(control_points)
    rows = control.reshape(-1, 4, 2)
    out = np.empty(len(rows))
    for i in range(0, len(rows), _CHUNK):
        samples = samples_of(rows[i : i + _CHUNK], nodes=nodes)[0]
        count = len(samples)
        guesses, info, status = np.empty((count, 7)), np.empty((count, 4)), np.empty(count, dtype=np.int64)
        guess_batch(
            samples.points, samples.angles, samples.curvatures, samples.weights, samples.fractions, samples.lengths,
            samples.ends, guesses, info, status,
        )  # fmt: skip
        states = np.empty((count, 2, 4))
        states_grid(guesses, np.stack([np.zeros(count), guesses[:, 6]], axis=1), states)
        turn = states[:, :, 2] - samples.ends[:, :, 2]
        out[i : i + count] = np.abs(turn - 2.0 * np.pi * np.round(turn / (2.0 * np.pi))).max(axis=1)
    return out.reshape(control.shape[:-2])


class RefinedGrid(NamedTuple):
    """Places of one control point while the other stands still: Fisker2018 §5.2, Fig. 5.6.

    Attributes:
        coarse: (n, 2), centres of the uniform grid's cells. gradients: (n,), ‖∇e_λ‖ there, by the point that moves.
        fine: (m, 2), centres after the cells are divided.
    """

    coarse: FloatArray
    gradients: FloatArray
    fine: FloatArray


def standard_cubics(c1: ArrayLike, c2: ArrayLike) -> FloatArray:
    """Cubics (…, 4, 2) in the standard position of Fisker2018 §5.2, c₃ = (0, 1) and c₄ = (0, 0)."""
    first, second = np.broadcast_arrays(np.asarray(c1, dtype=np.float64), np.asarray(c2, dtype=np.float64))
    out = np.zeros((*first.shape[:-1], 4, 2))
    out[..., 0, :], out[..., 1, :], out[..., 2, 1] = first, second, 1.0
    return out


def refined_grid(place: ArrayLike, moving: int, *, spacing: float = SPACING, cells: int = CELLS,
                 subdivisions: tuple[int, int, int, int] = SUBDIVISIONS) -> RefinedGrid:  # fmt: skip
    """The grid of one control point for a place of the other, finer where e_λ varies quickly: Fisker2018 §5.2.

    The 25th, 50th and 75th percentile of ‖∇e_λ‖ part the cells of the uniform grid into four kinds; those of kind i are
    divided into subdivisions[i]² squares. Cells whose centre gives a cusp or a line, with no gradient, are of the last.

    Parameters:
        place: of the other control point, in standard position. moving: 1 or 2, the point that the grid is for.
        spacing, cells, subdivisions: as in `build_good_region_database`.

    Returns:
        A `RefinedGrid`.

    Raises:
        InvalidInputError: another number, another shape.
    """
    other = np.asarray(place, dtype=np.float64)
    if moving not in (1, 2) or other.shape != (2,):
        raise InvalidInputError(
            f"the grid is for point 1 or 2, beside one place of shape (2,); got {moving!r}, {other.shape}"
        )
    coarse = _cell_centres(-cells, cells, -cells, cells, spacing)
    pair = (coarse, other) if moving == 1 else (other, coarse)
    _, gradient = lambda_residual_gradient(standard_cubics(*pair), tolerance=None)
    size = np.hypot(*gradient[:, moving - 1].T)
    quick = np.where(np.isnan(size), np.inf, size)
    kind = np.searchsorted(np.percentile(quick, [25.0, 50.0, 75.0]), quick, side="right")
    fine = []
    for i, m in enumerate(subdivisions):
        part = ((np.arange(m) + 0.5) / m - 0.5) * spacing
        offsets = np.stack(np.meshgrid(part, part, indexing="ij"), axis=-1).reshape(-1, 2)
        fine.append((coarse[kind == i, None] + offsets).reshape(-1, 2))
    return RefinedGrid(coarse, size, np.concatenate(fine))


def _cell_centres(left: int, right: int, low: int, high: int, spacing: float) -> FloatArray:
    """Centres of square cells whose borders are multiples of the spacing; the y-axis, on which lines lie, is a border."""
    x, y = (np.arange(left, right) + 0.5) * spacing, (np.arange(low, high) + 0.5) * spacing + 0.5
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)


@dataclass(frozen=True, eq=False)
class GoodRegionDatabase:
    """Cubic Béziers close to elastica, in standard position c₃ = (0, 1), c₄ = (0, 0): Fisker2018 §5.2.

    `build_good_region_database` makes it, `io.good_region_database_files` keeps it. Mirror images in the y-axis belong to
    it though they are not stored.

    Attributes:
        rows: (n, 6), the numbers named in `COLUMNS`; c₀ = 2c₁ − c₂ is the control point before the joint c₁ of a C¹ spline,
            the angle error is in radians.
        spacing: of the uniform grids. cells: they cover |x| ≤ cells × spacing, |y − ½| ≤ cells × spacing.
        residual_below, angle_error_below: limits of e_λ and the angle error, met by all rows.
    """

    rows: FloatArray
    spacing: float
    cells: int
    residual_below: float
    angle_error_below: float

    @cached_property
    def points(self) -> dict[str, FloatArray]:
        """The places of "c0", "c1" and "c2", each (n, 2)."""
        c0, c2 = self.rows[:, 0:2], self.rows[:, 2:4]
        return {n: np.ascontiguousarray(p) for n, p in (("c0", c0), ("c1", 0.5 * (c0 + c2)), ("c2", c2))}

    @cached_property
    def _trees(self) -> dict[str, Any]:
        from scipy.spatial import cKDTree  # takes a while to load

        return {name: cKDTree(places) for name, places in self.points.items()}

    def matches(self, active: str, fixed: str, place: ArrayLike, radius: float | None = None) -> FloatArray:
        """Where one point lies in those curves whose other point is near a place: Fisker2018 §5.2, step 2.

        Mirror images count too.

        Parameters:
            active, fixed: "c0", "c1" or "c2". place: shape (2,), of the fixed point in standard position.
            radius: how near, in units of |c₃ − c₄|; None takes half a spacing. The thesis's own program takes 0.26.

        Returns:
            Different places (m, 2), sorted; none where the database has no such curve.

        Raises:
            InvalidInputError: other names, another shape, a radius that is not positive.
        """
        at = np.asarray(place, dtype=np.float64)
        near = SEARCH_RADIUS * self.spacing if radius is None else float(radius)
        names = self.points.keys()
        if at.shape != (2,) or not near > 0.0 or active not in names or fixed not in names:
            raise InvalidInputError(
                f"matches are sought for two of {sorted(names)}, a place of shape (2,) and a radius > 0; got {active!r}, "
                f"{fixed!r}, shape {at.shape} and {radius}"
            )
        mirror = np.array([-1.0, 1.0])
        tree, places = self._trees[fixed], self.points[active]
        found = [places[tree.query_ball_point(at, near)], places[tree.query_ball_point(at * mirror, near)] * mirror]
        return np.unique(np.concatenate(found).round(12), axis=0)


def build_good_region_database(
    *,
    spacing: float = SPACING,
    cells: int = CELLS,
    subdivisions: tuple[int, int, int, int] = SUBDIVISIONS,
    residual_below: float = RESIDUAL_BELOW,
    angle_error_below: float = ANGLE_ERROR_BELOW,
    progress: Callable[[str, int, int], None] | None = None,
) -> GoodRegionDatabase:
    """The database of Fisker2018 §5.2, from two sets of cubics in standard position.

    In the first set c₁ takes the centres of a uniform grid's cells in the left two quadrants, x < 0, and for each of them
    c₂ the places of `refined_grid`, in all quadrants; in the second set the same the other way round. Rows within both
    limits are kept. The thesis prints neither the grids nor how far a cell is divided.

    Parameters:
        spacing: of the uniform grids, in units of |c₃ − c₄|, > 0. cells: on each side of the middle, ≥ 1.
        subdivisions: squares a side, for each quarter of ‖∇e_λ‖, the lowest first.
        residual_below: limit of e_λ. angle_error_below: limit of the angle error, radians.
        progress: called as progress(stage, done, total).

    Returns:
        A `GoodRegionDatabase`; the same numbers always. The defaults give about 385,000 rows, as in the thesis.

    Raises:
        InvalidInputError: parameters out of range.

    Accuracy: e_λ to 1e-4, the angle error as in `angle_error`.

    Example:
        >>> database = build_good_region_database(spacing=0.8, cells=5)
        >>> len(database.rows) > 1000, bool(database.rows[:, 4].max() < 0.21)
        (True, True)
    """
    if not (0.0 < spacing < math.inf and cells >= 1 and len(subdivisions) == 4 and min(subdivisions) >= 1):
        raise InvalidInputError(
            "a database needs a spacing > 0, cells ≥ 1 and four subdivisions ≥ 1; "
            f"got {spacing}, {cells}, {subdivisions}"
        )
    left = _cell_centres(-cells, 0, -cells, cells, spacing)
    kept = []
    for moving in (2, 1):
        for i, place in enumerate(left):
            fine = refined_grid(place, moving, spacing=spacing, cells=cells, subdivisions=subdivisions).fine
            control = standard_cubics(place, fine) if moving == 2 else standard_cubics(fine, place)
            residual = lambda_residual(control, tolerance=_RESIDUAL_TOLERANCE)
            close = residual < residual_below
            control = control[close]
            error = angle_error(control)
            good = error < angle_error_below
            c1, c2 = control[good, 0], control[good, 1]
            kept.append(np.column_stack([2.0 * c1 - c2, c2, residual[close][good], error[good]]))
            if progress is not None:
                progress("database", (2 - moving) * len(left) + i + 1, 2 * len(left))
    return GoodRegionDatabase(np.concatenate(kept), spacing, cells, residual_below, angle_error_below)


class DatabaseRole(NamedTuple):
    """What one affected piece of a C¹ spline looks for in the database: see `database_roles`.

    Attributes:
        piece: its number. active, fixed: names of the point that moves and of the one that is looked up. place: (2,), the
            fixed point in standard position. origin, unit: complex; standard position z is at origin + unit · z.
    """

    piece: int
    active: str
    fixed: str
    place: FloatArray
    origin: complex
    unit: complex


def database_roles(proxy: CubicProxy, index: int) -> list[DatabaseRole]:
    """The standard positions of the pieces that a control point of a C¹ spline affects: Fisker2018 §5.2, step 1.

    c₃ and c₄ are the two Bézier points that stay, so some pieces are run through backwards. At the spline's ends c₁ itself
    is a control point and takes the place of c₀.

    Raises:
        InvalidInputError: a spline of continuity 2 or with borders, an unknown control point, or an affected piece whose
            points c₃ and c₄ coincide.
    """
    if proxy.continuity != 1 or proxy.borders is not None:
        raise InvalidInputError(
            "the database gives regions of C¹ splines without borders, as in Fisker2018 §5.2; use "
            "solvers.good_region.good_region for others"
        )
    last = proxy.piece_count - 1
    out = []
    for piece in proxy.affected_pieces(index).tolist():
        for backwards in (False, True):
            before, second = (2 * piece + 3, 2 * piece + 2) if backwards else (2 * piece, 2 * piece + 1)
            if index not in (before, second):
                continue
            end = "c1" if piece == (last if backwards else 0) else "c0"
            active, fixed, looked_up = (end, "c2", second) if index == before else ("c2", end, before)
            points = proxy.pieces[piece][::-1] if backwards else proxy.pieces[piece]
            (c3x, c3y), (c4x, c4y) = points[2:].tolist()
            if c3x == c4x and c3y == c4y:
                raise InvalidInputError(
                    f"the end handle of piece {piece} has length zero, so it has no standard position; move control point "
                    f"{2 * piece + 1 if backwards else 2 * piece + 2} first"
                )
            origin = complex(c4x, c4y)
            unit = -1j * (complex(c3x, c3y) - origin)
            z = (complex(*proxy.control_points[looked_up].tolist()) - origin) / unit
            out.append(DatabaseRole(piece, active, fixed, np.array([z.real, z.imag]), origin, unit))
    return out


@dataclass(frozen=True, eq=False)
class DatabaseRegion:
    """What `database_region` returns.

    Attributes:
        polygons: each with an outer ring, counter-clockwise, and holes, clockwise, as in `GoodRegion`; the largest first.
        shapes: the region of each affected piece. roles: what was looked up for it.
    """

    polygons: tuple[Polygon, ...]
    shapes: tuple[AlphaShape, ...]
    roles: tuple[DatabaseRole, ...]

    @property
    def area(self) -> float:
        """The area of the polygons less that of their holes."""
        return float(sum(polygon.area for polygon in self.polygons))

    def contains(self, points: ArrayLike) -> BoolArray:
        """Which points, shape (…, 2), lie in the region; on the border either."""
        return inside_polygons(self.polygons, np.asarray(points, dtype=np.float64))


def database_region(
    database: GoodRegionDatabase,
    proxy: CubicProxy,
    index: int,
    *,
    search_radius: float | None = None,
    shape_radius: float | None = None,
) -> DatabaseRegion:
    """Where a control point of a C¹ spline may be, looked up in the database: Fisker2018 §5.2, steps 1–3.

    The region of one piece is the α-shape of the places that `GoodRegionDatabase.matches` gives. That of two is the α-shape
    of the places of each that lie in the other's shape, together with the points where the two borders cross.

    Parameters:
        database: from `build_good_region_database`. proxy: the spline. index: of the active control point.
        search_radius: see `matches`. A larger one finds more places but blurs the region by what it tolerates.
        shape_radius: of the α-shapes, in units of |c₃ − c₄| of each piece; None takes
            1.2 spacings.

    Returns:
        A `DatabaseRegion`, empty where the database has no match: it reaches no further than its grids.

    Raises:
        InvalidInputError: as `database_roles` and `matches`.

    Accuracy: none is guaranteed. `studies.regions` measures how much the region differs from `good_region`: the median
    symmetric difference is a quarter of the union.
    Degenerate cases: near a straight spline e_λ depends on the shape of what is left of a deviation and not on its size, and
    the grids hold no line itself; its own place may be missing.

    Example:
        >>> database = build_good_region_database(spacing=0.5, cells=8)
        >>> proxy = CubicProxy([(0, 0), (1, 1), (3, 1), (5, -1), (7, -1), (8, 0)])
        >>> database_region(database, proxy, 2).contains([(3.0, 1.0), (3.0, 5.0)]).tolist()
        [True, False]
    """
    roles = database_roles(proxy, index)
    around = SHAPE_RADIUS * database.spacing if shape_radius is None else shape_radius
    clouds, shapes, radii = [], [], []
    for role in roles:
        found = database.matches(role.active, role.fixed, role.place, search_radius)
        placed = role.origin + role.unit * (found[:, 0] + 1j * found[:, 1])
        clouds.append(np.stack([placed.real, placed.imag], axis=-1))
        radii.append(around * abs(role.unit))
        shapes.append(alpha_shape(clouds[-1], radii[-1]))
    common = shapes[0]
    if len(shapes) == 2:
        first, second = shapes
        inside = [clouds[0][second.contains(clouds[0])], clouds[1][first.contains(clouds[1])]]
        crossings = border_crossings(first.rings, second.rings)
        common = alpha_shape(np.concatenate([*inside, crossings]), max(radii))
    return DatabaseRegion(common.polygons, tuple(shapes), tuple(roles))


def border_crossings(first: tuple[FloatArray, ...], second: tuple[FloatArray, ...]) -> FloatArray:
    """The points (m, 2) where edges of polygons cross edges of others."""
    if not first or not second:
        return np.empty((0, 2))
    (a, u), (b, v) = (
        (np.concatenate(rings), np.concatenate([np.roll(r, -1, axis=0) - r for r in rings]))
        for rings in (first, second)
    )
    away = b[None] - a[:, None]
    turned = u[:, None, 0] * v[None, :, 1] - u[:, None, 1] * v[None, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (away[..., 0] * v[:, 1] - away[..., 1] * v[:, 0]) / turned
        across = (away[..., 0] * u[:, None, 1] - away[..., 1] * u[:, None, 0]) / turned
        i, j = np.nonzero((along >= 0.0) & (along <= 1.0) & (across >= 0.0) & (across <= 1.0))
    return a[i] + along[i, j, None] * u[i]
