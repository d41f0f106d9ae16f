"""Lofts against the curves they are made of and against scipy's splines across."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from batten.curves.bspline import BSplineCurve
from batten.errors import InvalidInputError
from batten.surfaces.loft import compatible, loft

RNG = np.random.default_rng(5)


def mixed_curves() -> list[BSplineCurve]:
    """Five splines of different degrees and knots, with another parameter range, a kink and an unclamped start."""
    x = np.linspace(0, 3000, 6)
    rows = [np.stack([x[:n] * 5 / (n - 1), RNG.normal(size=n) * 200], axis=1) for n in (6, 6, 5, 6, 6)]
    return [
        BSplineCurve([0, 0, 0, 0, 1, 2, 3, 3, 3, 3], rows[0], 3),
        BSplineCurve([0, 0, 0, 0, 0.9, 2.4, 3, 3, 3, 3], rows[1], 3),
        BSplineCurve([-7, -7, -7, 2, 4, 5, 5, 5], rows[2], 2),
        BSplineCurve([0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1], rows[3], 5),
        BSplineCurve([0, 1, 2, 3, 3.5, 3.5, 4, 4, 4, 4], rows[4], 3),
    ]


@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_surface_holds_every_curve(axis: str) -> None:
    curves, positions = mixed_curves(), np.array([-100.0, 0.0, 450.0, 700.0, 1500.0])
    surface = loft(curves, positions, blade_axis=axis)  # type: ignore[arg-type]
    t = np.linspace(0, 1, 97)
    for curve, position in zip(curves, positions):
        wanted = np.insert(curve.point(t), 1 if axis == "x" else 0, position, axis=1)
        assert np.abs(surface.point(t, position) - wanted).max() < 1e-9
    assert surface.domain == ((0.0, 1.0), (-100.0, 1500.0))


def test_across_it_is_the_not_a_knot_cubic() -> None:
    curves, positions = mixed_curves(), np.array([-100.0, 0.0, 450.0, 700.0, 1500.0])
    surface = loft(curves, positions)
    t, v = np.linspace(0, 1, 13), np.linspace(-100, 1500, 50)
    heights = np.stack([curve.point(t)[:, 1] for curve in curves])
    wanted = CubicSpline(positions, heights, bc_type="not-a-knot")(v)
    assert surface.point(t, v[:, None])[..., 2] == pytest.approx(wanted, abs=1e-9)
    assert surface.point(t, v[:, None])[..., 1] == pytest.approx(np.broadcast_to(v[:, None], (50, 13)), abs=1e-9)


@pytest.mark.parametrize(("count", "degree"), [(2, 1), (3, 2), (4, 3), (5, 3)])
def test_few_curves_lower_the_degree_across(count: int, degree: int) -> None:
    surface = loft(mixed_curves()[:count], np.arange(count))
    assert surface.degree_v == degree


def test_a_cubic_surface_comes_back_from_its_own_sections() -> None:
    # z = (x/1000)³ − x v²/1e6 + v³/1e6 is cubic along and across: four sections determine it.
    u = np.linspace(0, 3000, 7)

    def height(x: np.ndarray, v: float) -> np.ndarray:
        return (x / 1000) ** 3 * 100 - x * v**2 / 1e6 + v**3 / 1e6

    positions = [0.0, 300.0, 800.0, 1500.0]
    curves = [BSplineCurve.interpolate(np.stack([u, height(u, v)], axis=1), u) for v in positions]
    t = np.linspace(0, 1, 31)
    for v in (100.0, 1111.0):
        assert loft(curves, positions).point(t, v)[:, 2] == pytest.approx(height(3000 * t, v), abs=1e-9)


def test_compatible_curves_are_the_same_curves() -> None:
    curves = mixed_curves()
    knots, degree, rows = compatible(curves)
    assert degree == 5
    t = np.linspace(0, 1, 71)
    for curve, row in zip(curves, rows):
        assert np.abs(BSplineCurve(knots, row, degree).point(t) - curve.point(t)).max() < 1e-10


def test_knots_that_differ_by_rounding_are_one() -> None:
    a = BSplineCurve([0, 0, 1 / 3, 1, 1], [(0, 0), (1, 1), (3, 0)], 1)
    b = BSplineCurve([0, 0, 1 / 3 + 1e-14, 1, 1], [(0, 1), (1, 2), (3, 1)], 1)
    assert len(compatible([a, b])[0]) == 5


@pytest.mark.parametrize(
    ("positions", "message"),
    [
        ([0.0], "positions of shape"),
        ([0.0, 0.0], "strictly ascending"),
        ([1.0, 0.0], "ascending"),
        ([0, np.nan], "finite"),
    ],
)
def test_bad_positions_get_one_clear_line(positions: list[float], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message) as caught:
        loft(mixed_curves()[:2], positions)
    assert "\n" not in str(caught.value)


def test_one_curve_or_another_axis_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="1 curves"):
        loft(mixed_curves()[:1], [0.0])
    with pytest.raises(InvalidInputError, match="blade_axis = 'z'"):
        loft(mixed_curves()[:2], [0.0, 1.0], blade_axis="z")  # type: ignore[arg-type]
