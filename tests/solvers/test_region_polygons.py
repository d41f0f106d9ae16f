"""Polygons with holes: areas, what is inside, what is nearest, which ring belongs to which."""

import numpy as np

from batten.solvers.region_polygons import Polygon, inside_polygons, nearest_on_polygons, polygons_of_rings, signed_area

SQUARE = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)])
HOLE = np.array([(1.0, 1.0), (1.0, 3.0), (3.0, 3.0), (3.0, 1.0)])
FAR = SQUARE + np.array([10.0, 0.0])


def test_rings_become_polygons_by_where_they_lie():
    inner = 0.25 * SQUARE + 1.5  # an island in the hole
    rings = [HOLE, FAR, SQUARE, inner]
    polygons, numbers = polygons_of_rings(rings, np.array([(0.5, 0.5), (2.0, 2.0)]))
    assert sorted(numbers) == [2, 3]
    assert sorted(p.area for p in polygons) == [1.0, 12.0]
    assert polygons_of_rings(rings, np.array([(7.0, 1.0)])) == ([], [])


def test_inside_and_area():
    polygon = Polygon(SQUARE, (HOLE,))
    assert signed_area(HOLE) == -4.0
    assert polygon.area == 12.0
    assert abs(polygon.width - 4.0) < 1e-12
    rng = np.random.default_rng(0)
    places = rng.uniform(-1, 5, (2000, 2))
    expected = (np.abs(places - 2) < 2).all(axis=1) & ~(np.abs(places - 2) < 1).all(axis=1)
    assert (inside_polygons([polygon], places) == expected).all()


def test_nearest_places_and_the_way_inwards():
    polygons = [Polygon(SQUARE, (HOLE,)), Polygon(FAR)]
    for point, place, inward, number in (
        ((2.0, -3.0), (2.0, 0.0), (0.0, 1.0), 0),
        ((2.0, 1.5), (2.0, 1.0), (0.0, -1.0), 0),
        ((9.0, 2.0), (10.0, 2.0), (1.0, 0.0), 1),
        ((5.0, 5.0), (4.0, 4.0), (-(0.5**0.5), -(0.5**0.5)), 0),
    ):
        found, way, which = nearest_on_polygons(polygons, np.array(point))
        assert np.abs(found - place).max() < 1e-12
        assert np.abs(way - inward).max() < 1e-12
        assert which == number
    inside, _, which = nearest_on_polygons(polygons, np.array((0.5, 0.5)))
    assert inside.tolist() == [0.5, 0.5]
    assert which == 0
