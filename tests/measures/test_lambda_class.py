"""The classes of the λ-residual: the paper's borders, batches, refusals."""

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.measures.lambda_class import BEST_BELOW, BORDERLINE_BELOW, GOOD_BELOW, LAMBDA_CLASSES, lambda_class


def test_the_borders_are_the_papers():
    assert (BEST_BELOW, GOOD_BELOW, BORDERLINE_BELOW) == (0.22, 0.4, 0.5)
    assert LAMBDA_CLASSES == ("best", "good", "borderline", "far")


@pytest.mark.parametrize(
    ("residual", "name"),
    [
        (0.0, "best"),
        (np.nextafter(0.22, 0), "best"),
        (0.22, "good"),
        (np.nextafter(0.4, 0), "good"),
        (0.4, "borderline"),
        (np.nextafter(0.5, 0), "borderline"),
        (0.5, "far"),
        (1.0, "far"),
        (np.nan, ""),
    ],
)
def test_a_border_belongs_to_the_class_above(residual, name):
    found = lambda_class(residual)
    assert found == name
    assert type(found) is str
    assert lambda_class(np.float64(residual)) == name


def test_a_batch_keeps_its_shape():
    found = lambda_class([[0.1, 0.3], [np.nan, 0.9]])
    assert found.tolist() == [["best", "good"], ["", "far"]]
    assert lambda_class(np.empty((0, 3))).shape == (0, 3)


@pytest.mark.parametrize("bad", [-1e-9, 1.5, [0.1, np.inf], "word"])
def test_what_is_no_residual_is_refused(bad):
    with pytest.raises(InvalidInputError):
        lambda_class(bad)
