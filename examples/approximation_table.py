"""Twelve cubic Béziers of as many kinds and the elastica nearest to them: table and picture of docs/approximation.md.

    python examples/approximation_table.py          writes docs/approximation.md and docs/pictures/approximation.png

The columns are those of Brander2016, Table 1, for curves of our own.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from batten.curves.bezier import CubicBezier
from batten.curves.elastica import Elastica
from batten.solvers.curve_samples import CurveSamples, samples_of
from batten.solvers.elastica_fit import fit_elastica
from batten.solvers.initial_guess import initial_elastica

DOCS = Path(__file__).resolve().parents[1] / "docs"
NODES = 64
BLUE, RED, GREEN, CYAN, INK = "#1f4fa3", "#d03a2b", "#2c9c4b", "#1fb5c9", "#1c2733"

CURVES = {
    "wave": [(0.0, 0.0), (0.55, 0.95), (0.75, -0.75), (1.3, 0.1)],
    "s-shape": [(0.0, 0.0), (1.05, 0.1), (0.0, 0.8), (1.0, 0.9)],
    "flat s-shape": [(0.0, 0.0), (0.45, 0.22), (0.6, -0.2), (1.1, 0.05)],
    "arch": [(0.0, 0.0), (0.1, 0.7), (0.9, 0.7), (1.0, 0.0)],
    "leaning arch": [(0.0, 0.0), (0.25, 0.95), (0.75, 0.6), (1.0, 0.2)],
    "horseshoe": [(0.0, 0.0), (-0.55, 0.9), (1.45, 1.0), (1.0, 0.0)],
    "hook": [(0.0, 0.0), (0.6, 0.05), (1.5, 0.3), (0.75, 0.75)],
    "loop": [(0.0, 0.0), (1.35, 0.95), (-0.35, 0.95), (1.0, 0.0)],
    "leaning loop": [(0.0, 0.0), (1.5, 0.55), (0.05, 1.15), (0.8, 0.1)],
    "near cusp": [(0.0, 0.0), (0.97, 0.85), (0.07, 0.85), (1.0, 0.0)],
    "near line": [(0.0, 0.0), (0.35, 0.03), (0.7, 0.035), (1.0, 0.0)],
    "one sharp bend": [(0.0, 0.0), (0.95, 0.02), (1.0, 0.1), (1.05, 0.9)],
}


class Row(NamedTuple):
    """A row of the table; `iterations` are those from the guess alone, the fits are the best of several starts."""

    name: str
    inflections: int
    r1: float
    r2: float
    r3: float
    r4_guess: float
    r4_free: float
    gradient: float
    iterations: int
    r4_fixed: float
    iterations_fixed: int
    guess: Elastica
    free: Elastica
    fixed: Elastica


def gradient_norm(elastica: Elastica, samples: CurveSamples) -> float:
    """‖∇F‖ of F = ½∫‖γ − x‖² ds by the seven stored numbers, for the curve scaled to length 1."""
    length, fractions = float(samples.lengths[0]), samples.fractions[0]
    s = fractions * elastica.length
    jacobian = elastica.jacobian_at(s)
    angle = elastica.angle_at(s)
    jacobian[..., 6] = fractions[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    gap = elastica.point_at(s) - samples.points[0]
    gradient = np.einsum("n,nc,nck->k", samples.weights[0], gap, jacobian)
    units = np.array([length, length, 1.0, 1 / length, 1 / length**2, 1 / length**2, length])
    return float(np.linalg.norm(gradient * units / length**3))


def rows() -> list[Row]:
    """The table, computed."""
    table = []
    for name, control in CURVES.items():
        curve = CubicBezier(control)
        guess = initial_elastica(curve, nodes=NODES)
        free, fixed = (fit_elastica(curve, ends=ends, nodes=NODES) for ends in ("free", "points"))
        alone = [fit_elastica(curve, ends=ends, nodes=NODES, starts=1).iterations for ends in ("free", "points")]
        gradient = gradient_norm(free.elastica, samples_of(curve, nodes=NODES)[0])
        table.append(
            Row(
                name,
                len(free.elastica.inflections()),
                guess.r1,
                guess.r2,
                guess.r3,
                guess.r4,
                free.distance,
                gradient,
                alone[0],
                fixed.distance,
                alone[1],
                guess.elastica,
                free.elastica,
                fixed.elastica,
            )
        )
    return table


def cells(number: int, row: Row) -> list[str]:
    """The row as it is printed."""
    residuals = [f"{v:.2g}" for v in (row.r1, row.r2, row.r3, row.r4_guess, row.r4_free)]
    gradient = f"{row.gradient:.0e}"
    return [
        str(number), row.name, str(row.inflections), *residuals, gradient, str(row.iterations), f"{row.r4_fixed:.2g}",
        str(row.iterations_fixed),
    ]  # fmt: skip


HEAD = ["", "curve", "infl.", "R₁", "R₂", "R₃", "R₄(p₀)", "R₄(p)", "‖∇F‖", "iter.", "R₄(p*)", "iter.*"]


def page(table: list[Row]) -> str:
    """docs/approximation.md."""
    lines = ["| " + " | ".join(HEAD) + " |", "|" + "---|" * len(HEAD)]
    lines += ["| " + " | ".join(cells(i, row)) + " |" for i, row in enumerate(table, 1)]
    return f"""# Approximation by elastica: twelve kinds of curve

As Brander2016, Table 1 and Figs. 7–8, for cubic Béziers of our own. Written by `python examples/approximation_table.py`.

![twelve curves, their first guesses and their nearest elastica](pictures/approximation.png)

Blue the curve, dashed red the guess, green the nearest elastica, dotted cyan the nearest one with the same end points.

{chr(10).join(lines)}

R₁ is the λ-residual, R₂ the residual of the parabola sin θ_u = P(u), R₃ the share of the curve outside [u_min, u_max], R₄
the L² distance divided by L^(3/2): of the guess p₀, of the fit p, and of the fit p* with the end points held. ‖∇F‖ is the
gradient by the seven stored numbers for the curve scaled to length 1. "infl." counts the inflections of the fit; the
iterations are those from the guess alone, the distances the best of several starts (`fit_elastica`).
"""


def draw(table: list[Row], path: Path) -> None:
    """The picture: twelve small panels."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 7.6), dpi=110)
    t = np.linspace(0.0, 1.0, 400)
    for i, row in enumerate(table):
        axes = figure.add_axes(((i % 4) * 0.25 + 0.012, 1.0 - (i // 4 + 1) / 3 + 0.015, 0.226, 0.26))
        curve = CubicBezier(CURVES[row.name]).point(t)
        axes.plot(*curve.T, color=BLUE, lw=3.2, alpha=0.75, solid_capstyle="round")
        axes.plot(*row.guess.point(t).T, color=RED, lw=1.2, ls=(0, (4, 2.5)))
        axes.plot(*row.free.point(t).T, color=GREEN, lw=1.5)
        axes.plot(*row.fixed.point(t).T, color=CYAN, lw=1.2, ls=(0, (1, 1.6)))
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.08)
        axes.set_axis_off()
        figure.text(
            (i % 4) * 0.25 + 0.125, 1.0 - i // 4 / 3 - 0.03, f"{i + 1}  {row.name}", ha="center", color=INK, fontsize=10
        )
        figure.text(
            (i % 4) * 0.25 + 0.125, 1.0 - i // 4 / 3 - 0.054, f"R₁ {row.r1:.2g}   R₄ {row.r4_free:.2g}", ha="center",
            color="#66727f", fontsize=8,
        )  # fmt: skip
    FigureCanvasAgg(figure)
    figure.savefig(path, metadata={"Software": None})


def main() -> None:
    table = rows()
    (DOCS / "approximation.md").write_text(page(table))
    (DOCS / "pictures").mkdir(exist_ok=True)
    draw(table, DOCS / "pictures" / "approximation.png")
    for i, row in enumerate(table, 1):
        print("  ".join(cells(i, row)))


if __name__ == "__main__":
    main()
