"""The study of the feedback projection: the paper's statistics within sampling error, the same for any number of workers."""

import numpy as np
import pytest
from pyarrow import parquet

from batten.cli.main import main
from batten.errors import InvalidInputError
from batten.io import projection_study_files, study_parts
from batten.measures.lambda_residual import lambda_residual
from batten.studies import projection
from batten.studies.projection import lines, run, statistics


@pytest.fixture(scope="module")
def study():
    return run(20_000, seed=7)


def test_statistics_within_sampling_error_of_a_hundred_thousand(study):
    """Mean 0.042, median 0.031, 99 % 0.158 within the constraints; 0.38 and 0.30 outside: three standard errors each."""
    table = statistics(study)
    spread = np.nanstd(study.results.after, axis=0) / np.sqrt(study.inside.sum(axis=0))
    assert table[0, 0] == pytest.approx(0.042, abs=3 * spread[0] + 5e-4)
    assert table[0, 1] == pytest.approx(0.031, abs=0.002)
    assert table[0, 2] == pytest.approx(0.158, abs=0.01)
    assert table[0, 4] < 0.3
    assert table[3, 0] == pytest.approx(0.38, abs=3 * spread[3] + 5e-3)
    assert table[3, 1] == pytest.approx(0.30, abs=0.015)
    assert study.inside[:, 0].mean() == pytest.approx(0.535, abs=0.015)
    assert (np.diff(study.inside.mean(axis=0)[:3]) > 0).all()


def test_the_number_of_workers_does_not_matter(monkeypatch):
    monkeypatch.setattr(projection, "PART", 500)
    one, three = run(1800, seed=2, workers=1), run(1800, seed=2, workers=3)
    for name in ("control_points", "before", "after"):
        assert np.array_equal(getattr(one.results, name), getattr(three.results, name), equal_nan=True)
    assert not np.array_equal(one.results.before, run(1800, seed=3).results.before)


def test_a_stopped_run_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr(projection, "PART", 300)
    monkeypatch.setattr(projection_study_files, "PART", 300)
    done, whole = [], run(1000, seed=4)

    def stop(stage, count, total):
        done.append(count)
        if count == 600:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        projection_study_files.run_in(tmp_path, 1000, seed=4, progress=stop, workers=1)
    assert len(list((tmp_path / "parts").iterdir())) == 2
    again = projection_study_files.run_in(tmp_path, 1000, seed=4, progress=lambda *a: done.append(a[1]))
    assert done == [300, 600, 900, 1000]
    assert np.array_equal(again.results.after, whole.results.after, equal_nan=True)
    path = sorted((tmp_path / "parts").iterdir())[0]
    path.write_bytes(path.read_bytes()[:100])
    assert np.array_equal(projection_study_files.run_in(tmp_path, 1000, seed=4).results.before, whole.results.before)
    assert study_parts.kept(tmp_path / "parts" / "none.npz", projection.ProjectionPart) is None


def test_the_command_writes_parquet_and_a_figure(tmp_path, capsys):
    assert main(["study", "projection", "--size", "3000", "--seed", "1", "-o", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert printed.rstrip("\n").splitlines() == lines(run(3000, seed=1))
    table = parquet.read_table(tmp_path / "curves.parquet")
    assert table.column_names == list(projection_study_files.COLUMNS)
    assert table.num_rows == 3000
    control = np.column_stack([table[name].to_numpy() for name in table.column_names[:8]]).reshape(-1, 4, 2)
    assert lambda_residual(control) == pytest.approx(table["before"].to_numpy())
    assert table["after"].null_count + table["after_outside"].null_count == 3000
    assert (tmp_path / "projection.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "study.txt").read_text("utf-8") == printed


def test_bad_sizes(capsys):
    with pytest.raises(InvalidInputError, match="size"):
        run(0)
    assert main(["study", "projection", "--size", "0"]) == 2
