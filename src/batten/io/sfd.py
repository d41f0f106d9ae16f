"""FontForge's SFD files: contours of Spiro points, read, and written again with other curves."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from batten.errors import FormatError
from batten.io.spline_reading import SplinePoints
from batten.io.study_parts import written_file
from batten.splines.knot_types import MEANING
from batten.typing import FloatArray

_POINT = re.compile(r"^\s*(\S+)\s+(\S+)\s+(\S)\S*\s*$")


@dataclass(frozen=True)
class _Contour:
    """Lines first … spiro are the curve of a contour, spiro … is its Spiro block."""

    first: int
    spiro: int


class SfdFile:
    """The contours of an SFD file that have Spiro points.

    Written again the file is the same line by line, Spiro points and their types included, but for the cubics of these
    contours, with six decimals.

    Parameters:
        path: the file.

    Raises:
        FormatError: no SFD, or a Spiro block that cannot be read; the message names the file and line.

    Example:
        >>> import tempfile
        >>> text = "SplineFontDB: 3.2\\nStartChar: A\\nFore\\nSplineSet\\n0 0 m 0\\n 9 0 l 0\\n  Spiro\\n    0 0 {\\n"
        >>> text += "    5 3 o\\n    9 0 o\\n    0 0 z\\n  EndSpiro\\nEndSplineSet\\nEndChar\\n"
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     file = Path(folder) / "a.sfd"
        ...     _ = file.write_text(text)
        ...     (arch,) = SfdFile(file).splines
        >>> arch.name, arch.types, arch.points.tolist()
        ('A 1', '{o}', [[0.0, 0.0], [5.0, 3.0], [9.0, 0.0]])
    """

    def __init__(self, path: Path) -> None:
        try:
            self._lines = path.read_text("utf-8").splitlines(keepends=True)
        except UnicodeDecodeError as error:
            raise FormatError(f"{path}: is not UTF-8 text ({error.reason}); save it again by FontForge") from error
        if not self._lines or not self._lines[0].startswith("SplineFontDB:"):
            raise FormatError(f"{path}: line 1: does not begin with SplineFontDB; an SFD file of FontForge is needed")
        self._path = path
        self._contours: list[_Contour] = []
        self.splines: list[SplinePoints] = []
        glyph, number, first = "glyph", 0, -1
        k = 0
        while k < len(self._lines):
            words = self._lines[k].split()
            if words[:1] == ["StartChar:"]:
                glyph, number = " ".join(words[1:]) or "glyph", 0
            elif len(words) >= 3 and words[2] == "m":
                first = k
            elif words == ["Spiro"]:
                number += 1
                if first < 0:
                    raise FormatError(f"{path}: line {k + 1}: a Spiro block without a contour before it")
                self._contours.append(_Contour(first, k))
                k = self._block(k + 1, f"{glyph} {number}")
                first = -1
            k += 1

    def _block(self, k: int, name: str) -> int:
        """Read the points from line k on; the line of EndSpiro."""
        points: list[tuple[float, float]] = []
        letters = ""
        begin = k
        while k < len(self._lines) and self._lines[k].split() != ["EndSpiro"]:
            where = f"{self._path}: line {k + 1}"
            found = _POINT.match(self._lines[k])
            try:
                if found is None:
                    raise ValueError
                x, y = float(found[1]), float(found[2])
            except ValueError as error:
                raise FormatError(
                    f"{where}: {self._lines[k].strip()!r} is no Spiro point; needed is: x y letter"
                ) from error
            if found[3] not in MEANING or not np.isfinite([x, y]).all():
                raise FormatError(f"{where}: {found[3]!r} is no type of a Spiro point; allowed are {' '.join(MEANING)}")
            if found[3] != "z":
                points.append((x, y))
                letters += found[3]
            k += 1
        if k == len(self._lines) or len(points) < 2:
            what = "has no EndSpiro" if k == len(self._lines) else "has fewer than two points"
            raise FormatError(f"{self._path}: line {begin}: its Spiro block {what}")
        closed = letters[0] != "{"
        types = letters if closed else letters[:-1] + "}"
        self.splines.append(SplinePoints(name, np.array(points), closed, types))
        return k

    def write(self, cubics: Sequence[FloatArray], out: Path) -> None:
        """The same file with other cubics (n, 4, 2), one array for each of `splines`; whole or not at all."""
        parts: list[str] = []
        last = 0
        for contour, rows in zip(self._contours, cubics):
            parts += [*self._lines[last : contour.first], *_contour_lines(rows)]
            last = contour.spiro
        text = "".join([*parts, *self._lines[last:]])
        written_file(out, lambda file: file.write(text.encode()))


def _contour_lines(cubics: FloatArray) -> list[str]:
    """A contour as SFD has it: a move, then three points for each cubic; 0 is a curve point, 1 a corner."""
    turn = np.zeros(len(cubics) + 1, dtype=bool)
    before, after = cubics[:-1, 3] - cubics[:-1, 2], cubics[1:, 1] - cubics[1:, 0]
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    turn[1:-1] = np.abs(np.arctan2(cross, (before * after).sum(axis=1))) > 1e-5
    rows = [f"{_text(cubics[0, 0])} m 0\n"]
    rows += [f" {_text(c[1])} {_text(c[2])} {_text(c[3])} c {int(k)}\n" for c, k in zip(cubics, turn[1:])]
    return rows


def _text(point: FloatArray) -> str:
    return " ".join(f"{float(v):.6f}".rstrip("0").rstrip(".") for v in point).replace("-0 ", "0 ")
