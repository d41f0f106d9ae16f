"""The study of boundary value problems in words and tables, the paper's numbers beside ours: Fisker2018 Tables 2.1, B.1."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from batten.studies.boundary import METHODS, BoundaryPart, BoundaryStudy
from batten.typing import FloatArray

QUANTITIES = ("2nd end point", "length", "runtime (s)", "L2 distance", "H1 distance")
NEAREST = ("L2 to the nearest", "H1 to the nearest")

PAPER_TABLE: dict[str, tuple[tuple[float, ...], ...]] = {
    "average": (
        (5.27e-4, 4.94e-4, 0.0, 0.0, 0.0),
        (0.0, 0.0, 2.67e-5, 3.75e-2, 1.33e-2),
        (1.09e-1, 4.46e-1, 1.38e-1, 4.18e-1, 4.36e-1),
        (1.88e-2, 1.8e-2, 3.14e-2, 2.5e-2, 2.20e-2),
        (1.51e-1, 1.37e-1, 3.38e-1, 2.18e-1, 1.54e-1),
    ),
    "median": (
        (1.07e-7, 2.19e-8, 0.0, 0.0, 0.0),
        (0.0, 0.0, 4.23e-9, 4.50e-9, 6.29e-9),
        (9.19e-2, 3.86e-1, 1.01e-1, 2.65e-1, 3.72e-1),
        (1.78e-3, 5.71e-4, 2.25e-3, 4.07e-4, 3.82e-5),
        (4.26e-3, 1.27e-3, 2.21e-2, 4.42e-3, 8.02e-4),
    ),
    "maximum": (
        (6.46e-2, 8.70e-2, 0.0, 0.0, 0.0),
        (0.0, 0.0, 1.31e-2, 1.22e1, 6.49),
        (5.33e-1, 1.57, 1.37, 3.46, 2.56),
        (3.14e-1, 3.15e-1, 3.38e-1, 7.28e-1, 7.28e-1),
        (2.60, 2.66, 3.88, 3.54, 3.46),
    ),
}
"""Fisker2018 Table 2.1: for each statistic a row for each of `QUANTITIES`, over the first five methods; 500 problems of the
paper's own, on its computer, in MATLAB."""

PAPER_ENERGIES = (
    (0.08832, 0.08809, 0.08778, 0.08769, 0.08769, 0.08769, 0.08769, 0.08769),
    (0.4751, 0.47337, 0.45771, 0.45049, 0.44783, 0.44772, 0.44770, 0.44770),
    (0.05407, 0.05259, 0.05252, 0.05252, 0.05252, 0.05251, 0.05251, 0.05251),
    (0.08848, 0.08848, 0.08802, 0.08799, 0.08798, 0.08798, 0.08798, 0.08798),
    (0.1513, 0.15061, 0.15018, 0.14975, 0.14973, 0.14973, 0.14973, 0.14973),
    (0.1467, 0.14207, 0.14040, 0.14016, 0.14014, 0.14014, 0.14014, 0.14014),
    (0.1520, 0.14900, 0.14746, 0.14730, 0.14730, 0.14730, 0.14730, 0.14730),
    (0.25120, 0.24687, 0.24519, 0.24426, 0.24413, 0.24412, 0.24412, 0.24412),
    (0.13310, 0.13309, 0.13237, 0.13170, 0.13160, 0.13160, 0.13158, 0.13158),
    (1.005, 0.68234, 0.66807, 0.64544, 0.64505, 0.64500, 0.64500, 0.64500),
)
"""Fisker2018 Table B.1: ½∫κ² ds of the Bézier and after 0 … 6 knot updates, for ten curves of the paper's own."""

_STATISTICS: dict[str, Callable[..., FloatArray]] = {
    "average": np.nanmean,
    "median": np.nanmedian,
    "maximum": np.nanmax,
}
_WIDTH = 11


def statistics(results: BoundaryPart) -> dict[str, FloatArray]:
    """Average, median and maximum of every quantity: rows as `QUANTITIES` + `NEAREST`, columns as `METHODS`; (7, m)."""
    names = ("end_error", "length_error", "runtime", "l2", "h1", "l2_nearest", "h1_nearest")
    columns = [getattr(results, name) for name in names]
    some = ~np.isnan(results.runtime).all(axis=0)
    out = {}
    for word, statistic in _STATISTICS.items():
        table = np.full((len(names), len(METHODS)), np.nan)
        for i, column in enumerate(columns):
            table[i, some] = statistic(column[:, some], axis=0)
        out[word] = table
    return out


def lines(study: BoundaryStudy) -> list[str]:
    """The study as lines of text: Table 2.1 and Table B.1, ours with the paper's numbers below.

    Parameters:
        study: from `run`.

    Returns:
        Lines without line ends, at most 120 characters each.

    Example:
        >>> from batten.studies.boundary import run
        >>> lines(run(1, seed=3))[0]
        '1 random elastica of length 1 (seed 3): their ends, end tangents and length given, the curve wanted'
    """
    results = study.results
    text = [
        f"{study.size} random elastica of length 1 (seed {study.seed}): their ends, end tangents and length given, the "
        "curve wanted",
        "Method 1: polyline, Method 2: cubic spline (Fisker2018 2.2); ours: all solutions, exact; paper: Fisker2018, "
        "Table 2.1",
        "",
        _row("", METHODS),
    ]
    tables = statistics(results)
    for word, table in tables.items():
        text += ["", word]
        for i, quantity in enumerate((*QUANTITIES, *NEAREST)):
            text.append(_row("  " + quantity, [f"{v:.2e}" for v in table[i]]))
            if i < len(QUANTITIES):
                text.append(_row("    paper", [f"{v:.2e}" for v in PAPER_TABLE[word][i]]))
    text += ["", f"of {study.size} problems"]
    text.append(_row("  not converged", (~results.converged).sum(axis=0)))
    text.append(_row("  another elastica", results.another.sum(axis=0)))
    text.append(_row("  L2 > 0.01 to any", (results.l2_nearest > 0.01).sum(axis=0)))
    counts = results.solutions
    text += [
        "",
        f"ours: the elastica asked for is missing in {int(results.missing.sum())} of {study.size} problems (to 1e-9); "
        f"solutions a problem: {counts[:, 0].mean():.1f}",
        f"with the asked winding, up to {counts[:, 0].max()}; {counts[:, 1].mean():.1f} with any, up to "
        f"{counts[:, 1].max()}",
    ]
    return [*text, "", *_energy_lines(study)]


def _row(name: str, cells: object) -> str:
    return f"{name:<20}" + "".join(_cell(c) for c in np.asarray(cells, dtype=object).ravel())


def _cell(cell: object) -> str:
    return f"{cell!s:>14}"


def _energy_lines(study: BoundaryStudy) -> list[str]:
    table = study.energies
    heads = ["exact", "Bezier", *(f"{i} upd." for i in range(table.energies.shape[1] - 1))]
    text = ["Table B.1: half the integral of squared curvature by Method 2", "", _narrow("", heads)]
    for number, (exact, energies, another) in enumerate(zip(table.exact, table.energies, table.another), start=1):
        text.append(_narrow(f"  {number}", [f"{v:.5f}" for v in (exact, *energies)]) + "  another" * bool(another))
    text.append("")
    text.append("excess over the last value, median of ten")
    for name, rows in (("  here", table.energies), ("  paper", np.array(PAPER_ENERGIES))):
        excess = np.median(rows / rows[:, -1:] - 1.0, axis=0)
        text.append(_narrow(name, ["", *(f"{v:.1e}" for v in excess)]))
    return text


def _narrow(name: str, cells: list[str]) -> str:
    return f"{name:<8}" + "".join(f"{c:>{_WIDTH}}" for c in cells)
