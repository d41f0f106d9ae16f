"""All elastica between two ends: none missing, none wrong, clear words where there is none."""

import numpy as np
import pytest
from scipy.special import ellipe, ellipk, gamma

from batten.curves.elastica import Elastica, states_along
from batten.errors import ConvergenceError, InvalidInputError, NoSolutionError
from batten.kernels.boundary_polish import bending_and_inflections
from batten.solvers.boundary_value import STATUS, solve_boundary, solve_boundary_batch
from tests.reference.boundary_brute_force import ANGLE, CURVATURE, brute_force, difference, inflections

PI = np.pi


def random_segments(count, seed):
    """Parameters (count, 7) of segments of length 1: at most one period and 1.5 turns, any modulus, phase and extent."""
    rng = np.random.default_rng(seed)
    out = []
    while len(out) < count:
        k = np.sqrt(rng.random()) if rng.random() < 0.6 else 1 / np.sqrt(rng.random())
        period = 4 * ellipk(k * k) if k < 1 else 2 * ellipk(1 / k**2) / k
        ell = period * rng.random() * rng.choice([1, -1])
        curve = Elastica.from_modulus(k, rng.random() * period, ell, 1 / abs(ell), rng.random() * 2 * PI)
        if abs(curve.angle_at(curve.length) - curve.start_angle) <= 3 * PI and abs(ell) > 0.02:
            out.append(curve.parameters)
    return np.array(out)


def problems(segments):
    """Arguments of `solve_boundary_batch` that the segments solve."""
    ends = states_along(segments, segments[:, 6:] * np.array([[0.0, 1.0]]))[:, 1]
    return segments[:, :2], segments[:, 2], ends[:, :2], ends[:, 2], segments[:, 6]


def apart(found, wanted):
    """Least relative difference in curvature and force of solutions (m, 7) from the curve wanted (7,), both of length 1."""
    bend = 1 + abs(wanted[3]) + np.sqrt(np.hypot(*wanted[4:6]))
    return min((difference(f[3:6], wanted[3:6], bend) for f in found), default=np.inf)


def test_the_generating_segment_is_always_among_the_solutions():
    segments = random_segments(300, 1)
    batch = solve_boundary_batch(*problems(segments))
    words = [STATUS[s] for s in batch.status]
    assert words.count("found") >= 295  # in the others, a further solution with tight loops cannot be stored
    assert set(words) <= {"found", "a solution cannot be stored"}
    worst = max(apart(batch.parameters[i, : batch.count[i]], segments[i]) for i in range(300))
    assert worst < 1e-9


def test_ends_tangents_and_length_are_met_to_1e_11():
    segments = random_segments(300, 2)
    start, start_angle, end, end_angle, length = problems(segments)
    batch = solve_boundary_batch(start, start_angle, end, end_angle, length)
    for i in range(300):
        for row in batch.parameters[i, : batch.count[i]]:
            curve = Elastica.from_parameters(row)
            assert curve.length == length[i]
            assert (curve.start == start[i]).all()
            assert curve.start_angle == start_angle[i]
            stiff = np.sqrt(np.hypot(*curve.force))
            allowed = 1e-11 if stiff < 30 else 1e-9
            assert np.hypot(*(curve.point_at(1.0) - end[i])) < allowed
            assert abs(curve.angle_at(1.0) - end_angle[i]) < allowed


def missing_solutions(segments, starts, seed=0):
    """Solutions of the brute force with at most two inflections that batten does not list; and how many there were."""
    start, start_angle, end, end_angle, length = problems(segments)
    batch = solve_boundary_batch(start, start_angle, end, end_angle, length)
    lost, total = [], 0
    for i in range(len(segments)):
        goal = (*(end[i] - start[i]), end_angle[i])
        for z in brute_force(start_angle[i], goal, starts=starts, seed=seed + i):
            count = bending_and_inflections(np.array([start_angle[i], *z]))[1]
            if count > 2 or np.sqrt(np.hypot(z[1], z[2])) > 40:
                continue
            total += 1
            bend = 1 + abs(z[0]) + np.sqrt(np.hypot(z[1], z[2]))
            found = batch.parameters[i, : batch.count[i]]
            if min((difference(f[3:6], z, bend) for f in found), default=np.inf) > 1e-3:
                lost.append((i, z))
    return lost, total


def test_no_solution_of_the_brute_force_is_missing():
    lost, total = missing_solutions(random_segments(6, 3), starts=700)
    assert lost == []
    assert total >= 6


@pytest.mark.slow
def test_no_solution_of_the_brute_force_is_missing_in_300_problems():
    lost, total = missing_solutions(random_segments(300, 1), starts=3000)
    assert lost == []
    assert total >= 300


def test_the_inflections_are_counted_as_by_integration():
    for row in random_segments(30, 4):
        count = bending_and_inflections(np.array([row[2], *row[3:6]]))[1]
        assert count == inflections(row[3:6], row[2])


def test_solutions_are_sorted_and_say_what_they_are():
    solutions = solve_boundary((0, 0), 0.3, (0.7, 0.1), -0.4, 1.0, max_inflections=5)
    assert [s.energy for s in solutions] == sorted(s.energy for s in solutions)
    for s in solutions:
        assert s.energy == pytest.approx(s.elastica.bending_energy(), rel=1e-10)
        assert s.rotation_number == pytest.approx(-0.7 / (2 * PI), abs=1e-10)
        assert s.inflections == len(s.elastica.inflections())
        assert s.stable == (s.margin > 1)
    assert max(s.inflections for s in solutions) == 5
    assert len(solve_boundary((0, 0), 0.3, (0.7, 0.1), -0.4, 1.0, max_inflections=2)) < len(solutions)


def test_similar_and_mirrored_problems_have_similar_solutions():
    rng = np.random.default_rng(5)
    for _ in range(20):
        angles, end = rng.uniform(-2, 2, 2), rng.uniform(-0.6, 0.6, 2)
        here = solve_boundary((0, 0), angles[0], end, angles[1], 1.0)
        scale, turn, shift = rng.uniform(0.01, 100), rng.uniform(-3, 3), rng.uniform(-9, 9, 2)
        rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        there = solve_boundary(shift, angles[0] + turn, shift + scale * rotation @ end, angles[1] + turn, scale)
        mirror = solve_boundary((0, 0), -angles[0], end * [1, -1], -angles[1], 1.0)
        back = solve_boundary(end, angles[1] + PI, (0, 0), angles[0] + PI, 1.0)
        for other, unit in ((there, scale), (mirror, 1.0), (back, 1.0)):
            assert np.allclose([s.energy * unit for s in other], [s.energy for s in here], rtol=1e-8)


def test_straight_and_taut():
    (only,) = solve_boundary((1, 2), 0.5, (1 + 3 * np.cos(0.5), 2 + 3 * np.sin(0.5)), 0.5, 3.0)
    assert only.energy == 0.0
    assert only.stable
    assert (only.elastica.force == 0).all()
    with pytest.raises(NoSolutionError, match=r"straight, but the end angles 0\.1 and 0 do not lie along"):
        solve_boundary((0, 0), 0.1, (1, 0), 0.0, 1.0)
    with pytest.raises(NoSolutionError, match="do not lie along"):
        solve_boundary((0, 0), 0.0, (1, 0), 2 * PI, 1.0)
    moved = solve_boundary((5, 6), 0.1, (5.8, 6.1), 0.2, 1.0)
    assert (moved[0].elastica.start == [5, 6]).all()


def test_a_rod_shorter_than_its_chord():
    with pytest.raises(NoSolutionError, match=r"the ends are 1\.1 apart and the rod is only 1 long"):
        solve_boundary((0, 0), 0, (1.1, 0), 0, 1.0)


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_full_circles(turns):
    (circle,) = solve_boundary((0, 0), 0.7, (0, 0), 0.7 + 2 * PI * turns, 2.0)
    assert circle.energy == pytest.approx((2 * PI * turns) ** 2 / 2.0, rel=1e-12)
    assert circle.rotation_number == pytest.approx(turns)
    assert np.hypot(*circle.elastica.force) < 1e-9


def test_figure_eights_stand_for_their_family():
    eights = solve_boundary((0, 0), 0.3, (0, 0), 0.3, 1.0)
    assert [s.energy for s in eights] == pytest.approx([112.4396] * 2, abs=1e-4)
    assert all(abs(s.elastica.start_curvature) < 1e-9 for s in eights)
    assert all(np.hypot(*s.elastica.point_at(1.0)) < 1e-12 for s in eights)
    assert len(solve_boundary((0, 0), 0.3, (0, 0), 0.3, 1.0, max_inflections=3)) == 4
    assert len(solve_boundary((0, 0), 0.3, (0, 0), 0.3, 1.0, end_angle_modulo=True)) == 4  # and two circles


def test_half_turns():
    half = solve_boundary((0, 0), PI / 2, (2 / PI, 0), -PI / 2, 1.0)
    assert half[0].energy == pytest.approx(PI**2, rel=1e-12)
    for s in solve_boundary((0, 0), 0.0, (0, 0.3), PI, 1.0):
        assert s.elastica.angle_at(1.0) == pytest.approx(PI, abs=1e-11)


@pytest.mark.parametrize("slack", [1e-2, 1e-4, 1e-6, 1e-8, 1e-10])
def test_nearly_straight_rods_buckle_to_either_side(slack):
    """A clamped column: amplitude (2/π)·√slack of θ = A sin 2πs, energy 4π²·2·slack, force 4π²."""
    both = solve_boundary((0, 0), 0.0, (1 - slack, 0), 0.0, 1.0)
    assert len(both) == 2
    for s in both:
        assert s.energy == pytest.approx(8 * PI**2 * slack, rel=0.5 * slack + 1e-5)
        assert s.elastica.force[0] == pytest.approx(4 * PI**2, rel=0.6 * slack + 1e-4)
    assert both[0].elastica.start_curvature == pytest.approx(-both[1].elastica.start_curvature, rel=1e-6)


def test_rods_that_are_pulled_hard_say_so_where_they_cannot_be_stored():
    (taut,) = solve_boundary((0, 0), 0.3, (0.99, 0), 0.3, 1.0)
    assert taut.residual < 1e-11
    with pytest.raises(NoSolutionError, match="all but taut"):
        solve_boundary((0, 0), 0.3, (0.9999, 0), 0.3, 1.0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (((0, 0), np.nan, (1, 0), 0.0, 2.0), "finite"),
        (((0, 0), 0.0, (np.inf, 0), 0.0, 2.0), "finite"),
        (((0, 0), 0.0, (1, 0), 0.0, -2.0), "above 0"),
        (((0, 0), 0.0, (1, 0, 0), 0.0, 2.0), r"shape \(2,\)"),
        (((0, 0), "x", (1, 0), 0.0, 2.0), "numbers"),
    ],
)
def test_bad_input(arguments, words):
    with pytest.raises(InvalidInputError, match=words):
        solve_boundary(*arguments)


def test_bad_limits():
    for limits in ({"max_inflections": -1}, {"max_turns": -0.5}):
        with pytest.raises(InvalidInputError, match="from 0 on"):
            solve_boundary((0, 0), 0.0, (1, 0), 0.0, 2.0, **limits)
    with pytest.raises(NoSolutionError, match="at most 0 inflections"):
        solve_boundary((0, 0), 0.0, (0.8, 0), 0.0, 1.0, max_inflections=0)


def test_all_windings():
    every = solve_boundary((0, 0), 0.2, (0.5, 0.1), -0.3, 1.0, end_angle_modulo=True, max_turns=2)
    windings = {round(s.rotation_number + 0.5 / (2 * PI)) for s in every}
    assert windings == {-1, 0, 1, 2}
    one = solve_boundary((0, 0), 0.2, (0.5, 0.1), -0.3 + 2 * PI, 1.0)
    assert {round(s.energy, 6) for s in one} <= {round(s.energy, 6) for s in every}


def test_a_batch_is_its_rows_whatever_the_number_of_threads():
    segments = random_segments(600, 6)
    arguments = list(problems(segments))
    arguments[1] = arguments[1].copy()
    arguments[1][5] = np.nan
    one = solve_boundary_batch(*arguments, workers=1)
    two = solve_boundary_batch(*arguments, workers=2)
    assert np.array_equal(one.parameters, two.parameters, equal_nan=True)
    assert np.array_equal(one.margin, two.margin, equal_nan=True)
    assert STATUS[one.status[5]] == "bad input"
    assert one.count[5] == 0
    assert (one.count[6:] > 0).all()
    assert (one.inflections[one.inflections >= 0] <= 2).all()
    start, start_angle, end, end_angle, length = arguments
    alone = solve_boundary(start[7], start_angle[7], end[7], end_angle[7], length[7])
    assert len(alone) == one.count[7]
    assert alone[0].elastica.parameters == pytest.approx(one.parameters[7, 0], rel=1e-9, abs=1e-9)
    with pytest.raises(InvalidInputError, match="n rows"):
        solve_boundary_batch(np.zeros((3, 2)), 0.0, np.ones((4, 2)), 0.0, 3.0)


def test_too_few_places_are_said():
    batch = solve_boundary_batch((0, 0), 0.0, (0.8, 0), 0.0, 1.0, most=1)
    assert STATUS[batch.status[0]] == "search cut short"
    assert batch.count[0] == 1


def test_a_family_is_cut_short_and_said():
    """A pinned rod bent by equal moments into a full circle may turn about its pin: nothing holds it."""
    with pytest.raises((ConvergenceError, NoSolutionError)) as caught:
        solve_boundary((0, 0), None, (0, 0), None, 1.0, start_curvature=2 * PI, end_curvature=2 * PI)
    assert "pinned in one point" in str(caught.value)


@pytest.mark.parametrize("off", [0.0, 1e-13, -1e-12, 1e-10, 1e-7, -1e-5])
def test_ends_that_are_inflections(off):
    """A half wave of the rectangular elastica, chord/L = π/ϖ²: both end curvatures vanish, the tip of a chart."""
    lemniscate = gamma(0.25) ** 2 / (2 * np.sqrt(2 * PI))
    solutions = solve_boundary((0, 0), PI / 2, (1, 0), -PI / 2, lemniscate**2 / PI * (1 + off))
    assert solutions[0].energy == pytest.approx(4 * PI**2 / lemniscate**2, rel=1e-6)
    assert solutions[0].stable
    assert solutions[0].elastica.start_curvature == pytest.approx(PI * off, abs=1e-12 + 0.01 * abs(off))


def test_nearly_degenerate_problems_are_solved_or_refused_in_words():
    """Chords next to 0 and to the length, turns next to multiples of π/2, down to 1e-14: no crash, no wrong solution."""
    rng = np.random.default_rng(3)
    n = 800
    near = 10.0 ** rng.uniform(-14, -1, n)
    chord = np.choose(rng.integers(0, 3, n), [1 - np.maximum(near, 1e-12), near, rng.random(n)])
    exact = rng.random((2, n)) < 0.5
    direction = rng.choice([0, PI / 2, PI, -PI / 2, 1.0], n) + np.where(exact[0], 0, 10.0 ** rng.uniform(-14, 0, n))
    turn = rng.choice([0, PI, -PI, 2 * PI, PI / 2, -4 * PI, 1.0, -0.3], n)
    turn += np.where(exact[1], 0, rng.choice([-1, 1], n) * 10.0 ** rng.uniform(-14, 0, n))
    ends = chord[:, None] * np.column_stack([np.cos(direction), np.sin(direction)])
    batch = solve_boundary_batch((0, 0), 0.0, ends, turn, 1.0)
    words = [STATUS[s] for s in batch.status]
    assert words.count("search cut short") <= 8
    for i in range(n):
        if words[i] != "search cut short":
            for row in batch.parameters[i, : batch.count[i]]:
                curve = Elastica.from_parameters(row)
                assert np.hypot(*(curve.point_at(1.0) - ends[i])) < 2e-9
                assert abs(curve.angle_at(1.0) - turn[i]) < 2e-9


# --- other end conditions ---


@pytest.mark.parametrize("chord", [0.95, 0.6, 0.2])
def test_pinned_ends_in_closed_form(chord):
    """√λ·L = 2mK, chord/L = ±(2E/K − 1): Euler's column after it has buckled into m half waves."""
    solutions = solve_boundary((0, 0), None, (chord, 0), None, 1.0, max_inflections=1)
    for s in solutions:
        m = s.inflections + 1
        root = np.sqrt(np.hypot(*s.elastica.force))
        energy_modulus = s.elastica.to_modulus().k
        assert root == pytest.approx(2 * m * ellipk(energy_modulus**2), rel=1e-8)
        assert abs(2 * ellipe(energy_modulus**2) / ellipk(energy_modulus**2) - 1) == pytest.approx(chord, rel=1e-8)
        assert s.elastica.curvature_at([0.0, 1.0]) == pytest.approx([0.0, 0.0], abs=1e-8)
    assert [s.stable for s in solutions[:2]] == [True, True]
    assert [s.inflections for s in solutions[:2]] == [0, 0]
    assert not any(s.stable for s in solutions[2:])


def test_one_pinned_end_misses_nothing_that_brute_force_finds():
    rng = np.random.default_rng(8)
    checked = 0
    for i in range(5):
        angle, end, kappa = rng.uniform(-1.5, 1.5), rng.uniform(-0.7, 0.7, 2), rng.uniform(-3, 3) * (i % 2)
        found = solve_boundary((0, 0), angle, end, None, 1.0, end_curvature=kappa, max_turns=3)
        for z in brute_force(angle, (*end, kappa), end=CURVATURE, starts=700, seed=i):
            count = bending_and_inflections(np.array([angle, *z]))[1]
            if count <= 2 and np.sqrt(np.hypot(z[1], z[2])) < 20:
                checked += 1
                bend = 1 + abs(z[0]) + np.sqrt(np.hypot(z[1], z[2]))
                assert min(difference(s.elastica.parameters[3:6], z, bend) for s in found) < 1e-3
    assert checked > 10


def test_a_pinned_start_is_a_pinned_end_run_backwards():
    there = solve_boundary((0, 0), 0.2, (0.7, 0.1), None, 1.0)
    back = solve_boundary((0.7, 0.1), None, (0, 0), 0.2 + PI, 1.0)
    assert [s.energy for s in there] == pytest.approx([s.energy for s in back], rel=1e-9)
    assert [s.stable for s in there] == [s.stable for s in back]


@pytest.mark.parametrize("kappas", [(2.0, -2.0), (1.5, 0.5), (-4.0, 3.0)])
def test_given_curvatures_at_both_ends(kappas):
    solutions = solve_boundary((0, 0), None, (0.6, 0.3), None, 1.0, start_curvature=kappas[0], end_curvature=kappas[1])
    assert len(solutions) >= 1
    for s in solutions:
        assert s.elastica.curvature_at([0.0, 1.0]) == pytest.approx(kappas, abs=1e-9)
        assert s.elastica.point_at(1.0) == pytest.approx([0.6, 0.3], abs=1e-9)
        goal = (0.6, 0.3, kappas[1])
        z = brute_force(s.elastica.start_angle, goal, end=CURVATURE, starts=5)
        assert z.shape[1] == 3
    stable = [s for s in solutions if s.stable]
    assert stable
    assert np.isnan(stable[0].margin)


def test_an_end_angle_given_as_such_or_by_its_moment():
    """The moment that a clamp needs, given in place of its angle, leads to the same curve."""
    for s in solve_boundary((0, 0), 0.4, (0.7, 0.2), -0.6, 1.0):
        kappa = float(s.elastica.curvature_at(1.0))
        again = solve_boundary((0, 0), 0.4, (0.7, 0.2), None, 1.0, end_curvature=kappa)
        assert min(abs(a.energy / s.energy - 1) for a in again) < 1e-9


assert ANGLE != CURVATURE
