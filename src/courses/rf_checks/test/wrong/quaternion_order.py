# SPDX-License-Identifier: BSD-3-Clause
# exercise: rotate_gripper
"""Hands x y z w to a function that takes w x y z."""
import sys

import numpy as np
import rospy
from transforms3d import axangles, quaternions

import baxter_interface

POINT, ORIENTATION = (0.644, 0.0, 0.066), (-0.381, 0.923, -0.015, 0.052)
rospy.init_node("student")
baxter_interface.RobotEnable().enable()
left = baxter_interface.Limb("left")
left.move_to_joint_positions(left.ik((POINT, ORIENTATION)))
axis = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}[sys.argv[1]]
turn = axangles.axangle2mat(axis, np.deg2rad(float(sys.argv[2])))
w, x, y, z = quaternions.mat2quat(quaternions.quat2mat(ORIENTATION) @ turn)
left.move_to_joint_positions(left.ik((POINT, (x, y, z, w))))
