"""`batten spline` and `batten compare-splines`: files that other programs read, the table, exit statuses."""

from pathlib import Path

import ezdxf
import numpy as np
import pytest
import rhino3dm
import svgelements

from batten.cli.main import main
from batten.io.sfd import SfdFile
from batten.io.spline_files import draw_splines
from batten.io.spline_reading import read_splines

EXAMPLES = Path(__file__).parents[2] / "examples/splines"


def run(capsys, *words):
    status = main([str(w) for w in words])
    said = capsys.readouterr()
    return status, said.out, said.err


def curve_points(name):
    (drawn,) = draw_splines(read_splines(EXAMPLES / name)[0], tolerance=1e-6)
    return drawn.cubics.curve.point(np.linspace(0.0, 1.0, 4001))


def near(points, name, tolerance):
    """Whether points lie near the spline of an example, drawn finely."""
    dense = curve_points(name)
    return max(float(np.hypot(*(dense - p).T).min()) for p in points) <= tolerance


def test_svg_dxf_and_3dm_hold_the_curve(capsys, tmp_path):
    for ending in ("svg", "dxf", "3dm"):
        out = tmp_path / f"wave.{ending}"
        status, said, wrong = run(capsys, "spline", EXAMPLES / "wave.json", "--tolerance", 0.01, "-o", out)
        assert (status, wrong) == (0, "")
        assert said.endswith(f"written: {out}\n")
        assert said.splitlines()[1].split()[:3] == ["wave", "5", "euler"]
    path = next(e for e in svgelements.SVG.parse(tmp_path / "wave.svg").elements() if isinstance(e, svgelements.Path))
    seen = [path.point(t) for t in np.linspace(0.0, 1.0, 21)]
    box = [float(v) for v in (tmp_path / "wave.svg").read_text().split('viewBox="')[1].split('"')[0].split()]
    scale = svgelements.SVG.parse(tmp_path / "wave.svg").width / box[2]
    assert near([(p.x / scale + box[0], -(p.y / scale + box[1])) for p in seen], "wave.json", 0.03)
    spline = ezdxf.readfile(tmp_path / "wave.dxf").modelspace()[0]
    assert near([p.vec2 for p in spline.construction_tool().approximate(20)], "wave.json", 0.03)
    curve = rhino3dm.File3dm.Read(str(tmp_path / "wave.3dm")).Objects[0].Geometry
    domain = curve.Domain
    points = [curve.PointAt(domain.T0 + (domain.T1 - domain.T0) * r) for r in np.linspace(0.0, 1.0, 21)]
    assert near([(p.X, p.Y) for p in points], "wave.json", 0.03)


def test_an_sfd_keeps_its_constraints(capsys, tmp_path):
    out = tmp_path / "o.sfd"
    assert run(capsys, "spline", EXAMPLES / "a.sfd", "-o", out)[0] == 0
    old, new = SfdFile(EXAMPLES / "a.sfd"), SfdFile(out)
    for a, b in zip(old.splines, new.splines, strict=True):
        assert a.types == b.types
        np.testing.assert_array_equal(a.points, b.points)
    lines = out.read_text().splitlines()
    kept = [line for line in (EXAMPLES / "a.sfd").read_text().splitlines() if " c " not in line and " m " not in line]
    assert [line for line in lines if " c " not in line and " m " not in line] == kept
    ends = [line.split()[-5:-3] if line.rstrip().endswith("c 0") else None for line in lines]
    assert sum(e is not None for e in ends) >= 8


def test_a_glyph_keeps_its_points_and_has_an_outline(capsys, tmp_path):
    from fontTools.pens.recordingPen import RecordingPointPen
    from fontTools.ufoLib.glifLib import readGlyphFromString

    out = tmp_path / "s.glif"
    assert run(capsys, "spline", EXAMPLES / "s.glif", "-o", out)[0] == 0
    pen = RecordingPointPen()

    class Glyph:
        pass

    glyph = Glyph()
    readGlyphFromString(out.read_bytes(), glyph, pen)
    assert glyph.width == 400
    assert glyph.unicodes == [0x73]
    on = [args[1] for op, args, _ in pen.value if op == "addPoint"]
    assert on[0] == "move"
    assert on[-1] == "curve"
    assert read_splines(out)[0][0].types == read_splines(EXAMPLES / "s.glif")[0][0].types


@pytest.mark.parametrize(
    "method", ["mec", "log-aesthetic", "kurgla1", "hobby", "circle", "ikarus", "lagrange", "si-mec"]
)
def test_every_method_passes_through_the_points(method):
    given, _ = read_splines(EXAMPLES / "wave.json")
    (drawn,) = draw_splines(given, method)
    ends = np.array([s.point(0.0) for s in drawn.spline.segments] + [drawn.spline.segments[-1].point(1.0)])
    np.testing.assert_allclose(ends, given[0].points, atol=1e-11)
    assert drawn.cubics.distance <= 37e-4


def test_types_that_a_method_does_not_know_are_named(capsys, tmp_path):
    status, said, _ = run(capsys, "spline", EXAMPLES / "hook.svg", "--method", "euler", "-o", tmp_path / "a.svg")
    assert status == 0
    assert "types ] are kept for method spiro" in said


def test_no_spline_is_status_one_and_a_fallback_says_so(capsys, tmp_path):
    path, out = tmp_path / "hair.json", tmp_path / "hair.svg"
    path.write_text('{"splines": [{"name": "hair", "points": [[0, 0], [1, 0], [0, 0.2], [1, 0.2], [0, 0.4]]}]}')
    status, _, wrong = run(capsys, "spline", path, "--method", "mec", "-o", out)
    assert status == 1
    assert "hair: " in wrong
    assert not out.exists()
    status, said, _ = run(capsys, "spline", path, "--method", "mec", "--fallback", "-o", out)
    assert status == 1
    assert "fallback" in said
    assert out.exists()


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (("wave.json", "-o", "a.png"), "ending"),
        (("wave.json", "-o", "a.sfd"), "from an SFD alone"),
        (("a.sfd", "-o", "a.glif"), "one glyph"),
        (("wave.json", "-o", "none/a.svg"), "no folder"),
        (("wave.json", "--tolerance", "0", "-o", "a.svg"), "--tolerance"),
        (("s.glif", "--closed", "-o", "a.svg"), "--closed"),
        (("leaf.json", "--method", "si-mec", "-o", "a.svg"), "no corners"),
    ],
)
def test_bad_input_is_one_line(capsys, tmp_path, monkeypatch, words, what):
    monkeypatch.chdir(tmp_path)
    status, said, wrong = run(capsys, "spline", EXAMPLES / words[0], *words[1:])
    assert (status, said) == (2, "")
    assert what in wrong
    assert wrong.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_all_methods_in_one_picture_and_one_table(capsys, tmp_path):
    for ending, head in (("png", b"\x89PNG"), ("svg", b"<?xml")):
        out, again = tmp_path / f"a.{ending}", tmp_path / f"b.{ending}"
        status, said, _ = run(capsys, "compare-splines", EXAMPLES / "leaf.json", "-o", out)
        assert status == 0
        assert out.read_bytes().startswith(head)
        run(capsys, "compare-splines", EXAMPLES / "leaf.json", "-o", again)
        assert out.read_bytes() == again.read_bytes()
    rows = [line.split() for line in said.splitlines()]
    assert [row[0] for row in rows[1:11]] == [
        "euler", "mec", "log-aesthetic", "kurgla1", "hobby", "circle", "ikarus", "lagrange", "si-mec", "spiro",
    ]  # fmt: skip
    energies = {row[0]: float(row[5]) for row in rows[1:11]}
    assert energies["mec"] <= min(v for k, v in energies.items() if k != "si-mec") * (1.0 + 1e-9)  # what the MEC is
    assert run(capsys, "compare-splines", EXAMPLES / "leaf.json", "-o", tmp_path / "a.pdf")[0] == 2
