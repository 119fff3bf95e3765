#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
# exercise: steer_to
"""Steer the left gripper to a place, and keep its orientation: steer_to.py X Y Z, in `base` [m].

The servo of the left arm runs already: it takes geometry_msgs/TwistStamped on /left_servo/delta_twist_cmds, m/s and
rad/s in the axes of header.frame_id. A twist counts for 0.1 s.
"""
import sys

import rospy
from geometry_msgs.msg import TwistStamped

import baxter_interface


def main():
    goal = [float(word) for word in rospy.myargv()[1:]]
    rospy.init_node("my_steer_to")
    baxter_interface.RobotEnable().enable()
    arm = baxter_interface.Limb("left")
    twists = rospy.Publisher("/left_servo/delta_twist_cmds", TwistStamped, queue_size=1)
    # TODO: until the gripper is at the goal, publish 50 times a second the velocity that leads it there; then stop.
    print("from", arm.endpoint_pose()["position"], "to", goal, "by", twists.name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
