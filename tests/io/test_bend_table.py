"""The printed table: its numbers are the solutions' own, columns stand under their heads, marks where a rod is overbent."""

import math
import re

import numpy as np
import pytest

from batten.curves.elastica import Elastica
from batten.fabrication.rod import Rod
from batten.fabrication.section import RoundSection
from batten.io.bend_table import bend_lines
from batten.solvers.boundary_value import BoundarySolution
from batten.solvers.snap_error import snap_error


def numbers(line):
    return [float(w.replace("−", "-").replace("∞", "inf")) for w in line.split() if re.fullmatch(r"[−\d.e∞+]+", w)]


def test_without_a_rod(bent):
    lines = bend_lines(bent.problem, bent.solutions)
    assert lines[0] == "length 1000 from (0, 0), 60° to (600, 100), −30°, any winding: 4 shapes, 2 of them stable"
    head = " ".join(lines[1].split())
    assert head == "no stable L·∫κ² ∫κ² inflections turns margin force λ₁ λ₂ κ start κ end"
    assert len(lines) == 6
    assert len(set(map(len, lines[1:]))) == 1, "columns to the right edge"
    for number, (line, solution) in enumerate(zip(lines[2:], bent.by_energy), start=1):
        assert line.split()[1] == ("yes" if solution.stable else "no")
        curve = solution.elastica
        ends = curve.curvature_at([0.0, curve.length]).tolist()
        expected = [number, 1000.0 * solution.energy, solution.energy, solution.inflections, solution.rotation_number]
        assert numbers(line) == pytest.approx([*expected, solution.margin, *curve.force, *ends], rel=1e-3, abs=1e-12)


def test_with_a_rod_the_strained_ones_are_marked(bent):
    strains = sorted(bent.rod.greatest_strain(s.elastica) for s in bent.solutions)
    rod = Rod(1000.0, RoundSection(3.0), 200000.0, 0.5 * (strains[0] + strains[1]))
    lines = bend_lines(bent.problem, bent.solutions, rod)
    head = next(i for i, line in enumerate(lines) if line.startswith("no  force N"))
    assert lines[head - 1].startswith("rod: round, Ø 3 mm, E = 200000 MPa, EI = 795216 N·mm²")
    assert "1/mm²" in lines[1]
    rows = lines[head + 1 : head + 5]
    assert ["!" in row for row in rows] == [False, True, True, True]
    assert lines[-1].startswith("! above the rod's ")
    for row, solution in zip(rows, bent.by_energy):
        force, start, end = rod.loads(solution.elastica)
        strain = rod.greatest_strain(solution.elastica)
        expected = [force, start, end, rod.energy_j(solution.elastica), 100.0 * strain, 1.5 / strain]
        error = snap_error(solution.elastica)
        assert numbers(row)[1:] == pytest.approx([*expected, error.shift, abs(np.degrees(error.turn))], rel=1e-3)


def test_no_shapes_and_noise_near_zero(bent):
    assert bend_lines(bent.problem, []) == [
        "length 1000 from (0, 0), 60° to (600, 100), −30°, any winding: no shape",
    ]
    circle = Elastica((0, 0), 0.0, 2 * math.pi / 1000, (1e-20, -1e-19), 1000.0)
    row = bend_lines(bent.problem, [BoundarySolution(circle, 0.04, 0, -1e-17, True, 2.0, 0.0)])[2]
    assert row.split()[5:9] == ["0.00000", "2.000", "0", "0"]
