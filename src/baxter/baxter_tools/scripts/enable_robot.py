#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Print the robot's state; enable, disable, reset or stop it."""
import argparse
import sys
from collections.abc import Sequence

import rospy

from baxter_interface import CHECK_VERSION, RobotEnable
from baxter_interface.programs import run

ACTIONS = {
    "state": lambda robot: print(robot.state()),
    "enable": lambda robot: robot.enable() or print("the robot is enabled"),
    "disable": lambda robot: robot.disable() or print("the robot is disabled"),
    "reset": lambda robot: robot.reset() and print("the robot is reset; it is disabled until it is enabled (-e)"),
    "stop": lambda robot: robot.stop() or print("the robot is stopped"),
}


def parse_arguments(argv: Sequence[str]) -> list[str]:
    parser = argparse.ArgumentParser(
        prog="enable_robot.py", description=__doc__,
        epilog="Options are carried out in the order given. A robot is waited for, 30 s or "
               "as long as a simulator is visibly starting. "
               "Exit status: 0 done, 1 something failed, 2 wrong options.")
    for flags, action, text in (
        (("-s", "--state"), "state", "print the robot's state"),
        (("-e", "--enable"), "enable", "switch the motors on; a stopped robot is reset first"),
        (("-d", "--disable"), "disable", "switch the motors off"),
        (("-r", "--reset"), "reset", "clear a stop or an error"),
        (("-S", "--stop"), "stop", "stop the robot, as its stop button would"),
    ):
        parser.add_argument(*flags, dest="actions", action="append_const", const=action, default=[], help=text)
    actions = parser.parse_args(argv).actions
    if not actions:
        parser.print_usage()
    return actions


def carry_out(actions: Sequence[str]) -> None:
    robot = RobotEnable(CHECK_VERSION)
    for action in actions:
        ACTIONS[action](robot)


def main() -> int:
    actions = parse_arguments(rospy.myargv()[1:])
    return run("rsdk_robot_enable", lambda: carry_out(actions)) if actions else 0


if __name__ == "__main__":
    sys.exit(main())
