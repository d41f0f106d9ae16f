"""The rod against strength of materials: circles, Euler's strut, a cantilever."""

import math

import numpy as np
import pytest
from scipy.special import ellipk

from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError
from batten.fabrication.job import RodJob
from batten.fabrication.rod import Rod, greatest_curvature
from batten.fabrication.section import FlatSection, RoundSection, TubeSection

ROUND = RoundSection(3.0)
STEEL = Rod(1000.0, ROUND, 200000.0, 0.008)


def test_second_moment_of_a_round_section_by_summing_it_up():
    n = 2000
    x = (np.arange(n) + 0.5) / n * 3.0 - 1.5
    summed = float((x[:, None] ** 2 * (x[:, None] ** 2 + x**2 <= 1.5**2)).sum() * (3.0 / n) ** 2)
    assert pytest.approx(summed, rel=1e-3) == STEEL.second_moment_mm4
    assert pytest.approx(200000.0 * summed, rel=1e-3) == STEEL.bending_stiffness_nmm2


def test_strain_of_circles_from_the_length_of_the_outer_fibre():
    radius, angle = 250.0, 1.2
    outer, middle = (radius + 1.5) * angle, radius * angle
    assert STEEL.strain([1.0 / radius, -1.0 / radius, 0.0]) == pytest.approx([outer / middle - 1.0] * 2 + [0.0])
    assert STEEL.strain(1.0 / STEEL.min_radius_mm) == pytest.approx(0.008, rel=1e-14)


@pytest.mark.parametrize("k", [1e-3, 1e-2])
def test_eulers_strut_between_pinned_ends(k):
    quarter = 0.5 * math.pi * (1.0 + k**2 / 4.0 + 9.0 * k**4 / 64.0)  # K(k), by its series
    strut = Elastica.from_modulus(k, -quarter, 2.0 * quarter, 1000.0 / (2.0 * quarter))
    assert strut.length == pytest.approx(1000.0)
    loads = STEEL.loads(strut)
    buckling = math.pi**2 * STEEL.bending_stiffness_nmm2 / 1000.0**2
    assert loads.force_n == pytest.approx(buckling * (1.0 + k**2 / 2.0), rel=k**3)  # (2K/π)² = 1 + k²/2 + …
    assert abs(loads.moment_start_nmm) < 1e-6
    assert abs(loads.moment_end_nmm) < 1e-6
    # The moment at the middle is force × height there.
    height = float(np.abs(strut.point_at(500.0) - 0.5 * (strut.point_at(0.0) + strut.point_at(1000.0))).max())
    middle = float(STEEL.moment_nmm(strut.curvature_at(500.0)))
    assert abs(middle) == pytest.approx(loads.force_n * height, rel=1e-9)


def test_moments_of_a_bent_rod_balance_its_force():
    bent = Elastica((10.0, -20.0), 0.3, 0.002, (3e-6, -5e-6), 900.0)
    force_n, start, end = STEEL.loads(bent)
    lever = bent.point_at(900.0) - bent.start
    force = STEEL.bending_stiffness_nmm2 * bent.force
    assert force_n == pytest.approx(math.hypot(*force))
    assert end - start == pytest.approx(lever[0] * force[1] - lever[1] * force[0], rel=1e-12)


@pytest.mark.parametrize("section", [ROUND, TubeSection(8.0, 0.7), FlatSection(20.0, 0.5)])
def test_what_bending_costs_is_the_work_of_the_moment(section):
    """Rolled up into a circle by end moments, M = EI·κ grows from 0: the work is ½ M × the angle, here of one full turn."""
    rod = Rod(1000.0, section, 200000.0, 0.01)
    curvature = 2.0 * math.pi / 1000.0
    circle = Elastica((0.0, 0.0), 0.3, curvature, (0.0, 0.0), 1000.0)
    work_nmm = 0.5 * float(rod.moment_nmm(curvature)) * 2.0 * math.pi
    assert rod.energy_j(circle) == pytest.approx(1e-3 * work_nmm, rel=1e-12)


def test_energy_is_the_work_of_the_force_that_holds_it():
    """A strut between pinned ends: as it shortens, its force does work, summed up over 200 struts to k = 0.6."""

    def strut(k):
        quarter = float(ellipk(k * k))
        return Elastica.from_modulus(k, -quarter, 2.0 * quarter, 1000.0 / (2.0 * quarter))

    moduli = np.sqrt(
        np.linspace(0.0, 0.36, 201)[1:]
    )  # k² in even steps, so that the chord shortens in nearly even ones
    struts = [strut(k) for k in moduli]
    chords = np.array([1000.0, *(np.linalg.norm(s.point_at(1000.0) - s.start) for s in struts)])
    buckling = math.pi**2 * STEEL.bending_stiffness_nmm2 / 1000.0**2
    forces = np.array([buckling, *(STEEL.loads(s).force_n for s in struts)])
    work_nmm = float(np.trapezoid(forces, -chords))
    assert STEEL.energy_j(struts[-1]) == pytest.approx(1e-3 * work_nmm, rel=1e-5)


@pytest.mark.parametrize("seed", range(40))
def test_the_greatest_curvature_is_that_of_many_samples(seed):
    rng = np.random.default_rng(seed)
    force = rng.normal(size=2) * 10.0 ** rng.uniform(-2.0, 2.0)
    curve = Elastica(rng.normal(size=2), rng.uniform(-9, 9), 3.0 * rng.normal(), force, rng.uniform(0.1, 6.0))
    found = greatest_curvature(curve)
    sampled = float(np.abs(curve.curvature_at(np.linspace(0.0, curve.length, 20001))).max())
    assert sampled <= found * (1.0 + 1e-12)
    assert found == pytest.approx(sampled, rel=1e-5)


def test_the_greatest_curvature_of_a_wave_of_many_crests_and_of_lines_and_circles():
    wave = Elastica.from_modulus(0.7, -0.1, 40.0)
    assert greatest_curvature(wave) == pytest.approx(1.4, rel=1e-12)  # 2k, at its crests
    assert greatest_curvature(wave.reversed()) == pytest.approx(1.4, rel=1e-12)
    assert greatest_curvature(Elastica((0, 0), 1.0, -0.25, (0, 0), 3.0)) == 0.25
    assert greatest_curvature(Elastica((0, 0), 0.0, 0.0, (2.0, 0.0), 3.0)) == 0.0
    assert STEEL.greatest_strain(wave.reversed()) == pytest.approx(1.5 * 1.4)


def test_a_job_makes_the_rod_it_describes():
    assert Rod.of(RodJob(800.0, 4.0, 190000.0, 0.01, 2.0)) == Rod(800.0, RoundSection(4.0), 190000.0, 0.01)
    tube = RodJob(800.0, 4.0, 190000.0, 0.01, wall_mm=0.5)
    assert Rod.of(tube) == Rod(800.0, TubeSection(4.0, 0.5), 190000.0, 0.01)
    strip = RodJob(800.0, None, 190000.0, 0.01, width_mm=20.0, thickness_mm=0.5)
    assert Rod.of(strip) == Rod(800.0, FlatSection(20.0, 0.5), 190000.0, 0.01)
    assert Rod.of(RodJob()).section == RoundSection(3.0)


@pytest.mark.parametrize(
    ("values", "name"),
    [
        ((0.0, ROUND, 2e5, 0.008), "length_mm = 0.0"),
        ((1e3, 3.0, 2e5, 0.008), "section = 3.0; allowed are RoundSection"),
        ((1e3, ROUND, math.nan, 0.008), "youngs_modulus_mpa = nan"),
        ((1e3, ROUND, 2e5, math.inf), "max_strain = inf"),
        ((1e3, ROUND, 2e5, "0.8%"), "max_strain = '0.8%'"),
        ((1e3, ROUND, 2e5, 1.5), "below 1"),
    ],
)
def test_what_is_no_rod_is_refused_by_name(values, name):
    with pytest.raises(InvalidInputError, match=name):
        Rod(*values)


def test_a_force_has_two_components():
    with pytest.raises(InvalidInputError, match=r"shape \(3,\)"):
        STEEL.force_n([1.0, 2.0, 3.0])
