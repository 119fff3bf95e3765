# SPDX-License-Identifier: BSD-3-Clause
"""Goals of pages that have gone without cancelling them end."""
from types import SimpleNamespace

import pytest
from tf2_web_republisher.msg import TFSubscriptionGoal

from lab_testing.waiting import wait_until
from tf2_web_republisher import node


class Server:
    """An action server without ROS."""

    def __init__(self, _name, _action, begin, cancel, auto_start):
        self.begin, self.cancel, self.listeners = begin, cancel, 1
        self.feedback_pub = SimpleNamespace(get_num_connections=lambda: self.listeners)

    def start(self):
        pass


class Handle:
    def __init__(self, name):
        self._name = name
        self.state = ""

    def get_goal(self):
        return TFSubscriptionGoal(source_frames=["hand"], target_frame="base", rate=100.0)

    def get_goal_id(self):
        return SimpleNamespace(id=self._name)

    def set_accepted(self):
        self.state = "active"

    def set_canceled(self):
        self.state = "canceled"

    def set_aborted(self, text):
        self.state = text

    def publish_feedback(self, _feedback):
        pytest.fail("there is no transform")


@pytest.fixture
def served(monkeypatch):
    monkeypatch.setattr(node, "ActionServer", Server)
    monkeypatch.setattr(node.rospy, "Service", lambda *_: None)
    monkeypatch.setattr(node.tf2_ros, "TransformListener", lambda _: None)
    monkeypatch.setattr(node.rospy, "Time", lambda _: None)
    monkeypatch.setattr(node.tf2_ros, "Buffer", lambda: SimpleNamespace(lookup_transform=lookup))
    made = node.Republisher()
    yield made
    made._schedule.end()


def lookup(*_):
    raise node.tf2_ros.LookupException("no such frame")


def test_goals_end_when_nobody_listens(served, monkeypatch):
    monkeypatch.setattr(node, "GONE_S", 0.05)
    handles = [Handle(str(number)) for number in range(3)]
    for handle in handles:
        served._server.begin(handle)
    served._server.cancel(handles[0])
    assert [handle.state for handle in handles] == ["canceled", "active", "active"]
    served._server.listeners = 0
    wait_until(lambda: not served._goals, "the end of all goals")
    assert handles[0].state == "canceled"
    wait_until(lambda: all("nobody has listened" in handle.state for handle in handles[1:]), "reasons")
    assert served._schedule._jobs == {}


def test_of_too_many_goals_the_oldest_ends(served, monkeypatch):
    monkeypatch.setattr(node, "MAX_GOALS", 2)
    handles = [Handle(str(number)) for number in range(4)]
    for handle in handles:
        served._server.begin(handle)
    assert [handle.state == "active" for handle in handles] == [False, False, True, True]
    assert "this was the oldest" in handles[0].state and len(served._goals) == 2
