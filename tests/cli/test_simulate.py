"""`batten simulate` on the example's own cut: the whole wall keeps its limit, a damaged program does not."""

import json
import re
import shutil

import pytest

from batten.cli.main import main


@pytest.fixture
def out(real_cut, tmp_path):
    shutil.copytree(real_cut.out, tmp_path / "out")
    return tmp_path / "out"


def keep_block(out, number):
    for path in (out / "rapid").glob("*.mod"):
        if f"_B{number:03d}_" not in path.name:
            path.unlink()
    return sorted((out / "rapid").glob("*_L.mod"))[0]


def numbers_of(out, capsys, number):
    assert main(["simulate", str(out), "--json"]) == 1  # the other blocks have no program
    record = json.loads(capsys.readouterr().out)
    (block,) = [b for b in record["blocks"] if b["block"] == number]
    assert json.loads((out / "simulation/simulation.json").read_text(encoding="utf-8")) == record
    return block


def test_the_demo_keeps_its_limit(out, capsys):
    """Tolerance and 0.05 mm, between the leaves too; then the cut is checked, and cut again over it."""
    assert main(["simulate", str(out)]) == 0
    said = capsys.readouterr().out
    assert "every point of the simulated face lies within 2.55 mm" in said
    record = json.loads((out / "simulation/simulation.json").read_text(encoding="utf-8"))
    assert record["good"] is True
    assert len(record["blocks"]) == 25
    assert record["face"]["max_mm"] <= 2.55
    assert record["design"]["max_mm"] <= 2.55
    assert main(["check", str(out)]) == 0


def test_a_target_that_is_3_mm_off_shows(out, capsys):
    """The left gripper 3 mm lower at one leaf of a block that is well within its limit."""
    module = keep_block(out, 13)
    good = numbers_of(out, capsys, 13)
    lines = module.read_text(encoding="ascii").split("\n")
    at = [i for i, line in enumerate(lines) if "MoveL" in line][15]
    leaf = lines[at - 1].split(", ")[1]
    lines[at] = re.sub(
        r"\[\[([^,]+),([^,]+),([^\]]+)\]", lambda m: f"[[{m[1]},{m[2]},{float(m[3]) - 3.0:.3f}]", lines[at], count=1
    )
    module.write_text("\n".join(lines), encoding="ascii")
    bad = numbers_of(out, capsys, 13)
    assert good["face"]["max_mm"] < 1.0
    assert bad["face"]["max_mm"] > good["face"]["max_mm"] + 0.5
    assert leaf in bad["worst"]["where"]


def test_a_program_that_snaps_the_rod_is_refused_with_its_leaves(out, capsys):
    module = keep_block(out, 13)
    before = (out / "cut.json").read_bytes()
    lines = module.read_text(encoding="ascii").split("\n")
    at = [i for i, line in enumerate(lines) if "MoveL" in line][15]
    lines[at] = re.sub(r"\[\[([^,]+)", lambda m: f"[[{float(m[1]) - 250.0:.3f}", lines[at], count=1)
    module.write_text("\n".join(lines), encoding="ascii")
    assert main(["simulate", str(out)]) == 1
    said = capsys.readouterr().err
    assert "block 13, between leaf" in said
    assert not (out / "simulation").exists()
    assert (out / "cut.json").read_bytes() == before


def test_bad_input_is_named(out, tmp_path, capsys):
    assert main(["simulate", str(tmp_path / "nothing")]) == 2
    assert "cut.json: no such file" in capsys.readouterr().err
    module = keep_block(out, 13)
    module.write_text(module.read_text(encoding="ascii").replace("MoveL", "MoveJ", 1), encoding="ascii")
    assert main(["simulate", str(out)]) == 2
    assert re.search(rf"{re.escape(module.name)}, line \d+: MoveJ is not simulated", capsys.readouterr().err)
    assert main(["simulate", str(out), "--allowance", "-1"]) == 2
