"""The command: exit status, one line for what is wrong, nothing half-written, quick help."""

import dataclasses
import json
import shutil
import signal
import subprocess
import sys
import time
import types
from pathlib import Path

import pytest
import rhino3dm

from batten.cli.main import main
from batten.cli.progress import StageProgress
from batten.errors import ConvergenceError, LimitError

WALL = Path(__file__).parents[2] / "examples/freeform-wall"
JOB = """\
[surface]
file = "freeform-surface.3dm"
scale_mm_per_unit = 300.0
[blocks]
size_mm = [600.0, 600.0]
direction = "u"
[leaves]
spacing_mm = 20.0
tolerance_mm = 0.5
[rod]
length_mm = 1000.0
diameter_mm = 3.0
youngs_modulus_mpa = 200000.0
max_strain = 0.008
[blade]
kerf_mm = 1.0
speed_mm_s = 20.0
[cell]
preset = "two-irb6620"
"""


@pytest.fixture
def folder(tmp_path):
    shutil.copy(WALL / "freeform-surface.3dm", tmp_path)
    (tmp_path / "wall.toml").write_text(JOB, encoding="utf-8")
    return tmp_path


@pytest.fixture
def planned(monkeypatch, make_plan):
    """`plan_cut` replaced by one that gives a made-up plan at once; `planned(...)` says which plan or what to do."""
    fake = types.ModuleType("batten.fabrication.cut")
    fake.check_again = lambda plan, job, surface: plan.checks
    monkeypatch.setitem(sys.modules, "batten.fabrication.cut", fake)

    def choose(refused=(), act=None):
        def plan_cut(job, surface, progress=None):
            if act is not None:
                act()
            progress("plan", 1, 1)
            plan, _ = make_plan(rows=1, columns=1, leaves=3, refused=refused, name=job.name)
            return dataclasses.replace(plan, checks=tuple(c for c in plan.checks if refused or c.name != "strain"))

        fake.plan_cut = plan_cut

    choose()
    return choose


def run(capsys, *words):
    status = main([str(w) for w in words])
    said = capsys.readouterr()
    return status, said.out, said.err


def test_a_whole_cut(folder, planned, capsys):
    status, out, err = run(capsys, "cut", folder / "wall.toml", "-o", folder / "out", "--no-pictures")
    assert (status, err) == (0, "")
    assert "Can be cut" in out
    assert out.rstrip().endswith(f"report: {folder / 'out' / 'report.html'}")
    assert (folder / "out/report.html").is_file()
    status, out, err = run(capsys, "check", folder / "out")
    assert (status, err) == (0, "")
    assert "DIFF" not in out
    assert out.rstrip().endswith("everything agrees; whole")


def test_a_refused_leaf_is_status_1_and_is_written_all_the_same(folder, planned, capsys):
    planned(refused=(2,))
    status, out, _ = run(capsys, "cut", folder / "wall.toml", "-o", folder / "out", "--json", "--no-pictures")
    summary = json.loads(out)
    assert status == 1
    assert summary["whole"] is False
    assert summary["refused_leaves"] == [2]
    assert summary["checks"][0] == {
        "name": "strain", "title": "Strain on the whole rod", "unit": "", "sense": "max", "limit": 0.008,
        "worst": 0.0093, "margin": pytest.approx(-0.0013), "leaf": 2, "block": 1, "rods_beyond": 1, "hard": True,
    }  # fmt: skip
    status, out, _ = run(capsys, "check", folder / "out", "--json")
    assert status == 1
    assert json.loads(out)["agrees"] is True
    (folder / "out/rods.csv").write_text("")
    assert json.loads(run(capsys, "check", folder / "out", "--json")[1])["agrees"] is False


def write_model(path, geometry, unit=rhino3dm.UnitSystem.Millimeters):
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = unit
    model.Objects.Add(geometry, rhino3dm.ObjectAttributes())
    assert model.Write(str(path), 7)


def flat_surface(height=0.0):
    surface = rhino3dm.NurbsSurface.Create(3, False, 2, 2, 2, 2)
    for i in range(2):
        for j in range(2):
            surface.Points[i, j] = rhino3dm.Point4d(10.0 * i, 10.0 * j, height, 1.0)
    for knots in (surface.KnotsU, surface.KnotsV):
        knots[0], knots[1] = 0.0, 1.0
    return surface


def circle():
    return rhino3dm.Circle(rhino3dm.Point3d(0.0, 0.0, 0.0), 1.0).ToNurbsCurve()


BAD_MODELS = {
    "no surface in it": lambda path: write_model(path, circle()),
    "unit unset": lambda path: write_model(path, flat_surface(), getattr(rhino3dm.UnitSystem, "None")),
    "NaN in control points": lambda path: write_model(path, flat_surface(float("nan"))),
    "a trimmed face": lambda path: write_model(
        path, rhino3dm.Brep.CreateTrimmedPlane(rhino3dm.Plane.WorldXY(), circle())
    ),
    "not a Rhino file": lambda path: path.write_text("tea"),
}
SAYS = ("no surface", "set scale_mm_per_unit", "NaN", "is trimmed", "is not a Rhino file")


@pytest.mark.parametrize(("what", "says"), list(zip(BAD_MODELS, SAYS)), ids=list(BAD_MODELS))
def test_a_bad_surface_is_one_line_and_status_2(folder, planned, capsys, what, says):
    BAD_MODELS[what](folder / "freeform-surface.3dm")
    job = JOB if what != "unit unset" else "\n".join(x for x in JOB.splitlines() if not x.startswith("scale_mm"))
    (folder / "wall.toml").write_text(job, encoding="utf-8")
    status, out, err = run(capsys, "cut", folder / "wall.toml", "-o", folder / "out")
    assert (status, out) == (2, "")
    assert err.startswith(f"batten: {folder / 'freeform-surface.3dm'}")
    assert says in err
    assert err.count("\n") == 1
    assert sorted(p.name for p in folder.iterdir()) == ["freeform-surface.3dm", "wall.toml"]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("freeform-surface.3dm", "absent.3dm", "no such file"),
        ("size_mm = [600.0, 600.0]", "size_mm = [600.0, -600.0]", "blocks.size_mm = [600.0, -600.0]: must be"),
        ("length_mm = ", "length_mm = 0.5e-0#", "rod.length_mm = 0.5: a rod must be longer than its leaf"),
        ("tolerance_mm = ", "tolerance_mm = 0#", "leaves.tolerance_mm = 0: must be a number > 0"),
        ("tolerance_mm = ", "tolerance_mm = nan#", "leaves.tolerance_mm = nan"),
        ('preset = "two-irb6620"', 'preset = "three-arms"', "no cell is called 'three-arms'"),
    ],
)
def test_a_bad_job_is_one_line_and_status_2(folder, planned, capsys, old, new, says):
    assert old in JOB
    (folder / "wall.toml").write_text(JOB.replace(old, new), encoding="utf-8")
    status, out, err = run(capsys, "cut", folder / "wall.toml", "-o", folder / "out")
    assert (status, out) == (2, "")
    assert says in err
    assert err.count("\n") == 1
    assert not (folder / "out").exists()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["cut"], "Missing argument"),
        (["cut", "a.toml"], "Missing option"),
        (["cut", "a.toml", "-o", "x", "--speed"], "No such option"),
        (["cook"], "No such command"),
        (["cut", "absent.toml", "-o", "x"], "absent.toml: no such file"),
        (["check", "nowhere"], "no such file; give a folder that `batten cut` made"),
    ],
)
def test_a_wrong_call_is_one_line_and_status_2(capsys, words, says, tmp_path, monkeypatch, planned):
    monkeypatch.chdir(tmp_path)
    status, out, err = run(capsys, *words)
    assert (status, out) == (2, "")
    assert says in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("error", "status", "says"),
    [
        (LimitError("leaf 3: strain 0.01 over 0.008"), 1, "batten: leaf 3: strain 0.01 over 0.008\n"),
        (ConvergenceError("the fit of leaf 3\ndid not end"), 2, "batten: the fit of leaf 3 did not end\n"),
        (OSError(28, "No space left on device"), 2, "batten: No space left on device; nothing was written\n"),
        (KeyboardInterrupt(), 130, "batten: interrupted; nothing was written\n"),
    ],
)
def test_errors_become_a_line_and_a_status(folder, planned, capsys, error, status, says):
    def fail():
        raise error

    planned(act=fail)
    assert run(capsys, "cut", folder / "wall.toml", "-o", folder / "out") == (status, "", says)
    assert not (folder / "out").exists()


def test_a_fault_of_battens_own_shows_its_trace_and_is_not_taken_for_bad_input(folder, planned, capsys):
    planned(act=lambda: 1 // 0)
    status, _, err = run(capsys, "cut", folder / "wall.toml", "-o", folder / "out")
    assert status == 70
    assert "ZeroDivisionError" in err
    assert err.endswith("batten: this is a fault in batten; please report it with the lines above\n")


def test_a_place_that_cannot_be_written_is_one_line(folder, planned, capsys):
    status, out, err = run(capsys, "cut", folder / "wall.toml", "-o", folder / "wall.toml" / "out")
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert f"{folder / 'wall.toml'} is a file and can hold no folder" in err
    (folder / "mine").mkdir()
    (folder / "mine/letter.txt").write_text("dear")
    status, _, err = run(capsys, "cut", folder / "wall.toml", "-o", folder / "mine")
    assert status == 2
    assert "was not made by batten" in err
    assert [p.name for p in (folder / "mine").iterdir()] == ["letter.txt"]


SLOW = """
import sys, time, types
fake = types.ModuleType("batten.fabrication.cut")
def plan_cut(job, surface, progress=None):
    print("planning", flush=True)
    time.sleep(30)
fake.plan_cut = plan_cut
sys.modules["batten.fabrication.cut"] = fake
from batten.cli.main import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals work otherwise there")
@pytest.mark.parametrize(
    ("number", "status", "says"),
    [(signal.SIGINT, 130, "batten: interrupted; nothing was written\n"), (signal.SIGTERM, 143, "")],
)
def test_being_stopped_leaves_nothing(folder, number, status, says):
    before = sorted(p.name for p in folder.iterdir())
    words = [sys.executable, "-c", SLOW, "cut", str(folder / "wall.toml"), "-o", str(folder / "out")]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "planning\n"
        process.send_signal(number)
        _, err = process.communicate(timeout=20)
    assert (process.returncode, err) == (status, says)
    assert sorted(p.name for p in folder.iterdir()) == before


def test_help_and_version_load_next_to_nothing():
    script = """
import sys
from batten.cli.main import main
main(["--help"]); main(["cut", "--help"]); main(["--version"]); main([])
heavy = {"numpy", "numba", "scipy", "matplotlib", "rhino3dm", "rich.progress"}
print("loaded:", sorted(heavy & set(sys.modules)))
"""
    began = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "loaded: []" in done.stdout
    assert "JOB.toml" in done.stdout
    assert "batten 0." in done.stdout
    assert time.perf_counter() - began < 5.0  # half a second on an idle machine; what matters is the line above


def test_progress_is_plain_where_there_is_no_terminal(capsys, monkeypatch):
    clock = iter([0.0, 0.2, 0.4, 0.5, 2.0])
    monkeypatch.setattr(time, "monotonic", lambda: next(clock))
    with StageProgress() as progress:
        progress("quick", 0, 2)
        progress("quick", 1, 2)
        progress("quick", 2, 2)
        progress("slow", 0, 1)
        progress("slow", 1, 1)
    assert capsys.readouterr().err == "slow: 1.5 s\n"
    clock = iter([0.0, 5.0])

    def fail_after_a_slow_stage():
        with StageProgress() as progress:
            progress("slow", 0, 1)
            progress("slow", 1, 1)
            raise LimitError

    with pytest.raises(LimitError):
        fail_after_a_slow_stage()
    assert capsys.readouterr().err == "", "an error is told in one line, and that line alone"


def test_progress_draws_bars_on_a_terminal(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    with StageProgress() as progress:
        for done in range(3):
            progress("fit", done, 2)
    said = capsys.readouterr()
    assert said.out == ""
    assert "2/2" in said.err
