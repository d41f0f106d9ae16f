"""The kerf along rods that shift and turn, against the law's formula by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from batten.fabrication.checks.kerf import kerf_checks
from batten.fabrication.job import BladeJob, CutJob, KerfJob, SurfaceJob
from batten.fabrication.plan import ArmMotion, BlockMotion

LAW = KerfJob(formula="a + b / v", a=0.4, b=12.0, tolerance_mm=0.25)
TABLE = KerfJob(speeds_mm_s=(5.0, 10.0, 20.0, 40.0), widths_mm=(2.8, 1.6, 1.0, 0.7))


def job(kerf=LAW):
    return CutJob(SurfaceJob(), blade=BladeJob(kerf_mm=1.0), kerf=kerf)


def motion(rods, seconds, block=1):
    """A motion that takes these seconds between its leaves; where its arms are does not matter."""
    n = len(rods)
    poses, edge, zero = np.tile(np.eye(4), (n, 1, 1)), np.eye(4), np.zeros(n)
    arm = ArmMotion(
        poses,
        np.zeros((n, 6)),
        zero,
        zero,
        zero,
        zero,
        zero,
        edge,
        edge,
        np.zeros(6),
        np.zeros(6),
        np.zeros((n, 4), int),
    )
    return BlockMotion(block, tuple(rods), arm, arm, 20.0, np.asarray(seconds, dtype=float))


@pytest.fixture
def made(hand):
    """Three level rods 20 mm apart, and a fourth that is turned about the start of the third."""
    turn = 0.05
    rods = [hand.place(hand.line(), leaf=i + 1, plane=hand.vertical(100.0 + 20.0 * i)) for i in range(3)]
    rods.append(hand.place(hand.line(angle=turn), leaf=4, plane=hand.vertical(140.0)))
    return SimpleNamespace(rods=rods, blocks=[hand.block()], chord=2.0 * np.sin(0.5 * turn))


def test_each_rod_has_the_worse_of_its_two_moves(made) -> None:
    # Times of 1 and 1.25 s for 20 mm: kerfs of 1.0 and 1.15 mm.
    (check,) = kerf_checks(job(), made.blocks, made.rods, [motion((0, 1, 2), [1.0, 1.25])])
    assert check.values == pytest.approx([0.0, 0.15, 0.15, np.nan], abs=1e-9, nan_ok=True)
    assert (check.name, check.unit, check.sense, check.limit, check.hard) == ("kerf", "mm", "max", 0.25, False)
    assert check.passed.all()
    assert check.note.endswith("Points of the blade move at 16 to 20 mm/s.")


def test_a_turn_about_an_end_melts_unevenly(made) -> None:
    # Points at 0 … 600 mm from the axis; the one on it stands still, and a formula melts there without end.
    (check,) = kerf_checks(job(), made.blocks, made.rods, [motion((2, 3), [1.0])])
    assert check.values.tolist()[2:] == [np.inf, np.inf]
    assert not check.passed[2]
    # Where the axis lies outside of the block, the slowest point is the one on the border.
    outer = [made.rods[i] for i in (2, 3)]
    block = SimpleNamespace(number=1, corner_mm=np.array([150.0, 0.0, 0.0]), size_mm=np.array([450.0, 600.0, 400.0]))
    (check,) = kerf_checks(job(), [block], outer, [motion((0, 1), [1.0])])
    slow, fast = (0.4 + 12.0 / (made.chord * s) for s in (150.0, 600.0))
    assert check.values == pytest.approx([max(slow - 1.0, 1.0 - fast)] * 2, rel=1e-3)


def test_a_speed_outside_the_table_counts_as_the_worst(made) -> None:
    (check,) = kerf_checks(job(TABLE), made.blocks, made.rods, [motion((0, 1, 2), [1.0, 0.4])])
    assert check.values == pytest.approx([0.0, np.inf, np.inf, np.nan], abs=1e-9, nan_ok=True)


def test_nothing_without_a_law_or_a_motion(made) -> None:
    assert kerf_checks(job(KerfJob()), made.blocks, made.rods, [motion((0, 1), [1.0])]) == ()
    assert kerf_checks(job(), made.blocks, made.rods, ()) == ()


def test_a_move_beside_the_block_does_not_count(hand) -> None:
    rods = [hand.place(hand.line(), leaf=i, plane=hand.vertical(y)) for i, y in enumerate((580.0, 600.0, 700.0, 720.0))]
    (check,) = kerf_checks(job(), [hand.block()], rods, [motion((0, 1, 2, 3), [1.25, np.nan, np.nan])])
    assert check.values == pytest.approx([0.15, 0.15, np.nan, np.nan], abs=1e-9, nan_ok=True)
    single = kerf_checks(job(), [hand.block()], rods, [motion((0,), [])])
    assert np.isnan(single[0].values).all()
