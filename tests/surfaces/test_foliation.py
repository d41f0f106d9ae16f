"""Leaves against the surface itself, the planes, finite differences and closed forms."""

import math

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.foliation import (
    blade_directions,
    clip_to_blocks,
    covering_offsets,
    foliate,
    intersect_planes,
    parallel_planes,
    plane_leaf,
)
from batten.surfaces.plane import Plane


def wall(weights: bool = False) -> BSplineSurface:
    """A 3000 × 2000 relief whose plan coordinates are not affine in the parameters."""
    x, y = np.meshgrid(np.linspace(0, 3000, 8), np.linspace(0, 2000, 7), indexing="ij")
    net = np.stack(
        [x + 60 * np.sin(y / 300), y + 50 * np.cos(x / 400), 300 * np.sin(x / 500) * np.cos(y / 400)], axis=-1
    )
    knots = [[0.0] * 3 + list(np.linspace(0, 1, n - 2)) + [1.0] * 3 for n in (8, 7)]
    return BSplineSurface(*knots, 3, 3, net, 1.0 + 0.3 * np.sin(x + y) if weights else None)


def dome(radius: float = 500.0) -> BSplineSurface:
    """An eighth of a sphere, exact: biquadratic and rational, x, y, z ≥ 0 with a pole at (0, 0, r), seen from +z."""
    r, s = radius, math.sqrt(0.5)
    net = np.array(
        [[(r, 0, 0), (r, 0, r), (0, 0, r)], [(r, r, 0), (r, r, r), (0, 0, r)], [(0, r, 0), (0, r, r), (0, 0, r)]]
    )
    weights = np.outer([1, s, 1], [1, s, 1])
    return BSplineSurface([0, 0, 0, 1, 1, 1], [0, 0, 0, 1, 1, 1], 2, 2, net.astype(float), weights)


TURNED = [
    Plane((1500, 1000, 0), (math.cos(0.3), math.sin(0.3), 0), (0, 0, 1)),  # about the vertical
    Plane((1500, 900, 50), (1, 0.1, 0.05), (0, 0.2, 1)),  # and tilted
    Plane((1400, 1000, 0), (0, 1, 0), (0.1, 0, 1)),  # across
]


@pytest.mark.parametrize("weights", [False, True])
def test_points_lie_on_the_surface_and_in_the_plane(weights: bool) -> None:
    surface = wall(weights)
    x = np.linspace(-700, 700, 201)
    sections = intersect_planes(surface, TURNED, x)
    assert np.isfinite(sections.y).all()
    for i, plane in enumerate(TURNED):
        on_surface = surface.point(sections.u[i], sections.v[i])
        in_plane = plane.to_world(np.stack([x, sections.y[i]], axis=-1))
        assert np.abs(on_surface - in_plane).max() < 1e-9
        assert np.abs(plane.signed_distance(on_surface)).max() < 1e-9


@pytest.mark.parametrize("weights", [False, True])
def test_slopes_and_second_derivatives_agree_with_differences(weights: bool) -> None:
    x, h = np.linspace(-700, 700, 57), 0.02
    here, left, right = (intersect_planes(wall(weights), TURNED, x + d) for d in (0.0, -h, h))
    assert here.slope == pytest.approx((right.y - left.y) / (2 * h), abs=1e-7)
    assert here.second == pytest.approx((right.slope - left.slope) / (2 * h), abs=1e-8)
    bent = here.second / (1 + here.slope**2) ** 1.5
    assert here.curvature == pytest.approx(bent, rel=1e-14)
    assert np.tan(here.angle) == pytest.approx(here.slope, rel=1e-12)
    first_alone = intersect_planes(wall(weights), TURNED, x, order=1)
    assert first_alone.slope == pytest.approx(here.slope, rel=1e-13, abs=1e-13)
    assert np.isnan(first_alone.second).all()


def test_a_sphere_is_cut_into_circles() -> None:
    # A plane at distance d from the centre cuts a circle of radius √(r² − d²), whatever its position.
    plane = Plane((80, 80, 0), (1, -1, 0), (0, 0, 1))
    x = np.linspace(-60, 60, 31)
    s = intersect_planes(dome(), [plane], x)
    rho = math.sqrt(500.0**2 - plane.signed_distance(np.zeros(3)) ** 2)
    assert s.y[0] == pytest.approx(np.sqrt(rho**2 - x**2), abs=1e-9)
    assert s.slope[0] == pytest.approx(-x / np.sqrt(rho**2 - x**2), abs=1e-10)
    assert s.curvature[0] == pytest.approx(np.full(31, -1.0 / rho), rel=1e-9)


def test_a_plane_along_a_parameter_gives_the_isocurve() -> None:
    x, y = np.meshgrid(np.arange(7.0), np.arange(7.0), indexing="ij")
    knots = [0.0] * 4 + [1, 2, 3] + [4.0] * 4
    greville = np.lib.stride_tricks.sliding_window_view(np.array(knots)[1:-1], 3).mean(axis=1)
    net = np.stack([greville[x.astype(int)], greville[y.astype(int)], np.sin(x) + np.cos(2 * y)], axis=-1)
    surface = BSplineSurface(knots, knots, 3, 3, net)
    t = np.linspace(0, 4, 41)
    s = intersect_planes(surface, parallel_planes("x", [1.3]), t)
    iso = surface.isocurve("u", 1.3)
    assert s.y[0] == pytest.approx(iso(t)[:, 2], abs=1e-13)
    assert s.slope[0] == pytest.approx(iso(t, nu=1)[:, 2], abs=1e-12)
    assert s.second[0] == pytest.approx(iso(t, nu=2)[:, 2], abs=1e-11)


def test_leaves_pass_through_exact_points_and_know_their_error() -> None:
    surface = wall()
    planes = parallel_planes("x", np.linspace(200, 1800, 9))
    leaves = foliate(surface, planes, (100, 2900), 201, rows=[i // 3 for i in range(9)], first_number=10)
    assert [leaf.number for leaf in leaves] == list(range(10, 19))
    assert [leaf.row for leaf in leaves] == [0, 0, 0, 1, 1, 1, 2, 2, 2]
    x = np.random.default_rng(0).uniform(100, 2900, 300)
    exact = intersect_planes(surface, planes, x)
    for i, leaf in enumerate(leaves):
        assert leaf.complete
        assert leaf.curve is not None
        assert leaf.points.shape == (201, 2)
        assert leaf.curve.point(np.linspace(0, 1, 201)) == pytest.approx(leaf.points, abs=1e-9)
        error = np.abs(leaf.curve.point((x - 100) / 2800)[:, 1] - exact.y[i]).max()
        assert 0.0 < leaf.curve_error < 1e-3
        assert error < 2.0 * leaf.curve_error


def test_a_tolerance_is_kept_by_more_points() -> None:
    coarse = plane_leaf(wall(), TURNED[0], (-700, 700), n=9)
    fine = plane_leaf(wall(), TURNED[0], (-700, 700), n=9, tolerance=1e-3, number=4, row=2)
    assert coarse.curve_error > 1e-3 >= fine.curve_error
    assert len(fine.x) > len(coarse.x)
    assert (fine.number, fine.row) == (4, 2)


def test_a_plane_that_misses_spoils_no_other_leaf_and_extension_reaches_it() -> None:
    planes = parallel_planes("x", [1000.0, 2100.0, 9000.0])
    inside, beside, far = foliate(wall(), planes, (500, 2500), 21)
    assert inside.complete
    assert not beside.complete
    assert beside.curve is None
    assert math.isnan(far.curve_error)
    _, beside, far = foliate(wall(), planes, (500, 2500), 21, extend=0.15)
    assert beside.complete
    assert not far.complete
    assert np.isfinite(beside.section.second).all()


def test_families_of_planes() -> None:
    for plane, offset in zip(parallel_planes("x", [-5.0, 20.0], turn_rad=0.25, centre=(100, 50)), (-5.0, 20.0)):
        assert plane.x_axis == pytest.approx([math.cos(0.25), math.sin(0.25), 0])
        assert -plane.normal @ (np.array([100, 50, 7]) - plane.origin) == pytest.approx(-offset)
    (plane,) = parallel_planes("y", [300.0])
    assert plane.to_world([10.0, 2.0]).tolist() == [300.0, 10.0, 2.0]
    along, across = blade_directions("y", 0.1)
    assert along @ across == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("turn", [0.0, 0.2, -0.7])
def test_a_family_covers_its_rectangle(axis: str, turn: float) -> None:
    rectangle = np.array([[100.0, 200.0], [3100.0, 1400.0]])
    offsets = covering_offsets(axis, rectangle, 37.0, turn_rad=turn)  # type: ignore[arg-type]
    planes = parallel_planes(axis, offsets, turn_rad=turn, centre=rectangle.mean(axis=0))  # type: ignore[arg-type]
    points = np.random.default_rng(1).uniform(*rectangle, (500, 2))
    gaps = np.array([np.abs(p.signed_distance(np.append(points, np.zeros((500, 1)), axis=1))) for p in planes])
    assert gaps.min(axis=0).max() <= 18.5 + 1e-9
    clipped = clip_to_blocks(planes, rectangle[None])[:, 0]
    inner = clipped[1:-1] if turn else clipped
    assert np.isfinite(inner).all()
    for plane, ends in zip(planes[1:-1], clipped[1:-1]):
        on_border = plane.to_world(np.stack([ends, [0, 0]], axis=-1))[:, :2]
        # Both ends lie on the border: inside the closed rectangle and on one of its sides.
        assert (on_border >= rectangle[0] - 1e-9).all()
        assert (on_border <= rectangle[1] + 1e-9).all()
        assert np.minimum(np.abs(on_border - rectangle[0]), np.abs(on_border - rectangle[1])).min(
            axis=1
        ) == pytest.approx([0, 0], abs=1e-9)


def test_a_turned_plane_is_clipped_to_each_block_without_gaps() -> None:
    corners = np.array([(600.0 * i, 600.0 * j) for j in range(5) for i in range(5)])
    blocks = np.stack([corners, corners + 600.0], axis=1)
    (plane,) = parallel_planes("x", [0.0], turn_rad=0.4, centre=(1500, 1500))
    intervals = clip_to_blocks([plane], blocks)[0]
    pieces = np.sort(intervals[np.isfinite(intervals[:, 0])], axis=0)
    assert len(pieces) == 7  # five columns; tan 0.4 · 3000 = 1268 crosses two borders between rows
    assert pieces[1:, 0] == pytest.approx(pieces[:-1, 1], abs=1e-9)
    assert np.ptp(pieces) == pytest.approx(3000 / math.cos(0.4))


def test_a_plane_along_a_border_belongs_to_both_blocks_and_a_corner_to_none() -> None:
    blocks = [[[0, 0], [600, 600]], [[0, 600], [600, 1200]]]
    along, beside = clip_to_blocks(parallel_planes("x", [600.0, 1200.1]), blocks)
    assert along.tolist() == [[0, 600], [0, 600]]
    assert np.isnan(beside).all()
    corner = Plane((0, 0, 0), (1, -1, 0), (0, 0, 1))
    assert np.isnan(clip_to_blocks([corner], blocks)).all()


def test_bad_input_gets_one_clear_line() -> None:
    planes = parallel_planes("x", [1.0, 2.0])
    with pytest.raises(InvalidInputError, match=r"got shape \(3, 4\) for 2 planes"):
        intersect_planes(wall(), planes, np.zeros((3, 4)))
    with pytest.raises(InvalidInputError, match="x_range"):
        foliate(wall(), planes, (5.0, 5.0))
    with pytest.raises(InvalidInputError, match="n = 3"):
        foliate(wall(), planes, (0.0, 5.0), 3)
    with pytest.raises(InvalidInputError, match="1 rows"):
        foliate(wall(), planes, (0.0, 5.0), 9, rows=[0])
    with pytest.raises(InvalidInputError, match="blade_axis = 'z'"):
        parallel_planes("z", [0.0])  # type: ignore[arg-type]
    with pytest.raises(InvalidInputError, match="spacing = 0"):
        covering_offsets("x", [[0, 0], [1, 1]], 0.0)
    with pytest.raises(InvalidInputError, match="rectangles"):
        clip_to_blocks(planes, [[[0, 0], [0, 1]]])
    with pytest.raises(InvalidInputError, match="vertical"):
        clip_to_blocks([TURNED[1]], [[[0, 0], [1, 1]]])
