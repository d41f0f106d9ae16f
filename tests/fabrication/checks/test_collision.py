"""The check of free distances over a plan, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from batten.fabrication.checks.collision import collision_check, travel_check
from batten.fabrication.checks.run import refusals
from batten.fabrication.cut import check_again, plan_cut
from batten.fabrication.job import ArmJob, BladeJob, CellJob, CutJob, GripperJob, KerfJob, RodJob, SurfaceJob
from batten.fabrication.plan import gripper_frames
from batten.fabrication.robot.cell import cell_from_job
from batten.fabrication.robot.motion import plan_block_motion

THIN = ArmJob(link_radii_mm=(1.0,) * 6)  # so that the grippers are what counts
JOB = CutJob(
    SurfaceJob(),
    rod=RodJob(length_mm=1000.0),
    gripper=GripperJob(radius_mm=25.0),
    blade=BladeJob(lead="level"),
    kerf=KerfJob(offset=False),
    cell=CellJob(left=THIN, right=THIN),
)
LIMIT = JOB.cell.min_clearance_mm


@pytest.fixture
def straight(hand):
    """Two blocks side by side, three level straight rods in each, 200 mm over the table and 200 mm beside the block."""
    blocks = [hand.block(1), hand.block(2, column=1)]
    rods = [
        hand.place(hand.line(start=(600.0 * column, 200.0)), block=column + 1, leaf=leaf, plane=hand.vertical(y))
        for column in (0, 1)
        for leaf, y in enumerate((0.0, 300.0, 600.0), start=1)
    ]
    return blocks, rods


def motion_of(cell, block, rods, indices, shift_mm=(0.0, 0.0, 0.0)):
    """A motion through one block, the grippers moved from where the rods' ends are."""
    to_work = np.linalg.inv(block.work_frame("x"))
    held = gripper_frames([rods[i] for i in indices])
    frames = [
        (held.positions_mm[:, k] + to_work[:3, 3] + shift_mm, held.tangents[:, k], held.normals) for k in range(2)
    ]
    return plan_block_motion(cell, *frames, 20.0, 100.0, 100.0, block=block.number, rods=indices)


def test_values_stand_at_the_rods_of_the_motions_and_the_note_names_the_nearest(straight):
    blocks, rods = straight
    cell = cell_from_job(JOB.cell)
    motions = [
        motion_of(cell, blocks[0], rods, [0, 1, 2]),
        motion_of(cell, blocks[1], rods, [3, 5], shift_mm=(-230.0, 0.0, 0.0)),
    ]
    check = collision_check(JOB, cell, blocks, rods, motions, "x")
    # The jaw's axis is 500 − 300 mm beside the block; 30 mm within it where the right gripper was moved by 230 mm.
    expected = [175.0, 175.0, 175.0, -55.0, np.nan, -55.0]
    np.testing.assert_allclose(check.values, expected, rtol=0, atol=1e-6)
    assert (check.name, check.sense, check.unit, check.limit, check.hard) == ("collision", "min", "mm", LIMIT, True)
    assert check.passed.tolist() == [True, True, True, False, True, False]
    assert check.note.endswith("The nearest: right gripper jaw and block, leaf 1 in block 2.")
    assert refusals([check], rods)[3] == ("free distance of arms, grippers and rod -55 mm < 10 mm in block 2",)


def test_the_way_from_block_to_block_stands_at_each_blocks_first_rod(straight):
    blocks, rods = straight
    cell = cell_from_job(JOB.cell)
    motions = [motion_of(cell, blocks[1], rods, [3, 4, 5]), motion_of(cell, blocks[0], rods, [1, 2])]
    check = travel_check(JOB, cell, blocks, rods, motions, "x")
    assert np.flatnonzero(np.isfinite(check.values)).tolist() == [1, 3]
    assert (check.name, check.limit, check.hard) == ("travel", LIMIT, False)
    assert check.passed.all()
    assert " on the way to block " in check.note
    # A block that reaches to where the grippers stand: the way to it is not free, and no leaf is refused for that.
    wide = [replace(b, size_mm=np.array([1300.0, 900.0, 400.0])) for b in blocks]
    broken = travel_check(JOB, cell, wide, rods, motions, "x")
    assert not broken.passed[[1, 3]].any()
    assert refusals([broken], rods) == {}


def test_without_motions_nothing_is_known(straight):
    blocks, rods = straight
    check = collision_check(JOB, cell_from_job(JOB.cell), blocks, rods, [], "x")
    assert np.isnan(check.values).all()
    assert check.passed.all()


@pytest.fixture(scope="module")
def corner(made_surfaces):
    """A part of the example's wall of one block, and its job with few leaves."""
    wall, job = made_surfaces.example_wall()
    surface = made_surfaces.patch(wall, (600.0, 1200.0), (600.0, 1200.0))
    return surface, replace(job, leaves=replace(job.leaves, spacing_mm=100.0, max_turn_between_deg=180.0))


def free(plan):
    return next(c for c in plan.checks if c.name == "collision")


def test_the_examples_cell_stays_clear_and_the_plan_says_the_same_when_read_again(corner):
    surface, job = corner
    plan = plan_cut(job, surface)
    check = free(plan)
    cut = np.array([r.status == "ok" for r in plan.rods])
    assert cut.any()
    assert (check.values[cut] >= LIMIT).all()
    again = next(c for c in check_again(plan, job, surface) if c.name == "collision")
    np.testing.assert_array_equal(again.values[cut], check.values[cut])
    assert again.note == check.note


def test_a_table_in_the_way_refuses_the_leaves(corner):
    surface, job = corner
    # Nine metres of table: the arms' shoulders stand in it.
    plan = plan_cut(replace(job, cell=replace(job.cell, table_mm=(9000.0, 900.0))), surface)
    assert plan.motions == ()
    assert all(r.status == "refused" for r in plan.rods)
    reasons = {text for r in plan.rods for text in r.reasons}
    assert any(text.startswith("free distance of arms, grippers and rod -") for text in reasons)


def test_arms_too_near_to_each_other_refuse_the_leaves(corner):
    surface, job = corner
    thick = ArmJob(link_radii_mm=(350.0, 300.0, 180.0, 250.0, 150.0, 700.0))
    plan = plan_cut(replace(job, cell=replace(job.cell, left=thick, right=thick)), surface)
    assert all(r.status == "refused" for r in plan.rods)
    assert (free(plan).values < LIMIT).all()


def test_a_limit_of_ones_own(corner):
    surface, job = corner
    least = float(np.nanmin(free(plan_cut(job, surface)).values))
    strict = plan_cut(replace(job, cell=replace(job.cell, min_clearance_mm=least + 0.5)), surface)
    assert free(strict).limit == least + 0.5
    assert strict.refused_leaves
    assert CellJob().min_clearance_mm == LIMIT
