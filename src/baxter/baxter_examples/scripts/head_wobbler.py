#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Nod, and look around at random for a while."""
import random
import sys

import rospy

from baxter_dataflow.ros_clock import RosClock
from baxter_dataflow.waiting import Stopwatch
from baxter_examples.arguments import new_parser, parse
from baxter_interface import Head
from baxter_interface.programs import EnabledRobot, run

LARGEST_ANGLE_RAD = 1.5
SPEED = 0.3
DURATION_S = 10.0


def wobble() -> None:
    head = Head()
    with EnabledRobot():
        head.command_nod()
        clock = RosClock()
        watch = Stopwatch(clock.now())
        while watch.elapsed_s(clock.now()) < DURATION_S and not rospy.is_shutdown():
            angle = random.uniform(-LARGEST_ANGLE_RAD, LARGEST_ANGLE_RAD)
            print("looking at %.2f rad" % angle, flush=True)
            head.set_pan(angle, speed=SPEED)
        head.set_pan(0.0)


def main() -> int:
    parse(new_parser(__doc__))
    return run("rsdk_head_wobbler", wobble)


if __name__ == "__main__":
    sys.exit(main())
