"""The directed distance between polylines: closed forms, and dense samples with a Lipschitz bound."""

from itertools import pairwise

import numpy as np
import pytest

from batten.kernels.polyline_distance import directed_distance


def _distance_to(p, polyline):
    a, d = polyline[:-1], np.diff(polyline, axis=0)
    w = np.clip(((p[:, None] - a) * d).sum(-1) / np.maximum((d**2).sum(-1), 1e-300), 0, 1)
    return np.linalg.norm(p[:, None] - a - w[..., None] * d, axis=-1).min(axis=1)


def _along(polyline, count):
    u = np.linspace(0, 1, count)[:, None]
    return np.concatenate([a + u * (b - a) for a, b in pairwise(polyline)])


def _array(points):
    return np.array(points, dtype=float)


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        ([(0, 0), (1, 0)], [(0, 2), (1, 2)], 2.0),
        ([(0, 0), (4, 0)], [(0, 3), (0, 0)], 4.0),
        ([(0, 3), (0, 0)], [(0, 0), (4, 0)], 3.0),
        # From the middle of a long segment to the gap between two prongs: the largest value is inside the segment.
        ([(0, 0), (2, 0)], [(0, 0), (0, 9), (2, 9), (2, 0)], 1.0),
        ([(0, 0), (1, 1)], [(0, 0), (0.25, 0.25), (0.25, 0.25), (1, 1)], 0.0),
    ],
)
def test_closed_forms(a, b, expected):
    assert directed_distance(_array(a), _array(b), 1e-9, 0.0) == pytest.approx(expected, abs=1e-9)


def test_a_lower_bound_is_returned_if_nothing_is_larger():
    assert directed_distance(_array([(0, 0), (1, 0)]), _array([(0, 2), (1, 2)]), 1e-9, 5.0) == 5.0


@pytest.mark.parametrize("seed", range(8))
def test_random_polylines(seed):
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(2 + 3 * seed, 2)), rng.normal(size=(40, 2))
    found = directed_distance(a, b, 1e-7, 0.0)
    samples = _along(a, 2000)
    below = _distance_to(samples, b).max()
    # The distance is 1-Lipschitz: between two samples it rises by no more than half their spacing.
    spacing = np.linalg.norm(np.diff(a, axis=0), axis=1).max() / 1999
    assert below - 1e-7 <= found <= below + 0.5 * spacing + 1e-12
