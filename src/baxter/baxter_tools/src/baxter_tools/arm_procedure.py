# SPDX-License-Identifier: BSD-3-Clause
"""Programs that let the robot run a procedure on one arm: taring, calibrating."""
from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

import rospy

from baxter_interface import CHECK_VERSION, Gripper, RobotEnable, RobustController
from baxter_interface.gripper_link import NoGripper
from baxter_interface.programs import ProgramFailed, run
from baxter_model import SIDES

if TYPE_CHECKING:
    from collections.abc import Callable

    from genpy import Message


def run_arm_procedure(node_name: str, procedure: str, kind: Callable[[bool, str, Message], Message], data: Message,
                      timeout_s: float, description: str | None) -> int:
    """Parse the options, run `procedure` on the arm, and return the exit status.

    Parameters: `procedure` as the robot calls it; `kind` of its enable message and its `data`; `timeout_s`.
    """
    parser = argparse.ArgumentParser(
        description=description, epilog="The arm must carry no gripper, and have room to move. Exit status: 0 done, "
                                        "1 failed, 2 wrong options.")
    parser.add_argument("-l", "--limb", required=True, choices=SIDES, help="the arm")
    limb = parser.parse_args(rospy.myargv()[1:]).limb

    def body() -> None:
        robot = RobotEnable(CHECK_VERSION)
        _require_bare_hand(limb, procedure)
        controller = RobustController("/robustcontroller/%s/%s" % (limb, procedure), kind(True, "sdk", data),
                                      kind(False, "sdk", data), timeout_s)
        robot.enable()
        try:
            rospy.loginfo("%s of the %s arm: this may take up to %.0f min", procedure, limb, timeout_s / 60.0)
            controller.run()
        finally:
            robot.disable()
        rospy.loginfo("%s of the %s arm is complete", procedure, limb)

    return run("%s_%s" % (node_name, limb), body)


def _require_bare_hand(limb: str, procedure) -> None:
    """Raise ProgramFailed if the arm carries a gripper: the robot would count its weight as the arm's."""
    try:
        kind = Gripper(limb).type()
    except NoGripper:
        return
    if kind != "custom":
        raise ProgramFailed("the %s arm carries a gripper (%s): take it off before %s" % (limb, kind, procedure))
