"""The printed table of a bent rod's shapes: what `batten bend` says."""

from __future__ import annotations

import math
from collections.abc import Sequence

from batten.fabrication.rod import Rod
from batten.io.bend_numbers import BendNumbers, BendProblem, BendSolution, BentRod, bend_numbers


def bend_lines(problem: BendProblem, solutions: Sequence[BendSolution], rod: Rod | None = None) -> list[str]:
    """What was asked, and one row for each solution, by energy; with a rod a second table in N and mm.

    The first table: number; whether it is stable; L∫κ² ds, free of scale, and ∫κ² ds in 1/length; inflections; rotation
    number (θ(L) − θ(0))/2π; margin; force (λ₁, λ₂) and moments κ at both ends, for EI = 1. The second: size of the force at
    either gripper, moments EI·κ, energy ½EI∫κ² ds, greatest strain (with "!" where it is above the rod's), least radius,
    and the least shift and turn of a gripper at which the rod snaps (0 for an unstable rod, ∞ where it bears every one).

    Parameters:
        problem: what was asked.
        solutions: any number of them.
        rod: the rod, for the second table; the problem is in mm then.

    Returns:
        The lines, without their ends.

    Example:
        >>> from batten.curves.elastica import Elastica
        >>> from batten.solvers.boundary_value import BoundarySolution
        >>> half = Elastica((0, 0), math.pi / 2, -math.pi, (0, 0), 1.0)
        >>> solution = BoundarySolution(half, math.pi**2, 0, -0.5, True, 2.0, 0.0)
        >>> problem = BendProblem((0.0, 0.0), math.pi / 2, (2 / math.pi, 0.0), -math.pi / 2, 1.0)
        >>> for line in bend_lines(problem, [solution]): print(line)
        length 1 from (0, 0), 90° to (0.636619772, 0), −90°: 1 shape, 1 of them stable
        no  stable    L·∫κ²     ∫κ²  inflections     turns  margin  force λ₁  λ₂   κ start     κ end
         1  yes     9.86960  9.8696            0  −0.50000   2.000         0   0  −3.14159  −3.14159
    """
    rows = bend_numbers(solutions, rod)
    lines = [_heading(problem, rows, "" if rod is None else " mm")]
    if not rows:
        return lines
    lines += _table(_SHAPE_HEAD if rod is None else _SHAPE_HEAD_MM, [_shape_cells(row) for row in rows])
    if rod is not None:
        lines += ["", _rod_line(rod)]
        bent = [(row.number, row.rod) for row in rows if row.rod is not None]
        lines += _table(_ROD_HEAD, [_rod_cells(number, b) for number, b in bent])
        if any(b.too_strained for _, b in bent):
            lines.append(f"! above the rod's {100.0 * rod.max_strain:g} %: it would stay bent, or break")
    return lines


_SHAPE_HEAD = ["no", "stable", "L·∫κ²", "∫κ²", "inflections", "turns", "margin", "force λ₁", "λ₂", "κ start", "κ end"]
_SHAPE_HEAD_MM = [
    *("no", "stable", "L·∫κ²", "∫κ² 1/mm", "inflections", "turns", "margin"),
    *("force λ₁ 1/mm²", "λ₂", "κ start 1/mm", "κ end"),
]
_ROD_HEAD = [
    "no",
    "force N",
    "moment start N·mm",
    "end N·mm",
    "energy J",
    "strain %",
    "least radius mm",
    "snaps at mm",
    "or at °",
]
_LEFT = ("stable",)
_NOISE = 1e-11  # forces and curvatures below this, for length 1, are zero but for rounding


def _heading(problem: BendProblem, rows: Sequence[BendNumbers], unit: str) -> str:
    (x0, y0), (x1, y1) = problem.start, problem.end
    stable = sum(row.solution.stable for row in rows)
    found = "no shape" if not rows else f"{len(rows)} shape{'s' if len(rows) > 1 else ''}, {stable} of them stable"
    modulo = ", any winding" if problem.end_angle_modulo else ""
    return (
        f"length {text_of(problem.length, 9)}{unit} from ({text_of(x0, 9)}, {text_of(y0, 9)}), "
        f"{_held(problem.start_angle)} to ({text_of(x1, 9)}, {text_of(y1, 9)}), "
        f"{_held(problem.end_angle)}{modulo}: {found}"
    )


def _held(angle: float | None) -> str:
    return "pinned" if angle is None else f"{text_of(math.degrees(angle))}°"


def _rod_line(rod: Rod) -> str:
    return (
        f"rod: {rod.section.description}, E = {rod.youngs_modulus_mpa:g} MPa, EI = {rod.bending_stiffness_nmm2:.6g} N·mm², "
        f"strain up to {100.0 * rod.max_strain:g} %, so radii of {rod.min_radius_mm:.6g} mm or more"
    )


def _shape_cells(row: BendNumbers) -> list[str]:
    solution, length = row.solution, row.solution.elastica.length
    force, moments = row.force, (row.curvature_start, row.curvature_end)
    return [
        str(row.number),
        "yes" if solution.stable else "no",
        f"{row.scaled_energy:.5f}",
        text_of(solution.energy),
        str(solution.inflections),
        turns_text(solution.rotation_number, 5),
        margin_text(solution.margin),
        *(text_of(value if abs(value) * length**2 > _NOISE else 0.0) for value in force),
        *(text_of(value if abs(value) * length > _NOISE else 0.0) for value in moments),
    ]


def _rod_cells(number: int, bent: BentRod) -> list[str]:
    return [
        str(number),
        text_of(bent.force_size_n, 5),
        text_of(bent.moment_start_nmm, 5),
        text_of(bent.moment_end_nmm, 5),
        text_of(bent.energy_j, 5),
        f"{100.0 * bent.strain:.4f}" + (" !" if bent.too_strained else "  "),
        text_of(bent.least_radius_mm, 5),
        text_of(bent.snap_shift_mm, 4),
        text_of(bent.snap_turn_deg, 4),
    ]


def text_of(value: float, digits: int = 6) -> str:
    """A number with so many digits, with a true minus and ∞; −0 as 0, – for one that does not exist."""
    text = f"{value + 0.0:.{digits}g}".replace("inf", "∞").replace("nan", "–")
    return text.replace("-", "−")


def turns_text(turns: float, decimals: int) -> str:
    """A rotation number with so many decimals and a true minus; −0 as 0."""
    return f"{round(turns, decimals) + 0.0:.{decimals}f}".replace("-", "−")


def margin_text(margin: float) -> str:
    """The margin with three decimals; ∞ if there is no conjugate length."""
    return f"{margin:.3f}".replace("inf", "∞")


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Columns as wide as needed, two blanks apart; numbers to the right."""
    columns = list(zip(head, *rows))
    widths = [max(map(len, column)) for column in columns]
    lines = []
    for cells in (head, *rows):
        padded = (
            cell.ljust(width) if name in _LEFT else cell.rjust(width) for name, cell, width in zip(head, cells, widths)
        )
        lines.append("  ".join(padded).rstrip())
    return lines
