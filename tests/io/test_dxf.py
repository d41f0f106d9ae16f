"""DXF: read back with ezdxf, the audit is clean, every spline is its Béziers."""

import io

import ezdxf
import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.io.bend_numbers import bend_numbers, drawn_curves
from batten.io.dxf import dxf_text


def read(text):
    document = ezdxf.read(io.StringIO(text))
    auditor = document.audit()
    assert not auditor.errors
    assert not auditor.fixes
    return document


@pytest.mark.parametrize("unit", ["mm", None])
def test_layers_units_and_dashes(bent, unit):
    document = read(dxf_text(drawn_curves(bend_numbers(bent.solutions, bent.rod)), 1e-3, unit))
    assert document.units == (4 if unit == "mm" else 0)
    assert document.layers.get("unstable").dxf.linetype == "DASHED"
    assert document.layers.get("stable").dxf.linetype == "Continuous"
    assert len(document.linetypes.get("DASHED").pattern_tags.tags) > 3
    splines = list(document.modelspace())
    assert [s.dxftype() for s in splines] == ["SPLINE"] * 4
    assert [s.dxf.layer for s in splines] == ["stable" if s.stable else "unstable" for s in bent.by_energy]
    assert {s.dxf.get("linetype", "BYLAYER") for s in splines} == {"BYLAYER"}
    assert splines[1].get_xdata("BATTEN")[0].value.startswith("curve 2: energy = ")


@pytest.mark.parametrize("tolerance", [1e-1, 1e-4, 1e-9])
def test_splines_are_their_beziers_and_lie_on_their_curves(bent, greatest_distance, tolerance):
    curves = drawn_curves(bend_numbers(bent.solutions))
    document = read(dxf_text(curves, tolerance))
    for spline, curve in zip(document.modelspace(), curves):
        assert (spline.dxf.degree, spline.closed) == (3, False)
        tool = spline.construction_tool()
        beziers = curve.elastica.to_beziers(tolerance)
        parts = list(tool.bezier_decomposition())
        assert len(parts) == len(beziers)
        for part, bezier in zip(parts, beziers):
            assert np.array([(p.x, p.y, p.z) for p in part])[:, :2] == pytest.approx(bezier.control_points, abs=1e-12)
        t = np.linspace(0.0, len(beziers), 6 * len(beziers) + 1)
        points = np.array([(p.x, p.y) for p in tool.points(t)])
        assert greatest_distance(points, curve.elastica) <= tolerance
        # one tangent where two pieces meet
        before, after = (
            np.array([(p.x, p.y) for p in tool.points(np.arange(1, len(beziers)) + d)]) for d in (-1e-6, 1e-6)
        )
        at = np.array([(p.x, p.y) for p in tool.points(np.arange(1, len(beziers)).astype(float))])
        one, other = at - before, after - at
        cross = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
        assert np.abs(cross / np.linalg.norm(one, axis=1) / np.linalg.norm(other, axis=1)).max() < 1e-4


def test_the_same_curves_give_the_same_text(bent):
    curves = drawn_curves(bend_numbers(bent.solutions))
    before = ezdxf.options.write_fixed_meta_data_for_testing
    assert dxf_text(curves, 1e-3) == dxf_text(curves, 1e-3)
    assert ezdxf.options.write_fixed_meta_data_for_testing == before


@pytest.mark.parametrize(("curves", "tolerance", "says"), [([], 1.0, "no curves"), ([1], np.nan, "tolerance = nan")])
def test_nothing_to_draw_and_no_tolerance(curves, tolerance, says):
    with pytest.raises(InvalidInputError, match=says):
        dxf_text(curves, tolerance)
