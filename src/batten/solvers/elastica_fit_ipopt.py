"""The reference for `elastica_fit`: the same least distance, found by Ipopt on a symbolic elastica.

Nothing is shared with the fast path but the samples. The elastica here is its differential equation, integrated by Taylor
steps as a casadi graph; casadi differentiates that graph exactly, twice, and Ipopt, an interior-point filter line search,
minimises. It needs the extra `verify` (casadi) and takes tens of milliseconds a curve.

The unknowns describe the curve at one of its points near the middle: position, tangent angle θ, and, free of dimension, κℓ
and the force ℓ²R₋θ(λ₁, λ₂) in the frame of the tangent, and the length ℓ. Then the shape depends on three of them only, and
what grows along an unstable curve grows over half of it.
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
_STEP_ERROR = 1e-13  # of the integration, × length, checked on every solution
_MOVES = 32  # stretches between the start and the point described by the unknowns
_SIZES = np.array([1.0, 1.0, 1.0, 5.0, 25.0, 25.0, 1.0])  # of the unknowns, for Ipopt's regularisation
_SHORTEST = 0.05  # a fit shorter than a twentieth of the curve is none


class IpoptFit(NamedTuple):
    """What Ipopt found.

    parameters: (7,), as `Elastica.parameters`. distance: normalised by the length. iterations: over all refinements.
    status: Ipopt's own word. violation: largest error of the held coordinates, on the curve scaled to length 1.
    """

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

    Minimises F = ½ Σ wᵢ ‖γ(σᵢℓ) − xᵢ‖² (Brander2016 §4), for "H1" with ½ Σ wᵢ L² (θ(σᵢℓ) − θᵢ)² added, over all elastica
    of length ℓ ≥ L/20. The distance returned is √(2F/L³): Fisker2018 (3.2) for "L2", (3.3) for "H1".

    Parameters:
        samples: one curve, with nodes xᵢ, θᵢ, σᵢ, wᵢ (see `samples_of`).
        start_parameters: shape (7,), where to start: start_x, start_y, start_angle, start_curvature, force_x, force_y,
            length, as `Elastica.parameters`.
        metric: "L2" or "H1".
        ends: "free"; "points" holds both end points; "tangents" also both end tangents, the angles without jumps by 2π.
        max_iterations: of Ipopt, for each refinement of the integration.

    Returns:
        `IpoptFit`; `status` is Ipopt's own ("Solve_Succeeded", "Maximum_Iterations_Exceeded", …). It is a local minimum.

    Raises:
        BattenError: casadi is not installed.
        InvalidInputError: shapes or values that make no curve.

    Accuracy: Ipopt's tolerance is 1e-12 on the curve scaled to length 1; the integration is checked to 1e-13 × length on
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
    fractions, weights = samples.fractions[0], samples.weights[0] / length
    anchor = float(fractions[fractions.size // 2])
    count = {"free": 0, "points": 2, "tangents": 3}[ends]
    tips = ((samples.ends[0] - [*origin, 0.0]) / [length, length, 1.0])[:, :count]
    nodes_xy = (samples.points[0] - origin) / length
    nodes = [*nodes_xy.T, samples.angles[0], fractions, weights]
    data = np.concatenate([*nodes, *tips])

    # Force form ↔ unknowns: scale to length 1, bring the angle to the samples' turn, go to the anchor.
    unit = np.array([length, length, 1.0, 1 / length, 1 / length**2, 1 / length**2, length])
    shift = np.array([*origin, 0.0, 0.0, 0.0, 0.0, 0.0])
    scaled = (start - shift) / unit
    scaled[2] -= 2 * np.pi * np.round((scaled[2] - samples.ends[0, 0, 2]) / (2 * np.pi))
    guess = _moved(_local(scaled, -1.0), anchor)

    iterations = 0
    lowest = np.array([-np.inf] * 6 + [_SHORTEST])
    for substeps in _SUBSTEPS:
        solver = _problem(fractions.size, metric, count, substeps, max_iterations)
        solution = solver(x0=guess / _SIZES, p=data, lbx=lowest, ubx=np.inf, lbg=0.0, ubg=0.0)
        stats = solver.stats()
        iterations += int(stats["iter_count"])
        guess = np.asarray(solution["x"]).ravel() * _SIZES
        rough, fine = (np.asarray(_states(fractions.size, m)(guess, fractions)) for m in (substeps, 2 * substeps))
        if iterations >= max_iterations or not np.abs(rough - fine).max() >= _STEP_ERROR:
            break
    begin, end = _moved(guess, -anchor), _moved(guess, 1.0 - anchor)
    violation = float(np.abs(np.array([begin[:count], end[:count]]) - tips).max(initial=0.0))
    error = ((fine[:2, 1:-1].T - nodes_xy) ** 2).sum(axis=1) + (metric == "H1") * (
        fine[2, 1:-1] - samples.angles[0]
    ) ** 2
    distance = float(np.sqrt(weights @ error))  # Ipopt's own value is not to be had where it gave up
    return IpoptFit(_local(begin, 1.0) * unit + shift, distance, iterations, str(stats["return_status"]), violation)


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


def _local(parameters: FloatArray, way: float) -> FloatArray:
    """Force form to unknowns (way −1): κ → κℓ, λ → ℓ²R₋θλ; and back (way 1)."""
    out = parameters.copy()
    length, cos, sin = parameters[6], np.cos(parameters[2]), way * np.sin(parameters[2])
    out[3] = parameters[3] * length**-way
    out[4] = (cos * parameters[4] - sin * parameters[5]) * length ** (-2 * way)
    out[5] = (sin * parameters[4] + cos * parameters[5]) * length ** (-2 * way)
    return out


def _moved(unknowns: FloatArray, fraction: float) -> FloatArray:
    """The same elastica described at another point of it, `fraction` of its length ahead."""
    ahead = np.asarray(_move()(unknowns, fraction)).ravel()
    cos, sin = np.cos(ahead[2] - unknowns[2]), np.sin(ahead[2] - unknowns[2])
    force = [cos * unknowns[4] + sin * unknowns[5], cos * unknowns[5] - sin * unknowns[4]]
    return np.array([*ahead, *force, unknowns[6]])


def _casadi() -> Any:
    try:
        import casadi
    except ImportError as error:
        raise BattenError(
            'the solver "ipopt" needs casadi, which is not installed; install it with: pip install "batten[verify]"'
        ) from error
    return casadi


def _stretch(ca: Any, substeps: int) -> Any:
    """Some Taylor steps as a casadi function: state (x, y, θ, cos θ, sin θ), step h, law (κ₀, λ₁, λ₂) ↦ state.

    x, y and θ count from where the law holds. With scaled Taylor coefficients, κ = κ₀ + xλ₂ − yλ₁ and
    (cos θ)′ = −κ sin θ, (sin θ)′ = κ cos θ give each coefficient from those before it.
    """
    state, h, law = ca.SX.sym("state", 5), ca.SX.sym("h"), ca.SX.sym("law", 3)
    step = h / substeps
    now = ca.vertsplit(state)
    for _ in range(substeps):
        x, y, turned, cos, sin = ([v] for v in now)
        kappa = []
        for n in range(_ORDER):
            kappa.append(step * (x[n] * law[2] - y[n] * law[1] + (law[0] if n == 0 else 0)))
            x.append(step * cos[n] / (n + 1))
            y.append(step * sin[n] / (n + 1))
            turned.append(kappa[n] / (n + 1))
            by_sin = sum(kappa[j] * sin[n - j] for j in range(n + 1))
            by_cos = sum(kappa[j] * cos[n - j] for j in range(n + 1))
            cos.append(-by_sin / (n + 1))
            sin.append(by_cos / (n + 1))
        now = [sum(reversed(series)) for series in (x, y, turned, cos, sin)]
    return ca.Function("stretch", [state, h, law], [ca.vertcat(*now)])


def _shape(ca: Any, law: Any, fractions: Any, n: int, substeps: int) -> Any:
    """(x, y, θ) in the frame of the point described, unit length, at n fractions of the length, in their order; (3, n)."""
    steps = ca.diff(ca.vertcat(0, fractions)).T
    start = ca.DM([0, 0, 0, 1, 0])
    return _stretch(ca, substeps).mapaccum(n)(start, steps, ca.repmat(law, 1, n))[:3, :]


def _placed(ca: Any, unknowns: Any, shape: Any) -> Any:
    """The shape turned, scaled and shifted to where it belongs."""
    cos, sin, length = ca.cos(unknowns[2]), ca.sin(unknowns[2]), unknowns[6]
    return ca.vertcat(
        unknowns[0] + length * (cos * shape[0, :] - sin * shape[1, :]),
        unknowns[1] + length * (sin * shape[0, :] + cos * shape[1, :]),
        unknowns[2] + shape[2, :],
    )


@lru_cache(maxsize=32)
def _move() -> Any:
    """(unknowns, fraction of the length ahead) ↦ (x, y, θ, κℓ) there."""
    ca = _casadi()
    unknowns, fraction = ca.MX.sym("unknowns", 7), ca.MX.sym("fraction")
    shape = _shape(ca, unknowns[3:6], fraction * ca.DM(np.arange(1, _MOVES + 1) / _MOVES), _MOVES, 4)[:, -1]
    curvature = unknowns[3] + shape[0] * unknowns[5] - shape[1] * unknowns[4]
    return ca.Function("move", [unknowns, fraction], [ca.vertcat(_placed(ca, unknowns, shape), curvature)])


@lru_cache(maxsize=32)
def _states(n: int, substeps: int) -> Any:
    """(unknowns, n ascending fractions) ↦ (x, y, θ) at 0, at the fractions, at 1; (3, n + 2).

    The unknowns describe the fraction of index n // 2; the steps go from there both ways.
    """
    ca = _casadi()
    unknowns, fractions = ca.MX.sym("unknowns", 7), ca.MX.sym("fractions", n)
    middle = n // 2
    relative = ca.vertcat(0.0, fractions, 1.0) - fractions[middle]
    before = _shape(ca, unknowns[3:6], relative[: middle + 1][::-1], middle + 1, substeps)
    after = _shape(ca, unknowns[3:6], relative[middle + 2 :], n - middle, substeps)
    shape = ca.horzcat(before[:, ::-1], ca.DM.zeros(3, 1), after)
    return ca.Function("states", [unknowns, fractions], [_placed(ca, unknowns, shape)])


@lru_cache(maxsize=32)
def _problem(n: int, metric: Metric, count: int, substeps: int, max_iterations: int) -> Any:
    """The nonlinear program for n samples, built once and solved for many curves: all data are its parameters.

    `count` coordinates out of (x, y, θ) are held at both ends.
    """
    ca = _casadi()
    variables = ca.MX.sym("variables", 7)
    data = ca.MX.sym("data", 5 * n + 2 * count)
    points = ca.reshape(data[: 2 * n], n, 2).T
    angles, fractions, weights = (data[i * n : (i + 1) * n] for i in (2, 3, 4))
    states = _states(n, substeps)(variables * _SIZES, fractions)
    objective = 0.5 * ca.dot(weights, ca.sum1((states[:2, 1:-1] - points) ** 2).T)
    if metric == "H1":
        objective += 0.5 * ca.dot(weights, (states[2, 1:-1].T - angles) ** 2)
    held = ca.vertcat(states[:count, 0], states[:count, -1]) - data[5 * n :]
    ipopt = {"print_level": 0, "sb": "yes", "tol": 1e-12, "max_iter": max_iterations, "constr_viol_tol": 1e-12}
    options = {
        "print_time": False,
        "show_eval_warnings": False,  # a trial step too long for the integrator gives NaN, and Ipopt shortens it
        "ipopt": {**ipopt, "mu_init": 1e-10},  # the one bound, on the length, is not to push the start away
    }
    return ca.nlpsol("fit", "ipopt", {"x": variables, "p": data, "f": objective, "g": held}, options)
