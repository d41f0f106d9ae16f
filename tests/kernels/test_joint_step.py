"""The step of the joined fit against a dense system, its conditions against differences."""

import numpy as np

from batten.curves.elastica import states_at
from batten.kernels.elastica_fit import force_form, sample_middle
from batten.kernels.joint_step import end_conditions, joint_step


def state(mid, fraction):
    kappa, fx, fy = force_form(mid)
    return states_at(np.array([mid[0], mid[1], mid[2], kappa, fx, fy, mid[6]]), (fraction - 0.5) * mid[6])


def test_end_conditions_and_their_slopes():
    mid = np.array([0.3, -0.2, 0.7, 0.9, -4.0, 3.0, 1.3])
    fractions = np.array([0.0, 1.0])
    values, jac, s = np.empty((2, 4)), np.empty((2, 3, 7)), np.empty(2)
    sample_middle(mid, fractions, s, values, jac)
    for row in (0, 1):
        out, rows = np.empty(4), np.empty((4, 7))
        end_conditions(mid, values, jac, row, 4, out, rows)
        np.testing.assert_allclose(out, state(mid, fractions[row]), atol=1e-12)
        for a in range(7):
            step = np.zeros(7)
            step[a] = 1e-6
            slope = (state(mid + step, fractions[row]) - state(mid - step, fractions[row])) / 2e-6
            np.testing.assert_allclose(rows[:, a], slope, atol=1e-7)


def test_the_step_solves_the_whole_system():
    rng = np.random.default_rng(2)
    for c, k in ((1, 3), (2, 3), (5, 4), (7, 3)):
        roots = rng.normal(size=(c, 9, 7))
        models = np.einsum("cia,cib->cab", roots, roots)
        grads, slopes, jumps = rng.normal(size=(c, 7)), np.zeros((c, 2, 4, 7)), np.zeros((max(c - 1, 1), 4))
        slopes[:, :, :k], jumps[: c - 1, :k] = rng.normal(size=(c, 2, k, 7)), rng.normal(size=(c - 1, k))
        steps, nu = np.zeros((c, 7)), np.zeros((max(c - 1, 1), 4))
        decrease = joint_step(grads, models, slopes, jumps, k, 0.0, 0.0, steps, nu)
        size, held = 7 * c, k * (c - 1)
        system = np.zeros((size + held, size + held))
        for i in range(c):
            system[7 * i : 7 * i + 7, 7 * i : 7 * i + 7] = models[i]
        for j in range(c - 1):
            at = slice(size + k * j, size + k * j + k)
            system[at, 7 * j : 7 * j + 7] = slopes[j, 1, :k]
            system[at, 7 * j + 7 : 7 * j + 14] = -slopes[j + 1, 0, :k]
        system[:size, size:] = system[size:, :size].T
        right = np.concatenate([-grads.ravel(), -jumps[: c - 1, :k].ravel()])
        answer = np.linalg.solve(system, right)
        np.testing.assert_allclose(steps.ravel(), answer[:size], rtol=1e-7, atol=1e-8)
        np.testing.assert_allclose(nu[: c - 1, :k].ravel(), answer[size:], rtol=1e-7, atol=1e-8)
        dense = system[:size, :size]
        assert np.isclose(decrease, -(grads.ravel() @ answer[:size] + 0.5 * answer[:size] @ dense @ answer[:size]))


def test_jumps_of_curvature_that_yield_are_weighed():
    rng = np.random.default_rng(4)
    c, yielding = 5, 0.3
    roots = rng.normal(size=(c, 9, 7))
    models = np.einsum("cia,cib->cab", roots, roots)
    grads, slopes, jumps = rng.normal(size=(c, 7)), rng.normal(size=(c, 2, 4, 7)), rng.normal(size=(c - 1, 4))
    steps, nu = np.zeros((c, 7)), np.zeros((c - 1, 4))
    joint_step(grads, models, slopes, jumps, 4, 0.0, yielding, steps, nu)
    after = (
        jumps + np.einsum("jka,ja->jk", slopes[:-1, 1], steps[:-1]) - np.einsum("jka,ja->jk", slopes[1:, 0], steps[1:])
    )
    np.testing.assert_allclose(after[:, :3], 0.0, atol=1e-9)

    def model(x):
        left = jumps + np.einsum("jka,ja->jk", slopes[:-1, 1], x[:-1]) - np.einsum("jka,ja->jk", slopes[1:, 0], x[1:])
        return (grads * x).sum() + 0.5 * np.einsum("ca,cab,cb", x, models, x) + 0.5 * (left[:, 3] ** 2).sum() / yielding

    # No way that keeps the conditions leads down from there.
    rows = np.zeros((3 * (c - 1), 7 * c))
    for j in range(c - 1):
        rows[3 * j : 3 * j + 3, 7 * j : 7 * j + 7] = slopes[j, 1, :3]
        rows[3 * j : 3 * j + 3, 7 * j + 7 : 7 * j + 14] = -slopes[j + 1, 0, :3]
    for way in np.linalg.svd(rows)[2][3 * (c - 1) :]:
        move = 1e-3 * way.reshape(c, 7)
        assert min(model(steps + move), model(steps - move)) > model(steps)
