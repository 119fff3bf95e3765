#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Steer both arms with a joystick, two joints of each arm at a time."""
import sys

from baxter_examples.arguments import add_joystick, new_parser, parse
from baxter_examples.jogging import STEP_RAD, Jogging
from baxter_examples.joystick_loop import JoystickTable, joystick_loop
from baxter_examples.mounted_grippers import mounted_grippers
from baxter_external_devices.joystick import JOYSTICKS
from baxter_interface.programs import EnabledRobot, run
from baxter_model import JOINTS, SIDES

GRIPPER_BUTTONS = {"left": ("leftTrigger", "dPadLeft", "btnLeft"), "right": ("rightTrigger", "dPadRight", "btnRight")}


class JointPair:
    """The two joints of one arm that its stick moves; switching takes the next two."""

    def __init__(self, side: str, jogging: Jogging) -> None:
        self._side, self._jogging = side, jogging
        self._first = 0

    def switch(self) -> None:
        self._first = (self._first + 1) % len(JOINTS)
        print("%s stick: %s and %s" % (self._side, self._joint(0), self._joint(1)), flush=True)

    def step(self, which: int, step_rad: float) -> None:
        self._jogging.step(self._side, self._joint(which), step_rad)

    def _joint(self, which):
        return JOINTS[(self._first + which) % len(JOINTS)]


def steer(kind: str) -> None:
    with EnabledRobot() as robot:
        jogging = Jogging()
        table = JoystickTable("the arms' controls:", JOYSTICKS[kind]())
        for side in SIDES:
            pair = JointPair(side, jogging)
            table.on_down(side + "Bumper", "%s arm: next joints" % side, pair.switch)
            for which, direction in enumerate(("Horz", "Vert")):
                table.while_held(side + "Stick" + direction, "%s arm: joint %d of the pair" % (side, which + 1),
                                 lambda step_rad, pair=pair, which=which: pair.step(which, step_rad), STEP_RAD)
        for side, gripper in mounted_grippers(SIDES).items():
            for button, action in zip(GRIPPER_BUTTONS[side], ("close", "open", "calibrate"), strict=True):
                table.on_down(button, "%s gripper: %s" % (side, action), getattr(gripper, action))
        joystick_loop(table, robot)


def main() -> int:
    parser = new_parser(__doc__)
    add_joystick(parser)
    kind = parse(parser).joystick
    return run("rsdk_joint_position_joystick", lambda: steer(kind))


if __name__ == "__main__":
    sys.exit(main())
