"""Segments cut from a generating curve that the caller gives by its curvature (Levien2009 §4.8)."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from batten.curves.intrinsic import CurvatureFunction, IntrinsicCurve, IntrinsicTable
from batten.splines.segment_family import SegmentEnds
from batten.typing import FloatArray, IntArray

_GRID = 96
_LARGE = 0.4  # radians: smaller angles are reached from angles of this size
_ROUNDS = 30


class GeneratingCurve:
    """All segments [a, b] of one curve, scaled, turned, mirrored and run backwards.

    For angles (start, end) a window is sought so that the tangents at its ends have these angles to its chord: two unknowns,
    Newton's method with exact derivatives, from a window nearby in a table of 96 × 96. Mirror images and reversals are tried
    too, since the curve may lack the symmetry; of several windows the shortest over its chord is taken. Which windows there
    are depends on the curve: a spiral that is cut off does not reach the circle, so that exact arcs cannot be had from it.

    Parameters:
        curvature: κ of arc length, for arrays; it may vanish and change sign.
        low, high: where it is used. Small angles of two signs need an inflection between them.
        name: for tables and messages.

    Raises:
        InvalidInputError: low ≥ high, a curvature that is not finite there.

    Accuracy: angles to 1e-11; κ′ for the joints' equations by differences, which costs steps and no accuracy.

    Example:
        >>> from batten.splines.interpolating_spline import interpolating_spline
        >>> own = GeneratingCurve(lambda s: np.sinh(s), -4.0, 4.0, name="sinh")
        >>> spline = interpolating_spline([[0, 0], [1, 0.6], [2.2, 0.2], [3, 1]], own)
        >>> spline.method, spline.status
        ('sinh', 'converged')
    """

    winds = False
    exponent = 1.0
    reach = 2.0 * np.pi

    def __init__(self, curvature: CurvatureFunction, low: float, high: float, name: str = "generating curve") -> None:
        self.table = IntrinsicTable.of(curvature, low, high)
        self.name = name

    @cached_property
    def _windows(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(windows, 2), their angles (windows, 2) and length over chord; those that turn by a full turn are left out."""
        low, high = self.table.edges[0], self.table.edges[-1]
        edge = np.linspace(low, high, _GRID)
        a, b = (v.ravel() for v in np.meshgrid(edge, edge, indexing="ij"))
        keep = a < b
        windows = np.stack([a[keep], b[keep]], axis=1)
        angles = self._angles(windows)[0]
        _, z, _ = self.table.state(windows)
        with np.errstate(divide="ignore"):
            ratio = (windows[:, 1] - windows[:, 0]) / np.abs(z[:, 1] - z[:, 0])
        good = (np.abs(angles) < np.pi).all(axis=1) & (np.abs(angles[:, 1] - angles[:, 0]) < self.reach)
        return windows[good], angles[good], ratio[good]

    def _angles(self, windows: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(angles, curvature × chord, derivatives of the angles by a and b) of windows (n, 2)."""
        theta, z, kappa = self.table.state(windows)
        step = z[:, 1] - z[:, 0]
        chord = np.abs(step)
        middle = self.table.state(windows.mean(axis=1))[0]
        direction = middle + np.angle(step * np.exp(-1j * middle))
        angles = theta - direction[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            sine = np.sin(angles) / chord[:, None]
        # dχ = (sin(end) db − sin(start) da)/chord
        slopes = np.empty((len(windows), 2, 2))
        slopes[:, 0, 0], slopes[:, 0, 1] = kappa[:, 0] + sine[:, 0], -sine[:, 1]
        slopes[:, 1, 0], slopes[:, 1, 1] = sine[:, 0], kappa[:, 1] - sine[:, 1]
        return angles, kappa * chord[:, None], slopes

    def ends(self, angles: FloatArray, chords: FloatArray, memory: tuple[FloatArray, ...] = ()) -> SegmentEnds:
        """End curvatures; see `SegmentFamily`. memory: (n, 3), first and last arc length and −1 for a mirror image."""
        n = len(angles)
        best = np.full((n, 3), np.nan)
        if memory:
            known = memory[0]
            forward, mirror = known[:, 1] >= known[:, 0], known[:, 2] < 0.0
            windows = np.sort(known[:, :2], axis=1)
            found, good = self._newton(windows, _as_window(angles, mirror, ~forward))
            good &= np.abs(found - windows).max(axis=1) < 0.5 * (self.table.edges[-1] - self.table.edges[0])
            best[good] = _kept(found, mirror, ~forward)[good]
        rest = np.flatnonzero(np.isnan(best[:, 0]))
        if rest.size:
            best[rest] = self._search(angles[rest])
        exists = np.isfinite(best[:, 0])
        return SegmentEnds(*self._measured(best, exists), exists, (best,))

    def _measured(self, best: FloatArray, exists: np.ndarray) -> tuple[FloatArray, FloatArray]:
        """Curvatures and slopes, as the segment is run."""
        n = len(best)
        curvatures, slopes = np.full((n, 2), np.nan), np.full((n, 2, 2), np.nan)
        own = best[exists]
        if not len(own):
            return curvatures, slopes
        backwards, mirror = own[:, 0] > own[:, 1], own[:, 2] < 0.0
        windows = np.sort(own[:, :2], axis=1)
        angles, bend, by_ends = self._angles(windows)
        _, z, kappa = self.table.state(windows)
        chord = np.abs(z[:, 1] - z[:, 0])
        h = 1e-5 * (windows[:, 1] - windows[:, 0])
        slope = (self._kappa(windows + h[:, None]) - self._kappa(windows - h[:, None])) / (2.0 * h[:, None])
        # d(κ·chord) by a and b; dchord = cos(end) db − cos(start) da
        moved = np.empty((len(own), 2, 2))
        cos = np.cos(angles)
        moved[:, 0, 0], moved[:, 0, 1] = slope[:, 0] * chord - kappa[:, 0] * cos[:, 0], kappa[:, 0] * cos[:, 1]
        moved[:, 1, 0], moved[:, 1, 1] = -kappa[:, 1] * cos[:, 0], slope[:, 1] * chord + kappa[:, 1] * cos[:, 1]
        d = moved @ np.linalg.pinv(by_ends)
        # Mirrored: angles and curvatures change sign. Backwards: ends are exchanged, curvature changes sign.
        d[backwards] = -d[backwards][:, ::-1, ::-1]
        bend = np.where(mirror[:, None], -bend, bend)
        bend[backwards] = -bend[backwards][:, ::-1]
        curvatures[exists], slopes[exists] = bend, d
        return curvatures, slopes

    def _kappa(self, s: FloatArray) -> FloatArray:
        return np.asarray(self.table.curvature(np.clip(s, self.table.edges[0], self.table.edges[-1])), dtype=np.float64)

    def _search(self, angles: FloatArray) -> FloatArray:
        """The shortest window for each row of angles over all four ways to run it; NaN where there is none."""
        best = np.full((len(angles), 3), np.nan)
        shortest = np.full(len(angles), np.inf)
        size = np.abs(angles).max(axis=1)
        grow = np.maximum(1.0, _LARGE / np.maximum(size, 1e-12))
        windows, known, ratios = self._windows
        for mirror in (False, True):
            for backwards in (False, True):
                wanted = _as_window(angles, np.full(len(angles), mirror), np.full(len(angles), backwards))
                near = self._nearest(known, ratios, wanted * grow[:, None])
                found, good = self._newton(windows[near], wanted * grow[:, None])
                share = grow.copy()
                while good.any() and (share[good] > 1.0).any():  # back to small angles
                    share = np.maximum(1.0, 0.5 * share)
                    following, fine = self._newton(found, wanted * share[:, None])
                    found, good = np.where(good[:, None], following, found), good & fine
                _, z, _ = self.table.state(np.where(good[:, None], found, windows[:1]))
                with np.errstate(divide="ignore", invalid="ignore"):
                    ratio = np.where(good, (found[:, 1] - found[:, 0]) / np.abs(z[:, 1] - z[:, 0]), np.inf)
                take = ratio < shortest - 1e-9
                shortest[take] = ratio[take]
                every = np.full(len(angles), mirror), np.full(len(angles), backwards)
                best[take] = _kept(found, *every)[take]
        return best

    @staticmethod
    def _nearest(known: FloatArray, ratios: FloatArray, wanted: FloatArray) -> IntArray:
        """For each row the least winding one of the windows whose angles are near."""
        from scipy.spatial import cKDTree

        count = min(24, len(known))
        distance, index = cKDTree(known).query(wanted, k=count)
        distance, index = distance.reshape(len(wanted), count), index.reshape(len(wanted), count)
        near = distance <= 2.0 * distance[:, :1] + 0.05
        best = np.argmin(np.where(near, ratios[index], np.inf), axis=1)
        return np.asarray(index[np.arange(len(wanted)), best])

    def _newton(self, windows: FloatArray, wanted: FloatArray) -> tuple[FloatArray, np.ndarray]:
        """Windows (n, 2) with the wanted angles, from others nearby, and which were found; damped, kept in the table."""
        low, high = self.table.edges[0], self.table.edges[-1]
        own = windows.copy()
        for _ in range(_ROUNDS):
            angles, _, slopes = self._angles(own)
            miss = angles - wanted
            worst = np.abs(miss).max(axis=1)
            if (worst[np.isfinite(worst)] < 1e-13).all():
                break
            with np.errstate(divide="ignore", invalid="ignore"):
                det = slopes[:, 0, 0] * slopes[:, 1, 1] - slopes[:, 0, 1] * slopes[:, 1, 0]
                step_a = -(slopes[:, 1, 1] * miss[:, 0] - slopes[:, 0, 1] * miss[:, 1]) / det
                step_b = -(slopes[:, 0, 0] * miss[:, 1] - slopes[:, 1, 0] * miss[:, 0]) / det
            width = own[:, 1] - own[:, 0]
            factor = np.minimum(1.0, 0.4 * width / np.maximum(np.maximum(np.abs(step_a), np.abs(step_b)), 1e-300))
            step = np.nan_to_num(np.stack([step_a, step_b], axis=1) * factor[:, None])
            own = np.clip(own + step, low, high)
        size = 1e-11 * (1.0 + np.abs(wanted).max(axis=1))
        return own, (np.abs(self._angles(own)[0] - wanted).max(axis=1) < size) & (own[:, 1] > own[:, 0])

    def curve(self, p: FloatArray, q: FloatArray, kept: FloatArray) -> IntrinsicCurve:
        """The segment from p to q of a row of the memory."""
        return IntrinsicCurve(self.table, float(kept[0]), float(kept[1]), bool(kept[2] < 0.0), p, q)


def _as_window(angles: FloatArray, mirror: np.ndarray, backwards: np.ndarray) -> FloatArray:
    """Angles that the window itself must have."""
    own = np.where(mirror[:, None], -angles, angles)
    return np.where(backwards[:, None], own[:, ::-1], own)


def _kept(windows: FloatArray, mirror: np.ndarray, backwards: np.ndarray) -> FloatArray:
    """(first, last, ±1)."""
    ends = np.where(backwards[:, None], windows[:, ::-1], windows)
    return np.column_stack([ends, np.where(mirror, -1.0, 1.0)])
