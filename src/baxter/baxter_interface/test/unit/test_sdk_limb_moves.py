# SPDX-License-Identifier: BSD-3-Clause
"""A limb's readings from joint states of any publisher, and what ends its moves, without a master."""
import threading
from types import SimpleNamespace

import pytest
from sensor_msgs.msg import JointState

from baxter_interface import limb
from baxter_model import joint_names

LEFT = joint_names("left")
START = dict.fromkeys(LEFT, 0.0)


class Clock:
    """Time that passes with each look [s]; as RosClock, without a master."""

    def __init__(self, gives_up=lambda: False):
        self.time_s, self.gives_up = 0.0, gives_up

    def now(self):
        self.time_s += 0.01
        return self.time_s


@pytest.fixture
def left():
    """A Limb as after its start, without connections."""
    made = object.__new__(limb.Limb)
    made.name, made._joint_names, made._lock = "left", LEFT, threading.Lock()
    made._angles, made._velocities, made._efforts = dict(START), dict(START), dict(START)
    made._robot_state, made._resets = None, SimpleNamespace(count=0)
    made._hindrance = limb.ArmHindrance("left")
    return made


def test_a_message_with_positions_alone_leaves_the_other_readings(left):
    left._on_joint_states(JointState(name=list(LEFT), position=[0.1] * 7, velocity=[0.2] * 7, effort=[0.3] * 7))
    left._on_joint_states(JointState(name=["gripper", *LEFT], position=[9.0] + [0.5] * 7))
    assert left.joint_angles() == dict.fromkeys(LEFT, 0.5)
    assert (left.joint_velocities(), left.joint_efforts()) == (dict.fromkeys(LEFT, 0.2), dict.fromkeys(LEFT, 0.3))


def test_a_reset_of_the_simulation_ends_a_move(left, monkeypatch):
    sent, said = [], []
    monkeypatch.setattr(limb, "RosClock", Clock)
    monkeypatch.setattr(limb.rospy, "logerr", lambda text, *values: said.append(text % values))
    monkeypatch.setattr(limb.rospy, "is_shutdown", lambda: False)
    left._send, left.halt = lambda mode, command: sent.append(command), lambda: None

    class Ticker:
        def __init__(self, clock, rate):
            pass

        def sleep(self):
            left._resets.count = 1 if len(sent) >= 3 else 0
            assert len(sent) < 10, "the move goes on after the reset"

    monkeypatch.setattr(limb, "Ticker", Ticker)
    assert left.move_to_joint_positions(dict.fromkeys(LEFT, 0.5)) is False
    assert len(sent) == 3 and limb.PUT_ELSEWHERE in said[0]
