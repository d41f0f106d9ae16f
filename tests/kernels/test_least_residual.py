"""The λ-residual as a function of lengths and directions: its derivatives, and the table of its least."""

import math

import numpy as np
import pytest

from batten.kernels.least_residual import AT_X, AT_Y, LEAST, least_tables, residual, workspace
from batten.kernels.quadrature import panel_condition
from batten.measures.lambda_residual import lambda_residual

FINE, ROUGH = panel_condition(1e-10), panel_condition(1e-2)


def curve(theta1, theta2, x, y, chord=1.0):
    l1, l2 = np.exp(x), np.exp(y)
    zero = np.zeros(np.broadcast(theta1, theta2, x, y).shape)
    rows = [
        (zero, zero),
        (l1 * np.cos(theta1) + zero, l1 * np.sin(theta1) + zero),
        (chord + l2 * np.cos(theta2) + zero, l2 * np.sin(theta2) + zero),
        (chord + zero, zero),
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def shape(theta1, theta2, chord=1.0):
    return np.array([math.cos(theta1), math.sin(theta1), math.cos(theta2), math.sin(theta2), chord])


@pytest.mark.parametrize("chord", [1.0, 0.0])
def test_value_and_derivatives(chord):
    rng = np.random.default_rng(1)
    work = workspace()
    for _ in range(30):
        at = np.concatenate([rng.uniform(0.3, 2.8, 2), rng.uniform(-1.0, 1.0, 2)])
        found = residual(shape(at[0], at[1], chord), at[2], at[3], FINE, True, work)
        assert found[0] == pytest.approx(float(lambda_residual(curve(*at, chord), tolerance=1e-10)), abs=1e-9)
        if found[0] > 0.98:
            continue
        h = 1e-4
        for k, slope in enumerate((found[3], found[4], found[1], found[2])):
            steps = np.zeros((4, 4))
            steps[:, k] = (-2 * h, -h, h, 2 * h)
            e = lambda_residual(np.stack([curve(*(at + step), chord) for step in steps]), tolerance=1e-10)
            assert slope == pytest.approx((e[0] - 8 * e[1] + 8 * e[2] - e[3]) / (12 * h), abs=2e-5)


def test_tables_hold_the_least_of_all_lengths():
    n = 12
    table, loops = np.empty((n, n, 3)), np.empty((n, 3))
    least_tables(table, loops, ROUGH, FINE)
    assert np.isfinite(table).all()
    angle = 2.0 * math.pi * (np.arange(n) + 0.5) / n
    grid = np.linspace(math.log(0.1), math.log(6.0), 50)
    for i in range(n):
        for j in range(n):
            row = table[i, j]
            # Entries that come from a mirror image or a reversed curve belong to these directions.
            e = float(lambda_residual(curve(angle[i], angle[j], row[AT_X], row[AT_Y])))
            assert row[LEAST] == pytest.approx(e, abs=1e-4)
            assert row[LEAST] <= lambda_residual(curve(angle[i], angle[j], grid[:, None], grid)).min() + 2e-3
    for i in range(n):
        row = loops[i]
        e = lambda_residual(curve(angle[i] / 2, -angle[i] / 2, grid, -grid, 0.0))
        assert row[LEAST] <= e.min() + 2e-3
