"""The program of a chain's step against the same one written out in full."""

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.sparse import csr_matrix

from batten.splines.chain_program import least_offset


def problem(seed, n=4, m=30, equations=5, jumps=3):
    rng = np.random.default_rng(seed)
    u = np.linspace(0.0, 1.0, m)
    offsets = np.sin(9.0 * u + rng.normal(size=(n, 1))) * rng.uniform(0.3, 1.0, (n, 1))
    response = np.stack([np.cos((k + 1) * u) * rng.normal(size=(n, 1)) for k in range(7)], axis=2)
    a, j = rng.normal(size=(equations, 7 * n)), rng.normal(size=(jumps, 7 * n))
    return response, offsets, a, 0.02 * rng.normal(size=equations), j, 0.1 * rng.normal(size=jumps)


def in_full(response, offsets, a, gaps, j, torn, weight, reach):
    n, m = offsets.shape
    g = np.zeros((n * m, 7 * n))
    for i in range(n):
        g[i * m : (i + 1) * m, 7 * i : 7 * i + 7] = response[i]
    zero, one = np.zeros, np.ones
    rows = [np.hstack([s * g, -one((n * m, 1)), zero((n * m, 1))]) for s in (1, -1)]
    rows += [np.hstack([s * j, zero((len(torn), 1)), -one((len(torn), 1))]) for s in (1, -1)]
    o = offsets.ravel()
    found = linprog(
        np.append(zero(7 * n), [1.0, weight]),
        A_ub=np.vstack(rows),
        b_ub=np.concatenate([-o, o, -torn, torn]),
        A_eq=np.hstack([a, zero((len(a), 2))]),
        b_eq=-gaps,
        bounds=[(-reach, reach)] * (7 * n) + [(0, None)] * 2,
    )
    return found.fun


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("jumps", [0, 3])
def test_the_value_is_that_of_the_whole_program(seed, jumps):
    response, offsets, a, gaps, j, torn = problem(seed, jumps=jumps)
    step, value = least_offset(response, offsets, csr_matrix(a), gaps, csr_matrix(j), torn, 10.0, 0.3)
    assert np.abs(step).max() <= 0.3 + 1e-9
    np.testing.assert_allclose(a @ step.ravel(), -gaps, atol=1e-7)
    reached = np.abs(offsets + np.einsum("nmi,ni->nm", response, step)).max()
    reached += 10.0 * np.abs(torn + j @ step.ravel()).max() if jumps else 0.0
    best = in_full(response, offsets, a, gaps, j, torn, 10.0, 0.3)
    assert value >= reached - 1e-7
    assert best - 1e-7 <= value <= best + 1.1e-3


def test_equations_out_of_reach_have_no_step():
    response, offsets, a, gaps, j, torn = problem(0, jumps=0)
    step, value = least_offset(response, offsets, csr_matrix(a), gaps + 1e3, csr_matrix(j), torn, 10.0, 0.3)
    assert step is None
    assert value == np.inf
