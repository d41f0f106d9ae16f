"""Surfaces against scipy's tensor products, closed forms and finite differences."""

import math

import numpy as np
import pytest
from scipy.interpolate import NdBSpline

from batten.errors import InvalidInputError
from batten.surfaces.bspline_surface import BSplineSurface

RNG = np.random.default_rng(7)
KNOTS_U = [0.0, 0, 0, 0, 1, 2.5, 4, 4, 4, 4]
KNOTS_V = [-1.0, -1, -1, 0.2, 0.2, 1, 1, 1]
NET = RNG.normal(size=(6, 5, 3))


def wavy() -> BSplineSurface:
    return BSplineSurface(KNOTS_U, KNOTS_V, 3, 2, NET)


def cylinder(radius: float = 5.0, height: float = 2.0) -> BSplineSurface:
    """A quarter of a cylinder about the y axis, exact as a rational surface: x² + z² = radius²."""
    arc = np.array([(radius, 0, 0), (radius, 0, radius), (0, 0, radius)], dtype=float)
    net = np.stack([arc, arc + np.array([0.0, height, 0.0])], axis=1)
    weights = np.array([1.0, math.sqrt(0.5), 1.0])[:, None] * np.ones(2)
    return BSplineSurface([0, 0, 0, 1, 1, 1], [0, 0, 1, 1], 2, 1, net, weights)


@pytest.mark.parametrize("nu", [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)])
def test_points_and_derivatives_are_those_of_scipy(nu: tuple[int, int]) -> None:
    u, v = RNG.uniform(0, 4, (3, 50)), RNG.uniform(-1, 1, (3, 50))
    theirs = NdBSpline((np.array(KNOTS_U), np.array(KNOTS_V)), NET, (3, 2))(np.stack([u, v], axis=-1), nu=nu)
    ours = wavy().derivatives(u, v, 2)[nu]
    assert ours.shape == (3, 50, 3)
    assert np.abs(ours - theirs).max() < 1e-12 * np.abs(theirs).max()


def test_a_rational_surface_is_exactly_a_cylinder() -> None:
    u, v = RNG.uniform(-0.2, 1.2, 200), RNG.uniform(0, 1, 200)
    d = cylinder().derivatives(u, v, 2, extend=0.3)
    p, du, duu = d[0, 0], d[1, 0], d[2, 0]
    assert np.hypot(p[:, 0], p[:, 2]) == pytest.approx(np.full(200, 5.0), abs=1e-13)
    # x² + z² = 25, differentiated once and twice along u.
    assert (p * du)[:, [0, 2]].sum(axis=1) == pytest.approx(np.zeros(200), abs=1e-11)
    assert (du * du + p * duu)[:, [0, 2]].sum(axis=1) == pytest.approx(np.zeros(200), abs=1e-10)
    assert d[0, 1] == pytest.approx(np.broadcast_to((0.0, 2.0, 0.0), (200, 3)), abs=1e-12)


def test_rational_derivatives_agree_with_differences() -> None:
    weights = RNG.uniform(0.5, 2.0, (6, 5))
    surface = BSplineSurface(KNOTS_U, KNOTS_V, 3, 2, NET, weights)
    u, v, h = np.array([0.3, 1.7, 3.9]), np.array([-0.5, 0.1, 0.8]), 1e-5
    d = surface.derivatives(u, v, 2)
    plus_u, minus_u = surface.derivatives(u + h, v, 1), surface.derivatives(u - h, v, 1)
    plus_v, minus_v = surface.derivatives(u, v + h, 1), surface.derivatives(u, v - h, 1)
    assert d[1, 0] == pytest.approx((plus_u[0, 0] - minus_u[0, 0]) / (2 * h), abs=1e-8)
    assert d[0, 1] == pytest.approx((plus_v[0, 0] - minus_v[0, 0]) / (2 * h), abs=1e-8)
    assert d[2, 0] == pytest.approx((plus_u[1, 0] - minus_u[1, 0]) / (2 * h), abs=1e-7)
    assert d[1, 1] == pytest.approx((plus_v[1, 0] - minus_v[1, 0]) / (2 * h), abs=1e-7)
    assert d[0, 2] == pytest.approx((plus_v[0, 1] - minus_v[0, 1]) / (2 * h), abs=1e-7)


def test_equal_weights_make_it_polynomial() -> None:
    surface = BSplineSurface(KNOTS_U, KNOTS_V, 3, 2, NET, np.full((6, 5), 3.0))
    assert not surface.is_rational
    assert cylinder().is_rational


def test_extension_continues_the_border_polynomial_and_stops_where_told() -> None:
    # z = u³ over one span, so the continuation is known.
    cubic = BSplineSurface(
        [0, 0, 0, 0, 1, 1, 1, 1],
        [0, 0, 1, 1],
        3,
        1,
        np.stack([np.array([(i / 3, y, float(i == 3)) for i in range(4)]) for y in (0.0, 1.0)], axis=1),
    )
    assert cubic.point(1.5, 0.5, extend=0.5)[2] == pytest.approx(1.5**3, rel=1e-14)
    assert np.isnan(cubic.point(1.5001, 0.5, extend=0.5)).all()
    assert np.isnan(cubic.point([np.nan, 1.0 + 1e-9], 0.5)).all()
    assert cubic.point(1.0 + 1e-14, 0.5)[2] == pytest.approx(1.0)  # rounding is no overhang
    assert cubic.point(1e6, 0.5, extend=np.inf)[2] == pytest.approx(1e18, rel=1e-9)


def test_one_bad_row_spoils_nothing() -> None:
    u = np.array([0.5, np.nan, 9.0, np.inf, 2.0])
    points = wavy().point(u, 0.0)
    assert np.isnan(points).all(axis=1).tolist() == [False, True, True, True, False]
    assert (points[0] == wavy().point(0.5, 0.0)).all()


@pytest.mark.parametrize("direction", ["u", "v"])
def test_isocurves_lie_on_the_surface(direction: str) -> None:
    s = wavy()
    at = 0.37
    t = np.linspace(*s.domain[0 if direction == "u" else 1], 30)
    curve = s.isocurve(direction, at)  # type: ignore[arg-type]
    assert curve(t) == pytest.approx(s.point(t, at) if direction == "u" else s.point(at, t), abs=1e-13)


def test_an_affine_map_moves_points_and_bad_ones_are_refused() -> None:
    s = wavy()
    turn = np.eye(4)
    turn[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    turn[:3, 3] = [1, 2, 3]
    assert s.transformed(turn).point(1.0, 0.0) == pytest.approx(turn[:3, :3] @ s.point(1.0, 0.0) + [1, 2, 3])
    assert s.scaled(25.4).point(1.0, 0.0) == pytest.approx(25.4 * s.point(1.0, 0.0))
    for bad in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InvalidInputError, match="mm_per_unit"):
            s.scaled(bad)
    with pytest.raises(InvalidInputError, match="affine"):
        s.transformed(np.full((4, 4), 1.0))


@pytest.mark.parametrize("surface", [wavy(), cylinder()], ids=["wavy", "cylinder"])
def test_the_bounding_box_holds_the_surface_tightly(surface: BSplineSurface) -> None:
    u, v = (np.linspace(a, b, 201) for a, b in surface.domain)
    points = surface.point(u[:, None], v).reshape(-1, 3)
    low, high = surface.bounding_box()
    assert (low <= points.min(axis=0) + 1e-12).all()
    assert (high >= points.max(axis=0) - 1e-12).all()
    size = float(np.ptp(surface.control_points.reshape(-1, 3), axis=0).max())
    assert np.abs(low - points.min(axis=0)).max() < 0.003 * size
    assert np.abs(high - points.max(axis=0)).max() < 0.003 * size


def height_field(fold: float) -> BSplineSurface:
    """A graph over the plan for fold < 1/3 of the spacing; beyond, it overhangs in the middle."""
    x, y = np.meshgrid(np.arange(6.0), np.arange(6.0), indexing="ij")
    net = np.stack([x + fold * np.where(x == 2, 1, np.where(x == 3, -1, 0)), y, np.sin(x) * np.cos(y)], axis=-1)
    knots = [0.0, 0, 0, 0, 1, 2, 3, 3, 3, 3]
    return BSplineSurface(knots, knots, 3, 3, net)


def test_graph_over_plan() -> None:
    assert height_field(0.0).is_graph_over_plan()
    assert not height_field(2.0).is_graph_over_plan()
    assert not cylinder().is_graph_along((0, 1, 0))
    assert cylinder().is_graph_along((1, 0, 1))
    # Locally one to one everywhere, and yet a ramp that turns once and a half covers part of its plan twice.
    angle = np.linspace(0.0, 3 * math.pi, 40)
    ramp = np.stack([np.stack([r * np.cos(angle), r * np.sin(angle), angle], axis=-1) for r in (1.0, 2.0)], axis=1)
    knots = np.concatenate([[0.0], np.arange(40), [39.0]])
    assert not BSplineSurface(knots, [0, 0, 1, 1], 1, 1, ramp).is_graph_over_plan()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"control_points": np.zeros((6, 5, 2))}, r"got shape \(6, 5, 2\)"),
        ({"control_points": np.where(np.arange(90).reshape(6, 5, 3) == 34, np.nan, 1.0)}, r"point \(2, 1\)"),
        ({"weights": np.zeros((6, 5))}, "positive weights"),
        ({"weights": np.ones((5, 6))}, "positive weights"),
        ({"degree_u": 2}, "knots_u"),
        ({"knots_v": KNOTS_V[:-1]}, "knots_v"),
    ],
)
def test_bad_input_gets_one_clear_line(change: dict[str, object], message: str) -> None:
    good: dict[str, object] = {
        "knots_u": KNOTS_U,
        "knots_v": KNOTS_V,
        "degree_u": 3,
        "degree_v": 2,
        "control_points": NET,
    }
    with pytest.raises(InvalidInputError, match=message) as caught:
        BSplineSurface(**{**good, **change})  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


def test_bad_arguments_of_methods() -> None:
    with pytest.raises(InvalidInputError, match="order = 3"):
        wavy().derivatives(0.0, 0.0, 3)
    with pytest.raises(InvalidInputError, match="extend"):
        wavy().point(0.0, 0.0, extend=-0.1)
    with pytest.raises(InvalidInputError, match="isocurve"):
        wavy().isocurve("u", 7.0)
    with pytest.raises(InvalidInputError, match="isocurve"):
        cylinder().isocurve("u", 0.5)
    with pytest.raises(InvalidInputError, match="direction"):
        wavy().is_graph_along((0, 0, 0))


def test_the_surface_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        wavy().control_points[0, 0, 0] = 1.0
