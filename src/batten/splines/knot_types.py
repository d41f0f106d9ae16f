"""Knots of constrained splines by libspiro's letters, and how they divide a path into runs (Levien2009 ch. 7, 8)."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from batten.errors import InvalidInputError
from batten.typing import ArrayLike, BoolArray, FloatArray, IntArray

Boundary = Literal["free", "line"]

MEANING = {
    "{": "start of an open path",
    "}": "end of an open path",
    "v": "corner",
    "o": "smooth, G4",
    "c": "smooth, G2",
    "[": "from curve to line",
    "]": "from line to curve",
    "a": "anchor, whose tangent points to the handle that follows",
    "h": "handle of the anchor before it",
    "z": "end of a closed path",
}
_ALLOWED = "; ".join(f"{letter} {words}" for letter, words in MEANING.items())


@dataclass(frozen=True, eq=False)
class KnotPath:
    """The knots that a path passes through.

    Attributes:
        knots: (n, 2). letters: n of them; no h, no z.
        handles: (n,), direction from an anchor to its handle, radians; NaN at other knots.
        closed: whether the last segment leads back to the first knot.
        places: (n,), index of each knot in the points as given.
    """

    knots: FloatArray
    letters: str
    handles: FloatArray
    closed: bool
    places: IntArray

    @property
    def segments(self) -> int:
        """How many segments there are."""
        return len(self.knots) - (not self.closed)

    def parameters(self) -> IntArray:
        """(segments,), how many parameters each segment has: 4, 2, 1 (an arc) or 0 (a line)."""
        return _counts(self.letters + self.letters[:1] if self.closed else self.letters)


@dataclass(frozen=True, eq=False)
class Run:
    """Segments that are solved together.

    Attributes:
        segments: indices of its segments on the path, in order.
        letters: of the knots between them; of all knots if closed.
        closed: whether the run is the whole of a closed path without a break.
        boundaries: at start and end: "free", or "line" where the curve leaves a line or has its tangent from a handle.
        directions: of the tangent at boundaries of kind "line", radians; else 0.
    """

    segments: IntArray
    letters: str
    closed: bool
    boundaries: tuple[Boundary, Boundary] = ("free", "free")
    directions: tuple[float, float] = (0.0, 0.0)

    @property
    def parameters(self) -> IntArray:
        """(segments,), how many parameters each has: 4, 2 or 1."""
        if self.closed:
            return _counts(self.letters + self.letters[0])
        start, end = ("v" if b == "free" else line for b, line in zip(self.boundaries, "][", strict=True))
        return _counts(start + self.letters + end)

    @property
    def knots(self) -> IntArray:
        """Indices on the path of the knots that have letters."""
        return self.segments if self.closed else self.segments[1:]


def _counts(letters: str) -> IntArray:
    return np.array([_parameters(a, b) for a, b in itertools.pairwise(letters)], dtype=np.int64)


def _parameters(left: str, right: str) -> int:
    """How many parameters a segment has between two knots (Levien2009 ch. 8); an anchor on its left acts by its handle."""
    if left in "o]a" or right in "o[a":
        return 4
    if left == "c" and right == "c":
        return 2
    return 1 if "c" in (left, right) else 0


def read_knots(points: ArrayLike, types: str | Sequence[str]) -> KnotPath:
    """The path of points (n, 2) with one letter for each, or `InvalidInputError` in words."""
    letters = "".join(str(t) for t in types)
    own = np.array(points, dtype=np.float64)
    unknown = sorted(set(letters) - set(MEANING))
    if unknown:
        raise InvalidInputError(f"types: got {', '.join(map(repr, unknown))}; allowed are {_ALLOWED}")
    closed = not letters.startswith("{")
    if closed and not letters.endswith("z"):
        raise InvalidInputError(f"types = {_short(letters)} says neither open nor closed; begin with {{ or end with z")
    if letters.endswith("z"):
        letters = letters[:-1]
        if own.ndim == 2 and len(own) == len(letters) + 1:
            own = own[:-1]  # libspiro's closing point, whose place means nothing
    if own.ndim != 2 or own.shape[1] != 2 or len(own) != len(letters) or len(own) < 2 or not np.isfinite(own).all():
        raise InvalidInputError(
            f"points: got shape {own.shape} with {len(letters)} types; allowed is (n, 2), finite, n ≥ 2, one type for each"
        )
    if not closed:
        letters = letters[:-1] + "}"
    inner = letters if closed else letters[1:-1]
    misplaced = set(inner) & set("{}z")
    if misplaced:
        raise InvalidInputError(f"types: {min(misplaced)} stands inside a path; each call takes one path")
    return _without_handles(own, letters, closed)


def _short(letters: str) -> str:
    return repr(letters if len(letters) <= 24 else letters[:12] + "…" + letters[-12:])


def _without_handles(points: FloatArray, letters: str, closed: bool) -> KnotPath:
    """Handles taken off the path."""
    n = len(letters)
    handles = np.full(n, np.nan)
    for i, letter in enumerate(letters):
        following = letters[(i + 1) % n] if closed else letters[min(i + 1, n - 1)]
        before = letters[i - 1]
        if letter == "a":
            if following != "h":
                raise InvalidInputError(f"types: the anchor a at {i} needs its handle h as the next point")
            step = points[(i + 1) % n] - points[i]
            if not step.any():
                raise InvalidInputError(f"points {i} and {(i + 1) % n} are the same; a handle gives a direction")
            handles[i] = np.arctan2(step[1], step[0])
        elif letter == "h" and before != "a":
            raise InvalidInputError(f"types: the handle h at {i} needs its anchor a as the point before")
    keep = np.array([letter != "h" for letter in letters])
    places = np.flatnonzero(keep)
    knots = points[keep]
    if len(knots) < 2:
        raise InvalidInputError("a path needs two knots besides its handles; add a point")
    following_knots = np.roll(knots, -1, axis=0) if closed else knots[1:]
    same = np.flatnonzero((following_knots == knots[: len(following_knots)]).all(axis=1))
    if same.size:
        hint = "; leave out the last point of a closed path" if closed and same[-1] == len(knots) - 1 else ""
        a, b = places[same[0]], places[(same[0] + 1) % len(knots)]
        raise InvalidInputError(f"points {a} and {b} are the same; leave one out{hint}")
    knots.setflags(write=False)
    return KnotPath(knots, letters.replace("h", ""), handles[keep], closed, places)


def runs(path: KnotPath) -> list[Run]:
    """The curved runs of a path: what lies between corners, ends, anchors and lines."""
    count = path.parameters()
    n, m = len(path.knots), path.segments
    letters = path.letters
    steps = np.roll(path.knots, -1, axis=0) - path.knots
    direction = np.arctan2(steps[:, 1], steps[:, 0])
    line: BoolArray = count == 0
    after = line if path.closed else np.append(line, False)
    before = np.roll(line, 1) if path.closed else np.append(False, line)
    own = np.array(list(letters))
    breaks = np.isin(own, list("v{}a")) | after | before
    if not breaks.any():
        return [Run(np.arange(m), letters, True)]
    cuts = np.flatnonzero(breaks)
    pairs = list(zip(cuts, [*cuts[1:], cuts[0] + n] if path.closed else cuts[1:], strict=False))
    out = []
    for i, j in pairs:
        if line[i % m]:
            continue
        segments = np.arange(i, j) % m
        inner = "".join(letters[k % n] for k in range(i + 1, j))
        start = _boundary(path, int(i), before, direction[(i - 1) % n], "]")
        end = _boundary(path, int(j) % n, after, direction[j % n], "[")
        out.append(Run(segments, inner, False, (start[0], end[0]), (start[1], end[1])))
    return out


def _boundary(path: KnotPath, knot: int, beside: BoolArray, line: float, letter: str) -> tuple[Boundary, float]:
    """What holds at a knot where a run ends; `beside`: whether a line is on the other side, `line`: its direction."""
    if path.letters[knot] == "a":
        return "line", float(path.handles[knot])
    if path.letters[knot] == letter and beside[knot]:
        return "line", float(line)
    return "free", 0.0
