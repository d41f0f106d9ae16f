"""Cutting into pieces: halves, longest pieces, and the least number that any cutting needs."""

import numpy as np
import pytest

from batten.curves.bezier import CubicBezier
from batten.curves.elastica import Elastica
from batten.curves.polyline import Polyline
from batten.splines.curve_spans import spans_of
from batten.splines.piece_split import PieceFitter, bisected, longest_first

WAVE = CubicBezier([(0.0, 0.0), (1.0, 3.0), (3.0, -2.0), (4.0, 1.0)])


def fitter(curve, tolerance, held="tangents"):
    (span,) = spans_of(curve, 0.005 * tolerance, 0.1, 0.5 * tolerance)
    return PieceFitter(span, held, tolerance, 0.005 * tolerance)


@pytest.mark.parametrize("held", ["points", "tangents"])
def test_fitted_pieces_hold_their_ends(held):
    work = fitter(WAVE, 1e-3, held)
    a, b = np.array([0.0, 1.0]), np.array([1.0, 2.0])
    parameters, distances = work.fit(a, b)
    for row, s0, s1 in zip(parameters, a, b):
        piece = Elastica.from_parameters(row)
        assert np.allclose(piece.point([0.0, 1.0]), work.span.points_at(np.array([s0, s1])), atol=1e-11)
        if held == "tangents":
            assert np.allclose(piece.angle_at([0.0, piece.length]), work.span.angles_at(np.array([s0, s1])), atol=1e-10)
    assert (distances < 0.1).all()


def test_halves_stop_where_the_tolerance_is_met():
    work = fitter(WAVE, 1e-3)
    halves = bisected(work)
    assert (halves.distances <= 1e-3).all()
    levels = np.log2(WAVE.length / np.diff(halves.joints))
    assert np.allclose(levels, np.round(levels), atol=1e-9)
    # Every piece's twin and itself together were too far away, or are cut further.
    whole = work.fit_one(float(halves.joints[0]), float(2.0 * halves.joints[1]))[1]
    assert whole > 1e-3


def test_longest_pieces_cannot_be_longer():
    work = fitter(WAVE, 1e-3)
    pieces = longest_first(work, 100)
    assert (pieces.distances <= 1e-3).all()
    for a, b in zip(pieces.joints[:-2], pieces.joints[1:-1]):
        assert work.fit_one(float(a), float(a + 1.03 * (b - a)))[1] > 1e-3
    assert longest_first(work, len(pieces) - 1) is None


def test_straight_spans_are_lines():
    pieces = longest_first(fitter(Polyline([(1.0, 1.0), (4.0, 5.0)]), 1e-3), 1)
    assert len(pieces) == 1
    assert pieces.parameters[0, 3:].tolist() == [0.0, 0.0, 0.0, 5.0]
