"""The figure of the study of projections."""

import numpy as np
import pytest

from batten.io.projection_figure import figure
from batten.studies.projection import PAPER, ROWS, STUDY
from batten.studies.study import run


def test_each_row_has_its_histogram_and_the_papers_mean():
    outcome = run(STUDY, 2000, seed=1)
    panels = figure(outcome).axes
    assert len(panels) == len(ROWS)
    for j, panel in enumerate(panels):
        assert panel.get_title().startswith(ROWS[j])
        assert panel.lines[0].get_xdata()[0] == PAPER[j][0]
        counts = np.histogram(outcome.results.after[outcome.results.inside[:, j], j], np.linspace(0.0, 1.0, 101))[0]
        heights = [bar.get_height() for bar in panel.patches[100:200]]
        assert heights == pytest.approx(counts / counts.sum() * 100.0)


def test_rows_without_curves_are_empty():
    for seed in range(3):
        assert len(figure(run(STUDY, 1, seed=seed)).axes) == len(ROWS)
