"""The same points in every format, and files that are damaged, each with its place named."""

import numpy as np
import pytest

from batten.errors import FormatError, InvalidInputError
from batten.io.scan_reading import read_scan

POINTS = np.array([[0.5, 1.25, -3.0], [100.0, 0.0, 2.5], [7.0, -8.0, 9.0]])


def _ply(kind, body, count=3, extra=""):
    head = f"ply\nformat {kind} 1.0\ncomment made\n{extra}element vertex {count}\nproperty uchar red\n"
    return f"{head}property float x\nproperty double y\nproperty float z\nend_header\n".encode() + body


def _binary_ply(order):
    record = np.dtype([("red", "u1"), ("x", order + "f4"), ("y", order + "f8"), ("z", order + "f4")])
    table = np.zeros(3, record)
    table["red"] = 255
    for i, axis in enumerate("xyz"):
        table[axis] = POINTS[:, i]
    return table.tobytes()


def _binary_stl(triangles):
    facet = np.zeros(len(triangles), np.dtype([("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")]))
    facet["c"] = triangles
    return b"solid says nothing".ljust(80) + np.uint32(len(triangles)).tobytes() + facet.tobytes()


TEXT_STL = b"""solid made
 facet normal 0 0 1
  outer loop
   vertex 0.5 1.25 -3
   vertex 1e2 0 2.5
   vertex 7 -8 9
  endloop
 endfacet
endsolid made
"""
ROWS = b"1 0.5 1.25 -3\n2 100 0 2.5\n3 7 -8 9\n"
FILES = {
    "text.ply": _ply("ascii", ROWS + b"3 0 1 2\n", extra=""),
    "ahead.ply": _ply("ascii", b"7\n8\n" + ROWS, extra="element camera 2\nproperty float width\n"),
    "little.ply": _ply("binary_little_endian", _binary_ply("<")),
    "big.PLY": _ply("binary_big_endian", _binary_ply(">") + b"faces that nobody reads"),
    "skip.ply": _ply(
        "binary_little_endian", b"12345678" + _binary_ply("<"), extra="element camera 2\nproperty int a\n"
    ),
    "binary.stl": _binary_stl(np.array([POINTS, POINTS[::-1]])),
    "text.stl": TEXT_STL,
    "plain.xyz": b"# a scan\n0.5 1.25 -3 255\n\n100\t0 2.5 1\n7 -8 9 2\n",
    "named.xyz": b"x;y;z\r\n0.5;1.25;-3\r\n100;0;2.5\r\n7;-8;9\r\n",
    "commas.xyz": b"0.5, 1.25, -3\n100, 0, 2.5\n7, -8, 9",
}


@pytest.mark.parametrize("name", FILES)
def test_every_format_gives_the_same_points(name, tmp_path):
    (tmp_path / name).write_bytes(FILES[name])
    got = read_scan(tmp_path / name)
    wanted = POINTS[np.lexsort(POINTS.T[::-1])] if name.endswith("stl") else POINTS
    np.testing.assert_array_equal(got, wanted)
    assert got.dtype == np.float64


@pytest.mark.parametrize(("units", "factor"), [("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("inch", 25.4)])
def test_units(units, factor, tmp_path):
    (tmp_path / "a.xyz").write_bytes(FILES["plain.xyz"])
    np.testing.assert_allclose(read_scan(tmp_path / "a.xyz", units=units), factor * POINTS, rtol=1e-15)


def test_rays_that_met_nothing_stay_as_nan(tmp_path):
    (tmp_path / "a.xyz").write_bytes(b"1 2 3\nnan nan nan\n")
    assert np.isnan(read_scan(tmp_path / "a.xyz")).all(axis=1).tolist() == [False, True]


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.ply", b"hello", "line 1"),
        (
            "a.ply",
            _ply("ascii", ROWS).replace(b"property double y", b"property complex y"),
            "line 7: 'property complex y'",
        ),
        ("a.ply", _ply("ascii", ROWS).replace(b"double y", b"double w"), "properties x, y, z"),
        ("a.ply", _ply("ascii", ROWS.replace(b"100", b"1O0")), "line 11: '2 1O0 0 2.5'"),
        ("a.ply", _ply("ascii", ROWS, count=4), "4 points are promised, 3 lines are there"),
        ("a.ply", _ply("binary_little_endian", _binary_ply("<")[:-1]), "cut short: 3 points of 17 bytes.*50 bytes"),
        ("a.stl", _binary_stl(np.array([POINTS]))[4:], "as binary STL"),
        ("a.stl", TEXT_STL[:-16], "line 8: the file ends without 'endsolid'"),
        ("a.stl", TEXT_STL.replace(b"7 -8 9", b"7 -8"), "line 6: 'vertex 7 -8'"),
        ("a.stl", TEXT_STL.replace(b"   vertex 7 -8 9\n", b""), "2 lines 'vertex'"),
        ("a.xyz", b"# c\n1 2 3\n4 5 six\n", "line 3: '4 5 six': columns 1, 2, 3"),
        ("a.xyz", b"1 2 3\n4 5\n", "line 2: '4 5'"),
        ("a.xyz", b"# nothing\n", "holds no point"),
    ],
)
def test_damage_is_named_with_its_place(name, data, message, tmp_path):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(FormatError, match=message) as caught:
        read_scan(tmp_path / name)
    assert str(tmp_path / name) in str(caught.value)


def test_other_files_and_units_are_refused(tmp_path):
    with pytest.raises(InvalidInputError, match=r"\.ply, \.stl, \.xyz"):
        read_scan(tmp_path / "a.e57")
    with pytest.raises(InvalidInputError, match="no such file"):
        read_scan(tmp_path / "a.ply")
    with pytest.raises(InvalidInputError, match="mm, cm, m, inch"):
        read_scan(tmp_path / "a.ply", units="feet")
