"""Trims from curves in space on planes, cylinders, spheres, cones and tori, against areas known in closed form."""

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.face import Face
from batten.surfaces.face_loops import closed_directions, loop_polygon, parameter_loop_polygon

R, H = 200.0, 500.0
TOLERANCE = 0.01
_FULL = np.array([0.0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4])
_ROUND = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)], dtype=float)
_ROUND_WEIGHTS = np.array([1, np.sqrt(0.5)] * 4 + [1])


def revolved(profile: np.ndarray, weights: np.ndarray, knots: np.ndarray, degree: int) -> BSplineSurface:
    """A profile (n, 2) of radius and height turned round z; u goes round, 0 … 4, and v along the profile."""
    net = np.empty((9, len(profile), 3))
    net[..., :2] = _ROUND[:, None] * profile[:, :1]
    net[..., 2] = profile[:, 1]
    return BSplineSurface(_FULL, knots, 2, degree, net, np.outer(_ROUND_WEIGHTS, weights))


def tube() -> BSplineSurface:
    return revolved(np.array([(R, 0.0), (R, H)]), np.ones(2), np.array([0.0, 0, 1, 1]), 1)


def cone() -> BSplineSurface:
    return revolved(np.array([(R, 0.0), (0.0, H)]), np.ones(2), np.array([0.0, 0, 1, 1]), 1)


def sphere() -> BSplineSurface:
    half = np.array([(0, -1), (1, -1), (1, 0), (1, 1), (0, 1)]) * R
    return revolved(half, _ROUND_WEIGHTS[:5], np.array([0.0, 0, 0, 1, 1, 2, 2, 2]), 2)


def torus() -> BSplineSurface:
    return revolved(_ROUND * 50.0 + [R, 0.0], _ROUND_WEIGHTS, _FULL, 2)


def arc(radius: float, height: float, start: float, end: float):  # type: ignore[no-untyped-def]
    """Round z from one angle to another, radians."""

    def curve(t: np.ndarray) -> np.ndarray:
        phi = start + t * (end - start)
        return np.stack([radius * np.cos(phi), radius * np.sin(phi), np.full_like(t, height)], axis=-1)

    return curve


def line(start: tuple[float, float, float], end: tuple[float, float, float]):  # type: ignore[no-untyped-def]
    return lambda t: np.asarray(start) + t[:, None] * (np.asarray(end) - np.asarray(start))


def polar(radius: float, at: float):  # type: ignore[no-untyped-def]
    """A meridian of the sphere at an angle round z, from pole to pole."""

    def curve(t: np.ndarray) -> np.ndarray:
        beta = np.pi * (t - 0.5)
        return radius * np.stack([np.cos(beta) * np.cos(at), np.cos(beta) * np.sin(at), np.sin(beta)], axis=-1)

    return curve


def backwards(curve):  # type: ignore[no-untyped-def]
    return lambda t: curve(1.0 - t)


def check_on_edges(surface: BSplineSurface, polygon: np.ndarray, distance) -> None:  # type: ignore[no-untyped-def]
    """Points all along the polygon's sides lie as near to the edges as was asked for, measured by `distance`."""
    share = np.linspace(0, 1, 9)[:, None, None]
    at = polygon + share * (np.roll(polygon, -1, axis=0) - polygon)
    assert distance(surface.point(at[..., 0], at[..., 1]).reshape(-1, 3)).max() < 1.1 * TOLERANCE


def test_what_closes() -> None:
    assert closed_directions(tube()) == (True, False)
    assert closed_directions(sphere()) == (True, False)
    assert closed_directions(torus()) == (True, True)


def test_a_circle_on_a_plane() -> None:
    flat = BSplineSurface([0, 0, 9, 9], [0, 0, 9, 9], 1, 1, [[(0, 0, 5), (0, 900, 5)], [(900, 0, 5), (900, 900, 5)]])
    move = np.array([400.0, 450.0, 5.0])
    polygon = loop_polygon(flat, [lambda t: arc(R, 0.0, 0.0, 2 * np.pi)(t) + move], TOLERANCE)
    check_on_edges(flat, polygon, lambda p: np.abs(np.hypot(p[:, 0] - 400, p[:, 1] - 450) - R))
    # Inscribed within the tolerance: short of the disc by 2/3 of a ring of that width at most.
    area = Face(flat, (polygon,)).area()
    assert np.pi * R**2 - 2 / 3 * 2 * np.pi * R * TOLERANCE <= area <= np.pi * R**2


@pytest.mark.parametrize("start", [0.0, 1.0, np.pi, -2.0])
def test_all_round_a_cylinder(start: float) -> None:
    """Bottom, seam, top, seam: the whole surface where the seam is the surface's own, from wherever the edges begin."""
    surface = tube()
    edges = [
        line((R, 0, 0), (R, 0, H)),
        backwards(arc(R, H, 0.0, 2 * np.pi)),
        line((R, 0, H), (R, 0, 0)),
        arc(R, 0.0, 0.0, 2 * np.pi),
    ]
    polygon = loop_polygon(surface, edges, TOLERANCE)
    assert Face(surface, (polygon,)).covers_domain()
    turned = [edges[i % 4] for i in range(int(start) + 1, int(start) + 5)]
    assert Face(surface, (loop_polygon(surface, turned, TOLERANCE),)).covers_domain()


@pytest.mark.parametrize(("start", "end"), [(0.5, 2.0), (3.0, 2 * np.pi), (0.0, 0.3)])
def test_a_band_of_a_cylinder(start: float, end: float) -> None:
    a, b = (np.array([R * np.cos(p), R * np.sin(p), 0.0]) for p in (start, end))
    up = np.array([0, 0, 300.0])
    edges = [arc(R, 0.0, start, end), line(b, b + up), backwards(arc(R, 300.0, start, end)), line(a + up, a)]
    polygon = loop_polygon(tube(), edges, TOLERANCE)
    assert Face(tube(), (polygon,)).area() == pytest.approx(R * (end - start) * 300.0, rel=1e-9)


def test_a_slanting_cut_of_a_cylinder() -> None:
    """The ellipse z = 250 + x/2 above the bottom circle: 2πR × 250 of area."""

    def ellipse(t: np.ndarray) -> np.ndarray:
        points = arc(R, 0.0, 0.0, 2 * np.pi)(t)
        points[:, 2] = 250.0 + 0.5 * points[:, 0]
        return points

    edges = [
        arc(R, 0.0, 0.0, 2 * np.pi),
        line((R, 0, 0), (R, 0, 350)),
        backwards(ellipse),
        line((R, 0, 350), (R, 0, 0)),
    ]
    polygon = loop_polygon(tube(), edges, TOLERANCE)
    face = Face(tube(), (polygon,))
    assert face.area() == pytest.approx(2 * np.pi * R * 250.0, abs=2 * np.pi * R * TOLERANCE)
    assert face.contains(
        *tube().closest_parameters([[-R, 0.0, 149.0], [-R, 0.0, 151.0], [0.0, R, 249.0]])
    ).tolist() == [
        True,
        False,
        True,
    ]


def test_a_hole_far_from_the_seam_and_the_area_it_takes() -> None:
    """A cylinder of radius a through the tube takes ∫ 2 √(a² − y²) R dφ, with y = R sin φ."""
    a = 80.0

    def hole(t: np.ndarray) -> np.ndarray:
        s, c = a * np.sin(2 * np.pi * t), a * np.cos(2 * np.pi * t)
        return np.stack([-np.sqrt(R**2 - s**2), s, 250.0 + c], axis=-1)

    polygon = loop_polygon(tube(), [hole], TOLERANCE)
    # y = a sin ψ makes the integrand smooth.
    psi, weight = np.polynomial.legendre.leggauss(60)
    psi, weight = 0.5 * np.pi * psi, 0.5 * np.pi * weight
    area = (weight * 2 * (a * np.cos(psi)) ** 2 * R / np.sqrt(R**2 - (a * np.sin(psi)) ** 2)).sum()
    assert Face(tube(), (polygon,)).area() == pytest.approx(area, abs=2 * np.pi * a * TOLERANCE)


def test_a_whole_sphere_with_both_poles() -> None:
    meridian = polar(R, 0.0)
    polygon = loop_polygon(sphere(), [None, meridian, None, backwards(meridian)], TOLERANCE)
    assert Face(sphere(), (polygon,)).covers_domain()
    polygon = loop_polygon(sphere(), [backwards(meridian), None, meridian, None], TOLERANCE)
    assert Face(sphere(), (polygon,)).covers_domain()


def test_a_lune_and_a_cap_of_a_sphere() -> None:
    """Between two meridians 1 rad apart R² × 2; above a parallel 2πR × height."""
    edges = [None, polar(R, 1.5), None, backwards(polar(R, 0.5))]
    for start in range(4):
        lune = loop_polygon(sphere(), [*edges[start:], *edges[:start]], TOLERANCE)
        assert Face(sphere(), (lune,)).area() == pytest.approx(2 * R**2, rel=1e-8)
    z = 0.6 * R

    def up(t: np.ndarray) -> np.ndarray:
        beta = np.arcsin(0.6) + t * (np.pi / 2 - np.arcsin(0.6))
        return R * np.stack([np.cos(beta), 0 * t, np.sin(beta)], axis=-1)

    cap = loop_polygon(sphere(), [arc(0.8 * R, z, 0.0, 2 * np.pi), up, None, backwards(up)], TOLERANCE)
    assert Face(sphere(), (cap,)).area() == pytest.approx(2 * np.pi * R * 0.4 * R, rel=1e-8)


def test_a_cone_to_its_point() -> None:
    side = line((R, 0, 0), (0, 0, H))
    polygon = loop_polygon(cone(), [arc(R, 0.0, 0.0, 2 * np.pi), side, None, backwards(side)], TOLERANCE)
    assert Face(cone(), (polygon,)).covers_domain()


def test_a_band_of_a_torus_across_both_seams_borders() -> None:
    """The outer half of a torus, between its two greatest parallels r = R at z = ±50: π r₀ · 2πR + 2π · 2 r₀²."""
    top, bottom = arc(R, 50.0, 0.0, 2 * np.pi), arc(R, -50.0, 0.0, 2 * np.pi)

    def inner(t: np.ndarray) -> np.ndarray:
        psi = np.pi / 2 + np.pi * t
        return np.stack([R + 50 * np.cos(psi), 0 * t, 50 * np.sin(psi)], axis=-1)

    polygon = loop_polygon(torus(), [top, inner, backwards(bottom), backwards(inner)], TOLERANCE)
    inner_half = np.pi * 50.0 * 2 * np.pi * R - 2 * np.pi * 2 * 50.0**2
    assert Face(torus(), (polygon,)).area() == pytest.approx(inner_half, rel=1e-8)


def test_smaller_tolerances_need_more_corners() -> None:
    counts = []
    for tolerance in (1.0, 0.1, 0.01, 0.001):
        polygon = loop_polygon(tube(), [_shifted_hole], tolerance)
        counts.append(len(polygon))
        share = np.linspace(0, 1, 9)[:, None, None]
        at = polygon + share * (np.roll(polygon, -1, axis=0) - polygon)
        p = tube().point(at[..., 0], at[..., 1]).reshape(-1, 3)
        assert np.abs(np.hypot(p[:, 1], p[:, 2] - 250.0) - 80.0).max() < 1.2 * tolerance
    assert counts == sorted(counts)
    assert counts[-1] > counts[0]


def _shifted_hole(t: np.ndarray) -> np.ndarray:
    s, c = 80.0 * np.sin(2 * np.pi * t), 80.0 * np.cos(2 * np.pi * t)
    return np.stack([-np.sqrt(R**2 - s**2), s, 250.0 + c], axis=-1)


def test_edges_off_the_surface_are_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"leaves the surface by 5 "):
        loop_polygon(tube(), [arc(R + 5.0, 100.0, 0.0, 2 * np.pi)], TOLERANCE, gap=1.0)
    with pytest.raises(InvalidInputError, match=r"leaves the surface by 50 .*RebuildEdges"):
        loop_polygon(tube(), [arc(R, H + 50.0, 0.0, 2 * np.pi)], TOLERANCE)


def test_edges_that_do_not_close_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="no closed chain"):
        loop_polygon(tube(), [line((R, 0, 0), (R, 0, H)), arc(R, 0.0, 0.0, 3.0)], TOLERANCE)
    square = BSplineSurface([0, 0, 1, 1], [0, 0, 1, 1], 1, 1, [[(0, 0, 5), (0, 900, 5)], [(900, 0, 5), (900, 900, 5)]])
    with pytest.raises(InvalidInputError, match="no closed chain"):
        parameter_loop_polygon(square, [lambda t: np.stack([t, 0 * t], axis=-1)], TOLERANCE)


def test_a_circle_round_a_closed_surface_is_no_border() -> None:
    with pytest.raises(InvalidInputError, match="no edge follows the seam"):
        loop_polygon(tube(), [arc(R, 100.0, 0.0, 2 * np.pi)], TOLERANCE)


@pytest.mark.parametrize("tolerance", [0.0, -1.0, np.nan])
def test_bad_tolerances(tolerance: float) -> None:
    with pytest.raises(InvalidInputError, match="tolerance"):
        loop_polygon(tube(), [arc(R, 0.0, 0.0, 2 * np.pi)], tolerance)
    with pytest.raises(InvalidInputError, match="tolerance"):
        parameter_loop_polygon(tube(), [], tolerance)
