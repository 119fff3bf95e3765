# SPDX-License-Identifier: BSD-3-Clause
"""The order in which an action server's topics arrive."""
from types import SimpleNamespace

import actionlib
import pytest
from actionlib.action_client import ClientGoalHandle, CommStateMachine
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray
from control_msgs.msg import GripperCommandActionGoal, GripperCommandActionResult

from baxter_examples.action_client import ActionClient


@pytest.fixture
def goal():
    """actionlib's own state of a goal, which no master needs, and the client of it."""
    simple = object.__new__(actionlib.SimpleActionClient)
    simple.simple_state, simple.done_cb, simple.active_cb = actionlib.SimpleGoalState.PENDING, None, None
    simple.done_condition = actionlib.simple_action_client.threading.Condition()
    simple.action_client = SimpleNamespace(ns="gripper_action")
    sent = CommStateMachine(GripperCommandActionGoal(goal_id=GoalID(id="one")), simple._handle_transition, None, None,
                            None)
    simple.gh = ClientGoalHandle(sent)
    client = object.__new__(ActionClient)
    client._client = simple
    return sent, client


@pytest.mark.parametrize("status_first", [True, False])
def test_a_goal_is_done_when_its_result_is_there(goal, status_first):
    sent, client = goal
    succeeded = GoalStatus(goal_id=GoalID(id="one"), status=GoalStatus.SUCCEEDED)
    if status_first:
        sent.update_status(GoalStatusArray(status_list=[succeeded]))
        assert not client.is_done()
    sent.update_result(GripperCommandActionResult(status=succeeded))
    assert client.is_done()
    assert client._client.get_result() is not None
