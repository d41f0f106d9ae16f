"""Elastic splines: balance against polylines and integrated equations, energies against finite differences and searches."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

from batten.errors import ConvergenceError, InvalidInputError, NoSolutionError
from batten.solvers.boundary_value import solve_boundary
from batten.solvers.discrete_rod import DiscreteRod
from batten.splines.elastic_spline import elastic_spline

POINTS = np.array([(0.0, 0.0), (1.0, 0.6), (2.1, -0.1), (2.9, 0.3)])
CHORDS = np.hypot(*np.diff(POINTS, axis=0).T)


@pytest.fixture(scope="module")
def wave():
    return elastic_spline(POINTS, 0.9, -0.2, 3.9)


def polyline(piece, edges):
    """Force, and curvature at both ends, of a polyline of equal edges clamped like a piece."""
    end = piece.point_at(piece.length)
    rod = DiscreteRod(
        piece.start, piece.start_angle, end, float(piece.angle_at(piece.length)), piece.length, edges, "points"
    )
    found = rod.solve(piece.angle_at((np.arange(edges) + 0.5) * piece.length / edges))
    assert found.converged
    inner = np.diff(found.angles) * edges / piece.length  # curvature at the corners
    weights = np.array([3.0, -3.0, 1.0])
    return found.force, np.array([weights @ inner[:3], weights @ inner[:-4:-1]])


def test_balance_at_every_support_by_polylines(wave):
    """Moments continuous, no force along the rod from an inner support: from polylines that know no elastica."""
    forces, curvatures = [], []
    for piece in wave.pieces:
        coarse, fine = polyline(piece, 200), polyline(piece, 400)
        forces.append((4.0 * fine[0] - coarse[0]) / 3.0)
        curvatures.append((4.0 * fine[1] - coarse[1]) / 3.0)
    for j in (1, 2):
        tangent = np.array([np.cos(wave.angles[j]), np.sin(wave.angles[j])])
        push = forces[j] - forces[j - 1]
        scale = np.abs(curvatures).max()
        assert abs(curvatures[j][0] - curvatures[j - 1][1]) < 1e-3 * scale
        assert abs(push @ tangent) < 1e-3 * np.hypot(*push)
        np.testing.assert_allclose(push, wave.reactions[j], atol=1e-3 * np.hypot(*push))


def test_pieces_are_elastica_by_integration(wave):
    for piece, end, angle in zip(wave.pieces, POINTS[1:], wave.angles[1:]):
        fx, fy = piece.force

        def slope(_, y, fx=fx, fy=fy):
            return [np.cos(y[2]), np.sin(y[2]), y[3], fy * np.cos(y[2]) - fx * np.sin(y[2])]

        start = [*piece.start, piece.start_angle, piece.start_curvature]
        last = solve_ivp(slope, (0.0, piece.length), start, rtol=1e-11, atol=1e-12).y[:, -1]
        np.testing.assert_allclose(last[:3], [*end, angle], atol=1e-8)


def test_residuals_and_length(wave):
    assert wave.status == "converged"
    assert wave.stable
    assert wave.length == pytest.approx(3.9, rel=1e-12)
    assert max(wave.moment_residual, wave.force_residual, wave.angle_error, wave.position_error) < 1e-9
    np.testing.assert_allclose(wave.curve.joints().curvature_jumps, 0.0, atol=1e-9)
    np.testing.assert_allclose(wave.angles[[0, -1]], [0.9, -0.2], atol=1e-14)
    np.testing.assert_allclose(wave.reactions.sum(axis=0), 0.0, atol=1e-9)


@pytest.mark.parametrize("index", range(4))
def test_reactions_are_slopes_of_the_energy(wave, index):
    h = 1e-4
    for axis in (0, 1):
        energy = []
        for sign in (1, -1):
            moved = POINTS.copy()
            moved[index, axis] += sign * h
            energy.append(0.5 * elastic_spline(moved, 0.9, -0.2, 3.9, design=wave).energy)
        assert (energy[0] - energy[1]) / (2 * h) == pytest.approx(wave.reactions[index, axis], rel=1e-5, abs=1e-5)


def test_moments_of_rest_and_torque(wave):
    """Forces and couples on the whole rod turn it nowhere."""
    arms = POINTS - POINTS[0]
    torque = (arms[:, 0] * wave.reactions[:, 1] - arms[:, 1] * wave.reactions[:, 0]).sum() + wave.couples.sum()
    assert abs(torque) < 1e-9
    assert np.abs(wave.couples[1:-1]).max() < 1e-10


def test_it_is_a_minimum(wave):
    """Every other way to share out the length and to turn the joints costs more, by all solutions of each piece."""
    rng = np.random.default_rng(3)
    for _ in range(6):
        angles, lengths = wave.angles.copy(), wave.lengths.copy()
        angles[1:-1] += rng.normal(0.0, 0.05, 2)
        change = rng.normal(0.0, 0.01, 3)
        lengths += change - change.mean()
        energy = sum(
            min(s.energy for s in solve_boundary(POINTS[i], angles[i], POINTS[i + 1], angles[i + 1], lengths[i]))
            for i in range(3)
        )
        assert energy > wave.energy * (1.0 + 1e-6)


def test_random_splines_converge():
    rng = np.random.default_rng(0)
    for _ in range(40):
        n = rng.integers(2, 8)
        points = np.column_stack([np.arange(n) + rng.normal(0, 0.15, n), rng.normal(0, 0.4, n)])
        total = np.hypot(*np.diff(points, axis=0).T).sum() * rng.uniform(1.02, 1.6)
        spline = elastic_spline(points, *rng.normal(0.0, 0.5, 2), total)
        assert spline.stable
        assert max(spline.moment_residual, spline.force_residual) < 1e-8 * (1.0 + spline.energy * spline.length)
        assert max(spline.position_error, spline.angle_error, spline.length_error) < 1e-8


def test_similar_inputs_give_similar_splines(wave):
    turn, scale, shift = 0.7, 250.0, np.array([30.0, -900.0])
    c, s = np.cos(turn), np.sin(turn)
    moved = elastic_spline(scale * POINTS @ np.array([[c, s], [-s, c]]) + shift, 0.9 + turn, -0.2 + turn, 3.9 * scale)
    assert moved.energy * scale == pytest.approx(wave.energy, rel=1e-10)
    np.testing.assert_allclose(moved.lengths, scale * wave.lengths, rtol=1e-8)


def test_pinned_lengths_balance_moments_only(wave):
    lengths = CHORDS * np.array([1.1, 1.05, 1.2])
    pinned = elastic_spline(POINTS, 0.9, -0.2, lengths=lengths)
    np.testing.assert_allclose(pinned.lengths, lengths, rtol=1e-13)
    assert pinned.moment_residual < 1e-9
    sliding = elastic_spline(POINTS, 0.9, -0.2, float(lengths.sum()), design=pinned)
    assert sliding.energy < pinned.energy * (1.0 - 1e-6)


def test_free_ends_bear_no_moment():
    spline = elastic_spline(POINTS, None, None, 3.9)
    assert abs(spline.pieces[0].start_curvature) < 1e-9
    assert abs(spline.pieces[-1].curvature_at(spline.pieces[-1].length)) < 1e-9


def test_a_free_length_is_the_best():
    free = elastic_spline([(0, 0), (1, 0)], 0.8, -0.5)
    best = minimize_scalar(
        lambda length: solve_boundary((0, 0), 0.8, (1, 0), -0.5, length)[0].energy, bounds=(1.01, 1.4), method="bounded",
        options={"xatol": 1e-9},
    )  # fmt: skip
    assert free.energy == pytest.approx(best.fun, rel=1e-9)
    assert free.length == pytest.approx(best.x, abs=1e-5)
    whole = elastic_spline(POINTS, 0.9, -0.2)
    assert whole.force_residual < 1e-9
    for total in (0.995 * whole.length, 1.005 * whole.length):
        assert elastic_spline(POINTS, 0.9, -0.2, total, design=whole).energy > whole.energy


def test_tangent_continuous_splines_are_the_pieces_of_least_energy():
    tangents, lengths = [0.7, 0.0, -0.4, 0.5], CHORDS * 1.15
    spline = elastic_spline(POINTS, tangents=tangents, lengths=lengths)
    assert spline.continuity == 1
    for i, piece in enumerate(spline.pieces):
        every = solve_boundary(POINTS[i], tangents[i], POINTS[i + 1], tangents[i + 1], lengths[i])
        assert piece.bending_energy() == pytest.approx(min(s.energy for s in every if s.stable), rel=1e-10)
    assert max(spline.angle_error, spline.position_error, spline.length_error) < 1e-12
    free = elastic_spline(POINTS, tangents=tangents)
    assert free.force_residual < 1e-9
    assert free.energy < elastic_spline(POINTS, tangents=tangents, lengths=free.lengths * 1.02).energy


def test_a_circle_is_found():
    angles = np.array([0.0, 0.7, 1.5])
    points = np.column_stack([np.sin(angles), 1.0 - np.cos(angles)])
    spline = elastic_spline(points, tangents=angles, lengths=np.diff(angles))
    assert spline.energy == pytest.approx(1.5, rel=1e-12)
    sliding = elastic_spline(points, 0.0, 1.5, 1.5)
    assert sliding.energy == pytest.approx(1.5, rel=1e-9)
    np.testing.assert_allclose(sliding.lengths, [0.7, 0.8], atol=1e-6)


def test_least_energy_jumps_where_a_design_is_followed():
    """As in Fig. 5.4: a small change of the end tangents, and the shape of least energy lies on the other side."""

    def height(spline):
        return float(spline.curve.point(0.5)[1])

    angles = np.linspace(0.3, -0.3, 13)
    least = [elastic_spline([(0, 0), (1, 0)], tangents=[a, -a], lengths=[1.2]) for a in angles]
    jumps = np.abs(np.diff([height(s) for s in least]))
    assert (jumps > 0.3).sum() == 1
    followed = [least[0]]
    for a in angles[1:]:
        followed.append(elastic_spline([(0, 0), (1, 0)], tangents=[a, -a], lengths=[1.2], design=followed[-1]))
    assert np.abs(np.diff([height(s) for s in followed])).max() < 0.03
    assert followed[-1].energy > least[-1].energy


def test_a_sliding_spline_follows_its_design():
    points = [(0, 0), (1, 0), (2, 0)]
    spline = elastic_spline(points, 0.4, 0.4, 2.3)
    heights = []
    for a in np.linspace(0.4, -0.2, 13):
        spline = elastic_spline(points, a, a, 2.3, design=spline, keep=True)
        heights.append(float(spline.curve.point(0.25)[1]))
    assert heights[0] > 0.1
    assert np.abs(np.diff(heights)).max() < 0.05
    fresh = elastic_spline(points, -0.2, -0.2, 2.3)
    assert float(fresh.curve.point(0.25)[1]) < 0.0 < heights[-1]


@pytest.mark.parametrize(
    ("arguments", "words", "error"),
    [
        ({"points": [(0, 0)], "length": 1.0}, "n ≥ 2", InvalidInputError),
        ({"points": [(0, 0), (0, 0), (1, 0)]}, "must differ", InvalidInputError),
        ({"points": POINTS, "length": 3.0}, "longer", NoSolutionError),
        ({"points": POINTS, "lengths": [1.0, 2.0, 1.0]}, "apart", NoSolutionError),
        ({"points": POINTS, "lengths": [2.0, 2.0]}, "shape", InvalidInputError),
        ({"points": POINTS, "length": 4.0, "lengths": [2.0, 2.0, 2.0]}, "not both", InvalidInputError),
        ({"points": POINTS, "tangents": [0, 0, 0, 0], "length": 4.0}, "no total length", InvalidInputError),
        ({"points": POINTS, "start_angle": np.nan, "length": 4.0}, "finite", InvalidInputError),
        ({"points": POINTS, "length": 4.0, "design": "wave"}, "a design is a curve", InvalidInputError),
        ({"points": [(0, 0), (1, 0)], "start_angle": 2.8, "end_angle": -2.8}, "falls without end", NoSolutionError),
    ],
)
def test_errors_say_what_is_wrong(arguments, words, error):
    with pytest.raises(error, match=words):
        elastic_spline(**arguments)


def test_a_piece_without_a_shape_is_named():
    with pytest.raises(ConvergenceError, match=r"piece 0.*more length"):
        elastic_spline([(0, 0), (1, 0)], tangents=[2.0, -2.0], lengths=[1.0 + 1e-7])


def test_a_symmetric_saddle_is_left():
    """The symmetric rod between symmetric supports has more energy: it slides to one side."""
    points = [(0, 0), (1, 0.5), (2, 0)]
    spline = elastic_spline(points, 0.8, -0.8, 2.4)
    half = solve_boundary((0, 0), 0.8, (1, 0.5), 0.0, 1.2)
    assert spline.energy < 2.0 * min(s.energy for s in half) * (1.0 - 1e-3)
    assert abs(spline.lengths[0] - spline.lengths[1]) > 0.01
