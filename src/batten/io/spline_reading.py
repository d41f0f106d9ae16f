"""Points of splines from files: JSON, SVG with Inkscape's spiro effect, FontForge's SFD, UFO glyphs."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import svgelements as _svgelements  # type: ignore[import-untyped]

from batten.errors import FormatError, InvalidInputError
from batten.splines.interpolating_spline import End
from batten.splines.knot_types import MEANING
from batten.typing import FloatArray

svgelements: Any = _svgelements

READABLE = (".json", ".svg", ".sfd", ".glif", ".ufo")
"""The endings of files of points."""

_INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"
#: Two unit tangents whose sum is shorter than 2 by less than this are smooth, as Inkscape has it.
_SMOOTH = 1e-3


@dataclass(frozen=True, eq=False)
class SplinePoints:
    """The points of one spline.

    Attributes:
        name: as tables call it.
        points: (n, 2), y up; handles of anchors included.
        closed: whether it returns to its first point, which is not repeated.
        types: libspiro's letters, one for each point: an open spline begins with { and ends with }; or empty.
        corners: indices of points where the tangent may break, where there are no types.
        start, end: as `interpolating_spline` takes them.
    """

    name: str
    points: FloatArray
    closed: bool
    types: str = ""
    corners: tuple[int, ...] = ()
    start: End = "natural"
    end: End = "natural"


def read_splines(path: str | Path) -> tuple[list[SplinePoints], tuple[str, ...]]:
    """The splines of a file, and notes on what was left alone.

    - .json: see `json_splines`;
    - .svg: paths with Inkscape's spiro effect, from their `inkscape:original-d`; types as Inkscape takes them from lines,
      curves and smooth nodes;
    - .sfd: blocks `Spiro` … `EndSpiro` of all glyphs; .glif, .ufo: see `ufo.glif_splines`.

    Raises:
        InvalidInputError: no such file, another ending, no splines in it.
        FormatError: the file cannot be understood; the message names the file and line or field.
    """
    path = Path(path)
    if path.suffix.lower() not in READABLE:
        raise InvalidInputError(f"{path}: has the ending {path.suffix or 'none'}; allowed are {', '.join(READABLE)}")
    if not path.exists() or path.is_dir() != (path.suffix.lower() == ".ufo"):
        what = "is a folder" if path.is_dir() else "is no folder" if path.exists() else "no such file"
        raise InvalidInputError(f"{path}: {what}; give a file of points")
    found: list[SplinePoints]
    notes: tuple[str, ...] = ()
    if path.suffix.lower() == ".sfd":
        from batten.io.sfd import SfdFile

        found = SfdFile(path).splines
    elif path.suffix.lower() in (".glif", ".ufo"):
        from batten.io.ufo import glif_splines, ufo_glyphs

        files = [path] if path.suffix.lower() == ".glif" else ufo_glyphs(path)
        found = [spline for file in files for spline in glif_splines(file)]
    else:
        found, notes = json_splines(path) if path.suffix.lower() == ".json" else svg_splines(path)
    if not found:
        raise InvalidInputError(f"{path}: has no splines; {'; '.join(notes) or 'it is empty'}")
    return found, notes


def json_splines(path: Path) -> tuple[list[SplinePoints], tuple[str, ...]]:
    """The splines of a JSON file: an object with the list "splines".

    Each is an object with "points", a list of pairs [x, y], y up, and, if wanted, "name"; "closed" (true or false);
    "corners", a list of indices; "types", a text of libspiro's letters, one for each point (for a closed spline
    a z more may follow); "start" and "end": "natural", "arc", an angle in radians, or {"curvature": κ}.

    Raises:
        FormatError: no JSON, or not of this form; the message names the file and the field.

    Example:
        >>> import tempfile
        >>> text = '{"splines": [{"name": "arch", "points": [[0, 0], [1, 1], [2, 0]], "corners": [1], "start": 1.5}]}'
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     file = Path(folder) / "arch.json"
        ...     _ = file.write_text(text)
        ...     (arch,), notes = json_splines(file)
        >>> arch.name, arch.corners, arch.start, arch.end
        ('arch', (1,), 1.5, 'natural')
    """
    try:
        document = json.loads(path.read_text("utf-8"))
    except UnicodeDecodeError as error:
        raise FormatError(f"{path}: is not UTF-8 text ({error.reason}); save it as UTF-8") from error
    except json.JSONDecodeError as error:
        raise FormatError(f"{path}: line {error.lineno}: {error.msg}; JSON is needed") from error
    rows = document.get("splines") if isinstance(document, dict) else None
    if not isinstance(rows, list):
        raise FormatError(f'{path}: has no list "splines"; needed is {{"splines": [{{"points": [[x, y], …]}}, …]}}')
    return [_json_spline(row, f"{path}: splines[{i}]", i + 1) for i, row in enumerate(rows)], ()


_FIELDS = ("name", "points", "closed", "corners", "types", "start", "end")


def _json_spline(row: Any, where: str, number: int) -> SplinePoints:
    if not isinstance(row, dict):
        raise FormatError(f"{where}: is no object; needed is an object with points")
    unknown = sorted(set(row) - set(_FIELDS))
    if unknown:
        raise FormatError(f"{where}.{unknown[0]}: is no field of a spline; allowed are {', '.join(_FIELDS)}")
    points = point_pairs(row.get("points"), f"{where}.points")
    closed, corners = row.get("closed", False), row.get("corners", [])
    if not isinstance(closed, bool):
        raise FormatError(f"{where}.closed: is {closed!r}; allowed are true and false")
    if not isinstance(corners, list) or any(type(c) is not int or not 0 <= c < len(points) for c in corners):
        raise FormatError(f"{where}.corners: is {corners!r}; allowed are indices of points, 0 to {len(points) - 1}")
    ends = [_end(row.get(key, "natural"), f"{where}.{key}") for key in ("start", "end")]
    types = row.get("types", "")
    if types:
        if corners or ends != ["natural", "natural"]:
            raise FormatError(f"{where}.types: say corners and ends by themselves; leave out corners, start and end")
        types, closed = checked_types(types, len(points), f"{where}.types")
    return SplinePoints(str(row.get("name", f"spline {number}")), points, closed, types, tuple(corners), *ends)


def checked_types(types: Any, count: int, where: str) -> tuple[str, bool]:
    """Letters, one for each of `count` points, and whether they say closed.

    Raises:
        FormatError: no text, unknown letters, another number of them.
    """
    if not isinstance(types, str) or set(types) - set(MEANING):
        raise FormatError(f"{where}: is {types!r}; allowed are the letters {' '.join(MEANING)}")
    closed = not types.startswith("{")
    own = types[:-1] if types.endswith("z") else types
    if len(own) != count:
        raise FormatError(f"{where}: has {len(own)} letters for {count} points; needed is one for each")
    return own if closed else own[:-1] + "}", closed


def point_pairs(values: Any, where: str) -> FloatArray:
    """Two or more pairs of finite numbers as an array (n, 2), or `FormatError`."""
    try:
        points = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise FormatError(f"{where}: is no list of pairs of numbers") from error
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2 or not np.isfinite(points).all():
        raise FormatError(f"{where}: has shape {points.shape}; needed are two or more pairs [x, y] of finite numbers")
    return points


def _end(value: Any, where: str) -> End:
    if value in ("natural", "arc"):
        return "natural" if value == "natural" else "arc"
    if isinstance(value, dict) and list(value) == ["curvature"] and _number(value["curvature"]):
        return ("curvature", float(value["curvature"]))
    if _number(value):
        return float(value)
    raise FormatError(f'{where}: is {value!r}; allowed are "natural", "arc", an angle in radians, {{"curvature": κ}}')


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


# --- SVG with Inkscape's spiro effect ---


def svg_splines(path: Path) -> tuple[list[SplinePoints], tuple[str, ...]]:
    """The paths of an SVG that have Inkscape's spiro effect, as they are seen: transforms applied, y up.

    The nodes are those of `inkscape:original-d`. As in Inkscape a node is a corner (v) unless the tangents on both sides
    agree; between a line and a curve it is ] or [, else c. Other paths are left alone.

    Raises:
        FormatError: no XML, no SVG, or path data that cannot be read.
    """
    try:
        root = ElementTree.fromstring(path.read_bytes())
    except ElementTree.ParseError as error:
        raise FormatError(f"{path}: line {error.position[0]}: no XML ({error}); SVG is needed") from error
    if root.tag.rsplit("}", 1)[-1] != "svg":
        raise FormatError(f"{path}: the outermost element is <{root.tag.rsplit('}', 1)[-1]}>; SVG is needed")
    effects = {e.get("id"): e.get("effect", "") for e in root.iter() if e.tag.rsplit("}", 1)[-1] == "path-effect"}
    found: list[SplinePoints] = []
    left = 0

    def walk(element: ElementTree.Element, outer: Any) -> None:
        nonlocal left
        name = element.get("id", f"path {len(found) + left + 1}")
        try:
            frame = svgelements.Matrix(element.get("transform", "")) * outer
        except (ValueError, IndexError, TypeError) as error:
            raise FormatError(f"{path}: {name}: its transform {element.get('transform')!r} cannot be read") from error
        if element.tag.rsplit("}", 1)[-1] == "path":
            asked = element.get(_INKSCAPE + "path-effect", "").replace("#", "").split(";")
            if any(effects.get(a.strip()) == "spiro" for a in asked) and element.get(_INKSCAPE + "original-d"):
                found.extend(_svg_path(element.get(_INKSCAPE + "original-d", ""), frame, name, f"{path}: {name}"))
            else:
                left += 1
        for child in element:
            walk(child, frame)

    walk(root, svgelements.Matrix())
    return found, (f"{left} × <path> without the spiro effect left out",) if left else ()


def _svg_path(data: str, frame: Any, name: str, where: str) -> list[SplinePoints]:
    problem = FormatError(f"{where}: inkscape:original-d cannot be read: {data[:60]!r}")
    try:
        parts = [list(part) for part in abs(svgelements.Path(data) * frame).as_subpaths()]
    except (ValueError, IndexError, TypeError, AttributeError) as error:
        raise problem from error
    out = []
    for number, part in enumerate(parts, 1):
        closed = isinstance(part[-1], svgelements.Close)
        pieces = [s for s in part if not isinstance(s, svgelements.Move)]
        if any(s.start is None or s.end is None for s in pieces):
            raise problem
        pieces = [s for s in pieces if not (isinstance(s, svgelements.Close | svgelements.Line) and s.start == s.end)]
        if not pieces:
            continue
        nodes = np.array([[s.start.x, -s.start.y] for s in pieces] + [[pieces[-1].end.x, -pieces[-1].end.y]])
        kinds = [_kind(a, b) for a, b in itertools.pairwise(pieces)]
        if closed:
            types, nodes = _kind(pieces[-1], pieces[0]) + "".join(kinds), nodes[:-1]
        else:
            types = "{" + "".join(kinds) + "}"
        out.append(SplinePoints(name if len(parts) == 1 else f"{name} part {number}", nodes, closed, types))
    return out


def _kind(before: Any, after: Any) -> str:
    """The letter of the node between two pieces."""
    a, b = _tangent(before, 1.0), _tangent(after, 0.0)
    if not (abs(a) > 0.0 and abs(b) > 0.0 and 2.0 - abs(a / abs(a) + b / abs(b)) < _SMOOTH):
        return "v"
    lines = _is_line(before), _is_line(after)
    return "]" if lines == (True, False) else "[" if lines == (False, True) else "c"


def _handles(piece: Any) -> list[complex]:
    """The control points of a piece; an arc of an ellipse by its cubics."""
    if isinstance(piece, svgelements.Arc):
        cubics = list(piece.as_cubic_curves())
        points = [cubics[0].start, cubics[0].control1, cubics[-1].control2, cubics[-1].end]
    elif isinstance(piece, svgelements.CubicBezier):
        points = [piece.start, piece.control1, piece.control2, piece.end]
    elif isinstance(piece, svgelements.QuadraticBezier):
        points = [piece.start, piece.control, piece.end]
    else:
        points = [piece.start, piece.end]
    return [complex(p.x, p.y) for p in points]


def _tangent(piece: Any, place: float) -> complex:
    z = _handles(piece)
    order: Sequence[complex] = z if place == 0.0 else z[::-1]
    for other in order[1:]:
        if abs(other - order[0]) > 1e-9 * (abs(other) + abs(order[0])):
            return (other - order[0]) * (1.0 if place == 0.0 else -1.0)
    return 0j


def _is_line(piece: Any) -> bool:
    z = _handles(piece)
    return len(z) == 2 or (len(z) == 4 and z[1] == z[0] and z[2] == z[3])
