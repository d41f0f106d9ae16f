"""Stability: against a finite-difference Hessian that knows neither elliptic functions nor conjugate points."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk, ellipkm1

from batten.curves.elastica import Elastica
from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError
from batten.solvers import stability as module
from batten.solvers.stability import Stability, least_eigenvalues, margins, stability

ENDS = ("clamped", "pinned", "clamped-pinned", "pinned-clamped")
K_MEET = brentq(lambda k: 2.0 * ellipe(k * k) - ellipk(k * k), 0.9, 0.92, xtol=1e-15)  # ends of a half wave meet
STRAIGHT_Z = {"clamped": 2.0 * np.pi, "pinned": np.pi, "clamped-pinned": brentq(lambda z: np.tan(z) - z, 4.4, 4.6)}
STRAIGHT_Z["pinned-clamped"] = STRAIGHT_Z["clamped-pinned"]


# --- the oracle: angles by Runge-Kutta, the second variation by differences, its inertia by LDLᵀ and a Schur complement ---


def _angles(p, n, inner=8):
    """θ at n + 1 equidistant nodes of the elastica p (rows, 7), from θ″ = −λ₁ sin θ + λ₂ cos θ; shape (n + 1, rows)."""
    theta, rate, f1, f2 = p[:, 2].copy(), p[:, 3].copy(), p[:, 4], p[:, 5]
    h = p[:, 6] / (n * inner)

    def pull(angle):
        return f2 * np.cos(angle) - f1 * np.sin(angle)

    out = [theta.copy()]
    for step in range(1, n * inner + 1):
        a1 = pull(theta)
        r2 = rate + 0.5 * h * a1
        a2 = pull(theta + 0.5 * h * rate)
        r3 = rate + 0.5 * h * a2
        a3 = pull(theta + 0.5 * h * r2)
        r4 = rate + h * a3
        a4 = pull(theta + h * r3)
        theta = theta + h / 6.0 * (rate + 2.0 * r2 + 2.0 * r3 + r4)
        rate = rate + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        if step % inner == 0:
            out.append(theta.copy())
    return np.array(out)


def _index(p, theta, ends, shift=0.0):
    """How many directions that the ends and both constraints allow have a second variation below shift·∫v²/L²."""
    n = theta.shape[0] - 1
    h = 1.0 / n
    weight = np.full(n + 1, h)
    weight[[0, -1]] = 0.5 * h
    load = (p[:, 4] * np.cos(theta) + p[:, 5] * np.sin(theta)) * p[:, 6] ** 2
    diagonal = np.full(n + 1, 2.0 / h)
    diagonal[[0, -1]] = 1.0 / h
    diagonal = diagonal[:, None] - weight[:, None] * (load + shift)
    first = 1 if ends in ("clamped", "clamped-pinned") else 0
    last = n - 1 if ends in ("clamped", "pinned-clamped") else n
    negative = np.zeros(p.shape[0], dtype=int)
    pivot, y = np.full(p.shape[0], np.inf), np.zeros((2, p.shape[0]))
    gram = np.zeros((p.shape[0], 2, 2))
    constraint = weight[:, None, None] * np.stack([np.cos(theta), np.sin(theta)], axis=1)
    for i in range(first, last + 1):
        factor = -1.0 / (h * pivot)
        y = constraint[i] - factor * y
        pivot = diagonal[i] - 1.0 / (h * h * pivot)
        negative += pivot < 0.0
        gram += (y[:, None] * y[None] / pivot).transpose(2, 0, 1)
    return negative + (np.linalg.eigvalsh(gram) > 0.0).sum(axis=1) - 2


def _is_unstable(p, ends, n):
    """The sign of the least eigenvalue; near 0, of what it tends to as the differences get finer."""
    theta = _angles(p, n)
    doubt = (_size(p) / n) ** 2 / 3.0  # four times z⁴/(12 n²), the size of the error of second order
    below = _index(p, theta, ends, -doubt) > 0
    open_ = np.flatnonzero(below != (_index(p, theta, ends, doubt) > 0))
    if open_.size:
        some = p[open_]
        below[open_] = 4.0 * _least(some, ends, 2 * n, theta_inner=4) < _least(some, ends, n, theta_inner=8)
    return below


def _size(p):
    """z²: λL², or (κL/2)² where that is greater."""
    return np.maximum(np.hypot(p[:, 4], p[:, 5]), 0.25 * p[:, 3] ** 2) * p[:, 6] ** 2


def _least(p, ends, n, theta_inner=8):
    """Least eigenvalue of the same differences, by bisection on the inertia."""
    theta = _angles(p, n, theta_inner)
    size = np.hypot(p[:, 4], p[:, 5]) * p[:, 6] ** 2
    low, high = -size - 1.0, size + 400.0
    for _ in range(46):
        middle = 0.5 * (low + high)
        below = _index(p, theta, ends, middle) > 0
        high, low = np.where(below, middle, high), np.where(below, low, middle)
    return 0.5 * (low + high)


# --- random rods ---


def _somewhere(curve, rng):
    rotation, scale, translation = rng.uniform(-3, 3), 10 ** rng.uniform(-2, 3), rng.uniform(-5, 5, 2)
    return curve.transformed(Similarity(scale=scale, rotation=rotation, translation=translation))


def _modulus(rng, most=1.0):
    kind = rng.integers(3)
    if kind == 0:
        return rng.uniform(0.02, 0.999)
    if kind == 1:
        return 1.0 - 10 ** rng.uniform(-5, -1)
    return K_MEET + rng.uniform(-0.05, 0.05) if most <= 1.0 else rng.uniform(1.001, most)


def _random_rods(count, ends, seed):
    """Rods up to 1.3 periods long, with no curvature at pinned ends; half of them near the end of stability."""
    rng = np.random.default_rng(seed)
    rows = []
    for i in range(count):
        if ends == "clamped":
            k = _modulus(rng, 1.6)
            period = 4.0 * ellipk(k * k) if k < 1.0 else 2.0 * ellipk(1.0 / k**2) / k
            curve = Elastica.from_modulus(k, rng.uniform(-0.5, 0.5) * period, rng.uniform(0.05, 1.3) * period)
        else:
            k = _modulus(rng)
            quarter = ellipk(k * k)
            length = 2.0 * quarter * rng.integers(1, 4) if ends == "pinned" else rng.uniform(0.1, 5.2) * quarter
            curve = Elastica((0, 0), 2.0 * np.arcsin(k) * rng.choice([-1, 1]), 0.0, (1.0, 0.0), length)
        if i % 2 and ends != "pinned":
            near = margins(curve.parameters, "clamped" if ends == "clamped" else "pinned-clamped") * curve.length
            if np.isfinite(near):
                curve = curve.extended(0.0, near * rng.uniform(0.9, 1.1) - curve.length)
        if ends == "clamped-pinned":
            curve = curve.reversed()
        rows.append(_somewhere(curve, rng).parameters)
    return np.array(rows)


def _disagreements(count, seed, n):
    """Rods of each kind on which margin and finite differences disagree, and how many were compared."""
    wrong, compared = [], 0
    for ends, share in (("clamped", 0.5), ("pinned", 0.15), ("clamped-pinned", 0.2), ("pinned-clamped", 0.15)):
        p = _random_rods(int(count * share), ends, seed)
        margin = margins(p, ends)
        assert not np.isnan(margin).any()
        unstable = _is_unstable(p, ends, n)
        sure = ~(np.abs(margin - 1.0) < 0.002)
        compared += int(sure.sum())
        wrong += [(ends, *row) for row in p[sure & (unstable != (margin <= 1.0))]]
        least = least_eigenvalues(p, ends)
        wrong += [("eigenvalue", ends, *row) for row in p[sure & (unstable != (least < 0.0))]]
    return wrong, compared


def test_agrees_with_finite_differences_on_200_rods():
    wrong, compared = _disagreements(200, 11, 400)
    assert compared > 190
    assert wrong == []


@pytest.mark.slow
def test_agrees_with_finite_differences_on_2000_rods():
    wrong, compared = _disagreements(2000, 12, 800)
    assert compared > 1900
    assert wrong == []


# --- theorems ---


def test_without_inflections_there_is_no_conjugate_point():
    rng = np.random.default_rng(5)
    rows = []
    for k in [1.0, 1.0 + 1e-9, 1.0001, *rng.uniform(1.0, 3.0, 40)]:
        rows.append(_somewhere(Elastica.from_modulus(k, rng.uniform(-3, 3), rng.uniform(1.0, 12.0)), rng).parameters)
    rows.append([0, 0, 1.0, 4.0, 0, 0, 8.0])  # a circle, five turns
    p = np.array(rows)
    exact = np.array([Elastica.from_parameters(row).to_modulus().k >= 1.0 for row in p])
    assert exact.sum() >= len(p) - 3  # k = 1 itself may be rounded to below
    assert (margins(p)[exact] == np.inf).all()
    assert (margins(p) > 1.0).all()
    assert (_index(p, _angles(p, 800), "clamped") == 0).all()


def test_three_interior_inflections_are_unstable_between_clamped_ends():
    rng = np.random.default_rng(6)
    rows = []
    for k in np.concatenate([10.0 ** rng.uniform(-6, 0, 100), 1.0 - 10.0 ** rng.uniform(-12, -1, 100)]):
        quarter = ellipkm1((1.0 - k) * (1.0 + k))
        before, after = rng.uniform(1e-3, 1.0, 2) * quarter
        curve = Elastica.from_modulus(k, quarter - before, 4.0 * quarter + before + after)
        assert len(curve.inflections()) >= 3
        rows.append(curve.parameters)
    assert (margins(rows) < 1.0).all()


def test_a_pinned_rod_is_stable_up_to_where_its_ends_meet():
    """One half wave with the ends not yet crossed is stable; beyond, or with more half waves, it is not."""
    rng = np.random.default_rng(7)
    k = np.concatenate(
        [rng.uniform(0.001, 1.0, 60), K_MEET + np.array([-1e-3, -1e-9, 1e-9, 1e-3]), [0.88, 0.8861, 0.8862]]
    )
    for waves in (1, 2, 3):
        p = [Elastica((0, 0), 2 * np.arcsin(x), 0, (1, 0), 2 * waves * ellipk(x * x)).parameters for x in k]
        assert ((margins(p, "pinned") > 1.0) == ((waves == 1) & (k < K_MEET))).all()


@pytest.mark.parametrize(
    ("ends", "factor"), [("clamped", 4.0), ("pinned", 1.0), ("clamped-pinned", 2.0457), ("pinned-clamped", 2.0457)]
)
def test_loads_at_which_straight_rods_buckle(ends, factor):
    length, angle = 2.5, 0.7
    for load in np.array([0.5, 0.999999, 1.000001, 3.0]) * STRAIGHT_Z[ends] ** 2 / length**2:
        rod = Elastica((3, 4), angle, 0.0, load * np.array([np.cos(angle), np.sin(angle)]), length)
        found = stability(rod, ends)
        assert found.margin == pytest.approx(STRAIGHT_Z[ends] / (np.sqrt(load) * length), rel=1e-14)
        assert found.stable == (load * length**2 < STRAIGHT_Z[ends] ** 2) == (found.least_eigenvalue > 0.0)
        pulled = Elastica((3, 4), angle, 0.0, -load * np.array([np.cos(angle), np.sin(angle)]), length)
        assert stability(pulled, ends).margin > 1.0
        assert stability(pulled, ends).least_eigenvalue > 0.0
    assert STRAIGHT_Z[ends] ** 2 / np.pi**2 == pytest.approx(factor, abs=5e-5)
    assert stability(Elastica((0, 0), 1.0, 0.0, (0, 0), 2.0), ends).margin == np.inf


def test_margins_of_slightly_bowed_rods_have_the_limits_stated():
    p1 = brentq(lambda p: np.tan(p) - p, 4.4, 4.6)  # twice this, where the middle of the clamped rod is a vertex
    limits = {"pinned": 4.9638 / np.pi, "clamped-pinned": 6.0175 / 4.0, "clamped": 2.0 * p1 / 6.0}
    for k in (1e-3, 1e-5, 1.1e-7):
        pinned = Elastica((0, 0), 2 * k, 0.0, (1, 0), np.pi)
        mixed = Elastica((0, 0), 2 * k, 0.0, (1, 0), 4.0).reversed()
        vertex = Elastica((0, 0), 0.0, 2 * k, (1, 0), 6.0).extended(p1, -p1)  # the conjugate segment is [−p₁, p₁]
        for ends, rod in (("pinned", pinned), ("clamped-pinned", mixed), ("clamped", vertex)):
            if ends == "pinned" and k > 1e-4:
                rod = rod.extended(0.0, 2.0 * ellipk(k * k) - np.pi)
            assert stability(rod, ends).margin == pytest.approx(limits[ends], rel=2e-5)
    straight = Elastica((0, 0), 1e-7, 0.0, (1, 0), np.pi)
    assert stability(straight, "pinned").margin == 1.0
    for length in (6.0, 6.2, 6.5, 8.0):  # sines of vanishing bow: both decisions by finite differences
        rows = [Elastica((0, 0), 2e-5, 0.0, (1, 0), length).extended(-a, a).parameters for a in np.linspace(0, 3, 7)]
        p = np.array(rows)
        sure = np.abs(margins(p) - 1.0) > 0.002
        assert ((_index(p, _angles(p, 800), "clamped") == 0) == (margins(p) > 1.0))[sure].all()


def test_margin_and_eigenvalue_agree_on_what_is_straight():
    """Columns a little above the load at which a straight one buckles: below k = 1e-7 they are straight, above bowed."""
    for ends, length in (("clamped", 6.4), ("pinned", 3.2), ("pinned-clamped", 4.6)):
        for k, stable in ((0.0, False), (5e-9, False), (9e-8, False), (1.2e-7, True), (2e-6, True)):
            angle, curvature = (0.0, 2.0 * k) if ends == "clamped" else (2.0 * k, 0.0)
            found = stability(Elastica((0, 0), angle, curvature, (1, 0), length), ends)
            assert found.stable == (found.least_eigenvalue > 0.0) == stable


# --- invariance ---


@pytest.mark.parametrize("ends", ENDS)
def test_similar_and_mirrored_rods_have_the_same_margin(ends):
    rng = np.random.default_rng(8)
    p = _random_rods(40, ends, 9)
    margin, least = margins(p, ends), least_eigenvalues(p, ends)
    moved = np.array([_somewhere(Elastica.from_parameters(row), rng).parameters for row in p])
    mirrored = p * np.array([1, -1, -1, -1, 1, -1, 1])
    for other in (moved, mirrored):
        np.testing.assert_allclose(margins(other, ends), margin, rtol=1e-8)
        np.testing.assert_allclose(least_eigenvalues(other, ends), least, rtol=1e-6, atol=1e-5)


def test_reversed_rods():
    """Clamped: another margin on the same side of 1. With pinned ends: the same one."""
    swapped = {"clamped": "clamped", "pinned": "pinned", "clamped-pinned": "pinned-clamped"}
    for ends, other in swapped.items():
        p = _random_rods(60, ends, 10)
        back = np.array([Elastica.from_parameters(row).reversed().parameters for row in p])
        one, two = margins(p, ends), margins(back, other)
        assert ((one > 1.0) == (two > 1.0))[np.abs(one - 1.0) > 1e-9].all()
        finite = np.isfinite(one) & np.isfinite(two)
        if ends == "clamped":
            assert (np.abs(two[finite] / one[finite] - 1.0) > 0.01).any()
        else:
            np.testing.assert_allclose(two[finite], one[finite], rtol=1e-6)
        np.testing.assert_allclose(least_eigenvalues(back, other), least_eigenvalues(p, ends), rtol=1e-6, atol=1e-5)


# --- the least eigenvalue ---


@pytest.mark.parametrize("ends", ENDS)
def test_least_eigenvalue_against_finite_differences(ends):
    p = _random_rods(16, ends, 13)
    coarse, fine = _least(p, ends, 200), _least(p, ends, 400)
    expected = (4.0 * fine - coarse) / 3.0  # without the error of second order
    size = 1.0 + np.hypot(p[:, 4], p[:, 5]) * p[:, 6] ** 2 + p[:, 3] ** 2 * p[:, 6] ** 2
    assert (np.abs(least_eigenvalues(p, ends) - expected) < 0.02 * np.abs(fine - coarse) + 1e-6 * size).all()


@pytest.mark.parametrize("ends", ENDS)
def test_least_eigenvalue_has_the_sign_of_the_margin(ends):
    """Down to 1e-7 on either side of margin 1, where the order of the spectral method shows."""
    p = _random_rods(60, ends, 14)
    for distance in (1e-3, 1e-6):
        for side in (-1.0, 1.0):
            if ends == "pinned":
                k = K_MEET - side * distance
                near = np.array([Elastica((0, 0), 2 * np.arcsin(k), 0, (1, 0), 2 * ellipk(k * k)).parameters])
            else:
                near = p[np.isfinite(margins(p, ends))].copy()
                if ends == "clamped-pinned":  # the pinned end stays where it is
                    near = np.array([Elastica.from_parameters(row).reversed().parameters for row in near])
                other = "pinned-clamped" if ends == "clamped-pinned" else ends
                near[:, 6] *= margins(near, other) / (1.0 + side * distance)
                if ends == "clamped-pinned":
                    near = np.array([Elastica.from_parameters(row).reversed().parameters for row in near])
            assert ((margins(near, ends) - 1.0) * side > 0.0).all()
            assert (least_eigenvalues(near, ends) * side > 0.0).all()


def test_least_eigenvalues_of_straight_rods_in_closed_form():
    """Without force: v″ + μv = const under ∫v = 0: (2π)², π², 4.4934²; a force along the rod shifts it."""
    for ends in ENDS:
        for force in (0.0, 30.0, -30.0):
            rod = [0.0, 0.0, 0.0, 0.0, force / 4.0, 0.0, 2.0]
            assert least_eigenvalues(rod, ends) == pytest.approx(STRAIGHT_Z[ends] ** 2 - force, rel=1e-9)


def test_least_eigenvalue_has_converged_for_long_rods():
    """1e-8 (1 + Φ²): the same rods at one and a half times the order."""
    rng = np.random.default_rng(15)
    for phase in (3.0, 12.0, 40.0, 80.0):
        for k in (0.3, 0.95, 1.0 - 1e-6, 1.2):
            row = Elastica.from_modulus(k, rng.uniform(-5, 5), phase / max(k, 1.0)).parameters[None]
            value = least_eigenvalues(row)
            more = module._least_of_one_order(row, 0, 36 + 12 * int(np.ceil(0.5 * phase)))
            assert abs(value - more)[0] < 1e-8 * (1.0 + phase**2)


def test_the_jump_of_the_pinned_margin():
    for k, expected in ((0.886113, 1.5204), (0.886114, 1.2065)):
        rod = Elastica((0, 0), 2 * np.arcsin(k), 0, (1, 0), 2 * ellipk(k * k))
        assert stability(rod, "pinned").margin == pytest.approx(expected, abs=1e-3)


# --- bad and special input ---


def test_bad_rows_are_nan_and_spoil_no_other():
    good = Elastica.from_modulus(0.5, 0.3, 2.0).parameters
    p = np.stack([good] * 6).reshape(2, 3, 7)
    p[0, 1, 4] = np.nan
    p[1, 0, 6] = 0.0
    p[1, 1, 2] = np.inf
    for function in (margins, least_eigenvalues):
        values = function(p)
        assert values.shape == (2, 3)
        assert np.isnan(values).tolist() == [[False, True, False], [True, True, False]]
        assert values[0, 0] == pytest.approx(values[1, 2], rel=1e-12)
        assert np.isnan(function(good, "pinned"))


def test_refusals():
    bent = Elastica((0, 0), 0.0, 1.0, (0, 0), 1.0)
    for ends in ENDS[1:]:
        with pytest.raises(InvalidInputError, match=r"pinned end; got κ·length = 1.*inflections"):
            stability(bent, ends)
    half = Elastica.from_modulus(0.6, -ellipk(0.36), 2.5)
    assert stability(half, "pinned-clamped").margin > 1.0
    with pytest.raises(InvalidInputError, match="pinned end"):
        stability(half, "clamped-pinned")
    with pytest.raises(InvalidInputError, match="'clamped', 'pinned'"):
        stability(bent, "free")
    with pytest.raises(InvalidInputError, match=r"shape \(…, 7\)"):
        margins(np.zeros((3, 6)))


def test_circles_and_the_separatrix():
    for turns in (0.01, 0.5, 1.0, 3.0):
        found = stability(Elastica((0, 0), 0.0, 2 * np.pi * turns, (0, 0), 1.0))
        assert found == Stability(True, np.inf, np.inf, found.least_eigenvalue)
        assert found.least_eigenvalue > 0.0
    for k in (1.0 - 1e-15, 1.0 - 1e-12, 1.0, 1.0 + 1e-15, 1.0 + 1e-9):
        found = stability(Elastica.from_modulus(k, -6.0, 12.0))
        assert found.stable
        assert found.least_eigenvalue > 0.0
