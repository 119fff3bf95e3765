#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The simulated arm as the lab uses it: joint states, /tf, six joints by FollowJointTrajectory, topics in rostopic."""
import os
import subprocess
import tempfile
import unittest
from pathlib import Path

import actionlib
import numpy as np
import rospy
import tf2_ros
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal, FollowJointTrajectoryResult
from controller_manager_msgs.srv import ListControllers
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lab_testing.waiting import stretched, wait_until

JOINTS = ["joint_%d" % number for number in range(1, 7)]
ACTION = "/probot_anno/arm_joint_controller/follow_joint_trajectory"
TIMEOUT_S = stretched(60.0)
# All in one line, upwards: far from "home" in two joints, and the tip's pose is computed by hand.
START = (0.0, 0.0, 1.5708, 0.0, 1.5708, 0.0)
START_TIP_M = (0.0, 0.0, 0.487 + 0.22885535 + 0.055)
ARRIVED_RAD = 1e-3


def trajectory(*points):
    """points: (positions, seconds from start, velocity of all joints if it is not zero).

    Quintic, as planners send it: linear segments would not end at rest, and the controller, which by default allows no
    time after the end, would report a violation.
    """
    return JointTrajectory(joint_names=JOINTS, points=[
        JointTrajectoryPoint(positions=positions, velocities=velocity * 6 or [0.0] * 6, accelerations=[0.0] * 6,
                             time_from_start=rospy.Duration(seconds))
        for positions, seconds, *velocity in points])


class ProbotTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.client = actionlib.SimpleActionClient(ACTION, FollowJointTrajectoryAction)
        assert cls.client.wait_for_server(rospy.Duration(TIMEOUT_S)), "%s is not there" % ACTION
        cls.buffer = tf2_ros.Buffer()
        cls.listener = tf2_ros.TransformListener(cls.buffer)

    def follow(self, *points):
        """Send a trajectory, wait for its end; return (terminal state, result)."""
        self.client.send_goal(FollowJointTrajectoryGoal(trajectory=trajectory(*points)))
        self.assertTrue(self.client.wait_for_result(rospy.Duration(TIMEOUT_S)), "the trajectory does not end")
        return self.client.get_state(), self.client.get_result()

    def positions(self):
        state = rospy.wait_for_message("/probot_anno/joint_states", JointState, TIMEOUT_S)
        return np.array([state.position[state.name.index(name)] for name in JOINTS])

    def assert_arrives(self, goal, seconds):
        state, result = self.follow((goal, seconds))
        self.assertEqual((state, result.error_code), (GoalStatus.SUCCEEDED, FollowJointTrajectoryResult.SUCCESSFUL),
                         result.error_string)
        np.testing.assert_allclose(self.positions(), goal, atol=ARRIVED_RAD)

    def test_both_controllers_run(self):
        name = "/probot_anno/controller_manager/list_controllers"
        rospy.wait_for_service(name, TIMEOUT_S)
        list_controllers = rospy.ServiceProxy(name, ListControllers)
        expected = {
            "joint_state_controller": ("joint_state_controller/JointStateController", "running"),
            "arm_joint_controller": ("position_controllers/JointTrajectoryController", "running")}

        def listed():
            return {item.name: (item.type, item.state) for item in list_controllers().controller}

        # Each has a spawner of its own.
        wait_until(lambda: listed() == expected, lambda: "both controllers, there are %s" % listed(), TIMEOUT_S)

    def test_joint_states_come_at_50_hz_of_simulated_time(self):
        stamps, names = [], []

        def note(message):
            stamps.append(message.header.stamp.to_sec())
            names.append(message.name)

        subscriber = rospy.Subscriber("/probot_anno/joint_states", JointState, note, queue_size=200)
        wait_until(lambda: len(stamps) > 100, lambda: "101 messages, %d came" % len(stamps), TIMEOUT_S)
        subscriber.unregister()
        self.assertEqual(sorted(names[-1]), JOINTS)
        self.assertAlmostEqual(stamps[100] - stamps[0], 2.0, delta=0.05)

    def test_six_joints_move_and_tf_follows(self):
        self.assert_arrives((0.6, -0.5, 0.8, 1.2, 0.9, -1.5), 1.5)
        self.assert_arrives(START, 1.5)
        tip = self.buffer.lookup_transform("base_link", "tool0", rospy.Time.now(), rospy.Duration(TIMEOUT_S)).transform
        self.assertLess(np.linalg.norm(np.array([tip.translation.x, tip.translation.y, tip.translation.z])
                                       - START_TIP_M), 2e-3)
        self.assert_arrives([0.0] * 6, 1.5)

    def test_several_points_are_passed(self):
        highest = []
        subscriber = rospy.Subscriber("/probot_anno/joint_states", JointState,
                                      lambda message: highest.append(max(message.position)), queue_size=200)
        state, result = self.follow(([0.2] * 6, 0.5, 0.4), ([0.4] * 6, 1.0), ([0.1] * 6, 1.5, -0.3), ([0.0] * 6, 2.0))
        subscriber.unregister()
        self.assertEqual((state, result.error_code), (GoalStatus.SUCCEEDED, 0), result.error_string)
        self.assertAlmostEqual(max(highest), 0.4, delta=0.01)
        np.testing.assert_allclose(self.positions(), [0.0] * 6, atol=ARRIVED_RAD)

    def test_unknown_joint_is_refused(self):
        goal = trajectory(([0.1] * 6, 1.0))
        goal.joint_names = [*JOINTS[:5], "joint_7"]
        self.client.send_goal(FollowJointTrajectoryGoal(trajectory=goal))
        self.assertTrue(self.client.wait_for_result(rospy.Duration(TIMEOUT_S)))
        self.assertEqual(self.client.get_result().error_code, FollowJointTrajectoryResult.INVALID_JOINTS)

    def test_rostopic_echoes_the_goal(self):
        echo = subprocess.Popen(["rostopic", "echo", "-n", "1", ACTION + "/goal"], stdout=subprocess.PIPE, text=True)
        try:
            # Listeners of a topic are known by the publisher, which is the action client here.
            wait_until(lambda: self.client.action_client.pub_goal.get_num_connections() > 1,
                       "rostopic to listen", TIMEOUT_S)
            self.assert_arrives([0.0] * 6, 0.5)
            text = echo.communicate(timeout=TIMEOUT_S)[0]
        finally:
            echo.kill()
        for name in JOINTS:
            self.assertIn(name, text)

    def test_plot_shows_the_motion(self):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(os.environ.get("ROS_TEST_RESULTS_DIR", folder)) / "probot_anno.png"
            topics = "/probot_anno/joint_states/" + ":".join("position[%d]" % number for number in range(6))
            plot = subprocess.Popen(["rosrun", "rqt_plot", "rqt_plot", topics, "--png", str(file), "--seconds", "5"],
                                    stdout=subprocess.PIPE, text=True)
            try:
                while plot.poll() is None:
                    self.assert_arrives([0.1 * number for number in range(1, 7)], 0.7)
                    self.assert_arrives([0.0] * 6, 0.7)
                output = plot.communicate()[0]
            finally:
                plot.kill()
            self.assertEqual(plot.returncode, 0, output)
            self.assertEqual(file.read_bytes()[:4], b"\x89PNG")
        for number in range(6):
            (line,) = (line for line in output.splitlines() if "position[%d]: " % number in line)
            lowest, highest = float(line.split()[6]), float(line.split()[8])
            self.assertAlmostEqual(lowest, 0.0, delta=0.01)
            self.assertAlmostEqual(highest, 0.1 * (number + 1), delta=0.01)


if __name__ == "__main__":
    import rostest
    rospy.init_node("probot_anno_rostest")
    rostest.rosrun("probot_gazebo", "probot_anno", ProbotTest)
