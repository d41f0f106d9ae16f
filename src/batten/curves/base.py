"""The one protocol that every plane curve of batten satisfies."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from batten.errors import InvalidInputError
from batten.typing import ArrayLike, FloatArray


@runtime_checkable
class Curve(Protocol):
    """A plane curve γ: [0, 1] → R² with derivatives up to the third, an arc length and a list of its breaks.

    The parameter is t ∈ [0, 1]; it need not be proportional to arc length. A curve is piecewise smooth: between two
    neighbouring values of `breaks()` it has as many derivatives as anyone asks for, and at a break the value is that of
    the piece on the right (at t = 1, of the last piece). Objects are immutable. Functions that take a `Curve` use only
    these four members, so any object that has them will do. `length` is an attribute (a property), not a method: an
    elastica stores it.

    Example:
        >>> import numpy as np
        >>> class Segment:
        ...     def point(self, t):
        ...         return np.asarray(t)[..., None] * np.array([3.0, 4.0])
        ...     def derivative(self, t, order=1):
        ...         return np.ones(np.shape(t))[..., None] * np.array([3.0, 4.0]) * (order == 1)
        ...     length = 5.0
        ...     def breaks(self):
        ...         return np.array([0.0, 1.0])
        >>> isinstance(Segment(), Curve)
        True
    """

    def point(self, t: ArrayLike) -> FloatArray:
        """Points γ(t), shape (…, 2) for t of shape (…); t ∈ [0, 1], outside of it the curve may extrapolate or not."""
        ...

    def derivative(self, t: ArrayLike, order: int = 1) -> FloatArray:
        """Derivatives dⁿγ/dtⁿ for n = `order` ∈ {1, 2, 3}, shape (…, 2) for t of shape (…)."""
        ...

    @property
    def length(self) -> float:
        """The arc length from t = 0 to t = 1, in the unit of the coordinates (an attribute, not a method)."""
        ...

    def breaks(self) -> FloatArray:
        """Parameters where the curve need not be smooth, ascending, 0 and 1 included; shape (n + 1,) for n pieces."""
        ...


def check_order(order: int) -> None:
    """Refuse orders of differentiation other than 1, 2 and 3: `InvalidInputError`."""
    if order not in (1, 2, 3):
        raise InvalidInputError(f"derivatives of order 1, 2 and 3 are defined; got {order}; for order 0 use point(t)")
