"""The projection "nearest": lower, steadier and closer than feedback, for every cubic, and the least change that will do."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError
from batten.measures.lambda_class import BEST_BELOW
from batten.measures.lambda_residual import lambda_residual
from batten.solvers.bezier_criteria import bezier_criteria
from batten.solvers.bezier_projection import STATUS, project_bezier
from batten.solvers.nearest_projection import projection_change

KEPT, REACHED, BEST, MINIMUM, _, _, _, DEGENERATE, NOT_FINITE, TURNED, MOVED = range(len(STATUS))
ARCH = np.array([(0, 0), (0, 1), (1, 1), (1, 0)], dtype=float)
KEEPS = ("tangents", "points", "nothing")


def disc(count, seed):
    """Random control points, uniform in the unit disc."""
    rng = np.random.default_rng(seed)
    radius, angle = np.sqrt(rng.random((count, 4))), 2 * math.pi * rng.random((count, 4))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def constrained(control):
    found = bezier_criteria(control)
    return found.angles_1 & found.angles_2


def with_lengths(curve, length1, length2):
    """Curves with ends and end directions of `curve` and lengths in chords that broadcast."""
    length1, length2 = np.broadcast_arrays(length1, length2)
    chord = np.linalg.norm(curve[3] - curve[0])
    out = np.broadcast_to(curve, (*length1.shape, 4, 2)).copy()
    for inner, end, length in ((1, 0, length1), (2, 3, length2)):
        edge = curve[inner] - curve[end]
        out[..., inner, :] = curve[end] + (chord * length)[..., None] * edge / np.linalg.norm(edge)
    return out


def rotated(vector, angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]], axis=-1)


def compare(control, seed):
    """Feedback and nearest on the same curves and on the same moved by 0.001, in the disc's unit, in a random direction.

    For each: λ-residuals, mean movement of the control points, share of the curves of which one moves by more than 0.05.
    """
    step = np.random.default_rng(seed).normal(size=control.shape)
    step *= 0.001 / np.sqrt((step**2).sum(axis=(1, 2), keepdims=True))
    inside = constrained(control) & constrained(control + step)
    control, step = control[inside], step[inside]
    out = {}
    for method in ("feedback", "nearest"):
        found, other = project_bezier(control, method), project_bezier(control + step, method)
        jump = np.linalg.norm(found.control_points - other.control_points, axis=-1).max(axis=-1) > 0.05
        movement = projection_change(control, found.control_points).movement.mean()
        out[method] = (found.residual_after, movement, jump.mean())
    return out


def assert_better(found):
    ours, theirs = found["nearest"], found["feedback"]
    assert (ours[0] < theirs[0]).mean() >= 0.95
    assert ours[0].max() < 0.2 < theirs[0].max()
    assert ours[0].mean() < 0.6 * theirs[0].mean()
    assert ours[1] < theirs[1]


def test_lower_than_feedback_and_closer_to_what_was_drawn():
    assert_better(compare(disc(16_000, 1), 2))


@pytest.mark.slow
def test_steadier_than_feedback():
    found = compare(disc(400_000, 21), 22)
    assert_better(found)
    assert found["nearest"][2] <= found["feedback"][2]


@pytest.mark.parametrize("keep", KEEPS)
@pytest.mark.parametrize("threshold", [0.1, 0.22, 0.4])
def test_a_threshold_is_met_where_it_can_be_and_then_kept(keep, threshold):
    control = disc(600, 3)
    found = project_bezier(control, "nearest", threshold=threshold, keep=keep)
    good = found.status != BEST
    assert (found.residual_after[good] <= threshold).all()
    assert (found.residual_after[~good] > threshold).all()
    assert good.all() or keep == "tangents"
    kept = found.residual_before <= threshold - 1e-6
    assert (found.status[kept] == KEPT).all()
    assert (found.control_points[kept] == control[kept]).all()
    # Not further than needed: what was changed lies on the border.
    changed = good & (found.status != KEPT)
    on_border = lambda_residual(found.control_points[changed], tolerance=1e-10) > threshold - 1e-6
    assert on_border.mean() > 0.99  # but for those that jump across it, where the curve doubles back
    again = project_bezier(found.control_points[good], "nearest", threshold=threshold, keep=keep)
    assert (again.status == KEPT).all()
    assert (again.control_points == found.control_points[good]).all()


@pytest.mark.parametrize(("threshold", "share"), [(0.22, 0.95), (0.05, 0.92)])
def test_no_lengths_nearer_to_the_drawn_ones_meet_the_threshold(threshold, share):
    """Dense circles in (log L₁, log L₂) about the drawn lengths, up to 0.985 of the distance of the answer."""
    control = disc(200, 11)
    found = project_bezier(control, "nearest", threshold=threshold)
    before, after = bezier_criteria(control).edges, bezier_criteria(found.control_points).edges
    rows = np.flatnonzero(found.status == REACHED)[:80]
    angle = np.arange(180) * math.pi / 90
    nearest = []
    for i in rows:
        r = np.linspace(0.0, 0.985, 50)[1:, None] * np.linalg.norm(np.log(after[i] / before[i]))
        lengths = before[i] * np.exp(r[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1))
        e = lambda_residual(with_lengths(control[i], lengths[..., 0], lengths[..., 1]), tolerance=1e-5)
        nearest.append(e.min() > threshold)
    assert len(rows) == 80
    assert np.mean(nearest) >= share


def test_where_lengths_do_not_reach_the_threshold_none_do():
    control = disc(300, 12)
    found = project_bezier(control, "nearest", threshold=0.22)
    grid = np.exp(np.linspace(math.log(0.1), math.log(6.0), 90))
    rows = np.flatnonzero(found.status == BEST)
    assert len(rows) > 30
    for i in rows:
        e = lambda_residual(with_lengths(control[i], grid[:, None], grid), tolerance=1e-5)
        assert 0.22 < found.residual_after[i] < e.min() + 1e-3


@pytest.mark.parametrize("keep", ["points", "nothing"])
def test_less_turning_does_not_reach_the_threshold(keep):
    """Turns on ellipses of less change, each with all lengths of a grid."""
    control = disc(250, 13)
    found = project_bezier(control, "nearest", keep=keep)
    change = projection_change(control, found.control_points)
    rows = np.flatnonzero(found.status >= TURNED)[:16]
    assert len(rows) == 16
    grid = np.exp(np.linspace(math.log(0.1), math.log(6.0), 40))
    angle = np.arange(24) * math.pi / 12
    least = []
    for i in rows:
        curve = control[i]
        q = np.linalg.norm(curve[3] - curve[0]) / np.linalg.norm(np.diff(curve, axis=0), axis=1).sum()
        scale = 1.0 if keep == "points" else q / math.sqrt(4.0 + q * q)
        bad = []
        for share in (0.4, 0.7, 0.9):
            a, b = share * change.change[i] * np.cos(angle) / scale, share * change.change[i] * np.sin(angle)
            for t1, t2 in zip((a + b) / math.sqrt(2.0), (a - b) / math.sqrt(2.0)):
                turned = curve.copy()
                turned[1] = curve[0] + rotated(curve[1] - curve[0], t1)
                turned[2] = curve[3] + rotated(curve[2] - curve[3], t2)
                e = lambda_residual(with_lengths(turned, grid[:, None], grid), tolerance=1e-4)
                bad.append(e.min() > 0.219)
        least.append(all(bad))
    assert np.mean(least) >= 0.9


def test_every_cubic_reaches_the_threshold_if_it_may_turn():
    control = disc(1200, 14)
    found = {keep: project_bezier(control, "nearest", threshold=BEST_BELOW, keep=keep) for keep in KEEPS}
    change = {keep: projection_change(control, found[keep].control_points) for keep in KEEPS}
    missed = found["tangents"].status == BEST
    assert 0.1 < missed.mean() < 0.25
    assert change["tangents"].change.max() < 1e-12
    for keep, status in (("points", TURNED), ("nothing", MOVED)):
        assert (found[keep].residual_after <= BEST_BELOW).all()
        assert (found[keep].status[missed] == status).all()
        assert (found[keep].control_points[~missed] == found["tangents"].control_points[~missed]).all()
        assert (found[keep].residual_after == project_bezier(control, "nearest", keep=keep).residual_after).all()
    assert (found["points"].control_points[:, [0, 3]] == control[:, [0, 3]]).all()
    # The more may change, the less needs to: the arcs of the end points are no shorter than their chords.
    assert (change["nothing"].change <= change["points"].change + 1e-6).all()
    assert change["nothing"].change[missed].mean() < 0.5 * change["points"].change[missed].mean()


@settings(max_examples=12, deadline=None)
@given(
    st.integers(0, 10**6), st.floats(1e-3, 1e3), st.floats(-4, 4), st.sampled_from([None, 0.22, "points", "nothing"])
)
def test_it_commutes_with_similarity_mirror_and_reversal(seed, scale, rotation, aim):
    control = disc(40, seed)
    options = {"keep": aim} if isinstance(aim, str) else {"threshold": aim}
    found = project_bezier(control, "nearest", **options)
    similarity = Similarity(scale, rotation, (2.0 * scale, -scale))
    differing = 0
    for there in (similarity.apply, lambda c: c * [1, -1], lambda c: c[:, ::-1]):
        other = project_bezier(there(control), "nearest", **options)
        wanted = there(found.control_points)
        size = np.abs(wanted - wanted[:, :1]).max(axis=(1, 2)) + np.abs(wanted[:, :1]).max()
        same = np.abs(other.control_points - wanted).max(axis=(1, 2)) / size < 1e-4
        assert (other.status == found.status)[same].all()
        differing += np.sum(~same)
    # What begins from circles and tables may find another of two answers.
    assert differing <= (0 if aim is None else 4)


def test_ends_and_end_directions_are_kept():
    control = disc(500, 5) * 100.0 + [30.0, -20.0]
    for threshold in (None, 0.2):
        found = project_bezier(control, "nearest", threshold=threshold).control_points
        assert (found[:, [0, 3]] == control[:, [0, 3]]).all()
        assert np.abs(projection_change(control, found).turns).max() < 1e-12
        assert (bezier_criteria(found).edges > 0.0).all()


DEGENERATE_CURVES = {
    "p0 = p3": [(0, 0), (1, 1), (-1, 1), (0, 0)],
    "slim loop": [(0, 0), (0.1, 1), (-0.1, 1), (0, 0)],
    "p0 = p3, one handle": [(0, 0), (0, 0), (1, 1), (0, 0)],
    "no first handle": [(0, 0), (0, 0), (1, 1), (1, 0)],
    "no last handle": [(0, 0), (0, 1), (1, 0), (1, 0)],
    "line that doubles back": [(0, 0), (-1, 0), (2, 0), (1, 0)],
    "closed line": [(0, 0), (1, 0), (2, 0), (0, 0)],
    "cusp": [(0, 0), (1, 1), (0, 1), (1, 0)],
    "handles that cross": [(0, 0), (2, 1), (-1, 1), (1, 0)],
    "p1 = p2": [(0, 0), (0.5, 1), (0.5, 1), (1, 0)],
    "tiny chord": [(0, 0), (0, 1), (1, 1), (1e-9, 0)],
}


@pytest.mark.parametrize("name", DEGENERATE_CURVES)
def test_degenerate_curves_have_answers(name):
    curve = np.array(DEGENERATE_CURVES[name], dtype=float)
    for keep in KEEPS:
        found = project_bezier(curve, "nearest", threshold=0.22, keep=keep)
        assert np.isfinite(found.control_points).all()
        assert found.residual_after <= max(found.residual_before, 0.22)
        assert keep == "tangents" or found.residual_after <= 0.22
    assert project_bezier(curve, "nearest").residual_after <= found.residual_before + 1e-9


def test_lines_are_kept_and_bad_rows_stay_alone():
    line = np.array([(0, 0), (0.1, 0.2), (0.5, 1.0), (1, 2)])
    rows = np.stack([ARCH] * 5)
    rows[1], rows[2], rows[3, 2, 0], rows[4, 0, 1] = line, [0.5, 0.5], np.nan, np.inf
    for options in ({}, {"threshold": 0.01}, {"keep": "nothing"}):
        found = project_bezier(rows, "nearest", **options)
        assert found.status[1:].tolist() == [KEPT, DEGENERATE, NOT_FINITE, NOT_FINITE]
        assert (found.control_points[1] == line).all()
        assert np.isnan(found.control_points[2:]).all()
        alone = project_bezier(ARCH, "nearest", **options)
        assert (found.control_points[0] == alone.control_points).all()
    assert project_bezier(np.broadcast_to(ARCH, (2, 3, 4, 2)), "nearest").status.tolist() == [[MINIMUM] * 3] * 2
    assert project_bezier(np.empty((0, 4, 2)), "nearest", keep="points").status.shape == (0,)


def test_what_a_change_is():
    """A quarter turn of the first handle, and the last end moved by 1 along a polygon of length 3."""
    after = np.array([(0, 0), (1, 0), (1, 1), (2, 0)], dtype=float)
    found = projection_change(ARCH, after)
    assert found.movement == pytest.approx((math.sqrt(2.0) + 1.0) / 4.0)
    assert found.turns == pytest.approx([-math.pi / 2, math.pi / 4])
    assert found.end_movement == pytest.approx([0.0, 1.0 / 3.0])
    assert found.change == pytest.approx(math.sqrt(math.pi**2 * (1 / 4 + 1 / 16) + 1 / 9))
    with pytest.raises(InvalidInputError, match="same shape"):
        projection_change(ARCH, [ARCH, ARCH])


@pytest.mark.parametrize("method", ["zone", "feedback", "gradient"])
def test_other_methods_keep_tangents(method):
    with pytest.raises(InvalidInputError, match="nearest"):
        project_bezier(ARCH, method, keep="points")
    with pytest.raises(InvalidInputError, match="keep is one of"):
        project_bezier(ARCH, "nearest", keep="lengths")
