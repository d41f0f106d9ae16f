"""STEP and IGES files that Open CASCADE writes, against areas in closed form and points of the solids."""

import subprocess
import sys

import numpy as np
import pytest
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeWire
from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.Geom import Geom_CylindricalSurface, Geom_RectangularTrimmedSurface
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp_Ax2, gp_Ax3, gp_Cylinder, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.IGESControl import IGESControl_Writer
from OCP.Interface import Interface_Static
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS

from batten.errors import FormatError, InvalidInputError
from batten.io.face_reading import read_faces
from batten.io.step_reading import _shrunk

R, H, A = 200.0, 500.0, 80.0
TRIM = 0.01


@pytest.fixture(params=[".step", ".igs"])
def write(request, tmp_path):
    """Writes a shape of Open CASCADE's as STEP or IGES, in a unit."""

    def write(shape, unit="MM"):
        path = tmp_path / f"shape{request.param}"
        if request.param == ".step":
            writer = STEPControl_Writer()
            Interface_Static.SetCVal_s("write.step.unit", unit)
            writer.Transfer(shape, STEPControl_AsIs)
        else:
            Interface_Static.SetCVal_s("write.iges.unit", unit)
            writer = IGESControl_Writer()
            writer.AddShape(shape)
            writer.ComputeModel()
        writer.Write(str(path))
        Interface_Static.SetCVal_s("write.step.unit", "MM")
        Interface_Static.SetCVal_s("write.iges.unit", "MM")
        return path

    return write


def bored_cylinder():
    """An upright cylinder with half a hole across it, from its axis out towards +x."""
    hole = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(0, 0, 250), gp_Dir(1, 0, 0)), A, 600.0).Shape()
    return BRepAlgoAPI_Cut(BRepPrimAPI_MakeCylinder(R, H).Shape(), hole).Shape()


def hole_area():
    """∫ 2 √(a² − y²) R dφ with y = R sin φ = a sin ψ."""
    psi, weight = np.polynomial.legendre.leggauss(60)
    psi, weight = 0.5 * np.pi * psi, 0.5 * np.pi * weight
    return float((weight * 2 * (A * np.cos(psi)) ** 2 * R / np.sqrt(R**2 - (A * np.sin(psi)) ** 2)).sum())


def bore_area():
    """The hole's own wall: ∫ a √(R² − a² sin² ψ) dψ all round."""
    psi = 2 * np.pi * np.arange(400) / 400
    return float((A * np.sqrt(R**2 - (A * np.sin(psi)) ** 2)).mean() * 2 * np.pi)


def test_a_trimmed_cylinder(write):
    faces = read_faces(write(bored_cylinder()))
    assert [face.name for face in faces] == [f"face {i}" for i in range(1, 6)]
    by_area = sorted(faces, key=lambda face: -face.area())
    ring = 2 * np.pi * A * TRIM
    assert by_area[0].area() == pytest.approx(2 * np.pi * R * H - hole_area(), abs=2 * ring)
    assert [by_area[i].area() for i in (1, 2)] == pytest.approx([np.pi * R**2] * 2, abs=2 * np.pi * R * TRIM)
    assert by_area[3].area() == pytest.approx(bore_area(), abs=2 * ring)
    assert by_area[4].area() == pytest.approx(np.pi * A**2, abs=ring)
    side = by_area[0]
    u, v = side.surface.closest_parameters([(R, 0, 250), (R, 0, 100), (-R, 0, 250), (0, R, 250), (0, -R, 499)])
    assert side.contains(u, v).tolist() == [False, True, True, True, True]
    # The outlines lie on the cylinder, and on its ends, its seam or the hole.
    for outline in side.outline(TRIM):
        assert np.hypot(outline[:, 0], outline[:, 1]) == pytest.approx(np.full(len(outline), R), abs=1e-5)


def test_a_box_with_round_edges(write):
    r = 20.0
    box = BRepPrimAPI_MakeBox(300.0, 200.0, 100.0).Shape()
    fillet = BRepFilletAPI_MakeFillet(box)
    explorer = TopExp_Explorer(box, TopAbs_EDGE)
    while explorer.More():
        fillet.Add(r, TopoDS.Edge(explorer.Current()))
        explorer.Next()
    areas = np.sort([face.area() for face in read_faces(write(fillet.Shape()))])
    inner = np.array([300.0, 200.0, 100.0]) - 2 * r
    flats = [inner[0] * inner[1], inner[1] * inner[2], inner[2] * inner[0]]
    wanted = np.sort(np.concatenate([[np.pi * r**2 / 2] * 8, np.repeat(np.pi / 2 * r * inner, 4), np.repeat(flats, 2)]))
    assert areas == pytest.approx(wanted, rel=2e-5)


@pytest.mark.parametrize(
    ("shape", "areas"),
    [
        (lambda: BRepPrimAPI_MakeSphere(R).Shape(), [4 * np.pi * R**2]),
        (lambda: BRepPrimAPI_MakeTorus(R, 50.0).Shape(), [4 * np.pi**2 * R * 50.0]),
        (lambda: BRepPrimAPI_MakeCone(R, 0.0, H).Shape(), [np.pi * R * np.hypot(R, H), np.pi * R**2]),
        (lambda: BRepPrimAPI_MakeSphere(R, -0.5, 1.0).Shape(),
         [2 * np.pi * R**2 * (np.sin(1.0) + np.sin(0.5)), np.pi * (R * np.cos(1.0)) ** 2, np.pi * (R * np.cos(0.5)) ** 2]),
        (lambda: BRepPrimAPI_MakeCylinder(R, H, 2.0).Shape(), [2.0 * R * H, R * H, R * H, R**2, R**2]),
    ],
    ids=["sphere", "torus", "cone", "zone", "wedge"],
)  # fmt: skip
def test_solids_that_close_on_themselves(write, shape, areas):
    found = [face.area() for face in read_faces(write(shape()))]
    assert np.sort(found) == pytest.approx(np.sort(areas), rel=1.1e-4)
    whole = [face for face in read_faces(write(shape())) if not face.is_trimmed]
    assert whole[0].area() == pytest.approx(areas[0], rel=1e-8)


def test_a_face_across_the_seam(write):
    """A part of a cylinder whose parameters run across 0, from −1 to +1 rad, and one turn later from 5 to 8."""
    for start, end in ((-1.0, 1.0), (5.0, 8.0)):
        band = BRepBuilderAPI_MakeFace(gp_Cylinder(gp_Ax3(), R), start, end, 100.0, 400.0).Face()
        (face,) = read_faces(write(band))
        assert face.area() == pytest.approx((end - start) * R * 300.0, rel=1e-8)
        middle = 0.5 * (start + end)
        places = [
            (R * np.cos(p), R * np.sin(p), z) for p, z in ((middle, 250.0), (middle, 410.0), (middle + 2.0, 250.0))
        ]
        u, v = face.surface.closest_parameters(places)
        distance = np.linalg.norm(face.surface.point(u, v) - places, axis=-1)
        assert distance[0] < 1e-6
        assert distance[1] == pytest.approx(10.0)
        assert distance[2] > 50.0


@pytest.mark.parametrize("low", [-1.0, 0.0, 2.0, 5.0, 6.0, 7.0])
def test_a_part_of_a_periodic_surface_keeps_its_parameters(low):
    """Open CASCADE gives a part that begins outside the first period a period away; files with such parts are rare."""
    tube = Geom_RectangularTrimmedSurface(Geom_CylindricalSurface(gp_Ax3(), R), 0.0, H, False)
    whole, part = (GeomConvert.SurfaceToBSplineSurface_s(tube) for _ in range(2))
    surface = _shrunk(part, np.array([low, 100.0]), np.array([low + 3.0, 400.0]))
    assert surface.domain[0] == pytest.approx((low, low + 3.0))
    assert surface.domain[1] == pytest.approx((100.0, 400.0))
    for u in (low, low + 1.3, low + 3.0):
        wanted = whole.Value(u, 250.0)
        assert surface.point(u, 250.0) == pytest.approx([wanted.X(), wanted.Y(), wanted.Z()], abs=1e-9)


def test_moved_parts_are_where_they_belong(write):
    move = gp_Trsf()
    move.SetTranslation(gp_Vec(1000.0, -2000.0, 300.0))
    ball = BRepPrimAPI_MakeSphere(R).Shape().Moved(TopLoc_Location(move))
    (face,) = read_faces(write(ball))
    low, high = face.surface.bounding_box()
    assert 0.5 * (low + high) == pytest.approx([1000.0, -2000.0, 300.0], abs=1.0)


@pytest.mark.parametrize(("unit", "mm"), [("INCH", 25.4), ("M", 1000.0)])
def test_units_become_mm(write, unit, mm):
    """Open CASCADE writes the same length in another unit, so the file's numbers differ and the size does not."""
    path = write(BRepPrimAPI_MakeSphere(R).Shape(), unit)
    (face,) = read_faces(path)
    assert face.area() == pytest.approx(4 * np.pi * R**2, rel=1e-6)
    low, high = face.surface.bounding_box()
    assert (high - low)[2] == pytest.approx(2 * R, rel=1e-3)
    numbers = path.read_text("latin-1")
    assert f"{R / mm:.4g}" in numbers or f"{R / mm:.6g}" in numbers


def test_a_free_face_with_a_hole(write):
    """A plane face with a round hole, as a surface without a solid."""
    from OCP.gp import gp_Circ, gp_Pln

    face = BRepBuilderAPI_MakeFace(gp_Pln(), 0.0, 400.0, 0.0, 300.0)
    circle = BRepBuilderAPI_MakeEdge(gp_Circ(gp_Ax2(gp_Pnt(200, 150, 0), gp_Dir(0, 0, -1)), 100.0)).Edge()
    face.Add(BRepBuilderAPI_MakeWire(circle).Wire())
    (found,) = read_faces(write(face.Face()))
    assert len(found.trims) == 2
    assert found.area() == pytest.approx(400.0 * 300.0 - np.pi * 1e4, abs=2 * np.pi * 100.0 * TRIM)
    (closer,) = read_faces(write(face.Face()), trim_mm=1e-4)
    assert closer.area() == pytest.approx(400.0 * 300.0 - np.pi * 1e4, abs=2 * np.pi * 100.0 * 1e-4)


def test_what_is_refused(write, tmp_path):
    path = write(BRepBuilderAPI_MakeEdge(gp_Pnt(0, 0, 0), gp_Pnt(1, 0, 0)).Edge())
    with pytest.raises(InvalidInputError, match="no face"):
        read_faces(path)
    with pytest.raises(InvalidInputError, match="name their unit"):
        read_faces(path, scale_mm_per_unit=1.0)
    with pytest.raises(InvalidInputError, match=r"only \.3dm files have layers"):
        read_faces(path, layer="a")
    bad = tmp_path / f"bad{path.suffix}"
    bad.write_text("hello\n")
    with pytest.raises(FormatError, match=r"is not a (STEP|IGES) file"):
        read_faces(bad)
    with pytest.raises(InvalidInputError, match="no such file"):
        read_faces(tmp_path / f"none{path.suffix}")


def test_without_open_cascade_the_message_says_what_to_install(tmp_path):
    (tmp_path / "a.step").write_text("ISO-10303-21;")
    code = (
        "import sys; sys.modules['OCP'] = None\n"
        "from batten.errors import InvalidInputError\nfrom batten.io.face_reading import read_faces\n"
        f"try: read_faces({str(tmp_path / 'a.step')!r})\n"
        "except InvalidInputError as error: print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert 'pip install "batten[cad]"' in done.stdout
