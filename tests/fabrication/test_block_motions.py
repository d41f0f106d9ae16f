"""Ways in and out, from rods whose surface is known in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from batten.curves.elastica import Elastica
from batten.fabrication.block_motions import STEEPNESS, clearance_of, flatter_ways, move_blocks, rods_in_block
from batten.fabrication.job import BladeJob, CellJob, CutJob, GripperJob, KerfJob, RodJob, SurfaceJob
from batten.fabrication.plan import Block, RodPlacement
from batten.fabrication.robot.cell import cell_from_job
from batten.surfaces.plane import Plane

SIZE = np.array([600.0, 500.0, 700.0])
RADIUS = 900.0
SPARE = 180.0
JOB = CutJob(
    SurfaceJob(),
    rod=RodJob(length_mm=980.0, diameter_mm=3.0),
    gripper=GripperJob(radius_mm=25.0),
    kerf=KerfJob(offset=False),
)


def rods_on(height, y, block=1, corner=(0.0, 0.0, 0.0), turn=0.0, axis="x"):
    """Rods that arch over a block as arcs of one circle, the middle of each raised by `height(y)`; y from the face."""
    rods = []
    half = np.arcsin(0.5 * 600.0 / RADIUS)
    corner = np.array(corner)
    centre = corner + (SIZE if axis == "x" else SIZE[[1, 0, 2]]) * [0.5, 0.5, 0.0]
    for number, at in enumerate(y, start=1):
        across = at - 0.5 * SIZE[1]
        along = np.array([np.cos(turn), np.sin(turn), 0.0])
        middle = np.array([0.0, across, 0.0])
        if axis == "y":  # x_work = +y_wall, y_work = −x_wall
            along, middle = np.array([-along[1], along[0], 0.0]), np.array([-across, 0.0, 0.0])
        origin = centre + middle + [0.0, 0.0, height(at)]
        start = (-RADIUS * np.sin(half), RADIUS * (np.cos(half) - 1.0))
        piece = Elastica(start, half, -1.0 / RADIUS, (0.0, 0.0), 2.0 * half * RADIUS)
        spare = 0.5 * (JOB.rod.length_mm - piece.length)
        points = piece.point_at(np.linspace(0.0, piece.length, 41))
        plane = Plane(origin, along, (0.0, 0.0, 1.0))
        rods.append(RodPlacement(block, number, plane, points, piece, piece.extended(spare, spare), spare))
    return rods


def block(number=1, row=0, column=0, axis="x"):
    return Block(number, row, column, np.zeros(3), SIZE if axis == "x" else SIZE[[1, 0, 2]])


def quiet(stage, done, of):
    """Nobody is told."""


Y = np.array([0.0, 30.0, 55.0, 120.0, 300.0, 410.0, 470.0, 500.0])


@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_slope_of_a_plane_and_of_a_parabola_is_met_exactly(axis):
    seen = rods_in_block(JOB, rods_on(lambda y: 300.0 + 0.4 * y, Y, axis=axis), block(axis=axis), axis)
    np.testing.assert_allclose(seen.rise, [-0.4, 0.4], rtol=0, atol=1e-12)
    bowl = rods_in_block(JOB, rods_on(lambda y: 300.0 + 0.002 * y * (y - 300.0), Y, axis=axis), block(axis=axis), axis)
    np.testing.assert_allclose(bowl.rise, [0.6, 1.4], rtol=0, atol=1e-11)
    np.testing.assert_allclose(bowl.size_mm, SIZE)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_rods_are_seen_from_the_block(axis):
    seen = rods_in_block(JOB, rods_on(lambda y: 300.0 + 0.1 * y, Y, axis=axis), block(axis=axis), axis)
    np.testing.assert_allclose(seen.points[:, :, 1], (Y - 250.0)[:, None] + np.zeros(25), rtol=0, atol=1e-9)
    away = np.hypot(seen.points[..., 0], seen.points[..., 2] - (300.0 + 0.1 * Y[:, None] - RADIUS))
    np.testing.assert_allclose(away, RADIUS, rtol=0, atol=1e-9)
    for k, (positions, tangents, normals) in enumerate(seen.frames):
        np.testing.assert_allclose(positions, seen.points[:, -k], rtol=0, atol=1e-9)
        np.testing.assert_allclose(tangents[:, 0], np.cos(0.5 * 980.0 / RADIUS), rtol=0, atol=1e-12)
        np.testing.assert_allclose(normals, np.tile([0.0, 1.0, 0.0], (len(Y), 1)), rtol=0, atol=1e-12)
    # Chords of 980/24 mm on a circle of 900 mm lie this far within it.
    chord = RADIUS * (1.0 - np.cos(0.5 * 980.0 / 24.0 / RADIUS))
    assert seen.radius_mm == pytest.approx(1.5 + chord, rel=1e-3)
    assert seen.radius_mm >= 1.5 + chord


def test_few_leaves_and_flat_rods():
    one = rods_in_block(JOB, rods_on(lambda y: 300.0 + 0.4 * y, Y[:1]), block(), "x")
    assert one.rise.tolist() == [0.0, 0.0]
    two = rods_in_block(JOB, rods_on(lambda y: 300.0 + 0.4 * y, Y[:2]), block(), "x")
    np.testing.assert_allclose(two.rise, [-0.4, 0.4], rtol=0, atol=1e-12)
    strip = replace(JOB, rod=RodJob(length_mm=980.0, width_mm=4.0, thickness_mm=3.0))
    thick = rods_in_block(strip, rods_on(lambda y: 300.0, Y), block(), "x")
    thin = rods_in_block(JOB, rods_on(lambda y: 300.0, Y), block(), "x")
    assert thick.radius_mm - thin.radius_mm == pytest.approx(2.5 - 1.5)


@pytest.mark.parametrize("turn", [0.0, 0.06, -0.06])
def test_the_whole_rod_is_outside_before_it_is_bent_otherwise(turn):
    rods = rods_on(lambda y: 300.0 + 0.3 * y, np.linspace(-20.0, 520.0, 12), turn=turn)
    (motion,) = move_blocks(JOB, cell_from_job(CellJob()), [block()], rods, "x", quiet)
    seen = rods_in_block(JOB, rods, block(), "x")
    assert (seen.outside_mm > 0.0).all() == (turn != 0.0)  # turned rods reach back over the block's face
    for shape, way, sign in (
        (seen.points[0], motion.left.approach[:3, 3] - motion.left.poses[0, :3, 3], -1.0),
        (seen.points[-1], motion.left.leave[:3, 3] - motion.left.poses[-1, :3, 3], 1.0),
    ):
        before = (sign * shape[:, 1]).min() - 0.5 * SIZE[1]
        outside = (sign * (shape + way)[:, 1]).min() - 0.5 * SIZE[1]
        assert outside == pytest.approx(JOB.blade.approach_mm + max(before, 0.0), abs=1e-9)
        assert way[0] == 0.0
        assert way[2] / way[1] == pytest.approx(0.3, abs=1e-9)  # along the plane that the rods sweep
    for name, leaf in (("approach", 0), ("leave", -1)):  # both ends alike: the shape stays
        left, right = (getattr(arm, name) - arm.poses[leaf] for arm in (motion.left, motion.right))
        np.testing.assert_allclose(left, right, rtol=0, atol=1e-9)
        np.testing.assert_array_equal(left[:3, :3], np.zeros((3, 3)))


def test_level_ways_on_demand():
    job = replace(JOB, blade=BladeJob(lead="level", approach_mm=70.0))
    rods = rods_on(lambda y: 300.0 + 0.3 * y, np.linspace(0.0, 500.0, 12))
    (motion,) = move_blocks(job, cell_from_job(job.cell), [block()], rods, "x", quiet)
    way = motion.right.approach[:3, 3] - motion.right.poses[0, :3, 3]
    np.testing.assert_allclose(way, [0.0, -70.0, 0.0], rtol=0, atol=1e-9)
    flat = flatter_ways(job, [block()], rods, (motion,), "x")
    assert (flat, type(flat)) == (2, int)  # a fact of the plan, for JSON too


def test_a_way_that_leads_into_the_table_is_made_less_steep():
    # The first leaf's ends hang 103 mm over the table's height; at the full slope the way in goes 200 mm down.
    job = replace(JOB, blade=BladeJob(approach_mm=100.0), cell=CellJob(table_mm=(1100.0, 900.0)))
    cell = cell_from_job(job.cell)
    rods = rods_on(lambda y: 230.0 + 2.0 * y, np.linspace(0.0, 100.0, 8))
    (motion,) = move_blocks(job, cell, [block()], rods, "x", quiet)
    way = motion.left.approach[:3, 3] - motion.left.poses[0, :3, 3]
    steep = way[2] / way[1] / 2.0
    assert steep == pytest.approx(min(STEEPNESS, key=lambda s: abs(s - steep)), abs=1e-9)
    assert steep < 1.0
    free = clearance_of(job, cell, motion, rods_in_block(job, rods, block(), "x"))
    assert free.distance_mm[0] >= cell.min_clearance_mm
    out = motion.left.leave[:3, 3] - motion.left.poses[-1, :3, 3]
    assert out[2] / out[1] == pytest.approx(2.0, abs=1e-9)  # the way out goes up as it should
    assert flatter_ways(job, [block()], rods, (motion,), "x") == 1


def test_blocks_whose_rods_are_the_same_keep_their_motion_and_refused_rods_have_none():
    first = rods_on(lambda y: 300.0 + 0.3 * y, np.linspace(0.0, 500.0, 6))
    second = [replace(r, block=2) for r in first]
    blocks = [block(), block(2, column=1)]
    rods = (*first, *second)
    cell = cell_from_job(CellJob())
    before = move_blocks(JOB, cell, blocks, rods, "x", quiet)
    assert [m.rods for m in before] == [tuple(range(6)), tuple(range(6, 12))]
    rods = (*first, replace(second[0], status="refused"), *second[1:])
    after = move_blocks(JOB, cell, blocks, rods, "x", quiet, known=before)
    assert after[0] is before[0]
    assert after[1].rods == tuple(range(7, 12))
    gone = move_blocks(JOB, cell, blocks, [replace(r, status="refused") for r in rods], "x", quiet)
    assert gone == ()
