# SPDX-License-Identifier: BSD-3-Clause
"""Joysticks on the topic /joy (sensor_msgs/Joy)."""
from __future__ import annotations

import threading
from typing import Any

import rospy
from sensor_msgs.msg import Joy

from command_line.options import counted

from .controls import CONTROLLERS, ButtonEvents, ControlLayout, StickEvents


class Joystick:
    """A joystick as a source of events; its subclasses are the known controllers.

    Parameters: a stick's value is `scale` * reading + `offset`, or 0 while its reading is within `deadband`.
    Names of buttons: btnLeft, btnUp, btnDown, btnRight, dPadUp, dPadDown, dPadLeft, dPadRight, leftBumper, rightBumper,
    leftTrigger, rightTrigger, function1, function2. Of sticks: leftStickHorz, leftStickVert, rightStickHorz,
    rightStickVert; left and up are positive. Other names raise KeyError.
    """

    CONTROLLER: ControlLayout

    def __init__(self, scale: float = 1.0, offset: float = 0.0, deadband: float = 0.1) -> None:
        if not hasattr(self, "CONTROLLER"):
            raise TypeError("a Joystick is one of XboxController, LogitechController and PS3Controller")
        self._lock = threading.Lock()
        self._buttons = {name: ButtonEvents() for name in self.CONTROLLER.buttons}
        self._sticks = {name: StickEvents(scale, offset, deadband) for name in self.CONTROLLER.sticks}
        self._subscriber = rospy.Subscriber("/joy", Joy, self._on_joy, queue_size=10)

    def button_down(self, name: str) -> bool:
        """Tell whether the button has gone down since the last call."""
        with self._lock:
            return self._buttons[name].take_down()

    def button_up(self, name: str) -> bool:
        """Tell whether the button has gone up since the last call."""
        with self._lock:
            return self._buttons[name].take_up()

    def stick_value(self, name: str) -> float:
        """Return the stick's value."""
        with self._lock:
            return self._sticks[name].value

    def stick_changed(self, name: str) -> bool:
        """Tell whether the stick has moved since the last call."""
        return self._move(name) != 0.0

    def stick_inc(self, name: str) -> bool:
        """Tell whether the stick's value is greater than at the last call."""
        return self._move(name) > 0.0

    def stick_dec(self, name: str) -> bool:
        """Tell whether the stick's value is less than at the last call."""
        return self._move(name) < 0.0

    def _move(self, name: str):
        with self._lock:
            return self._sticks[name].take_move()

    def _on_joy(self, message: Any) -> None:
        with self._lock:
            try:
                for name, button in self.CONTROLLER.buttons.items():
                    self._buttons[name].update(button.read(message.axes, message.buttons))
                for name, stick in self.CONTROLLER.sticks.items():
                    self._sticks[name].update(stick.read(message.axes, message.buttons))
            except IndexError:
                rospy.logwarn_throttle(5.0, "/joy has %s and %s, which does not fit %s: is another "
                                            "controller plugged in?"
                                            % (counted(len(message.axes), "axis", "axes"),
                                               counted(len(message.buttons), "button"), type(self).__name__))


class XboxController(Joystick):
    """A controller for the Xbox, as Linux's xpad driver numbers it."""

    CONTROLLER = CONTROLLERS["xbox"]

    def __init__(self, scale: float = 1.0, offset: float = 0.0, deadband: float = 0.5) -> None:
        super().__init__(scale, offset, deadband)


class LogitechController(Joystick):
    """A Logitech gamepad in its mode D."""

    CONTROLLER = CONTROLLERS["logitech"]

    def __init__(self, scale: float = 1.0, offset: float = 0.0, deadband: float = 0.5) -> None:
        super().__init__(scale, offset, deadband)


class PS3Controller(Joystick):
    """A controller for the PlayStation 3."""

    CONTROLLER = CONTROLLERS["ps3"]

    def __init__(self, scale: float = 1.0, offset: float = 0.0, deadband: float = 0.5) -> None:
        super().__init__(scale, offset, deadband)


JOYSTICKS = {"xbox": XboxController, "logitech": LogitechController, "ps3": PS3Controller}
