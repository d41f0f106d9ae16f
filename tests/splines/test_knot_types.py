"""Types of knots: numbers of parameters, runs, and what is refused."""

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.splines.knot_equations import KnotEquations
from batten.splines.knot_types import read_knots, runs

# Left and right letter of a segment (Levien2009 ch. 8): four beside o, right of ] and of an anchor, left of [ and of an
# anchor; two between c and c; one between c and an end; none else.
COUNTS = {
    4: "oo oc ov o} o[ o] oa co vo {o [o ]o ao ]c ]v ]} ][ ]] ]a ac av a} a[ a] aa c[ v[ {[ [[ ca va {a [a",
    2: "cc",
    1: "{c vc [c c} cv c]",
    0: "vv {v v} {} [] [v [} v] {]",
}


def _points(n: int) -> np.ndarray:
    return np.stack([np.arange(n), np.arange(n) % 2 * 0.3], axis=1)


@pytest.mark.parametrize("count", COUNTS)
def test_numbers_of_parameters(count):
    for left, right in COUNTS[count].split():
        types = ("" if left == "{" else "{") + left + ("h" if left == "a" else "")
        types += right + ("h" if right == "a" else "") + ("" if right == "}" else "}")
        path = read_knots(_points(len(types)), types)
        assert path.parameters()[path.letters.index(left + right)] == count, left + right


def test_every_pair_of_letters_is_counted():
    pairs = {p for text in COUNTS.values() for p in text.split()}
    assert pairs == {a + b for a in "{voc[]a" for b in "}voc[]a"}


def test_there_are_as_many_equations_as_unknowns():
    """Whatever the types: random ones, with over a thousand runs in all."""
    random = np.random.default_rng(0)
    count = 0
    for _ in range(800):
        letters = "".join(random.choice(list("oocv[]"), random.integers(2, 12)))
        letters = letters.replace("v", "ah") if random.integers(2) else letters
        types = letters + "z" if random.integers(2) else "{" + letters + "}"
        path = read_knots(_points(len(types) - types.endswith("z")), types)
        found = runs(path)
        assert sorted([i for r in found for i in r.segments]) == np.flatnonzero(path.parameters()).tolist()
        for run in found:
            m = len(run.segments)
            equations = KnotEquations(run, np.ones(m), np.zeros(m + (not run.closed)))
            assert equations.rows == equations.unknowns == path.parameters()[run.segments].sum()
            count += 1
    assert count > 1000


def test_runs_of_a_path():
    points = np.array([[0, 0], [1, 1], [2, 1], [3, 1], [4, 0], [5, 0], [5, 1], [6, 0], [7, 0]])
    path = read_knots(points, "{o[]cahv}")
    assert (path.letters, path.closed, path.places.tolist()) == ("{o[]cav}", False, [0, 1, 2, 3, 4, 5, 7, 8])
    found = runs(path)
    assert [r.segments.tolist() for r in found] == [[0, 1], [3, 4], [5]]
    assert [r.letters for r in found] == ["o", "c", ""]
    assert [r.boundaries for r in found] == [("free", "line"), ("line", "line"), ("line", "free")]
    assert [r.directions for r in found] == [(0.0, 0.0), (0.0, np.pi / 2), (np.pi / 2, 0.0)]


def test_closed_paths_wrap_around():
    points = _points(5)
    whole = runs(read_knots(points, "ocooo" + "z"))
    assert [(r.segments.tolist(), r.letters, r.closed) for r in whole] == [([0, 1, 2, 3, 4], "ocooo", True)]
    split = runs(read_knots(points, "oovoo" + "z"))
    assert [(r.segments.tolist(), r.letters, r.closed) for r in split] == [([2, 3, 4, 0, 1], "oooo", False)]
    anchored = read_knots(points, "hoooa" + "z")  # the handle of the last point is the first
    assert (anchored.letters, anchored.places.tolist()) == ("oooa", [1, 2, 3, 4])
    assert anchored.handles[3] == np.arctan2(0.0, -4.0)


def test_libspiros_closing_point_and_fontforges_open_paths_are_read():
    """A `z` with a place; an open path that ends with a z and with a letter of its own (as in SFD files)."""
    points = _points(4)
    assert read_knots(points, "ooo" + "z").letters == "ooo"
    path = read_knots(points, "{ooz")
    assert (path.letters, path.closed, len(path.knots)) == ("{o}", False, 3)


@pytest.mark.parametrize(
    ("points", "types", "words"),
    [
        (_points(3), "oxo", "'x'; allowed are .*corner"),
        (_points(3), "ooo", "begin with { or end with z"),
        (_points(3), "{o", "one type for each"),
        (_points(1), "oz", "n ≥ 2"),
        ([[0, 0], [np.inf, 1], [2, 0]], "{o}", "finite"),
        ([[0, 0, 0], [1, 1, 0]], "{}", r"\(n, 2\)"),
        (_points(4), "{o{}", "inside a path"),
        (_points(4), "{oz}", "inside a path"),
        (_points(4), "{ao}", "anchor a at 1 needs its handle"),
        (_points(4), "{oh}", "handle h at 2 needs its anchor"),
        (_points(4), "{oah", "anchor a at 2 needs its handle"),
        ([[0, 0], [1, 1], [1, 1], [2, 0]], "{ah}", "a handle gives a direction"),
        ([[0, 0], [1, 1], [1, 1], [2, 0]], "{oo}", "points 1 and 2 are the same"),
        ([[0, 0], [1, 1], [2, 0], [0, 0]], "oooo" + "z", "last point of a closed path"),
        ([[0, 0], [1, 1]], "ahz", "two knots"),
    ],
)
def test_bad_input_is_refused_in_words(points, types, words):
    with pytest.raises(InvalidInputError, match=words):
        read_knots(points, types)
