"""cut.json gives back every number bit by bit, and says what is wrong with a file that is not one."""

import dataclasses
import json
import math
import re

import numpy as np
import pytest

from batten.curves.elastica import Elastica
from batten.errors import FormatError
from batten.fabrication.job import KerfJob
from batten.fabrication.plan import CheckResult
from batten.io.cut_json import files_of_cut, read_cut_json, write_cut_json
from batten.surfaces.plane import Plane


def same(a, b):
    """Equal in every bit, through dataclasses, tuples and arrays."""
    assert type(a) is type(b)
    if dataclasses.is_dataclass(a):
        return all(same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    if isinstance(a, tuple | list):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b))
    if isinstance(a, dict):
        return list(a) == list(b) and same(list(a.values()), list(b.values()))
    if isinstance(a, np.ndarray):
        assert a.dtype == b.dtype
        if a.dtype.kind == "f":  # one NaN is as good as another
            a, b = (np.where(np.isnan(v), np.nan, v) for v in (a, b))
        return a.shape == b.shape and a.tobytes() == b.tobytes()
    return a == b or (isinstance(a, float) and math.isnan(a) and math.isnan(b))


@pytest.fixture
def stored(tmp_path, make_plan):
    plan, job = make_plan(rows=2, columns=2, leaves=3, refused=(2,))
    awkward = CheckResult("x", "X", "mm", math.inf, "max", np.array([np.nan, np.inf, -np.inf, -0.0, 5e-324, 1 / 3]))
    plan = dataclasses.replace(
        plan, checks=(*plan.checks, awkward), facts=plan.facts | {"nan": math.nan, "inf": -math.inf, "π": 0.1 + 0.2}
    )
    path = tmp_path / "cut.json"
    job = dataclasses.replace(job, surface=dataclasses.replace(job.surface, file=tmp_path / "wall.3dm"))
    write_cut_json(path, plan, job, {"rods.csv": "00ff"})
    return path, plan, job


def test_every_number_comes_back_bit_by_bit(stored):
    path, plan, job = stored
    back = read_cut_json(path)
    assert same(back.plan, plan)
    assert back.files == {"rods.csv": "00ff"}
    assert back.job.surface.source == path.parent / "input/wall.3dm"
    assert dataclasses.replace(back.job, path=None, surface=job.surface) == job
    assert re.fullmatch(r"batten (\d+\.\d+\.\d+.*|\(not installed\))", back.software)


def test_planned_times_and_the_kerfs_law_come_back(stored):
    path, plan, job = stored
    motions = tuple(
        dataclasses.replace(
            m, planned_s=np.linspace(0.1, 1 / 3, len(m.rods) - 1) if i else np.full(len(m.rods) - 1, np.nan)
        )
        for i, m in enumerate(plan.motions)
    )
    kerf = KerfJob(False, "upper", 0.3, 4.0, 40.0, speeds_mm_s=(5.0, 20.0), widths_mm=(1.7, 0.1 + 0.2))
    plan, job = dataclasses.replace(plan, motions=motions), dataclasses.replace(job, kerf=kerf)
    write_cut_json(path, plan, job, {})
    back = read_cut_json(path)
    assert same(back.plan, plan)
    assert back.job.kerf == kerf


def test_a_plane_that_normalising_would_move_comes_back_as_it_was(stored):
    rng = np.random.default_rng(3)
    path, plan, job = stored
    rods = []
    for rod in plan.rods:
        plane = Plane(rng.normal(size=3), rng.normal(size=3), rng.normal(size=3))
        values = Elastica.from_parameters(np.append(rng.normal(size=6), 1.0 + rng.uniform()))
        rods.append(dataclasses.replace(rod, plane=plane, piece=values))
    moved = [Plane(r.plane.origin, r.plane.x_axis, r.plane.y_axis) for r in rods]
    assert not all(same(m, r.plane) for m, r in zip(moved, rods)), "no plane here is moved by normalising it again"
    plan = dataclasses.replace(plan, rods=tuple(rods))
    write_cut_json(path, plan, job, {})
    assert same(read_cut_json(path).plan, plan)


def test_it_is_plain_json_with_one_rod_a_line(stored):
    path, plan, _ = stored

    def refuse(name):
        raise AssertionError(name)

    text = path.read_text(encoding="utf-8")
    data = json.loads(text, parse_constant=refuse)
    assert data["checks"][-1]["values"] == [None, "Infinity", "-Infinity", -0.0, 5e-324, 1 / 3]
    assert sum(line.startswith('{"block":') and '"leaf"' in line for line in text.splitlines()) == len(plan.rods)


def test_writing_what_was_read_gives_the_same_file(stored, tmp_path):
    path, _, _ = stored
    back = read_cut_json(path)
    write_cut_json(tmp_path / "again.json", back.plan, back.job, back.files)
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"schema": 2', '"schema": 1', "schema = 1: this batten"),
        ('"format": "batten cut"', '"format": "tea"', "format = 'tea'"),
        ('"format"', '"farmot"', "format = None"),
        ('"blade_axis": "x"', '"blade_axis": "z"', "blade_axis: 'z'"),
        ('"design_mm"', '"design"', "rods[0]: 'design_mm' is missing"),
        ('"status":"ok"', '"status":"fine"', "rods[0]: status = 'fine'"),
        ('"force_per_mm2":[', '"force_per_mm2":[1.0,', "rods[0]: cannot reshape"),
        ('"spin_rad"', '"spin"', "motions[0]: 'spin_rad' is missing"),
        ('"max_strain":0.008', '"max_strain":-1', "job.rod.max_strain"),
        ('"blocks": [', '"blocks": 3, "x": [', "blocks: 'int' object"),
        ("[null,", "[NaN,", "not a JSON file: NaN is no JSON number"),
        ("{", "", "not a JSON file"),
    ],
)
def test_what_is_wrong_is_named(stored, old, new, says):
    path, _, _ = stored
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(FormatError) as caught:
        read_cut_json(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert says in message
    assert "\n" not in message


def test_which_files_are_battens_own(stored, tmp_path):
    path, _, _ = stored
    assert files_of_cut(path.parent) == {"cut.json", "rods.csv"}
    (tmp_path / "other").mkdir()
    assert files_of_cut(tmp_path / "other") is None
    (tmp_path / "other/cut.json").write_text("{}")
    assert files_of_cut(tmp_path / "other") is None
    with pytest.raises(FormatError, match="no such file; give a folder that `batten cut` made"):
        read_cut_json(tmp_path / "nowhere/cut.json")
