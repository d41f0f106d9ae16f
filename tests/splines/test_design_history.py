"""The steps of a design: going back and forth."""

import pytest

from batten.curves.cubic_proxy import CubicProxy
from batten.errors import InvalidInputError
from batten.splines.design_history import DesignHistory, DesignState
from batten.splines.design_limits import DesignLimits

LINE = CubicProxy.line((0, 0), (3, 0))


def state(height, action="move"):
    return DesignState(
        LINE.with_control_point(1, (1.0, height)), DesignLimits(), action, 1 if action == "move" else None
    )


def heights(history):
    return [s.proxy.control_points[1, 1] for s in history.states]


def test_a_new_step_drops_what_was_undone():
    history = DesignHistory([state(0.0, "start")])
    for height in (1.0, 2.0, 3.0):
        history.add(state(height))
    history.back()
    history.back()
    assert (history.undo_depth, history.redo_depth) == (1, 2)
    history.add(state(9.0))
    assert heights(history) == [0.0, 1.0, 9.0]
    assert (history.undo_depth, history.redo_depth) == (2, 0)
    history.add(state(8.0), replace=True)
    assert heights(history) == [0.0, 1.0, 8.0]


def test_there_and_back_are_the_same_objects():
    history = DesignHistory([state(0.0, "start")])
    history.add(state(1.0))
    last = history.present
    first = history.back()
    assert first is history.states[0]
    assert history.forth() is last
    with pytest.raises(InvalidInputError, match="no undone step"):
        history.forth()
    history.back()
    with pytest.raises(InvalidInputError, match="no step to undo"):
        history.back()


@pytest.mark.parametrize(
    ("states", "current", "message"),
    [
        ([], 0, "the present state is one of the 0"),
        ([state(0.0, "start")], 1, "got 1"),
        ([state(0.0, "start")], -1, "got -1"),
        ([state(0.0)], 0, "state 0 has the action 'move'; allowed are start"),
        ([state(0.0, "start"), state(0.0, "start")], 0, "state 1 has the action 'start'; allowed are move"),
        ([state(0.0, "start"), DesignState(LINE, DesignLimits(), "move", 4)], 0, "state 1 moves control point 4"),
        ([state(0.0, "start"), DesignState(LINE, DesignLimits(), "move")], 0, "state 1 moves control point None"),
    ],
)
def test_what_is_no_history_is_refused(states, current, message):
    with pytest.raises(InvalidInputError, match=message):
        DesignHistory(states, current)
