#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Three robots in one world move at the same time, each by its own commands only."""

import unittest

import actionlib
import rospy
import rostest
from baxter_core_msgs.msg import AssemblyState
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal, FollowJointTrajectoryResult
from controller_manager_msgs.srv import ListControllers
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectoryPoint

import baxter_interface
from baxter_model import poses
from lab_testing.waiting import wait_until

WAIT_S = 60.0
ANNO_JOINTS = ["joint_%d" % number for number in range(1, 7)]
GOALS = {
    "left_anno": [0.4, -0.3, 0.3, 0.2, -0.4, 0.5],
    "right_anno": [-0.5, -0.2, 0.4, -0.3, 0.3, -0.6],
}


def running(name):
    """Whether the arm's trajectory controller runs; its action exists as soon as it is loaded."""
    service = f"/{name}/probot_anno/controller_manager/list_controllers"
    rospy.wait_for_service(service, 60.0)
    listing = rospy.ServiceProxy(service, ListControllers)().controller
    return any(entry.name == "arm_joint_controller" and entry.state == "running" for entry in listing)


def enabled():
    """Whether Baxter is enabled."""
    return rospy.wait_for_message("/robot/state", AssemblyState, timeout=60.0).enabled


class ThreeRobots(unittest.TestCase):
    def test_all_arrive_where_they_were_sent(self):
        for name in GOALS:
            wait_until(lambda name=name: running(name), f"the controller of {name} to run", WAIT_S)
        wait_until(enabled, "Baxter to be enabled", WAIT_S)
        clients = {}
        for name in GOALS:
            action = f"/{name}/probot_anno/arm_joint_controller/follow_joint_trajectory"
            clients[name] = actionlib.SimpleActionClient(action, FollowJointTrajectoryAction)
            self.assertTrue(clients[name].wait_for_server(rospy.Duration(40)), f"no action server {action}")
        for name, goal in GOALS.items():
            message = FollowJointTrajectoryGoal()
            message.trajectory.joint_names = ANNO_JOINTS
            still = [0.0] * 6
            message.trajectory.points = [JointTrajectoryPoint(goal, still, still, [], rospy.Duration(3.0))]
            clients[name].send_goal(message)
        self.assertTrue(baxter_interface.Limb("left").move_to_neutral())
        for name, client in clients.items():
            self.assertTrue(client.wait_for_result(rospy.Duration(20)), f"{name} does not finish")
            self.assertEqual(client.get_result().error_code, FollowJointTrajectoryResult.SUCCESSFUL, name)
        for name, goal in GOALS.items():
            state = rospy.wait_for_message(f"/{name}/probot_anno/joint_states", JointState, timeout=10)
            for joint, wanted in zip(ANNO_JOINTS, goal, strict=True):
                self.assertAlmostEqual(
                    state.position[state.name.index(joint)], wanted, delta=0.005, msg=f"{name} {joint}"
                )
        state = rospy.wait_for_message("/robot/joint_states", JointState, timeout=10)
        self.assert_at(state, poses().angles("neutral", "left"))

    def assert_at(self, state, wanted):
        for joint, angle in wanted.items():
            self.assertAlmostEqual(state.position[state.name.index(joint)], angle, delta=0.005, msg=joint)


if __name__ == "__main__":
    rospy.init_node("three_robots")
    wait_until(lambda: rospy.get_time() > 0.0, "simulation time", WAIT_S)
    rostest.rosrun("workspace_tests", "three_robots", ThreeRobots)
