"""`batten cut` and `batten check` on the example's surface with nothing replaced, with few leaves to be quick."""

import json
import re
import shutil
from pathlib import Path

import pytest

from batten.cli.main import main

WALL = Path(__file__).parents[2] / "examples/freeform-wall"


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wall")
    shutil.copy(WALL / "freeform-surface.3dm", folder)
    text = (WALL / "wall.toml").read_text(encoding="utf-8")
    (folder / "wall.toml").write_text(re.sub(r"spacing_mm = [\d.]+", "spacing_mm = 120.0", text), encoding="utf-8")
    return folder / "wall.toml"


def test_a_cut_agrees_with_itself_when_it_is_computed_again(job, capsys):
    out = job.parent / "out"
    status = main(["cut", str(job), "-o", str(out), "--json"])
    summary = json.loads(capsys.readouterr().out)
    assert status == (0 if summary["whole"] else 1)
    assert summary["rods"] >= 25 * 4
    assert len(list((out / "rapid").iterdir())) <= 2 * summary["blocks"]
    for check in summary["checks"]:
        assert check["title"] in (out / "report.html").read_text(encoding="utf-8")
    status = main(["check", str(out), "--json"])
    again = json.loads(capsys.readouterr().out)
    assert [f for f in again["findings"] if not f["agrees"]] == []
    assert (again["whole"], status) == (summary["whole"], 0 if summary["whole"] else 1)


def test_a_rod_shorter_than_a_leaf_is_one_line_and_status_2(job, capsys):
    text = re.sub(r"length_mm = [\d.]+", "length_mm = 700.0", job.read_text(encoding="utf-8"))
    (job.parent / "short.toml").write_text(text, encoding="utf-8")
    assert main(["cut", str(job.parent / "short.toml"), "-o", str(job.parent / "short")]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert re.fullmatch(r"batten: .*rod of 700 mm is shorter than a leaf.*\n", said.err)
    assert not (job.parent / "short").exists()
