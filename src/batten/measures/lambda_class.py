"""Classes of curves by their λ-residual."""

from __future__ import annotations

from typing import overload

import numpy as np
from numpy.typing import NDArray

from batten.errors import InvalidInputError
from batten.typing import ArrayLike

BEST_BELOW = 0.22
"""Below it a curve is "best"."""
GOOD_BELOW = 0.4
"""From `BEST_BELOW` on, and below this, a curve is "good"."""
BORDERLINE_BELOW = 0.5
"""From `GOOD_BELOW` on, and below this, a curve is "borderline"; above it "far"."""
LAMBDA_CLASSES = ("best", "good", "borderline", "far")
"""All classes, from the closest to elastica to the farthest."""


@overload
def lambda_class(residual: float) -> str: ...
@overload
def lambda_class(residual: ArrayLike) -> str | NDArray[np.str_]: ...
def lambda_class(residual: ArrayLike) -> str | NDArray[np.str_]:
    """The class of a λ-residual: "best" < 0.22 ≤ "good" < 0.4 ≤ "borderline" < 0.5 ≤ "far" (Brander2018 §3).

    Parameters:
        residual: e_λ as from `lambda_residual`, shape (…), in [0, 1].

    Returns:
        One of `LAMBDA_CLASSES` for a number, an array of them of the same shape for an array.

    Raises:
        InvalidInputError: something that is no number, or a number outside [0, 1].

    Accuracy: exact comparisons; a residual that is only known to a tolerance may fall on the other side of a border.

    Degenerate cases: NaN (the residual of a single point) gives the empty text "".

    Example:
        >>> lambda_class(0.1)
        'best'
        >>> lambda_class([0.22, 0.45, 1.0]).tolist()
        ['good', 'borderline', 'far']
    """
    try:
        values = np.asarray(residual, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"a λ-residual is a number in [0, 1]; got {residual!r}") from error
    if ((values < 0.0) | (values > 1.0)).any():
        worst = values[(values < 0.0) | (values > 1.0)].flat[0]
        raise InvalidInputError(
            f"a λ-residual lies in [0, 1]; got {worst}; for √L‖r‖ (curvature_residual) no classes exist"
        )
    names = np.array([*LAMBDA_CLASSES, ""])
    found = np.digitize(values, [BEST_BELOW, GOOD_BELOW, BORDERLINE_BELOW])
    classes = names[np.where(np.isnan(values), len(LAMBDA_CLASSES), found)]
    return str(classes) if values.ndim == 0 else classes
