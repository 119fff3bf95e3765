# SPDX-License-Identifier: BSD-3-Clause
"""Steer the robot by keys until Esc or Ctrl-C."""
from __future__ import annotations

from typing import TYPE_CHECKING

from baxter_external_devices.getch import CTRL_C, ESCAPE, Keyboard

if TYPE_CHECKING:
    from baxter_interface.programs import EnabledRobot

    from .key_table import KeyTable

RATE_HZ = 100.0


def keyboard_loop(table: KeyTable, robot: EnabledRobot) -> None:
    """Press typed keys on `table` (a KeyTable) while `robot` (an EnabledRobot) is there. Raises RobotLost."""
    print(table.help() + "\n  Esc or Ctrl-C: quit", flush=True)
    with Keyboard() as keyboard:
        for _ in robot.beats(RATE_HZ):
            try:
                key = keyboard.read(0.0)
            except EOFError:
                return
            if key in (ESCAPE, CTRL_C):
                return
            if key is not None:
                table.press(key)
