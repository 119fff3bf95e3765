# SPDX-License-Identifier: BSD-3-Clause
# exercise: plan_around
"""Plans without a word of the pillar."""
import sys

import rospy

import baxter_interface
import moveit_commander

moveit_commander.roscpp_initialize(sys.argv)
rospy.init_node("student")
baxter_interface.RobotEnable().enable()
group = moveit_commander.MoveGroupCommander("left_arm")
group.go("left_neutral")
