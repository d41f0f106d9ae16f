"""Elastica between two given tangents with free length, or free chord: angle-constrained MEC and SI-MEC (Levien2009).

MEC: the rod slides through both ends. ∫κ² ds is stationary in the length too, so that ½κ² − force · tangent = 0; it is
cut from the rectangular elastica, k = 1/√2 (Levien2009 Result 4). SI-MEC: the ends slide on a rail along the chord, the
length is held; that is L∫κ² ds (3.25), and the force is perpendicular to the chord.

One unknown is left in each of a few families of curves (`angle_charts`). A scan finds all roots, also two that nearly touch;
Newton's method on the stored numbers polishes them. Where the whole curve lies within 0.002 rad of the chord, the cubic is
a start that Newton's method brings home.

Angles to the chord are (α₀, α₁) here; Levien's are θleft = α₀, θright = −α₁. turn = α₁ − α₀ = −(θleft + θright), and
lean = (α₀ + α₁)/2 = (θleft − θright)/2. A mirror image changes the signs of both, reversal that of the lean alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from batten.curves.elastica import Elastica
from batten.errors import ConvergenceError, InvalidInputError, NoSolutionError
from batten.kernels import elastica_jacobian as jacobian_kernel
from batten.solvers.angle_charts import (
    FLAT,
    SCAN,
    Rectangular,
    Start,
    Turning,
    Upright,
    charts_of,
    highest,
    near_the_chord,
    rectangular_reach,
    reduced,
    roots,
)
from batten.typing import ArrayLike, FloatArray

_SAME = 1e-7  # of curvature, force and length, in chords: solutions closer than this are one
_EIGHT = 0.9089085575485414  # modulus of the figure-eight, 2E = K


@dataclass(frozen=True)
class SlidingSolution:
    """One elastica between two given tangents with free length (MEC) or free chord (SI-MEC).

    Its ends slide, so it is judged by another second variation than a `BoundarySolution`, whose ends are held.

    Attributes:
        elastica: the curve.
        energy: what is stationary: ∫κ² ds in 1/length (MEC), or L∫κ² ds, scale-free (SI-MEC).
        inflections: how often the curvature changes sign strictly between the ends.
        rotation_number: (θ(L) − θ(0)) / 2π.
        principal: whether it is the one of least energy with at most one inflection (Levien2009 §3.7).
        stable: whether `energy` is a strict minimum among neighbours with the same ends and tangents.
        least_eigenvalue: least value of L²·(second variation)/∫v² ds, scale-free; stable means above 1e-8. It is 0 on the
            envelope, where two solutions merge.
        residual: greatest miss of the end point (in lengths), the end angle (radians) and the natural condition
            (½κ² − force · tangent, or the force along the chord, times L²), as stored.
    """

    elastica: Elastica
    energy: float
    inflections: int
    rotation_number: float
    principal: bool
    stable: bool
    least_eigenvalue: float
    residual: float


def levien_ends(left: float, right: float) -> tuple[tuple[float, float], float, tuple[float, float], float]:
    """(start, start_angle, end, end_angle) of Levien's angles: the chord is (0, 0)–(1, 0), the angles are left and −right.

    Definition: Levien2009 Fig. 3.13. left = right is an arch, left = −right an S.

    Parameters:
        left, right: θleft and θright, radians, real numbers; the curve turns by −(left + right).

    Example:
        >>> quarter = scale_invariant_curves(*levien_ends(np.pi / 4, np.pi / 4))[0]
        >>> print(f"{quarter.elastica.length:.6f} {quarter.energy / (np.pi / 2) ** 2:.6f}")
        1.110721 1.000000
    """
    return (0.0, 0.0), float(left), (1.0, 0.0), -float(right)


def minimum_energy_curves(
    start: ArrayLike, start_angle: float, end: ArrayLike, end_angle: float, *, max_inflections: int = 1
) -> list[SlidingSolution]:
    """All curves of stationary bending energy, of any length, between two tangents: angle-constrained MEC.

    Definition: stationary curves of ∫κ² ds with free length (Levien2009 §3.9, Result 4): the rod slides through both ends.
    Longer curves far around have less energy than any of them: minima are local.

    Parameters:
        start, end: points (2,), any unit of length, not the same.
        start_angle, end_angle: tangent angles in radians; their difference is the turn that the curve makes, real, at most π
            in size.
        max_inflections: only curves with at most so many inflections between the ends.

    Returns:
        The solutions sorted by ∫κ² ds, never an empty list.

    Raises:
        InvalidInputError: a value that is not finite, a wrong shape, start = end, max_inflections below 0.
        NoSolutionError: outside the envelope, see `minimum_energy_envelope`; the message says how far.
        ConvergenceError: a solution was found and could not be computed to 1e-9.

    Accuracy:
        `residual` is below 1e-11 for max_inflections up to 6. Two solutions about to merge are told apart down to 1e-7 in
        curvature, force and length (in chords).

    Degenerate cases:
        Tangents along the chord: the straight line, with force 0. turn = ±π: the half wave of the rectangular elastica with
        ends at its inflections, for symmetric angles only.

    Example:
        >>> arch = minimum_energy_curves((0, 0), 1.5, (1, 0), -1.5)[0]
        >>> print(f"{arch.elastica.length:.6f} {arch.energy:.6f} {arch.inflections} {arch.stable}")
        1.762727 5.622441 0 True
        >>> minimum_energy_curves((0, 0), 1.6, (1, 0), -1.6)
        Traceback (most recent call last):
        batten.errors.NoSolutionError: no curve with at most 1 inflection: the tangents turn by 3.2 rad, 0.0584 rad more ...
    """
    problem = _problem(start, start_angle, end, end_angle, max_inflections)
    turn, lean = problem.standard()
    found = near_the_chord(turn, lean, rail=False)
    if turn <= np.pi + 1e-12:
        for count, cell in charts_of(turn, max_inflections):
            chart = Rectangular(min(turn, np.pi), count, cell)
            found += [s for x in roots(chart.lean, chart.grid(), lean) if (s := chart.start(x)) is not None]
    solutions = _finish(problem, found, max_inflections, rail=False)
    if not solutions:
        _complain(problem, rectangular_reach(turn, max_inflections) if turn <= np.pi else -1.0, np.pi, max_inflections)
    return solutions


def scale_invariant_curves(
    start: ArrayLike, start_angle: float, end: ArrayLike, end_angle: float, *, max_inflections: int = 1
) -> list[SlidingSolution]:
    """All curves of stationary L∫κ² ds between two tangents: angle-constrained SI-MEC.

    Definition: Levien2009 (3.25), §3.11; a rod of given length whose ends slide on a rail along the chord with held angles.
    The force is perpendicular to the chord, the curvature linear along it.

    Parameters:
        start, end: points (2,), any unit of length, not the same.
        start_angle, end_angle: tangent angles in radians; their difference is the turn that the curve makes, a real number.
        max_inflections: only curves with at most so many inflections between the ends.

    Returns:
        The solutions sorted by L∫κ² ds, never an empty list.

    Raises:
        InvalidInputError: a value that is not finite, a wrong shape, start = end, max_inflections below 0.
        NoSolutionError: none within the limits; where `scale_invariant_envelope` knows, the message says how far outside.
        ConvergenceError: a solution was found and could not be computed to 1e-9.

    Accuracy:
        As for `minimum_energy_curves`, for √λ·L up to about 30: beyond, the end hangs on the start like exp(√λ·L).

    Degenerate cases:
        Tangents along the chord: the straight line. Symmetric angles: the circle, force 0, L∫κ² = turn². Curves whose chord
        is below 1e-9 lengths are left out.

    Example:
        >>> s_shape = scale_invariant_curves(*levien_ends(np.pi / 2, -np.pi / 2))[0]  # cut from the figure-eight
        >>> print(f"{s_shape.energy:.4f} {2 * s_shape.energy:.4f} {s_shape.inflections} {s_shape.stable}")
        28.1099 56.2198 1 True
    """
    problem = _problem(start, start_angle, end, end_angle, max_inflections)
    turn, lean = problem.standard()
    found = near_the_chord(turn, lean, rail=True)
    charts: list[Upright | Turning] = []
    for up in (-1, 1):
        psi0 = reduced(lean - 0.5 * turn - up * 0.5 * np.pi)
        if max(abs(psi0), abs(psi0 + turn)) < np.pi - 1e-12:
            charts += [Upright(psi0, turn, up, count, cell) for count, cell in charts_of(turn, max_inflections)]
    if turn >= FLAT:
        charts.append(Turning(lean - 0.5 * turn + 0.5 * np.pi, turn))
    for chart in charts:
        found += [s for x in roots(chart.along, SCAN) if (s := chart.start(x)) is not None]
    solutions = _finish(problem, found, max_inflections, rail=True)
    if not solutions:
        reach = scale_invariant_envelope(turn) if turn <= 2 * np.pi and max_inflections > 0 else np.nan
        _complain(problem, reach, np.inf, max_inflections)
    return solutions


def minimum_energy_envelope(turn: float) -> float:
    """How far the tangents may lean for an angle-constrained MEC to exist, for a given turn: Levien2009 Fig. 3.13.

    Definition: the greatest |θleft − θright|/2 for θleft + θright = ±turn. On it two curves with one inflection merge; with
    X = ∫cos ψ ds, Y = ∫sin ψ ds it is the maximum of arctan(Y/X) − ½(ψ₀ + ψ₁) over the curves of that turn. For turn = 0
    (antisymmetric) that is 1.7377981344 (99.57°), at the ψ where X² + X √(2/cos ψ) sin ψ + 4 cos ψ = 0; X is an incomplete
    elliptic integral of ψ, so there is no closed form.

    Parameters:
        turn: radians; the sign does not matter.

    Returns:
        Radians; 0 for π (there the curve is symmetric), −1 beyond, where there is no curve at all.

    Raises:
        InvalidInputError: turn is not finite.

    Accuracy: 1e-12.

    Example:
        >>> print(f"{minimum_energy_envelope(0.0):.10f} {minimum_energy_envelope(np.pi):.10f}")
        1.7377981344 0.0000000000
    """
    size = _size(turn)
    return rectangular_reach(size, 1) if size <= np.pi else -1.0


def mec_exists(left: float, right: float) -> bool:
    """Whether an angle-constrained MEC exists for Levien's angles; the envelope itself belongs to the domain.

    Definition: Levien2009 §3.9; |left − right|/2 is at most `minimum_energy_envelope(left + right)`. More than one
    inflection does not lead farther.

    Parameters:
        left, right: θleft and θright in radians, as they are: those of an MEC lie in (−π, π).

    Raises:
        InvalidInputError: an angle that is not finite.

    Accuracy: as the envelope, 1e-12.

    Example:
        >>> mec_exists(1.57, 1.57), mec_exists(1.58, 1.58), mec_exists(1.73, -1.73), mec_exists(1.74, -1.74)
        (True, False, True, False)
    """
    return abs(float(left) - float(right)) <= 2.0 * minimum_energy_envelope(float(left) + float(right)) + 1e-12


def scale_invariant_envelope(turn: float) -> float:
    """How far the tangents may lean for an angle-constrained SI-MEC with at most one inflection: Levien2009 §3.11.

    Definition: the greatest |θleft − θright|/2 for θleft + θright = ±turn, following the family from the straight line on,
    with angles that go on counting beyond π. Up to turn = 4 arcsin k₀ = 4.5626 (k₀ the figure-eight's modulus) two solutions
    merge there; beyond, it is π/2 and the chord vanishes (a closed drop, at 2π the circle). For turn = 0 it is 3.8859, not
    far beyond the figure-eight at π/2 + 2 arcsin k₀ = 3.8521.

    Parameters:
        turn: radians, at most 2π; the sign does not matter.

    Returns:
        Radians.

    Raises:
        InvalidInputError: turn is not finite, or beyond 2π.

    Accuracy: 1e-9.

    Example:
        >>> print(f"{scale_invariant_envelope(0.0):.6f} {scale_invariant_envelope(5.0):.6f}")
        3.885948 1.570796
    """
    size = _size(turn)
    if size > 2 * np.pi + 1e-12:
        raise InvalidInputError(f"the envelope of the SI-MEC is known for turns up to 2π; got {turn}")
    if size >= 4.0 * np.arcsin(_EIGHT):
        return float(0.5 * np.pi)

    def room(lean: float) -> float:
        """Positive if the two solutions of that lean have not merged yet."""
        return highest(Upright(lean - 0.5 * size - 0.5 * np.pi, size, 1, 1, 1).along, SCAN[200:600])[1]

    low, high = 0.5 * np.pi, 1.5 * np.pi - 0.5 * size - 1e-9  # both ends within (−π, π)
    for _ in range(48):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if room(middle) > 0.0 else (low, middle)
    return low


# --- the problem ---


class _Problem(NamedTuple):
    """Start, chord (length and direction), angles to the chord: the first as given, and how far the second is from it."""

    start: FloatArray
    start_angle: float
    chord: float
    direction: float
    turn: float

    def standard(self) -> tuple[float, float]:
        """(|turn|, lean) of the problem or of its mirror image; the lean in (−π, π]."""
        lean = reduced(self.start_angle - self.direction + 0.5 * self.turn)
        return abs(self.turn), -lean if self.turn < 0.0 else lean


def _size(turn: float) -> float:
    if not np.isfinite(turn):
        raise InvalidInputError(f"a turn is a finite number; got {turn!r}")
    return abs(float(turn))


def _problem(start: ArrayLike, start_angle: float, end: ArrayLike, end_angle: float, most: int) -> _Problem:
    try:
        p, q = np.array(start, dtype=np.float64), np.array(end, dtype=np.float64)
        first, last = float(start_angle), float(end_angle)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"ends and angles are numbers; {error}") from error
    if p.shape != (2,) or q.shape != (2,):
        raise InvalidInputError(f"start and end are points, shape (2,); got shapes {p.shape} and {q.shape}")
    if not (np.isfinite(p).all() and np.isfinite(q).all() and np.isfinite([first, last]).all()):
        raise InvalidInputError(f"ends and angles must be finite; got {p}, {start_angle}, {q}, {end_angle}")
    if not most >= 0:
        raise InvalidInputError(f"max_inflections = {most!r}; allowed are whole numbers from 0 on")
    dx, dy = q - p
    if dx == 0.0 and dy == 0.0:
        raise InvalidInputError(f"start and end are both {p}; with free length their distance sets the scale: move one")
    return _Problem(p, first, float(np.hypot(dx, dy)), float(np.arctan2(dy, dx)), last - first)


# --- from a root to a solution ---


def _finish(problem: _Problem, starts: list[Start], most: int, *, rail: bool) -> list[SlidingSolution]:
    """The different solutions, polished, in the problem's own frame, sorted by energy."""
    turn, lean = problem.standard()
    mirror = -1.0 if problem.turn < 0.0 else 1.0
    angle = mirror * (lean - 0.5 * turn)
    seen: list[FloatArray] = []
    solutions = []
    for s in starts:
        size = s.lam * s.chord**2
        z = np.array([s.kappa * s.chord, size * np.cos(s.along), -size * np.sin(s.along), s.length / s.chord])
        z[[0, 2]] *= mirror
        z, miss = _polished(z, angle, problem.turn, rail)
        if miss > 1e-9:
            raise ConvergenceError(
                f"a solution of length {z[3]:.3g} chords was found, but in double precision its end is missed by "
                f"{miss:.2g}: it makes tight loops; allow fewer inflections",
                residual=miss,
            )
        unit = np.array([1.0 / z[3], 1.0 / z[3] ** 2, 1.0 / z[3] ** 2, z[3]])
        if any((np.abs(z - other) < _SAME * np.maximum(np.abs(z), unit)).all() for other in seen):
            continue
        seen.append(z)
        cos, sin = np.cos(problem.direction), np.sin(problem.direction)
        force = np.array([cos * z[1] - sin * z[2], sin * z[1] + cos * z[2]]) / problem.chord**2
        curve = Elastica(problem.start, problem.start_angle, z[0] / problem.chord, force, z[3] * problem.chord)
        solutions.append(_solution(problem, curve, miss, rail))
    solutions = sorted((s for s in solutions if s.inflections <= most), key=lambda s: s.energy)
    first = next((i for i, s in enumerate(solutions) if s.inflections <= 1), -1)
    return [replace(s, principal=i == first) for i, s in enumerate(solutions)]


def _polished(z: FloatArray, angle: float, turn: float, rail: bool) -> tuple[FloatArray, float]:
    """Newton's method for (κ₀, λ₁, λ₂, L) of a curve from (0, 0) to (1, 0), and what it misses, see `SlidingSolution`."""
    ones, values, out = np.ones(1), np.empty((1, 1, 4)), np.zeros((1, 1, 3, 7))
    cos, sin = np.cos(angle), np.sin(angle)
    best, least = z, np.inf
    for _ in range(8):
        jacobian_kernel.jacobian_batch(np.array([[0.0, 0.0, angle, *z]]), ones, values, out)
        natural = z[1] if rail else 0.5 * z[0] ** 2 - z[1] * cos - z[2] * sin
        miss = np.array([values[0, 0, 0] - 1.0, values[0, 0, 1], values[0, 0, 2] - angle - turn, natural])
        size = float(np.max(np.abs(miss) * [1.0 / z[3], 1.0 / z[3], 1.0, z[3] ** 2]))
        if not size < 0.5 * least:
            break
        best, least = z, size
        rows = np.vstack([out[0, 0][:, 3:], [0.0, 1.0, 0.0, 0.0] if rail else [z[0], -cos, -sin, 0.0]])
        units = np.array([1.0 / z[3], 1.0 / z[3] ** 2, 1.0 / z[3] ** 2, z[3]])
        weights = np.array([1.0 / z[3], 1.0 / z[3], 1.0, z[3] ** 2])
        z = z - units * np.linalg.lstsq(weights[:, None] * rows * units, weights * miss, rcond=1e-15)[0]
        if not z[3] > 0.0:
            break
    return best, least


def _solution(problem: _Problem, curve: Elastica, miss: float, rail: bool) -> SlidingSolution:
    x, y, angle, _ = curve._evaluate(curve.length)
    to = problem.start + problem.chord * np.array([np.cos(problem.direction), np.sin(problem.direction)])
    gap = float(np.hypot(x - to[0], y - to[1]))
    residual = max(miss, gap / curve.length, abs(float(angle) - problem.start_angle - problem.turn))
    energy = curve.bending_energy() * (curve.length if rail else 1.0)
    at = curve.inflections()
    inflections = int(np.count_nonzero((at > 1e-9 * curve.length) & (at < (1.0 - 1e-9) * curve.length)))
    least = _least_eigenvalue(curve, problem.direction, rail)
    turned = (float(angle) - problem.start_angle) / (2 * np.pi)
    return SlidingSolution(curve, energy, inflections, turned, False, least > 1e-8, least, residual)


@lru_cache(maxsize=32)
def _held_polynomials(order: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Orthonormal polynomials on [0, 1] that vanish at both ends, at Gauss nodes: nodes, weights, values, ∫φ′φ′."""
    x, w = np.polynomial.legendre.leggauss(order + order // 2)
    n = np.arange(order)
    norm = np.sqrt(2.0 * n + 1.0)
    free = np.linalg.qr(np.array([norm, norm * (-1.0) ** n]).T, mode="complete")[0][:, 2:]
    slopes = np.array([np.polynomial.legendre.legval(x, np.polynomial.legendre.legder(row)) for row in np.eye(order)]).T
    slopes = 2.0 * (slopes * norm) @ free
    values = (np.polynomial.legendre.legvander(x, order - 1) * norm) @ free
    return 0.5 * (x + 1.0), 0.5 * w, values, slopes.T @ (0.5 * w[:, None] * slopes)


def _least_eigenvalue(curve: Elastica, direction: float, rail: bool) -> float:
    """Least value of L²I(v)/∫v² over v = δθ, 0 at both ends, that move the end along the chord at most.

    I(v) = ∫(v′² − force · tangent v²) ds for the SI-MEC. The MEC's length takes back what v moves the end along the chord c:
    δL = −(L/|c|) ∫n_c v ds, and with the natural condition I loses (δL)² ∫κ² ds/L².
    """
    length = curve.length
    force = np.hypot(*curve.force)
    most = max(force, 0.25 * float(np.max(curve.curvature_at(np.linspace(0.0, length, 33)) ** 2)))
    nodes, weights, values, stiffness = _held_polynomials(min(24 + 16 * int(0.25 * length * np.sqrt(most)), 408))
    angle = curve.angle_at(nodes * length)
    tangent = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    weighted = values.T * weights
    matrix = stiffness - length**2 * (weighted * (tangent @ curve.force)) @ values
    across, along = weighted @ np.cos(angle - direction), -(weighted @ np.sin(angle - direction))
    if not rail:
        matrix -= length * curve.bending_energy() * np.outer(along, along) / (weights @ np.cos(angle - direction)) ** 2
    free = np.linalg.qr(across[:, None], mode="complete")[0][:, 1:]
    return float(np.linalg.eigvalsh(free.T @ matrix @ free)[0])


def _complain(problem: _Problem, reach: float, most_turn: float, most: int) -> None:
    turn, lean = problem.standard()
    said = f"no curve with at most {most} inflection{'s' * (most != 1)}: "
    if turn > most_turn:
        raise NoSolutionError(
            f"{said}the tangents turn by {turn:.6g} rad, {turn - most_turn:.3g} rad more than the {most_turn:.6g} that are "
            "possible; take end angles that differ less"
        )
    if abs(lean) > reach:
        raise NoSolutionError(
            f"{said}the tangents lean by {abs(lean):.6g} rad to the chord on average, {abs(lean) - reach:.3g} rad more than "
            f"the {reach:.6g} that are possible for a turn of {turn:.6g} rad; turn them towards the chord"
        )
    raise NoSolutionError(
        f"{said}none turns by {turn:.6g} rad and leans by {abs(lean):.6g} rad to the chord on average; allow more with "
        "max_inflections"
    )
