#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The left gripper to a place in `base` [m] by twists for its servo: steer_to.py X Y Z."""
import sys

import numpy as np
import rospy
from geometry_msgs.msg import TwistStamped

import baxter_interface

# Speed [1/s] per metre that is left, and its limit [m/s]; the gripper is there within so much [m].
GAIN, FASTEST, NEAR = 2.0, 0.15, 0.003
RATE_HZ, TIMEOUT_S = 50.0, 30.0


def main():
    goal = np.array([float(word) for word in rospy.myargv()[1:]])
    rospy.init_node("steer_to_solution")
    baxter_interface.RobotEnable().enable()
    arm = baxter_interface.Limb("left")
    twists = rospy.Publisher("/left_servo/delta_twist_cmds", TwistStamped, queue_size=1)
    rate, end = rospy.Rate(RATE_HZ), rospy.get_time() + TIMEOUT_S
    while not rospy.is_shutdown() and rospy.get_time() < end:
        left = goal - np.array(arm.endpoint_pose()["position"])
        velocity = GAIN * left
        velocity *= min(1.0, FASTEST / max(np.linalg.norm(velocity), 1e-9))
        is_there = np.linalg.norm(left) < NEAR
        message = TwistStamped()
        message.header.stamp, message.header.frame_id = rospy.Time.now(), "base"
        linear = message.twist.linear
        linear.x, linear.y, linear.z = np.zeros(3) if is_there else velocity
        twists.publish(message)
        if is_there and twists.get_num_connections():
            return 0
        rate.sleep()
    return 1


if __name__ == "__main__":
    sys.exit(main())
