"""Elliptic integrals against mpmath and closed forms."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

from batten.kernels.elliptic import carlson_rf, complete_k, incomplete_f


def test_carlson_rf_against_mpmath():
    random = np.random.default_rng(1)
    for _ in range(200):
        x, y, z = 10.0 ** random.uniform(-8, 8, 3)
        assert carlson_rf(x, y, z) == pytest.approx(float(mpmath.elliprf(x, y, z)), rel=4e-15)
    assert carlson_rf(0.0, 1.0, 2.0) == pytest.approx(float(mpmath.elliprf(0, 1, 2)), rel=2e-15)


def test_carlson_rf_in_closed_form():
    assert carlson_rf(4.0, 4.0, 4.0) == 0.5  # R_F(x, x, x) = x^(−1/2)
    assert carlson_rf(0.0, 1.0, 1.0) == pytest.approx(math.pi / 2, rel=4e-16)  # R_C(0, 1)
    assert carlson_rf(2.0, 8.0, 18.0) == pytest.approx(carlson_rf(18.0, 2.0, 8.0), rel=4e-16)
    assert carlson_rf(9.0, 18.0, 27.0) == pytest.approx(carlson_rf(1.0, 2.0, 3.0) / 3.0, rel=4e-16)


@pytest.mark.parametrize("complement", [1.0, 0.75, 0.5, 1e-3, 1e-8, 1e-16, 1e-200])
def test_complete_k_against_mpmath(complement):
    with mpmath.workdps(250):
        expected = float(mpmath.ellipk(1 - mpmath.mpf(complement)))
    assert complete_k(complement) == pytest.approx(expected, rel=2e-15)


def test_complete_k_at_its_end():
    assert complete_k(0.0) == math.inf
    assert complete_k(1.0) == pytest.approx(math.pi / 2, rel=1e-16)


@pytest.mark.parametrize("complement", [1.0, 0.8, 0.3, 1e-2, 1e-6, 1e-12])
def test_incomplete_f_against_mpmath(complement):
    for phi in (-9.0, -4.0, -1.5, -1e-8, 0.0, 1e-3, 0.7, 1.57, 1.58, 3.0, 3.2, 20.0):
        with mpmath.workdps(40):
            expected = float(mpmath.ellipf(mpmath.mpf(phi), 1 - mpmath.mpf(complement)))
        # Next to odd multiples of π/2 the value is as sensitive as 1/√(1 − k²) to rounding of φ.
        slope = 1.0 / math.sqrt(math.cos(phi) ** 2 + complement * math.sin(phi) ** 2)
        assert abs(incomplete_f(phi, complement) - expected) <= 4e-15 * abs(expected) + 4e-16 * abs(phi) * slope


def test_incomplete_f_at_the_ends_of_its_modulus():
    assert incomplete_f(2.5, 1.0) == pytest.approx(2.5, rel=1e-15)  # k = 0
    assert incomplete_f(0.9, 0.0) == pytest.approx(
        math.asinh(math.tan(0.9)), rel=1e-15
    )  # k = 1: the Gudermannian's inverse
    assert incomplete_f(2.0, 0.0) == math.inf
    assert incomplete_f(-2.0, 0.0) == -math.inf
