"""Foliations of elastic splines: every leaf integrated from its differential equation, and the jumps of Fig. 5.4."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial import cKDTree

from batten.curves.cubic_proxy import CubicProxy
from batten.errors import InvalidInputError
from batten.measures.distance import hausdorff_distance
from batten.surfaces.design_surface import DesignSurface
from batten.surfaces.elastic_foliation import elastic_foliation
from batten.surfaces.isocurves import isocurve_pieces

LOW = CubicProxy([(0, 0), (1, 0.5), (2, 0.3), (4, -0.3), (5, -0.5), (6, 0)])
HIGH = CubicProxy([(0, 0.2), (1, 1.4), (2, 1.6), (4, 1.2), (5, 0.4), (6, 0.3)])
SURFACE = DesignSurface([LOW, HIGH, LOW], [0.0, 2.0, 3.0]).surface


def integrated(row):
    """Ends of one elastica from its seven numbers, by κ = κ₀ + (γ − γ₀) × force: x, y, θ, κ."""
    x0, y0, angle, kappa, lx, ly, length = row

    def rate(_, state):
        x, y, theta = state
        return [np.cos(theta), np.sin(theta), kappa + (x - x0) * ly - (y - y0) * lx]

    x, y, theta = solve_ivp(rate, (0.0, length), [x0, y0, angle], rtol=1e-11, atol=1e-12).y[:, -1]
    return np.array([x, y, theta, kappa + (x - x0) * ly - (y - y0) * lx])


@pytest.mark.parametrize("continuity", [1, 2])
def test_every_leaf_is_an_elastic_spline_on_its_isocurves_data(continuity):
    found = elastic_foliation(SURFACE, 9, continuity=continuity)
    pieces = isocurve_pieces(SURFACE, found.positions)
    assert set(found.status) == {"converged"}
    assert found.stable.all()
    assert found.misses.max() < 1e-9
    for rows, control in zip(found.parameters, pieces):
        ends = np.array([integrated(row) for row in rows])
        assert np.abs(ends[:, :2] - control[:, 3]).max() < 1e-8  # joints are met
        assert np.abs(rows[:, :2] - control[:, 0]).max() < 1e-12
        tangents = np.array([control[0, 1] - control[0, 0], control[-1, 3] - control[-1, 2]])
        angles = np.arctan2(tangents[:, 1], tangents[:, 0])
        assert np.abs([rows[0, 2] - angles[0], ends[-1, 2] - angles[1]]).max() < 1e-8
        assert abs(ends[0, 2] - rows[1, 2]) < 1e-8
        lengths = np.array([np.hypot(*np.diff(cubic(c), axis=0).T).sum() for c in control])
        if continuity == 1:
            inner = control[1, 1] - control[1, 0]
            assert abs(rows[1, 2] - np.arctan2(inner[1], inner[0])) < 1e-8
            assert rows[:, 6] == pytest.approx(lengths, rel=1e-7)
        else:
            assert abs(ends[0, 3] - rows[1, 3]) < 1e-7  # moments balance
            assert rows[:, 6].sum() == pytest.approx(lengths.sum(), rel=1e-7)


def cubic(control, n=20001):
    t = np.linspace(0.0, 1.0, n)[:, None]
    a, b, c, d = control
    return (1 - t) ** 3 * a + 3 * t * (1 - t) ** 2 * b + 3 * t**2 * (1 - t) * c + t**3 * d


def test_distances_are_those_of_leaf_and_isocurve():
    at = [0.0, 1.0, 2.5]
    found = elastic_foliation(SURFACE, at)
    for i, position in enumerate(at):
        fine = np.concatenate([cubic(c, 4001) for c in isocurve_pieces(SURFACE, [position])[0]])
        leaf = found.leaf(i).point(np.linspace(0.0, 1.0, 8001))
        apart = max(nearest(fine, leaf), nearest(leaf, fine))
        assert found.distances[i] == pytest.approx(apart, abs=1.2e-4)
        assert found.distances[i] > 1e-3
    assert found.greatest_distance == found.distances.max()


def nearest(points, others):
    return cKDTree(others).query(points)[0].max()


def wild(number):
    """Pairs of unrelated splines; the second, third and sixth jump or fail as rods that slide."""
    rng = np.random.default_rng(5)
    abscissae = np.array([0.0, 1.0, 2.0, 4.0, 5.0, 6.0])
    for _ in range(number + 1):
        pair = []
        for _ in range(2):
            x = abscissae + rng.normal(size=6) * 0.2 * (np.arange(6) % 5 != 0)
            pair.append(CubicProxy(np.column_stack([x, rng.normal(size=6) * 1.2])))
    return DesignSurface(pair, [0.0, 1.0]).surface


def test_rods_that_take_another_shape_between_two_leaves_are_told():
    surface = wild(1)
    alone = elastic_foliation(surface, 25, continuity=2)
    followed = elastic_foliation(surface, 25, continuity=2, follow=True)
    assert len(alone.jumps) == 1
    assert len(followed.jumps) == 0
    at = int(np.searchsorted(alone.positions, alone.jumps[0]))
    apart = hausdorff_distance(alone.leaf(at), alone.leaf(at + 1))
    assert apart > 3.0 * hausdorff_distance(followed.leaf(at), followed.leaf(at + 1))
    # before the jump both ways find the same rods, behind it others, that hold too and come to have more energy
    assert followed.energies[: at + 1] == pytest.approx(alone.energies[: at + 1], rel=1e-9)
    assert (np.abs(followed.energies - alone.energies)[at + 1 :] > 1e-6).all()
    assert followed.energies[-1] > 1.02 * alone.energies[-1]
    assert followed.stable.all()
    finer = elastic_foliation(surface, 49, continuity=2)
    assert finer.steps.max() > 1.8 * alone.steps.max()  # a jump does not get smaller with the distance of leaves


def test_a_leaf_without_a_spline_spoils_no_other():
    straight = CubicProxy.line((0, 0), (6, 0), 2)
    found = elastic_foliation(DesignSurface([straight, HIGH], [0.0, 1.0]).surface, 5)
    assert [word == "converged" for word in found.status] == [False, True, True, True, True]
    assert "longer" in found.status[0] or "exceed" in found.status[0]
    assert np.isnan(found.parameters[0]).all()
    assert np.isfinite(found.parameters[1:]).all()
    assert np.isnan(found.greatest_distance)
    with pytest.raises(InvalidInputError, match="leaf 0 has no"):
        found.leaf(0)


def test_bad_input_gets_one_clear_line():
    with pytest.raises(InvalidInputError, match="continuity"):
        elastic_foliation(SURFACE, 5, continuity=0)
    for at in (1, [1.0], [1.0, 0.5], [[0.0, 1.0]]):
        with pytest.raises(InvalidInputError, match="ascending"):
            elastic_foliation(SURFACE, at)
    with pytest.raises(InvalidInputError, match="leaves are 0 … 1"):
        elastic_foliation(SURFACE, 2).leaf(2)


def test_progress_is_told():
    seen = []
    elastic_foliation(SURFACE, 3, progress=lambda done, of: seen.append((done, of)))
    assert seen == [(1, 3), (2, 3), (3, 3)]
