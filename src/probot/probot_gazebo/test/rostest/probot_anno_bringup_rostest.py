#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Bringup with MoveIt as it is printed: everything runs; what is not installed is one line."""
import os
import signal
import subprocess
import tempfile
import unittest

import actionlib
import roslib.packages
import rospkg
import rospy
from control_msgs.msg import FollowJointTrajectoryAction
from sensor_msgs.msg import JointState

from lab_testing.waiting import stretched, wait_until

TIMEOUT_S = stretched(60.0)


def has_planning_server():
    try:
        return bool(roslib.packages.find_node("moveit_ros_move_group", "move_group"))
    except rospkg.ResourceNotFound:
        return False


class BringupTest(unittest.TestCase):
    def setUp(self):
        self.output = tempfile.NamedTemporaryFile("w+", suffix=".txt")
        self.addCleanup(self.output.close)
        # No display: no windows, and rviz is the other thing that is missing.
        environment = {**os.environ, "DISPLAY": ""}
        self.lab = subprocess.Popen(
            ["roslaunch", "probot_gazebo", "probot_anno_bringup_moveit.launch"],
            env=environment, stdout=self.output, stderr=subprocess.STDOUT, start_new_session=True)
        self.addCleanup(self.end_lab)

    def end_lab(self):
        if self.lab.poll() is None:
            os.killpg(self.lab.pid, signal.SIGINT)
            self.lab.wait(30.0)

    def printed(self, text):
        with open(self.output.name) as file:
            return [line for line in file if text in line]

    def test_everything_that_is_installed_runs(self):
        client = actionlib.SimpleActionClient(
            "/probot_anno/arm_joint_controller/follow_joint_trajectory", FollowJointTrajectoryAction)
        self.assertTrue(client.wait_for_server(rospy.Duration(TIMEOUT_S)), "the controller is not there")
        # Where MoveIt's clients look for the arm.
        state = rospy.wait_for_message("/joint_states", JointState, TIMEOUT_S)
        self.assertEqual(len(state.name), 6)
        self.assertIn("manipulator", rospy.get_param("/robot_description_semantic"))

        missing = ["rviz is not started: there is no display"]
        if not has_planning_server():
            missing.append("move_group is not started: package moveit_ros_move_group is not installed")
        wait_until(lambda: all(self.printed(text) for text in missing), "the lines %s" % missing, TIMEOUT_S)
        for text in missing:
            self.assertEqual(len(self.printed(text)), 1)
        self.assertEqual(self.printed("has died"), [])
        self.assertEqual(self.printed("Traceback"), [])


if __name__ == "__main__":
    import rostest
    rospy.init_node("probot_anno_bringup_rostest")
    rostest.rosrun("probot_gazebo", "probot_anno_bringup", BringupTest)
