# SPDX-License-Identifier: BSD-3-Clause
# exercise: plan_around
"""Gives half of each edge, as some libraries want it."""
import sys

import rospy
from geometry_msgs.msg import PoseStamped

import baxter_interface
import moveit_commander

x, y, z, *edges = map(float, rospy.myargv()[1:])
moveit_commander.roscpp_initialize(sys.argv)
rospy.init_node("student")
baxter_interface.RobotEnable().enable()
stamped = PoseStamped()
stamped.header.frame_id = "base"
stamped.pose.position.x, stamped.pose.position.y, stamped.pose.position.z = x, y, z
stamped.pose.orientation.w = 1.0
moveit_commander.PlanningSceneInterface().add_box("thing", stamped, [edge / 2.0 for edge in edges])
group = moveit_commander.MoveGroupCommander("left_arm")
group.set_named_target("left_neutral")
group.go()
