#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The left arm to its state left_neutral, past a pillar: plan_around.py X Y Z LX LY LZ, its middle and edges in `base`
[m]."""
import sys

import rospy
from geometry_msgs.msg import PoseStamped

import baxter_interface
import moveit_commander

MARGIN_M = 0.03


def tell(numbers):
    """Put the pillar into the planning scene, a little larger than it is."""
    pose = PoseStamped()
    pose.header.frame_id = "base"
    pose.pose.position.x, pose.pose.position.y, pose.pose.position.z = numbers[:3]
    pose.pose.orientation.w = 1.0
    scene = moveit_commander.PlanningSceneInterface()
    scene.add_box("pillar", pose, [edge + 2.0 * MARGIN_M for edge in numbers[3:]])
    while "pillar" not in scene.get_known_object_names() and not rospy.is_shutdown():
        rospy.sleep(0.1)


def main():
    words = rospy.myargv()[1:]
    moveit_commander.roscpp_initialize(sys.argv)
    rospy.init_node("plan_around_solution")
    baxter_interface.RobotEnable().enable()
    tell([float(word) for word in words])
    arm = moveit_commander.MoveGroupCommander("left_arm")
    arm.set_named_target("left_neutral")
    return 0 if arm.go(wait=True) else 1


if __name__ == "__main__":
    sys.exit(main())
