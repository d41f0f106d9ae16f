"""A mesh read back by the format's own rules, and by the reader of scans."""

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.io.ply import write_ply_mesh
from batten.io.scan_reading import read_scan

POINTS = np.array([[0.0, 0.0, 0.5], [1500.25, 0.0, 1.0], [0.0, 3.5, -2.0], [7.0, 8.0, 9.0]])
TRIANGLES = np.array([[0, 1, 2], [2, 1, 3]])
COLOURS = np.array([[255, 0, 0], [0, 255, 7], [1, 2, 3], [9, 9, 9]])
QUALITY = np.array([0.5, -0.25, 0.0, 8.0])


def test_the_bytes_follow_the_format(tmp_path):
    path = tmp_path / "mesh.ply"
    write_ply_mesh(path, POINTS, TRIANGLES, COLOURS, QUALITY, comment="a\nb ü")
    head, body = path.read_bytes().split(b"end_header\n", 1)
    lines = head.decode("ascii").splitlines()
    assert lines[:3] == ["ply", "format binary_little_endian 1.0", "comment a b ?"]
    assert "element vertex 4" in lines
    assert lines[-2:] == ["element face 2", "property list uchar int vertex_indices"]
    row = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("c", "u1", 3), ("q", "<f4")])
    vertices = np.frombuffer(body, row, 4)
    assert np.stack([vertices[k] for k in "xyz"], axis=1).tolist() == POINTS.tolist()
    assert vertices["c"].tolist() == COLOURS.tolist()
    assert vertices["q"].tolist() == QUALITY.tolist()
    faces = np.frombuffer(body, np.dtype([("n", "u1"), ("v", "<i4", 3)]), 2, offset=4 * row.itemsize)
    assert (faces["n"] == 3).all()
    assert faces["v"].tolist() == TRIANGLES.tolist()
    assert len(body) == 4 * row.itemsize + 2 * 13
    assert read_scan(path).tolist() == POINTS.tolist()


def test_arrays_must_match(tmp_path):
    with pytest.raises(InvalidInputError, match=r"triangles name points 0 to 4; there are 4"):
        write_ply_mesh(tmp_path / "a.ply", POINTS, [[0, 1, 4]], COLOURS, QUALITY)
    with pytest.raises(InvalidInputError, match=r"quality \(3,\)"):
        write_ply_mesh(tmp_path / "a.ply", POINTS, TRIANGLES, COLOURS, QUALITY[:3])
    assert list(tmp_path.iterdir()) == []
