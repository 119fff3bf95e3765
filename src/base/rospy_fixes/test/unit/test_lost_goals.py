# SPDX-License-Identifier: BSD-3-Clause
"""actionlib's own record of a goal, as programs in the lab import it: cancelled before a list has named it."""
import pytest
from actionlib import msg
from actionlib.action_client import ClientGoalHandle, CommState, CommStateMachine
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray

from rospy_fixes import lost_goals


def list_of(*named):
    return GoalStatusArray(status_list=[GoalStatus(goal_id=GoalID(id=name), status=status) for name, status in named])


@pytest.fixture
def cancelled():
    """A goal that was cancelled before it was answered."""
    goal = CommStateMachine(msg.TestActionGoal(goal_id=GoalID(id="ours")), None, None, None, lambda _goal: None)
    ClientGoalHandle(goal).cancel()
    return goal


def test_a_list_from_before_the_goal_does_not_end_it(cancelled):
    cancelled.update_status(list_of())
    cancelled.update_status(list_of(("another", GoalStatus.SUCCEEDED)))
    assert cancelled.state == CommState.WAITING_FOR_CANCEL_ACK
    cancelled.update_result(msg.TestActionResult(status=list_of(("ours", GoalStatus.PREEMPTED)).status_list[0]))
    assert ClientGoalHandle(cancelled).get_terminal_state() == GoalStatus.PREEMPTED
    assert ClientGoalHandle(cancelled).get_result() is not None


def test_a_goal_is_lost_once_lists_do_not_name_it_any_more(cancelled):
    cancelled.update_status(list_of(("ours", GoalStatus.ACTIVE)))
    cancelled.update_status(list_of())
    assert ClientGoalHandle(cancelled).get_terminal_state() == GoalStatus.LOST


def test_a_goal_that_never_arrived_is_lost_after_some_seconds(cancelled, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(lost_goals.time, "monotonic", lambda: now[0])
    cancelled.update_status(list_of())
    now[0] += 0.9 * lost_goals.UNKNOWN_S
    cancelled.update_status(list_of())
    assert cancelled.state == CommState.WAITING_FOR_CANCEL_ACK
    now[0] += 0.2 * lost_goals.UNKNOWN_S
    cancelled.update_status(list_of())
    assert ClientGoalHandle(cancelled).get_terminal_state() == GoalStatus.LOST
