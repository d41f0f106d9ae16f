"""The figure of the study of random Béziers."""

import numpy as np

from batten.io import random_figure
from batten.io.study_files import write
from batten.studies.random_sample import ANGLES, LENGTHS, SIMPLE, STUDY
from batten.studies.study import run


def test_panels_show_the_curves_they_name(monkeypatch):
    outcome = run(STUDY, 20_000, seed=1)
    results = outcome.results
    allowed = results.satisfying(SIMPLE | ANGLES)
    held = allowed & results.satisfying(LENGTHS)
    panels = random_figure.figure(outcome).axes[:4]
    for panel, rows, low, high in zip(panels, (allowed, held, held, held), (0, 0, 0.22, 0.4), (2, 0.22, 0.4, 2)):
        band = rows & (results.residual >= np.float32(low)) & (results.residual < np.float32(high))
        assert band.sum() > 5
        assert panel.get_title().endswith(f": {band.sum():,}")
        assert np.allclose(panel.collections[0].get_offsets(), results.phi[band])
        assert np.allclose(panel.collections[0].get_array(), results.residual[band])
    monkeypatch.setattr(random_figure, "_MOST_POINTS", 50)
    assert [len(p.collections[0].get_offsets()) for p in random_figure.figure(outcome).axes[:3]] == [50, 50, 50]


def test_one_curve_is_written(tmp_path):
    assert len(write(run(STUDY, 1, seed=3), tmp_path)) == 3
    assert (tmp_path / "random.png").read_bytes().startswith(b"\x89PNG")
