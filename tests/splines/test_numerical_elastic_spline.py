"""The paper's numerical elastic splines: against their conditions, and against the exact ones of another method."""

import numpy as np
import pytest

from batten.errors import InvalidInputError, NoSolutionError
from batten.measures.distance import l2_distance
from batten.splines.elastic_spline import elastic_spline
from batten.splines.numerical_elastic_spline import numerical_elastic_spline

POINTS = np.array([(0.0, 0.0), (1.0, 0.6), (2.1, -0.1), (2.9, 0.3)])


@pytest.fixture(scope="module")
def numerical():
    return numerical_elastic_spline(POINTS, 0.9, -0.2, updates=3)


def test_it_meets_points_tangents_and_length(numerical):
    assert numerical.converged
    np.testing.assert_allclose(numerical.curve.point(np.arange(4) / 3.0), POINTS, atol=1e-13)
    for t, angle in ((0.0, 0.9), (1.0, -0.2)):
        x, y = numerical.curve.derivative(t)
        assert np.arctan2(y, x) == pytest.approx(angle, abs=1e-12)
    assert numerical.curve.length == pytest.approx(numerical.design.length, rel=1e-8)


def test_energies_fall_with_every_update(numerical):
    assert (np.diff(numerical.energies) < 0.0).all()
    assert len(numerical.energies) == numerical.updates + 2
    assert numerical.lambda_residuals.shape == (3,)
    assert numerical.lambda_residuals.max() < 0.02


def test_the_exact_energy_is_the_limit_from_below(numerical):
    """Never above the numerical one; what is above it falls like the fourth power of the width."""
    exact = elastic_spline(POINTS, 0.9, -0.2, numerical.design.length, design=numerical.curve)
    excess = np.array(numerical.energies[2:]) / exact.energy - 1.0
    assert (excess > -1e-9).all()
    assert 8.0 < excess[1] / excess[2] < 40.0
    assert excess[2] < 2e-4


def test_random_splines_agree_in_the_same_basin():
    rng = np.random.default_rng(5)
    agreed = 0
    for _ in range(6):
        points = np.column_stack([np.arange(3) + rng.normal(0, 0.1, 3), rng.normal(0, 0.3, 3)])
        steps = np.diff(points, axis=0)
        angles = np.arctan2(steps[:, 1], steps[:, 0]) + rng.normal(0, 0.2, 2)
        numerical = numerical_elastic_spline(points, *angles, updates=2)
        exact = elastic_spline(points, *angles, numerical.design.length, design=numerical.curve)
        assert exact.energy <= numerical.energy * (1.0 + 1e-9)
        if numerical.converged:
            assert numerical.energy < exact.energy * (1.0 + 2e-3)
            # Arc lengths in the points, read off the numerical curve by a fine polyline, are those of the sliding rod.
            fine = numerical.curve.point(np.linspace(0.0, 1.0, 4001))
            first = np.hypot(*np.diff(fine[:2001], axis=0).T).sum()
            assert first == pytest.approx(exact.lengths[0], abs=2e-3 * exact.length)
            agreed += 1
    assert agreed >= 5


def test_a_length_of_its_own():
    spline = numerical_elastic_spline([(0, 0), (1, 0.5), (2.2, 0)], 0.8, -0.5, 2.5, updates=3)
    exact = elastic_spline([(0, 0), (1, 0.5), (2.2, 0)], 0.8, -0.5, 2.5, design=spline.curve)
    assert spline.converged
    assert spline.curve.length == pytest.approx(2.5, rel=1e-8)
    assert -1e-9 < spline.energy / exact.energy - 1.0 < 1e-3


def test_tangent_continuous_splines():
    tangents = [0.9, -0.2, 0.1, -0.2]
    spline = numerical_elastic_spline(POINTS, tangents=tangents)
    assert spline.converged, spline.status
    lengths = [piece.length for piece in spline.design.pieces]
    exact = elastic_spline(POINTS, tangents=tangents, lengths=lengths, design=spline.curve)
    assert -1e-9 < spline.energy / exact.energy - 1.0 < 1e-3
    for mine, theirs in zip(exact.pieces, spline.curve.pieces):
        assert l2_distance(mine, theirs) < 2e-3
    np.testing.assert_allclose(spline.curve.joints().tangent_jumps, 0.0, atol=1e-10)


def test_two_points_are_a_rod():
    spline = numerical_elastic_spline([(0, 0), (1, 0)], 0.6, -0.6, 1.08, updates=4)
    exact = elastic_spline([(0, 0), (1, 0)], 0.6, -0.6, 1.08)
    assert -1e-9 < spline.energy / exact.energy - 1.0 < 1e-4


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        ({"start_angle": 0.0, "end_angle": None}, InvalidInputError),
        ({"start_angle": 0.0, "end_angle": 0.0, "length": 2.0}, NoSolutionError),
        ({"start_angle": 0.0, "end_angle": 0.0, "updates": 9}, InvalidInputError),
        ({"start_angle": 0.0, "end_angle": 0.0, "tolerance": 0.0}, InvalidInputError),
        ({"tangents": [0.0, 1.0]}, InvalidInputError),
        ({"tangents": [0.0] * 4, "lengths": [2.0]}, InvalidInputError),
    ],
)
def test_bad_input(arguments, error):
    with pytest.raises(error):
        numerical_elastic_spline(POINTS, **arguments)
