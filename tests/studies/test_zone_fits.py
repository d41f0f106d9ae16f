"""Fits in Π: the papers' bounds hold, distances are the measures', and more starts find nothing nearer."""

import numpy as np
import pytest

from batten.curves.bezier import CubicBezier
from batten.curves.elastica import Elastica
from batten.measures.distance import h1_distance, l2_distance
from batten.measures.lambda_residual import lambda_residual
from batten.solvers.bezier_criteria import is_elastica_like
from batten.solvers.curve_samples import samples_of
from batten.solvers.elastica_fit import fit_elastica_batch, fit_samples
from batten.studies.study import run
from batten.studies.zone import zone_beziers
from batten.studies.zone_fits import NORMS, PAPER_BOUNDS, STUDY, columns, lines, nearest_elastica


@pytest.fixture(scope="module")
def outcome():
    return run(STUDY, 400, seed=9)


@pytest.fixture(scope="module")
def control(outcome):
    rows = np.zeros((outcome.size, 4, 2))
    rows[:, 3, 0] = 1.0
    rows[:, 1:3] = outcome.results.inner
    return rows


def test_the_papers_bounds(outcome, control):
    assert is_elastica_like(control).all()
    assert np.array_equal(outcome.results.residual, lambda_residual(control))
    most = outcome.results.distances.max(axis=0)
    assert (most <= PAPER_BOUNDS).all()
    # A sample of 38,826 has the means 0.0011 and 0.0201.
    error = outcome.results.distances.std(axis=0) / np.sqrt(outcome.size)
    assert (np.abs(outcome.results.distances.mean(axis=0) - [0.0011, 0.0201]) < 4.0 * error).all()


def test_distances_are_those_of_the_elastica_that_are_kept(outcome, control):
    for i in range(0, 400, 40):
        curve = CubicBezier(control[i])
        for j, measure in enumerate((l2_distance, h1_distance)):
            elastica = Elastica.from_parameters(outcome.results.elastica[i, j])
            assert measure(curve, elastica) == pytest.approx(outcome.results.distances[i, j], rel=1e-6, abs=1e-9)


def test_nothing_nearer_from_more_starts(outcome, control):
    """Thirteen starts of other shapes, and starts scattered about what was found, for each norm."""
    rng = np.random.default_rng(3)
    some = slice(0, 40)
    for j, norm in enumerate(NORMS):
        best = fit_elastica_batch(control[some], metric=norm, starts=13).distance
        for scatter in (0.3, 1.0, 3.0):
            given = outcome.results.elastica[some, j].copy()
            given[:, 2:6] += scatter * rng.standard_normal((40, 4))
            again = fit_samples(samples_of(control[some])[0], metric=norm, starts=1, given=given)
            best = np.fmin(best, again.distance)
        assert (outcome.results.distances[some, j] <= best + 1e-8).all()


@pytest.mark.slow
def test_nothing_nearer_from_more_starts_for_2000_curves():
    control = zone_beziers(2000, np.random.default_rng(12))
    few, many = nearest_elastica(control)[0], nearest_elastica(control, starts=13)[0]
    assert (few <= many + 1e-7).all()


def test_norms_are_in_order(outcome):
    """H¹ ≥ L² at any elastica, so the least are in order too; each elastica is farther in the other norm."""
    l2, h1 = outcome.results.distances.T
    assert (h1 >= l2).all()


def test_what_is_printed(outcome):
    text = lines(outcome)
    assert max(map(len, text)) <= 120
    for name, most in zip(NORMS, outcome.results.distances.max(axis=0)):
        assert any(line.startswith(name) and f"{most:.5f}" in line for line in text)
    table = columns(outcome.results)
    assert len(table) == 5 + 2 * 8
    assert np.array_equal(table["h1_length"], outcome.results.elastica[:, 1, 6])
    assert lines(run(STUDY, 1))[0].startswith("1 Bézier")
