"""Gauss rules against exact integrals, and adaptive panels on functions with known singularities."""

from fractions import Fraction

import numpy as np
import pytest

from batten.kernels import quadrature as q


@pytest.mark.parametrize("count", [16, 24, 32])
def test_rule_is_exact_up_to_its_degree(count):
    nodes, weights = getattr(q, f"NODES_{count}"), getattr(q, f"WEIGHTS_{count}")
    assert nodes.size == count
    for n in range(2 * count):
        assert (weights * nodes**n).sum() == pytest.approx(float(Fraction(1, n + 1)), rel=1e-13)
    assert not nodes.flags.writeable
    assert (np.diff(nodes) > 0).all()


def test_condition_grows_as_the_tolerance_falls():
    values = [q.panel_condition(tolerance) for tolerance in (0.1, 1e-3, 1e-6, 1e-10)]
    assert values == sorted(values)
    assert values[0] > 1.0
    assert values[-1] < 1.5


def _integral(function, edges):
    width = np.diff(edges)[:, None]
    return ((function(edges[:-1, None] + width * q.NODES_24) @ q.WEIGHTS_24) * width[:, 0]).sum(axis=-1)


def test_panels_shrink_towards_a_peak_and_meet_the_tolerance():
    def function(t):
        return np.stack([1.0 / (1e-8 + (t - 0.3) ** 2), np.cos(t)])

    exact = 1e4 * (np.arctan(0.7e4) + np.arctan(0.3e4))
    for tolerance in (1e-4, 1e-8, 1e-12):
        edges, converged = q.adaptive_panels(function, np.array([0.0, 1.0]), tolerance)
        assert converged
        assert edges[0] == 0.0
        assert edges[-1] == 1.0
        assert (np.diff(edges) > 0.0).all()
        assert np.diff(edges).min() < 1e-3 < np.diff(edges).max()
        found = _integral(function, edges)
        assert found[0] == pytest.approx(exact, rel=10 * tolerance)
        assert found[1] == pytest.approx(np.sin(1.0), rel=1e-14)


def test_breaks_are_edges_and_a_smooth_function_needs_no_more():
    breaks = np.array([0.0, 0.2, 0.7, 1.0])
    edges, converged = q.adaptive_panels(lambda t: np.abs(t - 0.2)[None], breaks, 1e-12)
    assert converged
    np.testing.assert_array_equal(edges, breaks)


def test_a_divergent_integral_is_reported_after_finite_work():
    edges, converged = q.adaptive_panels(lambda t: 1.0 / np.abs(t - 0.3)[None], np.array([0.0, 1.0]), 1e-6)
    assert not converged
    assert np.diff(edges).min() == pytest.approx(0.5**q.DEEPEST)
    assert edges.size < 500


def test_noise_is_not_chased():
    rng = np.random.default_rng(0)
    edges, converged = q.adaptive_panels(
        lambda t: 1.0 + 1e-3 * rng.normal(size=(1, *t.shape)), np.array([0.0, 1.0]), 1e-9
    )
    assert not converged
    assert edges.size < 5000
