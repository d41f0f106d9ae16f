import numpy as np

from batten.io.methods_figure import figure
from batten.studies.methods import NAMES, STUDY
from batten.studies.study import run


def test_curves_of_the_figure_are_quantiles():
    outcome = run(STUDY, 300, seed=1)
    left, right = figure(outcome).axes
    assert [line.get_label() for line in left.lines] == ["as drawn", *NAMES]
    j = NAMES.index("feedback")
    x, y = left.lines[1 + j].get_data()
    values = outcome.results.after[:, j]
    values = values[~np.isnan(values)]
    assert np.mean(values <= x[200]) >= y[200] - 0.01
    assert len(right.lines) == len(NAMES)
