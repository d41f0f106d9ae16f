"""The command `batten study`."""

from batten.cli.main import main
from batten.studies import annulus, projection


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


def test_the_default_sizes_in_the_help_are_those_of_the_studies(capsys):
    for name, module in (("projection", projection), ("annulus", annulus)):
        assert main(["study", name, "--help"]) == 0
        assert f"{module.DEFAULT_SIZE:,}" in " ".join(capsys.readouterr().out.split())


def test_workers_and_a_scheduler_exclude_each_other(capsys):
    words = ["study", "annulus", "--size", "1", "--workers", "2", "--scheduler", "tcp://127.0.0.1:1"]
    assert main(words) == 2
    assert "workers or a scheduler" in capsys.readouterr().err


def test_every_sampled_study_has_the_same_options(capsys):
    for name in ("projection", "methods", "annulus", "random", "zone", "fits", "bound", "regions"):
        assert main(["study", name, "--help"]) == 0
        printed = capsys.readouterr().out
        assert all(option in printed for option in ("--size", "--seed", "--out", "--workers", "--scheduler"))
