"""Splines through the points of a file, as cubics in another: what `batten spline` does."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal, NamedTuple, get_args

import numpy as np

from batten.curves.base import Curve
from batten.curves.piecewise import PiecewiseCurve
from batten.curves.to_beziers import BezierPieces, to_beziers
from batten.errors import BattenError, InvalidInputError
from batten.io.bezier_paths import BezierPath
from batten.io.path_drawings import ENDINGS, write_paths
from batten.io.spline_reading import SplinePoints
from batten.splines.constrained_spline import constrained_spline
from batten.splines.interpolating_spline import interpolating_spline
from batten.splines.scale_invariant_spline import scale_invariant_spline
from batten.typing import FloatArray

SplineMethod = Literal[
    "euler", "mec", "log-aesthetic", "kurgla1", "hobby", "circle", "ikarus", "lagrange", "si-mec", "spiro"
]
SPLINE_METHODS: tuple[SplineMethod, ...] = get_args(SplineMethod)

WRITABLE = (*ENDINGS, ".glif", ".sfd")
"""The endings of files that `write_splines` knows."""

#: Of the size of a spline's points, where no tolerance is given.
_SHARE = 1e-4


class FairSpline(NamedTuple):
    """A spline through points.

    Attributes:
        given: its points. method: by which it was made.
        segments: one curve for each pair of neighbouring points.
        passed: (n, 2), the points that it passes through.
        status: "converged", "fallback" (Euler spirals in place of what was asked for), or what the spline says.
        message: what happened, in words; empty if nothing did.
    """

    given: SplinePoints
    method: SplineMethod
    segments: tuple[Curve, ...]
    passed: FloatArray
    status: str
    message: str


class DrawnSpline(NamedTuple):
    """A spline and the cubics that follow it."""

    spline: FairSpline
    cubics: BezierPieces


def fair_spline(given: SplinePoints, method: SplineMethod | None = None, *, fallback: bool = False) -> FairSpline:
    """The spline of one kind through points.

    Parameters:
        given: the points.
        method: None takes "spiro" for points with types and "euler" for others. Of types other methods honour corners (v)
            and the ends alone, and say so; handles are left out. "spiro" takes points without types as G⁴ (o).
        fallback: where there is none, the Euler spiral spline in its place.

    Raises:
        InvalidInputError: points that the method refuses. NoSolutionError: there is no such spline. The name comes first.
    """
    own: SplineMethod = method or ("spiro" if given.types else "euler")
    try:
        if own == "spiro":
            return _spiro(given)
        points, corners, ignored = _without_types(given)
        if own == "si-mec":
            if corners:
                raise InvalidInputError("method si-mec knows no corners; choose another, or give each part by itself")
            fair = scale_invariant_spline(points, closed=given.closed, start=given.start, end=given.end).spline
        else:
            fair = interpolating_spline(
                points,
                own,
                closed=given.closed,
                start=given.start,
                end=given.end,
                corners=corners,
                fallback=fallback,
            )
    except BattenError as error:
        raise type(error)(f"{given.name}: {error}") from error
    notes = [fair.message] if fair.message else []
    if ignored:
        notes.append(f"types {' '.join(ignored)} are kept for method spiro; {own} takes them as points")
    used = "fallback" if fair.method != own and own != "si-mec" else fair.status
    return FairSpline(given, own, fair.segments, fair.points, used, "; ".join(notes))


def _spiro(given: SplinePoints) -> FairSpline:
    types = given.types
    if not types:
        if given.start != "natural" or given.end != "natural":
            raise InvalidInputError("method spiro has free ends; leave start and end out, or choose another method")
        letters = ["v" if i in given.corners else "o" for i in range(len(given.points))]
        if not given.closed:
            letters[0], letters[-1] = "{", "}"
        types = "".join(letters)
    fair = constrained_spline(given.points, types + ("z" if given.closed else ""))
    return FairSpline(given, "spiro", fair.segments, fair.points, fair.status, fair.message)


def _without_types(given: SplinePoints) -> tuple[FloatArray, list[int], list[str]]:
    """The points that a spline passes through, its corners, and the letters that say more."""
    if not given.types:
        return given.points, list(given.corners), []
    kept = [i for i, letter in enumerate(given.types) if letter != "h"]
    corners = [k for k, i in enumerate(kept) if given.types[i] == "v"]
    return given.points[kept], corners, sorted(set(given.types) - set("ocv{}"))


def draw_splines(
    given: Sequence[SplinePoints],
    method: SplineMethod | None = None,
    *,
    tolerance: float | None = None,
    fallback: bool = False,
) -> list[DrawnSpline]:
    """The splines through points, and cubics that follow them.

    Parameters:
        given, method, fallback: as `fair_spline`.
        tolerance: greatest distance of the cubics from the spline, in the file's unit; None takes 1e-4 of the greater side
            of the box about all points.

    Raises:
        InvalidInputError, NoSolutionError: as `fair_spline`; a tolerance that is not above 0.

    Example:
        >>> arch = SplinePoints("arch", np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]]), False)
        >>> (drawn,) = draw_splines([arch], tolerance=1e-2)
        >>> len(drawn.cubics.pieces), drawn.cubics.distance < 1e-2
        (2, True)
    """
    if tolerance is not None and not (math.isfinite(tolerance) and tolerance > 0.0):
        raise InvalidInputError(f"--tolerance {tolerance:g}: allowed are finite numbers above 0; try 0.1")
    within = tolerance
    if within is None:
        within = _SHARE * float(np.ptp(np.concatenate([s.points for s in given]), axis=0).max())
    found = []
    for one in given:
        spline = fair_spline(one, method, fallback=fallback)
        curve = PiecewiseCurve(spline.segments)
        found.append(DrawnSpline(spline, to_beziers(curve, within)))
    return found


def closed_splines(given: Sequence[SplinePoints]) -> list[SplinePoints]:
    """The same splines, closed.

    Raises:
        InvalidInputError: one of them has types that say it is open.
    """
    out = []
    for one in given:
        if one.types and not one.closed:
            raise InvalidInputError(f"{one.name}: its types {one.types!r} say that it is open; leave out --closed")
        last = slice(None, -1) if (one.points[0] == one.points[-1]).all() and not one.closed else slice(None)
        out.append(replace(one, closed=True, points=one.points[last]))
    return out


def checked_target(source: Path, out: Path) -> Path:
    """The file to write, whose ending and folder are looked at before any work.

    Raises:
        InvalidInputError: an ending that cannot be written, .sfd from another format, no such folder, a folder.
    """
    if out.suffix.lower() not in WRITABLE:
        raise InvalidInputError(f"{out}: has the ending {out.suffix or 'none'}; allowed are {', '.join(WRITABLE)}")
    if out.suffix.lower() == ".sfd" and source.suffix.lower() != ".sfd":
        raise InvalidInputError(
            f"{out}: an SFD is written from an SFD alone, as everything else in it is kept; try .glif"
        )
    if out.suffix.lower() == ".glif" and source.suffix.lower() in (".sfd", ".ufo"):
        raise InvalidInputError(f"{out}: a .glif holds one glyph, {source} a font; give a .glif, or write .svg")
    if out.is_dir() or not out.parent.is_dir():
        what = "is a folder" if out.is_dir() else f"there is no folder {out.parent}"
        raise InvalidInputError(f"{out}: {what}; give the path of a file in a folder that exists")
    return out


def write_splines(drawn: Sequence[DrawnSpline], source: Path, out: Path) -> None:
    """Write the cubics; the ending says how. The file appears whole or not at all.

    Parameters:
        drawn: as `draw_splines`.
        source: the file that the points came from. A .sfd is written again with other curves; so is a .glif.
        out: .svg, .dxf, .3dm, .json (see `write_paths`), .glif (points with types in its lib), .sfd.

    Raises:
        InvalidInputError: as `checked_target`. OSError: the file cannot be written.
    """
    ending = checked_target(source, out).suffix.lower()
    if ending == ".sfd":
        from batten.io.sfd import SfdFile

        SfdFile(source).write([d.cubics.control_points for d in drawn], out)
    elif ending == ".glif":
        from batten.io.ufo import write_glyph

        kept = source if source.suffix.lower() == ".glif" else None
        write_glyph(out, [d.spline.given for d in drawn], [d.cubics for d in drawn], kept)
    else:
        write_paths([BezierPath(d.spline.given.name, d.cubics.control_points, d.cubics.closed) for d in drawn], out)


def spline_lines(drawn: Sequence[DrawnSpline], notes: Sequence[str] = ()) -> list[str]:
    """The table: a line for each spline, then what was left out and what each spline says.

    "halving" is the number of cubics that halving would need, "distance" the greatest from the spline, verified.
    """
    rows = [["spline", "points", "method", "cubics", "halving", "distance", "length", "status"]]
    for spline, cubics in drawn:
        length = sum(s.length for s in spline.segments)
        rows.append([
            spline.given.name, str(len(spline.passed)), spline.method, str(len(cubics.pieces)), str(cubics.halving_pieces),
            f"{cubics.distance:.3g}", f"{length:.6g}", spline.status,
        ])  # fmt: skip
    said = [f"{spline.given.name}: {spline.message}" for spline, _ in drawn if spline.message]
    return [*aligned(rows, (0, 2, 7)), *notes, *said]


def aligned(rows: Sequence[Sequence[str]], left: Sequence[int]) -> list[str]:
    """Rows of cells as lines of text; columns in `left` begin, others end, at the same place."""
    widths = [max(map(len, column)) for column in zip(*rows)]
    return [
        "  ".join(c.ljust(w) if k in left else c.rjust(w) for k, (c, w) in enumerate(zip(row, widths))).rstrip()
        for row in rows
    ]
