"""The figure of the study of connected components: what its lines show is what the study says."""

import numpy as np
import pytest

from batten.io.components_figure import figure
from batten.studies.component_paths import mirrored
from batten.studies.components import LEVEL, LEVELS, run


@pytest.fixture(scope="module")
def drawing():
    study = run(24)
    return study, figure(study)


def test_members_are_drawn_with_polygon_and_elastica(drawing):
    study, figure = drawing
    members = [axes for axes in figure.axes if axes.get_title().startswith("$e_")]
    assert len(members) == 8
    for axes, inner in zip(members, study.gallery):
        polygon, curve, elastica = axes.get_lines()
        assert polygon.get_xydata()[1:3].ravel() == pytest.approx(inner)
        apart = np.linalg.norm(elastica.get_xydata()[:, None] - curve.get_xydata(), axis=-1).min(axis=1)
        assert 0.0 < apart.max() < 0.1


def test_counts_and_the_way_over(drawing):
    study, figure = drawing
    counts = next(axes for axes in figure.axes if axes.get_title() == "number of components")
    drawn = [line.get_ydata().tolist() for line in counts.get_lines()]
    assert drawn[0::2][:3] == [[grid.on_grid(level) for level in LEVELS] for grid in study.grids]
    assert drawn[1::2][:3] == [[1] * len(LEVELS)] * 3
    over = next(axes for axes in figure.axes if "mirror image" in axes.get_title())
    values = over.get_lines()[0].get_ydata()
    assert values.max() < LEVEL
    assert values == pytest.approx(values[::-1], abs=1e-3)
    assert np.array_equal(study.paths[-1][-1], mirrored(study.paths[-1][0]))
