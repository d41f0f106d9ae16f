"""The basis functions against scipy's, and splines rewritten over finer knots against themselves."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from batten.errors import InvalidInputError
from batten.surfaces.bspline_basis import basis_functions, check_knots, greville, powers, rewrite, span_polynomials

KNOTS = {
    1: [0.0, 0, 1, 2.5, 4, 4],
    2: [0.0, 0, 0, 1, 1, 3, 4, 4, 4],
    3: [-1.0, 0, 0.5, 1, 2, 2, 2, 3, 5, 6, 7],  # not clamped, and an inner knot three times
    5: [0.0] * 6 + [0.3, 0.31] + [1.0] * 6,
}


@pytest.mark.parametrize("degree", KNOTS)
@pytest.mark.parametrize("order", [0, 1, 2])
def test_values_and_derivatives_are_those_of_scipy(degree: int, order: int) -> None:
    knots = np.array(KNOTS[degree])
    count = len(knots) - degree - 1
    inside = np.linspace(knots[degree], knots[count], 41)[:-1]
    t = np.concatenate([inside, knots[degree] - np.array([0.7, 0.1]), knots[count] + np.array([0.1, 0.7])])
    first, values = basis_functions(knots, degree, t, order)
    ours = np.zeros((len(t), count))
    for a in range(degree + 1):
        ours[np.arange(len(t)), first + a] = values[order, a]
    spline = BSpline(knots, np.eye(count), degree, extrapolate=True)
    theirs = spline(t, nu=order) if order <= degree else np.zeros_like(ours)
    assert ours == pytest.approx(theirs, rel=1e-11, abs=1e-11 * np.abs(theirs).max(initial=1.0))


def test_the_end_of_the_domain_belongs_to_the_last_span() -> None:
    first, values = basis_functions(np.array(KNOTS[2]), 2, np.array([4.0]), 0)
    assert first.tolist() == [3]
    assert values[0, :, 0].tolist() == [0.0, 0.0, 1.0]


@pytest.mark.parametrize("degree", KNOTS)
@pytest.mark.parametrize("order", [0, 1, 2])
def test_polynomials_on_the_spans_are_those_of_scipy(degree: int, order: int) -> None:
    knots = np.array(KNOTS[degree])
    count = len(knots) - degree - 1
    spline = BSpline(knots, np.eye(count), degree)
    borders, first, coefficients = span_polynomials(knots, degree)
    assert borders.tolist() == sorted(set(knots[degree : count + 1].tolist()))
    for low, high, index, c in zip(borders[:-1], borders[1:], first, coefficients):
        t = low + (high - low) * np.array([0.01, 0.3, 0.99])
        ours = np.zeros((3, count))
        ours[:, index : index + degree + 1] = powers(t - 0.5 * (low + high), degree, order)[:, order] @ c
        theirs = spline(t, nu=order) if order <= degree else np.zeros_like(ours)
        assert ours == pytest.approx(theirs, rel=1e-11, abs=1e-11 * np.abs(theirs).max(initial=1.0))


def test_rewriting_keeps_the_spline() -> None:
    rng = np.random.default_rng(1)
    knots = np.array([0.0, 0, 0, 0, 1, 2, 2, 5, 5, 5, 5])
    coefficients = rng.normal(size=(7, 3))
    finer = np.array([0.0] * 6 + [1, 1, 1, 1.5] + [2] * 4 + [4] + [5] * 6)  # every old knot twice more, for degree 5
    new = rewrite(knots, 3, coefficients, finer, 5)
    t = np.linspace(0.0, 5.0, 101)
    assert np.abs(BSpline(finer, new, 5)(t) - BSpline(knots, coefficients, 3)(t)).max() < 1e-13


def test_greville_abscissae_reproduce_the_parameter() -> None:
    knots = np.array(KNOTS[3])
    t = np.linspace(1.0, 3.0, 11)
    assert BSpline(knots, greville(knots, 3), 3)(t) == pytest.approx(t, abs=1e-14)


@pytest.mark.parametrize(
    ("knots", "degree", "count", "message"),
    [
        ([0, 0, 1, 1], 2, 2, "degree 2 with 2 control points"),
        ([0, 1], 1, 2, "need 4 knots .Rhino"),
        ([0, 1, 0.5, 1], 1, 2, "ascending"),
        ([0, 0, np.nan, 1], 1, 2, "finite"),
        ([0, 0, 1, 1, 2, 2], 1, 4, "more than degree = 1 times"),
        ([1, 1, 1, 1], 1, 2, "more than degree"),
    ],
)
def test_bad_knots_get_one_clear_line(knots: list[float], degree: int, count: int, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message) as caught:
        check_knots(knots, degree, count)
    assert "\n" not in str(caught.value)
