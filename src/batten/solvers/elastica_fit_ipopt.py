"""The reference for `elastica_fit`: the same least distance, found by Ipopt on a symbolic elastica.

Nothing is shared with the fast path. The elastica here is its differential equation, integrated by Taylor steps as a casadi
graph; casadi differentiates that graph exactly, and Ipopt, an interior-point filter line search, minimises. It is thorough,
needs the extra `verify` (casadi), and takes tens of milliseconds a curve.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Literal, NamedTuple

import numpy as np

from batten.errors import BattenError, InvalidInputError
from batten.solvers.curve_samples import CurveSamples
from batten.typing import ArrayLike, FloatArray

Metric = Literal["L2", "H1"]
Ends = Literal["free", "points", "tangents"]

_ORDER = 14  # of the Taylor steps
_SUBSTEPS = (1, 2, 4, 8, 16)  # steps between two neighbouring samples: refined until _STEP_ERROR is met
_LOWEST = np.array([-np.inf] * 6 + [0.05])  # a fit shorter than a twentieth of the curve is none
_MOVES = 32  # stretches from one end to the middle
_STEP_ERROR = 1e-11  # of the integration, × length, checked on every solution


class IpoptFit(NamedTuple):
    """What Ipopt found: force-form parameters (7,), normalised distance, iterations, Ipopt's status, constraint violation."""

    parameters: FloatArray
    distance: float
    iterations: int
    status: str
    violation: float


def fit_elastica_ipopt(
    samples: CurveSamples,
    start_parameters: ArrayLike,
    *,
    metric: Metric = "L2",
    ends: Ends = "free",
    max_iterations: int = 500,
) -> IpoptFit:
    """The elastica of least distance from a sampled curve, by Ipopt with exact first and second derivatives.

    Minimises F = ½ Σ wᵢ ‖γ(σᵢℓ) − xᵢ‖² (Brander2016 §4), for "H1" with ½ Σ wᵢ L² (θ(σᵢℓ) − θᵢ)² added, over the force
    form (x₀, y₀, θ₀, κ₀, λ₁, λ₂, ℓ). The distance returned is √(2F/L³): Fisker2018 (3.2) for "L2", (3.3) for "H1".

    Parameters:
        samples: one curve, with nodes xᵢ, θᵢ, σᵢ, wᵢ (see `samples_of`).
        start_parameters: shape (7,), where to start: start_x, start_y, start_angle, start_curvature, force_x, force_y,
            length, as `Elastica.parameters`.
        metric: "L2" or "H1".
        ends: "free"; "points" holds both end points; "tangents" also both end tangents, the angles without jumps by 2π.
        max_iterations: of Ipopt, over all refinements.

    Returns:
        `IpoptFit`; `status` is Ipopt's own ("Solve_Succeeded", "Maximum_Iterations_Exceeded", …). It is a local minimum.

    Raises:
        BattenError: casadi is not installed.
        InvalidInputError: shapes or values that make no curve.

    Accuracy: Ipopt's tolerance is 1e-12 on the curve scaled to length 1; the integration is checked to 1e-11 × length on
    the solution and refined up to 16 Taylor steps of order 14 from sample to sample.

    Degenerate cases: lines and circles are ordinary points of the force form; a force or curvature that the samples do
    not determine stays where Ipopt leaves it.

    References: Brander2016 §4; Fisker2018 §3.2.

    Example:
        >>> from batten.solvers.curve_samples import samples_of
        >>> samples, _ = samples_of([[0.0, 0.0], [0.3, 0.6], [0.7, 0.6], [1.0, 0.0]])
        >>> fit = fit_elastica_ipopt(samples, [0.0, 0.0, 1.1, -2.0, 0.0, 0.0, 1.3], ends="points")
        >>> fit.status, bool(fit.distance < 3e-3)
        ('Solve_Succeeded', True)
    """
    start = _checked(samples, start_parameters, metric, ends)
    length, origin = float(samples.lengths[0]), samples.points[0].mean(axis=0)
    unit = np.array([length, length, 1.0, 1 / length, 1 / length**2, 1 / length**2, length])
    shift = np.concatenate([origin, np.zeros(5)])
    guess = (start - shift) / unit
    guess[2] -= 2 * np.pi * np.round((guess[2] - samples.ends[0, 0, 2]) / (2 * np.pi))
    count = {"free": 0, "points": 2, "tangents": 3}[ends]
    tips = ((samples.ends[0] - [*origin, 0.0]) / [length, length, 1.0])[:, :count]
    fractions, weights = samples.fractions[0], samples.weights[0] / length
    nodes = [*((samples.points[0] - origin) / length).T, samples.angles[0], fractions, weights]
    data = np.concatenate([*nodes, *tips])
    anchor = fractions[fractions.size // 2]
    guess = _moved(guess, anchor)
    iterations = 0
    for substeps in _SUBSTEPS:
        solver = _problem(fractions.size, metric, count, substeps, max_iterations)
        solution = solver(x0=guess, p=data, lbx=_LOWEST, ubx=np.inf, lbg=0.0, ubg=0.0)
        stats = solver.stats()
        iterations += int(stats["iter_count"])
        guess = np.asarray(solution["x"]).ravel()
        rough, fine = (np.asarray(_evaluator(fractions.size, m)(guess, fractions)) for m in (substeps, 2 * substeps))
        if iterations >= max_iterations or not np.abs(rough - fine).max() >= _STEP_ERROR:
            break
    found = _moved(guess, -anchor)
    ends_of_it = np.array([found[:count], _moved(found, 1.0)[:count]])
    violation = float(np.abs(ends_of_it - tips).max(initial=0.0))
    distance = float(np.sqrt(max(0.0, 2 * float(solution["f"]))))
    return IpoptFit(found * unit + shift, distance, iterations, str(stats["return_status"]), violation)


def _moved(parameters: FloatArray, fraction: float) -> FloatArray:
    """The same elastica described at another point of it, `fraction` of its length ahead."""
    ahead = np.asarray(_evaluator(_MOVES, 2)(parameters, fraction * np.arange(1, _MOVES + 1) / _MOVES))[:, -1]
    return np.concatenate([ahead[:4], parameters[4:]])


def _checked(samples: CurveSamples, start_parameters: ArrayLike, metric: str, ends: str) -> FloatArray:
    start = np.asarray(start_parameters, dtype=np.float64)
    if metric not in ("L2", "H1") or ends not in ("free", "points", "tangents"):
        raise InvalidInputError(
            f'metric is "L2" or "H1", ends "free", "points" or "tangents"; got metric={metric!r}, ends={ends!r}'
        )
    if len(samples) != 1 or start.shape != (7,):
        raise InvalidInputError(
            f"the fit takes the samples of one curve and 7 start parameters; got {len(samples)} curves and parameters of "
            f"shape {start.shape}: call it curve by curve"
        )
    everything = [
        samples.points,
        samples.angles,
        samples.weights,
        samples.fractions,
        samples.lengths,
        samples.ends,
        start,
    ]
    if not (all(np.isfinite(v).all() for v in everything) and samples.lengths[0] > 0 and start[6] > 0):
        raise InvalidInputError(
            f"the fit needs finite samples and start parameters and positive lengths; got a curve of length "
            f"{samples.lengths[0]} and the start {start}"
        )
    return start


def _casadi() -> Any:
    try:
        import casadi
    except ImportError as error:
        raise BattenError(
            'the solver "ipopt" needs casadi, which is not installed; install it with: pip install "batten[verify]"'
        ) from error
    return casadi


def _taylor_step(ca: Any) -> Any:
    """One step as a casadi function: state (x, y, θ, cos θ, sin θ), step h, (κ₀, λ₁, λ₂) ↦ state.

    x, y and θ count from the start of the curve. With scaled Taylor coefficients, κ = κ₀ + xλ₂ − yλ₁ and
    (cos θ)′ = −κ sin θ, (sin θ)′ = κ cos θ give each coefficient from those before it.
    """
    state, h, law = ca.SX.sym("state", 5), ca.SX.sym("h"), ca.SX.sym("law", 3)
    x, y, turned, cos, sin = ([state[i]] for i in range(5))
    kappa = []
    for n in range(_ORDER):
        kappa.append(h * (x[n] * law[2] - y[n] * law[1] + (law[0] if n == 0 else 0)))
        x.append(h * cos[n] / (n + 1))
        y.append(h * sin[n] / (n + 1))
        turned.append(kappa[n] / (n + 1))
        by_sin = sum(kappa[j] * sin[n - j] for j in range(n + 1))
        by_cos = sum(kappa[j] * cos[n - j] for j in range(n + 1))
        cos.append(-by_sin / (n + 1))
        sin.append(by_cos / (n + 1))
    after = [sum(reversed(series)) for series in (x, y, turned, cos, sin)]
    return ca.Function("taylor_step", [state, h, law], [ca.vertcat(*after)])


def _along(ca: Any, parameters: Any, fractions: Any, n: int, substeps: int) -> Any:
    """(x, y, θ, κ) of the elastica at n fractions of its length from the point described, one after the other, (4, n)."""
    step = _taylor_step(ca)
    state, h, law = ca.SX.sym("state", 5), ca.SX.sym("h"), ca.SX.sym("law", 3)
    after = state
    for _ in range(substeps):
        after = step(after, h / substeps, law)
    stretch = ca.Function("stretch", [state, h, law], [after])
    steps = parameters[6] * ca.diff(ca.vertcat(0, fractions))
    start = ca.vertcat(0, 0, 0, ca.cos(parameters[2]), ca.sin(parameters[2]))
    moved = stretch.mapaccum(n)(start, steps.T, ca.repmat(parameters[3:6], 1, n))
    curvature = moved[0, :] * parameters[5] - moved[1, :] * parameters[4]
    return ca.vertcat(moved[:3, :], curvature) + ca.repmat(parameters[:4], 1, n)


def _both_ways(ca: Any, parameters: Any, fractions: Any, n: int, substeps: int) -> Any:
    """(x, y, θ, κ) at n fractions of the length, of which the middle one is where the parameters describe the curve.

    Unstable growth along the curve is then the square root of what it would be from one end.
    """
    middle = n // 2
    relative = fractions - fractions[middle]
    before = _along(ca, parameters, relative[:middle][::-1], middle, substeps)
    after = _along(ca, parameters, relative[middle + 1 :], n - middle - 1, substeps)
    return ca.horzcat(before[:, ::-1], parameters[:4], after)


@lru_cache(maxsize=32)
def _evaluator(n: int, substeps: int) -> Any:
    """(parameters, fractions) ↦ (x, y, θ, κ) from the point described, in the order of the fractions."""
    ca = _casadi()
    parameters, fractions = ca.MX.sym("parameters", 7), ca.MX.sym("fractions", n)
    return ca.Function("along", [parameters, fractions], [_along(ca, parameters, fractions, n, substeps)])


@lru_cache(maxsize=32)
def _problem(n: int, metric: Metric, count: int, substeps: int, max_iterations: int) -> Any:
    """The nonlinear program for n samples, built once and solved for many curves: all data are its parameters.

    `count` coordinates (x, y, θ) are held at both ends.
    """
    ca = _casadi()
    unknown = ca.MX.sym("unknown", 7)
    data = ca.MX.sym("data", 5 * n + 2 * count)
    points = ca.reshape(data[: 2 * n], n, 2).T
    angles, fractions, weights = (data[i * n : (i + 1) * n] for i in (2, 3, 4))
    if count:
        states = _both_ways(ca, unknown, ca.vertcat(0.0, fractions, 1.0), n + 2, substeps)
        tips = ca.vertcat(states[:count, 0], states[:count, -1])
        states = states[:, 1:-1]
    else:
        states, tips = _both_ways(ca, unknown, fractions, n, substeps), ca.MX(0, 1)
    objective = 0.5 * ca.dot(weights, ca.sum1((states[:2, :] - points) ** 2).T)
    if metric == "H1":
        objective += 0.5 * ca.dot(weights, (states[2, :].T - angles) ** 2)
    nlp = {"x": unknown, "p": data, "f": objective, "g": tips - data[5 * n :]}
    ipopt = {"print_level": 0, "sb": "yes", "tol": 1e-12, "max_iter": max_iterations, "constr_viol_tol": 1e-12}
    options = {
        "print_time": False,
        "show_eval_warnings": False,  # a trial step too long for the integrator gives NaN, and Ipopt shortens it
        "ipopt": {**ipopt, "mu_init": 1e-10},  # the one bound, on the length, is not to push the start away
    }
    return ca.nlpsol("fit", "ipopt", nlp, options)
