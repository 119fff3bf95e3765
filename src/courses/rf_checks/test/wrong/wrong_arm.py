# SPDX-License-Identifier: BSD-3-Clause
# exercise: rotate_gripper
"""Moves the right arm."""
import rospy

import baxter_interface

rospy.init_node("student")
baxter_interface.RobotEnable().enable()
right = baxter_interface.Limb("right")
right.move_to_joint_positions(right.ik(((0.6, -0.3, 0.3), (0.0, 1.0, 0.0, 0.0))))
