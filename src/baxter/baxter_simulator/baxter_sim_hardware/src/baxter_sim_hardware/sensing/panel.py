# SPDX-License-Identifier: BSD-3-Clause
"""Buttons, lights, wheels and the other single channels of the robot, with their values.

The names are the physical robot's. Documents leave open which of the torso's channels can be written; here a channel
whose name says sensor, input or switch is an input. The part that measures a sensor attaches it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from baxter_model import SIDES
from baxter_sim_hardware.errors import CommandRefused

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

NAVIGATORS = (*SIDES, *("torso_%s" % side for side in SIDES))
BUTTONS = ("ok", "back", "show")  # of a navigator, in the order of its state message
LIGHTS = ("inner", "outer")
WHEEL_COUNTS = 256  # a wheel's counter wraps
ANALOG_MAX = 65535  # the command message's uint16

# {name: whether it is an input}
DIGITAL = {
    **{"%s_%s_light" % (navigator, light): False for navigator in NAVIGATORS for light in LIGHTS},
    **{"%s_button_%s" % (navigator, button): True for navigator in NAVIGATORS for button in BUTTONS},
    **{"%s_%s" % (side, name): True for side in SIDES
       for name in ("lower_cuff", "lower_button", "upper_button", "shoulder_button")},
    **{"%s_%s" % (side, name): False for side in SIDES for name in ("suck", "blow", "pneumatic", "hand_camera_power")},
    **dict.fromkeys(("torso_camera_power", "head_red_light", "head_green_light", "head_yellow_light",
                     "right_blue_light", "head_lcd_auto_config", "torso_brake", *("torso_ui_output%d" % number
                                                                                  for number in range(4))), False),
    **dict.fromkeys(("torso_brake_sensor", "torso_foot_pedal", "torso_digital_input0", "torso_process_sense0",
                     "torso_process_sense1", "torso_safety_stop", "limit_switch_1", "limit_switch_2",
                     "limit_switch_3", "motor_fault_signal"), True),
}
WHEELS = tuple("%s_wheel" % navigator for navigator in NAVIGATORS)
PUMPS = {side: "%s_suck" % side for side in SIDES}  # the valves of a suction gripper
BLOWERS = {side: "%s_blow" % side for side in SIDES}
VACUUM_SENSORS = {side: "%s_vacuum_sensor_analog" % side for side in SIDES}
RANGE_SENSORS = {side: "%s_hand_range" % side for side in SIDES}
ANALOG = {**dict.fromkeys((*WHEELS, *VACUUM_SENSORS.values(), *RANGE_SENSORS.values()), True),
          "torso_fan": False, "torso_lighting": False}


ESTOP = "estop"  # the emergency stop button, which is not a separate channel


def navigator_name(navigator: str) -> str:
    """The name that topics give one of NAVIGATORS."""
    return "%s_navigator" % navigator


class ControlPanel:
    """The present value of every channel: `digital` {name: bool}, `analog` {name: int}; all zero at the start."""

    def __init__(self) -> None:
        self._sensors, self._valves = {}, {}
        self.reset()

    def attach(self, name: str, read: Callable[[], int]) -> None:
        """Make an analog input show the result of `read()`, an integer from 0."""
        self._sensors[name] = read

    def attach_valve(self, name: str, read: Callable[[], bool], write: Callable[[bool], None]) -> None:
        """Make a digital output show the result of `read()`, and call `write(value)` when it is switched."""
        self._valves[name] = read, write

    def read_digital(self, name: str) -> bool:
        """Whether a digital channel is on."""
        return bool(self._valves[name][0]()) if name in self._valves else self.digital[name]

    def read_analog(self, name: str) -> int:
        """The present integer of an analog channel."""
        return self._sensors[name]() if name in self._sensors else self.analog[name]

    def reset(self) -> None:
        """Everything released, dark and at zero."""
        self.digital = dict.fromkeys(DIGITAL, False)
        self.analog = dict.fromkeys(ANALOG, 0)

    def set_digital(self, name: str, value: bool) -> None:
        """Switch an output. Raises CommandRefused for an unknown name, for an input, and if its valve refuses."""
        _require(name, DIGITAL, "a digital output", is_input=False)
        if name in self._valves:
            self._valves[name][1](bool(value))
        else:
            self.digital[name] = bool(value)

    def set_analog(self, name: str, value: int) -> None:
        """Set an output to an integer, 0 to 65535. Raises CommandRefused for another value, and for an input."""
        _require(name, ANALOG, "an analog output", is_input=False)
        if not 0 <= value <= ANALOG_MAX:
            raise CommandRefused("%s is set to %s; it must be from 0 to %d" % (name, value, ANALOG_MAX))
        self.analog[name] = int(value)

    def press(self, name: str, pressed: bool = True) -> None:
        """Press or release a digital input. Raises CommandRefused for an unknown name and for an output."""
        _require(name, DIGITAL, "a digital input", is_input=True)
        self.digital[name] = pressed

    def turn(self, name: str, steps: int) -> None:
        """Turn a wheel by a number of counts. Raises CommandRefused for an unknown wheel."""
        _require(name, dict.fromkeys(WHEELS, True), "a wheel", is_input=True)
        self.analog[name] = (self.analog[name] + steps) % WHEEL_COUNTS

    def navigator(self, navigator: str) -> tuple[list[bool], int, list[bool]]:
        """(buttons, wheel, lights) of one of NAVIGATORS, in the order of BUTTONS and LIGHTS."""
        return ([self.digital["%s_button_%s" % (navigator, button)] for button in BUTTONS],
                self.analog["%s_wheel" % navigator],
                [self.digital["%s_%s_light" % (navigator, light)] for light in LIGHTS])


def _require(name: str, table: Mapping[str, bool], kind: str, is_input: bool) -> None:
    if table.get(name) is not is_input:
        raise CommandRefused("'%s' is not %s; choices are %s" % (
            name, kind, ", ".join(sorted(known for known, known_input in table.items() if known_input is is_input))))
