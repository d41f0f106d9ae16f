"""How far rods stray between leaves: against the simulation, a cylinder, and a pair that must stray."""

import numpy as np
import pytest

from batten.curves.elastica import Elastica
from batten.fabrication.between_leaves import SHARES, strays_between
from batten.fabrication.plan import Block, RodPlacement, gripper_frames
from batten.fabrication.robot.motion import grip_poses
from batten.fabrication.simulation import BlockPath, sweep_rods
from batten.surfaces.deviation import surface_deviation
from batten.surfaces.plane import Plane

RADIUS, LENGTH = 600.0, 960.0
ARC = Elastica((-RADIUS * np.sin(0.8), RADIUS * np.cos(0.8)), 0.8, -1.0 / RADIUS, (0.0, 0.0), LENGTH)
BLOCK = Block(1, 0, 0, np.array([-250.0, 0.0, 400.0]), np.array([500.0, 100.0, 250.0]))
BEFORE = 220.0


def rod(leaf, y, curve, block=1):
    piece = curve.extended(-BEFORE, -BEFORE)
    plane = Plane((0.0, y, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    return RodPlacement(block, leaf, plane, np.zeros((2, 2)), piece, curve, BEFORE)


@pytest.fixture(scope="module")
def cylinder(made_surfaces):
    return made_surfaces.cylinder(RADIUS, 100.0)


def test_parallel_arcs_stay_on_the_cylinder(cylinder):
    rods = [rod(3, 60.0, ARC), rod(1, 20.0, ARC), rod(2, 40.0, ARC), rod(9, 50.0, ARC, block=2)]
    off = strays_between(cylinder, [BLOCK, Block(2, 0, 1, BLOCK.corner_mm, BLOCK.size_mm)], rods)
    assert np.isnan(off[[0, 3]]).all()  # the last ones of their blocks
    assert off[[1, 2]].max() < 1e-6
    assert np.isnan(strays_between(cylinder, [BLOCK], rods[:1])).all()


def test_it_is_what_the_simulation_finds(cylinder):
    """Two leaves that differ, followed by `sweep_rods` from tool poses without spin: the same shapes at the same shares."""
    other = Elastica((-425.0, 420.0), 0.78, -1.0 / 590.0, (1.0e-7, 2.0e-7), LENGTH)
    rods = [rod(1, 20.0, ARC), rod(2, 45.0, other)]
    (off, _) = strays_between(cylinder, [BLOCK], rods)
    frames = gripper_frames(rods)
    arms = [
        grip_poses(frames.positions_mm[:, k], frames.tangents[:, k], frames.normals, side)
        for k, side in enumerate(("left", "right"))
    ]
    path = BlockPath(1, *arms, ("leaf 1", "leaf 2"), np.ones(2, dtype=bool), np.ones(1))
    (sweep,) = sweep_rods([path], LENGTH, misfit=lambda i, p: -p[:, 2].mean(), step_mm=1000.0)
    assert sweep.share[:4].tolist() == SHARES.tolist()
    points = sweep.points(np.linspace(BEFORE, LENGTH - BEFORE, 401) / LENGTH)[1:4]
    points = points[np.abs(points[..., 0]) <= 250.0]
    wanted = np.abs(surface_deviation(cylinder, points).signed).max()
    assert 1.0 < wanted < 30.0
    assert off == pytest.approx(wanted, rel=0.02)


def test_nearly_straight_rods_stray_most(made_surfaces):
    """Two shallow arches of the same bow, tilted against each other: half way the chord is shorter than the leaves' own."""

    def shallow(tilt):
        middle = 0.5 * LENGTH * np.array([np.cos(tilt), np.sin(tilt)])
        return Elastica(np.array([0.0, 500.0]) - middle, tilt + 0.02, -0.04 / LENGTH, (0.0, 0.0), LENGTH)

    surface = made_surfaces.graph(
        lambda x, y: 500.0 + x * np.tan(0.003 * y) + 0.0 * y, (-300.0, 300.0), (0.0, 100.0), (8, 8), 3
    )
    off = [
        strays_between(surface, [BLOCK], [rod(1, 40.0, shallow(0.12)), rod(2, 40.0 + d, shallow(0.12 + 0.003 * d))])[0]
        for d in (2.0, 20.0)
    ]
    # Slack grows by tilt²/8 of the chord half way: the bow with its root.
    assert off[1] > off[0] + 2.0
