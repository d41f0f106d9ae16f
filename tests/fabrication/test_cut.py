"""Small jobs from surface to plan: what is cut, what is refused and why, and that a plan follows its surface."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.fabrication.cut import check_again, plan_cut
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
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.deviation import surface_deviation

SIDE = 1200.0


@pytest.fixture(scope="session")
def relief(made_surfaces):
    """The middle 1.2 × 1.2 m of the example's wall, and its job with few leaves."""
    wall, job = made_surfaces.example_wall()
    surface = made_surfaces.patch(wall, (600.0, 600.0 + SIDE), (600.0, 600.0 + SIDE))
    u = np.linspace(600.0, 1800.0, 7)
    assert surface.point(u, u[::-1]) == pytest.approx(wall.point(u / 300.0, u[::-1] / 300.0), abs=1e-9)
    return surface, with_(job, "leaves", spacing_mm=60.0, tolerance_mm=1.0, max_turn_between_deg=40.0)


@pytest.fixture(scope="session")
def plan(relief):
    surface, job = relief
    return plan_cut(job, surface)


def with_(job, part, **values):
    """The job with other values in one part."""
    return replace(job, **{part: replace(getattr(job, part), **values)})


def check(plan, name):
    return next(c for c in plan.checks if c.name == name)


def by_leaf(plan, name):
    """The worst value of each leaf, {leaf: value}, over the rods to which the check applies."""
    c = check(plan, name)
    worst = {}
    for rod, value in zip(plan.rods, c.values):
        if np.isfinite(value):
            pick = max if c.sense == "max" else min
            worst[rod.leaf] = pick(worst.get(rod.leaf, value), value)
    return worst


def in_motions(plan):
    return {plan.rods[i].leaf for motion in plan.motions for i in motion.rods}


def all_leaves(plan):
    return {r.leaf for r in plan.rods}


def assert_motions_hold_the_kept_rods(plan) -> None:
    """Every rod that is kept is moved once, in its own block, in the plan's order; and no other is."""
    moved = [i for motion in plan.motions for i in motion.rods]
    assert moved == [i for i, r in enumerate(plan.rods) if r.status == "ok"]
    for motion in plan.motions:
        assert {plan.rods[i].block for i in motion.rods} == {motion.block}
        for arm in (motion.left, motion.right):
            assert len(arm.poses) == len(arm.joints_rad) == len(motion.rods)
            assert np.isfinite(arm.joints_rad).all()
    assert plan.refused_leaves == tuple(sorted(all_leaves(plan) - in_motions(plan)))
    for rod in plan.rods:
        assert (rod.status == "refused") == bool(rod.reasons) == (rod.leaf in plan.refused_leaves)


# --- a whole cut ---


def test_a_whole_cut(relief, plan) -> None:
    surface, job = relief
    assert plan.refused_leaves == ()
    assert all(c.passed.all() for c in plan.checks if c.hard)
    assert_motions_hold_the_kept_rods(plan)
    assert len(plan.blocks) == 4
    assert plan.blade_axis == "x"
    assert plan.direction_reason == "the job asks for u, which runs along wall x"
    for rod in plan.rods:
        block = plan.block(rod.block)
        low, high = block.corner_mm, block.corner_mm + block.size_mm
        ends = rod.plane.to_world(rod.piece.point_at([0.0, rod.piece.length]))
        assert ends[:, 0] == pytest.approx([low[0], high[0]], abs=1e-8), "from border to border"
        assert rod.rod.length == pytest.approx(job.rod.length_mm, abs=1e-9)
        assert rod.rod.point_at(rod.before_mm) == pytest.approx(rod.piece.start, abs=1e-8)
        wanted = rod.plane.to_world(rod.design)[1:-1]
        over = wanted[
            ((wanted > surface.control_points[0, 0] + 1.0) & (wanted < surface.control_points[-1, -1] - 1.0))[
                :, :2
            ].all(1)
        ]
        away = surface_deviation(surface, over, extend=0.1).signed
        assert away == pytest.approx(np.full(len(over), 0.5 * job.blade.kerf_mm), abs=0.01)
        assert all(
            (p[1:] < low[1:]).any() or (p[1:] > high[1:]).any() or not low[0] < p[0] < high[0]
            for p in (g.position_mm for g in rod.grippers())
        )


def test_a_flat_strip_is_cut_without_turning_it(relief, plan) -> None:
    surface, job = relief
    strip = with_(job, "rod", diameter_mm=None, width_mm=12.0, thickness_mm=1.5)
    flat = plan_cut(strip, surface)
    assert [r.rod for r in flat.rods] == [r.rod for r in plan.rods], "the section has no say in the shape"
    assert check(flat, "strain").values == pytest.approx(0.5 * check(plan, "strain").values, rel=1e-12)
    assert all((arm.spin_rad == 0.0).all() for motion in flat.motions for arm in (motion.left, motion.right))
    assert any((arm.spin_rad != 0.0).any() for motion in plan.motions for arm in (motion.left, motion.right))


def test_poses_are_the_rods_ends_in_the_work_frame(plan) -> None:
    for motion in plan.motions:
        pose = plan.block(motion.block).work_frame(plan.blade_axis)
        for arm, side, sign in ((motion.left, 0, 1.0), (motion.right, 1, -1.0)):
            for matrix, i in zip(arm.poses, motion.rods):
                gripper = plan.rods[i].grippers()[side]
                world = pose @ matrix
                assert world[:3, 3] == pytest.approx(gripper.position_mm, abs=1e-9)
                assert world[:3, 2] == pytest.approx(sign * gripper.tangent, abs=1e-9)


def test_facts_agree_with_the_plan(relief, plan) -> None:
    _, job = relief
    facts = plan.facts
    assert facts["blocks"] == facts["rows"] * facts["columns"] == len(plan.blocks) == 4
    assert (facts["rods"], facts["leaves"]) == (len(plan.rods), len(all_leaves(plan)))
    assert facts["refused_leaves"] == 0
    assert facts["turn_deg"] == 3.0
    assert facts["repaired_leaves"] == len({r.leaf for r in plan.rods if len(r.repair) == 2})
    assert facts["longest_piece_mm"] == pytest.approx(max(r.piece.length for r in plan.rods))
    assert facts["worst_deviation_before_repair_mm"] >= 0.99 * np.nanmax(check(plan, "hausdorff").values)
    seconds = 0.0
    for motion in plan.motions:
        ends = np.array([[g.position_mm for g in plan.rods[i].grippers()] for i in motion.rods])
        seconds += np.linalg.norm(np.diff(ends, axis=0), axis=2).max(axis=1).sum() / job.blade.speed_mm_s
    assert facts["cut_time_s"] == pytest.approx(seconds, rel=1e-12)


def test_speeds_follow_from_the_kerfs_law(relief, plan) -> None:
    surface, job = relief
    kerf = KerfJob(formula="a + b / v", a=0.4, b=12.0, tolerance_mm=0.3)
    got = plan_cut(replace(job, kerf=kerf), surface)
    assert_motions_hold_the_kept_rods(got)
    assert all(c.passed.all() for c in got.checks if c.hard), "the joints too keep to their speeds"
    for old, new in zip(plan.rods, got.rods, strict=True):
        assert np.array_equal(old.rod.parameters, new.rod.parameters), "speed has no say in the shape"
    assert got.facts["cut_time_s"] == pytest.approx(sum(m.seconds[1:-1].sum() for m in got.motions))
    # By hand: ways of the rod's own points within the piece, less their parts along the blade.
    uneven, worst = check(got, "kerf").values, np.zeros(len(got.rods))
    before = np.zeros(len(got.rods))
    for motion, plain in zip(got.motions, plan.motions, strict=True):
        for k, (i, j) in enumerate(pairwise(motion.rods)):
            one, two = got.rods[i], got.rods[j]
            s = np.linspace(max(one.before_mm, two.before_mm), min(r.before_mm + r.piece.length for r in (one, two)), 9)
            d = two.plane.to_world(two.rod.point_at(s)) - one.plane.to_world(one.rod.point_at(s))
            angle = 0.5 * (one.rod.angle_at(s) + two.rod.angle_at(s))
            t = np.cos(angle)[:, None] * one.plane.x_axis + np.sin(angle)[:, None] * [0.0, 0.0, 1.0]
            middle = one.plane.to_world(one.rod.point_at(s)) + 0.5 * d
            block = got.block(one.block)
            inside = ((middle >= block.corner_mm) & (middle <= block.corner_mm + block.size_mm))[:, :2].all(axis=1)
            way = np.linalg.norm(np.cross(d, t), axis=1)[inside]
            for motions_of, most in ((motion, worst), (plain, before)):
                off = np.abs(0.4 + 12.0 * motions_of.seconds[1:-1][k] / way - 1.0).max(initial=0.0)
                most[[i, j]] = np.maximum(most[[i, j]], off)
    known = np.isfinite(uneven)
    assert (worst[known] <= uneven[known] + 1e-3).all()
    assert np.median(uneven[known] - worst[known]) < 0.01
    assert worst.max() < 0.5 * before.max(), "at constant speed the kerf is more uneven"


def test_stages_are_told_in_order_and_to_the_end(made_surfaces) -> None:
    told = []
    surface = made_surfaces.graph(lambda x, y: 60.0 * np.sin(x / 190.0) + 0.02 * y, (0, 600), (0, 600), (20, 8))
    plan_cut(analytic_job(spacing_mm=150.0), surface, progress=lambda *what: told.append(what))
    stages = list(dict.fromkeys(stage for stage, _, _ in told))
    assert stages[0] == "fit elastica to the leaves"
    assert stages[-2:] == ["check the rods", "plan the robots"]
    for stage in stages:
        done = [(d, of) for s, d, of in told if s == stage]
        assert done[-1][0] == done[-1][1]


# --- leaves that are refused ---


@pytest.mark.parametrize(
    ("name", "part", "field", "says"),
    [
        ("strain", "rod", "max_strain", "strain on the whole rod"),
        ("straightness", "rod", "min_bow_mm", "bow of the rod over its chord"),
        ("gripper_moment", "gripper", "max_moment_nmm", "bending moment"),
    ],
)
def test_a_limit_refuses_exactly_the_leaves_that_break_it(relief, plan, name, part, field, says) -> None:
    surface, job = relief
    ordered = sorted(by_leaf(plan, name).values(), reverse=check(plan, name).sense == "min")
    limit = 0.5 * (ordered[-4] + ordered[-3])  # three leaves are beyond it
    got = plan_cut(with_(job, part, **{field: float(limit)}), surface)
    worst = by_leaf(got, name)
    beyond = {leaf for leaf, value in worst.items() if (value > limit) == (check(plan, name).sense == "max")}
    # Where the rod lies also depends on the least bow that it must keep: that may save a leaf.
    assert 1 <= len(beyond) <= 3 if name == "straightness" else len(beyond) == 3
    assert set(got.refused_leaves) == beyond
    assert_motions_hold_the_kept_rods(got)
    for rod in got.rods:
        if rod.leaf in beyond:
            assert len(rod.reasons) == 1
            assert rod.reasons[0].lower().startswith(says)
            assert f"{worst[rod.leaf]:.3g}" in rod.reasons[0]
            at_fault = int(rod.reasons[0].split("block ")[1].split()[0])
            assert any(
                r.leaf == rod.leaf and r.block == at_fault and v == worst[rod.leaf]
                for r, v in zip(got.rods, check(got, name).values)
            )
    assert got.facts["refused_leaves"] == len(beyond)
    # Their neighbours are the same pieces as before.
    for old, new in zip(plan.rods, got.rods, strict=True):
        assert np.array_equal(old.piece.parameters, new.piece.parameters)
    assert [r.leaf for r in got.rods if r.status == "ok"] == [r.leaf for r in plan.rods if r.leaf not in beyond]


def analytic_job(**leaves):
    """Robots that have room, blocks of 600 mm and no limits that these surfaces come near to."""
    return CutJob(
        SurfaceJob(),
        name="made",
        blocks=BlocksJob(direction="u"),
        leaves=LeavesJob(**{"spacing_mm": 60.0, "max_turn_between_deg": 90.0, **leaves}),
        rod=RodJob(length_mm=1000.0, min_bow_mm=0.0),
        blade=BladeJob(max_speed_ratio=100.0),
        gripper=GripperJob(radius_mm=20.0, clearance_mm=5.0),
        cell=CellJob(min_joint_margin_deg=2.0),
    )


def test_leaves_too_wavy_for_an_elastica_are_refused_for_their_deviation(made_surfaces) -> None:
    # Three waves within the block, 6 mm high at y = 300 and gone 150 mm from there: no elastica comes near.
    def height(x, y):
        wave = 6.0 * np.exp(-(((y - 300.0) / 60.0) ** 2)) * np.sin(np.pi * x / 100.0)
        return 80.0 * np.sin(np.pi * x / 600.0) + wave

    surface = made_surfaces.graph(height, (0.0, 600.0), (0.0, 600.0), (30, 26))
    got = plan_cut(analytic_job(tolerance_mm=1.5), surface)
    assert len(got.rods) == 11
    # The wave's own height bounds what an elastica can do: half-way between its crests.
    waves = {r.leaf: 6.0 * np.exp(-(((r.plane.origin[1] - 300.0) / 60.0) ** 2)) for r in got.rods}
    assert {leaf for leaf, h in waves.items() if h > 3.0} <= set(got.refused_leaves)
    assert not {leaf for leaf, h in waves.items() if h < 1.0} & set(got.refused_leaves)
    deviation = check(got, "deviation")
    for rod, value in zip(got.rods, deviation.values):
        points = rod.plane.to_world(rod.piece.point_at(np.linspace(0.0, rod.piece.length, 401)))
        off = np.abs(points[:, 2] - height(*points[:, :2].T)).max()
        assert value <= off * 1.01 + 1e-3
        assert (value > 1.5) == (rod.leaf in got.refused_leaves)
        if rod.status == "refused":
            assert any(
                x.startswith(f"greatest deviation from the surface {value:.3g} mm > 1.5 mm") for x in rod.reasons
            )
            assert any("border points moved" in x for x in rod.repair), "it was tried"
    assert 1 <= len(got.refused_leaves) <= 5
    assert_motions_hold_the_kept_rods(got)


def test_straight_leaves_are_refused_and_a_turn_of_the_planes_makes_them(made_surfaces) -> None:
    # The example's own corner: its border at y = 0 is a straight line (Fisker2018 §5.4.3, Solution 1).
    wall, job = made_surfaces.example_wall()
    surface = made_surfaces.patch(wall, (0.0, 1200.0), (0.0, 600.0))
    job = with_(with_(job, "leaves", tolerance_mm=6.0, spacing_mm=100.0, turn_deg=0.0), "rod", min_bow_mm=5.0)
    job = with_(with_(job, "leaves", max_turn_between_deg=180.0), "kerf", offset=False)
    straight = plan_cut(job, surface)
    first = min(all_leaves(straight))
    assert first in straight.refused_leaves
    bow = by_leaf(straight, "straightness")
    assert bow[first] == pytest.approx(0.0, abs=1e-6)
    refused = next(r for r in straight.rods if r.leaf == first)
    assert any(x.startswith("bow of the rod over its chord ") and "< 5 mm" in x for x in refused.reasons)
    turned = plan_cut(with_(job, "leaves", turn_deg="auto"), surface)
    turn = turned.facts["turn_deg"]
    assert 0.0 < abs(turn) < 3.0
    assert min(by_leaf(turned, "straightness").values()) >= 5.0
    assert min(by_leaf(turned, "passes_straight").values()) >= 5.0
    assert all(r.repair[0] == f"planes turned by {turn:g}°" for r in turned.rods)
    angles = {round(float(np.degrees(np.arctan2(r.plane.x_axis[1], r.plane.x_axis[0]))), 9) for r in turned.rods}
    assert angles == {turn}
    assert not any("bow" in x for r in turned.rods for x in r.reasons)


def test_auto_leaves_planes_alone_where_no_leaf_is_straight(relief, plan) -> None:
    surface, job = relief
    got = plan_cut(with_(job, "leaves", turn_deg="auto"), surface)
    assert got.facts["turn_deg"] == 0.0
    assert not any("turned" in x for r in got.rods for x in r.repair)


def test_leaves_out_of_reach_are_refused_and_the_others_planned_again(relief, plan) -> None:
    surface, job = relief
    job = with_(job, "cell", min_joint_margin_deg=40.0)
    got = plan_cut(job, surface)
    assert 0 < len(got.refused_leaves) < len(all_leaves(got))
    assert_motions_hold_the_kept_rods(got)
    margins = check(got, "joint_limits")
    assert margins.limit == pytest.approx(40.0)
    for rod, value in zip(got.rods, margins.values):
        if rod.status == "ok":
            assert value >= 40.0
    for leaf in got.refused_leaves:
        reason = next(r.reasons for r in got.rods if r.leaf == leaf)
        assert reason[0].startswith("distance of the joints from their limits ")
        assert "° < 40° in block" in reason[0]
        assert by_leaf(got, "joint_limits")[leaf] < 40.0, "the value that refused it is kept"
    # The checks of what is kept are those of the final motions.
    again = check_again(got, job, surface)
    kept = np.array([r.status == "ok" for r in got.rods])
    assert [c.name for c in again] == [c.name for c in got.checks]
    for old, new in zip(got.checks, again):
        assert np.array_equal(old.values[kept], new.values[kept], equal_nan=True), old.name
        assert all(old.passed[kept]) or not old.hard


def test_a_plan_is_checked_again_to_the_same_numbers(relief, plan) -> None:
    surface, job = relief
    for old, new in zip(plan.checks, check_again(plan, job, surface), strict=True):
        assert (old.name, old.limit, old.sense) == (new.name, new.limit, new.sense)
        assert np.array_equal(old.values, new.values, equal_nan=True), old.name


def test_a_leaf_beyond_the_reach_of_an_arm(relief) -> None:
    surface, job = relief
    got = plan_cut(with_(job, "cell", min_reach_margin_mm=505.0), surface)
    assert 0 < len(got.refused_leaves) < len(all_leaves(got))
    assert_motions_hold_the_kept_rods(got)
    assert all(any(x.startswith("reach of the robots ") for x in r.reasons) for r in got.rods if r.status == "refused")


@pytest.mark.parametrize(("part", "values"), [("rod", {"min_bow_mm": 1e4}), ("cell", {"min_joint_margin_deg": 120.0})])
def test_a_plan_may_have_nothing_left(relief, part, values) -> None:
    surface, job = relief
    got = plan_cut(with_(job, part, **values), surface)
    assert set(got.refused_leaves) == all_leaves(got)
    assert got.motions == ()
    assert got.facts["cut_time_s"] == 0.0
    assert all(r.reasons for r in got.rods)
    assert ("joint_limits" in [c.name for c in got.checks]) == (part == "cell")


# --- leaves between, and directions ---


def test_leaves_are_put_between_where_the_rods_ends_turn_too_much(relief, plan) -> None:
    surface, job = relief

    def turns(got):
        """Greatest turn of an end from leaf to leaf, in every block, by atan2 of the tangents; (places, turns)."""
        places, most = [], []
        for block in got.blocks:
            rods = [r for r in got.rods if r.block == block.number]
            for a, b in pairwise(rods):
                spares = [job.rod.length_mm - r.piece.length for r in (a, b)]
                ends = [
                    [r.piece.angle_at(-0.5 * s), r.piece.angle_at(r.piece.length + 0.5 * s)]
                    for r, s in zip((a, b), spares)
                ]
                most.append(np.degrees(np.abs(np.subtract(*ends)).max()))
                places.append(0.5 * (offset(a) + offset(b)))
        return np.array(places), np.array(most)

    def offset(rod):
        return float(-rod.plane.normal @ rod.plane.origin)

    places, before = turns(plan)
    limit = 3.0
    assert (before > limit).any()
    assert (before < limit).any()
    fine = with_(job, "leaves", max_turn_between_deg=limit)
    got = plan_cut(with_(fine, "rod", min_bow_mm=0.0), surface)
    _, after = turns(got)
    assert after.max() <= limit
    old, new = ({round(offset(r), 6): r for r in p.rods} for p in (plan, got))
    assert set(old) < set(new)
    extra = sorted(set(new) - set(old))
    ordered = np.array(sorted(old))
    gaps = np.searchsorted(ordered, extra)
    wide = ordered[gaps] - ordered[gaps - 1]
    shares = (np.array(extra) - ordered[gaps - 1]) / wide * 8.0
    assert shares == pytest.approx(np.round(shares), abs=1e-3), "half-way, and half-way again"
    worst = {round(p, 3): b for p, b in zip(places[np.argsort(before)], np.sort(before))}
    for gap in set(gaps.tolist()):
        middle = round(0.5 * (ordered[gap] + ordered[gap - 1]), 3)
        assert worst[middle] > limit, "none is put where there is no need"
    assert all(np.diff([r.leaf for r in got.rods if r.block == 1]) == 1), "numbered anew, in cutting order"
    # One of them is too straight for the job's rod: there the turn is taken in one step, and nothing is refused.
    assert min(by_leaf(got, "straightness").values()) < job.rod.min_bow_mm
    careful = plan_cut(fine, surface)
    assert careful.refused_leaves == ()
    assert len(all_leaves(careful)) < len(all_leaves(got))
    assert turns(careful)[1].max() > limit


@pytest.mark.parametrize("axis", ["x", "y"])
def test_auto_takes_the_direction_in_which_the_leaves_are_elastica(made_surfaces, axis) -> None:
    # Along one axis all leaves are one parabola, nearly an elastica; along the other they have three waves to a block.
    def height(along, across):
        return 100.0 * (along / 600.0 - 0.5) ** 2 + 15.0 * np.sin(across / 30.0)

    surface = made_surfaces.graph(
        (lambda x, y: height(x, y)) if axis == "x" else (lambda x, y: height(y, x)), (0, 600), (0, 600), (26, 26)
    )
    job = analytic_job(tolerance_mm=1.0, spacing_mm=100.0)
    got = plan_cut(with_(job, "blocks", direction="auto"), surface)
    other = "y" if axis == "x" else "x"
    assert got.blade_axis == axis
    assert f" 0 pieces miss the tolerance before repair along wall {axis}" in got.direction_reason
    assert f"along wall {other}" in got.direction_reason
    assert got.facts["pieces_outside_tolerance_before_repair"] == 0
    asked = plan_cut(with_(job, "blocks", direction="v" if axis == "x" else "u"), surface)
    assert asked.blade_axis == other
    assert asked.facts["pieces_outside_tolerance_before_repair"] == len(asked.rods)


# --- errors ---


def test_a_rod_shorter_than_a_leaf(relief) -> None:
    surface, job = relief
    with pytest.raises(InvalidInputError, match="rod of 610 mm is shorter than a leaf"):
        plan_cut(with_(job, "rod", length_mm=610.0), surface)


def test_a_block_too_low_for_its_relief(relief) -> None:
    surface, job = relief
    with pytest.raises(InvalidInputError, match=r"block \d needs a height of"):
        plan_cut(with_(job, "blocks", height_mm=200.0), surface)


def test_a_surface_that_does_not_reach_over_its_plan(made_surfaces) -> None:
    # A plan in the shape of a lozenge: the corners of its rectangle have no surface.
    net = [[(0.0, 600.0, 0.0), (600.0, 1200.0, 90.0)], [(600.0, 0.0, 80.0), (1200.0, 600.0, 0.0)]]
    lozenge = BSplineSurface([0, 0, 1, 1], [0, 0, 1, 1], 1, 1, net)
    with pytest.raises(InvalidInputError, match=r"leaf \d+ has no elastica in block \d+.*plan is a rectangle"):
        plan_cut(analytic_job(), lozenge)


# --- a plan follows its surface ---


@pytest.fixture(scope="module")
def hilly(made_surfaces):
    def height(x, y):
        return 40.0 * np.sin(x / 110.0) * np.cos(y / 260.0) + 0.15 * x + 2e-4 * (y - 200.0) ** 2 + x**2 / 3000.0

    return made_surfaces.graph(height, (0.0, 640.0), (0.0, 400.0), (22, 14))


def hilly_job(**leaves):
    job = analytic_job(spacing_mm=80.0, tolerance_mm=0.35, turn_deg=4.0)
    job = with_(job, "leaves", **leaves)
    job = with_(job, "gripper", radius_mm=12.0, clearance_mm=3.0)
    return with_(with_(job, "blocks", size_mm=(320.0, 400.0)), "rod", length_mm=520.0)


def scaled_job(job, k):
    job = with_(
        job, "blocks", size_mm=tuple(k * s for s in job.blocks.size_mm), clearance_mm=k * job.blocks.clearance_mm
    )
    job = with_(job, "leaves", spacing_mm=k * job.leaves.spacing_mm, tolerance_mm=k * job.leaves.tolerance_mm)
    job = with_(job, "rod", length_mm=k * job.rod.length_mm, diameter_mm=k * job.rod.diameter_mm)
    job = with_(job, "blade", kerf_mm=k * job.blade.kerf_mm)
    return with_(job, "gripper", radius_mm=k * job.gripper.radius_mm, clearance_mm=k * job.gripper.clearance_mm)


def test_twice_the_surface_gives_twice_the_plan(hilly) -> None:
    job, k = hilly_job(), 2.0
    small, large = plan_cut(job, hilly), plan_cut(scaled_job(job, k), hilly.scaled(k))
    assert any(len(r.repair) == 2 for r in small.rods), "joints are moved too"
    assert [(r.block, r.leaf) for r in small.rods] == [(r.block, r.leaf) for r in large.rods]
    for a, b in zip(small.blocks, large.blocks):
        assert b.corner_mm == pytest.approx(k * a.corner_mm, abs=1e-9)
        assert b.size_mm == pytest.approx(k * a.size_mm, abs=1e-9)
    for a, b in zip(small.rods, large.rods):
        t = np.linspace(0.0, 1.0, 9)
        points = [r.plane.to_world(r.rod.point_at(t * r.rod.length)) for r in (a, b)]
        assert points[1] == pytest.approx(k * points[0], abs=2e-3)
    for name, power in (("deviation", 1), ("hausdorff", 1), ("straightness", 1), ("strain", 0), ("gripper_moment", 3)):
        a, b = (check(p, name).values for p in (small, large))
        assert b == pytest.approx(k**power * a, rel=1e-4, abs=2e-3, nan_ok=True), name


@pytest.mark.parametrize(
    ("mirror", "turn"), [((-1.0, 1.0, 1.0), -4.0), ((1.0, -1.0, 1.0), -4.0), ((1.0, 1.0, -1.0), 4.0)], ids="xyz"
)
def test_a_mirrored_surface_gives_the_mirrored_plan(hilly, mirror, turn) -> None:
    plain = plan_cut(hilly_job(), hilly)
    job = with_(hilly_job(turn_deg=turn), "kerf", side="upper" if mirror[2] < 0.0 else "lower")
    mirrored = plan_cut(job, hilly.transformed(np.diag([*mirror, 1.0])))
    assert len(plain.rods) == len(mirrored.rods)

    def places(p, sign):
        """Deviation, strain and bow of every rod by the middle of its piece in plan."""
        found = {}
        for i, r in enumerate(p.rods):
            ends = r.plane.to_world(r.piece.point_at([0.0, r.piece.length]))[:, :2]
            key = tuple((ends.mean(axis=0) * sign[:2]).round(3) + 0.0)
            found[key] = [check(p, name).values[i] for name in ("deviation", "strain", "straightness", "hausdorff")]
        return found

    a, b = places(plain, (1.0, 1.0)), places(mirrored, mirror)
    assert sorted(a) == sorted(b)
    assert np.array([b[k] for k in a]) == pytest.approx(np.array(list(a.values())), rel=1e-3, abs=1e-5, nan_ok=True)
