#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Steer both grippers with a joystick."""
import sys

from baxter_examples.arguments import add_joystick, new_parser, parse
from baxter_examples.gripper_steps import GripperSteps
from baxter_examples.joystick_loop import JoystickTable, joystick_loop
from baxter_examples.mounted_grippers import mounted_grippers
from baxter_external_devices.joystick import JOYSTICKS
from baxter_interface.programs import EnabledRobot, run
from baxter_model import SIDES

DEAD_BAND_PERCENT = 2.5
# By side: buttons with their actions, and the stick that moves the fingers.
BUTTONS = {
    "left": (("leftTrigger", "close", "close"), ("leftBumper", "open", "open"), ("btnLeft", "calibrate", "calibrate"),
             ("dPadLeft", "holding force - 5 %", "change", "holding_force", -5.0),
             ("dPadUp", "holding force + 5 %", "change", "holding_force", 5.0)),
    "right": (("rightTrigger", "close", "close"), ("rightBumper", "open", "open"),
              ("btnRight", "calibrate", "calibrate"),
              ("dPadDown", "holding force - 5 %", "change", "holding_force", -5.0),
              ("dPadRight", "holding force + 5 %", "change", "holding_force", 5.0)),
}
STICKS = {"left": "leftStickVert", "right": "rightStickVert"}
# Step of a held stick [%].
STEP_PERCENT = 5.0


def steer(kind: str) -> None:
    with EnabledRobot() as robot:
        table = JoystickTable("the grippers' controls:", JOYSTICKS[kind]())
        for side, gripper in mounted_grippers(SIDES, calibrate=True).items():
            gripper.set_dead_band(DEAD_BAND_PERCENT)
            steps = GripperSteps(gripper)
            for button, text, method, *arguments in BUTTONS[side]:
                table.on_down(button, "%s gripper: %s" % (side, text), getattr(steps, method), *arguments)
            table.while_held(STICKS[side], "%s gripper: open, close" % side, steps.move, STEP_PERCENT)
        joystick_loop(table, robot)


def main() -> int:
    parser = new_parser(__doc__)
    add_joystick(parser)
    kind = parse(parser).joystick
    return run("rsdk_gripper_joystick", lambda: steer(kind))


if __name__ == "__main__":
    sys.exit(main())
