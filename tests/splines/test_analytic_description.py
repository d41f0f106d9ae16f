"""The analytic description: against exact elastic splines, one-piece fits and a general optimiser."""

import numpy as np
import pytest
from scipy.optimize import minimize

from batten.curves.bezier import CubicBezier
from batten.curves.bspline import BSplineCurve
from batten.curves.elastica import Elastica, states_along
from batten.curves.piecewise import PiecewiseCurve
from batten.errors import InvalidInputError
from batten.solvers.curve_samples import samples_of
from batten.solvers.elastica_fit import fit_elastica
from batten.splines.analytic_description import analytic_description, analytic_descriptions
from batten.splines.elastic_spline import elastic_spline
from batten.splines.numerical_elastic_spline import numerical_elastic_spline
from batten.splines.spline_start import interpolating_cubic

POINTS = np.array([(0.0, 0.0), (1.0, 0.6), (2.1, -0.1), (2.9, 0.3)])


def foliation(leaves, pieces, seed=0):
    """Cubic splines between two random ones."""
    rng = np.random.default_rng(seed)
    x = np.arange(pieces + 1.0)
    first, last = rng.normal(0.0, 0.3, (2, pieces + 1))
    rows = []
    for v in np.linspace(0.0, 1.0, leaves):
        y = (1.0 - v) * first + v * last + 0.1 * np.sin(3.0 * v)
        rows.append([b.control_points for b in interpolating_cubic(np.column_stack([x, y]), 0.2, -0.1).to_beziers()])
    return np.array(rows)


@pytest.fixture(scope="module")
def leaves():
    return foliation(40, 4)


@pytest.mark.parametrize("continuity", [0, 1, 2])
def test_an_exact_elastic_spline_comes_back(continuity):
    exact = elastic_spline(POINTS, 0.9, -0.2, 3.9)
    found = analytic_description(exact.curve, continuity=continuity)
    assert found.status == "converged"
    assert found.distance < 1e-9
    for mine, theirs in zip(found.pieces, exact.pieces):
        np.testing.assert_allclose(mine.parameters, theirs.parameters, atol=1e-7)


@pytest.mark.parametrize("continuity", [1, 2])
def test_a_numerical_spline_gets_its_description(continuity):
    numerical = numerical_elastic_spline(POINTS, 0.9, -0.2, updates=2)
    exact = elastic_spline(POINTS, 0.9, -0.2, numerical.design.length, design=numerical.curve)
    found = analytic_description(numerical.curve, 3, continuity)
    joints = found.curve.joints()
    assert joints.position_jumps.max() < 1e-11
    assert np.abs(joints.tangent_jumps).max() < 1e-11
    assert found.distance < 1e-3
    for mine, theirs in zip(found.pieces, exact.pieces):
        np.testing.assert_allclose(mine.point(0.5), theirs.point(0.5), atol=0.01)
    if continuity == 2:
        assert np.abs(joints.curvature_jumps).max() < 1e-9


def test_one_piece_is_the_free_fit():
    control = np.array([[0.0, 0.0], [0.3, 0.6], [0.7, 0.5], [1.0, 0.1]])
    found = analytic_description(CubicBezier(control))
    assert found.distance == pytest.approx(fit_elastica(control, nodes=24).distance, rel=1e-6)


def test_the_distance_is_that_of_dense_points(leaves):
    found = analytic_descriptions(leaves[:1], 1)
    samples = samples_of(leaves[0], nodes=64)[0]
    on = states_along(found.parameters[0], samples.fractions * found.parameters[0][:, 6:])[..., :2]
    total = (samples.weights * ((on - samples.points) ** 2).sum(axis=2)).sum()
    assert found.distance[0] == pytest.approx(np.sqrt(total / samples.lengths.sum() ** 3), rel=1e-4)


@pytest.mark.parametrize("continuity", [1, 2])
def test_no_general_optimiser_comes_nearer(continuity):
    """scipy's SLSQP, with its own differences, on two pieces, from the result and from a little beside it."""
    control = np.array([[(0, 0), (1, 0.8), (2, 0.5), (3, 0)], [(3, 0), (4, -0.5), (5, -0.9), (6.5, 0)]])
    found = analytic_descriptions(control[None], continuity)
    samples = samples_of(control, nodes=16)[0]
    scale = np.array([1.0, 1.0, 1.0, 0.3, 0.1, 0.1, 1.0])

    def pieces(z):
        return z.reshape(2, 7) * scale

    def cost(z):
        rows = pieces(z)
        on = states_along(rows, samples.fractions * rows[:, 6:])[..., :2]
        return 1e4 * (samples.weights * ((on - samples.points) ** 2).sum(axis=2)).sum()

    def jumps(z):
        rows = pieces(z)
        end = states_along(rows[:1], rows[:1, 6:])[0, 0]
        return (end - rows[1, :4])[: 2 + continuity]

    ours = (found.parameters[0] / scale).ravel()
    assert np.abs(jumps(ours)).max() < 1e-11
    for noise in (0.0, 1e-3):
        start = ours + noise * np.random.default_rng(1).normal(size=14)
        theirs = minimize(
            cost, start, constraints={"type": "eq", "fun": jumps}, method="SLSQP", options={"maxiter": 500}
        )
        assert np.abs(jumps(theirs.x)).max() < 1e-6
        assert cost(ours) <= theirs.fun * (1.0 + 1e-3)


def test_conditions_cost_distance(leaves):
    every = [analytic_descriptions(leaves, k) for k in (0, 1, 2)]
    for found in every:
        assert (found.status == 0).all()
        assert found.position_jump.max() < 1e-11
    assert max(every[1].angle_jump.max(), every[2].angle_jump.max()) < 1e-11
    assert every[2].curvature_jump.max() < 1e-9
    assert every[0].angle_jump.max() > 1e-6
    assert (every[1].distance <= every[2].distance * (1.0 + 1e-6)).all()


def test_neighbours_give_what_leaves_alone_give(leaves):
    together = analytic_descriptions(leaves, 1)
    for i in (1, 17, 39):
        alone = analytic_descriptions(leaves[i : i + 1], 1)
        assert together.distance[i] <= alone.distance[0] * (1.0 + 1e-6)
        np.testing.assert_allclose(together.parameters[i, :, :3], alone.parameters[0, :, :3], atol=1e-4)


def test_the_number_of_threads_does_not_matter():
    rows = foliation(300, 2, seed=4)
    one, two = (analytic_descriptions(rows, 2, workers=w) for w in (1, 2))
    np.testing.assert_array_equal(one.parameters, two.parameters)


def test_a_bad_leaf_spoils_no_other(leaves):
    spoilt = leaves[:6].copy()
    spoilt[2, 1, 3, 0] = np.nan
    found, good = analytic_descriptions(spoilt, 1), analytic_descriptions(leaves[:6], 1)
    assert found.status.tolist() == [0, 0, 2, 0, 0, 0]
    assert np.isnan(found.parameters[2]).all()
    np.testing.assert_allclose(found.distance[[0, 1, 3, 4, 5]], good.distance[[0, 1, 3, 4, 5]], rtol=1e-5)


def test_similar_leaves_have_similar_descriptions(leaves):
    c, s = np.cos(2.9), np.sin(2.9)  # the angles pass π on the way
    turned = 70.0 * leaves[:5] @ np.array([[c, s], [-s, c]]) + np.array([-40.0, 3000.0])
    one, other = analytic_descriptions(leaves[:5], 2), analytic_descriptions(turned, 2)
    np.testing.assert_allclose(other.distance, one.distance, rtol=1e-4)
    np.testing.assert_allclose(other.parameters[..., 6], 70.0 * one.parameters[..., 6], rtol=1e-5)
    assert np.abs(np.diff(other.parameters[..., 2], axis=1)).max() < np.pi


def test_lines_and_circles():
    line = BSplineCurve.interpolate([(0, 0), (1, 1), (2, 2), (4, 4)])
    found = analytic_description(line, 3)
    assert found.distance < 1e-12
    circle = Elastica((1.0, 0.0), 0.5 * np.pi, 1.0, (0.0, 0.0), 2.5)
    round_one = analytic_description(circle, 3, 2)
    np.testing.assert_allclose([p.start_curvature for p in round_one.pieces], 1.0, atol=1e-7)
    assert round_one.distance < 1e-9


def test_pieces_with_different_numbers_of_cubics():
    uneven = PiecewiseCurve([CubicBezier(b) for b in foliation(1, 3)[0]])
    found = analytic_description(uneven, 2)
    samples = samples_of(uneven, nodes=48)[0]
    assert found.status == "converged"
    total = sum(p.length for p in found.pieces)
    assert total == pytest.approx(float(samples.lengths[0]), rel=0.01)


@pytest.mark.parametrize("continuity", [1, 2])
def test_many_pieces_of_strong_bends_are_joined(continuity):
    found = analytic_descriptions(foliation(3, 12, seed=2), continuity)
    assert (found.status == 0).all()


def test_bad_input():
    with pytest.raises(InvalidInputError, match="curve"):
        analytic_description("spline")
    with pytest.raises(InvalidInputError, match="whole number"):
        analytic_description(CubicBezier([(0, 0), (1, 0), (2, 0), (3, 0)]), 0)
    with pytest.raises(InvalidInputError, match="continuity"):
        analytic_descriptions(foliation(1, 2), 3)
    with pytest.raises(InvalidInputError, match="shape"):
        analytic_descriptions(np.zeros((3, 4, 2)))
    with pytest.raises(InvalidInputError, match="no length"):
        analytic_description(CubicBezier([(0, 0), (0, 0), (0, 0), (0, 0)]))


def sharp(seed, pieces, size):
    """A cubic spline through points that go up and down at random, by `size` from one to the next."""
    rng = np.random.default_rng(seed)
    n = pieces + 1
    points = np.column_stack([np.arange(n) + rng.normal(0.0, 0.15, n), rng.normal(0.0, size, n)])
    return np.array([b.control_points for b in interpolating_cubic(points, None, None).to_beziers()])


def check_joined(found, continuity):
    assert (found.status == 0).all()
    assert found.angle_jump.max() < 1e-9
    assert found.position_jump.max() < 1e-9
    if continuity == 2:
        pieces = found.parameters.shape[1]
        assert found.curvature_jump.max() < 1e-9 * pieces


@pytest.mark.parametrize("continuity", [1, 2])
def test_sharp_splines_are_joined(continuity):
    """13 and 19 of these 100 were left apart by the first way alone."""
    splines = np.array([sharp(seed, 5, 0.6) for seed in range(100)])
    found = analytic_descriptions(splines, continuity)
    check_joined(found, continuity)
    assert np.median(found.angle_jump) < 1e-11
    assert np.isfinite(found.parameters).all()
    # None is far: at worst by as much as points alone and their first guesses are.
    loose = analytic_descriptions(splines, 0)
    assert np.median(found.distance / loose.distance) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("continuity", [1, 2])
def test_hundreds_of_sharp_pieces_are_joined(continuity):
    for seed in range(3):
        found = analytic_descriptions(sharp(seed, 500, 0.6)[None], continuity)
        check_joined(found, continuity)
        assert found.distance[0] < 1e-4
