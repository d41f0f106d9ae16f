"""A rod followed while its ends move, and where it snaps."""

import numpy as np
import pytest

from batten.curves.elastica import Elastica
from batten.errors import BattenError, InvalidInputError, NoSolutionError
from batten.solvers.boundary_value import solve_boundary
from batten.solvers.snap_error import snap_error, snap_errors, snapped_shape
from batten.solvers.stability import least_eigenvalues
from batten.solvers.track import RodTracker, track_boundary

FLAT = np.array([0, 0, 0, 0.8, 0, 0.0])


def shapes(pose=FLAT, length=1.0):
    return solve_boundary(pose[:2], pose[2], pose[3:5], pose[5], length)


def meets(elastica, pose):
    ends = elastica.point_at([0.0, elastica.length])
    angles = elastica.angle_at([0.0, elastica.length])
    misses = [ends[0] - pose[:2], ends[1] - pose[3:5], angles - pose[[2, 5]]]
    return float(np.abs(np.concatenate(misses)).max())


def test_every_pose_is_met_and_solved_by_the_same_shape_as_from_scratch():
    t = np.linspace(0, 2 * np.pi, 60)
    path = np.column_stack(
        [0.1 * t, 0 * t, 0.3 * np.sin(t), 0.1 * t + 0.75 + 0.1 * np.cos(t), 0.1 * np.sin(2 * t), 0.4 * np.sin(3 * t)]
    )
    states = track_boundary(path, 1.0)
    assert all(s.snap is None for s in states)
    for pose, state in zip(path, states):
        assert meets(state.elastica, pose) < 1e-11
        assert state.stable
        energies = [s.energy for s in shapes(pose)]
        assert min(abs(e / state.energy - 1) for e in energies) < 1e-9


def test_steps_do_not_matter():
    last = np.array([0, 0, 0.6, 0.5, 0.3, -0.2])
    one = track_boundary([FLAT, last], 1.0)[-1]
    many = track_boundary(np.linspace(FLAT, last, 40), 1.0)[-1]
    assert one.elastica.parameters == pytest.approx(many.elastica.parameters, abs=1e-9)


def test_a_rod_is_followed_through_turns_of_its_end():
    path = np.linspace([0, 0, 0, 0.3, 0, 0], [0, 0, 0, 0.3, 0, 4 * np.pi], 60)
    last = track_boundary(path, 1.0)[-1]
    assert last.elastica.angle_at(1.0) - last.elastica.start_angle == pytest.approx(4 * np.pi)


def test_length_and_place_only_scale():
    scale, shift, turn = 250.0, np.array([30.0, -70.0]), 0.7
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    path = np.linspace(FLAT, [0, 0, 0.5, 0.7, 0.1, 0.5], 5)
    moved = path.copy()
    for columns in (slice(0, 2), slice(3, 5)):
        moved[:, columns] = shift + scale * path[:, columns] @ rotation.T
    moved[:, [2, 5]] += turn
    here, there = track_boundary(path, 1.0), track_boundary(moved, scale)
    for a, b in zip(here, there):
        assert b.energy * scale == pytest.approx(a.energy, rel=1e-9)
        assert b.margin == pytest.approx(a.margin, rel=1e-9)


def snapping():
    """One end of a flat buckled rod turned by 3 rad against its bow: the states, and the path."""
    down = min((s.elastica for s in shapes()), key=lambda e: e.start_curvature)
    up = max((s.elastica for s in shapes()), key=lambda e: e.start_curvature)
    path = np.linspace(FLAT, [0, 0, 0, 0.8, 0, 3.0], 31)
    return track_boundary(path, 1.0, solution=down), track_boundary(path, 1.0, solution=up), path


def test_the_fold_is_where_the_least_eigenvalue_vanishes():
    _, states, path = snapping()
    (where,) = [i for i, s in enumerate(states) if s.snap is not None]
    snap = states[where].snap
    assert snap.pose == pytest.approx(path[where - 1] + snap.fraction * (path[where] - path[where - 1]))
    assert meets(snap.before, snap.pose) < 1e-9
    scale = abs(float(least_eigenvalues(states[0].elastica.parameters)))
    assert 0 <= float(least_eigenvalues(snap.before.parameters)) < 1e-2 * scale
    before = snap.pose + 1e-4 * (path[where - 1] - path[where])  # two shapes there that are about to merge
    beyond = snap.pose - 1e-4 * (path[where - 1] - path[where])
    assert len(shapes(before)) == len(shapes(beyond)) + 2


def test_the_shape_after_a_snap_is_stable_and_lower():
    others, states, _ = snapping()
    snap = next(s.snap for s in states if s.snap is not None)
    assert snap.energy_released == pytest.approx(snap.before.bending_energy() - snap.after.bending_energy())
    assert snap.energy_released > 1
    assert any(abs(s.energy / snap.after.bending_energy() - 1) < 1e-3 and s.stable for s in shapes(snap.pose))
    assert states[-1].energy == pytest.approx(
        others[-1].energy
    )  # it fell to the shape that was followed from the other side
    assert all(s.snap is None for s in others)


def test_a_bifurcation_ends_the_way_too():
    """Both ends turned alike, symmetrically, against an arch: it loses stability to either side before its fold."""
    up = max((s.elastica for s in shapes()), key=lambda e: e.start_curvature)
    states = track_boundary(np.linspace(FLAT, [0, 0, -1.5, 0.8, 0, 1.5], 31), 1.0, solution=up)
    snap = next(s.snap for s in states if s.snap is not None)
    assert 0 <= float(least_eigenvalues(snap.before.parameters)) < 0.05
    assert states[-1].elastica.point_at(0.5)[1] < 0


def test_an_unstable_shape_can_be_followed_too():
    unstable = next(s for s in solve_boundary((0, 0), 0, (0.8, 0), 0, 1, max_inflections=3) if not s.stable)
    state = track_boundary([FLAT, [0, 0, 0.05, 0.82, 0.01, 0]], 1.0, solution=unstable.elastica)[-1]
    assert not state.stable
    assert state.snap is None
    assert meets(state.elastica, np.array([0, 0, 0.05, 0.82, 0.01, 0])) < 1e-11


def test_bad_poses_leave_the_tracker_where_it_was():
    tracker = RodTracker(1.0)
    first = tracker.move(FLAT)
    for pose, error in (
        ((0, 0, 0, 1.2, 0, 0), NoSolutionError),
        ((0, 0, 0, np.nan, 0, 0), InvalidInputError),
        ((0, 0, 0), InvalidInputError),
    ):
        with pytest.raises(error):
            tracker.move(pose)
    assert tracker.move(FLAT).elastica.parameters == pytest.approx(first.elastica.parameters, abs=1e-9)
    with pytest.raises(InvalidInputError, match="length"):
        RodTracker(-1.0)
    with pytest.raises(InvalidInputError, match=r"shape \(n, 6\)"):
        track_boundary([1, 2, 3], 1.0)
    with pytest.raises(InvalidInputError, match="away from the first pose"):
        track_boundary([FLAT], 1.0, solution=Elastica((0, 0), 0.0, 0.0, (0, 0), 1.0))


def test_wild_poses_are_followed_or_refused_in_words():
    rng = np.random.default_rng(0)
    tracker, refused = RodTracker(1.0), 0
    for _ in range(60):
        r, a = rng.uniform(0, 0.9), rng.uniform(-np.pi, np.pi)
        pose = np.array([0, 0, 0, r * np.cos(a), r * np.sin(a), rng.uniform(-2, 2)])
        try:
            state = tracker.move(pose)
        except BattenError:
            refused += 1
        else:
            assert state.stable
            assert meets(state.elastica, pose) < 1e-9
    assert refused <= 3


def test_an_ordinary_pose_costs_few_evaluations():
    t = np.linspace(0, 2 * np.pi, 200)
    path = np.column_stack([0 * t, 0 * t, 0.2 * np.sin(t), 0.8 + 0.05 * np.cos(t), 0 * t, 0.2 * np.sin(2 * t)])
    states = track_boundary(path, 1.0)
    assert np.median([s.evaluations for s in states]) <= 6


# --- the errors of grippers ---


@pytest.mark.parametrize("slack", [1e-2, 1e-4, 1e-6])
def test_nearly_straight_rods_flip_at_a_turn_of_1_78_roots_of_their_slack(slack):
    up = shapes(np.array([0, 0, 0, 1 - slack, 0, 0]))[0].elastica
    error = snap_error(up)
    assert abs(error.turn) == pytest.approx(1.7818 * np.sqrt(slack), rel=1e-3)
    assert error.shift == pytest.approx(slack, rel=1e-6)
    assert error.direction == pytest.approx(0.0)
    down = snapped_shape(up, error)
    assert down.point_at(0.5)[1] * up.point_at(0.5)[1] < 0


def test_beyond_the_error_there_is_no_such_shape_and_short_of_it_there_is():
    up = max((s.elastica for s in solve_boundary((0, 0), 0.1, (0.9, 0), -0.1, 1)), key=lambda e: -e.bending_energy())
    low = next(s.elastica for s in solve_boundary((0, 0), 0.5, (0.9, 0), -0.5, 1) if s.stable and s.margin < 1.1)
    for elastica in (up, low):
        error = snap_error(elastica)
        if not np.isfinite(error.turn):
            continue
        end, angle = elastica.point_at(1.0), float(elastica.angle_at(1.0))
        for share, snaps in ((0.999, False), (1.001, True)):
            pose = np.array([0, 0, elastica.start_angle, *end, angle])
            pose[2 if error.turned == "start" else 5] += share * error.turn
            states = track_boundary([[0, 0, elastica.start_angle, *end, angle], pose], 1.0, solution=elastica)
            assert (states[-1].snap is not None) == snaps
            if np.isfinite(error.shift):
                step = share * error.shift * np.array([np.cos(error.direction), np.sin(error.direction)])
                moved = np.array([0, 0, elastica.start_angle, *(end + step), angle])
                states = track_boundary([[0, 0, elastica.start_angle, *end, angle], moved], 1.0, solution=elastica)
                assert (states[-1].snap is not None) == snaps


def test_no_random_shift_below_the_error_makes_the_rod_snap():
    elastica = next(s.elastica for s in solve_boundary((0, 0), 0.5, (0.9, 0), -0.5, 1) if s.stable and s.margin < 1.1)
    error, rng = snap_error(elastica), np.random.default_rng(3)
    end, angle = elastica.point_at(1.0), float(elastica.angle_at(1.0))
    for direction in rng.uniform(-np.pi, np.pi, 30):
        shift = 0.98 * error.shift * np.array([np.cos(direction), np.sin(direction)])
        pose = [0, 0, elastica.start_angle, *(end + shift), angle]
        assert (
            track_boundary([[0, 0, elastica.start_angle, *end, angle], pose], 1.0, solution=elastica)[-1].snap is None
        )


def test_straight_unstable_and_bad_rods():
    assert snap_error(Elastica((0, 0), 0.3, 0.0, (0, 0), 2.0))[:1] == (0.0,)
    unstable = next(s for s in solve_boundary((0, 0), 0, (0.8, 0), 0, 1, max_inflections=3) if not s.stable)
    assert snap_error(unstable.elastica).turn == 0.0
    only = solve_boundary((0, 0), 1.0, (0.9, 0), -1.0, 1)[0].elastica
    assert snap_error(only, reach=0.05, turn_reach=0.2).turn == np.inf
    with pytest.raises(NoSolutionError, match="does not snap"):
        snapped_shape(only, snap_error(only, reach=0.05, turn_reach=0.2))
    with pytest.raises(InvalidInputError, match="above 0"):
        snap_errors(only.parameters, reach=-1.0)
    rows = snap_errors(np.stack([only.parameters, np.full(7, np.nan)]), reach=0.05, turn_reach=0.2)
    assert np.isinf(rows[0, 0])
    assert np.isnan(rows[1]).all()


def test_errors_scale_with_the_rod():
    up = shapes(np.array([0, 0, 0, 0.97, 0, 0]))[0].elastica
    large = shapes(np.array([0, 0, 0, 970.0, 0, 0]), 1000.0)[0].elastica
    small, big = snap_error(up), snap_error(large)
    assert big.shift == pytest.approx(1000 * small.shift, rel=1e-6)
    assert abs(big.turn) == pytest.approx(abs(small.turn), rel=1e-6)
