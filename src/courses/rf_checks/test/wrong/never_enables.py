# SPDX-License-Identifier: BSD-3-Clause
# exercise: rotate_gripper
"""Moves without RobotEnable."""
import rospy

import baxter_interface

rospy.init_node("student")
left = baxter_interface.Limb("left")
left.move_to_joint_positions(left.ik(((0.644, 0.0, 0.066), (-0.381, 0.923, -0.015, 0.052))))
