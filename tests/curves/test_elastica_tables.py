"""Elastica against printed tables and constants that can be derived by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import ellipe, ellipk

from batten.curves.elastica import Elastica

# Timoshenko and Gere, Theory of Elastic Stability, table 2-3: a column clamped at its foot, free at its end, under an
# axial load P: end slope in degrees, P/P_critical, height x/l and deflection y/l of the end.
TIMOSHENKO_GERE = [
    (20, 1.015, 0.970, 0.219),
    (40, 1.063, 0.881, 0.422),
    (60, 1.152, 0.741, 0.593),
    (80, 1.293, 0.560, 0.719),
    (100, 1.518, 0.349, 0.792),
    (120, 1.884, 0.123, 0.803),
    (140, 2.541, -0.107, 0.750),
    (160, 4.029, -0.340, 0.625),
]


def _column(degrees, length=1.0):
    """From the foot, tangent along +x. EI θ″ = −P sin θ, so the force is (P/EI, 0); the moment vanishes at the free
    end, where the slope is α, so κ₀² = 2 (P/EI)(1 − cos α) and √(P/EI) l = K(sin α/2)."""
    alpha = math.radians(degrees)
    root_load = ellipk(math.sin(alpha / 2) ** 2) / length
    return Elastica(
        start=(0.0, 0.0),
        start_angle=0.0,
        start_curvature=2 * root_load * math.sin(alpha / 2),
        force=(root_load**2, 0.0),
        length=length,
    )


@pytest.mark.parametrize(("degrees", "load", "x", "y"), TIMOSHENKO_GERE)
def test_clamped_free_column_of_timoshenko_and_gere(degrees, load, x, y):
    for length in (1.0, 1250.0):
        curve = _column(degrees, length)
        end = curve.point_at(length) / length
        critical = math.pi**2 / (4 * length**2)
        # The table was made by interpolation: its third place is off by one here and there.
        assert curve.force[0] / critical == pytest.approx(load, rel=8e-4)
        assert end == pytest.approx((x, y), abs=1e-3)
        k = math.sin(math.radians(degrees) / 2)
        quarter = ellipk(k * k)
        assert end == pytest.approx((2 * ellipe(k * k) / quarter - 1, 2 * k / quarter), abs=1e-13)
        assert curve.angle_at(length) == pytest.approx(math.radians(degrees), abs=1e-12)
        assert abs(curve.curvature_at(length)) * length < 1e-12  # the free end carries no moment


def test_figure_eight():
    # The modulus at which a full period comes back to its start: 2E(k) = K(k).
    k = 0.9089085575
    quarter = ellipk(k * k)
    curve = Elastica.from_modulus(k, 0.0, 4 * quarter, 1.0, 0.0, (0.0, 0.0))
    s = np.linspace(0, curve.length, 2001)
    assert np.linalg.norm(curve.point_at(curve.length) - curve.point_at(0.0)) < 1e-8
    assert curve.angle_at(curve.length) == pytest.approx(curve.angle_at(0.0), abs=1e-12)
    assert curve.length * curve.bending_energy() == pytest.approx(112.4396, abs=1e-4)
    # Levien's constant λ = 1/(4k²) is the force over the square of the greatest curvature.
    greatest = np.abs(curve.curvature_at(s)).max()
    assert np.linalg.norm(curve.force) / greatest**2 == pytest.approx(0.30262, abs=1e-5)
    assert len(curve.inflections()) == 2
    crossing = curve.point_at(quarter)
    assert curve.point_at(3 * quarter) == pytest.approx(crossing, abs=1e-8)  # both inflections lie on the double point


@pytest.mark.parametrize(("radius", "turns"), [(1.0, 1.0), (-2.5, 1.0), (1e-6, 10.0), (1e6, 0.25)])
def test_circle_energy_points_and_angle(radius, turns):
    length = abs(radius) * 2 * math.pi * turns
    curve = Elastica(start=(0.0, 0.0), start_angle=0.0, start_curvature=1 / radius, force=(0.0, 0.0), length=length)
    assert length * curve.bending_energy() == pytest.approx(4 * math.pi**2 * turns**2, rel=1e-14)
    s = np.linspace(0, length, 40)
    expected = np.column_stack([radius * np.sin(s / radius), radius * (1 - np.cos(s / radius))])
    np.testing.assert_allclose(curve.point_at(s), expected, atol=1e-14 * length, rtol=0)
    np.testing.assert_allclose(curve.angle_at(s), s / radius, rtol=1e-14)
    assert curve.inflections().size == 0


def test_rectangular_elastica_has_eulers_product():
    """Euler: height times arc of the rectangular elastica (k = 1/√2) is π/4 of its width squared; and 2E − K = π/2K."""
    k = math.sqrt(0.5)
    quarter = ellipk(0.5)
    curve = Elastica.from_modulus(k, 0.0, quarter, 3.0, 0.4, (2.0, -1.0))
    chord = curve.point_at(curve.length) - curve.point_at(0.0)
    x = chord @ (math.cos(0.4), math.sin(0.4))
    y = chord @ (-math.sin(0.4), math.cos(0.4))
    assert x == pytest.approx(3 * (2 * ellipe(0.5) - quarter), abs=1e-14)
    assert x * curve.length == pytest.approx(math.pi / 4 * y**2, rel=1e-14)
    assert curve.angle_at(curve.length) - 0.4 == pytest.approx(math.pi / 2, abs=1e-14)


@pytest.mark.parametrize("scale", [1.0, 2.0**-20, 2.0**20])
def test_separatrix_in_hyperbolic_functions(scale):
    """k = 1: the loop of infinite length, (2 tanh s − s, 2 − 2 sech s), exactly representable in doubles."""
    curve = Elastica((0.0, 0.0), 0.0, 2 / scale, (1 / scale**2, 0.0), 8 * scale)
    s = np.linspace(-6, 6, 49)
    expected = scale * np.column_stack([2 * np.tanh(s) - s, 2 - 2 / np.cosh(s)])
    np.testing.assert_allclose(curve.point_at(scale * s), expected, atol=2e-14 * scale, rtol=0)
    np.testing.assert_allclose(curve.curvature_at(scale * s), 2 / np.cosh(s) / scale, atol=1e-14 / scale, rtol=0)
    np.testing.assert_allclose(curve.angle_at(scale * s), 4 * np.arctan(np.tanh(s / 2)), atol=1e-14, rtol=0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_straight_rod_stays_straight_under_axial_load(sign):
    """No load, however far above Euler's, moves a perfectly straight rod: an equilibrium, stable or not."""
    for load in (0.0, 1.0, math.pi**2, 1e4):
        curve = Elastica((1.0, 2.0), 0.0, 0.0, (sign * load, 0.0), 1.0)
        s = np.linspace(0, 1, 9)
        np.testing.assert_allclose(curve.point_at(s), np.column_stack([1 + s, 2 + 0 * s]), atol=1e-15, rtol=0)
        assert curve.bending_energy() == 0.0
        assert curve.inflections().size == 0


def test_small_deflection_is_eulers_sine():
    """A rod bent a little in compression is a sine wave: y ≈ (κ₀/λ)(1 − cos √λ s), to third order in κ₀."""
    load, curvature = 9.0, 1e-6
    curve = Elastica((0.0, 0.0), 0.0, curvature, (load, 0.0), 2.0)
    s = np.linspace(0, 2, 21)
    np.testing.assert_allclose(
        curve.point_at(s)[:, 1], curvature / load * (1 - np.cos(3 * s)), atol=1e-18 + 1e-11 * curvature, rtol=0
    )
    # Quarter waves: the curvature κ₀ cos √λ s vanishes at √λ s = π/2, 3π/2.
    np.testing.assert_allclose(curve.inflections(), [math.pi / 6, math.pi / 2], rtol=1e-9)


def test_small_deflection_in_tension_is_a_catenary_like_growth():
    """In tension a small curvature grows as κ₀ cosh √λ s."""
    curvature = 1e-9
    curve = Elastica((0.0, 0.0), 0.0, curvature, (-9.0, 0.0), 2.0)
    s = np.linspace(0, 2, 21)
    np.testing.assert_allclose(curve.curvature_at(s), curvature * np.cosh(3 * s), rtol=1e-9)
    assert curve.inflections().size == 0


def test_a_line_in_tension_has_a_modulus_form_of_the_same_line():
    line = Elastica(start=(1.0, 2.0), start_angle=0.0, start_curvature=0.0, force=(-4.0, 0.0), length=3.0)
    form = line.to_modulus()
    assert (form.k, form.s0, form.ell, form.scale) == (0.0, 0.0, 6.0, 0.5)
    s = np.linspace(0.0, 3.0, 5)
    np.testing.assert_allclose(Elastica.from_modulus(*form).point_at(s), line.point_at(s), rtol=0, atol=1e-15)
