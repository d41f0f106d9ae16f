"""Files of a bent rod: the name says the format, whole or not at all, and the same bytes for the same input."""

import json
import os
import stat
import sys

import ezdxf
import pytest
import rhino3dm
import svgelements

from batten.errors import InvalidInputError
from batten.io import bend_files
from batten.io.bend_files import write_bend

OPENERS = {
    ".svg": lambda path: svgelements.SVG.parse(str(path)),
    ".dxf": lambda path: ezdxf.readfile(path),
    ".3dm": lambda path: rhino3dm.File3dm.Read(str(path)).Objects[3],
    ".json": lambda path: json.loads(path.read_text(encoding="utf-8")),
    ".png": lambda path: path.read_bytes().index(b"IEND"),
}


@pytest.mark.parametrize("with_rod", [True, False])
@pytest.mark.parametrize("suffix", [*OPENERS, ".SVG"])
def test_the_ending_says_the_format(bent, tmp_path, suffix, with_rod):
    path = tmp_path / f"shapes{suffix}"
    path.write_text("something older")
    write_bend(bent.problem, bent.solutions, path, bent.rod if with_rod else None)
    assert OPENERS[suffix.lower()](path)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("suffix", [".svg", ".dxf", ".json", ".png"])
def test_the_same_shapes_give_the_same_bytes(bent, tmp_path, suffix):
    for name in ("one", "two"):
        write_bend(bent.problem, bent.solutions, tmp_path / f"{name}{suffix}", bent.rod)
    assert (tmp_path / f"one{suffix}").read_bytes() == (tmp_path / f"two{suffix}").read_bytes()


@pytest.mark.parametrize("suffix", list(OPENERS))
def test_an_error_leaves_what_was_there(bent, tmp_path, monkeypatch, suffix):
    def fail(problem, solutions, part, rod):
        part.write_text("half of it")
        raise OSError(28, "No space left on device")

    path = tmp_path / f"shapes{suffix}"
    path.write_text("something older")
    monkeypatch.setitem(bend_files._WRITERS, suffix, fail)
    with pytest.raises(OSError, match="No space"):
        write_bend(bent.problem, bent.solutions, path)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    assert path.read_text() == "something older"


@pytest.mark.skipif(sys.platform == "win32", reason="modes work otherwise there")
def test_the_file_is_as_readable_as_any_other(bent, tmp_path):
    (tmp_path / "other.txt").write_text("")
    write_bend(bent.problem, bent.solutions, tmp_path / "shapes.json")
    modes = {stat.S_IMODE(os.stat(tmp_path / name).st_mode) for name in ("other.txt", "shapes.json")}
    assert len(modes) == 1


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("shapes.pdf", "has the ending .pdf; allowed are .svg, .dxf, .3dm, .json, .png; try"),
        ("shapes", "has no ending; allowed are"),
        ("nowhere/shapes.svg", "there is no folder"),
        ("folder.svg", "is a folder"),
    ],
)
def test_other_names_are_refused(bent, tmp_path, name, says):
    (tmp_path / "folder.svg").mkdir()
    with pytest.raises(InvalidInputError) as caught:
        write_bend(bent.problem, bent.solutions, tmp_path / name)
    assert says in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path / name))
    assert [p.name for p in tmp_path.iterdir()] == ["folder.svg"]


def test_no_solutions_are_no_file(bent, tmp_path):
    with pytest.raises(InvalidInputError, match="nothing to write"):
        write_bend(bent.problem, [], tmp_path / "shapes.svg")
    assert list(tmp_path.iterdir()) == []
