"""The inverse of a piecewise polynomial arc length, against one in closed form."""

import numpy as np
import pytest
from numpy.polynomial import legendre

from batten.kernels.arc_length import parameters_batch

EDGES = np.array([0.0, 0.25, 0.25, 1.0])  # one panel without extent


def panels(powers):
    """Lengths at the edges and both series for the arc length Σ powers[i] t^i."""
    coefficients, slopes = np.zeros((3, 25)), np.zeros((3, 24))
    for k in range(3):
        half, middle = 0.5 * (EDGES[k + 1] - EDGES[k]), 0.5 * (EDGES[k + 1] + EDGES[k])
        local = np.polynomial.Polynomial(powers)(np.polynomial.Polynomial([middle, half]))
        local -= local(-1.0)
        row = legendre.poly2leg(local.coef)
        coefficients[k, : len(row)] = row
        slope = legendre.poly2leg(local.deriv().coef)
        slopes[k, : len(slope)] = slope
    return np.polynomial.Polynomial(powers)(EDGES), coefficients, slopes


@pytest.mark.parametrize("powers", [(0.0, 1.0), (0.0, 0.5, 2.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.0, 1.0)])
def test_every_arc_length_is_met(powers):
    lengths, coefficients, slopes = panels(powers)
    t = np.linspace(0.0, 1.0, 101)
    goals, out = np.polynomial.Polynomial(powers)(t), np.empty(101)
    parameters_batch(goals, EDGES, lengths, coefficients, slopes, out)
    np.testing.assert_allclose(np.polynomial.Polynomial(powers)(out), goals, atol=2e-15)
    if powers[1] > 0.0:
        np.testing.assert_allclose(out, t, atol=4e-15)


def test_what_is_not_finite_stays_by_itself():
    lengths, coefficients, slopes = panels((0.0, 1.0))
    out = np.empty(3)
    parameters_batch(np.array([np.nan, 0.5, np.inf]), EDGES, lengths, coefficients, slopes, out)
    assert np.isnan(out[[0, 2]]).all()
    assert out[1] == pytest.approx(0.5, abs=1e-15)
