"""Distances of pieces: of concentric arcs, and of curves that cannot be followed."""

import numpy as np
import pytest

from batten.curves.elastica import Elastica
from batten.splines.curve_spans import spans_of
from batten.splines.piece_distance import piece_distance, piece_distances


@pytest.mark.parametrize("gap", [1e-1, 1e-3, 1e-5])
def test_concentric_arcs(gap):
    arc = Elastica((1.0, 0.0), np.pi / 2, 1.0, (0.0, 0.0), 2.0)
    wide = Elastica((1.0 + gap, 0.0), np.pi / 2, 1.0 / (1.0 + gap), (0.0, 0.0), 2.0 * (1.0 + gap))
    (span,) = spans_of(arc, 0.005 * gap, 0.1, gap)
    assert piece_distance(span, 0.0, 2.0, wide.parameters, 0.005 * gap) == pytest.approx(gap, rel=0.015)
    # What the piece leaves out of the span counts as well.
    (short,) = piece_distances(
        span, np.zeros(1), np.full(1, 2.0), wide.extended(after=-0.5).parameters[None], 0.005 * gap
    )
    assert short == pytest.approx(np.hypot(*(arc.point(1.0) - wide.extended(after=-0.5).point(1.0))), rel=0.015)


def test_what_cannot_be_followed_is_infinitely_far():
    (span,) = spans_of(Elastica((0.0, 0.0), 0.0, 1.0, (0.0, 0.0), 2.0), 1e-4, 0.1, 1e-2)
    assert piece_distance(span, 0.0, 2.0, np.full(7, np.nan), 1e-4) == np.inf
    curled = Elastica((0.0, 0.0), 0.0, 1e9, (0.0, 0.0), 2.0)
    assert piece_distance(span, 0.0, 2.0, curled.parameters, 1e-4) == np.inf
