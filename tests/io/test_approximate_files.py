"""Drawings by pieces of elastica: what is read, what is written, and read back by others."""

import json

import ezdxf
import numpy as np
import pytest

from batten.curves.elastica import Elastica
from batten.curves.piecewise import PiecewiseCurve
from batten.curves.polyline import Polyline
from batten.errors import InvalidInputError
from batten.io.approximate_files import (
    approximate_curves,
    approximation_lines,
    path_curve,
    read_curves,
    write_approximations,
)
from batten.measures.distance import hausdorff_distance

SVG = """<svg xmlns="http://www.w3.org/2000/svg">
<path id="wave" d="M0 0C10 30 30 -20 40 10"/><path id="frame" d="M0 0H40V30H0Z"/></svg>"""
TOLERANCE = 0.1


@pytest.fixture
def drawing(tmp_path):
    path = tmp_path / "drawing.svg"
    path.write_text(SVG)
    return path


@pytest.fixture
def found(drawing):
    return approximate_curves(read_curves(drawing)[0], TOLERANCE)


def test_straight_paths_are_polylines(drawing):
    curves, notes = read_curves(drawing)
    assert [name for name, _ in curves] == ["wave", "frame"]
    assert isinstance(curves[0][1], PiecewiseCurve)
    assert isinstance(curves[1][1], Polyline)
    assert curves[1][1].points.tolist() == [[0, 0], [40, 0], [40, -30], [0, -30], [0, 0]]
    assert notes == ()
    back = np.array([[(0.0, 0.0), (2.0, 0.0), (-1.0, 0.0), (1.0, 0.0)]])
    assert not isinstance(path_curve(back), Polyline)  # it runs back over itself
    assert path_curve(np.zeros((2, 4, 2))) is None


@pytest.mark.parametrize("suffix", ["svg", "dxf", "3dm"])
def test_what_is_written_is_within_the_tolerance(found, tmp_path, suffix):
    out = tmp_path / f"out.{suffix}"
    write_approximations(found, out)
    curves, _ = read_curves(out)
    assert len(curves) == len(found)
    for (_, read), row in zip(curves, found):
        within = 1e-3 * TOLERANCE
        assert hausdorff_distance(read, row.curve, tolerance=within) <= row.result.distance + 2.0 * within
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


def test_json_holds_the_elastica_bit_by_bit(found, tmp_path):
    write_approximations(found, tmp_path / "out.json")
    document = json.loads((tmp_path / "out.json").read_text("utf-8"))
    assert document["parameters"][3] == "start_curvature"
    for row, (name, _, result) in zip(document["curves"], found):
        assert (row["name"], row["status"]) == (name, "converged")
        assert tuple(Elastica.from_parameters(piece["parameters"]) for piece in row["pieces"]) == result.pieces
        assert [piece["distance"] for piece in row["pieces"]] == result.distances.tolist()
        assert row["joints"] == result.joints.tolist()


def test_a_line_for_each_curve(found):
    lines = approximation_lines(found, ["1 × <rect> left as it is"])
    assert lines[0].split() == ["curve", "pieces", "bisection", "saved", "%", "distance", "status"]
    assert [line.split()[0] for line in lines[1:3]] == ["wave", "frame"]
    assert lines[2].split()[1:4] == ["4", "4", "0"]
    assert lines[3] == "1 × <rect> left as it is"


def test_dxf_is_read(tmp_path):
    document = ezdxf.new()
    document.modelspace().add_lwpolyline([(0, 0, 0.3), (30, 0, 0), (30, 20, 0)], format="xyb")
    document.saveas(tmp_path / "bulge.dxf")
    curves, _ = read_curves(tmp_path / "bulge.dxf")
    (row,) = approximate_curves(curves, 0.01)
    assert len(row.result.pieces) == 2  # the arc and the line are elastica, the corner stays
    assert row.result.corners.tolist() == [True, True, True]


def test_what_cannot_be_read_is_refused(tmp_path):
    with pytest.raises(InvalidInputError, match="ending"):
        read_curves(tmp_path / "drawing.png")
    for suffix in ("svg", "dxf"):
        with pytest.raises(InvalidInputError, match="no such file"):
            read_curves(tmp_path / f"drawing.{suffix}")
    ezdxf.new().saveas(tmp_path / "empty.dxf")
    with pytest.raises(InvalidInputError, match="no curves"):
        read_curves(tmp_path / "empty.dxf")
    with pytest.raises(InvalidInputError, match="dot: tolerance"):
        approximate_curves([("dot", Polyline([(0, 0), (1e9, 0)]))], 0.1)
