"""Rhino files: cubic curves and polycurves in and out, everything else as it was."""

from itertools import pairwise

import numpy as np
import pytest
import rhino3dm

from batten.errors import FormatError
from batten.io.project_files import project_paths
from batten.io.rhino_paths import RhinoPaths

P = rhino3dm.Point3d


def nurbs(points, degree=3):
    return rhino3dm.NurbsCurve.CreateControlPointCurve([P(*p) for p in points], degree)


@pytest.fixture
def model(tmp_path):
    """A file with a spline, a polycurve, a tilted one, an arc, a mesh, a space curve, layers and user texts."""
    model = rhino3dm.File3dm()
    layer = rhino3dm.Layer()
    layer.Name = "rods"
    model.Layers.Add(layer)
    joined = rhino3dm.PolyCurve()
    joined.Append(nurbs([(0, 0, 0), (0, 4, 0), (0.5, 4, 0), (1, 0, 0)]))
    joined.Append(rhino3dm.LineCurve(P(1, 0, 0), P(1.5, -4, 0)))
    joined.Append(nurbs([(1.5, -4, 0), (1.75, -6, 0), (3, -7, 0), (3, -2, 0)]))
    tilted = nurbs([(0, 0, 0), (0, 2, 2), (0.3, 2, 2), (1, 0, 0)])
    spline = nurbs([(0, 0, 5), (1, 3, 5), (3, -3, 5), (4, 0, 5), (4.5, 2, 5), (4, 4, 5)])
    space = nurbs([(0, 0, 0), (1, 1, 1), (2, 0, 3), (3, 1, 0), (4, 4, 4)])
    shapes = [joined, tilted, spline, space, nurbs([(0, 0, 0), (1, 1, 0), (2, 0, 0)], 2)]
    arc = rhino3dm.Arc(P(0, 0, 0), P(1, 1, 0), P(2, 0, 0))
    shapes += [rhino3dm.ArcCurve.CreateFromArc(arc), rhino3dm.Point(P(9, 9, 9))]
    for i, shape in enumerate(shapes):
        attributes = rhino3dm.ObjectAttributes()
        attributes.Name, attributes.LayerIndex = f"shape {i}", 0
        attributes.SetUserString("number", str(i))
        model.Objects.Add(shape, attributes)
    path = tmp_path / "in.3dm"
    assert model.Write(str(path), 7)
    return path


def test_what_is_taken(model):
    drawing = RhinoPaths(model)
    assert [p.name for p in drawing.paths] == ["shape 0", "shape 1", "shape 2"]
    assert [len(p.control_points) for p in drawing.paths] == [3, 1, 3]
    assert drawing.paths[0].fixed.tolist() == [False, True, False]
    assert drawing.notes == (
        "1 × ArcCurve left as it is",
        "1 × curve of degree 2 left as it is",
        "1 × curve that is not planar left as it is",
    )
    tilted = drawing.paths[1].control_points[0]
    edges = np.linalg.norm(np.diff(tilted, axis=0), axis=1)
    np.testing.assert_allclose(edges, [8**0.5, 0.3, np.sqrt(0.49 + 8)], atol=1e-12)


def test_projected_curves_are_valid_and_the_rest_is_what_it_was(model, tmp_path):
    drawing = RhinoPaths(model)
    results = project_paths(drawing.paths, threshold=0.1, keep="points")
    assert all(r.projection.reached.all() for r in results)
    changed = [r.projection.control_points for r in results]
    drawing.write(changed, tmp_path / "out.3dm")
    old, new = (rhino3dm.File3dm.Read(str(tmp_path / name)) for name in ("in.3dm", "out.3dm"))
    assert len(old.Objects) == len(new.Objects)
    assert [layer.Name for layer in new.Layers] == [layer.Name for layer in old.Layers]
    for i in range(len(old.Objects)):
        a, b = old.Objects[i], new.Objects[i]
        assert a.Attributes.Id == b.Attributes.Id
        assert (b.Attributes.Name, b.Attributes.LayerIndex) == (f"shape {i}", 0)
        assert b.Attributes.GetUserString("number") == str(i)
        assert type(a.Geometry) is type(b.Geometry)
        assert b.Geometry.IsValid
        if i > 2:
            assert a.Geometry.Encode() == b.Geometry.Encode()
    joined = new.Objects[0].Geometry
    assert not joined.HasGap
    assert joined.SegmentCurve(1).IsLinear()
    for path, wanted in zip(RhinoPaths(tmp_path / "out.3dm").paths, changed, strict=True):
        got = path.control_points
        if path.name == "shape 1":  # its plane's axes are found anew: compare lengths
            got, wanted = (np.linalg.norm(c[:, 1:] - c[:, :1], axis=-1) for c in (got, wanted))
        np.testing.assert_allclose(got, wanted, atol=1e-12)
    for i in (1, 2):  # still in its plane, ends where they were
        a, b = old.Objects[i].Geometry, new.Objects[i].Geometry
        assert b.PointAtStart.DistanceTo(a.PointAtStart) < 1e-12
        assert b.PointAtEnd.DistanceTo(a.PointAtEnd) < 1e-12
        assert b.IsPlanar(1e-9)
        assert (b.Domain.T0, b.Domain.T1) == (a.Domain.T0, a.Domain.T1)
    spline = new.Objects[2].Geometry
    for t in (1.0, 2.0):  # knots where Béziers meet: one tangent
        before, after = spline.TangentAt(t - 1e-9), spline.TangentAt(t + 1e-9)
        np.testing.assert_allclose((before.X, before.Y), (after.X, after.Y), atol=1e-6)


def test_unchanged_curves_keep_their_knots(model, tmp_path):
    drawing = RhinoPaths(model)
    drawing.write([p.control_points for p in drawing.paths], model)
    again = rhino3dm.File3dm.Read(str(model))
    assert len(again.Objects[2].Geometry.Points) == 6
    assert [p.name for p in tmp_path.iterdir()] == ["in.3dm"]


def test_a_periodic_curve(tmp_path):
    ring = rhino3dm.NurbsCurve.Create(True, 3, [P(0, 0, 0), P(4, -1, 0), P(5, 3, 0), P(1, 5, 0), P(-2, 2, 0)])
    model = rhino3dm.File3dm()
    model.Objects.AddCurve(ring)
    assert model.Write(str(tmp_path / "ring.3dm"), 7)
    drawing = RhinoPaths(tmp_path / "ring.3dm")
    (path,) = drawing.paths
    assert path.closed
    t = np.linspace(0, 1, 5)[:, None]
    basis = np.concatenate([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3], axis=1)
    knots = np.unique(np.round(ring.Knots.ToList(), 12))
    knots = knots[(knots >= ring.Domain.T0) & (knots <= ring.Domain.T1)]
    for (a, b), cubic in zip(pairwise(knots.tolist()), path.control_points, strict=True):
        wanted = [ring.PointAt(a + (b - a) * s) for s in t[:, 0].tolist()]
        np.testing.assert_allclose(basis @ cubic, [(p.X, p.Y) for p in wanted], atol=1e-12)
    (result,) = project_paths(drawing.paths, threshold=0.05, keep="points")
    assert result.projection.smooth.all()
    drawing.write([result.projection.control_points], tmp_path / "ring.3dm")
    again = rhino3dm.File3dm.Read(str(tmp_path / "ring.3dm")).Objects[0].Geometry
    assert again.IsValid
    assert again.IsClosed


def test_bad_files(tmp_path):
    (tmp_path / "bad.3dm").write_bytes(b"3D Geometry File Format")
    with pytest.raises(FormatError, match=r"bad\.3dm: is not a Rhino file or is damaged"):
        RhinoPaths(tmp_path / "bad.3dm")
