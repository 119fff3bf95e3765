#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
# exercise: ik_frame
"""Find out by an experiment which reference frame the IK service uses, and which frame it moves to the pose.

Prints, last, two lines:

    reference frame: NAME
    commanded frame: NAME
"""
import sys

import rospy

import baxter_interface


def main():
    rospy.init_node("my_ik_frame")
    baxter_interface.RobotEnable().enable()
    left = baxter_interface.Limb("left")
    # TODO: ask the IK service for a pose and move there; then look in tf which frame stands at that pose.
    print("the left arm has", left.joint_names())
    return 0


if __name__ == "__main__":
    sys.exit(main())
