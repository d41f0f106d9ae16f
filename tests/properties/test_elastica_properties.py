"""What must hold for every elastica, line, circle and loop: symmetries, parts, energies, the papers' parameters."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from batten.curves.elastica import Elastica
from batten.curves.similarity import Similarity

FRACTIONS = np.linspace(0.0, 1.0, 9)
quick = settings(deadline=None, max_examples=120, derandomize=True)


def _signed(smallest, largest):
    """Zero, or ± a power of ten with an exponent from the range: near-degenerate values as likely as ordinary ones."""
    sized = st.builds(
        lambda sign, e, m: sign * m * 10.0**e, st.sampled_from((-1, 1)), st.integers(smallest, largest), st.floats(1, 9)
    )
    return st.one_of(st.just(0.0), sized)


ANGLES = st.one_of(
    st.floats(-math.pi, math.pi), st.sampled_from((0.0, math.pi / 2, math.pi, -math.pi / 2, 1e-9, math.pi - 1e-9))
)


@st.composite
def elastica(draw, loaded=False):
    """Up to two full turns or seven waves, at a scale from 1e-3 to 1e3; lines, circles and k = 1 among them."""
    length = draw(st.sampled_from((1.0, 1e-3, 1e3, 0.7)))
    kind = draw(st.sampled_from(("any", "aligned", "separatrix")))
    angle, direction = draw(ANGLES), draw(ANGLES)
    curvature = draw(_signed(-12, 0)) / length
    size = draw(st.floats(1e-3, 80)) if loaded else abs(draw(_signed(-14, 1)))
    size /= length**2
    if kind == "aligned":
        angle, direction = 0.0, draw(st.sampled_from((0.0, math.pi)))
    if kind == "separatrix":
        curvature = draw(st.sampled_from((-2, 2))) * math.sqrt(size) * math.cos((angle - direction) / 2)
    force = (size * math.cos(direction), size * math.sin(direction) if direction != math.pi else 0.0)
    start = (draw(st.floats(-3, 3)) * length, draw(st.floats(-3, 3)) * length)
    return Elastica(start=start, start_angle=angle, start_curvature=curvature, force=force, length=length)


def _greatest_curvature(curve):
    """A bound for |κ| on the whole curve: κ² = κ₀² + 2λ(cos ψ − cos ψ₀)."""
    return abs(curve.start_curvature) + 2 * math.sqrt(np.linalg.norm(curve.force))


def _growth(curve):
    """How much a small change of the numbers may grow along the curve."""
    return math.exp(min(60.0, math.sqrt(np.linalg.norm(curve.force)) * curve.length))


def _same(one, other, tolerance=1e-13, s=None):
    s = one.length * FRACTIONS if s is None else s
    allowed = tolerance * _growth(one)
    np.testing.assert_allclose(other.point_at(s), one.point_at(s), atol=allowed * 4 * one.length, rtol=0)
    turn = 1 + _greatest_curvature(one) * one.length
    whole_turns = 2 * math.pi * round((other.start_angle - one.start_angle) / (2 * math.pi))
    np.testing.assert_allclose(other.angle_at(s), one.angle_at(s) + whole_turns, atol=allowed * turn, rtol=0)
    size = _greatest_curvature(one) + 1 / one.length
    np.testing.assert_allclose(other.curvature_at(s), one.curvature_at(s), atol=allowed * size, rtol=0)


def _same_energy(curve, other):
    """Equal to 1e-9, or as far as the rounding of the start values, grown along the curve, changes √∫κ² ds."""
    energy = curve.bending_energy()
    noise = 1e-14 * _growth(curve) * _greatest_curvature(curve) * math.sqrt(curve.length)
    assert abs(other - energy) <= 1e-9 * energy + 4 * noise * math.sqrt(energy) + noise**2


def _rounding(form):
    """Near k = 1 the rounding of k and s₀ grows from the apex to s₀ as the curves part: exp |s₀| at most."""
    return 1e-11 + 4e-16 * math.exp(min(700.0, abs(form.s0)))


@quick
@given(elastica())
def test_curvature_is_affine_in_position_and_the_speed_is_one(curve):
    s = curve.length * FRACTIONS
    away = curve.point_at(s) - curve.start
    affine = curve.start_curvature + away[:, 0] * curve.force[1] - away[:, 1] * curve.force[0]
    size = _greatest_curvature(curve) + np.linalg.norm(curve.force) * curve.length
    np.testing.assert_allclose(curve.curvature_at(s), affine, atol=1e-13 * size, rtol=0)
    # κ²/2 − F·t is constant: the rod's first integral.
    energy = curve.curvature_at(s) ** 2 / 2 - np.cos(curve.angle_at(s)) * curve.force[0]
    energy -= np.sin(curve.angle_at(s)) * curve.force[1]
    np.testing.assert_allclose(energy, energy[0], atol=1e-13 * (size**2 + 1e-300), rtol=0)


@quick
@given(elastica())
def test_tangent_is_the_derivative_of_position_and_curvature_that_of_angle(curve):
    """By Gauss quadrature over short stretches: ∫(cos θ, sin θ) ds = Δγ, ∫κ ds = Δθ."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    edges = np.linspace(0, curve.length, 9)
    half = (edges[1] - edges[0]) / 2
    s = edges[:-1, None] + half * (1 + nodes)
    angle = curve.angle_at(s)
    assert angle.shape == s.shape
    steps = half * np.stack([np.cos(angle) @ weights, np.sin(angle) @ weights], axis=-1)
    np.testing.assert_allclose(np.diff(curve.point_at(edges), axis=0), steps, atol=1e-14 * 4 * curve.length, rtol=0)
    turned = half * (curve.curvature_at(s) @ weights)
    np.testing.assert_allclose(np.diff(curve.angle_at(edges)), turned, atol=1e-13 * _growth(curve), rtol=0)


@quick
@given(elastica(), st.sampled_from((1e-3, 0.3, 1.0, 7.0, 1e3)), ANGLES, st.floats(-5, 5), st.floats(-5, 5))
def test_similarities_carry_points_over(curve, scale, rotation, x, y):
    similarity = Similarity(scale=scale, rotation=rotation, translation=(x * curve.length, y * curve.length))
    image = curve.transformed(similarity)
    assert image.length == pytest.approx(scale * curve.length, rel=1e-15)
    s = curve.length * FRACTIONS
    cos, sin = math.cos(rotation), math.sin(rotation)
    turned = curve.point_at(s) @ np.array([[cos, sin], [-sin, cos]])
    expected = scale * turned + curve.length * np.array([x, y])
    allowed = 1e-14 * _growth(curve) * (6 + 6 * scale) * curve.length
    np.testing.assert_allclose(image.point_at(scale * s), expected, atol=allowed, rtol=0)


@quick
@given(elastica(), st.sampled_from((1e-3, 0.3, 7.0)))
def test_energy_scales_as_one_over_length(curve, scale):
    image = curve.transformed(Similarity(scale=scale, rotation=0.0, translation=(0.0, 0.0)))
    _same_energy(curve, image.bending_energy() * scale)


@quick
@given(elastica())
def test_energy_is_the_integral_of_squared_curvature(curve):
    nodes, weights = np.polynomial.legendre.leggauss(20)
    half = curve.length / 16
    s = np.arange(8)[:, None] * 2 * half + half * (1 + nodes)
    quadrature = half * (curve.curvature_at(s) ** 2 @ weights).sum()
    _same_energy(curve, quadrature)


@quick
@given(elastica())
def test_reversed_runs_the_same_points_back(curve):
    back = curve.reversed()
    assert back.length == curve.length
    s = curve.length * FRACTIONS
    tolerance = 1e-13 * _growth(curve)
    np.testing.assert_allclose(
        back.point_at(curve.length - s), curve.point_at(s), atol=4 * tolerance * curve.length, rtol=0
    )
    size = _greatest_curvature(curve) + 1 / curve.length
    np.testing.assert_allclose(
        back.curvature_at(curve.length - s), -curve.curvature_at(s), atol=tolerance * size, rtol=0
    )
    turn = np.exp(1j * (back.angle_at(curve.length - s) - curve.angle_at(s)))
    np.testing.assert_allclose(turn, -1, atol=tolerance * (1 + size * curve.length), rtol=0)
    _same(curve, back.reversed(), 1e-12)


@quick
@given(elastica(), st.floats(0.01, 0.99))
def test_split_parts_make_up_the_whole(curve, at):
    first, second = curve.split(at * curve.length)
    assert first.length + second.length == pytest.approx(curve.length, rel=1e-15)
    s = curve.length * FRACTIONS
    _same(curve, first, s=s)
    np.testing.assert_allclose(
        second.point_at(s - at * curve.length), curve.point_at(s), atol=4e-13 * _growth(curve) * curve.length, rtol=0
    )
    _same_energy(curve, first.bending_energy() + second.bending_energy())


@quick
@given(elastica(), st.floats(0, 0.5), st.floats(0, 0.5))
def test_extended_holds_the_same_curve(curve, before, after):
    longer = curve.extended(before * curve.length, after * curve.length)
    assert longer.length == pytest.approx((1 + before + after) * curve.length, rel=1e-15)
    s = curve.length * FRACTIONS
    inside = longer.point_at(s + before * curve.length)
    allowed = 4e-13 * _growth(longer) * longer.length
    np.testing.assert_allclose(inside, curve.point_at(s), atol=allowed, rtol=0)
    np.testing.assert_allclose(longer.force, curve.force, rtol=1e-15)


@quick
@given(elastica())
def test_inflections_are_the_sign_changes_of_curvature(curve):
    found = curve.inflections()
    assert np.all(np.diff(found) > 0)
    assert np.all((found >= 0) & (found <= curve.length))
    size = _greatest_curvature(curve)
    assert np.all(np.abs(curve.curvature_at(found)) <= 1e-12 * size * _growth(curve))
    s = np.linspace(0, curve.length, 257)
    kappa = curve.curvature_at(s)
    clear = np.abs(kappa) > 1e-9 * size
    changes = np.count_nonzero(np.diff(np.sign(kappa[clear])) != 0)
    assert changes <= found.size <= changes + 2  # one more, or two, may hide at the ends


@quick
@given(
    st.one_of(
        st.floats(1e-6, 0.999),
        st.floats(1.001, 1e3),
        st.builds(lambda s, e: 1 + s * 10.0**-e, st.sampled_from((-1, 1)), st.integers(3, 13)),
    ),
    st.floats(-0.95, 0.95),
    st.floats(0.05, 3),
    st.sampled_from((1e-3, 1.0, 1e3)),
    ANGLES,
    st.booleans(),
)
def test_modulus_form_goes_round(k, phase, waves, scale, rotation, backwards):
    """Parameters → curve → parameters, and the curve they name is the papers' own: S R_φ ζ_k(s₀ + ℓ t)."""
    quarter = math.pi / 2 / max(1.0, k) if abs(k - 1) > 0.3 else 1.5
    s0, ell = 2 * phase * quarter if k < 1 else phase * quarter, waves * quarter
    if backwards:
        ell = -ell
    curve = Elastica.from_modulus(k, s0, ell, scale, rotation, (scale, -2 * scale))
    again = curve.to_modulus()
    assert curve.length == pytest.approx(abs(ell) * scale, rel=1e-15)
    rounded = 1e-12 + 4e-15 / min(1.0, k)  # the start angle, stored to 16 digits, swings by 4k at most
    assert again.k == pytest.approx(k, rel=rounded)
    assert again.scale == pytest.approx(scale, rel=1e-12)
    if not backwards or k > 1:  # with inflections, the opposite orientation is a rotation by π (Brander2016, note 1)
        assert again.ell == pytest.approx(ell, rel=1e-12)
        assert math.cos(again.rotation - rotation) == pytest.approx(1, abs=1e-12)
    _same(curve, Elastica.from_modulus(*again), _rounding(again))
    # κ = (2k/S) cn(s₀ + ℓt), Brander2016 (4), at the start through the first integral: cn² = 1 − sin²(ψ/2)/k².
    cn = curve.start_curvature * scale / (2 * k)
    psi = curve.start_angle - again.rotation + (math.pi if again.ell < 0 else 0.0)
    assert cn**2 + (math.sin(psi / 2) / k) ** 2 == pytest.approx(1, abs=rounded)


@quick
@given(elastica(loaded=True))
def test_stored_curve_to_modulus_and_back(curve):
    force = np.linalg.norm(curve.force)
    form = curve.to_modulus()
    assume(form.k > 1e-6 and math.isfinite(form.s0))  # a line in tension lies at the end of an infinite s₀
    assert form.scale == pytest.approx(1 / math.sqrt(force), rel=1e-14)
    assert abs(form.ell) * form.scale == pytest.approx(curve.length, rel=1e-14)
    _same(curve, Elastica.from_modulus(*form), _rounding(form) * (1 + form.k) / min(1.0, form.k))


@settings(quick, max_examples=40)
@given(elastica(), st.sampled_from((1e-2, 1e-4, 1e-7)))
def test_beziers_stay_within_the_tolerance(curve, tolerance):
    pieces = curve.to_beziers(tolerance * curve.length)
    ends = [np.asarray(piece.point(np.array([0.0, 1.0]))) for piece in pieces]
    joints = np.array([end[1] for end in ends[:-1]] + [ends[-1][1]])
    np.testing.assert_allclose(ends[0][0], curve.point_at(0.0), atol=1e-13 * curve.length, rtol=0)
    np.testing.assert_allclose(ends[-1][1], curve.point_at(curve.length), atol=1e-13 * curve.length, rtol=0)
    for joint, following in zip(joints[:-1], ends[1:], strict=True):
        np.testing.assert_allclose(joint, following[0], atol=1e-13 * curve.length, rtol=0)
    # Every point of every piece lies near the curve: nearest of a fine polyline, corrected for its sagitta.
    s = np.linspace(0, curve.length, 4001)
    fine, step = curve.point_at(s), s[1]
    for piece in pieces[:: max(1, len(pieces) // 6)]:
        for point in piece.point(np.linspace(0, 1, 13)):
            i = int(np.argmin(np.linalg.norm(fine - point, axis=1)))
            tangent = np.array([math.cos(curve.angle_at(s[i])), math.sin(curve.angle_at(s[i]))])
            away = point - fine[i]
            across = abs(
                tangent[0] * away[1] - tangent[1] * away[0] - 0.5 * curve.curvature_at(s[i]) * (tangent @ away) ** 2
            )
            slack = (_greatest_curvature(curve) + np.linalg.norm(curve.force) * curve.length) ** 2 * step**3
            assert across <= tolerance * curve.length + slack
