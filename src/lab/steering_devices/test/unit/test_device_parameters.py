# SPDX-License-Identifier: BSD-3-Clause
"""Parameters and terminals that a device cannot use end it with one sentence."""
import io
import sys
from types import SimpleNamespace

import numpy as np
import pytest
import rospy

from steering_devices import gamepad_node, hands, keyboard_node
from steering_devices.steering import KeyboardSteering, Steering

NAN = float("nan")


@pytest.fixture()
def parameters(monkeypatch):
    """The parameters of a node without ROS."""
    values, nothing = {}, lambda *_, **__: None
    ros = SimpleNamespace(get_param=values.get, resolve_name=str, Publisher=nothing, Subscriber=nothing,
                          init_node=nothing, myargv=lambda: ["device"])
    for module in (hands, gamepad_node, keyboard_node):
        monkeypatch.setattr(module, "rospy", ros)
    for module in (gamepad_node, keyboard_node):
        monkeypatch.setattr(module, "limit_ports", nothing)
    monkeypatch.setattr(gamepad_node, "end_on_signals", nothing)
    return values


def ended_by(main):
    with pytest.raises(SystemExit) as end:
        main()
    return str(end.value)  # a text: the exit code is 1


@pytest.mark.parametrize(("name", "value"), [
    ("~servos", 5), ("~servos", ""), ("~servos", []), ("~servos", [1]), ("~servos", "left servo!"),
    ("~linear_speed", "fast"), ("~linear_speed", NAN), ("~linear_speed", -1.0), ("~angular_speed", 1e308),
    ("~angular_speed", None), ("~grippers", "middle"), ("~grippers", "left right"), ("~joy_timeout", NAN),
    ("~joy_timeout", "long"), ("~layout", {"hold": 1, "motions": {"x": {"axis": 1, "scale": "fast"}}})])
def test_a_parameter_that_cannot_be_used_is_named(parameters, name, value):
    parameters["~layout"] = {"hold": 1, "motions": {}}
    parameters[name] = value
    assert ended_by(gamepad_node.main).startswith("servo_gamepad: " + name)


class Sent(list):
    """A publisher; what was published."""

    def __init__(self, *_, **__):
        super().__init__()

    publish = list.append


@pytest.mark.parametrize("bad", [5, ["x"], {}, True, OSError("no master")])
def test_a_servo_whose_parameters_are_none_is_steered(parameters, monkeypatch, bad):
    def cached(name, default):
        if isinstance(bad, OSError):
            raise bad
        return "unitless" if name.endswith("in_type") else bad
    monkeypatch.setattr(hands.rospy, "get_param_cached", cached, raising=False)
    monkeypatch.setattr(hands.rospy, "Publisher", Sent)
    monkeypatch.setattr(hands.rospy, "Time", rospy.Time, raising=False)
    monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time(1.0))
    hand = hands.Hand("servo")
    hand.steer(np.full(6, 0.5), in_tool=True)
    hand.jog({"turn": 0.5})
    twist, jog = hand._twists[0], hand._jogs[0]
    twist.serialize(io.BytesIO())
    jog.serialize(io.BytesIO())
    assert twist.header.frame_id == "" and jog.velocities == [0.1 if bad == 5 else 0.5]


def test_a_terminal_that_nobody_knows(parameters, monkeypatch):
    monkeypatch.setenv("TERM", "nonsense")
    for stream in ("stdin", "stdout"):
        monkeypatch.setattr(sys, stream, SimpleNamespace(isatty=lambda: True))
    text = ended_by(keyboard_node.main)
    assert "'nonsense'" in text and "TERM" in text


def test_what_a_servo_says_ends_no_keyboard(parameters, monkeypatch):
    drawn = []

    def add(row, column, text, count):
        assert "\0" not in text, "curses raises ValueError"
        drawn.append(text[:count])
    screen = SimpleNamespace(erase=lambda: None, refresh=lambda: None, getmaxyx=lambda: (24, 60), addnstr=add)
    hand = SimpleNamespace(name="left_servo", is_there=True, reason="'no\0where' is not a frame")
    keyboard_node._draw(screen, SimpleNamespace(hands=[hand]), KeyboardSteering(), Steering())
    assert any("no\\x00where" in line for line in drawn)
