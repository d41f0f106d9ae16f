"""The criterion of good regions as the kernel has it: the angle error from moments, against the guess itself."""

import math

import numpy as np

from batten.kernels import good_region as kernel
from batten.kernels.quadrature import panel_condition

FREE = np.array([-np.inf, -np.inf, np.inf, np.inf])


def problem_of(cubic, limits, box=FREE):
    """The last control point but one is the active one."""
    response = np.zeros((1, 4, 2, 2))
    response[0, 2] = np.eye(2)
    return (cubic[None], response, np.zeros(1, np.int64), np.zeros((1, kernel.CHORDS + 1, 2)), box, limits)


def limits_of(**changed):
    limits = {"residual": 0.21, "angle": math.radians(6), "curvature": math.inf, "margin": 0.0, "simple": 0.0} | changed
    return np.array([*limits.values(), panel_condition(1e-4)])


def violations(cubic, places, limits, box=FREE):
    out = np.empty(len(places))
    kernel.violation_batch(places, problem_of(cubic, limits, box), out)
    return out


def test_the_angle_error_from_moments_is_that_of_the_guess():
    """With a limit of the curvature that nothing reaches, every guess in doubt is made in full; the signs are the same."""
    rng = np.random.default_rng(1)
    good = doubtful = 0
    for _ in range(60):
        cubic = np.array([(0.0, 0.0), (0.3, 0.4), (0.7, 0.4), (1.0, 0.0)])
        cubic[1:3] += 0.3 * rng.standard_normal((2, 2))
        places = rng.uniform(-0.6, 0.6, (1500, 2))
        quick, full = (violations(cubic, places, limits_of(curvature=c)) for c in (math.inf, 1e300))
        assert ((quick < 0.0) == (full < 0.0)).mean() > 0.9999
        good += (quick < 0.0).sum()
        doubtful += (quick != full).sum()
    assert good > 5000
    assert doubtful > 100  # or nothing was compared


def test_all_values_agree_with_the_violation():
    rng = np.random.default_rng(2)
    base = np.array([(0.0, 0.0), (0.3, 0.4), (0.7, 0.4), (1.0, 0.0)])
    places = rng.uniform(-0.3, 0.3, (300, 2))
    limits = limits_of()
    worst = violations(base, places, limits)
    cubics = np.tile(base, (300, 1, 1))
    cubics[:, 2] += places
    values = np.empty((300, 4))
    kernel.values_batch(cubics, limits, values)
    expected = np.maximum(values[:, 0] / limits[0], values[:, 1] / limits[1]) - 1.0
    clear = np.abs(expected) > 1e-6
    assert ((worst < 0.0) == (expected < 0.0))[clear].all()
    assert 50 < (worst < 0.0).sum() < 295


def test_places_outside_the_box_are_infinitely_bad():
    base = np.array([(0.0, 0.0), (0.3, 0.4), (0.7, 0.4), (1.0, 0.0)])
    box = np.array([-0.1, -0.2, 0.1, 0.2])
    found = violations(base, np.array([(0.0, 0.0), (0.11, 0.0), (0.0, -0.21), (0.1, 0.2)]), limits_of(), box)
    assert found[0] < 0.0
    assert found[1] == found[2] == math.inf
    assert found[3] < math.inf


def test_lines_are_good_and_cusps_and_points_are_not():
    line = np.array([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0)])
    back = np.array([(7.0, 0.0)])
    assert violations(line, np.zeros((1, 2)), limits_of())[0] < 0.0
    assert violations(line, back, limits_of())[0] >= 0.0  # doubles back
    cusp = np.array([(0.0, 0.0), (1.0, 1.0), (0.0, 1.0), (1.0, 0.0)])
    assert violations(cusp, np.zeros((1, 2)), limits_of())[0] >= 0.0
    point = np.zeros((4, 2))
    assert violations(point, np.zeros((1, 2)), limits_of())[0] >= 0.0
