"""Modules of a real cut read back: every number as the strict reader of the tests takes it; damage is named by its line."""

import numpy as np
import pytest

from batten.errors import FormatError
from batten.io.rapid_reading import read_rapid_module


@pytest.fixture(scope="module")
def module_path(real_cut):
    return sorted((real_cut.out / "rapid").glob("*_B007_L.mod"))[0]


def test_the_moves_are_those_of_the_other_reader(module_path, rapid_reader):
    ours, theirs = read_rapid_module(module_path), rapid_reader.read_module(module_path.read_text(encoding="ascii"))
    assert (ours.name, ours.block, len(ours.moves)) == (theirs.name, 7, len(theirs.synchronous))
    for mine, other in zip(ours.moves, theirs.synchronous):
        assert mine.identity == other.identity
        assert np.abs(mine.pose - other.pose).max() < 1e-9
        assert mine.speed_mm_s == theirs.speeds[other.speed][0]
        assert (
            np.array_equal(mine.tool, theirs.tools[other.tool])
            or np.abs(mine.tool - theirs.tools[other.tool]).max() < 1e-6
        )
        assert np.abs(mine.work_object - theirs.wobjs[other.wobj]).max() < 1e-9
    lines = module_path.read_text(encoding="ascii").split("\n")
    for move in ours.moves:
        assert f"\\ID:={move.identity}" in lines[move.line - 1]
        assert lines[move.line - 2].strip() == f"! block 7, {move.label}"
    assert ours.moves[0].label.startswith("approach")
    assert ours.moves[1].label.startswith("leaf ")


def test_times_of_moves_are_read(module_path, tmp_path):
    text = module_path.read_text(encoding="ascii").replace("\\ID:=30, cut_speed", "\\ID:=30, cut_speed \\T:=1.25")
    (tmp_path / "m.mod").write_text(text, encoding="ascii")
    moves = read_rapid_module(tmp_path / "m.mod").moves
    assert [m.seconds for m in moves if m.identity == 30] == [1.25]


def _line_of(text, part):
    return next(i for i, line in enumerate(text.split("\n"), start=1) if part in line)


@pytest.mark.parametrize(
    ("old", "new", "at", "message"),
    [
        ("\\ID:=30,", "\\ID:=20,", "leaf", "ID:=20 twice"),
        ("\\ID:=30,", ",", "leaf", "a whole number from 1"),
        ("    MoveL [[", "    MoveC [[", "MoveC", "MoveC is not simulated"),
        ("cut_speed, z5", "fast, z5", "fast", "speed fast"),
        ("\\WObj:=block_frame;", "\\WObj:=other;", "other", "not declared above"),
        ("\\WObj:=block_frame;", "\\WObj:=block_frame", "MoveL", "ends with ;"),
        (
            "PERS tooldata grip_left := [TRUE",
            "PERS tooldata grip_left := [FALSE",
            "tooldata",
            "tooldata of another kind",
        ),
        ("CONST speeddata cut_speed := [", "CONST speeddata cut_speed := [-", "speeddata cut", "above 0"),
        ("SyncMoveOn sync2", "SyncMoveOff sync2", "SyncMoveOff sync2", "SyncMoveOff twice"),
        ("! block 7, leaf", "! block 8, leaf", "block 8", "block 8 in a module of block 7"),
        ("PROC main()", "PROC main()\n    x := 3;", "x := 3", "x is not simulated"),
        ("    Stop;", "    Stop §;", None, "cannot be read"),
        ("    Stop;", "    Stop %;", "Stop %", "is not RAPID"),
    ],
)
def test_damage_is_named_by_file_and_line(module_path, tmp_path, old, new, at, message):
    text = module_path.read_text(encoding="ascii")
    assert old in text
    path = tmp_path / "bad.mod"
    path.write_text(text.replace(old, new, 1 if "block 7" not in old else 2), encoding="utf-8")
    with pytest.raises(FormatError) as caught:
        read_rapid_module(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)
    if at not in (None, "leaf"):
        assert f"line {_line_of(path.read_text(encoding='utf-8'), at)}" in str(caught.value)


def test_a_quaternion_that_is_none_is_refused(module_path, tmp_path):
    lines = module_path.read_text(encoding="ascii").split("\n")
    i = next(k for k, line in enumerate(lines) if "\\ID:=40" in line)
    head, tail = lines[i].split("],[", 1)
    lines[i] = head + "],[0.5," + tail.split(",", 1)[1]
    (tmp_path / "q.mod").write_text("\n".join(lines), encoding="ascii")
    with pytest.raises(FormatError, match=rf"line {i + 1}: robtarget: a frame is"):
        read_rapid_module(tmp_path / "q.mod")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no name, or no synchronous move"),
        ("MODULE a\nENDMODULE\n", "no synchronous move"),
        (None, "cannot be read"),
    ],
)
def test_what_is_no_module(tmp_path, text, message):
    path = tmp_path / "m.mod"
    if text is not None:
        path.write_text(text, encoding="ascii")
    with pytest.raises(FormatError, match=message):
        read_rapid_module(path)
