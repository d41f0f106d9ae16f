"""The order of the blocks, against all orders where they can be counted."""

from itertools import permutations
from types import SimpleNamespace

import numpy as np
import pytest

from batten.fabrication.block_order import block_order, travel_mm, way_length_mm
from batten.fabrication.plan import Block


def pose(at):
    out = np.eye(4)
    out[:3, 3] = at
    return out


def cut(rows, columns, seed=0):
    """Motions that begin and end somewhere, and their blocks."""
    rng = np.random.default_rng(seed)
    motions, blocks = [], {}
    for number in range(1, rows * columns + 1):
        ends = rng.uniform(-500.0, 500.0, (2, 2, 3))
        left, right = (SimpleNamespace(approach=pose(a), leave=pose(b)) for a, b in ends)
        motions.append(SimpleNamespace(block=number, left=left, right=right))
        row, column = divmod(number - 1, columns)
        blocks[number] = Block(number, row, column, np.zeros(3), np.ones(3))
    return motions, blocks


def numbers(order, motions):
    return [motions[k].block for k in order]


def test_travel_is_that_of_the_arm_that_goes_further():
    motions, _ = cut(1, 4)
    travel = travel_mm(motions)
    for i, a in enumerate(motions):
        for j, b in enumerate(motions):
            ways = [
                np.linalg.norm(getattr(a, side).leave[:3, 3] - getattr(b, side).approach[:3, 3])
                for side in ("left", "right")
            ]
            assert travel[i, j] == pytest.approx(max(ways))
    assert way_length_mm((2, 0, 3), travel) == pytest.approx(travel[2, 0] + travel[0, 3])
    assert way_length_mm((1,), travel) == way_length_mm((), travel) == 0.0


def test_numbered_and_serpentine():
    motions, blocks = cut(3, 4)
    shuffled = [motions[k] for k in np.random.default_rng(1).permutation(12)]
    assert numbers(block_order("numbered", shuffled, blocks), shuffled) == list(range(1, 13))
    assert numbers(block_order("serpentine", shuffled, blocks), shuffled) == [1, 2, 3, 4, 8, 7, 6, 5, 9, 10, 11, 12]
    without = [m for m in shuffled if m.block not in (2, 7)]  # blocks of which nothing is cut
    assert numbers(block_order("serpentine", without, blocks), without) == [1, 3, 4, 8, 6, 5, 9, 10, 11, 12]


def test_nearest_takes_the_nearest_of_what_is_left():
    motions, blocks = cut(3, 4, seed=4)
    travel = travel_mm(motions)
    order = block_order("nearest", motions, blocks)
    assert order[0] == 0
    for k in range(len(order) - 1):
        assert travel[order[k], order[k + 1]] == min(travel[order[k], j] for j in order[k + 1 :])


@pytest.mark.parametrize("seed", range(8))
def test_the_shortest_is_no_longer_than_the_others_and_near_the_best_of_all(seed):
    motions, blocks = cut(2, 3, seed)
    travel = travel_mm(motions)
    lengths = {
        order: way_length_mm(block_order(order, motions, blocks), travel)
        for order in ("numbered", "serpentine", "nearest", "shortest")
    }
    assert lengths["shortest"] == min(lengths.values())
    best = min(way_length_mm(order, travel) for order in permutations(range(6)))
    assert best - 1e-9 <= lengths["shortest"]
    assert lengths["shortest"] == pytest.approx(best, rel=0.05)


def test_many_blocks_are_all_there_once():
    motions, blocks = cut(5, 6, seed=2)
    travel = travel_mm(motions)
    order = block_order("shortest", motions, blocks)
    assert sorted(order) == list(range(30))
    assert way_length_mm(order, travel) < way_length_mm(block_order("nearest", motions, blocks), travel)


@pytest.mark.parametrize("order", ["numbered", "serpentine", "nearest", "shortest"])
def test_one_block_and_none(order):
    motions, blocks = cut(1, 1)
    assert block_order(order, motions, blocks) == (0,)
    assert block_order(order, [], {}) == ()
