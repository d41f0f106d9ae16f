"""Faces against areas, lengths and regions known in closed form, and scipy's splines."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import BSpline

from batten.errors import InvalidInputError
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.face import Face


def sheet(width: float = 4.0, depth: float = 3.0) -> BSplineSurface:
    """A flat rectangle with u = x and v = y."""
    net = [[(0, 0, 0), (0, depth, 0)], [(width, 0, 0), (width, depth, 0)]]
    return BSplineSurface([0, 0, width, width], [0, 0, depth, depth], 1, 1, net)


def quarter_cylinder(radius: float, height: float) -> BSplineSurface:
    """A quarter round z, exact and rational."""
    points = [[(x * radius, y * radius, z) for z in (0.0, height)] for x, y in ((1, 0), (1, 1), (0, 1))]
    return BSplineSurface([0, 0, 0, 1, 1, 1], [0, 0, 1, 1], 2, 1, points, [[w, w] for w in (1.0, np.sqrt(0.5), 1.0)])


def waves() -> BSplineSurface:
    """A free bicubic with uneven, partly double knots."""
    rng = np.random.default_rng(8)
    u, v = [0, 0, 0, 0, 1, 1, 2.5, 4, 4, 4, 4], [-1, -1, -1, -1, 0, 3, 3, 3, 3]
    net = np.stack([*np.meshgrid(np.arange(7.0), np.arange(5.0), indexing="ij"), rng.normal(size=(7, 5))], axis=-1)
    return BSplineSurface(u, v, 3, 3, net)


def circle(middle: tuple[float, float], radius: float, count: int) -> np.ndarray:
    t = 2 * np.pi * np.arange(count) / count
    return np.stack([middle[0] + radius * np.cos(t), middle[1] + radius * np.sin(t)], axis=-1)


def test_even_odd() -> None:
    face = Face(sheet(), (circle((2, 1.5), 1.4, 400), circle((2, 1.5), 0.7, 400), circle((2, 1.5), 0.3, 400)[::-1]))
    rng = np.random.default_rng(1)
    u, v = rng.uniform(0, 4, (50, 60)), rng.uniform(0, 3, (50, 60))
    r = np.hypot(u - 2, v - 1.5)
    clear = np.abs(r[..., None] - [0.3, 0.7, 1.4]).min(axis=-1) > 1e-3
    wanted = (r < 0.3) | ((r > 0.7) & (r < 1.4))
    assert clear.mean() > 0.9
    assert (face.contains(u, v) == wanted)[clear].all()


def test_rays_through_corners_count_once() -> None:
    diamond = Face(sheet(), ([(1, 1), (2, 0), (3, 1), (2, 2)],))
    v = np.array([0.0, 0.5, 1.0, 1.5, 1.99])
    assert diamond.contains(2.0, v[1:]).all()
    assert not diamond.contains(0.5, v).any()
    assert not diamond.contains(3.5, v).any()
    stair = Face(sheet(), ([(0, 0), (4, 0), (4, 1), (2, 1), (2, 2), (0, 2)],))
    assert stair.contains([1.0, 3.0, 1.0, 3.0], [1.0, 0.5, 1.5, 1.5]).tolist() == [True, True, True, False]


def test_the_border_of_the_domain_is_inside() -> None:
    square = [(0, 0), (4, 0), (4, 3), (0, 3)]
    for face in (Face(sheet()), Face(sheet(), (square,))):
        assert face.contains([0, 4, 2, 2, 0, 4], [1, 1, 0, 3, 0, 3]).all()
        assert not face.contains([-0.1, 4.1, 2, 2, np.nan], [1, 1, -0.1, 3.1, 1]).any()
        assert face.covers_domain()
    assert not Face(sheet(), ([(0, 0), (4, 0), (4, 3)],)).covers_domain()


def test_shapes_of_answers() -> None:
    face = Face(sheet(), (circle((2, 1.5), 1, 30),))
    assert face.contains(2.0, 1.5).shape == ()
    assert face.contains(np.zeros((3, 1)), np.zeros(4)).shape == (3, 4)


def test_areas_in_closed_form() -> None:
    assert Face(sheet()).area() == pytest.approx(12.0, rel=1e-14)
    assert Face(sheet(), (circle((2, 1.5), 1, 7),)).area() == pytest.approx(3.5 * np.sin(2 * np.pi / 7), rel=1e-13)
    ring = Face(sheet(), (circle((2, 1.5), 1.4, 100), circle((1.9, 1.4), 0.5, 30)))
    polygon_areas = [50 * 1.4**2 * np.sin(2 * np.pi / 100), 15 * 0.25 * np.sin(2 * np.pi / 30)]
    assert ring.area() == pytest.approx(polygon_areas[0] - polygon_areas[1], rel=1e-12)


def test_areas_on_a_cylinder() -> None:
    """A rational quarter: the trim is a band between two straight lines in (u, v), whose area is an integral in u."""
    radius, height = 2.0, 5.0
    surface = quarter_cylinder(radius, height)
    whole = Face(surface)
    assert whole.area() == pytest.approx(0.5 * np.pi * radius * height, rel=1e-13)
    (u0, u1), (v0, v1) = surface.domain
    # The region below v = v₀ + (u − u₀)/(u₁ − u₀) (v₁ − v₀): height × ∫ share dφ, by Gauss over 400 pieces.
    below = Face(surface, ([(u0, v0), (u1, v0), (u1, v1)],))
    x = np.linspace(u0, u1, 40001)
    points = surface.point(x, v0)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    share = (0.5 * (x[1:] + x[:-1]) - u0) / (u1 - u0)
    assert below.area() == pytest.approx(height * float(steps @ share), rel=1e-8)


def test_the_outline_of_a_whole_face_has_the_length_of_its_border() -> None:
    radius, height = 2.0, 5.0
    (outline,) = Face(quarter_cylinder(radius, height)).outline(1e-5)
    length = np.linalg.norm(outline - np.roll(outline, -1, axis=0), axis=1).sum()
    assert length == pytest.approx(2 * (np.pi / 2 * radius + height), rel=1e-5)
    assert np.hypot(outline[:, 0], outline[:, 1]) == pytest.approx(np.full(len(outline), radius), abs=1e-12)
    (coarse,) = Face(quarter_cylinder(radius, height)).outline()
    assert len(coarse) < len(outline)


@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-4])
def test_the_outline_keeps_its_tolerance(tolerance: float) -> None:
    face = Face(waves(), ([(0.3, -0.8), (3.7, 0.1), (2.0, 2.8)],))
    (outline,) = face.outline(tolerance)
    a, b = face.trims[0], np.roll(face.trims[0], -1, axis=0)
    share = np.linspace(0, 1, 1001)[:, None]
    start, end = outline, np.roll(outline, -1, axis=0)
    for first, last in zip(a, b):
        at = first + share * (last - first)
        points = face.surface.point(at[:, 0], at[:, 1])
        t = ((points[:, None] - start) * (end - start)).sum(-1) / ((end - start) ** 2).sum(-1)
        feet = start + np.clip(t, 0, 1)[..., None] * (end - start)
        assert np.linalg.norm(points[:, None] - feet, axis=-1).min(axis=1).max() < 1.2 * tolerance


@pytest.mark.parametrize("rational", [False, True])
def test_a_part_is_the_same_surface(rational: bool) -> None:
    surface = waves()
    if rational:
        weights = np.random.default_rng(2).uniform(0.5, 2.0, surface.control_points.shape[:2])
        surface = BSplineSurface(surface.knots_u, surface.knots_v, 3, 3, surface.control_points, weights)
    part = Face(surface, (), "sail").part(0.5, 3.0, -0.5, 2.0)
    assert part.surface.domain == ((0.5, 3.0), (-0.5, 2.0))
    assert part.name == "sail"
    assert not part.is_trimmed
    u, v = np.linspace(0.5, 3.0, 41)[:, None], np.linspace(-0.5, 2.0, 31)
    assert part.surface.point(u, v) == pytest.approx(surface.point(u, v), abs=1e-13)


def test_a_part_against_scipy() -> None:
    surface = waves()
    part = Face(surface).part(1.0, 2.5, -1.0, 3.0).surface
    u = np.linspace(1.0, 2.5, 23)
    across = BSpline(surface.knots_v, np.moveaxis(surface.control_points, 1, 0), 3)(0.7)
    assert part.point(u, 0.7) == pytest.approx(BSpline(surface.knots_u, across, 3)(u), abs=1e-13)
    assert len(part.knots_u) == 8  # the double knot at 1 is its border


def test_parts_share_out_the_trimmed_area() -> None:
    face = Face(waves(), (circle((2, 1), 1.7, 60), circle((1.4, 1.1), 0.5, 20)))
    borders_u, borders_v = [0.0, 1.2, 1.9, 4.0], [-1.0, 0.8, 3.0]
    parts = [face.part(a, b, c, d) for a, b in pairwise(borders_u) for c, d in pairwise(borders_v)]
    assert sum(part.area() for part in parts) == pytest.approx(face.area(), rel=1e-8)
    rng = np.random.default_rng(3)
    u, v = rng.uniform(0, 4, 2000), rng.uniform(-1, 3, 2000)
    assert (sum(part.contains(u, v).astype(int) for part in parts) == face.contains(u, v)).all()


def test_a_part_inside_the_trims_is_whole() -> None:
    face = Face(sheet(), (circle((2, 1.5), 1.4, 60),))
    assert not face.part(1.5, 2.5, 1.0, 2.0).is_trimmed
    with pytest.raises(InvalidInputError, match="outside the trims"):
        face.part(0.0, 0.1, 0.0, 0.1)


def test_moved_and_scaled() -> None:
    face = Face(sheet(), ([(0, 0), (4, 0), (4, 3)],), "a")
    assert face.scaled(10.0).area() == pytest.approx(600.0)
    turn = np.array([[0, -1, 0, 5], [1, 0, 0, 0], [0, 0, 1, 2], [0, 0, 0, 1.0]])
    moved = face.transformed(turn)
    assert moved.area() == pytest.approx(face.area())
    assert moved.name == "a"
    assert moved.outline()[0].min(axis=0) == pytest.approx([2.0, 0.0, 2.0])


def test_the_first_corner_again_is_left_out() -> None:
    assert Face(sheet(), ([(0, 0), (4, 0), (4, 3), (0, 0)],)).trims[0].shape == (3, 2)


def test_what_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="k ≥ 3"):
        Face(sheet(), ([(0, 0), (1, 1)],))
    with pytest.raises(InvalidInputError, match="clip the trims"):
        Face(sheet(), ([(0, 0), (5, 0), (4, 3)],))
    with pytest.raises(InvalidInputError, match="clip the trims"):
        Face(sheet(), ([(0, 0), (np.nan, 0), (4, 3)],))
    for bad in ((1, 1, 0, 1), (2, 1, 0, 1), (-1, 1, 0, 1), (0, 1, 0, 3.5)):
        with pytest.raises(InvalidInputError, match="from less to greater"):
            Face(sheet()).part(*bad)
    with pytest.raises(InvalidInputError, match="tolerance"):
        Face(sheet()).outline(0.0)
