"""The criteria of control polygons against plain geometry, scipy's periodic spline, and the published statistics."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.path import Path
from scipy.interpolate import CubicSpline

from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError
from batten.kernels.bezier_criteria import ZONE_BORDER, in_zone
from batten.measures.lambda_residual import lambda_residual
from batten.solvers.bezier_criteria import (
    ANGLE_LIMITS,
    WIDE_ANGLE_LIMITS,
    bezier_criteria,
    is_elastica_like,
)

TURN = 2.0 * math.pi
GIVEN = [(1.05, 1.05), (1.9, 1.3), (math.pi, 1.35), (4.3, 1.3), (5.2, TURN - 5.2)]


def disc(count, seed):
    """Random control points, uniform in the unit disc."""
    rng = np.random.default_rng(seed)
    radius, angle = np.sqrt(rng.random((count, 4))), TURN * rng.random((count, 4))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def from_angles(beta1, beta2, l1, l2):
    """Control points in standard position."""
    p1 = (-l1 * math.cos(beta1), l1 * math.sin(beta1))
    return [(0, 0), p1, (1 + l2 * math.cos(beta2), l2 * math.sin(beta2)), (1, 0)]


def test_angles_and_edges_are_those_of_plain_geometry():
    control = disc(2000, 1)
    found = bezier_criteria(control)
    z = control @ [1, 1j]
    p = (z - z[:, :1]) / (z[:, 3:] - z[:, :1])
    first, middle, last = (p[:, i + 1] - p[:, i] for i in range(3))
    wanted = [math.pi - np.angle(first), np.angle(-last), np.angle(-middle / first), np.angle(-last / middle)]
    for got, angle in zip([*found.beta.T, *found.phi.T], wanted, strict=True):
        assert ((got >= 0) & (got < TURN)).all()
        assert np.abs(np.exp(1j * got) - np.exp(1j * angle)).max() < 1e-12
    assert found.edges == pytest.approx(np.abs([first, last]).T, rel=1e-13)
    # An angle lies between 0 and π where the polygon turns right.
    right = (first.conj() * middle).imag < 0
    assert (right == (found.phi[:, 0] < math.pi)).all()
    assert (found.inflectional == (right != ((middle.conj() * last).imag < 0))).all()


def test_the_sum_of_the_inner_angles_does_not_depend_on_the_edges():
    found = bezier_criteria(disc(2000, 2))
    off = found.phi.sum(axis=-1) - found.beta.sum(axis=-1)
    assert np.abs(off - TURN * np.round(off / TURN)).max() < 1e-12


def test_vertical_legs_and_the_reading_of_the_last_edge():
    """Brander2018 §5.1: both outer edges are vectors from the end; vertical legs have Δ = 0."""
    for up in (1, -1):
        found = bezier_criteria([(0, 0), (0, up), (1, up), (1, 0)])
        assert found.edge_limits == pytest.approx([0.4, 1.2])
        outwards = bezier_criteria([(0, 0), (-0.2, up), (1.2, up), (1, 0)]).edge_limits
        inwards = bezier_criteria([(0, 0), (0.1, up), (0.9, up), (1, 0)]).edge_limits
        assert (outwards > found.edge_limits + 0.1).all()
        assert (inwards < found.edge_limits).all()
        # With the last edge as it runs Δ would be −1 for every upright arch, and legs of one chord too long.
        assert found.lengths_1


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize(
    ("name", "inside", "outside"),
    [
        ("angles_1", (math.pi / 3 + 1e-9, 2.0, 0.5, 0.5), (math.pi / 3 - 1e-9, 2.0, 0.5, 0.5)),
        ("angles_1", (4.0, 5 * math.pi / 3 - 1e-9, 0.5, 0.5), (4.0, 5 * math.pi / 3 + 1e-9, 0.5, 0.5)),
        ("angles_2", (1.3, 1.3 + 0.4 * math.pi - 1e-9, 0.5, 0.5), (1.3, 1.3 + 0.4 * math.pi + 1e-9, 0.5, 0.5)),
        ("lengths_1", (1.5, 1.5, 0.5081689, 0.9), (1.5, 1.5, 0.5081688, 0.9)),
        ("lengths_1", (1.6, 1.6, 0.5, 1.088), (1.6, 1.6, 0.5, 1.089)),
        ("lengths_1", (2.5, 2.5, 0.270001, 0.3), (2.5, 2.5, 0.269999, 0.3)),
        ("lengths_1", (2.5, 2.5, 0.3, 0.579999), (2.5, 2.5, 0.3, 0.580001)),
        ("lengths_2", (3.3, 3.0, 0.3, 0.3899), (3.3, 3.0, 0.3, 0.3901)),
    ],
)
def test_each_constraint_at_its_limit(name, inside, outside, mirror):
    # β = 1.5: Δ = 1 − 3/π, Lmin = 0.50816882; β = 1.6: Δ = 1 − 3.2/π, Lmax = 1.08845.
    for polygon, holds in ((inside, True), (outside, False)):
        control = np.array(from_angles(*polygon)) * [1, -1 if mirror else 1]
        for direction in (control, control[::-1]):
            assert getattr(bezier_criteria(direction), name) == holds


def test_relaxed_angle_limits():
    control = from_angles(0.8, 2.4, 0.5, 0.5)
    assert not bezier_criteria(control).angles_1
    assert not bezier_criteria(control).angles_2
    wide = bezier_criteria(control, angle_limits=WIDE_ANGLE_LIMITS)
    assert wide.angles_1
    assert wide.angles_2


def test_polygons_that_meet_themselves():
    def side(a, b, c):
        u, v = b - a, c - a
        return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] > 0

    p = disc(20000, 3).transpose(1, 0, 2)
    crosses = (side(p[0], p[1], p[2]) != side(p[0], p[1], p[3])) & (side(p[2], p[3], p[0]) != side(p[2], p[3], p[1]))
    assert (bezier_criteria(p.transpose(1, 0, 2)).simple == ~crosses).all()
    along = [(0.6, 0.7), (0.7, 0.7), (0.8, 0.7), (0.9, 1.5), (1.1, 1.5), (-1, -0.1), (-1, 0.1), (-1, 2)]
    line = [[(0, 0), (x, 0), (y, 0), (1, 0)] for x, y in along]
    assert bezier_criteria(line).simple.tolist() == [True, False, False, True, False, False, True, True]


@pytest.mark.parametrize(("power", "most"), [(0.5, 1e-9), (0.0, 0.03), (1.0, 0.03)])
def test_the_zone_is_the_periodic_spline_through_the_reflected_points(power, most):
    """scipy's spline; other parameters of it than the centripetal one differ by no more than is said."""
    points = GIVEN + [(TURN - b, TURN - a) for a, b in GIVEN[-2::-1]]
    points = np.array(points + [(b, a) for a, b in points[-2:0:-1]])
    points = np.vstack([points, points[:1]])
    t = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1) ** power))
    spline = CubicSpline(t, points, bc_type="periodic")
    border = spline(np.linspace(0.0, t[-1], 4000)[::97])
    assert max(zone_distance(q) for q in border) < most
    if power == 0.5:
        phi = np.random.default_rng(4).uniform(0.0, TURN, (2000, 2))
        inside = Path(spline(np.linspace(0.0, t[-1], 200001)))
        assert inside.contains_points(phi).tolist() == [bool(in_zone(a, b, 0.0)) for a, b in phi]


def zone_distance(phi):
    """Distance of a point from the border by the coefficients, over the quarter that it is reflected to."""
    tau = np.linspace(0.0, 1.0, 100001)
    q = np.abs([TURN - phi[0] - phi[1], phi[0] - phi[1]])
    curve = np.hstack([np.stack([np.polyval(row[::-1], tau) for row in piece]) for piece in ZONE_BORDER])
    i = int(np.argmin(((curve.T - q) ** 2).sum(axis=1)))
    i = min(max(i, 1), curve.shape[1] - 2)
    chord = curve[:, i + 1] - curve[:, i - 1]
    off = q - curve[:, i]
    return abs(chord[0] * off[1] - chord[1] * off[0]) / math.hypot(*chord) / math.sqrt(2.0)


@settings(max_examples=50)
@given(st.integers(0, 10**6), st.floats(1e-3, 1e3), st.floats(-4, 4), st.tuples(st.floats(-5, 5), st.floats(-5, 5)))
def test_similarity_mirror_and_reversal_change_nothing(seed, scale, rotation, shift):
    control = disc(50, seed)
    found = bezier_criteria(control)
    moved = Similarity(scale, rotation, (scale * shift[0], scale * shift[1])).apply(control)
    mirrored = control * [1, -1]
    for other in (moved, mirrored, control[:, ::-1], moved[:, ::-1] * [1, -1]):
        got = bezier_criteria(other)
        for one, two in zip(found[4:], got[4:], strict=True):
            assert (one == two).all()
        assert (is_elastica_like(control) == is_elastica_like(other)).all()
        assert got.edge_limits == pytest.approx(found.edge_limits, abs=1e-9)
    assert bezier_criteria(moved).phi == pytest.approx(found.phi, abs=1e-9)
    assert bezier_criteria(mirrored).beta == pytest.approx(TURN - found.beta, abs=1e-12)
    assert bezier_criteria(control[:, ::-1]).edges == pytest.approx(found.edges[:, ::-1])


def test_the_published_shares():
    """Shares of random curves with sampling errors: Brander2018 §5.1, §6.2, Fisker2018 Table 3.4."""
    control = disc(400_000, 6)
    found = bezier_criteria(control)
    residual = lambda_residual(control)
    angles = found.angles_1 & found.angles_2
    assert 0.53 - 0.003 < angles.mean() < 0.55
    like = is_elastica_like(control)
    assert like.sum() > 4000
    assert residual[like].max() < 0.4
    assert residual[like].mean() == pytest.approx(0.15, abs=0.005)
    assert (residual[like] < 0.22).mean() == pytest.approx(155389 / 188043, abs=4 * math.sqrt(0.83 * 0.17 / like.sum()))
    best = angles & found.simple & (residual < 0.22)
    assert like[best].mean() == pytest.approx(0.36, abs=0.02)
    # Without the edge lengths the zone says little.
    zone = angles & found.simple & found.in_zone
    assert residual[zone].mean() == pytest.approx(0.32, abs=0.015)
    assert residual[zone].max() > 0.8


def test_degenerate_rows_stay_alone():
    good = [(0, 0), (0, 1), (1, 1), (1, 0)]
    rows = np.array([good, [(0, 0), (0, 1), (1, 1), (0, 0)], [(0, 0), (0, 0), (1, 1), (1, 0)], good, good], dtype=float)
    rows[3, 2, 0], rows[4, 1, 1] = np.nan, np.inf
    found = bezier_criteria(rows)
    for numbers in found[:4]:
        assert np.isnan(numbers).any(axis=-1).tolist() == [False, True, True, True, True]
    for truths in found[4:]:
        assert not truths[1:].any()
    assert is_elastica_like(rows).tolist() == [True, False, False, False, False]
    # Inner points that coincide: no middle edge, so no inner angles; the rest stands.
    peak = bezier_criteria([(0, 0), (0.5, 0.5), (0.5, 0.5), (1, 0)])
    assert np.isnan(peak.phi).all()
    assert peak.beta == pytest.approx([2.35619449] * 2)
    assert not peak.simple
    assert not is_elastica_like([(0, 0), (0.5, 0.5), (0.5, 0.5), (1, 0)])


def test_straight_lines_and_shapes():
    handles = [0.2, 0.3, 0.45, 0.6]
    lines = np.array([[(0, 0), (h, 2 * h), (1 - h, 2 - 2 * h), (1, 2)] for h in handles])
    assert is_elastica_like(lines).tolist() == [False, True, True, False]
    assert is_elastica_like(lines.reshape(2, 2, 4, 2)).shape == (2, 2)
    assert bezier_criteria(lines[0]).phi.shape == (2,)
    assert bezier_criteria(np.empty((0, 4, 2))).simple.shape == (0,)


def test_what_is_refused():
    with pytest.raises(InvalidInputError, match="shape"):
        bezier_criteria(np.zeros((3, 2)))
    for limits in [(0.0, 1.0), (1.0, math.nan), (1.0,), 3.0, (1.0, -1.0)]:
        with pytest.raises(InvalidInputError, match="angle limits"):
            bezier_criteria([(0, 0), (0, 1), (1, 1), (1, 0)], angle_limits=limits)
    assert np.degrees(ANGLE_LIMITS) == pytest.approx([60.0, 72.0])
