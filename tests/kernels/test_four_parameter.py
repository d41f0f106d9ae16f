"""Ends of four-parameter segments against mpmath, their derivatives, and what cannot be computed."""

import mpmath
import numpy as np
import pytest

from batten.kernels import four_parameter, spiral


def _ends(middle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    out, status = np.empty((len(middle), four_parameter.WIDTH)), np.empty(len(middle), dtype=np.int64)
    four_parameter.segment_ends_batch(np.ascontiguousarray(middle, dtype=np.float64), out, status)
    return out, status


@pytest.mark.parametrize("k", [[0.3, 0.0, 0.0, 0.0], [2.0, -3.0, 11.0, 30.0], [-1.5, 8.0, -60.0, -200.0]])
def test_ends_are_those_of_mpmath(k):
    with mpmath.workdps(30):

        def theta(s: mpmath.mpf) -> mpmath.mpf:
            return s * (k[0] + s * (mpmath.mpf(k[1]) / 2 + s * (mpmath.mpf(k[2]) / 6 + s * mpmath.mpf(k[3]) / 24)))

        half = mpmath.mpf(1) / 2
        chord = mpmath.quad(lambda s: mpmath.expj(theta(s)), mpmath.linspace(-half, half, 9))
        c, chi = abs(chord), mpmath.arg(chord)
        wanted = [c, chi]
        for s in (-half, half):
            wanted.append(theta(s) - chi)
            wanted += [mpmath.diff(theta, s, j) * c**j for j in (1, 2, 3)]
        wanted = np.array([float(w) for w in wanted])
    out, status = _ends(np.array([k]))
    assert status[0] == spiral.CONVERGED
    np.testing.assert_allclose(out[0, :10], wanted, rtol=2e-14, atol=4e-15)


def test_derivatives_are_those_by_differences():
    middle = np.random.default_rng(2).normal(0.0, 1.0, (60, 4)) * [1.5, 4.0, 12.0, 40.0]
    out, _ = _ends(middle)
    for p in range(4):
        h = 1e-5 * 2.0**p
        step = h * np.eye(4)[p]
        (plus, _), (minus, _) = _ends(middle + step), _ends(middle - step)
        slope = (plus[:, 2:10] - minus[:, 2:10]) / (2.0 * h)
        np.testing.assert_allclose(out[:, 10:].reshape(-1, 8, 4)[:, :, p], slope, rtol=2e-7, atol=2e-7)


def test_what_cannot_be_computed_says_so_and_spoils_no_other():
    rows = np.array([[np.nan, 0.0, 0.0, 0.0], [2.0 * np.pi, 0.0, 0.0, 0.0], [1e7, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
    out, status = _ends(rows)
    assert status.tolist() == [spiral.BAD_INPUT, spiral.NO_SOLUTION, spiral.NO_SOLUTION, spiral.CONVERGED]
    assert np.isnan(out[:3]).all()
    np.testing.assert_allclose(out[3, [0, 2, 6]], [2.0 * np.sin(0.5), -0.5, 0.5], rtol=1e-15)
