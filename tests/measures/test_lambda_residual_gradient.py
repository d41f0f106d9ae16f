"""The gradient of the λ-residual: differences of the residual itself, a finer oracle, invariances, degenerate curves."""

import functools

import mpmath as mp
import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.measures.curvature_fit import curvature_fit
from batten.measures.lambda_residual import lambda_residual
from batten.measures.lambda_residual_gradient import lambda_residual_gradient

TAME = np.array([(0, 0), (0.1, 0.7), (0.9, 0.6), (1, 0)])


def unit_disc(seed, count):
    rng = np.random.default_rng(seed)
    radius, angle = np.sqrt(rng.random((count, 4))), 2 * np.pi * rng.random((count, 4))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def differences(function, control, step):
    """Central differences of order six by each coordinate, all evaluated in one batch."""
    unit = np.eye(8).reshape(8, 4, 2)
    shifts = np.array([1, 2, 3, -1, -2, -3])
    values = function(control + step * shifts[:, None, None, None] * unit)
    return (np.array([45, -9, 1, -45, 9, -1]) @ values / (60 * step)).reshape(4, 2)


@pytest.mark.parametrize("control", unit_disc(2, 20))
def test_is_the_derivative_of_the_residual_by_the_same_quadrature(control):
    value, gradient = lambda_residual_gradient(control, tolerance=None)
    assert value == pytest.approx(lambda_residual(control, tolerance=None), rel=2e-13)  # the order of sums is free
    found = differences(lambda p: lambda_residual(p, tolerance=None), control, 1e-4)
    # The rounding of e_λ, 1e-15 or so, over the step; the sixth order's error is far less but for sharp peaks.
    scale = max(1.0, np.abs(gradient).max()) ** 3
    assert np.abs(found - gradient).max() < 1e-9 * scale


def test_the_panels_are_those_of_a_residual_a_hundred_times_as_accurate():
    control = unit_disc(3, 500)
    for tolerance in (1e-2, 1e-8):
        values, _ = lambda_residual_gradient(control, tolerance=tolerance)
        assert values == pytest.approx(lambda_residual(control, tolerance=tolerance / 100), rel=2e-13)


@functools.cache
def precise_rule(count=32):
    """Gauss–Legendre nodes and weights on [0, 1] to 40 digits, by Newton's method on the polynomial."""
    nodes, weights = [], []
    for guess in np.polynomial.legendre.leggauss(count)[0]:
        x = mp.findroot(lambda x: mp.legendre(count, x), mp.mpf(float(guess)))
        slope = count * (x * mp.legendre(count, x) - mp.legendre(count - 1, x)) / (x * x - 1)
        nodes.append((1 + x) / 2)
        weights.append(1 / ((1 - x * x) * slope * slope))
    return nodes, weights


def precise_residual(control):
    """e_λ² in 40 digits' arithmetic from the normal equations, on eight panels."""
    p = [[mp.mpf(float(v)) if not isinstance(v, mp.mpf) else v for v in row] for row in control]

    def state(t):
        u = 1 - t
        out = []
        for k in range(2):
            a, b, c, d = (row[k] for row in p)
            out.append(u**3 * a + 3 * u * u * t * b + 3 * u * t * t * c + t**3 * d)
            out.append(3 * (u * u * (b - a) + 2 * u * t * (c - b) + t * t * (d - c)))
            out.append(6 * (u * (c - 2 * b + a) + t * (d - 2 * c + b)))
        x, dx, ddx, y, dy, ddy = out
        speed = mp.sqrt(dx * dx + dy * dy)
        return x, y, (dx * ddy - dy * ddx) / speed**3, speed

    nodes, weights = precise_rule()
    m = mp.matrix(4, 4)
    for j in range(8):
        for x, w in zip(nodes, weights):
            a, b, k, speed = state((j + x) / 8)
            v = (mp.mpf(1), a, b, k)
            for i in range(4):
                for n in range(4):
                    m[i, n] += v[i] * v[n] * w * speed / 8
    solution = mp.lu_solve(m[:3, :3], m[:3, 3])
    return (m[3, 3] - sum(solution[i] * m[i, 3] for i in range(3))) / m[3, 3]


@pytest.mark.parametrize("control", [TAME, TAME * [1, -0.05], [(0, 0), (1, 0.8), (0.1, -0.4), (1.1, 0.3)]])
def test_against_differences_with_thirty_digits(control):
    control = np.asarray(control, dtype=float)
    value, gradient = lambda_residual_gradient(control, tolerance=1e-8)
    with mp.workdps(40):
        step = mp.mpf("1e-12")
        exact = np.empty((4, 2))
        for i, j in np.ndindex(4, 2):
            sides = []
            for sign in (1, -1):
                moved = [[mp.mpf(float(v)) for v in row] for row in control]
                moved[i][j] += sign * step
                sides.append(mp.sqrt(precise_residual(moved)))
            exact[i, j] = float((sides[0] - sides[1]) / (2 * step))
        assert float(mp.sqrt(precise_residual(control))) == pytest.approx(float(value), abs=1e-9)
    assert np.abs(gradient - exact).max() < 1e-8 * (1 + np.abs(exact).max())


@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-4, 1e-6, 1e-8])
def test_the_error_is_below_the_tolerance(tolerance):
    """Against the finest panels there are, by the tightest residual's quadrature and differences of it."""
    control = unit_disc(4, 300)
    length = curvature_fit(control).length
    _, gradient = lambda_residual_gradient(control, tolerance=tolerance)
    _, fine = lambda_residual_gradient(control, tolerance=1e-8)
    for row in range(0, 300, 10):  # the oracle itself
        step = 1e-4 / max(1.0, np.abs(fine[row]).max())
        by_differences = differences(lambda p: lambda_residual(p, tolerance=1e-10), control[row], step)
        # e_λ is only known to 1e-10 where its panels change, so its differences are to 1e-10/step at worst.
        assert np.abs(by_differences - fine[row]).max() < 1e-10 / step + 1e-6 * np.abs(fine[row]).max()
    size, error = (np.sqrt((g**2).sum(axis=(1, 2))) * length for g in (fine, gradient - fine))
    assert (error <= tolerance * (1 + size)).all()


def test_is_orthogonal_to_similarities():
    control = unit_disc(5, 2000) + np.array([3.0, -2.0])
    _, gradient = lambda_residual_gradient(control)
    size = np.abs(gradient).max(axis=(1, 2)) * 5
    assert (np.abs(gradient.sum(axis=1)).max(axis=1) < 1e-11 * (1 + size)).all()
    assert (np.abs((gradient * control).sum(axis=(1, 2))) < 1e-5 * (1 + size)).all()
    turned = np.stack([-control[..., 1], control[..., 0]], axis=-1)
    assert (np.abs((gradient * turned).sum(axis=(1, 2))) < 1e-5 * (1 + size)).all()


def test_turns_and_scales_with_the_curve_and_reverses():
    value, gradient = lambda_residual_gradient(TAME)
    c, s = 3.0 * np.cos(0.7), 3.0 * np.sin(0.7)
    matrix = np.array([[c, s], [-s, c]])
    moved_value, moved = lambda_residual_gradient(TAME @ matrix + [5, -1])
    assert moved_value == pytest.approx(value, abs=1e-12)
    np.testing.assert_allclose(moved, gradient @ matrix / 9, atol=1e-12)
    np.testing.assert_allclose(lambda_residual_gradient(TAME[::-1])[1], gradient[::-1], atol=1e-9)


def test_steps_along_the_gradient_make_the_residual_smaller():
    control = np.array([(0, 0), (0.2, 1.1), (1.4, 0.3), (1, 0)])
    value, gradient = lambda_residual_gradient(control)
    for step in (1e-2, 1e-3):
        new = lambda_residual(control - step * gradient)
        assert value - new == pytest.approx(step * (gradient**2).sum(), rel=50 * step)


@pytest.mark.parametrize(
    ("control", "value"),
    [
        ([(0, 0), (1, 1), (2, 2), (3, 3)], 0.0),
        ([(0, 0), (0, 0), (1, 3), (1, 3)], 0.0),
        ([(0, 0), (3, 0), (-2, 0), (1, 0)], 1.0),
        ([(0, 0), (1, 1), (0, 1), (1, 0)], 1.0),
        ([(0, 0), (0, 0), (1, 1), (2, 0)], 1.0),
        ([(0, 0), (1, 1), (2, 0), (2, 0)], 1.0),
        ([(2, 1)] * 4, np.nan),
        ([(0, 0), (np.nan, 1), (2, 1), (3, 0)], np.nan),
        ([(0, 0), (np.inf, 1), (2, 1), (3, 0)], np.nan),
    ],
)
def test_degenerate_curves_have_a_value_and_no_gradient(control, value):
    rows = np.array([TAME, control, TAME])
    values, gradients = lambda_residual_gradient(rows)
    np.testing.assert_equal(values[1], value)
    assert np.isnan(gradients[1]).all()
    assert values[0] == values[2] == lambda_residual_gradient(TAME)[0]
    assert np.array_equal(gradients[0], gradients[2])


def test_coincident_inner_points_are_no_trouble():
    control = np.array([(0, 0), (0.5, 0.6), (0.5, 0.6), (1, 0)])
    value, gradient = lambda_residual_gradient(control)
    found = differences(lambda p: lambda_residual(p, tolerance=1e-10), control, 1e-3)
    assert 0 < value < 1
    assert np.abs(found - gradient).max() < 1e-6


def test_shapes_and_refusals():
    values, gradients = lambda_residual_gradient(np.broadcast_to(TAME, (2, 3, 4, 2)))
    assert values.shape == (2, 3)
    assert gradients.shape == (2, 3, 4, 2)
    assert lambda_residual_gradient(np.empty((0, 4, 2)))[1].shape == (0, 4, 2)
    with pytest.raises(InvalidInputError):
        lambda_residual_gradient(np.zeros((3, 2)))
    for tolerance in (0.0, 1e-9, 0.2, np.nan):
        with pytest.raises(InvalidInputError):
            lambda_residual_gradient(TAME, tolerance=tolerance)
