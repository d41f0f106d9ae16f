"""The steps of a design, to go back and forth between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from batten.curves.cubic_proxy import CubicProxy
from batten.errors import InvalidInputError
from batten.splines.design_limits import DesignLimits

ACTIONS = ("start", "move", "insert", "delete", "borders", "limits")
"""What can lead to a state; "start" to the first one alone."""


@dataclass(frozen=True)
class DesignState:
    """All that a design consists of at one time, and what led there.

    Attributes:
        proxy: the cubic spline with its borders.
        limits: what its pieces have to keep.
        action: one of `ACTIONS`.
        index: the control point moved, the piece divided or the joint deleted; None for other actions.
    """

    proxy: CubicProxy
    limits: DesignLimits
    action: str = "start"
    index: int | None = None


class DesignHistory:
    """States in the order in which they came to be, and which of them is the present one.

    Parameters:
        states: at least one, the first with the action "start", the others with others.
        current: index of the present one.

    Raises:
        InvalidInputError: no states, a `current` that is none of them, an action out of place.

    Example:
        >>> line = CubicProxy.line((0, 0), (3, 0))
        >>> history = DesignHistory([DesignState(line, DesignLimits())])
        >>> history.add(DesignState(line.with_control_point(1, (1, 0.1)), DesignLimits(), "move", 1))
        >>> history.back().proxy is line, history.undo_depth, history.redo_depth
        (True, 0, 1)
    """

    def __init__(self, states: Sequence[DesignState], current: int = 0) -> None:
        self._states = list(states)
        if not 0 <= current < len(self._states):
            raise InvalidInputError(
                f"the present state is one of the {len(self._states)} of the history, counted from 0; got {current}"
            )
        self._current = current
        for i, state in enumerate(self._states):
            allowed = ACTIONS[1:] if i else ACTIONS[:1]
            if state.action not in allowed:
                raise InvalidInputError(f"state {i} has the action {state.action!r}; allowed are {', '.join(allowed)}")
            points = len(state.proxy.control_points)
            if state.action == "move" and (state.index is None or not 0 <= state.index < points):
                raise InvalidInputError(f"state {i} moves control point {state.index}; it has 0 … {points - 1}")

    @property
    def states(self) -> tuple[DesignState, ...]:
        """All states, those that were undone included."""
        return tuple(self._states)

    @property
    def current(self) -> int:
        """The index of the present state."""
        return self._current

    @property
    def present(self) -> DesignState:
        """The present state."""
        return self._states[self._current]

    @property
    def undo_depth(self) -> int:
        """How many steps can be undone."""
        return self._current

    @property
    def redo_depth(self) -> int:
        """How many undone steps can be done again."""
        return len(self._states) - 1 - self._current

    def add(self, state: DesignState, *, replace: bool = False) -> None:
        """Go on to a state; undone ones are dropped. replace: it takes the place of the present one."""
        keep = self._current if replace else self._current + 1
        self._states[keep:] = [state]
        self._current = keep

    def back(self) -> DesignState:
        """Go one state back.

        Raises:
            InvalidInputError: the present state is the first one.
        """
        if self.undo_depth == 0:
            raise InvalidInputError("there is no step to undo; see undo_depth")
        self._current -= 1
        return self.present

    def forth(self) -> DesignState:
        """Go one state forth.

        Raises:
            InvalidInputError: the present state is the last one.
        """
        if self.redo_depth == 0:
            raise InvalidInputError("there is no undone step to do again; see redo_depth")
        self._current += 1
        return self.present
