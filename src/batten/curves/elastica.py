"""The elastica as an object, in force form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.special import ellipkm1, elliprf

from batten.errors import InvalidInputError
from batten.kernels import elastica as kernel
from batten.kernels import elastica_jacobian as jacobian_kernel
from batten.typing import ArrayLike, FloatArray

if TYPE_CHECKING:
    from batten.curves.bezier import CubicBezier
    from batten.curves.similarity import Similarity


class ModulusForm(NamedTuple):
    """The papers' seven control parameters (Brander2016 §2.2.2): γ(t) = S R_φ ζ_k(s₀ + ℓt) + (x₀, y₀), t ∈ [0, 1]."""

    k: float
    s0: float
    ell: float
    scale: float
    rotation: float
    origin: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Elastica:
    """A segment of a planar elastic curve, stored in force form.

    The tangent angle solves θ″ = −λ₁ sin θ + λ₂ cos θ (Brander2016 eq. 1) with θ(0) = `start_angle`,
    θ′(0) = `start_curvature`, (λ₁, λ₂) = `force`. Its curvature is affine in position (Brander2016 eq. 5):
    κ(s) = start_curvature + (γ(s) − start) × force with a × b = a_x b_y − a_y b_x. A rod of bending stiffness EI carries
    the force EI·force and the moment EI·κ. Lines (force = 0 or parallel, curvature 0) and circles (force = 0) are members.

    Parameters:
        start: (x, y), shape (2,), any unit of length.
        start_angle: tangent angle at the start, radians, any real number (turns are kept).
        start_curvature: 1/length, positive to the left.
        force: (λ₁, λ₂), shape (2,), 1/length².
        length: arc length, positive.

    Raises:
        InvalidInputError: a value that is not finite, a wrong shape, or a length that is not positive.

    Accuracy:
        Positions, angles and length-scaled curvatures are within 1e-12 × length of the exact curve of the stored numbers
        (typically 1e-15 × length), for every modulus from 0 to ∞, 1 included, as long as |start_angle| < 1e6.

    Example:
        >>> quarter = Elastica(start=(1, 0), start_angle=np.pi / 2, start_curvature=1, force=(0, 0), length=np.pi / 2)
        >>> quarter.point_at(quarter.length).round(15).tolist()
        [0.0, 1.0]
    """

    start: FloatArray
    start_angle: float
    start_curvature: float
    force: FloatArray
    length: float

    def __post_init__(self) -> None:
        try:
            start = np.array(self.start, dtype=np.float64).reshape(2)
            force = np.array(self.force, dtype=np.float64).reshape(2)
            rest = [float(self.start_angle), float(self.start_curvature), float(self.length)]
        except (TypeError, ValueError) as error:
            raise InvalidInputError(
                f"an elastica needs start (2,), start_angle, start_curvature, force (2,), length as numbers; got {self!r}"
            ) from error
        if not (np.isfinite(start).all() and np.isfinite(force).all() and np.isfinite(rest).all()):
            raise InvalidInputError(
                f"an elastica needs finite numbers; got start {start}, start_angle {rest[0]}, start_curvature {rest[1]}, "
                f"force {force}, length {rest[2]}"
            )
        if not rest[2] > 0.0:
            raise InvalidInputError(
                f"an elastica needs a length above 0; got {rest[2]}; use reversed() to turn it round"
            )
        start.setflags(write=False)
        force.setflags(write=False)
        object.__setattr__(self, "start", start)
        object.__setattr__(self, "force", force)
        for name, value in zip(("start_angle", "start_curvature", "length"), rest):
            object.__setattr__(self, name, value)

    # --- the seven numbers ---

    @property
    def parameters(self) -> FloatArray:
        """The stored numbers (x, y, start_angle, start_curvature, λ₁, λ₂, length), shape (7,)."""
        return np.array([*self.start, self.start_angle, self.start_curvature, *self.force, self.length])

    @classmethod
    def from_parameters(cls, parameters: ArrayLike) -> Elastica:
        """The elastica of the seven numbers that `parameters` returns."""
        p = np.asarray(parameters, dtype=np.float64)
        if p.shape != (7,):
            raise InvalidInputError(f"an elastica has seven parameters, shape (7,); got shape {p.shape}")
        return cls(p[:2], float(p[2]), float(p[3]), p[4:6], float(p[6]))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Elastica) and bool(np.array_equal(self.parameters, other.parameters))

    def __hash__(self) -> int:
        return hash(tuple(self.parameters.tolist()))

    # --- evaluation ---

    def _evaluate(self, s: ArrayLike) -> FloatArray:
        arc = np.asarray(s, dtype=np.float64)
        out = np.empty((arc.size, 4))
        s_flat = np.ascontiguousarray(arc.reshape(-1))
        kernel.evaluate(self.start[0], self.start[1], self.start_angle, self._constants(), s_flat, out)
        return out.reshape(*arc.shape, 4)

    def point_at(self, s: ArrayLike) -> FloatArray:
        """Points γ(s) at arc length s of any shape (…); shape (…, 2). Outside [0, length] the same curve goes on."""
        return self._evaluate(s)[..., :2]

    def angle_at(self, s: ArrayLike) -> FloatArray:
        """Tangent angle θ(s) in radians, continuous along the curve (turns are counted); shape of s."""
        return self._evaluate(s)[..., 2]

    def curvature_at(self, s: ArrayLike) -> FloatArray:
        """Curvature κ(s) = θ′(s), positive to the left; shape of s."""
        return self._evaluate(s)[..., 3]

    def jacobian_at(self, s: ArrayLike) -> FloatArray:
        """Derivative of γ(s) with respect to the seven numbers of `parameters` at fixed s; shape (…, 2, 7).

        The column of `length` is zero, since γ(s) does not depend on where the segment ends; for the derivative at a fixed
        fraction of the length put (s/length)·(cos θ, sin θ) there.

        Accuracy: 1e-9 relative to the norm of each column.
        """
        arc = np.asarray(s, dtype=np.float64)
        order = np.argsort(arc, axis=None)
        ascending = np.ascontiguousarray(arc.reshape(-1)[order])
        out, values = np.empty((arc.size, 3, 6)), np.empty((arc.size, 4))
        numbers = (self.start_angle, self.start_curvature, float(self.force[0]), float(self.force[1]))
        constants = self._constants()
        jacobian_kernel.jacobian(self.start[0], self.start[1], *numbers, constants, ascending, values, out)
        near = constants[0] * ascending**2 < 1e-3
        if near.any() and not near.all():
            some = np.empty((int(near.sum()), 3, 6))
            jacobian_kernel.jacobian_taylor(*numbers, np.ascontiguousarray(ascending[near]), some)
            out[near] = some
        full = np.zeros((arc.size, 2, 7))
        full[order, :, :6] = out[:, :2, :]
        return full.reshape(*arc.shape, 2, 7)

    # --- the Curve protocol: t = s/length ---

    def point(self, t: ArrayLike) -> FloatArray:
        """Points at the fraction t of the length; shape (…, 2)."""
        return self.point_at(np.asarray(t, dtype=np.float64) * self.length)

    def derivative(self, t: ArrayLike, order: int = 1) -> FloatArray:
        """Derivative of `point` of order 1, 2 or 3 with respect to t; shape (…, 2)."""
        values = self._evaluate(np.asarray(t, dtype=np.float64) * self.length)
        angle, kappa = values[..., 2], values[..., 3]
        tangent = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        normal = np.stack([-tangent[..., 1], tangent[..., 0]], axis=-1)
        if order == 1:
            return self.length * tangent
        if order == 2:
            return self.length**2 * kappa[..., None] * normal
        if order == 3:
            slope = tangent[..., 0] * self.force[1] - tangent[..., 1] * self.force[0]
            return self.length**3 * (slope[..., None] * normal - (kappa**2)[..., None] * tangent)
        raise InvalidInputError(f"derivatives of order 1, 2 or 3 are offered; got {order}")

    def breaks(self) -> FloatArray:
        """An elastica is smooth: (0, 1)."""
        return np.array([0.0, 1.0])

    # --- measures ---

    def bending_energy(self) -> float:
        """∫κ² ds over the segment (twice the energy of Brander2016 §2.1, which has the factor ½).

        Gauss quadrature on panels shorter than the distance to the nearest singularity of κ: every term is positive, so that
        the small energy of a nearly straight rod keeps its digits, which the closed form 4Mℓ − 2λ(ℓ − X) does not.

        Accuracy: 1e-12 relative, as far as the curvature itself is determined by the stored numbers.
        """
        lam, q, a, *_ = self._constants()
        phase = self.length * np.sqrt(max(lam, q * q + lam * a * a))
        panels = int(min(np.ceil(phase / 1.5) + 1.0, 1e5))
        x, w = np.polynomial.legendre.leggauss(16)
        s = (np.arange(panels)[:, None] + 0.5 * (x + 1.0)) * (self.length / panels)
        return float((self.curvature_at(s) ** 2 @ w).sum() * 0.5 * self.length / panels)

    def _constants(self) -> tuple[float, float, float, float, float, float, float]:
        return kernel.elastica_constants_exact(
            self.start_angle, self.start_curvature, float(self.force[0]), float(self.force[1])
        )

    def inflections(self) -> FloatArray:
        """Arc lengths in [0, length] where the curvature changes sign, ascending; shape (n,).

        Empty for lines, circles, curves of modulus k ≥ 1.
        """
        lam, q, a, c, delta, _, _ = self._constants()
        big_m = q * q + lam * a * a
        if not (delta > 0.0 and big_m > 0.0):
            return np.empty(0)
        root = np.sqrt(lam)
        quarter = ellipk_complement(delta / lam)
        phase = _incomplete_first(a * np.sqrt(lam / big_m), q / np.sqrt(big_m), c, quarter)
        first = np.ceil((-quarter + phase - 1e-9) / (2.0 * quarter) - 1.0)
        last = np.floor((root * self.length + phase + 1e-9 - quarter) / (2.0 * quarter) + 1.0)
        s = ((2.0 * np.arange(first, last + 1.0) + 1.0) * quarter - phase) / root
        for _ in range(3):  # polish on κ itself
            values = self._evaluate(s)
            slope = np.cos(values[:, 2]) * self.force[1] - np.sin(values[:, 2]) * self.force[0]
            s = s - np.divide(values[:, 3], slope, out=np.zeros_like(s), where=slope != 0.0)
        slack = 1e-14 * self.length
        s = s[(s >= -slack) & (s <= self.length + slack)]
        return np.clip(s, 0.0, self.length)

    # --- derived curves ---

    def extended(self, before: float = 0.0, after: float = 0.0) -> Elastica:
        """The same curve, longer by `before` at its start and by `after` at its end (negative: shorter)."""
        if before == 0.0:
            return Elastica(self.start, self.start_angle, self.start_curvature, self.force, self.length + after)
        x, y, angle, kappa = self._evaluate(-float(before))
        return Elastica(np.array([x, y]), angle, kappa, self.force, self.length + before + after)

    def split(self, s: float) -> tuple[Elastica, Elastica]:
        """The two parts before and after arc length s, 0 < s < length."""
        if not 0.0 < s < self.length:
            raise InvalidInputError(f"split at an arc length inside (0, {self.length}); got {s}")
        return self.extended(0.0, s - self.length), self.extended(-s, 0.0)

    def reversed(self) -> Elastica:
        """The same point set run from its end to its start; angles turn by π, curvature and force change sign."""
        x, y, angle, kappa = self._evaluate(self.length)
        return Elastica(np.array([x, y]), angle + np.pi, -kappa, -self.force, self.length)

    def transformed(self, similarity: Similarity) -> Elastica:
        """The image under a similarity (scale > 0, rotation, translation)."""
        scale = similarity.scale
        cos, sin = np.cos(similarity.rotation), np.sin(similarity.rotation)
        turned = np.array([cos * self.force[0] - sin * self.force[1], sin * self.force[0] + cos * self.force[1]])
        return Elastica(
            similarity.apply(self.start),
            self.start_angle + similarity.rotation,
            self.start_curvature / scale,
            turned / scale**2,
            self.length * scale,
        )

    # --- the papers' parameters ---

    @classmethod
    def from_modulus(
        cls,
        k: float,
        s0: float,
        ell: float,
        scale: float = 1.0,
        rotation: float = 0.0,
        origin: ArrayLike = (0.0, 0.0),
    ) -> Elastica:
        """γ(t) = S R_φ ζ_k(s₀ + ℓt) + (x₀, y₀), t ∈ [0, 1] (Brander2016 §2.2.2); stored by arc length |ℓ|S.

        Parameters:
            k: elliptic modulus (not m = k²), 0 ≤ k; above 1 the extended one (Brander2016 App. A).
            s0, ell: start and extent on the basic elastica ζ_k; ell ≠ 0, negative runs it backwards.
            scale: S > 0. rotation: φ in radians. origin: (x₀, y₀).

        Example:
            >>> Elastica.from_modulus(0.5, 0.0, 1.0).start_curvature  # κ = 2k cn(s₀)/S
            1.0
        """
        from batten.curves.similarity import Similarity

        values = np.array([k, s0, ell, scale, rotation, *np.asarray(origin, dtype=np.float64).reshape(2)])
        if not (np.isfinite(values).all() and k >= 0.0 and scale > 0.0 and ell != 0.0):
            raise InvalidInputError(
                f"the modulus form needs finite numbers with k ≥ 0, scale > 0, ell ≠ 0; got k={k}, s0={s0}, ell={ell}, "
                f"scale={scale}, rotation={rotation}, origin={origin!r}"
            )
        basic = cls(np.zeros(2), 0.0, 2.0 * k, np.array([1.0, 0.0]), abs(ell))
        basic = basic.extended(-s0, s0) if ell > 0.0 else basic.extended(-(s0 + ell), s0 + ell).reversed()
        return basic.transformed(Similarity(scale=scale, rotation=rotation, translation=(values[5], values[6])))

    def to_modulus(self) -> ModulusForm:
        """The papers' seven control parameters, inverse of `from_modulus`.

        s₀ lies in (−2K, 2K] with inflections and in (−K, K] of the extended K without; ell is negative for a curve of
        negative curvature without inflections (Brander2016 notes 1–3).

        Degenerate: force = 0 has no finite modulus form; a circle gives k = scale = inf, a line k = 0, scale = inf, both
        with s0 = ell = 0, and `from_modulus` refuses them. A line in exact tension (force along −tangent, curvature 0) is
        the end of ζ₁ at s₀ = ±∞: it is returned as the line ζ₀ in compression, the same curve with the opposite force. At
        k = 1 s₀ ranges over the real line.
        """
        lam, q, a, c, delta, ux, uy = self._constants()
        rotation = float(np.arctan2(uy, ux))
        big_m = q * q + lam * a * a
        if lam == 0.0:
            k = float("inf") if q != 0.0 else 0.0
            return ModulusForm(k, 0.0, 0.0, float("inf"), 0.0, (float(self.start[0]), float(self.start[1])))
        if q == 0.0 and c == 0.0:
            x, y = self.start.tolist()
            return ModulusForm(0.0, 0.0, float(self.length * np.sqrt(lam)), float(lam**-0.5), self.start_angle, (x, y))
        if delta <= 0.0 and q < 0.0:
            back = self.reversed().to_modulus()
            return back._replace(s0=back.s0 + back.ell, ell=-back.ell)
        scale = 1.0 / np.sqrt(lam)
        k = float(np.sqrt(big_m / lam))
        if big_m == 0.0:
            s0 = 0.0
        elif delta >= 0.0:
            s0 = _incomplete_first(a / k, q / np.sqrt(big_m), c, ellipk_complement(delta / lam))
        else:
            s0 = _incomplete_first(a, c, q / np.sqrt(big_m), ellipk_complement(-delta / big_m)) / k
        basic = np.empty((1, 4))
        kernel.evaluate(0.0, 0.0, 0.0, kernel.elastica_constants_exact(0.0, 2.0 * k, 1.0, 0.0), np.array([s0]), basic)
        x, y = basic[0, :2]
        origin = (
            float(self.start[0] - scale * (ux * x - uy * y)),
            float(self.start[1] - scale * (uy * x + ux * y)),
        )
        return ModulusForm(k, float(s0), float(self.length / scale), float(scale), rotation, origin)

    def to_beziers(self, tolerance: float) -> list[CubicBezier]:
        """Cubic Béziers, joined with tangent continuity, as few as `curves.to_beziers.to_beziers` finds within a distance.

        Parameters:
            tolerance: greatest distance allowed, in the curve's unit; at least 1e-13 × length.
        """
        from batten.curves.to_beziers import to_beziers

        return list(to_beziers(self, tolerance).pieces)


def points_batch(parameters: ArrayLike, fractions: ArrayLike) -> FloatArray:
    """Points on many elastica: at `fractions` (m,) of the length of each row of `parameters` (…, 7); shape (…, m, 2).

    A row that is not finite gives NaN. Accuracy as in `Elastica`.
    """
    p = _rows(parameters)
    t = np.ascontiguousarray(np.asarray(fractions, dtype=np.float64).reshape(-1))
    rows = np.ascontiguousarray(p.reshape(-1, 7))
    out = np.empty((rows.shape[0], t.size, 2))
    kernel.points_batch(rows, t, out)
    return out.reshape(*p.shape[:-1], t.size, 2)


def states_at(parameters: ArrayLike, s: ArrayLike) -> FloatArray:
    """(x, y, θ, κ) on many elastica, at one arc length each: `parameters` (…, 7), s (…); shape (…, 4); NaN as above."""
    return states_along(parameters, np.asarray(s, dtype=np.float64)[..., None])[..., 0, :]


def states_along(parameters: ArrayLike, s: ArrayLike) -> FloatArray:
    """(x, y, θ, κ) on many elastica, at m arc lengths each: `parameters` (…, 7), s (…, m); shape (…, m, 4).

    A row that is not finite gives NaN throughout, an arc length that is not finite gives NaN there. Accuracy as in
    `Elastica`.
    """
    p = _rows(parameters)
    arc = np.asarray(s, dtype=np.float64)
    m = arc.shape[-1]
    arcs = np.empty((*p.shape[:-1], m))  # a copy: for arrays that cannot be written to, all would be compiled once more
    arcs[...] = arc
    rows = np.ascontiguousarray(p.reshape(-1, 7))
    out = np.empty((len(rows), m, 4))
    kernel.states_grid(rows, arcs.reshape(-1, m), out)
    return out.reshape(*p.shape[:-1], m, 4)


def _rows(parameters: ArrayLike) -> FloatArray:
    p = np.asarray(parameters, dtype=np.float64)
    if p.shape[-1:] != (7,):
        raise InvalidInputError(f"parameters of elastica have shape (…, 7); got {p.shape}")
    return p


def ellipk_complement(mc: float) -> float:
    """Complete elliptic integral of the first kind K as a function of 1 − k²; inf at 0."""
    return float(ellipkm1(mc)) if mc > 0.0 else float("inf")


def _incomplete_first(sin: float, cos: float, delta: float, quarter: float) -> float:
    """F(φ, k) for sin φ, cos φ given apart and Δ = √(1 − k² sin²φ); φ ∈ (−π, π]; `quarter` is K."""
    value = sin * float(elliprf(cos * cos, delta * delta, 1.0))
    if cos < 0.0:
        value = float(np.copysign(2.0 * quarter, sin)) - value
    return value
