"""Pieces between joints: energy and its derivatives against quadrature and differences, descents against a general one."""

import numpy as np
import pytest
from scipy.optimize import minimize

from batten.curves.elastica import Elastica
from batten.solvers.boundary_value import solve_boundary
from batten.splines.joint_descent import RodPieces, descend, freedom

POINTS = np.array([(0.0, 0.0), (0.3, 0.2), (0.6, -0.05), (0.9, 0.1)])
ANGLES = np.array([0.9, 0.0, 0.2, 0.3])
LENGTHS = np.array([0.4, 0.45, 0.42])
INNER = np.array([False, True, True, False])


@pytest.fixture(scope="module")
def pieces():
    rows = [
        next(s for s in solve_boundary(POINTS[i], ANGLES[i], POINTS[i + 1], ANGLES[i + 1], LENGTHS[i]) if s.stable)
        for i in range(3)
    ]
    found, good = RodPieces.of(POINTS, ANGLES, np.array([s.elastica.parameters for s in rows])).corrected()
    assert good.all()
    return found


def test_energy_is_half_of_the_bending_energies(pieces):
    energies = [Elastica.from_parameters(row).bending_energy() for row in pieces.parameters]
    assert pieces.energy == pytest.approx(0.5 * sum(energies), rel=1e-12)


def test_derivatives_are_slopes(pieces):
    h = 1e-5
    gradient, hessian = pieces.gradient, pieces.hessian()
    for k in range(7):
        step = np.zeros(7)
        step[k] = h
        up, down = (pieces.moved(ANGLES + s[:4], LENGTHS + s[4:])[0] for s in (step, -step))
        assert (up.energy - down.energy) / (2 * h) == pytest.approx(gradient[k], rel=1e-6, abs=1e-6)
        np.testing.assert_allclose(
            (up.gradient - down.gradient) / (2 * h), hessian[k], atol=1e-5 * np.abs(hessian).max()
        )


@pytest.mark.parametrize(("rule", "count"), [("held", 2), ("total", 4), ("free", 5)])
def test_directions_keep_what_is_held(rule, count):
    directions = freedom(INNER, rule, np.array([0.1, 0.3, 0.2]))
    assert directions.shape == (7, count)
    assert np.linalg.matrix_rank(directions) == count
    assert np.abs(directions[[0, 3]]).max() == 0.0
    if rule != "free":
        np.testing.assert_allclose(directions[4:].sum(axis=0), 0.0, atol=1e-15)


@pytest.mark.parametrize("rule", ["held", "total", "free"])
def test_a_descent_ends_where_a_general_one_does(pieces, rule):
    rest = descend(pieces, INNER, rule)
    assert rest.status == "converged"
    assert rest.gradient < 1e-9
    assert rest.curvature > 0.0
    directions = freedom(INNER, rule, LENGTHS - np.hypot(*np.diff(POINTS, axis=0).T))
    begin = np.concatenate([rest.pieces.angles, rest.pieces.lengths])

    def energy(z):
        moved = begin + directions @ z
        trial, good = rest.pieces.moved(moved[:4], moved[4:])
        return trial.energy if good.all() else np.inf

    rng = np.random.default_rng(0)
    found = minimize(
        energy, 0.05 * rng.normal(size=directions.shape[1]), method="Nelder-Mead", options={"maxiter": 4000}
    )
    assert found.fun == pytest.approx(rest.pieces.energy, rel=1e-6)
    assert found.fun > rest.pieces.energy * (1.0 - 1e-10)


def test_nothing_free_is_at_rest(pieces):
    rest = descend(pieces, np.zeros(4, dtype=bool), "held")
    assert rest.iterations == 0
    assert rest.curvature == np.inf


def test_a_piece_that_is_let_go_falls_to_a_stable_shape():
    unstable = next(s for s in solve_boundary((0, 0), 0.1, (0.8, 0), 0.1, 1.0, max_inflections=4) if not s.stable)
    ends = np.array([(0.0, 0.0), (0.8, 0.0)])
    rod, good = RodPieces.of(ends, np.array([0.1, 0.1]), unstable.elastica.parameters[None]).corrected()
    assert good.all()
    fallen, good = rod.snapped(0).corrected()
    assert good.all()
    assert fallen.energy < rod.energy * (1.0 - 1e-3)
