"""Design curves written for jobs, read back by Rhino's library and by `read_design_curves`."""

import numpy as np
import pytest
import rhino3dm

from batten.curves.bspline import BSplineCurve
from batten.errors import InvalidInputError
from batten.fabrication.job import SurfaceJob
from batten.io.design_curves_file import write_design_curves
from batten.io.job_surface import read_job_surface
from batten.io.rhino import DesignCurves, read_design_curves
from batten.surfaces.loft import loft

RNG = np.random.default_rng(8)


def design(axis, knots=(0, 0, 0, 0, 1, 1, 2, 2, 2, 2), count=3):
    n = len(knots) - 4
    points = [np.column_stack([np.linspace(0, 900, n), 50 * RNG.normal(size=n)]) for _ in range(count)]
    return DesignCurves(tuple(BSplineCurve(knots, p) for p in points), np.array([-100.0, 30.5, 400.0])[:count], axis)


def test_a_job_reads_the_curves_bit_by_bit(tmp_path):
    path = tmp_path / "designs.3dm"
    designs = {"one": design("x"), "the other": design("y", (0, 0, 0, 0, 0.3, 0.7, 1, 1, 1, 1))}
    write_design_curves(path, designs)
    for name, written in designs.items():
        read = read_design_curves(path, layer=name)
        assert read.blade_axis == written.blade_axis
        assert read.positions.tolist() == written.positions.tolist()
        for a, b in zip(read.curves, written.curves, strict=True):
            assert np.array_equal(a.control_points, b.control_points)
            assert np.array_equal(a.knots, b.knots)
        surface = read_job_surface(SurfaceJob(curves=path, layer=name))
        wanted = loft(written.curves, written.positions, blade_axis=written.blade_axis)
        assert np.array_equal(surface.control_points, wanted.control_points)


def test_the_file_is_in_mm_with_a_layer_for_each_design(tmp_path):
    path = tmp_path / "designs.3dm"
    write_design_curves(path, {"one": design("x", count=2), "two": design("y")})
    model = rhino3dm.File3dm.Read(str(path))
    assert model.Settings.ModelUnitSystem == rhino3dm.UnitSystem.Millimeters
    assert [layer.Name for layer in model.Layers] == ["one", "two"]
    found = [(item.Attributes.LayerIndex, item.Attributes.Name, item.Geometry.IsValid) for item in model.Objects]
    assert found[:2] == [(0, "one at -100 mm", True), (0, "one at 30.5 mm", True)]
    assert len(found) == 5
    assert [p.name for p in tmp_path.iterdir()] == ["designs.3dm"]


@pytest.mark.parametrize("name", ["", " ", "a:b", "x" * 61])
def test_a_layer_needs_a_name(tmp_path, name):
    with pytest.raises(InvalidInputError, match="a layer has a name"):
        write_design_curves(tmp_path / "designs.3dm", {name: design("x")})
    assert list(tmp_path.iterdir()) == []
