"""The rod on its way between targets: ends, shapes, planes, snaps, against closed forms and the search for all shapes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError, LimitError
from batten.fabrication.simulation import BlockPath, held_ends, sweep_rods
from batten.solvers.boundary_value import solve_boundary

LENGTH = 1000.0


def tool(position, tangent, side, spin=0.0, normal=(0.0, 1.0, 0.0)):
    """A tool pose written from the convention alone: z along the rod, out of the gripper; x the plane's normal, spun."""
    z = np.array(tangent, dtype=float) * (1.0 if side == "left" else -1.0)
    x = np.array(normal, dtype=float)
    y = np.cross(z, x)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1] = np.cos(spin) * x + np.sin(spin) * y, np.cos(spin) * y - np.sin(spin) * x
    pose[:3, 2], pose[:3, 3] = z, position
    return pose


def planar_path(poses, places, spins=None, labels=None, seconds=1.0):
    """A path of rods in planes y = place; poses are start x, z, angle, end x, z, angle; spins (n, 2) of the tools."""
    spins = np.zeros((len(poses), 2)) if spins is None else np.asarray(spins)
    arms = []
    for k, side in enumerate(("left", "right")):
        at = [p[3 * k : 3 * k + 3] for p in poses]
        arms.append(
            np.stack(
                [
                    tool((x, y, z), (np.cos(a), 0.0, np.sin(a)), side, s)
                    for (x, z, a), y, s in zip(at, places, spins[:, k])
                ]
            )
        )
    labels = labels or tuple(f"leaf {i + 1}" for i in range(len(poses)))
    return BlockPath(
        1, *arms, labels, np.array([x.startswith("leaf") for x in labels]), np.full(len(poses) - 1, seconds)
    )


def ends_of(curve):
    end = curve.point_at(curve.length)
    return [*curve.start, curve.start_angle, *end, float(curve.angle_at(curve.length))]


BENT = Elastica((-400.0, 300.0), 0.35, -0.0012, (1.2e-6, 4.0e-7), LENGTH)
OTHER = Elastica((-395.0, 310.0), 0.42, -0.0014, (1.0e-6, 6.0e-7), LENGTH)


def test_at_the_targets_the_rods_are_those_of_the_leaves():
    path = planar_path([ends_of(BENT), ends_of(OTHER)], [0.0, 20.0])
    (sweep,) = sweep_rods([path], LENGTH, misfit=lambda i, p: np.abs(p[:, 2] - 400.0).mean())
    s = np.linspace(0.0, 1.0, 41)
    for row, curve, y in ((0, BENT, 0.0), (-1, OTHER, 20.0)):
        x, z = curve.point_at(s * LENGTH).T
        assert np.abs(sweep.points(s)[row] - np.stack([x, np.full(41, y), z], axis=1)).max() < 1e-7
    assert sweep.at_leaf.tolist() == [True] + [False] * (len(sweep.move) - 2) + [True]
    assert (sweep.margin > 1.0).all()
    assert sweep.out_of_plane_rad.max() < 1e-9


def test_between_targets_the_rod_is_a_shape_of_its_ends():
    """Half way both ends are half way, and the rod is one of all elastica between them, the one near its neighbours."""
    path = planar_path([ends_of(BENT), ends_of(OTHER)], [0.0, 20.0])
    (sweep,) = sweep_rods([path], LENGTH, misfit=lambda i, p: np.abs(p[:, 2] - 400.0).mean(), step_mm=2.0)
    middle = int(np.flatnonzero(sweep.share == 0.5)[0])
    pose = 0.5 * (np.array(ends_of(BENT)) + ends_of(OTHER))
    found = solve_boundary(pose[:2], pose[2], pose[3:5], pose[5], LENGTH)
    s = np.linspace(0.0, 1.0, 21)
    points = sweep.points(s)[middle]
    off = [np.abs(f.elastica.point_at(s * LENGTH) - points[:, [0, 2]]).max() for f in found]
    assert min(off) < 1e-6
    assert np.abs(points[:, 1] - 10.0).max() < 1e-9
    assert len(sweep.move) == 1 + max(
        4, int(np.ceil(np.linalg.norm(path.right[1, :3, 3] - path.right[0, :3, 3]) / 2.0))
    )


def test_tools_go_as_movel_says():
    """Ends on straight lines, evenly; tangents by the shortest turn of the whole tool, here with a spin: scipy's Slerp."""
    path = planar_path([ends_of(BENT), ends_of(OTHER)], [0.0, 20.0], spins=[(0.0, 0.4), (0.3, -0.2)])
    (sweep,) = sweep_rods([path], LENGTH, misfit=lambda i, p: np.abs(p[:, 2] - 400.0).mean())
    for arm, end in ((path.left, 0.0), (path.right, 1.0)):
        lines = arm[0, :3, 3] + sweep.share[:, None] * (arm[1, :3, 3] - arm[0, :3, 3])
        assert np.abs(sweep.points([end])[:, 0] - lines).max() < 1e-8
    turned = Slerp([0.0, 1.0], Rotation.from_matrix(path.left[:, :3, :3]))(sweep.share).as_matrix()[:, :, 2]
    step = (sweep.points([1e-6])[:, 0] - sweep.points([0.0])[:, 0]) / (1e-6 * LENGTH)
    angle = np.degrees(np.arccos(np.clip((turned * step).sum(axis=1), -1.0, 1.0)))
    assert angle.max() <= np.degrees(sweep.out_of_plane_rad.max()) + 1e-3


def test_a_spin_on_the_way_drives_the_ends_out_of_the_plane():
    """To second order half way by spin × turn / 8, and the two grippers turn against each other by the spins' difference."""
    turn, spin = 0.02, 0.04
    straight = [-400.0, 0.0, 0.3, 400.0, 0.0, -0.3]
    turned = [-400.0, 0.0, 0.3 + turn, 400.0, 0.0, -0.3]
    (sweep,) = sweep_rods([planar_path([straight, turned], [0.0, 20.0], spins=[(0.0, 0.0), (spin, 0.0)])], LENGTH)
    middle = int(np.flatnonzero(sweep.share == 0.5)[0])
    assert sweep.twist_rad[-1] == pytest.approx(-spin, abs=1e-9)
    # One end alone turns the plane about the chord by its share and keeps the rest: together they are spin·turn/8.
    tilt = np.arctan2(sweep.frame[middle, 1, 1], sweep.frame[middle, 1, 2])
    whole = np.abs(np.sin(tilt) * np.sin(0.3 + 0.5 * turn)) + sweep.out_of_plane_rad[middle]
    assert whole == pytest.approx(spin * turn / 8.0, rel=0.05)
    assert sweep.out_of_plane_rad[[0, -1]].max() < 1e-9


def test_the_plane_turns_with_both_ends():
    """A rod tilted about its chord lies in the tilted plane: nothing is out of it."""
    tilt = Rotation.from_euler("x", 0.2).as_matrix()
    left = tool((-400.0, 0.0, 0.0), tilt @ [np.cos(0.4), 0.0, np.sin(0.4)], "left", normal=tilt @ [0.0, 1.0, 0.0])
    right = tool((400.0, 0.0, 0.0), tilt @ [np.cos(0.3), 0.0, -np.sin(0.3)], "right", normal=tilt @ [0.0, 1.0, 0.0])
    held = held_ends(left[None], right[None])
    assert np.abs(held.frame[0, 2] @ tilt @ [0.0, 1.0, 0.0]) == pytest.approx(1.0, abs=1e-9)
    assert held.out_of_plane_rad[0] < 1e-6
    assert held.pose[0] == pytest.approx([0.0, 0.0, 0.4, 800.0, 0.0, -0.3], abs=1e-6)
    assert held.out_of_plane_mm[0] < 1e-3


def test_nearly_straight_ends_leave_the_plane_upright():
    """Tangents that stray by less than a thousandth say nothing about the plane; the deflection is told."""
    c = 4e-5
    left = tool((-400.0, 0.0, 0.0), (np.sqrt(1 - c * c), c, 0.0), "left", normal=(-c, np.sqrt(1 - c * c), 0.0))
    right = tool((400.0, 0.0, 0.0), (1.0, 0.0, 0.0), "right")
    held = held_ends(left[None], right[None])
    assert abs(held.frame[0, 1, 2]) > 1.0 - 1e-6
    assert held.out_of_plane_mm[0] == pytest.approx(800.0 * c * 4.0 / 27.0, rel=1e-2)  # greatest t(1−t)²


def test_a_snap_on_the_way_is_told_with_its_leaves():
    """The arch that must give way when one end turns by 170° and the one that need not."""
    angles = np.linspace(0.0, 3.0, 7)
    poses = [[0.0, 0.0, 0.0, 800.0, 0.0, a] for a in angles]
    path = planar_path(poses, 20.0 * np.arange(7))
    above, below = (lambda i, p, sign=sign: float(sign * p[:, 2].mean()) for sign in (-1.0, 1.0))
    (held,) = sweep_rods([path], LENGTH, misfit=below)
    assert held.choices == 2
    with pytest.raises(LimitError, match=r"block 1, between leaf 2 and leaf 3: the rod snaps"):
        sweep_rods([path], LENGTH, misfit=above)


def test_a_rod_that_is_pulled_taut_is_told():
    poses = [[-400.0, 0.0, 0.3, 400.0, 0.0, -0.3], [-400.0, 0.0, 0.3, 605.0, 0.0, -0.3]]
    with pytest.raises(LimitError, match="block 1, between leaf 1 and leaf 2: the rod cannot be held: the ends are"):
        sweep_rods([planar_path(poses, [0.0, 20.0])], LENGTH)
    with pytest.raises(LimitError, match=r"block 1: (the rod cannot be fixed|a rod of 700 mm has no stable)"):
        sweep_rods([planar_path(poses, [0.0, 20.0])], 700.0)


def test_the_first_shape_is_chosen_at_the_first_leaf():
    """The misfit sees the rod where the first leaf is, not at the approach pose."""
    poses = [[-400.0, 0.0, 0.0, 400.0, 0.0, 0.0]] * 3
    path = planar_path(poses, [-120.0, 0.0, 20.0], labels=("approach", "leaf 7", "leaf 8"))
    seen = []

    def misfit(i, points):
        seen.append(points[:, 1])
        return float(points[:, 2].mean())

    (sweep,) = sweep_rods([path], LENGTH, misfit=misfit)
    assert np.abs(seen).max() < 1e-9
    assert (sweep.points([0.5])[:, 0, 2] < -100.0).all()
    assert path.way(0) == "between approach and leaf 7"
    assert sweep.seconds[-1] == 2.0


def test_several_blocks_are_followed_side_by_side():
    """Each as if it were alone, also where one is done earlier."""
    short = planar_path([ends_of(BENT), ends_of(OTHER)], [0.0, 20.0])
    long = planar_path([ends_of(OTHER), ends_of(BENT), ends_of(OTHER)], [0.0, 20.0, 60.0])
    alone = [sweep_rods([p], LENGTH)[0] for p in (short, long)]
    for one, other in zip(alone, sweep_rods([short, long], LENGTH)):
        assert np.array_equal(one.parameters, other.parameters)


def test_bad_input_is_named():
    path = planar_path([ends_of(BENT), ends_of(OTHER)], [0.0, 20.0])
    assert sweep_rods([], LENGTH) == ()
    with pytest.raises(InvalidInputError, match="length_mm = -1"):
        sweep_rods([path], -1.0)
    with pytest.raises(InvalidInputError, match="n ≥ 2 targets"):
        BlockPath(1, path.left[:1], path.right[:1], ("leaf 1",), np.array([True]), np.zeros(0))
    with pytest.raises(InvalidInputError, match="times above 0"):
        BlockPath(1, path.left, path.right, path.labels, path.is_leaf, np.array([0.0]))
