"""The fit: stationary, ends held, invariant, robust, and never worse than Ipopt from the same guess."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from batten.curves.bezier import CubicBezier
from batten.curves.elastica import Elastica
from batten.errors import ConvergenceError, InvalidInputError
from batten.measures.distance import h1_distance, l2_distance
from batten.solvers.curve_samples import from_points, samples_of
from batten.solvers.elastica_fit import STATUS, fit_elastica, fit_elastica_batch, fit_samples
from batten.solvers.initial_guess import initial_elastica

ENDS = ("free", "points", "tangents")
HELD = {"free": 0, "points": 2, "tangents": 3}
CURVES = np.array(
    [
        [(0.0, 0.0), (0.1, 0.7), (0.9, 0.7), (1.0, 0.0)],  # an arch
        [(0.0, 0.0), (0.6, 0.8), (0.4, -0.8), (1.0, 0.0)],  # an S
        [(0.0, 0.0), (1.2, 0.9), (-0.3, 0.8), (1.0, 0.0)],  # a loop
        [(0.0, 0.0), (0.2, 0.4), (0.5, 0.6), (1.0, 0.1)],
        [(0.0, 0.0), (0.0, -0.9), (1.5, -0.7), (0.8, 0.2)],
        [(0.0, 0.0), (0.4, 0.1), (0.7, 0.15), (1.0, 0.05)],  # flat
    ]
)


def _integrated(parameters, fractions):
    """(x, y, θ) at the fractions of the length by scipy: no formula of the fit's."""
    x, y, angle, curvature, force_x, force_y, length = parameters

    def rate(_, state):
        kappa = curvature + (state[0] - x) * force_y - (state[1] - y) * force_x
        return [np.cos(state[2]), np.sin(state[2]), kappa]

    solution = solve_ivp(
        rate, (0, length), [x, y, angle], method="DOP853", rtol=1e-13, atol=1e-13 * length, dense_output=True
    )
    return solution.sol(np.asarray(fractions) * length).T


def _squared(parameters, samples, metric):
    """The square of Fisker2018 (3.2) or (3.3), written down once more."""
    states = _integrated(parameters, samples.fractions[0])
    error = ((states[:, :2] - samples.points[0]) ** 2).sum(axis=1) / samples.lengths[0] ** 3
    if metric == "H1":
        error += (states[:, 2] - samples.angles[0]) ** 2 / samples.lengths[0]
    return samples.weights[0] @ error


def _slopes(function, at, *arguments):
    """Derivatives along the seven numbers, the force's in units of 25: central differences, extrapolated."""
    found = []
    for step in (2e-4, 1e-4):
        moves = np.diag([1.0, 1.0, 1.0, 5.0, 25.0, 25.0, 1.0]) * step
        found.append([(function(at + m, *arguments) - function(at - m, *arguments)) / (2 * step) for m in moves])
    return (4.0 * np.array(found[1]) - np.array(found[0])) / 3.0


@pytest.mark.parametrize("metric", ["L2", "H1"])
@pytest.mark.parametrize("ends", ENDS)
def test_the_result_is_stationary_and_the_ends_hold(metric, ends):
    for control in CURVES:
        fit = fit_elastica(control, metric, ends)
        assert fit.status == "converged"
        parameters, (samples, _) = fit.elastica.parameters, samples_of(control)
        best = _squared(parameters, samples, metric)
        assert fit.distance == pytest.approx(np.sqrt(best), rel=1e-8)
        held = HELD[ends]
        tips = _integrated(parameters, [0.0, 1.0])[:, :held]
        assert np.abs(tips - samples.ends[0][:, :held]).max(initial=0.0) < 1e-10 * samples.lengths[0]

        # Along the directions that hold the ends to first order, the distance has no slope.
        gradient = _slopes(_squared, parameters, samples, metric)
        if held:
            rows = _slopes(_integrated, parameters, [0.0, 1.0])[:, :, :held].reshape(7, -1)
            _, singular, basis = np.linalg.svd(rows.T, full_matrices=True)
            gradient = basis[np.count_nonzero(singular > 1e-6 * singular[0]) :] @ gradient
            assert len(gradient) == 7 - 2 * held
        assert np.abs(gradient).max() < 1e-6 * np.sqrt(best)


@pytest.mark.parametrize("ends", ENDS)
def test_the_distances_are_those_of_the_measures(ends):
    for control in CURVES:
        curve = CubicBezier(control)
        fit = fit_elastica(curve, ends=ends, nodes=64)
        assert fit.distance == pytest.approx(l2_distance(curve, fit.elastica), rel=1e-9)
        fit = fit_elastica(curve, "H1", ends, nodes=64)
        assert fit.distance == pytest.approx(h1_distance(curve, fit.elastica), rel=1e-8)


def test_holding_more_comes_less_close():
    free, points, tangents = (fit_elastica_batch(CURVES, ends=ends).distance for ends in ENDS)
    assert (free <= points).all()
    assert (points <= tangents).all()


@pytest.mark.parametrize("metric", ["L2", "H1"])
@pytest.mark.parametrize("ends", ENDS)
def test_an_elastica_is_its_own_best_fit(metric, ends):
    random = np.random.default_rng(7)
    for i in range(40):
        k = random.uniform(0.1, 0.99) if i % 2 else random.uniform(1.01, 4.0)
        true = Elastica.from_modulus(
            k,
            random.uniform(-3, 3),
            random.uniform(1, 6) / max(k, 1),
            10 ** random.uniform(-2, 2),
            random.uniform(-3, 3),
        )
        fit = fit_elastica(true, metric, ends, nodes=48)
        assert fit.distance < 1e-10
        t = np.linspace(0.0, 1.0, 17)
        assert np.abs(fit.elastica.point(t) - true.point(t)).max() < 1e-9 * true.length


def test_lines_and_circles_fit_themselves():
    line = fit_elastica([(0.0, 0.0), (1.0, 1.0), (2.0, 2.0), (3.0, 3.0)], ends="tangents")
    assert line.distance < 1e-12
    assert np.abs(line.elastica.curvature_at([0.0, line.elastica.length])).max() < 1e-6
    circle = Elastica((1.0, 2.0), 0.3, -0.7, (0.0, 0.0), 5.0)
    assert fit_elastica(circle, ends="points").distance < 1e-11


@pytest.mark.parametrize("ends", ENDS)
def test_similar_and_reversed_curves_have_similar_fits(ends):
    cos, sin = 300.0 * np.cos(2.5), 300.0 * np.sin(2.5)
    one = fit_elastica_batch(CURVES, ends=ends)
    other = fit_elastica_batch(CURVES @ [[cos, sin], [-sin, cos]] + [5e3, -7e3], ends=ends)
    back = fit_elastica_batch(CURVES[:, ::-1], ends=ends)
    np.testing.assert_allclose(other.distance, one.distance, rtol=1e-8)
    np.testing.assert_allclose(back.distance, one.distance, rtol=1e-8)
    np.testing.assert_allclose(other.parameters[:, 6], 300.0 * one.parameters[:, 6], rtol=1e-6)
    for i in range(len(CURVES)):
        first, second = (Elastica.from_parameters(f.parameters[i]).point([0.0, 0.3, 1.0]) for f in (one, back))
        np.testing.assert_allclose(second[[0, 2]], first[[2, 0]], atol=1e-6)


def test_a_batch_is_its_rows():
    assert fit_elastica_batch(CURVES[0]).distance.shape == ()
    fits = fit_elastica_batch(CURVES.reshape(2, 3, 4, 2), ends="points")
    assert fits.distance.shape == fits.status.shape == (2, 3)
    assert fits.parameters.shape == (2, 3, 7)
    for control, parameters, distance in zip(CURVES, fits.parameters.reshape(-1, 7), fits.distance.ravel()):
        single = fit_elastica(control, ends="points")
        assert single.distance == pytest.approx(distance, rel=1e-9)  # numpy sums rows in another order
        np.testing.assert_allclose(single.elastica.parameters, parameters, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("ends", ENDS)
def test_one_bad_row_spoils_nothing(ends):
    bad = np.array(
        [
            [(0.0, np.nan), (1.0, 1.0), (2.0, 1.0), (3.0, 0.0)],
            [(0.0, 0.0), (1.0, np.inf), (2.0, 1.0), (3.0, 0.0)],
            [(2.0, 1.0)] * 4,  # no length
            [(0.0, 0.0)] * 4,
        ]
    )
    mixed = np.concatenate([CURVES[:2], bad, CURVES[2:]])
    fits, alone = fit_elastica_batch(mixed, ends=ends), fit_elastica_batch(CURVES, ends=ends)
    assert fits.status.tolist() == [0, 0, 3, 3, 3, 3, 0, 0, 0, 0]
    assert np.isnan(fits.parameters[2:6]).all()
    assert np.isnan(fits.distance[2:6]).all()
    kept = [0, 1, 6, 7, 8, 9]
    np.testing.assert_allclose(fits.parameters[kept], alone.parameters, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(fits.distance[kept], alone.distance, rtol=1e-9)


def test_degenerate_control_points_are_fitted_or_named():
    odd = np.array(
        [
            [(0.0, 0.0), (0.0, 0.0), (1.0, 1.0), (2.0, 0.0)],  # first handle without length
            [(0.0, 0.0), (1.0, 1.0), (2.0, 0.0), (2.0, 0.0)],
            [(0.0, 0.0), (1.0, 1.0), (0.0, 1.0), (1.0, 0.0)],  # an exact cusp
            [(0.0, 0.0), (1.0, 1.0), (-1.0, 1.0), (0.0, 0.0)],  # closed
            [(0.0, 0.0), (2.0, 0.0), (-1.0, 0.0), (1.0, 0.0)],  # a line that doubles back
        ]
    )
    for ends in ENDS:
        fits = fit_elastica_batch(odd, ends=ends)
        done = fits.status < 2
        assert np.isfinite(fits.distance[done]).all()
        assert np.isfinite(fits.parameters[done]).all()
        assert np.isnan(fits.distance[~done]).all()
        assert done[:2].all()


def test_noisy_points_are_fitted_to_the_noise():
    random = np.random.default_rng(11)
    true = Elastica.from_modulus(0.8, -1.0, 4.0, 2.0, 0.4)
    for noise, most in ((1e-2, 2e-2), (1e-4, 3e-4), (0.0, 1e-9)):
        points = true.point(np.linspace(0, 1, 80)) + noise * true.length * random.normal(size=(80, 2))
        assert l2_distance(true, fit_elastica(from_points(points)).elastica) < most


def test_a_given_start_is_used_and_a_row_of_nan_asks_for_the_guess():
    samples, _ = samples_of(CURVES[:2])
    found = fit_samples(samples, ends="points")
    given = found.parameters.copy()
    given[1] = np.nan
    again = fit_samples(samples, ends="points", starts=1, given=given)
    assert again.iterations[0] <= 3
    assert np.isnan(again.r1[0])
    assert np.isfinite(again.r1[1])
    np.testing.assert_allclose(again.distance, found.distance, rtol=1e-10)


def test_weight_on_the_force_trades_distance_for_force():
    samples, _ = samples_of(CURVES)
    plain, heavy = (fit_samples(samples, ends="points", force_weight=w) for w in (0.0, 1e-5))
    force = [np.hypot(f.parameters[:, 4], f.parameters[:, 5]) * f.parameters[:, 6] ** 2 for f in (plain, heavy)]
    assert (heavy.distance >= plain.distance * (1 - 1e-9)).all()
    assert (force[1] <= force[0] * (1 + 1e-9)).all()
    assert (force[1] < 0.99 * force[0]).any()
    # `distance` is without the weight.
    assert heavy.distance[0] == pytest.approx(
        np.sqrt(_squared(heavy.parameters[0], samples_of(CURVES[0])[0], "L2")), rel=1e-8
    )


def test_the_residuals_are_those_of_the_guess():
    for control in CURVES:
        fit, guess = fit_elastica(control, nodes=64), initial_elastica(control, nodes=64)
        np.testing.assert_allclose(
            [fit.r1, fit.r2, fit.r3, fit.r4], [guess.r1, guess.r2, guess.r3, guess.r4], rtol=1e-6
        )
        assert fit.distance <= fit.r4 * (1 + 1e-12)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: fit_elastica(CURVES[0], "L1"), "'L2' or 'H1'; got 'L1'"),
        (lambda: fit_elastica(CURVES[0], ends="fixed"), "'free', 'points' or 'tangents'; got 'fixed'"),
        (lambda: fit_elastica(CURVES[0], starts=0), "1 to 13; got 0"),
        (lambda: fit_elastica(CURVES[0], starts=14), "1 to 13; got 14"),
        (lambda: fit_elastica(samples_of(CURVES)[0]), "one curve; got 6; use fit_elastica_batch"),
        (lambda: fit_elastica(np.zeros((4, 2))), "no length or is not finite"),
        (lambda: fit_elastica(np.full((4, 2), np.nan)), "no length or is not finite"),
        (lambda: fit_elastica(np.zeros((5, 2))), "from_points"),
        (lambda: fit_elastica_batch(np.zeros((3, 4, 3))), r"\(3, 4, 3\)"),
    ],
)
def test_bad_input_is_refused(call, message):
    with pytest.raises(InvalidInputError, match=message):
        call()


def test_ends_that_cannot_be_met_are_said_so():
    samples, _ = samples_of(CURVES[0])
    far = np.array(samples.ends)
    far[0, 1, 0] = 1e9  # the end point is to lie a billion lengths away
    wrong = type(samples)(*(far if f == "ends" else getattr(samples, f) for f in samples.__dataclass_fields__))
    with pytest.raises(ConvergenceError, match="try ends='points' or 'free'") as caught:
        fit_elastica(wrong, ends="points")
    assert isinstance(caught.value.iterations, int)
    assert fit_samples(wrong, ends="points").status.tolist() == [
        STATUS.index("end conditions cannot be met from any start")
    ]


# --- against Ipopt ---


@pytest.fixture(scope="module")
def proof():
    pytest.importorskip("casadi")
    path = Path(__file__).parents[2] / "benchmarks" / "proof_fit.py"
    spec = importlib.util.spec_from_file_location("proof_fit", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _compare(proof, indices, starts, max_iterations):
    rows = [proof.by_us(proof.by_ipopt(i, starts, max_iterations=max_iterations)) for i in indices]
    feasible = sum(np.isfinite(row["ipopt"]).any() for row in rows)
    return rows, feasible, [(row["index"], proof.excess(row)) for row in rows if proof.excess(row) > proof.SLACK]


@pytest.mark.parametrize("ends", ENDS)
def test_never_worse_than_ipopt_from_the_same_guess(proof, ends):
    """40 random curves in all: 3 in 5 from the disc, the rest from the annuli; none is left out."""
    indices = [i for i in range(52) if proof.ends_of(i) == ends]
    indices = [i for i in indices if i % 2 == 0 or i < 48][:14]
    rows, feasible, worse = _compare(proof, indices, 1, 150)
    assert feasible >= 0.6 * len(rows)  # elsewhere Ipopt missed the end conditions: any result is better
    assert worse == []


@pytest.mark.slow
@pytest.mark.parametrize(("size", "starts", "allowed"), [(300, 1, 0.0), (120, 4, 0.005)])
def test_the_claim_on_many_curves(proof, size, starts, allowed):
    rows, _, worse = _compare(proof, range(size), starts, 200)
    assert len(worse) <= allowed * len(rows), worse
