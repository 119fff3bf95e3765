#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Bringup with MoveIt as in the lab sheet: everything runs, and the arm follows a program's goals."""
import os
import signal
import subprocess
import tempfile
import unittest

import actionlib
import rospy
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryActionGoal
from sensor_msgs.msg import JointState

from lab_testing.waiting import stretched, wait_for_message, wait_until
from moveit_commander import MoveGroupCommander

TIMEOUT_S = stretched(60.0)


class BringupTest(unittest.TestCase):
    def setUp(self):
        self.output = tempfile.NamedTemporaryFile("w+", suffix=".txt")
        self.addCleanup(self.output.close)
        # No display: no windows, and rviz is missing.
        environment = {**os.environ, "DISPLAY": ""}
        self.lab = subprocess.Popen(
            ["roslaunch", "probot_gazebo", "probot_anno_bringup_moveit.launch"],
            env=environment, stdout=self.output, stderr=subprocess.STDOUT, start_new_session=True)
        self.addCleanup(self.end_lab)

    def end_lab(self):
        if self.lab.poll() is None:
            os.killpg(self.lab.pid, signal.SIGINT)
            self.lab.wait(TIMEOUT_S)

    def printed(self, text):
        with open(self.output.name) as file:
            return [line for line in file if text in line]

    def test_everything_runs_and_the_arm_goes_where_it_is_sent(self):
        client = actionlib.SimpleActionClient(
            "/probot_anno/arm_joint_controller/follow_joint_trajectory", FollowJointTrajectoryAction)
        self.assertTrue(client.wait_for_server(rospy.Duration(TIMEOUT_S)), "the controller is not there")
        # The topic that MoveIt's clients read.
        state = rospy.wait_for_message("/joint_states", JointState, TIMEOUT_S)
        self.assertEqual(len(state.name), 6)
        self.assertIn("manipulator", rospy.get_param("/robot_description_semantic"))

        goals = []
        listener = rospy.Subscriber("/probot_anno/arm_joint_controller/follow_joint_trajectory/goal",
                                    FollowJointTrajectoryActionGoal, goals.append)
        self.addCleanup(listener.unregister)
        wait_until(lambda: listener.get_num_connections() > 0, "move_group's goals to be heard", TIMEOUT_S)
        group = MoveGroupCommander("manipulator", wait_for_servers=TIMEOUT_S)
        self.assertTrue(group.go("upward"))
        # As on the slide, except for the frame, which is the root of our description.
        wait_until(lambda: goals, "the goal that was sent", TIMEOUT_S)
        self.assertRegex(goals[0].goal_id.id, r"^/move_group-\d+-%d\.%d$" % (
            goals[0].goal_id.stamp.secs, goals[0].goal_id.stamp.nsecs))
        trajectory = goals[0].goal.trajectory
        self.assertEqual(trajectory.joint_names, ["joint_%d" % number for number in range(1, 7)])
        self.assertEqual(trajectory.header.frame_id, "world")
        first = trajectory.points[0]
        self.assertEqual((first.velocities, first.effort, first.time_from_start.to_sec()), ((0.0,) * 6, (), 0.0))
        upward = group.get_named_target_values("upward")
        wait_for_message("/probot_anno/joint_states", JointState, lambda message: all(
            abs(position - upward[name]) < 0.02 for name, position in zip(message.name, message.position, strict=True)))

        wait_until(lambda: self.printed("You can start planning now!"), "move_group's line", TIMEOUT_S)
        wait_until(lambda: self.printed("rviz is not started: there is no display"), "rviz's line", TIMEOUT_S)
        self.assertEqual(self.printed("has died"), [])
        self.assertEqual(self.printed("Traceback"), [])


if __name__ == "__main__":
    import rostest
    rospy.init_node("probot_anno_bringup_rostest")
    rostest.rosrun("probot_gazebo", "probot_anno_bringup", BringupTest)
