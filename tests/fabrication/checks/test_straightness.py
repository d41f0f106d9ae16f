"""Bows of arcs, lines and waves, and what lies between them."""

import math

import numpy as np
import pytest
from scipy.special import ellipk

from batten.curves.elastica import Elastica
from batten.fabrication.checks.straightness import straightness_checks


def sagitta(radius, length):
    return radius * (1.0 - math.cos(0.5 * length / radius))


def test_bow_of_arcs_and_lines(hand):
    rods = [hand.place(hand.arc(r, 600.0)) for r in (400.0, -400.0, 100000.0, 150000.0)] + [hand.place(hand.line())]
    check, _ = straightness_checks(hand.context(rods))
    bows = [sagitta(r, 1000.0) for r in (400.0, 400.0, 100000.0, 150000.0)]
    assert check.values == pytest.approx([*bows, 0.0], rel=1e-6, abs=1e-9)
    assert check.passed.tolist() == [True, True, True, False, False]
    assert check.hard


@pytest.mark.parametrize("k", [0.05, 0.3, 0.6])
def test_bow_of_a_wave_is_the_height_of_its_crests(hand, k):
    # From inflection to inflection over a whole period the chord is the axis, and the crests are 2kS high.
    quarter = float(ellipk(k**2))
    scale = 1000.0 / (4.0 * quarter)
    wave = Elastica.from_modulus(k, -quarter, 4.0 * quarter, scale)
    check, _ = straightness_checks(hand.context([hand.place(wave.extended(-200.0, -200.0))]))
    assert check.values == pytest.approx([2.0 * k * scale], rel=1e-4)


def test_a_closed_rod_has_no_chord(hand):
    ring = hand.arc(1000.0 / (2.0 * math.pi), 600.0)
    check, _ = straightness_checks(hand.context([hand.place(ring)]))
    assert check.values == pytest.approx([1000.0 / math.pi], rel=1e-6)


def test_between_arcs_of_opposite_bow_lies_the_line(hand):
    rods = [hand.place(hand.arc(r, 600.0), leaf=i) for i, r in enumerate((2000.0, 3000.0, -8000.0, -6000.0))]
    bow, passes = straightness_checks(hand.context(rods))
    assert bow.passed.all()
    flat = sagitta(6000.0, 1000.0)
    # Leaves 1 and 2 bend to opposite sides; on the steps before and after nothing is flatter than the flatter one.
    assert passes.values[0] == pytest.approx(sagitta(3000.0, 1000.0), rel=1e-3)
    assert (passes.values[1:3] < 0.01 * (sagitta(3000.0, 1000.0) + sagitta(8000.0, 1000.0))).all()
    assert passes.values[3] == pytest.approx(sagitta(8000.0, 1000.0), rel=1e-3)
    assert flat > passes.values[3]
    assert passes.passed.tolist() == [True, False, False, True]
    assert not passes.hard


def test_a_wave_between_keeps_the_rod_from_the_line(hand):
    quarter = float(ellipk(0.04))
    wave = Elastica.from_modulus(0.2, 0.0, 2.0 * quarter, 1000.0 / (2.0 * quarter))  # κ goes from + to −
    rods = [
        hand.place(hand.arc(2000.0, 600.0), leaf=1),
        hand.place(wave.extended(-200.0, -200.0), leaf=2),
        hand.place(hand.arc(-2000.0, 600.0), leaf=3),
    ]
    _, passes = straightness_checks(hand.context(rods))
    assert passes.passed.all()
    assert passes.values.min() > 5.0


def test_a_single_leaf_is_on_no_way(hand):
    _, passes = straightness_checks(hand.context([hand.place(hand.arc(900.0, 600.0))]))
    assert np.isnan(passes.values).all()
