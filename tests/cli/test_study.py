"""The command `batten study`."""

from batten.cli.main import main


def test_boundary_prints_the_tables_and_writes_them(tmp_path, capsys):
    out = tmp_path / "study"
    assert main(["study", "boundary", "--size", "2", "--seed", "1", "-o", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "the elastica asked for is missing in 0 of 2 problems" in printed
    assert "Table B.1" in printed
    names = {path.name for path in out.iterdir()}
    assert {"study.txt", "problems.csv", "table-2.1.csv", "table-b1.csv", "figure-2.13.png"} <= names
    assert (out / "study.txt").read_text("utf-8").strip() in printed


def test_a_size_of_nothing_is_refused(capsys):
    assert main(["study", "boundary", "--size", "0"]) == 2
    assert "--size" in capsys.readouterr().err


def test_an_unknown_study_is_refused(capsys):
    assert main(["study", "nothing"]) == 2
    assert "nothing" in capsys.readouterr().err
