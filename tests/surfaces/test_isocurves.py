"""Isocurves as exact cubics against scipy's splines of the same surfaces, residuals against a plain least-squares fit."""

import numpy as np
import pytest

from batten.curves.bspline import BSplineCurve
from batten.errors import InvalidInputError
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.isocurves import IsocurveResiduals, isocurve_pieces, isocurve_residuals
from batten.surfaces.loft import loft

RNG = np.random.default_rng(54)
POSITIONS = np.array([-200.0, 0.0, 350.0, 700.0, 1500.0])


def curves(degree, knots, count=5):
    n = len(knots) - degree - 1
    x = np.linspace(0.0, 3000.0, n)
    return [BSplineCurve(knots, np.stack([x, RNG.normal(size=n) * 200.0], axis=1), degree) for _ in range(count)]


def cubics(t, control):
    basis = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3], axis=-1)
    return basis @ control


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize(
    ("degree", "knots"),
    [
        (3, [0, 0, 0, 0, 1, 1, 2, 2, 2, 2]),  # C¹
        (3, [0, 0, 0, 0, 1, 1.7, 3, 3, 3, 3]),  # C²
        (2, [0, 0, 0, 1, 3, 3, 3]),
        (1, [0, 0, 1, 2, 2]),
        (3, [-7, -6, -7 + 2, 0, 1, 1, 2, 3, 3.5, 4]),  # unclamped
    ],
)
def test_pieces_are_the_isocurves(degree, knots, axis):
    surface = loft(curves(degree, np.sort(knots).astype(float)), POSITIONS, blade_axis=axis)
    at = np.array([-200.0, -13.0, 350.0, 1499.0, 1500.0])
    pieces = isocurve_pieces(surface, at)
    borders = np.unique(surface.knots_u)
    assert pieces.shape == (5, len(borders) - 1, 4, 2)
    t = np.linspace(0.0, 1.0, 11)
    for v, rows in zip(at, pieces):
        spline = surface.isocurve("u", v)
        for a, b, control in zip(borders[:-1], borders[1:], rows):
            wanted = spline(a + (b - a) * t)[:, [0, 2] if axis == "x" else [1, 2]]
            assert np.abs(cubics(t, control) - wanted).max() < 1e-9


def plain_residual(control):
    """e_λ by Simpson's rule and a dense least-squares fit of κ by affine functions, in the piece's own scale."""
    t = np.linspace(0.0, 1.0, 20001)
    p = cubics(t, control)
    d = cubics_derivative(t, control)
    first, last = control[2] - 2 * control[1] + control[0], control[3] - 2 * control[2] + control[1]
    dd = 6.0 * ((1 - t)[:, None] * first + t[:, None] * last)
    speed = np.hypot(*d.T)
    kappa = (d[:, 0] * dd[:, 1] - d[:, 1] * dd[:, 0]) / speed**3
    w = np.ones(len(t))
    w[1:-1:2], w[2:-1:2] = 4.0, 2.0
    w = np.sqrt(w * speed)
    q = (p - p.mean(axis=0)) / np.ptp(p)
    rows = np.column_stack([q[:, 1], q[:, 0], np.ones(len(t))]) * w[:, None]
    rest = kappa * w - rows @ np.linalg.lstsq(rows, kappa * w, rcond=None)[0]
    return np.linalg.norm(rest) / np.linalg.norm(kappa * w)


def cubics_derivative(t, control):
    a, b, c = np.diff(control, axis=0)
    return 3.0 * ((1 - t)[:, None] ** 2 * a + 2 * (t * (1 - t))[:, None] * b + t[:, None] ** 2 * c)


def test_residuals_are_those_of_every_piece():
    surface = loft(curves(3, np.array([0, 0, 0, 0, 1, 1, 2, 2, 2, 2.0])), POSITIONS)
    found = isocurve_residuals(surface, 7)
    assert found.positions == pytest.approx(np.linspace(-200.0, 1500.0, 7))
    pieces = isocurve_pieces(surface, found.positions)
    wanted = np.array([[plain_residual(control) for control in rows] for rows in pieces])
    assert found.residuals == pytest.approx(wanted, abs=2e-6)
    assert found.worst == pytest.approx(wanted.max(), abs=2e-6)
    assert found.worst_position == found.positions[np.argmax(wanted.max(axis=1))]


def test_the_worst_and_where():
    found = IsocurveResiduals(np.array([1.0, 2.0, 3.0]), np.array([[0.1, 0.3], [0.22, 0.1], [0.0, np.nan]]))
    assert found.greatest.tolist() == [0.3, 0.22, np.inf]
    assert (found.worst, found.worst_position) == (np.inf, 3.0)
    assert found.above(0.22).tolist() == [True, True, True]  # the threshold itself is not below it
    assert found.above(0.25).tolist() == [True, False, True]


def test_what_has_no_cubic_isocurves_is_refused():
    surface = loft(curves(3, np.array([0, 0, 0, 0, 1, 1, 1, 1.0])), POSITIONS)
    for at in ([-201.0], [np.nan], [], [[0.0]]):
        with pytest.raises(InvalidInputError, match="v of shape"):
            isocurve_pieces(surface, at)
    with pytest.raises(InvalidInputError, match="2 or more"):
        isocurve_residuals(surface, 1)
    net = surface.control_points
    weighted = BSplineSurface(surface.knots_u, surface.knots_v, 3, 3, net, 1.0 + RNG.random(net.shape[:2]))
    with pytest.raises(InvalidInputError, match="rational"):
        isocurve_pieces(weighted, [0.0])
    steep = loft(curves(5, np.repeat([0.0, 1.0], 6)), POSITIONS)
    with pytest.raises(InvalidInputError, match="degree 5"):
        isocurve_pieces(steep, [0.0])
    c, s = np.cos(0.1), np.sin(0.1)
    turned = surface.transformed([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    with pytest.raises(InvalidInputError, match="planes of constant"):
        isocurve_pieces(turned, [0.0])
