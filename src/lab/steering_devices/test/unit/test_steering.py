# SPDX-License-Identifier: BSD-3-Clause
"""Keys and gamepads: what is held moves, what is let go does not."""
import xmlrpc.client
from pathlib import Path

import numpy as np
import pytest
import yaml

from steering_devices.steering import MOTIONS, OTHER_KEYS, Gamepad, KeyboardSteering, LayoutError

CONFIG = Path(__file__).parents[2] / "config"
PADS = ("xbox", "playstation")


@pytest.mark.parametrize("key", MOTIONS)
def test_a_key_moves_as_long_as_it_repeats(key):
    keyboard = KeyboardSteering()
    _, row, sign = MOTIONS[key]
    for tick in range(10):
        keyboard.press(key, 0.03 * tick)
        twist = keyboard.take(0.03 * tick).twist
        assert twist[row] * sign > 0.0 and np.count_nonzero(twist) == 1
    assert keyboard.take(0.6).twist[row] == 0.0


def test_the_other_keys():
    keyboard = KeyboardSteering(hands=2)
    assert set(OTHER_KEYS) & set(MOTIONS) == set()
    keyboard.press("w", 0.0)
    slow = keyboard.take(0.0).twist[0]
    keyboard.press("+", 0.0)
    assert keyboard.take(0.0).twist[0] > slow
    keyboard.press(" ", 0.0)
    assert not keyboard.take(0.0).twist.any()
    for key, name, value in (("h", "hand", 1), ("h", "hand", 0), ("t", "in_tool", True), ("g", "gripper", "close"),
                             ("g", "gripper", "open"), ("2", "mark", "failure"), ("x", "ends", True)):
        assert keyboard.press(key, 1.0)
        taken = keyboard.take(1.0)
        assert getattr(taken, name) == value and not taken.twist.any()
    assert keyboard.take(1.0).mark == "" and not keyboard.press("?", 1.0)


def pad(kind):
    layout = yaml.safe_load((CONFIG / ("gamepad_%s.yaml" % kind)).read_text())["layout"]
    return Gamepad(layout, 2), layout


@pytest.mark.parametrize("file", sorted(CONFIG.glob("*.yaml")), ids=lambda file: file.stem)
def test_a_layout_can_be_a_parameter(file):
    # XML-RPC has no null.
    assert xmlrpc.client.dumps((yaml.safe_load(file.read_text()),))


def pressed(*numbers):
    return [int(number in numbers) for number in range(13)]


@pytest.mark.parametrize("kind", PADS)
def test_a_gamepad_moves_only_while_it_is_held(kind):
    gamepad, layout = pad(kind)
    for row, source in enumerate(layout["motions"].values()):
        axes = [0.0] * 8
        axes[source["axis"]] = 0.5
        assert np.count_nonzero(gamepad.take(axes, pressed(layout["hold"])).twist) == 1, row
        assert not gamepad.take(axes, pressed()).twist.any()
    assert not gamepad.take([float("nan")] * 8, pressed(layout["hold"])).twist.any()
    assert not gamepad.take([], []).twist.any()


def test_a_cap_needs_no_button_and_rests_in_its_middle():
    cap, _ = pad("spacemouse")
    assert cap.take([0.5, 0.05, -1.2, 0.0, 0.09, -0.3], [0, 0]).twist.tolist() == [0.5, 0.0, -1.0, 0.0, 0.0, -0.3]
    assert not cap.take([0.05] * 6, [0, 0]).twist.any() and not cap.take([], []).twist.any()
    taken = cap.take([0.5] * 6, [1, 0])
    assert taken.hand == 1 and not taken.twist.any(), "the other hand does not begin with a motion"
    assert cap.take([0.0] * 6, [0, 1]).gripper == "close"


@pytest.mark.parametrize("kind", PADS)
def test_buttons_count_once(kind):
    gamepad, layout = pad(kind)
    for name, field in (("open", "gripper"), ("close", "gripper"), ("success", "mark"), ("again", "mark")):
        assert getattr(gamepad.take([], pressed(layout[name])), field) == name
        assert getattr(gamepad.take([], pressed(layout[name])), field) == ""
    assert gamepad.take([], pressed(layout["hand"])).hand == 1
    assert gamepad.take([], pressed(layout["hand"])).hand == 1
    gamepad.take([], pressed())
    assert gamepad.take([], pressed(layout["hand"])).hand == 0


@pytest.mark.parametrize("layout", [None, {}, {"motions": {"x": {"axis": 1}}},
                                    {"hold": 1, "motions": {"q": {"axis": 1}}},
                                    {"hold": 1, "motions": {"x": {"axis": "one"}}}, {"hold": -1, "motions": {}},
                                    {"hold": 1, "motions": {}, "dead_zone": 1.5},
                                    {"hold": 1, "motions": {}, "dead_zone": True},
                                    *({"hold": 1, "motions": {"x": {**source, "scale": scale}}}
                                      for source in ({"axis": 1}, {"buttons": [1, 2]})
                                      for scale in ("fast", None, float("nan"), 1e308, True))])
def test_a_layout_that_cannot_be_used(layout):
    with pytest.raises(LayoutError):
        Gamepad(layout)
