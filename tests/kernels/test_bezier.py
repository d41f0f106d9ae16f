"""The batch kernel: what the public measures do not show, its flags, scales and stack of panels."""

import numpy as np
import pytest

from batten.kernels.bezier import LAMBDA_RESIDUAL, LENGTH, curvature_fit_batch
from batten.kernels.quadrature import panel_condition

ARCH = np.array([(0, 0), (0.1, 0.7), (0.9, 0.7), (1, 0)])


def _fit(rows, condition):
    out = np.full((len(rows), 7), 123.0)
    curvature_fit_batch(np.asarray(rows, dtype=float), condition, out)
    return out


@pytest.mark.parametrize("condition", [0.0, panel_condition(1e-6)])
@pytest.mark.parametrize("scale", [1e-280, 1e-150, 1e-30, 1e30, 1e150])
def test_no_scale_is_too_small_or_too_large(scale, condition):
    reference, row = _fit([ARCH, scale * ARCH], condition)
    assert row[LENGTH] == pytest.approx(scale * reference[LENGTH], rel=1e-14)
    assert row[LAMBDA_RESIDUAL] == pytest.approx(reference[LAMBDA_RESIDUAL], abs=1e-13)


def test_bad_rows_spoil_no_others():
    rows = np.stack([ARCH] * 7)
    rows[1, 2, 0] = np.nan
    rows[2, 0, 1] = np.inf
    rows[4, 3] = -np.inf
    rows[5] = 3.0
    out = _fit(rows, panel_condition(1e-6))
    assert np.isnan(out[[1, 2, 4]]).all()
    assert out[5, LENGTH] == 0.0
    assert np.isnan(out[5, 1:]).all()
    np.testing.assert_array_equal(out[[3, 6]], out[[0, 0]])
    assert np.isfinite(out[0]).all()


def test_plain_rule_is_the_textbook_one():
    """24 nodes, γ' and γ'' by differences, the 3 × 3 normal equations of Brander2016 (6)."""
    rng = np.random.default_rng(2)
    rows = rng.normal(size=(300, 4, 2))
    x, w = np.polynomial.legendre.leggauss(24)
    t, w = (x + 1) / 2, w / 2
    bernstein = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3])
    first = 3 * np.stack([(1 - t) ** 2, 2 * t * (1 - t), t**2])
    second = 6 * np.stack([1 - t, t])
    out = _fit(rows, 0.0)
    for row, found in zip(rows, out):
        p, d1, d2 = row.T @ bernstein, np.diff(row.T) @ first, np.diff(row.T, n=2) @ second
        speed = np.hypot(*d1)
        kappa = (d1[0] * d2[1] - d1[1] * d2[0]) / speed**3
        ds = speed * w
        a = np.stack([-p[1], p[0], np.ones_like(t)])
        lambdas = np.linalg.solve((a * ds) @ a.T, (a * ds) @ kappa)
        residual = kappa - lambdas @ a
        energy = ds @ kappa**2
        expected = [ds.sum(), energy, ds @ residual**2, *lambdas, np.sqrt(ds @ residual**2 / energy)]
        np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-9 * np.abs(lambdas).max())
