#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Steer both arms by keys, joint by joint."""
import sys

from baxter_examples.arguments import new_parser, parse
from baxter_examples.jogging import STEP_RAD, Jogging
from baxter_examples.key_table import KeyTable
from baxter_examples.keyboard_loop import keyboard_loop
from baxter_examples.mounted_grippers import mounted_grippers
from baxter_interface.programs import EnabledRobot, run
from baxter_model import JOINTS, SIDES

# For the joints from shoulder to wrist: the key that increases the angle, and the key that decreases it.
JOINT_KEYS = {"left": ("96", "87", "oy", "iu", "lh", "kj", ".n"), "right": ("41", "32", "rq", "ew", "fa", "ds", "vz")}
GRIPPER_KEYS = {
    "left": ((",", "close"), ("m", "open"), ("/", "calibrate")),
    "right": (("c", "close"), ("x", "open"), ("b", "calibrate")),
}


def steer() -> None:
    with EnabledRobot() as robot:
        jogging = Jogging()
        table = KeyTable("the arms' keys:")
        for side in SIDES:
            for joint, (up, down) in zip(JOINTS, JOINT_KEYS[side], strict=True):
                table.add(up, "%s_%s + %g rad" % (side, joint, STEP_RAD), jogging.step, side, joint, STEP_RAD)
                table.add(down, "%s_%s - %g rad" % (side, joint, STEP_RAD), jogging.step, side, joint, -STEP_RAD)
        for side, gripper in mounted_grippers(SIDES).items():
            for key, action in GRIPPER_KEYS[side]:
                table.add(key, "%s gripper: %s" % (side, action), getattr(gripper, action))
        keyboard_loop(table, robot)


def main() -> int:
    parse(new_parser(__doc__))
    return run("rsdk_joint_position_keyboard", steer)


if __name__ == "__main__":
    sys.exit(main())
