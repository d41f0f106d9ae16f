"""Lines of a live stream: any bytes become a pose or an error, records are plain JSON and hold what they promise."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError
from batten.fabrication.rod import Rod
from batten.fabrication.section import RoundSection
from batten.io.live_records import (
    LONGEST_LINE,
    SHOWN,
    Ends,
    LiveError,
    LivePose,
    RecordStyle,
    error_record,
    line_of,
    parse_line,
    pose_record,
    unwrapped,
)

GOOD = '{"start": [0, 0, 0.4], "end": [0.8, 0, -0.4]}'
ARC = Elastica((100.0, 50.0), 0.25, 1 / 400, (0.0, 0.0), 1000.0)


def tracked(curve=ARC, margin=math.inf, snap=None):
    return SimpleNamespace(elastica=curve, energy=curve.bending_energy(), margin=margin, stable=margin > 1.0, snap=snap)


def no_constant(name):
    raise AssertionError(f"{name} is not plain JSON")


def read(line):
    return json.loads(line, parse_constant=no_constant)


def test_a_pose_and_its_fields():
    line = (
        b' {"t": 1.5, "id": {"a": [null, "\\u03bb"]}, "end": [1, 2.5, -7.25], "start": [-1e-3, 2, 0], "wrap": false}\r'
    )
    pose = parse_line(line, 3.0)
    assert pose.ends == Ends(-1e-3, 2.0, 0.0, 1.0, 2.5, -7.25)
    assert pose.echo == {"t": 1.5, "id": {"a": [None, "λ"]}}
    assert pose.wrap is False
    bare = parse_line(b"\xef\xbb\xbf" + GOOD.encode(), 1.0)  # as some shells begin what they send
    assert (bare.echo, bare.wrap) == ({}, True)
    assert parse_line(b'{"start": [0, 0, 0], "end": [1, 0, 0], "id": null}', 1.0).echo == {"id": None}


def test_ends_as_far_apart_as_the_rod_is_long_are_for_the_tracker_to_judge():
    line = b'{"start": [0, 0, 0], "end": [3, 4, 0]}'
    assert isinstance(parse_line(line, 5.0), LivePose)
    assert "5 apart" in parse_line(line, 4.999).message


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (b"", "not JSON"),
        (b"hello", "not JSON: Expecting value"),
        (GOOD[:-1].encode(), "not JSON"),
        (GOOD.encode() + b" {}", "not JSON: Extra data"),
        (b"\xff" + GOOD.encode(), "not UTF-8 text: invalid start byte at byte 0"),
        (b"[1, 2, 3]", "a JSON list came"),
        (b"null", "a JSON NoneType came"),
        (b"{}", "start is missing"),
        (b'{"start": [0, 0, 0]}', "end is missing"),
        (b'{"start": [0, 0], "end": [0, 0, 0]}', "start = [0, 0]; allowed are three numbers"),
        (b'{"start": {"x": 0}, "end": [0, 0, 0]}', 'start = {"x": 0}; allowed'),
        (b'{"start": [0, 0, 0], "end": [0, "1", 0]}', 'end[1] = "1"; allowed are finite numbers'),
        (b'{"start": [0, 0, 0], "end": [0, true, 0]}', "end[1] = true; allowed"),
        (b'{"start": [0, 0, 0], "end": [0, NaN, 0]}', "not JSON: NaN is no JSON number"),
        (b'{"start": [0, 0, 0], "end": [-Infinity, 0, 0]}', "-Infinity is no JSON number"),
        (b'{"start": [0, 0, 0], "end": [1e999, 0, 0]}', "1e999 is larger than numbers can be"),
        (b'{"start": [0, 0, 0], "end": [1' + b"0" * 400 + b", 0, 0]}", "too large"),
        (b'{"start": [0, 0, 0], "end": [1' + b"0" * 5000 + b", 0, 0]}", "not JSON"),
        (b'{"start": [0, 0, 1e7], "end": [0, 0, 0]}', "start[2] = 10000000.0; allowed are radians"),
        (b'{"start": [0, 0, 0], "end": [0, 0, 0], "t": "now"}', 't = "now"; allowed are a number'),
        (b'{"start": [0, 0, 0], "end": [0, 0, 0], "t": null}', "t = null; allowed"),
        (b'{"start": [0, 0, 0], "end": [0, 0, 0], "wrap": 0}', "wrap = 0; allowed are true and false"),
        (b'{"start": [0, 0, 0], "end": [0, 0, 0], "warp": true}', 'unknown field "warp"; allowed are start, end, id'),
        (b'{"start": [1e308, 0, 0], "end": [-1e308, 0, 0]}', "inf apart"),
        (b"[" * 60000, "nested too deep"),
        (GOOD[:-1].encode() + b', "id": ' + b"[" * 40 + b"]" * 40 + b"}", "nested too deep; allowed are 32"),
        (GOOD.encode() + b" " * LONGEST_LINE, "more than 65536 bytes"),
    ],
)
def test_errors_say_what_came_and_what_is_allowed(line, says):
    error = parse_line(line, 1.0)
    assert isinstance(error, LiveError)
    assert says in error.message
    assert "\n" not in error.message
    assert len(error.message) < 400
    assert error.line == line.decode(errors="replace")[:SHOWN]
    assert read(line_of(error_record(error, 3))) == {"n": 3, "error": error.message, "line": error.line}


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=12,
)
END = st.lists(st.floats() | st.integers() | JSON, min_size=2, max_size=4) | JSON
OBJECTS = st.fixed_dictionaries({}, optional={"start": END, "end": END, "id": JSON, "t": JSON, "wrap": JSON})
GOOD_END = st.lists(st.floats(-0.1, 0.1), min_size=3, max_size=3)
GOOD_OBJECTS = st.fixed_dictionaries({"start": GOOD_END, "end": GOOD_END}, optional={"id": JSON, "t": st.floats(-9, 9)})


@settings(max_examples=400, deadline=None)
@given(
    line=st.binary(max_size=200)
    | st.text(max_size=100).map(lambda text: text.encode("utf-8", "surrogatepass"))
    | OBJECTS.map(lambda data: json.dumps(data).encode())
    | GOOD_OBJECTS.map(lambda data: json.dumps(data).encode())
    | st.tuples(st.integers(0, len(GOOD)), st.binary(max_size=4)).map(
        lambda cut: GOOD[: cut[0]].encode() + cut[1] + GOOD[cut[0] + len(cut[1]) :].encode()
    )
)
def test_any_bytes_give_a_record_or_an_error_and_never_an_exception(line):
    found = parse_line(line, 1.0)
    if isinstance(found, LiveError):
        assert found.message
        record = read(line_of(error_record(found, 1)))
        assert record["line"] == line.decode(errors="replace").removeprefix("\ufeff")[:SHOWN]
    else:
        assert np.isfinite(found.ends).all()
        record = read(line_of(pose_record(found, tracked(), RecordStyle(1000.0, 2), 1)))
        sent = read(line.decode().removeprefix("\ufeff"))
        assert {k: record[k] for k in ("id", "t") if k in record} == {k: sent[k] for k in ("id", "t") if k in sent}


def angles(start, end, wrap=True):
    return LivePose(Ends(0.0, 0.0, start, 1.0, 0.0, end), {}, wrap)


def test_an_angle_goes_on_where_it_was():
    last, seen = None, []
    for true in np.arange(0.0, 30.0, 0.4):  # both ends turn nearly five times; the sensors say −π to π
        last = unwrapped(angles(math.remainder(-true, math.tau), math.remainder(true, math.tau)), last)
        seen.append((last.ends.start_angle, last.ends.end_angle))
    np.testing.assert_allclose(seen, [(-t, t) for t in np.arange(0.0, 30.0, 0.4)], atol=1e-12)


def test_an_angle_may_be_taken_as_it_is():
    turned = unwrapped(angles(0.0, 6.5, wrap=False), angles(0.0, 0.0))
    assert turned.ends.end_angle == 6.5
    assert unwrapped(angles(0.0, 0.3), turned).ends.end_angle == pytest.approx(0.3 + math.tau, abs=1e-15)


@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_unwrapping_takes_whole_turns_to_the_nearest(angle, before):
    found = unwrapped(angles(0.0, angle), angles(0.0, before)).ends.end_angle
    assert abs(found - before) <= math.pi + 1e-9
    assert abs(math.remainder(found - angle, math.tau)) < 1e-9
    if abs(angle - before) < 3.14:
        assert found == angle, "what needs no turn is not touched"


def test_a_record_of_an_arc():
    pose = LivePose(Ends(100.0, 50.0, 0.25, 0.0, 0.0, 2.75), {"id": [1, "λ"], "t": 2})
    line = line_of(pose_record(pose, tracked(), RecordStyle(1000.0, 5), 7, dropped=3))
    assert line.isascii()
    record = read(line)
    assert list(record) == [
        "id", "t", "n", "elastica", "points", "energy", "force", "moments", "margin", "stable", "snap", "dropped",
    ]  # fmt: skip
    assert (record["id"], record["t"], record["n"], record["dropped"]) == ([1, "λ"], 2, 7, 3)
    assert record["elastica"] == [100.0, 50.0, 0.25, 0.0025, 0.0, 0.0, 1000.0]
    assert record["energy"] == pytest.approx(1000.0 / 400.0**2, rel=1e-12)
    assert record["force"] == [0.0, 0.0]
    assert record["moments"] == pytest.approx([0.0025, 0.0025], rel=1e-12)
    assert (record["margin"], record["stable"], record["snap"]) == ("Infinity", True, None)
    turn = 0.25 + np.linspace(0.0, 2.5, 5)  # of a circle of radius 400 about (100, 50) + 400 (−sin, cos) 0.25
    circle = np.array([100.0 - 400.0 * math.sin(0.25), 50.0 + 400.0 * math.cos(0.25)])
    np.testing.assert_allclose(
        record["points"], circle + 400.0 * np.column_stack([np.sin(turn), -np.cos(turn)]), atol=1e-9
    )


def test_numbers_come_back_bit_by_bit():
    curve = Elastica((0.1, 1 / 3), 0.7, -1.9, (3.3, math.pi), 1.0)
    record = read(line_of(pose_record(angles(0.7, 0.0), tracked(curve, 1.5), RecordStyle(1.0, 9), 1)))
    assert record["elastica"] == curve.parameters.tolist()
    assert record["points"] == curve.point_at(np.linspace(0.0, 1.0, 9)).tolist()
    assert record["moments"] == curve.curvature_at([0.0, 1.0]).tolist()
    assert record["margin"] == 1.5


def test_a_rod_gives_newtons_and_joules():
    rod = Rod(1000.0, RoundSection(3.0), 200000.0, 0.003)
    stiffness = 200000.0 * math.pi * 3.0**4 / 64.0
    bent = Elastica((0.0, 0.0), 0.25, 1 / 400, (1e-6, -2e-6), 1000.0)
    snap = SimpleNamespace(fraction=0.25, pose=np.arange(6.0), before=bent, after=ARC, energy_released=0.004)
    record = read(line_of(pose_record(angles(0, 0), tracked(ARC, 1.2, snap), RecordStyle(1000.0, 2, rod), 1)))
    assert record["moments_nmm"] == pytest.approx([stiffness / 400.0] * 2, rel=1e-12)
    assert record["energy_j"] == pytest.approx(0.5e-3 * stiffness * 1000.0 / 400.0**2, rel=1e-12)
    assert record["strain"] == pytest.approx(1.5 / 400.0, rel=1e-12)
    assert record["strain_ok"] is False
    assert record["snap"] == {
        "fraction": 0.25, "pose": [0, 1, 2, 3, 4, 5], "energy_released": 0.004,
        "before": bent.parameters.tolist(), "after": ARC.parameters.tolist(),
        "energy_released_j": pytest.approx(0.5e-3 * stiffness * 0.004, rel=1e-12),
    }  # fmt: skip
    record = read(line_of(pose_record(angles(0, 0), tracked(bent), RecordStyle(1000.0, 2, rod), 1)))
    assert record["force_n"] == pytest.approx([stiffness * 1e-6, stiffness * -2e-6], rel=1e-12)
    assert pose_record(angles(0, 0), tracked(), RecordStyle(1000.0, 2), 1).keys().isdisjoint({"force_n", "strain_ok"})


def test_numbers_that_json_does_not_know():
    snap = SimpleNamespace(
        fraction=math.nan, pose=np.full(6, math.nan), before=ARC, after=ARC, energy_released=-math.inf
    )
    record = read(line_of(pose_record(angles(0, 0), tracked(margin=math.nan, snap=snap), RecordStyle(1000.0), 1)))
    assert record["margin"] is None
    assert record["snap"]["fraction"] is None
    assert record["snap"]["pose"] == [None] * 6
    assert record["snap"]["energy_released"] == "-Infinity"
    assert len(record["points"]) == 33


def test_an_error_may_stand_for_others():
    error = LiveError("no", "line", {"id": 4, "t": 0.5})
    assert error_record(error, 9, unreported=2) == {
        "id": 4, "t": 0.5, "n": 9, "error": "no", "line": "line", "unreported": 2,
    }  # fmt: skip


@pytest.mark.parametrize("style", [(0.0,), (math.nan,), (math.inf,), (1.0, 1), (1.0, 10_001)])
def test_a_style_has_bounds(style):
    with pytest.raises(InvalidInputError, match="allowed are"):
        RecordStyle(*style)
