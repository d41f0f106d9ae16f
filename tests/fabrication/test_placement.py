"""Where rods lie along their curves, against lines and circles in closed form and against a brute search."""

import numpy as np
import pytest

from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError
from batten.fabrication.job import GripperJob, RodJob
from batten.fabrication.placement import bow, rod_placement
from batten.surfaces.plane import Plane

ROD = RodJob(length_mm=1000.0)
GRIPPER = GripperJob(radius_mm=40.0, clearance_mm=20.0)
LOW, HIGH = np.array([0.0, 0.0, 0.0]), np.array([600.0, 600.0, 400.0])
SHARES = np.linspace(0.0, 1.0, 21)
PLANE = Plane((0.0, 300.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
SPIRAL = Elastica((0.0, 200.0), 0.1, -1e-4, (0.0, -4e-6), 620.0)  # bends more and more to the right, from 200 to 300 mm
WAVE = Elastica((0.0, 250.0), -0.5, 1 / 500.0, (6e-6, 1e-6), 650.0)


def place(pieces, blocks=None, low=LOW, high=HIGH, rod=ROD, gripper=GRIPPER, plane=PLANE):
    n = len(pieces)
    return rod_placement(
        np.array([p.parameters for p in pieces]),
        (plane,) * n,
        np.tile(low, (n, 1)),
        np.tile(high, (n, 1)),
        np.zeros(n, dtype=np.int64) if blocks is None else np.array(blocks),
        rod,
        gripper,
    )


def tried(piece, low=LOW, high=HIGH, plane=PLANE):
    """For every share: greatest curvature and the grippers' least distance from the block, evaluated densely."""
    spare = ROD.length_mm - piece.length
    bends, gaps = [], []
    for share in SHARES:
        s = np.linspace(-share * spare, ROD.length_mm - share * spare, 2001)
        bends.append(np.abs(piece.curvature_at(s)).max())
        ends = plane.to_world(piece.point_at(s[[0, -1]]))
        gaps.append(np.linalg.norm(ends - np.clip(ends, low, high), axis=1).min())
    return np.array(bends), np.array(gaps)


def test_straight_rods_lie_in_the_middle() -> None:
    line = Elastica((0.0, 200.0), 0.0, 0.0, (0.0, 0.0), 600.0)
    assert place([line]) == pytest.approx([200.0])
    # 60 mm on either side of a block that reaches 120 mm farther to the left: 180 mm of the 400 mm are enough there.
    assert place([line], low=np.array([-120.0, 0.0, 0.0])) == pytest.approx([200.0])
    assert place([line], low=np.array([-190.0, 0.0, 0.0])) == pytest.approx([260.0])


@pytest.mark.parametrize("piece", [SPIRAL, SPIRAL.reversed(), WAVE], ids=["spiral", "spiral reversed", "wave"])
@pytest.mark.parametrize("need", [0.0, 60.0, 120.0])
def test_of_the_shares_that_keep_the_clearance_the_one_that_bends_least(piece, need) -> None:
    if piece.angle_at(0.0) > 1.5:  # reversed: turned round again, so that it runs through the block the other way
        piece = Elastica((0.0, 250.0), 0.0, piece.start_curvature, tuple(-piece.force), piece.length)
    bends, gaps = tried(piece)
    clear = gaps >= need
    assert 0 < clear.sum() <= 21
    before = place([piece], gripper=GripperJob(radius_mm=0.6 * need, clearance_mm=0.4 * need))[0]
    share = before / (ROD.length_mm - piece.length)
    chosen = np.abs(SHARES - share).argmin()
    assert share == pytest.approx(SHARES[chosen], abs=1e-12)
    assert clear[chosen]
    assert bends[chosen] <= bends[clear].min() * (1.0 + 2e-4)


def test_clearance_comes_before_curvature() -> None:
    bends, gaps = tried(SPIRAL)
    assert bends.argmin() == 20
    assert gaps[20] < 60.0 < gaps[10]
    share = place([SPIRAL])[0] / (ROD.length_mm - SPIRAL.length)
    assert share == pytest.approx(SHARES[gaps >= 60.0].max(), abs=1e-12), (
        "as far to the left as the right gripper lets it"
    )


def test_the_least_bow_comes_before_curvature_but_after_clearance() -> None:
    # An S: in the middle of the rod its bow is least, towards either end more.
    pieces = Elastica((0.0, 200.0), 0.0, 2e-4, (0.0, -8e-7), 560.0)
    shares = np.linspace(0.0, 1.0, 21)
    bows = bow(np.tile(pieces.parameters, (21, 1)), shares * 440.0, 1000.0)
    free = GripperJob(radius_mm=0.0, clearance_mm=0.0)
    chosen = []
    for least in (0.0, 0.5 * (bows.min() + bows.max()), 2.0 * bows.max()):
        before = place([pieces], rod=RodJob(length_mm=1000.0, min_bow_mm=float(least)), gripper=free)[0]
        chosen.append(int(np.abs(shares - before / 440.0).argmin()))
    bends, gaps = tried(pieces)
    assert bows[chosen[0]] < 0.5 * (bows.min() + bows.max()) <= bows[chosen[1]], "the case tells the two apart"
    keeps = (bows >= 0.5 * (bows.min() + bows.max())) & (gaps >= 0.0)
    assert bends[chosen[1]] <= bends[keeps].min() * (1.0 + 2e-4)
    assert chosen[2] == chosen[0], "a bow that cannot be had changes nothing"


def test_without_a_share_that_is_clear_the_greatest_distance() -> None:
    _, gaps = tried(SPIRAL)
    gripper = GripperJob(radius_mm=300.0, clearance_mm=50.0)
    share = place([SPIRAL], gripper=gripper)[0] / (ROD.length_mm - SPIRAL.length)
    assert gaps.max() < 350.0
    assert gaps[np.abs(SHARES - share).argmin()] == pytest.approx(gaps.max(), abs=1e-9)


def test_one_share_for_a_block_and_another_for_the_next() -> None:
    blocks = [7, 3, 7, 3, 9]
    mirrored = Elastica((0.0, 200.0), 0.0, SPIRAL.curvature_at(620.0), (0.0, 4e-6), 560.0)
    pieces = [SPIRAL, mirrored, WAVE, mirrored, WAVE]
    share = place(pieces, blocks) / (ROD.length_mm - np.array([p.length for p in pieces]))
    assert share[0] == pytest.approx(share[2], abs=1e-12)
    assert share[1] == pytest.approx(share[3], abs=1e-12)
    assert len(set(share.round(9))) == 3
    # The block's share suits the worst of its rods, not each.
    bends = np.maximum(tried(SPIRAL)[0], tried(WAVE)[0])
    gaps = np.minimum(tried(SPIRAL)[1], tried(WAVE)[1])
    chosen = np.abs(SHARES - share[0]).argmin()
    assert bends[chosen] <= bends[gaps >= 60.0].min() * (1.0 + 2e-4)
    # A block's choice does not depend on the others.
    assert place([SPIRAL, WAVE])[0] == pytest.approx(share[0] * (ROD.length_mm - SPIRAL.length), abs=1e-9)


def test_the_plane_may_lie_anywhere() -> None:
    turn = 0.7
    plane = Plane((40.0, -30.0, 15.0), (np.cos(turn), np.sin(turn), 0.0), (0.0, 0.0, 1.0))
    low = np.array([0.0, 0.0, 0.0])
    high = plane.to_world([600.0, 400.0])
    bends, gaps = tried(SPIRAL, low, high, plane)
    chosen = np.abs(SHARES * 380.0 - place([SPIRAL], low=low, high=high, plane=plane)[0]).argmin()
    assert gaps[chosen] >= 60.0
    assert bends[chosen] <= bends[gaps >= 60.0].min() * (1.0 + 2e-4)


@pytest.mark.parametrize("length", [500.0, 650.0])
def test_a_rod_that_is_no_longer_than_a_piece_is_an_error(length) -> None:
    with pytest.raises(InvalidInputError, match=rf"rod of {length:g} mm is shorter than a leaf: a piece is 650\.0 mm"):
        place([SPIRAL, WAVE], rod=RodJob(length_mm=length))


@pytest.mark.parametrize("radius", [200.0, -350.0, 1e4, 1e7])
def test_the_bow_of_an_arc(radius) -> None:
    arc = Elastica((5.0, 7.0), 0.3, 1.0 / radius, (0.0, 0.0), 400.0)
    half = 0.5 * 600.0 / abs(radius)
    assert half < 0.5 * np.pi
    got = bow(arc.parameters[None], np.array([120.0]), 600.0)
    assert got == pytest.approx([2.0 * abs(radius) * np.sin(0.5 * half) ** 2], rel=2e-3)


def test_the_bow_is_that_of_the_whole_rod_and_each_row_its_own() -> None:
    line = Elastica((0.0, 0.0), 1.0, 0.0, (0.0, 0.0), 300.0)
    rows = [line, SPIRAL, WAVE]
    before = np.array([0.0, 30.0, 200.0])
    got = bow(np.array([r.parameters for r in rows]), before, 900.0)
    for piece, start, value in zip(rows, before, got):
        points = piece.point_at(np.linspace(-start, 900.0 - start, 20001))
        direction = (points[-1] - points[0]) / np.linalg.norm(points[-1] - points[0])
        across = (points - points[0]) @ np.array([-direction[1], direction[0]])
        assert value == pytest.approx(np.abs(across).max(), rel=2e-3, abs=1e-9)
