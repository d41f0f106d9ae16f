"""The study of good regions, with a coarse database: areas by other means, the same for any number of workers."""

import dataclasses

import numpy as np
import pytest

from batten.curves.cubic_proxy import CubicProxy
from batten.measures.lambda_residual import lambda_residual
from batten.solvers.good_region import good_region
from batten.solvers.good_region_database import angle_error, build_good_region_database, database_region
from batten.solvers.region_polygons import Polygon, inside_polygons
from batten.studies import regions
from batten.studies.regions import STUDY, areas_of_two, columns, lines, random_splines, within_grids
from batten.studies.study import run


@pytest.fixture(scope="module")
def database():
    return build_good_region_database(spacing=0.5, cells=8)


@pytest.fixture(scope="module")
def outcome(database):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(regions, "study_database", lambda: database)
        made = run(STUDY, 24, seed=5)
    return made


def test_random_splines_are_close_to_elastica():
    control = random_splines(40, np.random.default_rng(2))
    assert control.shape == (40, 8, 2)
    pieces = np.array([CubicProxy(points).pieces for points in control])
    assert lambda_residual(pieces, tolerance=1e-8).max() < 0.21 + 1e-4
    assert angle_error(pieces).max() < np.radians(6.0)


def test_areas_of_two_against_closed_forms():
    angle = 2.0 * np.pi * np.arange(1000) / 1000
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    disc, moved, annulus = (
        Polygon(circle),
        Polygon(circle + np.array([1.0, 0.0])),
        Polygon(2.0 * circle, (circle[::-1],)),
    )
    lens = 2.0 * np.pi / 3.0 - np.sqrt(3.0) / 2.0  # of two unit circles, centres 1 apart
    for first, second, wanted in (
        ([annulus], [], (3.0 * np.pi, 0.0, 3.0 * np.pi)),
        ([annulus], [annulus], (3.0 * np.pi, 3.0 * np.pi, 0.0)),
        ([annulus], [disc], (3.0 * np.pi, np.pi, 4.0 * np.pi)),
        ([disc], [moved], (np.pi, np.pi, 2.0 * (np.pi - lens))),
        ([disc, disc], [moved, disc], (np.pi, 2.0 * np.pi - lens, np.pi - lens)),  # polygons that overlap count once
        ([annulus, disc], [], (4.0 * np.pi, 0.0, 4.0 * np.pi)),
        ([], [], (0.0, 0.0, 0.0)),
    ):
        assert areas_of_two(first, second) == pytest.approx(wanted, rel=2e-4, abs=1e-9)


def test_areas_of_the_study_against_points_in_polygons(outcome, database):
    """Each case again: regions from the stored spline, areas by a grid of points."""
    r = outcome.results
    for i in range(5):
        proxy = CubicProxy(r.control_points[i])
        ours, theirs = good_region(proxy, int(r.index[i])), database_region(database, proxy, int(r.index[i]))
        rings = np.concatenate([p.outer for p in (*ours.polygons, *theirs.polygons)])
        low, high = rings.min(axis=0), rings.max(axis=0)
        part = (np.arange(250) + 0.5) / 250
        grid = low + (high - low) * np.stack(np.meshgrid(part, part), axis=-1)
        one, other = inside_polygons(ours.polygons, grid), inside_polygons(theirs.polygons, grid)
        whole = np.prod(high - low)
        assert r.difference[i] == pytest.approx((one ^ other).mean() * whole, abs=0.01 * r.union[i])
        assert r.union[i] == pytest.approx((one | other).mean() * whole, rel=0.01)
        finer = areas_of_two(ours.polygons, theirs.polygons, 8000)
        assert r.difference[i] == pytest.approx(finer[2], abs=1e-3 * r.union[i])
        assert r.holds_active[i] == theirs.contains(proxy.control_points[r.index[i]])
        beyond = one.copy()
        beyond[one] = ~within_grids(database, theirs, grid[one])
        assert r.beyond[i] == pytest.approx(beyond.mean() * whole, abs=0.03 * r.ours[i])


def test_within_grids_judges_the_pieces_themselves(database):
    """Against the affected pieces brought to standard position by their own points."""
    control = random_splines(6, np.random.default_rng(8))
    places = np.random.default_rng(1).uniform(-30, 30, (400, 2))
    for points, index in zip(control, (0, 1, 3, 4, 6, 7)):
        proxy = CubicProxy(points)
        region = database_region(database, proxy, index)
        wanted = []
        for place in places:
            pieces = proxy.with_control_point(index, place).pieces
            good = True
            for role in region.roles:
                z = (pieces[role.piece] @ (1.0, 1j) - role.origin) / role.unit
                inner = z[:2] if abs(z[3]) < 1e-9 else z[2:]
                good &= bool((np.abs(inner.real) <= 4.0).all() and (np.abs(inner.imag - 0.5) <= 4.0).all())
            wanted.append(good)
        assert within_grids(database, region, places).tolist() == wanted
        assert 0 < sum(wanted) < 400


def test_the_number_of_workers_does_not_matter(outcome, database, monkeypatch):
    monkeypatch.setattr(regions, "study_database", lambda: database)
    small = dataclasses.replace(STUDY, part_size=4)
    one, two = run(small, 10, seed=1, workers=1).results, run(small, 10, seed=1, workers=2).results
    for field in dataclasses.fields(one):
        assert np.array_equal(getattr(one, field.name), getattr(two, field.name))
    assert not np.array_equal(outcome.results.control_points[:10], one.control_points)


def test_lines_and_columns_say_what_was_found(outcome):
    text, r = lines(outcome), outcome.results
    share = r.difference / r.union
    row = next(line for line in text if line.startswith("all")).split()
    assert row[1] == "24"
    assert float(row[4]) == pytest.approx(np.median(share), abs=6e-4)
    assert 0.0 < np.median(share) < 1.0
    assert f"leaves out the present, good place in {1.0 - r.holds_active.mean():.1%}" in text[-1]
    assert all(len(line) <= 125 for line in text)
    table = columns(r)
    assert {len(column) for column in table.values()} == {24}
    assert np.array_equal(table["y7"], r.control_points[:, 7, 1])
    assert list(table)[-6:] == ["ours", "database", "difference", "beyond", "bounded", "holds_active"]


def test_the_database_is_built_once(monkeypatch, database):
    calls = []
    monkeypatch.setattr(regions, "build_good_region_database", lambda: calls.append(1) or database)
    regions._built.cache_clear()
    try:
        assert regions.study_database() is regions.study_database() is database
        assert calls == [1]
    finally:
        regions._built.cache_clear()


@pytest.mark.slow
def test_agreement_with_the_database_at_full_resolution():
    share = (results := run(STUDY, 100, seed=0).results).difference / results.union
    assert 0.15 < np.median(share) < 0.35
