"""Points of a scan from PLY, STL (both as text or binary) and XYZ files."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from pathlib import Path

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


def _ply(path: Path, data: bytes) -> FloatArray:
    end = re.search(rb"^end_header\r?\n", data, re.MULTILINE)
    if data[:3] != b"ply" or end is None:
        raise FormatError(
            f"{path}, line 1: a PLY file begins with 'ply' and has a line 'end_header'; is it another format?"
        )
    lines = data[: end.start()].decode("latin-1").splitlines()
    kind = ""
    elements: list[tuple[str, int, list[tuple[str, str]]]] = []  # name, count, (property, type); type "" for a list
    for number, line in enumerate(lines[1:], start=2):
        words = line.split()
        try:
            match words:
                case ["format", kind, "1.0"] if kind in _PLY_FORMATS:
                    pass
                case ["element", name, number_of]:
                    elements.append((name, int(number_of), []))
                case ["property", "list", _, _, name]:
                    elements[-1][2].append((name, ""))
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
    place = next((i for i, e in enumerate(elements) if e[0] == "vertex"), -1)
    names = [name for name, _ in elements[place][2]] if place >= 0 else []
    if kind == "" or not {"x", "y", "z"} <= set(names):
        raise FormatError(f"{path}: the header names no format, or no element vertex with the properties x, y, z")
    before, (_, count, properties) = elements[:place], elements[place]
    ahead = sum(e[1] for e in before)
    if kind == "ascii":
        columns = [names.index(axis) for axis in "xyz"]
        first = len(lines) + 1 + ahead
        return _rows(path, data[end.end() :].splitlines()[ahead : ahead + count], first, count, columns)
    if any(not t for e in before for _, t in e[2]) or any(not t for _, t in properties):
        raise FormatError(f"{path}: lists in front of the points, or in them, are not read; write the points first")
    order = _PLY_FORMATS[kind]
    skip = end.end() + sum(e[1] * sum(np.dtype(t).itemsize for _, t in e[2]) for e in before)
    record = np.dtype([(f"{i}", order + t) for i, (_, t) in enumerate(properties)])
    if len(data) < skip + count * record.itemsize:
        raise FormatError(
            f"{path}: cut short: {count} points of {record.itemsize} bytes are promised, "
            f"{max(0, len(data) - skip)} bytes are there"
        )
    table = np.frombuffer(data, record, count, skip)
    return np.stack([table[f"{names.index(axis)}"].astype(np.float64) for axis in "xyz"], axis=1)


def _stl(path: Path, data: bytes) -> FloatArray:
    count = int.from_bytes(data[80:84], "little") if len(data) >= _STL_HEAD else -1
    if len(data) == _STL_HEAD + _STL_FACET * count:
        facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        corners = np.frombuffer(data, facet, count, _STL_HEAD)["corners"].reshape(-1, 3)
        points = np.unique(corners, axis=0).astype(np.float64)
        if not np.isfinite(points).all():
            raise FormatError(f"{path}: a corner of a triangle is not finite")
        return points
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
        return np.zeros((0, 3))
    return np.unique(_rows(path, [lines[i] for i in numbers], numbers, len(numbers), [1, 2, 3]), axis=0)


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
