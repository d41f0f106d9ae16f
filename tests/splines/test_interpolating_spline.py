"""Interpolating splines: their equations by independent measures, the figures of Levien2009 ch. 4, and what they refuse."""

import numpy as np
import pytest
from scipy.optimize import brentq

from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError, NoSolutionError
from batten.splines.interpolating_spline import METHODS, interpolating_spline

OPEN = np.array([[0.0, 0.0], [1.0, 0.6], [2.2, 0.2], [3.0, 1.0], [4.0, 0.8]])
RING = np.array([[0.0, 0.0], [2.0, -0.4], [3.0, 0.8], [1.6, 2.0], [0.1, 1.2]])
JOINED = ("euler", "mec", "log-aesthetic", "kurgla1")


def _circle(n: int) -> np.ndarray:
    a = 2.0 * np.pi * np.arange(n) / n
    return np.stack([np.cos(a), np.sin(a)], axis=1)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("closed", [False, True])
def test_every_spline_passes_through_its_points_with_a_common_tangent(method, closed):
    points = RING if closed else OPEN
    spline = interpolating_spline(points, method, closed=closed)
    assert spline.status == "converged"
    assert spline.message == ""
    assert len(spline.segments) == len(points) - (not closed)
    for i, segment in enumerate(spline.segments):
        np.testing.assert_allclose(segment.point(0.0), points[i], atol=1e-13)
        np.testing.assert_allclose(segment.point(1.0), points[(i + 1) % len(points)], atol=1e-13)
    assert np.abs(spline.curve.joints().tangent_jumps).max() < 1e-11


@pytest.mark.parametrize("method", [*JOINED, "circle"])
@pytest.mark.parametrize("closed", [False, True])
def test_curvature_is_continuous_where_the_method_says_so(method, closed):
    spline = interpolating_spline(RING if closed else OPEN, method, closed=closed)
    assert np.abs(spline.curve.joints().curvature_jumps).max() < (1e-8 if method == "circle" else 1e-12)
    if not closed and method in JOINED:
        for segment, t in ((spline.segments[0], 0.0), (spline.segments[-1], 1.0)):
            assert np.abs(segment.derivative(t, 2)).max() < 1e-12


@pytest.mark.parametrize("method", ["euler", "log-aesthetic", "kurgla1", "circle", "ikarus"])
def test_roundness(method):
    """Points on a circle give the circle (Levien2009 Table 4.1)."""
    angles = np.sort(np.random.default_rng(4).uniform(0.0, 2.0 * np.pi, 9))
    points = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    if method == "ikarus":  # its tangents are those of cubics: only equal distances have the circle's
        points = _circle(9)
    curve = interpolating_spline(points, method, closed=True).curve
    assert np.abs(np.hypot(*curve.point(np.linspace(0.0, 1.0, 400)).T) - 1.0).max() < 1e-12


def test_the_mec_is_not_round_by_as_much_as_levien_says():
    """Containing radius 1.035 for the triangle, 1.009 for the square (§4.2.1), then falling as n⁻⁴."""
    radius = [
        np.hypot(*interpolating_spline(_circle(n), "mec", closed=True).curve.point(np.linspace(0, 1, 24 * n)).T).max()
        for n in (3, 4, 16, 32)
    ]
    assert radius[:2] == pytest.approx([1.035, 1.009], abs=5e-4)
    assert np.log2((radius[2] - 1.0) / (radius[3] - 1.0)) == pytest.approx(4.0, abs=0.05)


def test_hobbys_error_on_the_circle_falls_as_the_sixth_power():
    error = [
        np.abs(
            np.hypot(
                *interpolating_spline(_circle(n), "hobby", closed=True).segments[0].point(np.linspace(0, 1, 200)).T
            )
            - 1.0
        ).max()
        for n in (8, 16)
    ]
    assert np.log2(error[0] / error[1]) == pytest.approx(6.0, abs=0.1)


@pytest.mark.parametrize("method", JOINED[:3])
def test_extensionality(method):
    """A point of the curve added to the points changes nothing, for splines cut from a generating curve (Theorem 1)."""
    spline = interpolating_spline(OPEN, method)
    extra = spline.segments[2].point(0.37)
    again = interpolating_spline(np.insert(OPEN, 3, extra, axis=0), method)
    for segment, t in ((again.segments[0], 0.5), (again.segments[4], 0.5)):
        place = segment.point(t)
        own = spline.segments[0 if segment is again.segments[0] else 3].point(t)
        np.testing.assert_allclose(place, own, atol=1e-10)
    assert np.abs(again.curve.joints().curvature_jumps).max() < 1e-11


def test_kurgla_is_not_extensional():
    spline = interpolating_spline(OPEN, "kurgla1")
    again = interpolating_spline(np.insert(OPEN, 3, spline.segments[2].point(0.37), axis=0), "kurgla1")
    assert 1e-6 < np.abs(again.segments[0].point(0.5) - spline.segments[0].point(0.5)).max() < 1e-2


def test_the_mec_has_the_least_energy_and_its_supports_pull_across_the_rod():
    """Nearby splines with other tangents have more energy; the force jumps along the normal at each point (§3.10)."""
    spline = interpolating_spline(OPEN, "mec")
    least = spline.bending_energy()
    for method in ("euler", "kurgla1", "hobby", "log-aesthetic", "lagrange", "circle"):
        assert interpolating_spline(OPEN, method).bending_energy() > least
    for before, after in zip(spline.segments[:-1], spline.segments[1:], strict=True):
        assert isinstance(before, Elastica)
        assert isinstance(after, Elastica)
        tangent = np.array([np.cos(after.start_angle), np.sin(after.start_angle)])
        jump = after.force - before.force
        assert abs(jump @ tangent) < 1e-11 * (1.0 + np.hypot(*jump))
        assert np.hypot(*jump) > 0.1


def _falloff(exponent: float) -> float:
    """Ratio of the angles of a nearly straight segment of κ = sign(s)|s|^α with κ₀θ₁ = κ₁θ₀ (§4.8.2), by one root."""
    a = exponent

    def ends(w: float) -> tuple[float, float]:
        p, q = w - 0.5, w + 0.5
        height = (np.sign(q) * abs(q) ** (a + 2) - np.sign(p) * abs(p) ** (a + 2)) / ((a + 1) * (a + 2))
        first, last = abs(p) ** (a + 1) / (a + 1) - height, abs(q) ** (a + 1) / (a + 1) - height
        return np.sign(p) * abs(p) ** a * last - np.sign(q) * abs(q) ** a * first, abs(first / last)

    return ends(brentq(lambda w: ends(w)[0], 0.05, 0.45))[1]


def test_falloff_of_the_euler_spiral_is_leviens_and_that_of_1_78_is_not():
    """1/(2 + √3) = 0.268; the printed 0.173 belongs to α = 1.73, at 1.78 it is 0.169."""
    assert _falloff(1.0) == pytest.approx(1.0 / (2.0 + np.sqrt(3.0)), abs=1e-12)
    assert _falloff(1.78) == pytest.approx(0.16897, abs=1e-5)
    assert _falloff(1.732) == pytest.approx(0.173, abs=5e-5)


@pytest.mark.parametrize(("method", "exponent"), [("euler", 1.0), ("mec", 1.0), ("log-aesthetic", 1.78)])
def test_a_moved_point_is_felt_less_from_crest_to_crest(method, exponent):
    """Angles along a straight row of points of which one is moved a little (§4.8.2)."""
    points = np.stack([np.arange(25.0), np.zeros(25)], axis=1)
    points[12, 1] = 1e-3
    spline = interpolating_spline(points, method, exponent=exponent)
    start = np.abs(spline.angles[13:17, 0])
    np.testing.assert_allclose(start[1:] / start[:-1], _falloff(exponent), rtol=1e-5)


def test_end_conditions_hold():
    for end, measure in [
        (0.4, lambda s, t: np.arctan2(*s.derivative(t)[::-1]) - 0.4),
        (("curvature", 0.7), lambda s, t: s.curvature_at(t * s.length) - 0.7),
        ("arc", lambda s, t: s.curvature_at(0.0) - s.curvature_at(s.length)),
    ]:
        spline = interpolating_spline(OPEN, "euler", start=end, end=end)
        assert measure(spline.segments[0], 0.0) == pytest.approx(0.0, abs=1e-12)
        assert measure(spline.segments[-1], 1.0) == pytest.approx(0.0, abs=1e-12)


def test_corners_split():
    spline = interpolating_spline(RING, closed=True, corners=[1, 3])
    jumps = spline.curve.joints().tangent_jumps  # at points 2 … 5 of the run that starts at the first corner
    assert len(spline.segments) == 5
    assert np.allclose(spline.segments[0].point(0.0), RING[1])
    assert np.flatnonzero(np.abs(jumps) > 1e-6).tolist() == [1]
    parts = interpolating_spline(OPEN, corners=[2])
    alone = interpolating_spline(OPEN[:3])
    np.testing.assert_allclose(parts.segments[1].point(0.3), alone.segments[1].point(0.3), atol=1e-14)


def test_random_points_always_have_an_euler_spline_and_windings_are_marked():
    random = np.random.default_rng(11)
    found = {"converged": 0, "higher winding": 0}
    for _ in range(150):
        points = random.uniform(0.0, 1.0, (random.integers(3, 31), 2))
        closed = bool(random.integers(2))
        spline = interpolating_spline(points, closed=closed)
        found[spline.status] += 1
        chords = np.hypot(*np.diff(np.vstack([points, points[:1]]), axis=0).T)
        worst = max(
            np.hypot(*(s.point(1.0) - points[(i + 1) % len(points)])) / s.length for i, s in enumerate(spline.segments)
        )
        assert worst < 1e-12
        jumps = spline.curve.joints()
        assert np.abs(jumps.tangent_jumps).max() < 1e-9
        assert np.abs(jumps.curvature_jumps).max() * chords.min() < 1e-9
        turns = np.array([s.end_angle - s.start_angle for s in spline.segments])
        assert np.abs(turns).max() < 2.0 * np.pi
        if spline.status == "converged":
            assert np.abs(spline.angles).max() <= np.pi + 1e-9
            assert not spline.message
        else:
            assert "loop" in spline.message
    assert min(found.values()) > 20


def test_where_the_mec_does_not_exist_the_segment_is_named_or_the_euler_spiral_taken():
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.2, 0.6], [1.2, 0.9]])
    with pytest.raises(NoSolutionError, match=r"from point \d to point \d.*put a point between"):
        interpolating_spline(points, "mec")
    spline = interpolating_spline(points, "mec", fallback=True)
    assert (spline.method, spline.asked, spline.status) == ("euler", "mec", "converged")
    assert "Euler spiral spline in its place" in spline.message
    assert spline.blame >= 0


@pytest.mark.parametrize("method", METHODS)
def test_similarity_mirror_and_reversal_change_nothing(method):
    spline = interpolating_spline(OPEN, method)
    t = np.array([0.2, 0.7])
    turned = 3.0 * OPEN @ np.array([[0.6, 0.8], [-0.8, 0.6]]) + [5.0, -2.0]
    mirrored = OPEN * [1.0, -1.0]
    for points, back in [
        (turned, lambda p: ((p - [5.0, -2.0]) / 3.0) @ np.array([[0.6, -0.8], [0.8, 0.6]])),
        (mirrored, lambda p: p * [1.0, -1.0]),
    ]:
        other = interpolating_spline(points, method)
        np.testing.assert_allclose(back(other.segments[1].point(t)), spline.segments[1].point(t), atol=1e-9)
    other = interpolating_spline(OPEN[::-1], method)
    np.testing.assert_allclose(other.segments[2].point(0.5), spline.segments[1].point(0.5), atol=2e-3)
    if method in JOINED:
        np.testing.assert_allclose(other.segments[2].point(0.5), spline.segments[1].point(0.5), atol=1e-10)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"points": [[0, 0]]}, "n ≥ 2"),
        ({"points": [[0, 0], [1, 0]], "closed": True}, "n ≥ 3"),
        ({"points": [[0, 0], [0, 0], [1, 0]]}, "points 0 and 1 are the same"),
        ({"points": [[0, 0], [1, 0], [0, 1], [0, 0]], "closed": True}, "last point of a closed spline"),
        ({"points": [[0, 0], [np.nan, 0]]}, "finite"),
        ({"points": OPEN, "method": "cubic"}, "allowed are euler"),
        ({"points": OPEN, "start": "flat"}, "'natural', 'arc'"),
        ({"points": OPEN, "corners": [9]}, "0 to 4"),
        ({"points": OPEN, "method": "circle", "start": 0.3}, "leave start and end out"),
        ({"points": OPEN, "method": "log-aesthetic", "exponent": 0.0}, "0.05 to 20"),
        ({"points": OPEN, "method": "hobby", "tension": 0.5}, "from 0.75"),
    ],
)
def test_bad_input_is_refused_in_words(arguments, words):
    with pytest.raises(InvalidInputError, match=words):
        interpolating_spline(**arguments)
