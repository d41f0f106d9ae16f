"""Moreton1995, computed again: tables and pictures of docs/minimum-curves.md.

python examples/minimum_curves.py          writes docs/minimum-curves.md and docs/pictures/minimum_curves_*.png
"""

from __future__ import annotations

from pathlib import Path
from time import perf_counter

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from batten.splines.interpolating_spline import interpolating_spline
from batten.splines.minimum_curve import ENERGIES, MinimumCurve, minimum_closed_curve, minimum_curve
from batten.splines.scale_invariant_spline import scale_invariant_spline

DOCS = Path(__file__).resolve().parents[1] / "docs"
BLUE, RED, INK, SOFT = "#1f4fa3", "#d03a2b", "#1c2733", "#66727f"
DPI = 110

# C. H. Woodford, Smooth curve interpolation, BIT 9 (1969); Moreton1995 does not print the points: from public copies.
WOODFORD = np.array([[0, 0], [1, 1.9], [2, 2.7], [3, 2.6], [4, 1.6], [5, 0.89], [6, 1.2]])
ZIGZAG = np.array([[0.0, 0.0], [1.0, 0.6], [2.2, 0.2], [3.0, 1.0], [4.0, 0.8]])
ANGLE = 2.0 * np.pi * np.arange(3) / 3
TRIANGLE = np.stack([np.cos(ANGLE), np.sin(ANGLE)], axis=1)
LEANING = ANGLE + np.pi / 2 + np.array([0.5, -0.3, 0.3])  # tangents that no circle has
EIGHT = np.array([[-2.0, 0.0], [0.0, 0.0], [2.0, 0.0], [0.0, 0.0]])
LOP_SIDED = np.array([1.2, -0.4, 1.9, 2.6])
HORN = np.array([[-1.0, 0.0], [1.0, 0.0]])


class Fourier:
    """Σ c_k exp(2πikt) as a closed curve."""

    def __init__(self, terms: dict[int, float]) -> None:
        self.terms = terms

    def _sum(self, t, order):
        t = np.asarray(t, dtype=float)
        z = sum(c * (2j * np.pi * k) ** order * np.exp(2j * np.pi * k * t) for k, c in self.terms.items())
        return np.stack([z.real, z.imag], axis=-1)

    def point(self, t):
        return self._sum(t, 0)

    def derivative(self, t, order=1):
        return self._sum(t, order)

    @property
    def length(self) -> float:
        return float(np.hypot(*self._sum(np.arange(4096) / 4096, 1).T).mean())

    def breaks(self):
        return np.array([0.0, 1.0])


class WithCircle:
    """A closed curve that runs once more through the circle of curvature where its curvature is greatest."""

    def __init__(self, lemnoid: MinimumCurve) -> None:
        from batten.curves.arc_length import ArcLength

        self.ruler = ArcLength.of(lemnoid.curve)
        t = np.linspace(0.0, 1.0, 6401)[:-1]
        d, dd = lemnoid.curve.derivative(t), lemnoid.curve.derivative(t, 2)
        kappa = (d[:, 0] * dd[:, 1] - d[:, 1] * dd[:, 0]) / np.hypot(*d.T) ** 3
        crest = int(np.argmax(kappa))
        self.radius = 1.0 / kappa[crest]
        self.angle = float(np.arctan2(d[crest, 1], d[crest, 0]))
        self.first = float(self.ruler.fraction_at(t[crest]))
        self.centre = lemnoid.curve.point(t[crest]) + self.radius * self._normal(self.angle)
        self.length = self.ruler.length + 2.0 * np.pi * self.radius

    @staticmethod
    def _normal(angle):
        return np.stack([-np.sin(angle), np.cos(angle)], axis=-1)

    def point(self, t):
        return self._at(t, 0)

    def derivative(self, t, order=1):
        return self._at(t, order)

    def breaks(self):
        return np.array([0.0, self.ruler.length / self.length, 1.0])

    def _at(self, t, order):
        s = np.asarray(t, dtype=float) * self.length
        outside = (s < self.ruler.length)[..., None]
        u = self.ruler.parameter_at((self.first + np.minimum(s, self.ruler.length) / self.ruler.length) % 1.0)
        angle = self.angle + (s - self.ruler.length) / self.radius
        normal, tangent = self._normal(angle), np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        d, dd = self.ruler.curve.derivative(u), self.ruler.curve.derivative(u, 2)
        square = (d * d).sum(axis=-1, keepdims=True)
        if order == 0:
            return np.where(outside, self.ruler.curve.point(u), self.centre - self.radius * normal)
        if order == 1:
            return self.length * np.where(outside, d / np.sqrt(square), tangent)
        bend = dd / square - d * (d * dd).sum(axis=-1, keepdims=True) / square**2
        return self.length**2 * np.where(outside, bend, normal / self.radius)


# --- the page ---


def timed(make):
    begin = perf_counter()
    made = make()
    return made, perf_counter() - begin


def row(name: str, made: MinimumCurve, seconds: float) -> str:
    status = made.status if made.status != "converged" else "minimum" if made.minimum else "stationary"
    return (
        f"| {name} | {made.length:.5f} | {made.bending:.5f} | {made.scale_invariant_bending:.5f} | {made.variation:.5g} "
        f"| {made.scale_invariant_variation:.6g} | {made.turning:.3f} | {status} | {made.iterations} | {1e3 * seconds:.0f} |"
    )


HEAD = "| | L | ∫κ² | L∫κ² | ∫κ′² | L³∫κ′² | turns | ended as | steps | ms |\n" + "|---" * 10 + "|\n"


def table(make) -> tuple[str, dict[str, MinimumCurve]]:
    """A row for each energy."""
    rows, curves = [], {}
    for energy in ENERGIES:
        made, seconds = timed(lambda e=energy: make(e))
        curves[energy] = made
        rows.append(row(energy, made, seconds))
    return HEAD + "\n".join(rows) + "\n", curves


def convergence() -> str:
    """Relative errors of the energy by the number of elements between points."""
    counts = (1, 2, 4, 8)
    lines = ["| points | energy | reference | " + " | ".join(map(str, counts)) + " | order, first |", "|---" * 8 + "|"]
    for name, points in (("zigzag", ZIGZAG), ("Woodford", WOODFORD)):
        for energy in ENERGIES:
            if (name, energy) == ("zigzag", "mvc"):
                continue  # escapes
            value = [minimum_curve(points, energy, elements=n).energy for n in counts]
            exact, source = minimum_curve(points, energy, elements=16).energy, "16 elements"
            if energy == "mec":
                exact, source = interpolating_spline(points, "mec").bending_energy(), "exact elastica"
            elif energy == "si-mec":
                exact, source = scale_invariant_spline(points).scale_invariant_energy, "exact elastica"
            error = np.array(value) / exact - 1.0
            cells = " | ".join(f"{e:.0e}" for e in error)
            order = np.log2(error[0] / error[1]) if error[1] > 0.0 else np.inf
            lines.append(f"| {name} | {energy} | {source} | {cells} | {order:.1f} |")
    return "\n".join(lines) + "\n"


def methods() -> str:
    """Newton against conjugate gradients, two elements between Woodford's points."""
    lines = ["| energy | method | ended as | energy reached | steps | evaluations | ms |", "|---" * 7 + "|"]
    for energy in ENERGIES:
        for method in ("newton", "cg"):
            made, seconds = timed(lambda e=energy, m=method: minimum_curve(WOODFORD, e, elements=2, method=m))
            lines.append(
                f"| {energy} | {method} | {made.status} | {made.energy:.9g} | {made.iterations} | {made.evaluations} "
                f"| {1e3 * seconds:.0f} |"
            )
    return "\n".join(lines) + "\n"


def draw(name: str, panels: list[tuple[str, MinimumCurve, np.ndarray | None]]) -> None:
    """Curves with combs of curvature, as wide as the paper's fins: κ times length."""
    figure = Figure(figsize=(3.0 * len(panels), 3.1))
    FigureCanvasAgg(figure)
    for k, (title, made, points) in enumerate(panels):
        axes = figure.add_subplot(1, len(panels), k + 1)
        t = np.linspace(0.0, 1.0, 1201)[:-1] + 1e-9
        p, d, dd = made.curve.point(t), made.curve.derivative(t), made.curve.derivative(t, 2)
        speed = np.hypot(*d.T)
        kappa = (d[:, 0] * dd[:, 1] - d[:, 1] * dd[:, 0]) / speed**3
        size = float(np.ptp(p, axis=0).max())
        normal = np.stack([d[:, 1], -d[:, 0]], axis=1) / speed[:, None]
        tip = p + normal * (0.25 * size * kappa / np.abs(kappa).max())[:, None]
        axes.plot(*np.stack([p, tip, np.full_like(p, np.nan)], axis=1)[::6].reshape(-1, 2).T, color=BLUE, lw=0.4)
        axes.plot(*tip.T, color=BLUE, lw=0.6)
        axes.plot(*p.T, color=INK, lw=1.6)
        if points is not None:
            axes.plot(*points.T, "o", color=RED, ms=4)
        axes.set_title(f"{title}{'' if made.status == 'converged' else ': ' + made.status}", fontsize=9, color=SOFT)
        axes.set_aspect("equal")
        axes.axis("off")
    figure.subplots_adjust(left=0.01, right=0.99, bottom=0.02, top=0.9)
    figure.savefig(DOCS / "pictures" / f"minimum_curves_{name}.png", dpi=DPI)


def closed_rows() -> tuple[str, list[tuple[str, MinimumCurve, np.ndarray | None]]]:
    """Closed curves without points, by turning number."""
    starts = {
        "ellipse": Fourier({1: 2.0, -1: 0.8}),
        "limaçon": Fourier({1: 0.6, 2: 1.0}),
        "figure-eight": Fourier({1: 1.0, -1: 1.0, 2: 0.5, -2: -0.5, 3: 0.1, -3: 0.05}),
    }
    rows, panels = [], []
    for name, start in starts.items():
        for energy in ENERGIES:
            made, seconds = timed(lambda s=start, e=energy: minimum_closed_curve(s, e, elements=24))
            rows.append(row(f"{name}, {energy}", made, seconds))
            if energy == "si-mvc":
                panels.append((f"from {name}", made, None))
    lemnoid = minimum_closed_curve(starts["figure-eight"], "si-mvc", elements=32)
    made, seconds = timed(lambda: minimum_closed_curve(WithCircle(lemnoid), "si-mvc", elements=32))
    rows.append(row("lemnoid with inner circle, si-mvc", made, seconds))
    panels.append(("with inner circle", made, None))
    return HEAD + "\n".join(rows) + "\n", panels


def main() -> None:
    minimum_curve(WOODFORD, "mvc", elements=1)  # compile
    horn, horns = table(lambda e: minimum_curve(HORN, e, tangents=[np.pi / 2, -np.pi / 2]))
    opened, _ = table(lambda e: minimum_curve(HORN, e, tangents=[np.pi / 2 + 0.1, -np.pi / 2 - 0.1], elements=4))
    leaning, leanings = table(lambda e: minimum_curve(TRIANGLE, e, closed=True, tangents=LEANING))
    even, _ = table(lambda e: minimum_curve(TRIANGLE, e, closed=True))
    flat, _ = table(lambda e: minimum_curve([[0, 0], [4, 0], [2, 0.5]], e, closed=True, elements=4))
    data, datas = table(lambda e: minimum_curve(WOODFORD, e))
    eight, eights = table(lambda e: minimum_curve(EIGHT, e, closed=True, start_angles=LOP_SIDED, elements=8))
    closed, panels = closed_rows()
    draw("horn", [(e, c, HORN) for e, c in horns.items()])
    draw("three", [(e, c, TRIANGLE) for e, c in leanings.items()])
    draw("woodford", [(e, c, WOODFORD) for e, c in datas.items()])
    draw("eight", [(e, c, EIGHT) for e, c in eights.items()])
    draw("closed", panels)
    page = DOCS / "minimum-curves.md"
    page.write_text(
        TEXT.format(
            horn=horn, opened=opened, leaning=leaning, even=even, flat=flat, data=data, eight=eight, closed=closed,
            convergence=convergence(), methods=methods(),
        ),
        encoding="utf-8",
    )  # fmt: skip


TEXT = """# Minimum curves

Moreton1995: MEC (least ∫κ² ds), MVC (least ∫κ′² ds) and their scale-invariant forms SI-MEC (L∫κ² ds) and SI-MVC
(L³∫κ′² ds), by `splines.minimum_curve`. Written by `python examples/minimum_curves.py`;
tests in `tests/splines/test_minimum_curve.py`. "Escaped" rows are those that the paper prints in grey: there is no
minimum, and the figures are those of the shape at which that was noticed. "Stationary": the descent has settled, but the
Hessian has a slightly negative direction there. Times are of one core of the machine that wrote the page, and say no more
than an order of magnitude.

## Two points with parallel tangents (Fig. 1, Horn's case)

![](pictures/minimum_curves_horn.png)

{horn}
All but the MEC give the half circle. The MEC's minimum is a level place only (docs/levien-figures.md), and is reached
slowly. Opened by 0.1 rad at both ends:

{opened}
## Three points

With tangents that no circle has, as in Fig. 3 (the paper does not give its points; these are an equilateral triangle with
tangents off the circle by 0.5, −0.3 and 0.3 rad):

![](pictures/minimum_curves_three.png)

{leaning}
As in Fig. 3 the curvature of the MEC and SI-MEC jumps at the points, and each curve is the best in its own column but for
∫κ′² of those two, in which the jumps do not count. Without tangents, equilateral:

{even}
A flat triangle, (0, 0), (4, 0), (2, ½):

{flat}
## Woodford's data (Fig. 4)

![](pictures/minimum_curves_woodford.png)

{data}
## The lop-sided figure-eight (Fig. 5)

Through (−2, 0), (0, 0), (2, 0), (0, 0), started with tangents at 1.2, −0.4, 1.9 and 2.6 rad.

![](pictures/minimum_curves_eight.png)

{eight}
The paper's values of what is least are 112.44187 (SI-MEC) and 4501.25 (SI-MVC), from descents stopped early.

## Closed curves without points (§5)

![](pictures/minimum_curves_closed.png)

{closed}
## How many elements

Relative error of the energy by the number of elements between two points. For MVC and SI-MVC the reference is 16 elements,
good to about 1e-10. The energy of Newton's method is that of a curve whose parameter is held, by 1e-7 of the energy: below
1e-10 the columns show that term and where the descent ends.

{convergence}
The zigzag has no MVC: it escapes, by Newton's method and by conjugate gradients, as §2 says of curves with an inflection
between points that turn by much.

## Newton's method and conjugate gradients

Woodford's data, two elements between points; conjugate gradients end after 5000 steps at the latest.

{methods}
## What differs from the paper

- Fig. 5, SI-MVC: 4498.589 is the minimum; 4501.25 is 0.06 % above it.
- §3: elements meet with curvature for the MEC too, save at points with a given tangent, where its curvature jumps.
- The SI-MEC from a lemnoid with inner circle unwinds (§5.2), but its elements meet a cusp on the way: "iteration limit".
"""

if __name__ == "__main__":
    main()
