"""The same mesh in every format, and files that are damaged, each with its place named."""

import numpy as np
import pytest

from batten.errors import FormatError, InvalidInputError
from batten.io.mesh_reading import read_mesh

VERTICES = np.array([[0.0, 0, 0], [2, 0, 0.25], [2, 1, 0.5], [0, 1, -0.75], [3, 0.5, 1]])
TRIANGLES = [[0, 1, 2], [0, 2, 3], [1, 4, 2]]  # the first two are a quad in formats that have such

OBJ = b"""# made
mtllib none.mtl
v 0 0 0
v 2 0 0.25 1.0
v 2 1 .5
vn 0 0 1
g left
v 0 1 -7.5e-1
f 1/1/1 2//1 3/3 4
v 3 0.5 1
f -4 -1 \\
-3
"""

STL_FACET = np.dtype([("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")])


def text_stl(corners):
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n" + "".join(f"vertex {x} {y} {z}\n" for x, y, z in t) + "endloop\nendfacet\n"
        for t in corners.tolist()
    )
    return f"solid made\n{facets}endsolid made\n".encode()


def binary_stl(corners):
    table = np.zeros(len(corners), STL_FACET)
    table["c"] = corners
    return b"made".ljust(80) + np.uint32(len(corners)).tobytes() + table.tobytes()


HEAD = "ply\nformat {} 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
FACES = "element face 2\nproperty uchar flag\nproperty list uchar int vertex_indices\nproperty list uchar float soft\n"
TEXT_PLY = (
    (HEAD + FACES).format("ascii")
    + "end_header\n"
    + "".join(f"{x} {y} {z}\n" for x, y, z in VERTICES)
    + "7 4 0 1 2 3 0\n7 3 1 4 2 2 0.5 0.5\n"
).encode()


def binary_ply(order, name):
    head = (HEAD + FACES).format(name) + "end_header\n"
    faces = b""
    for corners, soft in (([0, 1, 2, 3], []), ([1, 4, 2], [0.5, 0.5])):
        faces += b"\x07" + bytes([len(corners)]) + np.array(corners, order + "i4").tobytes()
        faces += bytes([len(soft)]) + np.array(soft, order + "f4").tobytes()
    return head.encode() + VERTICES.astype(order + "f4").tobytes() + faces


FILES = {
    "a.obj": OBJ,
    "a.STL": text_stl(VERTICES[TRIANGLES]),
    "b.stl": binary_stl(VERTICES[TRIANGLES]),
    "a.ply": TEXT_PLY,
    "b.ply": binary_ply("<", "binary_little_endian"),
    "c.PLY": binary_ply(">", "binary_big_endian"),
}


@pytest.mark.parametrize("name", FILES)
def test_every_format_gives_the_same_triangles(tmp_path, name):
    (tmp_path / name).write_bytes(FILES[name])
    vertices, triangles = read_mesh(tmp_path / name)
    assert vertices.shape == (5, 3)
    assert vertices[triangles].tolist() == VERTICES[TRIANGLES].tolist()


def test_points_alone_are_no_mesh(tmp_path):
    (tmp_path / "a.ply").write_bytes(HEAD.format("ascii").encode() + b"end_header\n" + b"0 0 0\n" * 5)
    with pytest.raises(FormatError, match="no element face"):
        read_mesh(tmp_path / "a.ply")
    (tmp_path / "a.obj").write_bytes(b"v 0 0 0\n")
    with pytest.raises(FormatError, match="holds no triangle"):
        read_mesh(tmp_path / "a.obj")


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.obj", OBJ.replace(b"v 2 1 .5", b"v 2 1 x"), r"a.obj, line 5: 'v 2 1 x'"),
        ("a.obj", OBJ.replace(b"v 2 1 .5", b"v 2 1"), r"line 5"),
        ("a.obj", OBJ.replace(b"3/3 4", b"0"), r"line 9: .*counted from 1"),
        ("a.obj", OBJ.replace(b"3/3 4", b""), r"line 9"),
        ("a.obj", OBJ + b"f 1 2 9\n", r"triangle 4 names vertex 9; there are 5"),
        ("a.obj", OBJ + b"f 1 2 -9\n", r"triangle 4 names vertex"),
        ("a.obj", OBJ.replace(b"v 2 1 .5", b"v 2 1 nan"), "not finite"),
        ("a.ply", TEXT_PLY.replace(b"7 3 1 4 2 2", b"7 3 1 4"), r"a.ply, line 18: '7 3 1 4 0.5 0.5' is no face"),
        ("a.ply", TEXT_PLY.replace(b"7 4 0", b"7 q 0"), r"line 17"),
        ("a.ply", TEXT_PLY[:-20], "2 faces are promised, 1 lines are there|line 18"),
        ("b.ply", FILES["b.ply"][:-14], "2 faces are promised, 1 are there"),
        ("b.ply", FILES["b.ply"][:-30], "2 faces are promised, 0 are there|1 are there"),
        ("b.stl", FILES["b.stl"][:-1], "as binary STL with 3 triangles"),
    ],
)
def test_damaged_files(tmp_path, name, data, message):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(FormatError, match=message):
        read_mesh(tmp_path / name)


def test_which_files_are_taken(tmp_path):
    with pytest.raises(InvalidInputError, match=r"\.obj, \.stl, \.ply"):
        read_mesh(tmp_path / "a.off")
    with pytest.raises(InvalidInputError, match="no such file"):
        read_mesh(tmp_path / "a.obj")
