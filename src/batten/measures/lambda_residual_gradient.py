"""The gradient of the λ-residual by the control points."""

from __future__ import annotations

import numpy as np

from batten.errors import InvalidInputError
from batten.kernels.lambda_residual_gradient import lambda_residual_gradient_batch
from batten.kernels.quadrature import panel_condition
from batten.measures.curvature_fit import cubic_array
from batten.typing import ArrayLike, FloatArray

#: Panels are those of a residual that is this much more accurate: the integrands of the gradient are more singular.
_TIGHTER = 0.01


def lambda_residual_gradient(control: ArrayLike, *, tolerance: float | None = 1e-6) -> tuple[FloatArray, FloatArray]:
    """e_λ of cubic Béziers and ∂e_λ/∂(control points), e_λ as in `lambda_residual`: Brander2018 §2, Fisker2018 (2.3).

    With Q = ∫r² ds and W = ∫κ² ds, de = (dQ − e² dW)/(2eW). At the least-squares multipliers ∂Q/∂(λ₁, λ₂, α) = 0, so dQ
    is taken with the multipliers held (envelope theorem). Sums over fixed nodes have the same property: the gradient is
    that of the number that the same quadrature gives.

    Parameters:
        control: control points, shape (…, 4, 2), any unit of length.
        tolerance: in [1e-8, 0.1], see below; or None for one Gauss rule of 24 nodes (as `lambda_residual` with None,
            whose derivative this is, to rounding). A tolerance τ takes the panels of `lambda_residual` with τ/100.

    Returns:
        (values, gradients): e_λ, shape (…), and its gradient, shape (…, 4, 2), in 1/length. The four rows of a gradient add
        up to 0, it is orthogonal to the control points (scaling) and to the control points turned by 90° (rotation).

    Raises:
        InvalidInputError: an array of another shape, a tolerance outside its range.

    Accuracy: e_λ within `tolerance`; L × |error of the gradient| ≤ tolerance × (1 + L × |gradient|) with the Euclidean
    norm of all eight numbers and the length L. A near-line with sagitta ε × length loses 1e-16/ε², relatively.

    Degenerate cases:
        - A straight line has the value 0 by definition but no gradient (NaN): close to it e_λ depends on the shape of the
          deviation and not on its size, so it jumps.
        - A cusp, an end whose handle has length zero, a line that doubles back: value 1, gradient NaN. With None a cusp is
          not noticed, and the numbers mean nothing there.
        - A single point, or NaN or infinity in the row: both NaN. The other rows stand.

    Example:
        >>> import numpy as np
        >>> arch = np.array([(0, 0), (0.1, 0.7), (0.9, 0.7), (1, 0)])
        >>> value, gradient = lambda_residual_gradient(arch)
        >>> gradient[1].round(4).tolist()  # moving the second point outwards, then upwards
        [0.4035, 0.2487]
        >>> bool(np.abs(gradient.sum(axis=0)).max() < 1e-14)
        True
    """
    points = cubic_array(control)
    if tolerance is not None and not 1e-8 <= tolerance <= 0.1:
        raise InvalidInputError(f"the tolerance of the gradient lies in [1e-8, 0.1] or is None; got {tolerance}")
    condition = 0.0 if tolerance is None else panel_condition(_TIGHTER * tolerance)
    rows = np.require(points.reshape(-1, 4, 2), requirements=["C", "W"])
    values, gradients = np.empty(len(rows)), np.empty((len(rows), 4, 2))
    lambda_residual_gradient_batch(rows, condition, values, gradients)
    shape = points.shape[:-2]
    return values.reshape(shape), gradients.reshape(*shape, 4, 2)
