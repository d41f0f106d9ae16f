"""New drawings of paths, read back by other programs."""

import ezdxf
import numpy as np
import pytest
import rhino3dm
import svgelements

from batten.errors import InvalidInputError
from batten.io.bezier_paths import BezierPath, JsonPaths
from batten.io.path_drawings import ENDINGS, write_paths

CUBICS = np.array([[(0, 0), (0, 1 / 3), (1, 1), (1, 0)], [(1, 0), (1, -2), (0, -1 / 7), (0, 0)]])
PATHS = [BezierPath("a <b>", CUBICS, True), BezierPath("c", CUBICS[:1] + 3.0, False)]
CHAIN = np.concatenate([CUBICS[0], CUBICS[1, 1:]])


def test_json(tmp_path):
    write_paths(PATHS, tmp_path / "o.json")
    again = JsonPaths(tmp_path / "o.json").paths
    assert [(p.name, p.closed) for p in again] == [("a <b>", True), ("c", False)]
    assert (again[0].control_points == CUBICS).all()


def test_svg(tmp_path):
    write_paths(PATHS, tmp_path / "o.svg")
    found = list(
        svgelements.SVG.parse(tmp_path / "o.svg", width=1, height=1).select(lambda e: isinstance(e, svgelements.Path))
    )
    assert len(found) == 2
    text = (tmp_path / "o.svg").read_text()
    assert "<title>a &lt;b&gt;</title>" in text
    data = [s for s in svgelements.Path(text.split('d="')[1].split('"')[0]) if isinstance(s, svgelements.CubicBezier)]
    got = [[(p.x, -p.y) for p in (s.start, s.control1, s.control2, s.end)] for s in data]
    np.testing.assert_allclose(got, CUBICS, atol=4e-12)


def test_dxf(tmp_path):
    write_paths(PATHS, tmp_path / "o.dxf")
    splines = list(ezdxf.readfile(tmp_path / "o.dxf").modelspace())
    assert [e.dxftype() for e in splines] == ["SPLINE", "SPLINE"]
    assert np.array(splines[0].control_points)[:, :2].tolist() == CHAIN.tolist()
    middle = next(iter(splines[0].construction_tool().points([1.5])))
    np.testing.assert_allclose((middle.x, middle.y), [1, 3, 3, 1] @ CUBICS[1] / 8, atol=1e-12)


def test_3dm(tmp_path):
    write_paths(PATHS, tmp_path / "o.3dm")
    model = rhino3dm.File3dm.Read(str(tmp_path / "o.3dm"))
    curve = model.Objects[0].Geometry
    assert curve.IsValid
    assert model.Objects[0].Attributes.Name == "a <b>"
    point = curve.PointAt(0.5)
    np.testing.assert_allclose((point.X, point.Y), [1, 3, 3, 1] @ CUBICS[0] / 8, atol=1e-12)


def test_what_is_refused(tmp_path):
    with pytest.raises(InvalidInputError, match=r"allowed are \.svg, \.dxf, \.3dm, \.json"):
        write_paths(PATHS, tmp_path / "o.pdf")
    for ending in ENDINGS:
        with pytest.raises(InvalidInputError, match="no paths"):
            write_paths([], tmp_path / f"o{ending}")
    assert list(tmp_path.iterdir()) == []
