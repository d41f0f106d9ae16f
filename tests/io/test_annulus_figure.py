"""The figure of the study of the annuli."""

import dataclasses

import numpy as np

from batten.io import annulus_figure
from batten.io.study_files import write
from batten.studies.annulus import STUDY
from batten.studies.study import Outcome, run


def test_it_shows_every_simple_polygon_in_three_panels(monkeypatch):
    outcome = run(STUDY, 60, seed=1)
    simple = outcome.results.simple
    panels = annulus_figure.figure(outcome).axes
    assert [panel.get_title()[:9] for panel in panels] == ["Fig. 3.6", "Fig. 3.7", "Fig. 3.15", "Table 3.2"]
    for panel, x, y in zip(panels, ("smallest_angle", "residual", "residual"), ("l2", "l2", "h1")):
        shown = np.asarray(panel.collections[0].get_offsets())
        scale = np.pi if x == "smallest_angle" else 1.0
        assert np.allclose(shown[:, 0] * scale, getattr(outcome.results, x)[simple])
        assert np.allclose(shown[:, 1], getattr(outcome.results, y)[simple])
    monkeypatch.setattr(annulus_figure, "_MOST_DOTS", 20)
    assert len(annulus_figure.figure(outcome).axes[0].collections[0].get_offsets()) == -(-simple.sum() // 3)


def test_no_simple_polygon_at_all(tmp_path):
    """Also the files are written then."""
    one = run(STUDY, 1)
    results = dataclasses.replace(one.results, simple=np.array([False]))
    assert len(write(Outcome(STUDY, 1, 0, results), tmp_path)) == 3
