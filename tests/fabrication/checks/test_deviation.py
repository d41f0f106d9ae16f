"""Deviation from planes and cylinders, where it is known."""

import math

import numpy as np
import pytest

from batten.fabrication.checks.deviation import deviation_checks
from batten.fabrication.job import BladeJob, CutJob, KerfJob, SurfaceJob


def values(checks):
    return [float(c.values[0]) for c in checks]


def test_arcs_concentric_with_a_cylinder(hand):
    radius, gap, turn = 500.0, 0.37, 0.5
    centre = (300.0, -250.0)

    def concentric(r):
        start = (centre[0] - r * math.sin(turn), centre[1] + r * math.cos(turn))
        return hand.arc(-r, 2.0 * r * turn, start, turn)

    rods = [hand.place(concentric(radius + g)) for g in (gap, -gap, 0.0, 2.0)]
    worst, mean, _ = deviation_checks(hand.context(rods, surface=hand.cylinder(radius, centre)))
    assert worst.values == pytest.approx([gap, gap, 0.0, 2.0], abs=1e-8)
    assert mean.values == pytest.approx([gap, gap, 0.0, 2.0], abs=1e-8)
    assert worst.passed.tolist() == [True, True, True, False]
    assert worst.hard
    assert not mean.hard


@pytest.mark.parametrize(("side", "sign"), [("lower", 1.0), ("upper", -1.0)])
def test_with_an_offset_the_melted_face_counts(hand, side, sign):
    radius, kerf, turn = 500.0, 3.0, 0.5
    centre = (300.0, -250.0)

    def concentric(r):
        start = (centre[0] - r * math.sin(turn), centre[1] + r * math.cos(turn))
        return hand.place(hand.arc(-r, 2.0 * r * turn, start, turn))

    job = CutJob(SurfaceJob(), blade=BladeJob(kerf_mm=kerf), kerf=KerfJob(side=side))
    rods = [concentric(radius + r) for r in (sign * 1.5, sign * 1.8, sign * 1.3, 0.0)]
    worst, mean, _ = deviation_checks(hand.context(rods, surface=hand.cylinder(radius, centre), job=job))
    assert worst.values == pytest.approx([0.0, 0.3, 0.2, 1.5], abs=1e-8)
    assert mean.values == pytest.approx([0.0, 0.3, 0.2, 1.5], abs=1e-8)
    assert worst.note.endswith(f"1.5 mm {'below' if side == 'lower' else 'above'} the blade.")


def test_an_arc_over_a_plane_whose_highest_point_lies_between_samples(hand):
    radius, angle = 5000.0, 0.0713
    piece = hand.arc(-radius, 600.0, (0.0, 200.0), angle)
    worst, mean, _ = deviation_checks(hand.context([hand.place(piece)]))
    top = radius * (1.0 - math.cos(angle))
    turn = 600.0 / radius
    average = radius * ((math.sin(angle) - math.sin(angle - turn)) / turn - math.cos(angle))
    assert worst.values == pytest.approx([top], rel=1e-6)
    assert mean.values == pytest.approx([average], rel=1e-3)


def test_below_counts_as_much_as_above(hand):
    up, down = (hand.place(hand.arc(r, 600.0)) for r in (40000.0, -40000.0))
    worst, _, _ = deviation_checks(hand.context([up, down]))
    assert worst.values == pytest.approx([40000.0 * (1.0 - math.cos(600.0 / 40000.0))] * 2, rel=1e-9)


def test_only_the_part_within_the_block_counts(hand):
    # Level line, surface rising from 0 along x; in row 0 the piece runs to x = 150, in row 1 from there to 600.
    slope = 0.01
    piece = hand.line(600.0 * math.sqrt(2.0), start=(0.0, 0.0))
    rods = [hand.place(piece, block=b, plane=hand.vertical(450.0, math.pi / 4)) for b in (1, 2, 3)]
    blocks = [hand.block(1), hand.block(2, row=1), hand.block(3, row=3)]
    worst, mean, hausdorff = deviation_checks(hand.context(rods, blocks, hand.flat(0.0, slope)))
    cosine = 1.0 / math.hypot(1.0, slope)
    assert worst.values == pytest.approx(np.array([1.5, 6.0, np.nan]) * cosine, rel=1e-6, nan_ok=True)
    assert mean.values == pytest.approx(np.array([0.75, 3.75, np.nan]) * cosine, rel=1e-6, nan_ok=True)
    assert hausdorff.values == pytest.approx([0.0, 0.0, np.nan], abs=1e-3, nan_ok=True)
    assert worst.passed[2]


def test_hausdorff_distance_from_the_wanted_curve(hand):
    x = np.linspace(0.0, 600.0, 61)
    wave = np.stack([x, 200.0 + 0.3 * np.sin(math.pi * x / 600.0)], axis=-1)
    short = np.stack([np.linspace(0.0, 590.0, 41), np.full(41, 200.0)], axis=-1)
    above = np.stack([x, np.full(61, 200.2)], axis=-1)
    rods = [hand.place(hand.line(), design=d) for d in (wave, short, above, np.empty((0, 2)))]
    hausdorff = deviation_checks(hand.context(rods))[2]
    assert hausdorff.values == pytest.approx([0.3, 10.0, 0.2, np.nan], abs=1e-3, nan_ok=True)
    assert not hausdorff.hard
