"""Points of splines from JSON, Inkscape's SVG, SFD, GLIF and UFO, and what is wrong with files, in words."""

import plistlib
from pathlib import Path

import numpy as np
import pytest

from batten.errors import FormatError, InvalidInputError
from batten.io.spline_reading import read_splines

EXAMPLES = Path(__file__).parents[2] / "examples/splines"


def test_json_points():
    (leaf, stem), notes = read_splines(EXAMPLES / "leaf.json")
    assert (leaf.name, leaf.closed, leaf.corners, notes) == ("leaf", True, (0, 3), ())
    assert stem.points.shape == (4, 2)
    assert not stem.closed


def test_inkscape_nodes_have_the_letters_that_inkscape_gives_them():
    (hook,), _ = read_splines(EXAMPLES / "hook.svg")
    assert hook.types == "{]cc}"
    np.testing.assert_allclose(hook.points[:2], [[10, -5], [10, -55]])  # the group's transform, y up


@pytest.mark.parametrize(
    ("data", "types", "count"),
    [
        ("M0 0L10 0L20 5z", "vvv", 3),
        ("M0 0L10 0L20 5L0 0z", "vvv", 3),
        ("M0 0C1 0 9 0 10 0L20 0", "{[}", 3),
        ("M0 0L10 0L20 0", "{c}", 3),
        ("M0 0C0 5 5 10 10 10C15 10 20 5 20 0C20 -5 15 -10 10 -10C5 -10 0 -5 0 0z", "cccc", 4),
    ],
)
def test_inkscape_letters(tmp_path, data, types, count):
    text = (EXAMPLES / "hook.svg").read_text()
    old = text.split('original-d="')[1].split('"')[0]
    path = tmp_path / "a.svg"
    path.write_text(text.replace(f'original-d="{old}"', f'original-d="{data}"'))
    (found,), _ = read_splines(path)
    assert (found.types, len(found.points)) == (types, count)


def test_paths_without_the_effect_are_left(tmp_path):
    path = tmp_path / "a.svg"
    path.write_text('<svg xmlns="http://www.w3.org/2000/svg"><path d="M0 0L1 1"/></svg>')
    with pytest.raises(InvalidInputError, match="1 × <path> without the spiro effect"):
        read_splines(path)


def test_fontforge_contours():
    found, _ = read_splines(EXAMPLES / "a.sfd")
    assert [(f.name, f.types, f.closed) for f in found] == [("o 1", "oooo", True), ("o 2", "oooo", True)]
    np.testing.assert_array_equal(found[1].points[2], [440, 240])


def test_glyphs_and_fonts(tmp_path):
    (glyph,), _ = read_splines(EXAMPLES / "s.glif")
    assert (glyph.types, glyph.points.shape, glyph.closed) == ("{ooooo}", (7, 2), False)
    folder = tmp_path / "a.ufo/glyphs"
    folder.mkdir(parents=True)
    (folder / "s.glif").write_bytes((EXAMPLES / "s.glif").read_bytes())
    (folder / "contents.plist").write_bytes(plistlib.dumps({"s": "s.glif"}))
    assert read_splines(tmp_path / "a.ufo")[0][0].types == glyph.types


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.json", "{", "line 1"),
        ("a.json", "{}", 'no list "splines"'),
        ("a.json", '{"splines": [{"points": [[0, 0]]}]}', r"splines\[0\].points"),
        ("a.json", '{"splines": [{"points": [[0, 0], [1, "x"]]}]}', "no list of pairs"),
        ("a.json", '{"splines": [{"points": [[0, 0], [1, 1]], "closed": 1}]}', "true and false"),
        ("a.json", '{"splines": [{"points": [[0, 0], [1, 1]], "corners": [2]}]}', "0 to 1"),
        ("a.json", '{"splines": [{"points": [[0, 0], [1, 1]], "types": "{q"}]}', "allowed are the letters"),
        ("a.json", '{"splines": [{"points": [[0, 0], [1, 1]], "types": "{o}"}]}', "3 letters for 2 points"),
        ("a.json", '{"splines": [{"points": [[0, 0], [1, 1]], "start": "round"}]}', "natural"),
        ("a.json", '{"splines": [{"pts": []}]}', "pts: is no field"),
        ("a.svg", "<svg", "line 1"),
        ("a.svg", "<html/>", "outermost element is <html>"),
        ("a.sfd", "no font", "line 1"),
        ("a.sfd", "SplineFontDB: 3.2\n0 0 m 0\n Spiro\n 0 zero o\n EndSpiro\n", "line 4"),
        ("a.sfd", "SplineFontDB: 3.2\n0 0 m 0\n Spiro\n 0 0 q\n EndSpiro\n", "line 4: 'q'"),
        ("a.sfd", "SplineFontDB: 3.2\n0 0 m 0\n Spiro\n 0 0 o\n 1 1 o\n", "no EndSpiro"),
        ("a.glif", "<glyph", "no GLIF"),
    ],
)
def test_bad_files_are_refused_in_words(tmp_path, name, text, words):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(FormatError, match=words):
        read_splines(path)


def test_files_that_are_not_there(tmp_path):
    for name, words in (
        ("a.txt", "ending"),
        ("a.json", "no such file"),
        ("a.sfd", "no such file"),
        ("a.ufo", "no such"),
    ):
        with pytest.raises(InvalidInputError, match=words):
            read_splines(tmp_path / name)
