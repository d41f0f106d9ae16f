"""Nearest points and line intersections against closed forms and brute force."""

import math

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.search import closest_parameters, parameters_along

RNG = np.random.default_rng(3)


def quarter_cylinder(radius: float = 5.0) -> BSplineSurface:
    """A quarter of a cylinder about the y axis, 0 ≤ y ≤ 2, from (r, y, 0) to (0, y, r)."""
    arc = np.array([(radius, 0, 0), (radius, 0, radius), (0, 0, radius)], dtype=float)
    weights = np.array([1.0, math.sqrt(0.5), 1.0])[:, None] * np.ones(2)
    return BSplineSurface(
        [0, 0, 0, 1, 1, 1], [0, 0, 1, 1], 2, 1, np.stack([arc, arc + np.array([0.0, 2.0, 0.0])], axis=1), weights
    )


def relief() -> BSplineSurface:
    """A bicubic wall with waves, whose plan coordinates are not affine in the parameters."""
    x, y = np.meshgrid(np.linspace(0, 3000, 8), np.linspace(0, 2000, 7), indexing="ij")
    z = 300 * np.sin(x / 500) * np.cos(y / 400)
    net = np.stack([x + 60 * np.sin(y / 300), y + 50 * np.cos(x / 400), z], axis=-1)
    knots = [[0.0] * 3 + list(np.linspace(0, 1, n - 2)) + [1.0] * 3 for n in (8, 7)]
    return BSplineSurface(*knots, 3, 3, net)


def test_vertical_lines_meet_the_cylinder_where_the_circle_says() -> None:
    x, y = RNG.uniform(0.1, 4.99, (4, 60)), RNG.uniform(0, 2, (4, 60))
    u, v = parameters_along(quarter_cylinder(), np.stack([x, y, np.full_like(x, -3.0)], axis=-1), (0, 0, 2))
    points = quarter_cylinder().point(u, v)
    assert u.shape == (4, 60)
    assert points == pytest.approx(np.stack([x, y, np.sqrt(25 - x**2)], axis=-1), abs=2e-12)


def test_slanted_lines_reach_the_surface_to_rounding() -> None:
    surface, direction = relief(), np.array([0.2, -0.1, 1.0])
    u, v = RNG.uniform(0, 1, 500), RNG.uniform(0, 1, 500)
    start = surface.point(u, v) + RNG.normal(size=(500, 1)) * 100 * direction
    s, t = parameters_along(surface, start, direction)
    miss = np.cross(surface.point(s, t) - start, direction / np.linalg.norm(direction))
    assert np.abs(miss).max() < 1e-9
    assert surface.is_graph_along(direction)
    assert s == pytest.approx(u, abs=1e-12)
    assert t == pytest.approx(v, abs=1e-12)


def test_searches_along_many_directions_do_not_mix() -> None:
    surface = relief()
    u, v = RNG.uniform(0, 1, 50), RNG.uniform(0, 1, 50)
    points = surface.point(u, v)
    for tilt in [
        *np.linspace(-0.2, 0.2, 10),
        -0.2,
    ]:  # more directions than search trees are kept, and the first once more
        s, t = parameters_along(surface, points + np.array([100 * tilt, 0.0, 100.0]), (tilt, 0.0, 1.0))
        assert np.stack([s, t]) == pytest.approx(np.stack([u, v]), abs=1e-12)
        s, t = closest_parameters(surface, points)
        assert np.stack([s, t]) == pytest.approx(np.stack([u, v]), abs=1e-7)


def test_lines_beside_the_surface_miss_it_unless_it_is_extended() -> None:
    surface = quarter_cylinder()
    lines = np.array([[3.0, 2.5, 0.0], [3.0, 1.0, 0.0], [9.0, 1.0, 0.0], [np.nan, 1.0, 0.0]])
    u, v = parameters_along(surface, lines, (0, 0, 1))
    assert np.isnan(u).tolist() == np.isnan(v).tolist() == [True, False, True, True]
    u, v = parameters_along(surface, lines, (0, 0, 1), extend=0.25)
    assert surface.point(u[0], v[0], extend=0.25) == pytest.approx([3.0, 2.5, 4.0], abs=1e-12)
    assert np.isnan(u[2:]).all()


def test_nearest_points_of_a_cylinder() -> None:
    angle, y, r = RNG.uniform(0.05, 1.5, 200), RNG.uniform(0, 2, 200), RNG.uniform(2, 9, 200)
    points = np.stack([r * np.cos(angle), y, r * np.sin(angle)], axis=-1)
    u, v = closest_parameters(quarter_cylinder(), points)
    foot = quarter_cylinder().point(u, v)
    assert foot == pytest.approx(np.stack([5 * np.cos(angle), y, 5 * np.sin(angle)], axis=-1), abs=1e-6)
    assert np.linalg.norm(foot - points, axis=1) == pytest.approx(np.abs(r - 5), abs=1e-12)


def test_nearest_points_on_the_border_and_beyond() -> None:
    surface = quarter_cylinder()
    points = np.array([[5.0, 3.0, -4.0], [6.0, 1.0, -1.0], [0.0, -1.0, 9.0], [np.nan, 0.0, 0.0]])
    u, v = closest_parameters(surface, points)
    assert surface.point(u, v)[:3] == pytest.approx(np.array([[5, 2, 0], [5, 1, 0], [0, 0, 5]]), abs=1e-12)
    assert np.isnan([u[3], v[3]]).all()
    u, v = closest_parameters(surface, points[:1], extend=1.0)
    assert surface.point(u, v, extend=1.0)[0, 1] == pytest.approx(3.0, abs=1e-9)


def test_nothing_on_a_dense_grid_is_nearer() -> None:
    surface = relief()
    points = surface.point(RNG.uniform(0, 1, 60), RNG.uniform(0, 1, 60)) + RNG.normal(size=(60, 3)) * 30
    u, v = surface.closest_parameters(points)
    ours = np.linalg.norm(surface.point(u, v) - points, axis=1)
    t = np.linspace(0, 1, 401)
    grid = surface.point(t[:, None], t).reshape(-1, 3)
    theirs = np.array([np.linalg.norm(grid - p, axis=1).min() for p in points])
    assert (ours <= theirs + 1e-9).all()
    assert (theirs - ours).max() < 8.0  # half the grid's spacing: the same foot


def test_bad_input_gets_one_clear_line() -> None:
    with pytest.raises(InvalidInputError, match=r"got shape \(2,\)"):
        parameters_along(relief(), [1.0, 2.0], (0, 0, 1))
    with pytest.raises(InvalidInputError, match="direction"):
        parameters_along(relief(), [1.0, 2.0, 3.0], (0, 0, 0))
    with pytest.raises(InvalidInputError, match="extend"):
        closest_parameters(relief(), [1.0, 2.0, 3.0], extend=-1.0)
