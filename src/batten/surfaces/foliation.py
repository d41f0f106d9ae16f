"""A surface cut by a family of planes into leaves: plane curves, one for every position of the blade."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from batten.curves.bspline import BSplineCurve
from batten.errors import InvalidInputError
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.plane import Plane
from batten.surfaces.search import parameters_along
from batten.typing import ArrayLike, BoolArray, FloatArray


class Sections(NamedTuple):
    """Plane sections of a surface as functions y(x) in the planes' own coordinates; every array has the same shape (…).

    `y` is the height, `slope` dy/dx, `second` d²y/dx², and (u, v) the surface's parameters. NaN where a plane's line of
    that x misses the surface, or touches it without crossing (derivatives alone).
    """

    y: FloatArray
    slope: FloatArray
    second: FloatArray
    u: FloatArray
    v: FloatArray

    @property
    def curvature(self) -> FloatArray:
        """Curvature y″ / (1 + y′²)^{3/2} of the sections, positive to the left of growing x."""
        return np.asarray(self.second / (1.0 + self.slope**2) ** 1.5)

    @property
    def angle(self) -> FloatArray:
        """Tangent angle atan y′ ∈ (−π/2, π/2), the direction of growing x."""
        return np.arctan(self.slope)


@dataclass(frozen=True, eq=False)
class Leaf:
    """One leaf of a foliation: the section of the surface by one plane, across all the blocks of a row.

    Attributes:
        number: counts from 1 over the whole wall.
        row: row of blocks it belongs to, from 0.
        plane: with `x_axis` along the blade.
        x: abscissae in the plane, shape (n,), ascending.
        section: exact heights, slopes and second derivatives there, arrays of shape (n,).
        curve: the spline through these points, in the plane's coordinates; its first coordinate is linear in its
            parameter. None where the surface is missing on part of the range.
        curve_error: greatest distance in height between curve and surface, measured half-way between the abscissae.
    """

    number: int
    row: int
    plane: Plane
    x: FloatArray
    section: Sections
    curve: BSplineCurve | None
    curve_error: float

    @property
    def points(self) -> FloatArray:
        """The exact points in the plane's coordinates, shape (n, 2)."""
        return np.stack([self.x, self.section.y], axis=-1)

    @property
    def complete(self) -> bool:
        """Whether the surface was met at every abscissa."""
        return self.curve is not None


def intersect_planes(
    surface: BSplineSurface,
    planes: Sequence[Plane],
    x: ArrayLike,
    *,
    order: Literal[1, 2] = 2,
    extend: float = 0.0,
) -> Sections:
    """Sections of a surface by planes at given abscissae, with exact first and second derivatives.

    Solves (S(u, v) − plane.to_world(x, 0)) ⊥ x_axis, normal for (u, v). With J the two rows ∂(u,v) of these two
    coordinates, J (u′, v′) = (1, 0) and J (u″, v″) = −(S_uu u′² + 2 S_uv u′v′ + S_vv v′²) in the same coordinates; y′ and
    y″ follow by the chain rule.

    Parameters:
        surface: single-valued along the planes' y axes (`is_graph_along`), or see `parameters_along`.
        planes: m planes in any position.
        x: shape (n,) for the same abscissae in all planes, or (m, n).
        order: 1 to do without the second derivatives, which are NaN then.
        extend: how far to continue the surface beyond its domain (see `BSplineSurface`).

    Returns:
        Arrays of shape (m, n).

    Raises:
        InvalidInputError: abscissae of another shape.

    Accuracy: points lie on the surface and in the plane to 1e-13 of the surface's size.

    Example:
        >>> flat = BSplineSurface([0, 0, 2, 2], [0, 0, 1, 1], 1, 1, [[(0, 0, 0), (0, 3, 0)], [(4, 0, 0), (4, 3, 8)]])
        >>> s = intersect_planes(flat, [Plane((0, 1.5, 0), (1, 0, 0), (0, 0, 1))], [1.0, 3.0, 5.0])
        >>> s.y.tolist(), s.slope.tolist()
        ([[1.0, 3.0, nan]], [[1.0, 1.0, nan]])
    """
    x = np.asarray(x, dtype=np.float64)
    if x.ndim not in (1, 2) or (x.ndim == 2 and len(x) != len(planes)):
        raise InvalidInputError(
            f"x: got shape {x.shape} for {len(planes)} planes; allowed are (n,) and ({len(planes)}, n)"
        )
    x = np.broadcast_to(x, (len(planes), x.shape[-1]))
    u, v = np.full(x.shape, np.nan), np.full(x.shape, np.nan)
    groups: dict[tuple[float, ...], list[int]] = {}
    for i, plane in enumerate(planes):
        groups.setdefault(tuple(plane.y_axis.tolist()), []).append(i)
    for direction, members in groups.items():
        points = np.stack([planes[i].to_world(np.stack([x[i], np.zeros_like(x[i])], axis=-1)) for i in members])
        u[members], v[members] = parameters_along(surface, points, direction, extend=extend)
    frames = np.array([(p.x_axis, p.y_axis, p.normal) for p in planes]).reshape(-1, 3, 3)
    origins = np.array([p.origin for p in planes]).reshape(-1, 1, 3)
    # Points and derivatives in the coordinates (x, y, normal) of each plane.
    d = surface.derivatives(u, v, order, extend=extend + 1e-9)
    d[0, 0] -= origins
    d = np.moveaxis(d @ frames.transpose(0, 2, 1), -1, 2)
    y, du, dv = d[0, 0, 1], d[1, 0], d[0, 1]
    determinant = du[0] * dv[2] - dv[0] * du[2]
    determinant = np.where(determinant == 0.0, np.nan, determinant)
    u1, v1 = dv[2] / determinant, -du[2] / determinant
    slope = du[1] * u1 + dv[1] * v1
    if order == 1:
        return Sections(y, slope, np.full(y.shape, np.nan), u, v)
    bend = d[2, 0] * u1**2 + 2.0 * d[1, 1] * u1 * v1 + d[0, 2] * v1**2
    u2 = (dv[0] * bend[2] - dv[2] * bend[0]) / determinant
    v2 = (du[2] * bend[0] - du[0] * bend[2]) / determinant
    return Sections(y, slope, du[1] * u2 + dv[1] * v2 + bend[1], u, v)


def plane_leaf(
    surface: BSplineSurface,
    plane: Plane,
    x_range: ArrayLike,
    *,
    n: int = 101,
    number: int = 1,
    row: int = 0,
    tolerance: float | None = None,
    extend: float = 0.0,
) -> Leaf:
    """The leaf that one plane cuts from a surface: `foliate` for one plane, where everything is explained.

    Parameters:
        surface: single-valued along the plane's y axis.
        plane: any position.
        x_range: (least, greatest) abscissa in the plane.
        n: number of abscissae.
        number: the leaf's number.
        row: its row of blocks.
        tolerance: bound for `curve_error`; None to measure it only.
        extend: how far to continue the surface.

    Returns:
        The leaf.
    """
    return foliate(surface, [plane], x_range, n, rows=[row], first_number=number, tolerance=tolerance, extend=extend)[0]


def foliate(
    surface: BSplineSurface,
    planes: Sequence[Plane],
    x_range: ArrayLike,
    n: int = 101,
    *,
    rows: Sequence[int] | None = None,
    first_number: int = 1,
    tolerance: float | None = None,
    extend: float = 0.0,
) -> tuple[Leaf, ...]:
    """The leaves that planes cut from a surface (Fisker2018 §5.4.2, §5.4.3), all at once.

    Parameters:
        surface: single-valued along the planes' y axes.
        planes: m planes in any position, one for each leaf.
        x_range: (least, greatest) abscissa, shape (2,) for all planes or (m, 2).
        n: number of abscissae, evenly spaced, at least 4.
        rows: row of blocks for each plane; all 0 if None.
        first_number: number of the first leaf.
        tolerance: if given, leaves whose curve strays farther from the surface get twice as many intervals, up to five
            times over; `curve_error` says what was reached.
        extend: how far to continue the surface beyond its domain (see `BSplineSurface`).

    Returns:
        One leaf for each plane, in order; a plane that misses the surface somewhere on its range gives a leaf with NaN
        there and `curve` None, and spoils no other.

    Raises:
        InvalidInputError: too few abscissae, an empty or infinite range, rows that do not match.

    Accuracy: the points are exact (see `intersect_planes`); the curve's error falls with the fourth power of the
    spacing, and with the third across the inner knots of a cubic surface.
    """
    ranges = np.asarray(x_range, dtype=np.float64)
    if ranges.shape not in ((2,), (len(planes), 2)) or not np.isfinite(ranges).all() or (np.diff(ranges) <= 0.0).any():
        raise InvalidInputError(
            f"x_range: got {ranges.tolist()}; allowed are finite (least, greatest), one or one a plane"
        )
    if n < 4 or (rows is not None and len(rows) != len(planes)):
        raise InvalidInputError(
            f"n = {n}, {None if rows is None else len(rows)} rows; allowed are n ≥ 4, {len(planes)} rows"
        )
    ranges = np.broadcast_to(ranges, (len(planes), 2))
    leaves: dict[int, Leaf] = {}
    pending = list(range(len(planes)))
    for _ in range(6):
        if not pending:
            break
        x = ranges[pending, :1] + np.linspace(0.0, 1.0, 2 * n - 1) * np.diff(ranges[pending])
        sections = intersect_planes(surface, [planes[i] for i in pending], x, extend=extend)
        for i, abscissae, *columns in zip(pending, x, *sections):
            fine = Sections(*columns)
            nodes = Sections(*(c[::2] for c in fine))
            curve, error = _spline_through(abscissae, fine.y)
            row = 0 if rows is None else rows[i]
            leaves[i] = Leaf(first_number + i, row, planes[i], abscissae[::2], nodes, curve, error)
        pending = [i for i in pending if tolerance is not None and leaves[i].curve_error > tolerance]
        n = 2 * n - 1
    return tuple(leaves[i] for i in range(len(planes)))


def _spline_through(x: FloatArray, y: FloatArray) -> tuple[BSplineCurve | None, float]:
    """The spline through every other point, and its greatest distance in height from the points between them."""
    if not np.isfinite(y).all():
        return None, float("nan")
    t = np.linspace(0.0, 1.0, len(x))
    curve = BSplineCurve.interpolate(np.stack([x[::2], y[::2]], axis=-1), t[::2])
    return curve, float(np.abs(curve.point(t[1::2])[:, 1] - y[1::2]).max())


def blade_directions(blade_axis: Literal["x", "y"], turn_rad: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Unit vectors in plan along the blade and across it, shapes (2,), for planes turned counter-clockwise by `turn_rad`.

    Across is +y turned for a blade along x, and +x turned for a blade along y: the way offsets count.
    """
    c, s = float(np.cos(turn_rad)), float(np.sin(turn_rad))
    if blade_axis == "x":
        return np.array([c, s]), np.array([-s, c])
    if blade_axis == "y":
        return np.array([-s, c]), np.array([c, s])
    raise InvalidInputError(f"blade_axis = {blade_axis!r}; allowed are 'x' and 'y'")


def parallel_planes(
    blade_axis: Literal["x", "y"], offsets: ArrayLike, *, turn_rad: float = 0.0, centre: ArrayLike = (0.0, 0.0)
) -> tuple[Plane, ...]:
    """Parallel vertical planes, turned together about a vertical axis (Fisker2018 §5.4.3, Solution 1).

    Parameters:
        blade_axis: the wall axis along which the planes lie before they are turned.
        offsets: shape (m,), signed distances of the planes from `centre`: towards +y for a blade along x, towards +x for
            a blade along y, before the turn.
        turn_rad: angle of the turn, radians, counter-clockwise seen from above.
        centre: (x, y) of the axis of the turn; also the point from whose foot in each plane its x is counted. At the
            origin and without turn the plane's x is the wall's x (or y).

    Returns:
        m planes with `x_axis` along the blade and `y_axis` = (0, 0, 1).

    Raises:
        InvalidInputError: another axis; values that are not finite.

    Example:
        >>> [p.origin.tolist() for p in parallel_planes("x", [10.0, 30.0])]
        [[0.0, 10.0, 0.0], [0.0, 30.0, 0.0]]
    """
    along, across = blade_directions(blade_axis, turn_rad)
    middle = np.asarray(centre, dtype=np.float64).reshape(2)
    return tuple(
        Plane(np.append(middle + offset * across, 0.0), np.append(along, 0.0), np.array([0.0, 0.0, 1.0]))
        for offset in np.asarray(offsets, dtype=np.float64).reshape(-1)
    )


def covering_offsets(
    blade_axis: Literal["x", "y"], rectangle: ArrayLike, spacing: float, *, turn_rad: float = 0.0
) -> FloatArray:
    """Offsets of parallel planes that cover a rectangle in plan, for `parallel_planes` about its centre.

    Parameters:
        blade_axis: as there.
        rectangle: [[x₀, y₀], [x₁, y₁]], least and greatest corner.
        spacing: greatest distance between neighbouring planes; it is made smaller so that a whole number fits.
        turn_rad: as there. The outermost planes run along the rectangle's border, or touch a corner where turned.

    Returns:
        Offsets, ascending and evenly spaced, shape (m,).

    Raises:
        InvalidInputError: a rectangle without area, a spacing that is not above 0.

    Example:
        >>> covering_offsets("x", [[0, 0], [3000, 600]], 200.0).tolist()
        [-300.0, -100.0, 100.0, 300.0]
    """
    corners = _rectangles(np.asarray(rectangle, dtype=np.float64)[None])[0]
    if not (np.isfinite(spacing) and spacing > 0.0):
        raise InvalidInputError(f"spacing = {spacing}; allowed are finite numbers above 0")
    across = np.abs(blade_directions(blade_axis, turn_rad)[1])
    half = 0.5 * float(across @ (corners[1] - corners[0]))
    count = max(1, int(np.ceil(2.0 * half / spacing - 1e-9)))
    return np.linspace(-half, half, count + 1)


def clip_to_blocks(planes: Sequence[Plane], rectangles: ArrayLike) -> FloatArray:
    """For every vertical plane and every block, the interval of the plane's x inside the block's plan rectangle.

    Parameters:
        planes: k planes whose y axis is vertical.
        rectangles: shape (m, 2, 2), [[x₀, y₀], [x₁, y₁]] of each block.

    Returns:
        Shape (k, m, 2): from, to; NaN where the plane does not cross the block, or touches a corner only. A plane along
        the border between two blocks belongs to both.

    Raises:
        InvalidInputError: a plane that is not vertical, rectangles without area.

    Example:
        >>> planes = parallel_planes("x", [300.0, 600.0])
        >>> clip_to_blocks(planes, [[[0, 0], [600, 600]], [[600, 600], [1200, 1200]]])[:, :, :].tolist()
        [[[0.0, 600.0], [nan, nan]], [[0.0, 600.0], [600.0, 1200.0]]]
    """
    boxes = _rectangles(rectangles)
    origins = np.array([p.origin[:2] for p in planes]).reshape(-1, 1, 2)
    along = np.array([p.x_axis[:2] for p in planes]).reshape(-1, 1, 2)
    for i, plane in enumerate(planes):
        if not np.hypot(*plane.y_axis[:2]) < 1e-9:
            raise InvalidInputError(f"plane {i}: its y axis is {plane.y_axis.tolist()}; allowed are vertical planes")
    rounding = 1e-9 * float(np.abs(boxes).max())
    parallel: BoolArray = np.abs(along) < 1e-12
    speed = np.where(parallel, 1.0, along)
    ends = (boxes[None] - origins[:, :, None]) / speed[:, :, None]
    low, high = ends.min(axis=2), ends.max(axis=2)
    between = (origins >= boxes[:, 0] - rounding) & (origins <= boxes[:, 1] + rounding)
    low = np.where(parallel, np.where(between, -np.inf, np.inf), low).max(axis=2)
    high = np.where(parallel, np.where(between, np.inf, -np.inf), high).min(axis=2)
    crossed = high - low > rounding
    return np.where(crossed[..., None], np.stack([low, high], axis=-1), np.nan)


def _rectangles(rectangles: ArrayLike) -> FloatArray:
    boxes = np.asarray(rectangles, dtype=np.float64)
    if (
        boxes.ndim != 3
        or boxes.shape[1:] != (2, 2)
        or not (np.isfinite(boxes).all() and (boxes[:, 1] > boxes[:, 0]).all())
    ):
        raise InvalidInputError(
            f"rectangles: got shape {boxes.shape}; allowed is (m, 2, 2), each [[x₀, y₀], [x₁, y₁]] with x₀ < x₁, y₀ < y₁"
        )
    return boxes
