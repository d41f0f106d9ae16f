"""The Ipopt reference on curves whose answer is known, and at points where the optimum can be checked from outside."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from batten.errors import BattenError, InvalidInputError
from batten.solvers.curve_samples import CurveSamples, samples_of

pytest.importorskip("casadi")
from batten.solvers.elastica_fit_ipopt import fit_elastica_ipopt

ARCH = np.array([[0.0, 0.0], [0.2, 0.9], [1.1, 0.8], [1.0, 0.1]])


def _integrated(parameters, fractions):
    """(x, y, θ) at the fractions, shape (n, 3): the differential equation by scipy."""
    x, y, angle, curvature, force_x, force_y, length = parameters

    def rate(_, state):
        kappa = curvature + (state[0] - x) * force_y - (state[1] - y) * force_x
        return [np.cos(state[2]), np.sin(state[2]), kappa]

    solution = solve_ivp(
        rate, (0, length), [x, y, angle], method="DOP853", rtol=1e-13, atol=1e-13 * length, dense_output=True
    )
    return solution.sol(np.asarray(fractions) * length).T


def _samples_of_elastica(parameters, n=24):
    nodes, weights = np.polynomial.legendre.leggauss(n)
    fractions = (nodes + 1) / 2
    states = _integrated(parameters, [0.0, *fractions, 1.0])
    length = parameters[6]
    return CurveSamples(
        points=states[None, 1:-1, :2],
        angles=states[None, 1:-1, 2],
        curvatures=np.full((1, n), np.nan),  # not for the fit's eyes
        weights=weights[None] * length / 2,
        fractions=fractions[None],
        lengths=np.array([length]),
        ends=states[None, [0, -1], :],
    )


def _squared_distance(parameters, samples, metric):
    states = _integrated(parameters, samples.fractions[0])
    error = ((states[:, :2] - samples.points[0]) ** 2).sum(axis=1) / samples.lengths[0] ** 3
    if metric == "H1":
        error += (states[:, 2] - samples.angles[0]) ** 2 / samples.lengths[0]
    return samples.weights[0] @ error


@pytest.mark.parametrize("metric", ["L2", "H1"])
@pytest.mark.parametrize(
    "parameters",
    [
        [0.3, -0.2, 0.4, 2.0, 3.0, -5.0, 1.7],  # with an inflection
        [2.0, 1.0, -1.0, 9.0, 6.0, 4.0, 1.2],  # without
        [-20.0, 5.0, 2.9, -0.05, 0.002, 0.001, 60.0],  # large
        [0.0, 0.0, 0.1, 1.5, 0.0, 0.0, 2.0],  # a circle
        [0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 2.0],  # a line
    ],
)
def test_an_elastica_is_its_own_best_fit(parameters, metric):
    samples = _samples_of_elastica(parameters)
    length = parameters[6]
    start = np.array(parameters) + np.array([0.03, -0.02, 0.05, 0.2, 0.3, -0.3, 0.04]) * (
        length,
        length,
        1,
        1 / length,
        1 / length**2,
        1 / length**2,
        length,
    )
    fit = fit_elastica_ipopt(samples, start, metric=metric)
    assert fit.distance < 1e-8
    found = _integrated(fit.parameters, samples.fractions[0])
    np.testing.assert_allclose(found[:, :2], samples.points[0], atol=2e-8 * length, rtol=0)
    assert fit.parameters[6] == pytest.approx(length, rel=1e-7)


@pytest.mark.parametrize(("metric", "ends"), [("L2", "free"), ("H1", "free"), ("L2", "points"), ("H1", "tangents")])
def test_the_distance_is_what_integration_says_and_no_neighbour_is_closer(metric, ends):
    samples, _ = samples_of(ARCH, nodes=24)
    start = [0.0, 0.0, 1.3, -1.5, 0.0, 0.0, samples.lengths[0]]
    fit = fit_elastica_ipopt(samples, start, metric=metric, ends=ends)
    assert fit.status == "Solve_Succeeded"
    best = _squared_distance(fit.parameters, samples, metric)
    assert np.sqrt(best) == pytest.approx(fit.distance, rel=1e-9)
    tips = _integrated(fit.parameters, [0.0, 1.0])
    held = {"free": 0, "points": 2, "tangents": 3}[ends]
    np.testing.assert_allclose(tips[:, :held], samples.ends[0][:, :held], atol=1e-10)
    assert fit.violation < 1e-10

    # In the directions that keep the held coordinates to first order, the distance has no slope.
    step = 1e-4
    moves = np.eye(7) * step
    tip_rows = [
        (_integrated(fit.parameters + m, [0.0, 1.0]) - _integrated(fit.parameters - m, [0.0, 1.0]))[:, :held].ravel()
        for m in moves
    ]
    _, singular, basis = np.linalg.svd(np.array(tip_rows).reshape(7, -1).T / (2 * step), full_matrices=True)
    free = basis[np.count_nonzero(singular > 1e-9) :]
    assert len(free) == 7 - 2 * held
    for direction in free:
        ahead, back = (_squared_distance(fit.parameters + s * step * direction, samples, metric) for s in (1, -1))
        assert abs(ahead - back) / (2 * step) < 1e-6 * np.sqrt(best)
        if held == 0:  # nor does it fall off
            assert ahead + back > 2 * best


def test_more_freedom_comes_closer():
    samples, _ = samples_of(ARCH, nodes=24)
    start = [0.0, 0.0, 1.3, -1.5, 0.0, 0.0, samples.lengths[0]]
    free, points, tangents = (
        fit_elastica_ipopt(samples, start, ends=e).distance for e in ("free", "points", "tangents")
    )
    assert free < points < tangents < 0.05


def test_the_answer_does_not_depend_on_unit_or_place():
    one, _ = samples_of(ARCH, nodes=24)
    other, _ = samples_of(1000 * ARCH + [5e4, -7e3], nodes=24)
    first = fit_elastica_ipopt(one, [0, 0, 1.3, -1.5, 0, 0, 2.0], ends="points")
    second = fit_elastica_ipopt(other, [5e4, -7e3, 1.3, -1.5e-3, 0, 0, 2e3], ends="points")
    assert second.distance == pytest.approx(first.distance, rel=1e-9)
    units = np.array([1e3, 1e3, 1, 1e-3, 1e-6, 1e-6, 1e3])
    np.testing.assert_allclose(
        second.parameters - [5e4, -7e3, 0, 0, 0, 0, 0], first.parameters * units, rtol=1e-6, atol=1e-9
    )


def test_bad_input_is_refused():
    samples, _ = samples_of(ARCH)
    with pytest.raises(InvalidInputError, match="metric"):
        fit_elastica_ipopt(samples, np.ones(7), metric="L1")
    with pytest.raises(InvalidInputError, match="one curve"):
        fit_elastica_ipopt(samples_of(np.stack([ARCH, ARCH]))[0], np.ones(7))
    with pytest.raises(InvalidInputError, match="finite"):
        fit_elastica_ipopt(samples, [0, 0, 0, np.nan, 0, 0, 1])


def test_without_casadi_the_message_says_what_to_install(monkeypatch):
    samples, _ = samples_of(ARCH, nodes=11)  # a size that no other test has cached
    monkeypatch.setitem(sys.modules, "casadi", None)
    from batten.solvers import elastica_fit_ipopt as module

    module._move.cache_clear()
    with pytest.raises(BattenError, match=r"batten\[verify\]"):
        fit_elastica_ipopt(samples, [0, 0, 1.3, -1.5, 0, 0, 2.0])
