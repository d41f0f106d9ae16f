"""Rods that do not stay in their shape, rods that hardly do, and pairs of leaves between which the rod jumps."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar
from scipy.special import ellipe, ellipk

from batten.curves.elastica import Elastica
from batten.fabrication.checks.run import refusals
from batten.fabrication.checks.stability import stability_checks
from batten.fabrication.job import CutJob, GripperJob, RodJob, SurfaceJob
from batten.fabrication.plan import CutPlan
from batten.io.cut_check import compare_checks
from batten.io.cut_json import read_cut_json, write_cut_json
from batten.io.report_numbers import worst_rod
from batten.solvers.discrete_rod import DiscreteRod
from batten.solvers.track import RodTracker

LENGTH = 1000.0
JOB = CutJob(SurfaceJob())


def arch(slack, up=True):
    """The first buckled shape of a clamped rod whose ends lie on one line, at a chord of (1 − slack)·LENGTH."""
    k = brentq(lambda k: 2.0 - 2.0 * ellipe(k * k) / ellipk(k * k) - slack, 1e-9, 0.5, xtol=1e-15)
    period = 4.0 * float(ellipk(k * k))
    above = Elastica.from_modulus(k, 0.0, period, LENGTH / period)
    placed = Elastica((0.0, 200.0), 0.0, above.start_curvature, (above.force[0], 0.0), LENGTH)
    assert placed.point_at(LENGTH) == pytest.approx([LENGTH * (1.0 - slack), 200.0], abs=1e-6)
    assert placed.angle_at(LENGTH) == pytest.approx(0.0, abs=1e-9)
    return placed if up else Elastica(placed.start, 0.0, -placed.start_curvature, placed.force, LENGTH)


def fold_turn(slack):
    """At which turn of one end a flat arch with ends on one line flips: from beam theory, for small slack.

    y = τ g with g⁗ + w² g″ = 0, g = g′ = 0 at the start, g = 0 and g′ = 1 at the end; τ² ∫g′² = 2 slack at length 1. The
    fold is the greatest τ between the buckled arch (w = 2π, τ = 0) and the load 8.9868 where g′ is unbounded again.
    """
    x = np.linspace(0.0, 1.0, 4001)

    def turn(w):
        system = [[np.cos(w) - 1.0, np.sin(w) - w], [-w * np.sin(w), w * np.cos(w) - w]]
        a, b = np.linalg.solve(system, [0.0, 1.0])
        slope = -a * w * np.sin(w * x) + b * w * (np.cos(w * x) - 1.0)
        return np.sqrt(2.0 * slack / np.trapezoid(slope**2, x))

    return turn(minimize_scalar(lambda w: -turn(w), bounds=(2.0 * np.pi + 1e-6, 8.98), method="bounded").x)


def turned(elastica, angle):
    """The shape that the rod takes when its end is turned by `angle`, in small steps; it must not snap."""
    pose = np.array([*elastica.start, elastica.start_angle, *elastica.point_at(LENGTH), elastica.angle_at(LENGTH)])
    tracker = RodTracker(LENGTH, solution=elastica)
    for share in np.linspace(0.0, 1.0, 21):
        state = tracker.move(np.append(pose[:5], pose[5] + share * angle))
        assert state.snap is None
    return state.elastica


def checks_of(hand, elasticas, job=JOB):
    """The four checks of whole rods in successive leaves of one block; the piece is the middle."""
    rods = [
        hand.place(rod.extended(-200.0, -200.0), leaf=7 + i, plane=hand.vertical(20.0 * i), block=1)
        for i, rod in enumerate(elasticas)
    ]
    context = hand.context(rods, job=job)
    return {check.name: check for check in stability_checks(context)}, rods


def of_margin(margin):
    """A rod of LENGTH whose curve is stable up to margin·LENGTH: an arch continued at its end.

    How far the arch can be continued is found by the second variation of a polyline, which shares nothing with the solver.
    """
    return stretched(0.02, how_far_stable() / margin)


@cache
def how_far_stable():
    return brentq(lambda factor: least_of_polyline(0.02, factor), 1.05, 1.6, xtol=1e-4)


def stretched(slack, factor):
    """The arch, continued to `factor` times its length, then scaled to LENGTH."""
    base = arch(slack)
    more = base.extended(0.0, (factor - 1.0) * LENGTH)
    return Elastica((0.0, 200.0), 0.0, more.start_curvature * factor, np.multiply(more.force, factor**2), LENGTH)


def least_of_polyline(slack, factor, n=400):
    """Least eigenvalue of ∫v′² − λ cos ψ v² with v = 0 at both ends and both ends' points held, by finite differences."""
    rod = stretched(slack, factor)
    h = LENGTH / n
    angle = rod.angle_at(np.arange(1, n) * h)
    matrix = (2.0 * np.eye(n - 1) - np.eye(n - 1, k=1) - np.eye(n - 1, k=-1)) / h**2
    matrix -= np.diag(rod.force[0] * np.cos(angle) + rod.force[1] * np.sin(angle))
    free = np.linalg.qr(np.stack([np.sin(angle), np.cos(angle)], axis=1), mode="complete")[0][:, 2:]
    return float(np.linalg.eigvalsh(free.T @ matrix @ free)[0])


def test_unstable_and_nearly_unstable_rods_are_refused_with_the_reason(hand):
    checks, rods = checks_of(hand, [of_margin(m) for m in (0.93, 1.02, 1.10)])
    margin = checks["stability"]
    assert margin.values == pytest.approx([0.93, 1.02, 1.10], rel=2e-3)  # of 400 finite differences
    assert margin.passed.tolist() == [False, False, True]
    assert margin.hard
    assert refusals([margin], rods) == {
        7: ("stability margin of the rod 0.93 < 1.05 in block 1",),
        8: ("stability margin of the rod 1.02 < 1.05 in block 1",),
    }
    strict = replace(JOB, rod=RodJob(min_stability_margin=1.2))
    assert not checks_of(hand, [of_margin(1.10)], strict)[0]["stability"].passed.any()


def test_an_unstable_rod_bears_no_error_and_goes_nowhere(hand):
    unstable = of_margin(0.93)
    checks, _ = checks_of(hand, [unstable, unstable])
    for name in ("snap_shift", "snap_turn", "jump_between"):
        assert checks[name].values.tolist() == [0.0, 0.0], name


def test_a_straight_rod_has_no_margin_against_snapping(hand):
    checks, rods = checks_of(hand, [hand.line(LENGTH)])
    assert checks["stability"].values.tolist() == [np.inf], "no force, no conjugate point"
    assert checks["stability"].passed.all()
    assert (checks["snap_shift"].values.tolist(), checks["snap_turn"].values.tolist()) == ([0.0], [0.0])
    assert refusals(list(checks.values()), rods)[7] == (
        "shift of a gripper that snaps the rod 0 mm < 0.1 mm in block 1",
        "turn of a gripper that snaps the rod 0° < 0.2° in block 1",
    )


@pytest.mark.parametrize("slack", [2e-6, 1e-5, 1e-4])
def test_the_turn_that_flips_a_flat_arch_is_that_of_beam_theory(hand, slack):
    fold = np.degrees(fold_turn(slack))
    assert fold == pytest.approx(np.degrees(1.78 * np.sqrt(slack)), rel=2e-3)
    wide = replace(JOB, gripper=GripperJob(angle_error_deg=0.5, position_error_mm=0.05))
    checks, _ = checks_of(hand, [arch(slack), arch(slack, up=False)], wide)
    assert checks["snap_turn"].values == pytest.approx([fold, fold], rel=2e-3)
    assert checks["snap_turn"].passed.tolist() == [fold > 0.5] * 2
    # A shift along the chord pulls it straight, long before one across would flip it.
    assert checks["snap_shift"].values == pytest.approx([slack * LENGTH] * 2, rel=1e-6)
    assert checks["snap_shift"].passed.tolist() == [slack * LENGTH > 0.05] * 2


def test_a_flat_arc_that_is_pulled_taut_comes_back_on_its_own_side(hand):
    """Its ends point 2.45 √slack off the chord: there is no second shape, though its slack is 0.004 mm."""
    radius = 100000.0
    flat = hand.arc(radius, LENGTH, angle=-0.5 * LENGTH / radius)
    checks, _ = checks_of(hand, [flat])
    assert np.isposinf(checks["snap_shift"].values).all()
    assert np.isposinf(checks["snap_turn"].values).all()


def test_what_the_rod_bears_beyond_the_reach_is_infinite(hand):
    checks, rods = checks_of(hand, [arch(0.01), arch(0.02), hand.arc(700.0, LENGTH)])
    for name in ("snap_shift", "snap_turn"):  # 10 mm and 10.2° at least, three times 0.1 mm and 0.2° are tried
        assert np.isposinf(checks[name].values).all()
        assert np.isposinf(checks[name].margins).all()
        assert checks[name].passed.all()
        assert worst_rod(checks[name]) == 0, "it applies to all of them"
    assert "0.3 mm" in checks["snap_shift"].note
    assert "0.6°" in checks["snap_turn"].note
    assert refusals(list(checks.values()), rods) == {}


def test_infinity_survives_the_files(hand, tmp_path):
    checks, rods = checks_of(hand, [hand.arc(700.0, LENGTH), arch(1e-4)])
    assert checks["stability"].values[0] == np.inf
    plan = CutPlan("x", "x", "", (hand.block(),), tuple(rods), tuple(checks.values()), ())
    job = replace(JOB, surface=SurfaceJob(file=tmp_path / "wall.3dm"))
    write_cut_json(tmp_path / "cut.json", plan, job, {})
    stored = read_cut_json(tmp_path / "cut.json").plan
    assert len(stored.checks) == 4
    for check in stored.checks:
        np.testing.assert_array_equal(check.values, checks[check.name].values)
    assert all(finding.agrees for finding in compare_checks(stored, plan.checks))


def test_errors_of_nothing_can_be_asked_for(hand):
    none = replace(JOB, gripper=GripperJob(angle_error_deg=0.0, position_error_mm=0.0))
    checks, _ = checks_of(hand, [arch(0.01), hand.line(LENGTH)], none)
    assert all(c.passed.all() for n, c in checks.items() if n.startswith("snap"))


# --- between leaves ---


def test_mirror_branches_are_a_jump(hand):
    checks, _ = checks_of(hand, [arch(0.01), arch(0.012), arch(0.01, up=False), arch(0.01, up=False)])
    jump = checks["jump_between"]
    assert jump.values.tolist() == [1.0, 0.0, 0.0, 1.0]  # each rod has the worse of its two ways
    assert (jump.hard, jump.limit) == (False, 1.0)
    assert jump.passed.tolist() == [True, False, False, True]
    assert "another shape" in jump.note


def test_a_fold_between_two_leaves_is_found_where_beam_theory_has_it(hand):
    slack = 1e-5
    fold = fold_turn(slack)
    up, down = arch(slack), arch(slack, up=False)
    way = 2.5 * fold
    # The arch that bows up is turned down at its end as it goes, and flips when turned up by the fold.
    held, flipped = turned(up, 0.8 * fold), turned(down, way)
    assert checks_of(hand, [up, held])[0]["jump_between"].values.tolist() == [1.0, 1.0]
    assert checks_of(hand, [down, flipped])[0]["jump_between"].values.tolist() == [1.0, 1.0]
    jump = checks_of(hand, [up, flipped])[0]["jump_between"]
    assert jump.values == pytest.approx([fold / way] * 2, rel=5e-3)
    assert not jump.passed.any()
    # Only the way of the sweep counts: back again the rod stays bowed down, and comes to another shape than `up`.
    assert checks_of(hand, [flipped, up])[0]["jump_between"].values.tolist() == [0.0, 0.0]


def test_a_polyline_that_is_let_go_flips_there_too(hand):
    """Below the found share the rod stays, above it falls: an overdamped polyline, no elastica."""
    slack = 1e-3
    up = arch(slack)
    way = 2.0 * fold_turn(slack)
    flipped = turned(arch(slack, up=False), way)
    share = checks_of(hand, [up, flipped])[0]["jump_between"].values[0]
    edges = 100
    middles = up.angle_at((np.arange(edges) + 0.5) * LENGTH / edges)
    sides = []
    for part in (0.97, 1.03):
        end = up.point_at(LENGTH)
        rod = DiscreteRod(up.start, 0.0, end, part * share * way, LENGTH, edges=edges, ends="points")
        shape = np.cumsum(np.sin(rod.relax(middles).angles))
        sides.append(shape[np.abs(shape).argmax()])
    assert sides[0] * np.cumsum(np.sin(middles))[50] > 0.0 > sides[1] * sides[0]


def test_a_whole_turn_in_the_stored_angle_is_no_turn(hand):
    up, next_up = arch(0.002), arch(0.15)  # far apart, so that the way is followed in steps
    again = Elastica(next_up.start, 2.0 * np.pi, next_up.start_curvature, next_up.force, LENGTH)
    assert checks_of(hand, [up, again, next_up])[0]["jump_between"].values.tolist() == [1.0, 1.0, 1.0]


def test_a_single_leaf_is_on_no_way(hand):
    checks, _ = checks_of(hand, [arch(0.01)])
    assert np.isnan(checks["jump_between"].values).all()
    assert all(c.values.shape == (0,) for c in stability_checks(hand.context([])))
