"""Vertices and triangles of OBJ, STL and PLY files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from batten.errors import FormatError, InvalidInputError
from batten.io.scan_reading import PlyHeader, ply_header, ply_vertices, stl_triangles
from batten.typing import FloatArray, IntArray

MESH_ENDINGS = (".obj", ".stl", ".ply")


def read_mesh(path: str | Path) -> tuple[FloatArray, IntArray]:
    """Read the vertices and triangles of a mesh.

    OBJ: the lines v and f; what else a line f holds behind slashes (textures, normals) is left out, and so are groups. STL
    and PLY: text or binary. Polygons of more than three corners are cut into triangles from their first corner.

    Parameters:
        path: the file; its ending says which format, in capitals or not.

    Returns:
        Vertices (n, 3), in the file's unit, which none of the formats names, and triangles (m, 3), indices from 0.

    Raises:
        InvalidInputError: no such file, another ending.
        FormatError: not such a file, cut short, a line that is none, a triangle that names no vertex.
    """
    path = Path(path)
    readers = {".obj": _obj, ".stl": _stl, ".ply": _ply}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InvalidInputError(f"{path}: allowed are files that end in {', '.join(readers)}")
    if not path.is_file():
        raise InvalidInputError(f"{path}: no such file")
    vertices, triangles = reader(path, path.read_bytes())
    if not len(triangles):
        raise FormatError(f"{path}: holds no triangle; points alone are no surface")
    wrong = (triangles < 0) | (triangles >= len(vertices))
    if wrong.any():
        row = int(np.argmax(wrong.any(axis=1)))
        raise FormatError(
            f"{path}: triangle {row + 1} names vertex {int(triangles[row][wrong[row]][0]) + 1}; there are {len(vertices)}"
        )
    if not np.isfinite(vertices[np.unique(triangles)]).all():
        raise FormatError(f"{path}: a corner of a triangle is not finite")
    return vertices, triangles


def _obj(path: Path, data: bytes) -> tuple[FloatArray, IntArray]:
    vertices: list[tuple[float, float, float]] = []
    polygons: list[list[int]] = []
    for number, line in enumerate(data.replace(b"\\\n", b" ").splitlines(), 1):
        words = line.split()
        try:
            if words[:1] == [b"v"]:
                x, y, z = (float(word) for word in words[1:4])
                vertices.append((x, y, z))
            elif words[:1] == [b"f"]:
                corners = [int(word.split(b"/")[0]) for word in words[1:]]
                if len(corners) < 3 or 0 in corners:
                    raise ValueError
                polygons.append([c - 1 if c > 0 else len(vertices) + c for c in corners])
        except ValueError as error:
            shown = line[:60].decode("latin-1").strip()
            raise FormatError(
                f"{path}, line {number}: {shown!r}: allowed are 'v x y z' and 'f i j k …', corners counted from 1"
            ) from error
    return np.array(vertices, dtype=np.float64).reshape(-1, 3), _fans(polygons)


def _stl(path: Path, data: bytes) -> tuple[FloatArray, IntArray]:
    corners = stl_triangles(path, data)
    vertices, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return vertices, index.reshape(-1, 3).astype(np.int64)


def _ply(path: Path, data: bytes) -> tuple[FloatArray, IntArray]:
    header = ply_header(path, data)
    vertices, start = ply_vertices(path, data, header)
    names = [e[0] for e in header.elements]
    behind = header.elements[names.index("vertex") + 1 :]
    lists = [name for name, t in (behind[0][2] if behind else []) if "," in t]
    if not behind or behind[0][0] != "face" or not {"vertex_indices", "vertex_index"} & set(lists):
        raise FormatError(
            f"{path}: no element face with a list vertex_indices right behind the vertices; points alone are no surface"
        )
    read = _text_faces if header.order == "" else _binary_faces
    return vertices, _fans(read(path, data, header, behind[0], start))


def _text_faces(
    path: Path, data: bytes, header: PlyHeader, element: tuple[str, int, list[tuple[str, str]]], start: int
) -> list[list[int]]:
    """The corners of the faces, a line for each; `start` counts lines of data."""
    lines = data[header.end :].splitlines()[start : start + element[1]]
    if len(lines) < element[1]:
        raise FormatError(f"{path}: cut short: {element[1]} faces are promised, {len(lines)} lines are there")
    faces: list[list[int]] = []
    for number, line in enumerate(lines, header.lines + start + 1):
        words, place = line.split(), 0
        try:
            for name, kind in element[2]:
                if "," not in kind:
                    place += 1
                    continue
                count = int(words[place])
                if len(words) <= place + count or count < 0:
                    raise ValueError
                if name in ("vertex_indices", "vertex_index"):
                    faces.append([int(word) for word in words[place + 1 : place + 1 + count]])
                place += 1 + count
        except (ValueError, IndexError) as error:
            shown = line[:60].decode("latin-1").strip()
            raise FormatError(
                f"{path}, line {number}: {shown!r} is no face: its corners' number, then so many"
            ) from error
    return faces


def _binary_faces(
    path: Path, data: bytes, header: PlyHeader, element: tuple[str, int, list[tuple[str, str]]], start: int
) -> list[list[int]]:
    """The corners of the faces; `start` counts bytes."""
    faces: list[list[int]] = []
    place = start
    for _ in range(element[1]):
        for name, kind in element[2]:
            if "," not in kind:
                place += np.dtype(kind).itemsize
                continue
            count_type, member_type = (np.dtype(header.order + k) for k in kind.split(","))
            if place + count_type.itemsize > len(data):
                raise FormatError(f"{path}: cut short: {element[1]} faces are promised, {len(faces)} are there")
            count = int(np.frombuffer(data, count_type, 1, place)[0])
            place += count_type.itemsize
            if count < 0 or place + count * member_type.itemsize > len(data):
                raise FormatError(f"{path}: cut short: {element[1]} faces are promised, {len(faces)} are there")
            if name in ("vertex_indices", "vertex_index"):
                faces.append(np.frombuffer(data, member_type, count, place).tolist())
            place += count * member_type.itemsize
    return faces


def _fans(polygons: Sequence[Sequence[int]]) -> IntArray:
    """Triangles from the first corner of every polygon."""
    rows = [(p[0], p[i], p[i + 1]) for p in polygons for i in range(1, len(p) - 1)]
    return np.array(rows, dtype=np.int64).reshape(-1, 3)
