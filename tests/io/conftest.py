"""Fixtures for the files of `batten bend`."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from batten.curves.elastica import Elastica
from batten.fabrication.rod import Rod
from batten.fabrication.section import RoundSection
from batten.io.bend_numbers import BendProblem
from batten.solvers.boundary_value import BoundarySolution

# Found once by shooting with scipy: curvature at the start, force, inflections, stable or not, margin.
_SHAPES = (
    (-0.007933343819632751, (7.115398192051891e-05, 9.304505102333626e-06), 2, True, 1.12),
    (0.004057668002131867, (2.792122672295545e-05, 5.625238463482035e-06), 2, True, math.inf),
    (0.005474786895235012, (9.424801052096353e-05, -1.2682005402570203e-05), 3, False, 0.9),
    (0.0061973556459085635, (-9.231040158217665e-05, -4.084510708563525e-05), 1, False, 0.75),
)


@pytest.fixture(scope="session")
def bent():
    """A problem in mm, four of its shapes (not in the order of their energy), and a rod that bears none of them."""
    problem = BendProblem((0.0, 0.0), math.pi / 3, (600.0, 100.0), -math.pi / 6, 1000.0, 3, 1, end_angle_modulo=True)
    solutions = []
    for curvature, force, inflections, stable, margin in _SHAPES:
        curve = Elastica(problem.start, problem.start_angle, curvature, force, problem.length)
        turned = float(curve.angle_at(problem.length)) - problem.start_angle
        miss = math.dist(curve.point_at(problem.length), problem.end) / problem.length
        energy = curve.bending_energy()
        solutions.append(BoundarySolution(curve, energy, inflections, turned / (2 * math.pi), stable, margin, miss))
    rod = Rod(1000.0, RoundSection(3.0), 200000.0, 0.008)
    by_energy = sorted(solutions, key=lambda s: s.energy)
    return SimpleNamespace(problem=problem, solutions=solutions, by_energy=by_energy, rod=rod)


@pytest.fixture(scope="session")
def greatest_distance():
    """A function: how far points lie from an elastica at most, by its nearest of many samples and the foot near there."""

    def measure(points, curve):
        samples = np.linspace(0.0, curve.length, 2001)
        places = curve.point_at(samples)
        s = samples[[np.argmin(((places - p) ** 2).sum(axis=1)) for p in points]]
        for _ in range(4):
            angle = curve.angle_at(s)
            s = s + ((points - curve.point_at(s)) * np.stack([np.cos(angle), np.sin(angle)], axis=1)).sum(axis=1)
        return float(np.linalg.norm(points - curve.point_at(s), axis=1).max())

    return measure
