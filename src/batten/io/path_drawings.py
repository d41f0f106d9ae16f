"""Paths of cubics as a new drawing: .svg, .dxf, .3dm or .json with nothing else in it."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from batten.errors import InvalidInputError
from batten.io.bezier_paths import BezierPath, json_text
from batten.io.study_parts import written_file
from batten.typing import FloatArray


def write_paths(paths: Sequence[BezierPath], out: Path) -> None:
    """Write paths into a new file; its ending says how. Curves alone: no styles, no layers, no unit.

    Parameters:
        paths: one or more, y up.
        out: .svg (paths of cubics, y turned down), .dxf (splines), .3dm (NURBS in the plane z = 0) or .json (see
            `JsonPaths`); it appears whole or not at all.

    Raises:
        InvalidInputError: another ending, or no paths.
        OSError: the file cannot be written.

    Accuracy: .json bit by bit, .dxf and .3dm all digits, .svg to 1e-12 of the drawing's extent.

    Example:
        >>> import tempfile
        >>> arch = BezierPath("arch", np.array([[(0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0)]]), False)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     write_paths([arch], Path(folder) / "arch.svg")
        ...     "M0,0C0,-1 1,-1 1,0" in (Path(folder) / "arch.svg").read_text()
        True
    """
    writer = _WRITERS.get(out.suffix.lower())
    if writer is None:
        raise InvalidInputError(f"{out}: has the ending {out.suffix or 'none'}; allowed are {', '.join(_WRITERS)}")
    if not paths:
        raise InvalidInputError("no paths: there is nothing to draw; give one or more")
    writer(paths, out)


def _write_json(paths: Sequence[BezierPath], out: Path) -> None:
    rows = [{"name": p.name, "closed": p.closed, "points": _chain(p.control_points).tolist()} for p in paths]
    text = json_text({"paths": rows})
    written_file(out, lambda file: file.write(text.encode()))


def _write_svg(paths: Sequence[BezierPath], out: Path) -> None:
    corners = np.concatenate([p.control_points.reshape(-1, 2) for p in paths]) * (1.0, -1.0)
    extent = float(np.ptp(corners, axis=0).max()) or 1.0
    low = corners.min(axis=0) - 0.05 * extent
    size = corners.max(axis=0) + 0.05 * extent - low
    rows = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{" ".join(f"{v:.9g}" for v in (*low, *size))}">',
        f'<g fill="none" stroke="black" stroke-width="{0.004 * extent:.6g}">',
    ]
    step = 1e-12 * extent
    for path in paths:
        x, *more = [f"{_number(float(p[0]), step)},{_number(-float(p[1]), step)}" for p in _chain(path.control_points)]
        cubics = "".join("C" + " ".join(more[i : i + 3]) for i in range(0, len(more), 3))
        rows.append(f'<path d="M{x}{cubics}{"Z" if path.closed else ""}"><title>{escape(path.name)}</title></path>')
    text = "\n".join([*rows, "</g>", "</svg>", ""])
    written_file(out, lambda file: file.write(text.encode()))


def _write_dxf(paths: Sequence[BezierPath], out: Path) -> None:
    import ezdxf as _ezdxf

    ezdxf: Any = _ezdxf
    fixed = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True  # no date, no random identifiers
    try:
        document = ezdxf.new("R2010")
        document.appids.add("BATTEN")
        for path in paths:
            spline = document.modelspace().add_spline(degree=3)
            spline.control_points = [(float(x), float(y), 0.0) for x, y in _chain(path.control_points)]
            spline.knots = [0.0, *_knots(len(path.control_points)), float(len(path.control_points))]
            spline.set_xdata("BATTEN", [(1000, path.name[:255])])
        text = io.StringIO()
        document.write(text)
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = fixed
    written_file(out, lambda file: file.write(text.getvalue().encode()))


def _write_3dm(paths: Sequence[BezierPath], out: Path) -> None:
    from batten.io.rhino_curves import Drawing, rhino3dm

    draw = Drawing({"paths": (0, 90, 200)}, None)
    for path in paths:
        points = [rhino3dm.Point3d(float(x), float(y), 0.0) for x, y in _chain(path.control_points)]
        curve = rhino3dm.NurbsCurve.CreateControlPointCurve(points, 3)
        for i, knot in enumerate(_knots(len(path.control_points))):
            curve.Knots[i] = knot
        draw.add("paths", path.name, curve, {})
    draw.write(out)


def _knots(count: int) -> list[float]:
    """Rhino's knots of so many Béziers end to end: 0, 0, 0, 1, 1, 1, …"""
    return [float(i) for i in range(count + 1) for _ in range(3)]


def _chain(cubics: FloatArray) -> FloatArray:
    """The 3 n + 1 points of n cubics."""
    return np.concatenate([cubics[0, :1], cubics[:, 1:].reshape(-1, 2)])


def _number(value: float, step: float) -> str:
    """A value to the nearest multiple of a power of ten below the step."""
    text = f"{value:.{max(0, int(np.ceil(-np.log10(step))))}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text in ("-0", "") else text


_WRITERS: dict[str, Callable[[Sequence[BezierPath], Path], None]] = {
    ".svg": _write_svg,
    ".dxf": _write_dxf,
    ".3dm": _write_3dm,
    ".json": _write_json,
}
ENDINGS = tuple(_WRITERS)
"""The endings that `write_paths` knows."""
