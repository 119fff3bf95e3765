# SPDX-License-Identifier: BSD-3-Clause
"""When the node makes a step; ROS time is the test's."""
import threading

import pytest

from moveit_servo import node as module
from moveit_servo.node import ServoNode
from moveit_servo.settings import ServoSettings

PERIOD_S = 0.008


class Clock:
    """ROS time that goes on only while somebody sleeps."""

    def __init__(self, monkeypatch):
        self.now = 5.0
        monkeypatch.setattr(module.rospy, "get_time", lambda: self.now)
        monkeypatch.setattr(module.rospy, "is_shutdown", lambda: False)
        monkeypatch.setattr(module.rospy, "sleep", self.sleep)

    def sleep(self, seconds):
        self.now += seconds


@pytest.mark.parametrize("rests", (True, False))
def test_an_arm_at_rest_does_not_wait_for_its_step(monkeypatch, rests):
    clock, node = Clock(monkeypatch), ServoNode.__new__(ServoNode)
    node._news, node._rests = threading.Event(), rests
    node._news.set()
    settings = ServoSettings(move_group_name="arm", command_out_topic="out", publish_period=PERIOD_S)
    assert node._wait_until(clock.now + PERIOD_S, settings) is rests
    assert clock.now == pytest.approx(5.0 if rests else 5.0 + PERIOD_S)
