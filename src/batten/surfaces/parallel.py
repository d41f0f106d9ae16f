"""The surface at a given distance from another, along its normals: where a blade runs whose melt ends on the other one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from batten.errors import ConvergenceError, InvalidInputError
from batten.surfaces.bspline_basis import greville
from batten.surfaces.bspline_surface import BSplineSurface
from batten.typing import FloatArray, IntArray

_BETWEEN = np.array([0.05, 0.27, 0.5, 0.73, 0.95])
"""Where, in each span of the answer, it is compared with the true parallel surface."""
_MOST_KNOTS = 400


class ParallelSurface(NamedTuple):
    """A B-spline surface close to the parallel one, and its greatest distance from that, in the surface's unit."""

    surface: BSplineSurface
    deviation: float


def parallel_surface(
    surface: BSplineSurface, distance: float, *, extend: float = 0.25, within: float | None = None
) -> ParallelSurface:
    """P(u, v) = S(u, v) + distance · n(u, v), n = S_u × S_v / ‖S_u × S_v‖, as a B-spline surface with the same parameters.

    Interpolated at the Greville abscissae in a spline space that holds S itself if it is not rational; spans are halved
    until the distance from P is small enough. Beyond the domain of S stands its continuation, shifted along the normals
    at the border: smooth but for a kink there, where a continuation of the small spans would stray.

    Parameters:
        surface: S, with normals that are continuous.
        distance: signed, positive on the side of S_u × S_v; 0 gives S back.
        extend: how far the answer's domain goes beyond that of S, as a share of its width.
        within: greatest distance from P over the domain of S; 1e-3 · |distance| if None.

    Returns:
        The surface, and its greatest distance from P over the domain of S.

    Raises:
        InvalidInputError: a distance that is not finite; `within` not above 0; a crease, a point without normal, or a
            radius of curvature below the distance on its side: P has a gap, is unknown, or folds.
        ConvergenceError: spans halved in vain.

    Accuracy: `deviation` is the part of P − S̃ along the normal at equal parameters, S̃ the answer, at 25 points in each of
    its patches: the distance either way but for the square of the part across, over twice the radius of curvature. It
    falls with the fourth power of the spans' width.

    Example:
        >>> flat = BSplineSurface([0, 0, 2, 2], [0, 0, 1, 1], 1, 1, [[(0, 0, 0), (0, 3, 0)], [(4, 0, 0), (4, 3, 0)]])
        >>> above = parallel_surface(flat, 0.5, extend=0.0)
        >>> above.surface.point(1.0, 0.5).round(12).tolist()
        [2.0, 1.5, 0.5]
    """
    if not (np.isfinite(distance) and np.isfinite(extend) and extend >= 0.0):
        raise InvalidInputError(f"distance = {distance}, extend = {extend}; allowed are finite numbers, extend ≥ 0")
    if distance == 0.0:
        return ParallelSurface(surface, 0.0)
    allowed = 1e-3 * abs(distance) if within is None else float(within)
    if not allowed > 0.0:
        raise InvalidInputError(f"within = {within}; allowed are numbers above 0")
    _refuse_creases(surface, distance, allowed)
    _refuse_folds(surface, distance)
    deviation, pieces = np.inf, 1
    while True:
        knots = [_knots(surface, axis, extend, pieces) for axis in range(2)]
        if pieces > 1 and max(len(k) for k in knots) > _MOST_KNOTS:
            break
        found = _interpolated(surface, distance, knots)
        deviation = _greatest_distance(surface, distance, found)
        if deviation <= allowed:
            return ParallelSurface(found, deviation)
        pieces *= 2
    raise ConvergenceError(
        f"the parallel surface at {distance:g} stays {deviation:.3g} away from its spline, more than {allowed:.3g}; smooth "
        "the design where its curvature jumps, or do without the offset",
        residual=float(deviation),
    )


def _true(surface: BSplineSurface, distance: float, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points of P at a grid of parameters and the normals there, each (a, b, 3); beyond the domain the border's normals."""
    (u0, u1), (v0, v1) = surface.domain
    normal: FloatArray = surface.normal(np.clip(u, u0, u1)[:, None], np.clip(v, v0, v1))
    points: FloatArray = surface.point(u[:, None], v, extend=np.inf)
    return np.asarray(points + distance * normal), normal


def _axis(surface: BSplineSurface, axis: int) -> tuple[FloatArray, int, float, float]:
    """Knots, degree and domain along u (0) or v (1)."""
    knots, degree = ((surface.knots_u, surface.degree_u), (surface.knots_v, surface.degree_v))[axis]
    return knots, degree, *surface.domain[axis]


def _inner(surface: BSplineSurface, axis: int) -> tuple[FloatArray, IntArray]:
    """Distinct inner knots and how often each is repeated."""
    knots, _, low, high = _axis(surface, axis)
    values, counts = np.unique(knots[(knots > low) & (knots < high)], return_counts=True)
    return values, counts


def _degree(degree: int) -> int:
    return max(degree, 3)


def _knots(surface: BSplineSurface, axis: int, extend: float, pieces: int) -> FloatArray:
    """Clamped knots of the answer: a knot of S repeated once more, for a normal has one derivative less; spans divided.

    At the border of S, where the normals stop to change, a kink is left. Beyond it S itself is not divided if the spline
    space holds it.
    """
    _, degree, low, high = _axis(surface, axis)
    inner, counts = _inner(surface, axis)
    new = _degree(degree)
    borders = np.concatenate([[low], inner, [high]])
    margin = extend * (high - low)
    repeated = [np.repeat(inner, np.clip(new - degree + counts + 1, 1, new))]
    ends = [low, high]
    if margin > 0.0:
        ends = [low - margin, high + margin]
        repeated += [np.repeat([low, high], new)]
        if surface.is_rational:
            borders = np.concatenate([[ends[0]], borders, [ends[1]]])
    finer = (borders[:-1, None] + np.diff(borders)[:, None] * np.arange(1, pieces) / pieces).ravel()
    between = np.sort(np.concatenate([finer, *repeated]))
    return np.concatenate([[ends[0]] * (new + 1), between, [ends[1]] * (new + 1)])


def _interpolated(surface: BSplineSurface, distance: float, knots: list[FloatArray]) -> BSplineSurface:
    """The spline surface through points of P."""
    from scipy.interpolate import make_interp_spline  # takes a while to load

    degrees = _degree(surface.degree_u), _degree(surface.degree_v)
    sites = [np.clip(greville(k, d), k[0], k[-1]) for k, d in zip(knots, degrees)]
    net, _ = _true(surface, distance, sites[0], sites[1])
    for axis in range(2):
        spline = make_interp_spline(sites[axis], np.moveaxis(net, axis, 0), k=degrees[axis], t=knots[axis])
        net = np.moveaxis(spline.c, 0, axis)
    return BSplineSurface(knots[0], knots[1], *degrees, net)


def _greatest_distance(surface: BSplineSurface, distance: float, found: BSplineSurface) -> float:
    """Greatest distance of `found` from P along the normals at equal parameters, over the domain of S and its border."""
    places = []
    for axis, knots in enumerate((found.knots_u, found.knots_v)):
        _, _, low, high = _axis(surface, axis)
        borders = np.unique(np.clip(knots, low, high))
        inside = (borders[:-1, None] + np.diff(borders)[:, None] * _BETWEEN).ravel()
        places.append(np.concatenate([[low], inside, [high]]))
    wanted, normal = _true(surface, distance, places[0], places[1])
    worst = np.abs(((found.point(places[0][:, None], places[1]) - wanted) * normal).sum(axis=-1)).max()
    return float(worst) if np.isfinite(worst) else np.inf


def _refuse_creases(surface: BSplineSurface, distance: float, allowed: float) -> None:
    for axis in range(2):
        _, degree, low, _ = _axis(surface, axis)
        inner, counts = _inner(surface, axis)
        sharp = inner[counts >= degree]
        if not sharp.size:
            continue
        across = np.linspace(*surface.domain[1 - axis], 33)
        sides = []
        for at in (np.nextafter(sharp, low), sharp):
            u, v = (at[:, None], across) if axis == 0 else (across, at[:, None])
            sides.append(surface.normal(u, v))
        jump = abs(distance) * np.linalg.norm(sides[1] - sides[0], axis=-1).max(axis=1)
        if (jump > allowed).any():
            worst = float(sharp[int(np.nanargmax(jump))])
            raise InvalidInputError(
                f"the surface has a crease at {'uv'[axis]} = {worst:g}, where a parallel surface has a gap or crosses "
                "itself; round the crease in the design, or do without the offset"
            )


def _refuse_folds(surface: BSplineSurface, distance: float) -> None:
    """Both 1 − distance · κ must be positive, κ the principal curvatures, positive towards the normal."""
    u, v = surface.samples.u, surface.samples.v
    d = surface.derivatives(u[:, None], v, 2)
    cross = np.cross(d[1, 0], d[0, 1])
    area = np.linalg.norm(cross, axis=-1)
    if not (area > 0.0).all():
        i, j = np.argwhere(~(area > 0.0))[0]
        raise InvalidInputError(
            f"the surface has no normal at (u, v) = ({u[i]:g}, {v[j]:g}), so no point parallel to it; "
            "avoid collapsed edges in the design, or do without the offset"
        )
    normal = cross / area[..., None]
    e, f, g = (
        np.einsum("...i,...i->...", a, b) for a, b in ((d[1, 0], d[1, 0]), (d[1, 0], d[0, 1]), (d[0, 1], d[0, 1]))
    )
    l, m, n = (np.einsum("...i,...i->...", a, normal) for a in (d[2, 0], d[1, 1], d[0, 2]))
    mean = 0.5 * (e * n - 2.0 * f * m + g * l) / area**2
    gauss = (l * n - m * m) / area**2
    spread = np.sqrt(np.maximum(mean**2 - gauss, 0.0))
    towards = np.maximum(np.sign(distance) * mean + spread, 0.0)
    tightest = float(towards.max())
    if abs(distance) * tightest >= 1.0:
        i, j = np.unravel_index(int(towards.argmax()), towards.shape)
        raise InvalidInputError(
            f"the surface has a radius of {1.0 / tightest:.3g} at (u, v) = ({u[i]:g}, {v[j]:g}), not above the distance "
            f"{abs(distance):g} on that side: the parallel surface folds; widen the radius, or do without the offset"
        )
