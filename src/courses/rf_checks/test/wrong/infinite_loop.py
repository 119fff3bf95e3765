# SPDX-License-Identifier: BSD-3-Clause
# exercise: rotate_gripper
"""Computes for ever."""
import rospy

rospy.init_node("student")
count = 0
while True:
    count += 1
