"""The papers' database: its rows against independent evaluation, its search by brute force, its regions by the criterion."""

import math

import numpy as np
import pytest

from batten.curves.bezier import CubicBezier
from batten.curves.cubic_proxy import Border, CubicProxy
from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError
from batten.measures.lambda_residual import lambda_residual
from batten.measures.lambda_residual_gradient import lambda_residual_gradient
from batten.solvers.good_region import good_region
from batten.solvers.good_region_database import (
    angle_error,
    border_crossings,
    build_good_region_database,
    database_region,
    database_roles,
    refined_grid,
    standard_cubics,
)
from batten.solvers.initial_guess import initial_elastica
from batten.solvers.region_polygons import nearest_on_polygons

LIMIT = math.radians(6.0)
# A C¹ spline whose pieces are all good.
SPLINE = np.array([(0, 0), (0.9, 0.5), (2, 0.7), (4, 0.5), (5, 0.2), (7, -0.1), (8, 0.1), (9, 0.6)], dtype=float)


@pytest.fixture(scope="module")
def coarse():
    return build_good_region_database(spacing=0.5, cells=8)


def cubics(database):
    return standard_cubics(database.points["c1"], database.points["c2"])


def test_angle_error_is_that_of_the_first_guess():
    """Against `initial_elastica` one by one, with twice the nodes, and against what `good_region` says of a piece."""
    rng = np.random.default_rng(3)
    control = standard_cubics(rng.uniform(-3, 3, (300, 2)), rng.uniform(-2, 3, (300, 2)))
    control = control[lambda_residual(control) < 0.21]
    assert len(control) > 8
    error = angle_error(control)
    for points, value in zip(control, error):
        guess, curve = initial_elastica(points, nodes=64).elastica, CubicBezier(points)
        ends = [
            (guess.angle_at(0.0), curve.derivative(0.0, 1)),
            (guess.angle_at(guess.length), curve.derivative(1.0, 1)),
        ]
        turns = [math.remainder(angle - math.atan2(*tangent[::-1]), 2.0 * math.pi) for angle, tangent in ends]
        assert value == pytest.approx(max(map(abs, turns)), abs=1e-5)
        seen = good_region(CubicProxy(points), 0, window=(50, 50, 51, 51)).values.angle_error[0]
        assert value == pytest.approx(seen, abs=1e-4)


def test_rows_are_curves_within_the_limits(coarse):
    """e_λ with 1e-9, angle error with twice the nodes, c₀ = 2c₁ − c₂: for every row."""
    control = cubics(coarse)
    assert len(control) > 20_000
    assert np.abs(lambda_residual(control, tolerance=1e-9) - coarse.rows[:, 4]).max() < 1e-4
    assert coarse.rows[:, 4].max() < 0.21
    assert coarse.rows[:, 5].max() < LIMIT
    assert np.mean(angle_error(control, nodes=64) >= LIMIT) < 1e-3
    assert np.allclose(control[:, 0], 0.5 * (coarse.rows[:, :2] + coarse.rows[:, 2:4]), atol=1e-14)
    assert ((control[:, 0, 0] < 0) | (control[:, 1, 0] < 0)).all()  # one of the points in the left two quadrants


def test_no_good_curve_of_the_grids_is_missing(coarse):
    """For some places of c₁ and of c₂ all places of the refined grid are judged again."""
    for moving, name in ((2, "c1"), (1, "c2")):
        for place in ((-0.75, 1.75), (-2.25, 0.25)):
            fine = refined_grid(place, moving, spacing=0.5, cells=8).fine
            control = standard_cubics(place, fine) if moving == 2 else standard_cubics(fine, place)
            good = lambda_residual(control) < 0.21
            good[good] = angle_error(control[good]) < LIMIT
            at = np.abs(coarse.points[name] - place).max(axis=1) < 1e-12
            stored = cubics(coarse)[at][:, moving - 1]
            wanted = control[good][:, moving - 1]
            assert len(wanted) > 20
            off = np.abs(wanted[:, None] - stored[None]).max(axis=2).min(axis=1)
            assert off.max() < 1e-12


def test_grids_are_finer_where_the_residual_varies_quickly():
    grid = refined_grid((-1.375, 2.125), 2, spacing=0.25, cells=16)
    _, gradient = lambda_residual_gradient(standard_cubics((-1.375, 2.125), grid.coarse), tolerance=None)
    size = np.linalg.norm(gradient[:, 1], axis=1)
    assert np.allclose(size, grid.gradients, equal_nan=True)
    cell = np.floor(grid.fine / 0.25 - (0.0, 2.0)).astype(int)
    numbers = np.floor(grid.coarse / 0.25 - (0.0, 2.0)).astype(int)
    many = np.array([np.count_nonzero((cell == number).all(axis=1)) for number in numbers])
    order = np.argsort(size)
    quarters = np.array_split(many[order], 4)
    assert [np.unique(q).tolist() for q in quarters] == [[1], [4], [9], [16]]


def test_building_is_deterministic_reports_progress_and_checks_its_input():
    seen = []
    one, two = (
        build_good_region_database(spacing=1.0, cells=4, progress=lambda *words: seen.append(words)) for _ in range(2)
    )
    assert np.array_equal(one.rows, two.rows)
    assert seen[31] == ("database", 32, 64)
    assert seen[63] == ("database", 64, 64)
    for bad in ({"spacing": 0.0}, {"cells": 0}, {"subdivisions": (1, 2, 3)}, {"subdivisions": (0, 1, 1, 1)}):
        with pytest.raises(InvalidInputError, match="subdivisions"):
            build_good_region_database(**bad)


@pytest.mark.parametrize(("active", "fixed"), [("c0", "c2"), ("c2", "c0"), ("c1", "c2"), ("c2", "c1")])
def test_matches_are_those_of_a_linear_search_with_mirror_images(coarse, active, fixed):
    rng = np.random.default_rng(1)
    for place in rng.uniform((-2, -1), (2, 3), (10, 2)):
        both = [(coarse.points[fixed] * flip, coarse.points[active] * flip) for flip in ((1, 1), (-1, 1))]
        wanted = np.concatenate([a[np.hypot(*(f - place).T) <= 0.3] for f, a in both])
        found = coarse.matches(active, fixed, place, 0.3)
        assert np.array_equal(found, np.unique(wanted.round(12), axis=0))
        mirrored = coarse.matches(active, fixed, place * (-1, 1), 0.3) * (-1, 1)
        assert np.array_equal(np.unique(mirrored.round(12), axis=0), found)
    assert coarse.matches(active, fixed, (50.0, 50.0)).shape == (0, 2)


def test_matches_refuse_in_words(coarse):
    for bad in (("c3", "c2", (0, 0)), ("c0", "c2", (0, 0, 0)), ("c0", "c2", (0, 0), -1.0)):
        with pytest.raises(InvalidInputError, match="matches are sought"):
            coarse.matches(*bad)


@pytest.mark.parametrize("index", range(8))
def test_roles_bring_the_affected_pieces_to_standard_position(index):
    """Wherever the active point is put: c₃ and c₄ are (0, 1) and (0, 0), c₁ and c₂ follow from the role."""
    proxy = CubicProxy(SPLINE)
    roles = database_roles(proxy, index)
    assert sorted(role.piece for role in roles) == proxy.affected_pieces(index).tolist()
    target = np.array([3.3, -1.7])
    moved = proxy.with_control_point(index, target)
    for role in roles:
        z = (moved.pieces[role.piece] @ (1.0, 1j) - role.origin) / role.unit
        standard = np.stack([z.real, z.imag], axis=-1)
        if np.abs(standard[3]).max() > 1e-12:
            standard = standard[::-1]
        at = (target @ (1.0, 1j) - role.origin) / role.unit
        places = {role.active: np.array([at.real, at.imag]), role.fixed: role.place}
        c1 = places["c1"] if "c1" in places else 0.5 * (places["c0"] + places["c2"])
        assert np.allclose(standard, [c1, places["c2"], (0, 1), (0, 0)], atol=1e-12)


@pytest.mark.parametrize("index", range(8))
def test_most_of_a_region_is_good(coarse, index):
    """By the criterion itself, which shares nothing with the search: more than half of it. It lies in both shapes."""
    proxy = CubicProxy(SPLINE)
    region, judge = database_region(coarse, proxy, index), good_region(proxy, index)
    assert judge.active_is_good
    rings = np.concatenate([polygon.outer for polygon in region.polygons])
    grid = np.stack(np.meshgrid(*np.linspace(rings.min(axis=0), rings.max(axis=0), 60).T), axis=-1).reshape(-1, 2)
    inside = grid[region.contains(grid)]
    assert region.area > 0.0
    assert len(inside) > 200
    assert judge.is_good(inside).mean() > 0.5
    for shape in region.shapes:
        outside = inside[~shape.contains(inside)]  # bridged by the α-shape of the intersection, so within its radius
        reach = max(s.radius for s in region.shapes)
        assert all(np.hypot(*(nearest_on_polygons(shape.polygons, p)[0] - p)) <= reach for p in outside)


def test_a_wider_search_blurs(coarse):
    proxy = CubicProxy(SPLINE)
    areas = [database_region(coarse, proxy, 3, search_radius=radius).area for radius in (0.25, 0.5, 1.0)]
    assert areas[0] < areas[1] < areas[2]


def test_regions_follow_similarities_and_reversal(coarse):
    proxy = CubicProxy(SPLINE)
    similarity = Similarity(scale=3.0, rotation=0.7, translation=(5.0, -2.0))
    moved = CubicProxy(similarity.apply(SPLINE))
    for index in (0, 3, 4):
        region = database_region(coarse, proxy, index)
        assert database_region(coarse, moved, index).area == pytest.approx(9.0 * region.area, rel=1e-6)
        assert database_region(coarse, CubicProxy(SPLINE[::-1]), 7 - index).area == pytest.approx(region.area, rel=1e-6)
        assert database_region(coarse, CubicProxy(SPLINE * (1, -1)), index).area == pytest.approx(region.area, rel=1e-6)


def test_what_the_database_cannot_do(coarse):
    far = SPLINE.copy()
    far[4] = (400.0, 90.0)
    region = database_region(coarse, CubicProxy(far), 3)
    assert (region.polygons, region.area, region.contains([(0.0, 0.0)]).tolist()) == ((), 0.0, [False])
    with pytest.raises(InvalidInputError, match="C¹ splines without borders"):
        database_region(coarse, CubicProxy.line((0, 0), (6, 0), pieces=3, continuity=2), 2)
    bordered = CubicProxy(SPLINE, borders=[None, Border.vertical(3.0), None, None])
    with pytest.raises(InvalidInputError, match="C¹ splines without borders"):
        database_region(coarse, bordered, 2)
    collapsed = SPLINE.copy()
    collapsed[6] = collapsed[7]
    with pytest.raises(InvalidInputError, match="length zero"):
        database_region(coarse, CubicProxy(collapsed), 5)


def test_border_crossings_of_two_squares():
    square = np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)])
    found = border_crossings((square,), (square + np.array([1.0, 0.5]),))
    assert sorted(found.tolist()) == [[1.0, 2.0], [2.0, 0.5]]
    assert len(border_crossings((square,), (square + 5.0,))) == 0
    assert len(border_crossings((), (square,))) == 0


@pytest.mark.slow
def test_the_default_database_has_as_many_rows_as_the_thesis():
    database = build_good_region_database()
    assert len(database.rows) == pytest.approx(385_000, rel=0.1)
