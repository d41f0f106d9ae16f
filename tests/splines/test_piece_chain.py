"""Chains with free joints: continuity that holds, distances that become less, and what cannot be joined."""

import numpy as np
import pytest

from batten.curves.bezier import CubicBezier
from batten.curves.elastica import Elastica
from batten.curves.piecewise import PiecewiseCurve
from batten.splines.curve_spans import spans_of
from batten.splines.piece_chain import PieceChain, _scales
from batten.splines.piece_distance import piece_distances
from batten.splines.piece_split import PieceFitter, longest_first, pieces_of

WAVE = CubicBezier([(0.0, 0.0), (1.0, 3.0), (3.0, -2.0), (4.0, 1.0)])
OVAL = PiecewiseCurve(
    [CubicBezier([(2, 0), (2, 1), (1, 2), (0, 2)]), CubicBezier([(0, 2), (-2, 2), (-3, 1), (-3, 0)]),
     CubicBezier([(-3, 0), (-3, -1), (-1, -1), (0, -1)]), CubicBezier([(0, -1), (1, -1), (2, -0.5), (2, 0)])]
)  # fmt: skip


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("curve", [WAVE, OVAL], ids=["open", "closed"])
def test_a_chain_is_joined_and_nearer(curve, order):
    tolerance = 1e-2
    (span,) = spans_of(curve, 0.005 * tolerance, 0.1, 0.5 * tolerance)
    assert span.closed == (curve is OVAL)
    held = longest_first(PieceFitter(span, "tangents" if order else "points", tolerance, 0.005 * tolerance), 100)
    parameters, joints = PieceChain(span, order).improved(held.parameters, held.joints, 0.0)
    pieces = pieces_of(parameters)
    loop = PiecewiseCurve([*pieces, pieces[0]] if span.closed else pieces)
    jumps = loop.joints()
    scale = curve.length / len(pieces)
    assert (jumps.position_jumps <= 1e-11 * scale).all()
    if order > 0:
        assert (np.abs(jumps.tangent_jumps) <= 1e-10).all()
    if order == 2:
        assert (np.abs(jumps.curvature_jumps) * scale <= 1e-10).all()
    distances = piece_distances(span, joints[:-1], joints[1:], parameters, 0.005 * tolerance)
    if order == 1:  # points alone leave little to gain, common curvatures cost something
        assert distances.max() < 0.9 * held.distances.max()
    assert distances.max() < 2.0 * held.distances.max()
    if not span.closed:
        assert np.allclose(loop.point([0.0, 1.0]), curve.point([0.0, 1.0]), atol=1e-11)


def test_offsets_have_the_derivatives_that_differences_show():
    (span,) = spans_of(WAVE, 1e-5, 0.1, 1e-3)
    chain = PieceChain(span, 2)
    held = longest_first(PieceFitter(span, "tangents", 1e-2, 1e-4), 100)
    feet = held.joints[:-1, None] + np.diff(held.joints)[:, None] * np.linspace(0.0, 1.0, 25)
    state = chain._seen(chain._joints(held.parameters), feet)
    state = chain._seen(state.joints, state.feet)
    rng = np.random.default_rng(5)
    move = rng.normal(size=held.parameters.shape) * 1e-6
    move[:, 6] -= move[:, 6].mean()  # the unit of the equations, the mean length, stays
    ahead, behind = (chain._seen(chain._joints(held.parameters + sign * move), state.feet) for sign in (1.0, -1.0))
    gaps = state.joints.equations @ (2.0 * move).ravel()
    assert np.allclose(ahead.joints.gaps - behind.joints.gaps, gaps, atol=1e-9 + 1e-4 * np.abs(gaps).max())
    expected = np.einsum("nmi,ni->nm", state.response, 2.0 * move)
    inner = (slice(None), slice(2, 23))  # towards the ends feet are held back
    assert np.allclose((ahead.offsets - behind.offsets)[inner], expected[inner], atol=1e-3 * np.abs(expected).max())


@pytest.mark.parametrize("power", [2, 4, 12])
def test_steps_downhill_lower_the_sum_of_powers_and_hold_the_equations(power):
    (span,) = spans_of(WAVE, 1e-5, 0.1, 1e-3)
    chain = PieceChain(span, 1)
    held = longest_first(PieceFitter(span, "tangents", 1e-2, 1e-4), 100)
    feet = held.joints[:-1, None] + np.diff(held.joints)[:, None] * np.linspace(0.0, 1.0, 25)
    state = chain._seen(chain._restored(chain._joints(held.parameters)), feet)
    move = chain._downhill(state, power, 1.0)
    assert np.abs(state.joints.scaled() @ move.ravel()).max() < 1e-10

    def total(x):
        moved = chain._seen(chain._joints(state.parameters + x * _scales(state.parameters)), state.feet)
        return float((np.abs(moved.offsets / state.worst) ** power).sum())

    step = 1e-3 * move
    slope = (total(step) - total(-step)) / 2e-3
    assert slope < 0.0
    # Of the quadratic model that the step minimises, with equations held, the slope along the step is minus its curvature.
    g, o = state.response * _scales(state.parameters)[:, None] / state.worst, state.offsets / state.worst
    assert slope == pytest.approx(
        power * float((np.abs(o) ** (power - 2) * o * np.einsum("nmi,ni->nm", g, move)).sum()), rel=0.05
    )


@pytest.mark.parametrize("curve", [WAVE, OVAL], ids=["open", "closed"])
def test_curvatures_are_closed_without_a_linear_program(curve, monkeypatch):
    monkeypatch.setattr(PieceChain, "_program", None)
    tolerance = 1e-2
    (span,) = spans_of(curve, 0.005 * tolerance, 0.1, 0.5 * tolerance)
    held = longest_first(PieceFitter(span, "tangents", tolerance, 0.005 * tolerance), 100)
    feet = held.joints[:-1, None] + np.diff(held.joints)[:, None] * np.linspace(0.0, 1.0, 25)
    chain = PieceChain(span, 2)
    begin = chain._seen(chain._restored(chain._joints(held.parameters), hard_only=True), feet)
    assert begin.joints.torn > 1e-3
    end = chain._levelled(begin, 0.0)
    assert end.joints.torn < 1e-11
    assert end.worst < 2.0 * begin.worst


def test_pieces_that_lie_apart_are_not_called_joined():
    (span,) = spans_of(WAVE, 1e-4, 0.1, 1e-2)
    far = np.stack([Elastica((50.0 * i, 90.0), 3.0, 800.0, (1e5, 0.0), 2.0).parameters for i in range(3)])
    found = PieceChain(span, 1).improved(far, np.linspace(0.0, span.length, 4), 0.0)
    if found is not None:
        jumps = PiecewiseCurve(pieces_of(found[0])).joints()
        assert (jumps.position_jumps < 1e-9).all()
