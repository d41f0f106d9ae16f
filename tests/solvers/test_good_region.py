"""Good regions: against the criterion itself, computed another way, and against what symmetry asks for."""

import math

import numpy as np
import pytest
from scipy import ndimage

from batten.curves.cubic_proxy import Border, CubicProxy
from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError
from batten.measures.lambda_residual import lambda_residual
from batten.solvers.good_region import good_region
from batten.solvers.initial_guess import initial_elastica
from batten.solvers.region_polygons import inside_polygons
from batten.solvers.stability import stability


def random_proxy(rng, continuity, pieces=4):
    line = CubicProxy.line((0, 0), (pieces, 0), pieces, continuity)
    turns = np.cumsum(rng.normal(0.0, 0.6, pieces + 1))
    points = line.control_points + 0.12 * rng.standard_normal(line.control_points.shape)
    angle = np.interp(points[:, 0], np.arange(pieces + 1), turns)
    x, y = np.diff(points, axis=0, prepend=points[:1]).T
    steps = np.stack([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)], axis=-1)
    return CubicProxy(np.cumsum(steps, axis=0), continuity)


def angle_error(cubic):
    """By the public guess: 64 nodes, its own end angles."""
    rod = initial_elastica(cubic, nodes=64).elastica
    first, last = np.asarray(rod.angle_at([0.0, rod.length])).tolist()
    (x0, y0), (x1, y1) = cubic[1] - cubic[0], cubic[3] - cubic[2]
    return max(
        abs(math.remainder(first - math.atan2(y0, x0), 2 * math.pi)),
        abs(math.remainder(last - math.atan2(y1, x1), 2 * math.pi)),
    )


def meets_limits(proxy, index, place, slack=0.0):
    moved = proxy.with_control_point(index, place)
    pieces = moved.pieces[proxy.affected_pieces(index)]
    if lambda_residual(pieces).max() >= 0.21 + slack:
        return False
    return max(angle_error(p) for p in pieces) < math.radians(6) + slack


@pytest.mark.parametrize("continuity", [1, 2])
def test_the_criterion_is_that_of_the_public_functions(continuity):
    rng = np.random.default_rng(continuity)
    good = 0
    for _ in range(12):
        proxy = random_proxy(rng, continuity)
        index = int(rng.integers(len(proxy.control_points)))
        region = good_region(proxy, index)
        for place in rng.uniform(-0.5, 0.5, (25, 2)) + proxy.control_points[index]:
            one, other = meets_limits(proxy, index, place, 3e-4), meets_limits(proxy, index, place, -3e-4)
            if one == other:
                assert bool(region.is_good(place)) == one
                good += one
        pieces = proxy.pieces[proxy.affected_pieces(index)]
        assert np.abs(region.values.residual - lambda_residual(pieces)).max() < 1e-4
    assert good > 20


@pytest.mark.parametrize("continuity", [1, 2])
def test_the_border_brackets_the_limit(continuity):
    """Every vertex is good, and not good within 1 % of the width outwards."""
    rng = np.random.default_rng(10 + continuity)
    vertices = brackets = 0
    for _ in range(15):
        proxy = random_proxy(rng, continuity)
        region = good_region(proxy, int(rng.integers(len(proxy.control_points))))
        for polygon in region.polygons if region.bounded else ():
            reach = 0.01 * polygon.width
            around = reach * np.stack([np.cos(np.arange(16) * math.pi / 8), np.sin(np.arange(16) * math.pi / 8)], -1)
            for ring in (polygon.outer, *polygon.holes):
                assert region.is_good(ring).all()
                brackets += (~region.is_good(ring[:, None] + around)).any(axis=1).sum()
                vertices += len(ring)
    assert vertices > 500
    assert brackets >= 0.995 * vertices


def misclassified(region, number, cells):
    """Of polygon `number`: (area that is wrong, area, how far from the true border, over the region's width).

    By brute force on a grid of `cells` along the width: bad places inside, and good ones outside that hang together with
    good ones inside. The true border lies half a step, give or take that much, before the nearest node of the other kind.
    """
    polygon = region.polygons[number]
    low, high = polygon.outer.min(axis=0) - 0.05 * polygon.width, polygon.outer.max(axis=0) + 0.05 * polygon.width
    step = max(polygon.width / cells, math.sqrt(np.prod(high - low) / 4e5))
    sides = [np.arange(a, b + step, step) for a, b in zip(low, high)]
    places = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1)
    good, inside = region.is_good(places), rowwise(region.polygons, places)
    own = inside if len(region.polygons) == 1 else rowwise([polygon], places)
    labels, _ = ndimage.label(good, np.ones((3, 3)))
    far = np.where(good, ndimage.distance_transform_edt(good), ndimage.distance_transform_edt(~good))
    off = (far - 0.5) * step / region.width
    wrong = (own & ~good) | (good & ~inside & np.isin(labels, np.unique(labels[good & own])))
    return wrong.sum() * step**2, own.sum() * step**2, float(off[wrong].max(initial=0.0))


def rowwise(polygons, places):
    """Which places lie in the polygons, row by row to save memory."""
    return np.array([inside_polygons(polygons, row) for row in places])


def borders(continuity, count, seed, cells):
    """For each region the share of its area that is wrong, and for each polygon how far its border is off."""
    rng = np.random.default_rng(seed)
    shares, off = [], []
    for _ in range(count):
        proxy = random_proxy(rng, continuity)
        region = good_region(proxy, int(rng.integers(len(proxy.control_points))))
        if region.polygons:
            found = np.array([misclassified(region, k, cells) for k in range(len(region.polygons))])
            shares.append(found[:, 0].sum() / found[:, 1].sum())
            off += found[:, 2].tolist()
    return np.array(shares), np.array(off)


@pytest.mark.parametrize("continuity", [1, 2])
def test_borders_are_right_to_one_per_cent_of_the_width(continuity):
    share, off = borders(continuity, 10, 60, cells=200)
    assert len(off) >= 10
    assert np.median(share) < 0.006
    assert (off <= 0.01).mean() >= 0.95


@pytest.mark.slow
@pytest.mark.parametrize("continuity", [1, 2])
def test_borders_of_many_regions_are_right_to_one_per_cent_of_the_width(continuity):
    share, off = borders(continuity, 100, 77, cells=400)
    print(
        f"C{continuity}: wrong area {np.quantile(share, [0.5, 0.95, 1.0])}, within 1 % {(off <= 0.01).mean()} of {len(off)}"
    )
    assert np.median(share) < 0.005
    assert np.quantile(share, 0.95) < 0.025
    assert (off <= 0.01).mean() >= 0.99


@pytest.mark.parametrize("continuity", [1, 2])
def test_the_area_is_that_of_a_dense_grid(continuity):
    rng = np.random.default_rng(20 + continuity)
    shares = []
    for _ in range(10):
        proxy = random_proxy(rng, continuity)
        region = good_region(proxy, int(rng.integers(len(proxy.control_points))))
        if not region.polygons:
            continue
        rings = np.concatenate([p.outer for p in region.polygons])
        low, high = rings.min(axis=0), rings.max(axis=0)
        places = rng.uniform(low, high, (4000, 2))
        inside = region.is_good(places)
        shares.append((inside != region.contains(places)).sum() / inside.sum())
        count = region.contains(places).sum() / 4000 * np.prod(high - low)
        assert abs(count - region.area) < 0.1 * np.prod(high - low)
    assert np.median(shares) < 0.015


def test_a_symmetric_spline_has_a_symmetric_region():
    proxy = CubicProxy([(-2, -1), (-1.7, -0.4), (-0.4, 0), (0.4, 0), (1.7, -0.4), (2, -1)])
    left, right = good_region(proxy, 2), good_region(proxy, 3)
    assert abs(left.area - right.area) < 0.01 * left.area
    rng = np.random.default_rng(0)
    places = rng.uniform((-2, -1.5), (1.5, 1.5), (3000, 2))
    assert (left.is_good(places) == right.is_good(places * (-1, 1))).all()
    assert (left.contains(places) != right.contains(places * (-1, 1))).sum() < 0.02 * left.contains(places).sum()


def test_similar_splines_have_similar_regions():
    turn = Similarity(30.0, 2.0, (5.0, -70.0))
    rng = np.random.default_rng(4)
    proxy = random_proxy(rng, 1)
    one, other = good_region(proxy, 4), good_region(proxy.transformed(turn), 4)
    assert abs(other.area / 900.0 - one.area) < 0.01 * one.area
    places = rng.uniform(-0.7, 0.7, (2000, 2)) + proxy.control_points[4]
    assert (one.contains(places) != other.contains(turn.apply(places))).sum() <= 0.01 * one.contains(places).sum() + 2


def test_clamped_places_are_good_and_near():
    rng = np.random.default_rng(6)
    for _ in range(8):
        proxy = random_proxy(rng, 1)
        index = int(rng.integers(len(proxy.control_points)))
        region = good_region(proxy, index)
        for place in rng.normal(0, 1.0, (10, 2)) + proxy.control_points[index] if region.polygons else ():
            found = region.clamp(place)
            assert region.is_good(found)
            vertices = np.concatenate([p.outer for p in region.polygons])
            assert np.linalg.norm(found - place) <= np.linalg.norm(vertices - place, axis=-1).min() * 1.2 + 0.1
            if region.is_good(place) and region.contains(place):
                assert (found == place).all()


def test_a_bordered_joint_never_leaves_its_border():
    rng = np.random.default_rng(8)
    line = CubicProxy.line((0, 0), (9, 0), 3)
    proxy = CubicProxy(line.control_points, borders=[None, Border.vertical(3), Border.vertical(6), None])
    free, held = good_region(line, 2), good_region(proxy, 2)
    assert held.active_is_good
    assert abs(free.area - held.area) > 0.05 * free.area
    for place in rng.uniform(held.polygons[0].outer.min(0), held.polygons[0].outer.max(0), (30, 2)):
        moved = proxy.with_control_point(2, place)
        assert abs(moved.joints[1, 0] - 3) < 1e-14
        assert bool(held.is_good(place)) == meets_limits(proxy, 2, place)


def test_parallel_borders_and_two_derivatives_leave_intervals():
    line = CubicProxy.line((0, 0), (5, 0), 5, 2)
    proxy = CubicProxy(line.control_points, 2, [Border.vertical(x) for x in range(6)])
    region = good_region(proxy, 3)
    assert region.polygons == ()
    assert len(region.intervals) >= 1
    for a, b in region.intervals:
        assert a[0] == b[0] == proxy.control_points[3, 0]
        inside, outside = (a + b) / 2, b + 0.01 * (b - a)
        assert region.contains(inside)
        assert region.is_good(inside)
        assert not region.is_good(outside)
    assert region.is_good(region.clamp((2.0, 50.0)))
    assert region.clamp((2.0, 50.0))[0] == proxy.control_points[3, 0]


def test_further_limits_make_the_region_smaller():
    proxy = CubicProxy([(-2, -1), (-1.7, -0.4), (-0.4, 0), (0.4, 0), (1.7, -0.4), (2, -1)])
    plain = good_region(proxy, 2)
    bent = good_region(proxy, 2, curvature_below=2.0)
    stable = good_region(proxy, 2, margin_above=2.0)
    assert 0 < bent.area < 0.98 * plain.area
    assert 0 < stable.area < 0.9 * plain.area
    for region, limit in ((bent, "curvature"), (stable, "margin")):
        for place in region.polygons[0].outer[::6]:
            for piece in proxy.with_control_point(2, place).pieces:
                rod = initial_elastica(piece).elastica
                if limit == "curvature":
                    assert np.abs(rod.curvature_at(np.linspace(0, rod.length, 100))).max() < 2.0 + 2e-3
                else:
                    assert stability(rod).margin > 2.0 - 2e-3


def test_a_spline_that_crosses_itself_is_refused():
    loop = CubicProxy([(0, 0), (3, 0), (3, 2), (2, 2), (0.5, 2), (1.5, -1.5)])
    assert len(good_region(loop, 1, simple=True, residual_below=1.0, angle_error_below=9.0).polygons) >= 1
    region = good_region(loop, 5, simple=True, residual_below=1.0, angle_error_below=9.0)
    assert not region.active_is_good
    assert good_region(loop, 5, residual_below=1.0, angle_error_below=9.0).active_is_good


def test_a_window_is_kept_to():
    proxy = CubicProxy.line((0, 0), (9, 0), 3)
    region = good_region(proxy, 3, window=(3.6, -0.2, 4.4, 0.2))
    rings = np.concatenate([p.outer for p in region.polygons])
    assert (rings >= (3.6, -0.2)).all()
    assert (rings <= (4.4, 0.2)).all()
    assert abs(region.area - 0.32) < 0.01 * 0.32


@pytest.mark.parametrize(
    ("options", "index"),
    [({"residual_below": 0.0}, 1), ({"angle_error_below": -1.0}, 1), ({"resolution": 0.5}, 1), ({"window": (0, 0, 0, 1)}, 1),
     ({"curvature_below": 0.0}, 1), ({"margin_above": -1.0}, 1), ({}, 9)],
)  # fmt: skip
def test_bad_input_is_refused_in_words(options, index):
    with pytest.raises(InvalidInputError, match=r"\w+ \w+ \w+"):
        good_region(CubicProxy.line((0, 0), (9, 0)), index, **options)


def test_a_spline_without_shape_is_refused():
    with pytest.raises(InvalidInputError, match="all lie at"):
        good_region(CubicProxy([(0, 0), (1, 1), (1, 1), (1, 1)]), 0)
