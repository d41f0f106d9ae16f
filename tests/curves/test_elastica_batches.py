"""Many elastica at once, against direct integration of the curvature, which is affine in position (Brander2016 eq. 5)."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from batten.curves.elastica import points_batch, states_along, states_at
from batten.errors import InvalidInputError


def integrated(parameters, s):
    """(x, y, θ, κ) at the arc lengths s, (m,), of one elastica, by a Runge–Kutta method of order 8."""
    x0, y0, theta, kappa, fx, fy, _ = parameters

    def bend(x, y):
        return kappa + (x - x0) * fy - (y - y0) * fx

    def slope(_, state):
        return [np.cos(state[2]), np.sin(state[2]), bend(state[0], state[1])]

    rows = []
    for end in s:
        found = solve_ivp(slope, (0.0, end), [x0, y0, theta], method="DOP853", rtol=1e-12, atol=1e-12)
        x, y, angle = found.y[:, -1]
        rows.append([x, y, angle, bend(x, y)])
    return np.array(rows)


def curves():
    rng = np.random.default_rng(7)
    parameters = rng.normal(size=(2, 3, 7))
    parameters[0, 0, 3:6] = 0.0  # a line
    parameters[1, 2, 4:6] = 0.0  # a circle
    parameters[..., 6] = rng.uniform(0.5, 2.0, (2, 3))
    return parameters, rng.uniform(-1.0, 3.0, (2, 3, 4))


def test_states_along_many_curves():
    parameters, s = curves()
    states = states_along(parameters, s)
    assert states.shape == (2, 3, 4, 4)
    for index in np.ndindex(2, 3):
        assert states[index] == pytest.approx(integrated(parameters[index], s[index]), abs=1e-9)


def test_one_arc_length_each_and_common_ones():
    parameters, s = curves()
    for index in np.ndindex(2, 3):
        own = integrated(parameters[index], [s[index][0], 0.25])
        assert states_at(parameters, s[..., 0])[index] == pytest.approx(own[0], abs=1e-9)
        assert states_along(parameters, [0.25])[index][0] == pytest.approx(own[1], abs=1e-9)


def test_points_at_fractions_of_the_length():
    parameters, _ = curves()
    points = points_batch(parameters, [0.0, 0.3, 1.0])
    for index in np.ndindex(2, 3):
        wanted = integrated(parameters[index], parameters[index][6] * np.array([0.0, 0.3, 1.0]))
        assert points[index] == pytest.approx(wanted[:, :2], abs=1e-9)


def test_a_bad_row_spoils_no_other():
    parameters, s = curves()
    good = states_along(parameters, s)
    parameters[0, 1, 4] = np.nan
    s[1, 0, 2] = np.inf
    states = states_along(parameters, s)
    bad = np.isnan(states).any(axis=-1)
    assert bad[0, 1].all()
    assert bad[1, 0].tolist() == [False, False, True, False]
    assert bad.sum() == 5
    assert np.array_equal(states[~bad], good[~bad])
    assert np.isnan(points_batch(parameters, [0.5])[0, 1]).all()


def test_shapes():
    assert states_along(np.empty((0, 7)), np.empty((0, 3))).shape == (0, 3, 4)
    assert states_at(np.empty((0, 7)), np.empty(0)).shape == (0, 4)
    assert states_at(np.ones(7), 0.5).shape == (4,)
    with pytest.raises(InvalidInputError, match=r"\(…, 7\)"):
        states_along(np.ones(6), [0.5])
