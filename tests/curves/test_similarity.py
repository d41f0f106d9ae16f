"""Similarities against complex arithmetic: p ↦ S e^{iφ} p + v."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError

SIMILARITIES = st.builds(
    Similarity,
    scale=st.floats(1e-3, 1e3),
    rotation=st.floats(-7.0, 7.0),
    translation=st.tuples(st.floats(-10.0, 10.0), st.floats(-10.0, 10.0)),
)
POINTS = np.array([[0.0, 0.0], [1.0, 0.0], [-2.0, 3.5], [0.1, -40.0]])


def _complex(similarity, points):
    z = points @ np.array([1.0, 1.0j])
    w = similarity.scale * np.exp(1j * similarity.rotation) * z + complex(*similarity.translation)
    return np.stack([w.real, w.imag], axis=-1)


@given(SIMILARITIES)
def test_apply_is_multiplication_by_a_complex_number(similarity):
    np.testing.assert_allclose(similarity.apply(POINTS), _complex(similarity, POINTS), rtol=1e-13, atol=1e-10)


@given(SIMILARITIES, SIMILARITIES)
def test_compose_applies_its_argument_first(second, first):
    expected = _complex(second, _complex(first, POINTS))
    np.testing.assert_allclose(
        second.compose(first).apply(POINTS), expected, rtol=1e-11, atol=1e-11 * np.abs(expected).max()
    )


@given(SIMILARITIES)
def test_inverse_undoes(similarity):
    np.testing.assert_allclose(similarity.inverse().apply(similarity.apply(POINTS)), POINTS, atol=1e-9)


def test_vectors_are_not_translated():
    np.testing.assert_array_equal(Similarity(translation=(5.0, 6.0)).apply_to_vectors([1.0, 2.0]), [1.0, 2.0])


@pytest.mark.parametrize(
    "bad",
    [
        {"scale": 0.0},
        {"scale": -1.0},
        {"scale": np.nan},
        {"rotation": np.inf},
        {"translation": (0.0, np.nan)},
        {"translation": (1.0, 2.0, 3.0)},
    ],
)
def test_refuses(bad):
    with pytest.raises(InvalidInputError, match="similarity needs"):
        Similarity(**bad)


def test_refuses_points_of_space():
    with pytest.raises(InvalidInputError, match="shape"):
        Similarity().apply([1.0, 2.0, 3.0])
