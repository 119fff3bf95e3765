# SPDX-License-Identifier: BSD-3-Clause
"""Joystick controls, the key table and the springs."""
import pytest

from baxter_examples.key_table import KeyTable
from baxter_examples.springs import DAMPING, STIFFNESS, spring_torques
from baxter_external_devices.controls import CONTROLLERS, ButtonEvents, StickEvents

BUTTONS = {"btnLeft", "btnUp", "btnDown", "btnRight", "dPadUp", "dPadDown", "dPadLeft", "dPadRight", "leftBumper",
           "rightBumper", "leftTrigger", "rightTrigger", "function1", "function2"}
STICKS = {"leftStickHorz", "leftStickVert", "rightStickHorz", "rightStickVert"}


@pytest.mark.parametrize("kind", CONTROLLERS)
def test_every_controller_has_every_control_once(kind):
    controller = CONTROLLERS[kind]
    assert set(controller.buttons) == BUTTONS
    assert set(controller.sticks) == STICKS
    assert len(set(controller.buttons.values())) == len(BUTTONS)
    assert len(set(controller.sticks.values())) == len(STICKS)


def test_pads_and_triggers_that_are_axes():
    buttons = CONTROLLERS["xbox"].buttons
    still = [0.0] * 8
    assert not any(buttons[name].read(still, [0] * 11) for name in BUTTONS)
    for name, axis, value in (("dPadLeft", 6, 1.0), ("dPadRight", 6, -1.0), ("dPadUp", 7, 1.0),
                              ("leftTrigger", 2, -1.0)):
        axes = list(still)
        axes[axis] = value
        assert [other for other in BUTTONS if buttons[other].read(axes, [0] * 11)] == [name]


def test_button_tells_each_change_once():
    button = ButtonEvents()
    assert not button.take_down()
    for is_down in (True, True, False):
        button.update(is_down)
    assert (button.take_down(), button.take_down(), button.take_up(), button.take_up()) == (True, False, True, False)


def test_stick_has_a_dead_band_a_scale_and_moves():
    stick = StickEvents(scale=2.0, offset=0.5, deadband=0.1)
    stick.update(0.09)
    assert stick.value == 0.0
    stick.update(-0.5)
    assert stick.value == -0.5
    assert stick.take_move() == -0.5
    assert stick.take_move() == 0.0


def test_key_table_acts_and_helps():
    said, done = [], []
    table = KeyTable("keys:", said.append)
    table.add("a", "one up", done.append, 1)
    table.press("a")
    table.press("?")
    assert done == [1]
    assert said == ["one up", "keys:\n  a: one up"]
    with pytest.raises(ValueError, match="in use for: one up"):
        table.add("a", "other", done.append)


def test_springs_pull_back_and_brake():
    assert spring_torques({"a": 1.0}, {"a": 0.5}, {"a": 2.0}, {"a": 10.0}, {"a": 0.25}) == {"a": 4.5}
    assert all(0.0 < default <= largest for table in (STIFFNESS, DAMPING) for default, largest in table.values())
