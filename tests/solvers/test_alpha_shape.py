"""α-shapes against convex hulls, known areas, and the definition."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull, Delaunay

from batten.errors import InvalidInputError
from batten.solvers.alpha_shape import alpha_shape, polygons_of
from batten.solvers.region_polygons import signed_area


def disc(count, seed, inner=0.0):
    rng = np.random.default_rng(seed)
    radius, angle = np.sqrt(rng.uniform(inner**2, 1.0, count)), rng.uniform(0.0, 2.0 * np.pi, count)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def test_an_infinite_radius_gives_the_convex_hull():
    for seed in range(5):
        points = np.random.default_rng(seed).normal(size=(200, 2)) * (3.0, 0.2) + (1e3, -50.0)
        shape, hull = alpha_shape(points, np.inf), ConvexHull(points)
        assert len(shape.rings) == 1
        assert shape.area == pytest.approx(hull.volume, rel=1e-9)
        corners = {tuple(p) for p in points[hull.vertices]}
        assert corners <= {tuple(p) for p in shape.rings[0]}


def test_an_annulus_has_one_hole_and_its_areas():
    shape = alpha_shape(disc(20_000, 3, inner=0.5), 0.1)
    assert [signed_area(ring) > 0 for ring in shape.rings] == [True, False]
    assert signed_area(shape.rings[0]) == pytest.approx(np.pi, rel=0.01)
    assert signed_area(shape.rings[1]) == pytest.approx(-0.25 * np.pi, rel=0.01)
    assert shape.area == pytest.approx(0.75 * np.pi, rel=0.02)
    (polygon,) = shape.polygons
    assert len(polygon.holes) == 1
    assert polygon.area == pytest.approx(shape.area, rel=1e-12)
    assert shape.contains([(0.0, 0.0), (0.75, 0.0), (2.0, 0.0)]).tolist() == [False, True, False]


def test_the_hole_closes_at_its_own_radius():
    """A ring of points on a circle of radius 1, and one on radius 2: the inner disc is filled from radius 1 on."""
    angle = 2.0 * np.pi * np.arange(60) / 60
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    points = np.concatenate([circle, 1.5 * circle, 2.0 * circle])
    assert len(alpha_shape(points, 0.999).rings) == 2
    assert len(alpha_shape(points, 1.001).rings) == 1


@pytest.mark.parametrize("radius", [0.03, 0.05, 0.08, 0.2])
def test_inside_is_what_the_definition_says(radius):
    """Independent of the rings: a place is inside if its Delaunay triangle has a circumcircle that is small enough."""
    points = disc(800, 11)
    shape = alpha_shape(points, radius)
    triangulation = Delaunay(points)
    corners = points[triangulation.simplices]
    a, b, c = (np.linalg.norm(corners[:, i] - corners[:, j], axis=1) for i, j in ((0, 1), (1, 2), (2, 0)))
    half = 0.5 * (a + b + c)
    area = np.sqrt(np.maximum(half * (half - a) * (half - b) * (half - c), 0.0))
    kept = a * b * c / (4.0 * area) <= radius
    places = np.random.default_rng(1).uniform(-1.1, 1.1, (5_000, 2))
    number = triangulation.find_simplex(places)
    assert np.array_equal(shape.contains(places), (number >= 0) & kept[number])
    assert shape.area == pytest.approx(area[kept].sum(), rel=1e-9)
    assert sum(polygon.area for polygon in shape.polygons) == pytest.approx(shape.area, rel=1e-9)


def test_rings_are_simple_and_run_with_the_inside_on_their_left():
    """At a radius of many holes that touch each other: no ring passes a point twice, and its left side is inside."""
    shape = alpha_shape(disc(500, 5), 0.055)
    assert len(shape.rings) > 10
    for ring in shape.rings:
        assert len(np.unique(ring, axis=0)) == len(ring)
        ahead = np.roll(ring, -1, axis=0) - ring
        left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=-1)
        middle = ring + 0.5 * ahead
        assert shape.contains(middle + 1e-7 * left).all()
        assert not shape.contains(middle - 1e-7 * left).any()


def test_a_grid_is_filled_by_default_and_its_scale_does_not_matter():
    x, y = np.meshgrid(np.arange(12.0), np.arange(9.0))
    grid = np.stack([x, y], axis=-1).reshape(-1, 2)
    shape = alpha_shape(grid)
    assert shape.radius == pytest.approx(2.5 / np.sqrt(2.0))
    assert (len(shape.rings), shape.area) == (1, pytest.approx(88.0))
    assert alpha_shape(1e-6 * grid).area == pytest.approx(88e-12)
    assert alpha_shape(np.concatenate([grid, grid[::2], [[np.nan, 0.0]]])).area == pytest.approx(88.0)


def test_holes_belong_to_the_ring_around_them():
    square = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    rings = [4.0 * square, (3.0 * square + 0.5)[::-1], square + 1.0, (0.5 * square + 1.25)[::-1], square + 10.0]
    polygons = polygons_of(rings)
    assert polygons[0].area == 7.0
    assert sorted(polygon.area for polygon in polygons[1:]) == [0.75, 1.0]


def test_degenerate_input():
    for points in (np.empty((0, 2)), [(0.0, 0.0)], [(0.0, 0.0)] * 9, np.arange(12.0).reshape(-1, 2)):
        assert (alpha_shape(points, 1.0).rings, alpha_shape(points).area) == ((), 0.0)
    for bad in (np.zeros((4, 3)), np.zeros(4)):
        with pytest.raises(InvalidInputError, match="shape"):
            alpha_shape(bad)
    for radius in (0.0, -1.0, np.nan):
        with pytest.raises(InvalidInputError, match="radius"):
            alpha_shape(np.eye(2), radius)
