# SPDX-License-Identifier: BSD-3-Clause
"""Steer the robot with a joystick until Ctrl-C."""
from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from .key_table import KeyTable

if TYPE_CHECKING:
    from baxter_external_devices.joystick import Joystick
    from baxter_interface.programs import EnabledRobot

RATE_HZ = 100.0
# Rate of the actions of a held stick [Hz].
STICK_RATE_HZ = 10.0
HELP_BUTTONS = ("function1", "function2")


class JoystickTable:
    """The actions of the controls of `joystick`; `title` goes above their list."""

    def __init__(self, title: str, joystick: Joystick) -> None:
        self._joystick = joystick
        self._table = KeyTable(title)
        self._buttons, self._sticks = [], []
        self._turn = 0

    def on_down(self, button: str, text: str, action: Callable[..., Any], *arguments: object) -> None:
        """Call `action(*arguments)` when the button goes down."""
        self._table.add(button, text, action, *arguments)
        self._buttons.append(button)

    def while_held(self, stick: str, text: str, action: Callable[..., Any], step: float) -> None:
        """Call `action(step)`, or with -step, ten times a second while the stick is held to a side."""
        # In the table for its help only.
        self._table.add(stick, text, lambda: None)
        self._sticks.append((stick, action, step))

    def help(self) -> str:
        """Return the list of controls as text."""
        return self._table.help()

    def work(self) -> None:
        """Execute the controls' present actions; call it RATE_HZ times a second."""
        for button in (*self._buttons, *HELP_BUTTONS):
            if self._joystick.button_down(button):
                self._table.press(button)
        self._turn = (self._turn + 1) % round(RATE_HZ / STICK_RATE_HZ)
        if self._turn == 0:
            for stick, action, step in self._sticks:
                value = self._joystick.stick_value(stick)
                if value:
                    action(step if value > 0.0 else -step)


def joystick_loop(table: JoystickTable, robot: EnabledRobot) -> None:
    """Work on `table` (a JoystickTable) while `robot` (an EnabledRobot) is there. Raises RobotLost."""
    print("%s\n  %s: this help\n  Ctrl-C: quit" % (table.help(), ", ".join(HELP_BUTTONS)), flush=True)
    for _ in robot.beats(RATE_HZ):
        table.work()
