"""`batten bend`: exit status, one line for what is wrong, files and tables; a made-up solver, and once batten's own."""

import json
import math
import subprocess
import sys
import types
from pathlib import Path

import pytest

from batten.cli.bend import end_of, length_of
from batten.cli.main import main
from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError, NoSolutionError
from batten.io.bend_json import read_bend_json
from batten.solvers.boundary_value import BoundarySolution

ROD = Path(__file__).parents[2] / "examples/bend/rod.toml"
ENDS = ("--start", "-1,0,0", "--end", "0.5,-.2,30deg")


@pytest.fixture
def solver(monkeypatch):
    """`solve_boundary` replaced by one that gives two arcs and remembers what it was asked; `solver.act` is done first."""
    fake = types.ModuleType("batten.solvers.boundary_value")
    fake.act = lambda: None

    def solve_boundary(start, start_angle, end, end_angle, length, **options):
        fake.asked = (start, start_angle, end, end_angle, length, options)
        fake.act()
        arcs = [Elastica(start, start_angle, k / length, (0.0, 0.0), length) for k in (2.0, -1.0)]
        return [
            BoundarySolution(arc, arc.bending_energy(), 0, k / (2 * math.pi), stable, margin, 0.0)
            for arc, k, stable, margin in zip(arcs, (2.0, -1.0), (False, True), (0.5, math.inf))
        ]

    fake.solve_boundary = solve_boundary
    monkeypatch.setitem(sys.modules, "batten.solvers.boundary_value", fake)
    return fake


def run(capsys, *words):
    status = main([str(w) for w in ("bend", *words)])
    said = capsys.readouterr()
    return status, said.out, said.err


def test_the_table_and_what_the_solver_is_asked(solver, capsys):
    status, out, err = run(capsys, *ENDS, "--length", "2")
    assert (status, err) == (0, "")
    options = {"max_inflections": 2, "max_turns": 1, "end_angle_modulo": False}
    assert solver.asked == ((-1.0, 0.0), 0.0, (0.5, -0.2), math.radians(30.0), 2.0, options)
    lines = out.splitlines()
    assert lines[0] == "length 2 from (−1, 0), 0° to (0.5, −0.2), 30°: 2 shapes, 1 of them stable"
    assert [line.split()[:2] for line in lines[2:]] == [["1", "yes"], ["2", "no"]]
    status, _, _ = run(capsys, *ENDS, "--length", "2", "--max-inflections", "5", "--any-winding")
    assert status == 0
    assert solver.asked[5] == {"max_inflections": 5, "max_turns": 1, "end_angle_modulo": True}


def test_a_rod_gives_the_length_and_the_second_table(solver, capsys):
    status, out, _ = run(capsys, "--start", "0,0,0", "--end", "600,0,0", "--rod", ROD)
    assert status == 0
    assert solver.asked[4] == 1000.0
    assert "rod: round, Ø 3 mm, E = 200000 MPa" in out
    assert "energy J" in out
    run(capsys, "--start", "0,0,0", "--end", "600,0,0", "--rod", ROD, "--length", "750.5")
    assert solver.asked[4] == 750.5


@pytest.mark.parametrize("suffix", ["svg", "dxf", "3dm", "json", "png"])
def test_files_are_written(solver, capsys, tmp_path, suffix):
    path = tmp_path / f"out.{suffix}"
    status, out, _ = run(capsys, *ENDS, "--length", "2", "-o", path)
    assert status == 0
    assert out.endswith(f"written: {path}\n")
    assert path.stat().st_size > 500
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_json_on_stdout_is_the_file_and_several_files_are_written(solver, capsys, tmp_path):
    files = [tmp_path / "out.json", tmp_path / "out.svg"]
    status, out, _ = run(capsys, *ENDS, "--length", "2", "--json", "-o", files[0], "-o", files[1])
    assert status == 0
    assert out == files[0].read_text(encoding="utf-8")
    assert json.loads(out)["solutions"][0]["margin"] == "Infinity"
    assert files[1].is_file()


@pytest.mark.parametrize("act", ["none", "error"])
def test_no_shape_is_status_1_and_one_line(solver, capsys, tmp_path, act):
    def fail():
        raise NoSolutionError("length 2 is below the chord 3")

    if act == "none":
        solver.solve_boundary = lambda *arguments, **options: []
    solver.act = fail
    status, out, err = run(capsys, *ENDS, "--length", "2", "-o", tmp_path / "out.svg")
    assert (status, out) == (1, "")
    assert ("no shape of length 2 with at most 2 inflections" if act == "none" else "is below the chord") in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"--start": "0,0"}, "--start '0,0': has 2 parts; allowed is X,Y,ANGLE"),
        ({"--start": "0,zero,0"}, "--start '0,zero,0': Y = 'zero': allowed are finite numbers"),
        ({"--end": "0,1,pi/2"}, "--end '0,1,pi/2': ANGLE = 'pi/2': allowed are finite numbers such as 30deg, 0.5rad"),
        ({"--end": "nan,1,0"}, "X = 'nan'"),
        ({"--end": "1e999,1,0"}, "X = '1e999'"),
        ({"--length": "0"}, "--length 0: allowed are numbers above 0"),
        ({"--length": "-2"}, "--length -2: allowed are numbers above 0"),
        ({"--length": "long"}, "--length = 'long'"),
        ({"--length": None}, "--length is missing; give the rod's length, or a --rod"),
        ({"--start": None}, "Missing option '--start'"),
        ({"--max-inflections": "-1"}, "--max-inflections -1: allowed are whole numbers, 0 or more"),
        ({"--max-inflections": "two"}, "Invalid value for '--max-inflections'"),
        ({"--rod": "absent.toml"}, "absent.toml: no such file; give the path of a rod file"),
        ({"-o": "out.pdf"}, "out.pdf: has the ending .pdf; allowed are .svg, .dxf, .3dm, .json, .png"),
        ({"-o": "absent/out.svg"}, "there is no folder"),
    ],
)
def test_bad_input_is_status_2_and_one_line_before_anything_is_solved(
    solver, capsys, change, says, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    options = {"--start": "0,0,0", "--end": "1,0,0", "--length": "2"} | change
    words = [word for pair in options.items() if pair[1] is not None for word in pair]
    status, out, err = run(capsys, *words)
    assert (status, out) == (2, "")
    assert says in err
    assert err.count("\n") == 1
    assert not hasattr(solver, "asked")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "end"),
    [
        ("0,0,0", (0.0, 0.0, 0.0)),
        ("-1.5,+2e1,-90deg", (-1.5, 20.0, -math.pi / 2)),
        (" .5 , 3. , 0.25 rad", (0.5, 3.0, 0.25)),
        ("1,2,450deg", (1.0, 2.0, 2.5 * math.pi)),
        ("1,2,-1e-3", (1.0, 2.0, -1e-3)),
    ],
)
def test_ends(text, end):
    assert end_of(text, "--start") == pytest.approx(end, abs=0.0, rel=1e-15)


@pytest.mark.parametrize(
    "text", ["1,2,30degrees", "1,2,0x10", "1,2,", "1,,3", "1;2;3", "1,2,inf", "1_0,2,3", "1,2,3,4"]
)
def test_what_is_no_end(text):
    with pytest.raises(InvalidInputError, match="--end"):
        end_of(text, "--end")
    assert length_of(" 2.5 ") == 2.5


def test_help_loads_next_to_nothing():
    script = """
import sys
from batten.cli.main import main
main(["bend", "--help"])
print("loaded:", sorted({"numpy", "numba", "scipy", "matplotlib", "rhino3dm", "ezdxf"} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "loaded: []" in done.stdout
    assert "X,Y,ANGLE" in done.stdout


def test_for_real(capsys, tmp_path):
    path = tmp_path / "out.json"
    words = ("--start", "0,0,60deg", "--end", "600,100,-30deg", "--rod", ROD, "-o", path)
    status, out, err = run(capsys, *words)
    assert (status, err) == (0, "")
    stored = read_bend_json(path)
    assert len(stored.solutions) >= 2
    for solution in stored.solutions:
        curve = solution.elastica
        assert curve.point_at(curve.length) == pytest.approx([600.0, 100.0], abs=1e-6)
        assert float(curve.angle_at(curve.length)) == pytest.approx(-math.pi / 6, abs=1e-9)
    assert "! above the rod's 0.8 %" in out
    status, out, err = run(capsys, "--start", "0,0,0", "--end", "3,0,0", "--length", "2")
    assert (status, out) == (1, "")
    assert err.count("\n") == 1


def test_pinned_ends(tmp_path, capsys):
    out = [tmp_path / f"bent.{kind}" for kind in ("json", "svg", "png", "3dm", "dxf")]
    files = [word for path in out for word in ("-o", str(path))]
    assert main(["bend", "--start", "0,0,pinned", "--end", "800,0,-0.2", "--length", "1000", *files]) == 0
    printed = capsys.readouterr().out
    assert "from (0, 0), pinned to (800, 0), −11.4592°" in printed
    stored = read_bend_json(out[0])
    assert stored.problem.start_angle is None
    assert {s.ends for s in stored.solutions} == {"pinned-clamped"}
    assert all(abs(s.elastica.start_curvature) * 1000 < 1e-9 for s in stored.solutions)
    assert all(path.stat().st_size > 0 for path in out)
    rod = str(ROD)
    assert main(["bend", "--start", "0,0,pinned", "--end", "800,0,pinned", "--rod", rod, "--max-inflections", "0"]) == 0
    assert capsys.readouterr().out.rstrip().splitlines()[-2].split()[-2:] == ["–", "–"]
    assert main(["bend", "--start", "0,0,pined", "--end", "800,0,0", "--length", "1000"]) == 2
    assert "or pinned" in capsys.readouterr().err
