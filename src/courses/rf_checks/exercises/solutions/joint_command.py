#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Bring the right arm to seven angles by a stream of joint commands: joint_command.py Q0 ... Q6 (s0 to w2) [rad]."""
import sys

import numpy as np
import rospy
from baxter_core_msgs.msg import JointCommand
from sensor_msgs.msg import JointState

import baxter_interface

NAMES = ["right_s0", "right_s1", "right_e0", "right_e1", "right_w0", "right_w1", "right_w2"]
RATE_HZ, SPEED_RAD_S, NEAR_RAD = 100, 0.6, 0.01


def angles():
    """Where the arm is now, in the order of NAMES [rad]."""
    while True:
        message = rospy.wait_for_message("/robot/joint_states", JointState, timeout=10.0)
        if set(NAMES) <= set(message.name):
            return np.array([message.position[message.name.index(name)] for name in NAMES])


def main():
    goal = np.array([float(word) for word in rospy.myargv()[1:]])
    rospy.init_node("joint_command_solution")
    baxter_interface.RobotEnable().enable()
    publisher = rospy.Publisher("/robot/limb/right/joint_command", JointCommand, queue_size=1)
    start = angles()
    duration_s = max(0.1, np.abs(goal - start).max() / SPEED_RAD_S)
    rate = rospy.Rate(RATE_HZ)
    steps = round(duration_s * RATE_HZ)
    for k in range(steps + 1):
        part = k / steps
        # Starts and ends slowly.
        command = start + (3.0 * part ** 2 - 2.0 * part ** 3) * (goal - start)
        publisher.publish(JointCommand(mode=JointCommand.POSITION_MODE, names=NAMES, command=list(command)))
        rate.sleep()
    while np.abs(angles() - goal).max() > NEAR_RAD and not rospy.is_shutdown():
        publisher.publish(JointCommand(mode=JointCommand.POSITION_MODE, names=NAMES, command=list(goal)))
        rate.sleep()
    return 0


if __name__ == "__main__":
    sys.exit(main())
