"""Segments cut from a curve that the caller gives, against the families that batten knows in closed form."""

import numpy as np
import pytest
from scipy.special import ellipj

from batten.curves.base import Curve
from batten.errors import InvalidInputError, NoSolutionError
from batten.splines.generating_curve import GeneratingCurve
from batten.splines.interpolating_spline import interpolating_spline
from batten.splines.segment_family import EulerSpirals, LogAesthetic, SlidingElastica

OPEN = np.array([[0.0, 0.0], [1.0, 0.6], [2.2, 0.2], [3.0, 1.0], [4.0, 0.8]])
ANGLES = np.random.default_rng(0).uniform(-1.1, 1.1, (60, 2))


def _away_from_arcs(angles: np.ndarray) -> np.ndarray:
    return angles[np.abs(angles.sum(axis=1)) > 0.1]


@pytest.mark.parametrize(
    ("generator", "family"),
    [
        (GeneratingCurve(lambda s: s, -5.0, 5.0), EulerSpirals()),
        (GeneratingCurve(lambda s: np.sign(s) * np.abs(s) ** 1.78, -4.0, 4.0), LogAesthetic(1.78)),
        # The rectangular elastica: κ = √2 cn(s | ½) for force 1.
        (GeneratingCurve(lambda s: np.sqrt(2.0) * ellipj(s, 0.5)[1], -4.0, 4.0), SlidingElastica()),
    ],
)
def test_known_curves_give_the_known_families(generator, family):
    angles = np.concatenate([_away_from_arcs(ANGLES), 1e-3 * _away_from_arcs(ANGLES)[:10]])
    chords = np.ones(len(angles))
    ours, known = generator.ends(angles, chords), family.ends(angles, chords)
    assert ours.exists.all()
    np.testing.assert_allclose(ours.curvatures, known.curvatures, atol=1e-9)
    np.testing.assert_allclose(ours.slopes, known.slopes, atol=2e-4)


def test_from_what_is_known_it_goes_on_to_angles_nearby():
    generator = GeneratingCurve(lambda s: s, -5.0, 5.0)
    angles = _away_from_arcs(ANGLES)
    chords = np.ones(len(angles))
    before = generator.ends(angles, chords)
    after = generator.ends(angles + 1e-3, chords, before.memory)
    assert after.exists.all()
    np.testing.assert_allclose(after.memory[0], before.memory[0], atol=0.05)


def test_a_spline_from_it_is_that_of_the_family_and_a_curve():
    ours = interpolating_spline(OPEN, GeneratingCurve(lambda s: s, -6.0, 6.0, name="own spiral"))
    known = interpolating_spline(OPEN, "euler")
    assert (ours.method, ours.asked, ours.status) == ("own spiral", "own spiral", "converged")
    t = np.linspace(0.0, 1.0, 9)
    for a, b in zip(ours.segments, known.segments, strict=True):
        assert isinstance(a, Curve)
        np.testing.assert_allclose(a.point(t), b.point(t), atol=1e-10)
        np.testing.assert_allclose(a.derivative(t, 2), b.derivative(t, 2), atol=1e-8)
        np.testing.assert_allclose(a.derivative(t, 3), b.derivative(t, 3), atol=1e-5)
        assert a.length == pytest.approx(b.length, rel=1e-11)


def test_a_curve_without_symmetry_is_mirrored_and_run_backwards():
    """κ = eˢ − 1 bends unlike on its two sides; still every piece joins with equal curvature."""
    spline = interpolating_spline(OPEN, GeneratingCurve(lambda s: np.exp(s) - 1.0, -4.0, 2.5), start=0.9, end=-0.6)
    assert np.abs(spline.curve.joints().curvature_jumps).max() < 1e-8
    runs = {(s.first < s.last, s.mirrored) for s in spline.segments}
    assert len(runs) > 1


def test_what_the_curve_cannot_do_is_said():
    angle = 2.0 * np.pi * np.arange(6) / 6
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    with pytest.raises(NoSolutionError, match="short spiral"):
        interpolating_spline(ring, GeneratingCurve(lambda s: s, -1.0, 1.0, name="short spiral"), closed=True)
    with pytest.raises(InvalidInputError, match="ascending"):
        GeneratingCurve(lambda s: s, 1.0, 0.0)
    with pytest.raises(InvalidInputError, match="finite there"):
        GeneratingCurve(lambda s: 1.0 / s, -1.0, 1.0)
    with pytest.raises(InvalidInputError, match="shape"):
        GeneratingCurve(lambda s: np.zeros(3), -1.0, 1.0)
