"""A rod through fixed points as clamped pieces, and the descent of its energy by the angles and lengths between them.

Every piece is the clamped elastica of its two joint angles and its length, followed by Newton's method as these change. With
E = ½ Σ ∫κ² ds and H = ½κ² − force·tangent, constant along a piece (Brander2016 eq. 1 integrated once),

    ∂E/∂θⱼ = κ at the end of the piece before − κ at the start of the piece behind,   ∂E/∂ℓᵢ = −Hᵢ,

and second derivatives follow from those of the end point. So at a minimum moments are continuous, and with them, where the
rod slides, the force along the tangent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from batten.curves.elastica import Elastica, states_at
from batten.errors import ConvergenceError
from batten.kernels.elastica_jacobian import jacobian_batch
from batten.solvers.stability import margins
from batten.solvers.track import fallen
from batten.typing import BoolArray, FloatArray, IntArray

_TIPS = np.array([-0.5, 0.5])
_CORRECTIONS = 20
_MET = (
    1e-8  # miss of an end, of the whole length, at which a piece counts as found; 1e-15 is usual, stiff ones are worse
)
_WIDEST = 0.5  # of a step: radians, or parts of what a length has beyond its chord
_NARROWEST = 1e-7
_ITERATIONS = 400
_MOST_SNAPS = 20
_STILL = 1e-12  # decrease that a step would bring, of the energy, at which Newton's method takes over
_LONGEST = 50.0  # times the chords: a rod of free length that is longer has no least energy


@dataclass(frozen=True, eq=False)
class RodPieces:
    """Clamped pieces between n points.

    Attributes:
        points: (n, 2). angles: (n,), tangent angles at the points. lengths: (n − 1,).
        middles: (n − 1, 6), (x, y, θ, κ, λ₁, λ₂) in the middle of each piece: from there neither end is far, and a stiff
            piece keeps twice as many digits.
    """

    points: FloatArray
    angles: FloatArray
    lengths: FloatArray
    middles: FloatArray

    @classmethod
    def of(cls, points: FloatArray, angles: FloatArray, parameters: FloatArray) -> RodPieces:
        """Pieces from `Elastica.parameters`, (n − 1, 7)."""
        middles = states_at(parameters, 0.5 * parameters[:, 6])
        return cls(points, angles, parameters[:, 6].copy(), np.concatenate([middles, parameters[:, 4:6]], axis=1))

    @property
    def parameters(self) -> FloatArray:
        """(n − 1, 7), as `Elastica.parameters`."""
        return np.column_stack(
            [self.points[:-1], self.angles[:-1], self._curvatures(self.points[:-1]), self.middles[:, 4:], self.lengths]
        )

    def _curvatures(self, points: FloatArray) -> FloatArray:
        """Curvature of the pieces in points of theirs: affine in position (Brander2016 eq. 5)."""
        x, y = (points - self.middles[:, :2]).T
        return np.asarray(self.middles[:, 3] + x * self.middles[:, 5] - y * self.middles[:, 4])

    @property
    def slips(self) -> FloatArray:
        """H = ½κ² − force·tangent of each piece, (n − 1,)."""
        _, _, angle, kappa, fx, fy = self.middles.T
        return np.asarray(0.5 * kappa**2 - fx * np.cos(angle) - fy * np.sin(angle))

    @property
    def energy(self) -> float:
        """½ Σ ∫κ² ds, from H and the forces."""
        along = (self.middles[:, 4:] * np.diff(self.points, axis=0)).sum(axis=1)
        return float((self.slips * self.lengths + along).sum())

    @property
    def gradient(self) -> FloatArray:
        """∂E by the n angles and the n − 1 lengths, (2n − 1,)."""
        n = len(self.points)
        out = np.zeros(2 * n - 1)
        out[1:n] += self._curvatures(self.points[1:])
        out[: n - 1] -= self._curvatures(self.points[:-1])
        out[n:] = -self.slips
        return out

    def misses(self) -> tuple[FloatArray, FloatArray]:
        """How far the pieces' ends lie from their points and angles, (n − 1, 6), and derivatives (n − 1, 6, 7)."""
        rows = np.column_stack([self.middles, self.lengths])
        values, slopes = np.empty((len(rows), 2, 4)), np.empty((len(rows), 2, 3, 7))
        jacobian_batch(np.ascontiguousarray(rows), _TIPS, values, slopes)
        wanted = np.column_stack([self.points, self.angles])
        miss = values[:, :, :3] - np.stack([wanted[:-1], wanted[1:]], axis=1)
        return miss.reshape(-1, 6), slopes.reshape(-1, 6, 7)

    def responses(self) -> FloatArray:
        """Derivatives of `middles` by a piece's two angles and its length, (n − 1, 6, 3)."""
        slopes = self.misses()[1]
        by = np.zeros((len(slopes), 6, 3))
        by[:, 2, 0] = by[:, 5, 1] = 1.0
        by[:, :, 2] = -slopes[:, :, 6]
        return np.asarray(np.linalg.solve(slopes[:, :, :6], by))

    def hessian(self) -> FloatArray:
        """Second derivatives of E by angles and lengths, (2n − 1, 2n − 1)."""
        n = len(self.points)
        d = self.responses()
        _, _, angle, kappa, fx, fy = self.middles.T[:, :, None]
        cos, sin = np.cos(angle), np.sin(angle)
        common = d[:, 3] - d[:, 0] * fy + d[:, 1] * fx
        ends = []
        for points in (self.points[:-1], self.points[1:]):
            x, y = (points - self.middles[:, :2]).T[:, :, None]
            ends.append(common + x * d[:, 5] - y * d[:, 4])
        slip = kappa * d[:, 3] - cos * d[:, 4] - sin * d[:, 5] + (fx * sin - fy * cos) * d[:, 2]
        blocks = np.stack([-ends[0], ends[1], -slip], axis=1)
        out = np.zeros((2 * n - 1, 2 * n - 1))
        for i, block in enumerate(blocks):
            at = np.array([i, i + 1, n + i])
            out[np.ix_(at, at)] += 0.5 * (block + block.T)
        return out

    def moved(self, angles: FloatArray, lengths: FloatArray) -> tuple[RodPieces, BoolArray]:
        """The pieces for other angles and lengths nearby, and which of them were found."""
        change = np.stack(
            [angles[:-1] - self.angles[:-1], angles[1:] - self.angles[1:], lengths - self.lengths], axis=1
        )
        middles = self.middles + np.einsum("ijk,ik->ij", self.responses(), change)
        return RodPieces(self.points, angles, lengths, middles).corrected()

    def corrected(self) -> tuple[RodPieces, BoolArray]:
        """Newton's method on the ends of all pieces, as long as each step at least halves the miss."""
        pieces, middles, best = self, self.middles.copy(), self.middles.copy()
        least = np.full(len(middles), np.inf)
        going = np.ones(len(middles), dtype=bool)
        for _ in range(_CORRECTIONS):
            with np.errstate(all="ignore"):
                miss, slopes = pieces.misses()
                size = np.abs(miss).max(axis=1)
            better = going & (size < least)
            going &= size <= 0.5 * least
            best[better] = middles[better]
            least[better] = size[better]
            if not going.any():
                break
            try:
                middles[going] -= np.linalg.solve(slopes[going, :, :6], miss[going, :, None])[..., 0]
            except np.linalg.LinAlgError:
                break
            pieces = RodPieces(self.points, self.angles, self.lengths, middles.copy())
        return RodPieces(self.points, self.angles, self.lengths, best), least <= _MET

    def snapped(self, piece: int) -> RodPieces:
        """One piece let go, to fall from its present shape to a stable one between its own ends."""
        row = self.parameters[piece]
        pose = np.concatenate(
            [self.points[piece], self.angles[[piece]], self.points[piece + 1], self.angles[[piece + 1]]]
        )
        shape = fallen(Elastica.from_parameters(row), pose).parameters
        middles = self.middles.copy()
        middles[piece, :4], middles[piece, 4:] = states_at(shape, 0.5 * shape[6]), shape[4:6]
        return RodPieces(self.points, self.angles, self.lengths, middles)


@dataclass(frozen=True, eq=False)
class Rest:
    """Where a descent ended.

    Attributes:
        pieces: the rod. gradient: greatest slope of ½∫κ² by a free angle or a length. curvature: the least eigenvalue of the
            second derivatives by what is free, inf if nothing is; above 0, with all pieces stable, the energy is least.
        iterations: steps. snaps: how often a piece lost its hold on the way. status: in words.
    """

    pieces: RodPieces
    gradient: float
    curvature: float
    iterations: int
    snaps: int
    status: str


def freedom(angles_free: BoolArray, rule: str, spare: FloatArray) -> FloatArray:
    """Directions in which angles and lengths may change together, (2n − 1, d).

    A radian of an angle counts as much as all that a length has beyond its chord: as this goes to 0 the energy grows
    without bound, and steps in proportion to it stay clear of that.

    Parameters:
        angles_free: (n,). rule: lengths are "held", their "total" is, or they are "free". spare: (n − 1,), lengths beyond
            the chords.
    """
    n, m = len(angles_free), len(spare)
    turns = np.eye(2 * n - 1)[:, np.flatnonzero(angles_free)]
    if rule == "held" or (rule == "total" and m == 1):
        return turns
    share = np.eye(m) if rule == "free" else np.linalg.qr(spare[:, None], mode="complete")[0][:, 1:]
    slides = np.zeros((n + m, share.shape[1]))
    slides[n:] = spare[:, None] * share
    return np.concatenate([turns, slides], axis=1)


def descend(pieces: RodPieces, angles_free: BoolArray, rule: str, most_snaps: int = _MOST_SNAPS) -> Rest:
    """Lower the energy, in the freedom given (see `freedom`), to a minimum, by Newton's method in a trust region.

    A step is taken only if all pieces are found and stable and the energy falls. Where a stable piece ceases to exist, so
    that no step leads on, it is let go.

    Parameters:
        pieces: of a rod of a length near 1. angles_free, rule: as in `freedom`.
        most_snaps: 0 stops where a piece would lose its hold.
    """
    n = len(pieces.points)
    chords = np.hypot(*np.diff(pieces.points, axis=0).T)
    radius, snaps = _WIDEST, 0
    for iteration in range(_ITERATIONS):
        directions = freedom(angles_free, rule, pieces.lengths - chords)
        gradient, hessian = directions.T @ pieces.gradient, directions.T @ pieces.hessian() @ directions
        if not gradient.size:
            return Rest(pieces, 0.0, np.inf, iteration, snaps, "converged")
        step, curvature = _step(gradient, hessian, radius)
        decrease = -float(gradient @ step + 0.5 * step @ hessian @ step)
        if curvature > 0.0 and decrease <= _STILL * max(pieces.energy, 1e-12) + 1e-30:
            return _polished(pieces, directions, iteration, snaps)
        if pieces.lengths.sum() > _LONGEST * chords.sum():
            return Rest(pieces, _greatest(gradient), curvature, iteration, snaps, "endless")
        change = directions @ step
        angles, lengths = pieces.angles + change[:n], pieces.lengths + change[n:]
        trial, lost = _tried(pieces, angles, lengths)
        gained = -np.inf if trial is None else pieces.energy - trial.energy
        if trial is not None and gained > 0.05 * decrease:
            pieces = trial
            if gained > 0.7 * decrease and np.linalg.norm(step) > 0.8 * radius:
                radius = min(2.0 * radius, _WIDEST)
            continue
        radius = 0.4 * min(radius, float(np.linalg.norm(step)))
        if radius > _NARROWEST:
            continue
        if not lost.size or snaps >= most_snaps:
            status = "a piece would lose its hold" if lost.size else "no descent"
            return Rest(pieces, _greatest(gradient), curvature, iteration, snaps, status)
        try:
            for piece in lost:
                pieces = pieces.snapped(int(piece))
            pieces, found = pieces.corrected()
        except ConvergenceError:
            found = np.zeros(n - 1, dtype=bool)
        if not found.all():
            return Rest(pieces, _greatest(gradient), curvature, iteration, snaps, "a piece was lost")
        radius, snaps = _WIDEST, snaps + 1
    return Rest(pieces, _greatest(directions.T @ pieces.gradient), np.nan, _ITERATIONS, snaps, "iteration limit")


def _tried(pieces: RodPieces, angles: FloatArray, lengths: FloatArray) -> tuple[RodPieces | None, IntArray]:
    """The pieces after a step, or None and those that are lost: not found, or no longer stable."""
    chords = np.hypot(*np.diff(pieces.points, axis=0).T)
    short = lengths <= chords * (1.0 + 1e-9)
    if short.any():
        return None, np.empty(0, dtype=np.int64)
    trial, found = pieces.moved(angles, lengths)
    good = found.copy()
    good[found] = margins(trial.parameters[found]) > 1.0
    return (trial, np.empty(0, dtype=np.int64)) if good.all() else (None, np.flatnonzero(~good))


def _step(gradient: FloatArray, hessian: FloatArray, radius: float) -> tuple[FloatArray, float]:
    """The minimum of the quadratic model within a radius, and the least curvature of the model."""
    values, vectors = np.linalg.eigh(0.5 * (hessian + hessian.T))
    slope = vectors.T @ gradient
    least = float(values[0])
    if least > 0.0:
        step = -slope / values
        if np.linalg.norm(step) <= radius:
            return vectors @ step, least
    # (Λ + μ) p = −slope with |p| = radius; pushed a little along the steepest way down from a saddle
    if least <= 0.0 and abs(slope[0]) < 1e-9 * np.abs(values).max():
        slope[0] = 1e-9 * np.abs(values).max()
    low = max(0.0, -least)
    high = low + float(np.linalg.norm(slope)) / radius + 1e-300
    for _ in range(100):
        middle = 0.5 * (low + high)
        with np.errstate(divide="ignore"):
            wide = np.linalg.norm(slope / (values + middle)) > radius
        low, high = (middle, high) if wide else (low, middle)
    return vectors @ (-slope / (values + high)), least


def _polished(pieces: RodPieces, directions: FloatArray, iteration: int, snaps: int) -> Rest:
    """Newton steps as long as they lower the gradient."""
    n = len(pieces.points)
    for _ in range(6):
        gradient, hessian = directions.T @ pieces.gradient, directions.T @ pieces.hessian() @ directions
        change = directions @ -np.linalg.solve(hessian, gradient)
        trial, found = pieces.moved(pieces.angles + change[:n], pieces.lengths + change[n:])
        if not found.all() or not _greatest(directions.T @ trial.gradient) < _greatest(gradient):
            break
        pieces, iteration = trial, iteration + 1
    gradient, hessian = directions.T @ pieces.gradient, directions.T @ pieces.hessian() @ directions
    least = float(np.linalg.eigvalsh(0.5 * (hessian + hessian.T))[0])
    return Rest(pieces, _greatest(gradient), least, iteration, snaps, "converged")


def _greatest(values: FloatArray) -> float:
    return float(np.abs(values).max(initial=0.0))
