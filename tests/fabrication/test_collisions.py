"""Distances of segments and boxes against minimisation by scipy, and the choice of the nearest pair against all pairs."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from batten.errors import InvalidInputError
from batten.fabrication.collisions import (
    Box,
    Capsules,
    box_distance,
    least_clearance,
    segment_box_distance,
    segment_distance,
)


def by_least_squares(a, b, c, d):
    """The distance of two segments as a bounded least-squares problem in the two parameters."""
    found = lsq_linear(np.column_stack([b - a, c - d]), c - a, bounds=(0.0, 1.0), method="bvls", tol=1e-15)
    return float(np.linalg.norm(np.column_stack([b - a, c - d]) @ found.x - (c - a)))


def signed(point, low, high):
    """The distance of one point from a box, written from its definition."""
    if all(low <= point) and all(point <= high):
        return -min((point - low).min(), (high - point).min())
    return float(np.linalg.norm(point - np.clip(point, low, high)))


def by_search(a, b, low, high):
    """The least signed distance along a segment, which is convex: thirds are cut off until nothing is left."""
    left, right = 0.0, 1.0
    for _ in range(90):
        third = (right - left) / 3.0
        if signed(a + (left + third) * (b - a), low, high) <= signed(a + (right - third) * (b - a), low, high):
            right -= third
        else:
            left += third
    return signed(a + left * (b - a), low, high)


def test_distance_from_a_box_on_every_side():
    low, high = np.array([0.0, 0.0, 0.0]), np.array([6.0, 4.0, 2.0])
    points = [(3, 2, 1), (3, 2, 1.75), (7, 2, 1), (9, 8, 1), (8, 6, 3), (6, 2, 1), (-2, 5, -2)]
    assert box_distance(np.array(points, float), low, high) == pytest.approx([-1.0, -0.25, 1.0, 5.0, 3.0, 0.0, 3.0])


def test_segments_as_far_apart_as_least_squares_says():
    rng = np.random.default_rng(5)
    ends = rng.normal(size=(4, 300, 3)) * rng.choice([1.0, 0.1, 3.0], (300, 1))
    found = segment_distance(*ends)
    expected = [by_least_squares(*ends[:, i]) for i in range(300)]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(ends).max())


@pytest.mark.parametrize(
    ("a", "b", "c", "d", "expected"),
    [
        ((0, 0, 0), (2, 0, 0), (1, -1, 0), (1, 1, 0), 0.0),  # they cross
        ((0, 0, 0), (2, 0, 0), (3, 0, 0), (5, 0, 0), 1.0),  # one behind the other
        ((0, 0, 0), (2, 0, 0), (1, 0, 0), (5, 0, 0), 0.0),  # overlapping on one line
        ((0, 0, 0), (2, 0, 0), (5, 4, 0), (1, 4, 0), 4.0),  # antiparallel, side by side
        ((0, 0, 0), (2, 0, 0), (5, 4, 0), (9, 4, 0), 5.0),  # parallel, apart
        ((1, 1, 1), (1, 1, 1), (0, 0, 1), (2, 0, 1), 1.0),  # a point and a segment
        ((1, 1, 1), (1, 1, 1), (1, 1, 4), (1, 1, 4), 3.0),  # two points
        ((0, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0), 0.0),
    ],
)
def test_segments_in_special_positions(a, b, c, d, expected):
    assert segment_distance(a, b, c, d) == pytest.approx(expected, abs=1e-15)
    assert segment_distance(d, c, a, b) == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize("angle", [1e-3, 1e-5, 1e-6, 1e-8, 1e-12])
def test_nearly_parallel_segments(angle):
    # They cross in their middles, one unit apart there; the ends are further apart by angle/2 at most.
    run = np.array([np.cos(angle), np.sin(angle), 0.0])
    found = segment_distance(
        (-0.5, 0, 0), (0.5, 0, 0), np.array([0, 0, 1]) - 0.5 * run, np.array([0, 0, 1]) + 0.5 * run
    )
    assert found == pytest.approx(1.0, abs=1e-12)


def test_a_bad_row_stays_alone():
    a = np.zeros((3, 3))
    a[1, 2] = np.nan
    d = segment_distance(a, a + 1.0, a + 5.0, (9.0, 9.0, 9.0))
    assert np.isnan(d).tolist() == [False, True, False]
    d = segment_box_distance(a, a + 1.0, (3, 3, 3), (4, 4, 4))
    assert np.isnan(d).tolist() == [False, True, False]


def test_segments_and_boxes_as_far_apart_as_a_search_says():
    rng = np.random.default_rng(6)
    n = 300
    a, b = rng.normal(size=(2, n, 3)) * 1.5
    a[:20, 0] = b[:20, 0]  # along two axes only
    a[20:40, :2] = b[20:40, :2]  # along one
    a[40:50] = b[40:50]
    low, high = -rng.uniform(0.2, 1.0, (n, 3)), rng.uniform(0.2, 1.0, (n, 3))
    found = segment_box_distance(a, b, low, high)
    expected = np.array([by_search(a[i], b[i], low[i], high[i]) for i in range(n)])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs([a, b]).max())
    assert (found < 0.0).sum() > 50
    assert (found > 0.0).sum() > 50


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        ((-5, 0, 3), (5, 0, 3), 2.0),  # over it
        ((-5, 0, 1), (5, 0, 1), 0.0),  # along its face
        ((-5, 0, 0.25), (5, 0, 0.25), -0.25),  # through it, near the bottom
        ((0, 0, -2), (0, 0, 4), -0.5),  # through both faces, deepest in the middle
        ((0, 0, 0.5), (0, 0, 9), -0.5),
        ((2, 2, 0), (2, 2, 9), np.sqrt(2.0)),  # along an edge
        ((4, 0, 1), (0, 4, 1), np.sqrt(2.0)),  # past an edge
        ((4, 5, 13), (4, 5, 13), 13.0),  # a point: 3, 4, 12 from a corner
    ],
)
def test_a_segment_and_a_box_in_special_positions(a, b, expected):
    assert segment_box_distance(a, b, (-1, -1, 0), (1, 1, 1)) == pytest.approx(expected, abs=1e-15)


def test_a_box_without_end_is_a_half_space():
    low, high = np.full(3, -np.inf), np.array([np.inf, np.inf, -2.0])
    assert segment_box_distance((0, 0, 1), (50, 9, 4), low, high) == 3.0
    assert segment_box_distance((0, 0, 1), (50, 9, -4), low, high) == -2.0
    assert box_distance(np.array([3.0, 4.0, 5.0]), low, high) == 7.0


def scene(seed, k=40, m=9, scale=4.0):
    rng = np.random.default_rng(seed)
    start = rng.uniform(-scale, scale, (k, m, 3))
    capsules = Capsules(
        start, start + 4.0 * rng.normal(size=(k, m, 3)), rng.uniform(0.0, 0.4, m), tuple("abcdefghi"[:m])
    )
    boxes = (
        Box(np.array([-0.5, -0.5, -0.5]), np.array([0.5, 0.5, 0.5]), "block"),
        Box(np.full(3, -9.0), np.array([9.0, 9.0, -3.5]), "floor"),
    )
    return capsules, boxes


@pytest.mark.parametrize("seed", range(3))
def test_the_nearest_pair_is_the_nearest_of_all(seed):
    capsules, boxes = scene(seed)
    m = len(capsules.names)
    pairs = np.array([(i, j) for i in range(m) for j in range(i + 1, m) if (i + j) % 3])
    against = np.ones((m, 2), dtype=bool)
    against[::2, 0] = False
    found = least_clearance(capsules, pairs, boxes, against)
    for pose in range(len(capsules.start)):
        values = {}
        for i, j in pairs:
            apart = segment_distance(*(c[pose, k] for k in (i, j) for c in (capsules.start, capsules.end)))
            values[int(i), int(j)] = float(apart - capsules.radius[i] - capsules.radius[j])
        for i in range(m):
            for j, box in enumerate(boxes):
                if against[i, j]:
                    apart = segment_box_distance(capsules.start[pose, i], capsules.end[pose, i], box.low, box.high)
                    values[i, m + j] = float(apart - capsules.radius[i])
        best = min(values, key=values.get)
        assert found.distance[pose] == pytest.approx(values[best], abs=1e-12)
        assert (found.first[pose], found.second[pose]) == best


@pytest.mark.parametrize("pair", [(0, 1), (1, 0)])
def test_a_long_capsule_whose_middle_is_far_is_not_passed_over(pair):
    start = np.array([[(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 10.0, 0.0)]])
    end = np.array([[(0.0, 0.0, 0.0), (101.0, 0.0, 0.0), (0.0, 10.0, 0.0)]])
    capsules = Capsules(start, end, np.zeros(3), ("a", "b", "c"))
    found = least_clearance(capsules, np.array([(0, 2), pair]))
    assert (found.distance[0], found.first[0], found.second[0]) == (1.0, *pair)
    box = Box(np.full(3, -1.0), np.zeros(3), "box")
    beside = least_clearance(capsules, np.array([(0, 2)]), (box,), np.array([[False], [True], [False]]))
    assert (beside.distance[0], beside.first[0], beside.second[0]) == (1.0, 1, 3)


def test_a_pose_that_is_not_known_is_told_and_nothing_to_look_at_is_infinitely_far():
    capsules, boxes = scene(0, k=3, m=4)
    capsules.start[1, 2] = np.nan
    found = least_clearance(capsules, np.array([[0, 2], [1, 3]]), boxes)
    assert np.isnan(found.distance).tolist() == [False, True, False]
    assert least_clearance(capsules, np.empty((0, 2), dtype=int)).distance.tolist() == [np.inf] * 3


def test_wrong_scenes_are_refused():
    capsules, boxes = scene(0, m=4)
    with pytest.raises(InvalidInputError, match="pairs up to 4"):
        least_clearance(capsules, np.array([[0, 4]]))
    with pytest.raises(InvalidInputError, match=r"shape \(4, 2\)"):
        least_clearance(capsules, np.array([[0, 1]]), boxes, np.ones((4, 1), dtype=bool))
    with pytest.raises(InvalidInputError, match="3 capsules need ends"):
        Capsules(np.zeros((1, 2, 3)), np.zeros((1, 2, 3)), np.zeros(2), ("a", "b", "c"))
