"""A mesh region as a face: the smooth height surface over its best plane, and the mesh's border as its trims."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from batten.errors import InvalidInputError
from batten.surfaces.bspline_basis import greville
from batten.surfaces.bspline_surface import BSplineSurface, perpendicular_frame
from batten.surfaces.deviation import surface_deviation
from batten.surfaces.face import Face
from batten.surfaces.plane import Plane
from batten.typing import ArrayLike, FloatArray, IntArray

if TYPE_CHECKING:
    from scipy.sparse import csr_array

_DEGREE = 3
_MOST_SPANS = 64  # along the shorter side
_MOST_COEFFICIENTS = 40_000
_STIFFNESS = 1e-4  # of the penalty against the data, at the wavelength of one span
_STEEPEST = 0.05  # cosine between a triangle and the plane, at least


@dataclass(frozen=True, eq=False)
class MeshRegion:
    """A face near a connected piece of a mesh, and how near.

    Attributes:
        face: bicubic; its parameters are the coordinates in `plane`, its trims the borders of the mesh.
        plane: the best plane of the mesh.
        distance_max: greatest distance of the mesh's vertices from the surface.
        distance_mean: their mean distance.
        spans: number of polynomial pieces along the plane's two axes.
    """

    face: Face
    plane: Plane
    distance_max: float
    distance_mean: float
    spans: tuple[int, int]


def mesh_regions(
    vertices: ArrayLike, triangles: ArrayLike, tolerance: float, *, name: str = ""
) -> tuple[MeshRegion, ...]:
    """Smooth faces near a mesh, one for each connected piece of it.

    The plane's normal is the mean one of the triangles. Over the rectangle around the mesh in that plane, with axes along
    its principal directions, a bicubic height z(x, y) on even knots minimises Σ aᵢ (z(xᵢ, yᵢ) − zᵢ)² / Σ aᵢ +
    μ h⁴ ∫∫ (z_xx² + 2 z_xy² + z_yy²) dx dy / A over its coefficients, aᵢ being a third of the triangles' areas around
    vertex i in plan, h the length of a span, A the area of the rectangle, μ = 1e-4. The number of spans is doubled until
    every vertex lies within the tolerance of the surface.

    Parameters:
        vertices: shape (n, 3), finite; equal points are one vertex.
        triangles: shape (m, 3), indices of vertices.
        tolerance: greatest distance of a vertex from the surface, above 0, in the unit of the vertices.
        name: for the faces; pieces of several get a number.

    Returns:
        The regions, the one with the most triangles first.

    Raises:
        InvalidInputError: no triangle; indices without a vertex; a piece that is closed, whose edges belong to more than
            two triangles, or that turns over itself seen along its mean normal; a tolerance that cannot be met with
            64 spans along the shorter side.

    Accuracy: `distance_max` is measured by the nearest point of the surface to each vertex. Between the vertices the
    surface is smooth and leaves the triangles as far as a curved surface leaves its chords.

    Degenerate cases: triangles without area are left out.

    Example:
        >>> points = [(x, y, 0.01 * x * y) for x in range(11) for y in range(7)]
        >>> quads = [(7 * i + j, 7 * i + j + 7, 7 * i + j + 8, 7 * i + j + 1) for i in range(10) for j in range(6)]
        >>> mesh = [q[:3] for q in quads] + [(q[0], q[2], q[3]) for q in quads]
        >>> (region,) = mesh_regions(points, mesh, 0.001)
        >>> region.distance_max < 0.001, region.face.is_trimmed
        (True, True)
    """
    points, corners = _cleaned(vertices, triangles)
    if not tolerance > 0.0:
        raise InvalidInputError(f"tolerance = {tolerance}; allowed are lengths above 0")
    pieces = _pieces(len(points), corners)
    regions: list[MeshRegion] = []
    for number, piece in enumerate(pieces, 1):
        label = name if len(pieces) == 1 or not name else f"{name} {number}"
        where = f"piece {number} of the mesh ({len(piece)} triangles)" if len(pieces) > 1 else "the mesh"
        used, local = np.unique(piece, return_inverse=True)
        try:
            regions.append(_region(points[used], local.reshape(-1, 3), tolerance, label))
        except InvalidInputError as error:
            raise InvalidInputError(f"{where} {error}") from error
    return tuple(regions)


def _cleaned(vertices: ArrayLike, triangles: ArrayLike) -> tuple[FloatArray, IntArray]:
    """Distinct vertices, and triangles of three different ones with area."""
    points = np.asarray(vertices, dtype=np.float64).reshape(-1, 3)
    corners = np.asarray(triangles, dtype=np.int64).reshape(-1, 3)
    if not len(corners) or not np.isfinite(points).all() or corners.min() < 0 or corners.max() >= len(points):
        raise InvalidInputError(
            f"mesh of {len(points)} vertices and {len(corners)} triangles; allowed are finite vertices, and triangles "
            "whose indices count them from 0"
        )
    points, same = np.unique(points, axis=0, return_inverse=True)
    corners = same.reshape(-1)[corners]
    p, q, r = (points[corners[:, i]] for i in range(3))
    areas = np.linalg.norm(np.cross(q - p, r - p), axis=1)
    corners = corners[areas > 1e-14 * float(np.ptp(points, axis=0).max()) ** 2]
    if not len(corners):
        raise InvalidInputError("mesh whose triangles have no area; at least one is needed")
    return points, corners


def _pieces(count: int, corners: IntArray) -> list[IntArray]:
    """The triangles by connected pieces, the largest first."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    start, end = corners[:, [0, 1]].ravel(), corners[:, [1, 2]].ravel()
    graph = coo_array((np.ones(len(start)), (start, end)), shape=(count, count))
    label = connected_components(graph, directed=False)[1][corners[:, 0]]
    pieces = [corners[label == i] for i in np.unique(label)]
    return sorted(pieces, key=len, reverse=True)


def _region(points: FloatArray, corners: IntArray, tolerance: float, name: str) -> MeshRegion:
    """The region of a connected mesh all of whose vertices are used."""
    corners = _turned_alike(corners)
    loops = _borders(corners)
    plane = _best_plane(points, corners)
    flat = plane.to_plane(points)
    areas = _plan_areas(flat, corners)
    _check_graph(points, corners, flat, areas, loops)
    weights = np.asarray(np.bincount(corners.ravel(), np.repeat(areas / 3.0, 3), len(points)), dtype=np.float64)
    heights = plane.signed_distance(points)
    low, high = flat.min(axis=0), flat.max(axis=0)
    best, spans = np.inf, 1
    while spans <= _MOST_SPANS:
        counts = np.maximum(1, np.rint(spans * (high - low) / (high - low).min())).astype(np.int64)
        if spans > 1 and np.prod(counts + _DEGREE) > _MOST_COEFFICIENTS:
            break
        surface = _height_surface(plane, flat, heights, weights, low, high, counts)
        deviation = surface_deviation(surface, points)
        best = min(best, deviation.max)
        if deviation.max <= tolerance:
            face = Face(surface, tuple(flat[loop] for loop in loops), name)
            face = Face(surface, (), name) if face.covers_domain() else face
            return MeshRegion(face, plane, deviation.max, deviation.mean, (int(counts[0]), int(counts[1])))
        spans *= 2
    raise InvalidInputError(
        f"has vertices {best:.3g} from the closest surface that was tried; allowed are {tolerance:.3g}: allow more, smooth "
        "the mesh, or divide it where it has creases"
    )


def _turned_alike(corners: IntArray) -> IntArray:
    """The triangles of a connected mesh, all turning the same way where that is possible."""
    start, end = corners.ravel(), corners[:, [1, 2, 0]].ravel()
    count = int(corners.max()) + 1
    members = np.unique(np.minimum(start, end) * count + np.maximum(start, end), return_counts=True)[1]
    if members.max() > 2:
        raise InvalidInputError(
            f"has {np.count_nonzero(members > 2)} edges that belong to more than two triangles; allowed are meshes without "
            "branches: take the pieces apart"
        )
    if len(np.unique(start * count + end)) == len(start):
        return corners
    sides: dict[tuple[int, int], list[int]] = {}
    for i, (a, b, c) in enumerate(corners.tolist()):
        for first, last in ((a, b), (b, c), (c, a)):
            sides.setdefault((min(first, last), max(first, last)), []).append(i)
    rows = corners.tolist()
    directed = [((a, b), (b, c), (c, a)) for a, b, c in rows]
    flipped: list[bool | None] = [None] * len(rows)
    flipped[0] = False
    stack = [0]
    while stack:
        i = stack.pop()
        for first, last in directed[i]:
            for j in sides[(min(first, last), max(first, last))]:
                if flipped[j] is None:
                    flipped[j] = bool(flipped[i]) ^ ((first, last) in directed[j])
                    stack.append(j)
    turned = corners.copy()
    mask = np.array([bool(f) for f in flipped])
    turned[mask] = turned[mask][:, ::-1]
    return turned


def _borders(corners: IntArray) -> list[IntArray]:
    """Closed chains of vertices along the edges that belong to one triangle."""
    start = corners.ravel()
    end = corners[:, [1, 2, 0]].ravel()
    count = int(corners.max()) + 1
    key, reverse = start * count + end, end * count + start
    open_edges = ~np.isin(key, reverse)
    following: dict[int, list[int]] = {}
    for a, b in zip(start[open_edges].tolist(), end[open_edges].tolist()):
        following.setdefault(a, []).append(b)
    if not following:
        raise InvalidInputError("is closed; allowed are regions with a border: cut out the part that is wanted")
    loops: list[IntArray] = []
    while following:
        first = next(iter(following))
        chain = [first]
        while True:
            ahead = following[chain[-1]]
            step = ahead.pop()
            if not ahead:
                del following[chain[-1]]
            if step == first:
                break
            if step not in following:
                raise InvalidInputError(
                    "has a border that does not close; its triangles turn different ways: unify its normals"
                )
            chain.append(step)
        loops.append(np.array(chain, dtype=np.int64))
    return loops


def _best_plane(points: FloatArray, corners: IntArray) -> Plane:
    """The plane across the mean normal, through the middle of the vertices, with axes along the principal directions."""
    p, q, r = (points[corners[:, i]] for i in range(3))
    normal = np.cross(q - p, r - p).sum(axis=0)
    length = float(np.linalg.norm(normal))
    if not length > 1e-6 * np.linalg.norm(np.cross(q - p, r - p), axis=1).sum():
        raise InvalidInputError("turns so far that it has no mean normal; divide it into regions")
    normal = normal / length
    frame = perpendicular_frame(normal)
    centre = points.mean(axis=0)
    flat = (points - centre) @ frame.T
    _, axes = np.linalg.eigh(flat.T @ flat)
    x_axis = axes[:, 1] @ frame
    x_axis = x_axis * (1.0 if x_axis[np.argmax(np.abs(x_axis))] > 0.0 else -1.0)
    return Plane(centre, x_axis, np.cross(normal, x_axis))


def _plan_areas(flat: FloatArray, corners: IntArray) -> FloatArray:
    p, q, r = (flat[corners[:, i]] for i in range(3))
    e, f = q - p, r - p
    return np.asarray(0.5 * (e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]))


def _check_graph(
    points: FloatArray, corners: IntArray, flat: FloatArray, areas: FloatArray, loops: list[IntArray]
) -> None:
    """Refuse a mesh that does not lie single over its plane: steep triangles, or more area than its border holds."""
    p, q, r = (points[corners[:, i]] for i in range(3))
    whole = 0.5 * np.linalg.norm(np.cross(q - p, r - p), axis=1)
    steepest = float((areas / whole).min())
    if steepest < _STEEPEST:
        raise InvalidInputError(
            f"has triangles at {np.rad2deg(np.arccos(np.clip(steepest, -1.0, 1.0))):.0f}° to its mean plane; allowed are "
            f"{np.rad2deg(np.arccos(_STEEPEST)):.0f}°: divide it into regions that turn less"
        )
    # The even-odd region of the borders is the mesh's shadow unless parts of it lie over each other.
    (x0, y0), (x1, y1) = flat.min(axis=0), flat.max(axis=0)
    knots_x, knots_y = np.array([x0, x0, x1, x1]), np.array([y0, y0, y1, y1])
    rectangle = np.array([[(x, y, 0.0) for y in (y0, y1)] for x in (x0, x1)])
    shadow = Face(BSplineSurface(knots_x, knots_y, 1, 1, rectangle), tuple(flat[loop] for loop in loops)).area()
    if abs(shadow - areas.sum()) > 1e-6 * areas.sum():
        raise InvalidInputError(
            f"lies over itself seen along its mean normal ({areas.sum():.6g} of area over {shadow:.6g} in plan); divide it "
            "into regions"
        )


def _height_surface(
    plane: Plane,
    flat: FloatArray,
    heights: FloatArray,
    weights: FloatArray,
    low: FloatArray,
    high: FloatArray,
    counts: IntArray,
) -> BSplineSurface:
    """The penalised least-squares height over the rectangle, with so many spans each way."""
    from scipy.sparse.linalg import spsolve

    knots = [
        np.concatenate([[a] * _DEGREE, np.linspace(a, b, n + 1), [b] * _DEGREE]) for a, b, n in zip(low, high, counts)
    ]
    rows = [_collocation(k, np.clip(flat[:, i], low[i], high[i])) for i, k in enumerate(knots)]
    basis = _row_products(rows[0], rows[1])
    span = float(((high - low) / counts).min())
    grams = [[_gram(k, order) for order in (0, 1, 2)] for k in knots]
    from scipy.sparse import diags_array, kron

    bend = (kron(grams[0][2], grams[1][0]) + 2.0 * kron(grams[0][1], grams[1][1]) + kron(grams[0][0], grams[1][2])) * (
        _STIFFNESS * span**4 / float(np.prod(high - low))
    )
    share = weights / weights.sum()
    normal = basis.T @ diags_array(share) @ basis + bend
    coefficients = spsolve(normal.tocsc(), basis.T @ (share * heights))
    x, y = (greville(k, _DEGREE) for k in knots)
    net = plane.to_world(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1))
    net = net + coefficients.reshape(len(x), len(y), 1) * plane.normal
    return BSplineSurface(knots[0], knots[1], _DEGREE, _DEGREE, net)


def _collocation(knots: FloatArray, at: FloatArray) -> csr_array:
    """Values of the B-splines at places, one row for each, as a sparse matrix."""
    from scipy.interpolate import BSpline

    return BSpline.design_matrix(at, knots, _DEGREE)


def _row_products(first: csr_array, second: csr_array) -> csr_array:
    """The matrix whose row i is the Kronecker product of the rows i; both have degree + 1 entries in each row."""
    from scipy.sparse import csr_array

    count, width = first.shape[0], _DEGREE + 1
    value = first.data.reshape(count, width, 1) * second.data.reshape(count, 1, width)
    column = first.indices.reshape(count, width, 1).astype(np.int64) * second.shape[1] + second.indices.reshape(
        count, 1, width
    )
    starts = np.arange(count + 1) * width * width
    return csr_array((value.ravel(), column.ravel(), starts), shape=(count, first.shape[1] * second.shape[1]))


def _gram(knots: FloatArray, order: int) -> csr_array:
    """∫ N_i^(order) N_j^(order) of cubic B-splines, exact by four Gauss nodes a span."""
    from scipy.interpolate import BSpline
    from scipy.sparse import csr_array

    borders = np.unique(knots)
    nodes, weights = np.polynomial.legendre.leggauss(_DEGREE + 1)
    at = (0.5 * (borders[:-1] + borders[1:])[:, None] + 0.5 * np.diff(borders)[:, None] * nodes).ravel()
    share = (0.5 * np.diff(borders)[:, None] * weights).ravel()
    values = BSpline(knots, np.eye(len(knots) - _DEGREE - 1), _DEGREE).derivative(order)(at) if order else None
    values = BSpline(knots, np.eye(len(knots) - _DEGREE - 1), _DEGREE)(at) if values is None else values
    return csr_array(values.T @ (share[:, None] * values))
