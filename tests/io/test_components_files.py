"""Files of the study of connected components: a run goes on from finished parts, and what is written can be read back."""

import numpy as np
import pytest
from pyarrow import parquet

from batten.errors import InvalidInputError
from batten.io import components_files
from batten.io.components_files import run_in, write
from batten.measures.lambda_residual import lambda_residual
from batten.studies.components import run
from batten.studies.components_lines import lines

SIZE = 16


def test_a_stopped_run_goes_on_from_whole_grids(tmp_path, monkeypatch):
    seen = []

    def stop(stage, done, total):
        seen.append(stage)
        if stage == "grid of 16":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_in(tmp_path, SIZE, 1, stop)
    kept = sorted(path.name for path in (tmp_path / "parts").iterdir())
    assert kept == ["components-grid-12.npz", "components-grid-8.npz"]
    seen.clear()
    again = run_in(tmp_path, SIZE, 1, lambda stage, done, total: seen.append(stage))
    assert not {"grid of 8", "grid of 12"} & set(seen)
    assert {"grid of 16", "paths from random curves"} <= set(seen)
    whole = run(SIZE, 1)
    for one, other in zip(again.grids, whole.grids):
        assert np.array_equal(one.least, other.least)
        assert np.array_equal(one.joined, other.joined)
    assert np.array_equal(again.sample.inner, whole.sample.inner)
    assert lines(again) == lines(whole)
    # Grids serve another seed; a torn file is computed again.
    path = tmp_path / "parts" / "components-grid-8.npz"
    path.write_bytes(path.read_bytes()[:50])
    monkeypatch.setattr(components_files, "run_grid", lambda size, progress: whole.grids[(8, 12, 16).index(size)])
    assert np.array_equal(run_in(tmp_path, SIZE, 2).grids[0].least, whole.grids[0].least)


def test_files_are_written_and_read_back(tmp_path):
    study = run(24)
    paths = write(study, tmp_path)
    assert [path.name for path in paths] == ["components.txt", "components.parquet", "components.png"]
    assert paths[0].read_text("utf-8").splitlines() == lines(study)
    assert paths[2].read_bytes().startswith(b"\x89PNG")
    table = parquet.read_table(paths[1])
    control = np.column_stack([table[f"p{i}_{axis}"].to_numpy() for i in range(4) for axis in "xy"]).reshape(-1, 4, 2)
    assert lambda_residual(control) == pytest.approx(table["lambda_residual"].to_numpy(), abs=1e-6)
    kinds = table["kind"].to_pylist()
    assert kinds.count("member") == 8
    assert kinds.count("body") == sum(len(grid.peaks) for grid in study.grids)
    assert kinds.count("neck") == kinds.count("body") - 3
    assert kinds.count("other") == 1
    way = control[[kind == "way over" for kind in kinds]]
    assert way[0] == pytest.approx(way[-1] * [1.0, -1.0])
    clear = table["clearance"].to_pylist()
    assert all((value is not None) == (kind in {"body", "neck"}) for value, kind in zip(clear, kinds))


def test_sizes_out_of_range_are_refused_before_anything_is_made(tmp_path):
    with pytest.raises(InvalidInputError, match="16 to 240"):
        run_in(tmp_path / "new", 10)
    assert not (tmp_path / "new").exists()
