# SPDX-License-Identifier: BSD-3-Clause
"""The node without ROS: when it makes a step, what it takes from messages and what it says of them."""
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from sensor_msgs.msg import JointState

from moveit_servo import node as module
from moveit_servo.node import ServoNode
from moveit_servo.settings import ARRAY, ServoSettings

sys.path.insert(0, str(Path(__file__).parents[1]))
from steered_arms import planar_model  # noqa: E402

PERIOD_S = 0.008
SETTINGS = ServoSettings(move_group_name="arm", planning_frame="base", command_out_topic="out", command_out_type=ARRAY)


class Topic:
    """A publisher that somebody hears; sent: what was published."""

    def __init__(self, *_, **__):
        self.sent = []

    def publish(self, message):
        self.sent.append(message)

    def get_num_connections(self):
        return 1


@pytest.fixture()
def node(monkeypatch):
    """The node of the planar arm, whose threads have ended; ``log``: its lines."""
    log, nothing = [], lambda *_, **__: None
    monkeypatch.setattr(module, "rospy", SimpleNamespace(
        Publisher=Topic, Subscriber=nothing, Service=nothing, get_param=lambda name, default: default,
        get_time=lambda: 5.0, is_shutdown=lambda: True, logwarn=log.append, logwarn_once=log.append))
    monkeypatch.setattr(module, "SceneMonitor", lambda *_: SimpleNamespace(scene=nothing))
    monkeypatch.setattr(module, "sphere_model_of", nothing)
    monkeypatch.setattr(module, "ConvexParts", nothing)
    monkeypatch.setattr(ServoNode, "_prepare", nothing)
    made = ServoNode(planar_model(), None, SETTINGS, None)
    made.log = log
    return made


@pytest.mark.parametrize("speed", [float("nan"), float("-inf"), 1e308])
def test_a_velocity_that_is_none_counts_as_0(node, speed):
    node._on_joints(JointState(name=["turn0", "turn1"], position=[0.1, 0.2], velocity=[speed, 0.5]))
    assert node._q[:2].tolist() == [0.1, 0.2] and node._velocity.tolist() == [0.0, 0.5, 0.0]
    assert "turn0" in node.log[0] and "count as 0" in node.log[0]


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
