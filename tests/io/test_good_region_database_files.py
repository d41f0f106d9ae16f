"""The database as a file: bit by bit the same, read by pyarrow alone, refused in words; its picture."""

import json

import numpy as np
import pytest
from pyarrow import parquet

from batten.errors import FormatError
from batten.io import good_region_database_files as files
from batten.measures.lambda_residual import lambda_residual
from batten.solvers.good_region_database import COLUMNS, build_good_region_database, standard_cubics


@pytest.fixture(scope="module")
def database():
    return build_good_region_database(spacing=1.0, cells=4)


def test_what_is_written_is_read_again(database, tmp_path):
    path = tmp_path / "good.parquet"
    files.write_good_region_database(database, path)
    again = files.read_good_region_database(path)
    assert np.array_equal(again.rows, database.rows)
    assert (again.spacing, again.cells) == (1.0, 4)
    assert (again.residual_below, again.angle_error_below) == (database.residual_below, database.angle_error_below)
    assert np.array_equal(again.matches("c0", "c2", (0.0, 2.0), 1.0), database.matches("c0", "c2", (0.0, 2.0), 1.0))
    table = parquet.read_table(path)
    assert table.column_names == list(COLUMNS)
    assert table.num_rows == len(database.rows) > 500
    assert json.loads(table.schema.metadata[b"batten"])["spacing"] == 1.0
    assert [p.name for p in tmp_path.iterdir()] == ["good.parquet"]


def test_other_files_are_refused_in_words(database, tmp_path):
    path = tmp_path / "other.parquet"
    path.write_bytes(b"PAR1 but no more")
    with pytest.raises(FormatError, match="not a Parquet file"):
        files.read_good_region_database(path)
    files.write_good_region_database(database, path)
    table = parquet.read_table(path)
    about = json.loads(table.schema.metadata[b"batten"])
    for change in (
        table.replace_schema_metadata({}),
        table.drop_columns(["c2_y"]),
        table.replace_schema_metadata({b"batten": json.dumps({**about, "spacing": None}).encode()}),
        table.replace_schema_metadata({b"batten": b"{"}),
    ):
        parquet.write_table(change, path)
        with pytest.raises(FormatError, match="batten study database"):
            files.read_good_region_database(path)
    parquet.write_table(table.replace_schema_metadata({b"batten": json.dumps({**about, "format": 9}).encode()}), path)
    with pytest.raises(FormatError, match="format 9"):
        files.read_good_region_database(path)
    with pytest.raises(FileNotFoundError):
        files.read_good_region_database(tmp_path / "missing.parquet")


def test_a_file_is_built_once_and_other_files_are_left_alone(database, tmp_path, monkeypatch):
    path, calls = tmp_path / "cached.parquet", []
    monkeypatch.setattr(files, "build_good_region_database", lambda progress: calls.append(progress) or database)
    first, second = files.good_region_database_at(path), files.good_region_database_at(path)
    assert len(calls) == 1
    assert np.array_equal(first.rows, second.rows)
    path.write_bytes(b"something else")
    with pytest.raises(FormatError):
        files.good_region_database_at(path)
    assert path.read_bytes() == b"something else"


def test_the_folder_holds_the_database_and_a_picture(database, tmp_path, monkeypatch):
    monkeypatch.setattr(files, "build_good_region_database", lambda progress: database)
    built, paths = files.write_database_folder(tmp_path / "new")
    assert built is database
    assert sorted(p.name for p in (tmp_path / "new").iterdir()) == ["good-regions.parquet", "good-regions.png"]
    assert paths[1].read_bytes().startswith(b"\x89PNG")
    lines = files.database_lines(database)
    assert f"{len(database.rows):,} cubic" in lines[0]
    assert "spacing 1 up to 4" in lines[1]


def test_cusps_are_where_the_residual_says_so():
    """At the dashed places the cubic has a cusp (value 1 by definition), beside them it has none."""
    c1 = np.array([-1.375, 2.125])
    places = files.cusp_places(c1, 64)
    places = places[np.isfinite(places).all(axis=1) & (np.abs(places).max(axis=1) < 20)]
    assert len(places) > 30
    cusps = lambda_residual(standard_cubics(c1, places[1:-1]), tolerance=1e-6)
    assert (cusps == 1.0).mean() > 0.95
    assert (lambda_residual(standard_cubics(c1, places[1:-1] + np.array([0.05, 0.1]))) < 1.0).all()


def test_the_figure_shows_the_three_panels_of_the_paper():
    figure = files.grids_figure()
    titles = [axes.get_title() for axes in figure.axes if axes.get_title()]
    assert titles == ["λ-residual by c₂", "refined grid of c₂", "‖∇e_λ‖ by c₂"]
