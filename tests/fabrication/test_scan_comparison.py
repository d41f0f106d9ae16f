"""Faults put into a made scan come out as distances, in the right block, with the right sign."""

import numpy as np
import pytest
from scipy.special import ndtri

from batten.errors import InvalidInputError
from batten.fabrication.plan import Block
from batten.fabrication.scan import ScanDesign, register_scan
from batten.fabrication.scan_comparison import PERCENTILES, compare_scan, scan_distances

BLOCKS = tuple(
    Block(n + 1, n // 2, n % 2, np.array([600.0 * (n % 2), 450.0 * (n // 2), -300.0]), np.array([600.0, 450.0, 700.0]))
    for n in range(4)
)
ALL = ((0.0, 0.0), (1200.0, 900.0))


@pytest.fixture(scope="module")
def design(made_surfaces):
    return ScanDesign(
        made_surfaces.graph(
            lambda x, y: 120.0 * np.sin(x / 260.0) * np.cos(y / 310.0) + 60.0 * np.cos(x / 170.0 - y / 230.0),
            (0.0, 1200.0),
            (0.0, 900.0),
        )
    )


def _bump(x, y):
    """4 mm too much over the fourth block's middle, 1 mm too little over the first's."""
    far = np.hypot(x - 900.0, y - 675.0)
    return 4.0 * np.exp(-((far / 60.0) ** 2)) - np.exp(-((np.hypot(x - 300.0, y - 225.0) / 60.0) ** 2))


def test_percentiles_of_pure_noise_are_those_of_the_normal_distribution(made_scan, design):
    scan, _, _, _ = made_scan(design.surface, 60_000, ALL, 0.5, stray=0.05)
    compared = compare_scan(design, BLOCKS, scan, register_scan(design, scan), tolerance_mm=2.5)
    whole = compared.whole
    for percentile, value in zip(PERCENTILES[:3], whole.percentiles_mm):  # |N(0, σ)|; stray points add up to 0.3 %
        assert value == pytest.approx(0.5 * ndtri(0.5 + percentile / 200.0), rel=0.03)
    assert abs(whole.mean_mm) < 0.05
    assert compared.is_good
    assert compared.failing == ()
    assert [b.block for b in compared.blocks] == [1, 2, 3, 4]
    assert 0.9 < whole.covered < 1.0
    assert sum(b.points for b in compared.blocks) == whole.points
    d = compared.distances
    assert whole.points + d.far + d.beyond + d.not_finite == len(scan)
    assert d.far > 0.6 * 0.05 * len(scan)


def test_faults_have_their_sign_and_block(made_scan, design):
    scan, _, _, _ = made_scan(design.surface, 60_000, ALL, 0.1, stray=0.0, holes=(), error=_bump)
    compared = compare_scan(design, BLOCKS, scan, register_scan(design, scan), tolerance_mm=1.0, share=0.97)
    assert compared.failing == (4,)
    assert not compared.is_good
    first, _, _, fourth = compared.blocks
    assert fourth.highest_mm == pytest.approx(4.0, abs=0.4)
    assert first.lowest_mm == pytest.approx(-1.0, abs=0.4)
    assert fourth.highest_mm > 3.0 > 1.0 > abs(fourth.lowest_mm)
    # Where the bump is above 1 mm: a disc of radius 60 √ln 4 of the block's 600 × 450.
    assert 1.0 - fourth.within == pytest.approx(np.pi * 60.0**2 * np.log(4.0) / (600.0 * 450.0), rel=0.1)
    peak = np.nanargmax(compared.distances.signed_mm)
    assert np.hypot(*(compared.distances.feet_mm[peak] - [900.0, 675.0])) < 30.0


def test_distances_are_nearest_and_signed_upwards(design):
    p = design.surface.point([300.0, 700.0], [400.0, 500.0])
    up = np.array([[0.0, 0.0, 1.0]])
    d = scan_distances(design, np.concatenate([p + 3.0 * up, p - 2.0 * up]), 20.0)
    assert np.sign(d.signed_mm).tolist() == [1.0, 1.0, -1.0, -1.0]
    assert (np.abs(d.signed_mm) < [3.0, 3.0, 2.0, 2.0]).all()
    assert (np.abs(d.signed_mm) > 1.0).all()
    edge = np.array(
        [[-5.0, 300.0, float(design.surface.point(0.0, 300.0)[2])], [np.nan, 0.0, 0.0], [600.0, 400.0, 900.0]]
    )
    d = scan_distances(design, edge, 20.0)
    assert (d.beyond, d.not_finite, d.far) == (1, 1, 1)
    assert np.isnan(d.signed_mm).all()
    assert np.isnan(d.feet_mm).all()


def test_one_block_alone(made_scan, design):
    window = ((600.0, 0.0), (1200.0, 450.0))
    scan, points, _, _ = made_scan(design.surface, 20_000, window, 0.2, stray=0.0)
    alone = ScanDesign(design.surface, window)
    found = register_scan(alone, points, start=np.eye(4))
    compared = compare_scan(alone, BLOCKS, points, found, tolerance_mm=1.0)
    assert [b.block for b in compared.blocks] == [2]
    assert 0.9 < compared.whole.covered < 1.0
    assert compared.whole.percentiles_mm[0] == pytest.approx(0.2 * ndtri(0.75), rel=0.05)
    assert len(scan) == len(points)


def test_values_outside_their_bounds_are_refused(made_scan, design):
    scan, _, _, _ = made_scan(design.surface, 2000, ALL, 0.0, stray=0.0)
    found = register_scan(design, scan)
    for wrong in ({"tolerance_mm": 0.0}, {"tolerance_mm": 1.0, "share": 1.5}, {"tolerance_mm": 1.0, "reach_mm": -1.0}):
        with pytest.raises(InvalidInputError, match="allowed"):
            compare_scan(design, BLOCKS, scan, found, **wrong)
