"""The figure of the study of bounds."""

import numpy as np

from batten.io import bound_figure
from batten.io.study_files import write
from batten.studies.bound import BOUNDS, STUDY
from batten.studies.study import run


def test_panels_show_the_curves_they_name(tmp_path, monkeypatch):
    outcome = run(STUDY, 150, seed=1)
    results = outcome.results
    every = np.ones(150, dtype=bool)
    few, line = results.ell <= 25.0, results.below_line
    drawing = bound_figure.figure(outcome)
    # Colour bars come behind the first eight panels.
    panels = drawing.subfigs[0].axes[:8]
    for j, (rows, heights) in enumerate(
        ((every, results.l2), (few, results.l2), (few, results.distance), (line, results.distance))
    ):
        assert rows.sum() > 0
        for panel, x in ((panels[j], results.residual), (panels[4 + j], results.curvature_residual)):
            assert np.allclose(panel.collections[0].get_offsets(), np.column_stack([x, heights])[rows])
    bounds, spread = drawing.subfigs[1].axes
    for j, dots in enumerate(bounds.collections):
        shown = np.asarray(dots.get_offsets())
        assert dots.get_label() == BOUNDS[j]
        assert np.allclose(shown[:, 0], results.distance)
        assert np.allclose(shown[:, 1], np.minimum(results.bounds[:, j], 1e10))
    assert sum(p.get_height() for p in spread.patches) == 450
    monkeypatch.setattr(bound_figure, "_MOST_POINTS", 20)
    assert len(bound_figure.figure(outcome).subfigs[0].axes[0].collections[0].get_offsets()) == 20
    assert len(write(outcome, tmp_path)) == 3
    assert (tmp_path / "bound.png").read_bytes().startswith(b"\x89PNG")


def test_one_curve(tmp_path):
    assert len(write(run(STUDY, 1, seed=3), tmp_path)) == 3
