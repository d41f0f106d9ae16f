"""Points of a scan from PLY, STL (both as text or binary) and XYZ files."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from batten.errors import FormatError, InvalidInputError
from batten.typing import FloatArray

UNITS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}
"""Length of a scan's unit in mm; none of the formats names its own."""

_PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_PLY_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_STL_HEAD, _STL_FACET = 84, 50


def read_scan(path: str | Path, *, units: str = "mm") -> FloatArray:
    """Read the points of a scan.

    PLY: the element `vertex`, text or binary; faces are left out. STL: the corners of the triangles, text or binary, those
    that triangles share once. XYZ: a line for each point, its first three columns x, y, z, between blanks, tabs, commas or
    semicolons; lines that begin with # and one line of column names at the top are left out.

    Parameters:
        path: the file; its ending says which format, in capitals or not.
        units: the file's unit: mm, cm, m or inch.

    Returns:
        Points, shape (n, 3), mm. PLY and XYZ files may hold NaN, as scanners write for rays that met nothing.

    Raises:
        InvalidInputError: no such file, another ending, another unit.
        FormatError: not such a file, cut short, or a line that is none; the message names file and line.

    Accuracy: the numbers of the file, times the unit.
    """
    path = Path(path)
    if units not in UNITS_MM:
        raise InvalidInputError(f"units = {units!r}; allowed are {', '.join(UNITS_MM)}")
    readers = {".ply": _ply, ".stl": _stl, ".xyz": _xyz}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InvalidInputError(
            f"{path}: allowed are files that end in {', '.join(readers)}; save the scan as one of them"
        )
    if not path.is_file():
        raise InvalidInputError(f"{path}: no such file")
    points = reader(path, path.read_bytes())
    if not len(points):
        raise FormatError(f"{path}: holds no point")
    return points * UNITS_MM[units]


class PlyHeader(NamedTuple):
    """What the header of a PLY file says.

    Attributes:
        order: "" for text, else numpy's sign of the byte order.
        elements: name, count, and (property, numpy type) of each element; a list has the types of its count and its
            members, with a comma between.
        lines: of the header.
        end: where the data begins, in bytes.
    """

    order: str
    elements: list[tuple[str, int, list[tuple[str, str]]]]
    lines: int
    end: int


def ply_header(path: Path, data: bytes) -> PlyHeader:
    """Read the header of a PLY file.

    Raises:
        FormatError: none, or one with a line that belongs to no header of version 1.0; the message names the line.
    """
    end = re.search(rb"^end_header\r?\n", data, re.MULTILINE)
    if data[:3] != b"ply" or end is None:
        raise FormatError(
            f"{path}, line 1: a PLY file begins with 'ply' and has a line 'end_header'; is it another format?"
        )
    lines = data[: end.start()].decode("latin-1").splitlines()
    kind = ""
    elements: list[tuple[str, int, list[tuple[str, str]]]] = []
    for number, line in enumerate(lines[1:], start=2):
        words = line.split()
        try:
            match words:
                case ["format", kind, "1.0"] if kind in _PLY_FORMATS:
                    pass
                case ["element", name, number_of]:
                    elements.append((name, int(number_of), []))
                case ["property", "list", count, member, name]:
                    elements[-1][2].append((name, f"{_PLY_TYPES[count]},{_PLY_TYPES[member]}"))
                case ["property", scalar, name]:
                    elements[-1][2].append((name, _PLY_TYPES[scalar]))
                case ["comment" | "obj_info", *_] | []:
                    pass
                case _:
                    raise ValueError
        except (ValueError, KeyError, IndexError) as error:
            raise FormatError(
                f"{path}, line {number}: {line.strip()!r} is no line of a PLY header, version 1.0"
            ) from error
    names = [name for element, _, properties in elements if element == "vertex" for name, _ in properties]
    if kind == "" or not {"x", "y", "z"} <= set(names):
        raise FormatError(f"{path}: the header names no format, or no element vertex with the properties x, y, z")
    return PlyHeader(_PLY_FORMATS[kind], elements, len(lines) + 1, end.end())


def ply_vertices(path: Path, data: bytes, header: PlyHeader) -> tuple[FloatArray, int]:
    """The vertices of a PLY file, (n, 3), in its unit, and where the data behind them begins: a byte, or a line of text.

    Raises:
        FormatError: cut short; lists in front of the vertices or in them in a binary file; a line without numbers.
    """
    place = next(i for i, e in enumerate(header.elements) if e[0] == "vertex")
    before, (_, count, properties) = header.elements[:place], header.elements[place]
    names = [name for name, _ in properties]
    if header.order == "":
        ahead = sum(e[1] for e in before)
        columns = [names.index(axis) for axis in "xyz"]
        lines = data[header.end :].splitlines()[ahead : ahead + count]
        return _rows(path, lines, header.lines + ahead, count, columns), ahead + count
    if any("," in t for e in before for _, t in e[2]) or any("," in t for _, t in properties):
        raise FormatError(f"{path}: lists in front of the points, or in them, are not read; write the points first")
    skip = header.end + sum(e[1] * sum(np.dtype(t).itemsize for _, t in e[2]) for e in before)
    record = np.dtype([(f"{i}", header.order + t) for i, (_, t) in enumerate(properties)])
    if len(data) < skip + count * record.itemsize:
        raise FormatError(
            f"{path}: cut short: {count} points of {record.itemsize} bytes are promised, "
            f"{max(0, len(data) - skip)} bytes are there"
        )
    table = np.frombuffer(data, record, count, skip)
    points = np.stack([table[f"{names.index(axis)}"].astype(np.float64) for axis in "xyz"], axis=1)
    return points, skip + count * record.itemsize


def _ply(path: Path, data: bytes) -> FloatArray:
    return ply_vertices(path, data, ply_header(path, data))[0]


def _stl(path: Path, data: bytes) -> FloatArray:
    return np.unique(stl_triangles(path, data).reshape(-1, 3), axis=0)


def stl_triangles(path: Path, data: bytes) -> FloatArray:
    """The corners of an STL file's triangles, text or binary, shape (n, 3, 3), in its unit.

    Raises:
        FormatError: cut short, another format, a corner that is not finite.
    """
    count = int.from_bytes(data[80:84], "little") if len(data) >= _STL_HEAD else -1
    if len(data) == _STL_HEAD + _STL_FACET * count:
        facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        corners = np.frombuffer(data, facet, count, _STL_HEAD)["corners"].astype(np.float64)
        if not np.isfinite(corners).all():
            raise FormatError(f"{path}: a corner of a triangle is not finite")
        return corners
    if not data.lstrip().startswith(b"solid"):
        raise FormatError(
            f"{path}: {len(data)} bytes; as binary STL with {count} triangles it would have "
            f"{_STL_HEAD + _STL_FACET * count}, and as text it would begin with 'solid': cut short, or another format"
        )
    lines = data.splitlines()
    numbers = [i for i, line in enumerate(lines) if line.split(None, 1)[:1] == [b"vertex"]]
    if not any(line.strip().startswith(b"endsolid") for line in lines[-20:]):
        raise FormatError(f"{path}, line {len(lines)}: the file ends without 'endsolid': cut short, or another format")
    if len(numbers) % 3:
        raise FormatError(f"{path}: {len(numbers)} lines 'vertex' are no whole number of triangles")
    if not numbers:
        return np.zeros((0, 3, 3))
    return _rows(path, [lines[i] for i in numbers], numbers, len(numbers), [1, 2, 3]).reshape(-1, 3, 3)


def _xyz(path: Path, data: bytes) -> FloatArray:
    lines = data.removeprefix(b"\xef\xbb\xbf").replace(b",", b" ").replace(b";", b" ").splitlines()
    kept = [i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith((b"#", b"//"))]
    if kept and lines[kept[0]].split()[0].strip(b'"').lower() == b"x":
        del kept[0]
    if not kept:
        return np.zeros((0, 3))
    return _rows(path, [lines[i] for i in kept], kept, len(kept), [0, 1, 2])


def _rows(
    path: Path, lines: Sequence[bytes], at: int | Sequence[int], count: int, columns: Sequence[int]
) -> FloatArray:
    """Three columns of lines as numbers; `at` is the index of the first line in its file, or of each."""
    if len(lines) < count:
        raise FormatError(f"{path}: cut short: {count} points are promised, {len(lines)} lines are there")
    if not count:
        return np.zeros((0, 3))
    try:
        table = np.loadtxt(io.BytesIO(b"\n".join(lines)), usecols=columns, comments=None, ndmin=2, encoding="latin-1")
    except (ValueError, IndexError) as error:
        raise _bad_line(path, lines, at, columns) from error
    if len(table) != count:  # blank lines are passed over
        raise _bad_line(path, lines, at, columns)
    return table


def _bad_line(path: Path, lines: Sequence[bytes], at: int | Sequence[int], columns: Sequence[int]) -> FormatError:
    """The error that names the first line which has no numbers in these columns."""
    for i, line in enumerate(lines):
        words = line.split()
        if len(words) <= max(columns) or not all(_is_number(words[c]) for c in columns):
            number = 1 + (at + i if isinstance(at, int) else at[i])
            shown = line[:60].decode("latin-1").strip()
            wanted = ", ".join(str(c + 1) for c in columns)
            return FormatError(f"{path}, line {number}: {shown!r}: columns {wanted} must be numbers")
    return FormatError(f"{path}: is no table of numbers; columns must be the same in all lines")


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
