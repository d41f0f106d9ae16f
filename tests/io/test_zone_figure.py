"""The figure of the study of Π."""

import numpy as np
import pytest

from batten.io.study_files import write
from batten.io.zone_figure import cells, figure
from batten.studies.study import run
from batten.studies.zone import STUDY, ZonePart, zone_border


def test_cells_hold_mean_and_greatest():
    high = 2.0 * np.pi - 0.9
    phi = np.array([(1.0, 1.0), (1.0, 1.0), (1.0, 5.0), (high, high)], np.float32)
    residual = np.array([0.1, 0.3, 0.2, 0.25], np.float32)
    mean, greatest = cells(ZonePart(np.zeros((4, 2, 2), np.float32), phi, residual), 2)
    assert mean == pytest.approx(np.array([[0.2, np.nan], [0.2, 0.25]]), nan_ok=True)
    assert greatest == pytest.approx(np.array([[0.3, np.nan], [0.2, 0.25]]), nan_ok=True)


def test_planes_are_filled_inside_the_border_and_empty_outside():
    outcome = run(STUDY, 20_000, seed=1)
    mean, greatest, spread = figure(outcome).axes[:3]
    values = np.ma.filled(greatest.images[0].get_array(), np.nan)
    assert np.nanmax(values) == outcome.results.residual.max()
    assert (np.nan_to_num(values) >= np.nan_to_num(np.ma.filled(mean.images[0].get_array(), np.nan)) - 1e-7).all()
    middle = len(values) // 2
    assert not np.isnan(values[middle - 2 : middle + 3, :][:, [3, middle, -4]]).all()
    assert np.isnan(values[0, middle])
    assert np.allclose(mean.lines[0].get_xydata(), zone_border())
    assert sum(p.get_height() for p in spread.patches) == 20_000


def test_one_curve_is_written(tmp_path):
    assert len(write(run(STUDY, 1, seed=3), tmp_path)) == 3
    assert (tmp_path / "zone.png").read_bytes().startswith(b"\x89PNG")
