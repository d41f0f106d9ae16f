"""The study of splines, small: what it prints, its figure, and that the Euler spiral spline never fails."""

import numpy as np
import pytest

from batten.io.splines_figure import figure
from batten.io.study_files import run_in, write
from batten.studies import splines
from batten.studies.study import run


@pytest.fixture(scope="module")
def outcome():
    return run(splines.STUDY, 60, seed=3, workers=1)


def test_the_euler_spiral_is_never_without_a_solution_nor_unmarked(outcome):
    status = outcome.results.status[:, 0]
    assert set(status.tolist()) == {0, 1}
    assert np.nanmax(outcome.results.residual[:, 0]) < 1e-9


def test_the_tables_have_a_row_for_each_kind(outcome):
    text = splines.STUDY.lines(outcome)
    rows = {line.split()[0]: line for line in text if line.strip()}
    assert "60 sequences" in text[0]
    assert rows["euler"].split()[1:4] == ["2", "exact", "0e+00"] or "exact" in rows["euler"]
    for name in ("mec", "log-aesthetic", "kurgla1", "hobby", "circle", "ikarus", "lagrange", "si-mec"):
        assert name in rows


def test_it_writes_its_files(tmp_path):
    small = run_in(splines.STUDY, tmp_path, 8, 1)
    write(small, tmp_path)
    assert {"splines.parquet", "splines.png", "splines.txt"} <= {p.name for p in tmp_path.iterdir()}


def test_every_kind_is_drawn(outcome):
    panels = figure(outcome).axes
    assert len(panels) == 9
    assert all(len(panel.lines) > 10 for panel in panels)


@pytest.mark.slow
def test_ten_thousand_sequences_have_an_euler_spiral_spline():
    result = run(splines.STUDY, 10_000, seed=7).results
    assert set(result.status[:, 0].tolist()) == {0, 1}
    assert np.nanmax(result.residual[:, 0]) < 1e-9
