"""SVG: read back with svgelements, every path on its curve with y down, full or dashed, named."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest
import svgelements

from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError
from batten.io.bend_numbers import bend_numbers, drawn_curves
from batten.io.drawn_curve import DrawnCurve
from batten.io.svg import svg_text

NAMESPACE = "{http://www.w3.org/2000/svg}"


def path_points(data, count=7):
    """Points on every cubic of a path's data, as svgelements understands it."""
    points = []
    for segment in svgelements.Path(data):
        if isinstance(segment, svgelements.CubicBezier):
            points += [(p.x, p.y) for p in (segment.point(t) for t in np.linspace(0.0, 1.0, count))]
        else:
            assert isinstance(segment, svgelements.Move)
    return np.array(points)


@pytest.mark.parametrize("tolerance", [1e-1, 1e-3, 1e-6, 1e-9])
def test_paths_lie_on_their_curves_with_y_turned(bent, greatest_distance, tolerance):
    curves = drawn_curves(bend_numbers(bent.solutions))
    root = ElementTree.fromstring(svg_text(curves, tolerance, "mm"))
    paths = root.findall(f".//{NAMESPACE}path")
    assert len(paths) == 4
    for path, curve in zip(paths, curves):
        points = path_points(path.get("d")) * (1.0, -1.0)
        assert greatest_distance(points, curve.elastica) <= tolerance
        ends = curve.elastica.point_at([0.0, curve.elastica.length])
        assert points[[0, -1]] == pytest.approx(ends, abs=tolerance / 100.0)


def test_it_is_what_it_says(bent):
    curves = drawn_curves(bend_numbers(bent.solutions, bent.rod))
    text = svg_text(curves, 1e-3, "mm")
    root = ElementTree.fromstring(text.encode("utf-8"))
    assert root.tag == f"{NAMESPACE}svg"
    assert "transform" not in text
    x, y, width, height = map(float, root.get("viewBox").split())
    assert (root.get("width"), root.get("height")) == (f"{width:.9g}mm", f"{height:.9g}mm")
    paths = root.findall(f".//{NAMESPACE}path")
    for path, curve, solution in zip(paths, curves, bent.by_energy):
        points = path_points(path.get("d"))
        assert (points > (x, y)).all()
        assert (points < (x + width, y + height)).all()
        assert path.get("class") == ("stable" if solution.stable else "unstable")
        assert (path.get("stroke-dasharray") is None) == solution.stable
        title = path.find(f"{NAMESPACE}title").text
        assert title.startswith(f"{curve.name}: ")
        said = dict(part.split(" = ") for part in title.split(": ")[1].split(", "))
        assert float(said["energy"]) == pytest.approx(solution.energy, rel=1e-8)
        assert float(said["margin"]) == pytest.approx(solution.margin)
        assert said["stable"] == ("yes" if solution.stable else "no")
        assert float(said["energy_j"]) == pytest.approx(bent.rod.energy_j(solution.elastica), rel=1e-8)
    assert [path.get("id") for path in paths] == ["curve-1", "curve-2", "curve-3", "curve-4"]
    assert svg_text(curves, 1e-3, "mm") == text


def test_a_whole_program_for_svg_sees_the_same_picture(bent, tmp_path):
    """svgelements applies viewBox and size: one unit is one mm, so 96/25.4 pixels."""
    curves = drawn_curves(bend_numbers(bent.solutions))
    (tmp_path / "all.svg").write_text(svg_text(curves, 1e-3, "mm"), encoding="utf-8")
    seen = [e for e in svgelements.SVG.parse(str(tmp_path / "all.svg")).elements() if isinstance(e, svgelements.Path)]
    for path, curve in zip(seen, curves):
        low_x, low_y, high_x, high_y = (float(v) * 25.4 / 96.0 for v in path.bbox())
        points = curve.elastica.point(np.linspace(0, 1, 4001))
        assert (high_x - low_x, high_y - low_y) == pytest.approx(np.ptp(points, axis=0).tolist(), abs=2e-3)


def test_without_a_unit_far_away_and_special_signs():
    far = Elastica((1e5, -1e5), 0.0, 1.0, (0.5, 0.25), 2.0)
    text = svg_text([DrawnCurve(1, far, True, {"<&>": '"ä"'})], 1e-7)
    root = ElementTree.fromstring(text.encode("utf-8"))
    assert root.get("width") is None
    path = root.find(f".//{NAMESPACE}path")
    assert path.find(f"{NAMESPACE}title").text == 'curve 1: <&> = "ä"'
    points = path_points(path.get("d"), 2) * (1.0, -1.0)
    assert points[-1] == pytest.approx(far.point_at(2.0), abs=1e-9)
    assert not re.search(r"\de[-+]?\d", path.get("d")), "no exponents: some readers do not know them"
    assert "-0," not in path.get("d")


@pytest.mark.parametrize(("curves", "tolerance", "says"), [([], 1.0, "no curves"), ([1], 0.0, "tolerance = 0.0")])
def test_nothing_to_draw_and_no_tolerance(curves, tolerance, says):
    with pytest.raises(InvalidInputError, match=says):
        svg_text(curves, tolerance)
