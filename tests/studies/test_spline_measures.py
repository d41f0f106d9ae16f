"""Measures of splines: against closed forms, and findings that differ from Levien2009's table."""

import numpy as np
import pytest

from batten.curves.spiral import Spiral
from batten.splines.interpolating_spline import interpolating_spline
from batten.studies.spline_measures import (
    continuity,
    curvature_and_slope,
    designs,
    extensionality,
    fairness,
    invariance,
    locality,
    makers,
    roundness,
)

MAKE = makers()


def test_curvature_and_its_slope_are_those_of_the_curve():
    curve = Spiral(np.zeros(2), 0.2, np.array([0.5, -1.0, 2.0, 0.7]), 1.9)
    t = np.linspace(0.0, 1.0, 7)
    speed, kappa, slope = curvature_and_slope(curve, t)
    np.testing.assert_allclose(speed, 1.9)
    np.testing.assert_allclose(kappa, curve.curvature_at(1.9 * t), atol=1e-13)
    np.testing.assert_allclose(slope, curve.curvature_at(1.9 * t, 1), atol=1e-12)


def test_fairness_of_an_arc_and_of_an_euler_spiral():
    angle = 2.0 * np.pi * np.arange(6) / 6
    ring = fairness(interpolating_spline(np.stack([np.cos(angle), np.sin(angle)], axis=1), closed=True))
    assert (ring.energy, ring.monotone) == (pytest.approx(2.0 * np.pi), 1.0)
    assert ring.variation < 1e-20
    one = interpolating_spline([[0.0, 0.0], [1.0, 0.2]], start=0.5, end=("curvature", 1.0))
    (segment,) = one.segments
    slope = float(segment.curvature_at(0.0, 1))
    assert fairness(one).variation == pytest.approx(slope**2 * segment.length, rel=1e-12)
    assert fairness(one).steepest == pytest.approx(abs(slope), rel=1e-12)


def test_circle_splines_are_g2():
    """Levien2009 §4.10 says that κ′ is 0 at the points; the blend of angles has a second derivative there, and it is not."""
    spline = MAKE["circle"](designs(1)[0], False)
    slopes = [curvature_and_slope(s, np.array([0.0]))[2][0] for s in spline.segments[1:]]
    assert np.abs(slopes).max() > 0.1
    assert continuity([spline]) == 2


@pytest.mark.parametrize(
    ("name", "order"), [("euler", 2), ("mec", 2), ("kurgla1", 2), ("hobby", 1), ("ikarus", 1), ("lagrange", 1)]
)
def test_orders_of_continuity(name, order):
    assert continuity([MAKE[name](p, False) for p in designs(3, seed=2)]) == order


def test_roundness_extensionality_and_locality_tell_the_kinds_apart():
    points = designs(1)[0]
    for name in ("euler", "log-aesthetic", "kurgla1", "circle", "si-mec"):
        assert roundness(MAKE[name], 8) < 1e-11
    assert roundness(MAKE["mec"], 8) > 1e-4 > roundness(MAKE["hobby"], 8) > 1e-6
    for name in ("euler", "mec", "log-aesthetic", "si-mec"):
        assert extensionality(MAKE[name], points) < 1e-9
    for name in ("kurgla1", "hobby", "circle", "ikarus", "lagrange"):
        assert extensionality(MAKE[name], points) > 1e-5
    assert locality(MAKE["euler"]) == pytest.approx(1.0 / (2.0 + np.sqrt(3.0)), abs=1e-6)
    assert locality(MAKE["circle"]) == 0.0


def test_invariance_notices_what_is_not_invariant():
    points = designs(1)[0]
    assert max(invariance(MAKE["euler"], points)) < 1e-13

    def crooked(p, closed):
        return interpolating_spline(p, start=0.1)  # an angle to the x-axis: no similarity leaves that

    assert invariance(crooked, points)[0] > 1e-3
