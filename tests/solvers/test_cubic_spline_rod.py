"""Method 2: its functions against differences, its curves against elastica, its updates, its refusals."""

import numpy as np
import pytest

from batten.curves.bspline import BSplineCurve
from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError, NoSolutionError
from batten.measures.distance import hausdorff_distance, l2_distance
from batten.solvers.clamped_ends import clamped_ends, feasible_bezier
from batten.solvers.cubic_spline_rod import CubicSplineRod, SplineSpace

ARCH = Elastica((0.3, -0.2), 0.9, -2.1, (1.5, -2.0), 1.0)  # no inflection
WAVE = Elastica((0.0, 0.0), 0.4, 3.0, (4.0, 9.0), 1.0)  # one inflection
LARGE = Elastica((-50.0, 20.0), 0.9 + 4 * np.pi, -2.1 / 40, (1.5 / 1600, -2.0 / 1600), 40.0)


def _ends(elastica):
    points = elastica.point_at([0.0, elastica.length])
    angles = elastica.angle_at([0.0, elastica.length])
    return points[0], angles[0], points[1], angles[1], elastica.length


@pytest.mark.parametrize("elastica", [ARCH, WAVE, LARGE])
def test_energies_fall_to_that_of_the_elastica(elastica):
    result = CubicSplineRod(*_ends(elastica)).solve(updates=6)
    assert result.converged, result.status
    excess = np.array(result.energies) / elastica.bending_energy() - 1.0
    assert len(excess) == 8
    assert np.all(np.diff(excess) < 1e-12)
    assert np.all(excess > -1e-12)
    assert excess[-1] < 1e-9
    assert excess[0] > 1e-4  # the Bézier alone is not it
    assert l2_distance(result.curve, elastica) < 1e-7
    assert result.energy == result.energies[-1]
    assert result.end_angle == pytest.approx(elastica.angle_at(elastica.length), abs=1e-12)


def test_energy_error_falls_like_the_sixth_power_of_the_pieces_and_distance_like_the_fifth():
    results = [CubicSplineRod(*_ends(WAVE)).solve(updates=u) for u in (2, 3, 4)]
    excess = np.array([r.energy - WAVE.bending_energy() for r in results])
    assert np.all(excess[:-1] / excess[1:] > 2**5)
    distance = np.array([l2_distance(r.curve, WAVE) for r in results])
    assert np.all(distance[:-1] / distance[1:] > 2**4)


@pytest.mark.parametrize("elastica", [ARCH, WAVE, LARGE])
def test_constraints_are_held(elastica):
    start, start_angle, end, end_angle, length = _ends(elastica)
    curve = CubicSplineRod(start, start_angle, end, end_angle, length).solve(updates=2).curve
    assert np.abs(curve.point([0.0, 1.0]) - [start, end]).max() < 1e-13 * 100
    assert abs(curve.length - length) < 1e-9 * length
    for t, angle in ((0.0, start_angle), (1.0, end_angle)):
        d = curve.derivative(t)
        assert abs(d @ [-np.sin(angle), np.cos(angle)]) < 1e-12 * np.hypot(*d)
        assert d @ [np.cos(angle), np.sin(angle)] > 0.0
    assert len(curve.breaks()) == 5
    assert curve.breaks() == pytest.approx(np.linspace(0, 1, 5))


@pytest.mark.parametrize("pieces", [1, 2, 4])
def test_gradients_and_hessians_are_those_of_differences(pieces):
    space = SplineSpace.of(clamped_ends(*_ends(WAVE)), pieces, 100)
    rng = np.random.default_rng(pieces)
    control = np.stack([np.linspace(0, 1, pieces + 3), np.zeros(pieces + 3)], axis=1) * 0.8
    z = space.unknowns(control) + 0.05 * rng.normal(size=2 * pieces)
    z[:2] = 0.31, 0.27
    h = 1e-5
    for which, exact in enumerate(space.expansions(z)):
        assert exact.value == pytest.approx(space.values(z)[which], rel=1e-13)
        for i, e in enumerate(np.eye(len(z))):
            difference = (space.values(z + h * e)[which] - space.values(z - h * e)[which]) / (2 * h)
            assert exact.gradient[i] == pytest.approx(difference, rel=1e-6, abs=1e-6)
            there, here = (space.expansions(z + sign * h * e)[which].gradient for sign in (1, -1))
            scale = np.abs(exact.hessian).max()
            assert exact.hessian[i] == pytest.approx((there - here) / (2 * h), rel=1e-6, abs=1e-6 * scale)


def test_energy_and_length_of_a_spline_by_another_quadrature():
    space = SplineSpace.of(clamped_ends(*_ends(ARCH)), 4, 100)
    z = space.unknowns(space.control_points(np.array([0.3, 0.3, 0.2, 0.4, 0.5, 0.1, 0.15, 0.1])))
    curve = BSplineCurve(space.knots, space.control_points(z))
    t = (np.arange(400_000) + 0.5) / 400_000
    d, dd = curve.derivative(t), curve.derivative(t, 2)
    speed = np.hypot(*d.T)
    energy = 0.5 * np.mean((d[:, 0] * dd[:, 1] - d[:, 1] * dd[:, 0]) ** 2 / speed**5)
    assert space.values(z) == pytest.approx((energy, speed.mean()), rel=1e-8)


@pytest.mark.parametrize("distance", ["L2", "hausdorff"])
def test_updates_go_on_until_two_solutions_agree(distance):
    rod = CubicSplineRod(*_ends(WAVE))
    result = rod.solve(tolerance=1e-4, distance=distance)
    assert result.converged
    assert result.distances[-1] <= 1e-4 < result.distances[-2]
    last, before = result.curve, rod.solve(updates=result.updates - 1).curve
    expected = l2_distance(last, before) if distance == "L2" else hausdorff_distance(last, before, normalised=True)
    assert result.distances[-1] == pytest.approx(expected, abs=2e-6)
    assert rod.solve(tolerance=1e-2).updates < result.updates


def test_a_tolerance_out_of_reach_is_not_called_converged():
    result = CubicSplineRod(*_ends(WAVE)).solve(tolerance=1e-15)
    assert not result.converged
    assert result.updates == 7
    assert "tolerance" in result.status


def test_a_near_cusp_of_the_start_is_not_sharpened():
    """Between 100 Gauss nodes the cusp of this Bézier is hardly seen; a solver that trusts them makes it infinite."""
    ends = ((0.0, 0.0), 0.0, (0.02, 0.0), 0.05, 1.0)
    bezier = CubicSplineRod(*ends).solve(updates=0)
    assert bezier.energies[0] > 1e3
    result = CubicSplineRod(*ends).solve(updates=4)
    assert result.converged, result.status
    assert result.energy < 0.1 * bezier.energies[0]
    assert abs(result.length_error) < 1e-9


def test_the_start_is_feasible():
    ends = clamped_ends(*_ends(LARGE))
    bezier = feasible_bezier(ends)
    assert bezier.length == pytest.approx(40.0, rel=1e-13)
    p = bezier.control_points
    assert np.hypot(*(p[1] - p[0])) == pytest.approx(np.hypot(*(p[3] - p[2])), rel=1e-12)
    assert p[[0, 3]] == pytest.approx(np.stack([ends.start, ends.end]))


def test_a_straight_rod():
    result = CubicSplineRod((1.0, 1.0), np.pi / 4, (4.0, 4.0), np.pi / 4, 3 * np.sqrt(2.0)).solve(updates=1)
    assert result.converged
    assert result.energy == pytest.approx(0.0, abs=1e-20)


def test_refusals():
    with pytest.raises(NoSolutionError, match="cannot reach"):
        CubicSplineRod((0, 0), 0.0, (2, 0), 0.0, 1.9)
    with pytest.raises(NoSolutionError, match="straight"):
        CubicSplineRod((0, 0), 0.1, (2, 0), 0.0, 2.0)
    for bad in (
        ((0, 0, 0), 0.0, (1, 0), 0.0, 2.0),
        ((0, 0), np.nan, (1, 0), 0.0, 2.0),
        ((0, 0), 0.0, (1, 0), 0.0, -2.0),
        ((0, 0), "east", (1, 0), 0.0, 2.0),
    ):
        with pytest.raises(InvalidInputError):
            CubicSplineRod(*bad)
    for options in ({"gauss_nodes": 3}, {"gauss_nodes": 9.5}, {"least_arm": 0.0}):
        with pytest.raises(InvalidInputError):
            CubicSplineRod((0, 0), 0.0, (1, 0), 0.0, 2.0, **options)
    rod = CubicSplineRod((0, 0), 1.0, (1, 0), -1.0, 2.0)
    for options in ({"updates": 8}, {"updates": -1}, {"tolerance": 0.0}, {"distance": "H1"}):
        with pytest.raises(InvalidInputError):
            rod.solve(**options)
