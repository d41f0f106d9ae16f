"""Leaves of a surface, cut at the block borders, as chains of elastica that join with a common tangent (Fisker2018 §5.3).

A *chain* is the row of pieces of one leaf. At first every piece holds the leaf's own points and tangents at the borders and
is the elastica of least L² distance under these conditions. Where a piece strays more than the tolerance, the chain's
joints are moved, each along its border and in direction, all together, so that the greatest distance becomes least: a
linear minimax problem in the joints (Lawson's weights), solved again about every new chain.

Whether joints are moved is decided chain by chain, so that they may jump from leaf to leaf; `eased` lets the moves swell and
fade over the leaves, where the tolerance allows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from batten.curves.elastica import points_batch
from batten.errors import InvalidInputError
from batten.kernels.elastica_jacobian import jacobian_batch
from batten.solvers.curve_samples import CurveSamples, gauss_rule
from batten.solvers.elastica_fit import fit_samples
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.foliation import intersect_planes
from batten.surfaces.plane import Plane
from batten.typing import ArrayLike, BoolArray, FloatArray, IntArray

_STATIONS = 33  # where the distance of a piece from its leaf is measured
_LAWSON = 24
_EASES = (2.0, 1.0, 0.5)  # how far moves are spread, in distances between leaves; the first that keeps the tolerance
_FAR = 0.02  # of a piece's length: a fit that is farther away is tried again from other starts


@dataclass(frozen=True, eq=False)
class Chains:
    """m leaves of c pieces each.

    Attributes:
        planes: m planes. edges: (m, c + 1), abscissae of the joints in the planes.
        joints: (m, c + 1, 2), height and tangent angle at the joints. moved: (m, c + 1, 2), how far they were moved from
            the leaf's own values.
        parameters: (m, c, 7), the pieces as `Elastica.parameters`, in the planes' coordinates.
        status: (m, c), as `elastica_fit.STATUS`.
        deviation: (m, c), greatest distance of the piece from its leaf in the plane, over the stations that count; NaN where
            there is no piece. first_deviation: the same before joints were moved.
        lambda_residual: (m, c), of the leaf itself on the piece's interval (Brander2018 §2; R₁).
    """

    planes: tuple[Plane, ...]
    edges: FloatArray
    joints: FloatArray
    moved: FloatArray
    parameters: FloatArray
    status: IntArray
    deviation: FloatArray
    first_deviation: FloatArray
    lambda_residual: FloatArray

    def rows(self, index: IntArray) -> Chains:
        """Some of these chains."""
        arrays = (getattr(self, name)[index] for name in self.__dataclass_fields__ if name != "planes")
        return Chains(tuple(self.planes[i] for i in index), *arrays)

    def with_between(self, after: IntArray, others: Chains) -> Chains:
        """These chains with `others` put in, the k-th one behind chain `after[k]`."""
        order = np.argsort(np.concatenate([np.arange(len(self.planes)), np.asarray(after) + 0.5]), kind="stable")
        planes = (*self.planes, *others.planes)
        arrays = (
            np.concatenate([getattr(self, name), getattr(others, name)])[order]
            for name in self.__dataclass_fields__
            if name != "planes"
        )
        return Chains(tuple(planes[i] for i in order), *arrays)


def rationalise(
    surface: BSplineSurface,
    planes: Sequence[Plane],
    edges: ArrayLike,
    tolerance: float,
    *,
    inside: Callable[[FloatArray], BoolArray] | None = None,
    extend: float = 0.25,
    nodes: int = 24,
    rounds: int = 4,
    progress: Callable[[int, int], None] | None = None,
) -> Chains:
    """Fit a chain of elastica to every leaf.

    Parameters:
        surface: single-valued along the planes' y axes.
        planes: m planes.
        edges: (m, c + 1), ascending abscissae of the block borders in each plane.
        tolerance: distance above which a chain's joints are moved; same unit as the surface.
        inside: which points in space, (…, 3), count for the distance; all if None. Pieces without such a point are fitted
            but never moved for their own sake.
        extend: how far the surface may be continued beyond its domain (see `BSplineSurface`).
        nodes: Gauss nodes on each piece.
        rounds: how often a chain's joints may be moved.
        progress: called with (chains done, chains in all).

    Returns:
        `Chains`; a piece that cannot be fitted has a status above 1 and NaN parameters, and spoils no other chain.

    Raises:
        InvalidInputError: edges of another shape or not ascending, a tolerance that is not above 0.

    Accuracy: joints hold to 1e-12 of a piece's length; the distance is measured at 33 stations along each piece.
    """
    borders = np.asarray(edges, dtype=np.float64)
    if borders.ndim != 2 or len(borders) != len(planes) or borders.shape[1] < 2 or not (np.diff(borders) > 0).all():
        raise InvalidInputError(
            f"edges: got shape {borders.shape} for {len(planes)} planes; allowed is (planes, pieces + 1), ascending"
        )
    if not tolerance > 0.0:
        raise InvalidInputError(f"tolerance = {tolerance}; allowed are numbers above 0")
    sections = intersect_planes(surface, list(planes), borders, order=1, extend=extend)
    own = np.stack([sections.y, np.arctan(sections.slope)], axis=-1)
    target = _Target(surface, tuple(planes), borders, inside, extend, nodes)
    # In portions: a bar to look at, and arrays that stay in the cache.
    parts = []
    portion = max(8, -(-len(planes) // 20))
    for first in range(0, len(planes), portion):
        rows = np.arange(first, min(first + portion, len(planes)))
        parts.append(_fit_portion(target, rows, own[rows], tolerance, rounds))
        if progress is not None:
            progress(int(rows[-1]) + 1, len(planes))
    joints, parameters, status, deviation, before, residual = (np.concatenate([p[k] for p in parts]) for k in range(6))
    return Chains(tuple(planes), borders, joints, joints - own, parameters, status, deviation, before, residual)


def eased(
    surface: BSplineSurface,
    chains: Chains,
    tolerance: float,
    *,
    inside: Callable[[FloatArray], BoolArray] | None = None,
    extend: float = 0.25,
    nodes: int = 24,
) -> Chains:
    """The same chains with the moves of their joints spread over the leaves, so that they change gradually.

    `rationalise` moves the joints of a chain that misses the tolerance and leaves those of its neighbour that just keeps it:
    from one to the other the rods' ends jump, and a rod that is led between them strays from both leaves. Here the moves are
    averaged over neighbouring leaves with Gaussian weights, as wide as the tolerance allows, up to two distances between
    leaves. In the linear problem that the moves solve, a mean of moves that keep a distance keeps it too.

    Parameters:
        surface, inside, extend, nodes: as for `rationalise`.
        chains: in the order of their planes.
        tolerance: distance that a chain which keeps it must keep; the others stay as they are.

    Returns:
        The chains; `first_deviation` and `lambda_residual` are those of before.

    Raises:
        InvalidInputError: a tolerance that is not above 0.

    Accuracy: as `rationalise`.
    Degenerate: with fewer than three leaves, or without moves, the chains as they are.
    """
    if not tolerance > 0.0:
        raise InvalidInputError(f"tolerance = {tolerance}; allowed are numbers above 0")
    if len(chains.planes) < 3 or not chains.moved.any():
        return chains
    place = np.append(0.0, np.cumsum(np.linalg.norm(np.diff([p.origin for p in chains.planes], axis=0), axis=1)))
    target = _Target(surface, chains.planes, chains.edges, inside, extend, nodes)
    whole = (chains.status <= 1).all(axis=1)
    share = np.gradient(place) * whole  # leaves that lie close together count less
    pending = np.flatnonzero(whole & (np.nan_to_num(chains.deviation).max(axis=1, initial=0.0) <= tolerance))
    unit = np.array([1.0, 1.0 / float(np.diff(chains.edges).mean())])  # a turn by 1/length counts as a unit of height
    own = chains.joints - chains.moved
    joints, parameters, status, deviation = (
        getattr(chains, name).copy() for name in ("joints", "parameters", "status", "deviation")
    )
    for ease in _EASES:
        reach = ease * float(np.median(np.diff(place)))
        weights = np.exp(-0.5 * ((place[:, None] - place) / reach) ** 2) * share
        weights /= np.maximum(weights.sum(axis=1, keepdims=True), 1e-300)
        moved = np.einsum("ij,jkl->ikl", weights, chains.moved)
        changed = (np.abs(moved - chains.moved) / unit).max(axis=(1, 2)) > 1e-3 * tolerance
        rows = pending[changed[pending]]
        if not rows.size:
            break
        trial = own[rows] + moved[rows]
        edges, now = chains.edges[rows], chains.parameters[rows]
        new, new_status, _ = _fit_pieces(target.samples(rows), edges, trial, tolerance, now)
        new_deviation = _deviation(target, rows, new)[0]
        good = (new_status <= 1).all(axis=1) & (np.nan_to_num(new_deviation).max(axis=1, initial=0.0) <= tolerance)
        at = rows[good]
        joints[at], parameters[at], status[at], deviation[at] = (
            v[good] for v in (trial, new, new_status, new_deviation)
        )
        pending = rows[~good]
    return replace(chains, joints=joints, moved=joints - own, parameters=parameters, status=status, deviation=deviation)


class _Target:
    """The wanted leaves: samples for the fit, and distances from them."""

    def __init__(
        self,
        surface: BSplineSurface,
        planes: tuple[Plane, ...],
        edges: FloatArray,
        inside: Callable[[FloatArray], BoolArray] | None,
        extend: float,
        nodes: int,
    ) -> None:
        self.surface, self.planes, self.edges = surface, planes, edges
        self.inside, self.extend, self.nodes = inside, extend, nodes

    def samples(self, rows: IntArray) -> CurveSamples:
        """Samples of all pieces of some chains, chain by chain."""
        t, w, cumulative = gauss_rule(self.nodes)
        low, width = self.edges[rows, :-1], np.diff(self.edges[rows])
        x = low[..., None] + width[..., None] * t
        m, c, n = x.shape
        section = intersect_planes(
            self.surface, [self.planes[i] for i in rows], x.reshape(m, c * n), extend=self.extend
        )
        y, slope, curvature = (v.reshape(m * c, n) for v in (section.y, section.slope, section.curvature))
        speed = np.sqrt(1.0 + slope**2) * width.reshape(-1, 1)
        weights = speed * w
        lengths = weights.sum(axis=1)
        points = np.stack([x.reshape(m * c, n), y], axis=-1)
        fractions = (
            np.einsum("ik,jk->ij", speed, cumulative) / lengths[:, None]
        )  # rows alike in any company, unlike BLAS
        return CurveSamples(points, np.arctan(slope), curvature, weights, fractions, lengths, np.empty((m * c, 2, 3)))

    def offsets(self, rows: IntArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signed distance of points (r, c, n, 2) from their leaves in the plane, and the leaf's normals (r, c, n, 2).

        First order in the distance, exact on the leaf: (y − y_S(x)) cos α; where the foot lies outside, so that the leaf
        has ended there, the difference of height. Points that do not count have weight 0: NaN.
        """
        r, c, n, _ = points.shape
        section = intersect_planes(
            self.surface, [self.planes[i] for i in rows], points[..., 0].reshape(r, c * n), order=1, extend=self.extend
        )
        y, slope = section.y.reshape(r, c, n), section.slope.reshape(r, c, n)
        cosine = 1.0 / np.sqrt(1.0 + slope**2)
        offset = (points[..., 1] - y) * cosine
        normals = np.stack([-slope * cosine, cosine], axis=-1)
        if self.inside is not None:
            beyond = ~self._counts(rows, points - offset[..., None] * normals)
            offset = np.where(beyond, points[..., 1] - y, offset)
            normals = np.where(beyond[..., None], np.array([0.0, 1.0]), normals)
            offset = np.where(self._counts(rows, points), offset, np.nan)
        return offset, normals

    def _counts(self, rows: IntArray, points: FloatArray) -> BoolArray:
        """Whether points (r, c, n, 2) in the planes lie inside."""
        assert self.inside is not None
        return self.inside(np.stack([self.planes[i].to_world(points[k]) for k, i in enumerate(rows)]))


def _fit_portion(
    target: _Target, rows: IntArray, own: FloatArray, tolerance: float, rounds: int
) -> tuple[FloatArray, FloatArray, IntArray, FloatArray, FloatArray, FloatArray]:
    """Chains `rows`: joints, parameters, status, deviation, deviation at first, λ-residual."""
    samples = target.samples(rows)
    joints = own.copy()
    parameters, status, residual = _fit_pieces(samples, target.edges[rows], joints, tolerance)
    deviation, offsets, normals = _deviation(target, rows, parameters)
    first = deviation.copy()
    pending = np.flatnonzero(np.nanmax(deviation, axis=1, initial=0.0) > tolerance)
    reach = np.ones(len(rows))
    for _ in range(rounds):
        pending = pending[(status[pending] <= 1).all(axis=1)]
        if not pending.size:
            break
        step = _minimax_step(
            parameters[pending], offsets[pending], normals[pending], target.edges[rows[pending]], tolerance
        )
        trial = joints[pending] + reach[pending, None, None] * step
        part = _rows_of(samples, pending, parameters.shape[1])
        new, new_status, _ = _fit_pieces(part, target.edges[rows[pending]], trial, tolerance, parameters[pending])
        new_deviation, new_offsets, new_normals = _deviation(target, rows[pending], new)
        worst, new_worst = (np.nanmax(v, axis=1, initial=0.0) for v in (deviation[pending], new_deviation))
        better = (new_worst < worst) & (new_status <= 1).all(axis=1)
        at = pending[better]
        joints[at], parameters[at], status[at] = trial[better], new[better], new_status[better]
        deviation[at], offsets[at], normals[at] = new_deviation[better], new_offsets[better], new_normals[better]
        reach[pending[~better]] *= 0.35
        gained = np.where(better, new_worst < 0.98 * worst, reach[pending] > 0.1)
        pending = pending[gained]
    return joints, parameters, status, deviation, first, residual


def _fit_pieces(
    samples: CurveSamples, edges: FloatArray, joints: FloatArray, tolerance: float, given: FloatArray | None = None
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Fit all pieces between given joints: parameters (m, c, 7), status (m, c), λ-residual (m, c).

    From the chain's present pieces, if `given`, so that a small move of the joints does not change the branch.
    """
    m, c = len(edges), edges.shape[1] - 1
    corner = np.concatenate([edges[..., None], joints], axis=-1)
    ends = np.stack([corner[:, :-1], corner[:, 1:]], axis=2).reshape(m * c, 2, 3)
    held = replace(samples, ends=ends)
    # A force of 50/ℓ² weighs as much as a distance of twice the tolerance.
    known = samples.lengths[np.isfinite(samples.lengths)]
    weight = 4.0 * (tolerance / float(np.median(known)) / 50.0) ** 2 if known.size else 0.0
    if given is None:
        fits = fit_samples(held, ends="tangents", starts=1, force_weight=weight)
        poor = np.flatnonzero(~(fits.distance <= _FAR) | (fits.status != 0))
        if poor.size:  # the canonical guess led nowhere: other starts
            more = fit_samples(_pick(held, poor), ends="tangents", starts=4, force_weight=weight)
            better = ~(more.distance >= fits.distance[poor])
            fits.parameters[poor[better]], fits.status[poor[better]] = more.parameters[better], more.status[better]
    else:
        fits = fit_samples(held, ends="tangents", starts=1, given=given.reshape(m * c, 7), force_weight=weight)
    return fits.parameters.reshape(m, c, 7), fits.status.reshape(m, c), fits.r1.reshape(m, c)


def _pick(samples: CurveSamples, rows: IntArray) -> CurveSamples:
    return CurveSamples(*(getattr(samples, k)[rows] for k in CurveSamples.__dataclass_fields__))


def _rows_of(samples: CurveSamples, chains: IntArray, pieces: int) -> CurveSamples:
    return _pick(samples, (chains[:, None] * pieces + np.arange(pieces)).reshape(-1))


def _deviation(target: _Target, rows: IntArray, parameters: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Greatest distance (m, c), signed distances (m, c, n) and normals (m, c, n, 2) at the stations."""
    points = points_batch(parameters, np.linspace(0.0, 1.0, _STATIONS))
    offsets, normals = target.offsets(rows, points)
    finite = np.isfinite(offsets).any(axis=-1)
    worst = np.where(finite, np.abs(np.nan_to_num(offsets)).max(axis=-1), np.nan)
    return worst, offsets, normals


def _minimax_step(
    parameters: FloatArray, offsets: FloatArray, normals: FloatArray, edges: FloatArray, tolerance: float
) -> FloatArray:
    """Moves of the joints (r, c + 1, 2) that make the greatest linearised distance least; Lawson's algorithm.

    A piece has seven parameters and six end conditions: its response to the four joint numbers is the least-norm solution,
    and one direction z, a change of length, is left to each piece.
    """
    r, c, n = offsets.shape
    length = np.diff(edges)
    sensitivity = _sensitivity(parameters.reshape(r * c, 7), normals.reshape(r * c, n, 2), length.reshape(r * c))
    sensitivity = sensitivity.reshape(r, c, n, 5)
    # Unknowns of a chain: (c + 1) × (height, angle·length), then one for each piece.
    unknowns = 2 * (c + 1) + c
    system = np.zeros((r, c * n, unknowns))
    unit = length.mean()
    for j in range(c):
        block = slice(j * n, (j + 1) * n)
        system[:, block, 2 * j : 2 * j + 4] = sensitivity[:, j, :, :4] * np.array([1.0, 1.0 / unit, 1.0, 1.0 / unit])
        system[:, block, 2 * (c + 1) + j] = sensitivity[:, j, :, 4]
    residual = offsets.reshape(r, c * n)
    counts = np.isfinite(residual)
    residual = np.where(counts, residual, 0.0)
    weights = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    best = np.zeros((r, unknowns))
    best_worst = np.abs(residual).max(axis=1)
    cost = np.concatenate([np.full(2 * (c + 1), 1e-8), np.full(c, 0.04)])
    ridge = np.eye(unknowns) * (cost * best_worst[:, None] ** 2)[:, None, :]
    transposed = np.ascontiguousarray(system.transpose(0, 2, 1))
    for _ in range(_LAWSON):
        weighted = transposed * weights[:, None]
        solution = -np.linalg.solve(weighted @ system + ridge, weighted @ residual[..., None])
        remaining = np.abs(residual + (system @ solution)[..., 0]) * counts
        worst = remaining.max(axis=1)
        improved = worst < best_worst
        best[improved], best_worst[improved] = solution[improved, :, 0], worst[improved]
        weights = weights * (remaining + 0.02 * worst[:, None])
        weights /= weights.sum(axis=1, keepdims=True)
    moves = best[:, : 2 * (c + 1)].reshape(r, c + 1, 2) / np.array([1.0, unit])
    return np.asarray(np.clip(moves, [-20.0 * tolerance, -0.2], [20.0 * tolerance, 0.2]))


def _sensitivity(parameters: FloatArray, normals: FloatArray, length: FloatArray) -> FloatArray:
    """How far the stations of p pieces move along the leaf's normals (p, n, 2), for a unit of each unknown: (p, n, 5).

    The unknowns: height and angle of the first joint, of the second one, and the piece's own direction z.
    """
    p, n, _ = normals.shape
    values, full = np.empty((p, n, 4)), np.empty((p, n, 3, 7))
    jacobian_batch(np.ascontiguousarray(parameters), np.linspace(0.0, 1.0, n), values, full)
    scale = length[:, None] ** np.array([0.0, 0.0, -1.0, -2.0, -3.0, -3.0, 0.0])
    u, sigma, vt = np.linalg.svd(full[:, [0, -1]].reshape(p, 6, 7) * scale[:, None])
    inverse = vt[:, :6].transpose(0, 2, 1) @ (u.transpose(0, 2, 1) / sigma[..., None])
    response = inverse[:, :, [1, 2, 4, 5]] * scale[..., None]
    free = vt[:, -1] * scale
    # In units of a change of force by 5/ℓ²: beyond that the piece does not respond linearly.
    free *= (5.0 / np.maximum(np.hypot(free[:, 4], free[:, 5]) * length**2, 1e-9))[:, None]
    along = normals[..., :1] * full[:, :, 0] + normals[..., 1:] * full[:, :, 1]
    return np.asarray(along @ np.concatenate([response, free[..., None]], axis=2))
