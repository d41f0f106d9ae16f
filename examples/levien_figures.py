"""Levien2009, Figs. 3.10, 3.13, 3.15, 3.16 and 3.17, computed again: tables and pictures of docs/levien-figures.md.

python examples/levien_figures.py          writes docs/levien-figures.md and docs/pictures/levien_3_*.png

The curves of given length come from the solver for held ends, those of free length from `solvers.angle_constrained`.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from batten.curves.elastica import Elastica
from batten.solvers.angle_constrained import (
    SlidingSolution,
    levien_ends,
    mec_exists,
    minimum_energy_curves,
    minimum_energy_envelope,
    scale_invariant_curves,
    scale_invariant_envelope,
)
from batten.solvers.boundary_value import solve_boundary_batch

DOCS = Path(__file__).resolve().parents[1] / "docs"
BLUE, RED, GREEN, INK, SOFT = "#1f4fa3", "#d03a2b", "#2c9c4b", "#1c2733", "#66727f"
DPI = 110
CHORDS = np.concatenate([[0.002], np.linspace(0.01, 0.93, 93)])
NEAR = np.concatenate([-np.geomspace(0.009, 1e-4, 8), np.geomspace(1e-4, 0.009, 8)])  # around the corner of λ
TABLE = np.array([0.0001, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 2 / np.pi, 0.7, 0.8, 0.9, 0.93])
EIGHTH = np.pi / 8


class Row(NamedTuple):
    """The rod of length 1 with its ends at a given distance that has the least energy among the symmetric ones."""

    chord: float
    levien: float
    mec: float
    si_mec: float
    inflections: int
    elastica: Elastica


def levien_lambda(elastica: Elastica) -> float:
    """Levien's λ = 1/(4k²) (Levien2009 §3.3): 0 for the circle, ¼ at k = 1, ½ for the rectangular elastica."""
    x, y = elastica.force
    force = float(np.hypot(x, y))
    along = x * np.cos(elastica.start_angle) + y * np.sin(elastica.start_angle)
    return force / (elastica.start_curvature**2 + 2.0 * (force - along)) if force > 0.0 else 0.0


def row_of(chord: float, elastica: Elastica) -> Row:
    """`Row` of a curve of length 1."""
    energy = elastica.bending_energy()
    inside = elastica.inflections()
    count = int(np.count_nonzero((inside > 1e-7) & (inside < 1.0 - 1e-7)))
    return Row(chord, levien_lambda(elastica), energy * chord, energy, count, elastica)


def by_chord(left: float, right: float, chords: np.ndarray) -> list[Row]:
    """Rods of length 1 between tangents at ±left = ±right to the chord, symmetric as their tangents are."""
    ends = np.column_stack([chords, np.zeros_like(chords)])
    batch = solve_boundary_batch((0.0, 0.0), left, ends, -right, 1.0, max_inflections=3, stability=False, workers=2)
    rows = []
    for i, chord in enumerate(chords):
        for j in range(batch.count[i]):  # by energy
            curve = Elastica.from_parameters(batch.parameters[i, j])
            first, last = curve.curvature_at([0.0, 1.0])
            if abs(first - np.sign(left * right) * last) < 1e-4 * (1.0 + abs(first)):
                rows.append(row_of(float(chord), curve))
                break
    return rows


def unit(solution: SlidingSolution) -> Row:
    """A solution with free length as the rod of length 1."""
    curve, size = solution.elastica, solution.elastica.length
    one = Elastica(curve.start, curve.start_angle, curve.start_curvature * size, curve.force * size**2, 1.0)
    return row_of(1.0 / size, one)


def marked(left: float, right: float) -> tuple[Row, Row]:
    """The MEC and the SI-MEC."""
    ends = levien_ends(left, right)
    return unit(minimum_energy_curves(*ends)[0]), unit(scale_invariant_curves(*ends)[0])


def drawn(left: float, right: float) -> list[Row]:
    """Rows of a picture's lines, closer around the SI-MEC, where λ has a corner for an arch."""
    _, corner = marked(left, right)
    rows = by_chord(left, right, np.sort(np.concatenate([CHORDS, corner.chord + NEAR])))
    return sorted([*rows, corner], key=lambda row: row.chord)


def table_of(left: float, right: float) -> list[tuple[str, Row]]:
    """Rows of a table, with what is special about them."""
    mec, si_mec = marked(left, right)
    rows = [("", row) for row in by_chord(left, right, TABLE)]
    rows = [(n, r) for n, r in rows if abs(r.chord - mec.chord) > 1e-6 < abs(r.chord - si_mec.chord)]
    return sorted([*rows, ("MEC", mec), ("SI-MEC", si_mec)], key=lambda row: row[1].chord)


def envelope() -> list[tuple[float, float, float]]:
    """(θleft + θright, greatest lean of the MEC, that of the SI-MEC) in steps of π/8; nan where there is none."""
    sums = np.linspace(0.0, 2 * np.pi, 17)
    return [(s, r if (r := minimum_energy_envelope(s)) >= 0.0 else np.nan, scale_invariant_envelope(s)) for s in sums]


# --- the page ---


def lines(table: list[tuple[str, Row]]) -> str:
    head = (
        "| chord/length | λ | MEC energy, chord·∫κ² | SI-MEC energy, length·∫κ² | inflections | |\n"
        + "|---" * 6
        + "|\n"
    )
    return head + "\n".join(
        f"| {r.chord:.4f} | {abs(r.levien):.5f} | {r.mec:.4f} | {r.si_mec:.4f} | {r.inflections} | {name} |"
        for name, r in table
    )


def envelope_lines() -> str:
    head = "| θleft + θright | MEC: θleft | θright | SI-MEC: θleft | θright |\n" + "|---" * 5 + "|\n"
    cells = []
    for total, mec, si_mec in envelope():
        pair = [
            f"{total / 2 + lean:.6f} | {total / 2 - lean:.6f}" if lean == lean else "— | —" for lean in (mec, si_mec)
        ]
        cells.append(f"| {round(total / EIGHTH)} π/8 | {pair[0]} | {pair[1]} |")
    return head + "\n".join(cells)


def page() -> str:
    """docs/levien-figures.md."""
    arch, less, wave = (lines(table_of(*a)) for a in ANGLES)
    return f"""# Levien's figures, computed again

Levien2009 §3.7–3.11: elastica between two tangents when their length changes. Angles are Levien's, measured from the chord:
(θleft, θright) with θleft = θright for an arch and θleft = −θright for an S. λ = 1/(4k²). Written by `python
examples/levien_figures.py`; tests in `tests/solvers/test_levien_figures.py`.

## Figs. 3.10 and 3.15: both tangents at π/2

![λ by the distance of the ends](pictures/levien_3_10.png)

![energies by the distance of the ends](pictures/levien_3_15.png)

{arch}

As Levien says: λ goes from about 0.34 up to ½, down to 0 at 2/π (the half circle), and towards ¼. Two of his sentences do
not hold. The rods left of the maximum have two inflections, "at most one" is not enough. And the MEC energy has no minimum
at λ = ½: it falls all the way to chord 0, and is only level there, since (π/2, π/2) is where the minima end (next figure).

## Fig. 3.16: both tangents at π/3

![energies for π/3](pictures/levien_3_16.png)

{less}

## Fig. 3.17: tangents at π/2 and −π/2

![energies and curves for an S](pictures/levien_3_17.png)

{wave}

The SI-MEC is half of the figure-eight, its energy a quarter of 112.4396; the line of action (red) is then vertical.

## Fig. 3.13: where the MEC exists

![curves of least energy by their angles, and the envelope](pictures/levien_3_13.png)

{envelope_lines()}

The envelope at θleft + θright from 0 (antisymmetric) on; with θleft and θright exchanged it is the other half. The MEC ends
at (π/2, π/2) and, antisymmetric, at 1.737798, not at "2.22": it is cut from the rectangular elastica, and no piece of that
leans farther; no single angle is above 2.166783. The SI-MEC ends at (π, π) and, antisymmetric, at 3.885948, just beyond the
figure-eight, which closes at π/2 + 2 arcsin k₀ = 3.852115; "5.57" is 2π less the 0.7105 of its node. From θleft + θright = 4
arcsin k₀ = 4.562636 on the SI-MEC ends where the chord vanishes.
"""


# --- the pictures ---

ANGLES = ((np.pi / 2, np.pi / 2), (np.pi / 3, np.pi / 3), (np.pi / 2, -np.pi / 2))


def styled(axes, x: str, y: str) -> None:
    axes.set_xlabel(x, color=INK, fontsize=11)
    axes.set_ylabel(y, color=INK, fontsize=11)
    axes.tick_params(colors=SOFT, labelsize=9.5)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(SOFT)
    axes.grid(color="#e6eaee", lw=0.8)
    axes.set_axisbelow(True)


def save(figure: Figure, name: str) -> None:
    FigureCanvasAgg(figure)
    (DOCS / "pictures").mkdir(exist_ok=True)
    figure.savefig(DOCS / "pictures" / name, metadata={"Software": None})


def small_curves(figure: Figure, rows: list[Row], boxes, *, action: bool = False) -> None:
    """Rods as small drawings, all to one scale: the rod, with `action` how it goes on, and its line of action."""
    for row, box in zip(rows, boxes, strict=True):
        axes = figure.add_axes(box)
        curve = row.elastica
        points = curve.point(np.linspace(0.0, 1.0, 300))
        middle = 0.5 * (points[0] + points[-1])
        if action:
            for part in (np.linspace(-0.4, 0.0, 150), np.linspace(1.0, 1.4, 150)):
                axes.plot(*(curve.point(part) - middle).T, color=BLUE, lw=0.9, ls=(0, (3, 2)), alpha=0.8)
            arm = 0.008 * np.asarray(curve.force)
            axes.plot(*np.stack([-arm, arm]).T, color=RED, lw=1.6, solid_capstyle="butt")
        axes.plot(*(points - middle).T, color=BLUE, lw=1.8, solid_capstyle="round")
        axes.plot(*(points[[0, -1]] - middle).T, "o", color=INK, ms=3.2)
        axes.set_aspect("equal")
        half = 0.66 if action else 0.53
        axes.set_xlim(-half, half)
        axes.set_ylim((-half, half) if action else (-0.12, 0.62))
        axes.set_axis_off()


def draw_lambda() -> None:
    """Fig. 3.10."""
    rows = drawn(*ANGLES[0])
    figure = Figure(figsize=(7.6, 4.9), dpi=DPI)
    axes = figure.add_axes((0.09, 0.115, 0.885, 0.655))
    axes.plot([r.chord for r in rows], [r.levien for r in rows], color=BLUE, lw=2.2)
    axes.axhline(0.25, color=SOFT, lw=1, ls=(0, (4, 3)))
    axes.text(0.02, 0.257, "λ = ¼, k = 1", color=SOFT, fontsize=9.5)
    mec, si_mec = marked(*ANGLES[0])
    for row, text, at in ((mec, "rectangular elastica", (0.475, 0.505)), (si_mec, "half circle, 2/π", (0.655, 0.008))):
        axes.plot(row.chord, row.levien, "o", color=RED, ms=6, clip_on=False, zorder=5)
        axes.text(*at, text, color=RED, fontsize=9.5)
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 0.54)
    styled(axes, "chord / length", "λ = 1/(4k²)")
    chosen = by_chord(*ANGLES[0], np.array([0.06, 0.25, 0.457, 2 / np.pi, 0.87]))
    small_curves(figure, chosen, [(0.09 + 0.885 * r.chord - 0.088, 0.775, 0.176, 0.22) for r in chosen])
    save(figure, "levien_3_10.png")


def draw_energies(left: float, right: float, name: str, label: str) -> None:
    """Figs. 3.15 and 3.16."""
    rows = drawn(left, right)
    figure = Figure(figsize=(7.6, 4.7), dpi=DPI)
    upper, lower = figure.add_axes((0.09, 0.44, 0.885, 0.49)), figure.add_axes((0.09, 0.115, 0.885, 0.235))
    chords = [r.chord for r in rows]
    upper.plot(chords, [r.mec for r in rows], color=GREEN, lw=2.2)
    upper.plot(chords, [r.si_mec for r in rows], color=BLUE, lw=2.2)
    lower.plot(chords, [r.levien for r in rows], color=INK, lw=1.8)
    mec, si_mec = marked(left, right)
    lowest = max(mec.mec, si_mec.si_mec)
    top = (3.4 if left > 1.4 else 8.0) * lowest
    for row, value, colour, word in ((mec, mec.mec, GREEN, "MEC"), (si_mec, si_mec.si_mec, BLUE, "SI-MEC")):
        upper.plot(row.chord, value, "o", color=colour, ms=6.5)
        for axes in (upper, lower):
            axes.axvline(row.chord, color=colour, lw=0.9, ls=(0, (3, 3)))
        lower.plot(row.chord, row.levien, "o", color=colour, ms=5, clip_on=False, zorder=5)
        side = -1 if row.chord < (mec.chord + si_mec.chord) / 2 else 1
        upper.text(
            row.chord + 0.008 * side,
            0.965 * top,
            word,
            color=colour,
            fontsize=10,
            va="top",
            ha="right" if side < 0 else "left",
        )
    steep = left > 1.4
    upper.text(
        0.03 if steep else 0.2, (0.24 if steep else 0.07) * top, "chord · ∫κ²  (MEC)", color=GREEN, fontsize=10.5
    )
    upper.text(0.19 if steep else 0.37, 0.75 * top, "length · ∫κ²  (SI-MEC)", color=BLUE, fontsize=10.5)
    upper.set_ylim(0, top)
    lower.set_ylim(0, 1.06 * max(r.levien for r in rows))
    for axes in (upper, lower):
        axes.set_xlim(0, 1)
    styled(upper, "", "energy")
    styled(lower, "chord / length", "λ")
    upper.tick_params(labelbottom=False)
    figure.text(0.53, 0.955, f"tangents at {label} to the chord", ha="center", color=INK, fontsize=11)
    save(figure, name)


def draw_wave() -> None:
    """Fig. 3.17."""
    rows = drawn(*ANGLES[2])
    figure = Figure(figsize=(7.6, 5.6), dpi=DPI)
    axes = figure.add_axes((0.09, 0.1, 0.885, 0.57))
    chords = [r.chord for r in rows]
    axes.plot(chords, [r.mec for r in rows], color=GREEN, lw=2.2)
    axes.plot(chords, [r.si_mec for r in rows], color=BLUE, lw=2.2)
    mec, si_mec = marked(*ANGLES[2])
    axes.plot(mec.chord, mec.mec, "o", color=GREEN, ms=6.5)
    axes.plot(si_mec.chord, si_mec.si_mec, "o", color=BLUE, ms=6.5)
    axes.text(mec.chord - 0.01, mec.mec - 6.5, "MEC", color=GREEN, fontsize=10, ha="center")
    axes.text(si_mec.chord + 0.015, si_mec.si_mec + 3, "SI-MEC", color=BLUE, fontsize=10, ha="center")
    axes.text(0.14, 7.0, "chord · ∫κ²  (MEC)", color=GREEN, fontsize=10.5)
    axes.text(0.32, 69, "length · ∫κ²  (SI-MEC)", color=BLUE, fontsize=10.5)
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 80)
    styled(axes, "chord / length", "energy")
    chosen = [*by_chord(*ANGLES[2], np.array([0.2, 0.44])), mec, si_mec, *by_chord(*ANGLES[2], np.array([0.93]))]
    small_curves(figure, chosen, [(0.012 + 0.196 * i, 0.69, 0.192, 0.25) for i in range(5)], action=True)
    for i, (row, name) in enumerate(zip(chosen, ("", "", "MEC: ", "SI-MEC: ", ""), strict=True)):
        figure.text(0.108 + 0.196 * i, 0.94, f"{name}{row.chord:.2f}", ha="center", color=INK, fontsize=10)
    save(figure, "levien_3_17.png")


def draw_space() -> None:
    """Fig. 3.13: half of the space of angles, the curve in its place."""
    figure = Figure(figsize=(8.2, 7.3), dpi=DPI)
    axes = figure.add_axes((0.09, 0.09, 0.89, 0.89))
    sums = np.pi * np.sin(np.linspace(-0.5 * np.pi, 0.5 * np.pi, 121))
    lean = np.array([minimum_energy_envelope(s) for s in sums])
    axes.plot(0.5 * sums + lean, 0.5 * sums - lean, color=RED, lw=2.0)
    axes.plot([-np.pi / 2, np.pi / 2], [-np.pi / 2, np.pi / 2], color=SOFT, lw=0.9, ls=(0, (4, 3)))
    size = 0.8 * EIGHTH
    for i in range(-5, 6):
        for j in range(-5, i + 1):
            left, right = i * EIGHTH, j * EIGHTH
            if mec_exists(left, right):
                curve = minimum_energy_curves(*levien_ends(left, right))[0].elastica
                points = (curve.point(np.linspace(0.0, 1.0, 200)) - [0.5, 0.0]) * size / max(1.0, 0.62 * curve.length)
                axes.plot(*np.add(points, (left, right)).T, color=BLUE, lw=1.5, solid_capstyle="round")
                axes.plot(*np.add(points[[0, -1]], (left, right)).T, "o", color=INK, ms=1.8)
    ticks = np.array([-2, -1, 0, 1, 2]) * np.pi / 4
    names = ["−π/2", "−π/4", "0", "π/4", "π/2"]
    axes.set_xticks(ticks, names)
    axes.set_yticks(ticks, names)
    axes.text(np.pi / 2 + 0.16, np.pi / 2 + 0.02, "(π/2, π/2)", color=RED, fontsize=10, va="center")
    end = minimum_energy_envelope(0.0)
    axes.plot([np.pi / 2, end], [np.pi / 2, -end], "o", color=RED, ms=5)
    axes.text(end + 0.07, -end - 0.02, f"({end:.4f}, −{end:.4f})", color=RED, fontsize=10, va="center")
    axes.set_aspect("equal")
    axes.set_xlim(-1.9, 2.75)
    axes.set_ylim(-2.3, 1.9)
    styled(axes, "θleft", "θright")
    save(figure, "levien_3_13.png")


def main() -> None:
    (DOCS / "levien-figures.md").write_text(page())
    draw_lambda()
    draw_space()
    draw_energies(*ANGLES[0], "levien_3_15.png", "π/2 and π/2")
    draw_energies(*ANGLES[1], "levien_3_16.png", "π/3 and π/3")
    draw_wave()


if __name__ == "__main__":
    main()
