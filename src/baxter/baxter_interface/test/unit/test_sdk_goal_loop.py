# SPDX-License-Identifier: BSD-3-Clause
"""The status of an action server while its node ends."""
import struct
from types import SimpleNamespace

import pytest
import rospy
from actionlib_msgs.msg import GoalID

from baxter_interface import goal_loop


def server(**attributes):
    """The parts of an actionlib server that `start` uses."""
    taken = []
    return SimpleNamespace(start=lambda: None, internal_goal_callback=taken.append,
                           internal_cancel_callback=taken.append, taken=taken,
                           **{"status_frequency": 0.0, **attributes})


def read_from_the_wire(secs, nsecs, text):
    """A GoalID as genpy reads it."""
    return GoalID().deserialize(struct.pack("<III%ds" % len(text), secs, nsecs, len(text), text))


GOOD = [(0, 0, b""), (1, 2, b"goal-1"), (5, 0, "Ziel é".encode()), (5, 0, b"\xff\xfe")]
# A stamp that overflows once its nanoseconds are carried over.
BAD = [(0xFFFFFFFF, 0xFFFFFFFF, b"goal-1")]


@pytest.mark.parametrize("wire", GOOD)
def test_goals_and_cancel_requests_come_in(wire):
    it = server()
    goal_loop.start(it)
    goal_id = read_from_the_wire(*wire)
    goal = SimpleNamespace(goal_id=goal_id)
    it.internal_goal_callback(goal)
    it.internal_cancel_callback(goal_id)
    assert it.taken == [goal, goal_id]


@pytest.mark.parametrize("wire", BAD)
def test_an_id_that_cannot_be_sent_back_is_dropped(wire):
    """It would stay in the status list for seconds, and no status could be sent."""
    it = server()
    goal_loop.start(it)
    goal_id = read_from_the_wire(*wire)
    it.internal_goal_callback(SimpleNamespace(goal_id=goal_id))
    it.internal_cancel_callback(goal_id)
    assert it.taken == []


@pytest.mark.parametrize("ends", [True, False])
def test_a_status_on_a_closed_topic_is_an_error_only_while_the_node_runs(monkeypatch, ends):
    def publish(event):
        raise rospy.ROSException("publish() to a closed topic")

    callbacks = []
    monkeypatch.setattr(rospy, "Timer", lambda period, callback, reset: callbacks.append(callback))
    monkeypatch.setattr(rospy.core, "_in_shutdown", ends)  # set before topics are closed; is_shutdown() comes after
    goal_loop.start(server(status_frequency=5.0, publish_status_async=publish,
                           status_timer=SimpleNamespace(shutdown=lambda: None)))
    if ends:
        callbacks[0](None)
    else:
        with pytest.raises(rospy.ROSException, match="closed topic"):
            callbacks[0](None)
