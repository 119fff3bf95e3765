#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
# exercise: unreachable
"""Say why a pose of the left gripper has no solution: unreachable.py X Y Z QX QY QZ QW (in base).

Prints one line: SOLVED, OUT_OF_REACH with how many metres it is short, or JOINT_LIMIT with the joint.
"""
import sys

import rospy

NODE = "/ExternalTools/left/PositionKinematicsNode/"


def main():
    numbers = [float(word) for word in rospy.myargv()[1:]]
    rospy.init_node("my_unreachable", anonymous=True)
    # TODO: subscribe to NODE + "IKReport" (baxter_kinematics_msgs/IKReport; `rosmsg show` it).
    # TODO: ask NODE + "IKService" for the pose, and print what the report says about it.
    print("I was asked about", numbers, "and the node is", NODE)
    return 0


if __name__ == "__main__":
    sys.exit(main())
