"""What pieces have to keep: against the public measures, and the messages."""

import math

import numpy as np
import pytest

from batten.curves.cubic_proxy import CubicProxy
from batten.errors import InvalidInputError
from batten.fabrication.rod import greatest_curvature
from batten.measures.lambda_residual import lambda_residual
from batten.solvers.initial_guess import initial_elastica
from batten.solvers.stability import margins
from batten.splines.design_limits import BrokenLimit, DesignLimits, broken_limits, piece_measures


@pytest.fixture(scope="module")
def wild():
    """Splines near a line, wilder and wilder."""
    rng = np.random.default_rng(5)
    line = CubicProxy.line((0.0, 0.0), (12.0, 0.0), 6)
    return [CubicProxy(line.control_points + size * rng.normal(size=(14, 2))) for size in np.linspace(0.01, 0.5, 12)]


def test_the_measures_are_those_of_the_first_guess(wild):
    compared = 0
    for proxy in wild:
        found = piece_measures(proxy, DesignLimits())
        np.testing.assert_allclose(found.residuals, lambda_residual(proxy.pieces), atol=2e-6)
        for k in np.flatnonzero(found.residuals < 0.4):
            guess = initial_elastica(proxy.pieces[k]).elastica
            curve = proxy.beziers()[k]
            ends = [curve.derivative(t) for t in (0.0, 1.0)]
            tangents = [math.atan2(y, x) for x, y in ends]
            turned = [
                abs(math.remainder(float(guess.angle_at(s)) - a, 2.0 * math.pi))
                for s, a in zip((0.0, guess.length), tangents)
            ]
            assert found.angle_errors[k] == pytest.approx(max(turned), abs=1e-5)
            assert found.curvatures[k] == pytest.approx(greatest_curvature(guess), rel=1e-2)
            assert found.margins[k] == pytest.approx(float(margins(guess.parameters)), rel=1e-4)
            compared += 1
    assert compared > 40


def test_pieces_that_did_not_change_need_not_be_measured_again(wild):
    before, after = wild[3], wild[3].with_control_point(4, wild[3].control_points[4] + 0.05)
    known = piece_measures(before, DesignLimits())
    found, whole = piece_measures(after, DesignLimits(), known, [1, 2]), piece_measures(after, DesignLimits())
    for name in ("residuals", "angle_errors", "curvatures", "margins"):
        assert getattr(found, name).tolist() == getattr(whole, name).tolist()
    assert known.residuals.tolist() == piece_measures(before, DesignLimits()).residuals.tolist()


def test_broken_limits_are_listed_piece_by_piece_with_both_numbers(wild):
    limits = DesignLimits(curvature_below=0.5, margin_above=1.2)
    measures = piece_measures(wild[-1], limits)
    expected = set()
    for k in range(6):
        expected |= {("residual_below", k)} if not measures.residuals[k] < 0.21 else set()
        expected |= {("angle_error_below", k)} if not measures.angle_errors[k] < math.radians(6.0) else set()
        expected |= {("curvature_below", k)} if not measures.curvatures[k] < 0.5 else set()
        expected |= {("margin_above", k)} if not measures.margins[k] > 1.2 else set()
    found = broken_limits(measures, limits)
    assert {(b.limit, b.piece) for b in found} == expected
    assert len({b.limit for b in found}) > 2
    assert all(b.excess >= 0.0 for b in found)
    assert [b for b in found if b.piece == 2] == list(broken_limits(measures, limits, [2]))


def test_a_loop_of_one_piece_and_of_two_cross():
    loop = CubicProxy([(0, 0), (3, 1), (-2, 1), (1, 0)])
    # A circle of two half turns and a tail that goes through it.
    ring = CubicProxy([(0, 0), (2, 0), (2, 2), (-1, 2), (-1, -1.2), (0.3, -1.2), (0.5, 1.0), (1.0, 3.0)])
    plain = CubicProxy.line((0, 0), (3, 0), 3)
    for proxy, crossing in ((loop, True), (ring, True), (plain, False)):
        assert piece_measures(proxy, DesignLimits(simple=True)).crossing is crossing
        assert piece_measures(proxy, DesignLimits()).crossing is None
    broken = broken_limits(piece_measures(ring, DesignLimits(simple=True)), DesignLimits(simple=True))
    assert "the spline crosses itself" in [str(b) for b in broken]


def test_a_piece_without_a_guess_breaks_every_limit():
    limits = DesignLimits(curvature_below=1e6, margin_above=1e-6)
    cusp = CubicProxy([(0, 0), (1, 1), (0, 1), (1, 0)])
    assert {b.limit for b in broken_limits(piece_measures(cusp, limits), limits)} == {
        "residual_below", "angle_error_below", "curvature_below", "margin_above",
    }  # fmt: skip


def test_words():
    assert (
        str(BrokenLimit("residual_below", 3, 0.3141, 0.21))
        == "piece 3 has a λ-residual of 0.314, allowed is below 0.21"
    )
    assert "an angle error of 7°, allowed is below 6°" in str(
        BrokenLimit("angle_error_below", 0, math.radians(7.0), math.radians(6.0))
    )
    margin = BrokenLimit("margin_above", 1, 0.9, 1.0)
    assert str(margin) == "piece 1 has a stability margin of 0.9, allowed is above 1"
    assert margin.excess == pytest.approx(0.1)


@pytest.mark.parametrize(
    "bad",
    [
        {"residual_below": 0.0},
        {"residual_below": 1.5},
        {"angle_error_below": math.nan},
        {"residual_below": None},
        {"curvature_below": -1.0},
        {"margin_above": math.inf},
        {"simple": 1},
        {"curvature_below": "2"},
    ],
)
def test_limits_that_are_none_are_refused(bad):
    with pytest.raises(InvalidInputError, match=next(iter(bad))):
        DesignLimits(**bad)
