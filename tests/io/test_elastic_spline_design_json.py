"""JSON of a design: every number back bit by bit, whole files or none, and words for what is wrong."""

import copy
import json
import math
import os

import numpy as np
import pytest

from batten.curves.cubic_proxy import Border
from batten.errors import FormatError, InvalidInputError
from batten.io import elastic_spline_design_json as module
from batten.io.elastic_spline_design_json import (
    elastic_spline_design_json,
    read_elastic_spline_design,
    read_elastic_spline_design_text,
    write_elastic_spline_design,
)
from batten.splines.design_limits import DesignLimits
from batten.splines.elastic_spline_design import ElasticSplineDesign


def bits(state):
    borders = state.proxy.borders
    return (
        state.proxy.control_points.tobytes(), state.proxy.continuity, state.action, state.index, state.limits,
        borders if borders is None else [b and (*map(float.hex, b.point), *map(float.hex, b.normal)) for b in borders],
    )  # fmt: skip


def designed(continuity, borders, seed=4):
    limits = DesignLimits(curvature_below=math.pi, simple=True)
    design = ElasticSplineDesign.line((0.1, 1 / 3), (6, -0.7), 3, continuity=continuity, borders=borders, limits=limits)
    rng = np.random.default_rng(seed)
    for _ in range(12):
        i = int(rng.integers(len(design.control_points)))
        design.move(i, design.control_points[i] + rng.normal(size=2) * 0.2)
    design.delete(0)
    design.set_limits(DesignLimits(margin_above=1.1))
    for _ in range(3):
        design.undo()
    return design


@pytest.fixture
def slanted():
    """Borders whose normals, scaled to length 1 once more, do not all stay what they are."""
    rng = np.random.default_rng(8)
    normals = rng.normal(size=(40, 2)) * 0.2 + (1.0, 0.0)
    borders = [Border((0.1 + 5.9 / 3 * (k % 4), 0.3), tuple(v)) for k, v in enumerate(normals.tolist())]
    moving = [b for b in borders if Border(b.point, b.normal).normal != b.normal]
    assert moving
    return [None, moving[0], None, None] if moving[0].point[0] < 3 else [None, None, moving[0], None]


@pytest.mark.parametrize("continuity", [1, 2])
@pytest.mark.parametrize("bordered", [False, True])
def test_the_whole_history_comes_back_bit_by_bit(continuity, bordered, slanted, tmp_path):
    design = designed(continuity, slanted if bordered else None)
    path = tmp_path / "design.json"
    write_elastic_spline_design(design, path)
    back = read_elastic_spline_design(path)
    assert len(back.states) > 6
    assert [bits(s) for s in back.states] == [bits(s) for s in design.states]
    assert (back.undo_depth, back.redo_depth) == (design.undo_depth, design.redo_depth)
    assert back.redo_depth == 3
    assert back.residuals.tolist() == design.residuals.tolist()
    assert elastic_spline_design_json(back) == elastic_spline_design_json(design)
    while back.undo_depth:
        back.undo()
    while back.redo_depth:
        back.redo()
        design.redo() if design.redo_depth else None
    assert bits(back.states[back.undo_depth]) == bits(design.states[-1])


def test_without_history_the_present_state_is_all(tmp_path):
    design = designed(1, None)
    back = read_elastic_spline_design_text(elastic_spline_design_json(design, history=False))
    assert (len(back.states), back.undo_depth, back.states[0].action) == (1, 0, "start")
    assert back.control_points.tobytes() == design.control_points.tobytes()
    assert back.limits == design.limits


def test_it_is_plain_json_of_a_schema():
    design = designed(2, None)
    data = json.loads(elastic_spline_design_json(design), parse_constant=pytest.fail)
    assert (data["format"], data["schema"]) == ("batten elastic spline design", 1)
    assert data["current"] == design.undo_depth
    state = data["states"][-1]
    assert state["action"] == "limits"
    assert state["limits"]["margin_above"] == 1.1
    assert state["limits"]["curvature_below"] is None
    assert np.array(state["control_points"]).shape == (5, 2)


def test_a_design_that_breaks_its_limits_is_read_and_says_so():
    design = ElasticSplineDesign.from_control_points([(0, 0), (1, 3), (0.2, 3), (1, 0)])
    assert design.broken
    assert read_elastic_spline_design_text(elastic_spline_design_json(design)).broken == design.broken


def test_a_file_appears_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "design.json"
    design = designed(1, None)
    write_elastic_spline_design(design, path)
    before = path.read_bytes()
    design.redo()

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_elastic_spline_design(design, path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["design.json"]
    monkeypatch.undo()
    write_elastic_spline_design(design, path)
    assert path.read_bytes() != before
    for bad in (tmp_path, tmp_path / "no" / "design.json"):
        with pytest.raises(InvalidInputError, match="give the name of a file"):
            write_elastic_spline_design(design, bad)


def drop(key):
    return lambda data: data["states"][1].pop(key)


def put(key, value):
    return lambda data: data["states"][1].update({key: value})


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda d: d.update(format="batten bend"), "format = 'batten bend'"),
        (lambda d: d.update(schema=2), "schema = 2: this .* reads schema 1"),
        (lambda d: d.pop("states"), "states: is missing"),
        (lambda d: d.update(states={}), "states: must be a list"),
        (lambda d: d.update(states=[]), "states and current: the present state is one of the 0"),
        (lambda d: d.update(current=99), "states and current: .* got 99"),
        (lambda d: d.update(current=1.0), "current: must be a whole number; got 1.0"),
        (lambda d: d.update(current=True), "current: must be a whole number"),
        (lambda d: d["states"].__setitem__(1, 7), r"states\[1\]: must be an object"),
        (drop("borders"), r"states\[1\]\.borders: is missing"),
        (put("colour", "red"), r"states\[1\]: unknown field 'colour'"),
        (put("action", "jump"), "state 1 has the action 'jump'"),
        (put("action", 3), r"states\[1\]\.action: must be a text"),
        (put("index", 40), "state 1 moves control point 40"),
        (put("continuity", 3), r"states\[1\]: a cubic spline has continuity 1 or 2"),
        (put("control_points", [[0, 0], [1, 0], [2, 0]]), r"states\[1\]: .*2\(n \+ 1\) control points"),
        (put("control_points", [[0, 0], [1]]), r"states\[1\]\.control_points: must be two numbers; got \[1\]"),
        (put("control_points", [[0, "1"]] * 8), r"states\[1\]\.control_points: must be a finite number; got '1'"),
        (put("control_points", [[0, 10**400]] * 8), r"states\[1\]\.control_points"),
        (put("borders", [None]), r"states\[1\]: .*got 1 entries"),
        (put("borders", [3] * 4), r"states\[1\]\.borders: a border is null or"),
        (put("borders", [{"point": [90, 0], "normal": [1, 0]}] * 4), r"states\[1\]: joint 0 .* from its border"),
        (put("borders", [{"point": [0, 0], "normal": [0, 0]}] * 4), r"states\[1\]\.borders: .*normal not 0"),
        (put("limits", {}), r"states\[1\]\.limits: must be an object with residual_below"),
        (lambda d: d["states"][1]["limits"].update(residual_below=-1), r"states\[1\]\.limits: residual_below"),
        (lambda d: d["states"][1]["limits"].update(simple=0), r"states\[1\]\.limits: simple"),
    ],
)
def test_what_is_no_design_is_refused_with_its_field(spoil, message):
    data = json.loads(elastic_spline_design_json(designed(1, None)))
    read_elastic_spline_design_text(json.dumps(data))
    spoiled = copy.deepcopy(data)
    spoil(spoiled)
    with pytest.raises(FormatError, match=message) as caught:
        read_elastic_spline_design_text(json.dumps(spoiled), "bow.json")
    assert str(caught.value).startswith("bow.json: ")


def test_what_is_no_json_or_no_file(tmp_path):
    for text in ("", "{", '{"format": NaN}', "[" * 100000):
        with pytest.raises(FormatError, match="not JSON"):
            read_elastic_spline_design_text(text)
    with pytest.raises(FormatError, match="format = 'list'"):
        read_elastic_spline_design_text("[]")
    (tmp_path / "latin.json").write_bytes(b"\xff\xfe{")
    with pytest.raises(FormatError, match=r"latin\.json: no text in UTF-8"):
        read_elastic_spline_design(tmp_path / "latin.json")
    with pytest.raises(InvalidInputError, match=r"none\.json: no such file"):
        read_elastic_spline_design(tmp_path / "none.json")
    assert module.SCHEMA == 1
