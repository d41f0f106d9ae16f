"""DXF drawings read as curves: against closed forms, and against ezdxf's own flattening."""

import math

import ezdxf
import numpy as np
import pytest

from batten.curves.bspline import BSplineCurve
from batten.curves.elastica import Elastica
from batten.curves.piecewise import PiecewiseCurve
from batten.curves.polyline import Polyline
from batten.errors import FormatError
from batten.io.dxf_curves import read_dxf_curves


@pytest.fixture
def drawn(tmp_path):
    document = ezdxf.new()

    def read():
        document.saveas(tmp_path / "drawing.dxf")
        return read_dxf_curves(tmp_path / "drawing.dxf")

    return document.modelspace(), read


def test_lines_arcs_and_circles(drawn):
    space, read = drawn
    space.add_line((1, 2), (4, 6))
    space.add_arc((1, 1), radius=2, start_angle=350, end_angle=80)
    space.add_circle((5, 5), radius=3)
    (_, line), (_, arc), (_, circle) = read()[0]
    assert isinstance(line, Polyline)
    assert line.length == 5.0
    assert isinstance(arc, Elastica)
    ends = [(1 + 2 * math.cos(math.radians(a)), 1 + 2 * math.sin(math.radians(a))) for a in (350, 80)]
    assert np.allclose(arc.point([0.0, 1.0]), ends, atol=1e-12)
    assert arc.length == pytest.approx(math.pi, abs=1e-12)
    assert circle.length == pytest.approx(6 * math.pi, abs=1e-12)


@pytest.mark.parametrize("closed", [False, True])
def test_bulges_are_arcs(drawn, closed):
    space, read = drawn
    rows = [(0, 0, 0.5), (4, 0, 0), (4, 3, -1.7), (0, 3, 0.2)]
    entity = space.add_lwpolyline(rows, format="xyb", close=closed)
    ((name, curve),), notes = read()
    assert (name, notes) == (f"LWPOLYLINE {entity.dxf.handle}", ())
    assert isinstance(curve, PiecewiseCurve)
    parts = list(entity.virtual_entities())  # ezdxf's own arcs and lines
    assert len(parts) == len(curve.pieces)
    for part, piece in zip(parts, curve.pieces):
        ends = (
            {tuple(np.round(tuple(p)[:2], 9)) for p in (part.start_point, part.end_point)}
            if part.dxftype() == "ARC"
            else None
        )
        if ends is None:
            assert piece.point([0.0, 1.0]).tolist() == [list(part.dxf.start)[:2], list(part.dxf.end)[:2]]
            continue
        assert {tuple(np.round(p, 9)) for p in piece.point([0.0, 1.0])} == ends
        centre = np.array(tuple(part.dxf.center)[:2])
        assert np.allclose(np.hypot(*(piece.point(np.linspace(0, 1, 9)) - centre).T), part.dxf.radius, atol=1e-12)
        turn = math.radians((part.dxf.end_angle - part.dxf.start_angle) % 360.0)
        assert piece.length == pytest.approx(turn * part.dxf.radius, abs=1e-12)
    assert (curve.joints().position_jumps < 1e-12).all()


def test_polylines_without_bulges_and_splines(drawn):
    space, read = drawn
    space.add_lwpolyline([(0, 0), (1, 0), (1, 0), (1, 1)], close=True)
    space.add_open_spline([(0, 0), (1, 2), (2, -1), (3, 0), (4, 4)], degree=3)
    (_, polyline), (_, spline) = read()[0]
    assert polyline.points.tolist() == [[0, 0], [1, 0], [1, 1], [0, 0]]
    assert isinstance(spline, BSplineCurve)
    assert spline.point([0.0, 1.0]).tolist() == [[0.0, 0.0], [4.0, 4.0]]


def test_what_is_left_out_is_said(drawn):
    space, read = drawn
    space.add_text("words")
    space.add_rational_spline([(0, 0), (1, 2), (2, -1), (3, 0)], weights=[1, 2, 1, 1])
    space.add_circle((0, 0), radius=1, dxfattribs={"extrusion": (0, 0, -1)})
    curves, notes = read()
    assert curves == []
    assert notes == (
        "1 × CIRCLE not in the plane seen from above left out",
        "1 × TEXT left out",
        "1 × rational SPLINE left out",
    )


def test_what_is_no_dxf_is_refused(tmp_path):
    path = tmp_path / "words.dxf"
    path.write_text("no drawing\n")
    with pytest.raises(FormatError, match=r"words\.dxf"):
        read_dxf_curves(path)
