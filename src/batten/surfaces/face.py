"""A face: a B-spline surface, or the part of one that closed curves in its parameter plane leave of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from batten.errors import InvalidInputError
from batten.surfaces.bspline_basis import rewrite
from batten.surfaces.bspline_surface import BSplineSurface
from batten.typing import ArrayLike, BoolArray, FloatArray

_ON_BORDER = 1e-9  # of the domain's width: so close to its border counts as on it
_CHORD = 1e-4  # of the surface's size: how far an outline may stray if nothing else is asked for
_HALVINGS = 12  # of a side of an outline, at most
_NODES = 12  # of Gauss–Legendre along each smooth piece
_FEW_NODES = 3  # across a strip that is narrow
_CHUNK = 4096  # intervals integrated at a time


@dataclass(frozen=True, eq=False)
class Face:
    """The points S(u, v) of a surface whose parameters lie inside its trims, by the even-odd rule.

    Parameters:
        surface: the whole surface.
        trims: closed polygons in the parameter plane, each of shape (k, 2), k ≥ 3, without the first corner again at the
            end, in any sense of turning; a point is inside if a ray from it crosses their sides an odd number of times,
            so that a polygon inside another is a hole. () for the whole surface.
        name: as the file calls it, or ''.

    Raises:
        InvalidInputError: polygons of another shape, or with corners outside the surface's domain.

    Example:
        >>> flat = BSplineSurface([0, 0, 2, 2], [0, 0, 1, 1], 1, 1, [[(0, 0, 0), (0, 3, 0)], [(4, 0, 0), (4, 3, 0)]])
        >>> face = Face(flat, ([(0, 0), (2, 0), (0, 1)],))
        >>> face.contains([0.5, 1.5], 0.5).tolist()
        [True, False]
        >>> round(face.area(), 9), round(Face(flat).area(), 9)
        (6.0, 12.0)
    """

    surface: BSplineSurface
    trims: tuple[FloatArray, ...] = ()
    name: str = ""

    def __post_init__(self) -> None:
        low, high = np.array(self.surface.domain).T
        slack = _ON_BORDER * (high - low)
        polygons: list[FloatArray] = []
        for i, trim in enumerate(self.trims):
            polygon = np.array(trim, dtype=np.float64)
            if polygon.ndim == 2 and len(polygon) > 1 and np.array_equal(polygon[0], polygon[-1]):
                polygon = polygon[:-1]
            if polygon.ndim != 2 or polygon.shape[1] != 2 or len(polygon) < 3:
                raise InvalidInputError(f"trim {i}: got shape {polygon.shape}; allowed is (k, 2) with k ≥ 3")
            if not ((polygon >= low - slack) & (polygon <= high + slack)).all():
                raise InvalidInputError(
                    f"trim {i}: its corners reach from {polygon.min(axis=0).tolist()} to {polygon.max(axis=0).tolist()}; "
                    f"the surface's domain is {low.tolist()} to {high.tolist()}: clip the trims to it"
                )
            polygon = np.clip(polygon, low, high)
            polygon.setflags(write=False)
            polygons.append(polygon)
        object.__setattr__(self, "trims", tuple(polygons))

    @property
    def is_trimmed(self) -> bool:
        """Whether there are trims."""
        return bool(self.trims)

    def contains(self, u: ArrayLike, v: ArrayLike) -> BoolArray:
        """Whether points of the parameter plane lie on the face.

        Parameters:
            u, v: shapes that broadcast to (…).

        Returns:
            Shape (…); False outside the domain and for NaN. The domain's own border is inside, where a trim runs along
            it too; on any other side of a trim the answer is either.
        """
        u, v = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64))
        (u0, u1), (v0, v1) = self.surface.domain
        du, dv = _ON_BORDER * (u1 - u0), _ON_BORDER * (v1 - v0)
        with np.errstate(invalid="ignore"):
            inside = np.asarray((u >= u0 - du) & (u <= u1 + du) & (v >= v0 - dv) & (v <= v1 + dv))
        if not self.trims or not inside.any():
            return inside
        odd = _odd(self.trims, np.clip(u[inside], u0 + du, u1 - du), np.clip(v[inside], v0 + dv, v1 - dv))
        answer = np.zeros(inside.shape, dtype=np.bool_)
        answer[inside] = odd
        return answer

    def polygons(self) -> tuple[FloatArray, ...]:
        """The trims, or where there are none the border of the domain as one polygon, (k, 2) each."""
        if self.trims:
            return self.trims
        (u0, u1), (v0, v1) = self.surface.domain
        return (np.array([(u0, v0), (u1, v0), (u1, v1), (u0, v1)]),)

    def covers_domain(self) -> bool:
        """Whether the trims leave all of the surface: there are none, or one that runs along the domain's border."""
        (u0, u1), (v0, v1) = self.surface.domain
        if len(self.trims) != 1:
            return not self.trims
        return abs(_signed_area(self.trims[0])) >= (1.0 - 1e-9) * (u1 - u0) * (v1 - v0)

    def outline(self, tolerance: float | None = None) -> tuple[FloatArray, ...]:
        """The border of the face as closed polygons in space.

        Parameters:
            tolerance: greatest distance of a side's middle from the middle of the arc that it stands for, above 0, in the
                surface's unit; None for 1e-4 of its size.

        Returns:
            One polygon of shape (k, 3) for each of `polygons()`, without the first corner again at the end.

        Raises:
            InvalidInputError: a tolerance that is not above 0.

        Accuracy: sides are halved until they meet the tolerance at a quarter, the middle and three quarters, at most
        twelve times.
        """
        size = float(np.ptp(self.surface.control_points.reshape(-1, 3), axis=0).max())
        tolerance = _CHORD * size if tolerance is None else tolerance
        if not tolerance > 0.0:
            raise InvalidInputError(f"tolerance = {tolerance}; allowed are numbers above 0")
        return tuple(_in_space(self.surface, polygon, tolerance) for polygon in self.polygons())

    def area(self) -> float:
        """The area ∫∫ |S_u × S_v| du dv of the face, in the square of the surface's unit.

        Accuracy: Gauss–Legendre with twelve nodes between knots, corners and crossings: about 1e-8 of the area for smooth
        surfaces of few waves to a span.
        """
        return _area(self)

    def part(self, u0: float, u1: float, v0: float, v1: float) -> Face:
        """The face over a rectangle of its parameter plane.

        Parameters:
            u0, u1: u₀ < u₁, within the domain.
            v0, v1: v₀ < v₁, within the domain.

        Returns:
            The same points with the same parameters, on a surface whose domain is the rectangle; the trims are clipped to
            it, and left out where they leave all of it.

        Raises:
            InvalidInputError: an empty rectangle, one beyond the domain, or one that the trims leave nothing of.

        Accuracy: about 1e-13 of the surface's size for degrees up to 5.

        Example:
            >>> flat = BSplineSurface([0, 0, 2, 2], [0, 0, 1, 1], 1, 1, [[(0, 0, 0), (0, 3, 0)], [(4, 0, 0), (4, 3, 0)]])
            >>> half = Face(flat, ([(0, 0), (2, 0), (0, 1)],)).part(1.0, 2.0, 0.0, 1.0)
            >>> half.surface.domain, round(half.area(), 9)
            (((1.0, 2.0), (0.0, 1.0)), 1.5)
        """
        surface = self.surface
        (a0, a1), (b0, b1) = surface.domain
        da, db = _ON_BORDER * (a1 - a0), _ON_BORDER * (b1 - b0)
        if not (a0 - da <= u0 < u1 <= a1 + da and b0 - db <= v0 < v1 <= b1 + db):
            raise InvalidInputError(
                f"part ({u0}, {u1}) × ({v0}, {v1}) of a face over ({a0}, {a1}) × ({b0}, {b1}); allowed are rectangles "
                "inside it, from less to greater"
            )
        u0, u1, v0, v1 = max(u0, a0), min(u1, a1), max(v0, b0), min(v1, b1)
        net = surface.control_points
        if surface.weights is not None:
            net = np.concatenate([net * surface.weights[..., None], surface.weights[..., None]], axis=2)
        knots_u, net = _restricted(surface.knots_u, surface.degree_u, net, u0, u1)
        knots_v, net = _restricted(surface.knots_v, surface.degree_v, np.moveaxis(net, 1, 0), v0, v1)
        net = np.moveaxis(net, 1, 0)
        weights = None
        if surface.weights is not None:
            net, weights = net[..., :3] / net[..., 3:], net[..., 3]
        smaller = BSplineSurface(knots_u, knots_v, surface.degree_u, surface.degree_v, net, weights)
        trims = tuple(p for p in (_clipped(trim, (u0, v0), (u1, v1)) for trim in self.trims) if len(p) >= 3)
        rectangle = (u1 - u0) * (v1 - v0)
        trims = tuple(p for p in trims if abs(_signed_area(p)) > 1e-12 * rectangle)
        if self.trims and not trims:
            raise InvalidInputError(
                f"part ({u0}, {u1}) × ({v0}, {v1}) lies outside the trims of the face; take another rectangle"
            )
        part = Face(smaller, trims, self.name)
        return Face(smaller, (), self.name) if part.covers_domain() else part

    def transformed(self, matrix: ArrayLike) -> Face:
        """The face under an affine map, a 4 × 4 matrix (see `BSplineSurface.transformed`)."""
        return replace(self, surface=self.surface.transformed(matrix))

    def scaled(self, mm_per_unit: float) -> Face:
        """The face in mm, from one whose unit is `mm_per_unit` mm."""
        return replace(self, surface=self.surface.scaled(mm_per_unit))


def _odd(polygons: tuple[FloatArray, ...], u: FloatArray, v: FloatArray) -> BoolArray:
    """Whether rays from (u, v), shape (n,), towards greater u cross the polygons' sides an odd number of times."""
    order = np.argsort(v, kind="stable")
    u, v = u[order], v[order]
    odd = np.zeros(len(u), dtype=np.bool_)
    for polygon in polygons:
        following = np.roll(polygon, -1, axis=0)
        first = np.searchsorted(v, np.minimum(polygon[:, 1], following[:, 1]))
        last = np.searchsorted(v, np.maximum(polygon[:, 1], following[:, 1]))
        for i in np.flatnonzero(last > first):
            (a, b), (c, d) = polygon[i], following[i]
            rows = slice(first[i], last[i])
            odd[rows] ^= u[rows] < a + (c - a) * ((v[rows] - b) / (d - b))
    answer = np.empty_like(odd)
    answer[order] = odd
    return answer


def _in_space(surface: BSplineSurface, polygon: FloatArray, tolerance: float) -> FloatArray:
    """The closed polygon (k, 2) on the surface, its sides halved until they are within the tolerance."""
    start, end = polygon, np.roll(polygon, -1, axis=0)
    place = np.arange(len(polygon), dtype=np.float64)  # where along the polygon a side begins
    length = np.ones(len(polygon))
    done: list[tuple[FloatArray, FloatArray]] = []
    for _ in range(_HALVINGS + 1):
        shares = np.array([0.0, 0.25, 0.5, 0.75, 1.0])[:, None, None]
        at = start + shares * (end - start)
        points = surface.point(at[..., 0], at[..., 1])
        stray = np.linalg.norm(points[1:4] - (points[0] + shares[1:4] * (points[4] - points[0])), axis=-1).max(axis=0)
        fine = stray <= tolerance
        done.append((place[fine], points[0, fine]))
        rough = ~fine
        if not rough.any():
            break
        start, end, length, middle = start[rough], end[rough], 0.5 * length[rough], at[2, rough]
        place = np.concatenate([place[rough], place[rough] + length])
        start, end, length = np.concatenate([start, middle]), np.concatenate([middle, end]), np.tile(length, 2)
    else:
        done.append((place, surface.point(start[:, 0], start[:, 1])))
    where, corners = (np.concatenate(parts) for parts in zip(*done))
    return np.asarray(corners[np.argsort(where, kind="stable")])


def _area(face: Face) -> float:
    """∫∫ |S_u × S_v| du dv between the trims, strip by strip."""
    (u0, u1), _ = face.surface.domain
    knots = np.unique(np.clip(face.surface.knots_u, u0, u1))
    v, weight, left, right = _rows(face)
    low, high = np.clip(knots[:-1], left[:, None], right[:, None]), np.clip(knots[1:], left[:, None], right[:, None])
    row, span = np.nonzero(high > low)
    middle, half = 0.5 * (low + high)[row, span], 0.5 * (high - low)[row, span]
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    total = 0.0
    for start in range(0, len(row), _CHUNK):
        part = slice(start, start + _CHUNK)
        d = face.surface.derivatives(middle[part, None] + half[part, None] * nodes, v[row[part], None], 1)
        stretch = np.linalg.norm(np.cross(d[1, 0], d[0, 1]), axis=-1)
        total += float(weight[row[part]] * half[part] @ (stretch @ weights))
    return total


def _rows(face: Face) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Intervals of u inside the trims at Gauss nodes of v: v, weight, from and to, shape (n,) each.

    The nodes lie in strips between successive v of knots and corners, where every side's crossing is linear in v.
    """
    _, (v0, v1) = face.surface.domain
    knots = np.unique(np.clip(face.surface.knots_v, v0, v1))
    polygons = face.polygons()
    starts = np.concatenate(polygons)
    ends = np.concatenate([np.roll(p, -1, axis=0) for p in polygons])
    lowest, highest = np.minimum(starts[:, 1], ends[:, 1]), np.maximum(starts[:, 1], ends[:, 1])
    levels = np.unique(np.concatenate([knots, starts[:, 1]]))
    many, few = np.polynomial.legendre.leggauss(_NODES), np.polynomial.legendre.leggauss(_FEW_NODES)
    rows = [(np.zeros(0),) * 4]
    narrow = 0.02 * np.diff(knots).max()
    for low, high in pairwise(levels):
        met = (lowest <= low) & (highest >= high)
        if not met.any():
            continue
        nodes, weights = few if high - low < narrow else many
        v, weight = 0.5 * (low + high) + 0.5 * (high - low) * nodes, 0.5 * (high - low) * weights
        a, b = starts[met], ends[met]
        crossings = np.sort(a[:, 0] + (b[:, 0] - a[:, 0]) * ((v[:, None] - a[:, 1]) / (b[:, 1] - a[:, 1])), axis=1)
        pairs = crossings.shape[1] // 2
        rows.append(
            (np.repeat(v, pairs), np.repeat(weight, pairs), crossings[:, 0::2].ravel(), crossings[:, 1::2].ravel())
        )
    v, weight, left, right = (np.concatenate(column) for column in zip(*rows))
    return v, weight, left, right


def _restricted(
    knots: FloatArray, degree: int, net: FloatArray, low: float, high: float
) -> tuple[FloatArray, FloatArray]:
    """Clamped knots over [low, high] and the coefficients (n, …) of the same spline over them."""
    slack = 1e-12 * (high - low)
    inner = knots[(knots > low + slack) & (knots < high - slack)]
    ends = np.ones(degree + 1)
    smaller = np.concatenate([low * ends, inner, high * ends])
    return smaller, rewrite(knots, degree, net, smaller, degree)


def _clipped(polygon: FloatArray, low: tuple[float, float], high: tuple[float, float]) -> FloatArray:
    """The part of a polygon inside a rectangle, by one half-plane after the other; inside, the even-odd rule holds on."""
    for axis, bound, sign in ((0, low[0], 1.0), (0, high[0], -1.0), (1, low[1], 1.0), (1, high[1], -1.0)):
        if not len(polygon):
            break
        height = sign * (polygon[:, axis] - bound)
        following, next_height = np.roll(polygon, -1, axis=0), np.roll(height, -1)
        crosses = (height > 0.0) & (next_height < 0.0) | (height < 0.0) & (next_height > 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = polygon + (height / (height - next_height))[:, None] * (following - polygon)
        crossing[:, axis] = bound
        both = np.stack([polygon, crossing], axis=1).reshape(-1, 2)
        polygon = both[np.stack([height >= 0.0, crosses], axis=1).reshape(-1)]
    return polygon


def _signed_area(polygon: FloatArray) -> float:
    """Area of a closed polygon (k, 2), positive if it turns counter-clockwise."""
    following = np.roll(polygon, -1, axis=0)
    return 0.5 * float((polygon[:, 0] * following[:, 1] - polygon[:, 1] * following[:, 0]).sum())
