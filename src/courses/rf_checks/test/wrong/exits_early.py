# SPDX-License-Identifier: BSD-3-Clause
# exercise: rotate_gripper
"""Sends one command and leaves."""
import rospy

import baxter_interface

rospy.init_node("student")
baxter_interface.RobotEnable().enable()
left = baxter_interface.Limb("left")
left.set_joint_positions(left.ik(((0.644, 0.0, 0.066), (-0.381, 0.923, -0.015, 0.052))))
