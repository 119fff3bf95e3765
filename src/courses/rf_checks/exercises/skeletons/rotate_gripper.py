#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
# exercise: rotate_gripper
"""Bring the left gripper to the lab's pose, then turn it about its own axis, in place: rotate_gripper.py AXIS DEGREES.

AXIS is x, y or z. The program ends when the gripper is there.
"""
import sys

import rospy

import baxter_interface

POINT = [0.644, 0.0, 0.066]  # of left_gripper in base [m]
ORIENTATION = [-0.381, 0.923, -0.015, 0.052]  # x y z w


def rotated(orientation, axis, angle):
    """A quaternion x y z w turned about one of the moved frame's own axes by an angle in radians."""
    # TODO: quaternion to matrix, times the turn, and back to a quaternion.
    return orientation


def main():
    axis, degrees = rospy.myargv()[1:]
    rospy.init_node("my_rotate_gripper")
    baxter_interface.RobotEnable().enable()
    left = baxter_interface.Limb("left")
    left.move_to_neutral()
    # TODO: ask the IK service for the joint angles of the pose above, and move there.
    # TODO: find out where the gripper is (tf), turn that orientation, ask again, and move there.
    print("to be turned about", axis, "by", degrees, rotated(ORIENTATION, axis, 0.0), POINT)
    return 0


if __name__ == "__main__":
    sys.exit(main())
