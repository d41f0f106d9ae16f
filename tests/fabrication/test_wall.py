"""The wall's division against areas, brute-force membership and frames."""

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.fabrication.job import BlocksJob
from batten.fabrication.wall import Wall, axis_of
from batten.surfaces.bspline_surface import BSplineSurface

LOW, HIGH = np.array([100.0, -200.0]), np.array([1500.0, 700.0])  # 1400 × 900 mm


def height(x, y):
    return 80.0 * np.sin(x / 200.0) * np.cos(y / 300.0) + 0.1 * x


@pytest.fixture(scope="module")
def surface(made_surfaces):
    return made_surfaces.graph(height, *zip(LOW, HIGH), (24, 20))


def cells(blocks):
    """Plan rectangles of blocks, (n, 2, 2): corner, then [least, greatest]."""
    return np.array([[b.corner_mm[:2], b.corner_mm[:2] + b.size_mm[:2]] for b in blocks])


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("size", [(700.0, 450.0), (600.0, 400.0), (1400.0, 900.0), (5000.0, 90.0), (333.3, 250.0)])
def test_blocks_tile_the_plan(surface, axis, size) -> None:
    wall = Wall.of(surface, size, axis)
    blocks = wall.blocks(BlocksJob())
    plan = cells(blocks)
    sides = np.diff(plan, axis=1)[:, 0]
    assert (sides > 1.0).all()
    assert (sides <= np.array(size) + 1e-9).all()
    assert len(blocks) == np.prod(np.ceil((HIGH - LOW) / size - 1e-9))
    # Every point lies in one block and one only, and no area is left.
    points = np.random.default_rng(0).uniform(LOW, HIGH, (2000, 2))
    inside = ((points[:, None] >= plan[:, 0]) & (points[:, None] < plan[:, 1])).all(axis=2)
    assert (inside.sum(axis=1) == 1).all()
    assert sides.prod(axis=1).sum() == pytest.approx(1400.0 * 900.0, rel=1e-12)
    full = np.isclose(sides, np.minimum(size, HIGH - LOW)).all(axis=1)
    assert full.any()
    assert all(b.row == len(wall.rows) - 2 or b.column == len(wall.columns) - 2 for b in np.array(blocks)[~full])


@pytest.mark.parametrize(("more", "columns"), [(-0.5, 2), (1e-5, 2), (0.9, 2), (1.1, 3), (300.0, 3)])
def test_a_sliver_is_no_block(made_surfaces, more, columns) -> None:
    flat = made_surfaces.graph(lambda x, y: 0.0 * x, (0.0, 1200.0 + more), (0.0, 600.0), (8, 8), 3)
    blocks = Wall.of(flat, (600.0, 600.0), "x").blocks(BlocksJob())
    assert len(blocks) == columns
    assert sum(b.size_mm[0] for b in blocks) == pytest.approx(1200.0 + more, abs=1e-9)


@pytest.mark.parametrize(("axis", "along"), [("x", 0), ("y", 1)])
def test_blocks_are_numbered_along_the_blade_and_then_across(surface, axis, along) -> None:
    wall = Wall.of(surface, (600.0, 400.0), axis)
    blocks = wall.blocks(BlocksJob())
    assert [b.number for b in blocks] == list(range(1, 10))
    assert [b.column for b in blocks] == [0, 1, 2] * 3
    assert [b.row for b in blocks] == [0] * 3 + [1] * 3 + [2] * 3
    for b in blocks:
        assert b.corner_mm[along] == wall.columns[b.column]
        assert b.corner_mm[1 - along] == wall.rows[b.row]
    assert wall.along == along


@pytest.mark.parametrize("clearance", [0.0, 25.0])
def test_heights_follow_from_the_relief_and_the_clearance(surface, clearance) -> None:
    for b in Wall.of(surface, (600.0, 400.0), "x").blocks(BlocksJob(clearance_mm=clearance)):
        ends = [np.linspace(b.corner_mm[k], b.corner_mm[k] + b.size_mm[k], 301) for k in range(2)]
        z = height(ends[0][:, None], ends[1][None, :])
        bottom, top = b.corner_mm[2], b.corner_mm[2] + b.size_mm[2]
        # At least the clearance, and not much more: the surroundings count up to 1/200 of the wall.
        assert bottom <= z.min() - clearance + 0.02
        assert top >= z.max() + clearance - 0.02
        assert z.min() - clearance - bottom < 6.0
        assert top - z.max() - clearance < 6.0


def test_a_given_height_is_kept_with_the_cut_in_the_middle_or_refused(surface) -> None:
    wall = Wall.of(surface, (700.0, 900.0), "x")
    free = wall.blocks(BlocksJob(clearance_mm=30.0))
    given = wall.blocks(BlocksJob(clearance_mm=30.0, height_mm=500.0))
    for a, b in zip(free, given):
        assert b.size_mm.tolist() == [*a.size_mm[:2], 500.0]
        assert b.corner_mm[2] + 250.0 == pytest.approx(a.corner_mm[2] + 0.5 * a.size_mm[2])
    needed = max(b.size_mm[2] for b in free)
    wall.blocks(BlocksJob(clearance_mm=30.0, height_mm=needed + 1e-6))
    with pytest.raises(InvalidInputError, match=rf"block \d needs a height of {needed:.0f} mm .* 30 mm clearance"):
        wall.blocks(BlocksJob(clearance_mm=30.0, height_mm=needed - 1.0))


def test_a_surface_that_folds_back_is_refused() -> None:
    points = [
        [(x, y, z) for y in (0.0, 500.0)] for x, z in ((0.0, 0.0), (900.0, 100.0), (-300.0, 200.0), (600.0, 300.0))
    ]
    folded = BSplineSurface([0] * 4 + [1] * 4, [0, 0, 1, 1], 3, 1, points)
    with pytest.raises(InvalidInputError, match="not single-valued"):
        Wall.of(folded, (600.0, 600.0), "x")


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("spacing", [20.0, 37.0, 400.0, 2000.0])
def test_unturned_planes_hold_the_borders_and_the_spacing(surface, axis, spacing) -> None:
    wall = Wall.of(surface, (600.0, 400.0), axis)
    planes = wall.planes(spacing, 0.0)
    across = 1 - wall.along
    at = np.array([p.origin[across] for p in planes])
    order = at if axis == "x" else at[::-1]
    assert (np.diff(order) > 0.0).all()
    assert np.diff(order).max() <= spacing + 1e-9
    for border in wall.rows:
        assert np.abs(order - border).min() < 1e-9
    for a, b in zip(wall.rows[:-1], wall.rows[1:]):
        steps = np.diff(order[(order > a - 1e-9) & (order < b + 1e-9)])
        assert steps == pytest.approx(np.full(len(steps), (b - a) / np.ceil((b - a) / spacing - 1e-9)))
    assert all(p.x_axis[wall.along] == 1.0 for p in planes)


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize(("turn", "border"), [(0.0, None), (0.05, None), (-0.3, None), (0.3, 0.0), (-0.3, 0.1)])
def test_planes_come_in_the_order_in_which_the_blade_is_swept(surface, axis, turn, border) -> None:
    wall = Wall.of(surface, (600.0, 400.0), axis)
    blocks = wall.blocks(BlocksJob())
    planes = wall.planes(60.0, turn, border)
    for block in blocks:
        to_work = np.linalg.inv(block.work_frame(axis))
        middle = block.corner_mm + 0.5 * block.size_mm
        # Where each plane passes the line through the block's middle along +y_work; and the blade runs along +x_work.
        sweep = np.linalg.inv(to_work)[:3, 1]
        places = [float((p.origin - middle) @ p.normal / (sweep @ p.normal)) for p in planes]
        assert (np.diff(places) > 0.0).all()
        assert all((to_work[:3, :3] @ p.x_axis)[0] > 0.9 for p in planes)
        assert all((to_work[:3, :3] @ -p.normal)[1] > 0.9 for p in planes), "the rod's normal is the way of the cut"


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize(
    ("spacing", "turn", "border"),
    [
        (50.0, 0.0, None),
        (50.0, 0.1, None),
        (33.0, -0.25, None),
        (20.0, 0.6, None),
        (50.0, 0.2, 0.0),
        (33.0, -0.4, 0.25),
    ],
)
def test_every_point_lies_within_the_spacing_of_a_plane_that_crosses_its_block(
    surface, axis, spacing, turn, border
) -> None:
    wall = Wall.of(surface, (600.0, 400.0), axis)
    blocks = wall.blocks(BlocksJob())
    planes = wall.planes(spacing, turn, border)
    plane_index, block_index = wall.crossings(planes, blocks)
    assert (np.diff(block_index) >= 0).all()
    for j, cell in enumerate(cells(blocks)):
        mine = plane_index[block_index == j]
        assert (np.diff(mine) > 0).all(), "in cutting order, each once"
        points = np.random.default_rng(j).uniform(*cell, (300, 2))
        gaps = [np.abs(planes[i].signed_distance(np.c_[points, np.zeros(300)])) for i in mine]
        assert np.min(gaps, axis=0).max() <= spacing + 1e-9
        # Membership by brute force: points along each plane that lie strictly inside.
        corners = np.array([(x, y, 0.0) for x in cell[:, 0] for y in cell[:, 1]])
        crossing = []
        for i, plane in enumerate(planes):
            side = plane.signed_distance(corners)
            if side.min() < -1e-3 and side.max() > 1e-3:
                crossing.append(i)
        assert set(crossing) <= set(mine)
        assert mine.tolist() == list(range(mine[0], mine[-1] + 1)), "none is left out between"
        # Beside them one on either side, so that the blade passes no corner uncut.
        assert mine[0] >= crossing[0] - 1
        assert mine[-1] <= crossing[-1] + 1
        behind, ahead = (planes[i].signed_distance(corners) for i in (mine[0], mine[-1]))
        assert behind.max() < 1e-5
        assert ahead.min() > -1e-5


@pytest.mark.parametrize(("axis", "turn"), [("x", 0.0), ("x", 0.2), ("y", 0.0), ("y", -0.2)])
def test_edges_are_where_planes_pass_the_columns_borders(surface, axis, turn) -> None:
    wall = Wall.of(surface, (600.0, 400.0), axis)
    planes = wall.planes(150.0, turn)
    edges = wall.edges(planes)
    assert edges.shape == (len(planes), 4)
    for plane, row in zip(planes, edges):
        assert plane.to_world(np.c_[row, 0.0 * row])[:, wall.along] == pytest.approx(wall.columns, abs=1e-9)


def test_contains_the_plan_with_its_border(surface) -> None:
    wall = Wall.of(surface, (600.0, 400.0), "x")
    points = np.array(
        [[100.0, -200.0, 1e4], [1500.0, 700.0, 0.0], [800.0, 0.0, -5.0], [99.9, 0.0, 0.0], [800, 700.1, 0]]
    )
    assert wall.contains(points[None]).tolist() == [[True, True, True, False, False]]


def test_axis_of_follows_the_surface_and_not_its_parameters(surface) -> None:
    assert (axis_of(surface, "u"), axis_of(surface, "v")) == ("x", "y")
    swapped = BSplineSurface(
        surface.knots_v, surface.knots_u, 5, 5, np.swapaxes(surface.control_points, 0, 1)
    )  # u runs along y
    assert (axis_of(swapped, "u"), axis_of(swapped, "v")) == ("y", "x")
    c, s = np.cos(1.2), np.sin(1.2)
    turned = surface.transformed([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    assert (axis_of(turned, "u"), axis_of(turned, "v")) == ("y", "x")
    backwards = surface.transformed(np.diag([-1.0, 1.0, 1.0, 1.0]))
    assert (axis_of(backwards, "u"), axis_of(backwards, "v")) == ("x", "y")
