"""The figure of the study of good regions."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from batten.io import regions_figure
from batten.solvers.good_region_database import build_good_region_database
from batten.studies import regions
from batten.studies.study import run


def test_five_cases_and_a_histogram(monkeypatch):
    database = build_good_region_database(spacing=0.5, cells=6)
    for module in (regions, regions_figure):
        monkeypatch.setattr(module, "study_database", lambda: database)
    outcome = run(regions.STUDY, 6, seed=2)
    figure = regions_figure.figure(outcome)
    FigureCanvasAgg(figure).draw()
    share = outcome.results.difference / outcome.results.union
    cases, histogram = figure.axes[:5], figure.axes[5]
    shown = [float(axes.get_title().split("%")[0]) / 100 for axes in cases]
    assert shown == sorted(shown)
    assert shown[2] == pytest.approx(np.sort(share)[3], abs=0.006)
    assert sum(bar.get_height() for bar in histogram.patches[-40:]) + 0 <= 6
    curve = cases[0].lines[1].get_xydata()
    case = int(np.argsort(share, kind="stable")[0])
    assert np.allclose(curve[0], outcome.results.control_points[case, 0])
