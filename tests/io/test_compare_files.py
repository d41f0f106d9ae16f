"""What is told of a comparison: verdict, remarks, numbers that do not exist, and a map that stray points leave alone."""

import json
from dataclasses import replace

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.fabrication.plan import Block
from batten.fabrication.scan import Registration, ScanDesign
from batten.fabrication.scan_comparison import compare_scan
from batten.io.compare_files import comparison_lines, comparison_record, remarks, verdict, write_comparison
from batten.io.compare_pictures import distance_map
from batten.surfaces.bspline_surface import BSplineSurface

FLAT = BSplineSurface([0, 0, 1, 1], [0, 0, 1, 1], 1, 1, [[(0, 0, 0), (0, 300, 0)], [(400, 0, 0), (400, 300, 0)]])
BLOCKS = tuple(Block(n + 1, 0, n, np.array([200.0 * n, 0.0, -50.0]), np.array([200.0, 300.0, 90.0])) for n in range(2))
KNOWN = Registration(np.eye(4), 0.1, 0.9, 0.01, 3.0)


def _compared(points, registration=KNOWN):
    return compare_scan(ScanDesign(FLAT), BLOCKS, points, registration, tolerance_mm=1.0)


@pytest.fixture(scope="module")
def scan():
    """0.25 mm too much over the left block, 2 mm too little over the right one."""
    x, y = (t.ravel() for t in np.meshgrid(np.arange(2.5, 400.0, 5.0), np.arange(2.5, 300.0, 5.0)))
    return np.stack([x, y, np.where(x < 200.0, 0.25, -2.0)], axis=1)


def test_the_failing_block_is_named(scan):
    compared = _compared(scan)
    assert verdict(compared) == "block 2 does not have 95% of the points within 1 mm"
    lines = comparison_lines(compared, cut="plate")
    assert [line.endswith("FAIL") for line in lines[-2:]] == [False, True]
    record = json.loads(json.dumps(comparison_record(compared, cut="plate", scan="a.ply"), allow_nan=False))
    left, right = record["blocks"]
    assert (left["mean_mm"], right["mean_mm"]) == pytest.approx((0.25, -2.0), abs=1e-12)
    assert (left["within"], right["within"]) == (1.0, 0.0)
    assert right["percentiles_mm"]["95"] == pytest.approx(2.0, abs=1e-12)
    assert remarks(compared) == []


def test_doubts_about_the_pose_are_told(scan):
    assert "another pose (misfit 1.05" in remarks(_compared(scan, replace(KNOWN, rival=1.05)))[0]
    assert "known to 0.300 mm" in remarks(_compared(scan, replace(KNOWN, pose_error_mm=0.3)))[0]
    assert "slide" in remarks(_compared(scan, replace(KNOWN, pose_error_mm=np.inf)))[0]
    nothing = _compared(scan, replace(KNOWN, pose_error_mm=np.nan, rival=np.nan))
    assert "without registration" in remarks(nothing)[0]
    assert comparison_record(nothing, cut="", scan="")["pose_error_mm"] is None


def test_a_scan_far_away_is_no_success_and_draws_nothing(scan, tmp_path):
    compared = _compared(scan + np.array([0.0, 0.0, 500.0]))
    assert not compared.is_good
    assert "nothing was measured" in verdict(compared)
    assert "nan" in "\n".join(comparison_lines(compared, cut="plate"))
    with pytest.raises(InvalidInputError, match="nothing to draw"):
        write_comparison(compared, tmp_path / "out", cut="plate", scan="a.ply")
    assert list(tmp_path.iterdir()) == []


def test_the_map_shows_the_median_where_it_lies(scan):
    stray = scan[::10] + np.array([0.0, 0.0, 15.0])
    dense = np.concatenate([scan + np.array([d, 0.0, 0.0]) for d in (-1.0, 0.0, 1.0)] + [stray])
    picture = distance_map(_compared(dense)).axes[0].images[0].get_array()
    height, width = picture.shape
    left, right = picture[:, : width // 2 - 1].compressed(), picture[:, width // 2 + 1 :].compressed()
    assert (height, len(left) > 100, len(right) > 100) == (round(width * 0.75), True, True)
    assert np.median(left) == pytest.approx(0.25)
    assert np.median(right) == pytest.approx(-2.0)
    assert (np.abs(left - 0.25) < 1e-9).mean() > 0.95
