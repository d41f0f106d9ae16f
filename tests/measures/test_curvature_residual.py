"""e_r = √L‖r‖₂ against quadrature, and its invariance."""

import numpy as np
import pytest

from batten.curves.similarity import Similarity
from batten.measures.curvature_residual import curvature_residual


def test_against_quadrature(random_cubics):
    control, expected = random_cubics
    scale = np.sqrt(expected[:, 0] * expected[:, 1])
    error = np.abs(curvature_residual(control, tolerance=1e-9) - np.sqrt(expected[:, 0]) * expected[:, 2])
    assert (error / scale).max() < 1e-8


def test_is_invariant_and_vanishes_with_the_curvature(arc):
    arch = np.array([(0, 0), (0.2, 0.7), (0.9, 0.5), (1, 0)])
    value = curvature_residual(arch)
    assert value > 0.01
    assert curvature_residual(Similarity(40.0, 2.0, (1.0, 2.0)).apply(arch)) == pytest.approx(value, rel=1e-9)
    flat = [curvature_residual(arch * [1.0, height]) for height in (1e-2, 1e-3)]
    assert flat[0] / flat[1] == pytest.approx(10.0, rel=0.01)
    assert curvature_residual(arc(3.0, 0.0, 2.0)) < 1e-13
    assert curvature_residual([(0, 0), (1, 1), (0, 1), (1, 0)]) == np.inf
