"""The study of the feedback projection: the paper's statistics within sampling error, the same for any number of workers."""

import dataclasses

import numpy as np
import pytest

from batten.cli.main import main
from batten.errors import InvalidInputError
from batten.studies.projection import STUDY, columns, lines, run_part, statistics
from batten.studies.study import run


@pytest.fixture(scope="module")
def results():
    return run(STUDY, 20_000, seed=7).results


def test_statistics_within_sampling_error_of_a_hundred_thousand(results):
    """Mean 0.042, median 0.031, 99 % 0.158 within the constraints; 0.38 and 0.30 outside: three standard errors each."""
    table = statistics(results)
    spread = np.nanstd(results.after, axis=0) / np.sqrt(results.inside.sum(axis=0))
    assert table[0, 0] == pytest.approx(0.042, abs=3 * spread[0] + 5e-4)
    assert table[0, 1] == pytest.approx(0.031, abs=0.002)
    assert table[0, 2] == pytest.approx(0.158, abs=0.01)
    assert table[0, 4] < 0.3
    assert table[3, 0] == pytest.approx(0.38, abs=3 * spread[3] + 5e-3)
    assert table[3, 1] == pytest.approx(0.30, abs=0.015)
    assert results.inside[:, 0].mean() == pytest.approx(0.535, abs=0.015)
    assert (np.diff(results.inside.mean(axis=0)[:3]) > 0).all()


def test_the_number_of_workers_does_not_matter():
    study = dataclasses.replace(STUDY, part_size=500)
    one, three = run(study, 1800, seed=2, workers=1), run(study, 1800, seed=2, workers=3)
    for name in ("control_points", "before", "after"):
        assert np.array_equal(getattr(one.results, name), getattr(three.results, name), equal_nan=True)
    assert not np.array_equal(one.results.before, run(study, 1800, seed=3).results.before)


def test_the_command_prints_the_lines_and_writes_them(tmp_path, capsys):
    assert main(["study", "projection", "--size", "3000", "--seed", "1", "-o", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert printed.rstrip("\n").splitlines() == lines(run(STUDY, 3000, seed=1))
    assert (tmp_path / "projection.txt").read_text("utf-8") == printed


def test_columns_are_the_control_points_and_all_residuals():
    part = run_part(1, 0, 5)
    table = columns(part)
    assert list(table) == ["p0_x", "p0_y", "p1_x", "p1_y", "p2_x", "p2_y", "p3_x", "p3_y", "before", "after",
                           "after_relaxed", "after_wide", "after_outside"]  # fmt: skip
    assert np.array_equal(table["p2_y"], part.control_points[:, 2, 1])
    assert np.array_equal(table["after_relaxed"], part.after[:, 1], equal_nan=True)


def test_one_curve_makes_a_study():
    for seed in range(4):  # inside the constraints and outside
        assert "maximum" in "\n".join(lines(run(STUDY, 1, seed=seed)))


def test_bad_sizes(capsys):
    with pytest.raises(InvalidInputError, match="size"):
        run(STUDY, 0)
    assert main(["study", "projection", "--size", "0"]) == 2
