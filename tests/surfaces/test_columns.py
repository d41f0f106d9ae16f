"""Columns of blocks: one for an elastica, two for two, as many as asked for by width and length, never fewer than needed."""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from batten.errors import InvalidInputError
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.columns import fewest_columns
from batten.surfaces.face import Face
from batten.surfaces.plane_family import plane_family

WIDTH, DEPTH = 600.0, 200.0


def extruded(made_surfaces, heights):
    """A cylinder over a curve given by its heights."""
    x = np.linspace(0.0, WIDTH, 241)
    y = heights(x)
    return Face(made_surfaces.graph(lambda u, v: np.interp(u, x, y) + 0.0 * v, (0, WIDTH), (0, DEPTH), n=(241, 6)))


def elastica(made_surfaces, x):
    return made_surfaces.elastica_heights(x, 0.0, 0.5, -3e-3, (1.2e-5, 4e-6))


def search(plan, tolerance=0.1, **limits):
    family = plane_family(plan, 0.0, 20.0, DEPTH)
    return fewest_columns(plan, family, tolerance, **({"greatest_width": WIDTH} | limits))


def test_a_cylinder_over_an_elastica_needs_one_column(made_surfaces):
    found = search(extruded(made_surfaces, lambda x: elastica(made_surfaces, x)), 1e-2)
    assert found.kept
    assert len(found.borders) == 2
    assert found.least == 1
    assert found.deviation < 2e-3
    assert np.ptp(found.chains.parameters[:, 0, 3:], axis=0).max() < 1e-4


def test_an_arc_and_a_counter_arc_need_two(made_surfaces):
    """Curvature jumps from −1/250 to +1/900 at x = 260: no single elastica is near it, two are it."""

    def heights(x):
        slope = np.where(x < 260.0, 0.5 - x / 250.0, -0.54 + (x - 260.0) / 900.0)
        return CubicHermiteSpline(x, np.append(0.0, np.cumsum(0.5 * (slope[1:] + slope[:-1]) * np.diff(x))), slope)(x)

    plan = extruded(made_surfaces, heights)
    one = search(plan, 0.5, at_most=1)
    assert not one.kept
    assert one.deviation > 0.5
    two = search(plan, 0.5)
    assert two.kept
    assert len(two.borders) == 3
    assert two.deviation <= 0.5


@pytest.mark.parametrize(("limits", "wanted"), [({"greatest_width": 250.0}, 3), ({"greatest_length": 400.0}, 2)])
def test_width_and_length_are_kept(limits, wanted, made_surfaces):
    found = search(extruded(made_surfaces, lambda x: elastica(made_surfaces, x)), **limits)
    assert found.kept
    assert len(found.borders) - 1 == wanted
    assert np.diff(found.borders).max() <= limits.get("greatest_width", WIDTH) + 1e-9
    assert np.nanmax(found.chains.parameters[..., 6]) <= limits.get("greatest_length", np.inf)


def test_tighter_tolerances_need_more_and_all_keep_them(made_surfaces):
    plan = Face(made_surfaces.graph(lambda x, y: 40.0 * np.sin(x / 60.0) * (1.0 + y / 400.0), (0, WIDTH), (0, DEPTH)))
    counts = []
    for tolerance in (4.0, 0.3):
        found = search(plan, tolerance)
        assert found.kept
        assert found.deviation <= tolerance
        assert found.least <= len(found.borders) - 1
        counts.append(len(found.borders) - 1)
    assert counts == sorted(counts)
    assert counts[0] < counts[-1]


def test_pieces_of_a_leaf_join_with_their_tangents(made_surfaces):
    plan = Face(made_surfaces.graph(lambda x, y: 40.0 * np.sin(x / 60.0) * (1.0 + y / 400.0), (0, WIDTH), (0, DEPTH)))
    found = search(plan, 0.3)
    assert len(found.borders) > 2
    heights = found.chains.joints
    assert np.isfinite(heights).all()
    assert np.abs(found.chains.parameters[:, 1:, 1] - heights[:, 1:-1, 0]).max() < 1e-9
    assert np.abs(found.chains.parameters[:, 1:, 2] - heights[:, 1:-1, 1]).max() < 1e-9


def test_what_cannot_be_kept_is_said(made_surfaces):
    found = search(extruded(made_surfaces, lambda x: 60.0 * np.sin(x / 25.0)), 0.01, at_most=2)
    assert not found.kept
    assert found.deviation > 0.01


@pytest.mark.parametrize("limits", [{"greatest_width": 0.0}, {"greatest_length": -1.0}])
def test_bounds(limits):
    net = [[(x, y, 0.0) for y in (0.0, DEPTH)] for x in (0.0, WIDTH)]
    plan = Face(BSplineSurface([0, 0, WIDTH, WIDTH], [0, 0, DEPTH, DEPTH], 1, 1, net))
    with pytest.raises(InvalidInputError, match="allowed"):
        search(plan, **limits)
