"""Makes teapot.3dm, wing.3dm and bow.3dm, the inputs of the jobs in this folder; ORIGIN.md says whose their data are.

python examples/rationalise/make_inputs.py [FOLDER]
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
from scipy.interpolate import NdBSpline, make_interp_spline, make_smoothing_spline
from scipy.optimize import brentq

from batten.io.rhino import rhino_surface
from batten.io.rhino_curves import Drawing
from batten.surfaces.bspline_basis import greville
from batten.surfaces.bspline_surface import BSplineSurface

HERE = Path(__file__).resolve().parent

TEAPOT_MM = 750.0  # for a unit of Newell's, so that the body is 3 m across

CAMBER, CAMBER_AT, THICKNESS = 0.04, 0.4, 0.15  # NACA 4415
WING_SPAN_MM = 3000.0
ROOT_MM, TAPER_MM = 1800.0, (-200.0, -500.0)  # chord at the root, and how it changes with v and v²
SWEEP_MM, DIHEDRAL_MM = (150.0, 550.0), (60.0, 240.0)  # of the quarter chord, the same way
SECTION_SPANS = 24  # each side of the highest camber

ROUNDING_MM = 1.0 / np.sqrt(12.0)  # root mean square of what rounding to whole mm takes from the table


def teapot() -> dict[str, BSplineSurface]:
    """Rim and body: each four quarters round, and as many patches down as it has, with Newell's Béziers as they are."""
    rows = np.loadtxt(HERE / "teapot-body.txt").reshape(12, 4, 4, 3) * TEAPOT_MM
    return {
        "rim": _rings(rows[None, :4], [0.0, 1.0]),
        "body": _rings(rows[4:].reshape(2, 4, 4, 4, 3), [0.0, 1.0, 2.0]),
    }


def _rings(patches: np.ndarray, knots_v: list[float]) -> BSplineSurface:
    """One surface of rings of four patches each, (rings, 4, down, round, 3); u goes round, v down."""
    rings, quarters = patches.shape[:2]
    net = np.empty((3 * quarters + 1, 3 * rings + 1, 3))
    for ring in range(rings):
        for quarter in range(quarters):
            net[3 * quarter : 3 * quarter + 4, 3 * ring : 3 * ring + 4] = patches[ring, quarter].transpose(1, 0, 2)
    return BSplineSurface(_joined_knots(np.arange(5.0)), _joined_knots(knots_v), 3, 3, net)


def _joined_knots(places) -> np.ndarray:
    """Knots of cubic Béziers side by side."""
    return np.concatenate([places[:1], np.repeat(places, 3), places[-1:]])


def naca_section(x, side: int) -> np.ndarray:
    """Points (…, 2) of the NACA four-digit section of chord 1, at x along the chord; `side` is 1 above and −1 below.

    Thickness across the camber line, by Jacobs, Ward and Pinkerton (NACA report 460, 1933), with the last coefficient that
    closes the trailing edge, −0.1036.
    """
    x = np.asarray(x, dtype=float)
    m, p = CAMBER, CAMBER_AT
    half = THICKNESS / 0.2 * (0.2969 * np.sqrt(x) - 0.1260 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4)
    front = x < p
    line = np.where(front, m / p**2 * (2 * p * x - x**2), m / (1 - p) ** 2 * (1 - 2 * p + 2 * p * x - x**2))
    slope = np.where(front, 2 * m / p**2 * (p - x), 2 * m / (1 - p) ** 2 * (p - x))
    steep = np.sqrt(1 + slope**2)
    return np.stack([x - side * half * slope / steep, line + side * half / steep], axis=-1)


def wing() -> dict[str, BSplineSurface]:
    """Upper and lower side; u runs from the leading edge with x = u², v from the root to the tip.

    The section is a quintic spline through points of the formula. Where the two parabolas of the camber line meet, the
    formula has a corner of 0.05°; there the spline is C¹, with close knots around it. Chord, sweep and dihedral are
    parabolas of v, so the surface has degree 2 along the span, exactly.
    """
    sides = {}
    for name, side in (("upper", 1), ("lower", -1)):
        knee = np.sqrt(CAMBER_AT)
        even = np.concatenate([np.linspace(0, knee, SECTION_SPANS + 1), np.linspace(knee, 1, SECTION_SPANS + 1)[1:]])
        near = knee + np.array([-0.25, 0.25]) * (1 - knee) / SECTION_SPANS
        knots = np.sort(np.concatenate([np.zeros(5), even, near, [knee] * 3, np.ones(5)]))
        u = greville(knots, 5)
        section = make_interp_spline(u, naca_section(u**2, side), k=5, t=knots).c
        net = np.empty((len(section), 3, 3))
        chord, shift, lift = (_bernstein(c) for c in ((ROOT_MM, *TAPER_MM), (0, *SWEEP_MM), (0, *DIHEDRAL_MM)))
        net[..., 0] = (section[:, :1] - 0.25) * chord + shift + 0.25 * ROOT_MM
        net[..., 1] = WING_SPAN_MM * np.array([0.0, 0.5, 1.0])
        net[..., 2] = section[:, 1:] * chord + lift
        sides[name] = BSplineSurface(knots, np.array([0.0, 0, 0, 1, 1, 1]), 5, 2, net)
    return sides


def _bernstein(powers) -> np.ndarray:
    """Bézier coefficients of a + b v + c v²."""
    a, b, c = powers
    return np.array([a, a + b / 2, a + b + c])


def bow() -> dict[str, BSplineSurface]:
    """The starboard side, y the half-breadth over stations x and waterlines z: the table of offsets, faired.

    Cubic smoothing splines along the waterlines and then along the stations, as smooth as they can be when their root mean
    square distance from the table is that of its rounding.
    """
    stations, waterlines, offsets = read_offsets(HERE / "bow-offsets.csv")

    def faired(stiffness: float):
        along = make_smoothing_spline(stations, offsets, lam=10**stiffness * 1e9, axis=0)
        up = make_smoothing_spline(waterlines, along.c, lam=10**stiffness * 1e9, axis=1)
        return along.t, up.t, up.c.T

    def excess(stiffness: float) -> float:
        return _root_mean_square(faired(stiffness), stations, waterlines, offsets) - ROUNDING_MM

    knots_x, knots_z, heights = faired(brentq(excess, -12.0, 3.0, xtol=0.01))
    x, z = greville(knots_x, 3), greville(knots_z, 3)
    net = np.stack([*np.broadcast_arrays(x[:, None], heights), np.broadcast_to(z, heights.shape)], axis=-1)
    return {"hull": BSplineSurface(knots_x, knots_z, 3, 3, net)}


def _root_mean_square(spline, stations, waterlines, offsets) -> float:
    """Of the differences between the table and a spline of two variables."""
    knots_x, knots_z, heights = spline
    places = np.stack(np.meshgrid(stations, waterlines, indexing="ij"), axis=-1)
    return float(np.sqrt(np.mean((NdBSpline((knots_x, knots_z), heights, k=3)(places) - offsets) ** 2)))


def read_offsets(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stations, waterlines, and half-breadths (stations, waterlines), mm."""
    with path.open(encoding="utf-8", newline="") as stream:
        rows = [row for row in csv.reader(stream) if row and not row[0].startswith("#")]
    table = np.array([[float(cell) for cell in row] for row in rows[1:]])
    return table[:, 0], np.array([float(cell) for cell in rows[0][1:]]), table[:, 1:]


def write(path: Path, surfaces: dict[str, BSplineSurface]) -> None:
    """Surfaces as a .3dm file in mm, each on a layer with its name."""
    draw = Drawing(dict.fromkeys(surfaces, (90, 120, 150)), "mm")
    for name, surface in surfaces.items():
        draw.add(name, name, rhino_surface(surface), {})
    draw.write(path)


def main(folder: Path) -> None:
    for name, surfaces in (("teapot", teapot()), ("wing", wing()), ("bow", bow())):
        write(folder / f"{name}.3dm", surfaces)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
