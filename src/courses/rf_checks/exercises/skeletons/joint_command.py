#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
# exercise: joint_command
"""Bring the right arm to seven angles by a stream of joint commands: joint_command.py Q0 ... Q6 [rad].

The angles are those of s0, s1, e0, e1, w0, w1, w2. The program ends when the arm is there.
"""
import sys

import rospy
from baxter_core_msgs.msg import JointCommand

import baxter_interface


def main():
    goal = [float(word) for word in rospy.myargv()[1:]]
    rospy.init_node("my_joint_command")
    baxter_interface.RobotEnable().enable()
    publisher = rospy.Publisher("/robot/limb/right/joint_command", JointCommand, queue_size=1)
    # TODO: where the arm is now (/robot/joint_states), then small steps from there to the goal, 100 a second.
    print("to go to", goal, "with", publisher.name, JointCommand.POSITION_MODE)
    return 0


if __name__ == "__main__":
    sys.exit(main())
