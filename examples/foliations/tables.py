"""Tables 5.1 and 5.2 of Fisker2018 for the designs of this folder, read from their jobs, and the second way of §5.4.1.

python examples/foliations/tables.py
"""

from __future__ import annotations

from pathlib import Path

from batten.io.job import load_job
from batten.io.rhino import DesignCurves, read_design_curves
from batten.studies.foliations import (
    FoliationNumbers,
    foliation_numbers,
    interpolated_foliations,
    interpolation_lines,
    table_5_1,
    table_5_2,
)

FOLDER = Path(__file__).resolve().parent
COUNT, COUNT_OF_SIX = 49, 55
"""Isocurves, as many as in the thesis."""


def design_curves(name: str) -> DesignCurves:
    """The design curves that a job names, mm."""
    job = load_job(FOLDER / f"{name}.toml").surface
    return read_design_curves(job.source, layer=job.layer, scale_mm_per_unit=job.scale_mm_per_unit)


def names() -> list[str]:
    """The jobs of the twelve foliations."""
    return sorted(path.stem for path in FOLDER.glob("[0-9]*.toml"))


def numbers(name: str) -> FoliationNumbers:
    """The rows of a design in its table."""
    curves = design_curves(name)
    return foliation_numbers(name, curves.curves, curves.positions, COUNT_OF_SIX if name == "six-blocks" else COUNT)


def main() -> None:
    """Print all three tables."""
    print(f"Table 5.1: twelve foliations, four design curves and {COUNT} curves each\n")
    print("\n".join(table_5_1([numbers(name) for name in names()])))
    print(*(f"({i}) {name[3:].replace('-', ' ')}" for i, name in enumerate(names(), 1)), sep="; ")
    six = numbers("six-blocks")
    print(
        f"\nTable 5.2: six blocks, {int(six.design.sum())} design curves and {len(six.positions)} curves, each against its "
        "C¹ elastic spline\n"
    )
    print("\n".join(table_5_2(six)))
    print("\n§5.4.1: elastic splines with the joints, tangents and lengths of the curves, distance from the lofts\n")
    every = [*names(), "six-blocks"]
    pairs = [interpolated_foliations(c.curves, c.positions, COUNT) for c in map(design_curves, every)]
    print("\n".join(interpolation_lines(every, pairs)))


if __name__ == "__main__":
    main()
