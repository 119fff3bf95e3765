#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Steer both grippers by keys."""
import sys

from baxter_examples.arguments import new_parser, parse
from baxter_examples.gripper_steps import GripperSteps
from baxter_examples.key_table import KeyTable
from baxter_examples.keyboard_loop import keyboard_loop
from baxter_examples.mounted_grippers import mounted_grippers
from baxter_interface.programs import EnabledRobot, run
from baxter_model import SIDES

# For the left gripper; for the right one the same with Shift. (Key, description, method, arguments.)
KEYS = (
    ("r", "restart", "reboot"), ("c", "calibrate", "calibrate"), ("q", "close", "close"), ("w", "open", "open"),
    ("[", "velocity 100 %", "set_velocity", 100.0), ("]", "velocity 30 %", "set_velocity", 30.0), ("s", "stop", "stop"),
    ("z", "dead band - 1 %", "change", "dead_zone", -1.0), ("x", "dead band + 1 %", "change", "dead_zone", 1.0),
    ("f", "moving force - 5 %", "change", "moving_force", -5.0),
    ("g", "moving force + 5 %", "change", "moving_force", 5.0),
    ("h", "holding force - 5 %", "change", "holding_force", -5.0),
    ("j", "holding force + 5 %", "change", "holding_force", 5.0),
    ("v", "velocity - 5 %", "change", "velocity", -5.0), ("b", "velocity + 5 %", "change", "velocity", 5.0),
    ("u", "position - 15 %", "move", -15.0), ("i", "position + 15 %", "move", 15.0),
)
SHIFTED = {"[": "{", "]": "}"}


def steer() -> None:
    with EnabledRobot() as robot:
        table = KeyTable("the grippers' keys:")
        grippers = mounted_grippers(SIDES)
        for side, gripper in grippers.items():
            steps = GripperSteps(gripper)
            for key, text, method, *arguments in KEYS:
                shifted = SHIFTED.get(key, key.upper())
                table.add(key if side == "left" else shifted, "%s gripper: %s" % (side, text),
                          getattr(steps, method), *arguments)
        keyboard_loop(table, robot)


def main() -> int:
    parse(new_parser(__doc__))
    return run("rsdk_gripper_keyboard", steer)


if __name__ == "__main__":
    sys.exit(main())
