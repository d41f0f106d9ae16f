"""Segments of MEC, tension and SI-MEC splines against the solver of angle-constrained curves, and by variation."""

import numpy as np
import pytest

from batten.curves.elastica import Elastica
from batten.kernels import sliding_segment, spiral
from batten.solvers.angle_constrained import mec_exists, minimum_energy_curves, scale_invariant_curves


def _solve(angles: np.ndarray, upright: bool, tension: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    n = len(angles)
    known, z = np.zeros((n, 3)), np.zeros((n, 3))
    known[:, 2], z[:, 1] = tension, -0.5 * tension
    out, status = np.empty((n, 7)), np.empty(n, dtype=np.int64)
    sliding_segment.sliding_batch(np.ascontiguousarray(angles), np.full(n, tension), upright, known, z, out, status)
    return z, out, status


@pytest.mark.parametrize("upright", [False, True])
def test_they_are_the_principal_angle_constrained_curves(upright):
    angles = np.random.default_rng(0).uniform(-1.3, 1.3, (25, 2))
    _, out, status = _solve(angles, upright)
    assert (status == spiral.CONVERGED).all()
    solve = scale_invariant_curves if upright else minimum_energy_curves
    for (start, end), row in zip(angles, out, strict=True):
        curve = next(s.elastica for s in solve((0, 0), start, (1, 0), end) if s.principal)
        assert row[0] == pytest.approx(1.0 / curve.length, rel=1e-9)
        assert row[1:3] == pytest.approx([curve.start_curvature, float(curve.curvature_at(curve.length))], abs=1e-8)


def test_outside_the_envelope_there_is_none():
    angles = np.array([[1.2, -1.2], [1.7, -1.7], [2.3, 2.3]])
    _, out, status = _solve(angles, False)
    exists = [mec_exists(a, -b) for a, b in angles]
    assert (status == spiral.CONVERGED).tolist() == exists == [True, False, False]
    assert np.isnan(out[1:]).all()


@pytest.mark.parametrize(("upright", "tension"), [(False, 0.0), (False, 7.0), (True, 0.0)])
def test_derivatives_are_those_by_differences(upright, tension):
    angles = np.random.default_rng(5).uniform(-1.1, 1.1, (60, 2))
    _, out, status = _solve(angles, upright, tension)
    assert (status == spiral.CONVERGED).all()
    h = 1e-5
    for a in range(2):
        step = h * np.eye(2)[a]
        plus, minus = _solve(angles + step, upright, tension)[1], _solve(angles - step, upright, tension)[1]
        for e in range(2):
            slope = (plus[:, 1 + e] - minus[:, 1 + e]) / (2.0 * h)
            np.testing.assert_allclose(out[:, 3 + 2 * e + a], slope, rtol=1e-6, atol=1e-6)


def test_tension_makes_energy_plus_length_stationary():
    """∫κ² + c ds, over elastica with the same ends and tangents and other lengths, is least at the one that is found."""
    from batten.solvers.boundary_value import solve_boundary

    tension = 7.0
    z, out, _ = _solve(np.array([[0.7, -0.4]]), False, tension)
    length = 1.0 / out[0, 0]
    unit = Elastica(np.zeros(2), 0.0, z[0, 0], z[0, 1:], 1.0)

    def energy(size: float) -> float:
        least = min(
            s.elastica.bending_energy() for s in solve_boundary((0, 0), 0.7, (1, 0), -0.4, size, max_inflections=1)
        )
        return least + tension * size

    here = unit.bending_energy() / length + tension * length
    assert here == pytest.approx(energy(length), rel=1e-9)
    assert energy(length * 0.998) > here < energy(length * 1.002)
    assert (energy(length * 1.0002) - energy(length * 0.9998)) / (0.0004 * length) == pytest.approx(0.0, abs=1e-3)
