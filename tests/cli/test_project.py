"""`batten project`: exit status, tables, files; on the drawings of examples/project."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from batten.cli.main import main
from batten.io.bezier_paths import JsonPaths
from batten.io.project_files import missed, project_lines, project_paths, read_drawing
from batten.io.svg_paths import SvgPaths
from batten.measures.lambda_residual import lambda_residual

EXAMPLES = Path(__file__).parents[2] / "examples/project"


def run(capsys, *words):
    status = main([str(w) for w in ("project", *words)])
    said = capsys.readouterr()
    return status, said.out, said.err


def kinks(control_points):
    edges = np.diff(control_points, axis=1) @ np.array([1.0, 1.0j])
    return np.angle(edges[1:, 0] / edges[:-1, 2])


@pytest.mark.parametrize("keep", ["tangents", "points", "nothing"])
def test_a_drawing(capsys, tmp_path, keep):
    out = tmp_path / "chair.svg"
    status, said, err = run(capsys, EXAMPLES / "chair.svg", "--threshold", "0.1", "--keep", keep, "-o", out)
    assert err == ""
    old, new = SvgPaths(EXAMPLES / "chair.svg"), SvgPaths(out)
    worst = 0.0
    for a, b in zip(old.paths, new.paths, strict=True):
        assert (a.name, a.closed) == (b.name, b.closed)
        before, after = kinks(a.control_points), kinks(b.control_points)
        smooth = np.abs(before) < np.radians(0.1)
        np.testing.assert_allclose(after[smooth], before[smooth], atol=1e-9)
        assert (np.abs(after[~smooth]) > 0.1).all()
        free = ~b.fixed & (np.ptp(b.control_points, axis=1).min(axis=1) > 1e-3)
        worst = max(worst, lambda_residual(b.control_points[free]).max(initial=0.0))
        if keep != "nothing":
            np.testing.assert_allclose(a.control_points[:, [0, 3]], b.control_points[:, [0, 3]], atol=1e-9)
    assert (status == 0) == (worst <= 0.1 + 1e-6) == ("not reached" not in said)
    assert status == (1 if keep == "tangents" else 0)
    lines = said.splitlines()
    assert lines[0].split()[:4] == ["path", "cubics", "changed", "e_λ"]
    assert lines[1].split()[:3] == ["shell", "4", "2"]
    assert "1 × <rect> left as it is" in lines
    assert lines[-1] == f"written: {out}"
    assert [p.name for p in tmp_path.iterdir()] == ["chair.svg"]
    kept = [
        line for line in (EXAMPLES / "chair.svg").read_text().splitlines() if " d=" not in line and "c 30,8" not in line
    ]
    assert set(kept) - set(out.read_text().splitlines()) <= {line for line in kept if "m70,-14" in line}


def test_without_a_threshold_the_least_is_taken_and_files_change_their_format(capsys, tmp_path):
    for name in ("sign.svg", "sign.dxf", "sign.3dm", "sign.json"):
        status, said, _ = run(capsys, EXAMPLES / "sign.json", "-o", tmp_path / name)
        assert status == 0
    assert said.splitlines()[1].startswith("S           3        3  0.200  0.0")
    made = JsonPaths(tmp_path / "sign.json").paths
    for name in ("sign.svg", "sign.3dm"):
        for a, b in zip(made, read_drawing(tmp_path / name).paths, strict=True):
            count = len(a.control_points)
            np.testing.assert_allclose(a.control_points, b.control_points[:count], atol=1e-8)
            assert a.closed == b.closed


def test_the_file_itself_may_be_written_and_a_second_time_changes_nothing(capsys, tmp_path):
    file = tmp_path / "sign.json"
    shutil.copy(EXAMPLES / "sign.json", file)
    assert run(capsys, file, "--keep", "points", "-o", file)[0] == 0
    first = file.read_bytes()
    assert first != (EXAMPLES / "sign.json").read_bytes()
    assert run(capsys, file, "--keep", "points", "-o", file)[0] == 0
    assert file.read_bytes() == first


def test_what_was_missed_is_named():
    results = project_paths(read_drawing(EXAMPLES / "chair.svg").paths, "feedback", threshold=0.01)
    lines = missed(results)
    assert any(line.startswith("shell, cubic 1: e_λ 0.") for line in lines)
    assert project_lines(results)[-len(lines) :] == [f"not reached: {line}" for line in lines]
    assert 0.0 < max(r.moved for r in results) < 0.5


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["absent.svg", "-o", "o.svg"], "absent.svg: no such file"),
        (
            [str(EXAMPLES / "chair.svg"), "-o", "o.pdf"],
            "o.pdf: has the ending .pdf; allowed are .svg, .dxf, .3dm, .json",
        ),
        ([str(EXAMPLES / "chair.svg"), "-o", "absent/o.svg"], "there is no folder absent"),
        (["in.dxf", "-o", "o.svg"], "in.dxf: has the ending .dxf; allowed are .svg, .json, .3dm"),
        (["bad.svg", "-o", "o.svg"], "bad.svg: line 1"),
        (["empty.svg", "-o", "o.svg"], "has no curves to project"),
        (
            [str(EXAMPLES / "chair.svg"), "-o", "o.svg", "--threshold", "2"],
            "--threshold 2: allowed are numbers between",
        ),
        ([str(EXAMPLES / "chair.svg"), "-o", "o.svg", "--keep", "all"], "Invalid value for '--keep'"),
        (
            [str(EXAMPLES / "chair.svg"), "-o", "o.svg", "--keep", "points", "--method", "zone"],
            "--keep points needs --method nearest",
        ),
        ([str(EXAMPLES / "chair.svg"), "-o", "o.svg", "--method", "zone", "--threshold", "0.2"], "threshold"),
        ([str(EXAMPLES / "chair.svg"), "-o", "o.svg", "--smooth", "nan"], "--smooth nan: allowed are degrees"),
        ([str(EXAMPLES / "chair.svg")], "Missing option"),
    ],
)
def test_bad_input_is_status_2_and_one_line(capsys, tmp_path, monkeypatch, words, says):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.svg").write_text("<svg><path d='M 0 0 C 1'/></svg>")
    (tmp_path / "empty.svg").write_text("<svg><circle r='2'/></svg>")
    status, out, err = run(capsys, *words)
    assert (status, out) == (2, "")
    assert says in err
    assert err.count("\n") == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bad.svg", "empty.svg"]


def test_help_loads_next_to_nothing():
    script = """
import sys
from batten.cli.main import main
main(["project", "--help"])
print("loaded:", sorted({"numpy", "numba", "scipy", "svgelements", "rhino3dm", "ezdxf"} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "loaded: []" in done.stdout
    assert "--keep" in done.stdout


def test_what_the_file_calls_open_may_turn_on_each_side_of_its_seam(tmp_path):
    """A loop whose ends meet smoothly: one joint if it is closed, two ends if it is not."""
    points = "[[0,0],[1,3],[8,2],[8,4],[8,6],[6,8],[3,8],[-9,8],[-1,-3],[0,0]]"
    found = {}
    for word in ("true", "false"):
        file = tmp_path / f"{word}.json"
        file.write_text(f'{{"paths": [{{"closed": {word}, "points": {points}}}]}}')
        (result,) = project_paths(read_drawing(file).paths, threshold=0.05, keep="points")
        found[word] = result.projection
        assert result.projection.reached.all()
    assert found["true"].smooth[-1]
    assert not found["false"].smooth[-1]
    assert found["true"].turned[-1, 1] == pytest.approx(found["true"].turned[0, 0], abs=1e-12)
    assert abs(found["false"].turned[-1, 1] - found["false"].turned[0, 0]) > 1e-4
