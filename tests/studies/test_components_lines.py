"""What the study of connected components prints: the answer, and that it changes with the numbers."""

import dataclasses

import numpy as np
import pytest

from batten.studies.components import LEVEL, LEVELS, run
from batten.studies.components_lines import lines


@pytest.fixture(scope="module")
def study():
    return run(16)


def test_the_answer_comes_first_and_lines_are_short(study):
    text = lines(study)
    assert text[0] == "Cubics with λ-residual < 0.2 and outer edges < 2: 1 connected component"
    assert "the same on all three grids" in text
    assert max(map(len, text)) <= 120
    assert any("its own mirror image" in line for line in text)


def test_each_grid_has_its_row(study):
    text = lines(study)
    for grid in study.grids:
        row = next(line.split() for line in text if line.startswith(f"{grid.size[0]} "))
        assert row[3] == str(grid.on_grid(LEVEL))
        assert row[-1] == "1"
        levels = next(line.split() for line in text if line.startswith(f"{grid.size[0]:>5} on grid"))
        assert levels[3:] == [str(grid.on_grid(level)) for level in LEVELS]


def test_other_numbers_give_another_answer(study):
    """A grid whose components have no path; random curves without one; a way over that does not stay below."""
    torn = dataclasses.replace(study.grids[-1], joined=np.full_like(study.grids[-1].joined, 1.0))
    lost = dataclasses.replace(study.sample, joined=np.full_like(study.sample.joined, 1.0))
    other = dataclasses.replace(study, grids=(*study.grids[:2], torn), sample=lost, safe=(*study.safe[:-1], False))
    text = lines(other)
    assert text[0].endswith(f"{torn.on_grid(LEVEL) + 1} connected components")
    assert any(line.startswith("NOT the same") for line in text)
    assert any(line.startswith(f"but {(study.sample.values < LEVEL).sum()} random curves") for line in text)
    assert not any("its own mirror image" in line for line in text)
