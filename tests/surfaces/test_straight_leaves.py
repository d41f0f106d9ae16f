"""Straight leaves against circles, fans of planes against brute force, the least turn against known functions."""

import itertools

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.surfaces.foliation import parallel_planes
from batten.surfaces.straight_leaves import fan_planes, leaf_straightness, least_turn, plane_between

CORNERS = np.array([[200.0, -100.0], [1400.0, 500.0]])  # 1200 × 600


def angle(plane):
    return float(np.arctan2(plane.x_axis[1], plane.x_axis[0]))


def meeting(first, second):
    """Where two vertical planes meet in plan."""
    matrix = np.stack([first.x_axis[:2], -second.x_axis[:2]], axis=1)
    t = np.linalg.solve(matrix, (second.origin - first.origin)[:2])
    return first.origin[:2] + t[0] * first.x_axis[:2]


def gaps(planes, points):
    """Distances of points in plan from planes, signed by the way across, (planes, points)."""
    return np.array([(points - p.origin[:2]) @ -p.normal[:2] for p in planes])


def test_arcs_of_a_cylinder_and_lines_of_its_rulings(made_surfaces) -> None:
    surface = made_surfaces.cylinder(400.0, 300.0)
    across = leaf_straightness(surface, parallel_planes("x", [50.0, 200.0]), [[-300.0, 0.0, 200.0]] * 2)
    angles = np.diff(np.arcsin(np.array([-300.0, 0.0, 200.0]) / 400.0))
    assert across.bow == pytest.approx(np.tile(400.0 * (1.0 - np.cos(angles / 2)), (2, 1)), rel=1e-3)
    assert across.bend == pytest.approx(np.tile(angles, (2, 1)), rel=1e-3)
    along = leaf_straightness(surface, parallel_planes("y", [-200.0, 0.0, 310.0]), [[10.0, 290.0]] * 3)
    assert along.bow.max() < 1e-10
    assert along.bend.max() < 1e-10
    assert (across.bow <= across.bend * 400.0 * angles / 8.0 + 1e-9).all()


def test_one_straight_leaf_among_others_is_found(made_surfaces) -> None:
    surface = made_surfaces.graph(lambda x, y: 1e-6 * (y - 130.0) * x**2 + 0.3 * x, (-300.0, 300.0), (0.0, 400.0))
    y = np.arange(0.0, 401.0, 10.0)
    found = leaf_straightness(surface, parallel_planes("x", y), np.tile([-300.0, 0.0, 300.0], (len(y), 1)))
    off = np.abs(y - 130.0) > 0.0
    for middle, piece in zip((-150.0, 150.0), found.bow.T):
        # A parabola a x² over 300 mm stands off its chord by a 300²/4, seen square to the chord of slope 0.3 + 2a · middle.
        bend = 1e-6 * (y - 130.0)
        bow = np.abs(bend) * 300.0**2 / 4.0 / np.hypot(1.0, 0.3 + 2.0 * bend * middle)
        assert piece[off] == pytest.approx(bow[off], rel=1e-3)
        assert piece[~off].max() < 1e-9
    assert (found.bow.max(axis=1) < 0.1).nonzero()[0].tolist() == [13]
    masked = leaf_straightness(
        surface, parallel_planes("x", y[:2]), [[-300.0, 0.0, 300.0]] * 2, inside=lambda p: p[..., 0] > 20.0
    )
    assert np.isnan(masked.bow).tolist() == [[True, False]] * 2
    with pytest.raises(InvalidInputError, match="ascending"):
        leaf_straightness(surface, parallel_planes("x", y[:2]), [[0.0, 0.0]] * 2)


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize(
    ("turn_deg", "border_deg", "spacing"), [(5.0, 0.0, 20.0), (26.0, 0.0, 45.0), (12.0, 6.0, 30.0), (40.0, 20.0, 70.0)]
)
def test_a_fan_covers_the_rectangle_and_none_of_its_planes_cross_in_it(axis, sense, turn_deg, border_deg, spacing):
    planes = fan_planes(
        axis, CORNERS, spacing, turn_rad=sense * np.radians(turn_deg), border_turn_rad=np.radians(border_deg)
    )
    forward = 0.0 if axis == "x" else np.pi / 2
    angles = sense * np.degrees([angle(p) - forward for p in planes])
    middle = int(angles.argmax())
    assert angles[[0, middle, -1]] == pytest.approx([border_deg, turn_deg, border_deg], abs=1e-9)
    assert (np.diff(angles[: middle + 1]) > 0.0).all()
    assert (np.diff(angles[middle:]) < 0.0).all()
    # Two families, each through one centre, the centres opposite one another about the middle of the rectangle.
    lower, upper = planes[: middle + 1], planes[middle:]
    centres = [np.array([meeting(a, b) for a, b in itertools.combinations(f, 2)]) for f in (lower, upper)]
    scale = np.abs(centres[0]).max()
    for found in centres:
        assert np.ptp(found, axis=0).max() < 1e-7 * scale
    one, other = (c.mean(axis=0) for c in centres)
    assert 0.5 * (one + other) == pytest.approx(CORNERS.mean(axis=0), abs=1e-6 * scale)
    along, across = (0, 1) if axis == "x" else (1, 0)
    assert one[across] <= CORNERS[0, across] + 1e-6 * scale, "on the front's side"
    # Counter-clockwise the front's centre lies left of the wall, seen along +y or, for a blade along y, along −x.
    left = (
        one[along] <= CORNERS[0, along] if sense * (1 if axis == "x" else -1) > 0 else one[along] >= CORNERS[1, along]
    )
    assert left
    # Nothing crosses: along any way across, the planes come in order; and no gap is wider than the spacing.
    rng = np.random.default_rng(1)
    points = rng.uniform(*CORNERS, (4000, 2))
    points[:4] = [(x, y) for x in CORNERS[:, 0] for y in CORNERS[:, 1]]
    side = gaps(planes, points) * (-1.0 if axis == "x" else 1.0) * -1.0
    ahead = side > 1e-7
    assert (ahead[:-1] >= ahead[1:]).all(), "who is behind a plane is behind all the later ones"
    assert (side[0] >= -1e-6).all()
    assert (side[-1] <= 1e-6).all()
    before = np.clip(ahead.sum(axis=0) - 1, 0, len(planes) - 2)
    columns = np.arange(len(points))
    between = side[before, columns] - side[before + 1, columns]
    assert between.max() <= spacing * 1.001
    assert between.max() >= 0.6 * spacing, "no more planes than are needed"
    if border_deg == 0.0:
        ends = [planes[0], planes[-1]]
        assert [p.origin[across] for p in ends] == pytest.approx(CORNERS[:, across], abs=1e-9)


def test_the_ends_of_the_family_are_parallel_planes() -> None:
    for border in (0.0, 0.3):
        fan = fan_planes("x", CORNERS, 50.0, turn_rad=-border, border_turn_rad=border)
        assert len({round(angle(p), 12) for p in fan}) == 1
        assert angle(fan[0]) == pytest.approx(-border)
    nearly = fan_planes("y", CORNERS, 51.0, turn_rad=2e-6)
    straight = parallel_planes("y", np.linspace(-600.0, 600.0, 25), centre=CORNERS.mean(axis=0))
    assert len(nearly) == len(straight)
    for a, b in zip(nearly, straight):
        assert abs(a.signed_distance(b.origin)) < 1e-3
    steepest = float(np.arctan(0.5))  # 600 / 1200: the centres are two corners
    fan = fan_planes("x", CORNERS, 50.0, turn_rad=steepest - 1e-9)
    assert meeting(fan[0], fan[1]) == pytest.approx(CORNERS[0], abs=1e-3)


@pytest.mark.parametrize(
    ("turn", "border", "match"),
    [
        (0.5, 0.0, r"try that or turn the borders more"),
        (-0.2, 0.3, r"try border_turn_rad = 0.1"),
        (0.2, -0.1, r"from 0 to the size of the turn"),
        (1.6, 1.0, "below π/2"),
        (float("nan"), 0.0, "below π/2"),
    ],
)
def test_a_fan_that_cannot_be(turn, border, match) -> None:
    with pytest.raises(InvalidInputError, match=match):
        fan_planes("x", CORNERS, 50.0, turn_rad=turn, border_turn_rad=border)


def test_the_plane_between_halves_angle_and_distance() -> None:
    fan = fan_planes("x", CORNERS, 80.0, turn_rad=0.3, border_turn_rad=0.1)
    for first, second in itertools.pairwise(fan):
        half = plane_between(first, second)
        assert angle(half) == pytest.approx(0.5 * (angle(first) + angle(second)), abs=1e-12)
        assert meeting(first, half) == pytest.approx(meeting(half, second), abs=1e-6)
        assert half.signed_distance(first.origin) == pytest.approx(-half.signed_distance(second.origin), abs=1e-9)


def known(threshold, *, also=()):
    """Clear from a threshold on, of either sense, and in further ranges; counts its calls."""

    def clearance(turn):
        clearance.calls.append(turn)
        if any(low <= turn <= high for low, high in also):
            return 1.0
        return abs(turn) / threshold if threshold else 1.0

    clearance.calls = []
    return clearance


@pytest.mark.parametrize("threshold", [0.0, 0.004, 0.01, 0.49, 0.5, 0.501, 3.333, 17.0])
def test_the_least_turn_of_a_clearance_that_grows(threshold) -> None:
    found = least_turn(known(threshold), step=0.5, most=20.0, unit=0.01)
    assert found.clears
    assert found.turn == pytest.approx(np.ceil(threshold * 100.0 - 1e-9) / 100.0, abs=1e-12)
    assert found.clearance >= 1.0
    assert found.turn in found.tried[:, 0]


def test_the_lesser_of_both_senses_is_taken() -> None:
    # Clear from 2.3 on one side, from 2.11 on the other, both in the same step.
    side = known(2.3, also=[(-9.0, -2.11)])
    assert least_turn(side, step=0.5, most=20.0, unit=0.01).turn == -2.11
    side = known(2.11, also=[(-9.0, -2.3)])
    side_only = least_turn(lambda turn: side(turn) if turn >= 0 else float(turn <= -2.3), step=0.5, most=9.0, unit=0.01)
    assert side_only.turn == 2.11
    # A range on one side alone, NaN elsewhere.
    found = least_turn(lambda turn: 2.0 if -4.2 <= turn <= -3.4 else np.nan, step=0.5, most=20.0, unit=0.05)
    assert (found.turn, found.clears) == (-3.4, True)


def test_without_a_turn_that_clears_the_nearest_is_told() -> None:
    found = least_turn(lambda turn: 0.9 - 0.1 * abs(turn - 3.0), step=1.0, most=5.0, unit=0.1)
    assert (found.turn, found.clears) == (3.0, False)
    assert found.clearance == pytest.approx(0.9)
    found = least_turn(lambda turn: abs(turn) / 50.0, step=1.0, most=5.25, unit=0.1)
    assert abs(found.turn) == 5.2, "the last whole unit is looked at"


def test_a_cheap_estimate_saves_thorough_tries() -> None:
    plain, thorough = known(7.77), known(7.77)
    without = least_turn(plain, step=0.5, most=20.0, unit=0.01)
    helped = least_turn(thorough, step=0.5, most=20.0, unit=0.01, quick=lambda turn: abs(turn) / 7.6)
    assert without.turn == helped.turn == 7.77
    assert len(thorough.calls) <= len(plain.calls) - 28
    assert least_turn(known(3.0), step=0.5, most=5.0, unit=0.01, quick=lambda turn: 0.0).clears is False


@pytest.mark.parametrize(
    "values", [(0.0, 5.0, 0.1), (0.5, -1.0, 0.1), (0.5, np.inf, 0.1), (0.5, 5.0, 0.0), (0.5, 5.0, 1.0)]
)
def test_bounds_of_the_search(values) -> None:
    step, most, unit = values
    with pytest.raises(InvalidInputError, match="0 < unit ≤ step"):
        least_turn(known(1.0), step=step, most=most, unit=unit)
