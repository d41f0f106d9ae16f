"""Which file goes to which reader, and what scales and layers do; the readers have tests of their own."""

import numpy as np
import pytest

from batten.errors import FormatError, InvalidInputError
from batten.io.face_reading import read_faces

SHEET = "v 0 0 1\nv 2 0 1\nv 2 1 1\nv 0 1 1\nf 1 2 3 4\nv 9 0 0\nv 11 0 0\nv 11 1 0\nf 5 6 7\n"


@pytest.fixture
def sheet(tmp_path):
    path = tmp_path / "Sheet.OBJ"
    path.write_text(SHEET)
    return path


def test_every_piece_of_a_mesh_is_a_face(sheet):
    rectangle, triangle = read_faces(sheet)
    assert [rectangle.name, triangle.name] == ["Sheet 1", "Sheet 2"]
    assert rectangle.area() == pytest.approx(2.0)
    assert triangle.area() == pytest.approx(1.0)
    assert triangle.is_trimmed
    low, high = rectangle.surface.bounding_box()
    assert [*low, *high] == pytest.approx([0, 0, 1, 2, 1, 1], abs=1e-9)


@pytest.mark.parametrize("scale", [25.4, 1000.0])
def test_meshes_are_scaled(sheet, scale):
    assert read_faces(sheet, scale_mm_per_unit=scale)[0].area() == pytest.approx(2.0 * scale**2)


def test_the_tolerance_of_meshes_is_in_mm(tmp_path):
    rng = np.random.default_rng(7)
    rows = [f"v {x} {y} {z}" for (x, y), z in zip(np.ndindex(9, 9), rng.normal(size=81).tolist())]
    rows += [f"f {9 * i + j + 1} {9 * i + j + 10} {9 * i + j + 11} {9 * i + j + 2}" for i in range(8) for j in range(8)]
    path = tmp_path / "rough.obj"
    path.write_text("\n".join(rows))
    (face,) = read_faces(path, scale_mm_per_unit=0.01, mesh_mm=0.1)
    assert len(face.surface.knots_u) == 8  # one span is near enough
    assert len(read_faces(path, scale_mm_per_unit=10.0, mesh_mm=6.0)[0].surface.knots_u) > 12


def test_what_is_refused(sheet, tmp_path):
    with pytest.raises(InvalidInputError, match=r"only \.3dm files have layers"):
        read_faces(sheet, layer="a")
    with pytest.raises(InvalidInputError, match=r"end in \.3dm, \.stp, \.step, \.igs, \.iges, \.obj, \.stl, \.ply"):
        read_faces(tmp_path / "a.dwg")
    for values in ({"trim_mm": 0.0}, {"mesh_mm": -1.0}, {"scale_mm_per_unit": 0.0}, {"scale_mm_per_unit": np.inf}):
        with pytest.raises(InvalidInputError, match=r"numbers above 0"):
            read_faces(sheet, **values)
    cube = tmp_path / "tetrahedron.obj"
    cube.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
    with pytest.raises(InvalidInputError, match=r"tetrahedron\.obj: the mesh is closed"):
        read_faces(cube)
    cube.write_text("v 0 0 0\nf 1 2\n")
    with pytest.raises(FormatError, match=r"tetrahedron\.obj, line 2"):
        read_faces(cube)
