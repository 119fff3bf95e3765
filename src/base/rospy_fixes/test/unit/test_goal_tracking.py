# SPDX-License-Identifier: BSD-3-Clause
"""actionlib's own client, as programs in the lab import it, with a server that answers before the goal was noted."""
import sys
import threading
import traceback
from types import SimpleNamespace

import pytest
from actionlib import CommState, SimpleActionClient, SimpleGoalState
from actionlib_msgs.msg import GoalStatus

from lab_testing.waiting import wait_until

DEADLINE_S = 60.0


def is_held_back(thread):
    """Whether the thread has come to the amended handler, which waits while the goal is being sent."""
    frame = sys._current_frames().get(thread.ident)
    return any(frame.f_code.co_name == "handle_news" for frame, _ in traceback.walk_stack(frame))


class QuickServer:
    """In the place of the ActionClient below: ``answer(transition, feedback, goal)`` in another thread, while the goal
    is being sent."""

    def __init__(self, answer):
        self._answer = answer
        self.threads = []

    def send_goal(self, goal, transition_cb, feedback_cb):
        handle = SimpleNamespace(get_comm_state=lambda: CommState.DONE, get_goal_status=lambda: GoalStatus.REJECTED,
                                 get_result=lambda: "refused")
        thread = threading.Thread(target=self._answer, args=(transition_cb, feedback_cb, handle), daemon=True)
        self.threads.append(thread)
        thread.start()
        wait_until(lambda: not thread.is_alive() or is_held_back(thread), "the answer to be handled, or held back")
        return handle


@pytest.fixture
def make_client(monkeypatch):
    monkeypatch.setattr("rospy.resolve_name", lambda name: name)

    def make(answer):
        client = SimpleActionClient.__new__(SimpleActionClient)
        client.gh, client.simple_state, client.done_condition = None, SimpleGoalState.DONE, threading.Condition()
        client.action_client = QuickServer(answer)
        client.action_client.ns = "move"
        return client
    return make


def end(client):
    for thread in client.action_client.threads:
        thread.join(DEADLINE_S)
        assert not thread.is_alive()


def test_a_goal_that_is_refused_at_once_has_ended(make_client):
    client, ended = make_client(lambda transition, _feedback, goal: transition(goal)), []
    client.send_goal("goal", done_cb=lambda *result: ended.append(result))
    end(client)
    assert ended == [(GoalStatus.REJECTED, "refused")]
    assert client.simple_state == SimpleGoalState.DONE


def test_the_first_feedback_is_heard(make_client):
    heard = []
    client = make_client(lambda _transition, feedback, goal: feedback(goal, "planning"))
    client.send_goal("goal", feedback_cb=heard.append)
    end(client)
    assert heard == ["planning"]


def test_a_callback_may_send_the_next_goal(make_client):
    client, heard = make_client(lambda _transition, feedback, goal: feedback(goal, "planning")), []

    def next_goal(feedback):
        heard.append(feedback)
        if len(heard) < 2:
            client.send_goal("another", feedback_cb=next_goal)

    client.send_goal("goal", feedback_cb=next_goal)
    end(client)
    assert heard == ["planning"] * 2
