#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A student's program for benches: sends both arms position commands at 100 Hz. `bench class` starts it in each lab."""
import math
import time

import rospy
from baxter_core_msgs.msg import JointCommand
from std_msgs.msg import Bool

from baxter_model import SIDES, joint_names, poses
from lab_testing.waiting import beats

RATE_HZ, SWING_RAD, SWING_RAD_S = 100.0, 0.3, 2.0


def main():
    rospy.init_node("both_arms", disable_rostime=True)
    publishers = {side: rospy.Publisher("/robot/limb/%s/joint_command" % side, JointCommand, queue_size=1)
                  for side in SIDES}
    neutral = {side: list(poses().angles("neutral", side).values()) for side in SIDES}
    rospy.Publisher("/robot/set_super_enable", Bool, latch=True, queue_size=1).publish(True)
    for _ in beats(RATE_HZ, rospy.is_shutdown):
        offset = SWING_RAD * math.sin(SWING_RAD_S * time.monotonic())
        for side, publisher in publishers.items():
            angles = [angle + offset for angle in neutral[side]]
            publisher.publish(JointCommand(JointCommand.POSITION_MODE, angles, list(joint_names(side))))


if __name__ == "__main__":
    main()
