"""The λ-residual: the contract of its tolerance, its invariances and its values at elastica and lines."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from batten.curves.bezier import CubicBezier
from batten.curves.polyline import Polyline
from batten.curves.similarity import Similarity
from batten.measures.bending_energy import bending_energy
from batten.measures.lambda_residual import lambda_residual

COORDINATE = st.floats(-2.0, 2.0, allow_subnormal=False)
CONTROL = st.lists(st.tuples(COORDINATE, COORDINATE), min_size=4, max_size=4)
# Away from cusps and lines, where a rounding of the control points is enlarged.
TAME = st.tuples(*[st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2))] * 4).map(
    lambda shift: np.array([(0, 0), (0.1, 0.7), (0.9, 0.6), (1, 0)]) + np.array(shift)
)


@pytest.mark.parametrize("tolerance", [10.0**-n for n in range(1, 11)])
def test_the_error_is_below_the_tolerance(random_cubics, tolerance):
    control, expected = random_cubics
    # The oracle itself: 1e-11 in the moments, e_λ² their quotient.
    oracle = 3e-10
    assert np.abs(lambda_residual(control, tolerance=tolerance) - expected[:, 6]).max() < tolerance + oracle


def test_the_plain_rule_is_right_where_no_peak_is_missed(random_cubics):
    control, expected = random_cubics
    error = np.abs(lambda_residual(control, tolerance=None) - expected[:, 6])
    assert np.median(error) < 1e-3
    # The claim of the docstring, that single curves are far off, holds of these curves too.
    assert error.max() > 0.05


@given(CONTROL)
def test_lies_between_0_and_1(control):
    for tolerance in (1e-6, None):
        value = lambda_residual([control], tolerance=tolerance)[0]
        assert 0.0 <= value <= 1.0 or len(set(control)) == 1


@given(TAME, st.floats(1e-3, 1e3), st.floats(-4.0, 4.0), st.tuples(st.floats(-5, 5), st.floats(-5, 5)))
def test_is_invariant_under_similarity_and_reversal(control, scale, rotation, shift):
    value = lambda_residual(control, tolerance=1e-10)
    moved = Similarity(scale, rotation, (scale * shift[0], scale * shift[1])).apply(control)
    assert lambda_residual(moved, tolerance=1e-10) == pytest.approx(value, abs=1e-9)
    assert lambda_residual(moved[::-1], tolerance=1e-10) == pytest.approx(value, abs=1e-9)
    assert lambda_residual(control * [1, -1], tolerance=1e-10) == pytest.approx(value, abs=1e-9)


@settings(max_examples=10, deadline=None)
@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(0.5, 6.0), st.floats(-3.0, 3.0))
def test_is_zero_for_elastica(elastica_from, angle, curvature, force, direction):
    curve = elastica_from(angle, curvature, (force * np.cos(direction), force * np.sin(direction)), 2.0)
    # What is left is that of the spline through the integrated points, which loses a near-line's curvature in rounding.
    assume(bending_energy(curve) > 1e-3)
    assert lambda_residual(curve) < 1e-6


def test_small_residuals_are_resolved():
    """A parabola flattened to ε is an elastica up to O(ε⁴): the residual must go on falling, far below rounding's root."""
    flat = 0.1 ** np.array([1.5, 2.0, 2.5, 3.0])
    values = [lambda_residual([(0, 0), (1, 0), (2, v), (3, 3 * v)], tolerance=1e-10) for v in flat]
    np.testing.assert_allclose(np.divide(values[:-1], values[1:]), 100.0, rtol=0.03)
    assert 1e-13 < values[-1] < 1e-11


@pytest.mark.parametrize(
    "line",
    [
        [(0, 0), (1, 0), (2, 0), (3, 0)],
        [(0.1, 0.1), (0.2, 0.2), (0.3, 0.3), (0.7, 0.7)],
        [(1e9, 0.0), (1e9 + 1, 1 / 3), (1e9 + 2, 2 / 3), (1e9 + 3, 1.0)],
        [(0, 0), (0, 0), (1, 3), (1, 3)],
    ],
)
def test_is_zero_for_lines(line):
    assert lambda_residual(line) == 0.0
    assert lambda_residual(line, tolerance=None) == 0.0
    assert lambda_residual(CubicBezier(line)) == 0.0
    assert lambda_residual(Polyline([line[0], line[3]])) == 0.0


def test_a_bump_on_a_line_is_seen_from_afar():
    """Far from the origin only what the coordinates can hold is left, and that is used."""
    bump = np.array([(0, 0), (1, 2**-10), (2, -(2**-10)), (3, 0)])
    value = lambda_residual(bump, tolerance=1e-10)
    assert lambda_residual(bump + np.array([2.0**20, 2.0**21]), tolerance=1e-10) == pytest.approx(value, abs=1e-9)


def test_nan_rows_stay_alone():
    rows = np.array([[(0, 0), (1, 1), (2, 1), (3, 0)]] * 3, dtype=float)
    rows[1, 1, 1] = np.nan
    values = lambda_residual(rows)
    assert np.isnan(values).tolist() == [False, True, False]
    assert values[0] == values[2]
