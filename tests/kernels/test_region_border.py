"""Rings followed on a lattice whose values are given: closed, on the right side, what they should hold, and no more work
than the border asks for."""

import math

import numpy as np
import pytest

from batten.kernels import region_border as kernel
from batten.kernels.quadrature import panel_condition

NOTHING = (
    np.array([[(0.0, 0.0), (1.0, 0.5), (2.0, 0.5), (3.0, 0.0)]]),
    np.zeros((1, 4, 2, 2)),
    np.zeros(1, np.int64),
    np.zeros((1, 17, 2)),
    np.array([-np.inf, -np.inf, np.inf, np.inf]),
    np.array([1.0, 9.0, np.inf, 0.0, 0.0, panel_condition(1e-4)]),
)
FRAME = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 1.0])


def trace(values, seeds, stride=4, small=0.0, far=0.0, problem=NOTHING, frame=FRAME, room=4000):
    points, numbers, rim = np.empty((room, 2)), np.empty(room, np.int64), np.empty(room, bool)
    marks = np.zeros(values.shape, np.uint8)
    count, state = kernel.trace_rings(
        frame, values, marks, np.array(seeds), stride, small, far, problem, points, numbers, rim
    )
    rings = [points[:count][numbers[:count] == k] for k in range(numbers[count - 1] + 1)] if count else []
    return rings, rim[:count], state


def area(ring):
    x, y = ring.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def grid(n=61):
    return np.meshgrid(np.arange(n, dtype=float), np.arange(n, dtype=float), indexing="ij")


def test_a_disc_is_followed_counter_clockwise():
    x, y = grid()
    values = np.hypot(x - 30.2, y - 29.7) - 20.0
    rings, rim, state = trace(values, [(30, 30)], stride=40)
    assert state == kernel.DONE
    assert len(rings) == 1
    assert not rim.any()
    assert np.abs(np.hypot(*(rings[0] - (30.2, 29.7)).T) - 20.0).max() < 0.02
    assert abs(area(rings[0]) - 400 * math.pi) < 2.0


def test_holes_are_found_between_the_nodes_of_the_coarse_lattice_and_run_clockwise():
    x, y = grid()
    values = np.maximum(np.hypot(x - 30, y - 30) - 25.0, 6.3 - np.hypot(x - 22, y - 33))
    seeds = [(i, j) for i in range(0, 61, 4) for j in range(0, 61, 4) if values[i, j] < 0.0]
    rings, _, _ = trace(values, seeds)
    areas = sorted(map(area, rings))
    assert len(areas) == 2
    assert abs(areas[0] + 6.3**2 * math.pi) < 1.0
    assert abs(areas[1] - 625 * math.pi) < 2.0


def test_parts_behind_a_slit_are_found_by_the_number_of_crossings():
    """No node of the coarse lattice is bad between the two halves."""
    x, y = grid()
    values = np.maximum(np.hypot(x - 30, y - 30) - 25.0, 0.8 - np.abs(x - 30.0))
    seeds = [(i, j) for i in range(4, 61, 4) for j in range(4, 61, 4) if values[i, j] < 0.0]
    assert {i for i, _ in seeds} >= {28, 32}
    rings, _, _ = trace(values, seeds)
    assert len(rings) == 2
    assert all(area(ring) > 0 for ring in rings)
    one, other = rings
    assert one[:, 0].max() < 30 < other[:, 0].min() or other[:, 0].max() < 30 < one[:, 0].min()


def test_other_components_are_left_alone():
    x, y = grid()
    values = np.minimum(np.hypot(x - 15, y - 30) - 10.0, np.hypot(x - 45, y - 30) - 10.0)
    rings, _, _ = trace(values, [(15, 30)], stride=60)
    assert len(rings) == 1
    assert rings[0][:, 0].max() < 26


def test_a_border_that_leaves_the_lattice_says_where():
    x, y = grid()
    centres = ((0, 30), (60, 30), (30, 0), (30, 60))
    for centre, state in zip(centres, (kernel.LEFT, kernel.RIGHT, kernel.BELOW, kernel.ABOVE)):
        values = np.hypot(x - centre[0], y - centre[1]) - 12.0
        assert trace(values, [centre], stride=30)[2] == state
    assert trace(np.hypot(x - 30, y - 30) - 12.0, [(30, 30)], stride=30, room=20)[2] == kernel.NO_ROOM


def test_an_infinite_rim_closes_the_ring():
    values = grid()[0] - 25.5
    values[0], values[:, 0], values[:, -1] = np.inf, np.inf, np.inf
    rings, rim, state = trace(values, [(10, 30)], stride=30)
    assert state == kernel.DONE
    assert rim.any()
    assert not rim[np.abs(rings[0][:, 0] - 25.5) < 1e-9].any()
    assert abs(area(rings[0]) - (25.5 * 60 - 1.5)) < 1e-9  # up to the rim's own nodes, the corners cut


def test_chords_stay_as_near_as_asked():
    x, y = grid()
    values = np.hypot(x - 30, y - 30) - 20.0
    full, _, _ = trace(values, [(30, 30)], stride=40)
    few, _, _ = trace(values, [(30, 30)], stride=40, far=0.2)
    assert len(few[0]) < 0.4 * len(full[0])
    middles = 0.5 * (few[0] + np.roll(few[0], -1, axis=0))
    assert np.abs(np.hypot(*(middles - 30).T) - 20).max() < 0.25


def test_random_rings_never_cross_themselves():
    rng = np.random.default_rng(0)
    for _ in range(40):
        values = rng.standard_normal((30, 30))
        values[[0, -1]], values[:, [0, -1]] = 9.0, 9.0
        seeds = np.argwhere(values < 0.0)
        rings, _, state = trace(values, seeds, stride=1)
        assert state == kernel.DONE
        for ring in rings:
            assert not kernel.crosses_itself(np.ascontiguousarray(ring), len(ring))
        # The middles of cells belong to the problem, which is good everywhere, so corners are joined.
        labels = np.empty(values.shape, np.int64)
        assert sum(area(ring) > 0 for ring in rings) == kernel.components(values, labels)


def test_only_nodes_along_the_border_are_computed():
    box = NOTHING[4].copy()
    box[:] = -3.0, -2.0, 3.0, 2.0
    problem = (*NOTHING[:4], box, NOTHING[5])
    values = np.full((201, 161), np.nan)
    frame = np.array([-5.0, -4.0, 0.05, 0.0, 0.0, 0.05])
    rings, _, state = trace(values, [(100, 80)], stride=90, small=0.01, far=0.01, problem=problem, frame=frame)
    assert state == kernel.DONE
    assert np.isfinite(values).sum() < 500 < 3 * np.isinf(values).sum()
    assert abs(area(rings[0]) - 24.0) < 0.01 * 24.0
    assert np.abs(np.abs(rings[0]) / (3.0, 2.0)).max() <= 1.0


@pytest.mark.parametrize("crossed", [False, True])
def test_crossings_of_a_ring(crossed):
    ring = np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)])
    if crossed:
        ring = ring[[0, 2, 1, 3]]
    assert kernel.crosses_itself(ring, 4) == crossed
