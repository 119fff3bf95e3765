#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
# exercise: plan_around
"""Bring the left arm to the state left_neutral, past a pillar that stands in its way: plan_around.py X Y Z LX LY LZ.

X Y Z is the pillar's middle, LX LY LZ are its edges, in `base` [m]. Nothing may touch it. move_group and the arm's
trajectory server run already.
"""
import sys

import rospy

import baxter_interface
import moveit_commander


def main():
    numbers = [float(word) for word in rospy.myargv()[1:]]
    moveit_commander.roscpp_initialize(sys.argv)
    rospy.init_node("my_plan_around")
    baxter_interface.RobotEnable().enable()
    arm = moveit_commander.MoveGroupCommander("left_arm")
    # TODO: tell move_group of the pillar (moveit_commander.PlanningSceneInterface), then plan and go.
    print("around", numbers, "with", arm.get_name())
    return 0


if __name__ == "__main__":
    sys.exit(main())
