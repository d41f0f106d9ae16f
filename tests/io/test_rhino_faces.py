"""Faces of solids, surfaces of revolution, extrusions with holes and meshes in .3dm files, against areas in closed form."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import rhino3dm

from batten.errors import FormatError, InvalidInputError
from batten.io.face_reading import read_faces
from batten.io.rhino_faces import _brep_face

WALL = Path(__file__).parents[2] / "examples" / "freeform-wall" / "freeform-surface.3dm"
R, H = 200.0, 500.0
TRIM = 0.01
MM = rhino3dm.UnitSystem.Millimeters


@pytest.fixture
def write(tmp_path):
    """Writes geometries, each on its layer and with its name, to a .3dm file."""

    def write(*pieces, unit=MM):
        model = rhino3dm.File3dm()
        model.Settings.ModelUnitSystem = unit
        for layer_name, name, geometry in pieces:
            layer = rhino3dm.Layer()
            layer.Name = layer_name
            attributes = rhino3dm.ObjectAttributes()
            attributes.LayerIndex = model.Layers.Add(layer)
            attributes.Name = name
            model.Objects.Add(geometry, attributes)
        path = tmp_path / "design.3dm"
        assert model.Write(str(path), 7)
        return path

    return write


def origin():
    return rhino3dm.Point3d(0, 0, 0)


def capped_cylinder():
    return rhino3dm.Brep.CreateFromCylinder(rhino3dm.Cylinder(rhino3dm.Circle(origin(), R), H), True, True)


def disc_area(radius):
    """Of a circle and of the polygon inscribed within the tolerance, halfway; and half their difference."""
    ring = 2 / 3 * 2 * np.pi * radius * TRIM
    return pytest.approx(np.pi * radius**2 - 0.5 * ring, abs=0.51 * ring)


def test_the_wall_is_one_untrimmed_face():
    (face,) = read_faces(WALL)
    assert not face.is_trimmed
    assert face.surface.control_points.shape == (6, 6, 3)
    assert read_faces(WALL, scale_mm_per_unit=300.0)[0].area() == pytest.approx(face.area() * 300.0**2)


def test_a_solid_cylinder(write):
    side, bottom, top = read_faces(write(("a", "drum", capped_cylinder())))
    assert [face.name for face in (side, bottom, top)] == ["drum 1", "drum 2", "drum 3"]
    assert not side.is_trimmed
    assert side.area() == pytest.approx(2 * np.pi * R * H, rel=1e-12)
    for cap in (bottom, top):
        assert cap.area() == disc_area(R)
        assert len(cap.trims) == 1
    (outline,) = top.outline()
    assert np.hypot(outline[:, 0], outline[:, 1]) == pytest.approx(np.full(len(outline), R), abs=TRIM)
    assert outline[:, 2] == pytest.approx(np.full(len(outline), H))


def test_a_sphere_and_a_cone(write):
    ball = rhino3dm.Brep.CreateFromSphere(rhino3dm.Sphere(origin(), R))
    line = rhino3dm.LineCurve(origin(), rhino3dm.Point3d(R, 0, H))
    axis = rhino3dm.Line(origin(), rhino3dm.Point3d(0, 0, 1))
    half = rhino3dm.Brep.CreateFromRevSurface(rhino3dm.RevSurface.Create(line, axis, 0.5, 0.5 + np.pi), False, False)
    whole, part = read_faces(write(("a", "ball", ball), ("b", "half", half)))
    assert whole.area() == pytest.approx(4 * np.pi * R**2, rel=1e-10)
    assert part.area() == pytest.approx(0.5 * np.pi * R * np.hypot(R, H), rel=1e-10)
    assert not whole.is_trimmed
    assert not part.is_trimmed


def test_an_extruded_pipe_has_holes_in_its_caps(write):
    cylinder = rhino3dm.Cylinder(rhino3dm.Circle(origin(), R), H)
    faces = read_faces(write(("a", "", rhino3dm.Extrusion.CreatePipeExtrusion(cylinder, 100.0, True, True))))
    outer, inner, *caps = faces
    assert outer.area() == pytest.approx(2 * np.pi * R * H, rel=1e-12)
    assert inner.area() == pytest.approx(2 * np.pi * 100.0 * H, rel=1e-12)
    assert len(caps) == 2
    for cap in caps:
        assert [len(trim) > 50 for trim in cap.trims] == [True, True]
        assert cap.area() == pytest.approx(np.pi * (R**2 - 100.0**2), abs=2 * np.pi * 300.0 * TRIM)
        u, v = cap.surface.closest_parameters([(150.0, 0, 0), (0, 50.0, 0), (0, 0, 0)])
        assert cap.contains(u, v).tolist() == [True, False, False]
    assert {face.name for face in faces} == {""}


def test_smaller_trims_come_closer(write):
    path = write(("a", "", capped_cylinder()))
    short = [np.pi * R**2 - read_faces(path, trim_mm=t)[1].area() for t in (1.0, 0.1, 0.001)]
    assert short[0] > short[1] > short[2] > 0.0
    for missing, trim in zip(short, (1.0, 0.1, 0.001)):
        assert missing <= 2 / 3 * 2 * np.pi * R * trim


def test_units_and_scale(write):
    path = write(("a", "", capped_cylinder()), unit=rhino3dm.UnitSystem.Centimeters)
    assert read_faces(path)[0].area() == pytest.approx(200 * np.pi * R * H)
    assert read_faces(path, scale_mm_per_unit=2.0)[0].area() == pytest.approx(8 * np.pi * R * H)
    nameless = write(("a", "", capped_cylinder()), unit=getattr(rhino3dm.UnitSystem, "None"))
    with pytest.raises(InvalidInputError, match="its size is unknown"):
        read_faces(nameless)


def test_layers(write):
    ball = rhino3dm.Brep.CreateFromSphere(rhino3dm.Sphere(origin(), R))
    path = write(("solids", "drum", capped_cylinder()), ("balls", "ball", ball))
    assert [face.name for face in read_faces(path, layer="Balls")] == ["ball"]
    assert len(read_faces(path)) == 4
    with pytest.raises(InvalidInputError, match="no layer 'walls'"):
        read_faces(path, layer="walls")


def test_a_mesh_becomes_a_smooth_face(write):
    mesh = rhino3dm.Mesh()
    x, y = np.meshgrid(np.linspace(0, 900, 31), np.linspace(0, 600, 21), indexing="ij")
    z = 100 * np.sin(x / 300) * np.cos(y / 400)
    for place in np.stack([x, y, z], axis=-1).reshape(-1, 3).tolist():
        mesh.Vertices.Add(*place)
    for i in range(30):
        for j in range(20):
            a = 21 * i + j
            if (i + j) % 2:
                mesh.Faces.AddFace(a, a + 21, a + 22, a + 1)
            else:
                mesh.Faces.AddFace(a, a + 21, a + 22)
                mesh.Faces.AddFace(a, a + 22, a + 1)
    path = write(("a", "dune", mesh))
    (face,) = read_faces(path, mesh_mm=0.1)
    assert face.name == "dune"
    u, v = face.surface.closest_parameters(np.stack([x, y, z], axis=-1))
    assert np.linalg.norm(face.surface.point(u, v) - np.stack([x, y, z], axis=-1), axis=-1).max() <= 0.1 + 1e-4
    with pytest.raises(InvalidInputError, match="object 1 on layer 'a': the mesh has vertices"):
        read_faces(path, mesh_mm=1e-9)


def test_the_edges_of_a_curved_face_in_their_directions():
    """A band of a cylinder with a window; rhino3dm cannot trim, so the face is put together from its surface and curves."""
    tube = rhino3dm.Cylinder(rhino3dm.Circle(origin(), R), H).ToNurbsSurface()

    def at(phi, z):
        return rhino3dm.Point3d(R * np.cos(phi), R * np.sin(phi), z)

    def arc(z, start, end):
        return rhino3dm.Arc(at(start, z), at(0.5 * (start + end), z), at(end, z)).ToNurbsCurve()

    def upright(phi, low, high):
        return rhino3dm.LineCurve(at(phi, low), at(phi, high))

    edges, loops = [], []
    for kind, (a, b, low, high) in (
        (rhino3dm.BrepLoopType.Outer, (0.4, 2.4, 50.0, 450.0)),
        (rhino3dm.BrepLoopType.Inner, (1.0, 1.5, 100.0, 300.0)),
    ):
        first = len(edges)
        edges += [arc(low, a, b), upright(b, low, high), arc(high, a, b), upright(a, low, high)]
        turns = [False, False, True, True]
        trims = [SimpleNamespace(EdgeIndex=first + i, IsReversed=turn) for i, turn in enumerate(turns)]
        loops.append(SimpleNamespace(LoopType=kind, Trims=trims))
    brep = SimpleNamespace(Faces=[SimpleNamespace(Loops=loops, ToNurbsSurface=lambda: tube)], Edges=edges)
    face = _brep_face(brep, 0, 2.0, "window", TRIM)
    assert face.area() == pytest.approx(4 * R * (2.0 * 400.0 - 0.5 * 200.0), rel=1e-9)
    loops[0].Trims[1].IsReversed = True
    with pytest.raises(InvalidInputError, match="no closed chain"):
        _brep_face(brep, 0, 1.0, "", TRIM)


def test_files_without_faces(write, tmp_path):
    line = rhino3dm.LineCurve(origin(), rhino3dm.Point3d(1, 0, 0))
    path = write(("a", "", line), ("b", "", line))
    with pytest.raises(InvalidInputError, match=r"no face; the file holds 2 LineCurve: surfaces, polysurfaces"):
        read_faces(path)
    with pytest.raises(InvalidInputError, match=r"no face; layer 'b' holds 1 LineCurve"):
        read_faces(path, layer="b")
    with pytest.raises(InvalidInputError, match="no such file"):
        read_faces(tmp_path / "none.3dm")
    (tmp_path / "text.3dm").write_text("hello")
    with pytest.raises(FormatError, match="not a Rhino file"):
        read_faces(tmp_path / "text.3dm")


def test_a_control_point_that_is_no_number(write):
    surface = rhino3dm.NurbsSurface.Create(3, False, 2, 2, 2, 2)
    for i in range(2):
        for j in range(2):
            surface.Points[i, j] = rhino3dm.Point4d(i, j, np.nan if i == j == 1 else 0.0, 1.0)
        surface.KnotsU[i] = surface.KnotsV[i] = i
    with pytest.raises(FormatError, match=r"object 1 on layer 'a' has 1 control points that are not numbers"):
        read_faces(write(("a", "", surface)))
