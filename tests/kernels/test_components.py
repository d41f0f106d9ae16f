"""Merge trees and distances on sparse cells, against floods and searches that know nothing of union-find."""

import numpy as np
import pytest
from scipy import ndimage

from batten.kernels.components import merge_tree, steps_outside

N = 6


@pytest.fixture(scope="module")
def cube():
    """Random smooth values on a 6 × 6 grid of each point: (36, 36) cells, those below 0.55 listed."""
    rng = np.random.default_rng(5)
    values = ndimage.gaussian_filter(rng.random((N, N, N, N)), 0.6)
    values = (values - values.min()) / np.ptp(values)
    numbers = np.full((N + 2, N + 2), -1)
    numbers[1:-1, 1:-1] = np.arange(N * N).reshape(N, N)  # first index y, second x
    around = (numbers[1:-1, 2:], numbers[1:-1, :-2], numbers[2:, 1:-1], numbers[:-2, 1:-1])
    neighbours = np.stack([other.ravel() for other in around], axis=-1)
    dense = values.reshape(N * N, N * N)
    rows, columns = np.nonzero(dense < 0.55)
    return values, neighbours, np.searchsorted(rows, np.arange(N * N + 1)), rows, columns, dense[rows, columns]


def tree_of(cube):
    _, neighbours, offsets, rows, columns, values = cube
    count = len(values)
    parent, births, sizes = (np.empty(count, np.int64) for _ in range(3))
    merges = np.empty((count, 4), np.int64)
    order = np.argsort(values, kind="stable")
    found = merge_tree(offsets, rows, columns, neighbours, values, order, parent, births, sizes, merges)
    return merges[:found], parent, births, sizes


def test_as_many_components_at_every_level_as_a_flood_finds(cube):
    values = cube[-1]
    merges, parent, births, _ = tree_of(cube)
    left = births[np.unique(parent)]
    begin = values[np.concatenate([left, merges[:, 0]])]
    end = np.concatenate([np.full(len(left), np.inf), values[merges[:, 2]]])
    counts = []
    for level in np.linspace(0.05, 0.55, 23):
        counts.append(((begin < level) & (end >= level)).sum())
        assert counts[-1] == ndimage.label(cube[0] < level)[1]
    assert max(counts) > 8


def test_the_forest_holds_the_components_that_are_left(cube):
    _, parent, _, sizes = tree_of(cube)
    label, count = ndimage.label(cube[0] < 0.55)
    flat = label.reshape(N * N, N * N)[cube[3], cube[4]]
    roots, which = np.unique(parent, return_inverse=True)
    assert len(roots) == count
    assert len(np.unique(flat * count + which)) == count
    assert sizes[roots].tolist() == np.bincount(which).tolist()


def test_a_component_that_ends_is_younger_and_its_end_higher(cube):
    values = cube[-1]
    merges, *_ = tree_of(cube)
    assert (values[merges[:, 0]] >= values[merges[:, 1]]).all()
    assert (values[merges[:, 2]] > values[merges[:, 0]]).all()


def test_merges_beyond_the_room_are_counted_and_not_written(cube):
    _, neighbours, offsets, rows, columns, values = cube
    merges, *_ = tree_of(cube)
    work = [np.empty(len(values), np.int64) for _ in range(3)]
    some = np.full((3, 4), -7)
    order = np.argsort(values, kind="stable")
    assert merge_tree(offsets, rows, columns, neighbours, values, order, *work, some[:2]) == len(merges)
    assert some[:2].tolist() == merges[:2].tolist()
    assert some[2].tolist() == [-7] * 4


def test_steps_outside_are_euclidean_distances(cube):
    """Against scipy's exact transform. Handing on vectors may be longer, in one cell of a hundred and by half a step."""
    values, neighbours, offsets, rows, columns, _ = cube
    steps = np.empty((len(rows), 4), np.int16)
    steps_outside(offsets, rows, columns, neighbours, 20, steps)
    exact = ndimage.distance_transform_edt(np.pad(values < 0.55, 1))[1:-1, 1:-1, 1:-1, 1:-1]
    exact = exact.reshape(N * N, N * N)[rows, columns]
    found = np.sqrt((steps.astype(float) ** 2).sum(axis=1))
    assert (found >= exact - 1e-12).all()
    assert (found > exact + 1e-12).mean() < 0.01
    assert found == pytest.approx(exact, abs=0.5)
    assert exact.max() >= np.sqrt(2.0)


def test_steps_lead_outside(cube):
    """Columns of the steps: x and y of the first point, x and y of the second."""
    values, neighbours, offsets, rows, columns, _ = cube
    steps = np.empty((len(rows), 4), np.int16)
    steps_outside(offsets, rows, columns, neighbours, 20, steps)
    padded = np.pad(values < 0.55, 1)
    y1, x1, y2, x2 = rows // N, rows % N, columns // N, columns % N
    at = np.column_stack([x1, y1, x2, y2]) + steps + 1
    assert not padded[at[:, 1], at[:, 0], at[:, 3], at[:, 2]].any()
