"""The canonical first guess of an elastica for a curve (Brander2016 §3–4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from batten.curves.base import Curve
from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError
from batten.kernels.elastica_fit_batch import guess_batch
from batten.solvers.curve_samples import CurveSamples, from_points, samples_of
from batten.typing import ArrayLike

STATUS = ("elastica", "line", "circle", "no guess")


@dataclass(frozen=True, eq=False)
class InitialGuess:
    """Result of `initial_elastica`: the elastica, R₁ … R₄ (Brander2016 §4) and what it is (one of `STATUS`)."""

    elastica: Elastica
    r1: float
    r2: float
    r3: float
    r4: float
    status: str


def initial_elastica(curve: Curve | CurveSamples | ArrayLike, *, nodes: int = 64) -> InitialGuess:
    """The canonical elastica near a curve, from linear least squares on its curvature (Brander2016 §3–4).

    λ₁, λ₂, α solve eq. (6); β eq. (9); the modulus follows from eq. (12), the ends from eq. (13) by counting the monotone
    runs of u that are at least half of u_max − u_min high, clipped to the interval; the translation from eq. (14). Where the
    tangents at the ends imply another count than the heights do, the count with the smaller R₄ is taken.

    Parameters:
        curve: a `Curve`, control points (4, 2) of one cubic Bézier, measured points (m, 2) with m ≥ 5 (a smoothing spline is
            put through them first), or `CurveSamples`.
        nodes: Gauss nodes on each smooth piece.

    Returns:
        An `InitialGuess`. Exact elastica are recovered to 1e-8 in every parameter that is determined. R₁ is the λ-residual.

    Degenerate: a line or a circle gives force = 0 and says so in `status`.

    R₃ counts whole quadrature nodes: it is good to about one over their number.

    Example:
        >>> from batten.curves.elastica import Elastica
        >>> arc = Elastica.from_modulus(0.6, 0.4, 2.0)
        >>> guess = initial_elastica(arc)
        >>> bool(guess.r1 < 1e-9), bool(abs(guess.elastica.to_modulus().k - 0.6) < 1e-8)
        (True, True)

    Raises:
        InvalidInputError: no length, not finite, or no guess exists (u does not vary).
    """
    if isinstance(curve, CurveSamples):
        samples = curve
    elif not isinstance(curve, Curve) and np.ndim(curve) == 2 and np.shape(curve)[0] != 4:
        samples = from_points(curve)
    else:
        samples = samples_of(curve, nodes=nodes)[0]
    if len(samples) != 1:
        raise InvalidInputError(f"initial_elastica takes one curve; got {len(samples)}")
    parameters, info, status = np.empty((1, 7)), np.empty((1, 4)), np.empty(1, dtype=np.int64)
    guess_batch(
        samples.points, samples.angles, samples.curvatures, samples.weights, samples.fractions, samples.lengths,
        samples.ends, parameters, info, status,
    )  # fmt: skip
    if status[0] == 3:
        raise InvalidInputError(
            "no first guess: the curve has no length, is not finite, or its curvature gives no direction"
        )
    r1, r2, r3, r4 = info[0].tolist()
    return InitialGuess(Elastica.from_parameters(parameters[0]), r1, r2, r3, r4, STATUS[int(status[0])])
