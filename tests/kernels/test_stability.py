"""The determinant of stability against its definition, and its first zeros, with fifty digits."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from scipy.special import ellipj, ellipk

from batten.kernels import stability as kernel
from batten.kernels.elastica import _TERMS, base_series


def _fields(k, start, end):
    """Jacobi fields ∂ψ by shift, rotation, scaling and k: rows (v at both ends, ∫v sin ψ, ∫v cos ψ), shape (4, 4).

    By definition: ∂/∂k of ψ = 2 asin(k sn t) by differences of fourth order, the displacements by quadrature.
    """
    x, w = np.polynomial.legendre.leggauss(60)
    t = np.concatenate([[start, end], start + 0.5 * (end - start) * (1.0 + x)])

    def psi(modulus):
        return 2.0 * np.arcsin(modulus * ellipj(t, modulus**2)[0])

    h = 5e-4
    by_k = (8.0 * (psi(k + h) - psi(k - h)) - psi(k + 2 * h) + psi(k - 2 * h)) / (12.0 * h)
    kappa = 2.0 * k * ellipj(t, k * k)[1]
    weights = 0.5 * (end - start) * w
    angle = psi(k)[2:]
    return np.array(
        [
            [*v[:2], weights @ (v[2:] * np.sin(angle)), weights @ (v[2:] * np.cos(angle))]
            for v in (kappa, np.ones_like(t), (t - start) * kappa, by_k)
        ]
    )


@pytest.mark.parametrize("k", [0.3, 0.8, 0.95])
def test_the_determinant_is_that_of_the_definition(k):
    """Up to the factor (1 − k² sn²p sn²τ)⁻², the ratio of both is one number wherever the segment lies."""
    quarter = ellipk(k * k)
    ser, wer = np.empty(_TERMS), np.empty(_TERMS)
    base_series(k * k, ser, wer)
    ratios = []
    for p, middle in ((0.9, 0.2), (1.6, -0.7), (2.6, 0.5), (2.6, 0.95), (3.4, 0.3)):
        half, tau = p * quarter, middle * quarter
        start = ellipj(tau - half, k * k)[:3]
        got = kernel.determinant(1, half, k * k, 1.0 - k * k, *start, ser, wer)
        spread = (1.0 - k * k * (ellipj(half, k * k)[0] * ellipj(tau, k * k)[0]) ** 2) ** 2
        ratios.append(np.linalg.det(_fields(k, tau - half, tau + half)) * spread / got)
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-6)


def _jacobi(which, t, m):
    return mp.ellipfun(which, t, m=m)


def _functions(m, p):
    """f, g, H, N and sn, cn, dn at p with mpmath's digits: the printed formulas again, for the accuracy of the zeros."""
    s, c, d = (_jacobi(name, p, m) for name in ("sn", "cn", "dn"))
    turns = mp.nint(p / (2 * mp.ellipk(m)))
    rest = p - 2 * turns * mp.ellipk(m)
    e = 2 * turns * mp.ellipe(m) + mp.ellipe(mp.asin(_jacobi("sn", rest, m)), m)
    j = (p - e) / m
    q = 1 - m
    f = s * d - (2 * e - p) * c
    g = (p * c * (e * (1 + c * c) - p + j - s * c * d) - (s * d - e * c) * (s * s * p - j)) / 2
    x = 2 * e - 2 * m * s * c / d - p
    along = [x, s / d - p * c / d**2, 2 * q * s / d - e * c / d**2 - c * x]
    across = [q * s / d, (j + s * c / d - p * c * c / d**2) / 2, q * (e * s * s / d**2 + j) / 2]
    big_h = d**3 * mp.det(mp.matrix([[1, p * s / d, e * s / d], along, across]))
    big_n = mp.det(mp.matrix([[0, s / d + p * c / d**2, e * c / d**2], along, across]))
    return f, g, big_h, big_n, s, c, d


def _exact_zero(theta, kappa, guess, code):
    """The conjugate length of the curve of the stored numbers (force (1, 0)) near `guess`."""
    a, c, q = mp.sin(mp.mpf(theta) / 2), mp.cos(mp.mpf(theta) / 2), mp.mpf(kappa) / 2
    m = q * q + a * a
    sn0, cn0 = a / mp.sqrt(m), q / mp.sqrt(m)

    def clamped(length):
        f, g, big_h, _, s, cp, d = _functions(m, length / 2)
        den = 1 - m * sn0**2 * s**2
        sn = (sn0 * cp * d + s * cn0 * c) / den
        cn = (cn0 * cp - sn0 * c * s * d) / den
        dn = (c * d - m * sn0 * cn0 * s * cp) / den
        return s * big_h * sn**2 * dn**2 - f * g * cn**2

    function = {0: clamped, 1: lambda h: _functions(m, h)[3], 3: lambda h: _functions(m, h)[2]}[code]
    near = mp.mpf(guess)
    return mp.findroot(
        function, (near * (1 - mp.mpf(10) ** -7), near * (1 + mp.mpf(10) ** -7)), tol=1e-50, verify=False
    )


CASES = [
    *[(k, 1e-13) for k in ("1e-6", "0.3", "0.9", "0.908", "0.909", "0.95", "0.9999")],
    *[(k, 1e-10) for k in ("0.99999999", "0.999999999999")],
]


@pytest.mark.parametrize(("k", "tolerance"), CASES)
def test_zeros_keep_their_digits_up_to_the_separatrix(k, tolerance):
    rng = np.random.default_rng(1)
    with mp.workdps(50):
        m = mp.mpf(k) ** 2
        quarter = mp.ellipk(m)
        for phase in rng.uniform(-2.0, 2.0, 3):
            t = quarter * mp.mpf(phase)
            theta = float(2 * mp.asin(mp.sqrt(m) * _jacobi("sn", t, m)))
            kappa = float(2 * mp.sqrt(m) * _jacobi("cn", t, m))
            got = kernel.conjugate_length(theta, kappa, 1.0, 0.0, 1.0, kernel.CLAMPED)
            assert abs(_exact_zero(theta, kappa, got, 0) / mp.mpf(got) - 1) < tolerance
        angle = float(2 * mp.asin(mp.sqrt(m)))
        exact_quarter = mp.ellipk(mp.sin(mp.mpf(angle) / 2) ** 2)
        for code, length in ((kernel.PINNED_CLAMPED, 1.0), (kernel.PINNED, float(2 * exact_quarter))):
            got = kernel.conjugate_length(angle, 0.0, 1.0, 0.0, length, code)
            assert abs(_exact_zero(angle, 0.0, got, code) / mp.mpf(got) - 1) < tolerance


def _samples(which, complement, low, high, count):
    ser, wer = np.empty(_TERMS), np.empty(_TERMS)
    k2 = 1.0 - complement
    base_series(k2, ser, wer)
    p = np.linspace(low, high, count) * kernel.quarter_period(complement)
    return p, np.array([kernel.determinant(which, x, k2, complement, 0.0, 1.0, 1.0, ser, wer) for x in p])


def test_the_brackets_hold_the_first_zero_and_no_other():
    """Signs that `conjugate_length` takes for granted, over the whole range of k."""
    for complement in np.concatenate([1.0 - np.logspace(-12, -0.3, 30), np.logspace(-14, -0.2, 120)]):
        for which, below, above in ((0, 1.0, 2.999), (2, 1.5, 3.88), (3, 1.0, 3.2)):
            p, value = _samples(which, complement, 0.3, above, 400)
            first = p[np.flatnonzero(value <= 0.0)[0]]
            assert first >= below * kernel.quarter_period(complement)
            if which != 3:
                assert (np.diff(np.sign(value)) != 0).sum() == 1
            else:
                angle = 2.0 * np.arctan2(np.sqrt(1.0 - complement), np.sqrt(complement))
                full = 2.0 * kernel.quarter_period(complement)
                got = kernel.conjugate_length(angle, 0.0, 1.0, 0.0, full, kernel.PINNED)
                assert first - got == pytest.approx(0.0, abs=0.01 * first)


def test_the_first_zero_of_clamped_ends_lies_between_sachkovs_bounds_and_is_unique_there():
    rng = np.random.default_rng(2)
    ser, wer = np.empty(_TERMS), np.empty(_TERMS)
    for i in range(300):
        complement = 10.0 ** rng.uniform(-9, 0) if i % 2 else 1.0 - rng.uniform(1e-5, 1.0) ** 2
        k2, quarter = 1.0 - complement, kernel.quarter_period(complement)
        base_series(k2, ser, wer)
        angle = rng.uniform(-np.pi, np.pi)
        sn, cn = np.sin(angle), np.cos(angle)
        dn = np.sqrt(complement + k2 * cn * cn)
        rest = (k2, complement, sn, cn, dn, ser, wer)
        vertex = kernel.first_zero(0, quarter, 3.0 * quarter, k2, complement, 0.0, 1.0, 1.0, ser, wer)
        low, high = sorted([2.0 * quarter, vertex])
        assert all(kernel.determinant(1, p, *rest) > 0.0 for p in np.linspace(0.2 * quarter, low * (1 - 1e-9), 60))
        inside = np.array([kernel.determinant(1, p, *rest) > 0.0 for p in np.linspace(low, high, 82)[1:-1]])
        assert (np.diff(inside.astype(int)) <= 0).all()


def test_kernels_never_raise():
    for bad in ((np.nan, 1.0, 1.0, 0.0, 1.0), (0.0, 1.0, np.inf, 0.0, 1.0), (0.0, 1.0, 1.0, 0.0, -1.0)):
        assert np.isnan(kernel.conjugate_length(*bad, kernel.CLAMPED))
    assert np.isnan(kernel.conjugate_length(0.0, 1.0, 1.0, 0.0, 1.0, 7))
    assert np.isnan(kernel.conjugate_length(0.0, 1.0, 1.0, 0.0, 1.0, kernel.PINNED))
