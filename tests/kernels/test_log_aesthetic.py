"""Segments of log-aesthetic curves against direct integration, and against the Euler spiral at α = 1."""

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from batten.kernels import log_aesthetic, spiral


def _solve(angles: np.ndarray, alpha: float) -> tuple[np.ndarray, np.ndarray]:
    out, status = np.empty((len(angles), 9)), np.empty(len(angles), dtype=np.int64)
    log_aesthetic.log_aesthetic_batch(np.ascontiguousarray(angles), alpha, out, status)
    return out, status


@pytest.mark.parametrize("alpha", [0.3, 0.9, 1.78, 4.0])
def test_segments_meet_their_angles_by_direct_integration(alpha):
    angles = np.random.default_rng(2).uniform(-2.2, 2.2, (12, 2))
    angles[0] = 0.4, -0.4 + 1e-9  # nearly an arc
    angles[1] = 0.4, 0.4  # an S
    out, status = _solve(angles, alpha)
    assert (status == spiral.CONVERGED).all()
    for (start, end), row in zip(angles, out, strict=True):
        k0, k1, c = row[:3]
        *_, at_start, at_end, w = log_aesthetic.log_aesthetic_chord(k0, k1, alpha)
        if abs(w) < 1e6:
            size = k1 / (np.copysign(abs(w + 0.5) ** alpha, w + 0.5) - np.copysign(abs(w - 0.5) ** alpha, w - 0.5))
            bend = lambda u: size * np.copysign(abs(w - 0.5 + u) ** alpha, w - 0.5 + u)  # noqa: B023, E731
        else:
            bend = lambda u: at_start + (at_end - at_start) * u  # noqa: B023, E731
        inner = 0.5 - w
        edges = [0.0, inner, 1.0] if 0.0 < inner < 1.0 else [0.0, 1.0]
        state = np.zeros(3)
        for a, b in itertools.pairwise(edges):
            ode = lambda u, y: [np.cos(y[2]), np.sin(y[2]), bend(u)]  # noqa: B023, E731
            state = solve_ivp(ode, (a, b), state, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        chord = np.angle(complex(state[0], state[1]))
        assert np.exp(1j * (-chord)) == pytest.approx(np.exp(1j * start), abs=2e-9)
        assert np.exp(1j * (state[2] - chord)) == pytest.approx(np.exp(1j * end), abs=2e-9)
        assert state[2] == pytest.approx(end - start, abs=2e-9)
        assert np.hypot(*state[:2]) == pytest.approx(c, abs=2e-9)


def test_with_exponent_1_it_is_the_euler_spiral():
    angles = np.random.default_rng(3).uniform(-2.5, 2.5, (300, 2))
    exact = np.empty((300, 9))
    spiral.euler_spiral_batch(angles, exact, np.empty(300, dtype=np.int64))
    out, status = _solve(angles, 1.0 + 1e-12)
    assert (status == spiral.CONVERGED).all()
    np.testing.assert_allclose(out[:, :5], exact[:, :5], rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(out[:, 5:], exact[:, 5:], rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("alpha", [0.6, 1.78, 3.0])
def test_derivatives_are_those_by_differences(alpha):
    angles = np.random.default_rng(4).uniform(-2.0, 2.0, (100, 2))
    # At an inflection on a segment's end a power below 1 has no derivative, and near it differences are no measure.
    rows, _ = _solve(angles, alpha)
    far = np.array(
        [abs(abs(log_aesthetic.log_aesthetic_chord(k0, k1, alpha)[4]) - 0.5) > 0.02 for k0, k1 in rows[:, :2]]
    )
    angles = angles[far]
    out, _ = _solve(angles, alpha)
    h = 1e-6
    for a in range(2):
        step = h * np.eye(2)[a]
        (plus, _), (minus, _) = _solve(angles + step, alpha), _solve(angles - step, alpha)
        for e in range(2):
            slope = (plus[:, 3 + e] - minus[:, 3 + e]) / (2.0 * h)
            np.testing.assert_allclose(out[:, 5 + 2 * e + a], slope, rtol=2e-6, atol=2e-6)
