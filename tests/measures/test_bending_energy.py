"""∫κ² ds against closed forms and scipy's quadrature."""

import numpy as np
import pytest
from scipy.integrate import quad

from batten.curves.bezier import CubicBezier
from batten.curves.piecewise import PiecewiseCurve
from batten.measures.bending_energy import bending_energy


def test_a_full_circle_has_4_pi_squared_over_its_length(arc):
    circle = arc(0.3, 1.0, 2 * np.pi)
    assert bending_energy(circle) * circle.length == pytest.approx(4 * np.pi**2, rel=1e-13)


@pytest.mark.parametrize("height", [0.01, 1.0, 30.0, 1e4])
def test_a_parabola_however_sharp(height):
    """y = h x² on [−1, 1]: 2h ∫ du/(1 + u²)^(5/2) over |u| ≤ 2h, in closed form."""
    u = 2 * height
    exact = 2 * height * 2 * u * (3 + 2 * u**2) / (3 * (1 + u**2) ** 1.5)
    control = [(-1, height), (-1 / 3, -height / 3), (1 / 3, -height / 3), (1, height)]
    assert bending_energy(control, tolerance=1e-9) == pytest.approx(exact, rel=1e-9)
    assert 2 * height * quad(lambda v: (1 + v * v) ** -2.5, -min(u, 50), min(u, 50))[0] == pytest.approx(
        exact, rel=1e-6
    )


def test_random_cubics(random_cubics):
    control, expected = random_cubics
    np.testing.assert_allclose(bending_energy(control, tolerance=1e-9), expected[:, 1], rtol=1e-8)


def test_pieces_add_up_and_scale():
    curve = CubicBezier([(0, 0), (0.2, 0.7), (0.9, 0.5), (1, 0)])
    whole = bending_energy(curve, tolerance=1e-10)
    assert bending_energy(PiecewiseCurve(curve.split(0.4)), tolerance=1e-10) == pytest.approx(whole, rel=1e-9)
    assert bending_energy(7.0 * curve.control_points, tolerance=1e-10) == pytest.approx(whole / 7.0, rel=1e-9)
    assert bending_energy([(0, 0), (1, 1), (2, 2), (3, 3)]) == 0.0
    assert bending_energy([(0, 0), (1, 1), (0, 1), (1, 0)]) == np.inf
