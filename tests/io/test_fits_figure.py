"""The figure of the study of fits in Π."""

import numpy as np

from batten.io.fits_figure import figure
from batten.io.study_files import write
from batten.studies.study import run
from batten.studies.zone_fits import PAPER_BOUNDS, STUDY


def test_distances_over_residuals_and_the_papers_bounds(tmp_path):
    outcome = run(STUDY, 80, seed=1)
    panels = figure(outcome).axes
    for i, bound in enumerate(PAPER_BOUNDS):
        plane, spread = panels[2 * i : 2 * i + 2]
        shown = np.asarray(plane.collections[0].get_offsets())
        assert np.allclose(shown, np.column_stack([outcome.results.residual, outcome.results.distances[:, i]]))
        assert set(plane.lines[0].get_ydata()) == {bound}
        assert plane.get_ylim()[1] > max(bound, shown[:, 1].max())
        assert plane.get_ylim() == spread.get_ylim()
        assert sum(p.get_width() for p in spread.patches) == 80
    assert len(write(outcome, tmp_path)) == 3
    assert (tmp_path / "fits.png").read_bytes().startswith(b"\x89PNG")
