"""Double-double arithmetic against exact rationals and mpmath."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy as np
import pytest

from batten.kernels.double_double import dd_add, dd_mul, dd_sin_cos, dd_sqrt, two_product, two_sum


def _numbers(seed, count=300, spread=20):
    random = np.random.default_rng(seed)
    return (random.choice([-1.0, 1.0], count) * 10.0 ** random.uniform(-spread, spread, count)).tolist()


def _pairs(seed):
    """Double-doubles: hi and a lo below half a unit of its last place."""
    random = np.random.default_rng(seed)
    return [(hi, 0.5 * np.spacing(abs(hi)) * random.uniform(-1.0, 1.0)) for hi in _numbers(seed, spread=3)]


def _value(pair):
    return Fraction(pair[0]) + Fraction(pair[1])


def test_sums_and_products_are_exact():
    for a, b in zip(_numbers(1), _numbers(2)):
        assert _value(two_sum(a, b)) == Fraction(a) + Fraction(b)
        assert two_sum(a, b)[0] == a + b
        assert _value(two_product(a, b)) == Fraction(a) * Fraction(b)
        assert two_product(a, b)[0] == a * b
    assert two_sum(1.0, -1.0) == (0.0, 0.0)


def test_addition_and_multiplication_keep_30_digits():
    for x, y in zip(_pairs(3), _pairs(4)):
        exact = _value(x) + _value(y)
        scale = abs(_value(x)) + abs(_value(y))
        assert abs(_value(dd_add(*x, *y)) - exact) <= scale * Fraction(1, 10**31)
        exact = _value(x) * _value(y)
        assert abs(_value(dd_mul(*x, *y)) - exact) <= abs(exact) * Fraction(1, 10**30)


def test_what_cancels_keeps_its_digits():
    x = (1.0 / 3.0, 1e-18)
    assert _value(dd_add(*x, -(1.0 / 3.0), 0.0)) == Fraction(1e-18)


def test_square_roots_keep_30_digits():
    for hi, lo in _pairs(5):
        x = (abs(hi), lo if hi > 0 else -lo)
        root = _value(dd_sqrt(*x))
        assert abs(root * root - _value(x)) <= _value(x) * Fraction(1, 10**30)
    assert dd_sqrt(0.0, 0.0) == (0.0, 0.0)
    assert dd_sqrt(-1.0, 0.0) == (0.0, 0.0)


@pytest.mark.parametrize("size", [1e-12, 1e-3, 1.0, 30.0, 1e4, 1e6])
def test_sine_and_cosine_keep_30_digits(size):
    random = np.random.default_rng(6)
    angles = [*(size * random.uniform(-1.0, 1.0, 40)), 0.0, np.pi / 2, np.pi, -np.pi / 2, 7 * np.pi / 4]
    with mpmath.workdps(60):
        for angle in map(float, angles):
            sine_hi, sine_lo, cosine_hi, cosine_lo = dd_sin_cos(angle)
            sine = mpmath.mpf(sine_hi) + mpmath.mpf(sine_lo)
            cosine = mpmath.mpf(cosine_hi) + mpmath.mpf(cosine_lo)
            # Away from 0 the reduction by multiples of π/2 leaves an absolute error.
            assert abs(sine - mpmath.sin(angle)) < 3e-30 * min(1.0, abs(angle) or 1.0)
            assert abs(cosine - mpmath.cos(angle)) < 3e-30
