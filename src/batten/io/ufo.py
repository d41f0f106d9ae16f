"""UFO glyphs: Spiro points in their lib, and curves drawn into them through fontTools' pens."""

from __future__ import annotations

import plistlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fontTools.ufoLib import glifLib as _glif  # type: ignore[import-untyped]

from batten.curves.to_beziers import BezierPieces
from batten.errors import FormatError
from batten.io.spline_reading import SplinePoints, checked_types, point_pairs
from batten.io.study_parts import written_file

glif: Any = _glif

SPIRO_KEY = "org.batten.spiro"
"""The key of a glyph's lib under which its Spiro points are: a list of contours, dicts of "points" and "types"."""


class _Glyph:
    """What fontTools reads a glyph into and writes it from."""

    def __init__(self) -> None:
        self.lib: dict[str, Any] = {}


def glif_splines(path: Path) -> list[SplinePoints]:
    """The splines in a .glif file's lib, `SPIRO_KEY`; none if it has no such key.

    UFO itself knows no Spiro points, and no key for them is in general use; this one holds for each contour "points", a list
    of pairs, and "types", libspiro's letters.

    Raises:
        FormatError: no GLIF, or not of this form.
    """
    glyph = read_glyph(path)
    rows = glyph.lib.get(SPIRO_KEY, [])
    if not isinstance(rows, list):
        raise FormatError(f"{path}: lib.{SPIRO_KEY}: is no list of contours")
    out = []
    for i, row in enumerate(rows):
        where = f"{path}: lib.{SPIRO_KEY}[{i}]"
        if not isinstance(row, dict):
            raise FormatError(f"{where}: is no dict with points and types")
        points = point_pairs(row.get("points"), f"{where}.points")
        types, closed = checked_types(row.get("types"), len(points), f"{where}.types")
        out.append(SplinePoints(f"{path.stem} {i + 1}", points, closed, types))
    return out


def ufo_glyphs(path: Path) -> list[Path]:
    """The .glif files of a .ufo folder's default layer, in the order of its contents.

    Raises:
        FormatError: no contents.plist, or one that cannot be read.
    """
    contents = path / "glyphs" / "contents.plist"
    try:
        names = plistlib.loads(contents.read_bytes())
        return [path / "glyphs" / name for name in names.values()]
    except (OSError, plistlib.InvalidFileException, ValueError, AttributeError, TypeError) as error:
        raise FormatError(f"{contents}: cannot be read ({error}); a UFO folder is needed") from error


def read_glyph(path: Path, draw: Any = None) -> Any:
    """A glyph as fontTools reads it: an object with its attributes and lib.

    Raises:
        FormatError: no GLIF.
    """
    glyph = _Glyph()
    try:
        glif.readGlyphFromString(path.read_bytes(), glyph, draw)
    except (glif.GlifLibError, SyntaxError, UnicodeDecodeError, ValueError) as error:
        raise FormatError(f"{path}: is no GLIF that can be read ({error})") from error
    return glyph


def write_glyph(
    path: Path, splines: Sequence[SplinePoints], drawn: Sequence[BezierPieces], source: Path | None
) -> None:
    """Write a glyph with the curves as its outline and their points, where they have types, in its lib.

    Parameters:
        path: the .glif file; it appears whole or not at all.
        splines: the points. drawn: their cubics, in the same order.
        source: a .glif whose other contents (width, unicodes, lib …) are kept; None for a new glyph named as the file.
    """
    glyph = _Glyph() if source is None else read_glyph(source)
    rows = [{"points": s.points.tolist(), "types": s.types + ("z" if s.closed else "")} for s in splines if s.types]
    if rows:
        glyph.lib = {**glyph.lib, SPIRO_KEY: rows}

    def draw(pen: Any) -> None:
        for pieces in drawn:
            pieces.draw_points(pen)

    name = getattr(glyph, "name", None) or path.stem
    data: bytes = glif.writeGlyphToString(name, glyph, draw, formatVersion=2).encode()
    written_file(path, lambda file: file.write(data))
