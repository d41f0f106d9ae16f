"""Parallel surfaces of planes, cylinders, spheres and graphs, where they or the distances from them are known."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize

from batten.errors import InvalidInputError
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.parallel import parallel_surface

RNG = np.random.default_rng(7)


def anywhere(surface, count=400):
    """Random parameters over a surface's domain."""
    return (RNG.uniform(low, high, count) for low, high in surface.domain)


@pytest.mark.parametrize("distance", [30.0, 0.5, -0.5, -30.0])
def test_of_a_cylinder_a_cylinder(made_surfaces, distance) -> None:
    surface = made_surfaces.cylinder(500.0, 400.0)
    up = math.copysign(1.0, surface.normal(0.5, 0.5)[2])
    parallel, deviation = parallel_surface(surface, up * distance)
    assert deviation <= 1e-3 * abs(distance)
    u, v = anywhere(surface)
    points = parallel.point(u, v)
    radii = np.hypot(points[:, 0], points[:, 2])
    assert np.abs(radii - (500.0 + distance)).max() <= 1.02 * deviation + 1e-9
    # At equal parameters the foot is the surface's own point.
    assert points == pytest.approx(
        surface.point(u, v) * [1 + distance / 500, 1, 1 + distance / 500], abs=2e-3 * abs(distance)
    )


def test_of_a_sphere_a_sphere(made_surfaces) -> None:
    def height(x, y):
        return np.sqrt(600.0**2 - x**2 - y**2)

    cap = made_surfaces.graph(height, (-300.0, 300.0), (-300.0, 300.0), (40, 40))
    parallel, _ = parallel_surface(cap, 12.0, within=1e-4)
    u, v = anywhere(cap)
    assert np.linalg.norm(parallel.point(u, v), axis=-1) == pytest.approx(np.full(400, 612.0), abs=3e-4)


@pytest.mark.parametrize("within", [1e-1, 1e-2, 1e-3, 1e-4, 1e-5])
def test_the_distance_asked_for_is_kept(made_surfaces, within) -> None:
    def height(x, y):
        return 40.0 * np.sin(x / 90.0) * np.cos(y / 130.0) + 0.4 * x

    surface = made_surfaces.graph(height, (0.0, 600.0), (0.0, 400.0), (40, 30), 5)
    parallel, deviation = parallel_surface(surface, 1.5, within=within)
    assert deviation <= within
    u, v = anywhere(surface, 12)
    for point in parallel.point(u, v):

        def square(q, point=point):
            return (q[0] - point[0]) ** 2 + (q[1] - point[1]) ** 2 + (height(*q) - point[2]) ** 2

        near = min(minimize(square, point[:2] + s, method="BFGS", options={"gtol": 1e-9}).fun for s in (0.0, 1.0))
        # The interpolated graph itself lies within 1e-6 of the function.
        assert math.sqrt(near) == pytest.approx(1.5, abs=1.1 * within + 3e-6)


def test_flat_is_exact_and_goes_beyond_the_border() -> None:
    net = [[(0, 0, 5), (0, 300, 5)], [(600, 0, 5), (600, 300, 5)]]
    flat = BSplineSurface([0, 0, 2, 2], [0, 0, 1, 1], 1, 1, net)
    parallel, deviation = parallel_surface(flat, -0.75, extend=0.25)
    assert deviation < 1e-12
    assert parallel.domain == ((-0.5, 2.5), (-0.25, 1.25))
    assert parallel.point([-0.5, 2.5], [-0.25, 1.25]) == pytest.approx(np.array([(-150, -75, 4.25), (750, 375, 4.25)]))


def test_beyond_the_border_the_continuation_is_shifted(made_surfaces) -> None:
    surface = made_surfaces.graph(lambda x, y: 1e-3 * x**2 + 0.2 * y, (0.0, 600.0), (0.0, 400.0), (12, 8), 3)
    parallel, _ = parallel_surface(surface, 2.0, within=1e-6)
    at_border, beyond = (surface.point(x, 100.0, extend=0.3) for x in (600.0, 700.0))
    shift = parallel.point(600.0, 100.0) - at_border
    assert np.linalg.norm(shift) == pytest.approx(2.0, abs=1e-5)
    assert parallel.point(700.0, 100.0) - beyond == pytest.approx(shift, abs=1e-5)


def test_no_distance_gives_the_surface_back(made_surfaces) -> None:
    surface = made_surfaces.cylinder(500.0, 400.0)
    assert parallel_surface(surface, 0.0).surface is surface


def test_a_radius_below_the_distance_is_refused_on_its_own_side(made_surfaces) -> None:
    surface = made_surfaces.cylinder(20.0, 400.0)
    up = math.copysign(1.0, surface.normal(0.5, 0.5)[2])
    parallel_surface(surface, 25.0 * up)
    with pytest.raises(InvalidInputError, match=r"a radius of 20 at .* not above the distance 25 on that side"):
        parallel_surface(surface, -25.0 * up)


def test_a_crease_is_refused_and_a_joint_without_kink_is_not() -> None:
    def roof(ridge):
        points = [[(x, y, z) for y in (0.0, 300.0)] for x, z in ((0.0, 0.0), (300.0, ridge), (600.0, 2.0 * 50.0))]
        return BSplineSurface([0, 0, 1, 2, 2], [0, 0, 1, 1], 1, 1, points)

    with pytest.raises(InvalidInputError, match="crease at u = 1"):
        parallel_surface(roof(80.0), 0.5)
    assert parallel_surface(roof(50.0), 0.5).deviation < 1e-12


def test_a_point_without_normal_is_refused() -> None:
    fan = BSplineSurface([0, 0, 1, 1], [0, 0, 1, 1], 1, 1, [[(0, 0, 0), (0, 0, 0)], [(300, 0, 0), (300, 200, 0)]])
    with pytest.raises(InvalidInputError, match="no normal at"):
        parallel_surface(fan, 0.5)


@pytest.mark.parametrize(("distance", "more"), [(np.nan, {}), (1.0, {"within": 0.0}), (1.0, {"extend": -0.1})])
def test_numbers_outside_their_domain(made_surfaces, distance, more) -> None:
    with pytest.raises(InvalidInputError):
        parallel_surface(made_surfaces.cylinder(500.0, 400.0), distance, **more)
