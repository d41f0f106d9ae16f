"""Reading .3dm: what comes out is what rhino3dm itself evaluates; what cannot be used gets one clear line."""

import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rhino3dm
from scipy.interpolate import make_interp_spline

from batten.errors import BattenError, FormatError, InvalidInputError
from batten.io.rhino import read_design_curves, read_surface
from batten.surfaces.loft import loft

WALL = Path(__file__).parents[2] / "examples" / "freeform-wall" / "freeform-surface.3dm"
MM = rhino3dm.UnitSystem.Millimeters
Writer = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Writer:
    """The function that writes geometry, each piece on its layer, to a file: write([("layer", geometry), …], unit)."""

    def write(pieces: list[tuple[str, object]], unit: object = MM) -> Path:
        model = rhino3dm.File3dm()
        model.Settings.ModelUnitSystem = unit
        indices: dict[str, int] = {}
        for name, geometry in pieces:
            if name not in indices:
                layer = rhino3dm.Layer()
                layer.Name = name
                indices[name] = model.Layers.Add(layer)
            attributes = rhino3dm.ObjectAttributes()
            attributes.LayerIndex = indices[name]
            model.Objects.Add(geometry, attributes)
        path = tmp_path / "design.3dm"
        assert model.Write(str(path), 7)
        return path

    return write


def point(*xyz: float) -> object:
    return rhino3dm.Point3d(*(float(c) for c in xyz))


def patch(rational: bool = False, spoil: float | None = None) -> rhino3dm.NurbsSurface:
    """A bicubic surface over a few knots; one control point may be spoiled."""
    surface = rhino3dm.NurbsSurface.Create(3, rational, 4, 3, 6, 4)
    rng = np.random.default_rng(2)
    for i in range(6):
        for j in range(4):
            w = float(rng.uniform(0.5, 2)) if rational else 1.0
            surface.Points[i, j] = rhino3dm.Point4d(i * w, j * w, float(rng.normal()) * w, w)
    for i, knot in enumerate([0, 0, 0, 0.5, 2, 3, 3, 3]):
        surface.KnotsU[i] = knot
    for i, knot in enumerate([-1, -1, 0, 1, 1]):
        surface.KnotsV[i] = knot
    assert surface.IsValid
    if spoil is not None:
        surface.Points[2, 1] = rhino3dm.Point4d(2.0, 1.0, spoil, 1.0)
    return surface


def polygon(*points: tuple[float, float, float], degree: int = 3) -> rhino3dm.NurbsCurve:
    return rhino3dm.NurbsCurve.Create(False, degree, [point(*p) for p in points])


def circle(radius: float = 1.0) -> rhino3dm.NurbsCurve:
    return rhino3dm.Circle(point(0, 0, 0), radius).ToNurbsCurve()


def assert_same(ours: object, theirs: object, scale: float) -> None:
    """The surface against rhino3dm's own evaluation."""
    rng = np.random.default_rng(0)
    (u0, u1), (v0, v1) = ours.domain  # type: ignore[attr-defined]
    u, v = rng.uniform(u0, u1, 50), rng.uniform(v0, v1, 50)
    wanted = np.array([(p.X, p.Y, p.Z) for p in (theirs.PointAt(a, b) for a, b in zip(u, v))])  # type: ignore[attr-defined]
    assert np.abs(ours.point(u, v) - scale * wanted).max() < 1e-12 * scale * np.abs(wanted).max()  # type: ignore[attr-defined]


def test_the_example_wall() -> None:
    surface = read_surface(WALL, 300.0)
    face = rhino3dm.File3dm.Read(str(WALL)).Objects[0].Geometry.Faces[0]
    assert_same(surface, face, 300.0)
    assert surface.control_points.shape == (6, 6, 3)
    assert (surface.degree_u, surface.degree_v, surface.is_rational) == (3, 3, False)
    assert surface.is_graph_over_plan()
    # The borders are straight and level; the relief at 300 mm a unit.
    t = np.linspace(0, 10, 41)
    borders = [surface.point(0, t), surface.point(10, t), surface.point(t, 0), surface.point(t, 10)]
    assert np.abs(np.array(borders)[..., 2]).max() < 1e-9
    assert surface.control_points[..., 2].min() == pytest.approx(-4.512 * 300, abs=0.2)
    assert surface.point(10, 10) == pytest.approx([3000, 3000, 0], abs=1e-9)


@pytest.mark.parametrize("rational", [False, True])
def test_nurbs_surfaces_come_exactly(write: Writer, rational: bool) -> None:
    surface = read_surface(write([("a", patch(rational))]), 2.5)
    assert surface.is_rational == rational
    assert_same(surface, patch(rational), 2.5)


def test_other_forms_of_surfaces(write: Writer) -> None:
    brep = rhino3dm.Brep.CreateFromSurface(patch())
    assert_same(read_surface(write([("a", brep)]), 1.0), patch(), 1.0)
    wave = polygon((0, 0, 0), (1, 2, 0), (2, -1, 0), (3, 1, 0), (4, 0, 0))
    extrusion = rhino3dm.Extrusion.Create(wave, 5.0, False)
    assert_same(read_surface(write([("a", extrusion)])), extrusion.ToNurbsSurface(), 1.0)


@pytest.mark.parametrize(
    ("unit", "mm"), [("Millimeters", 1.0), ("Centimeters", 10.0), ("Meters", 1000.0), ("Inches", 25.4), ("Feet", 304.8)]
)
def test_the_files_unit_counts_unless_a_scale_is_given(write: Writer, unit: str, mm: float) -> None:
    path = write([("a", patch())], getattr(rhino3dm.UnitSystem, unit))
    assert_same(read_surface(path), patch(), mm)
    assert_same(read_surface(path, 7.0), patch(), 7.0)


def test_a_layer_picks_one_surface_among_several(write: Writer) -> None:
    path = write([("walls", patch()), ("old", rhino3dm.Brep.CreateFromSurface(patch(True))), ("notes", circle())])
    assert_same(read_surface(path, 1.0, "Walls"), patch(), 1.0)
    assert_same(read_surface(path, 1.0, layer="old"), patch(True), 1.0)
    with pytest.raises(InvalidInputError, match=r"2 surfaces \(1 on layer 'old', 1 on layer 'walls'\)"):
        read_surface(path, 1.0)
    with pytest.raises(InvalidInputError, match="no layer 'new'; it has 'walls', 'old', 'notes'"):
        read_surface(path, 1.0, layer="new")
    with pytest.raises(InvalidInputError, match="no surface; layer 'notes' holds 1 NurbsCurve"):
        read_surface(path, 1.0, layer="notes")


def write_trimmed_face(path: Path, borders_too: bool = True) -> None:
    """A face over a bicubic surface that is trimmed in earnest, made from the example by changing its bytes.

    rhino3dm cannot trim a freeform surface. But a file keeps the surface under a face apart from the face's borders: put
    a larger surface, over −5 … 15, under the borders of the example's square, 0 … 10, along which it is 0 too.
    Without `borders_too` the borders still claim to be those of the whole surface: a file that contradicts itself.
    """
    data = bytearray(WALL.read_bytes())
    face = rhino3dm.File3dm.Read(str(WALL)).Objects[0].Geometry.Faces[0].ToNurbsSurface()
    old = np.array(face.KnotsU.ToList()).tobytes()
    knots = np.array([-5, -5, -5, -5, 5 / 3, 25 / 3, 15, 15, 15, 15])
    places = np.lib.stride_tricks.sliding_window_view(knots[1:-1], 3).mean(axis=1)
    heights = make_interp_spline(places, places * (places - 10) * (places - 3) / 40, k=3, t=knots).c
    net = np.stack([*np.meshgrid(places, places, indexing="ij"), np.outer(heights, heights)], axis=-1)
    new = knots[1:-1].tobytes()
    counts = struct.pack("<i", 8), struct.pack("<i", 36)
    replace_bytes(data, old + counts[0] + old + counts[1], new + counts[0] + new + counts[1] + net.tobytes())
    # South, east, north, west border of a surface; inside it, they are only "constant y" or "constant x".
    for i, (whole, inner) in enumerate(((4, 2), (5, 1), (6, 2), (3, 1)) if borders_too else ()):
        entry = (i, i, (i + 1) % 4, 0, 1)
        replace_bytes(data, struct.pack("<7i", *entry, whole, 0), struct.pack("<7i", *entry, inner, 0))
    path.write_bytes(data)


def replace_bytes(data: bytearray, old: bytes, new: bytes) -> None:
    """Writes `new` where `old` begins, and the checksums of the chunks around: type, length, content, CRC-32."""
    start = data.find(old)
    assert start > 0
    chunks: list[tuple[int, int]] = []
    for i in range(32, start):
        kind, size = struct.unpack_from("<Iq", data, i)
        end = i + 8 + size
        holds_it = kind & 0x8000 and start + len(new) <= end < len(data) - 4
        if holds_it and zlib.crc32(data[i + 12 : end]) == struct.unpack_from("<I", data, end)[0]:
            chunks.append((i + 12, end))
    assert chunks
    data[start : start + len(new)] = new
    for first, end in reversed(chunks):
        struct.pack_into("<I", data, end, zlib.crc32(data[first:end]))


def test_a_trimmed_face_is_refused(tmp_path: Path, write: Writer) -> None:
    path = tmp_path / "trimmed.3dm"
    write_trimmed_face(path)
    assert rhino3dm.File3dm.Read(str(path)).Objects[0].Geometry.IsValid
    with pytest.raises(InvalidInputError, match="layer 'Default' is trimmed"):
        read_surface(path, 300.0)
    disc = rhino3dm.Brep.CreateTrimmedPlane(rhino3dm.Plane.WorldXY(), circle())
    with pytest.raises(InvalidInputError, match="is trimmed"):
        read_surface(write([("a", disc)]))


def test_a_face_that_contradicts_itself_is_refused(tmp_path: Path) -> None:
    write_trimmed_face(tmp_path / "odd.3dm", borders_too=False)
    with pytest.raises(FormatError, match=r"is not valid .*m_iso"):
        read_surface(tmp_path / "odd.3dm", 300.0)


def tube() -> object:
    return rhino3dm.Brep.CreateFromCylinder(rhino3dm.Cylinder(rhino3dm.Circle(point(0, 0, 0), 1.0), 2.0), False, False)


def cone_patch() -> object:
    """A surface one side of which is a point."""
    surface = patch()
    for j in range(4):
        surface.Points[0, j] = rhino3dm.Point4d(0.0, 0.0, 0.0, 1.0)
    return surface


BAD: dict[str, tuple[object, type[BattenError], str]] = {
    "box": (
        rhino3dm.Brep.CreateFromBox(rhino3dm.Box(rhino3dm.BoundingBox(point(0, 0, 0), point(1, 2, 3)))),
        InvalidInputError,
        "polysurface of 6 faces",
    ),
    "extruded box": (
        rhino3dm.Extrusion.CreateBoxExtrusion(rhino3dm.Box(rhino3dm.BoundingBox(point(0, 0, 0), point(1, 2, 3))), True),
        InvalidInputError,
        "extruded solid",
    ),
    "tube": (tube(), InvalidInputError, "closed along u"),
    "sphere": (
        rhino3dm.Brep.CreateFromSphere(rhino3dm.Sphere(point(0, 0, 0), 1.0)),
        InvalidInputError,
        "closed along u",
    ),
    "pointed": (cone_patch(), InvalidInputError, "shrinks to a point"),
    "NaN": (patch(spoil=float("nan")), FormatError, r"1 control points that are not numbers \(NaN\)"),
    "infinity": (patch(spoil=float("inf")), FormatError, "not numbers"),
    "curve": (circle(), InvalidInputError, "no surface; the file holds 1 NurbsCurve"),
    "mesh": (rhino3dm.Mesh(), InvalidInputError, "no surface; the file holds 1 Mesh"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_cannot_be_cut_gets_one_clear_line(write: Writer, name: str) -> None:
    geometry, kind, message = BAD[name]
    path = write([("a", geometry)])
    with pytest.raises(kind, match=message) as caught:
        read_surface(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_empty_file(write: Writer) -> None:
    with pytest.raises(InvalidInputError, match="the file holds nothing"):
        read_surface(write([]))


@pytest.mark.parametrize("unit", ["None", "Unset"])
def test_without_a_unit_a_scale_is_needed(write: Writer, unit: str) -> None:
    path = write([("a", patch())], getattr(rhino3dm.UnitSystem, unit))
    with pytest.raises(InvalidInputError, match="set scale_mm_per_unit"):
        read_surface(path)
    assert_same(read_surface(path, 300.0), patch(), 300.0)


@pytest.mark.parametrize("scale", [0.0, -300.0, float("nan"), float("inf")])
def test_bad_scales(scale: float) -> None:
    with pytest.raises(InvalidInputError, match="scale_mm_per_unit"):
        read_surface(WALL, scale)


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="no such file"):
        read_surface(tmp_path / "missing.3dm")
    with pytest.raises(InvalidInputError, match="is a folder"):
        read_surface(tmp_path)
    for name, content in (("empty", b""), ("text", b"solid wall\n"), ("picture", b"\x89PNG\r\n\x1a\n" + bytes(100))):
        (tmp_path / f"{name}.3dm").write_bytes(content)
        with pytest.raises(FormatError, match="not a Rhino file"):
            read_surface(tmp_path / f"{name}.3dm")
    whole = WALL.read_bytes()
    for length in (60, 5000, len(whole) // 2):
        (tmp_path / "short.3dm").write_bytes(whole[:length])
        with pytest.raises(FormatError, match="cut short"):
            read_surface(tmp_path / "short.3dm", 300.0)


def arches(axis: str = "x") -> list[tuple[str, object]]:
    """Four design curves, out of order, one drawn backwards, one a joined curve, one of another degree."""

    def place(a: float, b: float, z: float) -> tuple[float, float, float]:
        return (a, b, z) if axis == "x" else (b, a, z)

    rows = [
        polygon(*(place(x, 4.0, np.sin(x)) for x in range(7))),
        polygon(*(place(x, 0.0, np.cos(x)) for x in range(6, -1, -1))),
        polygon(*(place(x, 1.5, 0.1 * x**2) for x in range(7)), degree=5),
    ]
    joined = rhino3dm.PolyCurve()
    joined.Append(polygon(place(0, 2.5, 0), place(1, 2.5, 2), place(2, 2.5, 1), place(3, 2.5, 1)))
    joined.Append(rhino3dm.LineCurve(point(*place(3, 2.5, 1)), point(*place(6, 2.5, 0))))
    return [("design", c) for c in (*rows, joined)]


@pytest.mark.parametrize("axis", ["x", "y"])
def test_design_curves_come_in_order_and_loft(write: Writer, axis: str) -> None:
    drawn = arches(axis)
    path = write([*drawn, ("notes", circle())], rhino3dm.UnitSystem.Centimeters)
    design = read_design_curves(path, layer="design")
    assert design.blade_axis == axis
    assert design.positions == pytest.approx([0, 15, 25, 40])
    surface = loft(design.curves, design.positions, blade_axis=design.blade_axis)
    t = np.linspace(0, 1, 33)
    for i, (source, backwards) in enumerate(((1, True), (2, False), (3, False), (0, False))):
        curve = drawn[source][1].ToNurbsCurve()  # type: ignore[attr-defined]
        knots = curve.Domain.T0 + (1 - t if backwards else t) * (curve.Domain.T1 - curve.Domain.T0)
        wanted = 10 * np.array([(p.X, p.Y, p.Z) for p in (curve.PointAt(k) for k in knots)])
        assert np.abs(surface.point(t, design.positions[i]) - wanted).max() < 1e-10
        assert (np.diff(design.curves[i].point([0, 1])[:, 0]) > 0).all()


def curves(*more: object) -> list[tuple[str, object]]:
    return [("design", polygon((0, 0, 0), (1, 0, 1), (2, 0, 0), (3, 0, 1))), *(("design", c) for c in more)]


@pytest.mark.parametrize(
    ("pieces", "kind", "message"),
    [
        (curves(), InvalidInputError, "1 design curve in the file"),
        ([("a", patch())], InvalidInputError, "0 design curves"),
        (curves(polygon((0, 0, 0), (1, 2, 1), (3, 4, 0), (4, 4, 4))), InvalidInputError, "planes of constant y"),
        (curves(polygon((0, 1, 0), (0, 2, 1), (0, 3, 0), (0, 4, 4))), InvalidInputError, "planes of constant y"),
        (
            curves(polygon((0, 0, 5), (1, 0, 6), (3, 0, 5), (4, 0, 5))),
            InvalidInputError,
            "two design curves lie in the plane at",
        ),
        (
            curves(polygon((0, 1, 0), (1, 1, float("nan")), (3, 1, 0), (4, 1, 0))),
            FormatError,
            r"curve 2 .* has .* \(NaN\)",
        ),
        (
            curves(rhino3dm.Arc(point(0, 1, 0), point(1, 1, 1), point(2, 1, 0)).ToNurbsCurve()),
            InvalidInputError,
            "curve 2 on layer 'design' is an arc",
        ),
        (
            curves(polygon((0, 1, 0), (1, 1, 1), (3, 1, 0), (0, 1, 0))),
            InvalidInputError,
            "curve 2 on layer 'design' is closed",
        ),
    ],
)
def test_design_curves_that_cannot_be_lofted(
    write: Writer, pieces: list[tuple[str, object]], kind: type[BattenError], message: str
) -> None:
    with pytest.raises(kind, match=message) as caught:
        read_design_curves(write(pieces))
    assert "\n" not in str(caught.value)
