"""Energies of quintic elements: against scipy's integrals of another evaluation, derivatives by differences."""

import numpy as np
import pytest
from scipy.integrate import quad

from batten.curves.quintic import QuinticHermite
from batten.kernels import hermite_energy as kernel
from batten.splines.element_chain import hermite_data


def evaluated(rows, kind, order):
    n = len(rows)
    values, gradients, hessians = np.empty((n, 2)), np.zeros((n, 2, 12)), np.zeros((n, 2, 12, 12))
    status = kernel.element_energies_batch(np.ascontiguousarray(rows), kind, order, values, gradients, hessians)
    return status, values, gradients, hessians


@pytest.fixture(scope="module")
def rows():
    random = np.random.default_rng(4)
    # Elements as they occur: no near-cusp, which 24 nodes do not resolve (the result's quadrature_error tells).
    own = np.tile([0.0, 0.0, 0.4, -0.7, 1.0, 0.0, 1.0, 0.05, -0.3, -0.7, 1.0, 0.0], (5, 1))
    return own + 0.05 * random.normal(size=own.shape)


def of_curve(row, kind):
    """Length and integral from the curve itself, κ′ by a difference of κ."""
    curve = QuinticHermite(hermite_data(row))

    def kappa(t):
        (x1, y1), (x2, y2) = curve.derivative(t), curve.derivative(t, 2)
        return (x1 * y2 - y1 * x2) / np.hypot(x1, y1) ** 3

    def inside(t):
        speed = np.hypot(*curve.derivative(t))
        slope = (8 * (kappa(t + 1e-4) - kappa(t - 1e-4)) - kappa(t + 2e-4) + kappa(t - 2e-4)) / 12e-4 / speed
        return (kappa(t) if kind == kernel.BENDING else slope) ** 2 * speed

    length = quad(lambda t: np.hypot(*curve.derivative(t)), 0, 1, epsabs=1e-12)[0]
    return length, quad(inside, 0, 1, epsabs=1e-10, epsrel=1e-10)[0]


@pytest.mark.parametrize("kind", [kernel.BENDING, kernel.VARIATION])
def test_values_are_integrals_along_the_curve(rows, kind):
    status, values, _, _ = evaluated(rows, kind, kernel.VALUES)
    assert status == kernel.GOOD
    np.testing.assert_allclose(values, [of_curve(r, kind) for r in rows], rtol=1e-7)


@pytest.mark.parametrize("kind", [kernel.BENDING, kernel.VARIATION])
def test_derivatives_are_those_of_differences(rows, kind):
    _, _, gradients, hessians = evaluated(rows, kind, kernel.HESSIANS)
    np.testing.assert_allclose(evaluated(rows, kind, kernel.GRADIENTS)[2], gradients, rtol=1e-13, atol=1e-12)
    step = 1e-5
    for i in range(12):
        up, down = rows.copy(), rows.copy()
        up[:, i] += step
        down[:, i] -= step
        by_values = (evaluated(up, kind, 0)[1] - evaluated(down, kind, 0)[1]) / (2 * step)
        by_gradients = (evaluated(up, kind, 1)[2] - evaluated(down, kind, 1)[2]) / (2 * step)
        for f in range(2):
            assert np.abs(by_values[:, f] - gradients[:, f, i]).max() < 1e-7 * np.abs(gradients[:, f]).max()
            assert np.abs(by_gradients[:, f] - hessians[:, f, i]).max() < 1e-7 * np.abs(hessians[:, f]).max()
    assert np.abs(hessians - hessians.swapaxes(2, 3)).max() < 1e-12 * np.abs(hessians).max()


def test_an_element_without_speed_is_nan_and_spoils_no_other(rows):
    bad = rows.copy()
    bad[2] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    status, values, _, _ = evaluated(bad, kernel.BENDING, kernel.HESSIANS)
    assert status == kernel.BAD_ELEMENT
    assert np.isnan(values[2]).all()
    assert np.isfinite(values[[0, 1, 3, 4]]).all()
