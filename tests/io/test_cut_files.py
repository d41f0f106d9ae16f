"""All files of a cut: whole, readable, the same twice, and read back by the check."""

import dataclasses
import shutil
import sys
import types
from pathlib import Path

import numpy as np
import pytest
import rhino3dm

from batten.errors import FormatError, InvalidInputError
from batten.fabrication.robot.cell import cell_from_job
from batten.io import report
from batten.io.cut_check import check_cut
from batten.io.cut_files import write_cut
from batten.io.cut_json import files_of_cut, read_cut_json, write_cut_json
from batten.io.job_surface import read_job_surface

WALL = Path(__file__).parents[2] / "examples/freeform-wall/freeform-surface.3dm"


@pytest.fixture
def cut(make_plan, tmp_path, monkeypatch):
    """A made-up plan with a real surface file, and a `check_again` that finds again what the plan says."""
    plan, job = make_plan(rows=1, columns=2, leaves=3, refused=(2,))
    hard_ok = tuple(dataclasses.replace(c, hard=c.name != "speed") for c in plan.checks)
    plan = dataclasses.replace(plan, checks=hard_ok)
    source = tmp_path / "design/wall.3dm"
    source.parent.mkdir()
    shutil.copy(WALL, source)
    job = dataclasses.replace(job, surface=dataclasses.replace(job.surface, file=source, scale_mm_per_unit=300.0))
    fake = types.ModuleType("batten.fabrication.cut")
    fake.check_again = lambda plan, job, surface: plan.checks
    monkeypatch.setitem(sys.modules, "batten.fabrication.cut", fake)
    out = tmp_path / "out"

    def write(**options):
        return write_cut(plan, job, read_job_surface(job.surface), cell_from_job(job.cell), out, **options)

    return types.SimpleNamespace(plan=plan, job=job, out=out, write=write, fake=fake)


def names(folder):
    return sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())


def test_every_file_is_there_and_can_be_read(cut):
    told = []
    sums = cut.write(progress=lambda *step: told.append(step))
    modules = [n for n in names(cut.out) if n.startswith("rapid/")]
    assert names(cut.out) == sorted(["cut.3dm", "cut.json", "input/wall.3dm", "report.html", "rods.csv", *modules])
    assert len(modules) == 2 * 2
    assert sorted(sums) == [n for n in names(cut.out) if n != "cut.json"]
    assert files_of_cut(cut.out) == set(names(cut.out))
    assert (cut.out / "input/wall.3dm").read_bytes() == WALL.read_bytes()
    model = rhino3dm.File3dm.Read(str(cut.out / "cut.3dm"))
    assert all(o.Geometry.IsValid for o in model.Objects)
    assert read_cut_json(cut.out / "cut.json").plan.refused_leaves == (2,)
    assert [done for _, done, _ in told] == sorted(done for _, done, _ in told)
    assert told[-1][1] == told[-1][2]


def test_a_second_run_replaces_the_first_and_tells_the_same(cut):
    cut.write(pictures=False)
    first = {n: (cut.out / n).read_bytes() for n in names(cut.out)}
    cut.write(pictures=False)
    second = {n: (cut.out / n).read_bytes() for n in names(cut.out)}
    assert list(first) == list(second)
    stamped = {"cut.3dm", "cut.json", "report.html"}  # Rhino's library writes new identifiers; the sums follow
    assert [n for n in first if first[n] != second[n] and n not in stamped] == []


def test_nothing_is_left_when_a_late_step_fails(cut, monkeypatch):
    def full(*args, **options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(report, "write_report", full)
    before = names(cut.out.parent)
    with pytest.raises(OSError, match=r"cannot be written \(No space left on device\).*out'"):
        cut.write()
    assert names(cut.out.parent) == before
    assert not cut.out.exists()


def test_a_folder_with_something_of_ones_own_is_left_alone(cut):
    cut.write(pictures=False)
    (cut.out / "notes.txt").write_text("mine")
    before = {n: (cut.out / n).read_bytes() for n in names(cut.out)}
    with pytest.raises(InvalidInputError, match=r"holds notes\.txt, which batten did not write"):
        cut.write(pictures=False)
    assert {n: (cut.out / n).read_bytes() for n in names(cut.out)} == before


def differences(cut):
    _, findings = check_cut(cut.out)
    return {f.what: f.detail for f in findings if not f.agrees}


def test_what_was_just_written_agrees_with_itself(cut):
    cut.write()
    stored, findings = check_cut(cut.out)
    assert [f for f in findings if not f.agrees] == []
    assert {"files", "rods.csv", "poses", "robot program", "cut.3dm", *(c.title for c in cut.plan.checks)} == {
        f.what for f in findings
    }
    assert stored.job.surface.source == cut.out / "input/wall.3dm"


def test_a_missing_or_changed_file_is_found(cut):
    cut.write(pictures=False)
    (cut.out / "report.html").unlink()
    with (cut.out / "rods.csv").open("a") as table:
        table.write("1,2,3\n")
    module = next((cut.out / "rapid").iterdir())
    module.write_text(module.read_text().replace("MoveL", "MoveJ", 1))
    found = differences(cut)
    assert found.pop("report.html") == "is missing"
    assert found.pop("rods.csv")
    assert found.pop(f"rapid/{module.name}")
    assert found.pop("robot program") == "3 of 4 modules as stored"
    assert found.pop("files").startswith("5 of 8")
    assert found == {}


def test_a_changed_elastica_is_found_though_the_sums_agree(cut):
    cut.write(pictures=False)
    stored = read_cut_json(cut.out / "cut.json")
    moved = dataclasses.replace(
        stored.plan.rods[0], rod=stored.plan.rods[0].rod.extended(0.0, 0.1)
    )  # its right end moves by 0.1 mm
    plan = dataclasses.replace(stored.plan, rods=(moved, *stored.plan.rods[1:]))
    write_cut_json(cut.out / "cut.json", plan, stored.job, stored.files)
    found = differences(cut)
    assert set(found) == {"rods.csv", "poses"}
    assert found["rods.csv"] == "differs from the stored rods"
    assert found["poses"].startswith("8 grippers, at most 9.9e-02 mm")


def test_a_rod_that_no_robot_holds_is_found(cut):
    cut.write(pictures=False)
    stored = read_cut_json(cut.out / "cut.json")
    plan = dataclasses.replace(stored.plan, motions=stored.plan.motions[1:])
    write_cut_json(cut.out / "cut.json", plan, stored.job, stored.files)
    assert differences(cut)["motions"] == "do not hold each rod that is cut once; leaves [1, 3]"


def test_a_check_that_comes_out_otherwise_is_found(cut):
    cut.write(pictures=False)
    strain = cut.plan.checks[0]
    values = strain.values.copy()
    values[3] *= 1.0 + 1e-5
    others = (
        dataclasses.replace(strain, values=values),
        dataclasses.replace(cut.plan.checks[1], limit=0.4),
        *cut.plan.checks[3:],
        dataclasses.replace(strain, name="new", title="A new one"),
    )
    cut.fake.check_again = lambda *args: others
    found = differences(cut)
    rod = cut.plan.rods[3]
    assert found.pop(strain.title).startswith(f"differs at 1 rods, first at leaf {rod.leaf} in block {rod.block}")
    assert found.pop(cut.plan.checks[1].title) == "has another limit now: 0.4 instead of 0.5"
    assert found.pop(cut.plan.checks[2].title) == "is no longer computed"
    assert found.pop("A new one") == "is computed now and was not stored"
    assert set(found) <= {"limits"}


def test_a_leaf_that_is_cut_beyond_a_hard_limit_is_found(cut):
    cut.write(pictures=False)
    values = np.where([r.leaf == 3 for r in cut.plan.rods], 0.02, cut.plan.checks[0].values)
    cut.fake.check_again = lambda *args: (dataclasses.replace(cut.plan.checks[0], values=values), *cut.plan.checks[1:])
    assert differences(cut)["limits"] == "leaves that are cut break a hard limit: [3]"


def test_a_step_that_cannot_be_done_is_a_finding_and_the_others_go_on(cut):
    cut.write(pictures=False)
    (cut.out / "cut.3dm").write_bytes(b"nothing")
    (cut.out / "input/wall.3dm").unlink()
    found = differences(cut)
    assert found["cut.3dm"]
    assert "no such file" in found["checks"]
    with pytest.raises(FormatError, match="no such file"):
        check_cut(cut.out / "rapid")
