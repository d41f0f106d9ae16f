"""The equations of a run: their band matrix, Newton's method, and following."""

import numpy as np
import pytest

from batten.splines.knot_equations import KnotEquations
from batten.splines.knot_types import Run, read_knots, runs

POINTS = np.array([[0.0, 0.0], [1.0, 0.6], [2.2, 0.2], [3.0, 1.0], [4.0, 0.8], [4.5, -0.5], [3.0, -2.0], [1.0, -1.5]])


def _equations(types: str, index: int = 0) -> KnotEquations:
    path = read_knots(POINTS[: len(types) - types.endswith("z")], types)
    run: Run = runs(path)[index]
    knots = path.knots if not path.closed else np.vstack([path.knots, path.knots[:1]])
    steps = np.diff(knots, axis=0)[run.segments]
    direction = np.arctan2(steps[:, 1], steps[:, 0])
    chords = np.hypot(*steps.T)
    if run.closed:
        turns = direction - np.roll(direction, 1)
    else:
        line = run.boundaries
        first = direction[0] - run.directions[0] if line[0] == "line" else 0.0
        last = run.directions[1] - direction[-1] if line[1] == "line" else 0.0
        turns = np.concatenate([[first], np.diff(direction), [last]])
    return KnotEquations(run, chords, (turns + np.pi) % (2.0 * np.pi) - np.pi)


@pytest.mark.parametrize(
    ("types", "index"),
    [
        ("{oooooo}", 0),
        ("oooooooo" + "z", 0),
        ("ooocccoz", 0),
        ("cc[cc]oo" + "z", 0),
        ("ooz", 0),
        ("{o[]cah}", 1),
        ("oooz", 0),
    ],
)
def test_the_band_matrix_is_that_of_the_equations(types, index):
    """Its solution against differences of the residuals; closed runs are folded."""
    equations = _equations(types, index)
    n = equations.unknowns
    x = np.random.default_rng(1).normal(0.0, 0.5, n)
    state = equations.state(x, equations.constant)
    solve = equations.factors(state)
    h = 1e-6
    columns = [
        (equations.state(x + h * e, equations.constant).miss - equations.state(x - h * e, equations.constant).miss)
        / (2 * h)
        for e in np.eye(n)
    ]
    np.testing.assert_allclose(solve(np.stack(columns, axis=1)), np.eye(n), atol=1e-6)
    assert equations._lower <= 7
    assert equations._upper <= 7


@pytest.mark.parametrize("types", ["{oooo}", "oooccooo" + "z", "{ooo[]o}"])
def test_newton_and_following_lead_to_the_same_place(types):
    equations = _equations(types)
    zero, whole = np.zeros(equations.unknowns), equations.constant
    state = equations.newton(zero, whole)
    followed = equations.follow(zero, 0.0 * whole, whole)
    assert equations.meets(state)
    assert equations.residual(state.ends) < 1e-12
    np.testing.assert_allclose(followed.x, state.x, atol=1e-9)
    wandered = equations.wander(zero, whole, 1.0)
    np.testing.assert_allclose(wandered.x, state.x, atol=1e-9)
    assert not equations.windings(state.ends).any()


def test_the_last_steps_are_quadratic():
    """With exact derivatives the digits double."""
    equations = _equations("{oooooo}")
    state = equations.newton(np.zeros(equations.unknowns), equations.constant)
    x = state.x + 1e-4 * np.random.default_rng(0).normal(size=equations.unknowns)
    misses = []
    for _ in range(3):
        here = equations.state(x, equations.constant)
        misses.append(np.abs(here.miss).max())
        x = x - equations.factors(here)(here.miss)
    assert misses[1] < 10.0 * misses[0] ** 2
    assert misses[2] < 1e-13


def test_where_there_is_no_solution_nothing_is_returned():
    """A fold of the solutions at 0.77 of the turning angles."""
    equations = _equations("{o[]}")
    zero, whole = np.zeros(equations.unknowns), equations.constant
    assert equations.newton(zero, whole) is None
    assert equations.follow(zero, 0.0 * whole, whole) is None
    assert equations.newton(zero, 0.7 * whole) is not None
