"""Faces divided into patches, each a graph over its own plan: what a blade can sweep from above."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from batten.errors import InvalidInputError
from batten.surfaces.bspline_surface import crosses_itself, perpendicular_frame
from batten.surfaces.face import Face
from batten.surfaces.height_surface import height_surface
from batten.typing import FloatArray

SPREAD = float(np.radians(70.0))
"""Greatest angle between a patch's normals and its own upright, unless another is asked for."""

_COARSE, _FINE = 33, 193  # samples along u and v
_SPANS = 192  # of the heights along either side, at most
_MOST_STRIPS, _MOST_HALVINGS = 8, 6
_OUTLINE = 2e-4  # of the face's size: how far the outline may stray from the border
_EXTEND = 0.08  # of the face's domain: so far its surface is followed beyond it
_BEYOND_WEIGHT = 0.03  # of a point beyond the face, against one on it
_LEANING = float(np.radians(80.0))  # where the surface leans more than this, it is not followed
_ROOM = 1.02  # the heights' square over the circle around the plan


@dataclass(frozen=True, eq=False)
class Patch:
    """A part of a face that is a graph over its plan, seen in a frame of its own.

    Attributes:
        face: the part, in the design's coordinates.
        frame: (4, 4), pose of the patch's frame in the design: origin in its middle, z along its middle normal, x as near as
            it can to the way the face's u runs.
        spread: greatest angle between the face's normals and the frame's z, radians.
        plan: the part as heights over x and y in its frame: a `Face` whose u and v are x and y, its trims the outline in
            plan. It goes on beyond the outline, first as the surface does and then as a plate, to
            the square about the circle that holds it.
        error: greatest distance in height of the face's samples from these heights.
    """

    face: Face
    frame: FloatArray
    spread: float
    plan: Face
    error: float

    @property
    def outline(self) -> tuple[FloatArray, ...]:
        """The outline in plan, closed polygons (k, 2) in the patch's frame."""
        return self.plan.trims

    def to_frame(self, points: FloatArray) -> FloatArray:
        """Points of the design, (…, 3), in the patch's frame."""
        return np.asarray((points - self.frame[:3, 3]) @ self.frame[:3, :3])

    def to_design(self, points: FloatArray) -> FloatArray:
        """Points of the patch's frame, (…, 3), in the design."""
        return np.asarray(points @ self.frame[:3, :3].T + self.frame[:3, 3])


def patches_of(face: Face, tolerance: float, *, spread: float = SPREAD) -> tuple[Patch, ...]:
    """Divide a face along its parameters into as few patches as make each a graph over its plan.

    A face whose normals stay within `spread` of one direction, and whose outline in plan does not cross itself, is one
    patch. Else it is cut into two, three, … up to eight equal strips across u or v, whichever does with fewer; if none
    does, it is halved the way that leaves the smaller spreads, and each half is looked at again.

    Parameters:
        face: any face.
        tolerance: wanted greatest distance of the patches' heights from the face, above 0.
        spread: greatest angle of normals, radians, between 0 and π/2.

    Returns:
        The patches, in the order of their parameters.

    Raises:
        InvalidInputError: a spread or tolerance outside these bounds; a face that six halvings do not make a graph, for
            example one that is creased or crosses itself.

    Accuracy: normals are looked at on 33 × 33 samples of each part; `error` says what the heights reached.

    Example:
        >>> import numpy as np
        >>> from batten.surfaces.bspline_surface import BSplineSurface
        >>> w = np.sqrt(0.5)
        >>> arc = [((1, 0), 1.0), ((1, 1), w), ((0, 1), 1.0), ((-1, 1), w), ((-1, 0), 1.0)]
        >>> net = [[(x, y, z) for y in (0.0, 3.0)] for (x, z), _ in arc]
        >>> half = BSplineSurface([0, 0, 0, 1, 1, 2, 2, 2], [0, 0, 1, 1], 2, 1, net, [[w, w] for _, w in arc])
        >>> [round(float(np.degrees(p.spread)), 3) for p in patches_of(Face(half), 1e-3)]
        [45.0, 45.0]
    """
    if not (0.0 < spread < 0.5 * np.pi and tolerance > 0.0):
        raise InvalidInputError(
            f"spread = {spread}, tolerance = {tolerance}; allowed are angles between 0 and π/2 and tolerances above 0"
        )
    parts = _divided(_shrunk(face), spread, _MOST_HALVINGS)
    return tuple(_patch(part, tolerance) for part in parts)


def upright(normals: FloatArray) -> tuple[FloatArray, float]:
    """The direction from which unit normals (n, 3) differ least at most, and that greatest angle, radians.

    Their mean, moved towards the farthest one in ever smaller steps (Bădoiu and Clarkson's way to the least ball).
    """
    axis = normals.sum(axis=0)
    best, least = axis, np.inf
    for step in range(600):
        axis = axis / max(float(np.linalg.norm(axis)), 1e-300)
        cosine = normals @ axis
        worst = int(np.argmin(cosine))
        angle = float(np.arccos(np.clip(cosine[worst], -1.0, 1.0)))
        if angle < least:
            best, least = axis, angle
        axis = axis + (normals[worst] - axis) / (step + 3.0)
    return best, least


def _shrunk(face: Face) -> Face:
    """The face on the rectangle of its trims, without what lies beyond."""
    if not face.trims:
        return face
    corners = np.concatenate(face.trims)
    (u0, v0), (u1, v1) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return face.part(u0, u1, v0, v1)


def _samples(face: Face, count: int) -> tuple[FloatArray, FloatArray]:
    """Parameters u and v, (n,), of a grid's points on the face; a grid over its own rectangle, the outline left out."""
    (u0, u1), (v0, v1) = face.surface.domain
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(u0, u1, count), np.linspace(v0, v1, count), indexing="ij"))
    inside = face.contains(u, v)
    return u[inside], v[inside]


def _normals(face: Face) -> FloatArray:
    """Unit normals (n, 3) over the face, without those of points where it has none."""
    u, v = _samples(face, _COARSE)
    corners = np.concatenate(face.polygons())
    normals = face.surface.normal(np.append(u, corners[:, 0]), np.append(v, corners[:, 1]))
    return np.asarray(normals[np.isfinite(normals).all(axis=1)])


def _is_graph(face: Face, spread: float) -> bool:
    """Whether the face is a graph along the middle of its normals, which stay within `spread` of it."""
    normals = _normals(face)
    if len(normals) < 4:
        return False
    axis, angle = upright(normals)
    if angle > spread:
        return False
    across = perpendicular_frame(axis)
    return not any(crosses_itself(_thinned(polygon @ across.T)) for polygon in face.outline(_size(face) * 1e-3))


def _thinned(polygon: FloatArray) -> FloatArray:
    """A polygon without corners that fall on the one before, as those of a side that shrinks to a point do."""
    step = np.linalg.norm(polygon - np.roll(polygon, 1, axis=0), axis=1)
    return np.asarray(polygon[step > 1e-9 * step.max()])


def _divided(face: Face, spread: float, halvings: int) -> list[Face]:
    """Parts of the face that are graphs, in the order of their parameters."""
    if _is_graph(face, spread):
        return [face]
    for count in range(2, _MOST_STRIPS + 1):
        for axis in (0, 1):
            strips = _strips(face, axis, count)
            if all(_is_graph(strip, spread) for strip in strips):
                return strips
    if halvings == 0:
        raise InvalidInputError(
            f"face {face.name or 'without a name'}: no division along its parameters makes its parts graphs with normals "
            f"within {np.degrees(spread):.0f}° of one direction; split it in CAD at creases and folds, or allow a greater "
            "spread"
        )
    ways = [_strips(face, axis, 2) for axis in (0, 1)]
    worst = [max(upright(_normals(part))[1] for part in parts) for parts in ways]
    return [piece for part in ways[int(np.argmin(worst))] for piece in _divided(part, spread, halvings - 1)]


def _strips(face: Face, axis: int, count: int) -> list[Face]:
    """The face cut across u (axis 0) or v (axis 1) at equal steps, without strips that its trims leave nothing of."""
    (u0, u1), (v0, v1) = face.surface.domain
    low, high = ((u0, u1), (v0, v1))[axis]
    cuts = np.linspace(low, high, count + 1).tolist()
    strips = []
    for a, b in pairwise(cuts):
        try:
            strips.append(_shrunk(face.part(a, b, v0, v1) if axis == 0 else face.part(u0, u1, a, b)))
        except InvalidInputError:  # the trims leave nothing of this strip
            continue
    return strips


def _patch(face: Face, tolerance: float) -> Patch:
    """The patch of a face that is a graph: its frame, and its heights."""
    axis, spread = upright(_normals(face))
    u, v = _samples(face, _FINE)
    d = face.surface.derivatives(u, v, 1)
    along = d[1, 0].sum(axis=0) - (d[1, 0].sum(axis=0) @ axis) * axis
    size = _size(face)
    if np.linalg.norm(along) < 1e-6 * np.abs(d[1, 0]).sum():  # it runs round and round: any direction will do
        along = perpendicular_frame(axis)[0]
    x = along / np.linalg.norm(along)
    outlines = face.outline(_OUTLINE * size)
    flat = [np.stack([p @ x, p @ np.cross(axis, x)], axis=1) for p in outlines]
    corners = np.concatenate(flat)
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    heights = d[0, 0] @ axis
    frame = np.eye(4)
    frame[:3, :3] = np.stack([x, np.cross(axis, x), axis], axis=1)
    frame[:3, 3] = frame[:3, :3] @ np.array([*middle, 0.5 * (heights.min() + heights.max())])
    samples = (np.concatenate([d[0, 0], *outlines]) - frame[:3, 3]) @ frame[:3, :3]
    reach = _ROOM * float(np.hypot(samples[:, 0], samples[:, 1]).max())
    beyond = (_beyond(face, axis) - frame[:3, 3]) @ frame[:3, :3]
    beyond = beyond[(np.abs(beyond[:, :2]) < reach).all(axis=1)]
    weights = np.repeat([1.0, _BEYOND_WEIGHT], [len(samples), len(beyond)])
    samples = np.concatenate([samples, beyond])
    fit = height_surface(samples, (-reach, -reach), (reach, reach), tolerance, weights=weights, most=_SPANS)
    plan = Face(fit.surface, tuple(_thinned(p - middle) for p in flat), face.name)
    return Patch(face, frame, spread, plan, fit.error)


def _beyond(face: Face, axis: FloatArray) -> FloatArray:
    """Points (n, 3) of the surface next to the face, where it goes on as a graph: so the leaves go on in their curvature."""
    grids = [np.linspace(a - _EXTEND * (b - a), b + _EXTEND * (b - a), _COARSE * 3) for a, b in face.surface.domain]
    u, v = (g.ravel() for g in np.meshgrid(*grids, indexing="ij"))
    outside = ~face.contains(u, v)
    u, v = u[outside], v[outside]
    d = face.surface.derivatives(u, v, 1, extend=_EXTEND + 1e-9)
    normal = np.cross(d[1, 0], d[0, 1])
    upright = (normal @ axis) > np.cos(_LEANING) * np.linalg.norm(normal, axis=1)
    return np.asarray(d[0, 0][upright])


def _size(face: Face) -> float:
    return float(np.ptp(face.surface.control_points.reshape(-1, 3), axis=0).max())
