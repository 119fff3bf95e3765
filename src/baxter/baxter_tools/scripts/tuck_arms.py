#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Fold the arms up for transport, or unfold them, from any posture and around each other."""
import argparse
import sys
from collections.abc import Sequence

import rospy

from baxter_interface import Head
from baxter_interface.programs import EnabledRobot, ProgramFailed, run
from baxter_tools.tucking import BothArms, Tucking, own_collision_avoidance

HEAD_SPEED = 0.5


def parse_arguments(argv: Sequence[str]) -> str:
    parser = argparse.ArgumentParser(prog="tuck_arms.py", description=__doc__,
                                     epilog="Exit status: 0 done, 1 failed, 2 wrong options.")
    choice = parser.add_mutually_exclusive_group(required=True)
    choice.add_argument("-t", "--tuck", dest="pose", action="store_const", const="tucked", help="fold the arms up")
    choice.add_argument("-u", "--untuck", dest="pose", action="store_const", const="untucked", help="unfold the arms")
    return parser.parse_args(argv).pose


def look_ahead() -> None:
    """Turn the head forward: the arms fold around it. If the head does not turn, folding still goes on."""
    try:
        Head().set_pan(0.0, speed=HEAD_SPEED)
    except OSError as failure:
        rospy.logwarn("%s", failure.strerror)


def fold(pose: str) -> None:
    arms = BothArms()
    tucking = Tucking(arms.names)
    with own_collision_avoidance() as too_near, EnabledRobot() as robot:
        look_ahead()
        way = tucking.way(arms.angles(), pose)
        rospy.loginfo("moving the arms to the pose %r (stretches of the way: %d)", pose, len(way) - 1)
        arms.follow(way, robot.is_enabled)
        rospy.loginfo("the arms are %s", pose)
        if too_near():
            robot.switch.disable()
            raise ProgramFailed("the robot holds its arms for too near and is disabled: %s" % "; ".join(too_near()))


def main() -> int:
    pose = parse_arguments(rospy.myargv()[1:])
    return run("rsdk_tuck_arms", lambda: fold(pose))


if __name__ == "__main__":
    sys.exit(main())
