"""Where a scan of the cut part lies in the wall frame: the pose that brings it onto the design surface."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from batten.errors import InvalidInputError, NoSolutionError
from batten.surfaces.bspline_surface import BSplineSurface
from batten.typing import ArrayLike, BoolArray, FloatArray, IntArray

LEAST_POINTS = 200
"""Points that a scan needs at least."""

_GRID = 320  # samples of the design, each way
_NEARLY = 0.25  # a sample at most this much farther than the nearest will do for the rough fit
_THIN = 13  # one sample in so many is kept for the rough fit
_ANGLES = 12  # turns about the normal that are tried, twice: either side up
_PLACES = 6  # places along the design's longer side where a smaller scan is tried, at most
_COARSE, _MIDDLE, _FINE = 200, 1000, 10000  # points of the scan, stage by stage
_TUKEY = 4.685  # the biweight's constant: 95 % of the efficiency of least squares under normal errors
_ALIKE = 1.1  # poses whose misfits differ by less are equally good
_HELD = 1e-7  # directions whose share of the normal matrix is below this are left alone


@dataclass(frozen=True, eq=False)
class ScanDesign:
    """The surface that a scan is laid on: all of it, or what lies within a window of the plan.

    Parameters:
        surface: the wanted surface in the wall frame, mm; a graph over its plan.
        window: ((x₀, y₀), (x₁, y₁)), the part of the plan that was scanned; None for all.

    Raises:
        InvalidInputError: a window that holds no part of the surface.
    """

    surface: BSplineSurface
    window: tuple[tuple[float, float], tuple[float, float]] | None = None

    def __post_init__(self) -> None:
        if len(self.points) < 16:
            raise InvalidInputError(
                f"window {self.window}: holds no part of the surface, which lies over {self._plan()}; give one that does"
            )

    def _plan(self) -> str:
        low, high = self.surface.bounding_box()
        return f"x {low[0]:.6g} … {high[0]:.6g}, y {low[1]:.6g} … {high[1]:.6g} mm"

    def holds(self, plan: FloatArray) -> BoolArray:
        """Whether places (…, 2 or 3) lie in the window."""
        if self.window is None:
            return np.ones(plan.shape[:-1], dtype=np.bool_)
        low, high = np.array(self.window)
        return np.asarray(((plan[..., :2] >= low) & (plan[..., :2] <= high)).all(axis=-1))

    @cached_property
    def _samples(self) -> tuple[FloatArray, FloatArray, BoolArray, float]:
        """Points, unit normals that point up, whether each is the outermost of its row, and the samples' spacing."""
        u, v = (np.linspace(*ends, _GRID) for ends in self.surface.domain)
        if self.window is not None:  # once more, as finely, between the parameters of the window
            inside = self.holds(self.surface.point(u[:, None], v))
            rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
            if not len(rows):
                return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=np.bool_), 0.0
            u, v = (
                np.linspace(t[max(i[0] - 1, 0)], t[min(i[-1] + 1, _GRID - 1)], _GRID)
                for t, i in ((u, rows), (v, columns))
            )
        d = self.surface.derivatives(u[:, None], v, 1)
        normals = np.cross(d[1, 0], d[0, 1])
        normals *= np.where(normals[..., 2:] < 0.0, -1.0, 1.0) / np.linalg.norm(normals, axis=-1, keepdims=True)
        inside = self.holds(d[0, 0])
        inner = inside.copy()
        inner[[0, -1]] = inner[:, [0, -1]] = False
        inner[1:-1, 1:-1] &= inside[2:, 1:-1] & inside[:-2, 1:-1] & inside[1:-1, 2:] & inside[1:-1, :-2]
        steps = [np.linalg.norm(np.diff(d[0, 0], axis=k), axis=-1).ravel() for k in (0, 1)]
        return d[0, 0][inside], normals[inside], ~inner[inside], float(np.percentile(np.concatenate(steps), 98.0))

    @property
    def points(self) -> FloatArray:
        """Samples of the design, shape (n, 3)."""
        return self._samples[0]

    @property
    def normals(self) -> FloatArray:
        """Their unit normals, upwards, shape (n, 3)."""
        return self._samples[1]

    @property
    def is_border(self) -> BoolArray:
        """Which of them lie at the border, shape (n,)."""
        return self._samples[2]

    @property
    def spacing(self) -> float:
        """How far neighbouring samples lie apart, mm."""
        return self._samples[3]

    @cached_property
    def tree(self) -> cKDTree:
        """A search tree of the samples."""
        return cKDTree(self.points)

    @cached_property
    def coarse(self) -> tuple[cKDTree, IntArray]:
        """A search tree of one sample in thirteen and of the border, and which they are: far points search long."""
        kept = np.flatnonzero(self.is_border | (np.arange(len(self.points)) % _THIN == 0))
        return cKDTree(self.points[kept]), kept

    @cached_property
    def radius(self) -> float:
        """Root mean square distance of the samples from their middle, mm."""
        return float(np.sqrt(((self.points - self.points.mean(axis=0)) ** 2).sum(axis=1).mean()))


@dataclass(frozen=True, eq=False)
class Registration:
    """Where a scan lies.

    Attributes:
        pose: shape (4, 4), takes points of the scan to the wall frame, both in mm; a rotation and a shift, no scale.
        noise_mm: 1.4826 × the median distance of what was used from the tangent planes: σ of normal errors.
        used: share of the sampled points that have weight in the fit.
        pose_error_mm: standard error of the worst direction of the pose, a turn counted at the design's radius, as if
            the errors of the points were independent of each other; inf if the surface leaves a direction free.
        rival: misfit of the next best pose, as a multiple of this one's: near 1 the scan fits in two ways. NaN if no
            other was found, or none was looked for.
    """

    pose: FloatArray
    noise_mm: float
    used: float
    pose_error_mm: float
    rival: float


def placed(pose: ArrayLike, points: FloatArray) -> FloatArray:
    """Points (n, 3) moved by a pose (4, 4)."""
    m = np.asarray(pose, dtype=np.float64)
    return np.asarray(points @ m[:3, :3].T + m[:3, 3])


def register_scan(design: ScanDesign, points: ArrayLike, *, start: ArrayLike | None = None) -> Registration:
    """The pose that lays a scan on the design (the comparison of Fisker2018 Fig. 1.2 needs it).

    Where several poses fit equally well (within 10 %), the one that turns the scan least is taken.

    Rough fit: the principal axes of the scan on those of the design, either side up and in twelve turns about the
    normal, since a square part has no longer axis; for a scan that is smaller than the design, at places all over it.
    The best go on by iterated closest points, point to tangent plane, with Tukey's biweight at 4.685 σ, σ from the
    median; matches with the design's border do not count. At the end the feet are exact, not samples.

    Parameters:
        design: what was to be cut.
        points: the scan, shape (n, 3), mm, n ≥ 200; rows that are not finite are left out.
        start: a pose (4, 4) near the wanted one, for example the unit matrix for a scan in the wall frame; None to search.

    Returns:
        The pose and how well it is known.

    Raises:
        InvalidInputError: too few points; a scan far larger or smaller than the design; a `start` that is no pose.
        NoSolutionError: the scan fits nowhere: it remains farther than 2 % of the design's radius from it.

    Accuracy: `pose_error_mm` for independent errors. Most of the points must lie on the design; up to about 30 % may be
    anything else. A scan that is small and nearly flat, or a design that is the same after a turn, fits in several
    ways: `rival`.

    Degenerate cases: directions that the surface leaves free (a plane slides along itself) stay as the rough fit put them.

    Example:
        >>> net = [[(0, 0, 0), (0, 50, 40), (0, 100, 0)], [(50, 0, 0), (50, 50, 0), (50, 100, 30)],
        ...        [(100, 0, 60), (100, 50, 0), (100, 100, -20)]]
        >>> bowl = BSplineSurface([0, 0, 0, 1, 1, 1], [0, 0, 0, 1, 1, 1], 2, 2, net)
        >>> t = np.linspace(0.0, 1.0, 30)
        >>> scan = bowl.point(t[:, None], t).reshape(-1, 3)[:, [1, 2, 0]] + [500.0, 0.0, -70.0]
        >>> found = register_scan(ScanDesign(bowl), scan)
        >>> bool(np.abs(placed(found.pose, np.array([[500.0, 0.0, -70.0]]))).max() < 1e-6)
        True
    """
    scan = np.asarray(points, dtype=np.float64)
    if scan.ndim != 2 or scan.shape[1] != 3:
        raise InvalidInputError(f"points: got shape {scan.shape}; allowed is (n, 3)")
    scan = scan[np.isfinite(scan).all(axis=1)]
    if len(scan) < LEAST_POINTS:
        raise InvalidInputError(f"the scan has {len(scan)} points; at least {LEAST_POINTS} are needed")
    scan = np.random.default_rng(0).permutation(scan[:: max(1, len(scan) // (10 * _FINE))])[:_FINE]
    rival = float("nan")
    if start is None:
        _check_size(design, scan)
        pose, rival = _searched(design, scan)
    else:
        pose = np.asarray(start, dtype=np.float64)
        turn = pose[:3, :3] if pose.shape == (4, 4) else np.zeros((3, 3))
        if not (
            np.isfinite(pose).all() and np.allclose(turn @ turn.T, np.eye(3), atol=1e-6) and np.linalg.det(turn) > 0.0
        ):
            raise InvalidInputError("start: allowed is a pose (4, 4) of a rotation and a shift; try numpy.eye(4)")
        pose = _followed(design, scan[:_MIDDLE], pose[None], 60)[0]
    return _polished(design, scan, pose, rival)


def _check_size(design: ScanDesign, scan: FloatArray) -> None:
    _, _, size = _axes(scan)
    ratio = size[0] / _axes(design.points)[2][0]
    if not 0.02 < ratio < 3.0:
        raise InvalidInputError(
            f"the scan is about {4.0 * size[0]:.3g} mm long, {ratio:.3g} times the design: another unit, or another part? "
            "Give the scan's unit, or crop it to the part"
        )


def _axes(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Middle (3,), principal axes as rows (3, 3), longest first, and standard deviations along them; far points left out."""
    middle = np.median(points, axis=0)
    distance = np.linalg.norm(points - middle, axis=1)
    near = points[distance <= 3.0 * np.median(distance)]
    middle = near.mean(axis=0)
    values, vectors = np.linalg.eigh(np.cov((near - middle).T))
    axes = vectors.T[::-1].copy()
    axes[2] = np.cross(axes[0], axes[1])
    return middle, axes, np.sqrt(np.maximum(values[::-1], 0.0))


def _searched(design: ScanDesign, scan: FloatArray) -> tuple[FloatArray, float]:
    """The best pose of many, and the misfit of the next best over its own."""
    poses = _candidates(design, scan)
    for count, rounds, kept in ((_COARSE, 5, 40), (_COARSE, 20, 8), (_MIDDLE, 20, 8)):
        rough = count == _COARSE
        poses = _followed(design, scan[:count], poses, rounds, rough)
        misfits = _misfits(design, scan[:count], poses, rough)
        order = np.argsort(misfits)
        if count != _COARSE or rounds > 5:  # those that met in one place count once
            order = _distinct(scan[:50], poses, order, max(0.05 * design.radius, 4.0 * design.spacing))
        poses, misfits = poses[order[:kept]], misfits[order[:kept]]
    alike = np.flatnonzero(misfits < _ALIKE * misfits[0] + 1e-9 * design.radius)
    best = int(alike[np.argmax([np.trace(poses[i, :3, :3]) for i in alike])])  # the least turn
    some = scan[:_COARSE]
    own = placed(poses[best], some)
    apart = np.array([np.linalg.norm(placed(pose, some) - own, axis=1).mean() for pose in poses])
    others = misfits[apart > max(0.05 * design.radius, 4.0 * design.spacing)]
    return poses[best], float(others[0] / max(misfits[best], 1e-300)) if len(others) else float("nan")


def _distinct(scan: FloatArray, poses: FloatArray, order: IntArray, apart: float) -> IntArray:
    """Of the poses in this order, those that put the scan farther than `apart` from where all before them do."""
    places: list[FloatArray] = []
    kept: list[int] = []
    for i in order:
        moved = placed(poses[i], scan)
        if all(float(np.linalg.norm(moved - p, axis=1).mean()) > apart for p in places):
            places.append(moved)
            kept.append(int(i))
    return np.array(kept, dtype=np.int64)


def _candidates(design: ScanDesign, scan: FloatArray) -> FloatArray:
    """Poses (c, 4, 4) of the rough fit; the first leaves the scan where it is."""
    middle, axes, size = _axes(scan)
    design_middle, design_axes, design_size = _axes(design.points)
    share = float(np.clip(size[0] / design_size[0], 0.0, 1.0))
    patches = [(design_middle, design_axes)]
    if share < 0.9:
        flat = (design.points - design_middle) @ design_axes.T
        for place in _places(flat[:, :2], share):
            near = design.points[np.linalg.norm(flat[:, :2] - place, axis=1) < 2.0 * size[0]]
            patches.append(_axes(near)[:2])
    turns = 2.0 * np.pi * np.arange(_ANGLES) / _ANGLES
    poses = [np.eye(4)]
    for patch_middle, patch_axes in patches:
        for side in (1.0, -1.0):
            for c, s in zip(np.cos(turns), np.sin(turns)):
                own = np.array([[c, s, 0.0], [-s * side, c * side, 0.0], [0.0, 0.0, side]]) @ axes
                pose = np.eye(4)
                pose[:3, :3] = patch_axes.T @ own
                pose[:3, 3] = patch_middle - pose[:3, :3] @ middle
                poses.append(pose)
    return np.array(poses)


def _places(flat: FloatArray, share: float) -> FloatArray:
    """Middles (m, 2) where a scan of `share` of the design's size may lie, on a grid over the design's middle plane."""
    low, high = flat.min(axis=0), flat.max(axis=0)
    width = high - low
    count = np.clip(np.ceil(1.5 * width / (share * width.max())).astype(int), 1, _PLACES)
    inset = np.minimum(0.5 * share * width.max(), 0.5 * width)
    lines = [np.linspace(a + i, b - i, n) for a, b, i, n in zip(low, high, inset, count)]
    return np.stack(np.meshgrid(*lines), axis=-1).reshape(-1, 2)


def _matched(
    design: ScanDesign, moved: FloatArray, rough: bool = False
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """For points (c, m, 3): distance to the nearest sample, its normal, the way to its tangent plane, at the border?"""
    if rough:
        distance, index = design.coarse[0].query(moved, eps=_NEARLY, workers=-1)
        index = design.coarse[1][index]
    else:
        distance, index = design.tree.query(moved, workers=-1)
    normals = design.normals[index]
    away = np.einsum("cmi,cmi->cm", design.points[index] - moved, normals)
    return np.asarray(distance), normals, np.asarray(away), design.is_border[index]


def _misfits(design: ScanDesign, scan: FloatArray, poses: FloatArray, rough: bool) -> FloatArray:
    """Root mean square distance, (c,), none counted beyond 5 % of the radius: poses compare over the same points."""
    moved = scan @ poses[:, :3, :3].transpose(0, 2, 1) + poses[:, None, :3, 3]
    distance, _, away, border = _matched(design, moved, rough)
    tight = np.maximum(np.abs(away), distance - design.spacing * (np.sqrt(_THIN) if rough else 1.0))
    cap = 0.05 * design.radius
    return np.asarray(np.sqrt((np.minimum(np.where(border, distance, tight), cap) ** 2).mean(axis=1)))


def _followed(design: ScanDesign, scan: FloatArray, poses: FloatArray, rounds: int, rough: bool = False) -> FloatArray:
    """Poses (c, 4, 4) after some rounds of closest points, all at once."""
    poses = poses.copy()
    for _ in range(rounds):
        moved = scan @ poses[:, :3, :3].transpose(0, 2, 1) + poses[:, None, :3, 3]
        _, normals, away, border = _matched(design, moved, rough)
        weights, _ = _weights(away, ~border)
        poses, step, _ = _stepped(poses, moved, normals, away, weights, design.radius)
        if float(step.max()) < 1e-3 * design.spacing:
            break
    return poses


def _weights(away: FloatArray, usable: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Tukey's biweight of residuals (c, m), 0 where they are not usable; and σ (c,) from the median of those that are."""
    size = np.sort(np.where(usable, np.abs(away), np.inf), axis=1)
    half = np.maximum(usable.sum(axis=1) - 1, 0) // 2
    middle = size[np.arange(len(size)), half]
    sigma = 1.4826 * np.where(np.isfinite(middle), middle, 0.0)
    share = away / np.maximum(_TUKEY * sigma, 1e-9)[:, None]
    return np.where(usable & (np.abs(share) < 1.0), (1.0 - share**2) ** 2, 0.0), sigma


def _stepped(
    poses: FloatArray, moved: FloatArray, normals: FloatArray, away: FloatArray, weights: FloatArray, radius: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Poses after one step of least squares, the step's size (c,) in mm, and the normal matrices' eigenvalues (c, 6)."""
    total = np.maximum(weights.sum(axis=1), 1e-300)
    middle = np.einsum("cm,cmi->ci", weights, moved) / total[:, None]
    arm = (moved - middle[:, None]) / radius
    rows = np.concatenate([np.cross(arm, normals), normals], axis=2)
    weighted = rows * weights[..., None]
    values, vectors = np.linalg.eigh(weighted.transpose(0, 2, 1) @ rows)
    right = np.einsum("cmi,cm->ci", weighted, away)
    inverse = np.where(values > _HELD * values[:, -1:], 1.0 / np.maximum(values, 1e-300), 0.0)
    x = np.einsum("cij,cj->ci", vectors, inverse * np.einsum("cji,cj->ci", vectors, right))
    turn = Rotation.from_rotvec(x[:, :3] / radius).as_matrix()
    result = poses.copy()
    result[:, :3, :3] = turn @ poses[:, :3, :3]
    shift = poses[:, :3, 3] - middle
    result[:, :3, 3] = np.einsum("cij,cj->ci", turn, shift) + middle + x[:, 3:]
    return result, np.linalg.norm(x, axis=1), values


def _polished(design: ScanDesign, scan: FloatArray, pose: FloatArray, rival: float) -> Registration:
    """The pose with exact feet, by the same steps; refuses one that does not fit."""
    moved = placed(pose, scan)
    distance, _, _, border = _matched(design, moved[None])
    if float(np.median(distance)) > 0.02 * design.radius + design.spacing:
        raise NoSolutionError(
            f"the scan fits nowhere on the design: half of its points remain {float(np.median(distance)):.3g} mm away or "
            "more; crop it to the cut surface, say which block it is, check its unit, or bring it close by hand"
        )
    scan = scan[~border[0] & (distance[0] < 0.05 * design.radius + design.spacing)]
    poses, surface = pose[None], design.surface
    values, weights, sigma, error = np.zeros((1, 6)), np.zeros((1, len(scan))), np.zeros(1), 0.0
    for count in range(25):
        some = scan if count > 3 else scan[: len(scan) // 4]  # the last steps with all
        moved = placed(poses[0], some)
        u, v = surface.closest_parameters(moved)
        d = surface.derivatives(u, v, 1)
        normals = np.cross(d[1, 0], d[0, 1])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        away = np.einsum("mi,mi->m", d[0, 0] - moved, normals)
        usable = ~on_border(surface, u, v) & design.holds(d[0, 0])
        weights, sigma = _weights(away[None], usable[None])
        poses, step, values = _stepped(poses, moved[None], normals[None], away[None], weights, design.radius)
        error = float(sigma[0] / np.sqrt(max(float(values[0, 0]), 1e-300)))
        if count > 3 and float(step[0]) < 1e-9 * design.radius + 0.01 * error:
            break
    free = values[0, 0] <= _HELD * values[0, -1]
    error = float("inf") if free else error
    return Registration(poses[0], float(sigma[0]), float((weights > 0.0).sum() / len(distance[0])), error, rival)


def on_border(surface: BSplineSurface, u: FloatArray, v: FloatArray) -> BoolArray:
    """Whether parameters lie on the border of the surface: what has its foot there may lie beyond it."""
    (u0, u1), (v0, v1) = surface.domain
    a, b = 1e-9 * (u1 - u0), 1e-9 * (v1 - v0)
    return np.asarray((u <= u0 + a) | (u >= u1 - a) | (v <= v0 + b) | (v >= v1 - b))
