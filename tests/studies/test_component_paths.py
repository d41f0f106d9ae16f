"""Paths of falling λ-residual: what they promise, tried where it is hard; the trunk; whiskers."""

import numpy as np
import pytest

from batten.measures.lambda_residual import lambda_residual
from batten.studies.component_paths import (
    LONGEST,
    TRUNK,
    control_points,
    descended,
    edge_lengths,
    in_trunk,
    join,
    least_by_edge,
    mirrored,
    residual,
    reversed_ends,
    stays_below,
    to_mirror_image,
    trunk_level,
)

LOOP = np.array([1.7, 1.05, -0.7, 1.05])
ARCH = np.array([-0.5, 1.6, 1.5, 1.6])
S_SHAPE = np.array([0.45, 0.33, 0.55, -0.33])
# An edge of length 0.0012 that points at the far control point: e_λ = 0.13 there, 1 in its neighbourhood.
WHISKER = np.array([0.0893, -0.2933, 0.99876, -0.0004])


def turning(inner):
    """Total turning of the tangent, radians, from the hodograph at 4000 places."""
    p = control_points(inner)
    edges = np.diff(p, axis=0)
    t = np.linspace(0.0, 1.0, 4001)[:, None]
    d = (1 - t) ** 2 * edges[0] + 2 * t * (1 - t) * edges[1] + t * t * edges[2]
    return float(np.unwrap(np.arctan2(d[:, 1], d[:, 0]))[[0, -1]] @ [-1.0, 1.0])


def hard_points(count):
    rng = np.random.default_rng(8)
    length = np.exp(rng.uniform(np.log(1e-3), np.log(LONGEST), (2, 200_000)))
    angle = rng.uniform(-np.pi, np.pi, (2, 200_000))
    x, y = length * np.cos(angle), length * np.sin(angle)
    points = np.column_stack([x[0], y[0], 1.0 + x[1], y[1]])
    return points[residual(points) < 0.3][:count]


def test_images_have_the_same_residual_and_are_their_own_inverse():
    points = hard_points(50)
    for image in (mirrored, reversed_ends):
        assert residual(image(points)) == pytest.approx(residual(points), abs=1e-6)
        assert image(image(points)) == pytest.approx(points, abs=1e-15)
    assert edge_lengths(reversed_ends(points)) == pytest.approx(edge_lengths(points)[:, ::-1], rel=1e-9)


def test_descent_falls_at_every_step_and_keeps_the_edges():
    points = hard_points(200)
    knots = []
    end = descended(points, 30, knots)
    steps = np.array(knots).reshape(30, 4, 200, 4)
    assert np.array_equal(steps[-1, -1], end)
    assert (edge_lengths(steps) <= LONGEST * (1 + 1e-12)).all()
    values = residual(steps)
    before = np.concatenate([residual(points)[None], values[:-1, -1]])
    assert (values <= before[:, None] + 1e-12).all()
    moved = (np.diff(np.concatenate([points[None], steps[:, -1]]), axis=0) != 0.0).any(axis=-1)
    assert moved.mean() > 0.5
    assert (residual(end) < 0.5 * residual(points)).mean() > 0.9


def test_paths_of_hard_points_stay_below_by_their_slopes():
    """And by brute force: 50 places on each piece of each path."""
    points = hard_points(150)
    share = np.linspace(0.0, 1.0, 50)[:, None, None]
    for path in join(points, keep_paths=True).paths:
        level = residual(path[0]) + 0.005
        assert stays_below(path, max(level, 0.1))
        assert residual(path[:-1] + share * np.diff(path, axis=0)).max() < max(level, 0.1)


def test_every_hard_point_is_joined_without_rising():
    points = hard_points(400)
    values = residual(points)
    joined = join(points)
    assert edge_lengths(points).min() < 0.02
    assert joined.levels == pytest.approx(np.maximum(values, joined.levels))
    assert (joined.levels < np.maximum(values, trunk_level()) + 1e-6).all()


def test_a_whisker_is_joined():
    assert residual(WHISKER) < 0.15
    off = WHISKER + np.array([0.0, 0.0, 0.0, 1e-4])
    assert residual(off) > residual(WHISKER) + 0.1
    joined = join(WHISKER[None], keep_paths=True)
    assert joined.levels[0] < 0.15
    assert stays_below(joined.paths[0], 0.2)


def test_a_loop_is_not_joined_below_the_level_asked_about():
    """It turns by more than the arch, the same way; between them lies a cusp, or an end that meets the curve."""
    assert turning(ARCH) == pytest.approx(-2 * np.arctan2(1.6, -0.5), abs=1e-6)
    assert abs(turning(LOOP)) > np.pi
    joined = join(LOOP[None], most_rounds=20)
    assert 0.35 < residual(LOOP) < 0.36
    assert joined.levels[0] > 0.5


def test_paths_begin_at_the_point_and_end_in_the_trunk():
    points = np.array([ARCH, S_SHAPE, WHISKER])
    joined = join(points, keep_paths=True)
    for point, path in zip(points, joined.paths):
        assert np.array_equal(path[0], point)
        assert np.array_equal(in_trunk(path[-1:])[0], path[-1])
        assert np.abs(path[-1] - [1 / 3, 0, 2 / 3, 0]).max() <= TRUNK + 1e-15
        assert stays_below(path, 0.2)


def test_the_trunk_is_low_everywhere_and_zero_in_the_middle():
    rng = np.random.default_rng(1)
    middle = np.array([1 / 3, 0.0, 2 / 3, 0.0])
    points = middle + rng.uniform(-TRUNK, TRUNK, (100_000, 4))
    assert residual(points).max() < trunk_level() < 0.1
    angle = rng.uniform(-np.pi, np.pi, 1000)
    flat = np.column_stack([np.zeros(1000), np.cos(angle), np.zeros(1000), np.sin(angle)])
    least = [lambda_residual(control_points(middle + size * flat)).max() for size in (0.1, 0.01, 0.001)]
    assert least[0] > 0.01 > 1e-3 > least[1]
    assert least[2] < 0.02 * least[1]  # like the square of the height


@pytest.mark.parametrize("start", [ARCH, S_SHAPE, WHISKER])
def test_the_way_to_the_mirror_image_stays_below(start):
    way = to_mirror_image(join(start[None], keep_paths=True).paths[0])
    assert np.array_equal(way[-1], mirrored(start))
    assert stays_below(way, 0.2)
    share = np.linspace(0.0, 1.0, 200)[:, None, None]
    assert residual(way[:-1] + share * np.diff(way, axis=0)).max() < 0.2


def test_a_cusp_on_the_way_is_seen():
    """The way from an arch to a loop with crossed handles, straight: both ends are smooth, a cusp lies between them."""
    assert not stays_below(np.array([ARCH, LOOP]), 0.9)
    assert not stays_below(np.array([S_SHAPE, ARCH, LOOP]), 0.5)
    assert stays_below(np.array([ARCH, ARCH]), 0.2)


def test_short_edges_cost_a_logarithm():
    """Least e_λ against edge length: growing, by less and less for each factor of 100, and below 0.2 at 1e-8."""
    least = least_by_edge(np.array([1e-1, 1e-2, 1e-4, 1e-6, 1e-8]))
    assert (np.diff(least) > 0.0).all()
    assert (np.diff(least[1:], n=2) < 0.0).all()
    assert 0.1 < least[-1] < 0.2
    # Nothing random is lower.
    rng = np.random.default_rng(2)
    far = rng.uniform(-1.0, 2.0, (200_000, 2))
    angle = np.arctan2(far[:, 1], far[:, 0]) + 0.01 * rng.normal(size=200_000)
    points = np.column_stack([0.01 * np.cos(angle), 0.01 * np.sin(angle), far])
    points = points[edge_lengths(points)[:, 1] < LONGEST]
    assert least[1] - 1e-6 < residual(points).min() < least[1] + 0.05
