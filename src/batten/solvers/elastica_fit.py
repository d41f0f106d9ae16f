"""The elastica of least distance to a curve."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from batten.curves.base import Curve
from batten.curves.elastica import Elastica, states_at
from batten.errors import ConvergenceError, InvalidInputError
from batten.kernels import elastica_fit_batch as kernel
from batten.solvers.curve_samples import CurveSamples, samples_of
from batten.solvers.shape_library import no_shapes, shape_library
from batten.typing import ArrayLike, FloatArray, IntArray

Metric = Literal["L2", "H1"]
Ends = Literal["free", "points", "tangents"]
Solver = Literal["batten", "ipopt"]

_CONDITIONS = {"free": 0, "points": 4, "tangents": 6}
STATUS = ("converged", "iteration limit", "end conditions cannot be met from any start", "bad input")


@dataclass(frozen=True, eq=False)
class ElasticaFit:
    """Result of `fit_elastica`.

    Attributes:
        elastica: the fitted curve.
        distance: in the chosen norm, normalised by the length: Fisker2018 (3.2) for L2, (3.3) for H1.
        r1, r2, r3, r4: Brander2016's residuals of the initial guess (§4): fit of the curvature, of sin θ_u, the share of
            the curve outside [u_min, u_max], and the L² distance of the guess. NaN where the guess does not exist.
        iterations: over all starts. optimality: predicted √(decrease) of the last step, 0 at a stationary point.
        status: one of `STATUS`.
    """

    elastica: Elastica
    distance: float
    r1: float
    r2: float
    r3: float
    r4: float
    iterations: int
    optimality: float
    status: str


@dataclass(frozen=True, eq=False)
class ElasticaFits:
    """Result of `fit_elastica_batch`; leading shape (…) of the input.

    Attributes:
        parameters: (…, 7), as `Elastica.parameters`; NaN where `status` is 2 or 3.
        distance, r1, r2, r3, r4, optimality: (…). iterations, status: (…), status indexes `STATUS`.
    """

    parameters: FloatArray
    distance: FloatArray
    r1: FloatArray
    r2: FloatArray
    r3: FloatArray
    r4: FloatArray
    iterations: IntArray
    optimality: FloatArray
    status: IntArray


def fit_samples(
    samples: CurveSamples,
    *,
    metric: Metric = "L2",
    ends: Ends = "free",
    starts: int = 4,
    max_iterations: int = 300,
    given: FloatArray | None = None,
    force_weight: float = 0.0,
) -> ElasticaFits:
    """`fit_elastica_batch` for curves that are already sampled; leading shape (b,).

    `given`, shape (b, 7), are parameters to start from in place of the canonical guess; a row of NaN asks for the guess.
    `force_weight` ≥ 0 adds force_weight·|λ|²ℓ⁴ to the squared normalised distance: of shapes that are equally near, the one
    with less end force, which bends less beyond its ends. `distance` is without it.
    """
    if metric not in ("L2", "H1"):
        raise InvalidInputError(f"metric is 'L2' or 'H1'; got {metric!r}")
    if ends not in _CONDITIONS:
        raise InvalidInputError(f"ends is 'free', 'points' or 'tangents'; got {ends!r}")
    if not 1 <= starts <= kernel.MAX_STARTS:
        raise InvalidInputError(f"starts is 1 to {kernel.MAX_STARTS}; got {starts}")
    b = len(samples)
    parameters, info, status = np.empty((b, 7)), np.empty((b, 7)), np.empty(b, dtype=np.int64)
    first = np.full((b, 7), np.nan) if given is None else np.ascontiguousarray(given, dtype=np.float64)
    held = _CONDITIONS[ends]
    library = no_shapes() if starts == 1 else shape_library(held)
    kernel.fit_batch(
        samples.points, samples.angles, samples.curvatures, samples.weights, samples.fractions, samples.lengths,
        samples.ends, first, library, held, metric == "H1", float(force_weight), starts, max_iterations,
        parameters, info, status,
    )  # fmt: skip
    # The kernel works about the middle of the segment.
    parameters[:, :4] = states_at(parameters, -0.5 * parameters[:, 6])
    return ElasticaFits(
        parameters,
        info[:, 0],
        info[:, 1],
        info[:, 2],
        info[:, 3],
        info[:, 4],
        info[:, 5].astype(np.int64),
        info[:, 6],
        status,
    )


def fit_elastica_batch(
    control_points: ArrayLike,
    *,
    metric: Metric = "L2",
    ends: Ends = "free",
    starts: int = 4,
    nodes: int = 32,
    max_iterations: int = 300,
) -> ElasticaFits:
    """`fit_elastica` for many cubic Béziers, control points (…, 4, 2); a bad row gives status 3, NaN; the rest goes on.

    Example:
        >>> arch = np.array([[0.0, 0.0], [0.3, 0.6], [0.7, 0.6], [1.0, 0.0]])
        >>> fits = fit_elastica_batch([arch, np.full((4, 2), np.nan)])
        >>> [STATUS[i] for i in fits.status]
        ['converged', 'bad input']
    """
    samples, shape = samples_of(control_points, nodes=nodes)
    fits = fit_samples(samples, metric=metric, ends=ends, starts=starts, max_iterations=max_iterations)
    return ElasticaFits(
        *(
            getattr(fits, name).reshape((*shape, *getattr(fits, name).shape[1:]))
            for name in ElasticaFits.__dataclass_fields__
        )
    )


def fit_elastica(
    curve: Curve | CurveSamples | ArrayLike,
    metric: Metric = "L2",
    ends: Ends = "free",
    *,
    starts: int = 4,
    nodes: int = 32,
    max_iterations: int = 300,
    solver: Solver = "batten",
) -> ElasticaFit:
    """The elastica of least distance to a curve (Brander2016 §4), with the chosen end conditions.

    Minimises ∫‖γ − γ_e‖² ds / L³, points compared at equal fractions of arc length (Fisker2018 (3.2)), plus
    ∫(θ − θ_e)² ds / L for the H¹ metric (3.3), over all elastica; from several starts, of which the best result is taken.

    Parameters:
        curve: a `Curve`, control points (4, 2) of one cubic Bézier, or `CurveSamples` (see `from_points` for noisy data).
        metric: "L2" or "H1".
        ends: "free", "points" (end points held) or "tangents" (end points and end tangents held).
        starts: 1 takes only the canonical initial guess. More add the curvature integrated, then the most similar shapes of
            a library, each with another number of inflections, then others, up to 13. All are tried where none comes
            within 4 % of the length, or none converges.
        nodes: Gauss nodes on each smooth piece.
        solver: "batten", or "ipopt" for the independent reference (extra `verify`): one start, the canonical guess.

    Returns:
        An `ElasticaFit`. The end conditions hold to 1e-12 × length.

    Raises:
        ConvergenceError: no start could meet the end conditions.
        InvalidInputError: a curve without length, or not finite.

    Example:
        >>> import numpy as np
        >>> fit = fit_elastica(np.array([[0.0, 0.0], [0.3, 0.6], [0.7, 0.6], [1.0, 0.0]]), ends="tangents")
        >>> fit.status, bool(fit.distance < 5e-3)
        ('converged', True)
    """
    samples = curve if isinstance(curve, CurveSamples) else samples_of(curve, nodes=nodes)[0]
    if len(samples) != 1:
        raise InvalidInputError(f"fit_elastica takes one curve; got {len(samples)}; use fit_elastica_batch")
    if solver == "ipopt":
        return _fit_by_ipopt(samples, metric, ends)
    if solver != "batten":
        raise InvalidInputError(f"solver is 'batten' or 'ipopt'; got {solver!r}")
    fits = fit_samples(samples, metric=metric, ends=ends, starts=starts, max_iterations=max_iterations)
    status = int(fits.status[0])
    if status == 3:
        raise InvalidInputError("the curve has no length or is not finite; give a curve with finite, distinct points")
    if status == 2:
        raise ConvergenceError(
            f"no start could meet the end conditions ends={ends!r}; try ends='points' or 'free', or cut the curve in two",
            iterations=int(fits.iterations[0]),
        )
    return ElasticaFit(
        elastica=Elastica.from_parameters(fits.parameters[0]),
        distance=float(fits.distance[0]),
        r1=float(fits.r1[0]),
        r2=float(fits.r2[0]),
        r3=float(fits.r3[0]),
        r4=float(fits.r4[0]),
        iterations=int(fits.iterations[0]),
        optimality=float(fits.optimality[0]),
        status=STATUS[status],
    )


def _fit_by_ipopt(samples: CurveSamples, metric: Metric, ends: Ends) -> ElasticaFit:
    from batten.solvers.elastica_fit_ipopt import fit_elastica_ipopt
    from batten.solvers.initial_guess import initial_elastica

    guess = initial_elastica(samples)
    fit = fit_elastica_ipopt(samples, guess.elastica.parameters, metric=metric, ends=ends)
    return ElasticaFit(
        elastica=Elastica.from_parameters(fit.parameters),
        distance=fit.distance,
        r1=guess.r1,
        r2=guess.r2,
        r3=guess.r3,
        r4=guess.r4,
        iterations=fit.iterations,
        optimality=float("nan"),
        status=STATUS[0] if fit.status == "Solve_Succeeded" else fit.status,
    )
