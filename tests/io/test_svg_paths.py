"""SVG drawings: what is read through transforms, what is written, and that all else stays byte by byte."""

import re

import numpy as np
import pytest
import svgelements

from batten.errors import FormatError
from batten.io.svg_paths import SvgPaths

HEAD = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:x="urn:x" width="100" height="100" viewBox="0 0 100 100">'
DRAWING = f"""<?xml version='1.0' encoding='utf-8'?>
<!DOCTYPE svg>
{HEAD}
  <!-- d="M0 0" is no path --><style>path {{ fill: none }}</style>
  <x:data path="M1 1" d='m 0 0'>ä &amp; ö</x:data>
  <g transform="translate(10,20) rotate(30)"><g transform="scale(2 0.5)">
    <path x:d="none" id="one" class='a' d = '  m1,1 c 0 1,1 2,3 1 s 2-1 3 1
       q 1 1 2 0 t 3 1 h4 V 9 l-1-1 z m 2 2 c 1 0 1 1 0 1 z' style="stroke:red"/>
  </g></g>
  <path
     id="two" d="M5 5A3 3 0 0 1 11 5 C 12 8 15 8 16 5A4 2 30 1 0 20 9" stroke-width="&#49;"/>
  <rect width="3" height="4"/><circle r="2"/><circle r="3"/>
  <clipPath id="c"><path d="M0 0C1 1 2 1 3 0"/></clipPath>
  <path d="M0 0C1 1 2 1 3 0" style="transform: scale(2)"/>
</svg>
"""


def read(tmp_path, text, name="in.svg"):
    file = tmp_path / name
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    return SvgPaths(file)


def points_of(path, count=41):
    """Points of every drawn piece of a svgelements path, absolute."""
    return [np.array([(p.x, p.y) for p in (s.point(t) for t in np.linspace(0, 1, count))]) for s in path if s.start]


def test_paths_are_read_as_they_are_seen(tmp_path):
    drawing = read(tmp_path, DRAWING)
    assert [p.name for p in drawing.paths] == ["one part 1", "one part 2", "two"]
    assert [p.closed for p in drawing.paths] == [True, True, False]
    seen = svgelements.Path(
        svgelements.SVG.parse(tmp_path / "in.svg", reify=True).get_element_by_id("one")
    ).as_subpaths()
    for path, subpath in zip(drawing.paths, seen):
        other = [p for p in points_of(svgelements.Path(subpath)) if np.ptp(p, axis=0).max() > 0]
        t = np.linspace(0, 1, 41)[:, None]
        basis = np.concatenate([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3], axis=1)
        for cubic, points in zip(path.control_points, other, strict=True):
            np.testing.assert_allclose(basis @ cubic * (1, -1), points, atol=2e-5)  # its matrices have six decimals
    assert drawing.notes == (
        "2 × <circle> left as it is",
        "1 × <path> in <clipPath> left as it is",
        "1 × <path> with a transform or data in its style left as it is",
        "1 × <rect> left as it is",
    )


def test_arcs_of_circles_as_they_are_seen_are_fixed(tmp_path):
    drawing = read(tmp_path, DRAWING)
    two = drawing.paths[2]
    circle = two.control_points[two.fixed]
    np.testing.assert_allclose(np.linalg.norm(circle[:, [0, 3]] - (8.0, -5.0), axis=-1), 3.0, atol=1e-6)
    assert two.fixed.sum() < len(two.fixed) - 1
    text = HEAD + '<g transform="scale(1 2)"><path d="M0 0a2 2 0 0 1 2 2"/><path d="M0 0a4 2 0 0 1 4 2"/></g></svg>'
    stretched = read(tmp_path, text)
    assert [bool(p.fixed.all()) for p in stretched.paths] == [False, True]
    squeezed = read(
        tmp_path,
        HEAD.replace('height="100"', 'height="50" preserveAspectRatio="none"') + '<path d="M0 0a2 2 0 0 1 2 2"/></svg>',
    )
    assert not squeezed.paths[0].fixed.any()
    np.testing.assert_allclose(squeezed.paths[0].control_points[-1, 3], (2.0, -1.0))


def test_unchanged_drawings_are_the_same_bytes(tmp_path):
    drawing = read(tmp_path, DRAWING.replace("\n", "\r\n"))
    drawing.write([p.control_points for p in drawing.paths], tmp_path / "out.svg")
    assert (tmp_path / "out.svg").read_bytes() == (tmp_path / "in.svg").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["in.svg", "out.svg"]


def test_only_the_data_of_changed_paths_is_replaced(tmp_path):
    drawing = read(tmp_path, DRAWING)
    changed = [p.control_points.copy() for p in drawing.paths]
    changed[0][1, 1:3] += 0.25
    drawing.write(changed, tmp_path / "out.svg")
    old, new = DRAWING, (tmp_path / "out.svg").read_text("utf-8")
    start = old.index("  m1,1")
    stop = old.index("' style=\"stroke:red")
    assert new.startswith(old[:start])
    assert new.endswith(old[stop:])
    data = new[start : len(new) - len(old) + stop]
    assert re.sub(r"[^A-Za-z]", "", data.replace("e", "")) == "MCCQQLLLZMCZ"
    again = SvgPaths(tmp_path / "out.svg")
    for path, wanted in zip(again.paths, changed, strict=True):
        np.testing.assert_allclose(path.control_points, wanted, atol=1e-10)
    drawing.write(changed, tmp_path / "in.svg")  # onto the file itself
    assert (tmp_path / "in.svg").read_text("utf-8") == new


def test_every_kind_of_piece_survives_a_change_beside_it(tmp_path):
    drawing = read(tmp_path, DRAWING)
    changed = [p.control_points.copy() for p in drawing.paths]
    free = int(np.flatnonzero(~drawing.paths[2].fixed)[0])
    changed[2][free, 1] += (0.1, 0.2)
    drawing.write(changed, tmp_path / "out.svg")
    old, new = [
        svgelements.Path(re.search(r'id="two" d="([^"]*)"', text)[1])
        for text in (DRAWING, (tmp_path / "out.svg").read_text("utf-8"))
    ]
    kinds = [type(s).__name__ for s in new]
    assert kinds == ["Move", "Arc", "CubicBezier", "Arc"]
    for i in (1, 3):
        np.testing.assert_allclose(points_of([old[i]])[0], points_of([new[i]])[0], atol=1e-6)
    changed[2][-1, 1] += (0.1, 0.2)  # the ellipse becomes cubics
    drawing.write(changed, tmp_path / "out.svg")
    text = re.search(r'id="two" d="([^"]*)"', (tmp_path / "out.svg").read_text("utf-8"))[1]
    assert [type(s).__name__ for s in svgelements.Path(text)][:2] == ["Move", "Arc"]
    assert text.count("A") == 1
    np.testing.assert_allclose(SvgPaths(tmp_path / "out.svg").paths[2].control_points, changed[2], atol=1e-6)


def test_moved_starts_and_large_offsets(tmp_path):
    text = HEAD + '<path transform="matrix(0 1 -2 0 1e4 5)" d="m1000 1000c0 1 1 1 1 0l1 0c1 1 2-1 2 2z"/></svg>'
    drawing = read(tmp_path, text)
    changed = [p.control_points.copy() for p in drawing.paths]
    changed[0][0, :2] += (1.0, -2.0)
    drawing.write(changed, tmp_path / "out.svg")
    again = SvgPaths(tmp_path / "out.svg").paths[0].control_points
    np.testing.assert_allclose(again[:3], changed[0][:3], atol=1e-9)


def test_a_dot_beside_a_curve_and_a_comment_with_a_path(tmp_path):
    text = HEAD + '<path d="M5 5zM1 1C1 2 2 2 2 1M7 7"/></svg>'
    drawing = read(tmp_path, text)
    changed = [p.control_points.copy() for p in drawing.paths]
    changed[1][0, 1] += 1.0
    drawing.write(changed, tmp_path / "out.svg")
    assert "M5,5Z" in (tmp_path / "out.svg").read_text()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("<svg><path d='M0 0C1 1'/></svg>", "line 1: <path>: its data cannot be read"),
        ("<svg>\n<path id='p' d='hello'/></svg>", "line 2: <path> 'p': its data cannot be read"),
        ("<svg><path d='C1 1 2 2 3 3'/></svg>", "its data cannot be read"),
        ("<svg><path d='M0 0C1 1 2 2 1e999 3'/></svg>", "its data cannot be read"),
        ("<svg>\n<g transform='turn(3'/></svg>", "line 2: <g>: its transform"),
        ("<svg><path d='M0 0'></svg>", "mismatched tag; SVG is needed"),
        ("<html/>", "the outermost element is <html>"),
        ("", "no element found"),
        (b"\x1f\x8b\x08\x00\x00", "SVG is needed"),
    ],
)
def test_bad_files_name_the_place(tmp_path, text, says):
    with pytest.raises(FormatError, match=re.escape(says)) as caught:
        read(tmp_path, text)
    assert "in.svg" in str(caught.value)
