"""The design of an elastic spline: steps, refusals, and that no step ever breaks a limit."""

import math
import time

import numpy as np
import pytest

from batten.curves.base import Curve
from batten.curves.cubic_proxy import Border, CubicProxy
from batten.errors import InvalidInputError
from batten.measures.lambda_residual import lambda_residual
from batten.solvers.initial_guess import initial_elastica
from batten.solvers.stability import margins
from batten.splines.design_limits import DesignLimits
from batten.splines.elastic_spline_design import ElasticSplineDesign

WALL = [Border.vertical(x) for x in (0.0, 2.0, 4.0, 6.0)]


def angle_error(piece):
    """Greatest turn of the end tangents of the first guess against those of a cubic."""
    chord = piece[3] - piece[0]
    off = np.abs((piece - piece[0]) @ [chord[1], -chord[0]]).max()
    if off < 1e-9 * (chord @ chord):  # straight but for rounding: no guess, and none needed
        return 0.0
    guess = initial_elastica(piece).elastica
    turns = []
    for s, (a, b) in ((0.0, piece[:2]), (guess.length, piece[2:])):
        turns.append(math.remainder(float(guess.angle_at(s)) - math.atan2(*(b - a)[::-1]), 2.0 * math.pi))
    return max(map(abs, turns))


def crosses(proxy):
    """Whether a fine polyline on the spline crosses itself, by the signs of all pairs of its segments."""
    points = proxy.point(np.linspace(0.0, 1.0, 40 * proxy.piece_count + 1))
    a, b = points[:-1, None], points[1:, None]
    c, d = points[None, :-1], points[None, 1:]

    def side(p, q, r):
        return (q - p)[..., 0] * (r - p)[..., 1] - (q - p)[..., 1] * (r - p)[..., 0]

    meets = (side(a, b, c) * side(a, b, d) < 0.0) & (side(c, d, a) * side(c, d, b) < 0.0)
    return bool(np.triu(meets, 2).any())


def assert_sound(design):
    """All limits, by the public measures; joints on their borders."""
    assert design.broken == ()
    limits = design.limits
    assert lambda_residual(design.pieces).max() < limits.residual_below + 2e-6
    assert max(angle_error(piece) for piece in design.pieces) < limits.angle_error_below + 1e-5
    if limits.margin_above is not None:
        guesses = [initial_elastica(piece).elastica.parameters for piece in design.pieces]
        assert margins(guesses).min() > limits.margin_above * (1.0 - 1e-4)
    if limits.simple:
        assert not crosses(design.proxy)
    for joint, border in zip(design.proxy.joints, design.borders or ()):
        assert border is None or abs(border.distance(joint)) < 1e-12 * 12.0


def a_step(design, rng):
    """One random operation: (its record, whether it is one that makes a step of its own)."""
    n, m = len(design.pieces), len(design.control_points)
    kind = rng.choice(["move", "insert", "delete", "undo", "redo"], p=[0.6, 0.1, 0.08, 0.12, 0.1])
    if kind == "insert" and n < 6:
        piece = int(rng.integers(n))
        if design.borders is not None and rng.random() < 0.5:
            x = float(np.mean(design.proxy.joints[piece : piece + 2, 0]))
            return design.insert(piece, border=Border.vertical(x))
        return design.insert(piece, fraction=float(rng.uniform(0.3, 0.7)))
    if kind == "delete" and n > 2:
        return design.delete(int(rng.integers(n + 1)))
    if kind == "undo" and design.undo_depth:
        return design.undo()
    if kind == "redo" and design.redo_depth:
        return design.redo()
    i = int(rng.integers(m))
    size = np.ptp(design.control_points, axis=0).max() / n
    target = design.control_points[i] + rng.normal(size=2) * size * 10.0 ** rng.uniform(-2.0, 0.3)
    return design.move(i, target, "clamp" if rng.random() < 0.4 else "refuse", continues=bool(rng.random() < 0.2))


def bits(design):
    borders = [] if design.borders is None else [b and (b.point, b.normal) for b in design.borders]
    return design.control_points.tobytes(), borders, design.limits


STARTS = {
    "C1": lambda: ElasticSplineDesign.line((0, 0), (8, 0), 4),
    "C2": lambda: ElasticSplineDesign.line((0, 0), (8, 0), 4, continuity=2),
    "C1 in blocks": lambda: ElasticSplineDesign.line((0, 0), (6, 1), 3, borders=WALL),
    "C2 in blocks": lambda: ElasticSplineDesign.line((0, 0), (6, 1), 3, continuity=2, borders=WALL),
    "C1 of a rod": lambda: ElasticSplineDesign.line(
        (0, 0), (8, 0), 3, limits=DesignLimits(curvature_below=3.0, margin_above=1.1, simple=True)
    ),
}


EVERY_OUTCOME = [("move", "done"), ("move", "refused"), ("move", "clamped"), ("insert", "done"), ("delete", "done"),
                 ("undo", "done"), ("redo", "done")]  # fmt: skip


@pytest.mark.parametrize("start", STARTS)
def test_no_step_of_a_random_walk_breaks_a_limit(start):
    design = STARTS[start]()
    first, rng = bits(design), np.random.default_rng(list(STARTS).index(start))
    outcomes, taken = {}, 0
    while taken < 300 or (taken < 1200 and min(outcomes.get(kind, 0) for kind in EVERY_OUTCOME) < 3):
        taken += 1
        before, depths = bits(design), (design.undo_depth, design.redo_depth)
        step = a_step(design, rng)
        outcomes[step.action, step.outcome] = outcomes.get((step.action, step.outcome), 0) + 1
        if step.outcome == "refused":
            assert step.reason
            assert bits(design) == before
            assert (design.undo_depth, design.redo_depth) == depths
        assert_sound(design)
        assert step.residuals.tolist() == design.residuals[step.pieces].tolist()
        if step.point is not None:
            assert step.point == tuple(design.control_points[step.index].tolist())
    assert min(outcomes.get(kind, 0) for kind in EVERY_OUTCOME) >= 3, outcomes
    while design.redo_depth:
        design.redo()
    last, depth = bits(design), design.undo_depth
    for _ in range(depth):
        design.undo()
    assert bits(design) == first
    for _ in range(depth):
        design.redo()
    assert bits(design) == last


def test_a_refused_move_says_which_limit_and_piece_and_changes_nothing():
    design = ElasticSplineDesign.line((0, 0), (12, 0), 4)
    before = design.states
    step = design.move(5, (7.0, 9.0))
    assert (step.outcome, step.action, step.index, step.asked, step.point) == (
        "refused",
        "move",
        5,
        (7.0, 9.0),
        (7.0, 0.0),
    )
    assert step.pieces.tolist() == [1, 2]
    assert {b.piece for b in step.broken} <= {1, 2}
    would_be = lambda_residual(design.proxy.with_control_point(5, (7.0, 9.0)).pieces)
    for b in step.broken:
        if b.limit == "residual_below":
            assert b.value == pytest.approx(would_be[b.piece], abs=2e-6)
            assert b.value >= 0.21
    assert any(b.limit == "residual_below" for b in step.broken)
    assert "has a λ-residual of" in step.reason
    assert "allowed is below 0.21" in step.reason
    assert step.residuals.tolist() == [0.0, 0.0]
    assert design.states == before


def test_a_clamped_move_ends_at_the_near_border_of_the_region():
    rng = np.random.default_rng(3)
    for _ in range(12):
        design = ElasticSplineDesign.line((0, 0), (12, 0), 4)
        for _ in range(6):
            i = int(rng.integers(10))
            design.move(i, design.control_points[i] + rng.normal(size=2) * 0.5)
        i = int(rng.integers(1, 9))
        target = design.control_points[i] + rng.normal(size=2) * 8.0
        if design.move(i, target).outcome == "done":
            continue
        here = design.control_points[i].copy()
        step = design.move(i, target, outside="clamp")
        assert step.outcome == "clamped"
        assert step.reason
        found = design.control_points[i]
        assert_sound(design)
        # No place along a fan of rays from the target is much nearer and good and joined to `here` by a straight good way.
        away = np.hypot(*(found - target))
        width = np.ptp(np.concatenate(rings(design, i)), axis=0).max()
        for angle in np.linspace(0.0, 2.0 * math.pi, 48, endpoint=False):
            place = target + (away - 0.03 * width) * np.array([math.cos(angle), math.sin(angle)])
            way = here + np.linspace(0.0, 1.0, 60)[:, None] * (place - here)
            assert away < 0.03 * width or not all(good(design, i, p) for p in way)


def rings(design, index):
    return [polygon.outer for polygon in design.good_region(index).polygons]


def good(design, index, point):
    pieces = design.proxy.with_control_point(index, point).pieces[design.proxy.affected_pieces(index)]
    return lambda_residual(pieces).max() < 0.21 and max(angle_error(p) for p in pieces) < math.radians(6.0)


def test_a_drag_is_one_step_and_keeps_its_region():
    design = ElasticSplineDesign.line((0, 0), (12, 0), 4)
    region = design.good_region(4)
    for k in range(1, 20):
        assert design.move(4, (5.0, 0.05 * k), continues=True).outcome == "done"
        assert design.good_region(4) is region
    assert design.undo_depth == 1
    assert design.undo().point == (5.0, 0.0)
    assert design.good_region(4) is region
    design.redo()
    design.move(9, (12.0, 0.1))  # of the last piece alone: far from the pieces 1 and 2 of point 4
    assert design.undo_depth == 2
    assert design.good_region(4) is region
    design.move(5, (7.0, 0.1), continues=True)
    assert design.undo_depth == 3
    again = design.good_region(4)
    assert again is not region
    assert again is design.good_region(4)
    design.set_limits(DesignLimits(residual_below=0.1))
    assert design.good_region(4) is not again


def test_a_move_inside_a_region_that_is_known_takes_less_than_a_millisecond():
    for continuity in (1, 2):
        design = ElasticSplineDesign.line((0, 0), (30, 0), 10, continuity=continuity)
        i = 7
        design.good_region(i)
        x, y = design.control_points[i]
        times = []
        for k in range(200):
            begin = time.perf_counter()
            step = design.move(i, (x + 0.001 * k, y + 0.002 * k), outside="clamp", continues=True)
            times.append(time.perf_counter() - begin)
            assert step.outcome == "done"
        assert np.median(times) < 1e-3


def test_a_new_step_drops_what_was_undone():
    design = ElasticSplineDesign.line((0, 0), (6, 0), 2)
    design.move(2, (2.0, 0.3))
    design.move(2, (2.0, 0.4))
    design.undo()
    assert design.move(2, (2.0, 90.0)).outcome == "refused"
    assert design.redo_depth == 1
    assert design.move(2, (2.0, 0.3)).outcome == "done"  # where it is already: no step
    assert design.redo_depth == 1
    design.move(3, (4.0, 0.2))
    assert design.redo_depth == 0
    with pytest.raises(InvalidInputError, match="no undone step"):
        design.redo()
    design.undo()
    design.undo()
    with pytest.raises(InvalidInputError, match="no step to undo"):
        design.undo()


def test_in_blocks_joints_stay_and_the_point_across_follows():
    design = ElasticSplineDesign.line((0, 0), (6, 0), 3, borders=WALL)
    step = design.move(2, (1.2, 0.3))
    assert step.outcome == "done"
    np.testing.assert_allclose(design.control_points[3], [2.8, 0.0], atol=1e-12)
    assert step.pieces.tolist() == [0, 1]
    assert abs(design.proxy.joints[1, 0] - 2.0) < 1e-12
    end = design.move(0, (-5.0, 0.1))  # the border holds it at x = 0
    assert (end.outcome, end.asked) == ("done", (-5.0, 0.1))
    np.testing.assert_allclose(end.point, [0.0, 0.1], atol=1e-12)


def test_a_point_that_borders_hold_fast_is_refused():
    borders = [None, Border.vertical(2.0), Border((4.0, 0.0), (1.0, 0.7)), None]
    design = ElasticSplineDesign.line((0, 0), (6, 0), 3, continuity=2, borders=borders)
    held = [i for i in range(6) if len(design.proxy.freedom(i).directions) == 0]
    assert held
    for outside in ("refuse", "clamp"):
        step = design.move(held[0], design.control_points[held[0]] + 0.1, outside=outside)
        assert step.outcome == "refused"
        assert "borders" in step.reason
    assert design.undo_depth == 0


def test_pieces_are_divided_and_joined_and_borders_go_along():
    design = ElasticSplineDesign.line((0, 0), (6, 0), 3, borders=WALL)
    design.move(2, (1.5, 0.4))
    assert design.insert(1, border=Border.vertical(3.0)).outcome == "done"
    assert [b.point[0] for b in design.borders] == [0.0, 2.0, 3.0, 4.0, 6.0]
    assert len(design.pieces) == 4
    step = design.delete(2)
    assert [b.point[0] for b in design.borders] == [0.0, 2.0, 4.0, 6.0]
    assert 1 in step.pieces
    assert_sound(design)
    for continuity in (1, 2):
        whole = ElasticSplineDesign.line((0, 0), (6, 0), 3, continuity=continuity, borders=WALL)
        whole.move(2, (2.0, 0.2))
        rest = whole.pieces.copy()
        assert whole.delete(0).pieces.tolist() == []
        np.testing.assert_allclose(whole.pieces, rest[1:], atol=1e-12)
        assert whole.delete(2).outcome == "done"
        np.testing.assert_allclose(whole.pieces, rest[1:2], atol=1e-12)
        assert [b.point[0] for b in whole.borders] == [2.0, 4.0]
        with pytest.raises(InvalidInputError, match="with one piece left"):
            whole.delete(0)


def test_deleting_a_joint_that_is_needed_is_refused():
    """A wave of four arcs: a cubic for two of them is no rod, nor is one near it."""
    points = [(0, 0), (1, 1.6), (2, 1.6), (4, -1.6), (5, -1.6), (7, 1.6), (8, 1.6), (10, -1.6), (11, -1.6), (12, 0)]
    design = ElasticSplineDesign.from_control_points(points)
    assert_sound(design)
    before = bits(design)
    step = design.delete(1)
    assert step.outcome == "refused"
    assert step.broken
    assert str(step.broken[0]) in step.reason
    assert {0, 1} <= set(step.pieces.tolist())
    assert bits(design) == before
    assert design.undo_depth == 0


def test_where_the_nearest_spline_breaks_a_limit_points_go_on_a_little():
    design = ElasticSplineDesign.line((0, 0), (6, 0), 3, borders=WALL)
    design.move(2, (1.5, 0.4))
    border = Border.vertical(3.0)
    nearest = design.proxy.with_piece(1, border=border)
    assert lambda_residual(nearest.pieces).max() > 0.21
    step = design.insert(1, border=border)
    assert step.outcome == "done"
    assert "control points were moved by up to" in step.reason
    assert_sound(design)
    assert np.abs(design.control_points - nearest.control_points).max() < 2e-3


def test_a_design_that_breaks_limits_can_be_put_right_but_not_made_worse():
    proxy = CubicProxy.line((0, 0), (12, 0), 4).with_control_point(3, (4.0, 2.6)).with_control_point(5, (7.0, -1.5))
    design = ElasticSplineDesign(proxy)
    broken = {(b.limit, b.piece): b.excess for b in design.broken}
    assert len(broken) >= 2
    assert design.move(3, (4.0, 9.0)).outcome == "refused"
    better = design.move(3, (4.0, 0.6))
    assert better.outcome == "done"
    assert all(b.excess <= broken[b.limit, b.piece] for b in better.broken)
    assert design.move(5, (7.0, -0.3), outside="clamp").outcome in ("done", "clamped")
    assert design.broken == ()
    tight = design.set_limits(DesignLimits(residual_below=1e-3))
    assert tight.outcome == "done"
    assert tight.broken == design.broken != ()
    assert all(b.allowed == 1e-3 for b in design.broken if b.limit == "residual_below")
    design.undo()
    assert design.broken == ()


def test_borders_can_be_set_and_taken_off():
    design = ElasticSplineDesign.line((0, 0), (6, 0), 3)
    design.move(2, (1.4, 0.5))
    assert design.set_borders(WALL).outcome == "done"
    assert_sound(design)
    assert np.abs(design.proxy.joints[:, 0] - [0, 2, 4, 6]).max() < 1e-12
    squeezed = [Border.vertical(x) for x in (0.0, 5.9, 0.1, 6.0)]
    assert design.set_borders(squeezed).outcome == "refused"
    design.set_borders(None)
    assert design.borders is None
    design.undo()
    assert design.borders == tuple(WALL)


def test_what_it_tells_about_itself():
    design = ElasticSplineDesign.from_control_points([(0, 0), (1, 1), (2, 1), (4, -1), (5, -1), (6, 0)])
    assert isinstance(design.proxy, Curve)
    assert design.pieces.shape == (2, 4, 2)
    np.testing.assert_allclose(design.residuals, lambda_residual(design.pieces), atol=2e-6)
    assert design.angle_errors.tolist() == pytest.approx([angle_error(p) for p in design.pieces], abs=1e-5)
    assert design.classes == ("best", "best")
    for kind in ("guess", "joined", "fit"):
        rods = design.elastica(kind)
        assert rods.greatest_distance < 0.01 * design.proxy.length
    assert np.all(design.elastica("joined").gaps < 1e-10)


def test_input_that_makes_no_sense_is_refused_in_words():
    design = ElasticSplineDesign.line((0, 0), (6, 0), 2)
    for call, message in (
        (lambda: ElasticSplineDesign("line"), "starts with a CubicProxy; got str"),
        (lambda: design.move(6, (0, 0)), "control points 0 … 5; got 6"),
        (lambda: design.move(-1, (0, 0)), "got -1"),
        (lambda: design.move(1, (0, math.nan)), "two finite numbers"),
        (lambda: design.move(1, (0, 0, 0)), "two finite numbers"),
        (lambda: design.move(1, (0, 0), "push"), "'refuse' or 'clamp'; got 'push'"),
        (lambda: design.good_region(6), "got 6"),
        (lambda: design.insert(2), "pieces 0 … 1; got 2"),
        (lambda: design.insert(0, fraction=1.0), "fraction in"),
        (lambda: design.insert(0, border=Border.vertical(5.0)), "does not cross"),
        (lambda: design.delete(3), "0 … 2; got 3"),
        (lambda: design.set_limits(0.2), "DesignLimits; got float"),
        (lambda: design.set_borders([None]), "3 joints; got 1"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            call()
    assert design.undo_depth == 0
