"""Files of a sampled study: a run that was killed goes on and ends with the same files; Parquet part by part."""

import dataclasses
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from pyarrow import parquet

from batten.cli.main import main
from batten.errors import InvalidInputError
from batten.io import study_files
from batten.io.study_files import run_in, write
from batten.io.study_parts import kept
from batten.measures.lambda_residual import lambda_residual
from batten.studies.projection import STUDY, ProjectionPart
from batten.studies.study import run

SMALL = dataclasses.replace(STUDY, part_size=300)


def test_a_stopped_run_goes_on(tmp_path):
    done, whole = [], run(SMALL, 1000, seed=4)

    def stop(stage, count, total):
        done.append(count)
        if count == 600:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_in(SMALL, tmp_path, 1000, seed=4, progress=stop, workers=1)
    assert len(list((tmp_path / "parts").iterdir())) == 2
    again = run_in(SMALL, tmp_path, 1000, seed=4, progress=lambda *words: done.append(words[1]), workers=1)
    assert done == [300, 600, 600, 900, 1000]
    assert np.array_equal(again.results.after, whole.results.after, equal_nan=True)


def test_a_part_that_is_broken_is_computed_again(tmp_path):
    whole = run_in(SMALL, tmp_path, 1000, seed=4)
    path = min((tmp_path / "parts").iterdir())
    path.write_bytes(path.read_bytes()[:100])
    assert kept(path, ProjectionPart) is None
    assert np.array_equal(run_in(SMALL, tmp_path, 1000, seed=4).results.before, whole.results.before)
    assert kept(path, ProjectionPart) is not None
    assert kept(tmp_path / "parts" / "none.npz", ProjectionPart) is None


def test_parts_serve_a_larger_study_and_no_other_seed_or_study(tmp_path):
    run_in(SMALL, tmp_path, 700, seed=4)
    told = []
    run_in(SMALL, tmp_path, 900, seed=4, progress=lambda *words: told.append(words[1]), workers=1)
    assert told == [600, 900]
    for study, seed in ((SMALL, 5), (dataclasses.replace(SMALL, name="other"), 4)):
        told.clear()
        run_in(study, tmp_path, 600, seed=seed, progress=lambda *words: told.append(words[1]), workers=1)
        assert told == [300, 600]


def _begun(folder, size, parts):
    """The command in a process of its own, when it has kept some parts of many."""
    words = ["study", "projection", "--size", str(size), "--seed", "3", "-o", str(folder), "--workers", "1"]
    process = subprocess.Popen([sys.executable, "-m", "batten.cli.main", *words], stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 60
    while len(list(folder.glob("parts/projection*.npz"))) < parts:
        assert process.poll() is None
        assert time.monotonic() < until
        time.sleep(0.005)
    return process, words


def test_a_killed_command_goes_on_to_the_same_files(tmp_path, kernels_compiled):
    def command(words):
        done = subprocess.run([sys.executable, "-m", "batten.cli.main", *words], stdout=subprocess.DEVNULL)
        return done.returncode

    size, folder = 60_000, tmp_path / "killed"
    process, words = _begun(folder, size, 2)
    process.send_signal(signal.SIGKILL)
    assert process.wait(timeout=30) == -signal.SIGKILL
    process.stderr.close()
    left = {path: path.stat().st_mtime_ns for path in folder.glob("parts/projection*.npz")}
    assert 2 <= len(left) < 6
    assert not (folder / "projection.txt").exists()
    assert command(words) == 0
    assert all(path.stat().st_mtime_ns == when for path, when in left.items())  # whole parts are not made again
    words[words.index(str(folder))] = str(tmp_path / "whole")
    assert command(words) == 0
    for name in ("projection.txt", "projection.parquet", "projection.png"):
        assert (folder / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    assert sorted(os.listdir(folder / "parts")) == sorted(os.listdir(tmp_path / "whole" / "parts"))


@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C of another process")
def test_ctrl_c_keeps_finished_parts_and_says_so(tmp_path):
    process, _ = _begun(tmp_path, 200_000, 1)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "finished parts are kept" in told
    assert "nothing was written" not in told
    assert 1 <= len(list(tmp_path.glob("parts/*.npz"))) < 20


def test_parquet_has_a_row_group_for_each_part_and_null_for_nan(tmp_path):
    outcome = run(SMALL, 1000, seed=1)
    paths = write(outcome, tmp_path)
    assert [p.name for p in paths] == ["projection.txt", "projection.parquet", "projection.png"]
    assert parquet.ParquetFile(paths[1]).num_row_groups == 4
    table = parquet.read_table(paths[1])
    assert table.num_rows == 1000
    control = np.column_stack([table[name].to_numpy() for name in table.column_names[:8]]).reshape(-1, 4, 2)
    assert lambda_residual(control) == pytest.approx(table["before"].to_numpy())
    assert table["after"].null_count + table["after_outside"].null_count == 1000
    assert np.array_equal(table["after_wide"].to_numpy(), outcome.results.after[:, 2], equal_nan=True)
    assert paths[0].read_text("utf-8").splitlines() == STUDY.lines(outcome)
    assert paths[2].read_bytes().startswith(b"\x89PNG")


def test_one_column_may_be_all_null_in_the_first_part(tmp_path):
    """The schema is taken from the first part: a column of NaN there is still one of numbers."""
    outcome = run(dataclasses.replace(STUDY, part_size=1), 12, seed=1)
    assert np.isnan(outcome.results.after[0]).any()
    table = parquet.read_table(write(outcome, tmp_path)[1])
    assert np.array_equal(table["after"].to_numpy(), outcome.results.after[:, 0], equal_nan=True)


def test_without_pyarrow_the_extra_is_named_before_anything_is_computed(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InvalidInputError, match='extra "studies"'):
        study_files.parquet_modules()
    assert main(["study", "projection", "--size", "10", "-o", str(tmp_path / "out")]) == 2
    assert not (tmp_path / "out").exists()
