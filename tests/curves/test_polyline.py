"""Polylines: everything in closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from batten.curves.base import Curve
from batten.curves.polyline import Polyline
from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError

PATH = Polyline([(0, 0), (3, 4), (3, 5), (-1, 5)])  # segments of length 5, 1, 4


def test_points_lie_at_their_part_of_the_length():
    assert isinstance(PATH, Curve)
    assert PATH.length == 10.0
    np.testing.assert_allclose(PATH.breaks(), [0.0, 0.5, 0.6, 1.0], atol=1e-16)
    t = [0.0, 0.25, 0.5, 0.55, 0.7, 1.0, 1.1]
    expected = [(0, 0), (1.5, 2), (3, 4), (3, 4.5), (2, 5), (-1, 5), (-2, 5)]
    np.testing.assert_allclose(PATH.point(t), expected, atol=1e-14)


def test_derivative_is_direction_times_length_and_that_on_the_right_at_a_corner():
    np.testing.assert_allclose(PATH.derivative([0.2, 0.5, 0.9, 1.0]), [(6, 8), (0, 10), (-10, 0), (-10, 0)], atol=1e-13)
    np.testing.assert_array_equal(PATH.derivative([[0.2], [0.3]], 2), np.zeros((2, 1, 2)))


@given(st.floats(0.0, 1.0))
def test_reversed_and_transformed(t):
    similarity = Similarity(2.0, 1.0, (1.0, 1.0))
    np.testing.assert_allclose(PATH.reversed().point(t), PATH.point(1.0 - t), atol=1e-13)
    np.testing.assert_allclose(PATH.transformed(similarity).point(t), similarity.apply(PATH.point(t)), atol=1e-13)


@pytest.mark.parametrize(
    ("points", "word"),
    [
        ([(0, 0)], "n ≥ 2"),
        ([(0, 0, 0), (1, 1, 1)], "shape"),
        ([(0, 0), (np.nan, 1)], "finite"),
        ([(0, 0), (1, 1), (1, 1)], r"points \[1\] coincide"),
    ],
)
def test_refuses(points, word):
    with pytest.raises(InvalidInputError, match=word):
        Polyline(points)
