"""Angle-constrained MEC and SI-MEC against the solver for held ends, closed forms, quadrature, a search by other code."""

from __future__ import annotations

from itertools import pairwise

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk, gamma

from batten.errors import InvalidInputError, NoSolutionError
from batten.solvers.angle_charts import SCAN, Rectangular, roots
from batten.solvers.angle_constrained import (
    levien_ends,
    mec_exists,
    minimum_energy_curves,
    minimum_energy_envelope,
    scale_invariant_curves,
    scale_invariant_envelope,
)
from batten.solvers.boundary_value import solve_boundary

LEMNISCATE = gamma(0.25) ** 2 / (2 * np.sqrt(2 * np.pi))  # ϖ = 2.62205755
FIGURE_EIGHT = brentq(lambda k: 2 * ellipe(k * k) - ellipk(k * k), 0.8, 0.99, xtol=1e-15)
BOTH = pytest.mark.parametrize("curves", [minimum_energy_curves, scale_invariant_curves])


def random_problems(seed, n, angle=1.5):
    """Ends and tangents (p, θ₀, q, θ₁) whose angles to the chord are up to `angle`, large and small ones."""
    rng = np.random.default_rng(seed)
    for _ in range(n):
        p, q = rng.uniform(-5, 5, (2, 2))
        first, last = rng.uniform(-angle, angle, 2) * 10 ** rng.uniform(-2, 0)
        along = np.arctan2(*(q - p)[::-1]) + 2 * np.pi * rng.integers(-1, 2)
        yield p, along + first, q, along + last


def natural(curve, direction, rail):
    """½κ² − force · tangent at the start, or the force along the chord; times L²."""
    tangent = np.array([np.cos(curve.start_angle), np.sin(curve.start_angle)])
    hamiltonian = 0.5 * curve.start_curvature**2 - curve.force @ tangent
    return (curve.force @ direction if rail else hamiltonian) * curve.length**2


@BOTH
def test_solutions_meet_their_ends_and_the_natural_condition(curves):
    for p, first, q, last in random_problems(1, 25):
        try:
            found = curves(p, first, q, last, max_inflections=3)
        except NoSolutionError:
            assert curves is minimum_energy_curves
            assert abs(last - first) > 1.0
            continue
        direction = (q - p) / np.linalg.norm(q - p)
        for s in found:
            curve = s.elastica
            assert s.residual < 1e-11
            angles = curve.angle_at
            stops = np.linspace(0.0, curve.length, 9)
            end = p + [
                sum(quad(f, a, b, epsabs=1e-13, epsrel=1e-12)[0] for a, b in pairwise(stops))
                for f in (lambda t, a=angles: np.cos(a(t)), lambda t, a=angles: np.sin(a(t)))
            ]
            assert np.linalg.norm(end - q) < 1e-11 * curve.length
            assert curve.start_angle == first
            assert float(angles(curve.length)) == pytest.approx(last, abs=1e-11)
            assert abs(natural(curve, direction, curves is scale_invariant_curves)) < 1e-11
            size = curve.length if curves is scale_invariant_curves else 1.0
            assert s.energy == pytest.approx(curve.bending_energy() * size, rel=1e-12)
            kappa = curve.curvature_at(np.linspace(0.0, curve.length, 4001)[1:-1])
            assert s.inflections == np.count_nonzero(np.diff(np.sign(kappa)) != 0) <= 3
        energies = [s.energy for s in found]
        assert energies == sorted(energies)
        assert [s.principal for s in found].count(True) == int(any(s.inflections < 2 for s in found))


@BOTH
def test_similar_mirrored_and_reversed_problems_have_similar_solutions(curves):
    power = 1.0 if curves is minimum_energy_curves else 0.0
    for p, first, q, last in random_problems(2, 12, 1.2):

        def numbers(found, factor=1.0):
            return np.array(
                [(s.energy * factor, s.elastica.length * factor**-power, s.least_eigenvalue) for s in found]
            )

        one = numbers(curves(p, first, q, last))
        turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
        moved = curves(3.0 * turn @ p + 1.0, first + 0.7, 3.0 * turn @ q + 1.0, last + 0.7)
        one_again = numbers(moved)
        one_again[:, 0] *= 3.0**power
        one_again[:, 1] /= 3.0
        for other in (
            one_again,
            numbers(curves(p * [1, -1], -first, q * [1, -1], -last)),
            numbers(curves(q, last + np.pi, p, first + np.pi)),
        ):
            assert other == pytest.approx(one, rel=1e-9, abs=1e-9)


def held_near(ends, length, curve):
    """Of the curves with held ends and this length, the one next to another curve."""
    held = solve_boundary(*ends, length, max_inflections=2)
    return min(held, key=lambda h: np.linalg.norm((h.elastica.parameters - curve.parameters)[3:6]))


def by_five(values, step):
    """First and second derivative in the middle of five values."""
    a, b, c, d, e = values
    return (a - 8 * b + 8 * d - e) / (12 * step), (16 * b - 30 * c + 16 * d - a - e) / (12 * step**2)


def test_the_length_of_a_mec_is_stationary():
    """By held ends: d∫κ²/dL = −2(½κ² − force · tangent); 0 at the MEC, and the energy a minimum there if stable."""
    rng = np.random.default_rng(3)
    for _ in range(12):
        ends = levien_ends(*rng.uniform(-1.1, 1.1, 2))
        for s in minimum_energy_curves(*ends):
            step = 1e-2 * (s.elastica.length - 1.0)  # of the length in excess
            for length in (s.elastica.length, s.elastica.length + 3 * step):
                near = [held_near(ends, length + i * step, s.elastica) for i in range(-2, 3)]
                slope, bend = by_five([h.energy for h in near], step)
                expected = -2.0 * natural(near[2].elastica, None, False) / length**2
                assert slope == pytest.approx(expected, abs=1e-2 * step * abs(bend))
                if length == s.elastica.length:
                    assert near[2].energy == pytest.approx(s.energy, rel=1e-10)
                    assert abs(slope) < 1e-2 * step * abs(bend)
                    assert (bend > 0.0) == s.stable


def test_the_chord_of_an_si_mec_is_stationary():
    rng = np.random.default_rng(4)
    for _ in range(10):
        left, right = rng.uniform(-1.5, 1.5, 2)
        for s in scale_invariant_curves(*levien_ends(left, right)):
            length = s.elastica.length
            ends = [((0, 0), left, (1.0 + i * 1e-3, 0), -right) for i in range(-2, 3)]
            near = [held_near(e, length, s.elastica) for e in ends]
            slope, bend = by_five([h.energy * length for h in near], 1e-3)
            assert near[2].energy * length == pytest.approx(s.energy, rel=1e-10)
            assert abs(slope) < 1e-4 * abs(bend)
            assert s.stable
            assert bend > 0.0


def test_the_sign_of_the_second_variation_is_that_of_the_energy_by_length():
    """Where two solutions are, the shorter is the minimum of ∫κ² by the length, the longer the maximum."""
    ends = levien_ends(1.7, -1.7)
    short, long = minimum_energy_curves(*ends)
    assert short.stable
    assert not long.stable
    for s, sign in ((short, 1.0), (long, -1.0)):
        held = [
            min(h.energy for h in solve_boundary(*ends, s.elastica.length * f, max_inflections=1))
            for f in (0.99, 1.0, 1.01)
        ]
        assert sign * (held[0] - 2 * held[1] + held[2]) > 0.0
        assert s.energy == pytest.approx(held[1], rel=1e-9)


def test_least_eigenvalues_in_closed_form():
    """A straight line and a circle: v = sin 2πt, 4π²."""
    for found in (
        minimum_energy_curves(*levien_ends(0.0, 0.0)),
        scale_invariant_curves(*levien_ends(0.0, 0.0)),
        scale_invariant_curves(*levien_ends(1.1, 1.1)),
    ):
        assert found[0].least_eigenvalue == pytest.approx(4 * np.pi**2, rel=1e-12)


@pytest.mark.parametrize("angle", [1e-9, 1e-3, 0.5, np.pi / 2, 2.5, 3.1, -0.7, -3.0])
def test_symmetric_si_mec_is_the_circle(angle):
    first = scale_invariant_curves(*levien_ends(angle, angle))[0]
    assert first.energy == pytest.approx((2 * angle) ** 2, rel=1e-12)
    assert first.elastica.length == pytest.approx(angle / np.sin(angle), rel=1e-12)
    assert np.linalg.norm(first.elastica.force) * first.elastica.length**2 < 1e-12
    assert first.principal
    assert first.stable


def test_a_circle_that_goes_round_once_more():
    first = scale_invariant_curves((0, 0), 0.5, (1, 0), -0.5 - 2 * np.pi)[0]
    assert first.energy == pytest.approx((1.0 + 2 * np.pi) ** 2, rel=1e-12)
    assert first.rotation_number == pytest.approx(-1.0 - 1.0 / (2 * np.pi), abs=1e-12)


def test_small_angles_are_cubics():
    """Curvature linear in arc length: L∫κ² = 4(α₀² + α₀α₁ + α₁²)."""
    for size in (1e-2, 1e-5, 1e-9):
        for curves in (minimum_energy_curves, scale_invariant_curves):
            first = curves((0, 0), 0.9 * size, (1, 0), 0.3 * size)[0]
            assert first.energy == pytest.approx(4 * size**2 * (0.81 + 0.27 + 0.09), rel=size**2)


def test_tangents_along_the_chord_give_the_straight_line():
    for curves in (minimum_energy_curves, scale_invariant_curves):
        line = curves((1, 1), np.pi / 4, (3, 3), np.pi / 4)[0]
        assert line.energy < 1e-28
        assert line.elastica.length == pytest.approx(np.sqrt(8), rel=1e-15)
        assert line.inflections == 0


def test_half_wave_of_the_rectangular_elastica():
    """The symmetric end of the domain, in the lemniscate constant ϖ: L = ϖ²/π, ∫κ² = 4π²/ϖ² for the chord 1."""
    arch = minimum_energy_curves(*levien_ends(np.pi / 2, np.pi / 2))[0]
    assert arch.elastica.length == pytest.approx(LEMNISCATE**2 / np.pi, rel=1e-12)
    assert arch.energy == pytest.approx(4 * np.pi**2 / LEMNISCATE**2, rel=1e-12)
    assert arch.elastica.start_curvature == pytest.approx(0.0, abs=1e-12)
    assert abs(arch.least_eigenvalue) < 1e-9  # the end of the family: neither minimum nor maximum
    assert not arch.stable
    k = minimum_energy_curves(*levien_ends(0.8, 0.1))[0].elastica.to_modulus().k
    assert k == pytest.approx(np.sqrt(0.5), rel=1e-12)


def test_half_wave_is_no_minimum():
    """By held ends: ∫κ² falls through its stationary value, shorter or longer; Levien2009 §3.11 has a minimum there."""
    arch = minimum_energy_curves(*levien_ends(np.pi / 2, np.pi / 2))[0]
    lengths = arch.elastica.length * np.array([0.9, 0.97, 1.0 - 1e-8, 1.03, 1.1])
    held = [solve_boundary(*levien_ends(np.pi / 2, np.pi / 2), l)[0].energy for l in lengths]
    assert held[2] == pytest.approx(arch.energy, rel=1e-9)
    assert (np.diff(held) < 0.0).all()


# the figure-eight


def test_si_mecs_cut_from_the_figure_eight():
    """(π/2, −π/2): from crest to crest, half the figure: a quarter of L∫κ² = 112.4396; (π/2, 0.71) from crest to node."""
    k, quarter = FIGURE_EIGHT, ellipk(FIGURE_EIGHT**2)
    whole = 4 * quarter * 4 * (4 * ellipe(k * k) - 4 * (1 - k * k) * quarter)
    assert whole == pytest.approx(112.4396, abs=5e-5)
    half = scale_invariant_curves(*levien_ends(np.pi / 2, -np.pi / 2))[0]
    assert half.energy == pytest.approx(whole / 4, rel=1e-12)
    assert half.elastica.to_modulus().k == pytest.approx(k, rel=1e-12)
    lean = 2 * np.arcsin(k) - np.pi / 2
    assert lean == pytest.approx(0.7105, abs=5e-5)
    # crest to node: a quarter of the whole figure, so a sixteenth of the energy
    node = scale_invariant_curves(*levien_ends(np.pi / 2, lean))[0]
    assert node.energy == pytest.approx(whole / 16, rel=1e-12)
    assert abs(float(node.elastica.curvature_at(node.elastica.length))) < 1e-11


def test_antisymmetric_si_mecs_end_at_the_figure_eight():
    """It closes at π/2 + 2 arcsin k₀ = 3.8521; the family folds a little farther out, at 3.8859. (Levien2009: 5.57.)"""
    closes = np.pi / 2 + 2 * np.arcsin(FIGURE_EIGHT)
    assert closes == pytest.approx(3.8521, abs=5e-5)
    for off in (1e-2, 1e-3, 1e-4):
        last = scale_invariant_curves(*levien_ends(closes + off, -closes - off))[-1]
        assert last.inflections == 1
        assert 1.0 / last.elastica.length < off
        assert last.energy == pytest.approx(112.43961, abs=off)
        assert not last.stable
    assert 2 * np.pi - (2 * np.arcsin(FIGURE_EIGHT) - np.pi / 2) == pytest.approx(5.57, abs=5e-3)  # as printed


# where they exist


def test_antisymmetric_end_of_the_mec_with_more_digits():
    """Levien2009 prints 2.22, which no MEC reaches."""
    with mpmath.workdps(30):

        def span(psi):
            return 2 * mpmath.quad(lambda t: mpmath.sqrt(2 * mpmath.cos(t)) / 2, [psi, 0, mpmath.pi / 2])

        psi = mpmath.findroot(
            lambda p: span(p) ** 2 + span(p) * mpmath.sqrt(2 / mpmath.cos(p)) * mpmath.sin(p) + 4 * mpmath.cos(p), -1.41
        )
        end = float(mpmath.re(mpmath.atan(2 * mpmath.sqrt(2 * mpmath.cos(psi)) / span(psi)) - psi))
    assert minimum_energy_envelope(0.0) == pytest.approx(end, abs=1e-12)
    assert end == pytest.approx(1.7377981344, abs=5e-11)
    assert mec_exists(np.pi / 2, np.pi / 2)
    assert not mec_exists(np.pi / 2 + 1e-9, np.pi / 2 + 1e-9)
    assert not mec_exists(2.22, -2.22)


@pytest.mark.parametrize("angle", [1.7, 1.78, 2.22])
def test_the_end_of_the_mec_by_held_ends(angle):
    """The energy by the length of the rod, ½κ² − force · tangent < 0 where it rises: beyond 1.7378 it falls for good."""
    ends = levien_ends(angle, -angle)
    rises = []
    for length in np.geomspace(1.25, 5.0, 40):
        rises += [natural(s.elastica, None, False) < -1e-9 for s in solve_boundary(*ends, length, max_inflections=3)]
    assert any(rises) == (angle < 1.7378)


@pytest.mark.parametrize("turn", [0.0, 0.3, 1.0, 2.0, 3.0, 3.1])
def test_two_mecs_merge_on_the_envelope(turn):
    reach = minimum_energy_envelope(turn)
    assert minimum_energy_envelope(-turn) == reach

    def ends(lean):
        return levien_ends(lean - turn / 2, -lean - turn / 2)

    short, long = minimum_energy_curves(*ends(reach - 1e-9))
    assert short.energy == pytest.approx(long.energy, rel=1e-8)
    assert abs(short.least_eigenvalue) < 0.05 > abs(long.least_eigenvalue)
    assert short.stable
    assert not long.stable
    with pytest.raises(NoSolutionError, match=f"1e-09 rad more than the {reach:.6g} that are possible"):
        minimum_energy_curves(*ends(reach + 1e-9))
    with pytest.raises(NoSolutionError):
        minimum_energy_curves(*ends(-reach - 1e-9), max_inflections=5)
    for n in range(2, 8):
        for cell in (0, 1):
            assert np.abs(Rectangular(turn, n, cell).lean(SCAN)).max() < reach - 1e-3
    for lean in np.linspace(-reach, reach, 25):
        assert minimum_energy_curves(*ends(lean))


@pytest.mark.parametrize("turn", [0.0, 1.0, 3.0, 4.5])
def test_two_si_mecs_merge_on_the_envelope(turn):
    reach = scale_invariant_envelope(turn)

    def found(lean):
        try:
            return scale_invariant_curves(*levien_ends(lean - turn / 2, -lean - turn / 2))
        except NoSolutionError:
            return []

    inside, outside = found(reach - 1e-9), found(reach + 1e-9)
    assert len(inside) == len(outside) + 2
    merged = sorted(inside, key=lambda s: abs(s.least_eigenvalue))[:2]
    assert abs(merged[0].least_eigenvalue) < 0.05 > abs(merged[1].least_eigenvalue)
    assert [s.stable for s in sorted(merged, key=lambda s: s.elastica.length)] == [True, False]


@pytest.mark.parametrize("turn", [4.6, 5.5, 6.2])
def test_the_chord_of_the_si_mec_vanishes_on_the_envelope(turn):
    assert scale_invariant_envelope(turn) == np.pi / 2
    for off in (1e-4, 1e-6):
        lean = np.pi / 2 - off
        curve = scale_invariant_curves(*levien_ends(lean - turn / 2, -lean - turn / 2))[0]
        assert 1.0 / curve.elastica.length < 20 * off
    with pytest.raises(NoSolutionError, match=r"0\.001 rad more than the 1\.5708"):
        scale_invariant_curves(*levien_ends(np.pi / 2 + 1e-3 - turn / 2, -np.pi / 2 - 1e-3 - turn / 2))


def test_the_symmetric_end_of_the_si_mec():
    assert scale_invariant_curves(*levien_ends(np.pi - 1e-6, np.pi - 1e-6))[0].energy == pytest.approx(
        4 * np.pi**2, rel=1e-5
    )
    with pytest.raises(InvalidInputError, match="2π"):
        scale_invariant_envelope(6.4)


# completeness


def march(z, angle, steps=160):
    """RK4 of many rods of chord 1: rows (κ₀, λ₁, λ₂, L) from (0, 0); end (x, y, θ) and how often κ changes sign."""
    kappa0, l1, l2, length = z.T
    state = np.stack([np.zeros_like(kappa0), np.zeros_like(kappa0), np.full_like(kappa0, angle)])
    h = length / steps

    def rate(u):
        return np.stack([np.cos(u[2]), np.sin(u[2]), kappa0 + u[0] * l2 - u[1] * l1])

    signs = [np.sign(kappa0)]
    for _ in range(steps):
        a = rate(state)
        b = rate(state + 0.5 * h * a)
        c = rate(state + 0.5 * h * b)
        d = rate(state + h * c)
        state = state + h / 6 * (a + 2 * b + 2 * c + d)
        signs.append(np.sign(kappa0 + state[0] * l2 - state[1] * l1))
    return state.T, np.count_nonzero(np.diff(signs, axis=0), axis=0)


def multi_start(first, last, rail, rng, starts=300):
    """Newton's method with differences, from many random starts: (κ₀, L) of the solutions with at most one inflection."""

    def miss(z):
        end, _ = march(z, first)
        rest = z[:, 1] if rail else 0.5 * z[:, 0] ** 2 - z[:, 1] * np.cos(first) - z[:, 2] * np.sin(first)
        return np.column_stack([end[:, 0] - 1.0, end[:, 1], end[:, 2] - last, rest])

    z = np.column_stack([rng.normal(0, 4, starts), rng.normal(0, 10, (starts, 2)), rng.uniform(1.0, 3.0, starts)])
    for _ in range(25):
        here = miss(z)
        slopes = np.stack([(miss(z + 1e-6 * e) - here) / 1e-6 for e in np.eye(4)], axis=2)
        step = np.linalg.solve(slopes + 1e-12 * np.eye(4), here[:, :, None])[:, :, 0]
        limit = np.array([2.0, 8.0, 8.0, 0.4])
        z = z - step * np.minimum(1.0, (limit / np.maximum(np.abs(step), 1e-300)).min(axis=1))[:, None]
        z = z[np.isfinite(z).all(axis=1) & (z[:, 3] > 0.3) & (z[:, 3] < 8.0) & (np.hypot(z[:, 1], z[:, 2]) < 400.0)]
    good = (np.abs(miss(z)).max(axis=1) < 1e-8) & (march(z, first)[1] <= 1)
    return z[good][:, [0, 3]]


def check_completeness(problems, curves, seed):
    rng = np.random.default_rng(seed)
    hits = 0
    for _ in range(problems):
        first, last = rng.uniform(-2.0, 2.0, 2)
        other = multi_start(first, last, curves is scale_invariant_curves, rng)
        try:
            mine = curves((0, 0), first, (1, 0), last, max_inflections=1)
        except NoSolutionError:
            assert len(other) == 0
            continue
        numbers = np.array([(s.elastica.start_curvature, s.elastica.length) for s in mine])
        for row in other:
            assert np.abs(numbers - row).max(axis=1).min() < 1e-3 * (1.0 + abs(row[0])), (first, last, row, numbers)
        hits += len(other) > 0
    assert hits >= 0.5 * problems


@BOTH
def test_no_solution_is_lost(curves):
    check_completeness(4, curves, 5)


@pytest.mark.slow
@BOTH
def test_no_solution_is_lost_in_more_problems(curves):
    check_completeness(30, curves, 6)


def test_roots_that_touch_cross_twice_or_lie_on_a_bound():
    grid = np.linspace(-1.0, 1.0, 21)
    assert sorted(roots(lambda x: (x - 0.033) ** 2 - 1e-8, grid)) == pytest.approx([0.0329, 0.0331], abs=1e-12)
    assert roots(lambda x: (x - 0.033) ** 2, grid) == pytest.approx([0.033], abs=1e-6)
    assert roots(lambda x: 1.0 - x, grid) == [1.0]
    assert roots(lambda x: np.where(x < 0.0, np.nan, x - 0.51), grid) == pytest.approx([0.51], abs=1e-13)
    assert roots(lambda x: x * x, grid, 2.0) == []


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (((0, 0), 0.1, (0, 0), 0.2), "move one"),
        (((0, 0), np.nan, (1, 0), 0.2), "finite"),
        (((0, 0, 0), 0.1, (1, 0), 0.2), "shape"),
        (((0, 0), "x", (1, 0), 0.2), "numbers"),
    ],
)
@BOTH
def test_bad_input(curves, args, words):
    with pytest.raises(InvalidInputError, match=words):
        curves(*args)
    with pytest.raises(InvalidInputError, match="max_inflections"):
        curves((0, 0), 0.1, (1, 0), 0.2, max_inflections=-1)


def test_far_outside_the_message_says_how_far():
    with pytest.raises(NoSolutionError, match=r"turn by 3\.2 rad, 0\.0584 rad more"):
        minimum_energy_curves(*levien_ends(1.6, 1.6))
    with pytest.raises(NoSolutionError, match=r"lean by 2\.22 rad .* 0\.482 rad more than the 1\.7378"):
        minimum_energy_curves(*levien_ends(2.22, -2.22))
    with pytest.raises(NoSolutionError, match="allow more"):
        minimum_energy_curves(*levien_ends(1.0, -1.0), max_inflections=0)
    with pytest.raises(InvalidInputError):
        minimum_energy_envelope(np.inf)
