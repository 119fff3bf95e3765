#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Wobble both arms around neutral, in velocity mode."""
import math
import random
import sys

import rospy
from std_msgs.msg import UInt16

from baxter_dataflow.ros_clock import RosClock
from baxter_dataflow.waiting import Stopwatch
from baxter_examples.arguments import new_parser, parse
from baxter_interface import Limb
from baxter_interface.programs import EnabledRobot, expect, run
from baxter_model import SIDES

RATE_HZ = 500
USUAL_STATE_RATE_HZ = 100
FREQUENCY_HZ = (0.3, 0.5)
SPEED_RAD_S = (0.1, 0.2)


def wobble() -> None:
    state_rate = rospy.Publisher("robot/joint_state_publish_rate", UInt16, queue_size=10, latch=True)
    with EnabledRobot() as robot:
        limbs = [Limb(side) for side in SIDES]
        for limb in limbs:
            expect(limb.move_to_neutral(), "the %s arm did not get to neutral" % limb.name)
        waves = {name: (random.uniform(*FREQUENCY_HZ), random.uniform(*SPEED_RAD_S))
                 for limb in limbs for name in limb.joint_names()}
        state_rate.publish(RATE_HZ)
        print("wobbling; Ctrl-C: quit", flush=True)
        clock = RosClock()
        watch = Stopwatch(clock.now())
        try:
            for _ in robot.beats(RATE_HZ):
                time_s = watch.elapsed_s(clock.now())
                for limb in limbs:
                    limb.set_joint_velocities({
                        name: peak * math.cos(2.0 * math.pi * frequency * time_s)
                        for name, (frequency, peak) in waves.items() if name in limb.joint_names()})
        finally:
            for limb in limbs:
                limb.exit_control_mode()
            state_rate.publish(USUAL_STATE_RATE_HZ)


def main() -> int:
    parse(new_parser(__doc__))
    return run("rsdk_joint_velocity_wobbler", wobble)


if __name__ == "__main__":
    sys.exit(main())
