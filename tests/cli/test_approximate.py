"""`batten approximate`: exit status, the table, files, one line for what is wrong."""

from pathlib import Path

import pytest

from batten.cli.main import main

CHAIR = Path(__file__).parents[2] / "examples/project/chair.svg"
WAVE = '<svg xmlns="http://www.w3.org/2000/svg"><path id="wave" d="M0 0C10 30 30 -20 40 10"/></svg>'


def run(capsys, *words):
    status = main([str(w) for w in ("approximate", *words)])
    said = capsys.readouterr()
    return status, said.out, said.err


@pytest.fixture
def wave(tmp_path):
    path = tmp_path / "wave.svg"
    path.write_text(WAVE)
    return path


@pytest.mark.parametrize("suffix", ["svg", "dxf", "3dm", "json"])
def test_files_are_written(wave, capsys, tmp_path, suffix):
    out = tmp_path / f"out.{suffix}"
    status, said, wrong = run(capsys, wave, "--tolerance", "0.1", "-o", out)
    assert (status, wrong) == (0, "")
    assert said.splitlines()[1].split()[0] == "wave"
    assert said.endswith(f"written: {out}\n")
    assert out.stat().st_size > 200


def test_options_reach_the_solver(wave, capsys, tmp_path):
    words = (wave, "--tolerance", "0.01", "-o", tmp_path / "out.json", "--split", "bisect", "--continuity", "C0")
    status, said, _ = run(capsys, *words)
    assert status == 0
    pieces, bisection = said.splitlines()[1].split()[1:3]
    assert pieces == bisection


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (("none.svg", "--tolerance", "1", "-o", "out.svg"), "no such file"),
        ((CHAIR, "--tolerance", "0", "-o", "out.svg"), "--tolerance"),
        ((CHAIR, "--tolerance", "nan", "-o", "out.svg"), "--tolerance"),
        ((CHAIR, "--tolerance", "1", "-o", "out.png"), "ending"),
        ((CHAIR, "--tolerance", "1e-9", "-o", "out.svg"), "tolerance"),
        ((CHAIR, "--tolerance", "1", "-o", "out.svg", "--continuity", "C7"), "C7"),
    ],
)
def test_bad_input_is_one_line(words, what, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, said, wrong = run(capsys, *words)
    assert (status, said) == (2, "")
    assert wrong.startswith("batten: ")
    assert wrong.count("\n") == 1
    assert what in wrong
    assert list(tmp_path.iterdir()) == []
