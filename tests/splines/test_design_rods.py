"""The rods of a design: against known curves, dense sampling and the conditions at the joints."""

import math

import numpy as np
import pytest

from batten.curves.cubic_proxy import CubicProxy
from batten.errors import InvalidInputError
from batten.solvers.initial_guess import initial_elastica
from batten.splines.design_rods import design_rods


@pytest.fixture(scope="module")
def bow():
    line = CubicProxy.line((0.0, 0.0), (9.0, 0.0), 3)
    heights = np.array([0.0, 0.7, 1.1, 0.3, -0.6, -1.2, -0.5, 0.0])
    return CubicProxy(np.column_stack([line.control_points[:, 0], heights]))


def farthest(one, other):
    """The greatest distance of 401 points of a curve from a fine polyline on another."""
    points, line = one.point(np.linspace(0.0, 1.0, 401))[:, None], other.point(np.linspace(0.0, 1.0, 801))
    along = np.diff(line, axis=0)
    part = np.einsum("ijk,jk->ij", points - line[:-1], along) / np.einsum("jk,jk->j", along, along)
    nearest = line[:-1] + np.clip(part, 0.0, 1.0)[..., None] * along
    return np.hypot(*np.moveaxis(points - nearest, -1, 0)).min(axis=1).max()


@pytest.mark.parametrize("kind", ["guess", "joined", "fit"])
def test_distances_are_those_of_dense_points(bow, kind):
    rods = design_rods(bow.pieces, kind)
    for curve, rod, distance in zip(bow.beziers(), rods.elastica, rods.distances):
        expected = max(farthest(curve, rod), farthest(rod, curve))
        assert distance == pytest.approx(expected, abs=1.1e-4 * curve.length)
        assert distance > 2e-4 or expected < 4e-4
    assert rods.greatest_distance == rods.distances.max() < 0.05


def test_guesses_are_the_first_guesses(bow):
    for piece, rod in zip(bow.pieces, design_rods(bow.pieces, "guess").elastica):
        np.testing.assert_allclose(rod.parameters, initial_elastica(piece).elastica.parameters, rtol=1e-9, atol=1e-9)


def test_joined_rods_meet_and_are_similar_to_the_guesses(bow):
    guesses, joined = design_rods(bow.pieces, "guess"), design_rods(bow.pieces, "joined")
    assert np.all(guesses.gaps > 1e-6)
    assert np.all(joined.gaps < 1e-11 * 3.0)
    for piece, guess, rod in zip(bow.pieces, guesses.elastica, joined.elastica):
        np.testing.assert_allclose(rod.start, piece[0], atol=1e-13)
        np.testing.assert_allclose(rod.point(1.0), piece[3], atol=1e-11)
        assert rod.to_modulus().k == pytest.approx(guess.to_modulus().k, rel=1e-9)
        assert rod.angle_at(rod.length) - rod.start_angle == pytest.approx(
            float(guess.angle_at(guess.length)) - guess.start_angle, abs=1e-9
        )


def test_fitted_rods_have_the_tangents_of_the_proxy(bow):
    fitted = design_rods(bow.pieces, "fit")
    assert np.all(fitted.gaps < 1e-11)
    assert np.all(np.abs(fitted.turns) < 1e-10)
    for piece, rod in zip(bow.pieces, fitted.elastica):
        x, y = piece[1] - piece[0]
        assert math.remainder(rod.start_angle - math.atan2(y, x), 2.0 * math.pi) == pytest.approx(0.0, abs=1e-11)


def test_straight_pieces_are_straight_rods_and_a_point_has_none():
    line = design_rods(CubicProxy.line((1.0, 2.0), (4.0, 6.0), 2).pieces)
    assert line.greatest_distance < 1e-12
    assert [rod.length for rod in line.elastica] == pytest.approx([2.5, 2.5], rel=1e-12)
    pieces = np.array([[(0, 0), (1, 0), (2, 0), (3, 0)], [(3, 0)] * 4, [(3, 0), (4, 0), (5, 0), (6, 0)]], dtype=float)
    rods = design_rods(pieces)
    assert [rod is None for rod in rods.elastica] == [False, True, False]
    assert np.isnan(rods.distances).tolist() == [False, True, False]
    assert np.isnan(rods.gaps).all()
    assert np.isnan(rods.greatest_distance)


def test_what_is_no_row_of_cubics_is_refused(bow):
    with pytest.raises(InvalidInputError, match=r"shape \(3, 4, 2\)|got shape \(4, 2\)"):
        design_rods(bow.pieces[0])
    with pytest.raises(InvalidInputError, match="kind is 'guess', 'joined' or 'fit'; got 'best'"):
        design_rods(bow.pieces, "best")
