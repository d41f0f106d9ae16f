"""Turns of the leaves' planes: against what a parabola's curvature says, and by the checks of the whole cut."""

from dataclasses import replace

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.fabrication.cut import plan_cut
from batten.fabrication.job import (
    BladeJob,
    BlocksJob,
    CellJob,
    CutJob,
    GripperJob,
    KerfJob,
    LeavesJob,
    RodJob,
    SurfaceJob,
)
from batten.fabrication.leaf_planes import choose_planes, clearance
from batten.fabrication.wall import Wall
from batten.surfaces.rationalise import rationalise

MIN_BOW = 2.0
SIDE = 600.0


def job_with(direction="u", **leaves):
    return CutJob(
        SurfaceJob(),
        name="made",
        blocks=BlocksJob(direction=direction),
        leaves=LeavesJob(**{"spacing_mm": 60.0, "max_turn_between_deg": 90.0, "tolerance_mm": 2.0, **leaves}),
        rod=RodJob(length_mm=1000.0, min_bow_mm=MIN_BOW, min_stability_margin=1.02),
        blade=BladeJob(max_speed_ratio=100.0),
        kerf=KerfJob(offset=False),
        gripper=GripperJob(radius_mm=20.0, clearance_mm=5.0),
        cell=CellJob(min_joint_margin_deg=2.0),
    )


def chosen(job, surface, axis="x"):
    """The planes for a job, and a function that measures any others."""
    wall = Wall.of(surface, job.blocks.size_mm, axis)
    blocks = wall.blocks(job.blocks)

    def fit(planes, thorough):
        return rationalise(surface, planes, wall.edges(planes), job.leaves.tolerance_mm, inside=wall.contains)

    def measure(turn_deg, border_deg=None):
        border = None if border_deg is None else np.radians(border_deg)
        planes = wall.planes(job.leaves.spacing_mm, np.radians(turn_deg), border)
        return clearance(job, wall, blocks, fit(planes, True))

    return choose_planes(job, wall, blocks, fit), measure


def value(plan, name):
    return next(c for c in plan.checks if c.name == name).values


def angles(planes):
    return np.degrees([np.arctan2(p.x_axis[1], p.x_axis[0]) for p in planes])


@pytest.fixture(scope="module")
def trough(made_surfaces):
    """z = (y − 300)²/1000: every leaf along x is a straight line."""
    return made_surfaces.graph(lambda x, y: 1e-3 * (y - 300.0) ** 2 + 0.0 * x, (0.0, SIDE), (0.0, SIDE), (8, 8))


@pytest.fixture(scope="module")
def twist(made_surfaces):
    """Arches on one border, hollows on the other, between them one straight leaf, at y = 310, that no leaf of 60 mm hits."""
    return made_surfaces.graph(lambda x, y: 3e-6 * (y - 310.0) * (x - 300.0) ** 2, (0.0, SIDE), (0.0, SIDE), (8, 8))


def test_an_extruded_surface_is_turned_as_far_as_its_curvature_asks_for(trough) -> None:
    job = job_with(turn_deg="auto")
    family, measure = chosen(job, trough)
    # In planes turned by a the leaf's curvature is 2/1000 sin² a; an arc of length L bows by κL²/8.
    expected = np.degrees(np.arcsin(np.sqrt(8.0 * MIN_BOW / (2e-3 * job.rod.length_mm**2))))
    assert abs(family.turn_deg) == pytest.approx(expected, abs=0.1)
    assert angles(family.planes) == pytest.approx(np.full(len(family.planes), family.turn_deg), abs=1e-9)
    assert measure(family.turn_deg).bow_mm >= MIN_BOW
    assert measure(family.turn_deg - np.copysign(0.05, family.turn_deg)).bow_mm < MIN_BOW
    assert family.facts["least_bow_unturned_mm"] < 1e-6
    assert family.repair == f"planes turned by {family.turn_deg:g}°"


def test_the_turn_that_is_found_makes_a_cut_without_straight_rods(twist) -> None:
    straight = plan_cut(job_with(), twist)
    assert value(straight, "passes_straight").min() < 0.5, "no leaf is straight, but the blade passes a line"
    for planes in ("parallel", "fan"):
        plan = plan_cut(job_with(turn_deg="auto", planes=planes), twist)
        turn = plan.facts["turn_deg"]
        assert 0.0 < abs(turn) < 5.0
        assert value(plan, "straightness").min() >= MIN_BOW
        assert value(plan, "passes_straight").min() >= MIN_BOW
        margin = value(plan, "stability").min()
        assert plan.facts.get("least_stability_margin_turned", np.inf) == pytest.approx(margin, rel=1e-9)
        assert plan.facts["least_bow_turned_mm"] == pytest.approx(value(plan, "straightness").min(), rel=1e-6)
        assert plan.facts["least_bow_between_turned_mm"] == pytest.approx(
            value(plan, "passes_straight").min(), rel=1e-6
        )
        # Written down, the turn gives the same cut; with 0.05° less there is a straight rod again.
        again = plan_cut(job_with(turn_deg=turn, planes=planes), twist)
        assert [r.rod for r in again.rods] == [r.rod for r in plan.rods]
        less = plan_cut(job_with(turn_deg=turn - np.copysign(0.05, turn), planes=planes), twist)
        assert min(value(less, "straightness").min(), value(less, "passes_straight").min()) < MIN_BOW


def test_a_fan_leaves_curved_borders_alone_and_turns_straight_ones(twist, trough) -> None:
    family, _ = chosen(job_with(turn_deg="auto", planes="fan"), twist)
    assert family.border_turn_deg == 0.0
    found = angles(family.planes)
    assert found[[0, -1]].tolist() == [0.0, 0.0]
    assert found[np.abs(found).argmax()] == pytest.approx(family.turn_deg, abs=1e-9)
    assert [p.origin[1] for p in (family.planes[0], family.planes[-1])] == pytest.approx([0.0, SIDE], abs=1e-6)
    assert "like a fan" in family.repair
    turned, measure = chosen(job_with(turn_deg="auto", planes="fan"), trough)
    assert turned.border_turn_deg == pytest.approx(0.5 * abs(turned.turn_deg))
    assert measure(turned.turn_deg, turned.border_turn_deg).bow_mm >= MIN_BOW
    # The border planes are the least turned ones: they ask for as much as planes turned alike.
    alike, _ = chosen(job_with(turn_deg="auto"), trough)
    assert turned.border_turn_deg == pytest.approx(abs(alike.turn_deg), abs=0.3)


@pytest.mark.parametrize("direction", ["u", "v"])
def test_the_blade_may_lie_either_way(made_surfaces, direction) -> None:
    along = (lambda x, y: y) if direction == "u" else (lambda x, y: x)
    surface = made_surfaces.graph(lambda x, y: 1e-3 * (along(x, y) - 300.0) ** 2, (0.0, SIDE), (0.0, SIDE), (8, 8))
    plan = plan_cut(job_with(direction, turn_deg="auto", planes="fan"), surface)
    assert value(plan, "straightness").min() >= MIN_BOW
    assert np.nanmax(value(plan, "deviation")) < 2.0
    leaves = [r.leaf for r in plan.rods]
    assert leaves == sorted(leaves)


def test_a_fan_over_several_blocks_is_a_whole_cut(made_surfaces) -> None:
    def height(x, y):
        return 40.0 * np.sin(x / 110.0) * np.cos(y / 260.0) + 0.15 * x + 2e-4 * (y - 200.0) ** 2 + x**2 / 3000.0

    surface = made_surfaces.graph(height, (0.0, 640.0), (0.0, 400.0), (22, 14))
    job = replace(
        job_with(turn_deg=9.0, planes="fan", border_turn_deg=3.0, spacing_mm=50.0, tolerance_mm=0.35),
        blocks=BlocksJob(size_mm=(320.0, 200.0), direction="u"),
    )
    job = replace(job, rod=replace(job.rod, length_mm=520.0))
    plan = plan_cut(job, surface)
    turned = angles([r.plane for r in plan.rods])
    assert [turned.min(), turned.max()] == pytest.approx([3.0, 9.0])
    assert plan.facts["border_turn_deg"] == 3.0
    assert np.nanmax(value(plan, "deviation")) <= 0.35
    assert np.nanmax(value(plan, "jump")) < 0.01
    for block in plan.blocks:
        rods = [r for r in plan.rods if r.block == block.number]
        # In cutting order: each later rod's plane is ahead at every point of the block.
        low, high = block.corner_mm[:2], block.corner_mm[:2] + block.size_mm[:2]
        points = np.random.default_rng(0).uniform(low, high, (200, 2))
        ahead = np.array([(points - r.plane.origin[:2]) @ -r.plane.normal[:2] for r in rods])
        assert (np.diff(ahead, axis=0) < 0.0).all()
        assert (ahead[0] > -1e-6).all()
        assert (ahead[-1] < 1e-6).all()
        assert -np.diff(ahead, axis=0).min() <= 50.0 * 1.01


def test_what_cannot_be_turned(made_surfaces, twist) -> None:
    flat = made_surfaces.graph(lambda x, y: 0.1 * x + 0.2 * y, (0.0, SIDE), (0.0, SIDE), (8, 8))
    family, _ = chosen(job_with(turn_deg="auto", spacing_mm=200.0), flat)
    assert family.turn_deg == 0.0, "a plane stays a plane, however it is cut"
    curved = made_surfaces.graph(lambda x, y: -1e-3 * (x - 300.0) ** 2 + 0.0 * y, (0.0, SIDE), (0.0, SIDE), (8, 8))
    family, _ = chosen(job_with(turn_deg="auto"), curved)
    assert (family.turn_deg, family.repair) == (0.0, "")
    with pytest.raises(InvalidInputError, match="turn the borders more"):
        plan_cut(job_with(turn_deg=60.0, planes="fan", border_turn_deg=0.0), twist)
    with pytest.raises(InvalidInputError, match=r"leaves.border_turn_deg = 3 with leaves.turn_deg = 2; .* try 1"):
        plan_cut(job_with(turn_deg=2.0, planes="fan", border_turn_deg=3.0), twist)
