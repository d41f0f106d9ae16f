"""All checks together, and the reasons that come out of them."""

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.fabrication.checks import collision, reach
from batten.fabrication.checks.run import refusals, run_checks
from batten.fabrication.job import CutJob, KerfJob, SurfaceJob
from batten.fabrication.plan import CheckResult

JOB = CutJob(SurfaceJob(), kerf=KerfJob(offset=False))
ORDER = [
    "strain", "deviation", "deviation_mean", "hausdorff", "jump", "jump_tangent", "reentry", "gripper_clearance",
    "straightness", "passes_straight", "stability", "snap_shift", "snap_turn", "jump_between", "speed_ratio",
    "gripper_force", "gripper_moment",
]  # fmt: skip
PURE_NUMBERS = ("strain", "stability", "jump_between", "speed_ratio")


def checks_of(hand, rods, **more):
    return run_checks(JOB, hand.flat(), [hand.block()], rods, **more)


@pytest.mark.parametrize("count", [0, 1, 3])
def test_every_check_has_a_value_for_every_rod(hand, count):
    rods = [hand.place(hand.arc(500.0, 600.0), leaf=i, plane=hand.vertical(20.0 * i)) for i in range(count)]
    checks = checks_of(hand, rods)
    assert [c.name for c in checks] == ORDER
    assert all(c.values.shape == (count,) and c.title and (c.unit or c.name in PURE_NUMBERS) for c in checks)


def test_the_robots_come_last_and_need_their_cell(hand, monkeypatch):
    extra = CheckResult("reach", "Reach", "mm", 20.0, "min", np.array([30.0]))
    monkeypatch.setattr(reach, "reach_checks", lambda motions, cell, n: (extra,) if (motions, n) == (["m"], 1) else ())
    free = CheckResult("collision", "Free", "mm", 10.0, "min", np.array([30.0]))
    monkeypatch.setattr(collision, "collision_check", lambda job, cell, blocks, rods, motions, axis: free)
    between = CheckResult("travel", "Between", "mm", 10.0, "min", np.array([30.0]), hard=False)
    monkeypatch.setattr(collision, "travel_check", lambda job, cell, blocks, rods, motions, axis: between)
    rods = [hand.place(hand.line())]
    assert checks_of(hand, rods, motions=["m"], cell="cell", blade_axis="x")[-3:] == (extra, free, between)
    with pytest.raises(InvalidInputError, match="pass blade_axis="):
        checks_of(hand, rods, motions=["m"], cell="cell")
    with pytest.raises(InvalidInputError, match="pass cell="):
        checks_of(hand, rods, motions=["m"])


def test_a_good_leaf_is_not_refused_and_bad_ones_with_every_reason(hand):
    radius = 100000.0  # 0.45 mm over 600 mm, 1.25 mm over 1000 mm
    rods = [
        hand.place(hand.arc(radius, 600.0, angle=-300.0 / radius), leaf=1),
        hand.place(hand.arc(100.0, 150.0), leaf=2),
        hand.place(hand.line(), leaf=3),
        hand.place(hand.arc(radius, 600.0, angle=-300.0 / radius), 30.0, 370.0, leaf=4),
    ]
    reasons = refusals(checks_of(hand, rods), rods)
    assert list(reasons) == [2, 3, 4]
    assert reasons[2][0] == "strain on the whole rod 0.015 > 0.008 in block 1"
    assert reasons[2][1].startswith("greatest deviation from the surface 92.9 mm > 0.5 mm")
    assert reasons[3] == (
        "bow of the rod over its chord 0 mm < 1 mm in block 1",
        "shift of a gripper that snaps the rod 0 mm < 0.1 mm in block 1",
        "turn of a gripper that snaps the rod 0° < 0.2° in block 1",
    )
    assert reasons[4] == ("free distance of the grippers from the block -10 mm < 20 mm in block 1",)


def test_reasons_name_the_worst_block_and_the_others(hand):
    rods = [hand.place(hand.line(), block=b, leaf=leaf) for b, leaf in ((1, 7), (2, 7), (3, 7), (4, 7), (1, 8))]
    strain = CheckResult("strain", "Strain", "", 0.008, "max", np.array([0.009, 0.012, 0.007, 0.0081, np.nan]))
    free = CheckResult("free", "Free distance", "mm", 20.0, "min", np.array([25.0, 25.0, 25.0, 25.0, 19.9999]))
    soft = CheckResult("soft", "Soft", "", 1.0, "max", np.full(5, 9.0), hard=False)
    assert refusals([strain, free, soft], rods) == {
        7: ("strain 0.012 > 0.008 in block 2 (also in 1, 4)",),
        8: ("free distance 19.9999 mm < 20 mm in block 1",),
    }
    with pytest.raises(InvalidInputError, match="5 values for 4 rods"):
        refusals([strain], rods[:4])
