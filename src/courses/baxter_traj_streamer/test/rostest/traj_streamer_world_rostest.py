#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The simulator: the notes' commands in another order, goals with faults, and stops during motion."""
import os
import pathlib
import random
import signal
import subprocess
import sys
import unittest

import numpy as np
import rospy
from actionlib_msgs.msg import GoalStatus
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Empty, Float64

from baxter_traj_streamer.judging import KNOWN_JOINTS
from baxter_traj_streamer.ros_settings import read_limits
from baxter_traj_streamer.settings import SIDES
from baxter_traj_streamer.traj_client import TrajClient, joint_trajectory
from lab_testing.waiting import stretched, wait_until

sys.path.insert(0, str(pathlib.Path(__file__).parents[1]))
from spoilt_goals import WORDS, spoilt_goal  # noqa: E402

DEADLINE_S = stretched(90.0)
# The notes' goal, and the tolerance that is promised [rad].
PRE_POSE_RIGHT = [-0.907528, -0.111813, 2.06622, 1.8737, -1.295, 2.00164, -2.87179]
TOLERANCE = 0.01
# Number of goals with faults, and the largest motion that they may cause [rad].
SPOILT, STILL = 150, 0.001
# Largest stopping distance when the robot is stopped or disabled at 0.25 rad/s [rad].
COASTING = 0.05


class TrajInTheWorldTest(unittest.TestCase):
    def start(self, *command):
        process = subprocess.Popen(["rosrun", *command], start_new_session=True)
        self.addCleanup(self.stop, process)
        return process

    @staticmethod
    def stop(process):
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)
            process.wait(timeout=DEADLINE_S)

    def test_1_right_arm_then_left_arm(self):
        client = self.start("baxter_traj_streamer", "traj_action_client_pre_pose")
        self.start("baxter_traj_streamer", "traj_interpolator_as")
        subprocess.run(["rosrun", "baxter_tools", "enable_robot.py", "-e"], check=True, timeout=DEADLINE_S)
        self.assertEqual(client.wait(timeout=DEADLINE_S), 0)
        robot = TrajClient()
        self.arrives(lambda: robot.streamer.get_qvec_right_arm(), PRE_POSE_RIGHT)
        left = self.start("baxter_traj_streamer", "traj_action_client_pre_pose", SIDES[1], "--time-optimal",
                          "--wait", "60")
        self.assertEqual(left.wait(timeout=DEADLINE_S), 0)
        self.arrives(lambda: robot.streamer.get_qvec_left_arm(), robot.streamer.settings.pose("pre_pose", "left"))
        # The right arm had no commands meanwhile, and holds.
        self.arrives(lambda: robot.streamer.get_qvec_right_arm(), PRE_POSE_RIGHT)

    def test_2_goals_with_faults_are_rejected_each_for_its_reason_and_nothing_moves(self):
        client = self.ready_client()
        before = np.array(client.here(KNOWN_JOINTS))
        farthest = np.zeros(len(KNOWN_JOINTS))
        reports = []

        def on_joint_states(message):
            angles = dict(zip(message.name, message.position, strict=True))
            if all(name in angles for name in KNOWN_JOINTS):
                reports.append(message.header.stamp)
                np.maximum(farthest, np.abs([angles[name] for name in KNOWN_JOINTS] - before), out=farthest)

        subscriber = rospy.Subscriber("/robot/joint_states", JointState, on_joint_states)
        self.addCleanup(subscriber.unregister)
        source, limits = random.Random(1), read_limits()
        for number in range(SPOILT):
            here = dict(zip(KNOWN_JOINTS, client.here(KNOWN_JOINTS), strict=True))
            kind, names, rows, _ = spoilt_goal(source, number, limits, here)
            goal = client.send(joint_trajectory(names, [row[0] for row in rows], [row[1] for row in rows]))
            self.assertTrue(goal.wait(DEADLINE_S), "goal %d did not end" % number)
            status, text, _ = goal.outcome()
            self.assertEqual(status, GoalStatus.REJECTED, "goal %d: %s" % (number, kind))
            self.assertIn(WORDS[kind], text)
        self.assertGreater(len(reports), 10)
        self.assertLess(farthest.max(), STILL)
        print("farthest joint moved by %.6f rad" % farthest.max())

    def test_3_stop_and_disable_end_a_move_gently(self):
        client = self.ready_client()
        stop = rospy.Publisher("/robot/set_super_stop", Empty, queue_size=1)
        enable = rospy.Publisher("/robot/set_super_enable", Bool, queue_size=1)
        wait_until(lambda: stop.get_num_connections() and enable.get_num_connections(), "the robot to listen")
        robot = client.streamer.robot
        joint = ["right_e1"]
        for interrupt, word in ((lambda: stop.publish(Empty()), "stopped"),
                                (lambda: enable.publish(Bool(data=False)), "not enabled")):
            begin = client.here(joint)[0]
            way = -0.8 if begin > 1.2 else 0.8
            goal = client.send(joint_trajectory(joint, [0.0, 4.0], [[begin], [begin + way]]))
            wait_until(lambda: abs(client.here(joint)[0] - begin) > 0.2, "the arm to move")  # noqa: B023
            interrupt()
            wait_until(robot.why_not_ready, "the robot to stop")
            at = client.here(joint)[0]
            self.assertTrue(goal.wait(DEADLINE_S))
            status, text, _ = goal.outcome()
            self.assertEqual(status, GoalStatus.ABORTED)
            self.assertIn(word, text)
            subprocess.run(["rosrun", "baxter_tools", "enable_robot.py", "-r"], check=True, timeout=DEADLINE_S)
            subprocess.run(["rosrun", "baxter_tools", "enable_robot.py", "-e"], check=True, timeout=DEADLINE_S)
            wait_until(lambda: not robot.why_not_ready(), "the robot to be enabled")
            # Neither the stop nor being enabled again made the arm jump.
            self.assertLess(abs(client.here(joint)[0] - at), COASTING)

    def test_4_speed_ratio_does_not_throttle_a_goal(self):
        client = self.ready_client()
        ratio = rospy.Publisher("/robot/limb/left/set_speed_ratio", Float64, queue_size=1)
        wait_until(ratio.get_num_connections, "the robot to listen")
        ratio.publish(0.05)
        begin = client.here(["left_e1"])[0]
        # At 0.05 of 1.5 rad/s this would take 11 s, and 4 s are allowed.
        goal = client.send(joint_trajectory(["left_e1"], [2.0], [[begin - 0.8]]))
        self.assertTrue(goal.wait(DEADLINE_S))
        status, text, _ = goal.outcome()
        self.assertEqual(status, GoalStatus.SUCCEEDED, text)
        self.assertAlmostEqual(client.here(["left_e1"])[0], begin - 0.8, delta=TOLERANCE)

    def ready_client(self):
        self.start("baxter_traj_streamer", "traj_interpolator_as")
        subprocess.run(["rosrun", "baxter_tools", "enable_robot.py", "-e"], check=True, timeout=DEADLINE_S)
        client = TrajClient()
        client.wait_until_ready()
        return client

    def arrives(self, measured, pose):
        wait_until(lambda: np.abs(np.subtract(measured(), pose)).max() <= TOLERANCE, "pose %s" % pose)
        print("farthest joint is off by %.5f rad" % np.abs(np.subtract(measured(), pose)).max())


if __name__ == "__main__":
    import rostest

    rospy.init_node("traj_streamer_world_rostest")
    rostest.rosrun("baxter_traj_streamer", "traj_streamer_world", TrajInTheWorldTest)
