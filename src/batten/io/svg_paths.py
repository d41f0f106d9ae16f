"""The paths of an SVG drawing as cubics in the frame in which they are seen, and the drawing again with others in it."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np
import svgelements as _svgelements  # type: ignore[import-untyped]

from batten.errors import FormatError
from batten.io.bezier_paths import BezierPath
from batten.io.study_parts import written_file
from batten.typing import FloatArray

svgelements: Any = _svgelements

_SHAPES = ("rect", "circle", "ellipse", "line", "polyline", "polygon")
#: What lies in them is not drawn as it stands.
_UNSEEN = ("clipPath", "mask", "marker", "pattern", "glyph", "font")
_ATTRIBUTE = re.compile(rb"""([^\s=/>"']+)\s*=\s*("[^"]*"|'[^']*')""")
_TRANSFORM = re.compile(r"(\s*(matrix|translate|scale|rotate|skewX|skewY)\s*\([^()]*\)[\s,]*)*\s*")
#: Greatest relative difference of the half axes of an arc that is called one of a circle.
_ROUND = 1e-6


@dataclass(frozen=True, eq=False)
class _Piece:
    """A command of a path: its letter, its end and, for an arc, the middle of its words; cubics first … first + count."""

    letter: str
    first: int
    count: int
    control_points: FloatArray
    middle: str = ""


@dataclass(frozen=True, eq=False)
class _Element:
    """A <path>: bytes start … stop of its data, its frame (2, 3), and the pieces and number of each part."""

    start: int
    stop: int
    frame: FloatArray
    parts: list[tuple[list[_Piece], int]] = field(default_factory=list)


class SvgPaths:
    """The <path> elements of an SVG file, each subpath a path of cubics.

    Curves are taken as they are seen: the transforms of the element and of all around it are applied (and viewBox where
    preserveAspectRatio is "none" and width and height are plain numbers), because a stretched elastica is none. Quadratic
    curves and arcs of ellipses count as cubics and become such if they change; lines and arcs that are seen as circles stay.
    Other shapes, and paths in clipPath, mask, marker, pattern and fonts, are left alone. What a <use> or a style sheet does
    is not seen; a path with a transform in its style attribute is left alone.

    Written again, the file is the same byte by byte but for the `d` of paths that changed, whose commands are absolute then,
    with numbers to 1e-12 of the path's size.

    Parameters:
        path: the file, UTF-8 or another encoding that contains ASCII.

    Raises:
        FormatError: no XML, no SVG, or a path whose data cannot be read; the message names the file, line and element.

    Example:
        >>> import tempfile
        >>> text = '<svg xmlns="http://www.w3.org/2000/svg"><path transform="scale(2)" d="m1 1h2c0 1 1 1 1 0z"/></svg>'
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     file = Path(folder) / "a.svg"
        ...     _ = file.write_text(text)
        ...     read = SvgPaths(file)
        >>> read.paths[0].closed, read.paths[0].control_points[1].tolist()
        (True, [[6.0, -2.0], [6.0, -4.0], [8.0, -4.0], [8.0, -2.0]])
    """

    def __init__(self, path: Path) -> None:
        self._path, self._data = path, path.read_bytes()
        self._elements: list[_Element] = []
        self._frames = [np.eye(2, 3)]
        self._names: list[str] = []
        self._left: Counter[str] = Counter()
        self._found: list[BezierPath] = []
        parser = expat.ParserCreate(namespace_separator=" ")
        parser.StartElementHandler = lambda tag, attributes: self._start(tag.split(" ")[-1], attributes, parser)
        parser.EndElementHandler = lambda tag: self._end()
        try:
            parser.Parse(self._data, True)
        except expat.ExpatError as error:
            raise FormatError(f"{path}: line {error.lineno}: {expat.ErrorString(error.code)}; SVG is needed") from error
        self.paths = tuple(self._found)
        self.notes = tuple(f"{count} × {what} left as it is" for what, count in sorted(self._left.items()))

    def _start(self, tag: str, attributes: dict[str, str], parser: expat.XMLParserType) -> None:
        if not self._names and tag != "svg":
            raise FormatError(f"{self._path}: the outermost element is <{tag}>; SVG is needed")
        where = f"{self._path}: line {parser.CurrentLineNumber}: <{tag}>"
        if "id" in attributes:
            where += f" {attributes['id']!r}"
        self._names.append(tag)
        frame = _composed(self._frames[-1], _transform(attributes.get("transform", ""), where))
        self._frames.append(_composed(frame, _stretch(attributes)) if tag == "svg" else frame)
        if tag in _SHAPES:
            self._left[f"<{tag}>"] += 1
        if tag != "path" or not attributes.get("d", "").strip():
            return
        around = next((name for name in self._names if name in _UNSEEN), None)
        if around is not None:
            self._left[f"<path> in <{around}>"] += 1
        elif re.search(r"(^|[;\s])(transform|d)\s*:", attributes.get("style", "")):
            self._left["<path> with a transform or data in its style"] += 1
        elif abs(np.linalg.det(frame[:, :2])) <= 1e-12 * np.abs(frame[:, :2]).max() ** 2:
            self._left["<path> that its transform flattens"] += 1
        else:
            self._take(attributes, frame, parser.CurrentByteIndex, where)

    def _end(self) -> None:
        self._names.pop()
        self._frames.pop()

    def _take(self, attributes: dict[str, str], frame: FloatArray, index: int, where: str) -> None:
        found = next((m for m in _ATTRIBUTE.finditer(self._data, index) if m[1] == b"d"), None)
        if self._data[index : index + 1] != b"<" or found is None:
            raise FormatError(f"{where}: cannot be found in the file's bytes; save it as UTF-8, without entities")
        element = _Element(found.start(2) + 1, found.end(2) - 1, frame)
        number = len(self._elements) + 1
        name = attributes.get("id", f"path {number}")
        parts = _parts(attributes["d"], frame, where)
        for i, (pieces, closed) in enumerate(parts, 1):
            seen = np.concatenate([_seen(piece.control_points, frame) for piece in pieces])
            fixed = np.concatenate([np.full(piece.count, piece.letter == "A°") for piece in pieces])
            element.parts.append((pieces, len(self._found)))
            self._found.append(BezierPath(name if len(parts) == 1 else f"{name} part {i}", seen, closed, fixed))
        self._elements.append(element)

    def write(self, changed: Sequence[FloatArray], out: Path) -> None:
        """The same bytes with other data in the paths that changed."""
        parts, last = [], 0
        for element in self._elements:
            numbers = [number for _, number in element.parts]
            if all(np.array_equal(changed[n], self.paths[n].control_points) for n in numbers):
                continue
            text = " ".join(
                _data(pieces, element.frame, self.paths[number].control_points, changed[number])
                for pieces, number in element.parts
            )
            parts += [self._data[last : element.start], text.encode()]
            last = element.stop
        whole = b"".join([*parts, self._data[last:]])
        written_file(out, lambda file: file.write(whole))


def _composed(outer: FloatArray, inner: FloatArray) -> FloatArray:
    """The frame (2, 3) that applies the inner, then the outer."""
    return outer @ np.vstack([inner, [0.0, 0.0, 1.0]])


def _transform(text: str, where: str) -> FloatArray:
    if not _TRANSFORM.fullmatch(text):
        raise FormatError(f"{where}: its transform {text!r} cannot be read")
    try:
        m = svgelements.Matrix(text)
        frame = np.array([[m.a, m.c, m.e], [m.b, m.d, m.f]], dtype=np.float64)
    except (ValueError, IndexError, TypeError) as error:
        raise FormatError(f"{where}: its transform {text!r} cannot be read") from error
    if not np.isfinite(frame).all():
        raise FormatError(f"{where}: its transform {text!r} is not finite")
    return frame


def _stretch(attributes: dict[str, str]) -> FloatArray:
    """What an <svg> does beyond a similarity."""
    box = re.split(r"[\s,]+", attributes.get("viewBox", "").strip())
    if attributes.get("preserveAspectRatio", "").strip() != "none" or len(box) != 4:
        return np.eye(2, 3)
    sizes = [re.fullmatch(r"\s*([\d.]+)\s*(px|mm|cm|in|pt|pc)?\s*", attributes.get(k, "")) for k in ("width", "height")]
    if sizes[0] is None or sizes[1] is None or sizes[0][2] != sizes[1][2]:
        return np.eye(2, 3)
    wide, high = (float(size[1]) / float(box[i]) for size, i in zip(sizes, (2, 3)) if size is not None)
    return np.array([[wide, 0.0, 0.0], [0.0, high, 0.0]])


def _seen(points: FloatArray, frame: FloatArray) -> FloatArray:
    return (points @ frame[:, :2].T + frame[:, 2]) * (1.0, -1.0)


def _parts(text: str, frame: FloatArray, where: str) -> list[tuple[list[_Piece], bool]]:
    """The subpaths of a path's data: their pieces, and whether they are closed."""
    problem = FormatError(f"{where}: its data cannot be read: {text[:60]!r}{'…' if len(text) > 60 else ''}")
    try:
        segments = list(svgelements.Path(text))
    except (ValueError, IndexError, TypeError, AttributeError) as error:
        raise problem from error
    parts: list[tuple[list[_Piece], bool]] = []
    pieces: list[_Piece] = []
    for segment in segments:
        if segment.end is None or (segment.start is None and not isinstance(segment, svgelements.Move)):
            raise problem
        if isinstance(segment, svgelements.Move):
            parts.append((pieces, False))
            pieces = []
            continue
        first = pieces[-1].first + pieces[-1].count if pieces else 0
        with np.errstate(invalid="ignore", over="ignore"):  # numbers that are not finite are refused below
            piece = _piece(segment, first, frame)
        if not np.isfinite(piece.control_points).all():
            raise problem
        if piece.letter == "Z" and pieces and (piece.control_points[0, 0] == piece.control_points[0, 3]).all():
            piece = _Piece("Z", first, 0, piece.control_points[:0])
        pieces.append(piece)
        if piece.letter == "Z":
            parts.append((pieces, True))
            pieces = []
    return [part for part in [*parts, (pieces, False)] if part[0]]


def _piece(segment: Any, first: int, frame: FloatArray) -> _Piece:
    start, end = _pair(segment.start), _pair(segment.end)
    straight = (start + (end - start) * np.array([[0.0], [1.0], [2.0], [3.0]]) / 3.0)[None]
    if isinstance(segment, svgelements.Close):
        return _Piece("Z", first, 1, straight)
    if isinstance(segment, svgelements.CubicBezier):
        return _Piece("C", first, 1, np.stack([start, _pair(segment.control1), _pair(segment.control2), end])[None])
    if isinstance(segment, svgelements.QuadraticBezier):
        control = _pair(segment.control)
        cubic = np.stack([start, (start + 2.0 * control) / 3.0, (2.0 * control + end) / 3.0, end])[None]
        return _Piece("Q", first, 1, cubic, _words(control))
    if isinstance(segment, svgelements.Arc) and (start != end).any() and segment.rx and segment.ry:
        return _arc(segment, first, frame, start, end)
    return _Piece("L", first, 1, straight)


def _arc(segment: Any, first: int, frame: FloatArray, start: FloatArray, end: FloatArray) -> _Piece:
    angle = float(segment.get_rotation())
    c, s = math.cos(angle), math.sin(angle)
    axes = frame[:, :2] @ np.array([[c, -s], [s, c]]) @ np.diag([float(segment.rx), float(segment.ry)])
    sizes = np.linalg.svd(axes, compute_uv=False)
    pieces = [np.stack([_pair(p) for p in (q.start, q.control1, q.control2, q.end)]) for q in segment.as_cubic_curves()]
    cubics = np.stack(pieces)
    cubics[1:, 0] = cubics[:-1, 3]
    cubics[0, 0], cubics[-1, 3] = start, end
    flags = f"{int(abs(segment.sweep) > math.pi)} {int(segment.sweep > 0.0)}"
    middle = f"{float(segment.rx):.15g} {float(segment.ry):.15g} {math.degrees(angle):.15g} {flags}"
    return _Piece("A°" if sizes[0] - sizes[1] <= _ROUND * sizes[0] else "A", first, len(cubics), cubics, middle)


def _pair(point: Any) -> FloatArray:
    return np.array([point.x, point.y], dtype=np.float64)


def _words(point: FloatArray) -> str:
    return " ".join(f"{float(value):.15g}" for value in point)


def _data(pieces: list[_Piece], frame: FloatArray, old: FloatArray, new: FloatArray) -> str:
    """A subpath's data with absolute commands; what did not change keeps its kind and its numbers."""
    extent = float(np.ptp(np.concatenate([p.control_points.reshape(-1, 2) for p in pieces]), axis=0).max()) or 1.0
    decimals = max(0, 12 - math.floor(math.log10(extent)))
    back = np.linalg.inv(frame[:, :2])

    def written(number: int, k: int, kept: FloatArray) -> str:
        point = kept
        if (new[number, k] != old[number, k]).any():
            point = (new[number, k] * (1.0, -1.0) - frame[:, 2]) @ back.T
        return ",".join(_number(float(value), decimals) for value in point)

    words = ["M" + written(0, 0, pieces[0].control_points[0, 0])]
    for piece in pieces:
        some = slice(piece.first, piece.first + piece.count)
        if piece.letter == "Z":
            words.append("Z")
            continue
        same = np.array_equal(new[some], old[some])
        end = written(some.stop - 1, 3, piece.control_points[-1, 3])
        if same and piece.letter == "L":
            words.append(f"L{end}")
        elif same and piece.letter != "C":
            words.append(f"{piece.letter[0]}{piece.middle} {end}")
        else:
            for i, row in enumerate(piece.control_points):
                words.append("C" + " ".join(written(piece.first + i, k, row[k]) for k in (1, 2, 3)))
    return "".join(words)


def _number(value: float, decimals: int) -> str:
    text = f"{value:.{decimals}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text in ("-0", "") else text
