"""Curves as .3dm: read back with rhino3dm, valid, on their layers, with their numbers, on their elastica."""

import numpy as np
import pytest
import rhino3dm

from batten.curves.elastica import Elastica
from batten.errors import FormatError
from batten.io.bend_numbers import bend_numbers, drawn_curves
from batten.io.drawn_curve import DrawnCurve
from batten.io.rhino_curves import write_curves_3dm


@pytest.mark.parametrize("unit", ["mm", None])
def test_layers_units_and_texts(bent, tmp_path, unit):
    rows = bend_numbers(bent.solutions, bent.rod)
    write_curves_3dm(drawn_curves(rows), tmp_path / "all.3dm", 1e-3, unit)
    assert [p.name for p in tmp_path.iterdir()] == ["all.3dm"]
    model = rhino3dm.File3dm.Read(str(tmp_path / "all.3dm"))
    units = rhino3dm.UnitSystem
    assert model.Settings.ModelUnitSystem == (units.Millimeters if unit == "mm" else getattr(units, "None"))
    layers = [layer.FullPath for layer in model.Layers]
    assert layers == ["stable", "unstable"]
    assert len(model.Objects) == 4
    for item, row in zip(model.Objects, rows):
        assert item.Geometry.IsValid
        assert layers[item.Attributes.LayerIndex] == ("stable" if row.solution.stable else "unstable")
        assert item.Attributes.Name == f"curve {row.number}"
        texts = dict(item.Attributes.GetUserStrings())
        assert float(texts["energy"]) == pytest.approx(row.solution.energy, rel=1e-8)
        assert float(texts["margin"]) == pytest.approx(row.solution.margin)
        assert float(texts["force_n"]) == pytest.approx(row.rod.force_size_n, rel=1e-8)
        assert [float(v) for v in texts["force"].split()] == pytest.approx(row.force, rel=1e-8)


@pytest.mark.parametrize("tolerance", [1.0, 1e-2, 1e-4, 1e-6])
def test_curves_are_smooth_cubics_on_their_elastica(bent, greatest_distance, tmp_path, tolerance):
    curves = drawn_curves(bend_numbers(bent.solutions))
    write_curves_3dm(curves, tmp_path / "all.3dm", tolerance)
    for item, curve in zip(rhino3dm.File3dm.Read(str(tmp_path / "all.3dm")).Objects, curves):
        nurbs, elastica = item.Geometry, curve.elastica
        assert (nurbs.Degree, nurbs.IsRational) == (3, False)
        t = np.linspace(nurbs.Domain.T0, nurbs.Domain.T1, 600)
        points = np.array([(p.X, p.Y, p.Z) for p in (nurbs.PointAt(k) for k in t)])
        assert (points[:, 2] == 0.0).all()
        assert greatest_distance(points[:, :2], elastica) < tolerance
        assert pytest.approx(elastica.length, abs=0.0) == nurbs.Domain.T1
        ends = elastica.point_at([0.0, elastica.length])
        assert points[[0, -1], :2] == pytest.approx(ends, abs=1e-9)
        assert np.abs(points[:, :2] - elastica.point_at(t)).max() < 10.0 * tolerance, "the parameter is the arc length"


def test_what_rhino_cannot_take_is_refused_and_not_written(tmp_path):
    wild = DrawnCurve(1, Elastica((0, 0), 0.0, 1e6, (0, 0), 1.0), True)  # 160000 turns
    with pytest.raises(FormatError, match="stable: curve 1 is not valid for Rhino"):
        write_curves_3dm([wild], tmp_path / "wild.3dm", 1e-9)
    assert list(tmp_path.iterdir()) == []
