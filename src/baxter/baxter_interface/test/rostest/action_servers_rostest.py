#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Trajectories in every mode, gripper and head goals, against the simulated robot."""
import contextlib
import os
import signal
import subprocess
import threading
import unittest

import actionlib
import numpy as np
import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import (
    FollowJointTrajectoryResult,
    GripperCommand,
    GripperCommandAction,
    GripperCommandGoal,
    JointTolerance,
    SingleJointPositionAction,
    SingleJointPositionActionFeedback,
    SingleJointPositionGoal,
)
from trajectory_client import DEADLINE_S, TrajectoryClient

from baxter_interface import HEAD_PAN_ANGLE_TOLERANCE, Head, Limb, RobotEnable, startup
from baxter_model import SIDES
from lab_testing.waiting import wait_until

NEUTRAL = [0.0, -0.55, 0.0, 0.75, 0.0, 1.26, 0.0]
# The example trajectory of the robot's documentation, for the left arm, in less time.
WAYPOINT = np.array([-0.11, -0.62, -1.15, 1.32, 0.80, 1.27, 2.39])
MIRRORED = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
# Joint states are 10 to 30 ms old when they are compared with the trajectory, and older on a busy machine; a benchmark
# measures how well the arms follow.
MEAN_ERROR_RAD = {"position_w_id": 0.1, "position": 0.2, "velocity": 0.1}
EXIT_TIMEOUT_S = 60.0


def patience(client):
    """Fields of a goal that does not fail on a busy machine."""
    return {"path_tolerance": [JointTolerance(name=name, position=-1.0) for name in client.names],
            "goal_time_tolerance": rospy.Duration(DEADLINE_S)}


class ActionServersTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.robot = RobotEnable()

    def serve(self, server, *options):
        """Start a server's program; returns a function that ends it as Ctrl-C does and checks that it ends well."""
        process = subprocess.Popen(["rosrun", "baxter_interface", server, *options], stderr=subprocess.PIPE, text=True,
                                   start_new_session=True)

        def end():
            os.killpg(process.pid, signal.SIGINT)
            errors = process.communicate(timeout=EXIT_TIMEOUT_S)[1]
            self.assertNotIn("Traceback", errors)

        self.addCleanup(lambda: process.poll() is None and os.killpg(process.pid, signal.SIGKILL))
        return end

    def limits_are_kept(self, client):
        state, code, text = client.go([(3.0, [0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0])])
        self.assertEqual((state, code), (GoalStatus.ABORTED, FollowJointTrajectoryResult.INVALID_GOAL))
        self.assertIn("e1 would have to be at 9.000000 at 3.000 s; its limit is 2.618", text)
        state, code, text = client.go([(0.05, [1.0, *NEUTRAL[1:]])])
        self.assertEqual((state, code), (GoalStatus.ABORTED, FollowJointTrajectoryResult.INVALID_GOAL))
        self.assertIn("s0 would have to move at", text)

    def follow(self, modes):
        """Move both arms at once; `modes`: mode by side."""
        ends = [self.serve("joint_trajectory_action_server.py", "--mode", mode, "--limb", side)
                for side, mode in modes.items()]
        clients = {side: TrajectoryClient(side) for side in modes}
        for side, client in clients.items():
            self.limits_are_kept(client)
            waypoint = WAYPOINT if side == "left" else WAYPOINT * MIRRORED
            angles = Limb(side).joint_angles()
            client.send([(0.0, [angles[name] for name in client.names]), (2.0, waypoint), (2.8, 0.75 * waypoint),
                         (4.0, 1.25 * waypoint)], **patience(client))
        for side, client in clients.items():
            self.assertEqual(client.end(), (GoalStatus.SUCCEEDED, 0, ""), side)
            errors = np.abs([message.error.positions for message in client.feedback]).max(axis=1)
            ticks_ms = 1e3 * np.diff([message.header.stamp.to_sec() for message in client.feedback])
            print("%s, %s arm: farthest off %.4f rad, in the mean %.4f rad, tick %.2f ms, its deviation %.2f ms" % (
                modes[side], side, errors.max(), errors.mean(), ticks_ms.mean(), ticks_ms.std()))
            self.assertLess(errors.mean(), MEAN_ERROR_RAD[modes[side]], side)
            client.send([(2.5, NEUTRAL)], **patience(client))
        for client in clients.values():
            self.assertEqual(client.end()[0], GoalStatus.SUCCEEDED)
        for end in ends:
            end()

    def test_trajectories_as_raw_positions_and_velocities(self):
        self.follow({"left": "position_w_id", "right": "velocity"})

    def test_trajectories_as_positions_and_raw_positions(self):
        self.follow({"left": "position", "right": "position_w_id"})

    def test_grippers(self):
        end = self.serve("gripper_action_server.py")
        for side in SIDES:
            name = "robot/end_effector/%s_gripper/gripper_action" % side
            client = actionlib.SimpleActionClient(name, GripperCommandAction)
            self.assertTrue(client.wait_for_server(rospy.Duration(DEADLINE_S)), name)
            for position, effort in ((0.0, 50.0), (100.0, 50.0), (25.0, 40.0), (75.0, -1.0)):
                client.send_goal(GripperCommandGoal(GripperCommand(position, effort)))
                self.assertTrue(client.wait_for_result(rospy.Duration(DEADLINE_S)))
                self.assertEqual(client.get_state(), GoalStatus.SUCCEEDED, client.get_goal_status_text())
                result = client.get_result()
                self.assertTrue(result.reached_goal)
                self.assertAlmostEqual(result.position, position, delta=5.0)
            client.send_goal(GripperCommandGoal(GripperCommand(float("nan"), 0.0)))
            self.assertTrue(client.wait_for_result(rospy.Duration(DEADLINE_S)))
            self.assertEqual(client.get_state(), GoalStatus.ABORTED)
            self.assertIn("finite", client.get_goal_status_text())
        end()

    def test_head(self):
        end = self.serve("head_action_server.py")
        client = actionlib.SimpleActionClient("robot/head/head_action", SingleJointPositionAction)
        self.assertTrue(client.wait_for_server(rospy.Duration(DEADLINE_S)))
        head, heard = Head(), []
        subscriber = rospy.Subscriber("robot/head/head_action/feedback", SingleJointPositionActionFeedback,
                                      lambda message: heard.append(message.feedback))
        self.addCleanup(subscriber.unregister)
        wait_until(subscriber.get_num_connections, "the server's feedback")

        def go(position, speed):
            client.send_goal(SingleJointPositionGoal(position=position, max_velocity=speed))
            self.assertTrue(client.wait_for_result(rospy.Duration(DEADLINE_S)))
            return client.get_state(), client.get_goal_status_text()

        for position, speed in ((0.0, 0.0), (1.57, 0.3), (-1.0, 0.4)):
            heard.clear()
            self.assertEqual(go(position, speed), (GoalStatus.SUCCEEDED, ""))
            # The result may arrive before the head's last state.
            wait_until(lambda position=position: abs(head.pan() - position) <= HEAD_PAN_ANGLE_TOLERANCE
                       and heard and abs(heard[-1].position - position) <= HEAD_PAN_ANGLE_TOLERANCE,
                       "the head at %g rad" % position)
        state, text = go(3.0, 1.0)
        self.assertEqual(state, GoalStatus.ABORTED)
        self.assertEqual(text, "the head turns from -1.5708 to 1.5708 rad, not to 3.0000 rad")
        begun = threading.Event()
        client.send_goal(SingleJointPositionGoal(position=1.57, max_velocity=0.01),
                         feedback_cb=lambda feedback: begun.set())
        self.assertTrue(begun.wait(DEADLINE_S), "no feedback")
        client.cancel_goal()
        self.assertTrue(client.wait_for_result(rospy.Duration(DEADLINE_S)))
        self.assertEqual(client.get_state(), GoalStatus.PREEMPTED)
        self.robot.disable()
        self.addCleanup(self.robot.enable)
        state, text = go(0.0, 1.0)
        self.assertEqual(state, GoalStatus.ABORTED)
        self.assertIn("not enabled", text)
        end()


if __name__ == "__main__":
    import rostest

    while not rospy.core.is_initialized():
        # The simulator takes its time on a busy machine; if it ends, so does this test.
        with contextlib.suppress(OSError):
            startup.init_node("action_servers_rostest")
    rostest.rosrun("baxter_interface", "action_servers", ActionServersTest)
