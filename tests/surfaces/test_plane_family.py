"""Planes over a plan: rows, covers, drawn-in edges; and the direction of the fewest blocks where it is known."""

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.face import Face
from batten.surfaces.plane_family import ABSENT, best_direction, counted, fitted, plane_family

TRIANGLE = (np.array([(0.0, 0.0), (90.0, 0.0), (0.0, 50.0)]),)


def flat(trims=()):
    net = [[(x, y, 0.0) for y in (0.0, 50.0)] for x in (0.0, 90.0)]
    return Face(BSplineSurface([0, 0, 90, 90], [0, 0, 50, 50], 1, 1, net), trims)


@pytest.mark.parametrize("turn", [0.0, 0.1, -0.25])
@pytest.mark.parametrize("angle", [0.0, 0.4, 2.0])
def test_edges_lie_on_the_blocks_borders(angle, turn):
    family = plane_family(flat(), angle, 5.0, 20.0, turn=turn)
    borders = np.linspace(family.low[0], family.high[0], 4)
    edges = family.edges(borders)
    along = np.array([np.cos(angle), np.sin(angle)])
    for plane, row in zip(family.planes, edges):
        assert plane.to_world(np.column_stack([row, 0.0 * row]))[:, :2] @ along == pytest.approx(borders, abs=1e-9)


@pytest.mark.parametrize("turn", [0.0, 0.1])
def test_planes_cover_the_box_within_the_spacing(turn):
    family = plane_family(flat(), 0.4, 5.0, 20.0, turn=turn)
    across = family.planes[0].normal
    offsets = np.array([p.origin @ across for p in family.planes])
    assert np.abs(np.diff(offsets)).max() <= 5.0 + 1e-9
    x, y = np.meshgrid(np.linspace(*(family.low[0], family.high[0])), np.linspace(family.low[1], family.high[1]))
    box = np.stack([x, y, 0.0 * x], axis=-1) @ family.pose.T @ across
    assert offsets.min() <= box.min() + 1e-9
    assert offsets.max() >= box.max() - 1e-9


def test_rows_are_planes_where_there_is_no_turn():
    family = plane_family(flat(), 0.4, 3.0, 17.0)
    across = np.array([-np.sin(0.4), np.cos(0.4)])
    offsets = np.array([p.origin[:2] @ across for p in family.planes])
    assert np.abs(family.rows[:, None] - offsets).min(axis=1).max() < 1e-9
    assert np.diff(family.rows).max() <= 17.0


def test_edges_are_drawn_in_but_no_more_than_to_a_part_of_a_column():
    """A plane, or what lies 2.5 below, meets the triangle up to x = 90 (1 − (y − 2.5)/50)."""
    family = plane_family(flat(TRIANGLE), 0.0, 5.0, 50.0)
    start, end, needed = family.clipped(np.array([0.0, 45.0, 90.0]))
    for i, plane in enumerate(family.planes):
        high = min(90.0, 90.0 * (1.0 - (plane.origin[1] - 2.5) / 50.0))
        assert needed[i].tolist() == [True, bool(high > 45.4)]
        last = 1 if needed[i, 1] else 0
        assert end[i, last] == pytest.approx(max(high, 45.0 * last + 0.1 * 45.0), abs=0.6)
        assert start[i, 0] == pytest.approx(0.0, abs=1e-9)
        assert not needed[i, 1] or end[i, 0] == start[i, 1] == 45.0


def test_a_leaf_that_meets_the_plan_twice_has_two_pieces_by_themselves(made_surfaces):
    """A notch from above, as wide as the middle column."""
    surface = made_surfaces.graph(lambda x, y: 10.0 * np.sin(x / 30.0), (0, 90), (0, 50))
    notched = np.array([(0, 0), (90, 0), (90, 50), (65, 50), (65, 20), (25, 20), (25, 50), (0, 50)], dtype=float)
    plan = Face(surface, (notched,))
    family = plane_family(plan, 0.0, 5.0, 50.0)
    borders = np.array([0.0, 30.0, 60.0, 90.0])
    start, end, needed = family.clipped(borders)
    assert needed[0].all()
    assert needed[-1].tolist() == [True, False, True]
    assert end[-1, 0] == pytest.approx(25.0, abs=0.4)
    assert start[-1, 2] == pytest.approx(65.0, abs=0.4)
    chains = fitted(plan, family, borders, 0.1)
    assert np.isfinite(chains.deviation[-1]).tolist() == [True, False, True]
    assert np.nanmax(chains.deviation) < 0.1


def test_what_lies_next_to_the_plan_counts():
    step = np.array([0.0, 5.0])
    points = np.array([(10.0, 10.0), (10.0, -2.4), (10.0, -2.6), (10.0, 53.0), (88.0, 40.0)])
    assert counted(flat(TRIANGLE), points, step).tolist() == [True, True, False, False, False]


def test_leaves_need_no_piece_beyond_the_plan(made_surfaces):
    surface = made_surfaces.graph(lambda x, y: 10.0 * np.sin(x / 30.0), (0, 90), (0, 50))
    plan = Face(surface, TRIANGLE)
    family = plane_family(plan, 0.0, 5.0, 50.0)
    chains = fitted(plan, family, np.array([0.0, 45.0, 90.0]), 0.1)
    absent = chains.status == ABSENT
    assert absent[-1].tolist() == [False, True]
    assert not absent[0].any()
    assert (np.isnan(chains.parameters).all(axis=2) == absent).all()


@pytest.mark.parametrize("bend", [0.0, 0.6, 2.2])
def test_a_cylinder_is_cut_across_its_rulings(bend, made_surfaces):
    """Its section across is a few arcs; along its rulings all rods are straight."""
    c, s = np.cos(bend), np.sin(bend)

    def height(x, y):
        return 60.0 * np.sin((c * x + s * y) / 70.0)

    plan = Face(made_surfaces.graph(height, (-200, 200), (-200, 200)))
    best, looked_at = best_direction(
        plan, 40.0, (400.0, 400.0), 0.5, is_straight=lambda chains: np.abs(chains.parameters[..., 3]) < 1e-6
    )
    off = abs((best.angle - bend + 0.5 * np.pi) % np.pi - 0.5 * np.pi)
    assert np.degrees(off) <= 70.0
    assert best.straight < 0.25
    along = min(looked_at, key=lambda d: abs(np.sin(d.angle - bend - 0.5 * np.pi)))
    assert best.blocks <= min(d.blocks for d in looked_at if d.straight < 0.25)
    assert along.angle != best.angle


@pytest.mark.parametrize("change", [{"spacing": 0.0}, {"greatest_depth": -1.0}, {"angle": np.nan}, {"turn": 1.5}])
def test_bounds(change):
    with pytest.raises(InvalidInputError, match="allowed"):
        plane_family(**({"plan": flat(), "angle": 0.0, "spacing": 5.0, "greatest_depth": 20.0} | change))
