"""The canonical guess: exact elastica are recovered, R₁ … R₄ are what Brander2016 defines, noise does what it must."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

from batten.curves.bezier import CubicBezier
from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError
from batten.measures.distance import l2_distance
from batten.measures.lambda_residual import lambda_residual
from batten.solvers.curve_samples import from_points, samples_of
from batten.solvers.initial_guess import initial_elastica

ARCHES = [
    [(0.0, 0.0), (0.1, 0.7), (0.9, 0.7), (1.0, 0.0)],  # an arch
    [(0.0, 0.0), (0.6, 0.8), (0.4, -0.8), (1.0, 0.0)],  # an S
    [(0.0, 0.0), (1.4, 1.0), (-0.4, 1.0), (1.0, 0.0)],  # a loop
    [(0.0, 0.0), (0.2, 0.4), (0.5, 0.6), (1.0, 0.1)],  # bent one way, unevenly
    [(0.0, 0.0), (0.0, -0.9), (1.5, -0.7), (0.8, 0.2)],  # a hook, turning left
    [(0.3, 0.1), (-0.4, 0.9), (-0.9, 0.2), (0.1, -0.6)],
    [(0.0, 0.0), (0.5, 0.02), (0.6, -0.03), (1.0, 0.05)],  # nearly straight
]


def half_period(k):
    """2K of the extended modulus (Brander2016 App. A): the arc of ζ_k between two extremes of u."""
    return 2.0 * ellipk(k * k) if k < 1.0 else ellipk(1.0 / k**2) / k


def _segments():
    """Some 600 (k, s₀, ℓ, S, φ, origin): all moduli, up to several periods, also from extreme to extreme, also short."""
    random = np.random.default_rng(16)
    for i in range(600):
        kind = i % 8
        k = random.uniform(0.05, 0.98) if random.random() < 0.5 else random.uniform(1.02, 5.0)
        if kind == 2:
            k = 1.0 + random.choice([-1.0, 1.0]) * 10.0 ** random.uniform(-8.0, -2.0)
        elif kind == 3:
            k = 10.0 ** random.uniform(-1.5, 2.0)
        half = min(half_period(k), 10.0)
        s0, ell = random.uniform(-2.0, 2.0) * half, random.uniform(0.3, 6.0) * half
        if kind == 5:
            ell = random.uniform(0.1, 0.4) * half
        elif kind == 6:  # starts at an extreme of u
            s0 = random.integers(-2, 3) * half
        elif kind == 7:  # runs from extreme to extreme
            s0, ell = random.integers(-1, 2) * half, random.integers(1, 5) * half
        if k > 1.0 and random.random() < 0.5:
            ell = -ell  # negative curvature
        scale, rotation = 10.0 ** random.uniform(-2.0, 2.0), random.uniform(-np.pi, np.pi)
        yield k, s0, ell, scale, rotation, random.normal(size=2) * 10.0 * scale


def _units(length):
    return np.array([length, length, 1.0, 1 / length, 1 / length**2, 1 / length**2, length])


def _errors(found, true):
    """Differences of the seven numbers, free of dimension: angles mod 2π, curvature and force by their largest value."""
    length = true.length
    difference = (found.parameters - true.parameters) / _units(length)
    difference[2] = np.remainder(difference[2] + np.pi, 2 * np.pi) - np.pi
    bend = np.abs(true.curvature_at(np.linspace(0.0, length, 65))).max() * length
    difference[3] /= max(bend, 1.0)
    difference[4:6] /= max(np.hypot(*true.force) * length**2, 1.0)
    return np.abs(difference)


def _flatness(curve):
    """How thin the curve is, which bounds what it tells of the force: ratio of the axes of inertia."""
    points = curve.point(np.linspace(0.0, 1.0, 200))
    return float(np.divide(*np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[::-1]))


def test_exact_elastica_are_recovered():
    counted, worst = 0, 0.0
    for k, s0, ell, scale, rotation, origin in _segments():
        true = Elastica.from_modulus(k, s0, ell, scale, rotation, origin)
        guess = initial_elastica(true, nodes=128)
        assert guess.status == "elastica"
        errors = _errors(guess.elastica, true)
        assert errors[[0, 1, 2, 3, 6]].max() < 1e-8, (k, s0, ell)
        if _flatness(true) > 1e-6:  # a curve that is straight to rounding determines no force
            counted += 1
            worst = max(worst, errors.max())
            assert errors.max() < 1e-8, (k, s0, ell)
            assert guess.r1 < 1e-8
            assert guess.r2 < 1e-7
            assert guess.r3 == 0.0
            assert guess.r4 < 1e-8
    assert counted >= 580


def test_the_papers_parameters_are_recovered():
    counted = 0
    for k, s0, ell, scale, rotation, origin in _segments():
        true = Elastica.from_modulus(k, s0, ell, scale, rotation, origin)
        if abs(k - 1.0) < 1e-2 or abs(ell) < 1.0 / max(k, 1.0) or k > 10.0 or k < 0.1:
            continue  # s₀ hangs on log|1 − k|; on a short arc modulus and scale trade; circles have no modulus form
        counted += 1
        found = initial_elastica(true, nodes=128).elastica.to_modulus()
        half = half_period(k)
        turns = (s0 - found.s0) / (
            2.0 * half
        )  # s₀ counts whole periods; without inflections the tangent turns with them
        assert abs(found.k - k) < 1e-8 * k
        assert abs(turns - np.round(turns)) < 1e-8 / half
        assert abs(found.ell - ell) < 1e-8 * max(abs(ell), 1.0)
        assert found.scale == pytest.approx(scale, rel=1e-8)
        assert np.cos(found.rotation - rotation) == pytest.approx(1.0, abs=1e-12)
        period = Elastica.from_modulus(k, 0.0, 2.0 * half, scale, rotation)  # how far a period carries the curve
        step = period.point(1.0) - period.point(0.0)
        gap = (np.array(found.origin) - origin - np.round(turns) * step) / true.length
        assert np.abs(gap).max() < 1e-7
    assert counted >= 350


@pytest.mark.parametrize("k", [1.0, 1.0 - 1e-14, 1.0 + 1e-13])
@pytest.mark.parametrize(("s0", "ell"), [(-2.0, 5.0), (0.0, 3.0), (1.0, 2.0), (-6.0, 3.0)])
def test_the_single_loop_is_recovered(k, s0, ell):
    true = Elastica.from_modulus(k, s0, ell, 2.0, 0.7, (3.0, -1.0))
    assert _errors(initial_elastica(true, nodes=128).elastica, true).max() < 1e-8


@pytest.mark.parametrize("curvature", [2.0, -0.3, 9.0])
def test_circles_are_called_so(curvature):
    arc = Elastica((2.0, 1.0), 0.4, curvature, (0.0, 0.0), 1.5)
    guess = initial_elastica(arc)
    assert guess.status == "circle"
    assert _errors(guess.elastica, arc).max() < 1e-12
    assert guess.r1 < 1e-13
    assert guess.r4 < 1e-14


def test_lines_are_called_so():
    line = CubicBezier([(0.0, 0.0), (1.0, 2.0), (2.0, 4.0), (3.0, 6.0)])
    guess = initial_elastica(line)
    assert guess.status == "line"
    assert guess.elastica.force.tolist() == [0.0, 0.0]
    np.testing.assert_allclose(guess.elastica.point([0.0, 1.0]), [(0.0, 0.0), (3.0, 6.0)], atol=1e-14)
    assert (guess.r1, guess.r2, guess.r3) == (0.0, 0.0, 0.0)
    assert guess.r4 < 1e-15


@pytest.mark.parametrize("away", [1e-3, 1e-5, 1e-7])
def test_next_to_a_circle_the_shape_is_recovered(away):
    true = Elastica((0.0, 0.0), 0.3, 2.0, (away, -0.5 * away), 1.2)
    guess = initial_elastica(true)
    assert _errors(guess.elastica, true)[[0, 1, 2, 3, 6]].max() < 1e-8
    assert np.abs(guess.elastica.force - true.force).max() < 1e-12  # rounding of κ, ×10³ for an arc so short


def _by_definition(curve, count=4001):
    """λ₁, λ₂, α, β, k, u_min, u_max, R₁, R₂, R₃ of Brander2016 §4 by Simpson's rule, for an infl. or left-turning curve."""
    t = np.linspace(0.0, 1.0, count)
    x, y = curve.point(t).T
    dx, dy = curve.derivative(t, 1).T
    ddx, ddy = curve.derivative(t, 2).T
    speed = np.hypot(dx, dy)
    rule = np.full(count, 2.0)
    rule[1::2], rule[[0, -1]] = 4.0, 1.0
    weight = rule / (3.0 * (count - 1)) * speed
    length = weight.sum()
    kappa = (dx * ddy - dy * ddx) / speed**3
    system = np.column_stack([-y, x, np.ones(count)])
    root = np.sqrt(weight)
    lambda_1, lambda_2, alpha = np.linalg.lstsq(system * root[:, None], kappa * root, rcond=None)[0]
    r1 = np.sqrt(weight @ (kappa - system @ [lambda_1, lambda_2, alpha]) ** 2 / (weight @ kappa**2))
    sign = 1.0
    for sign in (1.0, -1.0):  # −1: run backwards (note 3)
        l1, l2, a = sign * lambda_1, sign * lambda_2, sign * alpha
        lam = np.hypot(l1, l2)
        u = (l2 * x - l1 * y) / lam
        sine = (l1 * dx + l2 * dy) * sign / (lam * speed)
        beta = weight @ (sine - 0.5 * lam * u**2 - a * u) / length
        minus, plus = a**2 - 2 * lam * (beta - 1), a**2 - 2 * lam * (beta + 1)
        if plus < 0.0 or sign * (weight @ kappa) > 0.0:
            break
    high = (-a + np.sqrt(minus)) / lam
    low = (-a - np.sqrt(minus)) / lam if plus < 0.0 else (-a + np.sqrt(plus)) / lam
    r2 = np.sqrt(weight @ (sine - 0.5 * lam * u**2 - a * u - beta) ** 2 / length)
    r3 = weight @ ((u < low) | (u > high)) / length
    modulus = 0.5 * np.sqrt(minus / lam)
    ends = u[[0, -1]] if sign > 0.0 else u[[-1, 0]]
    return {"force": (lambda_1, lambda_2), "k": modulus, "ends": ends, "low": low, "high": high, "r": (r1, r2, r3)}


@pytest.mark.parametrize("control", ARCHES)
def test_the_recipe_is_the_papers(control):
    curve = CubicBezier(control)
    guess = initial_elastica(curve, nodes=400)
    expected = _by_definition(curve)
    form = guess.elastica.to_modulus()
    np.testing.assert_allclose(guess.elastica.force, expected["force"], rtol=1e-8, atol=1e-8)
    assert guess.r1 == pytest.approx(expected["r"][0], rel=1e-8)
    assert guess.r1 == pytest.approx(lambda_residual(curve, tolerance=1e-10), abs=2e-10)
    assert guess.r2 == pytest.approx(expected["r"][1], rel=1e-8)
    assert guess.r3 == pytest.approx(
        expected["r"][2], abs=0.02
    )  # the share of an interval whose ends fall between nodes
    assert guess.r4 == pytest.approx(l2_distance(curve, guess.elastica), rel=1e-8)
    assert form.k == pytest.approx(expected["k"], rel=1e-8)
    # Eq. (13): at both ends u is that of the curve, clipped to its range.
    clipped = np.clip(expected["ends"], expected["low"], expected["high"])
    ends = np.array([form.s0, form.s0 + form.ell])
    ends = ends if form.ell > 0.0 else ends[::-1]
    if form.k < 1.0:
        cn = ellipj(ends, form.k**2)[1]
    else:
        cn = ellipj(form.k * ends, 1.0 / form.k**2)[2]
    np.testing.assert_allclose(expected["high"] - 2 * form.k * form.scale * (1 - cn), clipped, atol=2e-7)
    # Eq. (14): the mean difference vanishes.
    samples = samples_of(curve, nodes=200)[0]
    gap = samples.weights[0] @ (samples.points[0] - guess.elastica.point(samples.fractions[0]))
    assert np.abs(gap).max() < 1e-12


def test_similar_and_reversed_curves_have_similar_guesses():
    cos, sin = 3.0 * np.cos(2.0), 3.0 * np.sin(2.0)
    for control in map(np.array, ARCHES):
        one = initial_elastica(control)
        other = initial_elastica(control @ [[cos, sin], [-sin, cos]] + [50.0, -20.0])
        back = initial_elastica(control[::-1])
        for two in (other, back):
            np.testing.assert_allclose([two.r1, two.r2], [one.r1, one.r2], rtol=1e-9)
            assert two.r4 == pytest.approx(one.r4, rel=1e-5)  # a clipped end is a square root of rounding
        t = np.linspace(0.0, 1.0, 9)
        np.testing.assert_allclose(back.elastica.point(t[::-1]), one.elastica.point(t), atol=1e-6)


def _measured(count, noise, random):
    """Noisy points of twelve elastica, noise in lengths: pairs (true, points)."""
    for i in range(12):
        k = random.uniform(0.3, 0.95) if i % 2 else random.uniform(1.1, 2.0)
        true = Elastica.from_modulus(
            k, random.uniform(-1, 1), random.uniform(2, 5) / max(k, 1), 3.0, random.uniform(-3, 3)
        )
        points = true.point(np.linspace(0.0, 1.0, count))
        yield true, points + noise * true.length * random.normal(size=points.shape)


# λ stems from a second derivative, which loses more than half of the digits that the points have: the median distance of the
# guess falls like noise^0.6 or so, and without noise the quintic spline between 60 points is all that is left.
@pytest.mark.parametrize(
    ("noise", "median", "largest"), [(1e-2, 3e-2, 0.2), (1e-3, 6e-3, 4e-2), (1e-5, 4e-4, 3e-3), (0.0, 2e-7, 5e-6)]
)
def test_noisy_points_give_a_guess_as_good_as_the_noise_allows(noise, median, largest):
    random = np.random.default_rng(4)
    error = [l2_distance(true, initial_elastica(points).elastica) for true, points in _measured(60, noise, random)]
    assert np.median(error) < median
    assert max(error) < largest


def test_measured_points_keep_unit_and_place():
    true, points = next(_measured(40, 1e-4, np.random.default_rng(5)))
    one, other = initial_elastica(points), initial_elastica(1000.0 * points + [3e5, -2e5])
    assert other.r4 == pytest.approx(one.r4, rel=1e-6)
    np.testing.assert_allclose(other.elastica.force * 1e6, one.elastica.force, rtol=1e-5)
    assert l2_distance(true, one.elastica) < 5e-3


def test_samples_and_curve_give_the_same_guess():
    curve = CubicBezier(ARCHES[0])
    samples, _ = samples_of(curve, nodes=64)
    assert initial_elastica(samples).elastica == initial_elastica(curve).elastica
    assert initial_elastica(np.array(ARCHES[0])).r1 == pytest.approx(initial_elastica(curve).r1, rel=1e-12)
    measured = curve.point(np.linspace(0, 1, 50))
    assert initial_elastica(from_points(measured)).elastica == initial_elastica(measured).elastica


@pytest.mark.parametrize(
    ("curve", "message"),
    [
        (np.zeros((4, 2)), "no length"),
        ([(0, 0), (np.nan, 1), (2, 1), (3, 0)], "not finite"),
        (np.stack([ARCHES[0], ARCHES[1]]), "one curve; got 2"),
        (np.zeros((3, 2)), "m ≥ 5"),
        (np.zeros((7, 2)), "coincide with the next"),
        (np.zeros((7, 3)), r"shape \(7, 3\)"),
        (np.full((7, 2), np.inf), "all finite"),
        (3.0, r"shape \(\)"),
    ],
)
def test_bad_input_is_refused(curve, message):
    with pytest.raises(InvalidInputError, match=message):
        initial_elastica(curve)
