"""Every kind of spline through the same points: one picture and one table, as `batten compare-splines` makes them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from batten.curves.piecewise import PiecewiseCurve
from batten.curves.to_beziers import to_beziers
from batten.errors import BattenError, InvalidInputError
from batten.io.spline_files import SPLINE_METHODS, FairSpline, SplineMethod, aligned, fair_spline
from batten.io.spline_reading import SplinePoints
from batten.io.splines_figure import draw_with_comb
from batten.io.study_parts import written_file
from batten.studies.spline_measures import Fairness, curvature_and_slope, fairness

_COLUMNS = 3
_WIDTH = 3.6  # inches, of one picture
_TALLEST = 1.0  # of a picture's height over its width
_TEETH = 0.12  # length of the comb at nine tenths of all places, over the size of the points


class ComparedSplines(NamedTuple):
    """One kind of spline through the points of all splines of a file.

    Attributes:
        method: its name.
        splines: one for each; None where there is none.
        fair: (∫κ² ds, ∫κ′² ds, max |κ′|, share of segments with monotone curvature) over all that there are.
        jump: greatest jump of curvature at points that are no corners, times the mean chord.
        cubics: how many follow the splines within the tolerance.
        message: why there is none, or what is amiss.
    """

    method: SplineMethod
    splines: tuple[FairSpline | None, ...]
    fair: Fairness
    jump: float
    cubics: int
    message: str


def checked_picture(out: Path) -> Path:
    """The picture to write, whose ending and folder are looked at before any work.

    Raises:
        InvalidInputError: another ending than .svg and .png, no such folder, a folder.
    """
    if out.suffix.lower() not in (".svg", ".png"):
        raise InvalidInputError(f"{out}: has the ending {out.suffix or 'none'}; allowed are .svg, .png")
    if out.is_dir() or not out.parent.is_dir():
        what = "is a folder" if out.is_dir() else f"there is no folder {out.parent}"
        raise InvalidInputError(f"{out}: {what}; give the path of a file in a folder that exists")
    return out


def compare_all(given: Sequence[SplinePoints], tolerance: float | None = None) -> list[ComparedSplines]:
    """Every method through the same points. Where a method has no spline that is a result, not an error.

    Raises:
        InvalidInputError: a tolerance that is not above 0.
    """
    if tolerance is not None and not (np.isfinite(tolerance) and tolerance > 0.0):
        raise InvalidInputError(f"--tolerance {tolerance:g}: allowed are finite numbers above 0; try 0.1")
    within = 1e-4 * _size(given) if tolerance is None else tolerance
    return [_compared(given, method, within) for method in SPLINE_METHODS]


def _size(given: Sequence[SplinePoints]) -> float:
    return float(np.ptp(np.concatenate([s.points for s in given]), axis=0).max())


def _compared(given: Sequence[SplinePoints], method: SplineMethod, tolerance: float) -> ComparedSplines:
    splines: list[FairSpline | None] = []
    said: list[str] = []
    for one in given:
        try:
            splines.append(fair_spline(one, method))
        except BattenError as error:
            splines.append(None)
            said.append(str(error))
        else:
            last = splines[-1]
            said += [f"{one.name}: {last.message}"] if last is not None and last.message else []
    made = [s for s in splines if s is not None]
    fair = [fairness(cast(Any, s)) for s in made]  # it looks at the segments alone
    segments = [len(s.segments) for s in made]
    total = Fairness(
        sum(f.energy for f in fair),
        sum(f.variation for f in fair),
        max((f.steepest for f in fair), default=0.0),
        float(np.average([f.monotone for f in fair], weights=segments)) if fair else float("nan"),
    )
    cubics = sum(len(to_beziers(PiecewiseCurve(s.segments), tolerance).pieces) for s in made)
    return ComparedSplines(
        method, tuple(splines), total, max((_jump(s) for s in made), default=0.0), cubics, "; ".join(said)
    )


def _jump(spline: FairSpline) -> float:
    """Greatest jump of curvature where the tangent goes on, times the mean length of the segments."""
    pairs = list(itertools.pairwise(spline.segments))
    if spline.given.closed:
        pairs.append((spline.segments[-1], spline.segments[0]))
    worst = 0.0
    for before, after in pairs:
        a, b = before.derivative(1.0), after.derivative(0.0)
        if abs(float(np.angle(complex(*b) * complex(*a).conjugate()))) < 1e-6:
            ends = [curvature_and_slope(c, np.array([t]))[1][0] for c, t in ((before, 1.0), (after, 0.0))]
            worst = max(worst, abs(float(ends[1] - ends[0])))
    return worst * float(np.mean([s.length for s in spline.segments]))


def comparison_lines(rows: Sequence[ComparedSplines]) -> list[str]:
    """The table, and below it why a method has no spline.

    "jump" is the greatest jump of curvature times the mean length of a segment, "monotone" the share of segments whose
    curvature has no extreme inside; integrals and max |κ′| are in the file's unit.
    """
    table = [["method", "splines", "jump of κ", "∫κ²", "∫κ′²", "max |κ′|", "monotone", "cubics"]]
    for row in rows:
        count = sum(s is not None for s in row.splines)
        cells = ["–"] * 6
        if count:
            jump = f"{row.jump:.2g}" if row.jump > 1e-7 else "0"
            f = row.fair
            arcs = row.jump > 1e-7 and f.variation < 1e-12 * f.energy  # κ′ is 0 but at jumps of κ
            cells = [
                jump,
                f"{f.energy:.5g}",
                "jumps" if arcs else f"{f.variation:.5g}",
                "jumps" if arcs else f"{f.steepest:.3g}",
                f"{100 * f.monotone:.0f}%",
                str(row.cubics),
            ]
        table.append([row.method, f"{count} of {len(row.splines)}", *cells])
    return [*aligned(table, (0,)), *(f"{row.method}: {row.message}" for row in rows if row.message)]


def comparison_figure(rows: Sequence[ComparedSplines]) -> Figure:
    """A picture for each method, with curvature combs of one scale on the right of the curves."""
    given = [s.given for s in next(r.splines for r in rows if all(r.splines)) if s is not None]
    corners = np.concatenate([s.points for s in given])
    size = _size(given)
    scale = _TEETH * size / _usual_curvature(rows)
    low, high = corners.min(axis=0) - 0.3 * size, corners.max(axis=0) + 0.3 * size
    shape = min(float((high - low)[1] / (high - low)[0]), _TALLEST)
    lines = -(-len(rows) // _COLUMNS)
    figure = Figure(figsize=(_COLUMNS * _WIDTH, lines * (_WIDTH * shape + 0.35)), layout="constrained")
    FigureCanvasAgg(figure)
    for axes in figure.subplots(lines, _COLUMNS, squeeze=False).ravel()[len(rows) :]:
        axes.axis("off")
    for axes, row in zip(figure.axes, rows):
        for one, spline in zip(given, row.splines):
            if spline is None:
                axes.plot(*one.points.T, "o", color="#222222", markersize=3.5)
                x, y = one.points.mean(axis=0).tolist()
                axes.text(x, y, "none", ha="center", va="center", color="#888888")
            else:
                draw_with_comb(axes, cast(Any, _Drawable(spline)), np.zeros(2), scale)
        axes.set_title(row.method, fontsize=10)
        axes.set_aspect("equal")
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.axis("off")
    return figure


class _Drawable:
    """What `draw_with_comb` looks at."""

    def __init__(self, spline: FairSpline) -> None:
        self.segments, self.points = spline.segments, spline.passed


def _usual_curvature(rows: Sequence[ComparedSplines]) -> float:
    """The |κ| that nine tenths of all places stay below."""
    t = np.linspace(0.02, 0.98, 17)
    every = [
        np.abs(curvature_and_slope(segment, t)[1])
        for row in rows
        for spline in row.splines
        if spline is not None
        for segment in spline.segments
    ]
    value = float(np.quantile(np.concatenate(every), 0.9))
    return value if value > 0.0 else 1.0


def write_comparison(rows: Sequence[ComparedSplines], out: Path) -> None:
    """Write the picture, .svg or .png; it appears whole or not at all, and is the same for the same points."""
    kind = out.suffix.lower()[1:]
    bare: dict[str, Any] = {"Software": None} if kind == "png" else {"Date": None, "Creator": None}
    with matplotlib.rc_context({"svg.hashsalt": "batten"}):
        figure = comparison_figure(rows)
        written_file(out, lambda file: figure.savefig(file, format=kind, dpi=150, metadata=bare))
