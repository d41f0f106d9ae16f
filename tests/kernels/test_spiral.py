"""Integrals of spirals against mpmath, the bound on their error, and the Euler spiral between two tangents."""

import mpmath
import numpy as np
import pytest

from batten.kernels import spiral


def _moment(k: list[float], j: int) -> complex:
    """∫ sʲ exp(iθ) ds by mpmath with 30 digits."""
    with mpmath.workdps(30):

        def theta(s: mpmath.mpf) -> mpmath.mpf:
            return s * (k[0] + s * (mpmath.mpf(k[1]) / 2 + s * (mpmath.mpf(k[2]) / 6 + s * mpmath.mpf(k[3]) / 24)))

        edges = [mpmath.mpf(i) / 8 - mpmath.mpf(1) / 2 for i in range(9)]
        return complex(mpmath.quad(lambda s: s**j * mpmath.expj(theta(s)), edges))


def _solve(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    out, status = np.empty((len(angles), 9)), np.empty(len(angles), dtype=np.int64)
    spiral.euler_spiral_batch(np.ascontiguousarray(angles), out, status)
    return out, status


@pytest.mark.parametrize("k", [[0.0, 0.0, 0.0, 0.0], [3.0, -7.0, 11.0, 40.0], [-20.0, 60.0, 0.0, -300.0]])
def test_moments_are_those_of_mpmath(k):
    work = np.empty(6)
    panels = spiral.panels_for(*k, 1e-16)
    spiral.moments(*k, panels, 2, work)
    for j in range(3):
        assert abs(complex(work[2 * j], work[2 * j + 1]) - _moment(k, j)) < 4e-16


@pytest.mark.parametrize("tolerance", [10.0**-e for e in range(1, 15)])
def test_the_bound_on_the_error_holds(tolerance):
    random = np.random.default_rng(3)
    work = np.empty(2)
    for _ in range(200):
        k = random.normal(0.0, 1.0, 4) * 10.0 ** random.uniform(0.0, 2.3) * [1.0, 2.0, 6.0, 24.0]
        panels = spiral.panels_for(*k, tolerance)
        spiral.moments(*k, panels, 0, work)
        coarse = complex(*work)
        spiral.moments(*k, 4 * spiral.panels_for(*k, 1e-16), 0, work)
        assert abs(coarse - complex(*work)) <= tolerance + 2e-15


def test_less_is_done_for_a_wider_tolerance():
    panels = [spiral.panels_for(30.0, 50.0, 0.0, 0.0, t) for t in (1e-14, 1e-8, 1e-2)]
    assert panels[0] > panels[1] > panels[2]


def test_euler_spirals_meet_their_angles():
    random = np.random.default_rng(0)
    angles = np.concatenate([random.uniform(-np.pi, np.pi, (60, 2)), random.normal(0.0, 1e-6, (10, 2)), [[-9.0, -7.0]]])
    out, status = _solve(angles)
    assert (status == spiral.CONVERGED).all()
    for (start, end), (k0, k1, c, at_start, at_end, *_) in zip(angles, out, strict=True):
        chord = _moment([k0, k1, 0.0, 0.0], 0)
        assert abs(chord) == pytest.approx(c, abs=1e-15)
        # The branch of the chord's angle: it is below π/2 of the tangent in the middle for these.
        assert -0.5 * k0 + k1 / 8.0 - np.angle(chord) == pytest.approx(start, abs=4e-15 * (1.0 + abs(k1)))
        assert 0.5 * k0 + k1 / 8.0 - np.angle(chord) == pytest.approx(end, abs=4e-15 * (1.0 + abs(k1)))
        assert (at_start, at_end) == pytest.approx(((k0 - 0.5 * k1) * c, (k0 + 0.5 * k1) * c), rel=1e-13)


def test_there_is_one_spiral_for_two_angles():
    """k₁/8 − χ grows with k₁ for every turn below 2π: what the solver's bracket and the word "the" rest on."""
    x, w = np.polynomial.legendre.leggauss(120)
    s, w = 0.5 * x, 0.5 * w
    k1 = np.linspace(0.0, 120.0, 2401)
    for k0 in np.linspace(0.0, 2.0 * np.pi - 0.02, 40):
        chord = np.exp(1j * (k0 * s + 0.5 * k1[:, None] * s * s)) @ w
        angle = np.angle(chord)
        assert angle.min() > -0.5 * np.pi
        assert angle.max() < 1.06
        assert (np.diff(k1 / 8.0 - angle) > 0.0).all()


def test_derivatives_are_those_by_differences():
    angles = np.random.default_rng(1).uniform(-2.8, 2.8, (200, 2))
    out, _ = _solve(angles)
    h = 1e-5
    for a in range(2):
        step = h * np.eye(2)[a]
        (plus, _), (minus, _) = _solve(angles + step), _solve(angles - step)
        for e in range(2):
            slope = (plus[:, 3 + e] - minus[:, 3 + e]) / (2.0 * h)
            np.testing.assert_allclose(out[:, 5 + 2 * e + a], slope, rtol=1e-7, atol=1e-7)


def test_what_has_no_spiral_says_so_and_spoils_no_other():
    out, status = _solve(np.array([[-np.pi, np.pi], [np.nan, 0.0], [0.3, -0.3]]))
    assert status.tolist() == [spiral.NO_SOLUTION, spiral.BAD_INPUT, spiral.CONVERGED]
    assert np.isnan(out[:2]).all()
    assert np.isfinite(out[2]).all()


def test_points_along_a_spiral_are_those_of_mpmath():
    curvatures, length = np.array([1.0, -3.0, 2.0, 5.0]), 2.5
    out = np.empty((3, 2))
    spiral.spiral_points(curvatures, length, 1e-16, np.array([0.2, 0.7, 1.0]), out)
    with mpmath.workdps(25):
        theta = lambda s: s + s * s * (-1.5) + s**3 / 3 + 5 * s**4 / 24  # noqa: E731
        for fraction, point in zip((0.2, 0.7, 1.0), out, strict=True):
            z = complex(mpmath.quad(lambda s: mpmath.expj(theta(s)), mpmath.linspace(0, fraction * length, 9)))
            assert abs(complex(*point) - z) < 3e-15
