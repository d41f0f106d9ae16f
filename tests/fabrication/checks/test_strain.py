"""Strain of circles, and of an elastica whose sharpest point lies outside the block."""

import numpy as np
import pytest

from batten.curves.elastica import Elastica
from batten.fabrication.checks.strain import strain_check


def test_strain_of_circles_is_half_the_diameter_over_the_radius(hand):
    rods = [hand.place(hand.arc(r, 600.0)) for r in (250.0, -300.0, 150.0)] + [hand.place(hand.line())]
    check = strain_check(hand.context(rods))
    assert check.values == pytest.approx([1.5 / 250.0, 1.5 / 300.0, 1.5 / 150.0, 0.0], rel=1e-9)
    assert check.passed.tolist() == [True, True, False, True]
    assert check.hard


@pytest.mark.parametrize("before", [150.0, 153.3, 160.1])
def test_the_vertex_of_the_rod_counts_though_it_lies_outside_the_block(hand, before):
    # κ = 2k cn(s/S)/S has its vertex at s = 0: 140 mm before the piece.
    scale, k = 300.0, 0.8
    piece = Elastica.from_modulus(k, 0.0, 1.0, scale).extended(-140.0, 440.0)
    rod = hand.place(piece, before, 200.0)
    assert strain_check(hand.context([rod])).values == pytest.approx([1.5 * 2.0 * k / scale], rel=1e-6)
    assert np.abs(piece.curvature_at(np.linspace(0, piece.length, 99))).max() < 0.95 * 2.0 * k / scale
