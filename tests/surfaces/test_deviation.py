"""Distances from surfaces against planes, cylinders and brute force."""

import math

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.deviation import strip_deviation, surface_deviation

RNG = np.random.default_rng(11)


def flat(width: float = 600.0) -> BSplineSurface:
    return BSplineSurface(
        [0, 0, 1, 1], [0, 0, 1, 1], 1, 1, [[(0, 0, 0), (0, width, 0)], [(width, 0, 0), (width, width, 0)]]
    )


def arch(radius: float = 500.0) -> BSplineSurface:
    """A quarter of a cylinder about the y axis, 0 ≤ y ≤ 400."""
    arc = np.array([(0, 0, radius), (radius, 0, radius), (radius, 0, 0)], dtype=float)
    net = np.stack([arc, arc + np.array([0.0, 400.0, 0.0])], axis=1)
    return BSplineSurface(
        [0, 0, 0, 1, 1, 1], [0, 0, 1, 1], 2, 1, net, np.array([1, math.sqrt(0.5), 1])[:, None] * np.ones(2)
    )


def test_signed_distances_from_a_plane() -> None:
    points = RNG.uniform((10, 10, -50), (590, 590, 50), (100, 3))
    deviation = surface_deviation(flat(), points)
    assert deviation.signed == pytest.approx(points[:, 2], abs=1e-12)
    assert deviation.max == pytest.approx(np.abs(points[:, 2]).max())
    assert deviation.mean == pytest.approx(np.abs(points[:, 2]).mean())
    assert deviation.u == pytest.approx(points[:, 0] / 600)


def test_points_on_the_surface_are_at_distance_0() -> None:
    angle, y = RNG.uniform(0, math.pi / 2, 500), RNG.uniform(0, 400, 500)
    points = np.stack([500 * np.sin(angle), y, 500 * np.cos(angle)], axis=-1)
    assert surface_deviation(arch(), points).max < 1e-10


def test_beyond_the_border_the_extension_decides() -> None:
    point = [700.0, 300.0, 20.0]
    assert surface_deviation(flat(), point).max == pytest.approx(math.hypot(100, 20))
    assert surface_deviation(flat(), point, extend=0.5).max == pytest.approx(20)


def test_radial_distances_from_a_cylinder() -> None:
    angle, r, y = RNG.uniform(0.1, 1.4, 100), RNG.uniform(300, 700, 100), RNG.uniform(0, 400, 100)
    points = np.stack([r * np.sin(angle), y, r * np.cos(angle)], axis=-1)
    assert surface_deviation(arch(), points).signed == pytest.approx(r - 500, abs=1e-9)


def test_points_that_are_not_finite_count_for_nothing() -> None:
    deviation = surface_deviation(flat(), [[100.0, 100, 3], [np.nan, 0, 0]])
    assert np.isnan(deviation.signed).tolist() == [False, True]
    assert (deviation.max, deviation.mean) == (3.0, 3.0)
    assert math.isnan(surface_deviation(flat(), [[np.nan, 0, 0]]).max)


def chords(count: int) -> np.ndarray:
    """A strip whose straight blades lie on the arch, `count` of them, evenly turned about its axis."""
    angle = np.linspace(0, math.pi / 2, count)
    y = np.linspace(0, 400, 5)
    circle = 500 * np.stack([np.sin(angle), np.cos(angle)], axis=-1)
    strip = np.empty((count, 5, 3))
    strip[..., 0], strip[..., 1], strip[..., 2] = circle[:, None, 0], y, circle[:, None, 1]
    return strip


@pytest.mark.parametrize("count", [7, 16])
def test_a_strip_of_chords_sags_by_the_sagitta(count: int) -> None:
    result = strip_deviation(arch(), chords(count), refine=2)
    sagitta = 500 * (1 - math.cos(math.pi / 4 / (count - 1)))
    assert result.max == pytest.approx(sagitta, rel=1e-9)
    assert result.hausdorff == pytest.approx(sagitta, rel=1e-2)
    assert result.hausdorff >= result.max
    # Half of the samples lie on the arch, between them the sagitta, but for the odd ones at the ends.
    assert result.mean == pytest.approx(sagitta * (count - 1) / (2 * count - 1), rel=1e-9)


def test_hausdorff_sees_the_ridge_that_the_strip_leaves_out() -> None:
    # A flat strip under a surface with a steep ridge: every strip point has a foot beside it, the ridge's top has none.
    x = np.array([0, 280, 299, 300, 301, 320, 600.0])
    z = np.array([0, 0, 0, 90, 0, 0, 0.0])
    net = np.stack([np.stack([x, np.full(7, y), z], axis=-1) for y in (0.0, 100.0)], axis=1)
    surface = BSplineSurface([0, *np.arange(7), 6], [0, 0, 1, 1], 1, 1, net)
    gx, gy = np.meshgrid([0, 200, 290, 310, 400, 600.0], [0, 50, 100.0], indexing="ij")
    result = strip_deviation(surface, np.stack([gx, gy, np.zeros_like(gx)], axis=-1), refine=8)
    assert result.max < 2.0
    assert 45.0 < result.hausdorff <= 90.0


def test_bad_strips() -> None:
    with pytest.raises(InvalidInputError, match=r"strip of shape \(1, 5, 3\)"):
        strip_deviation(flat(), np.zeros((1, 5, 3)))
    with pytest.raises(InvalidInputError, match="refine = 0"):
        strip_deviation(flat(), np.zeros((2, 5, 3)), refine=0)
    broken = chords(4)
    broken[1, 1, 1] = np.nan
    assert math.isnan(strip_deviation(arch(), broken).hausdorff)
